//! The rig file and its table: one truth, and a message for every way to get it wrong.

use plant::RigParameters;
use plant::parameters::table::{KEYS, Key};

/// Places of the table of a key, and of the key itself.
fn lines_of(key: &Key, lines: &[&str]) -> [usize; 2] {
    let header = format!("[{}]", key.table);
    let starts = |line: &&str| line.starts_with(&format!("{} = ", key.name));
    let table =
        lines.iter().position(|line| *line == header).unwrap_or_else(|| panic!("{header} is missing"));
    let at = lines[table..].iter().position(starts).unwrap_or_else(|| panic!("{key} is missing"));
    [table, table + at]
}

#[test]
fn the_shipped_file_says_what_the_table_says() {
    let lines: Vec<&str> = RigParameters::BASELINE_TOML.lines().collect();
    let mut place = 0;
    for key in KEYS {
        let [_, at] = lines_of(key, &lines);
        assert!(at > place, "{key} does not stand in the table's order");
        assert_eq!(lines[at - 1], key.comment(), "the comment above {key}, rig.toml:{at}");
        place = at;
    }
    let keys = lines.iter().filter(|line| line.contains(" = ") && !line.starts_with('#')).count();
    assert_eq!(keys, KEYS.len());
}

#[test]
fn the_baseline_is_that_of_rig_model_md() {
    let rig = RigParameters::baseline();
    assert_eq!(rig.supply().pressure_pa, 7e5);
    assert_eq!(rig.supply().exhaust_pressure_pa, 101_325.0);
    assert_eq!(rig.supply().atmospheric_pressure_pa, 101_325.0);
    assert_eq!(rig.supply().discharge_time_constant_s, 0.05);
    assert_eq!(rig.supply().recovery_time_constant_s, 0.3);
    assert_eq!(rig.supply().check_valve_pressure_pa, 2.5e5);
    assert_eq!((rig.gas().normal_pressure_pa, rig.gas().temperature_k), (101_325.0, 293.15));
    assert_eq!(rig.valve().spool_time_constant_s, 1.6e-3);
    assert_eq!(rig.valve().flow_lag_time_constant_s, 8e-3);
    assert_eq!(rig.valve().opening, [0.0, 0.03, 0.2, 0.5, 0.8, 1.0]);
    assert_eq!(rig.valve().kv_supply_m3_per_h, [0.0, 0.0, 0.115, 0.36, 0.60, 0.66]);
    assert_eq!(rig.valve().kv_exhaust_m3_per_h, [0.0, 0.0, 0.095, 0.30, 0.52, 0.58]);
    assert_eq!(rig.cylinder().stroke_m, 0.5);
    assert_eq!(rig.cylinder().piston_area_m2, 1963.5e-6);
    assert_eq!(rig.cylinder().annulus_area_m2, 1649.3e-6);
    assert_eq!(rig.cylinder().dead_volume_m3, 20e-6);
    assert_eq!((rig.friction().break_away_force_n, rig.friction().sliding_force_n), (35.0, 26.0));
    assert_eq!(rig.friction().viscous_n_s_per_m, 1100.0);
    assert_eq!((rig.mass().drive_kg, rig.mass().carriage_kg, rig.mass().load_kg), (5.0, 3.5, 1.5));
    assert_eq!(rig.mass().added_limit_kg, 20.0);
    assert_eq!(rig.linkage().gap_m, 0.2e-3);
    assert_eq!((rig.linkage().stiffness_n_per_m, rig.linkage().damping_n_s_per_m), (2e6, 2e3));
    assert_eq!(rig.start().rod_side_pressure_pa, 3.5e5);
    let sensors = rig.sensors();
    assert_eq!(sensors.position_step_m(), 0.5 / 65535.0);
    assert_eq!(sensors.force_step_n(), 2000.0 / 32767.0);
    assert_eq!(sensors.pressure_step_pa(), 1e6 / 16383.0);
    assert_eq!((sensors.position_noise_m, sensors.load_position_offset_m), (20e-6, 0.8e-3));
    assert_eq!((sensors.force_noise_n, sensors.pressure_noise_pa), (0.5, 400.0));
}

/// The shipped file with one line replaced, and the number of that line.
fn edited(from: &str, to: &str) -> (String, usize) {
    let text = RigParameters::BASELINE_TOML;
    let line = 1 + text.lines().position(|line| line == from).unwrap_or_else(|| panic!("no line {from}"));
    (text.replacen(&format!("\n{from}\n"), &format!("\n{to}\n"), 1), line)
}

