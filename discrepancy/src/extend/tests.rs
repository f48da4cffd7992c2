//! What is written is what was found, and nothing else changes.

use super::parameters::{key_of_parameter, names};
use super::*;
use plant::Axis;
use plant::effects::tabulated::{Balance, Variable};

fn records() -> Vec<String> {
    vec!["a.csv".to_owned(), "b.csv".to_owned()]
}

fn addition(effect: &str, place: &str, numbers: &[(&str, f64, Option<f64>)]) -> Addition {
    let numbers = numbers.iter().map(|(key, value, error)| ((*key).to_owned(), *value, *error)).collect();
    Addition { effect: effect.to_owned(), place: place.to_owned(), numbers }
}

fn leakage() -> Addition {
    addition("piston-leakage", "drive", &[("leakage_nl_per_min", 2.513_171_3, Some(0.0412))])
}

fn quantity(name: &str, value: f64, unit: &str, before: Option<f64>) -> Quantity {
    Quantity {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        standard_error: Some(0.01 * value),
        before,
    }
}

fn extended(text: &str, additions: &[Addition], changed: &[Quantity]) -> RigParameters {
    let text = extend(text, "rig.toml", additions, changed, Axis::Drive, &records()).unwrap();
    RigParameters::from_toml(&text, "rig.toml").unwrap()
}

fn refused(additions: &[Addition], changed: &[Quantity]) -> String {
    let text = RigParameters::BASELINE_TOML;
    extend(text, "rig.toml", additions, changed, Axis::Drive, &records()).unwrap_err().to_string()
}

/// Lines of the new text that the old one has not.
fn new_lines<'t>(old: &str, new: &'t str) -> Vec<&'t str> {
    new.lines().filter(|line| !old.lines().any(|old| old == *line)).collect()
}

#[test]
fn nothing_found_changes_nothing() {
    let text = RigParameters::BASELINE_TOML;
    assert_eq!(extend(text, "rig.toml", &[], &[], Axis::Drive, &records()).unwrap(), text);
}

#[test]
fn each_effect_is_switched_on_as_it_was_added_at_each_of_its_places() {
    for sheet in SHEETS {
        for place in sheet.place.names() {
            let numbers: Vec<_> = sheet
                .keys
                .iter()
                .map(|key| (key.name, key.drawn[0] + 0.3137 * (key.drawn[1] - key.drawn[0]), None))
                .collect();
            let plain: Vec<_> = numbers.iter().map(|(key, value, _)| (*key, *value)).collect();
            let wanted = RigParameters::baseline().with_effect(sheet.name, &place, &plain).unwrap();
            let rig = extended(RigParameters::BASELINE_TOML, &[addition(sheet.name, &place, &numbers)], &[]);
            assert_eq!(rig.effects(), wanted.effects(), "{} at {place}", sheet.name);
            assert_eq!(rig.friction(), wanted.friction());
        }
    }
}

#[test]
fn a_new_table_states_value_error_unit_range_and_records() {
    let old = RigParameters::BASELINE_TOML;
    let new = extend(old, "rig.toml", &[leakage()], &[], Axis::Drive, &records()).unwrap();
    assert!(new.starts_with(old));
    let lines = new_lines(old, &new);
    assert!(lines[0].starts_with("# piston-leakage: "), "{lines:?}");
    assert_eq!(lines[1..3], ["# Found from a.csv, b.csv.", "[effects.piston-leakage.drive]"]);
    assert!(lines[3].starts_with("# 2.513 +- 0.041 Nl/min; "), "{lines:?}");
    assert_eq!(lines[4..], ["leakage_nl_per_min = 2.5131713"]);
}

