//! The discrepancy term of a model: an unknown input that is a function of state and command, the same in all windows.
//!
//! ```text
//!   e = J a + B Phi_g w + noise       J sensitivities of parameters and effects, a with their priors
//!                                     B responses to unknown inputs by block, Phi_g hats over the variable of group g
//!   w ~ N(0, s^2)                     size s on a grid; ln Z_g = -1/2 (L + n ln s^2 + ln |H|), best s
//! ```
//!
//! A group is a balance and a variable. Its evidence is compared with that of the model without a term; parameters and effects
//! are free with their priors in both, so that what they can do is no discrepancy. L is the loss of [`crate::fit`], H its
//! Gauss-Newton Hessian with the priors.
//!
//! Source: discrepancy-notes.md, Second reading. Kennedy, O'Hagan 2001, J. R. Stat. Soc. B 63(3): discrepancy of a model; MacKay
//! 1992, Neural Comput. 4(3): evidence of a size.

use crate::engine::Engine;
use crate::fit::Products;
use crate::gridded_record::GriddedRecord;
use crate::locate::estimate::variables;
use crate::locate::{self, DIRECTION, POSITION, PRESSURE_DIFFERENCE, VARIABLES};
use crate::outside::CONSTANT;
use crate::parameters::COUNT;
use crate::refit::{
    EffectEstimate, coordinate_columns, linearise_at, prior_deviations, prior_precisions, rig_of,
};
use crate::report::{LocatedTerm, LocatedVariable};
use crate::windows::{BLOCK, BLOCKS, FORCE, InputResponses, UnknownKind, first_block};
use nalgebra::DMatrix;
use plant::Axis;
use rayon::prelude::*;

/// Knots of the hats of a variable, at quantiles of its values.
const KNOTS: usize = 8;
/// Sizes of a term, N and Nl/min.
const SIZES: [f64; 8] = [0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];
/// The same of several terms at once.
const JOINT_SIZES: [f64; 5] = [0.05, 0.4, 3.0, 20.0, 100.0];
/// A size at which a term is none.
const NO_SIZE: f64 = 1e-4;
/// Sweeps over the sizes of all terms.
const SWEEPS: usize = 2;
/// Log evidence over the model without a term from which on there is one. It is not calibrated: of six null records of seed 12
/// that are true to the rig file one had 39 and one 11 (its largest of some hundred groups).
const MIN_LOG_EVIDENCE: f64 = 8.0;
/// Share of the best log evidence from which on a constant comes first, or second.
const SIMPLER: f64 = 0.97;
const MOSTLY_CONSTANT: f64 = 0.8;
/// Products of another variable with the direction: friction over x, and over p_a - p_b.
const PRODUCTS: [[usize; 2]; 2] = [[POSITION, DIRECTION], [PRESSURE_DIFFERENCE, DIRECTION]];

/// Balances that a term may stand in. What acts on the valve or the supply stands in both chambers.
const BALANCES: [&[UnknownKind]; 5] = [
    &[UnknownKind::FlowA],
    &[UnknownKind::FlowB],
    &[UnknownKind::FlowA, UnknownKind::FlowB],
    &[UnknownKind::Force],
    &[UnknownKind::ForceSensor],
];

/// What a group's hats are over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    Constant,
    Variable(usize),
    /// Hats over the first, times the second.
    Product([usize; 2]),
}

impl Over {
    fn all() -> impl Iterator<Item = Over> {
        let single = (0..VARIABLES.len()).map(Over::Variable);
        [Over::Constant].into_iter().chain(single).chain(PRODUCTS.map(Over::Product))
    }

    fn names(self) -> Vec<&'static str> {
        match self {
            Over::Constant => vec![CONSTANT],
            Over::Variable(at) => vec![VARIABLES[at].name],
            Over::Product(pair) => pair.map(|at| VARIABLES[at].name).to_vec(),
        }
    }
}

