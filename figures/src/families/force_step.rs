//! The largest step of the load's force: how force and drive take it.
//!
//! ```text
//!  force                     final value: mean over the last 0.2 s of the horizon
//!    │        ╭─────────── ± 5 % of the step
//!    │   ____╱
//!    └───────┴─settling──┴──────── horizon: 0.5 s, less when the set-point changes again
//! ```
//!
//! Source: the paper, Fig. 9 (the force step settles aperiodically in about 100 ms, the drive nearly comes to a standstill for
//! a moment, the position error rises past 10 mm and is evened out).

use super::force::NOISE_S;
use super::{Family, Figures};
use crate::record::{Record, Step, largest_step};
use crate::series::{Series, Span};

/// A smaller jump is no step.
const LEAST_STEP_N: f64 = 10.0;
/// How long the force is looked at from the step on.
const HORIZON_S: f64 = 0.5;
/// The last part of it, over which the final value is averaged.
const FINAL_S: f64 = 0.2;
/// Half the band, by height of the step.
const BAND: f64 = 0.05;
/// How long the drive's speed is looked at.
const SPEED_S: f64 = 0.3;
/// Window of the slope that gives the speed.
const SLOPE_S: f64 = 0.02;
/// Below it a set-point's speed is none to compare with.
const LEAST_SPEED_M_PER_S: f64 = 0.01;
/// How long the position's error is looked at.
const RECOVERY_S: f64 = 1.5;
/// An error that counts as evened out.
const RECOVERED_M: f64 = 0.005;
/// Before the step, the position's error is taken over so long.
const BEFORE_S: f64 = 0.05;

