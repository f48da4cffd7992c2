//! Log marginal likelihood of a linearised model with a discrepancy term, whose parameters, amplitudes and unknown inputs are
//! integrated out.
//!
//! ```text
//!   e = S a + D z + M B w + noise       S, D sensitivities of parameters and effects, a with prior N(0, 1/P), z heavy-tailed
//!                                       B responses to unknown inputs by block, w ~ N(0, size^2 C) in each window
//!   M = 1 - S (S'WS)^-1 S'W             W window weights f_k / q_k: the term holds nothing that parameters can do
//!   ln p(e) = - power/2 (sum_k f_k ln(q_k / f_k) + ln |1 + size^2 B C B'|) - 1/2 ln |H|
//!             - 1/2 u' N u + 1/2 ln |N| + ln p(z) + n/2 ln 2 pi
//!   q_k = e' (1 + size^2 B C B')^-1 e   of the residual      u  estimate of a without the term      N^-1 = 1/P + (power S'WS)^-1
//! ```
//!
//! What parameters cannot do has the restricted likelihood (REML) of e: projecting S out of B changes nothing there. What they
//! can do has the normal density of u, in which no term takes part. H is the Hessian in a (no prior) and z (Gauss-Newton, and the
//! prior's weight in a fit), at the mode in z (Laplace). The likelihood is raised to `power`; priors are not.
//!
//! Source: Kennedy, O'Hagan 2001, J. R. Stat. Soc. B 63(3): discrepancy of a model. Plumlee 2017, J. Am. Stat. Assoc. 112(519):
//! orthogonal to the sensitivities of parameters. Tierney, Kadane 1986, J. Am. Stat. Assoc. 81(393): Laplace.

use super::Products;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{Continuous, StudentsT};
use std::f64::consts::TAU;

/// Passes of reweighting and of the heavy-tailed priors, from the mode of the search: a guess.
const PASSES: usize = 4;
/// Precision, as a share of the prior's, below which a parameter counts as undetermined by the windows: what it does is projected
/// out of the term as far as thirty standard deviations of its prior.
const UNDETERMINED: f64 = 1e-3;
/// Gauss and Legendre's rule of nine nodes on [-1, 1].
const NODES: [(f64, f64); 9] = [
    (-0.968_160_239_507_626_1, 0.081_274_388_361_574_4),
    (-0.836_031_107_326_635_8, 0.180_648_160_694_857_4),
    (-0.613_371_432_700_590_4, 0.260_610_696_402_935_4),
    (-0.324_253_423_403_808_9, 0.312_347_077_040_002_9),
    (0.0, 0.330_239_355_001_259_8),
    (0.324_253_423_403_808_9, 0.312_347_077_040_002_9),
    (0.613_371_432_700_590_4, 0.260_610_696_402_935_4),
    (0.836_031_107_326_635_8, 0.180_648_160_694_857_4),
    (0.968_160_239_507_626_1, 0.081_274_388_361_574_4),
];

/// Standard deviation and correlation length of the unknown inputs of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Covariance {
    /// Standard deviation of an input, N or Nl/min.
    pub(crate) size: f64,
    /// Blocks after which the correlation has fallen to 1/e; 0 for independent blocks.
    pub(crate) correlation_blocks: f64,
}

/// Unknown inputs of all windows, beside the residuals and columns of several models.
pub(crate) struct InputGrams {
    /// Blocks of each kind of input.
    pub(crate) blocks: usize,
    /// B'B of each window, kind after kind.
    pub(crate) gram: Vec<DMatrix<f64>>,
    /// B'c of each window: a column for each residual or column c.
    pub(crate) cross: Vec<DMatrix<f64>>,
}

/// The inputs of some covariance, integrated out.
pub(crate) struct IntegratedInputs {
    pub(crate) covariance: Covariance,
    /// ln |1 + size^2 B C B'|, all windows.
    pub(crate) log_determinant: f64,
    /// Reduction of the products of two columns in each window.
    reductions: Vec<DMatrix<f64>>,
}

