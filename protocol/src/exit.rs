//! Exit codes of the programs, for the shell that started them: one table for all programs of airbench (programs.md).

use std::process::ExitCode;

/// How a program ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All went well.
    Good = 0,
    /// A bound, a threshold or a check was broken, or a run ended before it was done.
    BoundBroken = 1,
    /// The command line, an input file or the output folder is not usable.
    BadInput = 2,
    /// The bus or a partner failed.
    BusFailed = 3,
    /// A member of the lockstep barrier was not done in time.
    LockstepTimeout = 4,
    /// Interrupted by Ctrl-C or SIGTERM, with everything saved.
    Interrupted = 130,
}

/// The table as `--help` of each program shows it.
pub const EXIT_CODE_HELP: &str = "Exit codes: 0 good; 1 a bound or threshold was broken; 2 usage, bad input, or an output \
that cannot be written; 3 the bus or a partner failed; 4 lockstep time-out; 130 interrupted with everything saved.";

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
