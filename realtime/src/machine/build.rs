//! What this program was built with, as the build script found it, and from, as the program says.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// A build; `unknown` where the build script could not tell.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Build {
    /// Version of airbench.
    pub version: Cow<'static, str>,
    /// The commit that was checked out; changes that nobody committed are not reported.
    pub commit: Cow<'static, str>,
    /// `release` or `debug`, and the level of optimisation.
    pub profile: Cow<'static, str>,
    /// Checks that only tests and debugging want.
    pub debug_assertions: bool,
    /// The compiler.
    pub rustc: Cow<'static, str>,
    /// What it was built for.
    pub target: Cow<'static, str>,
}

impl Build {
    pub(super) fn of_this_program(commit: &'static str) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: commit.into(),
            profile: concat!(
                env!("AIRBENCH_BUILD_PROFILE"),
                ", opt-level ",
                env!("AIRBENCH_BUILD_OPT_LEVEL")
            )
            .into(),
            debug_assertions: cfg!(debug_assertions),
            rustc: env!("AIRBENCH_BUILD_RUSTC").into(),
            target: env!("AIRBENCH_BUILD_TARGET").into(),
        }
    }
}