#[test]
fn a_changed_parameter_keeps_its_comments_and_its_old_value() {
    let old = RigParameters::BASELINE_TOML.replace("drive_kg = 5.0", "drive_kg = 5.0   # weighed in May");
    let mass = quantity("parameter:mass", 5.25, "kg", Some(5.0));
    let new = extend(&old, "rig.toml", &[], &[mass], Axis::Drive, &records()).unwrap();
    assert_eq!(
        new_lines(&old, &new),
        [
            "# was 5.0; 5.250 +- 0.052 kg, by parameter:mass from a.csv, b.csv",
            "drive_kg = 5.25   # weighed in May",
            "# was 3.5; times 1.050 +- 0.011, by parameter:mass from a.csv, b.csv",
            "carriage_kg = 3.6750000000000003",
        ]
    );
}

/// Numbers of a rig that a parameter scales, each with its parameter.
fn scaled(rig: &RigParameters) -> [(f64, &'static str); 13] {
    let (mass, friction, valve, cylinder) = (rig.mass(), rig.friction(), rig.valve(), rig.cylinder());
    [
        (mass.drive_kg, "parameter:mass"),
        (mass.carriage_kg, "parameter:mass"),
        (mass.load_kg, "parameter:mass"),
        (friction.viscous_n_s_per_m, "parameter:viscous-friction"),
        (friction.sliding_force_n, "parameter:sliding-friction"),
        (friction.break_away_force_n, "parameter:break-away-force"),
        (rig.supply().pressure_pa, "parameter:supply-pressure"),
        (valve.spool_time_constant_s, "parameter:spool-time-constant"),
        (valve.flow_lag_time_constant_s, "parameter:flow-lag"),
        (valve.kv_supply_m3_per_h[3], "parameter:kv-scale"),
        (valve.kv_exhaust_m3_per_h[5], "parameter:kv-scale"),
        (cylinder.piston_area_m2, "parameter:piston-area"),
        (cylinder.annulus_area_m2, "parameter:piston-area"),
    ]
}

#[test]
fn each_parameter_scales_what_the_records_of_the_study_scale() {
    let base = RigParameters::baseline();
    let text = RigParameters::BASELINE_TOML;
    for name in names() {
        let rig = extended(text, &[], &[quantity(name, 1.03, "", None)]);
        for ((value, of), (before, _)) in scaled(&rig).into_iter().zip(scaled(&base)) {
            let (ratio, wanted) = (value / before, if of == name { 1.03 } else { 1.0 });
            assert!((ratio - wanted).abs() < 1e-12, "{name}: {of} times {ratio}");
        }
        for path in Axis::ALL.iter().flat_map(|axis| key_of_parameter(name, *axis).unwrap()) {
            assert!(plant::parameters::table::KEYS.iter().any(|key| key.path() == path), "{path}");
        }
    }
    assert_eq!(key_of_parameter("parameter:colour", Axis::Drive), None);
}

#[test]
fn a_mass_is_that_of_the_axis_that_was_weighed() {
    // As heavy as the drive: no number says which of them it is.
    let text = RigParameters::BASELINE_TOML.replace("load_kg = 1.5", "load_kg = 5.0");
    let changed = [quantity("parameter:mass", 5.2, "kg", Some(5.0))];
    for (mass_axis, masses_kg) in [(Axis::Load, (5.2, 5.0)), (Axis::Drive, (5.0, 5.2))] {
        let text = extend(&text, "rig.toml", &[], &changed, mass_axis, &records()).unwrap();
        let rig = RigParameters::from_toml(&text, "rig.toml").unwrap();
        assert_eq!((rig.mass().load_kg, rig.mass().drive_kg), masses_kg);
    }
}

#[test]
fn sliding_friction_takes_the_break_away_force_along() {
    let changed = [quantity("parameter:sliding-friction", 40.0, "N", Some(26.0))];
    let rig = extended(RigParameters::BASELINE_TOML, &[], &changed);
    assert_eq!((rig.friction().sliding_force_n, rig.friction().break_away_force_n), (40.0, 40.0));
    let both = [changed[0].clone(), quantity("parameter:break-away-force", 50.0, "N", Some(35.0))];
    assert_eq!(extended(RigParameters::BASELINE_TOML, &[], &both).friction().break_away_force_n, 50.0);
}

#[test]
fn an_effect_that_is_on_gets_other_numbers_and_keeps_the_rest() {
    let sheet = sheet("spool-second-order").unwrap();
    let [first, second] = [sheet.keys[0], sheet.keys[1]];
    let value = second.min + 0.5 * (second.max - second.min);
    let head = "\n[effects.spool-second-order.drive]\n";
    let old = format!("{}{head}  # mine\n  {} = 8e1 # guess\n", RigParameters::BASELINE_TOML, first.name);
    let old = if second.default.is_some() { old } else { format!("{old}  {} = {value}\n", second.name) };
    let numbers = [(first.name, 91.25, Some(1.5)), (second.name, value, None)];
    let change = addition(sheet.name, "drive", &numbers);
    let new = extend(&old, "rig.toml", &[change], &[], Axis::Drive, &records()).unwrap();
    assert!(
        new.contains(&format!("  # mine\n  # was 8e1; 91.2 +- 1.5 Hz from a.csv, b.csv; {}", first.range())),
        "{new}"
    );
    assert!(new.contains(&format!("\n  {} = 91.25 # guess\n", first.name)), "{new}");
    let rig = RigParameters::from_toml(&new, "rig.toml").unwrap();
    assert_eq!(rig.effects().len(), 1);
    assert_eq!(rig.effects()[0].numbers[..2], [91.25, value]);
}

#[test]
fn a_number_that_a_table_left_out_is_put_into_it() {
    // An effect whose numbers all have defaults, and so a table that may be empty.
    let with_default = |sheet: &&Sheet| sheet.keys.iter().skip(1).any(|key| key.default.is_some());
    for sheet in SHEETS.iter().filter(with_default) {
        let key = sheet.keys.iter().skip(1).find(|key| key.default.is_some()).unwrap();
        let given: String = sheet
            .keys
            .iter()
            .filter(|key| key.default.is_none())
            .map(|key| format!("\t{} = {:?}\n", key.name, key.drawn[0]))
            .collect();
        let place = sheet.place.names()[0].clone();
        let old = format!("{}\n[effects.{}.{place}]\n{given}", RigParameters::BASELINE_TOML, sheet.name);
        let value = key.min + 0.5 * (key.max - key.min);
        let rig = extended(old.trim_end(), &[addition(sheet.name, &place, &[(key.name, value, None)])], &[]);
        let at = sheet.keys.iter().position(|other| other.name == key.name).unwrap();
        assert_eq!(rig.effects()[0].numbers[at], value, "{}", sheet.name);
    }
}

#[test]
fn an_effect_that_stands_with_defaults_alone_or_in_any_layout_is_changed_or_joined() {
    let base = RigParameters::BASELINE_TOML;
    let layouts = [
        format!("effects.piston-leakage.load.leakage_nl_per_min = 1.5\n{base}"),
        format!("effects.piston-leakage.drive.leakage_nl_per_min = 1.5\n{base}"),
        format!("effects = {{ piston-leakage = {{ drive = {{ leakage_nl_per_min = 1.5 }} }} }}\n{base}"),
        format!("effects = {{ piston-leakage = {{ load = {{ leakage_nl_per_min = 1.5 }} }} }}\n{base}"),
        format!("effects = {{ inclination = {{ load = {{ force_n = 10 }} }} }}\n{base}"),
        format!("{base}\n[effects.piston-leakage]\ndrive = {{ leakage_nl_per_min = 1.5 }}"),
        format!("{base}\n[effects]\npiston-leakage.drive.leakage_nl_per_min = 1.5"),
        format!("{base}\n[effects]\npiston-leakage.load.leakage_nl_per_min = 1.5"),
        format!("{base}\n  [ effects . \"piston-leakage\" . drive ]\n  'leakage_nl_per_min'=1.5# odd"),
    ];
    for old in layouts {
        let before = RigParameters::from_toml(&old, "rig.toml").unwrap();
        let wanted = before.with_effect("piston-leakage", "drive", &[("leakage_nl_per_min", 2.513_171_3)]);
        let rig = extended(&old, &[leakage()], &[]);
        assert_eq!(rig.effects(), wanted.unwrap().effects(), "{}", &old[..80]);
    }
}

#[test]
fn windows_line_ends_a_missing_last_one_and_a_byte_order_mark_survive() {
    let unix = format!("\u{feff}{}", RigParameters::BASELINE_TOML.trim_end());
    let old = unix.replace('\n', "\r\n");
    let changed = [quantity("parameter:kv-scale", 1.05, "", Some(1.0))];
    let new = extend(&old, "rig.toml", &[leakage()], &changed, Axis::Drive, &records()).unwrap();
    assert_eq!(new.matches('\n').count(), new.matches("\r\n").count());
    assert!(new.starts_with('\u{feff}') && new.matches('\u{feff}').count() == 1);
    let same = extend(&unix, "rig.toml", &[leakage()], &changed, Axis::Drive, &records()).unwrap();
    assert_eq!(new.replace("\r\n", "\n"), same);
}

#[test]
fn unusual_tables_keep_their_layout() {
    let base = RigParameters::BASELINE_TOML;
    let head = base.find("[gas]").unwrap();
    let old = base[head..].replace(
        "kv_supply_m3_per_h = [0.0, 0.0, 0.115, 0.36, 0.60, 0.66]",
        "  kv_supply_m3_per_h = [ # measured\n    0, 0.0,\n    0.115, 36e-2, # here\n    0.60, 0.66 ]",
    );
    let old = format!(
        "supply = {{ pressure_bar = 7, exhaust_pressure_bar = 1.01325, atmospheric_pressure_bar = 1.01325, \
         discharge_time_constant_s = 0.05, recovery_time_constant_s = 0.3, check_valve_pressure_bar = 2.5 }}\n{old}"
    );
    let changed = [
        quantity("parameter:supply-pressure", 7.3, "bar", Some(7.0)),
        quantity("parameter:kv-scale", 2.0, "", None),
    ];
    let new = extend(&old, "rig.toml", &[], &changed, Axis::Drive, &records()).unwrap();
    assert!(new.starts_with("# was 7; 7.300 +- 0.073 bar, by parameter:supply-pressure"), "{new}");
    assert!(new.contains("supply = { pressure_bar = 7.3, exhaust"), "{new}");
    assert!(new.contains("[ # measured\n    0.0, 0.0,\n    0.23, 0.72, # here\n    1.2, 1.32 ]\n"), "{new}");
    assert!(new.contains("  # was [0, 0.0, 0.115, 36e-2, 0.60, 0.66]; times 2.000 +- 0.020, by"), "{new}");
}

#[test]
fn what_no_rig_can_hold_is_refused_with_what_could_be() {
    let says = |additions: &[Addition], changed: &[Quantity], parts: &[&str]| {
        let message = refused(additions, changed);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    let leak = |numbers: &[_]| addition("piston-leakage", "drive", numbers);
    says(&[addition("gremlins", "drive", &[])], &[], &["gremlins", "piston-leakage"]);
    says(&[addition("piston-leakage", "drive.a", &[])], &[], &["drive.a", "drive, load"]);
    says(&[leak(&[("size", 1.0, None)])], &[], &["size", "leakage_nl_per_min"]);
    let out_of_range = "effects.piston-leakage.drive.leakage_nl_per_min = 1000000.0 is out of range";
    says(&[leak(&[("leakage_nl_per_min", 1e6, None)])], &[], &[out_of_range, "Nl/min"]);
    says(&[leak(&[("leakage_nl_per_min", f64::NAN, None)])], &[], &["leakage_nl_per_min = NaN"]);
    says(&[leakage(), leakage()], &[], &["piston-leakage at drive", "twice"]);
    says(&[leak(&[])], &[], &["missing", "leakage_nl_per_min"]);
    says(&[], &[quantity("parameter:colour", 1.0, "", None)], &["colour", "parameter:mass"]);
    says(&[], &[quantity("parameter:mass", 5e3, "g", Some(5.0))], &["\"g\"", "\"kg\""]);
    let pressure = quantity("parameter:supply-pressure", 20.0, "bar", Some(7.0));
    says(&[], &[pressure], &["supply.pressure_bar = 20.0 is out of range; allowed: 3 to 12 bar"]);
    let twice = quantity("parameter:flow-lag", 1.1, "", None);
    says(&[], &[twice.clone(), twice], &["valve.flow_lag_time_constant_ms", "twice"]);
    let broken = extend("[supply", "rig.toml", &[], &[], Axis::Drive, &[]).unwrap_err().to_string();
    assert!(broken.contains("rig.toml:1: not TOML"), "{broken}");
}

#[test]
fn a_records_name_cannot_break_out_of_its_comment() {
    let records = ["a\nb = 1\r\u{7f}.csv".to_owned()];
    let new =
        extend(RigParameters::BASELINE_TOML, "rig.toml", &[leakage()], &[], Axis::Drive, &records).unwrap();
    assert!(new.contains("# Found from a\u{fffd}b = 1\u{fffd}\u{fffd}.csv."));
}

#[test]
fn comments_are_rounded_to_the_second_digit_of_the_error() {
    assert_eq!(quantity_text(2.513_17, Some(0.0412), "N"), "2.513 +- 0.041 N");
    assert_eq!(quantity_text(412_500.3, Some(1234.0), ""), "412500 +- 1234");
    assert_eq!(quantity_text(7.0, None, "bar"), "7 bar, not bounded by the records");
}

#[test]
fn tables_stand_at_the_end_with_their_source_and_the_line_ends_of_the_file() {
    let table = Tabulated {
        axis: Axis::Load,
        balance: Balance::FlowA,
        variable: Variable::PressureA,
        at: vec![1e5, 1e6 / 3.0],
        value: vec![0.0, -2.5],
    };
    let windows = RigParameters::BASELINE_TOML.replace('\n', "\r\n");
    for text in [RigParameters::BASELINE_TOML, RigParameters::BASELINE_TOML.trim_end(), &windows] {
        let one = add_tables(text, "rig.toml", std::slice::from_ref(&table), &["a.csv".to_owned()]).unwrap();
        assert!(one.starts_with(text) && one.contains("# Found from a.csv."));
        assert!(!text.contains('\r') || one.matches('\n').count() == one.matches("\r\n").count());
        let two = add_tables(&one, "rig.toml", std::slice::from_ref(&table), &[]).unwrap();
        let rig = RigParameters::from_toml(&two, "rig.toml").unwrap();
        assert_eq!(rig.tabulated(), [table.clone(), table.clone()]);
    }
    assert_eq!(add_tables("nothing", "rig.toml", &[], &[]).unwrap(), "nothing");
    let inline = format!("tabulated = []\n{}", RigParameters::BASELINE_TOML);
    let error = add_tables(&inline, "rig.toml", &[table], &[]).unwrap_err().to_string();
    assert!(error.contains("rig.toml") && error.contains("a table"), "{error}");
}

#[test]
fn a_number_of_the_file_is_changed_where_it_stands_and_its_neighbours_stay() {
    let text = RigParameters::BASELINE_TOML;
    let changed = [
        quantity("cylinder.dead_volume_cm3", 24.5, "cm^3", Some(20.0)),
        quantity("valve.kv_supply_m3_per_h[2]", 0.125, "m^3/h", Some(0.115)),
        quantity("valve.kv_supply_m3_per_h[4]", 0.61, "m^3/h", Some(0.6)),
    ];
    let new = extend(text, "rig.toml", &[], &changed, Axis::Drive, &records()).unwrap();
    let rig = RigParameters::from_toml(&new, "rig.toml").unwrap();
    assert_eq!(rig.numbers("valve.kv_supply_m3_per_h"), [0.0, 0.0, 0.125, 0.36, 0.61, 0.66]);
    assert_eq!(rig.numbers("cylinder.dead_volume_cm3"), [24.5]);
    let comment = "# was 0.115; 0.1250 +- 0.0013 m^3/h, by valve.kv_supply_m3_per_h[2] from a.csv, b.csv";
    assert!(new.contains(comment), "{new}");
    assert_eq!(new_lines(text, &new).len(), 5);
}

#[test]
fn a_number_of_the_file_is_refused_where_it_is_none() {
    let refused = |changed: &[Quantity]| refused(&[], changed);
    let volume = quantity("cylinder.dead_volume_cm3", 24.5, "cm^3", Some(20.0));
    assert!(refused(&[volume.clone(), volume.clone()]).contains("changed twice"));
    assert!(refused(&[Quantity { unit: "l".to_owned(), ..volume.clone() }]).contains("\"cm^3\""));
    assert!(refused(&[Quantity { value: f64::NAN, ..volume.clone() }]).contains("no finite number"));
    assert!(refused(&[Quantity { value: 500.0, ..volume }]).contains("refused"));
    let point = quantity("valve.kv_supply_m3_per_h[2]", 0.125, "m^3/h", Some(0.115));
    for name in [
        "valve.kv_supply_m3_per_h[6]",
        "valve.kv_supply_m3_per_h",
        "cylinder.dead_volume_cm3[0]",
        "valve.no_key",
    ] {
        let unknown = Quantity { name: name.to_owned(), ..point.clone() };
        assert!(refused(&[unknown]).contains("unknown parameter"), "{name}");
    }
    let scale = Quantity { unit: String::new(), ..quantity("parameter:kv-scale", 1.02, "", Some(1.0)) };
    for both in [[point.clone(), scale.clone()], [scale, point]] {
        assert!(refused(&both).contains("changed twice"));
    }
}

const EDDY: &str = "[[suspects]]\nname = \"eddy\"\nplace = \"drive.force\"\nadd = \"-(c0 + c1*x)*v\"\n\
    parameters.c0 = { unit = \"N s/m\", range = [0, 200] }\nparameters.c1 = { unit = \"N s/m^2\", range = [-500, 500] }\n";

/// The report's words for the suspect with these numbers.
fn eddy(c0: f64, c1: f64) -> (NamedEffect, DeclaredSuspect) {
    let suspect = crate::suspects::read(EDDY, "s.toml").expect("good")[0].reported();
    let number = |name: &str, value, unit: &str| quantity(name, value, unit, Some(0.0));
    let effect = NamedEffect {
        effect: suspect.effect.clone(),
        place: suspect.place.clone(),
        parameters: vec![number("c0", c0, "N s/m"), number("c1", c1, "N s/m^2")],
        share_explained: 0.9,
        amplitude_variation: None,
        alternatives: Vec::new(),
    };
    (effect, suspect)
}

#[test]
fn a_named_suspect_stands_at_the_end_as_a_term_and_another_close_renews_its_numbers() {
    let extended = |text: &str, (effect, suspect): &(NamedEffect, DeclaredSuspect)| {
        add_terms(text, "rig.toml", &[(effect, suspect)], &records())
    };
    for text in [RigParameters::BASELINE_TOML, &RigParameters::BASELINE_TOML.replace('\n', "\r\n")] {
        let one = extended(text, &eddy(41.5, 100.0 / 3.0)).unwrap();
        assert!(one.starts_with(text) && one.contains("# Found from a.csv, b.csv: c0 = 41.5"), "{one}");
        assert!(!text.contains('\r') || one.matches('\n').count() == one.matches("\r\n").count());
        let numbers = |text: &str| -> Vec<f64> {
            let rig = RigParameters::from_toml(text, "rig.toml").unwrap();
            assert_eq!(rig.terms().len(), 1);
            rig.terms()[0].numbers().iter().map(|number| number.value).collect()
        };
        assert_eq!(numbers(&one), [41.5, 100.0 / 3.0]);
        let two = extended(&one, &eddy(50.25, -1.5)).unwrap();
        assert_eq!(numbers(&two), [50.25, -1.5]);
        assert_eq!(two.lines().count(), one.lines().count() + 1, "the comment");
    }
    let error = extended(RigParameters::BASELINE_TOML, &eddy(900.0, 0.0)).unwrap_err().to_string();
    assert!(error.contains("c0 = 900: allowed are 0 to 200"), "{error}");
}
