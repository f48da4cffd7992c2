//! One balance on records that the plant made: a chamber with a hidden volume, one with nothing hidden, a file that makes no
//! sense.

use super::*;
use crate::report::Verdict;
use crate::workflow::Reported;
use plant::{Inputs, Plant, Sensors, Setup, quantise_valve};
use std::fmt::Write;

fn baseline_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../plant/rig.toml")
}

/// A record of the drive alone, 20 s: opens and shuts in steps of many sizes, along the whole stroke.
fn record(rig: &RigParameters, seed: u64) -> String {
    let setup = Setup { carriage_position_m: 0.1, linked: false, added_mass_kg: 0.0 };
    let mut plant = Plant::new(rig, &setup).unwrap();
    let mut sensors = Sensors::new(rig, seed);
    let mut text = String::from("# linked=false added_mass_kg=0\n");
    text.push_str(
        "time_s,drive_valve,drive_position_m,drive_force_N,drive_pressure_a_Pa,drive_pressure_b_Pa\n",
    );
    let openings = [0.25, -0.3, 0.0, 0.4, -0.5, 0.15, -0.15, 0.6, 0.0, -0.6, 0.3, -0.2];
    for k in 0..20_000_u64 {
        let opening = openings[((k + 37 * seed) / 250) as usize % openings.len()];
        let inputs = Inputs { valve: [quantise_valve(opening), 0.0], ..Inputs::default() };
        let [drive, _] = sensors.sample(&plant, &inputs);
        let seconds = k as f64 * 1e-3;
        let (x, f) = (drive.position.value, drive.force.value);
        let (a, b) = (drive.pressure_a.value, drive.pressure_b.value);
        writeln!(text, "{seconds:.3},{},{x},{f},{a},{b}", inputs.valve[0]).unwrap();
        plant.step(&inputs);
    }
    text
}

fn model(folder: &Path) -> PathBuf {
    let file = folder.join("chamber.toml");
    let text = format!(
        "kind = \"chamber\"\nrig = {:?}\n[processing]\nlow_pass_hz = 40.0\n\
         decimate = 5\nends_s = 0.1\nposition_mm = [5.0, 495.0]\n",
        baseline_file().display().to_string()
    );
    std::fs::write(&file, text).unwrap();
    file
}

/// The page shows the held-out record with both models, in the unit of the balance: the noise of its sensor is not known.
fn drawn(report: &Report, pictures: &Pictures) {
    let [trace] = &pictures.traces[..] else { panic!("{} signals", pictures.traces.len()) };
    assert!(pictures.held_out && pictures.record.ends_with("2.csv"), "{}", pictures.record);
    let left =
        |values: &[f64]| rms(&values.iter().copied().filter(|value| value.is_finite()).collect::<Vec<_>>());
    let [before, after] = [left(&trace.before_residual), left(&trace.after_residual)];
    assert!(after < if report.named.is_empty() { 1.001 } else { 0.9 } * before, "{before}, {after}");
    assert!(trace.time_s.windows(2).all(|pair| pair[0] <= pair[1]));
    let page = crate::page::page(report, pictures);
    assert!(page.contains(&format!("difference, {}", trace.unit)) && !page.contains("times the noise"));
}

fn closed(rig: &RigParameters) -> (Report, String) {
    let folder = tempfile::tempdir().unwrap();
    let files = [1, 2].map(|seed| {
        let file = folder.path().join(format!("{seed}.csv"));
        std::fs::write(&file, record(rig, seed)).unwrap();
        file
    });
    let model = model(folder.path());
    let Closed { report, pictures, .. } = close(&model, &files[..1], &[&files[1]], &mut |_| {}).unwrap();
    drawn(&report, &pictures);
    let extended = extended_model_text(&model, &Reported::from(&report)).unwrap();
    std::fs::write(folder.path().join("extended.toml"), &extended).unwrap();
    let again = close(&folder.path().join("extended.toml"), &files[..1], &[], &mut |_| {}).unwrap().report;
    assert!(again.named.is_empty(), "the extended model lacks {:?}", again.named);
    (report, extended)
}

