//! Rig files: any text is refused with a message, or makes a plant that moves and stays finite; also as a file of effects, and of
//! suspects, each in the rig with its numbers at an end of their ranges.
#![no_main]

use libfuzzer_sys::fuzz_target;
use plant::parameters::suspects;
use plant::{Inputs, Plant, RigParameters, Setup};
use std::sync::OnceLock;

/// Periods that a plant is moved by.
const PERIODS: usize = 3;
/// Suspects of a file that are put into the rig.
const MOST: usize = 4;

fuzz_target!(|text: &str| {
    static BASELINE: OnceLock<RigParameters> = OnceLock::new();
    if let Ok(rig) = RigParameters::from_toml(text, "rig.toml") {
        moves(&rig);
    }
    let baseline = BASELINE.get_or_init(RigParameters::baseline);
    if let Ok(rig) = baseline.with_effects_of(text, "effects.toml") {
        moves(&rig);
    }
    for suspect in suspects(text, "suspects.toml").into_iter().flatten().take(MOST) {
        for end in 0..2 {
            let ends: Vec<f64> = suspect.numbers().iter().map(|number| number.range[end]).collect();
            if let Ok(term) = suspect.with(&ends) {
                moves(&baseline.with_term(&term));
            }
        }
    }
});

fn moves(rig: &RigParameters) {
    let setup = Setup { carriage_position_m: rig.cylinder().stroke_m / 2.0, ..Setup::default() };
    let mut plant = Plant::new(rig, &setup).expect("half of the stroke lies within it");
    for _ in 0..PERIODS {
        plant.step(&Inputs { valve: [1.0, -1.0], ..Inputs::default() });
    }
    assert!(plant.state().is_finite(), "{:?}", plant.state());
}
