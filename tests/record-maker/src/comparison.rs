//! A null record against the plant under the valve commands of the record, in windows of equal start and in one free run.
//!
//! ```text
//!   window    plant set to the record's true state, 100 ms under the record's commands      difference / noise at each ms
//!   free run  plant set once, at the first row                                              the same, for information
//! ```
//!
//! Following rig-model.md (Accuracy), single samples of the force at stick and contact events are excluded and counted: samples
//! at which only one of the two simulations has the piston stuck, or before which the piston stuck or broke away, or the
//! contact closed or opened.

use super::closed_loop::{replay_windows, run};
use super::{MakeError, Recipe, Record, Row};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup, SetupError, State};

/// Length of a window, rows of 1 ms.
pub const WINDOW: usize = 100;

/// Names of the signals of an axis, in the order of [`Row::without_noise`].
pub const SIGNALS: [&str; 4] = ["position", "force", "pressure a", "pressure b"];

/// Differences of one signal in units of its sensor's noise.
#[derive(Debug, Clone, Default)]
pub struct Difference {
    windows: Vec<f64>,
    /// Number of excluded samples, number of all samples.
    pub left_out: [usize; 2],
    squares: f64,
    samples: usize,
}

/// Differences of both axes and their [`SIGNALS`]; empty for a resting axis.
pub type Differences = [[Difference; 4]; 2];

impl Difference {
    /// Rms over all windows, in units of the noise; 0 without samples.
    pub fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }

    /// Percentile of the rms of the windows, `percent` from 0 to 100; 0 without windows.
    pub fn percentile(&self, percent: f64) -> f64 {
        let mut sorted = self.windows.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted.get((percent / 100.0 * last as f64).round() as usize).copied().unwrap_or(0.0)
    }

    fn add(&mut self, window: &Window) {
        if window.samples > 0 {
            self.windows.push((window.squares / window.samples as f64).sqrt());
        }
        self.squares += window.squares;
        self.samples += window.samples;
        self.left_out[0] += window.left_out;
        self.left_out[1] += window.left_out + window.samples;
    }
}

#[derive(Default)]
struct Window {
    squares: f64,
    samples: usize,
    left_out: usize,
}

/// Compares a record with the plant of `rig` in windows of `rows`, each started from the record's true state.
///
/// # Errors
/// [`SetupError`] when the plant cannot be set to a true state.
pub fn against_plant(record: &Record, rig: &RigParameters, rows: usize) -> Result<Differences, SetupError> {
    let mut differences = Differences::default();
    let recorded = |i: usize| record.recipe.both_axes || record.recipe.axis.index() == i;
    for rows in record.rows.chunks(rows) {
        let mut plant = Plant::in_state(rig, &state(record, rig, &rows[0])?)?;
        let mut windows: [[Window; 4]; 2] = Default::default();
        let mut held_before = [[true; 2]; 2];
        let mut touched_before = false;
        for (at, row) in rows.iter().enumerate() {
            let inputs = Inputs { valve: row.valve, ..Inputs::default() };
            let truth = plant.truth(&inputs);
            let touched = row.contact_force_n != 0.0 || truth.contact_force_n != 0.0;
            let both = (row.contact_force_n != 0.0) == (truth.contact_force_n != 0.0);
            let contact_event = !both || touched != touched_before;
            touched_before = touched;
            for i in (0..2).filter(|i| recorded(*i)) {
                let other = &truth.axes[i];
                let held = [row.axes[i].rod_velocity_m_per_s == 0.0, other.rod_velocity_m_per_s == 0.0];
                let event = contact_event || held[0] != held[1] || held != held_before[i];
                held_before[i] = held;
                let mounted_m = [0.0, rig.sensors().load_position_offset_m][i];
                let shown = [
                    other.position_m + mounted_m,
                    other.sensor_force_n,
                    other.pressure_a_pa,
                    other.pressure_b_pa,
                ];
                let noise = noises(rig);
                for signal in 0..4 {
                    let window = &mut windows[i][signal];
                    if signal == 1 && at > 0 && event {
                        window.left_out += 1;
                        continue;
                    }
                    let difference = (row.without_noise[i][signal] - shown[signal]) / noise[signal];
                    window.squares += difference * difference;
                    window.samples += 1;
                }
            }
            plant.step(&inputs);
        }
        for i in (0..2).filter(|i| recorded(*i)) {
            for signal in 0..4 {
                differences[i][signal].add(&windows[i][signal]);
            }
        }
    }
    Ok(differences)
}

