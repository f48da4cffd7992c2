//! Forces: steps at a position, loads in a row, the limits, what is remembered.

use super::*;
use crate::experiment::SetPoints;
use crate::set_point::tests::set_points;

fn read(segments: &str) -> Result<ForceSource, String> {
    match set_points("load", "force_limit_n = 500\ninitial_force_n = 100", segments)? {
        SetPoints::Forces(profile) => Ok(ForceSource::new(profile)),
        SetPoints::Positions(_) => panic!("a row of positions"),
    }
}

fn source(segments: &str) -> ForceSource {
    read(segments).unwrap_or_else(|error| panic!("{error}"))
}

fn at(position_m: f64) -> Actual {
    Actual { position_m, ..Actual::default() }
}

#[test]
fn a_row_of_forces_begins_with_the_initial_force_and_goes_on_where_it_stood() {
    let mut source = source(
        "law = 'rest'; duration_s = 1 + law = 'ramp'; to_n = 300; duration_s = 2 + law = 'step'; to_n = 50; duration_s = 1 \
         + law = 'constant'; force_n = 80; duration_s = 1",
    );
    let mut force_n = |time_s| source.at(time_s, &at(0.2)).force_n;
    assert_eq!([force_n(-1.0), force_n(0.5), force_n(2.0), force_n(3.0)], [100.0, 100.0, 200.0, 50.0]);
    assert_eq!([force_n(4.5), force_n(5.0)], [80.0, 80.0]);
    assert_eq!(source.at(2.0, &at(0.2)).rate_n_per_s, 100.0);
    assert_eq!((source.profile.duration_s(), source.end()), (5.0, ForceSetPoint::at_rest(80.0)));
}

#[test]
fn a_step_comes_when_the_axis_passes_the_position_in_its_direction() {
    let way = [0.1, 0.19, 0.2, 0.21, 0.18, 0.25];
    for (direction, first) in [("positive", 2), ("negative", 4), ("any", 2)] {
        let mut source = source(&format!(
            "law = 'step'; to_n = 300; at_position_m = 0.2; direction = '{direction}'; duration_s = 2"
        ));
        let points: Vec<ForceSetPoint> = (0..)
            .zip(way)
            .map(|(cycle, position_m)| source.at(f64::from(cycle) * 1e-3, &at(position_m)))
            .collect();
        let stepped: Vec<bool> = points.iter().map(|point| point.force_n == 300.0).collect();
        assert_eq!(stepped, (0..6).map(|cycle| cycle >= first).collect::<Vec<_>>(), "{direction}");
        let moving: Vec<usize> = (0..6).filter(|cycle| points[*cycle].moving).collect();
        assert_eq!(moving, [first], "{direction}: it moves in the cycle of the step");
    }
}

#[test]
fn a_step_at_a_position_that_is_never_passed_comes_at_the_end() {
    let mut source = source("law = 'step'; to_n = 300; at_position_m = 0.2; duration_s = 1");
    let forces: Vec<f64> = [0.0, 0.5, 0.998, 1.0].map(|time_s| source.at(time_s, &at(0.3)).force_n).into();
    assert_eq!(forces, [100.0, 100.0, 100.0, 300.0], "the axis began beyond the position");
}

#[test]
fn a_reset_forgets_that_the_axis_has_passed() {
    let mut source = source("law = 'step'; to_n = 300; at_position_m = 0.2; duration_s = 1");
    let _ = [0.1, 0.3].map(|position_m| source.at(0.1, &at(position_m)));
    assert_eq!(source.at(0.2, &at(0.3)).force_n, 300.0);
    source.reset();
    assert_eq!(source.at(0.0, &at(0.3)).force_n, 100.0);
}

#[test]
fn a_step_at_a_position_in_a_later_segment_triggers_on_its_own() {
    let step = "law = 'step'; at_position_m = 0.2; duration_s = 1";
    let mut source = source(&format!("{step}; to_n = 300 + {step}; to_n = 50"));
    let _ = [0.1, 0.3].map(|position_m| source.at(0.1, &at(position_m)));
    assert_eq!(source.at(1.0, &at(0.3)).force_n, 300.0, "not passed in the second one yet");
    assert_eq!(source.at(1.1, &at(0.1)).force_n, 50.0);
}

