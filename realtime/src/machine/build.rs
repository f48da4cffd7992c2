//! What this program was built with, as the build script found it, and from, as the program says.

use serde::Serialize;

/// A build; `unknown` where the build script could not tell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Build {
    /// Version of airbench.
    pub version: &'static str,
    /// The commit that was checked out; changes that nobody committed are not told.
    pub commit: &'static str,
    /// `release` or `debug`, and the level of optimisation.
    pub profile: &'static str,
    /// Checks that only tests and debugging want.
    pub debug_assertions: bool,
    /// The compiler.
    pub rustc: &'static str,
    /// What it was built for.
    pub target: &'static str,
}

impl Build {
    pub(super) fn of_this_program(commit: &'static str) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit,
            profile: concat!(
                env!("AIRBENCH_BUILD_PROFILE"),
                ", opt-level ",
                env!("AIRBENCH_BUILD_OPT_LEVEL")
            ),
            debug_assertions: cfg!(debug_assertions),
            rustc: env!("AIRBENCH_BUILD_RUSTC"),
            target: env!("AIRBENCH_BUILD_TARGET"),
        }
    }
}
