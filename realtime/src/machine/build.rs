//! What this program was built with, as the build script found it, and from, as the program says.

use super::text::stored_as_text;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// A build; `unknown` where the build script could not tell.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Build {
    /// Version of airbench.
    pub version: Cow<'static, str>,
    /// The commit that was checked out; changes that nobody committed are not reported.
    pub commit: Cow<'static, str>,
    /// `release` or `debug`, and the level of optimisation.
    pub profile: BuildProfile,
    /// Checks that only tests and debugging want.
    pub debug_assertions: bool,
    /// Version of the compiler, as `rustc --version` prints it.
    pub rustc: Cow<'static, str>,
    /// What it was built for.
    pub target: Cow<'static, str>,
}

impl Build {
    pub(super) fn of_this_program(commit: &'static str) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: commit.into(),
            profile: BuildProfile::from(concat!(
                env!("AIRBENCH_BUILD_PROFILE"),
                ", opt-level ",
                env!("AIRBENCH_BUILD_OPT_LEVEL")
            )),
            debug_assertions: cfg!(debug_assertions),
            rustc: env!("AIRBENCH_BUILD_RUSTC").into(),
            target: env!("AIRBENCH_BUILD_TARGET").into(),
        }
    }
}

/// Profile that a program was built with. Its text is the line in `run.json`, from which it is read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum BuildProfile {
    /// A build for debugging.
    Debug {
        /// Text after `debug`, its comma included: the level of optimisation.
        settings: String,
    },
    /// A build for use.
    Release {
        /// Text after `release`, its comma included: the level of optimisation.
        settings: String,
    },
    /// A profile that this version does not write. Empty where nothing was recorded.
    Other(String),
}

const DEBUG: &str = "debug";
const RELEASE: &str = "release";

impl BuildProfile {
    /// Whether the build is one for debugging.
    #[must_use]
    pub fn is_for_debugging(&self) -> bool {
        matches!(self, Self::Debug { .. })
    }
}

impl fmt::Display for BuildProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Debug { settings } => write!(f, "{DEBUG}{settings}"),
            Self::Release { settings } => write!(f, "{RELEASE}{settings}"),
            Self::Other(profile) => f.write_str(profile),
        }
    }
}

impl From<&str> for BuildProfile {
    fn from(profile: &str) -> Self {
        let after = |name: &str| profile.strip_prefix(name).map(str::to_owned);
        let debug = after(DEBUG).map(|settings| Self::Debug { settings });
        debug
            .or_else(|| after(RELEASE).map(|settings| Self::Release { settings }))
            .unwrap_or_else(|| Self::Other(profile.to_owned()))
    }
}

stored_as_text!(BuildProfile);
