//! A record on a grid of 1 ms: inputs, samples and smoothed states of every period.
//!
//! ```text
//!   record ──► grid of 1 ms ──► inputs held over each period, samples or None, states (x, v, p_a, p_b) by local parabolas
//! ```
//!
//! Rows go to their nearest millisecond. A period without a row has no samples and keeps the command before. A window with a
//! run of more than [`HELD_LONGEST`] periods without a command, or a period without a smoothed state, is not simulated
//! ([`GriddedRecord::excluded_periods`]).
//!
//! Windows start at the smoothed states; their remaining errors are estimated with each window. At rest the speed is exactly zero
//! (`gridded_record/rest.rs`).
//!
//! Source: rig-model.md, Measurement file; discrepancy-notes.md, 1. Savitzky, Golay 1964, Anal. Chem. 36(8): local parabolas.

pub(crate) mod memory;
mod rest;
mod subsample;

use crate::check::Checked;
use memory::Memory;
use model_fit::stats::{mean, mean_and_variance, median};
use plant::{Axis, Inputs, PERIOD_S, RigParameters, quantise_valve};
use records::{Channel, Record, Signal};
use rest::{Rate, RestClassifier};
pub(crate) use subsample::searched_share;

/// Simulated channels of an axis: position, force, pressures a and b.
pub(crate) const CHANNELS: usize = 4;
pub(crate) const SIGNALS: [Signal; CHANNELS] =
    [Signal::Position, Signal::Force, Signal::PressureA, Signal::PressureB];
/// Samples to each side of a local parabola of the position.
const POSITION_HALF_WIDTH: usize = 10;
/// The same of a pressure.
const PRESSURE_REACH: usize = 5;
/// Differences in a block of the autocorrelation estimate, and the fewest blocks at rest.
const LAG1_BLOCK_DIFFERENCES: usize = 25;
const FEWEST_AT_REST: usize = 10;
/// Autocorrelation and jitter below which they count as zero.
const LEAST_AUTOCORRELATION: f64 = 0.15;
const LEAST_JITTER_S: f64 = 2e-5;
/// Samples in a block of the jitter estimate, and the lowest speed of a block.
const JITTER_BLOCK_SAMPLES: usize = 20;
const JITTER_SPEED_M_PER_S: f64 = 0.1;
/// Longest run of missing commands in a window.
pub(crate) const HELD_LONGEST: usize = 3;

/// Inputs, readings and smoothed states of a record on its grid.
#[derive(Clone, Debug, Default)]
pub struct GriddedRecord {
    pub(crate) name: String,
    /// Whether the rods of the axes are linked.
    pub linked: bool,
    /// Weights on the carriage, kg.
    pub(crate) added_mass_kg: f64,
    /// Which axes were measured, drive and load.
    pub measured: [bool; 2],
    pub(crate) inputs: Vec<Inputs>,
    /// Readings at the start of each period, in the order of [`SIGNALS`], rig coordinates, the load's offset taken off.
    pub(crate) samples: Vec<[[Option<f64>; CHANNELS]; 2]>,
    /// Smoothed state of each axis at the start of each period.
    pub(crate) smoothed_states: Vec<[AxisState; 2]>,
    /// What each axis remembers at the start of each period.
    pub(crate) memories: Vec<[Memory; 2]>,
    /// Standard deviation of each reading, its rounding included.
    pub(crate) noise: [[f64; CHANNELS]; 2],
    /// Lag-1 autocorrelation of the noise, 0 to 1.
    pub(crate) lag1_autocorrelation: [[f64; CHANNELS]; 2],
    pub(crate) jitter_s: f64,
    /// Periods without a known command or without a smoothed state.
    pub(crate) excluded_periods: Vec<bool>,
    /// Periods of the whole record in which the blocks of a subsample begin; none of a whole record.
    pub(crate) blocks: Vec<usize>,
}

/// Mechanical state and pressures of an axis, along its extension.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisState {
    /// Extension of the rod, 0 to the stroke, m; of the load it grows against the rig's position.
    pub extension_m: f64,
    /// Its rate, m/s; exactly 0 at rest.
    pub rod_velocity_m_per_s: f64,
    /// An indistinguishable rate: that of creep where the piston seems at rest, 0 where it is slow.
    pub(crate) alternative_velocity_m_per_s: Option<f64>,
    /// Absolute pressures of the chambers a and b, Pa.
    pub pressures_pa: [f64; 2],
}

