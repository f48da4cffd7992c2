//! Gauss-Newton of the nonlinear fits of rigs and model files: one loop and one outcome; each kind of fit states its options.
//! Start states of windows have a loop of their own (`windows/starts.rs` of `discrepancy`).
//!
//! ```text
//!   linearise at the iterate ──► full step, then shorter ones, until the simulated loss falls ──► next iterate
//!                                          │ none does
//!                                          ▼
//!                converged if the linearised model predicts less than the tolerance, else stalled
//! ```
//!
//! Backtracking on the simulated loss (fits of model files damp a step in place of shortening it, see `fit`): a step counts only
//! if the loss of the simulator falls, not that of the linearised model (but for `calibrate::finer` of `discrepancy`). Callers
//! know how to linearise and which fits are linear within a step (of the rig, `refit` takes the baseline parameters as linear,
//! `name` and `tabulate` simulate them). Through stick-slip the loss has steps, so that neither the slope nor a sufficient
//! decrease is asked for.
//!
//! Source: Björck, Numerical Methods for Least Squares Problems, SIAM 1996, chapter 9 (damped Gauss-Newton, variable projection).

pub use runlog::discrepancy_report::{Convergence, Outcome};

/// Limits, tolerances and step lengths of one kind of fit.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Most accepted steps.
    pub steps: usize,
    /// Fall of the loss in a step below which the fit has converged. The loss is minus twice a log-likelihood, so that a
    /// parameter off by one standard error costs 1; the tolerances are below what decides between two models.
    pub absolute_tolerance: f64,
    /// The same as a share of the loss: where no model is exact, the last steps decide nothing. The larger of the two holds.
    pub relative_tolerance: f64,
    /// Fractions of the step that are tried, longest first.
    pub fractions: &'static [f64],
}

/// Backtracking factor.
const SHORTER: f64 = 0.4;
const SHORTER_TWICE: f64 = SHORTER * SHORTER;
/// Share of the loss of an inexact model that decides nothing: fits are alike within twenty times as much.
const INEXACT_TOLERANCE: f64 = 1e-3;

/// A candidate beside fixed parameter sensitivities. A step that is still too long at the last fraction crosses a break-away.
pub const CANDIDATE: Options = Options {
    steps: 7,
    absolute_tolerance: 0.3,
    relative_tolerance: INEXACT_TOLERANCE,
    fractions: &[1.0, SHORTER, SHORTER_TWICE, SHORTER_TWICE * SHORTER],
};
/// All numbers of a model, with one fraction more: this is the model that is reported.
pub const JOINT: Options = Options {
    steps: 6,
    absolute_tolerance: 0.3,
    relative_tolerance: 0.1 * INEXACT_TOLERANCE,
    fractions: &[1.0, SHORTER, SHORTER_TWICE, SHORTER_TWICE * SHORTER, SHORTER_TWICE * SHORTER_TWICE],
};
/// The same for models that are compared and not reported.
pub const JOINT_COMPARED: Options = Options { relative_tolerance: INEXACT_TOLERANCE, ..JOINT };
/// Tables: each step is some [`TABLES_WITHIN`] with the same derivatives, which cost many times a step.
pub const TABLES: Options = Options {
    steps: 7,
    absolute_tolerance: 1.0,
    relative_tolerance: INEXACT_TOLERANCE,
    fractions: &[1.0, 0.4, 0.15, 0.05],
};
/// The same with the derivatives held.
pub const TABLES_WITHIN: Options = Options { steps: 3, ..TABLES };
/// New linearisations of the parameters beside a candidate: those of a model that has an effect differ from the rig file's.
pub const RELINEARISATION: Options =
    Options { steps: 4, absolute_tolerance: 1.0, relative_tolerance: INEXACT_TOLERANCE, fractions: &[1.0] };
/// New linearisations of the parameters alone, from the rig file's values to a supply or a mass that is a tenth off.
pub const CALIBRATION: Options = Options { steps: 7, ..RELINEARISATION };

/// A model simulated at one set of its numbers.
pub trait Iterate {
    /// What the fit minimises: the loss with priors, of some fits with penalties.
    fn loss(&self) -> f64;
    /// Whether a number is at the end of its range.
    fn is_at_bound(&self) -> bool;
}

/// A step that was searched for.
pub enum Step<P> {
    /// The first fraction whose loss is below that of the iterate before.
    Accepted(P),
    /// No fraction lowers the loss, though the linearised model predicts this reduction.
    Refused {
        /// Fall of the loss by the linearised model: up to the tolerance the fit has converged, beyond it has stalled.
        predicted_reduction: f64,
    },
    /// No linearisation: a neighbouring rig does not exist.
    Impossible,
}

/// The loop of one fit, which counts.
#[derive(Debug)]
pub struct Estimator {
    options: Options,
    evaluations: usize,
}

impl Estimator {
    /// A loop that has evaluated nothing yet.
    pub fn new(options: Options) -> Self {
        Estimator { options, evaluations: 0 }
    }

    /// Fall of this loss below which a fit has converged.
    pub fn tolerance(&self, loss: f64) -> f64 {
        self.options.absolute_tolerance.max(self.options.relative_tolerance * loss)
    }

    /// The longest fraction of a step that lowers the loss; `at` simulates a fraction.
    pub fn backtrack<P: Iterate>(
        &mut self,
        from: &P,
        predicted_reduction: f64,
        fractions: &[f64],
        mut at: impl FnMut(f64) -> Option<P>,
    ) -> Step<P> {
        for fraction in fractions {
            self.evaluations += 1;
            if let Some(tried) = at(*fraction)
                && tried.loss() < from.loss()
            {
                return Step::Accepted(tried);
            }
        }
        Step::Refused { predicted_reduction }
    }

