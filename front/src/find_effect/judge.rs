//! Compares the effects that the workflow named with the sealed file.
//!
//! The result is right if every hidden effect is named, or is one of at most two that the report calls indistinguishable from a
//! named one; if no more are named than are hidden; and if, without a hidden effect, nothing outside the catalogue is reported.

use crate::FrontError;
use runlog::discrepancy_report::{NamedEffect, Quantity, Report, RigPlace, Verdict};
use runlog::run_folder::read_json;
use serde::Deserialize;
use std::fmt::{self, Display, Formatter};
use std::path::Path;

/// Most effects that a named one may stand for.
const MOST_ALTERNATIVES: usize = 2;

/// The lines to print and to write, and whether the result is right.
#[derive(Debug, PartialEq)]
pub(super) struct Judgement {
    pub(super) lines: Vec<String>,
    pub(super) right: bool,
}

pub(super) fn read(file: &Path) -> Result<Report, FrontError> {
    read_json(file)
        .map_err(|error| FrontError::Process(format!("discrepancy close left no usable report: {error}")))
}

/// Compares the sealed file with the report.
///
/// # Errors
/// [`FrontError::Input`] if the sealed file cannot be parsed.
pub(super) fn judge(sealed: &str, report: &Report) -> Result<Judgement, FrontError> {
    let hidden = HiddenItem::of(sealed)?;
    let mut lines: Vec<String> =
        hidden.iter().map(|hidden| line("hidden", &hidden.to_string(), &hidden.written)).collect();
    if hidden.is_empty() {
        lines.push("hidden: nothing".into());
    }
    lines.extend(report.named.iter().map(|effect| line("named", &name(effect), &numbers(effect))));
    if report.named.is_empty() {
        lines.push(format!("named: nothing ({})", report.verdict.name()));
    }
    let alternatives: Vec<&NamedEffect> =
        report.named.iter().flat_map(|effect| &effect.alternatives).collect();
    if !alternatives.is_empty() {
        let names: Vec<String> = alternatives.iter().map(|effect| name(effect)).collect();
        lines.push(format!("indistinguishable in this record: {}", names.join(", ")));
    }
    let is_named =
        |hidden: &&HiddenItem| report.named.iter().any(|effect| hidden.is(&effect.effect, &effect.place));
    let mut verdict = "right";
    let mut right = true;
    for hidden in hidden.iter().filter(|hidden| !is_named(hidden)) {
        let indistinguishable = alternatives.iter().any(|effect| hidden.is(&effect.effect, &effect.place));
        if indistinguishable && alternatives.len() <= MOST_ALTERNATIVES {
            if verdict == "right" {
                verdict = "right, within the set that this record cannot distinguish";
            }
            continue;
        }
        right = false;
        let unexcited = report.not_excited.iter().any(|effect| hidden.is(&effect.effect, &effect.place));
        verdict = match (indistinguishable, unexcited) {
            (true, _) => "wrong, it is one of too many that this record cannot distinguish",
            (false, true) => "wrong, and the report says that this experiment does not excite it",
            (false, false) => "wrong",
        };
    }
    if report.named.len() > hidden.len() {
        (right, verdict) = (false, "wrong, more was named than hidden");
    }
    if hidden.is_empty() && report.verdict == Verdict::OutsideCatalogue {
        (right, verdict) = (false, "wrong, nothing was hidden");
    }
    lines.push(verdict.into());
    Ok(Judgement { lines, right })
}

fn line(what: &str, name: &str, numbers: &str) -> String {
    if numbers.is_empty() { format!("{what}: {name}") } else { format!("{what}: {name} ({numbers})") }
}

/// An effect or term of a sealed file.
#[derive(Debug, PartialEq)]
struct HiddenItem {
    name: String,
    /// `drive` or `drive.force`: axis, and element or the target of a declared term.
    place: String,
    /// Numbers or expression in the notation of the file.
    written: String,
    is_term: bool,
}