impl InputGrams {
    /// Integrates the inputs out for each size with one correlation length; a size is left out where rounding leaves no positive
    /// matrix.
    pub(crate) fn integrated(&self, correlation_blocks: f64, sizes: &[f64]) -> Vec<IntegratedInputs> {
        let root = self.root(correlation_blocks);
        let transformed: Vec<(DMatrix<f64>, DMatrix<f64>)> = (self.gram.iter().zip(&self.cross))
            .map(|(gram, cross)| (root.transpose() * gram * &root, root.transpose() * cross))
            .collect();
        let of_size = |size: f64| {
            let covariance = Covariance { size, correlation_blocks };
            let mut integrated =
                IntegratedInputs { covariance, log_determinant: 0.0, reductions: Vec::new() };
            for (gram, cross) in &transformed {
                let mut matrix = gram * size.powi(2);
                matrix.fill_lower_triangle_with_upper_triangle();
                (0..matrix.nrows()).for_each(|at| matrix[(at, at)] += 1.0);
                let factor = matrix.cholesky()?;
                integrated.log_determinant += log_determinant(&factor);
                let whitened = factor.l_dirty().solve_lower_triangular(&(cross * size))?;
                integrated.reductions.push(whitened.transpose() * &whitened);
            }
            Some(integrated)
        };
        sizes.iter().filter_map(|size| of_size(*size)).collect()
    }

    /// A root of the correlation matrix of a window's inputs.
    fn root(&self, correlation_blocks: f64) -> DMatrix<f64> {
        let inputs = self.gram.first().map_or(0, DMatrix::nrows);
        let correlation = DMatrix::from_fn(inputs, inputs, |row, column| {
            let same_kind = row / self.blocks == column / self.blocks;
            match row.abs_diff(column) {
                0 => 1.0,
                apart if same_kind && correlation_blocks > 0.0 => {
                    (-(apart as f64) / correlation_blocks).exp()
                }
                _ => 0.0,
            }
        });
        correlation.cholesky().expect("an exponential correlation is positive").l()
    }
}

impl IntegratedInputs {
    /// Without a term.
    pub(crate) fn none(windows: usize) -> Self {
        let covariance = Covariance { size: 0.0, correlation_blocks: 0.0 };
        IntegratedInputs { covariance, log_determinant: 0.0, reductions: vec![DMatrix::zeros(0, 0); windows] }
    }

    /// Products of a model with the inputs integrated out; `residual` and `columns` are their places in [`InputGrams::cross`].
    pub(crate) fn products(&self, plain: &Products, residual: usize, columns: &[usize]) -> Products {
        let mut reduced = plain.clone();
        let mut information = plain.information.to_vec();
        let count = plain.columns;
        for (window, reduction) in
            self.reductions.iter().enumerate().filter(|(_, reduction)| !reduction.is_empty())
        {
            reduced.squares[window] = (reduced.squares[window] - reduction[(residual, residual)]).max(0.0);
            for (row, at) in columns.iter().enumerate() {
                reduced.scores[window][row] -= reduction[(residual, *at)];
                for (column, other) in columns.iter().enumerate() {
                    information[window][row * count + column] -= reduction[(*at, *other)];
                }
            }
        }
        reduced.information = information.into();
        reduced
    }
}

/// Student t prior of a coordinate, about 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeavyTailed {
    pub(crate) scale: f64,
    /// Degrees of freedom: 1 is Cauchy.
    pub(crate) dof: f64,
    /// Whether the coordinate has one sign only.
    pub(crate) is_one_sided: bool,
}

impl HeavyTailed {
    pub(crate) fn log_density(&self, z: f64) -> f64 {
        let density = StudentsT::new(0.0, self.scale, self.dof).expect("a scale is positive");
        density.ln_pdf(z) + if self.is_one_sided { 2.0_f64.ln() } else { 0.0 }
    }

    /// Precision of the normal prior with the same derivative here.
    pub(crate) fn precision(&self, z: f64) -> f64 {
        (self.dof + 1.0) / (self.dof * self.scale.powi(2) + z.powi(2))
    }
}

/// Priors of a linearised model, whose first columns are those of the parameters.
pub(crate) struct Priors {
    /// Prior precisions of the parameters.
    pub(crate) parameters: Vec<f64>,
    /// Their deviations from the prior means at the linearisation.
    pub(crate) deviations: Vec<f64>,
    /// Whether the parameters are those of the rig file: their sensitivities are projected out, and no parameter is free.
    pub(crate) are_exact: bool,
    /// Of each coordinate: its prior and its value at the linearisation.
    pub(crate) coordinates: Vec<(HeavyTailed, f64)>,
}