    /// Counts a simulation outside [`Estimator::backtrack`].
    pub fn count(&mut self) {
        self.evaluations += 1;
    }

    /// Counts those of a fit within a step.
    pub fn count_all(&mut self, within: Convergence) {
        self.evaluations += within.evaluations;
    }

    /// Steps from a starting point until convergence.
    pub fn descend<P: Iterate>(
        mut self,
        start: P,
        mut step: impl FnMut(&mut Self, &P) -> Step<P>,
    ) -> (P, Convergence) {
        let mut point = start;
        let (mut outcome, mut iterations) = (Outcome::StepLimit, 0);
        while iterations < self.options.steps {
            let next = match step(&mut self, &point) {
                Step::Accepted(next) => next,
                Step::Refused { predicted_reduction }
                    if predicted_reduction <= self.tolerance(point.loss()) =>
                {
                    outcome = Outcome::Converged;
                    break;
                }
                Step::Refused { .. } | Step::Impossible => {
                    outcome = Outcome::Stalled;
                    break;
                }
            };
            iterations += 1;
            let (fall, tolerance) = (point.loss() - next.loss(), self.tolerance(point.loss()));
            point = next;
            if fall < tolerance {
                outcome = Outcome::Converged;
                break;
            }
        }
        if outcome != Outcome::StepLimit && point.is_at_bound() {
            outcome = Outcome::Bound;
        }
        let convergence = Convergence { outcome, iterations, evaluations: self.evaluations };
        (point, convergence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An iterate of one number, within 0 to 10, and its loss.
    #[derive(Clone, Copy, Debug)]
    struct ScalarIterate(f64, fn(f64) -> f64);

    impl Iterate for ScalarIterate {
        fn loss(&self) -> f64 {
            self.1(self.0)
        }

        fn is_at_bound(&self) -> bool {
            [0.0, 10.0].contains(&self.0)
        }
    }

    const OPTIONS: Options = Options {
        steps: 20,
        absolute_tolerance: 1e-6,
        relative_tolerance: 0.0,
        fractions: &[1.0, 0.5, 0.25],
    };

    /// Newton's method with a slope and a curvature that belong to the loss, or do not.
    fn fitted(
        loss: fn(f64) -> f64,
        start: f64,
        slope: fn(f64) -> f64,
        curvature: f64,
    ) -> (ScalarIterate, Convergence) {
        Estimator::new(OPTIONS).descend(ScalarIterate(start, loss), |estimator, at| {
            let step = -slope(at.0) / curvature;
            let predicted_reduction = 0.5 * slope(at.0) * slope(at.0) / curvature;
            estimator.backtrack(at, predicted_reduction, OPTIONS.fractions, |fraction| {
                Some(ScalarIterate((at.0 + fraction * step).clamp(0.0, 10.0), loss))
            })
        })
    }

    #[test]
    fn a_parabola_converges_and_says_what_it_took() {
        let (at, convergence) = fitted(|x| (x - 3.0).powi(2), 9.0, |x| 2.0 * (x - 3.0), 2.0);
        assert_eq!((at.0, convergence.outcome), (3.0, Outcome::Converged));
        assert_eq!((convergence.iterations, convergence.evaluations), (1, 4));
    }

    #[test]
    fn a_step_that_is_too_long_is_shortened() {
        let (at, convergence) = fitted(|x| (x - 3.0).powi(2), 9.0, |x| 2.0 * (x - 3.0), 0.6);
        assert!((at.0 - 3.0).abs() < 1e-2, "{at:?}");
        assert!(convergence.evaluations > convergence.iterations, "{convergence:?}");
    }

    #[test]
    fn a_minimum_beyond_the_range_ends_at_the_bound() {
        let (at, convergence) = fitted(|x| (x - 12.0).powi(2), 5.0, |x| 2.0 * (x - 12.0), 2.0);
        assert_eq!((at.0, convergence.outcome), (10.0, Outcome::Bound));
        let (at, convergence) = fitted(|x| x * x, 5.0, |x| 2.0 * x, 2.0);
        assert_eq!((at.0, convergence.outcome), (0.0, Outcome::Bound));
    }

    #[test]
    fn a_wrong_slope_stalls() {
        let (at, convergence) = fitted(|x| (x - 3.0).powi(2), 9.0, |x| -2.0 * (x - 3.0), 20.0);
        assert_eq!((at.0, convergence.outcome, convergence.iterations), (9.0, Outcome::Stalled, 0));
    }

    #[test]
    fn of_a_large_loss_a_share_is_the_tolerance() {
        let from = |start: f64, relative_tolerance: f64| {
            let loss = |x: f64| 1000.0 + (x - 3.0).powi(2);
            let options = Options { relative_tolerance, ..OPTIONS };
            let halfway = |estimator: &mut Estimator, at: &ScalarIterate| {
                estimator.backtrack(at, 1.0, &[1.0], |_| Some(ScalarIterate(3.0 + 0.5 * (at.0 - 3.0), loss)))
            };
            Estimator::new(options).descend(ScalarIterate(start, loss), halfway).1
        };
        assert_eq!((from(4.0, 1e-3).iterations, from(9.0, 1e-3).iterations), (1, 4));
        assert!(from(4.0, 0.0).iterations > 5);
    }

    #[test]
    fn steps_that_are_used_up_are_no_convergence() {
        let (_, convergence) = fitted(|x| (x - 3.0).powi(2), 9.0, |x| 2.0 * (x - 3.0), 200.0);
        assert_eq!((convergence.outcome, convergence.iterations), (Outcome::StepLimit, 20));
    }
}
