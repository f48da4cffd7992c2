//! What each term of a search would gain, on the outputs as they are linear in its coefficient.
//!
//! ```text
//!   r = measured less simulated     S = sensitivities to what is fitted     g = d outputs / d k at k = 0
//!   all in units of each output's residual
//!   g' = g less what S can do for it          gain = (g' r)^2 / (g' g')          k = g' r / (g' g')
//! ```
//! All sums are kept for each block of time. Half of the blocks, drawn many times, say how often a term like the chosen one is
//! the best: its stability.
//!
//! Source: Meinshausen, Bühlmann 2010, JRSS B 72(4); Shah, Samworth 2013, JRSS B 75(1) (complementary halves).

use super::super::fit::{Fitting, UnknownId};
use super::super::select::Fitted;
use crate::parallel;
use model::{Model, Program};
use nalgebra::{DMatrix, DVector};

/// Terms that are simulated together.
const CHUNK: usize = 25;
/// Share of a term's size that the model's own numbers leave, squared: below it looks like them.
const HIDDEN: f64 = 0.0025;
/// Smallest eigenvalue of the scaled normal matrix, over its largest, that counts.
const DETERMINED: f64 = 1e-10;
/// Pairs of complementary halves.
const PAIRS: usize = 25;
/// Cosine of two terms that count as one in the stability.
const SAME_DIRECTION: f64 = 0.8;

/// Responses to all terms beside a fitted model.
pub(super) struct Screen {
    sensitivities: DMatrix<f64>,
    terms: DMatrix<f64>,
    residual: DVector<f64>,
    block_of: Vec<usize>,
    blocks: usize,
    whole: ProjectedGains,
}

/// Sums over some rows.
#[derive(Clone)]
struct RowSums {
    /// Of products of sensitivities.
    information: DMatrix<f64>,
    /// Of sensitivities with terms.
    cross: DMatrix<f64>,
    squares: DVector<f64>,
    /// Of sensitivities with the residual.
    scores: DVector<f64>,
    /// Of terms with the residual.
    term_scores: DVector<f64>,
}

/// Gain and coefficient of each term; both 0 of one that looks like the model's own numbers.
struct ProjectedGains {
    gains: Vec<f64>,
    coefficients_si: Vec<f64>,
}

impl Screen {
    /// `first` is the index of the first of `count` suspects of the model that are the terms.
    pub(super) fn new(fitted: &Fitted<'_>, first: usize, count: usize) -> Option<Self> {
        Self::of(fitted.fitting.model, fitted, first, count)
    }

    /// The same of terms of a larger model than the one that was fitted.
    pub(super) fn of(model: &Model, fitted: &Fitted<'_>, first: usize, count: usize) -> Option<Self> {
        let fitting = &fitted.fitting;
        let scale: Vec<f64> = (0..fitting.model.outputs.len())
            .map(|output| fitting.variance(output, fitted.point.squares[output]).sqrt().recip())
            .collect();
        let (slopes, values) = fitting.sensitivities(&fitted.point.values_si, &scale).ok()?;
        let sensitivities = DMatrix::from_row_slice(values.len(), fitting.unknowns.len(), &slopes);
        let cut = fitting.blocks_in_time();
        let (mut residual, mut block_of) = (Vec::new(), Vec::new());
        for (record, blocks) in fitting.records.iter().zip(&cut.block_of) {
            for (row, block) in blocks.iter().enumerate() {
                for (output, scale) in scale.iter().enumerate() {
                    let Some(measured) = record.outputs[output][row] else { continue };
                    residual.push(scale * measured - values[residual.len()]);
                    block_of.push(*block);
                }
            }
        }
        let all: Vec<usize> = (first..first + count).collect();
        let chunks: Vec<&[usize]> = all.chunks(CHUNK).collect();
        let columns =
            parallel::map(&chunks, |chunk| responses(model, fitted, chunk, (&scale, residual.len())));
        let mut terms = DMatrix::zeros(residual.len(), count);
        for (place, columns) in columns.iter().enumerate() {
            terms.columns_mut(place * CHUNK, columns.ncols()).copy_from(columns);
        }
        let residual = DVector::from_vec(residual);
        let whole = ProjectedGains { gains: Vec::new(), coefficients_si: Vec::new() };
        let mut screen = Self { sensitivities, terms, residual, block_of, blocks: cut.blocks, whole };
        let sums = screen.sums();
        let whole = sums.iter().skip(1).fold(sums[0].clone(), RowSums::plus);
        screen.whole = whole.projected();
        Some(screen)
    }

