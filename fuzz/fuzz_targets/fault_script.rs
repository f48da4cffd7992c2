//! Scripts of faults: any text is refused with its line, or breaks a rig that still moves and stays finite.
#![no_main]

use emulator::faults::overlay::{Overlay, on_wire};
use emulator::faults::script::FaultScript;
use libfuzzer_sys::fuzz_target;
use plant::{Inputs, Plant, RigParameters, Setup};
use std::sync::OnceLock;

/// Periods that a broken plant is moved by.
const PERIODS: usize = 3;

fuzz_target!(|text: &str| {
    static RIG: OnceLock<RigParameters> = OnceLock::new();
    let rig = RIG.get_or_init(RigParameters::baseline);
    let lines = text.bytes().filter(|byte| *byte == b'\n').count() + 1;
    let script = match FaultScript::from_toml(text, "faults.toml") {
        Ok(script) => script,
        Err(refused) => {
            let message = refused.to_string();
            let place = message.strip_prefix("faults.toml:").and_then(|rest| rest.split_once(':'));
            let line: usize = place.expect("a file and a line").0.parse().expect("a number");
            assert!((1..=lines).contains(&line), "{message}");
            return;
        }
    };
    let mut overlay = Overlay::default();
    for planned in &script.faults {
        assert!(planned.fault.numbers().all(|(_, number)| number.is_finite()), "{planned:?}");
        let _ = on_wire(&planned.fault);
        overlay.put(&planned.fault, rig);
    }
    let setup = Setup { carriage_position_m: rig.cylinder().stroke_m / 2.0, ..Setup::default() };
    let mut plant = Plant::new(rig, &setup).expect("half of the stroke lies within it");
    plant.set_faults(&overlay.plant);
    for _ in 0..PERIODS {
        plant.step(&Inputs { valve: [1.0, -1.0], ..Inputs::default() });
    }
    assert!(plant.state().is_finite(), "{:?}", plant.state());
});