#[test]
fn loads_stand_on_their_base_force_and_oppose_the_drive() {
    let fast = Actual { position_m: 0.3, velocity_m_per_s: 0.2, acceleration_m_per_s2: 3.0 };
    for (law, force_n, rate_n_per_s) in [
        ("law = 'spring'; stiffness_n_per_m = 1000; rest_position_m = 0.2", 200.0, 200.0),
        ("law = 'damper'; damping_n_s_per_m = 400", 180.0, 1200.0),
        ("law = 'mass'; mass_kg = 10", 130.0, 0.0),
        // tanh(20) is 1 to the last bit, and its slope 0.
        ("law = 'dry-friction'; force_n = 60", 160.0, 0.0),
    ] {
        let point = source(&format!("{law}; duration_s = 1")).at(0.5, &fast);
        // 0.3 - 0.2 carries a rounding of 3e-17, times 1000.
        assert!((point.force_n - force_n).abs() < 1e-12, "{law}: {point:?}");
        assert!((point.rate_n_per_s - rate_n_per_s).abs() < 1e-9 && point.moving, "{law}: {point:?}");
        let based = source(&format!("{law}; duration_s = 1; base_force_n = 0")).at(0.5, &fast);
        assert!((based.force_n - (force_n - 100.0)).abs() < 1e-12, "{law}: {based:?}");
    }
}

#[test]
fn an_axis_only_presses_and_only_up_to_its_limit() {
    let mut source = source("law = 'damper'; damping_n_s_per_m = 1000; duration_s = 1");
    for (velocity_m_per_s, force_n) in [(-0.5, 0.0), (0.7, 500.0), (f64::NAN, 0.0)] {
        let actual = Actual { velocity_m_per_s, acceleration_m_per_s2: 1.0, ..Actual::default() };
        let point = source.at(0.1, &actual);
        assert_eq!((point.force_n, point.rate_n_per_s), (force_n, 0.0), "{velocity_m_per_s} m/s");
    }
    let broken = Actual { acceleration_m_per_s2: f64::NAN, ..Actual::default() };
    assert_eq!(source.at(0.1, &broken).rate_n_per_s, 0.0);
}

#[test]
fn nothing_jumps_when_a_load_of_the_axis_ends() {
    let mut source =
        source("law = 'spring'; stiffness_n_per_m = 1000; rest_position_m = 0.2; duration_s = 1");
    assert!((source.at(0.999, &at(0.25)).force_n - 150.0).abs() < 1e-12);
    let end = source.at(1.0, &at(0.4));
    assert!((end.force_n - 150.0).abs() < 1e-12 && !end.moving);
    assert_eq!(source.end(), end);
    source.reset();
    assert_eq!(source.end(), ForceSetPoint::at_rest(100.0), "the base force");
}

#[test]
fn a_bad_force_is_refused_with_line_key_value_and_range() {
    for (law, hints) in [
        ("'step'; to_n = 501; duration_s = 1", ["e.toml:8: load.set-point[1].to_n = 501 N", "0 to 500 N"]),
        (
            "'sine'; amplitude_n = 120; frequency_hz = 1; duration_s = 1",
            ["goes from -20 to 220 N", "0 to 500 N"],
        ),
        ("'mass'; mass_kg = -1; duration_s = 1", ["mass_kg = -1 kg", "0 to 200 kg"]),
        ("'spring'; stiffness_n_per_m = 1; duration_s = 1", ["rest_position_m is missing", "0 to 0.5 m"]),
        (
            "'damper'; damping_n_s_per_m = nan; duration_s = 1",
            ["damping_n_s_per_m = NaN", "0 to 10000 N s/m"],
        ),
        ("'dry-friction'; force_n = 600; duration_s = 1", ["force_n = 600 N", "0 to 500 N"]),
        ("'damper'; damping_n_s_per_m = 1", ["duration_s is missing", "0.001 to 86400 s"]),
        ("'step'; to_n = 5; duration_s = 1; at_position_m = 0.6", ["at_position_m = 0.6 m", "0 to 0.5 m"]),
        (
            "'step'; to_n = 5; duration_s = 1; direction = 'any'",
            ["unknown key load.set-point[1].direction", "to_n"],
        ),
    ] {
        let message = read(&format!("law = {law}")).unwrap_err();
        hints.iter().for_each(|hint| assert!(message.contains(hint), "'{hint}' is missing in: {message}"));
    }
}
