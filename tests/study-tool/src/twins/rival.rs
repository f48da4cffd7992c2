//! The law of another effect nearest to a rig in a part of a record, with parameters of the baseline fitted too.
//!
//! ```text
//!   record ──► responses of all effects and parameters, window by window ──► each part: share of the effect's signature that
//!              one amplitude of another effect leaves, parameters held by their priors ──► the best: fitted in the simulator
//! ```
//!
//! Responses are those at the middle of a range; the fit ([`Fit`]) varies all numbers of the other effect and all parameters.

use super::{Model, Part};
use crate::classes::{nominal, with_parameter};
use crate::nearest::Fit;
use crate::signature::{Observer, dot, length};
use crate::trajectory::WINDOW;
use discrepancy::candidates::Candidate;
use discrepancy::parameters::PARAMETERS as PRIORS;
use nalgebra::DMatrix;
use plant::{Axis, RigParameters};
use record_maker::{Hidden, PARAMETERS};

/// Change of a parameter for its response.
const CHANGE: f64 = 0.01;
/// Noise at which the priors are weighted against the readings: the middle of those that twins have.
const NOISE: f64 = 3.0;
/// Smallest amplitude of a rival as a share of the smallest drawn, and where the range contains the baseline; largest as a
/// multiple of the largest drawn. A program names nothing below.
const SMALLEST: f64 = 1.0;
const SMALLEST_ABOUT: f64 = 0.05;
const LARGEST: f64 = 2.0;
/// Lengths of parts, the longest first, and spacing of their starts, windows.
const LENGTHS: [usize; 5] = [150, 100, 60, 40, 20];
const BETWEEN: usize = 2;
/// Of the parts in which the contrast of an effect to its rival exceeds this, the longest is taken; else the one with the
/// largest contrast, if that exceeds [`LEAST_CONTRAST`]. The fit leaves less than the responses predict.
const CONTRAST: f64 = 14.0;
const LEAST_CONTRAST: f64 = 3.0;

/// Responses in all windows of the record of an effect.
#[derive(Debug)]
pub(crate) struct Screening {
    rig: RigParameters,
    /// Number of readings in a window.
    rows: usize,
    /// Readings of the effect minus those of the baseline.
    signature: Vec<f64>,
    parameters: Vec<Vec<f64>>,
    others: Vec<(Candidate, Vec<f64>)>,
}

/// Another effect in a part of the record.
#[derive(Debug, Clone)]
pub(crate) struct Screened {
    candidate: Candidate,
    start: Vec<f64>,
    pub(crate) part: Part,
    /// Distance of the effect from the baseline, parameters fitted, at the specified noise.
    pub(crate) distance: f64,
    /// The same over the residual of the other effect.
    pub(crate) contrast: f64,
}

/// A fitted law.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub(crate) rig: RigParameters,
    pub(crate) model: Model,
    /// Distance from the rig that it was fitted to, at the specified noise.
    pub(crate) left: f64,
}

impl Screening {
    /// `observer` sees the whole record and has the rig with the effect as its baseline.
    pub(crate) fn new(observer: &Observer, hidden: &Hidden, axis: Axis) -> Option<Self> {
        let rig = RigParameters::baseline();
        let without = observer.readings(&rig);
        let response = |rig: &RigParameters| observer.between(&observer.readings(rig), &without);
        let of_parameter = |name: &str| {
            let all = response(&with_parameter(&rig, name, 1.0 + CHANGE).ok()?);
            Some(all.into_iter().map(|difference| difference / CHANGE).collect())
        };
        let parameters = PARAMETERS.iter().map(|name| of_parameter(name)).collect::<Option<_>>()?;
        let axes = Axis::ALL.map(|each| each == axis);
        let candidates = Candidate::all(&rig, axes, false, &[hidden.name.to_owned()]);
        let of = |candidate: Candidate| {
            let sheet = candidate.sheet;
            let with = rig.with_effect(sheet.name, &candidate.place.to_string(), &nominal(sheet)).ok()?;
            Some((candidate, response(&with)))
        };
        let others = candidates.into_iter().filter_map(of).collect();
        let signature = observer.between(&observer.baseline, &without);
        Some(Screening { rig, rows: observer.rows(), signature, parameters, others })
    }

    /// All other effects, each in its best part, by descending contrast.
    pub(crate) fn all(&self) -> Vec<Screened> {
        let mut all: Vec<Screened> = Vec::new();
        let windows = self.signature.len() / self.rows;
        let products = self.products(windows);
        for (at, (candidate, _)) in self.others.iter().enumerate() {
            let mut best: Option<Screened> = None;
            for length in LENGTHS {
                for from in (1..windows.saturating_sub(length)).step_by(BETWEEN) {
                    let Some(screened) = self.screened(*candidate, &products[at], [from, length]) else {
                        continue;
                    };
                    if best.as_ref().is_none_or(|best| screened.contrast > best.contrast) {
                        best = Some(screened);
                    }
                }
                if best.as_ref().is_some_and(|best| best.contrast > CONTRAST) {
                    break;
                }
            }
            all.extend(best.filter(|best| best.contrast > LEAST_CONTRAST));
        }
        all.sort_by(|one, other| other.contrast.total_cmp(&one.contrast));
        all
    }

