//! How fits ended.

use serde::Serialize;

/// Why a fit took no further step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The last step lowered the loss by less than the tolerance, or none was predicted to lower it by more.
    #[default]
    Converged,
    /// No step leads further, and a number is at the end of its range.
    Bound,
    /// The linearised model predicted more, and no step lowered the simulated loss or was possible.
    Stalled,
    /// The steps were used up.
    StepLimit,
}

/// How a fit ended and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Convergence {
    /// Why no further step was taken.
    pub outcome: Outcome,
    /// Accepted steps.
    pub iterations: usize,
    /// Simulations of the records for the loss; derivatives are not counted.
    pub evaluations: usize,
}

impl Convergence {
    /// What to doubt about it, in words.
    #[must_use]
    pub fn doubt(self) -> Option<&'static str> {
        match self.outcome {
            Outcome::Converged => None,
            Outcome::Bound => Some("its fit ended at the end of a range"),
            Outcome::Stalled => Some("its fit stalled: no step lowered the simulated loss"),
            Outcome::StepLimit => Some("its fit used up its steps"),
        }
    }

    /// Of two fits in turn: the outcome of the second, the steps and simulations of both.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        Convergence {
            outcome: next.outcome,
            iterations: self.iterations + next.iterations,
            evaluations: self.evaluations + next.evaluations,
        }
    }
}
