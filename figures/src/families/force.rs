//! Force control over the whole experiment: during motion, at rest, and before the experiment.
//!
//! A step of the set-point has figures of its own (`force_step.rs`); half a second from it on is left out here.

use super::position::still;
use super::{Family, Figures};
use crate::record::{Record, common};
use crate::series::{Series, Span};

/// Removes the sensor's noise of 0.5 N to some 0.2 N.
pub(super) const NOISE_S: f64 = 0.005;
/// How long a jump of the set-point is left out.
const STEP_S: f64 = 0.5;
/// A jump of the set-point from one row to the next that counts as a step.
const JUMP_N: f64 = 5.0;
/// The last part of the waiting before the experiment, over which the initial force is averaged.
const INITIAL_S: f64 = 0.2;

pub(super) const FAMILY: Family = Family {
    title: "force, over the whole experiment (load sensor smoothed over 5 ms)",
    definitions: definitions! {
        force_error_motion_rms_n: "N", Largest,
            "rms of force less set-point while the drive's set-point moves, 0.5 s from a step of the \
             force on left out";
        force_error_motion_largest_n: "N", Largest, "largest |force less set-point| of the same samples";
        force_rest_peak_to_peak_n: "N", Largest,
            "largest peak to peak of the force in the last 0.5 s of the rests of the drive's set-point, \
             the force's set-point being constant";
        force_initial_settled_n: "N", Farthest, "mean force in the last 0.2 s before the experiment";
        force_initial_error_n: "N", Farthest, "that mean less the set-point's";
        load_law_error_rms_n: "N", Largest,
            "rms of force less set-point in the experiment, for a load that follows from the motion \
             (spring, damper, mass, dry friction)";
        load_law_error_largest_n: "N", Largest, "largest |force less set-point| of the same samples";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let experiments = record.experiments();
    let set_point = record.load.numbers("set_force_N");
    let force = record.measured.numbers("load_force_N").smoothed(NOISE_S);
    let error = force.minus(set_point);
    if record.load_depends_on_state() {
        let followed = error.within_all(&experiments);
        figures.put("load_law_error_rms_n", followed.rms());
        figures.put("load_law_error_largest_n", followed.largest());
    } else {
        let moving = error.within_all(&common(&record.moves(), &away_from_steps(set_point)));
        figures.put("force_error_motion_rms_n", moving.rms());
        figures.put("force_error_motion_largest_n", moving.largest());
    }
    let constant = set_point.constant_stretches();
    let rests = record.rests();
    let still = still(&rests).filter(|span| {
        constant
            .iter()
            .any(|stretch| stretch.common(span).is_some_and(|both| both.length_s() > 0.95 * span.length_s()))
    });
    let swings = still.filter_map(|span| force.within(&span).peak_to_peak());
    figures.put("force_rest_peak_to_peak_n", swings.reduce(f64::max));
    if let Some(experiment) = experiments.first() {
        let before = Span { from_s: experiment.from_s - INITIAL_S, to_s: experiment.from_s };
        let wanted = set_point.within(&before).mean();
        let settled = wanted.and_then(|_| force.within(&before).mean());
        figures.put("force_initial_settled_n", settled);
        figures.put("force_initial_error_n", settled.zip(wanted).map(|(force, wanted)| force - wanted));
    }
}

/// The stretches of a set-point without the half second from each jump on.
fn away_from_steps(set_point: &Series) -> Vec<Span> {
    let Some(Span { mut from_s, to_s }) = set_point.span() else { return Vec::new() };
    let mut away = Vec::new();
    let mut before = None;
    for (time, value) in set_point.iter() {
        // The smoothing looks half its window ahead.
        if before.is_some_and(|before: f64| (value - before).abs() > JUMP_N) {
            away.push(Span { from_s, to_s: time - 0.5 * NOISE_S });
            from_s = time + STEP_S;
        }
        before = Some(value);
    }
    away.push(Span { from_s, to_s });
    away.retain(|span| span.length_s() > 0.0);
    away
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    /// Moves from 1 s to 3 s, steps from 100 N to 200 N at 2 s; the force is wrong by `error`.
    fn record(error: impl Fn(f64) -> f64) -> Record {
        let wanted = |time: f64| if time < 2.0 { 100.0 } else { 200.0 };
        let moving = each_ms(0.0, 5.0, |time| f64::from((1.0..3.0).contains(&time)));
        let place = each_ms(0.0, 5.0, |time| time.clamp(1.0, 3.0));
        let mut drive = table(&[("moving", &moving), ("set_position_m", &place)]);
        drive.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.9), ("", 5.0)]));
        let load = table(&[("set_force_N", &each_ms(0.0, 5.0, wanted))]);
        let measured = table(&[("load_force_N", &each_ms(0.0, 5.0, |time| wanted(time) + error(time)))]);
        Record { drive, load, measured, ..Record::default() }
    }

    #[test]
    fn the_error_in_motion_leaves_the_step_out() {
        let figures = super::super::of(&record(|time| match time {
            _ if (1.0..1.9).contains(&time) => 3.0,
            _ if (2.0..2.4).contains(&time) => -90.0,
            _ => 0.0,
        }));
        assert!((figures.get("force_error_motion_largest_n").unwrap() - 3.0).abs() < 1e-9);
        // 0.9 s of the 1.5 s that count: 3 sqrt(0.6), edges smoothed.
        assert!((figures.get("force_error_motion_rms_n").unwrap() - 3.0 * 0.6_f64.sqrt()).abs() < 0.01);
    }

    #[test]
    fn the_initial_force_and_an_oscillation_at_rest_are_seen() {
        let figures =
            super::super::of(&record(|time| if time < 0.9 { 1.5 } else { 2.0 * (50.0 * time).sin() }));
        assert!((figures.get("force_initial_settled_n").unwrap() - 101.5).abs() < 0.05);
        assert!((figures.get("force_initial_error_n").unwrap() - 1.5).abs() < 0.05);
        // A mean over 5 ms takes 0.3 % off a sine of 50 rad/s.
        assert!((figures.get("force_rest_peak_to_peak_n").unwrap() - 4.0).abs() < 0.03);
    }

    #[test]
    fn a_load_by_a_law_is_judged_on_its_law() {
        let mut record = record(|_| -4.0);
        assert_eq!(super::super::of(&record).get("load_law_error_rms_n"), None);
        record.experiment = "[[load.set-point]]\nlaw = \"damper\"".parse().unwrap();
        let figures = super::super::of(&record);
        // The smoothing blurs the test's own step of 100 N.
        assert!((figures.get("load_law_error_rms_n").unwrap() - 4.0).abs() < 0.7);
        assert_eq!(figures.get("force_error_motion_rms_n"), None);
    }
}