/// A balance of an axis with a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    axis: usize,
    /// One, or both chambers with hats of their own.
    kinds: &'static [UnknownKind],
    over: Over,
}

/// A place, and what a term there gains.
#[derive(Clone, Copy, Debug)]
struct Group {
    place: Place,
    log_evidence: f64,
    /// Fall of the loss at the best size.
    loss_fall: f64,
}

/// The model that a term is sought beside.
pub struct Beside<'a> {
    pub placed: &'a [EffectEstimate],
    /// Of the baseline parameters, in the order of [`crate::parameters::PARAMETERS`].
    pub factors: [f64; COUNT],
}

/// ln Z of a model, up to what all models of the records have in common; minus infinity where the fit is singular.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    pub(crate) alone: f64,
    pub(crate) with_terms: f64,
}

impl Evidence {
    /// What the terms add.
    pub(crate) fn left_to_terms(self) -> f64 {
        self.with_terms - self.alone
    }
}

/// The term of a model; `None` where none has [`MIN_LOG_EVIDENCE`].
pub fn located_term(engine: &Engine<'_>, beside: &Beside<'_>) -> Option<LocatedTerm> {
    let responses = engine.input_responses(&rig_of(engine.rig(), beside.placed, &beside.factors)?)?;
    let columns = linearise_at(engine, beside.placed, beside.factors).columns;
    let mut groups = Term::new(engine, beside, &columns, &responses)?.groups();
    let best = *groups.first().filter(|best| best.log_evidence > MIN_LOG_EVIDENCE)?;
    let constant =
        groups.iter().position(|group| group.place == Place { over: Over::Constant, ..best.place });
    // A law that is nearly or mostly its mean.
    if let Some(at) = constant {
        let ratio = groups[at].log_evidence / best.log_evidence;
        if ratio > MOSTLY_CONSTANT {
            let constant = groups.remove(at);
            groups.insert(usize::from(ratio <= SIMPLER), constant);
        }
    }
    let total = groups.iter().map(|group| group.loss_fall).fold(best.loss_fall, f64::max).max(1e-9);
    let mut variables: Vec<LocatedVariable> = Vec::new();
    let of_balance =
        groups.iter().filter(|group| group.place == Place { over: group.place.over, ..best.place });
    for group in of_balance.filter(|group| group.log_evidence > 0.0) {
        for name in group.place.over.names() {
            if variables.iter().all(|known| known.variable != name) {
                variables.push(LocatedVariable {
                    variable: name.to_owned(),
                    log_evidence: Some(group.log_evidence),
                    share: (group.loss_fall / total).clamp(0.0, 1.0),
                });
            }
        }
    }
    // Of both chambers the one that has more evidence alone.
    let best = best.place;
    let alone = groups.iter().map(|group| group.place).find(|place| {
        place.axis == best.axis && best.kinds.contains(&place.kinds[0]) && place.kinds.len() == 1
    });
    let kind = alone.map_or(best.kinds[0], |alone| alone.kinds[0]);
    let balance = format!("{}.{}", Axis::ALL[best.axis].name(), kind.name());
    Some(LocatedTerm { balance, variables })
}

/// Products of all windows.
pub(crate) struct Term<'a> {
    /// Of residual and nuisance columns, window by window.
    nuisance: Products,
    precisions: Vec<f64>,
    offsets: Vec<f64>,
    responses: &'a [InputResponses],
    /// B'c of each window: a row for the residual, and for each nuisance column.
    cross: Vec<DMatrix<f64>>,
    measured: [bool; 2],
    /// The variables of each axis, balance, window and block.
    values: [[Vec<BlockValues>; 4]; 2],
}

