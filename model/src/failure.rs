//! Why a record cannot be simulated.

use crate::simulate::MOST_STEPS;

/// Why a record cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// No number at the first sample.
    #[error("{place}: {what} is no finite number at the start")]
    Start {
        /// File, line and column of its equation.
        place: String,
        /// The equation of a state, or the output.
        what: String,
    },
    /// A state or output that runs away.
    #[error("{what} is no finite number at {time_s} s")]
    NotFinite {
        /// The state or output, as the file names it.
        what: String,
        /// Time of the record, s.
        time_s: f64,
    },
    /// Friction that drives.
    #[error("{place}: {name} does not brake: a force along the speed has to lower its rate")]
    Drives {
        /// File, line and column of its sliding force.
        place: String,
        /// As the file calls it.
        name: String,
    },
    /// Steps that would never end.
    #[error(
        "more than {MOST_STEPS} steps from {time_s} s to the next sample, or too many of the shortest: a fixed step is too \
         short, or the equations are stiff or jump to and fro without end"
    )]
    Steps {
        /// Time of the sample before, s.
        time_s: f64,
    },
}
