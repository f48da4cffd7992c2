//! Numbers that are known of each record, and differ.

use crate::closing::{close, file, number};
use model_fit::explain;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const MODEL: &str = r#"
[inputs.force_N]
unit = "N"
[parameters]
mass = { unit = "kg", values = { "light/run.csv" = 2.5, "heavy.csv" = 5 } }
drag = { unit = "N s/m", value = 1, range = [0, 100] }
[states.v]
unit = "m/s"
start = 0
derivative = "(force_N - drag*v)/mass"
[outputs.v_m_per_s]
unit = "m/s"
value = "v"
"#;

/// A push of 6 N for 2 s, off for 2 s, on a mass with a drag of 4 N s/m: its exact exponentials, and a little noise.
fn record(folder: &Path, name: &str, mass: f64) -> PathBuf {
    let (mut v, mut text) = (0.0, "t_s,force_N,v_m_per_s\n".to_owned());
    for row in 0..400_u32 {
        let force = if row / 100 % 2 == 0 { 6.0 } else { 0.0 };
        let noise = 1e-3 * (f64::from(row * row % 17) / 8.0 - 1.0);
        let _ = writeln!(text, "{},{force},{}", f64::from(row) * 0.02, v + noise);
        v = force / 4.0 + (v - force / 4.0) * (-0.02 * 4.0 / mass).exp();
    }
    std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
    file(folder, name, &text)
}

#[test]
fn a_fit_takes_the_mass_of_each_record_and_is_wrong_with_one_mass_for_both() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let train = [record(folder, "light/run.csv", 2.5), record(folder, "heavy.csv", 5.0)];
    let fitted = |text: &str| {
        let model = file(folder, "model.toml", text);
        let report = close(&model, &train, &[]).unwrap_or_else(|error| panic!("{error}")).report;
        (number(&report, "drag").value, report.training.iter().map(|one| one.rms_before).fold(0.0, f64::max))
    };
    let (drag, rms) = fitted(MODEL);
    assert!((drag - 4.0).abs() < 0.01 && rms < 1e-3, "{drag} N s/m, residual {rms} m/s");
    let known = r#"values = { "light/run.csv" = 2.5, "heavy.csv" = 5 }"#;
    let (drag, rms) = fitted(&MODEL.replace(known, "value = 3.75, fixed = true"));
    assert!((drag - 4.0).abs() > 0.05 && rms > 0.05, "{drag} N s/m, residual {rms} m/s");
    let model = file(folder, "model.toml", MODEL);
    let told = explain(&model, &[]).unwrap();
    assert!(told.contains("mass = 2.50 kg of light/run.csv, 5.00 kg of heavy.csv, known"), "{told}");
}

#[test]
fn a_record_that_is_not_listed_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let model = file(folder.path(), "model.toml", MODEL);
    // The folder is a part of the name, too.
    let other = [record(folder.path(), "other/run.csv", 2.5)];
    let message = close(&model, &other, &[]).unwrap_err().to_string();
    let expected = "other/run.csv: parameters.mass.values of the model has no value of this record; it has light/run.csv, heavy.csv";
    assert!(message.contains(expected), "{message}");
}
