//! The table is whole: every row can be read, put in and reported, and names agree with what the wire counts.

use super::mark::{Cause, Mark};
use super::overlay::{Overlay, on_wire};
use super::table::{Kind, all};
use super::*;
use plant::RigParameters;
use runlog::event::{FaultChange, FaultMark};
use runlog::telemetry::FaultGroup;

/// The fault of a row at one of its places, with numbers that mean something where there is no default.
fn some(spec: &'static FaultSpec, at: &str) -> Fault {
    let given: Vec<_> = spec
        .keys
        .iter()
        .filter(|key| key.default.is_none())
        .map(|key| (key.name.to_string(), Some(0.7 * key.max), String::new()))
        .collect();
    Fault::new(spec.name, Some(at), &given).unwrap()
}

#[test]
fn names_are_unique_and_every_number_has_a_range_with_its_default_in_it() {
    let names: Vec<_> = all().map(|spec| spec.name).collect();
    for (i, spec) in all().enumerate() {
        assert!(!names[..i].contains(&spec.name), "{} stands twice", spec.name);
        assert!(spec.keys.len() <= MOST_KEYS && !spec.places.names().is_empty(), "{}", spec.name);
        assert!(spec.places.names().len() < 256, "{}", spec.name);
        for key in spec.keys {
            assert!(
                key.min < key.max && key.min.is_finite() && key.max.is_finite(),
                "{} {}",
                spec.name,
                key.name
            );
            assert!(key.default.is_none_or(|default| key.allows(default)), "{} {}", spec.name, key.name);
            assert!(!key.allows(f64::NAN) && !key.allows(f64::INFINITY));
        }
    }
    assert!(names.len() >= 46, "{} rows", names.len());
}

#[test]
fn every_fault_at_every_place_does_something_of_its_own() {
    let rig = RigParameters::baseline();
    for spec in all() {
        let mut done = Vec::new();
        for at in spec.places.names() {
            let fault = some(spec, &at);
            assert_eq!(fault.place(), at);
            let mut overlay = Overlay::default();
            overlay.put(&fault, &rig);
            let wire = on_wire(&fault);
            assert_eq!(wire.is_some(), spec.group == FaultGroup::Bus, "{}", spec.name);
            if let Some((wire, _)) = wire {
                assert_eq!(wire.name(), spec.name, "the wire counts it by the same name");
            } else if spec.kind != Kind::Unlink {
                assert_ne!(overlay, Overlay::default(), "{} at {at} does nothing", spec.name);
            }
            let all_of_it = (overlay, wire.map(|wire| format!("{wire:?}")));
            assert!(!done.contains(&all_of_it), "{} at {at} does what it does elsewhere", spec.name);
            done.push(all_of_it);
        }
    }
}

#[test]
fn a_mark_is_a_row_a_sentence_and_an_object() {
    let fault = Fault::new("babbling-node", None, &[]).unwrap();
    let mark = Mark { number: 3, what: FaultChange::Begins, fault, cause: Cause::Script { line: 7 } };
    let mut row = Vec::new();
    mark.write(&mut row, 1005).unwrap();
    let row = String::from_utf8(row).unwrap();
    assert_eq!(row, "1.005,3,begins,babbling-node,bus,id=16;frames_per_ms=3;bytes=8,script line 7\n");
    assert_eq!(row.matches(',').count(), mark::COLUMNS.matches(',').count());
    assert_eq!(
        mark.to_string(),
        "fault 3 begins: babbling-node at bus, id=16, frames_per_ms=3, bytes=8 (script line 7)"
    );
    let json = serde_json::to_value(FaultMark::from(mark)).unwrap();
    assert_eq!((&json["fault"], &json["numbers"]["id"]), (&"babbling-node".into(), &16.0.into()));
}
