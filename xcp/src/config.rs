//! The configuration of XCP: a file that `--xcp` names.
//!
//! ```toml
//! key = "c0ffee…"              # 16 to 64 bytes in hexadecimal; without it nothing can be written
//! daq_packets_per_cycle = 1    # 1 to 4; the bus has one in reserve, for all controllers together
//! ```

use settings::parameters::Parameter;
use settings::{SettingsError, Source};
use std::path::{Path, PathBuf};

const KEY_BYTES: std::ops::RangeInclusive<usize> = 16..=64;

static DAQ_PACKETS: Parameter = Parameter::new(
    ("daq_packets_per_cycle", "packets"),
    [1.0, 4.0],
    1.0,
    "DAQ packets that may leave in a cycle",
)
.whole();

/// Write protection and DAQ rate of all XCP ports of a controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct XcpConfig {
    /// Secret of the write protection, 16 to 64 bytes; `None`: nothing can be written.
    pub key: Option<Vec<u8>>,
    /// DAQ packets that a port may send in a cycle, 1 to 4.
    pub daq_packets_per_cycle: u32,
}

impl Default for XcpConfig {
    fn default() -> Self {
        Self { key: None, daq_packets_per_cycle: 1 }
    }
}

impl XcpConfig {
    /// The configuration for the option `--xcp [FILE]`: `None` without the option, the defaults without a file.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML of this form, or holds a value that is not allowed.
    pub fn from_option(option: Option<&Option<PathBuf>>) -> Result<Option<Self>, SettingsError> {
        match option {
            None => Ok(None),
            Some(None) => Ok(Some(Self::default())),
            Some(Some(path)) => {
                let text = std::fs::read_to_string(path);
                let text = text.map_err(|error| SettingsError::unreadable(path, &error))?;
                Self::from_toml(&text, path).map(Some)
            }
        }
    }

    /// The configuration in a text; `file` names it in messages.
    ///
    /// # Errors
    /// The text is no TOML of this form, or holds a value that is not allowed. The message never contains the key.
    pub fn from_toml(text: &str, file: &Path) -> Result<Self, SettingsError> {
        let source = Source::parse_with_secrets(text, file)?;
        let mut root = source.root();
        root.allow(&["key", "daq_packets_per_cycle"])?;
        let key = root.text("key")?.map(|key| bytes(&key.text)).transpose();
        let key = key.map_err(|problem| root.wrong_at("key", &problem))?;
        Ok(Self { key, daq_packets_per_cycle: root.whole_or_default(&DAQ_PACKETS)? })
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

    fn parse(text: &str) -> Result<XcpConfig, SettingsError> {
        XcpConfig::from_toml(text, Path::new("xcp.toml"))
    }

    #[test]
    fn a_key_is_read_and_what_is_left_out_takes_its_default() {
        let config = parse(&format!("key = \"{KEY}\"\n")).unwrap();
        assert_eq!(config.key.unwrap()[14..], [14, 15, 0xF0]);
        assert_eq!(config.daq_packets_per_cycle, 1);
        assert_eq!(parse(""), Ok(XcpConfig::default()));
        assert_eq!(parse("daq_packets_per_cycle = 3").unwrap().daq_packets_per_cycle, 3);
    }

    #[test]
    fn a_bad_file_is_refused_and_the_key_is_not_printed() {
        let bad = "c0ffeec0ffeec0ffeec0ffeec0ffeezz";
        for (text, words) in [
            (format!("key = \"{bad}\""), "two digits each"),
            (format!("key = \"{}\"", &KEY[..31]), "31 characters"),
            ("key = \"c0ff\"".into(), "16 to 64 bytes"),
            ("daq_packets_per_cycle = 5".into(), "1 to 4"),
            ("daq_packets_per_cycle = 1.5".into(), "a whole number"),
            (format!("daq_packets_per_cycle = 1\nkey = {bad}"), "xcp.toml:2: "),
            (format!("daq_packets_per_cycle = \"{bad}\""), "allowed is a number, 1 to 4"),
            ("key = 12345678123456781234567812345678".into(), "allowed is a text"),
            (format!("kye = \"{bad}\""), "kye"),
        ] {
            let problem = parse(&text).unwrap_err().to_string();
            let hides = ["c0ffee", "12345678"].iter().all(|secret| !problem.contains(secret));
            assert!(problem.contains(words) && hides, "{text}: {problem}");
            assert!(problem.starts_with("xcp.toml:"), "{text}: {problem}");
        }
    }
}