/// Log marginal likelihood of a model, up to a constant of the windows; `None` where it has no mode.
///
/// `plain` are its products without the term, `reduced` those with `integrated`.
pub(crate) fn log_marginal_likelihood(
    plain: &Products,
    reduced: &Products,
    log_determinant_of_term: f64,
    priors: &Priors,
    power: f64,
) -> Option<f64> {
    let (parameters, coordinates) = (priors.parameters.len(), priors.coordinates.len());
    let all: Vec<usize> = (0..parameters + coordinates).collect();
    let no_prior = vec![0.0; all.len()];
    let flat = DVector::from_fn(parameters, |at, _| UNDETERMINED * priors.parameters[at]);
    let deviations = DVector::from_column_slice(&priors.deviations);
    let start = DVector::from_iterator(coordinates, priors.coordinates.iter().map(|(_, z)| *z));
    let mut step = DVector::zeros(all.len());
    let mut found = None;
    for _ in 0..PASSES {
        let squares = reduced.squares(&all, step.as_slice());
        let weights = reduced.weights(&squares);
        let [with, without] = [reduced, plain].map(|products| {
            let (matrix, vector) = products.normal(&all, &weights, &no_prior);
            PartitionedNormal::of(matrix * power, vector * power, parameters, &flat, &deviations)
        });
        let (with, without) = (with?, without?);
        let z = &start + step.rows(parameters, coordinates);
        let held = DVector::from_iterator(
            coordinates,
            priors.coordinates.iter().zip(z.iter()).map(|((prior, _), z)| prior.precision(*z)),
        );
        // u as a function of the step in z, and its precision.
        let estimate = &deviations + without.factor.solve(&without.score);
        let shift = without.factor.solve(&without.between);
        let precision = if priors.are_exact {
            without.matrix.clone()
        } else {
            let prior_covariance =
                DMatrix::from_diagonal(&DVector::from_fn(parameters, |at, _| priors.parameters[at].recip()));
            Cholesky::new(prior_covariance + without.factor.inverse())?.inverse()
        };
        let pull = shift.transpose() * &precision;
        let hessian = with.among - with.between.transpose() * with.factor.solve(&with.between)
            + &pull * &shift
            + DMatrix::from_diagonal(&held);
        let score = with.further - with.between.transpose() * with.factor.solve(&with.score)
            + &pull * &estimate
            - held.component_mul(&start);
        let factor = Cholesky::new(hessian)?;
        let moved = factor.solve(&score);
        let of_parameters = with.factor.solve(&(&with.score - &with.between * &moved));
        step.rows_mut(0, parameters).copy_from(&of_parameters);
        step.rows_mut(parameters, coordinates).copy_from(&moved);
        let off = &estimate - &shift * &moved;
        let beyond: f64 =
            (&deviations + &of_parameters).iter().zip(&flat).map(|(off, flat)| flat * off * off).sum();
        let determinants = log_determinant(&with.factor) + log_determinant(&factor)
            - log_determinant(&Cholesky::new(precision.clone())?);
        found = Some(-0.5 * (determinants + off.dot(&(&precision * &off)) + beyond));
    }
    let loss = reduced.loss(&reduced.squares(&all, step.as_slice()));
    let of_prior: f64 = (priors.coordinates.iter().zip(step.iter().skip(parameters)))
        .map(|((prior, z), step)| prior.log_density(z + step))
        .sum();
    let log = found? - 0.5 * power * (loss + log_determinant_of_term)
        + of_prior
        + 0.5 * coordinates as f64 * TAU.ln();
    log.is_finite().then_some(log)
}

/// Normal equations, cut at the parameters.
struct PartitionedNormal {
    matrix: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    between: DMatrix<f64>,
    among: DMatrix<f64>,
    score: DVector<f64>,
    further: DVector<f64>,
}

impl PartitionedNormal {
    fn of(
        normal: DMatrix<f64>,
        vector: DVector<f64>,
        parameters: usize,
        flat: &DVector<f64>,
        deviations: &DVector<f64>,
    ) -> Option<Self> {
        let further = normal.nrows() - parameters;
        let matrix =
            normal.view((0, 0), (parameters, parameters)).into_owned() + DMatrix::from_diagonal(flat);
        Some(PartitionedNormal {
            factor: Cholesky::new(matrix.clone())?,
            matrix,
            between: normal.view((0, parameters), (parameters, further)).into_owned(),
            among: normal.view((parameters, parameters), (further, further)).into_owned(),
            score: vector.rows(0, parameters) - flat.component_mul(deviations),
            further: vector.rows(parameters, further).into_owned(),
        })
    }
}

fn log_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * factor.l_dirty().diagonal().iter().map(|entry| entry.ln()).sum::<f64>()
}

