//! Parameter sets and the configuration of XCP: any text is refused with a message, or holds nothing that is out of its range.
#![no_main]

use axis_control::parameter_set;
use axis_control::program::file::Source;
use xcp::config::XcpConfig;
use libfuzzer_sys::fuzz_target;
use plant::{Axis, RigParameters};
use std::path::Path;
use std::sync::OnceLock;

fuzz_target!(|text: &str| {
    static RIG: OnceLock<RigParameters> = OnceLock::new();
    let rig = RIG.get_or_init(RigParameters::baseline);
    let lines = text.matches('\n').count() + 1;
    match parameter_set::parse(text, Path::new("set.toml")) {
        Ok(settings) => {
            let program = Source::shut().program(Axis::Drive, rig, false);
            let mut program = program.expect("it holds a valve shut");
            for setting in settings {
                let line = setting.place.strip_prefix("set.toml:").and_then(|rest| rest.strip_suffix(": "));
                let line: usize = line.expect("a file and a line").parse().expect("a number");
                assert!((1..=lines).contains(&line), "{}", setting.place);
                if let Some(place) = program.place(&setting.name)
                    && program.set(place, setting.value).is_ok()
                {
                    assert!(setting.value.is_finite(), "{setting:?}");
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    match XcpConfig::from_toml(text, Path::new("xcp.toml")) {
        Ok(config) => {
            assert!((1..=4).contains(&config.daq_packets_per_cycle));
            assert!(config.key.is_none_or(|key| (16..=64).contains(&key.len())));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
