//! Stuck channels: runs of one value that are longer than noise permits ([`model_fit::equal_runs`]).
//!
//! A channel whose rounding is coarser than its noise is not tested; but one that never moves although its sensor has noise is
//! dead.

use super::grid::Grid;
use super::notes::Notes;
use model_fit::equal_runs::{MOST, Run, SURELY, by_chance, runs, stuck};
use plant::RigParameters;
use records::{Channel, Quantity, Signal};

/// Runs that are listed one by one.
const LISTED: usize = 5;

pub(super) fn check(notes: &mut Notes, rig: &RigParameters, grid: &Grid) {
    let channels = notes.open_channels();
    for channel in channels {
        let Channel::Of(axis, Signal::Position | Signal::Force | Signal::PressureA | Signal::PressureB) =
            channel
        else {
            continue;
        };
        let values = grid.series(notes, channel);
        let present = values.iter().flatten().count();
        let all = runs(&values);
        let constant = present > SURELY && all.len() == 1;
        let stuck: Vec<Run> = match by_chance(&values) {
            _ if constant && notes.is_of_rig(axis) && is_noisy(channel, rig) => all,
            _ if constant => continue,
            _ => stuck(&values).0,
        };
        add_finding(notes, grid, channel, &values, &stuck);
    }
}

fn add_finding(notes: &mut Notes, grid: &Grid, channel: Channel, values: &[Option<f64>], stuck: &[Run]) {
    let present = values.iter().flatten().count();
    let samples: usize = stuck.iter().map(|run| run.samples).sum();
    let fatal = samples as f64 > MOST * present as f64;
    for (number, run) in stuck.iter().enumerate() {
        let (Some(level), row) = (values[run.places.start], grid.rows[run.places.start]) else { continue };
        if number < LISTED {
            let text = format!(
                "stuck at {level} for {:.0} ms, longer than its noise permits: {}",
                1e3 * grid.period_s * run.places.len() as f64,
                if fatal { "look at the sensor and its cable, and record again" } else { "left out there" }
            );
            notes.add("stuck", channel, row, fatal, &text);
        } else if number == LISTED {
            let text = format!("stuck {} more times: left out there", stuck.len() - LISTED);
            notes.add("stuck", channel, row, fatal, &text);
        }
        grid.rows[run.places.clone()].iter().flatten().for_each(|row| notes.leave_out(channel, *row));
    }
}

/// Whether the sensor's noise is larger than its rounding, so that its reading cannot stand still.
fn is_noisy(channel: Channel, rig: &RigParameters) -> bool {
    let sensors = rig.sensors();
    match channel.quantity() {
        Quantity::Length => sensors.position_noise_m > sensors.position_step_m(),
        Quantity::Force => sensors.force_noise_n > sensors.force_step_n(),
        Quantity::Pressure => sensors.pressure_noise_pa > sensors.pressure_step_pa(),
        Quantity::Opening => false,
    }
}
