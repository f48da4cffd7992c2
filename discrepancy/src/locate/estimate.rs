//! Unknown inputs of a window by regularised least squares on the linearised simulation.
//!
//! ```text
//! r = J theta + noise       theta = x, v, p_a, p_b at the start | force, its ramp | flow a, flow b | offset of the force sensor
//! P = (J' J + L)^-1         theta^ = P J' r       var(theta^ | no unknown input) = P - P L_u P
//! ```
//!
//! r residuals over the noise of their channel, J sensitivities by finite differences, L weak priors (L_u those of the unknown
//! inputs). Coloured noise is made white ([`super::noise_colour`]). Where constants do not describe a window, its deviations are
//! widened by the residual, sqrt(chi2 / degrees of freedom) [Birge 1932]: a break-away inside it is no force. At rest a force
//! moves nothing: an input whose posterior is not tighter than a tenth of its prior is not observable in that window. The ramp
//! absorbs changes of the force within a window; it is not reported.
//!
//! Where the responses to a small force and its opposite are not antisymmetric, the piston stops, breaks away or reverses. Finite
//! differences fail there, and only the offset is estimated.
//!
//! Position alone determines the force to some newtons, the force sensor ten times better. Windows are solved with and without an
//! offset of the force sensor; where the offsets of a record are insignificant, the solution without them counts.
//!
//! Source: discrepancy-notes.md, 2; Kay 1993, Fundamentals of Statistical Signal Processing I, 4.5 and 11.5.

use super::noise_colour::ar1_coefficients;
use super::regime::Regimes;
use super::simulated::{Perturbation, Readings, RecordFollower};
use super::{SHORT_WINDOW_PERIODS, UnknownPoint, UnknownSeries, VARIABLES, linkage};
use crate::gridded_record::memory::Memory;
use crate::gridded_record::{CHANNELS, GriddedRecord};
use crate::unknown_inputs::NORMAL_LITRES_PER_MINUTE;
use crate::windows::{FORCE, UnknownKind};
use nalgebra::{SMatrix, SVector};
use plant::{Axis, PERIOD_S, RigParameters};

/// Unknowns of a window and axis: start state and unknown inputs. The place of one is its index in vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WindowUnknown {
    Extension,
    Velocity,
    PressureA,
    PressureB,
    Force,
    Ramp,
    FlowA,
    FlowB,
    /// Of the force sensor.
    Offset,
}

/// Step of the force, N.
const FORCE_STEP_N: f64 = 1.0;
/// Of each number the standard deviation of its weak prior and the step of its finite differences, in m, m/s, Pa, N, m^3/s. The
/// sensitivity to the offset is known. Priors are a guess: some ten times the errors of points and the size of effects.
const NUMBERS: [(WindowUnknown, f64, Option<f64>); COUNT] = [
    (WindowUnknown::Extension, 1e-4, Some(1e-5)),
    (WindowUnknown::Velocity, 2e-2, Some(5e-4)),
    (WindowUnknown::PressureA, 5e3, Some(200.0)),
    (WindowUnknown::PressureB, 5e3, Some(200.0)),
    (WindowUnknown::Force, 300.0, Some(FORCE_STEP_N)),
    (WindowUnknown::Ramp, 300.0, Some(1.0)),
    (WindowUnknown::FlowA, 2e-3, Some(3e-5)),
    (WindowUnknown::FlowB, 2e-3, Some(3e-5)),
    (WindowUnknown::Offset, 100.0, None),
];
const COUNT: usize = WindowUnknown::Offset as usize + 1;
const _: () = {
    let mut at = 0;
    while at < COUNT {
        assert!(NUMBERS[at].0 as usize == at, "in the order of the numbers");
        at += 1;
    }
};

impl WindowUnknown {
    fn of(self, theta: &Theta) -> f64 {
        theta[self as usize]
    }

    fn prior(self) -> f64 {
        NUMBERS[self as usize].1
    }

    /// Whether it is 0 under the null.
    fn is_unknown_input(self) -> bool {
        self as usize >= WindowUnknown::Force as usize
    }
}

/// Prior of the force sensor's offset in the solution without one, N.
const NO_OFFSET_N: f64 = 1e-3;
/// Ratio of posterior to prior above which an input is not observable.
const OBSERVABLE_RATIO: f64 = 0.1;
/// Largest asymmetry of the response to a perturbation and its opposite.
const KINK: f64 = 0.2;
/// Windows skipped at the start and after a gap, in which memories fill [rig-model.md: judged after 0.1 s].
const FILLING_SHORT_WINDOWS: usize = 5;
/// Threshold of significant offsets of the force sensor.
const OFFSET_OVER_NOISE: f64 = 1.15;