    /// For each other effect the cumulative sums over windows of the products of signature, response and parameters.
    fn products(&self, windows: usize) -> Vec<Vec<DMatrix<f64>>> {
        let of = |response: &Vec<f64>| {
            let all: Vec<&Vec<f64>> =
                [&self.signature, response].into_iter().chain(&self.parameters).collect();
            let mut sum = DMatrix::zeros(all.len(), all.len());
            let mut sums = vec![sum.clone()];
            for window in 0..windows {
                let span = window * self.rows..(window + 1) * self.rows;
                for row in 0..all.len() {
                    for column in 0..=row {
                        let product = dot(&all[row][span.clone()], &all[column][span.clone()]);
                        sum[(row, column)] += product;
                        if row != column {
                            sum[(column, row)] += product;
                        }
                    }
                }
                sums.push(sum.clone());
            }
            sums
        };
        self.others.iter().map(|(_, response)| of(response)).collect()
    }

    fn screened(
        &self,
        candidate: Candidate,
        sums: &[DMatrix<f64>],
        [from, length]: [usize; 2],
    ) -> Option<Screened> {
        let all = sums.get(from + length)? - &sums[from];
        let count = self.parameters.len();
        let mut normal = all.view((2, 2), (count, count)).into_owned();
        priors().iter().enumerate().for_each(|(at, prior)| normal[(at, at)] += prior);
        let factor = normal.cholesky()?;
        let along = all.view((2, 0), (count, 2)).into_owned();
        // Residuals of signature and response after the parameters.
        let left = all.view((0, 0), (2, 2)) - along.transpose() * factor.solve(&along);
        let [square, response_square, product] = [left[(0, 0)], left[(1, 1)], left[(0, 1)]];
        let amplitude = product / response_square;
        if !(response_square > 0.0 && square > 0.0)
            || amplitude == 0.0
            || amplitude < 0.0 && !candidate.sheet.keys[0].signed
        {
            return None;
        }
        let share = (1.0 - product * product / response_square / square).max(1e-9);
        let mut start = candidate.origin();
        let middle = candidate.coordinate(0, nominal(candidate.sheet)[0].1);
        let [least, most] = candidate.fit_bounds(0);
        start[0] = (amplitude * middle).clamp(least, most);
        let part = Part { from: from * WINDOW, rows: length * WINDOW };
        Some(Screened { candidate, start, part, distance: square.sqrt(), contrast: share.sqrt().recip() })
    }

    /// The nearest law of another effect in its part; the observer has the rig with the effect as its baseline. `None` where
    /// the rig is refused, or the amplitude is out of range.
    pub(crate) fn fitted(&self, screened: &Screened, observer: &Observer) -> Option<Rival> {
        let candidate = screened.candidate;
        let priors = priors();
        let fit = Fit { observer, observed: &observer.baseline, candidate, rig: &self.rig, priors: &priors };
        let start = fit.at([&screened.start[..], &[0.0; PARAMETERS.len()]].concat())?;
        let nearest = fit.nearest(start, screened.distance.powi(2));
        let (effect, deviations) = nearest.coordinates.split_at(candidate.sheet.keys.len());
        if !is_drawn(&candidate, effect[0]) {
            return None;
        }
        let rig = fit.rig_at(&nearest.coordinates)?;
        let left = length(&observer.between(&observer.baseline, &nearest.run));
        let off = PARAMETERS.iter().zip(deviations).map(|(name, off)| ((*name).to_owned(), 1.0 + off));
        let model = Model {
            effect: candidate.sheet.name.to_owned(),
            place: candidate.place.to_string(),
            numbers: candidate.effect_parameters(effect),
            wrong_parameters: off.collect(),
        };
        Some(Rival { rig, model, left })
    }
}

/// Precisions of the deviations, in the order of the record maker's parameters, over that of readings at [`NOISE`].
fn priors() -> Vec<f64> {
    let of = |name: &&str| {
        PRIORS.iter().find(|prior| prior.name == *name).map_or(f64::INFINITY, |prior| prior.prior_std)
    };
    PARAMETERS.iter().map(|name| (NOISE / of(name)).powi(2)).collect()
}

/// Whether a first coordinate is within the range of rivals.
fn is_drawn(candidate: &Candidate, coordinate: f64) -> bool {
    let ends = candidate.sheet.keys[0].drawn.map(|number| candidate.coordinate(0, number));
    let least =
        if ends[0] * ends[1] < 0.0 { SMALLEST_ABOUT } else { SMALLEST * ends[0].abs().min(ends[1].abs()) };
    (least..=LARGEST * ends[0].abs().max(ends[1].abs())).contains(&coordinate.abs())
}
