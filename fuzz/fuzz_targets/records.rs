//! Records of the discrepancy workflow: a measurement.csv, a log, or a foreign CSV with its mapping, distinguished by the first
//! byte.
//!
//! `m` a measurement, `l` a log, `f` a mapping, a line `---`, and its CSV.
#![no_main]

use records::{Mapping, ReadOptions, UnlistedColumns};
use libfuzzer_sys::fuzz_target;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else { return };
    match kind {
        b'm' => {
            for unknown in [UnlistedColumns::Ignored, UnlistedColumns::Refused] {
                let options = ReadOptions { unknown, ..ReadOptions::default() };
                reported(records::read(&written("measurement.csv", rest), &options));
            }
        }
        b'l' => reported(records::read(&written("bus.log", rest), &ReadOptions::default())),
        b'f' => {
            let text = String::from_utf8_lossy(rest);
            let (mapping, table) = text.split_once("\n---\n").unwrap_or((&text, ""));
            if let Ok(mapping) = Mapping::from_toml(mapping, Path::new("mapping.toml")) {
                reported(records::read_mapped(&written("foreign.csv", table.as_bytes()), &mapping));
            }
        }
        _ => {}
    }
});

fn reported(read: Result<records::Record, records::ReadError>) {
    match read {
        Ok(record) => {
            for channel in record.channels() {
                let values = record.channel(channel).expect("it says that it has it");
                assert_eq!(values.len(), record.len());
                assert!(values.iter().flatten().all(|value| value.is_finite()), "{channel}");
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A file of this process with these bytes.
fn written(name: &str, bytes: &[u8]) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("airbench-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
        folder
    });
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    path
}
