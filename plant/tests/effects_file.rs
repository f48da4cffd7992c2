//! Effects in the rig file: each is switched on by name and place, and every way to get that wrong is named.

use plant::RigParameters;
use plant::effects::SHEETS;
use plant::effects::sheet::{ActiveEffect, EffectKey, Place, Sheet};

/// The shipped file with lines at its end; they start at [`first_line`].
fn with(lines: &str) -> String {
    format!("{}{lines}\n", RigParameters::BASELINE_TOML)
}

fn first_line() -> usize {
    RigParameters::BASELINE_TOML.lines().count() + 1
}

/// What switches an effect on.
fn table(sheet: &Sheet, place: Place, numbers: &[f64]) -> String {
    let keys = sheet.keys.iter().zip(numbers).map(|(key, number)| format!("{} = {number:?}\n", key.name));
    format!("[effects.{}.{place}]\n{}", sheet.name, keys.collect::<String>())
}

/// A key of an effect as messages write it.
fn path(sheet: &Sheet, place: Place, key: &EffectKey) -> String {
    format!("effects.{}.{place}.{}", sheet.name, key.name)
}

/// A value inside the range, another one for each key.
fn inside(key: &EffectKey) -> f64 {
    key.min + 0.37 * (key.max - key.min)
}

fn read(text: &str) -> Vec<ActiveEffect> {
    RigParameters::from_toml(text, "rig.toml").unwrap_or_else(|error| panic!("{error}")).effects().to_vec()
}

fn refused(text: &str) -> String {
    match RigParameters::from_toml(text, "my-rig.toml") {
        Ok(rig) => panic!("taken as {:?}", rig.effects()),
        Err(error) => error.to_string(),
    }
}

#[test]
fn the_shipped_rig_has_no_effect() {
    assert_eq!(RigParameters::baseline().effects(), []);
}

#[test]
fn each_effect_is_switched_on_at_each_place_of_its_kind() {
    for sheet in SHEETS {
        for place in sheet.place.places() {
            let numbers: Vec<f64> = sheet.keys.iter().map(inside).collect();
            let effects = read(&with(&table(sheet, *place, &numbers)));
            assert_eq!(effects, [ActiveEffect { name: sheet.name, place: *place, numbers }]);
        }
    }
}

#[test]
fn the_sheets_fit_their_own_ranges_and_no_two_have_one_name() {
    for (i, sheet) in SHEETS.iter().enumerate() {
        let name = sheet.name;
        assert!(SHEETS[..i].iter().all(|other| other.name != name), "{name}");
        assert!(!sheet.keys.is_empty() && !sheet.law.is_empty() && !sheet.source.is_empty(), "{name}");
        for key in sheet.keys {
            let what = format!("{name}.{}", key.name);
            let allowed = key.min..=key.max;
            assert!(key.min.is_finite() && key.max.is_finite() && key.min < key.max, "{what}");
            assert!(key.drawn[0] < key.drawn[1] && key.drawn.iter().all(|d| allowed.contains(d)), "{what}");
            assert!(!key.signed || key.drawn.iter().all(|d| allowed.contains(&-d)), "{what}");
            assert!(key.default.is_none_or(|default| allowed.contains(&default)), "{what}");
            assert!(!key.meaning.is_empty(), "{what}");
        }
    }
}

#[test]
fn both_ends_of_each_range_are_taken_and_what_lies_just_outside_is_refused() {
    for sheet in SHEETS {
        let place = sheet.place.places()[0];
        for (i, key) in sheet.keys.iter().enumerate() {
            let mut numbers: Vec<f64> = sheet.keys.iter().map(inside).collect();
            for end in [key.min, key.max] {
                numbers[i] = end;
                assert_eq!(read(&with(&table(sheet, place, &numbers)))[0].numbers, numbers);
            }
            let beyond = 1e-6 * (key.max - key.min);
            for (value, written) in [
                (key.min - beyond, format!("{:?}", key.min - beyond)),
                (key.max + beyond, format!("{:?}", key.max + beyond)),
                (f64::INFINITY, "inf".to_owned()),
                (f64::NEG_INFINITY, "-inf".to_owned()),
            ] {
                numbers[i] = value;
                let (line, path, range) = (first_line() + 1 + i, path(sheet, place, key), key.range());
                assert_eq!(
                    refused(&with(&table(sheet, place, &numbers))),
                    format!("my-rig.toml:{line}: {path} = {written} is out of range; allowed: {range}")
                );
            }
        }
    }
}

