//! The training records with the simulations of them.
//!
//! ```text
//!   e      = readings - baseline                     residual of the baseline
//!   N      = (with a factor 1 + h - with 1 - h) / 2 h, for each parameter that may be wrong
//!   C_j    = effect j at a probe - baseline
//! ```
//!
//! All columns are whitened, with the start states of the windows projected out ([`crate::windows`]). Where both axes are
//! measured and their rods are not linked, each axis of a window is a window of its own, axis by axis in a column: a law that is
//! missing on one axis says nothing about the noise of the other, whose weights it would take. Simulations run on all cores and
//! are gathered in a fixed order, so that two runs have the same bits.

use crate::fit::{self, Products};
use crate::gridded_record::GriddedRecord;
use crate::parameters::{COUNT, with_factors};
use crate::windows::{ReferenceRun, VariableRanges, Windows, axis_by_axis, dot};
use model_fit::parallel;
use model_fit::stats::order_statistic;
use plant::effects::leave_laws_alone;
use plant::{Batch, RigParameters};
use rand_pcg::Pcg64;
use std::sync::Mutex;

/// Change of a factor in finite differences.
pub(crate) const FACTOR_CHANGE: f64 = 0.01;

/// Bounds of the noise level correction: an effect in every window must not pass for noise, so that the upper one is close to 1.
const VARIANCE_FACTOR_BOUNDS: [f64; 2] = [0.6, 1.05];

/// Size of the cache of sensitivities, which saves a fifth of the time of naming.
const CACHE_SIZE: usize = 4;

/// A rig, the factors of its parameters, and the sensitivities to them.
type Sensitivities = (RigParameters, [f64; COUNT], Vec<Vec<f64>>);

/// Records, windows and the baseline rig.
#[derive(Debug)]
pub struct Engine<'a> {
    /// Windows of each record, in the order of the records.
    pub windows: Vec<Windows<'a>>,
    /// The baseline, as the rig file has it.
    pub rig: RigParameters,
    /// Whether each axis of a window counts as a window, the drive first.
    pub(crate) axis_by_axis: bool,
    /// Length of the residual vector of a window.
    pub(crate) rows: usize,
    /// Degrees of freedom of each window times the common variance factor.
    pub scaled_dof: Vec<f64>,
    /// Common variance factor of the noise, by the quietest windows.
    variance_factor: f64,
    /// Whether [`Engine::simulate`] takes longer steps.
    coarse: bool,
    /// Cache of sensitivities, latest last.
    sensitivity_cache: Mutex<Vec<Sensitivities>>,
}

impl<'a> Engine<'a> {
    /// An engine of some records of the same axes.
    pub fn new(records: &'a [GriddedRecord], rig: &RigParameters) -> Self {
        Self::with_steps(records, rig, false)
    }

    /// An engine to compare models: its steps are twice as long. Where rods are linked, contacts need the short ones.
    pub(crate) fn for_search(records: &'a [GriddedRecord], rig: &RigParameters) -> Self {
        Self::with_steps(records, rig, !records.iter().any(|record| record.linked))
    }

    fn with_steps(records: &'a [GriddedRecord], rig: &RigParameters, coarse: bool) -> Self {
        let windows = parallel::map(records, |record| Windows::new(record, rig));
        let axis_by_axis = windows.iter().all(Windows::axes_are_apart);
        let rows = windows.first().map_or(0, Windows::rows) / if axis_by_axis { 2 } else { 1 };
        let scaled_dof = windows.iter().flat_map(|windows| windows.dof(axis_by_axis)).collect();
        let mut engine = Engine {
            windows,
            rig: rig.clone(),
            axis_by_axis,
            rows,
            scaled_dof,
            variance_factor: 1.0,
            coarse,
            sensitivity_cache: Mutex::default(),
        };
        let residual = engine.residual(&engine.simulate(rig));
        engine.variance_factor = variance_factor(&engine.squares(&residual), &engine.scaled_dof);
        engine.scaled_dof.iter_mut().for_each(|scaled_dof| *scaled_dof *= engine.variance_factor);
        engine
    }

