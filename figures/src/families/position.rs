//! Position control over the whole experiment: errors while the set-point moves and while it rests.
//!
//! Source: bus.md, A run's folder (dynamic and static error); the paper, Fig. 8 ("two maxima of the control error").

use super::{Family, Figures};
use crate::record::Record;
use crate::series::{Series, Span};

/// The last part of a rest, over which the static error is averaged.
const STATIC_S: f64 = 0.2;
/// The last part of a rest, in which nothing may move any more.
const STILL_S: f64 = 0.5;
/// A rest must be longer than that part by so much, for the motion before it to settle.
const SETTLE_S: f64 = 0.25;
/// Removes the sensor's noise of 20 um to some 6 um.
pub(super) const NOISE_S: f64 = 0.01;
/// Over which the error is smoothed before its maxima are counted.
const MAXIMUM_S: f64 = 0.02;
/// Share of the largest error that a maximum reaches, and share by which the error falls between two maxima.
const MAXIMUM_SHARE: f64 = 0.5;
const FALL_SHARE: f64 = 0.25;

pub(super) const FAMILY: Family = Family {
    title: "position, over the whole experiment",
    definitions: definitions! {
        position_error_rms_m: "m", Largest,
            "rms of set-point less position while the drive's set-point moves";
        position_error_maxima: "1", Largest,
            "maxima of |error| above half the largest in the longest move, smoothed over 20 ms, the error \
             falling by a quarter of the largest between them";
        position_rest_peak_to_peak_m: "m", Largest,
            "largest peak to peak of the position sensor in the last 0.5 s of the rests of the set-point, \
             waiting before and after included";
        position_rest_peak_to_peak_smoothed_m: "m", Largest,
            "the same with the sensor's noise removed by a moving mean over 10 ms";
    },
    compute,
};

fn compute(record: &Record, figures: &mut Figures) {
    let error = record.position_error();
    let moves = record.moves();
    figures.put("position_error_rms_m", error.within_all(&moves).rms());
    figures
        .put("position_error_maxima", longest(record, &moves).and_then(|span| maxima(&error.within(&span))));
    let position = record.measured.numbers("drive_position_m");
    let smooth = position.smoothed(NOISE_S);
    let still: Vec<_> = still(&record.rests()).collect();
    let largest =
        |series: &Series| still.iter().filter_map(|span| series.within(span).peak_to_peak()).reduce(f64::max);
    figures.put("position_rest_peak_to_peak_m", largest(position));
    figures.put("position_rest_peak_to_peak_smoothed_m", largest(&smooth));
}

/// The last 0.5 s of those rests that leave time to settle, less what a centred mean sees of the motion that follows.
pub(super) fn still(rests: &[Span]) -> impl Iterator<Item = Span> {
    let long = rests.iter().filter(|rest| rest.length_s() > STILL_S + SETTLE_S);
    long.map(|rest| Span { to_s: rest.to_s - 0.5 * NOISE_S, ..rest.last(STILL_S) })
}

/// Ways that differ by less, in shares of the longer, are equal: a late rig skips the samples at an end.
const SAME_WAY: f64 = 0.01;

/// The move over the longest way; the first of equals.
fn longest(record: &Record, moves: &[Span]) -> Option<Span> {
    let set_point = record.drive.numbers("set_position_m");
    let ways = moves.iter().filter_map(|span| Some((span, set_point.within(span).peak_to_peak()?)));
    ways.reduce(|longest, other| if other.1 * (1.0 - SAME_WAY) > longest.1 { other } else { longest })
        .map(|(span, _)| *span)
}

/// Number of separate maxima of |error|.
fn maxima(error: &Series) -> Option<f64> {
    let size = error.smoothed(MAXIMUM_S).map(f64::abs);
    let largest = size.most().filter(|largest| *largest > 0.0)?;
    let fall = FALL_SHARE * largest;
    // Up and down by turns: a maximum is the highest since the last valley, and counts once the error has fallen from it.
    let (mut count, mut high, mut low) = (0_u32, f64::NEG_INFINITY, 0.0_f64);
    let mut rising = true;
    let mut close = |high: f64| count += u32::from(high >= MAXIMUM_SHARE * largest);
    for value in size.values() {
        if rising {
            high = high.max(*value);
            if *value < high - fall {
                close(high);
                (rising, low) = (false, *value);
            }
        } else {
            low = low.min(*value);
            if *value > low + fall {
                (rising, high) = (true, *value);
            }
        }
    }
    if rising {
        close(high);
    }
    Some(f64::from(count))
}

