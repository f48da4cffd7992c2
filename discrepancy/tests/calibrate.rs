//! A record determines the numbers of a rig that nothing is missing from: its volumes and the points of its valve's tables too.

use crate::record::gridded;
use discrepancy::calibrate::finer::{TableCalibration, calibrate_tables};
use discrepancy::calibrate::{calibrate, quantity};
use discrepancy::engine::Engine;
use discrepancy::extend::extend;
use discrepancy::parameters::PARAMETERS;
use discrepancy::refit::Linearisation;
use plant::{Axis, RigParameters};

const KV_SUPPLY: [f64; 6] = [0.0, 0.0, 0.123, 0.36, 0.57, 0.66];

fn found(engine: &Engine<'_>) -> TableCalibration {
    calibrate_tables(engine, &calibrate(engine, &Linearisation::at_baseline(engine))).expect("a rig")
}

#[test]
fn what_is_reported_of_a_parameter_is_what_was_simulated_and_a_rig_file() {
    let rig = RigParameters::baseline();
    let records = [gridded(&rig, &rig)];
    let engine = Engine::new(&records, &rig);
    let mut fit = calibrate(&engine, &Linearisation::at_baseline(&engine));
    // A fit on lines may have rest below what slides.
    let [sliding, rest] = ["parameter:sliding-friction", "parameter:break-away-force"]
        .map(|name| PARAMETERS.iter().position(|parameter| parameter.name == name).expect("one of them"));
    (fit.factors[sliding], fit.factors[rest]) = (1.1, 0.8);
    let quantities = [sliding, rest].map(|at| quantity(&engine, at, &fit));
    assert_eq!(quantities[0].value, quantities[1].value, "{quantities:?}");
    extend(RigParameters::BASELINE_TOML, "rig.toml", &[], &quantities, Axis::Drive, &[]).expect("a rig file");
}

#[test]
fn a_rig_file_with_equal_points_and_a_volume_at_the_end_of_its_range_is_calibrated_all_the_same() {
    let rig = RigParameters::baseline()
        .with("cylinder.dead_volume_cm3", &[200.0])
        .and_then(|rig| rig.with("valve.kv_supply_m3_per_h", &[0.0, 0.0, 0.115, 0.36, 0.66, 0.66]))
        .expect("numbers of a rig");
    let hidden = rig.with("friction.viscous_n_per_mm_per_s", &[1.3]).expect("a rig");
    let records = [gridded(&hidden, &rig)];
    let found = found(&Engine::new(&records, &rig));
    let viscous = found
        .quantities
        .iter()
        .find(|quantity| quantity.name == "parameter:viscous-friction")
        .expect("reported");
    let error = viscous.standard_error.expect("these strokes tell it");
    assert!((viscous.value - 1.3).abs() < 4.0 * error, "{viscous:?}");
    let names: Vec<&str> = found.quantities.iter().map(|quantity| quantity.name.as_str()).collect();
    assert!(
        names.contains(&"valve.kv_supply_m3_per_h[3]") && names.contains(&"valve.kv_exhaust_m3_per_h[5]")
    );
    for fixed in ["cylinder.dead_volume_cm3", "valve.kv_supply_m3_per_h[4]", "valve.kv_supply_m3_per_h[5]"] {
        assert!(!names.contains(&fixed), "{fixed} cannot be changed both ways");
    }
}

#[test]
fn a_record_tells_the_dead_volume_and_the_points_of_the_tables() {
    let hidden = RigParameters::baseline()
        .with("cylinder.dead_volume_cm3", &[26.0])
        .and_then(|rig| rig.with("valve.kv_supply_m3_per_h", &KV_SUPPLY))
        .and_then(|rig| rig.with("friction.viscous_n_per_mm_per_s", &[1.25]))
        .expect("numbers of a rig");
    let rig = RigParameters::baseline();
    let records = [gridded(&hidden, &rig)];
    let engine = Engine::new(&records, &rig);
    let found = found(&engine);

    let of =
        |name: &str| found.quantities.iter().find(|quantity| quantity.name == name).expect("it is reported");
    for (name, truth) in [
        ("cylinder.dead_volume_cm3", 26.0),
        ("valve.kv_supply_m3_per_h[2]", 0.123),
        ("valve.kv_supply_m3_per_h[3]", 0.36),
        ("valve.kv_exhaust_m3_per_h[2]", 0.095),
        ("parameter:viscous-friction", 1.25),
        ("parameter:mass", 5.0),
    ] {
        let quantity = of(name);
        let error = quantity.standard_error.expect("these strokes tell it");
        assert!(
            (quantity.value - truth).abs() < 4.0 * error && error < 0.05 * truth,
            "{quantity:?}, in truth {truth}"
        );
    }
    // As a file it is the rig that left the record, as far as the record tells.
    let text = extend(RigParameters::BASELINE_TOML, "rig.toml", &[], &found.changed, Axis::Drive, &[])
        .expect("a rig file");
    let after = RigParameters::from_toml(&text, "rig.toml").expect("it was read once");
    let chi2 = |rig: &RigParameters| {
        let residual = engine.residual(&engine.simulate(rig));
        residual.iter().map(|value| value * value).sum::<f64>() / engine.scaled_dof.iter().sum::<f64>()
    };
    assert!(chi2(&after) < 1.1 && chi2(&rig) > 10.0, "{} {}", chi2(&rig), chi2(&after));
}