#[test]
fn a_hidden_dead_volume_is_named_in_the_flow_of_its_chamber() {
    let rig = RigParameters::baseline();
    let rig = rig.with_effect("dead-volume", "drive", &[("volume_cm3", 50.0)]).unwrap();
    let (report, extended) = closed(&rig);
    assert_eq!(report.named[0].effect, "dead-volume", "{:#?}", report.candidates);
    let volume = &report.named[0].parameters[0];
    assert!((volume.value - 50.0).abs() < 5.0, "{volume:?}");
    assert_eq!(volume.before, Some(20.0));
    // In one chamber an offset of the position is the same column; which of the two it is stays open, and what would tell is
    // said.
    assert_eq!(report.named[0].alternatives[0].effect, "position-sensor-offset");
    assert_eq!((report.named.len(), report.verdict), (1, Verdict::Ambiguous));
    assert!(report.next.unwrap().otherwise.unwrap().contains("other chamber"));
    let misfit = report.misfit["drive_flow_a_m3_per_s"].clone();
    assert!(misfit.after < 0.8 * misfit.before, "{misfit:?}");
    assert!(report.verification.unwrap().confirmed);
    assert!(extended.contains("effect = \"dead-volume\""), "{extended}");
}

#[test]
fn a_chamber_without_anything_hidden_lacks_nothing() {
    let (report, _) = closed(&RigParameters::baseline());
    assert_eq!(report.verdict, Verdict::NothingMissing, "{:#?}", report.candidates);
}

#[test]
fn a_chamber_whose_valve_passes_more_has_another_scale_and_no_effect() {
    let rig = RigParameters::baseline();
    let valve = rig.valve();
    let more = |kv: &[f64]| -> Vec<f64> { kv.iter().map(|kv| 1.1 * kv).collect() };
    let (supply, exhaust) = (more(&valve.kv_supply_m3_per_h), more(&valve.kv_exhaust_m3_per_h));
    let rig = rig.with("valve.kv_supply_m3_per_h", &supply).unwrap();
    let rig = rig.with("valve.kv_exhaust_m3_per_h", &exhaust).unwrap();
    let (report, _) = closed(&rig);
    assert_eq!(report.verdict, Verdict::ParametersOnly, "{:#?}", report.candidates);
    let scale = &report.parameters[0];
    assert_eq!(scale.name, "parameter:kv-scale");
    assert!((scale.value - 1.1).abs() < 0.03, "{scale:?}");
}

#[test]
fn a_model_file_is_distinguished_from_a_rig_file() {
    assert!(is_model_file("kind = \"mass\"\n"));
    assert!(!is_model_file(&std::fs::read_to_string(baseline_file()).unwrap()));
    assert!(!is_model_file("kind = "));
}

#[test]
fn a_file_that_makes_no_sense_is_refused_with_key_and_value() {
    let refused = |text: &str| Model::from_toml(text, Path::new("m.toml")).unwrap_err().to_string();
    for (text, part) in [
        ("kind = \"spring\"\n", "spring"),
        ("kind = \"mass\"\n[processing]\ndecimate = 0\n", "processing.decimate = 0; allowed is 1 to 1000"),
        ("kind = \"mass\"\n[processing]\nlow_pass_hz = 600.0\n", "processing.low_pass_hz = 600"),
        ("kind = \"mass\"\n[channels]\nforce = \"thrust\"\n", "channels.force = thrust"),
        ("kind = \"mass\"\n[channels]\npressure = \"drive_pressure_a_Pa\"\n", "channels.pressure"),
        ("kind = \"mass\"\nsecret = 1\n", "secret"),
        ("kind = \"mass\"\n[selection]\nblocks = 1\n", "selection.blocks"),
    ] {
        assert!(refused(text).contains(part), "{}", refused(text));
    }
}