impl<'a> Term<'a> {
    /// Of a model; `columns` are sensitivities to the parameters, at this model or near it.
    pub(crate) fn new(
        engine: &Engine<'_>,
        beside: &Beside<'_>,
        columns: &[Vec<f64>],
        responses: &'a [InputResponses],
    ) -> Option<Self> {
        let rig = rig_of(engine.rig(), beside.placed, &beside.factors)?;
        let simulated = engine.simulate(&rig);
        let residual = engine.residual(&simulated);
        let mut columns = columns.to_vec();
        columns.extend(coordinate_columns(engine, &beside.factors, beside.placed, &simulated)?);
        let all: Vec<&[f64]> = std::iter::once(&residual).chain(&columns).map(Vec::as_slice).collect();
        let rows = engine.rows();
        let of_window = |window: usize| {
            let columns: Vec<&[f64]> = all.iter().map(|column| &column[window * rows..][..rows]).collect();
            responses[window].cross(&columns)
        };
        let cross = (0..responses.len()).into_par_iter().map(of_window).collect();
        let mut places: Vec<(&GriddedRecord, usize)> = Vec::new();
        for part in engine.windows() {
            places.extend(part.starts().iter().map(|start| (part.record(), *start)));
        }
        let mut values =
            [0, 1].map(|axis| UnknownKind::ALL.map(|kind| values_of(&places, axis, kind.place())));
        simulated_forces(engine, &simulated, &mut values);
        Some(Term {
            nuisance: engine.products(&residual, &columns),
            precisions: prior_precisions(beside.placed),
            offsets: prior_deviations(&beside.factors, beside.placed),
            responses,
            cross,
            measured: places.first().map_or([false; 2], |(record, _)| record.measured),
            values,
        })
    }

    /// All groups, by evidence.
    fn groups(&self) -> Vec<Group> {
        let (loss, log_determinant) = self.fitted(&self.nuisance, &self.precisions);
        let all: Vec<Place> = (0..2)
            .filter(|axis| self.measured[*axis])
            .flat_map(|axis| BALANCES.map(|kinds| (axis, kinds)))
            .flat_map(|(axis, kinds)| Over::all().map(move |over| Place { axis, kinds, over }))
            .collect();
        let mut groups: Vec<Group> = all
            .into_par_iter()
            .filter_map(|place| {
                // A singular fit has no evidence.
                let products = self.with_terms(&[place]);
                let count = products.columns() - self.precisions.len();
                let evidence = |size: f64| {
                    let precision = size.powi(-2);
                    let precisions: Vec<f64> = self
                        .precisions
                        .iter()
                        .copied()
                        .chain(std::iter::repeat_n(precision, count))
                        .collect();
                    let (with, with_determinant) = self.fitted(&products, &precisions);
                    let spread = -(count as f64) * precision.ln();
                    let log_evidence = -0.5 * (with - loss + spread + with_determinant - log_determinant);
                    Group { place, log_evidence, loss_fall: loss - with }
                };
                SIZES
                    .into_iter()
                    .map(evidence)
                    .filter(|group| group.log_evidence.is_finite())
                    .max_by(|left, right| left.log_evidence.total_cmp(&right.log_evidence))
            })
            .collect();
        groups.sort_by(|left, right| right.log_evidence.total_cmp(&left.log_evidence));
        groups
    }

    /// The loss with priors at its minimum, and ln |H| there; infinite where H is singular.
    fn fitted(&self, products: &Products, precisions: &[f64]) -> (f64, f64) {
        let all: Vec<usize> = (0..precisions.len()).collect();
        let mut offsets = self.offsets.clone();
        offsets.resize(precisions.len(), 0.0);
        let fit = products.fit_from(&all, precisions, &offsets);
        let (matrix, _) = products.normal(&all, &fit.weights, precisions);
        let log_determinant = matrix.cholesky().map_or(f64::INFINITY, |factor| {
            2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>()
        });
        (fit.loss, log_determinant)
    }