impl AxisState {
    /// Steps of finite differences in x, v, p_a, p_b: m, m/s, Pa, Pa. Small, so that no stick-slip event moves.
    pub(crate) const PERTURBATIONS: [f64; 4] = [2e-6, 2e-4, 50.0, 50.0];

    /// The state with one of its values perturbed, in the order of [`AxisState::PERTURBATIONS`].
    pub(crate) fn perturbed(mut self, number: usize) -> Self {
        let value = match number {
            0 => &mut self.extension_m,
            1 => &mut self.rod_velocity_m_per_s,
            _ => &mut self.pressures_pa[number - 2],
        };
        *value += AxisState::PERTURBATIONS[number];
        self
    }
}

/// Why a record cannot be simulated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum GriddingError {
    #[error(
        "{file}: no column {column}: the simulation of an axis needs valve, position, force and both pressures"
    )]
    Missing { file: String, column: String },
    #[error("{file}: no axis is measured: a record needs the columns of drive or load")]
    NoAxis { file: String },
    #[error("{file}: {length_ms} ms: a record needs at least {least_ms} ms")]
    Short { file: String, length_ms: usize, least_ms: usize },
}

impl GriddingError {
    /// The column that it is about.
    pub(crate) fn column(&self) -> Option<&str> {
        match self {
            GriddingError::Missing { column, .. } => Some(column),
            GriddingError::NoAxis { .. } | GriddingError::Short { .. } => None,
        }
    }
}

/// Shortest record, periods.
pub(crate) const SHORTEST: usize = 1000;

impl GriddedRecord {
    /// Puts a checked record on its grid.
    ///
    /// # Errors
    /// [`GriddingError`] when a signal is missing or the record is too short.
    pub fn of(
        record: &Record,
        checked: &Checked,
        rig: &RigParameters,
    ) -> Result<GriddedRecord, GriddingError> {
        let file = record.file.display().to_string();
        // A parked, unlinked load carries no information, and its position may be clipped.
        let measured = Axis::ALL.map(|axis| {
            record.channel(Channel::Of(axis, Signal::Position)).is_some()
                && (record.setup.linked || !checked.is_parked(axis))
        });
        if measured == [false, false] {
            return Err(GriddingError::NoAxis { file });
        }
        for axis in Axis::ALL.into_iter().filter(|axis| measured[axis.index()]) {
            for signal in [Signal::Valve].into_iter().chain(SIGNALS) {
                let channel = Channel::Of(axis, signal);
                if record.channel(channel).is_none() {
                    return Err(GriddingError::Missing { file, column: channel.column() });
                }
            }
        }
        let places = places(record, checked);
        let length = places.last().map_or(0, |last| last + 1);
        if length < SHORTEST {
            return Err(GriddingError::Short { file, length_ms: length, least_ms: SHORTEST });
        }
        let mut gridded = GriddedRecord {
            name: file,
            linked: record.setup.linked,
            added_mass_kg: record.setup.added_mass_kg,
            measured,
            inputs: vec![Inputs::default(); length],
            samples: vec![[[None; CHANNELS]; 2]; length],
            smoothed_states: vec![[AxisState::default(); 2]; length],
            excluded_periods: vec![false; length],
            ..GriddedRecord::default()
        };
        for axis in Axis::ALL {
            if measured[axis.index()] {
                gridded.fill(axis, record, checked, rig, &places);
            }
        }
        Ok(gridded)
    }

    /// Number of periods of 1 ms.
    pub fn len(&self) -> usize {
        self.inputs.len()
    }

    /// Whether it has no period.
    pub fn is_empty(&self) -> bool {
        self.inputs.is_empty()
    }