/// Dynamic error, m: what a controller that kept no account of it would have reported.
pub fn error_dynamic_m(record: &Record) -> Option<f64> {
    record.position_error().within_all(&record.moves()).largest()
}

/// Static error, m: as [`error_dynamic_m`].
pub fn error_static_m(record: &Record) -> Option<f64> {
    let size = record.position_error().map(f64::abs);
    let rests = crate::record::common(&record.rests(), &record.experiments());
    let long = rests.iter().filter(|rest| rest.length_s() > STATIC_S - 1e-4);
    long.filter_map(|rest| size.within(&rest.last(STATIC_S)).mean()).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};
    use std::f64::consts::PI;

    /// Moves from 1 s to 2 s and rests until 3 s; the position lags by `error`.
    fn record(error: impl Fn(f64) -> f64 + Copy) -> Record {
        let set = |time: f64| 0.1 + 0.3 * (time - 1.0).clamp(0.0, 1.0);
        let position = each_ms(0.0, 3.0, |time| set(time) - error(time));
        let moving = each_ms(0.0, 3.0, |time| f64::from((1.0..2.0).contains(&time)));
        let set = each_ms(0.0, 3.0, set);
        let mut drive = table(&[("set_position_m", &set), ("position_m", &position), ("moving", &moving)]);
        drive.set_states("main_chain", chain(&[("settling", 0.0), ("experiment", 0.5), ("", 3.0)]));
        Record { drive, measured: table(&[("drive_position_m", &position)]), ..Record::default() }
    }

    fn figure(record: &Record, name: &str) -> f64 {
        super::super::of(record).get(name).unwrap_or_else(|| panic!("{name} is absent"))
    }

    #[test]
    fn dynamic_and_static_error_are_those_of_bus_md() {
        let wave =
            record(|time| if (1.0..2.0).contains(&time) { 0.004 * (2.0 * PI * time).sin() } else { -0.0003 });
        // The crest of a sine falls on a sample within 5e-6 of its height; the mean is that of equal numbers.
        assert!((error_dynamic_m(&wave).unwrap() - 0.004).abs() < 2e-8);
        assert!((error_static_m(&wave).unwrap() - 0.0003).abs() < 1e-12);
        assert!((figure(&wave, "position_error_rms_m") - 0.004 / 2_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn maxima_are_counted_once_and_small_ones_not() {
        type Shape = fn(f64) -> f64;
        let shapes: [(Shape, f64); 4] = [
            (|time| (PI * (time - 1.0)).sin(), 1.0),
            (|time| (2.0 * PI * (time - 1.0)).sin(), 2.0),
            (|time| (PI * (time - 1.0)).sin() + 0.02 * (200.0 * time).sin(), 1.0),
            (|time| (2.0 * PI * (time - 1.0)).sin() * if time < 1.5 { 1.0 } else { 0.4 }, 1.0),
        ];
        for (place, (shape, expected)) in shapes.into_iter().enumerate() {
            let record = record(|time| if (1.0..2.0).contains(&time) { 0.004 * shape(time) } else { 0.0 });
            assert_eq!(figure(&record, "position_error_maxima"), expected, "shape {place}");
        }
    }

    #[test]
    fn an_oscillation_at_rest_is_seen_and_noise_of_one_sample_smoothed() {
        let ringing = record(|time| 0.0002 * (2.0 * PI * 5.0 * time).sin());
        assert!((figure(&ringing, "position_rest_peak_to_peak_m") - 0.0004).abs() < 1e-8);
        let noisy = record(|time| if (time * 1e3).round() % 2.0 == 0.0 { 2e-5 } else { -2e-5 });
        assert!((figure(&noisy, "position_rest_peak_to_peak_m") - 4e-5).abs() < 1e-12);
        // A mean over eleven samples of alternating sign leaves an eleventh of them.
        let smooth = figure(&noisy, "position_rest_peak_to_peak_smoothed_m");
        assert!((smooth - 4e-5 / 11.0).abs() < 1e-8, "{smooth}");
    }
}
