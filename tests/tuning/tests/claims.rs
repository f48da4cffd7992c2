//! What airbench claims of its shipped programs, held in rehearsal: Fig. 8, Fig. 9, better than the paper, margins.
//!
//! The tables behind it: `controller/docs/gains.md`, `controller/docs/better-than-the-paper.md`.

use axis_control::program::file::Source;
use plant::{Axis, RigParameters};
use std::path::Path;
use tuning::Trial;
use tuning::cases::{Case, CaseSpec, figures};
use tuning::position::{EXCITATION, attempt};

/// Corners that margins are held in, kg and bar: nominal, light and weak, heavy and strong.
const CORNERS: [(f64, f64); 3] = [(0.0, 7.0), (0.0, 5.0), (20.0, 8.0)];

fn case(spec: &CaseSpec) -> Case {
    Case::new(spec).unwrap()
}

fn rehearsed(spec: &CaseSpec) -> impl Fn(&str) -> f64 + use<> {
    let run = case(spec).run(&Trial::default()).unwrap();
    assert!(run.done, "{} came to no end", spec.experiment);
    let figure = figures(&run);
    move |name| figure(name).unwrap_or_else(|| panic!("{name} is absent"))
}

fn positioning(drive: &str) -> impl Fn(&str) -> f64 + use<> {
    rehearsed(&CaseSpec { experiment: "point-to-point", drive: Some(drive), ..CaseSpec::default() })
}

fn load_step<'a>(load: &'a str, set: &'a [String]) -> CaseSpec<'a> {
    CaseSpec { experiment: "load-step", load: Some(load), set, ..CaseSpec::default() }
}

/// The paper's words for Fig. 9 that a run breaks.
fn broken_of_fig_9(figure: impl Fn(&str) -> f64) -> Vec<&'static str> {
    let words = [
        ("settles in 70 to 130 ms", (0.07..=0.13).contains(&figure("force_settling_s"))),
        ("overshoots by at most 5 %", figure("force_overshoot_ratio") <= 0.05),
        ("is aperiodic", figure("force_aperiodic") == 1.0),
        ("the drive nearly stops", figure("drive_speed_ratio_least") <= 0.1),
        ("the error passes 10 mm", figure("position_error_peak_after_step_m") >= 0.01),
        ("and is evened out", figure("position_error_recovered_s") <= 1.5),
        ("nothing moves at rest", figure("position_rest_peak_to_peak_smoothed_m") <= 2e-4),
    ];
    words.into_iter().filter(|(_, kept)| !kept).map(|(word, _)| word).collect()
}

#[test]
fn fig_8_with_the_papers_program() {
    let figure = positioning("position-p");
    let (dynamic_m, static_m) = (figure("position_error_dynamic_m"), figure("position_error_static_m"));
    assert!(dynamic_m <= 4e-3 && static_m <= 4e-4, "{dynamic_m} m, {static_m} m");
    assert_eq!(figure("position_error_maxima"), 2.0);
    assert!(figure("position_rest_peak_to_peak_smoothed_m") <= 2e-4);
}

#[test]
fn the_cascade_at_least_halves_the_errors_of_p() {
    let (p, cascade) = (positioning("position-p"), positioning("position-cascade"));
    for name in ["position_error_dynamic_m", "position_error_rms_m", "position_error_static_m"] {
        assert!(cascade(name) <= 0.5 * p(name), "{name}: {} of {}", cascade(name), p(name));
    }
}

#[test]
fn fig_9_with_the_map() {
    let broken = broken_of_fig_9(rehearsed(&load_step("force-pid-map", &[])));
    assert!(broken.is_empty(), "{broken:?}");
}

#[test]
fn fig_9_with_the_papers_two_laws_and_a_soft_drive() {
    let drive = Some("position-paper-linked");
    let broken = broken_of_fig_9(rehearsed(&CaseSpec { drive, ..load_step("force-paper-linked", &[]) }));
    assert!(broken.is_empty(), "{broken:?}");
}

#[test]
fn the_map_at_least_halves_the_settling_of_p_with_the_same_drive() {
    let settling_s = |load| rehearsed(&load_step(load, &[]))("force_settling_s");
    let (p_s, map_s) = (settling_s("force-p"), settling_s("force-pid-map"));
    assert!(map_s <= 0.5 * p_s, "{map_s} s of {p_s} s");
}

#[test]
fn twice_the_loop_leaves_the_map_still() {
    let case = case(&load_step("force-pid-map", &[]));
    for (added_mass_kg, supply_bar) in CORNERS {
        let trial = Trial { added_mass_kg, supply_bar, loop_factor: 2.0, ..Trial::default() };
        let oscillation = case.run(&trial).unwrap().oscillation();
        assert!(oscillation.is_still(), "{trial:?}: {oscillation:?}");
    }
}

#[test]
fn twice_the_loop_leaves_the_cascade_still() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../controller/programs/position-cascade.toml");
    let source = Source::read(&path).unwrap();
    for (added_mass_kg, supply_bar) in CORNERS {
        let trial = Trial { added_mass_kg, supply_bar, loop_factor: 2.0, ..Trial::default() };
        let program = source.program(Axis::Drive, &RigParameters::baseline(), false).unwrap();
        let figures = attempt(program, EXCITATION, &trial).unwrap();
        assert!(figures.is_still(), "{trial:?}: {figures:?}");
    }
}

#[test]
fn wrong_gains_break_the_claims() {
    let set = |text: &str| [text.to_owned()];
    let slow = set("load.algorithm.gain_per_s=50");
    let broken = broken_of_fig_9(rehearsed(&load_step("force-pid-map", &slow)));
    assert!(broken.contains(&"settles in 70 to 130 ms"), "{broken:?}");
    let trial = Trial { added_mass_kg: 20.0, supply_bar: 8.0, loop_factor: 2.0, ..Trial::default() };
    let loud = set("load.algorithm.gain_per_s=400");
    let oscillation = case(&load_step("force-pid-map", &loud)).run(&trial).unwrap().oscillation();
    assert!(!oscillation.is_still(), "{oscillation:?}");
}