    fn fill(
        &mut self,
        axis: Axis,
        record: &Record,
        checked: &Checked,
        rig: &RigParameters,
        places: &[usize],
    ) {
        let i = axis.index();
        let sensors = rig.sensors();
        let offset_m = if axis == Axis::Load { sensors.load_position_offset_m } else { 0.0 };
        let mut commands = vec![None; self.len()];
        for (row, place) in places.iter().enumerate() {
            let value = |signal: Signal| {
                let channel = Channel::Of(axis, signal);
                record.value(channel, row).filter(|_| checked.is_usable(channel, row))
            };
            // An empty row must not replace a full one.
            if ![Signal::Valve].into_iter().chain(SIGNALS).any(|signal| value(signal).is_some()) {
                continue;
            }
            commands[*place] = value(Signal::Valve);
            for (at, signal) in SIGNALS.into_iter().enumerate() {
                let offset = if signal == Signal::Position { offset_m } else { 0.0 };
                self.samples[*place][i][at] = value(signal).map(|value| value - offset);
            }
        }
        let steps = [
            sensors.position_step_m(),
            sensors.force_step_n(),
            sensors.pressure_step_pa(),
            sensors.pressure_step_pa(),
        ];
        let specified = [
            sensors.position_noise_m,
            sensors.force_noise_n,
            sensors.pressure_noise_pa,
            sensors.pressure_noise_pa,
        ];
        for at in 0..CHANNELS {
            let noise = checked.noise(Channel::Of(axis, SIGNALS[at])).unwrap_or(specified[at]);
            // Rounding is a lower bound of the noise.
            self.noise[i][at] = noise.max(steps[at] / 12.0_f64.sqrt());
        }
        hold(&mut commands, &mut self.excluded_periods);
        for (inputs, command) in self.inputs.iter_mut().zip(&commands) {
            inputs.valve[i] = quantise_valve(command.unwrap_or(0.0).clamp(-1.0, 1.0));
        }
        self.smooth(axis, rig);
    }

    /// A record of simulated samples: inputs, samples, noise and measured axes are given.
    pub(crate) fn of_samples(given: GriddedRecord, rig: &RigParameters) -> GriddedRecord {
        let mut gridded = GriddedRecord {
            smoothed_states: vec![[AxisState::default(); 2]; given.len()],
            excluded_periods: vec![false; given.len()],
            ..given
        };
        for axis in Axis::ALL {
            if gridded.measured[axis.index()] {
                gridded.smooth(axis, rig);
            }
        }
        gridded
    }

    /// Standard errors of an axis' smoothed state from the noise of its samples, in the order of
    /// [`AxisState::PERTURBATIONS`]; 0 of the rate of an axis at rest.
    pub(crate) fn state_errors(&self, axis: usize, rests: bool) -> [f64; 4] {
        let error = |channel: usize, variance: f64| {
            let r = self.lag1_autocorrelation[axis][channel];
            self.noise[axis][channel] * (variance * (1.0 + r) / (1.0 - r)).sqrt()
        };
        let pressure = parabola_variance(PRESSURE_REACH);
        let [position, rate] = if rests {
            [rest::mean_variance(), 0.0]
        } else {
            [parabola_variance(POSITION_HALF_WIDTH), slope_error(POSITION_HALF_WIDTH).powi(2)]
        };
        [error(0, position), error(0, rate) / PERIOD_S, error(2, pressure), error(3, pressure)]
    }

    /// Points, autocorrelation and jitter of an axis from its samples.
    fn smooth(&mut self, axis: Axis, rig: &RigParameters) {
        let i = axis.index();
        let stroke_m = rig.cylinder().stroke_m;
        let column =
            |at: usize| -> Vec<Option<f64>> { self.samples.iter().map(|sample| sample[i][at]).collect() };
        let positions = column(0);
        let position = parabolas(&positions, POSITION_HALF_WIDTH);
        let pressures = [parabolas(&column(2), PRESSURE_REACH), parabolas(&column(3), PRESSURE_REACH)];
        let mut classifier = RestClassifier::new(&position, &positions, self.noise[i][0]);
        // Autocorrelation widens the error of a mean.
        let r = lag1_autocorrelation(&positions, &classifier.resting(), self.noise[i][0]);
        if r > 0.0 {
            let lasting_m = self.noise[i][0] * ((1.0 + r) / (1.0 - r)).sqrt();
            classifier = RestClassifier::new(&position, &positions, lasting_m);
        }
        for place in 0..self.len() {
            let pressures = pressures.each_ref().map(|column| column[place].map(|parabola| parabola.value));
            let (Some(rate), [Some(a), Some(b)]) = (classifier.rate(place), pressures) else {
                self.excluded_periods[place] = true;
                continue;
            };
            let Rate { position_m, rate_m_per_s, alternative_velocity_m_per_s } = rate;
            let (out_m, out) =
                if axis == Axis::Load { (stroke_m - position_m, -1.0) } else { (position_m, 1.0) };
            self.smoothed_states[place][i] = AxisState {
                extension_m: out_m.clamp(0.0, stroke_m),
                rod_velocity_m_per_s: out * rate_m_per_s,
                alternative_velocity_m_per_s: alternative_velocity_m_per_s.map(|rate| out * rate),
                pressures_pa: [a, b],
            };
        }
        let resting = classifier.resting();
        for at in 0..CHANNELS {
            self.lag1_autocorrelation[i][at] = lag1_autocorrelation(&column(at), &resting, self.noise[i][at]);
        }
        self.jitter_s = self.jitter_s.max(jitter_s(&position, &positions, &resting));
        self.remember(i);
    }
}