type Normal = SMatrix<f64, COUNT, COUNT>;
type Theta = SVector<f64, COUNT>;

/// Collected unknown inputs of all balances.
#[derive(Debug, Default)]
pub(super) struct Unknowns {
    /// Of each axis, in the order of [`UnknownKind::ALL`].
    axes: [[Vec<UnknownPoint>; UnknownKind::ALL.len()]; 2],
    linkage: Vec<UnknownPoint>,
}

impl Unknowns {
    /// One series for each balance that has any point.
    pub(super) fn into_series(self) -> Vec<UnknownSeries> {
        let mut all = Vec::new();
        let mut series = |balance: String, unit, points: Vec<UnknownPoint>| {
            if !points.is_empty() {
                all.push(UnknownSeries { balance, unit, points });
            }
        };
        for (axis, balances) in Axis::ALL.into_iter().zip(self.axes) {
            for (points, kind) in balances.into_iter().zip(UnknownKind::ALL) {
                let unit = if kind.is_flow() { "Nl/min" } else { "N" };
                series(format!("{}.{}", axis.name(), kind.name()), unit, points);
            }
        }
        series("linkage".to_owned(), "N", self.linkage);
        all
    }
}

/// A window and axis, solved.
struct SolvedWindow {
    from: usize,
    /// Whether the response to a force is antisymmetric.
    smooth: bool,
    /// Mean force reading of the baseline, N.
    baseline_force_n: f64,
    /// With and without an offset of the force sensor.
    free: Solution,
    bound: Solution,
}

/// A solution: estimates, null standard deviations, and sensitivities to a pressure offset.
struct Solution {
    theta: Theta,
    deviation: Theta,
    posterior: Theta,
    per_pressure_offset: [Theta; 2],
}

/// Estimates the unknown inputs of a record and appends them.
pub(super) fn estimate(rig: &RigParameters, gridded: &GriddedRecord, unknowns: &mut Unknowns) {
    let Some(mut follower) = RecordFollower::new(rig, gridded) else { return };
    let axes: Vec<usize> = (0..2).filter(|axis| gridded.measured[*axis]).collect();
    let ar1_coefficients = [0, 1]
        .map(|axis| if gridded.measured[axis] { ar1_coefficients(gridded, axis) } else { [0.0; CHANNELS] });
    let mut solved: [Vec<SolvedWindow>; 2] = [Vec::new(), Vec::new()];
    let mut filled = 0;
    // The last window needs one more period.
    for window in 0..(gridded.len() - 1) / SHORT_WINDOW_PERIODS {
        let from = window * SHORT_WINDOW_PERIODS;
        let whole = !gridded.excluded_periods[from..=from + SHORT_WINDOW_PERIODS].iter().any(|gap| *gap);
        filled = if whole { filled + 1 } else { 0 };
        if filled > FILLING_SHORT_WINDOWS
            && let Some(runs) = PerturbedRuns::of(&follower, from)
        {
            for axis in &axes {
                let window = LinearisedWindow {
                    gridded,
                    axis: *axis,
                    from,
                    ar1_coefficients: &ar1_coefficients[*axis],
                    runs: &runs,
                };
                solved[*axis].extend(window.solve());
            }
        }
        follower.advance(from, SHORT_WINDOW_PERIODS);
    }
    for axis in axes {
        gather(rig, gridded, axis, &solved[axis], &mut unknowns.axes[axis]);
    }
    linkage::gather(
        rig,
        gridded,
        &follower.contact_n,
        [ar1_coefficients[0][0], ar1_coefficients[1][0]],
        &mut unknowns.linkage,
    );
}

struct PerturbedRuns {
    baseline: Readings,
    /// With a perturbation each, in the order of [`NUMBERS`].
    perturbed: Vec<Readings>,
    /// With that of the force the other way.
    opposite: Readings,
}