/// Nodes and weights between two ends.
pub(crate) fn quadrature([from, to]: [f64; 2]) -> [(f64, f64); 9] {
    let half = 0.5 * (to - from);
    NODES.map(|(node, weight)| (0.5 * (from + to) + half * node, half * weight))
}

/// ln of a sum of exponentials.
pub(crate) fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY { most } else { most + logs.map(|log| (log - most).exp()).sum::<f64>().ln() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;
    use statrs::distribution::{ContinuousCDF, Normal};

    const ROWS: usize = 60;
    const TERM: Covariance = Covariance { size: 0.7, correlation_blocks: 2.0 };
    /// With so many degrees of freedom Student's t is normal.
    const NORMAL: f64 = 1e9;
    const PRIOR_PRECISIONS: [f64; 2] = [1.5, 0.4];
    const DEVIATIONS: [f64; 2] = [0.3, -0.2];
    const STARTS: [f64; 2] = [0.4, 0.1];

    /// One window: residual, two parameters, two coordinates, inputs of two kinds in three blocks each.
    struct SyntheticWindow {
        residual: DVector<f64>,
        columns: DMatrix<f64>,
        inputs: DMatrix<f64>,
        dof: f64,
    }

    impl SyntheticWindow {
        fn new(size: f64) -> Self {
            let mut random = Pcg64::seed_from_u64(3);
            let mut normal = || {
                let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
                Normal::standard().inverse_cdf(share.clamp(1e-12, 1.0 - 1e-12))
            };
            let columns = DMatrix::from_fn(ROWS, 4, |_, _| normal());
            let inputs = DMatrix::from_fn(ROWS, 6, |_, _| normal());
            let noise = DVector::from_fn(ROWS, |_, _| normal());
            let weights = DVector::from_fn(6, |_, _| size * normal());
            let residual =
                noise + &inputs * weights + &columns * DVector::from_vec(vec![0.2, -0.4, 0.5, -0.3]);
            SyntheticWindow { residual, columns, inputs, dof: ROWS as f64 }
        }

        fn products(&self, residual: &DVector<f64>, columns: &[usize]) -> Products {
            let columns: Vec<Vec<f64>> =
                columns.iter().map(|at| self.columns.column(*at).iter().copied().collect()).collect();
            Products::new(residual.as_slice(), &columns, &[self.dof], ROWS)
        }

        /// The term integrated out; the residual comes first.
        fn integrated(&self, residuals: &[DVector<f64>]) -> IntegratedInputs {
            let mut all: Vec<DVector<f64>> = residuals.to_vec();
            all.extend(self.columns.column_iter().map(Into::into));
            let grams = InputGrams {
                blocks: 3,
                gram: vec![self.inputs.transpose() * &self.inputs],
                cross: vec![self.inputs.transpose() * DMatrix::from_columns(&all)],
            };
            grams.integrated(TERM.correlation_blocks, &[TERM.size]).remove(0)
        }

        fn by_laplace(&self, prior: HeavyTailed) -> f64 {
            let plain = self.products(&self.residual, &[0, 1, 2, 3]);
            let term = self.integrated(std::slice::from_ref(&self.residual));
            let reduced = term.products(&plain, 0, &[1, 2, 3, 4]);
            let priors = priors(&[(prior, STARTS[0]), (prior, STARTS[1])]);
            log_marginal_likelihood(&plain, &reduced, term.log_determinant, &priors, 1.0).unwrap()
        }

        /// The same with the first coordinate integrated by quadrature.
        fn by_quadrature(&self, prior: HeavyTailed, ends: [f64; 2]) -> f64 {
            let nodes = quadrature(ends);
            let residuals: Vec<DVector<f64>> = nodes
                .iter()
                .map(|(z, _)| &self.residual - self.columns.column(2) * (z - STARTS[0]))
                .collect();
            let term = self.integrated(&residuals);
            let priors = priors(&[(prior, STARTS[1])]);
            log_sum(nodes.iter().zip(&residuals).enumerate().map(|(at, ((z, weight), residual))| {
                let plain = self.products(residual, &[0, 1, 3]);
                let first = residuals.len();
                let reduced = term.products(&plain, at, &[first, first + 1, first + 3]);
                let log = log_marginal_likelihood(&plain, &reduced, term.log_determinant, &priors, 1.0);
                log.unwrap() + prior.log_density(*z) + weight.ln()
            }))
        }

        /// Closed form with normal priors: covariance of the residual with everything integrated out. The degrees of freedom
        /// become those that give the window the weight 1.
        fn closed_form(&mut self, scale: f64) -> f64 {
            let [parameters, coordinates] = [0, 2].map(|from| self.columns.columns(from, 2).into_owned());
            let normal = parameters.transpose() * &parameters;
            let projected = &self.inputs
                - &parameters * normal.try_inverse().unwrap() * parameters.transpose() * &self.inputs;
            let correlation = DMatrix::from_fn(6, 6, |row: usize, column| {
                let apart = row.abs_diff(column) as f64;
                if row / 3 == column / 3 { (-apart / TERM.correlation_blocks).exp() } else { 0.0 }
            });
            let of_term = |inputs: &DMatrix<f64>| {
                DMatrix::identity(ROWS, ROWS) + TERM.size.powi(2) * inputs * &correlation * inputs.transpose()
            };
            let prior_covariance = DMatrix::from_diagonal(&DVector::from_iterator(
                2,
                PRIOR_PRECISIONS.iter().map(|precision| precision.recip()),
            ));
            let covariance = of_term(&projected)
                + &parameters * prior_covariance * parameters.transpose()
                + scale.powi(2) * &coordinates * coordinates.transpose();
            let from_mean = &self.residual
                + &parameters * DVector::from_column_slice(&DEVIATIONS)
                + &coordinates * DVector::from_column_slice(&STARTS);
            let factor = Cholesky::new(covariance).unwrap();
            let solved = factor.solve(&from_mean);
            let log = -0.5 * (log_determinant(&factor) + from_mean.dot(&solved));
            // The residual at the mode, under the term.
            let residual = &from_mean - scale.powi(2) * &coordinates * coordinates.transpose() * &solved;
            let term = Cholesky::new(of_term(&self.inputs)).unwrap();
            let weighed = term.solve(&parameters);
            let estimate =
                (parameters.transpose() * &weighed).try_inverse().unwrap() * weighed.transpose() * &residual;
            let residual = residual - parameters * estimate;
            self.dof = residual.dot(&term.solve(&residual));
            log + 0.5 * self.dof
        }
    }

    fn priors(coordinates: &[(HeavyTailed, f64)]) -> Priors {
        Priors {
            parameters: PRIOR_PRECISIONS.to_vec(),
            deviations: DEVIATIONS.to_vec(),
            are_exact: false,
            coordinates: coordinates.to_vec(),
        }
    }

    fn prior(scale: f64, dof: f64) -> HeavyTailed {
        HeavyTailed { scale, dof, is_one_sided: false }
    }

    #[test]
    fn laplace_and_quadrature_agree_with_the_closed_form() {
        let mut window = SyntheticWindow::new(TERM.size);
        let expected = window.closed_form(0.8);
        let laplace = window.by_laplace(prior(0.8, NORMAL));
        // The ridge of undetermined parameters is 1e-3 of a prior that is 1e-2 of the information.
        assert!((laplace - expected).abs() < 1e-2, "{laplace} {expected}");
        let quadrature = window.by_quadrature(prior(0.8, NORMAL), [-0.2, 1.2]);
        assert!((quadrature - expected).abs() < 5e-2, "{quadrature} {expected}");
        // Half of the mode is cut away.
        let halved = window.by_quadrature(prior(0.8, NORMAL), [-0.2, 0.5]);
        assert!(halved < expected - 0.2, "{halved} {expected}");
    }

    #[test]
    fn a_prior_three_times_as_wide_costs_ln_3_for_each_amplitude() {
        let mut window = SyntheticWindow::new(TERM.size);
        window.closed_form(0.8);
        let [narrow, wide] = [5.0, 15.0].map(|scale| window.by_laplace(prior(scale, 1.0)));
        assert!((narrow - wide - 2.0 * 3.0_f64.ln()).abs() < 0.05, "{narrow} {wide}");
    }

    #[test]
    fn without_a_term_nothing_is_taken() {
        let window = SyntheticWindow::new(0.0);
        let plain = window.products(&window.residual, &[0, 1, 2, 3]);
        let reduced = IntegratedInputs::none(1).products(&plain, 0, &[1, 2, 3, 4]);
        assert_eq!(plain.squares, reduced.squares);
    }

    #[test]
    fn nodes_integrate_a_cubic_exactly() {
        let sum: f64 = quadrature([1.0, 3.0]).iter().map(|(z, weight)| weight * z.powi(3)).sum();
        assert!((sum - 20.0).abs() < 1e-9, "{sum}");
    }
}