    /// The best terms that differ from each other, the one that gains most first; of terms that do the same the simplest.
    pub(super) fn best(&self, most: usize, same: f64, complexity: impl Fn(usize) -> usize) -> Vec<usize> {
        let gains = &self.whole.gains;
        let mut order: Vec<usize> = (0..gains.len()).filter(|term| gains[*term] > 0.0).collect();
        order.sort_by(|one, other| gains[*other].total_cmp(&gains[*one]));
        let mut groups: Vec<Vec<(usize, DVector<f64>)>> = Vec::new();
        for term in order.into_iter().take(10 * most) {
            let direction = self.direction(term);
            let is_same = |group: &&mut Vec<(usize, DVector<f64>)>| group[0].1.dot(&direction).abs() > same;
            match groups.iter_mut().find(is_same) {
                Some(group) => group.push((term, direction)),
                None => groups.push(vec![(term, direction)]),
            }
        }
        let simplest = |group: &Vec<(usize, DVector<f64>)>| {
            group.iter().map(|(term, _)| *term).min_by_key(|term| complexity(*term)).expect("one at least")
        };
        groups.iter().take(most).map(simplest).collect()
    }

    /// Coefficient with which a term explains most of the residual.
    pub(super) fn coefficient_si(&self, term: usize) -> f64 {
        self.whole.coefficients_si[term]
    }

    /// Share of the residual, beyond what the model's own numbers explain, that some terms explain together.
    pub(super) fn share(&self, terms: &[usize]) -> f64 {
        let (rest, residual) = (self.rest(self.terms.select_columns(terms)), self.projected_residual());
        let along = rest.tr_mul(&residual);
        let explained = (along.transpose() * inverse(&rest.tr_mul(&rest)) * &along)[(0, 0)];
        (explained / residual.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    /// Those of some terms that do not look like the model's own numbers, and the coefficients by which they explain most
    /// together.
    pub(super) fn together(&self, terms: &[usize]) -> (Vec<usize>, Vec<f64>) {
        let rest = self.rest(self.terms.select_columns(terms));
        let coefficients_si = inverse(&rest.tr_mul(&rest)) * rest.tr_mul(&self.projected_residual());
        let all = terms.iter().zip(rest.column_iter()).zip(coefficients_si.iter());
        let apart = all.filter(|((_, change), _)| change.norm_squared() > 0.0);
        apart.map(|((term, _), coefficient_si)| (*term, *coefficient_si)).unzip()
    }

    /// What terms do beyond the model's own numbers; 0 where that is nearly nothing.
    fn rest(&self, terms: DMatrix<f64>) -> DMatrix<f64> {
        let mut rest = self.project_off(terms.clone());
        for (mut projected, whole) in rest.column_iter_mut().zip(terms.column_iter()) {
            if projected.norm_squared() <= HIDDEN * whole.norm_squared() {
                projected.fill(0.0);
            }
        }
        rest
    }

    fn projected_residual(&self) -> DMatrix<f64> {
        self.project_off(DMatrix::from_column_slice(self.residual.len(), 1, self.residual.as_slice()))
    }

    fn project_off(&self, change: DMatrix<f64>) -> DMatrix<f64> {
        let taken =
            inverse(&self.sensitivities.tr_mul(&self.sensitivities)) * self.sensitivities.tr_mul(&change);
        change - &self.sensitivities * taken
    }

    /// Share of halves of the blocks in which the best term is this one or one that does nearly the same.
    pub(super) fn stability(&self, term: usize) -> f64 {
        let sums = self.sums();
        let direction = self.direction(term);
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut order: Vec<usize> = (0..self.blocks).collect();
        let mut wins = 0;
        for _ in 0..PAIRS {
            for place in (1..order.len()).rev() {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                order.swap(place, (state >> 33) as usize % (place + 1));
            }
            let (one, other) = order.split_at(self.blocks / 2);
            for half in [one, other] {
                let rest = half[1..].iter().map(|block| &sums[*block]);
                let gains = rest.fold(sums[half[0]].clone(), |sum, block| sum.plus(block)).projected().gains;
                let best = (0..gains.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b])).expect("a term");
                let is_it = || self.direction(best).dot(&direction).abs() > SAME_DIRECTION;
                wins += usize::from(best == term || is_it());
            }
        }
        wins as f64 / (2 * PAIRS) as f64
    }

    /// What a term does to the outputs that the model's own numbers cannot do, of length 1.
    fn direction(&self, term: usize) -> DVector<f64> {
        let change = self.terms.column(term).into_owned();
        let inverse = inverse(&self.sensitivities.tr_mul(&self.sensitivities));
        let rest = &change - &self.sensitivities * (inverse * self.sensitivities.tr_mul(&change));
        let norm = rest.norm();
        if norm > 0.0 { rest / norm } else { rest }
    }

