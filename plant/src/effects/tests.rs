//! Claims about all effects together: what one adds is its own field, and nothing else.

use super::acting::Effects;
use super::sums::{Port, PositionReading};
use super::*;
use crate::{Inputs, Plant, Setup};

/// Every effect at every place in the geometric middle of what is drawn, in a plant that moves under load.
fn moving() -> (RigParameters, Plant, Inputs) {
    let mut rig = RigParameters::baseline();
    for sheet in SHEETS {
        for place in sheet.place.names() {
            let middle = |key: &sheet::EffectKey| (key.name, (key.drawn[0] * key.drawn[1]).sqrt());
            let numbers: Vec<_> = sheet.keys.iter().map(middle).collect();
            rig = rig.with_effect(sheet.name, &place, &numbers).expect("in range");
        }
    }
    let setup = Setup { carriage_position_m: 0.25, linked: true, added_mass_kg: 1.0 };
    let mut plant = Plant::new(&rig, &setup).expect("good");
    let inputs = |k: u32| Inputs { valve: [0.6, if k < 70 { 0.2 } else { 0.35 }], ..Inputs::default() };
    (0..80).for_each(|k| plant.step(&inputs(k)));
    (rig, plant, inputs(80))
}

fn terms(effects: &Effects, plant: &Plant, inputs: &Inputs) -> Vec<Term> {
    let mut terms = Vec::new();
    effects.each_term(&plant.integrator, plant.state(), inputs, &mut |term| terms.push(term));
    terms
}

#[test]
fn every_effect_has_a_term_of_its_own_at_every_place() {
    let (rig, plant, inputs) = moving();
    let terms = terms(plant.effects().expect("on"), &plant, &inputs);
    for switched in rig.effects() {
        let is_it =
            |term: &&Term| term.effect == switched.name.replace('-', "_") && term.part == switched.place.part;
        assert!(terms.iter().any(|term| is_it(&term)), "{} {}", switched.name, switched.place);
    }
    let names: Vec<String> = terms.iter().map(Term::column).collect();
    for (i, name) in names.iter().enumerate() {
        assert!(!names[..i].contains(name), "{name} stands twice");
    }
    assert_eq!(plant.term_names(), names);
    assert_eq!(plant.terms(&inputs).values().len(), names.len());
}

#[test]
fn switching_an_effect_off_changes_its_sums_by_exactly_its_fields() {
    let (rig, plant, inputs) = moving();
    let effects = plant.effects().expect("on");
    let all = terms(effects, &plant, &inputs);
    for switched in rig.effects() {
        let mut without = effects.clone();
        without.on = AxisEffects::of(&rig.without_effect(switched.name, switched.place));
        let left = terms(&without, &plant, &inputs);
        let gone: Vec<&Term> =
            all.iter().filter(|term| !left.iter().any(|other| other.column() == term.column())).collect();
        assert!(!gone.is_empty(), "{} {}", switched.name, switched.place);
        for term in gone {
            let name = switched.name.replace('-', "_");
            assert_eq!(term.effect, name);
            // The other terms of its balance stay to the bit, so the sum changes by its field; drops at a port are compared
            // below, at the same flow.
            let siblings = |term: &&Term, other: &&Term| {
                other.balance == term.balance && other.part == term.part && other.element == term.element
            };
            for other in all.iter().filter(|other| siblings(&term, other) && other.effect != term.effect) {
                let after = left.iter().find(|after| after.column() == other.column()).expect("still on");
                if term.balance != "port" {
                    assert_eq!(after.value.to_bits(), other.value.to_bits(), "{name}: {}", other.column());
                }
            }
        }
    }
}

#[test]
fn drops_at_a_port_are_each_its_own_at_the_same_flow() {
    let (rig, plant, _) = moving();
    let effects = plant.effects().expect("on");
    let drops = |effects: &Effects| effects.drops(0, -3e-3, 4e5, 0.005);
    let all = drops(effects);
    let without = |name: &str| {
        let mut without = effects.clone();
        let place = sheet(name).expect("known").place.places()[0];
        without.on = AxisEffects::of(&rig.without_effect(name, place));
        drops(&without)
    };
    assert_eq!(without("line-resistance"), Port { line_resistance: 0.0, ..all });
    assert_eq!(without("check-valve-restriction"), Port { check_valve_restriction: 0.0, ..all });
    assert_eq!(without("end-cushion"), Port { end_cushion: 0.0, ..all });
    assert!(
        [all.line_resistance, all.check_valve_restriction, all.end_cushion].iter().all(|drop| *drop < 0.0)
    );
}

#[test]
fn a_sum_is_the_baseline_and_its_fields_and_off_is_zero() {
    let reading = PositionReading {
        declared_reading: 0.0,
        time_skew: 1.0,
        position_sensor_lag: 2.0,
        position_sensor_gain: 4.0,
        position_sensor_offset: 8.0,
        added: 0.0,
    };
    assert_eq!(reading.sum(16.0), 31.0);
    assert_eq!(PositionReading::default().sum(0.1), 0.1);
    assert_eq!(PositionReading { position_sensor_gain: 0.0, ..reading }.sum(16.0), 27.0);
}