#[test]
fn a_key_with_a_default_may_be_left_out_and_any_other_is_asked_for() {
    for sheet in SHEETS {
        let place = sheet.place.places()[0];
        for (left_out, key) in sheet.keys.iter().enumerate() {
            let numbers: Vec<f64> = sheet.keys.iter().map(inside).collect();
            let mut lines: Vec<String> = table(sheet, place, &numbers).lines().map(str::to_owned).collect();
            lines.remove(1 + left_out);
            let text = with(&lines.join("\n"));
            if let Some(default) = key.default {
                assert_eq!(read(&text)[0].numbers[left_out], default);
            } else {
                let (line, path, range) = (first_line(), path(sheet, place, key), key.range());
                let wanted = format!("my-rig.toml:{line}: {path} is missing; allowed is {range}");
                assert_eq!(refused(&text), wanted);
            }
        }
    }
}

/// Keys that are unknown in a table of an effect: the lines after `[effects.`, on which of them the key is, the key, and
/// what is allowed there.
const UNKNOWN: &[(&str, usize, &str, &str)] = &[
    ("piston-leak.drive]\nleakage_nl_per_min = 2.5", 0, "piston-leak", FIRST),
    ("Piston-Leakage.drive]\nleakage_nl_per_min = 2.5", 0, "Piston-Leakage", ""),
    ("piston-leakage]\nleakage_nl_per_min = 2.5", 1, "piston-leakage.leakage_nl_per_min", AXES),
    ("piston-leakage.left]\nleakage_nl_per_min = 2.5", 0, "piston-leakage.left", AXES),
    ("piston-leakage.left]", 0, "piston-leakage.left", ""),
    ("piston-leakage.drive.a]\nleakage_nl_per_min = 2.5", 0, "piston-leakage.drive.a", "leakage_nl_per_min"),
    ("rod-leakage.drive.position]\nleakage_nl_per_min = 2.5", 0, "rod-leakage.drive.position", "a, b"),
    ("rod-leakage.linkage.a]\nleakage_nl_per_min = 2.5", 0, "rod-leakage.linkage", AXES),
    ("coupling-backlash.drive]\ngap_mm = 1.0", 0, "coupling-backlash.drive", ""),
    (
        "piston-leakage.drive]\nleakage_nl_per_min = 2.5\nleakage_bar = 3",
        2,
        "piston-leakage.drive.leakage_bar",
        "leakage_nl_per_min",
    ),
];
const FIRST: &str = "critical-pressure-ratio, valve-characteristic, ";
const AXES: &str = "drive, load";

/// Other lines at the end of the shipped file, on which of them the mistake is, and the message.
const CASES: &[(&str, usize, &str)] = &[
    (
        "[effects]\npiston-leakage = 2.5",
        1,
        "effects.piston-leakage = 2.5 must be a table: write [effects.piston-leakage.PLACE], PLACE one of drive, load",
    ),
    (
        "[effects.piston-leakage]\ndrive = 2.5",
        1,
        "effects.piston-leakage.drive = 2.5 must be a table: write [effects.piston-leakage.drive]",
    ),
    (
        "[effects.rod-leakage]\ndrive.b = 2.5",
        1,
        "effects.rod-leakage.drive.b = 2.5 must be a table: write [effects.rod-leakage.drive.b]",
    ),
    (
        "[effects.rod-leakage.drive]",
        0,
        "effects.rod-leakage.drive = [effects.rod-leakage.drive]; allowed are tables of drive.a, drive.b, load.a, load.b",
    ),
    (
        "[[effects.rod-leakage]]",
        0,
        "effects.rod-leakage must be a table and no list: write [effects.rod-leakage.PLACE], PLACE one of drive.a, drive.b, load.a, load.b",
    ),
    (
        "[effects.rod-leakage]",
        0,
        "effects.rod-leakage = [effects.rod-leakage]; allowed are tables of drive.a, drive.b, load.a, load.b",
    ),
    (
        "[effects.piston-leakage.drive]",
        0,
        "effects.piston-leakage.drive.leakage_nl_per_min is missing; allowed is 0 to 50 Nl/min",
    ),
    (
        "[effects.pressure-sensor-offset.drive.a]\noffset_mbar = 1e9",
        1,
        "effects.pressure-sensor-offset.drive.a.offset_mbar = 1e9 is out of range; allowed: ",
    ),
    (
        "[effects.piston-leakage.drive]\nleakage_nl_per_min = 1\n[effects.piston-leakage.drive]\nleakage_nl_per_min = 1",
        2,
        "not TOML: ",
    ),
];

