//! What the workflow named, held against the seal.
//!
//! Right is: every hidden effect is named, or is one of at most two that the report calls indistinguishable from a named one; no
//! more is named than is hidden; and where nothing is hidden, nothing outside the catalogue is reported.

use crate::FrontError;
use runlog::run_folder::read_json;
use serde::Deserialize;
use std::path::Path;

/// The most effects that a named one may stand for.
const MOST_ALTERNATIVES: usize = 2;

/// What is read of a report: `discrepancy/docs/report.md`.
#[derive(Debug, Deserialize)]
pub(super) struct Report {
    verdict: String,
    named: Vec<Effect>,
    #[serde(default)]
    not_excited: Vec<Effect>,
}

#[derive(Debug, Deserialize)]
struct Effect {
    effect: String,
    #[serde(rename = "where")]
    place: Place,
    #[serde(default)]
    parameters: Vec<Parameter>,
    #[serde(default)]
    alternatives: Vec<Effect>,
}

#[derive(Debug, Deserialize)]
struct Place {
    axis: Option<String>,
    element: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Parameter {
    name: String,
    value: Option<f64>,
    unit: Option<String>,
    standard_error: Option<f64>,
}

/// What a person is told, and whether all was right.
#[derive(Debug, PartialEq)]
pub(super) struct Judged {
    pub(super) lines: Vec<String>,
    pub(super) right: bool,
}

/// Reads a report.
pub(super) fn read(file: &Path) -> Result<Report, FrontError> {
    read_json(file)
        .map_err(|error| FrontError::Process(format!("discrepancy close left no usable report: {error}")))
}

/// Opens the seal.
pub(super) fn judge(sealed: &str, report: &Report) -> Judged {
    let hidden = hidden_effects(sealed);
    let mut lines: Vec<String> = hidden.iter().map(|(name, numbers)| told("hidden", name, numbers)).collect();
    if hidden.is_empty() {
        lines.push("hidden: nothing".into());
    }
    lines.extend(report.named.iter().map(|effect| told("named", &effect.name(), &effect.numbers())));
    if report.named.is_empty() {
        lines.push(format!("named: nothing ({})", report.verdict));
    }
    let names = |effects: &[Effect]| effects.iter().map(Effect::name).collect::<Vec<_>>();
    let alternatives: Vec<_> = report.named.iter().flat_map(|effect| names(&effect.alternatives)).collect();
    if !alternatives.is_empty() {
        lines.push(format!("not to be told apart by this record: {}", alternatives.join(", ")));
    }
    let (named, unexcited) = (names(&report.named), names(&report.not_excited));
    let mut verdict = "right";
    let mut right = true;
    for (name, _) in hidden.iter().filter(|(name, _)| !named.contains(name)) {
        let indistinguishable = alternatives.contains(name);
        if indistinguishable && alternatives.len() <= MOST_ALTERNATIVES {
            verdict = if verdict == "right" {
                "right, among those that this record cannot tell apart"
            } else {
                verdict
            };
            continue;
        }
        right = false;
        verdict = match (indistinguishable, unexcited.contains(name)) {
            (true, _) => "wrong, it is one of too many that this record cannot tell apart",
            (false, true) => "wrong, and the report says that this experiment does not excite it",
            (false, false) => "wrong",
        };
    }
    if named.len() > hidden.len() {
        (right, verdict) = (false, "wrong, more was named than hidden");
    }
    if hidden.is_empty() && report.verdict == "outside-catalogue" {
        (right, verdict) = (false, "wrong, nothing was hidden");
    }
    lines.push(verdict.into());
    Judged { lines, right }
}

fn told(what: &str, name: &str, numbers: &str) -> String {
    if numbers.is_empty() { format!("{what}: {name}") } else { format!("{what}: {name} ({numbers})") }
}

/// Each effect of a sealed file as `EFFECT at PLACE`, and its numbers as they are written.
fn hidden_effects(sealed: &str) -> Vec<(String, String)> {
    let mut effects: Vec<(String, String)> = Vec::new();
    let mut in_effect = false;
    for line in sealed.lines() {
        if line.starts_with('[') {
            let table =
                line.strip_prefix("[effects.").and_then(|table| table.strip_suffix(']')?.split_once('.'));
            in_effect = table.is_some();
            effects.extend(table.map(|(effect, place)| (format!("{effect} at {place}"), String::new())));
        } else if let (true, Some((key, value)), Some((_, numbers))) =
            (in_effect, line.split_once(" = "), effects.last_mut())
        {
            let separator = if numbers.is_empty() { "" } else { ", " };
            *numbers += &format!("{separator}{key} {value}");
        }
    }
    effects
}

impl Effect {
    fn name(&self) -> String {
        let element = self.place.element.as_ref().map(|element| format!(".{element}")).unwrap_or_default();
        format!("{} at {}{element}", self.effect, self.place.axis.as_deref().unwrap_or_default())
    }

    fn numbers(&self) -> String {
        let written = |parameter: &Parameter| {
            let error = parameter.standard_error.map(|error| format!(" +- {}", significant(error, 2)));
            let unit = parameter.unit.as_ref().filter(|unit| !unit.is_empty()).map(|unit| format!(" {unit}"));
            let value = significant(parameter.value?, 4);
            Some(format!(
                "{} {value}{}{}",
                parameter.name,
                error.unwrap_or_default(),
                unit.unwrap_or_default()
            ))
        };
        self.parameters.iter().map_while(written).collect::<Vec<_>>().join(", ")
    }
}

/// A number with so many significant digits, without zeros at its end; with an exponent where it is far from 1.
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
    fn effects_of_a_sealed_file_are_told_with_their_numbers() {
        let sealed = "seed = 9\n\n[effects.piston-leakage.load]\nleakage_nl_per_min = 5.89\nshare = 0.5\n\n[effects.a.drive.x]\n";
        let expected =
            [("piston-leakage at load", "leakage_nl_per_min 5.89, share 0.5"), ("a at drive.x", "")];
        assert_eq!(
            hidden_effects(sealed),
            expected.map(|(name, numbers)| (name.to_owned(), numbers.to_owned()))
        );
    }
}
