//! What all laws of time have in common: derivatives, joints, limits.

use super::*;
use crate::experiment::{Experiment, SetPoints};
use std::path::Path;

const STROKE_M: f64 = 0.5;

/// The motion of a drive that starts at 0.2 m with these segments.
pub(super) fn motion(segments: &str) -> Motion {
    read(segments).unwrap_or_else(|error| panic!("{error}"))
}

fn read(segments: &str) -> Result<Motion, String> {
    match set_points("drive", "start_m = 0.2", segments)? {
        SetPoints::Positions(motion) => Ok(motion),
        SetPoints::Forces(_) => panic!("a row of forces"),
    }
}

pub(super) fn set_points(axis: &str, keys: &str, segments: &str) -> Result<SetPoints, String> {
    let head = format!("[[{axis}.set-point]]\n");
    let segments = segments.replace(" + ", &format!("\n{head}")).replace("; ", "\n");
    let text = format!("title = \"t\"\n[{axis}]\nprogram = \"p\"\n{keys}\n{head}{segments}");
    let Experiment { drive, load, .. } =
        Experiment::from_toml(&text, Path::new("e.toml"), STROKE_M).map_err(|error| error.to_string())?;
    Ok(drive.or(load).unwrap().set_points)
}

/// Laws whose position and velocity are continuous everywhere.
const SMOOTH: [&str; 6] = [
    "law = 'bestehorn'; to_m = 0.4; duration_s = 1.5",
    "law = 'modified-sine'; to_m = 0.05; duration_s = 1.5",
    "law = 'trapezoidal'; to_m = 0.4; velocity_m_per_s = 0.3; acceleration_m_per_s2 = 0.8",
    "law = 'trapezoidal'; to_m = 0.21; velocity_m_per_s = 0.3; acceleration_m_per_s2 = 0.8",
    "law = 'sine'; amplitude_m = 0.1; frequency_hz = 1.3; duration_s = 2.1; fade_s = 0.8",
    "law = 'chirp'; amplitude_m = 0.1; from_hz = 0.3; to_hz = 4; duration_s = 3; fade_s = 0.5",
];

/// Laws whose rate jumps at their ends alone.
const KINKED: [&str; 3] = [
    "law = 'ramp'; to_m = 0.4; duration_s = 1.5",
    "law = 'sine'; amplitude_m = 0.1; frequency_hz = 1; duration_s = 2.5",
    "law = 'chirp'; amplitude_m = 0.1; from_hz = 4; to_hz = 1; duration_s = 2",
];

#[test]
fn velocity_and_acceleration_are_the_derivatives() {
    const STEP_S: f64 = 1e-6;
    for law in SMOOTH.iter().chain(&KINKED) {
        let motion = motion(law);
        for index in 1..997 {
            let time_s = motion.duration_s() * f64::from(index) / 997.0;
            let [before, now, after] = [-STEP_S, 0.0, STEP_S].map(|off_s| motion.at(time_s + off_s));
            let slope = (after.position_m - before.position_m) / (2.0 * STEP_S);
            // Central difference: jerks below 4000 m/s^3 times 1e-12 / 6, and roundings of 1e-16 / 1e-6.
            assert!((slope - now.velocity_m_per_s).abs() < 1e-6, "{law} at {time_s} s: {slope}, {now:?}");
            let slope = (after.velocity_m_per_s - before.velocity_m_per_s) / (2.0 * STEP_S);
            let off = (slope - now.acceleration_m_per_s2).abs();
            // The fourth derivative, below 2e5 m/s^4, times 1e-12 / 6, and roundings of 1e-15 / 1e-6.
            assert!(off < 1e-6, "{law} at {time_s} s: {slope}, {now:?}");
        }
    }
}

#[test]
fn smooth_laws_begin_and_end_at_rest_where_they_say() {
    for law in SMOOTH {
        let motion = motion(law);
        // A nanosecond before the end the row has gone on already.
        for (at, where_m) in [(motion.at(0.0), 0.2), (motion.at(motion.duration_s() - 2e-9), motion.end_m())]
        {
            // 2e-9 s times accelerations below 100 m/s^2.
            assert!((at.position_m - where_m).abs() < 1e-12, "{law}: {at:?}");
            assert!(at.velocity_m_per_s.abs() < 1e-6, "{law}: {at:?}");
        }
        assert_eq!(motion.at(motion.duration_s()), SetPoint::at_rest(motion.end_m()), "{law}");
        assert_eq!(motion.at(-1.0), SetPoint::at_rest(0.2), "{law}");
        assert_eq!(motion.at(1e9), SetPoint::at_rest(motion.end_m()), "{law}");
    }
}

