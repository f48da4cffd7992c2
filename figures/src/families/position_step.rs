//! The largest step of the drive's set-point: how the position follows it.
//!
//! Source: the paper, Fig. 7 (the manipulated variable is in its limit at first; settling without lasting oscillation).

use super::position::NOISE_S;
use super::{Family, Figures};
use crate::record::{Record, largest_step};
use crate::series::{Series, Span};

/// A smaller jump is no step.
const LEAST_STEP_M: f64 = 0.002;
/// Settled: within this share of the step, or within this way, whichever is larger.
const SETTLED_SHARE: f64 = 0.01;
const SETTLED_M: f64 = 0.001;
/// An opening that counts as saturated.
const SATURATED: f64 = 0.99;
/// Within this time after the step the valve must saturate for it to be the step's doing.
const ANSWER_S: f64 = 0.02;
/// After settling, what is left of the approach is waited for so long before an oscillation is looked for.
const CALM_S: f64 = 0.2;

pub(super) const FAMILY: Family = Family {
    title: "step of the position (the largest in the experiment, 2 mm at least)",
    definitions: definitions! {
        position_step_m: "m", Farthest, "height of the step, signed";
        position_rise_s: "s", Largest, "from 10 % to 90 % of the step, by the position sensor";
        position_settling_s: "s", Latest,
            "from the step until |error| stays within 1 % of it or 1 mm, whichever is larger; absent when \
             it does not";
        position_overshoot_ratio: "1", Largest,
            "largest way beyond the new set-point, by height of the step; sensor smoothed over 10 ms";
        valve_saturated_s: "s", Smallest,
            "how long |opening| of the drive's valve stays at 0.99 or more from the step on; 0 when it \
             never gets there within 20 ms";
        position_oscillation_after_settling_m: "m", Largest,
            "peak to peak of the position, smoothed over 10 ms, from 0.2 s after settling until the \
             set-point changes again";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let set_point = record.drive.numbers("set_position_m");
    let Some(step) = largest_step(set_point, &record.experiments(), LEAST_STEP_M) else { return };
    let after = Span { from_s: step.at_s, to_s: step.until_s };
    let position = record.measured.numbers("drive_position_m").within(&after);
    // Share of the way: 0 at the old set-point, 1 at the new one.
    let share = |series: &Series| series.map(|value| (value - step.before_value) / step.height_value());
    let way = share(&position);
    let smooth = position.smoothed(NOISE_S);
    figures.put("position_step_m", Some(step.height_value()));
    let reached = |wanted: f64| way.first_time(|way| way >= wanted);
    figures.put("position_rise_s", reached(0.9).zip(reached(0.1)).map(|(high, low)| high - low));
    let bound_m = SETTLED_M.max(SETTLED_SHARE * step.height_value().abs());
    let settled_s = position.stays_from(|value| (value - step.after_value).abs() <= bound_m);
    figures.put("position_settling_s", settled_s.map(|time| time - step.at_s));
    figures.put("position_overshoot_ratio", share(&smooth).most().map(|most| (most - 1.0).max(0.0)));
    figures.put("valve_saturated_s", saturated_s(record.measured.numbers("drive_valve"), &after));
    let calm = settled_s.map(|time| smooth.within(&Span { from_s: time + CALM_S, to_s: step.until_s }));
    let long = calm.filter(|calm| calm.span().is_some_and(|span| span.length_s() > 0.5 * CALM_S));
    figures.put("position_oscillation_after_settling_m", long.and_then(|calm| calm.peak_to_peak()));
}

fn saturated_s(valve: &Series, after: &Span) -> Option<f64> {
    let valve = valve.within(after);
    let start_s = valve.span()?.from_s;
    let stretches = valve.stretches(|opening| opening.abs() >= SATURATED);
    let first = stretches.first().filter(|first| first.from_s - start_s <= ANSWER_S);
    Some(first.map_or(0.0, Span::length_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};

    /// A step by 0.1 m at 1 s, answered by `answer` of the time since.
    fn figures(answer: impl Fn(f64) -> f64) -> Figures {
        let set = each_ms(0.0, 4.0, |time| if time < 1.0 { 0.2 } else { 0.3 });
        let position =
            each_ms(0.0, 4.0, |time| 0.2 + 0.1 * if time < 1.0 { 0.0 } else { answer(time - 1.0) });
        let valve = each_ms(0.0, 4.0, |time| if (1.0015..1.0815).contains(&time) { 1.0 } else { 0.02 });
        let mut drive = table(&[("set_position_m", &set)]);
        drive.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.5), ("", 4.0)]));
        let measured = table(&[("drive_position_m", &position), ("drive_valve", &valve)]);
        super::super::of(&Record { drive, measured, ..Record::default() })
    }

    #[test]
    fn a_lag_of_first_order_settles_by_the_logarithm() {
        let figures = figures(|since| 1.0 - (-since / 0.1_f64).exp());
        let figure = |name: &str| figures.get(name).unwrap();
        // 1 % of 0.1 m is 1 mm: tau ln 100; rise tau ln 9; each seen within one sample.
        assert!((figure("position_settling_s") - 0.1 * 100_f64.ln()).abs() < 1.5e-3);
        assert!((figure("position_rise_s") - 0.1 * 9_f64.ln()).abs() < 2.5e-3);
        assert_eq!(figure("position_overshoot_ratio"), 0.0);
        assert!((figure("position_step_m") - 0.1).abs() < 1e-12);
        assert!((figure("valve_saturated_s") - 0.08).abs() < 1.5e-3);
        // What is left 0.2 s after settling: exp(-2) of 1 mm.
        assert!((figure("position_oscillation_after_settling_m") - 1e-3 * (-2_f64).exp()).abs() < 1e-5);
    }

    #[test]
    fn an_oscillation_overshoots_and_may_never_settle() {
        let damped = figures(|since| 1.0 - (-since / 0.5_f64).exp() * (20.0 * since).cos());
        // First crest beyond the set-point near 20 t = pi: exp(-pi / 10); the smoothing takes 0.2 % off.
        assert!((damped.get("position_overshoot_ratio").unwrap() - 0.7315).abs() < 0.005);
        let lasting = figures(|since| 1.0 - 0.05 * (20.0 * since).cos());
        assert_eq!(lasting.get("position_settling_s"), None);
        assert_eq!(lasting.get("position_oscillation_after_settling_m"), None);
    }
}