pub(super) const FAMILY: Family = Family {
    title: "step of the force (the largest in the experiment, 10 N at least; load sensor smoothed over 5 ms)",
    definitions: definitions! {
        force_step_n: "N", Farthest, "height of the step, signed";
        force_rise_s: "s", Largest, "from 10 % to 90 % of the way to the final value";
        force_settling_s: "s", Latest,
            "from the step until the force stays within 5 % of it around the final value (mean over the \
             last 0.2 s of the 0.5 s that are looked at); absent when it does not";
        force_settling_to_set_point_s: "s", Latest, "the same around the set-point";
        force_error_final_n: "N", Farthest, "final value less set-point";
        force_overshoot_ratio: "1", Largest, "largest excess beyond the final value, by height of the step";
        force_aperiodic: "1", Smallest,
            "1 when the force, once within 5 % of the final value, leaves that band at most once; else 0";
        drive_speed_ratio_least: "1", Smallest,
            "least of drive velocity (slope over 20 ms) by set-point velocity within 0.3 s from the step";
        position_error_before_step_m: "m", Largest, "largest |position error| in the 50 ms before the step";
        position_error_peak_after_step_m: "m", Largest, "largest |position error| within 0.5 s from the step";
        position_error_recovered_s: "s", Latest,
            "from the step until |position error| stays below 5 mm or its level before, whichever is \
             larger, within 1.5 s; absent when it does not";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let set_point = record.load.numbers("set_force_N");
    let Some(step) = largest_step(set_point, &record.experiments(), LEAST_STEP_N) else { return };
    figures.put("force_step_n", Some(step.height_value()));
    force_figures(&record.measured.numbers("load_force_N").smoothed(NOISE_S), &step, figures);
    drive_figures(record, &step, figures);
}

fn force_figures(force: &Series, step: &Step, figures: &mut Figures) {
    let horizon = Span { from_s: step.at_s, to_s: step.until_s.min(step.at_s + HORIZON_S) };
    let force = force.within(&horizon);
    let band = BAND * step.height_value().abs();
    let Some(last) = force.within(&horizon.last(FINAL_S.min(0.5 * horizon.length_s()))).mean() else {
        return;
    };
    let settled =
        |around: f64| force.stays_from(|force| (force - around).abs() <= band).map(|time| time - step.at_s);
    figures.put("force_settling_s", settled(last));
    figures.put("force_settling_to_set_point_s", settled(step.after_value));
    figures.put("force_error_final_n", Some(last - step.after_value));
    let sign = step.height_value().signum();
    figures.put(
        "force_overshoot_ratio",
        force.map(|force| sign * (force - last)).most().map(|most| most.max(0.0) / step.height_value().abs()),
    );
    let within = |force: f64| (force - last).abs() <= band;
    let outside = force.stretches(|force| !within(force));
    // The way up is the first of them, unless the step was done within a sample.
    let starts_outside = force.values().first().is_some_and(|first| !within(*first));
    let left_again = outside.len() - usize::from(starts_outside);
    figures.put("force_aperiodic", Some(f64::from(u8::from(left_again <= 1))));
    let way = force.map(|force| (force - step.before_value) / (last - step.before_value));
    let reached = |wanted: f64| way.first_time(|way| way >= wanted);
    figures.put("force_rise_s", reached(0.9).zip(reached(0.1)).map(|(high, low)| high - low));
}

fn drive_figures(record: &Record, step: &Step, figures: &mut Figures) {
    let after = |length_s: f64| Span { from_s: step.at_s, to_s: step.until_s.min(step.at_s + length_s) };
    let velocity = record.measured.numbers("drive_position_m").slope(SLOPE_S);
    let moving = record.moves().iter().filter_map(|span| span.common(&after(SPEED_S))).collect::<Vec<_>>();
    let wanted = record.drive.numbers("set_velocity_m_per_s").within_all(&moving);
    let wanted: Series = wanted.iter().filter(|(_, wanted)| wanted.abs() >= LEAST_SPEED_M_PER_S).collect();
    figures.put("drive_speed_ratio_least", velocity.with(&wanted, |is, wanted| is / wanted).least());
    let size = record.position_error().map(f64::abs);
    let before = size.within(&Span { from_s: step.at_s - BEFORE_S, to_s: step.at_s }).most();
    figures.put("position_error_before_step_m", before);
    figures.put("position_error_peak_after_step_m", size.within(&after(HORIZON_S)).most());
    let bound = before.unwrap_or(0.0).max(RECOVERED_M);
    let recovered_s = size.within(&after(RECOVERY_S)).stays_from(|error| error <= bound);
    figures.put("position_error_recovered_s", recovered_s.map(|time| time - step.at_s));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    /// A step by 200 N at 1 s, answered by `force` of the time since, while the drive moves with an `error`.
    fn figures(force: impl Fn(f64) -> f64, error: impl Fn(f64) -> f64) -> Figures {
        let since = |time: f64| (time - 1.0).max(0.0);
        let place = |time: f64| 0.1 * time;
        let drive = [
            ("set_position_m", each_ms(0.0, 3.0, place)),
            ("set_velocity_m_per_s", each_ms(0.0, 3.0, |_| 0.1)),
            ("position_m", each_ms(0.0, 3.0, |time| place(time) - error(since(time)))),
            ("moving", each_ms(0.0, 3.0, |_| 1.0)),
        ];
        let mut drive = table(&drive.each_ref().map(|(name, column)| (*name, column)));
        let position = each_ms(0.0, 3.0, |time| place(time) - error(since(time)));
        drive.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.5), ("", 3.0)]));
        let load =
            table(&[("set_force_N", &each_ms(0.0, 3.0, |time| if time < 1.0 { 100.0 } else { 300.0 }))]);
        let force = each_ms(0.0, 3.0, |time| 100.0 + 200.0 * force(since(time)));
        let measured = table(&[("load_force_N", &force), ("drive_position_m", &position)]);
        super::super::of(&Record { drive, load, measured, ..Record::default() })
    }

    #[test]
    fn a_lag_of_first_order_settles_aperiodically_in_three_time_constants() {
        let figures = figures(|since| 1.0 - (-since / 0.03_f64).exp(), |_| 0.002);
        let figure = |name: &str| figures.get(name).unwrap();
        // tau ln 20 until 5 % are left, tau ln 9 from 10 % to 90 %, each seen within a sample and half the smoothing's blur.
        assert!((figure("force_settling_s") - 0.03 * 20_f64.ln()).abs() < 2e-3);
        assert!((figure("force_settling_to_set_point_s") - 0.03 * 20_f64.ln()).abs() < 2e-3);
        assert!((figure("force_rise_s") - 0.03 * 9_f64.ln()).abs() < 4e-3);
        assert_eq!(figure("force_aperiodic"), 1.0);
        assert!(figure("force_overshoot_ratio") < 1e-3 && figure("force_error_final_n").abs() < 0.2);
        assert!((figure("drive_speed_ratio_least") - 1.0).abs() < 1e-9);
        assert_eq!(figure("position_error_recovered_s"), 0.0);
    }

    #[test]
    fn one_overshoot_is_aperiodic_still() {
        // Beyond the band of 5 % between 60 and 140 ms, once.
        let bump = |since: f64| if (0.06..0.14).contains(&since) { 0.2 } else { 0.0 };
        let figures = figures(|since| 1.0 - (-since / 0.01_f64).exp() + bump(since), |_| 0.0);
        assert_eq!(figures.get("force_aperiodic"), Some(1.0));
        assert!(figures.get("force_overshoot_ratio").unwrap() > 0.1);
    }

    #[test]
    fn an_oscillation_is_not_aperiodic_and_a_force_that_stays_away_never_settles_there() {
        let ringing = figures(|since| 1.0 - (-since / 0.1_f64).exp() * (60.0 * since).cos(), |_| 0.0);
        assert_eq!(ringing.get("force_aperiodic"), Some(0.0));
        assert!(ringing.get("force_overshoot_ratio").unwrap() > 0.5);
        let short = figures(|since| 0.9 * (1.0 - (-since / 0.03_f64).exp()), |_| 0.0);
        assert_eq!(short.get("force_settling_to_set_point_s"), None);
        assert!(short.get("force_settling_s").is_some());
        assert!((short.get("force_error_final_n").unwrap() + 20.0).abs() < 0.01);
    }

    #[test]
    fn the_drive_falls_behind_and_catches_up() {
        // e = 0.03 s/T exp(1 - s/T), T = 0.1 s: peak 30 mm at T; slope 0.3 e exp(..) > 0.1 m/s at first, so the drive even
        // turns back.
        let figures =
            figures(|since| f64::from(since > 0.0), |since| 0.3 * since * (1.0 - since / 0.1).exp());
        assert!((figures.get("position_error_peak_after_step_m").unwrap() - 0.03).abs() < 1e-5);
        assert!(figures.get("drive_speed_ratio_least").unwrap() < -2.0);
        // 5 mm at s/T exp(1 - s/T) = 1/6: s/T = 4.235.
        assert!((figures.get("position_error_recovered_s").unwrap() - 0.4235).abs() < 1.5e-3);
    }
}