#[test]
fn a_row_goes_on_where_it_stood() {
    let rest = "law = 'rest'; duration_s = 0.1";
    let all: Vec<&str> = SMOOTH.iter().chain(&KINKED).flat_map(|law| [*law, rest]).collect();
    let motion = motion(&all.join(" + "));
    let mut last_m = motion.start_m();
    for micro in (0..(motion.duration_s() * 1e4) as i64).map(|tick| tick as f64 * 1e-4) {
        let now_m = motion.at(micro).position_m;
        // No law is faster than 2.6 m/s: 0.1 m at 4 Hz.
        assert!((now_m - last_m).abs() < 2.6e-4, "{micro} s: {last_m} to {now_m} m");
        assert!((0.0..=STROKE_M).contains(&now_m));
        last_m = now_m;
    }
    assert!((motion.end_m() - 0.4).abs() < 1e-15);
}

#[test]
fn the_sine_starts_upwards_and_ends_where_it_started() {
    let motion = motion("law = 'sine'; amplitude_m = 0.1; frequency_hz = 1; duration_s = 2.5");
    assert_eq!(motion.at(0.0).position_m, 0.2);
    assert!((motion.at(0.25).position_m - 0.3).abs() < 1e-15);
    assert_eq!(motion.end_m(), 0.2);
}

#[test]
fn the_chirp_has_each_frequency_in_its_time() {
    let motion = motion("law = 'chirp'; amplitude_m = 0.1; from_hz = 1; to_hz = 5; duration_s = 10");
    // Where it passes the middle its velocity is amplitude times 2 pi f; f = 1 + 0.4 t, and its phase is whole at 5 s: 10 turns.
    let expected = 0.1 * std::f64::consts::TAU * 3.0;
    assert!((motion.at(5.0).velocity_m_per_s - expected).abs() < 1e-12);
}

#[test]
fn a_step_moves_for_one_cycle_and_holds() {
    let motion = motion("law = 'rest'; duration_s = 0.3 + law = 'step'; to_m = 0.3; duration_s = 0.5");
    let points: Vec<SetPoint> = (0..900).map(|cycle| motion.at(f64::from(cycle) * 1e-3)).collect();
    assert_eq!(points[299], SetPoint::at_rest(0.2));
    assert_eq!(points[300], SetPoint { moving: true, ..SetPoint::at_rest(0.3) });
    assert!(points[301..].iter().all(|point| *point == SetPoint::at_rest(0.3)));
}

#[test]
fn what_would_leave_the_stroke_is_refused() {
    for (law, hint) in [
        ("'sine'; amplitude_m = 0.21; frequency_hz = 1; duration_s = 1", "goes from -0.0"),
        ("'chirp'; amplitude_m = 0.22; from_hz = 1; to_hz = 1; duration_s = 1", "goes from -0.0"),
        ("'pseudo-random-steps'; amplitude_m = 0.24; hold_s = 0.1; duration_s = 1", "goes from -0.0"),
        ("'step'; to_m = 0.51; duration_s = 1", "to_m = 0.51 m"),
    ] {
        let message = read(&format!("law = {law}")).unwrap_err();
        [hint, "0 to 0.5 m"]
            .iter()
            .for_each(|hint| assert!(message.contains(hint), "'{hint}' is missing in: {message}"));
        assert!(message.starts_with("e.toml:") && message.contains(": drive.set-point[1]."), "{message}");
    }
}

#[test]
fn an_oscillation_that_would_end_off_the_middle_is_refused_with_a_duration_that_would_not() {
    let message = read("law = 'sine'; amplitude_m = 0.1; frequency_hz = 2; duration_s = 1.1").unwrap_err();
    assert!(message.contains("duration_s = 1.1 s") && message.contains("such as 1 or 1.25 s"), "{message}");
    let message =
        read("law = 'sine'; amplitude_m = 0.1; frequency_hz = 2; duration_s = 1; fade_s = 0.6").unwrap_err();
    assert!(message.contains("fade_s = 0.6 s; allowed is 0 to 0.5 s"), "{message}");
}

#[test]
fn the_same_file_gives_the_same_steps() {
    let law = "law = 'pseudo-random-steps'; amplitude_m = 0.1; hold_s = 0.05; duration_s = 5; levels = 5";
    let [one, same, other] =
        [law.to_owned(), law.to_owned(), format!("{law}; seed = 2")].map(|law| motion(&law));
    let trajectory =
        |motion: &Motion| (0..5000).map(|cycle| motion.at(f64::from(cycle) * 1e-3)).collect::<Vec<_>>();
    assert_eq!(trajectory(&one), trajectory(&same));
    assert_ne!(trajectory(&one), trajectory(&other));
    assert_eq!(one.end_m(), 0.2);
}