impl PerturbedRuns {
    /// `None` for a state that the rig cannot have.
    fn of(follower: &RecordFollower<'_>, from: usize) -> Option<Self> {
        let perturbations =
            NUMBERS.iter().filter_map(|(number, _, step)| Some(perturbation(*number, (*step)?)));
        Some(PerturbedRuns {
            baseline: follower.run(from, &Perturbation::default())?,
            perturbed: perturbations
                .map(|perturbation| follower.run(from, &perturbation))
                .collect::<Option<_>>()?,
            opposite: follower.run(from, &perturbation(WindowUnknown::Force, -FORCE_STEP_N))?,
        })
    }

    fn perturbed(&self, number: WindowUnknown) -> &Readings {
        &self.perturbed[number as usize]
    }
}

/// The same perturbation of both axes.
fn perturbation(number: WindowUnknown, step: f64) -> Perturbation {
    let mut perturbation = Perturbation::default();
    for axis in 0..2 {
        match number {
            WindowUnknown::Extension => perturbation.start[axis][0] = step,
            WindowUnknown::Velocity => perturbation.start[axis][1] = step,
            WindowUnknown::PressureA => perturbation.start[axis][2] = step,
            WindowUnknown::PressureB => perturbation.start[axis][3] = step,
            WindowUnknown::Force => perturbation.force_n[axis] = step,
            WindowUnknown::Ramp => perturbation.ramp_n[axis] = step,
            WindowUnknown::FlowA => perturbation.flows_m3_per_s[axis][0] = step,
            WindowUnknown::FlowB => perturbation.flows_m3_per_s[axis][1] = step,
            WindowUnknown::Offset => {}
        }
    }
    perturbation
}

/// A window of an axis with its perturbed simulations.
struct LinearisedWindow<'a> {
    gridded: &'a GriddedRecord,
    axis: usize,
    from: usize,
    ar1_coefficients: &'a [f64; CHANNELS],
    runs: &'a PerturbedRuns,
}

impl LinearisedWindow<'_> {
    /// Solves the window; `None` when it has too few samples.
    fn solve(&self) -> Option<SolvedWindow> {
        let mut normal = Normal::zeros();
        let mut right = Theta::zeros();
        let mut pressure = [Theta::zeros(), Theta::zeros()];
        let (mut squares, mut used) = (0.0, 0);
        for channel in (0..CHANNELS).filter(|channel| *channel != FORCE || !self.force_is_input()) {
            let phi = self.ar1_coefficients[channel];
            let white = (1.0 - phi * phi).sqrt();
            let mut before: Option<(Theta, f64)> = None;
            for at in 0..SHORT_WINDOW_PERIODS {
                let Some((row, residual)) = self.row(at, channel) else {
                    before = None;
                    continue;
                };
                let (mut whitened, mut white_residual, mut one) = (row, residual, 1.0 / self.noise(channel));
                if let Some((row, residual)) = before {
                    whitened = (whitened - row * phi) / white;
                    white_residual = (white_residual - phi * residual) / white;
                    one *= (1.0 - phi) / white;
                }
                before = Some((row, residual));
                normal.syger(1.0, &whitened, &whitened, 1.0);
                right += whitened * white_residual;
                squares += white_residual * white_residual;
                used += 1;
                if channel >= 2 {
                    pressure[channel - 2] += whitened * one;
                }
            }
        }
        if used < SHORT_WINDOW_PERIODS * CHANNELS / 2 {
            return None;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let equations = Equations { normal, right, squares, dof: (used - COUNT) as f64, pressure };
        let bound = equations.solve(NO_OFFSET_N)?;
        let forces_n = self.runs.baseline[self.axis].iter().map(|reading| reading[FORCE]);
        let baseline_force_n = forces_n.sum::<f64>() / SHORT_WINDOW_PERIODS as f64;
        Some(SolvedWindow {
            from: self.from,
            baseline_force_n,
            smooth: self.is_smooth(),
            free: equations.solve(WindowUnknown::Offset.prior())?,
            bound,
        })
    }

    /// A reading's sensitivities and residual over its noise.
    fn row(&self, at: usize, channel: usize) -> Option<(Theta, f64)> {
        let sample = self.gridded.samples[self.from + at][self.axis][channel]?;
        let rests = self.gridded.smoothed_states[self.from][self.axis].rod_velocity_m_per_s == 0.0;
        let weight = 1.0 / self.noise(channel);
        let baseline = self.runs.baseline[self.axis][at][channel];
        let mut row = Theta::zeros();
        for (number, _, step) in NUMBERS {
            // A speed known to be 0 is not estimated.
            if let Some(step) = step.filter(|_| number != WindowUnknown::Velocity || !rests) {
                let perturbed = self.runs.perturbed(number)[self.axis][at][channel];
                row[number as usize] = (perturbed - baseline) / step * weight;
            }
        }
        if channel == FORCE {
            row[WindowUnknown::Offset as usize] = weight;
        }
        Some((row, (sample - baseline) * weight))
    }

    /// Whether the responses to a small force and its opposite are antisymmetric.
    fn is_smooth(&self) -> bool {
        let PerturbedRuns { baseline, opposite, .. } = self.runs;
        let (mut sum, mut difference) = (0.0, 0.0);
        for at in 0..SHORT_WINDOW_PERIODS {
            for channel in 0..CHANNELS {
                let of = |run: &Readings| run[self.axis][at][channel] / self.noise(channel);
                let perturbed = self.runs.perturbed(WindowUnknown::Force);
                let (plus, minus) = (of(perturbed) - of(baseline), of(opposite) - of(baseline));
                sum += (plus + minus).powi(2);
                difference += (plus - minus).powi(2);
            }
        }
        sum <= (2.0 * KINK).powi(2) * difference
    }

    fn noise(&self, channel: usize) -> f64 {
        self.gridded.noise[self.axis][channel]
    }

    /// Whether this axis' force reading is used as the contact force, and so is no measurement.
    fn force_is_input(&self) -> bool {
        self.gridded.linked && self.axis == usize::from(self.gridded.measured[1])
    }
}

