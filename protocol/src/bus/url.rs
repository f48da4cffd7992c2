//! Names of buses: `can://IFACE` and `unix:///PATH?bitrate=1000000&loss=0.01&seed=1`.
//!
//! The options after `?` describe the wire of the embedded bus and count for its host alone; a peer that
//! only connects carries them without effect. Without `bitrate` the wire takes no time, and has no errors.

use super::host_report::FramesById;
use crate::can::{EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK};
use crate::wire_time::{FASTEST_BITS_PER_S, SLOWEST_BITS_PER_S, WireTiming};
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
        /// Options of the host's wire.
        wire: WireOptions,
    },
}

/// Options of the wire of the embedded bus: loss, seed, timing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireOptions {
    /// Probability that a frame is lost for everyone, 0 to 1.
    pub loss: f64,
    /// Seed of the wire's random numbers.
    pub seed: u64,
    /// How the wire keeps time; `None` for one that takes none.
    pub timing: Option<WireTiming>,
}

/// Error in a bus URL.
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
    #[error(
        "bus option '{0}' is none of loss=0..1, seed=0..18446744073709551615, bitrate=10000..1000000, and with a bitrate: \
         error_rate=0..1, errors_id=000..7FF (or 8 digits), errors_from_ms=N, errors_to_ms=N, restart_ms=0..60000"
    )]
    Option(String),
    /// An option that only a wire with a bit rate has.
    #[error("bus option '{0}' needs a bus with a bit rate: add bitrate=1000000")]
    NeedsBitRate(String),
}

/// Longest time that a bus-off node may be asked to wait, ms.
const LONGEST_RESTART_MS: u32 = 60_000;

/// Longest name of a bus, bytes.
pub const LONGEST_NAME: usize = 64;

/// Longest path that fits `sockaddr_un` with its closing zero.
const LONGEST_SOCKET_PATH: usize = 107;
/// `IFNAMSIZ` less the closing zero.
const LONGEST_INTERFACE: usize = 15;

impl BusUrl {
    /// The name by which clients open the bus: the interface, or the file name of the socket. None when it is longer than
    /// [`LONGEST_NAME`], or has a character that is not printable ASCII, or `<` or `>`, which delimit socketcand's messages.
    #[must_use]
    pub fn name(&self) -> Option<String> {
        let name = match self {
            Self::Can { interface } => interface.clone(),
            Self::Unix { path, .. } => path.file_name()?.to_str()?.to_owned(),
        };
        let is_writable = |c: char| c.is_ascii_graphic() && c != '<' && c != '>';
        (name.len() <= LONGEST_NAME && name.chars().all(is_writable)).then_some(name)
    }

    /// The interface; none of an embedded bus.
    #[must_use]
    pub fn interface(&self) -> Option<&str> {
        match self {
            Self::Can { interface } => Some(interface),
            Self::Unix { .. } => None,
        }
    }

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
    // Until a bit rate is given, what is said of its errors is kept with the first option that said it.
    let (mut timing, mut rate_given, mut needs) = (WireTiming::at(FASTEST_BITS_PER_S), false, None);
    for option in options.split('&').filter(|option| !option.is_empty()) {
        let refused = || UrlError::Option(option.into());
        let (key, value) = option.split_once('=').ok_or_else(refused)?;
        match key {
            "loss" => wire.loss = probability(value).ok_or_else(refused)?,
            "seed" => wire.seed = value.parse().map_err(|_| refused())?,
            "bitrate" => {
                let rates = SLOWEST_BITS_PER_S..=FASTEST_BITS_PER_S;
                timing.bits_per_s =
                    value.parse().ok().filter(|rate| rates.contains(rate)).ok_or_else(refused)?;
                rate_given = true;
            }
            _ => {
                take_timing(&mut timing, key, value).ok_or_else(refused)?;
                needs.get_or_insert(option);
            }
        }
    }
    wire.timing = rate_given.then_some(timing);
    match needs.filter(|_| !rate_given) {
        Some(option) => Err(UrlError::NeedsBitRate(option.into())),
        None => Ok(wire),
    }
}

fn probability(value: &str) -> Option<f64> {
    value.parse().ok().filter(|probability| (0.0..=1.0).contains(probability))
}