/// Rms of the differences of two records from a null record, in units of the noise, and the cosine between them, over the
/// signals of the first `axes`.
pub fn from_null(null: &Record, one: &Record, other: &Record, axes: usize) -> [f64; 3] {
    const NOISE: [f64; 4] = [20e-6, 0.5, 400.0, 400.0];
    let [mut one_one, mut other_other, mut product] = [0.0; 3];
    for ((null, one), other) in null.rows.iter().zip(&one.rows).zip(&other.rows) {
        for (axis, signal) in (0..4 * axes).map(|i| (i / 4, i % 4)) {
            let zero = null.without_noise[axis][signal];
            let a = (one.without_noise[axis][signal] - zero) / NOISE[signal];
            let b = (other.without_noise[axis][signal] - zero) / NOISE[signal];
            one_one += a * a;
            other_other += b * b;
            product += a * b;
        }
    }
    let count = (4 * axes * null.rows.len()) as f64;
    [(one_one / count).sqrt(), (other_other / count).sqrt(), product / (one_one * other_other).sqrt()]
}

/// Noise of position, force and pressures, SI.
fn noises(rig: &RigParameters) -> [f64; 4] {
    let sensors = rig.sensors();
    [sensors.position_noise_m, sensors.force_noise_n, sensors.pressure_noise_pa, sensors.pressure_noise_pa]
}

/// The plant's state at a row; states that a record does not hold have their initial values.
fn state(record: &Record, rig: &RigParameters, row: &Row) -> Result<State, SetupError> {
    let setup = Setup { linked: record.linked, added_mass_kg: record.added_mass_kg, ..Setup::default() };
    let mut state = *Plant::new(rig, &setup)?.state();
    for (axis, truth) in state.axes.iter_mut().zip(&row.axes) {
        axis.extension_m = truth.extension_m;
        axis.rod_velocity_m_per_s = truth.rod_velocity_m_per_s;
        axis.spool = truth.spool;
        [axis.stored_air_a_j, axis.stored_air_b_j] = truth.stored_air_j;
        [axis.flow_a_m3_per_s, axis.flow_b_m3_per_s] = truth.flow_m3_per_s;
    }
    state.supply_pressure_pa = row.supply_pressure_pa;
    Ok(state)
}

/// Rms difference between the plant of a rig with the record's effects and the record's sensors, over the first `rows`, in
/// units of the noise, for drive and load and their signals. One free run, since a record does not hold the memory of effects.
/// Includes the rounding of the sensors: some 0.1 of the noise in position, 0.04 in force and pressure.
///
/// # Errors
/// When the plant cannot be set to the first state, or the rig's noise cannot be switched off.
pub fn with_effects(
    record: &Record,
    rig: &RigParameters,
    rows: usize,
) -> Result<[[f64; 4]; 2], Box<dyn std::error::Error>> {
    let noise = noises(rig);
    let silent = rig
        .with("sensors.position_noise_um", &[0.0])?
        .with("sensors.force_noise_n", &[0.0])?
        .with("sensors.pressure_noise_pa", &[0.0])?;
    let mut plant = Plant::in_state(&silent, &state(record, &silent, &record.rows[0])?)?;
    let mut sensors = Sensors::new(&silent, 1);
    let mut squares = [[0.0; 4]; 2];
    for row in &record.rows[..rows] {
        let inputs = Inputs { valve: row.valve, ..Inputs::default() };
        let readings = sensors.sample(&plant, &inputs);
        for i in 0..2 {
            let [position, force] = [readings[i].position.value, readings[i].force.value];
            let shown = [position, force, readings[i].pressure_a.value, readings[i].pressure_b.value];
            for signal in 0..4 {
                let difference = (row.without_noise[i][signal] - shown[signal]) / noise[signal];
                squares[i][signal] += difference * difference;
            }
        }
        plant.step(&inputs);
    }
    Ok(squares.map(|axis| axis.map(|sum| (sum / rows as f64).sqrt())))
}

/// Change by halving the step: rms difference between the null record simulated with `steps_per_ms` and with twice as many, in
/// windows of equal start, in units of the noise; for drive and load and their signals.
///
/// # Errors
/// [`MakeError`] when the recipe is not valid, or a run fails.
pub fn of_halved_step(
    recipe: &Recipe,
    rig: &RigParameters,
    [rows, steps_per_ms]: [usize; 2],
) -> Result<[[f64; 4]; 2], MakeError> {
    let record = run(recipe, rig, [rows, steps_per_ms])?;
    let others = replay_windows(&record, rig, [WINDOW, 2 * steps_per_ms])?;
    let noise = noises(rig);
    let rms = |i: usize, signal: usize| {
        let squares = record.rows.iter().zip(&others).map(|(row, other)| {
            let difference = row.without_noise[i][signal] - other.without_noise[i][signal];
            (difference / noise[signal]).powi(2)
        });
        (squares.sum::<f64>() / rows as f64).sqrt()
    };
    Ok([0, 1].map(|i| [0, 1, 2, 3].map(|signal| rms(i, signal))))
}
