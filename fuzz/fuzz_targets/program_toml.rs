//! Program files: any text is refused, or makes a program of either axis that controls without a panic.
#![no_main]

use axis_control::program::file::Source;
use axis_control::program::{ActiveAlgorithm, Demand};
use axis_control::set_point::{ForceSetPoint, SetPoint};
use libfuzzer_sys::fuzz_target;
use plant::{Axis, RigParameters};
use protocol::frames::Sensors;
use std::sync::OnceLock;

/// Cycles that a program is run for.
const CYCLES: u64 = 4;

fuzz_target!(|text: &str| {
    static RIG: OnceLock<RigParameters> = OnceLock::new();
    let rig = RIG.get_or_init(RigParameters::baseline);
    let source = Source { path: "program.toml".into(), title: String::new(), text: text.into() };
    let Ok(fixed_settings) = source.fixed_settings() else { return };
    // A library is another process's trial; the target `plugin` looks into that.
    if fixed_settings.keys().any(|key| key.ends_with(".library")) {
        return;
    }
    for axis in Axis::ALL {
        let demand = Demand { position: SetPoint::at_rest(0.3), force: ForceSetPoint::at_rest(50.0) };
        let Ok(mut program) = source.program(axis, rig, false) else { continue };
        for cycle in 0..CYCLES {
            program.observe(cycle, &Sensors { position_m: 0.25, ..Sensors::default() }, 7e5);
            // A fault of the algorithm is an answer; a panic is none.
            let _ = program.control(cycle, &demand, ActiveAlgorithm::User);
        }
    }
});
