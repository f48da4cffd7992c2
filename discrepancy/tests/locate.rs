//! Claims about unknown inputs, on records that the plant makes here: each effect lifts its own balance and shows its variable.

use crate::record::{Hidden, gridded, hiding};
use discrepancy::discrepancy_term::{ReferenceModel, located_term};
use discrepancy::engine::Engine;
use discrepancy::locate::{Located, locate};
use discrepancy::outside::outside;
use discrepancy::report::UncataloguedTerm;
use plant::RigParameters;

fn located(effects: &[Hidden<'_>]) -> (Located, Option<UncataloguedTerm>) {
    let rig = RigParameters::baseline();
    let records = [gridded(&hiding(effects), &rig)];
    let located = locate(&rig, &records, &mut |_| ());
    let outside = outside(&located.unknowns, None, &mut |_| ());
    (located, outside)
}

fn birge_ratio(located: &Located, balance: &str) -> f64 {
    let bar = located.location.balances.iter().find(|bar| bar.balance == balance);
    bar.unwrap_or_else(|| panic!("{balance} is reported")).birge_ratio
}

#[test]
fn where_nothing_is_missing_every_balance_is_noise_and_nothing_is_outside() {
    let (located, outside) = located(&[]);
    for bar in &located.location.balances {
        // Some 500 windows: three standard errors of an rms are 0.1; the deviations themselves are good to a tenth.
        assert!((0.85..1.15).contains(&bar.birge_ratio), "{bar:?}");
    }
    assert!(outside.is_none(), "{outside:?}");
    assert_eq!(located.location.sensor_ratio, None);
}

#[test]
fn a_hidden_inclination_lifts_the_force_alone_and_is_a_constant() {
    let (located, outside) = located(&[("inclination", "drive", &[("force_n", 20.0)])]);
    assert!(birge_ratio(&located, "drive.force") > 3.0, "{:?}", located.location.balances);
    for flow in ["drive.flow-a", "drive.flow-b"] {
        assert!(birge_ratio(&located, flow) < 1.15, "{:?}", located.location.balances);
    }
    let outside = outside.expect("something is missing");
    assert_eq!(outside.balance, "drive.force");
    assert_eq!(outside.variables[0].variable, "constant");
    let force =
        located.unknowns.iter().find(|series| series.balance == "drive.force").expect("it is reported");
    // Its size: mean of some hundred windows of a newton each.
    let text = outside.formula.expect("a constant is short");
    let value: f64 =
        text.split_whitespace().next().and_then(|word| word.parse().ok()).expect("a number first");
    assert!((value - 20.0).abs() < 1.0, "{text}, {} windows", force.points.len());
}

#[test]
fn a_hidden_leak_lifts_its_chamber_and_not_the_force() {
    let (located, outside) = located(&[("rod-leakage", "drive.b", &[("leakage_nl_per_min", 20.0)])]);
    assert!(birge_ratio(&located, "drive.flow-b") > 1.5, "{:?}", located.location.balances);
    assert!(birge_ratio(&located, "drive.flow-a") < 1.15, "{:?}", located.location.balances);
    assert!(birge_ratio(&located, "drive.force") < 1.15, "{:?}", located.location.balances);
    assert_eq!(outside.expect("something is missing").balance, "drive.flow-b");
}

#[test]
fn a_hidden_spring_is_a_force_over_x() {
    let numbers = [("spring_n", 40.0)];
    let (located, outside) = located(&[("position-dependent-force", "drive", &numbers)]);
    assert!(birge_ratio(&located, "drive.force") > 3.0, "{:?}", located.location.balances);
    let outside = outside.expect("something is missing");
    assert_eq!((outside.balance.as_str(), outside.variables[0].variable.as_str()), ("drive.force", "x"));
    let curve = outside.curve.expect("there is a variable");
    // -40 (x - 250 mm) / 250 mm at every bin, within five standard errors.
    for ((x, value), band) in curve.at.iter().zip(&curve.value).zip(&curve.band) {
        let law = -40.0 * (x - 0.25) / 0.25;
        assert!((value - law).abs() < 2.5 * band + 1.0, "{x}: {value} for {law}, band {band}");
    }
}

#[test]
fn a_pressure_sensors_offset_moves_two_balances_in_the_ratio_of_geometry() {
    let (located, _) = located(&[("pressure-sensor-offset", "drive.a", &[("offset_mbar", 60.0)])]);
    let note = located.location.sensor_ratio.expect("both stand out");
    assert!(note.contains("pressure sensor a"), "{note}");
}

#[test]
fn the_same_records_give_the_same_bits() {
    let tell = || format!("{:?}", located(&[]).0.location);
    assert_eq!(tell(), tell());
}

/// Balance and first two variables of the discrepancy term of the baseline.
fn term(effects: &[Hidden<'_>]) -> Option<(String, Vec<String>)> {
    let rig = RigParameters::baseline();
    let records = [gridded(&hiding(effects), &rig)];
    let engine = Engine::new(&records, &rig);
    let term = located_term(&engine, &ReferenceModel { effects: &[], factors: [1.0; 9] })?;
    Some((term.balance, term.variables.into_iter().take(2).map(|variable| variable.variable).collect()))
}

#[test]
fn the_discrepancy_term_has_the_balance_and_the_variable_of_what_is_missing() {
    assert_eq!(term(&[]), None, "nothing is missing");
    let cases: [(Hidden<'_>, &str, &str); 5] = [
        (("inclination", "drive", &[("force_n", 20.0)]), "drive.force", "constant"),
        (("position-dependent-force", "drive", &[("spring_n", 40.0)]), "drive.force", "x"),
        (("friction-asymmetry", "drive", &[("asymmetry_percent", 30.0)]), "drive.force", "v"),
        (("rod-leakage", "drive.b", &[("leakage_nl_per_min", 20.0)]), "drive.flow-b", "p_b"),
        (("valve-dead-zone", "drive", &[("dead_zone_percent", 3.0)]), "drive.flow", "u"),
    ];
    for (hidden, balance, variable) in cases {
        let name = hidden.0;
        let (located, variables) = term(&[hidden]).unwrap_or_else(|| panic!("{name}: no term"));
        assert!(located.starts_with(balance), "{name}: {located} over {variables:?}");
        assert!(variables.iter().any(|known| known == variable), "{name}: {located} over {variables:?}");
    }
}
