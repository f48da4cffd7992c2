//! The configuration of XCP: a file that `--xcp` names.
//!
//! ```toml
//! key = "c0ffee…"              # 16 to 64 bytes in hexadecimal; without it nothing can be written
//! daq_packets_per_cycle = 1    # 1 to 4; the bus has one in reserve, for all controllers together
//! ```

use serde::Deserialize;
use settings::parameters::Parameter;
use std::path::{Path, PathBuf};

const KEY_BYTES: std::ops::RangeInclusive<usize> = 16..=64;

static DAQ_PACKETS: Parameter = Parameter::new(
    ("daq_packets_per_cycle", "packets"),
    [1.0, 4.0],
    1.0,
    "DAQ packets that may leave in a cycle",
)
.whole();

/// A configuration that cannot be used: the file, and what is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ConfigError(String);

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct XcpConfig {
    /// Secret of the write protection; `None`: nothing can be written.
    pub key: Option<Vec<u8>>,
    /// DAQ packets that may leave in a cycle.
    pub daq_packets_per_cycle: u32,
}

impl Default for XcpConfig {
    fn default() -> Self {
        Self { key: None, daq_packets_per_cycle: 1 }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    key: Option<String>,
    daq_packets_per_cycle: Option<f64>,
}

impl XcpConfig {
    /// What the command line asks for: `None` without `--xcp`, the defaults without a file.
    pub fn asked(asked: Option<&Option<PathBuf>>) -> Result<Option<Self>, ConfigError> {
        match asked {
            None => Ok(None),
            Some(None) => Ok(Some(Self::default())),
            Some(Some(path)) => Self::read(path).map(Some),
        }
    }

    /// Reads the file.
    ///
    /// # Errors
    /// [`ConfigError`] when it cannot be read, is no TOML of this form, or holds a value that is not allowed.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| ConfigError(format!("cannot read {}: {error}", path.display())))?;
        Self::from_toml(&text).map_err(|problem| ConfigError(format!("{}: {problem}", path.display())))
    }

    /// The configuration in a text.
    ///
    /// # Errors
    /// What is wrong; never what the key is.
    pub fn from_toml(text: &str) -> Result<Self, String> {
        // The library shows the line that is wrong, which may be the key's.
        let File { key, daq_packets_per_cycle } =
            toml::from_str(text).map_err(|error: toml::de::Error| {
                let line = settings::line_of(text, error.span().map_or(0, |span| span.start));
                format!("line {line}: {}", error.message())
            })?;
        let packets = DAQ_PACKETS
            .check(daq_packets_per_cycle.unwrap_or(DAQ_PACKETS.default))
            .map_err(|error| error.to_string())?;
        let key = key.map(|key| bytes(&key)).transpose()?;
        Ok(Self { key, daq_packets_per_cycle: packets as u32 })
    }
}

fn bytes(hexadecimal: &str) -> Result<Vec<u8>, String> {
    let (least, most) = (KEY_BYTES.start(), KEY_BYTES.end());
    let wrong = || {
        format!(
            "key: {} characters; allowed are {least} to {most} bytes in hexadecimal, two digits each; \
             'openssl rand -hex 32' makes a good one",
            hexadecimal.chars().count()
        )
    };
    if !hexadecimal.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err(wrong());
    }
    let byte = |at: usize| u8::from_str_radix(hexadecimal.get(at..at + 2)?, 16).ok();
    let bytes: Option<Vec<u8>> = (0..hexadecimal.len()).step_by(2).map(byte).collect();
    bytes.filter(|bytes| KEY_BYTES.contains(&bytes.len())).ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "000102030405060708090a0b0c0d0e0fF0";

    #[test]
    fn a_key_is_read_and_what_is_left_out_takes_its_default() {
        let config = XcpConfig::from_toml(&format!("key = \"{KEY}\"\n")).unwrap();
        assert_eq!(config.key.unwrap()[14..], [14, 15, 0xF0]);
        assert_eq!(config.daq_packets_per_cycle, 1);
        assert_eq!(XcpConfig::from_toml(""), Ok(XcpConfig::default()));
        assert_eq!(XcpConfig::from_toml("daq_packets_per_cycle = 3").unwrap().daq_packets_per_cycle, 3);
    }

    #[test]
    fn what_is_wrong_is_told_and_the_key_is_not() {
        let bad = "c0ffeec0ffeec0ffeec0ffeec0ffeezz";
        for (text, words) in [
            (format!("key = \"{bad}\""), "two digits each"),
            (format!("key = \"{}\"", &KEY[..31]), "31 characters"),
            ("key = \"c0ff\"".into(), "16 to 64 bytes"),
            ("daq_packets_per_cycle = 5".into(), "1 to 4"),
            ("daq_packets_per_cycle = 1.5".into(), "a whole number"),
            (format!("daq_packets_per_cycle = 1\nkey = {bad}"), "line 2"),
            (format!("kye = \"{bad}\""), "kye"),
        ] {
            let problem = XcpConfig::from_toml(&text).unwrap_err();
            assert!(problem.contains(words) && !problem.contains("c0ffee"), "{text}: {problem}");
        }
    }
}
