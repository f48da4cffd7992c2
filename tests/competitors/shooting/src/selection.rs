//! Stepwise selection by the Bayesian information criterion.
//!
//! ```text
//!   BIC = n ln(RSS / n) + k ln n          n numbers that were measured, k numbers that were fitted
//! ```
//!
//! A step fits each of the most promising terms beside what is chosen, takes the best, and leaves out what the criterion can do
//! without; it ends where no term lowers it. The variance of the noise is unknown, so that what no term describes counts as
//! noise. Source: Schwarz, Estimating the dimension of a model, Annals of Statistics 6 (1978).

/// Terms fitted in a step: the first ones by the gain that a linear fit predicts.
const TRIED: usize = 5;
/// Most terms of a model.
const MOST_TERMS: usize = 6;
/// Difference of the criterion up to which another term explains a record as well: "very strong evidence" begins there (Kass and
/// Raftery, Bayes factors, Journal of the American Statistical Association 90, 1995).
const AS_GOOD: f64 = 10.0;

/// What terms are chosen from.
pub(crate) trait Problem {
    type Term: Clone;
    type Fit;

    /// Numbers that were measured, less those that start states take.
    fn count(&self) -> f64;
    /// Fits terms from the numbers that they bring; `None` where no model can have them.
    fn fit(&self, terms: &[Self::Term]) -> Option<Self::Fit>;
    /// The same in a few steps, for comparing many.
    fn fit_roughly(&self, terms: &[Self::Term]) -> Option<Self::Fit>;
    /// Terms that can be added, each with the fall of the residual sum of squares that a linear fit predicts.
    fn predicted_gains(&self, at: &Self::Fit) -> Vec<(Self::Term, f64)>;
    /// Residual sum of squares.
    fn squares(fit: &Self::Fit) -> f64;
    /// Its terms, with the numbers that were fitted.
    fn terms(fit: &Self::Fit) -> &[Self::Term];
    fn numbers(term: &Self::Term) -> usize;
    /// Whether two terms are one at different numbers.
    fn is_same(one: &Self::Term, other: &Self::Term) -> bool;
}

pub(crate) fn criterion<P: Problem>(problem: &P, fit: &P::Fit) -> f64 {
    let count = problem.count();
    let numbers: usize = P::terms(fit).iter().map(P::numbers).sum();
    count * (P::squares(fit) / count).ln() + numbers as f64 * count.ln()
}

/// The best of some terms beside others, the criterion beside each.
fn best_extensions<P: Problem>(problem: &P, base: &P::Fit) -> Vec<(f64, P::Fit)> {
    let mut terms = problem.predicted_gains(base);
    let count = problem.count();
    let net_gain = |(term, gain): &(P::Term, f64)| gain - P::numbers(term) as f64 * count.ln();
    terms.sort_by(|one, other| net_gain(other).total_cmp(&net_gain(one)));
    let mut firsts: Vec<P::Term> = Vec::new();
    for (term, _) in terms {
        if firsts.len() < TRIED && !firsts.iter().any(|first| P::is_same(first, &term)) {
            firsts.push(term);
        }
    }
    let fits = firsts.into_iter().filter_map(|term| {
        let terms: Vec<P::Term> = P::terms(base).iter().cloned().chain([term]).collect();
        problem.fit_roughly(&terms)
    });
    let mut fits: Vec<(f64, P::Fit)> = fits.map(|fit| (criterion(problem, &fit), fit)).collect();
    fits.sort_by(|one, other| one.0.total_cmp(&other.0));
    fits
}

/// The model without each of its terms.
fn without<P: Problem>(problem: &P, fit: &P::Fit, at: usize) -> Option<P::Fit> {
    let mut terms = P::terms(fit).to_vec();
    terms.remove(at);
    problem.fit_roughly(&terms)
}

/// A model, and of each of its terms the others that explained the record as well when it was taken, alone at its place.
pub(crate) struct Selected<P: Problem> {
    pub(crate) fit: P::Fit,
    pub(crate) alternatives: Vec<Vec<P::Term>>,
}

