//! Model files of one balance, which integrate nothing, on records that are made here.

use crate::closing::{close_with, file, number, random};
use model_fit::{ClosedModel, ModelError, Search, Verdict};
use std::fmt::Write as _;

/// A path that repeats over 2000 samples: position a triangle, speed its sign; noise from a fixed sequence.
fn path() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let mut seed = 1_u64;
    let mut noise = || random(&mut seed);
    let at = |k: usize| (k % 200) as f64 / 100.0;
    let x = (0..2000).map(|k| if at(k) < 1.0 { at(k) } else { 2.0 - at(k) }).collect();
    let v = (0..2000).map(|k| if at(k) < 1.0 { 1.0 } else { -1.0 }).collect();
    (x, v, (0..2000).map(|_| noise()).collect())
}

const STROKES: &str = r#"
[rows.folds]
position = "x"
[inputs.x]
[inputs.v]
[parameters]
offset = { value = 0 }
sliding = { value = 0 }
[outputs.y]
value = "offset + sliding*v"
[[suspects]]
name = "slope"
place = "y"
add = "c*x"
parameters.c = { value = 0 }
[[suspects]]
name = "flipping-slope"
place = "y"
add = "c*x*v"
parameters.c = { value = 0 }
[[suspects]]
name = "drift"
place = "y"
decoy = true
add = "c*t"
parameters.c = { unit = "1/s", value = 0 }
"#;

fn taken(model: &str, target: impl Fn(usize, f64, f64, f64) -> f64) -> (Verdict, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let (x, v, noise) = path();
    let row = |k: usize| format!("{k},{},{},{}\n", x[k], v[k], target(k, x[k], v[k], noise[k]));
    let model = file(folder.path(), "model.toml", model);
    let rows: String = (0..2000).map(row).collect();
    let record = file(folder.path(), "record.csv", &format!("t_s,x,v,y\n{rows}"));
    let report = close_with(&model, (&[record], &[]), Search::Never, &mut |_| {})
        .unwrap_or_else(|error| panic!("{error}"))
        .report;
    (report.verdict, report.named.into_iter().map(|named| named.suspect).collect())
}

#[test]
fn what_is_there_is_taken_and_nothing_else() {
    assert_eq!(taken(STROKES, |_, _, _, noise| noise).0, Verdict::NothingMissing);
    assert_eq!(taken(STROKES, |_, x, _, noise| 2.0 * x + noise).1, ["slope"]);
    assert_eq!(taken(STROKES, |_, x, v, noise| 2.0 * x * v + noise).1, ["flipping-slope"]);
}

#[test]
fn a_drift_is_no_effect() {
    let (verdict, named) = taken(STROKES, |k, _, _, noise| k as f64 / 500.0 + noise);
    assert_eq!((verdict, named.len()), (Verdict::OutsideCatalogue, 0));
}

/// A wiggle in one tenth of the stroke, the same in every block of time: only folds over places see that no slope is there.
#[test]
fn an_error_that_repeats_with_the_path_but_not_over_places_is_not_taken() {
    let wiggle = |_: usize, x: f64, _: f64, noise: f64| if x > 0.9 { 1.0 } else { 0.0 } + 0.2 * noise;
    // It is plainly there, and no suspect: nothing is named for it.
    assert_eq!(taken(STROKES, wiggle), (Verdict::OutsideCatalogue, Vec::new()));
    let in_time_alone = STROKES.replace("[rows.folds]\nposition = \"x\"\n", "");
    assert_eq!(taken(&in_time_alone, wiggle).1, ["slope"]);
}

const MASS: &str = r#"
[record]
time = "t"
period_s = 0.001
[rows]
ends_s = 0.1
[inputs.x]
unit = "m"
low_pass_hz = 50
[inputs.v]
rate_of = "x"
unit = "m/s"
[inputs.a]
rate_of = "v"
unit = "m/s^2"
[parameters]
mass = { unit = "kg", value = 1, range = [0, 100] }
viscous = { unit = "N s/m", value = 1 }
sliding = { unit = "N", value = 1 }
[outputs.f]
unit = "N"
value = "mass*a + viscous*v + sliding*sign(v)"
"#;

/// Strokes of 1.6 kg under a force, 6 s, closed with a held-out record beside it.
fn mass(change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Result<ClosedModel, ModelError> {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("t,x,f\n");
    for k in 0..6000 {
        let t = k as f64 * 1e-3;
        // Noise of a few parts in ten thousand, by a hash of the row.
        let noise = ((k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / 8_388_608.0 - 1.0;
        // Two frequencies: with one the acceleration is a spring's force.
        let tones = [(2.0 * std::f64::consts::PI * 0.7, 0.1), (2.0 * std::f64::consts::PI * 3.1, 0.02)];
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| tones.iter().map(|(w, size)| size * of(*w, w * t)).sum::<f64>();
        let x = sum(&|_, phase| phase.sin());
        let v = sum(&|w, phase| w * phase.cos());
        let a = sum(&|w, phase| -w * w * phase.sin());
        let force = 1.6 * a + 8.0 * v + 3.0 * v.signum() + 0.01 * noise;
        let [t, x, f] = change(k, [t, x + 1e-6 * noise, force]);
        writeln!(text, "{t},{x},{f}").unwrap();
    }
    let [model, record] =
        [("mass.toml", MASS), ("mass.csv", &text)].map(|(name, text)| file(folder.path(), name, text));
    close_with(&model, (&[record], &[]), Search::Never, &mut |_| {})
}

/// Whether the mass that a report tells is this, within a hundredth.
fn is_near(closed: &ClosedModel, mass_kg: f64) -> bool {
    (number(&closed.report, "mass").value / mass_kg - 1.0).abs() < 0.01
}

#[test]
fn a_record_of_one_balance_is_checked_before_it_is_believed() {
    let good = mass(|_, row| row).unwrap();
    assert!(is_near(&good, 1.6), "{:?}", good.report.parameters);
    assert!(good.report.notes.is_empty(), "{:?}", good.report.notes);

    let turned = mass(|_, [t, x, f]| [t, x, -f]).unwrap().report;
    let number = number(&turned, "mass");
    assert!(number.is_at_bound && number.value == 0.0, "{number:?}");
    let said = "mass ended at the end of its range";
    assert!(turned.notes.iter().any(|note| note.contains(said)), "{:?}", turned.notes);

    let stuck = mass(|k, [t, x, f]| if k < 3500 { [t, 0.05, f] } else { [t, x, f] });
    let message = stuck.unwrap_err().to_string();
    assert!(message.contains("mass.csv:2: column x is stuck"), "{message}");
}

#[test]
fn a_stamp_far_beyond_is_refused_with_its_line() {
    let far = mass(|k, [t, x, f]| [if k == 5999 { 1e12 } else { t }, x, f]);
    let message = far.unwrap_err().to_string();
    assert!(message.contains("mass.csv:6001: 1000000000000 s: 6000 rows"), "{message}");
}