/// An option of a wire that keeps time; `None` when it is none, or out of range.
fn take_timing(timing: &mut WireTiming, key: &str, value: &str) -> Option<()> {
    match key {
        "error_rate" => timing.error_rate = probability(value)?,
        "errors_id" => timing.errors_id = Some(identifier(value)?),
        "errors_from_ms" => timing.errors_from_ms = value.parse().ok()?,
        "errors_to_ms" => timing.errors_to_ms = Some(value.parse().ok()?),
        "restart_ms" => {
            timing.restart_ms = value.parse().ok().filter(|restart_ms| *restart_ms <= LONGEST_RESTART_MS)?;
        }
        _ => return None,
    }
    Some(())
}

/// An identifier as candump writes it: eight digits for 29 bits.
fn identifier(value: &str) -> Option<u32> {
    let id = u32::from_str_radix(value, 16).ok()?;
    let (most, flag) = if value.len() == 8 { (EXTENDED_MASK, EXTENDED_FLAG) } else { (STANDARD_MASK, 0) };
    (id <= most).then_some(id | flag)
}

impl fmt::Display for WireOptions {
    /// Options that differ from the default, as a URL has them after the path.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut options = Vec::new();
        if let Some(timing) = &self.timing {
            let usual = WireTiming::at(timing.bits_per_s);
            options.push(format!("bitrate={}", timing.bits_per_s));
            if timing.error_rate > 0.0 {
                options.push(format!("error_rate={}", timing.error_rate));
            }
            if let Some(id) = timing.errors_id {
                let id = if id & EXTENDED_FLAG == 0 {
                    FramesById::name_of(id)
                } else {
                    format!("{:08X}", id & EXTENDED_MASK)
                };
                options.push(format!("errors_id={id}"));
            }
            if timing.errors_from_ms != usual.errors_from_ms {
                options.push(format!("errors_from_ms={}", timing.errors_from_ms));
            }
            if let Some(to_ms) = timing.errors_to_ms {
                options.push(format!("errors_to_ms={to_ms}"));
            }
            if timing.restart_ms != usual.restart_ms {
                options.push(format!("restart_ms={}", timing.restart_ms));
            }
        }
        if self.loss > 0.0 {
            options.push(format!("loss={}", self.loss));
        }
        if self.seed != 0 {
            options.push(format!("seed={}", self.seed));
        }
        if options.is_empty() { Ok(()) } else { write!(f, "?{}", options.join("&")) }
    }
}

impl fmt::Display for BusUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Can { interface } => write!(f, "can://{interface}"),
            Self::Unix { path, wire } => write!(f, "unix://{}{wire}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_survive_being_written_and_read() {
        for text in [
            "can://vcan0",
            "unix:///tmp/a/bus0",
            "unix:///tmp/bus0?loss=0.25&seed=7",
            "unix:///tmp/bus0?bitrate=500000",
            "unix:///b?bitrate=1000000&error_rate=0.125&errors_id=110&errors_from_ms=5&errors_to_ms=9&restart_ms=0&seed=3",
            "unix:///b?bitrate=1000000&errors_id=00000110",
        ] {
            assert_eq!(text.parse::<BusUrl>().unwrap().to_string(), text);
        }
        let url = BusUrl::default_embedded();
        assert_eq!(url.to_string().parse(), Ok(url));
    }

    #[test]
    fn without_an_absolute_runtime_folder_the_default_bus_is_in_a_folder_of_the_users_own() {
        assert_eq!(default_folder(Some("/run/user/7".into())), PathBuf::from("/run/user/7/airbench"));
        let folder = default_folder(None);
        assert!(folder.is_absolute() && folder != std::env::temp_dir(), "{}", folder.display());
        for none in ["", "relative"] {
            assert_eq!(default_folder(Some(none.into())), folder, "XDG_RUNTIME_DIR={none:?}");
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
            ("unix:///b?bitrate=9999", "bitrate=10000..1000000"),
            ("unix:///b?bitrate=1000001", "bitrate=10000..1000000"),
            ("unix:///b?bitrate=1000000&error_rate=2", "error_rate=0..1"),
            ("unix:///b?bitrate=1000000&errors_id=800", "errors_id=000..7FF"),
            ("unix:///b?bitrate=1000000&restart_ms=60001", "restart_ms=0..60000"),
            ("unix:///b?error_rate=0.1", "add bitrate=1000000"),
        ] {
            let message = text.parse::<BusUrl>().unwrap_err().to_string();
            assert!(message.contains(hint), "{text}: {message}");
        }
    }
}