    /// For each window a row for each block, a column for each hat.
    fn features(&self, Place { axis, over, .. }: Place, kind: UnknownKind) -> Vec<DMatrix<f64>> {
        let values = &self.values[axis][kind.place()];
        let knots = match over {
            Over::Constant => vec![0.0],
            Over::Variable(at) | Over::Product([at, _]) => {
                knots(values.iter().flatten().map(|values| values[at]).collect())
            }
        };
        let row = |values: &[f64; VARIABLES.len()], hat: usize| match over {
            Over::Constant => 1.0,
            Over::Variable(at) => hat_at(&knots, hat, values[at]),
            Over::Product([at, times]) => hat_at(&knots, hat, values[at]) * values[times],
        };
        values
            .iter()
            .map(|window| DMatrix::from_fn(BLOCKS, knots.len(), |block, hat| row(&window[block], hat)))
            .collect()
    }

    /// For each balance the place with most evidence alone, where that is enough for a term.
    pub(crate) fn places(&self) -> Vec<Place> {
        let mut places: Vec<Place> = Vec::new();
        for group in self.groups().into_iter().filter(|group| group.log_evidence > MIN_LOG_EVIDENCE) {
            let place = group.place;
            if place.kinds.len() == 1
                && places.iter().all(|other| (other.axis, other.kinds) != (place.axis, place.kinds))
            {
                places.push(place);
            }
        }
        places
    }

    /// The evidence of the model alone, and with terms at these places, each of its best size or none.
    pub(crate) fn evidence(&self, places: &[Place]) -> Evidence {
        let (loss, log_determinant) = self.fitted(&self.nuisance, &self.precisions);
        let prior: f64 = self.precisions.iter().map(|precision| precision.ln()).sum();
        let alone = -0.5 * (loss + log_determinant - prior);
        if places.is_empty() {
            return Evidence { alone, with_terms: alone };
        }
        let products = self.with_terms(places);
        let counts: Vec<usize> = places.iter().map(|place| self.hats(*place)).collect();
        let log_evidence = |sizes: &[Option<f64>]| {
            let of = counts.iter().zip(sizes);
            let terms =
                of.flat_map(|(count, size)| std::iter::repeat_n(size.unwrap_or(NO_SIZE).powi(-2), *count));
            let precisions: Vec<f64> = self.precisions.iter().copied().chain(terms).collect();
            let (loss, log_determinant) = self.fitted(&products, &precisions);
            let prior: f64 = precisions.iter().map(|precision| precision.ln()).sum();
            -0.5 * (loss + log_determinant - prior)
        };
        let mut sizes: Vec<Option<f64>> = vec![None; places.len()];
        let mut best = log_evidence(&sizes);
        for _ in 0..SWEEPS {
            for at in 0..places.len() {
                let tried = JOINT_SIZES.into_iter().map(Some).chain([None]).filter(|size| *size != sizes[at]);
                let tried: Vec<Option<f64>> = tried.collect();
                let found = tried
                    .into_par_iter()
                    .map(|size| {
                        let mut with = sizes.clone();
                        with[at] = size;
                        (log_evidence(&with), size)
                    })
                    .collect::<Vec<_>>();
                for (evidence, size) in found {
                    if evidence > best {
                        (best, sizes[at]) = (evidence, size);
                    }
                }
            }
        }
        Evidence { alone, with_terms: best }
    }

    /// Hats of a place.
    fn hats(&self, place: Place) -> usize {
        place.kinds.iter().map(|kind| self.features(place, *kind).first().map_or(0, DMatrix::ncols)).sum()
    }

