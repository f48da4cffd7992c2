//! Clipping: samples at the limit of a sensor's range, and runs at the extreme of a record.
//!
//! A sample at the limit is the limit or more, so it is left out with its neighbours, whose noise would all point inwards.
//! Somebody else's limit is where a record's extreme value comes again and again: noise makes that a matter of a few samples in
//! a row ([`super::stuck::by_chance`]).
//!
//! An axis at rest at the end of its stroke, its sensor at the limit, is parked, which is not fatal.

use super::PARKED;
use super::grid::Grid;
use super::notes::Notes;
use model_fit::equal_runs::{by_chance, is_rest, runs};
use model_fit::quantum;
use plant::RigParameters;
use records::{Channel, Quantity, Signal};

/// Rows to each side of a clipped sample that are left out with it.
const NEIGHBOURS: usize = 3;
/// Share of a channel beyond which too little is left of it.
const MOST: f64 = 0.5;
/// Range of position in which an axis is parked, m.
const PARKED_M: f64 = 1e-3;

pub(super) fn check(notes: &mut Notes, rig: &RigParameters, grid: &Grid) {
    let channels = notes.open_channels();
    for channel in channels {
        // Nothing is simulated from the supply's reading, and that of a good regulator stands still.
        if matches!(channel, Channel::Of(_, Signal::Valve | Signal::AppliedForce) | Channel::SupplyPressure) {
            continue;
        }
        let values = grid.series(notes, channel);
        let mut bad = vec![false; values.len()];
        let mut at_limit = false;
        // A position that is mostly below zero counts the other way, and zero is no limit to it: its sign is asked later.
        let reversed = channel.quantity() == Quantity::Length
            && 2 * values.iter().flatten().filter(|value| **value < 0.0).count() > values.len();
        let limits = if reversed { Vec::new() } else { limits(channel, rig, notes) };
        for (limit, lower) in limits {
            let beyond = |value: f64| if lower { value <= limit } else { value >= limit };
            for (place, value) in values.iter().enumerate() {
                if value.is_some_and(beyond) {
                    bad[place] = true;
                    at_limit = true;
                }
            }
        }
        at_extremes(&values, &mut bad);
        let Some(first) = (0..bad.len()).find(|place| bad[*place]) else { continue };
        let clipped = bad.iter().filter(|bad| **bad).count();
        let level = values[first].unwrap_or(0.0);
        let row = grid.rows[first];
        let present: Vec<f64> = values.iter().flatten().copied().collect();
        if at_limit && is_parked(channel, &present) {
            let text = format!(
                "the axis stands at the end of its stroke all the time ({level} m): it tells nothing here"
            );
            notes.add(PARKED, channel, row, false, &text);
        } else {
            let share = clipped as f64 / present.len().max(1) as f64;
            let fatal = share > MOST;
            let text = format!(
                "{clipped} samples ({:.2} %) are clipped at {level}{}: {}",
                1e2 * share,
                if at_limit { ", the limit of the sensor" } else { ", the extreme of this record" },
                if fatal {
                    "record again with a larger range"
                } else {
                    "they are left out with their neighbours"
                }
            );
            notes.add("clipped", channel, row, fatal, &text);
        }
        for place in (0..bad.len()).filter(|place| bad[*place]) {
            let around = place.saturating_sub(NEIGHBOURS)..(place + NEIGHBOURS + 1).min(bad.len());
            grid.rows[around].iter().flatten().for_each(|row| notes.leave_out(channel, *row));
        }
    }
}

/// Limits of a channel's sensor, the lower one marked; none of foreign sensors.
fn limits(channel: Channel, rig: &RigParameters, notes: &Notes) -> Vec<(f64, bool)> {
    if !matches!(channel, Channel::Of(axis, _) if notes.is_of_rig(axis)) {
        return Vec::new();
    }
    let sensors = rig.sensors();
    // Half a count, for values that were written with few digits.
    let pair =
        |least: f64, most: f64, step: f64| vec![(least + 0.5 * step, true), (most - 0.5 * step, false)];
    match channel.quantity() {
        Quantity::Length => pair(0.0, sensors.position_range_m, sensors.position_step_m()),
        Quantity::Force => pair(-sensors.force_range_n, sensors.force_range_n, sensors.force_step_n()),
        Quantity::Pressure => pair(0.0, sensors.pressure_range_pa, sensors.pressure_step_pa()),
        Quantity::Opening => Vec::new(),
    }
}

fn is_parked(channel: Channel, values: &[f64]) -> bool {
    let most = values.iter().copied().fold(f64::MIN, f64::max);
    let least = values.iter().copied().fold(f64::MAX, f64::min);
    matches!(channel, Channel::Of(_, Signal::Position)) && most - least < PARKED_M
}

/// Marks samples at the extremes where they come in runs.
fn at_extremes(values: &[Option<f64>], bad: &mut [bool]) {
    let most = values.iter().flatten().copied().fold(f64::MIN, f64::max);
    let least = values.iter().flatten().copied().fold(f64::MAX, f64::min);
    let inner: Vec<_> =
        values.iter().map(|value| value.filter(|value| *value < most && *value > least)).collect();
    // A channel of few values has its extremes often, and so has one that rests at them as it rests elsewhere.
    let Some(longest) = by_chance(&inner) else { return };
    let step = quantum::of(&values.iter().flatten().copied().collect::<Vec<_>>());
    if runs(&inner).iter().any(|run| run.samples > longest && is_rest(&inner, run, step)) {
        return;
    }
    for extreme in [least, most] {
        let found = runs(values)
            .into_iter()
            .any(|run| run.samples > longest && values[run.places.start] == Some(extreme));
        if found {
            values
                .iter()
                .zip(&mut *bad)
                .filter(|(value, _)| **value == Some(extreme))
                .for_each(|(_, bad)| *bad = true);
        }
    }
}