    /// The same records with the start states re-estimated under another rig. On linked rods micrometres decide whether they
    /// touch, so that each rig needs its own start states.
    pub(crate) fn with_starts_under(&self, rig: &RigParameters) -> Engine<'a> {
        let windows = parallel::map(&self.windows, |windows| Windows::new(windows.record, rig));
        let scaled_dof = windows
            .iter()
            .flat_map(|windows| windows.dof(self.axis_by_axis))
            .map(|scaled_dof| scaled_dof * self.variance_factor)
            .collect();
        self.on(windows, scaled_dof)
    }

    /// Other records of the same runs in the same windows, whose start states are estimated with the sensitivities of these:
    /// [`Windows::replicated`].
    pub(crate) fn replicated<'r>(
        &self,
        records: &'r [GriddedRecord],
        sensitivities: &[Vec<Vec<Vec<f64>>>],
    ) -> Option<Engine<'r>> {
        let all = self.windows.iter().zip(records).zip(sensitivities);
        let windows: Option<_> =
            all.map(|((windows, record), sensitivities)| windows.replicated(record, sensitivities)).collect();
        Some(self.on(windows?, self.scaled_dof.clone()))
    }

    /// Synthetic records in the same windows, which a rig made whose readings are `simulated`: [`Windows::drawn`].
    pub(crate) fn drawn(&self, simulated: &[f64], random: &mut Pcg64) -> Engine<'a> {
        let mut at = 0;
        let draw = |windows: &Windows<'a>| {
            let from = at;
            at += windows.count() * windows.rows();
            windows.drawn(&simulated[from..at], self.variance_factor, random)
        };
        let windows = self.windows.iter().map(draw).collect();
        self.on(windows, self.scaled_dof.clone())
    }

    fn on<'r>(&self, windows: Vec<Windows<'r>>, scaled_dof: Vec<f64>) -> Engine<'r> {
        Engine {
            windows,
            rig: self.rig.clone(),
            axis_by_axis: self.axis_by_axis,
            rows: self.rows,
            scaled_dof,
            variance_factor: self.variance_factor,
            coarse: self.coarse,
            sensitivity_cache: Mutex::default(),
        }
    }

    /// Whether a record was made with linked rods.
    pub(crate) fn is_linked(&self) -> bool {
        self.windows.iter().any(|windows| windows.record.linked)
    }

    /// The loss of windows with these squares, and their degrees of freedom, on some axes where each counts as a window.
    pub(crate) fn loss_on(&self, axes: [bool; 2], squares: &[f64]) -> (f64, f64) {
        let counts = |at: &usize| !self.axis_by_axis || axes[at % 2];
        let (squares, dof): (Vec<f64>, Vec<f64>) =
            (0..squares.len()).filter(counts).map(|at| (squares[at], self.scaled_dof[at])).unzip();
        (fit::loss(&squares, &dof), dof.iter().sum())
    }

    /// Whether [`Engine::simulate`] takes the plant's own steps.
    pub(crate) fn is_exact(&self) -> bool {
        !self.coarse
    }

    /// Readings of a rig over their noise, all records.
    pub fn simulate(&self, rig: &RigParameters) -> Vec<f64> {
        if self.coarse {
            return self.simulate_coarsely(rig);
        }
        self.windows.iter().flat_map(|windows| windows.simulate(rig)).collect()
    }

    /// Readings of `rig` in all windows, with half the step of [`Engine::simulate`], to estimate the error of integration.
    pub(crate) fn simulate_finely(&self, rig: &RigParameters) -> Vec<f64> {
        let simulate = |windows: &Windows<'a>| {
            if self.coarse { windows.simulate(rig) } else { windows.simulate_finely(rig) }
        };
        self.windows.iter().flat_map(simulate).collect()
    }

    /// Readings of `rig` in all windows, with the longer steps of the search and of its finite differences.
    pub fn simulate_coarsely(&self, rig: &RigParameters) -> Vec<f64> {
        self.windows.iter().flat_map(|windows| windows.simulate_coarsely(rig)).collect()
    }

    /// Runs of `rig` in all windows with the steps of the search, kept for [`Engine::simulate_where`].
    pub(crate) fn reference_runs(&self, rig: &RigParameters) -> Vec<ReferenceRun> {
        parallel::map(&self.windows, |windows| windows.reference_run(rig))
    }

    /// Readings of a neighbour of the reference rig: [`Windows::simulate_where`].
    pub(crate) fn simulate_where(
        &self,
        rig: &RigParameters,
        passed: &[ReferenceRun],
        differs: impl Fn(&VariableRanges) -> bool,
    ) -> Vec<f64> {
        let windows = self.windows.iter().zip(passed);
        windows.flat_map(|(windows, passed)| windows.simulate_where(rig, passed, &differs)).collect()
    }

    /// Readings of several rigs that differ in baseline numbers, with the steps of the search, on all cores and in batches.
    fn simulate_side_by_side(&self, rigs: &[RigParameters]) -> Vec<Vec<f64>> {
        // Rigs with other laws do not run in lanes and are distributed one by one.
        let alone = !rigs.iter().all(leave_laws_alone);
        let to_each = rigs.len().div_ceil(rayon::current_num_threads());
        let at_once = if alone { 1 } else { to_each.clamp(1, Batch::GROUP) };
        let simulate = |rigs: &&[RigParameters]| {
            let mut all = vec![Vec::new(); rigs.len()];
            for windows in &self.windows {
                let simulated = windows.simulate_side_by_side(rigs);
                all.iter_mut().zip(simulated).for_each(|(all, simulated)| all.extend(simulated));
            }
            all
        };
        let batches: Vec<&[RigParameters]> = rigs.chunks(at_once).collect();
        parallel::map(&batches, simulate).into_iter().flatten().collect()
    }

    /// Finite differences: each rig of the first half minus its counterpart of the second half, over `change`.
    pub(crate) fn differences(&self, rigs: &[RigParameters], change: f64) -> Vec<Vec<f64>> {
        let simulated = self.simulate_side_by_side(rigs);
        let (up, down) = simulated.split_at(rigs.len() / 2);
        parallel::map_range(0..up.len(), |at| self.slope(&up[at], &down[at], change))
    }

    /// Whitened residual of a simulation.
    pub fn residual(&self, simulated: &[f64]) -> Vec<f64> {
        self.each(simulated, |windows, simulated, _| windows.residual(simulated), simulated)
    }

    /// Difference of two simulations, processed like a residual.
    pub fn difference(&self, simulated: &[f64], from: &[f64]) -> Vec<f64> {
        self.each(simulated, Windows::difference, from)
    }

    /// The same over the change of a number that makes the difference.
    pub(crate) fn slope(&self, simulated: &[f64], from: &[f64], change: f64) -> Vec<f64> {
        let mut column = self.difference(simulated, from);
        column.iter_mut().for_each(|value| *value /= change);
        column
    }

    fn each(
        &self,
        simulated: &[f64],
        what: impl Fn(&Windows<'a>, &[f64], &[f64]) -> Vec<f64>,
        from: &[f64],
    ) -> Vec<f64> {
        let mut at = 0;
        let mut all = Vec::with_capacity(simulated.len());
        for windows in &self.windows {
            let length = windows.count() * windows.rows();
            let made = what(windows, &simulated[at..at + length], &from[at..at + length]);
            if self.axis_by_axis {
                made.chunks_exact(windows.rows()).for_each(|window| all.extend(axis_by_axis(window)));
            } else {
                all.extend(made);
            }
            at += length;
        }
        all
    }

    /// Squared residuals of each window.
    pub(crate) fn squares(&self, residual: &[f64]) -> Vec<f64> {
        residual.chunks_exact(self.rows).map(|window| dot(window, window)).collect()
    }

    pub(crate) fn products<C: AsRef<[f64]>>(&self, residual: &[f64], columns: &[C]) -> Products {
        Products::new(residual, columns, &self.scaled_dof, self.rows)
    }

    /// Sensitivities of a rig's readings to all parameter factors, by central differences at `factors`.
    ///
    /// # Panics
    /// When another thread panicked here.
    pub fn parameter_columns(&self, rig: &RigParameters, factors: &[f64; COUNT]) -> Vec<Vec<f64>> {
        let cache = || self.sensitivity_cache.lock().expect("nobody panics with it");
        if let Some((.., columns)) = cache().iter().find(|(at_rig, at, _)| at_rig == rig && at == factors) {
            return columns.clone();
        }
        let perturbed = |at: usize, change: f64| {
            let mut factors = *factors;
            factors[at] += change;
            with_factors(rig, &factors)
        };
        // First all increments, then all decrements.
        let rigs: Vec<RigParameters> = [FACTOR_CHANGE, -FACTOR_CHANGE]
            .into_iter()
            .flat_map(|change| (0..COUNT).map(move |at| perturbed(at, change)))
            .collect();
        let columns = self.differences(&rigs, 2.0 * FACTOR_CHANGE);
        let mut cache = cache();
        if cache.len() == CACHE_SIZE {
            cache.remove(0);
        }
        cache.push((rig.clone(), *factors, columns.clone()));
        columns
    }
}

/// Common variance factor: the lowest decile of chi2 per degree of freedom over its expectation, within
/// [`VARIANCE_FACTOR_BOUNDS`]. An error of a few per cent in the estimated noise would look like a large excess over 200 windows.
/// The factor multiplies the degrees of freedom instead of dividing chi2, so that fixed thresholds on the loss change their level
/// with it.
fn variance_factor(squares: &[f64], scaled_dof: &[f64]) -> f64 {
    let mut quiet: Vec<f64> =
        squares.iter().zip(scaled_dof).map(|(square, scaled_dof)| square / scaled_dof).collect();
    let decile = quiet.len() / 10;
    let Some(quantile) = order_statistic(&mut quiet, decile) else { return 1.0 };
    let mean = scaled_dof.iter().sum::<f64>() / scaled_dof.len() as f64;
    // The lowest tenth of chi2 / f ends 1.28 standard deviations below 1.
    (quantile / (1.0 - 1.28 * (2.0 / mean).sqrt()))
        .clamp(VARIANCE_FACTOR_BOUNDS[0], VARIANCE_FACTOR_BOUNDS[1])
}