#[test]
fn every_mistake_is_named_with_file_line_key_value_and_what_is_allowed() {
    let unknown = UNKNOWN.iter().map(|(lines, at, key, known)| {
        let known = if known.is_empty() { String::new() } else { format!("; allowed is {known}") };
        (format!("[effects.{lines}"), at, format!("unknown key effects.{key}{known}"))
    });
    let others = CASES.iter().map(|(lines, at, message)| ((*lines).to_owned(), at, (*message).to_owned()));
    for (lines, at, message) in unknown.chain(others) {
        let error = refused(&with(&lines));
        let wanted = format!("my-rig.toml:{}: {message}", first_line() + at);
        assert!(error.starts_with(&wanted), "\n   got {error}\nwanted {wanted}");
    }
    for (number, wrong) in [
        ("51", " is out of range; allowed:"),
        ("nan", " is out of range; allowed:"),
        ("\"2\"", "; allowed is"),
        ("[2.0]", "; allowed is"),
        ("true", "; allowed is"),
    ] {
        let error = refused(&with(&format!("[effects.piston-leakage.drive]\nleakage_nl_per_min = {number}")));
        let said = format!("effects.piston-leakage.drive.leakage_nl_per_min = {number}{wrong}");
        let wanted = format!("my-rig.toml:{}: {said} 0 to 50 Nl/min", first_line() + 1);
        assert!(error.starts_with(&wanted), "\n   got {error}\nwanted {wanted}");
    }
    let error = refused(&format!("effects = 3\n{}", RigParameters::BASELINE_TOML));
    assert_eq!(error, "my-rig.toml:1: effects = 3 must be a table: write [effects] with its keys below");
}

#[test]
fn an_effect_switched_on_by_a_call_is_that_of_a_file() {
    let baseline = RigParameters::baseline();
    for sheet in SHEETS {
        for place in sheet.place.places() {
            let numbers: Vec<f64> = sheet.keys.iter().map(inside).collect();
            let named: Vec<(&str, f64)> =
                sheet.keys.iter().map(|key| key.name).zip(numbers.clone()).collect();
            let called = baseline.with_effect(sheet.name, &place.to_string(), &named).expect("in range");
            let text = with(&table(sheet, *place, &numbers));
            assert_eq!(called, RigParameters::from_toml(&text, "rig.toml").expect("in range"));
            assert_eq!(called.without_effect(sheet.name, *place), baseline);
        }
    }
    let error = baseline.with_effect("piston-leakage", "drive", &[("leakage_nl_per_min", 51.0)]);
    let wanted =
        "effects.piston-leakage.drive.leakage_nl_per_min = 51.0 is out of range; allowed: 0 to 50 Nl/min";
    assert!(error.expect_err("out of range").to_string().ends_with(wanted));
    let error = baseline.with_effect("piston-leakage", "drive", &[("leakage_nl_per_min", f64::NAN)]);
    assert!(error.expect_err("no number").to_string().contains("leakage_nl_per_min = nan is out of range"));
}

#[test]
fn switching_on_again_replaces_the_numbers_and_leaves_other_places() {
    let with = |rig: &RigParameters, place, number| {
        rig.with_effect("rod-leakage", place, &[("leakage_nl_per_min", number)]).expect("in range")
    };
    let rig = with(&with(&with(&RigParameters::baseline(), "load.b", 3.0), "drive.a", 1.0), "load.b", 2.0);
    let found: Vec<(String, f64)> =
        rig.effects().iter().map(|effect| (effect.place.to_string(), effect.numbers[0])).collect();
    assert_eq!(found, [("drive.a".to_owned(), 1.0), ("load.b".to_owned(), 2.0)]);
    assert_eq!(rig.without_effects(), RigParameters::baseline());
}

#[test]
fn all_effects_together_stand_in_the_catalogues_order_whatever_the_files() {
    let text: String = SHEETS
        .iter()
        .rev()
        .flat_map(|sheet| sheet.place.places().iter().rev().map(move |place| (sheet, *place)))
        .map(|(sheet, place)| table(sheet, place, &sheet.keys.iter().map(inside).collect::<Vec<_>>()))
        .collect();
    let effects = read(&with(&text));
    let row = |effect: &ActiveEffect| SHEETS.iter().position(|sheet| sheet.name == effect.name);
    let order: Vec<(Option<usize>, Place)> =
        effects.iter().map(|effect| (row(effect), effect.place)).collect();
    assert!(order.is_sorted(), "{order:?}");
    assert_eq!(effects.len(), SHEETS.iter().map(|sheet| sheet.place.places().len()).sum::<usize>());
}

#[test]
fn inline_and_dotted_tables_say_the_same() {
    let usual = "[effects.rod-leakage.drive.a]\nleakage_nl_per_min = 2\n[effects.rod-leakage.load.b]\nleakage_nl_per_min = 3";
    let short = "[effects.rod-leakage]\ndrive.a.leakage_nl_per_min = 2\nload.b = { leakage_nl_per_min = 3 }";
    assert_eq!(read(&with(usual)), read(&with(short)));
}