/// Lag-1 autocorrelation r of a channel's noise, from its differences at rest: var(difference) = 2 sigma^2 (1 - r).
fn lag1_autocorrelation(values: &[Option<f64>], resting: &[bool], noise: f64) -> f64 {
    let mut variances: Vec<f64> = (0..values.len().saturating_sub(1) / LAG1_BLOCK_DIFFERENCES)
        .filter_map(|block| {
            let places = block * LAG1_BLOCK_DIFFERENCES..(block + 1) * LAG1_BLOCK_DIFFERENCES;
            let differences: Option<Vec<f64>> = places
                .map(|at| if resting[at] { Some(values[at + 1]? - values[at]?) } else { None })
                .collect();
            let differences = differences?;
            Some(mean_and_variance(&differences).1)
        })
        .collect();
    if variances.len() < FEWEST_AT_REST {
        return 0.0;
    }
    let difference_sd = median(&mut variances).map_or(0.0, f64::sqrt);
    let r = 1.0 - difference_sd * difference_sd / (2.0 * noise * noise);
    if r < LEAST_AUTOCORRELATION { 0.0 } else { r.min(0.95) }
}

/// Sampling jitter: the part of the scatter of positions around their parabolas that grows with the speed.
fn jitter_s(parabolas: &[Option<Parabola>], positions: &[Option<f64>], resting: &[bool]) -> f64 {
    let median_of = |of: &dyn Fn(usize) -> Option<f64>| -> Option<f64> {
        let mut blocks: Vec<f64> = (0..positions.len() / JITTER_BLOCK_SAMPLES)
            .filter_map(|block| {
                let values: Option<Vec<f64>> =
                    (block * JITTER_BLOCK_SAMPLES..(block + 1) * JITTER_BLOCK_SAMPLES).map(of).collect();
                values.map(|values| mean(&values))
            })
            .collect();
        median(&mut blocks)
    };
    let square = |at: usize| Some((positions[at]? - parabolas[at]?.value).powi(2));
    let Some(still) = median_of(&|at| if resting[at] { square(at) } else { None }) else { return 0.0 };
    let moving = median_of(&|at| {
        let slope = parabolas[at]?.slope / PERIOD_S;
        if slope.abs() < JITTER_SPEED_M_PER_S { None } else { Some((square(at)? - still) / (slope * slope)) }
    });
    let Some(variance) = moving else { return 0.0 };
    // A parabola absorbs part of the scatter.
    let kept = 1.0 - parabola_variance(POSITION_HALF_WIDTH);
    let jitter_s = (variance / kept).max(0.0).sqrt();
    if jitter_s < LEAST_JITTER_S { 0.0 } else { jitter_s }
}

/// Variance of the value of a parabola over so many samples to each side, over that of a sample.
fn parabola_variance(reach: usize) -> f64 {
    let m = reach as f64;
    3.0 * (3.0 * m * m + 3.0 * m - 1.0) / ((2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0))
}

/// Standard error of the slope of such a parabola, per period, over the standard deviation of a sample.
fn slope_error(reach: usize) -> f64 {
    let n = reach as f64;
    (3.0 / (n * (n + 1.0) * (2.0 * n + 1.0))).sqrt()
}

