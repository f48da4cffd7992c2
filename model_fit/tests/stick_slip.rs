//! Dry friction that sticks and slips, in records of another integrator: a mass that a spring pulls over a table.

use crate::closing::{self, file, named, random};
use model_fit::{ClosedModel, Search, Verdict};
use std::fmt::Write as _;
use std::fs;

const MASS_KG: f64 = 2.0;
const STIFFNESS_N_PER_M: f64 = 800.0;
const SLIDING_N: f64 = 3.0;
const BREAKAWAY_N: f64 = 4.5;

/// The other end of the spring, m.
fn pulled_m(time_s: f64) -> f64 {
    let turns = std::f64::consts::TAU * time_s;
    0.03 * (turns / 9.0).sin() + 0.01 * (turns / 2.7).sin()
}

/// 8 s at 50 Hz, by time stepping with impulses: a step of 20 us ends at rest where friction can bring it there. The position is
/// measured to 20 um.
fn record(mut seed: u64) -> String {
    const STEP_S: f64 = 2e-5;
    let [mut x, mut v] = [0.0_f64, 0.0_f64];
    let mut text = "t_s,end_m,x_m\n".to_owned();
    let shift_s = if seed == 1 { 0.0 } else { 4.0 };
    for row in 0..400_u32 {
        let time_s = f64::from(row) * 0.02;
        let end = pulled_m(time_s + shift_s) - pulled_m(shift_s);
        let noise: f64 = (0..12).map(|_| random(&mut seed)).sum();
        let _ = writeln!(text, "{time_s},{end},{}", x + 2e-5 * noise);
        let next = pulled_m(time_s + 0.02 + shift_s) - pulled_m(shift_s);
        for step in 0..1000_u32 {
            let share = (f64::from(step) + 0.5) / 1000.0;
            let spring = STIFFNESS_N_PER_M * (end + share * (next - end) - x);
            let free = v + STEP_S * spring / MASS_KG;
            let size = if v == 0.0 { BREAKAWAY_N } else { SLIDING_N };
            let brake = STEP_S * SLIDING_N / MASS_KG;
            v = if free.abs() <= STEP_S * size / MASS_KG { 0.0 } else { free - brake.copysign(free) };
            x += STEP_S * v;
        }
    }
    text
}

const PULLED: &str = r#"
[fit]
starts = 60
[inputs.end_m]
unit = "m"
hold = "linear"
[parameters]
mass = { unit = "kg", value = 2, fixed = true }
stiffness = { unit = "N/m", value = 780, tolerance = 40 }
[states.x]
unit = "m"
start = 0
derivative = "v"
[states.v]
unit = "m/s"
start = 0
derivative = "(stiffness*(end_m - x) - rubbing)/mass"
[outputs.x_m]
unit = "m"
value = "x"
"#;

fn closed(rest: &str) -> (ClosedModel, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let model = format!("{PULLED}{rest}");
    let search = Search::MoreThanNoise;
    (closing::closed(folder.path(), ("pulled.toml", &model), [1, 2].map(record), search), folder)
}

/// A number of the report and its standard error.
fn number(found: &ClosedModel, name: &str) -> [f64; 2] {
    let number = closing::number(&found.report, name);
    [number.value, number.standard_error.unwrap_or_else(|| panic!("{number:?}"))]
}

#[test]
fn a_fit_recovers_sliding_and_break_away_force_from_another_integrators_record() {
    let (found, _) = closed(
        r#"
[define]
rubbing = "rub"
[friction.rub]
unit = "N"
velocity = "v"
sliding = "sliding"
breakaway = "breakaway"
[parameters.sliding]
unit = "N"
value = 2.5
range = [0, 100]
[parameters.breakaway]
unit = "N"
value = 4
range = [0, 100]
"#,
    );
    for (name, expected) in
        [("stiffness", STIFFNESS_N_PER_M), ("sliding", SLIDING_N), ("breakaway", BREAKAWAY_N)]
    {
        let [value, error] = number(&found, name);
        assert!(
            (value - expected).abs() < 1.645 * error && error < 0.05 * expected,
            "{name}: {value} ± {error}"
        );
    }
}

#[test]
fn a_hidden_stick_slip_is_named_against_viscous_friction_and_goes_into_the_file() {
    let (found, folder) = closed(
        r#"
[define]
rubbing = "viscous*v"
[parameters.viscous]
unit = "N s/m"
value = 5
range = [0, 1000]
[[suspects]]
use = "friction/stick-slip"
place = "rubbing"
with.v = "v"
parameters.sliding = { value = [5, 1], range = [0, 20] }
parameters.excess = { value = [2, 0.5], range = [0, 20] }
[[suspects]]
name = "by-direction"
use = "friction/viscous-by-direction"
place = "rubbing"
with.v = "v"
"#,
    );
    let report = &found.report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::Named, Some(true)), "{}", report.headline);
    assert_eq!(named(report), ["stick-slip"], "{}", report.headline);
    let [sliding, excess] = ["sliding", "excess"].map(|name| number(&found, name)[0]);
    assert!((sliding - SLIDING_N).abs() < 0.1 && (excess - BREAKAWAY_N + SLIDING_N).abs() < 0.15);
    // The extended file is read, explained, and has nothing missing.
    let text = model_fit::extended(
        &fs::read_to_string(folder.path().join("pulled.toml")).unwrap(),
        folder.path(),
        report,
    )
    .unwrap();
    let path = file(folder.path(), "extended.toml", &text);
    let words = model_fit::explain(&path, &[]).unwrap();
    let said = "force = sliding against v, which it holds at rest up to sliding + excess";
    assert!(words.contains(said), "{words}");
}