/// The model of least criterion; `None` where not even one without terms can be simulated.
pub(crate) fn select<P: Problem>(problem: &P, progress: &mut dyn FnMut(&P::Fit, f64)) -> Option<Selected<P>> {
    let mut best = problem.fit(&[])?;
    let mut least = criterion(problem, &best);
    let mut alternatives: Vec<Vec<P::Term>> = Vec::new();
    progress(&best, least);
    while P::terms(&best).len() < MOST_TERMS {
        let extensions = best_extensions(problem, &best);
        let as_good = extensions.iter().skip(1).take_while(|(next, _)| extensions[0].0 + AS_GOOD > *next);
        let others = as_good.filter_map(|(_, fit)| P::terms(fit).last().cloned()).collect();
        let Some((next, fit)) = extensions.into_iter().next().filter(|(next, _)| *next < least) else {
            break;
        };
        (least, best) = (next, fit);
        alternatives.push(others);
        // What came last is not asked: it was just taken.
        let mut at = 0;
        while at + 1 < P::terms(&best).len() {
            match without(problem, &best, at).map(|fit| (criterion(problem, &fit), fit)) {
                Some((next, fit)) if next < least => {
                    (least, best) = (next, fit);
                    alternatives.remove(at);
                }
                _ => at += 1,
            }
        }
        best = problem.fit(P::terms(&best))?;
        least = criterion(problem, &best);
        progress(&best, least);
    }
    Some(Selected { fit: best, alternatives })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A linear regression on some columns.
    struct Columns {
        columns: DMatrix<f64>,
        measured: DVector<f64>,
    }

    #[derive(Clone)]
    struct Fitted {
        terms: Vec<usize>,
        residual: DVector<f64>,
    }

    impl Problem for Columns {
        type Term = usize;
        type Fit = Fitted;

        fn count(&self) -> f64 {
            self.measured.len() as f64
        }

        fn fit(&self, terms: &[usize]) -> Option<Fitted> {
            if terms.is_empty() {
                return Some(Fitted { terms: Vec::new(), residual: self.measured.clone() });
            }
            let chosen = self.columns.select_columns(terms);
            let numbers = chosen.clone().svd(true, true).solve(&self.measured, 1e-12).ok()?;
            Some(Fitted { terms: terms.to_vec(), residual: &self.measured - chosen * numbers })
        }

        fn fit_roughly(&self, terms: &[usize]) -> Option<Fitted> {
            self.fit(terms)
        }

        fn predicted_gains(&self, at: &Fitted) -> Vec<(usize, f64)> {
            let gain = |term: usize| {
                let column = self.columns.column(term);
                (term, column.dot(&at.residual).powi(2) / column.dot(&column))
            };
            (0..self.columns.ncols()).filter(|term| !at.terms.contains(term)).map(gain).collect()
        }

        fn squares(fit: &Fitted) -> f64 {
            fit.residual.norm_squared()
        }

        fn terms(fit: &Fitted) -> &[usize] {
            &fit.terms
        }

        fn numbers(_: &usize) -> usize {
            1
        }

        fn is_same(one: &usize, other: &usize) -> bool {
            one == other
        }
    }

    /// Twelve waves, of which the first is nearly the sum of the second and the third; noise of a fixed rule.
    fn problem(amplitudes: &[(usize, f64)]) -> Columns {
        let mut columns = DMatrix::from_fn(400, 12, |row, term| ((row * (term + 1)) as f64 * 0.037).sin());
        let sum = columns.column(1) + columns.column(2) + 0.05 * columns.column(0);
        columns.set_column(0, &sum);
        let noise = |row: usize| (row as f64 * 12.9898).sin() * 43_758.545_3;
        let noise = DVector::from_fn(400, |row, _| 2.0 * (noise(row) - noise(row).floor()) - 1.0);
        let measured = amplitudes.iter().map(|(term, amplitude)| columns.column(*term) * *amplitude);
        let measured = measured.fold(noise, |sum, column| sum + column);
        Columns { columns, measured }
    }

    fn chosen(amplitudes: &[(usize, f64)]) -> Vec<usize> {
        let mut terms = select(&problem(amplitudes), &mut |_, _| ()).unwrap().fit.terms;
        terms.sort_unstable();
        terms
    }

    #[test]
    fn what_is_there_is_chosen_and_nothing_else() {
        assert_eq!(chosen(&[]), [0_usize; 0]);
        assert_eq!(chosen(&[(5, 1.0)]), [5]);
        assert_eq!(chosen(&[(4, 1.0), (7, -0.5), (9, 0.8)]), [4, 7, 9]);
    }

    #[test]
    fn what_two_terms_replace_is_left_out_again() {
        // The first wave is taken first, being nearly both.
        assert_eq!(chosen(&[(1, 1.0), (2, 1.0)]), [0]);
        assert_eq!(chosen(&[(1, 3.0), (2, 1.0)]), [1, 2]);
    }

    #[test]
    fn a_twin_is_an_alternative_and_others_are_none() {
        let mut twins = problem(&[(5, 1.0)]);
        let twin = twins.columns.column(5) + 0.01 * twins.columns.column(8);
        twins.columns.set_column(3, &twin);
        let Selected { fit, alternatives } = select(&twins, &mut |_, _| ()).unwrap();
        assert_eq!(fit.terms.len(), 1);
        assert_eq!(alternatives, [[if fit.terms[0] == 5 { 3 } else { 5 }]]);
    }
}