/// Grid index of each row; rows whose time jumps back share that of the row before.
///
/// A row with an impossible time keeps the index before it; its samples do not count.
fn places(record: &Record, checked: &Checked) -> Vec<usize> {
    let times = record.time_s();
    let is_good = |row: usize| record.channels().any(|channel| checked.is_usable(channel, row));
    let good: Vec<bool> = (0..times.len()).map(is_good).collect();
    let first = times.iter().zip(&good).find(|(_, good)| **good).map_or(0.0, |(time, _)| *time);
    let mut last = 0;
    times
        .iter()
        .zip(good)
        .map(|(time, good)| {
            if good {
                last = last.max(((time - first) / PERIOD_S).round().max(0.0) as usize);
            }
            last
        })
        .collect()
}

/// Holds commands over short gaps and marks long ones.
fn hold(commands: &mut [Option<f64>], excluded_periods: &mut [bool]) {
    let mut since = 0;
    for place in 0..commands.len() {
        if commands[place].is_some() {
            since = 0;
            continue;
        }
        since += 1;
        commands[place] = place.checked_sub(1).and_then(|before| commands[before]);
        if since > HELD_LONGEST || commands[place].is_none() {
            excluded_periods[place + 1 - since..=place].fill(true);
        }
    }
}

/// Value and slope per period of a local parabola at its centre.
#[derive(Clone, Copy, Debug)]
struct Parabola {
    value: f64,
    slope: f64,
}

/// Least-squares parabola around each place; `None` where less than half of the samples exist.
fn parabolas(values: &[Option<f64>], reach: usize) -> Vec<Option<Parabola>> {
    (0..values.len())
        .map(|place| {
            let from = place.saturating_sub(reach);
            let to = (place + reach + 1).min(values.len());
            let mut sums = [[0.0; 4]; 3];
            let mut count = 0;
            for (at, value) in values[from..to].iter().enumerate() {
                let Some(value) = value else { continue };
                let t = (from + at) as f64 - place as f64;
                let powers = [1.0, t, t * t];
                for row in 0..3 {
                    for column in 0..3 {
                        sums[row][column] += powers[row] * powers[column];
                    }
                    sums[row][3] += powers[row] * value;
                }
                count += 1;
            }
            if count <= reach {
                return None;
            }
            solve(sums).map(|[value, slope, _]| Parabola { value, slope })
        })
        .collect()
}

/// Solves three equations by Gauss-Jordan elimination; `None` where they are singular.
fn solve(mut rows: [[f64; 4]; 3]) -> Option<[f64; 3]> {
    for pivot in 0..3 {
        let best = (pivot..3).max_by(|a, b| rows[*a][pivot].abs().total_cmp(&rows[*b][pivot].abs()))?;
        rows.swap(pivot, best);
        if rows[pivot][pivot].abs() < 1e-12 {
            return None;
        }
        for row in 0..3 {
            if row != pivot {
                let factor = rows[row][pivot] / rows[pivot][pivot];
                let pivot_row = rows[pivot];
                rows[row].iter_mut().zip(pivot_row).for_each(|(value, other)| *value -= factor * other);
            }
        }
    }
    Some([rows[0][3] / rows[0][0], rows[1][3] / rows[1][1], rows[2][3] / rows[2][2]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_its_own_parabola_holes_and_all() {
        let values: Vec<_> = (0..50)
            .map(|at| (at % 7 != 3).then_some(2.0 + 0.5 * f64::from(at) - 0.1 * f64::from(at * at)))
            .collect();
        let parabola = parabolas(&values, 10)[20].unwrap();
        assert!((parabola.value - (2.0 + 10.0 - 40.0)).abs() < 1e-9, "{parabola:?}");
        assert!((parabola.slope - (0.5 - 4.0)).abs() < 1e-9, "{parabola:?}");
    }

    #[test]
    fn commands_are_held_over_a_short_gap_and_a_long_one_is_marked() {
        let mut commands = vec![Some(0.5), None, None, Some(0.1), None, None, None, None, Some(0.2)];
        let mut excluded_periods = vec![false; 9];
        hold(&mut commands, &mut excluded_periods);
        assert_eq!(commands[2], Some(0.5));
        assert_eq!(excluded_periods, [false, false, false, false, true, true, true, true, false]);
    }
}