/// Normal equations of a window.
struct Equations {
    normal: Normal,
    right: Theta,
    squares: f64,
    dof: f64,
    pressure: [Theta; 2],
}

impl Equations {
    fn solve(&self, offset_prior_n: f64) -> Option<Solution> {
        let prior = |number: WindowUnknown| {
            if number == WindowUnknown::Offset { offset_prior_n } else { number.prior() }
        };
        let precision = Theta::from_fn(|at, _| prior(NUMBERS[at].0).powi(-2));
        let p = (self.normal + Normal::from_diagonal(&precision)).cholesky()?.inverse();
        let theta = p * self.right;
        // The residual widens the deviations.
        let residual_squares =
            self.squares - 2.0 * theta.dot(&self.right) + theta.dot(&(self.normal * theta));
        let birge = (residual_squares / self.dof).max(1.0).sqrt();
        let mut deviation = Theta::zeros();
        let unknown = || NUMBERS.iter().map(|one| one.0).filter(|number| number.is_unknown_input());
        for number in 0..COUNT {
            // Under the null, unknown inputs are 0 and start values vary within their priors.
            let unknown: f64 =
                unknown().map(|other| (p[(number, other as usize)] / prior(other)).powi(2)).sum();
            deviation[number] = (p[(number, number)] - unknown).max(0.0).sqrt() * birge;
        }
        Some(Solution {
            theta,
            deviation,
            posterior: p.diagonal().map(f64::sqrt),
            per_pressure_offset: self.pressure.map(|pressure| p * pressure),
        })
    }
}

/// Appends the unknown inputs of the short windows of an axis.
fn gather(
    rig: &RigParameters,
    gridded: &GriddedRecord,
    axis: usize,
    solved: &[SolvedWindow],
    balances: &mut [Vec<UnknownPoint>; UnknownKind::ALL.len()],
) {
    let offsets: Vec<f64> = solved
        .iter()
        .filter(|solved| is_informative(&solved.free, WindowUnknown::Offset))
        .map(|SolvedWindow { free, .. }| {
            WindowUnknown::Offset.of(&free.theta) / WindowUnknown::Offset.of(&free.deviation)
        })
        .collect();
    let squares = offsets.iter().map(|offset| offset * offset).sum::<f64>() / offsets.len().max(1) as f64;
    let faulty = squares.sqrt() > OFFSET_OVER_NOISE;
    for SolvedWindow { from, smooth, baseline_force_n, free, bound } in solved {
        let best = if faulty { free } else { bound };
        let regimes = Regimes::of(rig, gridded, axis, *from);
        for kind in UnknownKind::ALL {
            let (solution, number) = match kind {
                UnknownKind::FlowA => (best, WindowUnknown::FlowA),
                UnknownKind::FlowB => (best, WindowUnknown::FlowB),
                UnknownKind::Force => (best, WindowUnknown::Force),
                UnknownKind::ForceSensor => (free, WindowUnknown::Offset),
            };
            if !is_informative(solution, number) || !smooth && kind != UnknownKind::ForceSensor {
                continue;
            }
            let mut variables = variables(gridded, axis, *from, kind);
            if kind == UnknownKind::ForceSensor {
                // Its own reading would correlate with every error of the sensor.
                variables[super::FORCE] = *baseline_force_n;
            }
            let scale = if kind.is_flow() { NORMAL_LITRES_PER_MINUTE } else { 1.0 };
            balances[kind.place()].push(UnknownPoint {
                window: from / SHORT_WINDOW_PERIODS,
                value: number.of(&solution.theta) * scale,
                deviation: number.of(&solution.deviation) * scale,
                variables,
                per_pressure_offset: solution.per_pressure_offset.map(|change| number.of(&change) * scale),
                regimes,
            });
        }
    }
}