/// Strokes of 1.6 kg under a force, 6 s, to a mapping and a model.
fn mass(folder: &Path, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> (PathBuf, PathBuf) {
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
    let [csv, mapping, model] = ["mass.csv", "mapping.toml", "mass.toml"].map(|name| folder.join(name));
    std::fs::write(&csv, text).unwrap();
    let channels = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[channels.drive_position_m]\ncolumn = \"x\"\nunit = \"m\"\n\
                    [channels.drive_applied_force_N]\ncolumn = \"f\"\nunit = \"N\"\n";
    std::fs::write(&mapping, channels).unwrap();
    let text = "kind = \"mass\"\nmapping = \"mapping.toml\"\n[channels]\nforce = \"drive_applied_force_N\"\n\
                [processing]\nlow_pass_hz = 50.0\nends_s = 0.1\n";
    std::fs::write(&model, text).unwrap();
    (model, csv)
}

/// Whether the mass that a report tells is this, within a hundredth.
fn is_near(report: &Report, mass_kg: f64) -> bool {
    let reported = report.summary.split("mass ").nth(1).and_then(|rest| rest.split(' ').next());
    let reported: f64 =
        reported.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{}", report.summary));
    (reported / mass_kg - 1.0).abs() < 0.01
}

#[test]
fn a_record_of_one_balance_is_checked_before_it_is_believed() {
    let good = tempfile::tempdir().unwrap();
    let (model, train) = mass(good.path(), |_, row| row);
    let closed = close(&model, std::slice::from_ref(&train), &[], &mut |_| {}).unwrap();
    assert_ne!(closed.report.verdict, Verdict::BadData, "{}", closed.report.summary);
    assert!(is_near(&closed.report, 1.6), "{}", closed.report.summary);

    let turned = tempfile::tempdir().unwrap();
    let (turned_model, turned_train) = mass(turned.path(), |_, [t, x, f]| [t, x, -f]);
    let report = close(&turned_model, &[turned_train], &[], &mut |_| {}).unwrap().report;
    assert_eq!((report.verdict, report.named.len()), (Verdict::BadData, 0), "{}", report.summary);
    assert!(report.summary.contains("a mass of -1."), "{}", report.summary);

    let stuck = tempfile::tempdir().unwrap();
    let (stuck_model, stuck_train) =
        mass(stuck.path(), |k, [t, x, f]| if k < 3500 { [t, 0.05, f] } else { [t, x, f] });
    let report = close(&stuck_model, &[stuck_train], &[], &mut |_| {}).unwrap().report;
    assert_eq!(report.verdict, Verdict::BadData, "{}", report.summary);
    assert!(report.summary.contains("mass.csv:2: drive_position_m: stuck"), "{}", report.summary);
}

#[test]
fn a_held_out_record_of_one_balance_that_cannot_be_used_takes_nothing_away() {
    let folder = tempfile::tempdir().unwrap();
    let (model, train) = mass(folder.path(), |_, row| row);
    let test = folder.path().join("short.csv");
    std::fs::write(&test, "t,x,f\n0,0,0\n0.001,0,0\n").unwrap();
    let closed = close(&model, &[train], &[&test], &mut |_| {}).unwrap();
    assert!(closed.not_judged.is_some_and(|why| why.contains("short.csv")));
    assert!(closed.report.verification.is_none() && is_near(&closed.report, 1.6));
}

#[test]
fn a_stamp_far_beyond_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let (model, train) = mass(folder.path(), |k, [t, x, f]| [if k == 5999 { 1e12 } else { t }, x, f]);
    let error = close(&model, &[train], &[], &mut |_| {}).unwrap_err().to_string();
    assert!(error.contains("mass.csv:6001: 1000000000000 s: 6000 rows"), "{error}");
}