/// A key, what stands in place of its number, and what the message says of it.
const VALUES: &[(&str, &str, &str)] = &[
    ("supply.pressure_bar", "99", " is out of range; allowed: 3 to 12 bar"),
    ("supply.pressure_bar", "-7.0", " is out of range; allowed: 3 to 12 bar"),
    ("supply.pressure_bar", "nan", " is out of range; allowed: 3 to 12 bar"),
    ("supply.pressure_bar", "inf", " is out of range; allowed: 3 to 12 bar"),
    ("supply.pressure_bar", "\"7\"", "; allowed is 3 to 12 bar"),
    ("supply.pressure_bar", "[7.0]", "; allowed is 3 to 12 bar"),
    ("supply.pressure_bar", "true", "; allowed is 3 to 12 bar"),
    ("sensors.position_bits", "15.5", " is out of range; allowed: a whole number, 8 to 16 bits"),
    ("valve.opening", "[0.0, 0.03, 0.2, 0.5, 1.0]", "; allowed is 6 numbers, each 0 to 1"),
    ("valve.opening", "[0.0, 0.03, 0.2, 0.5, 0.8, 1.2]", " is out of range; allowed: 6 numbers, each 0 to 1"),
    (
        "valve.opening",
        "[0.0, 0.03, 0.5, 0.2, 0.8, 1.0]",
        " contradicts another key: the openings must start at 0, grow by at least 0.001, and end at 1",
    ),
    (
        "valve.kv_supply_m3_per_h",
        "[0.0, 0.0, 0.115, 0.36, 0.60, 0.5]",
        " contradicts another key: K_V must be 0 at opening 0 and never fall with valve.opening",
    ),
    (
        "valve.kv_exhaust_m3_per_h",
        "[0.1, 0.1, 0.2, 0.30, 0.52, 0.58]",
        " contradicts another key: K_V must be 0 at opening 0 and never fall with valve.opening",
    ),
    (
        "cylinder.annulus_area_mm2",
        "1963.5",
        " contradicts another key: it must be below cylinder.piston_area_mm2 = 1963.5",
    ),
    (
        "friction.sliding_force_n",
        "36",
        " contradicts another key: it must not be above friction.break_away_force_n = 35",
    ),
    ("mass.carriage_kg", "5", " contradicts another key: it must be below mass.drive_kg = 5.0"),
    (
        "supply.atmospheric_pressure_bar",
        "1.1",
        " contradicts another key: it must not be above supply.exhaust_pressure_bar = 1.01325",
    ),
    (
        "start.rod_side_pressure_bar",
        "8",
        " contradicts another key: it must lie between \
         supply.exhaust_pressure_bar = 1.01325 and supply.pressure_bar = 7.0",
    ),
];

/// A line, what stands in its place, and the whole message.
const LINES: &[(&str, &str, &str)] = &[
    (
        "pressure_bar = 7.0",
        "pressure_psi = 100",
        "unknown key supply.pressure_psi; allowed is pressure_bar, exhaust_pressure_bar, \
         atmospheric_pressure_bar, discharge_time_constant_s, recovery_time_constant_s, check_valve_pressure_bar",
    ),
    (
        "[gas]",
        "[plasma]",
        "unknown key plasma; allowed is supply, gas, valve, cylinder, friction, mass, linkage, start, sensors, \
         effects, tables, tabulated, terms",
    ),
    ("gap_mm = 0.2", "gap_mm = 0.2 mm", "not TOML: "),
];

#[test]
fn every_mistake_is_named_with_file_line_key_value_and_range() {
    let refused = |from: &str, to: &str, message: &str| {
        let (text, line) = edited(from, to);
        let error = RigParameters::from_toml(&text, "my-rig.toml").expect_err(to).to_string();
        let wanted = format!("my-rig.toml:{line}: {message}");
        assert!(error.starts_with(&wanted), "\n   got {error}\nwanted {wanted}");
    };
    for (path, value, message) in VALUES {
        let start = format!("{} = ", path.split_once('.').expect("a table and its key").1);
        let mut lines = RigParameters::BASELINE_TOML.lines();
        let line = lines.find(|line| line.starts_with(&start)).expect("a line of the key");
        refused(line, &format!("{start}{value}"), &format!("{path} = {value}{message}"));
    }
    LINES.iter().for_each(|(from, to, message)| refused(from, to, message));
}

#[test]
fn every_key_is_required_and_its_absence_is_named() {
    for key in KEYS {
        let mut lines: Vec<&str> = RigParameters::BASELINE_TOML.lines().collect();
        let [table, at] = lines_of(key, &lines);
        lines.remove(at);
        let error =
            RigParameters::from_toml(&lines.join("\n"), "f.toml").expect_err("incomplete").to_string();
        let wanted = format!("f.toml:{}: {key} is missing; allowed is {}", table + 1, key.range());
        assert_eq!(error, wanted);
    }
    let error = RigParameters::from_toml("", "empty.toml").expect_err("incomplete").to_string();
    assert!(
        error.starts_with("empty.toml:1: supply.pressure_bar is missing; allowed is 3 to 12 bar"),
        "{error}"
    );
}

#[test]
fn every_key_is_refused_just_outside_its_range() {
    let rig = RigParameters::baseline();
    let numbers = |key: &Key, value: f64| vec![value; key.count];
    for key in KEYS {
        for value in
            [key.min - 1e-6 * key.min.abs().max(1.0), key.max * (1.0 + 1e-6), f64::NAN, f64::INFINITY]
        {
            let error = rig.with(&key.path(), &numbers(key, value)).expect_err("out of range").to_string();
            assert!(error.contains(&key.path()) && error.contains(&key.range()), "{error}");
        }
        assert!(rig.with(&key.path(), &[]).is_err(), "{key} without a number");
    }
    assert!(rig.with("supply.colour", &[1.0]).is_err());
}

#[test]
fn a_changed_key_changes_its_number_alone() {
    let rig = RigParameters::baseline();
    let changed = rig.with("mass.load_kg", &[2.0]).expect("in range");
    assert_eq!(changed.mass().load_kg, 2.0);
    assert_eq!(changed.with("mass.load_kg", &[1.5]).expect("in range").mass(), rig.mass());
    assert_eq!(changed.cylinder(), rig.cylinder());
}

#[test]
fn a_rig_is_written_in_si_with_the_unit_in_the_key() {
    let json = serde_json::to_value(RigParameters::baseline()).expect("plain numbers");
    assert_eq!(json["supply"]["pressure_pa"], 7e5);
    assert_eq!(json["valve"]["opening"][1], 0.03);
    assert_eq!(json["sensors"]["position_bits"], 16);
}
