//! One balance on records that the plant made: a chamber with a hidden volume, one with nothing hidden, a file that makes no
//! sense.

use super::*;
use crate::report::Verdict;
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

fn closed(rig: &RigParameters) -> (Report, String) {
    let folder = tempfile::tempdir().unwrap();
    let files = [1, 2].map(|seed| {
        let file = folder.path().join(format!("{seed}.csv"));
        std::fs::write(&file, record(rig, seed)).unwrap();
        file
    });
    let model = model(folder.path());
    let report = close(&model, &files[..1], Some(&files[1]), &mut |_| {}).unwrap();
    let extended = extended_model_text(&model, &report).unwrap();
    std::fs::write(folder.path().join("extended.toml"), &extended).unwrap();
    let again = close(&folder.path().join("extended.toml"), &files[..1], None, &mut |_| {}).unwrap();
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
    let gap = report.gap["drive_flow_a_m3_per_s"].clone();
    assert!(gap.after < 0.8 * gap.before, "{gap:?}");
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
fn a_model_file_is_told_from_a_rig_file() {
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