/// Whether an unknown input is observable in a window.
fn is_informative(solution: &Solution, number: WindowUnknown) -> bool {
    number.of(&solution.posterior) < OBSERVABLE_RATIO * number.prior() && number.of(&solution.deviation) > 0.0
}

/// The variables of a window, in the order of [`VARIABLES`].
pub(crate) fn variables(
    gridded: &GriddedRecord,
    axis: usize,
    from: usize,
    kind: UnknownKind,
) -> [f64; VARIABLES.len()] {
    let states = &gridded.smoothed_states[from..from + SHORT_WINDOW_PERIODS];
    let n = SHORT_WINDOW_PERIODS as f64;
    let mean = |of: &dyn Fn(usize) -> f64| (0..SHORT_WINDOW_PERIODS).map(of).sum::<f64>() / n;
    let x = mean(&|at| states[at][axis].extension_m);
    let v = mean(&|at| states[at][axis].rod_velocity_m_per_s);
    let [a, b] = [0, 1].map(|chamber| mean(&|at| states[at][axis].pressures_pa[chamber]));
    let command = |at: usize| gridded.inputs[at].valve[axis];
    let u = mean(&|at| command(from + at));
    let before = from.saturating_sub(1);
    let rate = (command(from + SHORT_WINDOW_PERIODS - 1) - command(before)) / (n * PERIOD_S);
    let forces: Vec<f64> = gridded.samples[from..from + SHORT_WINDOW_PERIODS]
        .iter()
        .filter_map(|sample| sample[axis][FORCE])
        .collect();
    let force = if forces.is_empty() { 0.0 } else { forces.iter().sum::<f64>() / forces.len() as f64 };
    let end =
        &gridded.smoothed_states[(from + SHORT_WINDOW_PERIODS).min(gridded.smoothed_states.len() - 1)][axis];
    let slope =
        |chamber: usize| (end.pressures_pa[chamber] - states[0][axis].pressures_pa[chamber]) / (n * PERIOD_S);
    let dp = match kind {
        UnknownKind::FlowA => slope(0),
        UnknownKind::FlowB => slope(1),
        _ => slope(0) - slope(1),
    };
    let sign = if v == 0.0 { 0.0 } else { v.signum() };
    let time_s = (from as f64 + n / 2.0) * PERIOD_S;
    let remembered = |of: &dyn Fn(&Memory) -> f64| {
        let memories = gridded.memories.get(from..from + SHORT_WINDOW_PERIODS).unwrap_or_default();
        memories.iter().map(|memory| of(&memory[axis])).sum::<f64>() / n
    };
    let [fast, slow] = [0, 1].map(|time: usize| remembered(&|memory| memory.command_changes[time]));
    let [brief, long] = [0, 1].map(|time: usize| {
        remembered(&|memory| {
            let [a, b] = memory.pressure_changes_pa[time];
            match kind {
                UnknownKind::FlowA => a,
                UnknownKind::FlowB => b,
                _ => a - b,
            }
        })
    });
    let command_direction = remembered(&|memory| memory.command_direction);
    let extension_direction = remembered(&|memory| memory.extension_direction);
    let mean_speed = remembered(&|memory| memory.mean_speed_m_per_s);
    let plain = [x, v, v.abs(), sign, a, b, a - b, u, rate, force, time_s, dp];
    let memories = [fast, slow, command_direction, extension_direction, brief, long, mean_speed];
    std::array::from_fn(|at| if at < plain.len() { plain[at] } else { memories[at - plain.len()] })
}
