//! The report, and how its parts are made: `runlog/src/discrepancy_report.rs` has its types.

use crate::refit::EffectEstimate;
use plant::effects::sheet::{Part, Place};
pub use runlog::discrepancy_report::*;

/// A place of the plant as reports write it.
#[must_use]
pub fn place_of(place: Place) -> RigPlace {
    let named = RigPlace::named(&place.to_string());
    debug_assert!(place.element.is_some() == named.element.is_some() || matches!(place.part, Part::Linkage));
    named
}

/// An effect of a fit without its numbers.
pub(crate) fn effect_place(effect: &EffectEstimate) -> EffectPlace {
    EffectPlace { effect: effect.candidate.sheet.name.to_owned(), place: place_of(effect.candidate.place) }
}

/// The words in a sentence: `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Decimals of a value that is rounded to the second digit of its standard error.
pub(crate) fn decimals(standard_error: f64) -> usize {
    (1.0 - standard_error.log10().floor()).clamp(0.0, 12.0) as usize
}
