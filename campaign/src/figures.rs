//! The figures that a campaign of experiments can collect: those of `bench figures`, and the two that a summary has at its top.

use figures as of_runs;

/// Those at the top of a summary.
pub(crate) use of_runs::top::POSITIONS as TOP;

/// Whether there is a figure of this name.
#[must_use]
pub(crate) fn is_known(name: &str) -> bool {
    TOP.contains(&name) || of_runs::definition(name).is_some()
}

#[must_use]
pub(crate) fn all() -> Vec<String> {
    let definitions = of_runs::definitions().map(|definition| definition.name);
    TOP.into_iter().chain(definitions).map(str::to_owned).collect()
}