    /// The nuisance columns, then the hats of each place and balance.
    fn with_terms(&self, places: &[Place]) -> Products {
        let hats: Vec<(usize, Vec<DMatrix<f64>>)> = places
            .iter()
            .flat_map(|place| {
                let of_kind =
                    |kind: &UnknownKind| (first_block(place.axis, *kind), self.features(*place, *kind));
                place.kinds.iter().map(of_kind)
            })
            .collect();
        let (mut scores, mut information) = (Vec::new(), Vec::new());
        for (at, (responses, known)) in self.responses.iter().zip(&self.cross).enumerate() {
            let columns = hats.iter().map(|(_, hats)| hats[at].ncols()).sum();
            let mut cross = DMatrix::zeros(known.nrows(), columns);
            let mut among = DMatrix::zeros(columns, columns);
            let mut from = 0;
            for (first, own) in &hats {
                let own = &own[at];
                let shape = (cross.nrows(), own.ncols());
                cross.view_mut((0, from), shape).copy_from(&(known.columns(*first, BLOCKS) * own));
                let mut other_from = 0;
                for (other_first, other) in &hats {
                    let other = &other[at];
                    let products = own.transpose()
                        * responses.gram.view((*first, *other_first), (BLOCKS, BLOCKS))
                        * other;
                    among.view_mut((from, other_from), products.shape()).copy_from(&products);
                    other_from += other.ncols();
                }
                from += own.ncols();
            }
            scores.push(cross.row(0).iter().copied().collect::<Vec<f64>>());
            information.push((cross.rows(1, cross.nrows() - 1).into_owned(), among));
        }
        self.nuisance.extended(&scores, &information)
    }
}

/// The variables of a window's blocks.
type BlockValues = Vec<[f64; VARIABLES.len()]>;

fn values_of(places: &[(&GriddedRecord, usize)], axis: usize, balance: usize) -> Vec<BlockValues> {
    let window = |(record, start): &(&GriddedRecord, usize)| {
        (0..BLOCKS).map(|block| variables(record, axis, start + block * BLOCK, balance)).collect()
    };
    places.iter().map(window).collect()
}

/// Replaces the force readings by simulated ones: a term over the force would correlate with the noise of its own readings.
fn simulated_forces(engine: &Engine<'_>, simulated: &[f64], values: &mut [[Vec<BlockValues>; 4]; 2]) {
    let (rows, mut window) = (engine.rows(), 0);
    for part in engine.windows() {
        let width = part.outputs().len();
        for (output, (axis, channel)) in part.outputs().iter().enumerate().filter(|(_, of)| of.1 == FORCE) {
            let noise = part.record().noise[*axis][*channel];
            for at in window..window + part.count() {
                let readings: Vec<f64> =
                    simulated[at * rows..][..rows].iter().skip(output).step_by(width).copied().collect();
                for (block, readings) in readings.chunks_exact(BLOCK).enumerate() {
                    let force_n = noise * readings.iter().sum::<f64>() / BLOCK as f64;
                    values[*axis].iter_mut().for_each(|balance| balance[at][block][locate::FORCE] = force_n);
                }
            }
        }
        window += part.count();
    }
}

/// Knots at distinct quantiles.
fn knots(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut knots: Vec<f64> =
        (0..KNOTS).map(|knot| values[knot * (values.len() - 1) / (KNOTS - 1)]).collect();
    knots.dedup();
    knots
}

/// The piecewise linear hat of a knot, constant beyond the ends.
fn hat_at(knots: &[f64], hat: usize, value: f64) -> f64 {
    let value = value.clamp(knots[0], knots[knots.len() - 1]);
    let side = |neighbour: Option<&f64>| {
        neighbour.map_or(0.0, |neighbour| ((value - neighbour) / (knots[hat] - neighbour)).clamp(0.0, 1.0))
    };
    if value == knots[hat] {
        1.0
    } else if value < knots[hat] {
        side(hat.checked_sub(1).and_then(|before| knots.get(before)))
    } else {
        side(knots.get(hat + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_sum_to_one_and_are_one_at_their_knot() {
        let knots = knots((0..100).map(f64::from).collect());
        assert_eq!(knots.len(), KNOTS);
        for value in [-5.0, 0.0, 3.3, 50.0, 99.0, 120.0] {
            let sum: f64 = (0..KNOTS).map(|hat| hat_at(&knots, hat, value)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{value}: {sum}");
        }
        assert_eq!(hat_at(&knots, 2, knots[2]), 1.0);
        assert_eq!(super::knots(vec![1.0; 50]), [1.0]);
    }
}