impl HiddenItem {
    /// All effects and terms of a file, effects first.
    fn of(sealed: &str) -> Result<Vec<Self>, FrontError> {
        #[derive(Deserialize)]
        struct Term {
            name: String,
            place: String,
            add: String,
        }
        #[derive(Deserialize)]
        struct File {
            #[serde(default)]
            effects: toml::map::Map<String, toml::Value>,
            #[serde(default)]
            terms: Vec<Term>,
        }
        let file: File = toml::from_str(sealed)
            .map_err(|error| FrontError::Input(format!("the file of what is hidden: {error}")))?;
        let mut all = Vec::new();
        for (name, places) in &file.effects {
            let parts = places.as_table().into_iter().flatten();
            parts.for_each(|(part, numbers)| Self::add_effect(&mut all, name, part.clone(), numbers));
        }
        let term = |Term { name, place, add }| HiddenItem { name, place, written: add, is_term: true };
        all.extend(file.terms.into_iter().map(term));
        Ok(all)
    }

    /// The effect at this place, or at each of its elements.
    fn add_effect(all: &mut Vec<Self>, name: &str, place: String, numbers: &toml::Value) {
        let numbers = numbers.as_table().cloned().unwrap_or_default();
        let (elements, numbers): (Vec<_>, Vec<_>) =
            numbers.into_iter().partition(|(_, value)| value.is_table());
        for (element, numbers) in &elements {
            Self::add_effect(all, name, format!("{place}.{element}"), numbers);
        }
        if elements.is_empty() {
            let written: Vec<String> = numbers.iter().map(|(key, value)| format!("{key} {value}")).collect();
            let (name, written) = (name.to_owned(), written.join(", "));
            all.push(HiddenItem { name, place, written, is_term: false });
        }
    }

    /// Whether it is this effect of a report, which has the axis of a term, and the element of a reading or a flow.
    fn is(&self, effect: &str, place: &RigPlace) -> bool {
        let is_there = match self.is_term {
            true => self.place.split('.').next() == Some(&place.axis),
            false => self.place == place.to_string(),
        };
        effect == self.name && is_there
    }
}

impl Display for HiddenItem {
    fn fmt(&self, to: &mut Formatter<'_>) -> fmt::Result {
        write!(to, "{} at {}", self.name, self.place)
    }
}

fn name(effect: &NamedEffect) -> String {
    format!("{} at {}", effect.effect, effect.place)
}

fn numbers(effect: &NamedEffect) -> String {
    let written = |parameter: &Quantity| {
        let error =
            parameter.standard_error.map_or(String::new(), |error| format!(" +- {}", significant(error, 2)));
        let value = significant(parameter.value, 4);
        format!("{} {value}{error} {}", parameter.name, parameter.unit).trim_end().to_owned()
    };
    effect.parameters.iter().map(written).collect::<Vec<_>>().join(", ")
}

/// A number with so many significant digits, without trailing zeros; with an exponent far from 1.
fn significant(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return scientific };
    let short = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    match exponent.parse::<i32>() {
        Ok(exponent) if (-4..digits as i32).contains(&exponent) => {
            short(&format!("{value:.*}", (digits as i32 - 1 - exponent) as usize))
        }
        _ => format!("{}e{exponent}", short(mantissa)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_significant_digits_and_no_more() {
        let cases = [
            (5.91234, "5.912"),
            (0.0512, "0.0512"),
            (1234.56, "1235"),
            (2.0, "2"),
            (1.5e-7, "1.5e-7"),
            (123456.0, "1.235e5"),
        ];
        for (value, expected) in cases {
            assert_eq!(significant(value, 4), expected);
        }
        assert_eq!((significant(0.0512, 2).as_str(), significant(0.0, 2).as_str()), ("0.051", "0"));
    }

    #[test]
    fn effects_and_terms_of_a_sealed_file_are_listed_with_what_is_written() {
        let sealed = "[effects.piston-leakage.load]\nleakage_nl_per_min = 5.89\nshare = 0.5\n\n[effects.a.drive.x]\n\
                      [[terms]]\nname = 'brake'\nplace = 'drive.force'\nadd = '-(30[N s/m])*v'\n";
        let read: Vec<(String, String)> = HiddenItem::of(sealed)
            .expect("a sealed file")
            .iter()
            .map(|hidden| (hidden.to_string(), hidden.written.clone()))
            .collect();
        let expected = [
            ("a at drive.x", ""),
            ("piston-leakage at load", "leakage_nl_per_min 5.89, share 0.5"),
            ("brake at drive.force", "-(30[N s/m])*v"),
        ];
        assert_eq!(read, expected.map(|(name, written)| (name.to_owned(), written.to_owned())));
        assert!(HiddenItem::of("effects = 3").is_err());
    }
}