    /// Sums of each block; the last holds rows that judge nothing.
    fn sums(&self) -> Vec<RowSums> {
        let (numbers, terms) = (self.sensitivities.ncols(), self.terms.ncols());
        let zero = RowSums {
            information: DMatrix::zeros(numbers, numbers),
            cross: DMatrix::zeros(numbers, terms),
            squares: DVector::zeros(terms),
            scores: DVector::zeros(numbers),
            term_scores: DVector::zeros(terms),
        };
        let of_block = |block: usize| {
            let rows: Vec<usize> =
                (0..self.residual.len()).filter(|row| self.block_of[*row] == block).collect();
            if rows.is_empty() {
                return zero.clone();
            }
            let (slopes, terms) = (self.sensitivities.select_rows(&rows), self.terms.select_rows(&rows));
            let residual = self.residual.select_rows(&rows);
            RowSums {
                cross: slopes.tr_mul(&terms),
                squares: DVector::from_iterator(terms.ncols(), terms.column_iter().map(|g| g.norm_squared())),
                scores: slopes.tr_mul(&residual),
                term_scores: terms.tr_mul(&residual),
                information: slopes.tr_mul(&slopes),
            }
        };
        parallel::map_range(0..self.blocks + 1, of_block)
    }
}

impl RowSums {
    fn plus(mut self, other: &Self) -> Self {
        self.information += &other.information;
        self.cross += &other.cross;
        self.squares += &other.squares;
        self.scores += &other.scores;
        self.term_scores += &other.term_scores;
        self
    }

    fn projected(&self) -> ProjectedGains {
        let inverse = inverse(&self.information);
        let along = self.cross.tr_mul(&(&inverse * &self.scores));
        let taken = &inverse * &self.cross;
        let of = |term: usize| {
            let squares = self.squares[term] - self.cross.column(term).dot(&taken.column(term));
            let product = self.term_scores[term] - along[term];
            if squares > HIDDEN * self.squares[term] && product.is_finite() {
                (product * product / squares, product / squares)
            } else {
                (0.0, 0.0)
            }
        };
        let (gains, coefficients_si) = (0..self.squares.len()).map(of).unzip();
        ProjectedGains { gains, coefficients_si }
    }
}

/// Inverse of a normal matrix in the directions that it determines.
fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = matrix.diagonal().map(|square| if square > 0.0 { square.sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        matrix[(row, column)] * scale[row] * scale[column]
    });
    if scaled.is_empty() {
        return scaled;
    }
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let kept = eigen.eigenvalues.map(|value| if value > DETERMINED * largest { value.recip() } else { 0.0 });
    let vectors = &eigen.eigenvectors;
    let plain = vectors * DMatrix::from_diagonal(&kept) * vectors.transpose();
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        plain[(row, column)] * scale[row] * scale[column]
    })
}

/// Derivatives of all outputs by the coefficients of some terms; 0 of terms that are there, or cannot be simulated.
fn responses(
    model: &Model,
    fitted: &Fitted<'_>,
    terms: &[usize],
    (scale, rows): (&[f64], usize),
) -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(rows, terms.len());
    let fitting = &fitted.fitting;
    let new: Vec<usize> = terms.iter().copied().filter(|term| !fitted.suspects.contains(term)).collect();
    let suspects: Vec<usize> = fitted.suspects.iter().chain(&new).copied().collect();
    let Ok(program) = Program::new(model, &suspects) else { return columns };
    let mut wider = Fitting::new(model, program, fitting.records, &suspects);
    let known = |id: UnknownId| fitting.unknowns.iter().position(|unknown| unknown.id == id);
    let of = |id: UnknownId| match id {
        UnknownId::Shared(index) if Some(index) == coefficient(model, model.parameters[index].suspect) => {
            new.iter().position(|term| Some(*term) == model.parameters[index].suspect).map(|place| new[place])
        }
        _ => None,
    };
    wider.unknowns.retain(|unknown| known(unknown.id).is_some() || of(unknown.id).is_some());
    let value = |id: UnknownId| known(id).map_or(0.0, |place| fitted.point.values_si[place]);
    let values: Vec<f64> = wider.unknowns.iter().map(|unknown| value(unknown.id)).collect();
    let Ok((slopes, _)) = wider.sensitivities(&values, scale) else { return columns };
    let width = values.len();
    for (place, unknown) in wider.unknowns.iter().enumerate() {
        let Some(term) = of(unknown.id).filter(|_| known(unknown.id).is_none()) else { continue };
        let column = terms.iter().position(|other| *other == term).expect("it is one of them");
        for row in 0..rows {
            let slope = slopes[row * width + place];
            columns[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
        }
    }
    columns
}

/// The coefficient of a term: its first parameter.
pub(super) fn coefficient(model: &Model, suspect: Option<usize>) -> Option<usize> {
    suspect?;
    model.parameters.iter().position(|parameter| parameter.suspect == suspect)
}
