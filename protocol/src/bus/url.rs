//! Names of buses: `can://IFACE` and `unix:///PATH?loss=0.01&seed=1`.
//!
//! The options after `?` describe the wire of the embedded bus and count for its host alone; a peer that
//! only connects carries them without effect.

use std::ffi::OsString;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// A bus by name.
#[derive(Clone, Debug, PartialEq)]
pub enum BusUrl {
    /// A SocketCAN interface, hardware or virtual.
    Can {
        /// Interface name, as `ip link` shows it.
        interface: String,
    },
    /// The embedded bus on a Unix socket.
    Unix {
        /// Path of the socket.
        path: PathBuf,
        /// What the host's wire does to frames.
        wire: WireOptions,
    },
}

/// What the wire of the embedded bus does to frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireOptions {
    /// Probability that a frame is lost for everyone, 0 to 1.
    pub loss: f64,
    /// Seed of the wire's random numbers.
    pub seed: u64,
}

/// What is wrong with a bus URL.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrlError {
    /// Neither `can://` nor `unix://`.
    #[error("bus '{0}' is neither can://IFACE nor unix:///PATH")]
    Scheme(String),
    /// Interface names have 1 to 15 bytes.
    #[error("bus '{0}': an interface name has 1 to 15 characters and no '/', as in can://vcan0")]
    Interface(String),
    /// Unix socket addresses hold 107 bytes, and a relative path would change with the folder.
    #[error("bus '{0}': the socket's path must be absolute and at most 107 bytes, as in unix:///tmp/bus0")]
    Path(String),
    /// An option after `?` that is not known, or a value out of range.
    #[error("bus option '{0}' is none of loss=0..1, seed=0..18446744073709551615")]
    Option(String),
}

/// Longest path that fits `sockaddr_un` with its closing zero.
const LONGEST_SOCKET_PATH: usize = 107;
/// `IFNAMSIZ` less the closing zero.
const LONGEST_INTERFACE: usize = 15;

impl BusUrl {
    /// The embedded bus where this user's programs look for it: `$XDG_RUNTIME_DIR/airbench/bus0`, else a folder of
    /// the user's own under the temporary folder.
    #[must_use]
    pub fn default_embedded() -> Self {
        let path = default_folder(std::env::var_os("XDG_RUNTIME_DIR")).join("bus0");
        Self::Unix { path, wire: WireOptions::default() }
    }
}

/// Folder of the default bus. A runtime folder that is empty or relative counts as none, as the XDG specification says.
fn default_folder(runtime: Option<OsString>) -> PathBuf {
    match runtime.map(PathBuf::from).filter(|runtime| runtime.is_absolute()) {
        Some(runtime) => runtime.join("airbench"),
        None => std::env::temp_dir().join(format!("airbench-{}", rustix::process::getuid().as_raw())),
    }
}

impl FromStr for BusUrl {
    type Err = UrlError;

    fn from_str(text: &str) -> Result<Self, UrlError> {
        if let Some(interface) = text.strip_prefix("can://") {
            if interface.is_empty() || interface.len() > LONGEST_INTERFACE || interface.contains('/') {
                return Err(UrlError::Interface(text.into()));
            }
            return Ok(Self::Can { interface: interface.into() });
        }
        let rest = text.strip_prefix("unix://").ok_or_else(|| UrlError::Scheme(text.into()))?;
        let (path, options) = rest.split_once('?').unwrap_or((rest, ""));
        if !path.starts_with('/') || path.len() > LONGEST_SOCKET_PATH {
            return Err(UrlError::Path(text.into()));
        }
        Ok(Self::Unix { path: path.into(), wire: parse_wire(options)? })
    }
}

fn parse_wire(options: &str) -> Result<WireOptions, UrlError> {
    let mut wire = WireOptions::default();
    for option in options.split('&').filter(|option| !option.is_empty()) {
        let refused = || UrlError::Option(option.into());
        match option.split_once('=').ok_or_else(refused)? {
            ("loss", value) => {
                wire.loss = value.parse().ok().filter(|p| (0.0..=1.0).contains(p)).ok_or_else(refused)?;
            }
            ("seed", value) => wire.seed = value.parse().map_err(|_| refused())?,
            _ => return Err(refused()),
        }
    }
    Ok(wire)
}

impl fmt::Display for BusUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Can { interface } => write!(f, "can://{interface}"),
            Self::Unix { path, wire } if *wire == WireOptions::default() => {
                write!(f, "unix://{}", path.display())
            }
            Self::Unix { path, wire } => {
                write!(f, "unix://{}?loss={}&seed={}", path.display(), wire.loss, wire.seed)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_survive_being_written_and_read() {
        for text in ["can://vcan0", "unix:///tmp/a/bus0", "unix:///tmp/bus0?loss=0.25&seed=7"] {
            assert_eq!(text.parse::<BusUrl>().unwrap().to_string(), text);
        }
        let url = BusUrl::default_embedded();
        assert_eq!(url.to_string().parse(), Ok(url));
    }

    #[test]
    fn without_an_absolute_runtime_folder_the_default_bus_is_in_a_folder_of_the_users_own() {
        assert_eq!(default_folder(Some("/run/user/7".into())), PathBuf::from("/run/user/7/airbench"));
        let own = default_folder(None);
        assert!(own.is_absolute() && own != std::env::temp_dir(), "{}", own.display());
        for none in ["", "relative"] {
            assert_eq!(default_folder(Some(none.into())), own, "XDG_RUNTIME_DIR={none:?}");
        }
    }

    #[test]
    fn a_wrong_url_says_what_would_be_right() {
        for (text, hint) in [
            ("vcan0", "can://IFACE"),
            ("can://", "1 to 15"),
            ("can://interface-too-long", "1 to 15"),
            ("unix://relative", "absolute"),
            ("unix:///b?loss=1.5", "loss=0..1"),
            ("unix:///b?loss=NaN", "loss=0..1"),
            ("unix:///b?speed=9", "speed=9"),
        ] {
            let message = text.parse::<BusUrl>().unwrap_err().to_string();
            assert!(message.contains(hint), "{text}: {message}");
        }
    }
}
