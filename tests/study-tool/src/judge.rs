//! Judgement of one case: what was hidden against what was named.
//!
//! The *class* of an effect is the effect itself and all (effect, place) whose signature in this record has a cosine above 0.95
//! with its own ([`super::classes`]). The rules:
//!
//! - A name is *right* when it is of the class, and at most two names beside the right ones are reported. An `ambiguous` verdict
//!   is right only where the class has more than one effect, when the name or one of its alternatives is of the class, and at
//!   most two of them are not.
//! - A name is right *alone* when it is the only one, has no alternatives, and is the effect itself.
//! - `where` is right when the name's place is the true one, or effect and place are of the class.
//! - With several effects hidden, each name is assigned to one class only; names without a class are too many.
//! - With nothing hidden every name is a false alarm, and so is `outside-catalogue`; a parameter is not.

use crate::classes::{Member, TWIN_COSINE};
use crate::draws::{Draw, Kind};
use crate::program::{Execution, ProgramEnd};
use crate::report::{Named, Report, Verdict};
use plant::effects::sheet::Place;
use record_maker::Hidden;
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;

/// Most alternatives of an ambiguous verdict that may lie outside the class.
const MOST_BEYOND: usize = 2;

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Judgement {
    /// The verdict in one word: an effect, or `nothing`, `parameter`, `outside`, `ambiguous`, `error`.
    pub(crate) called: String,
    pub(crate) error: Option<String>,
    /// For each hidden effect whether a name of its class was reported, and at the right place.
    pub(crate) hidden: Vec<HiddenJudgement>,
    /// Whether the first name is the one hidden effect itself.
    pub(crate) top: bool,
    pub(crate) alone: bool,
    /// Whether the verdict was outside the catalogue, with the hidden effect or one of its class as the nearest.
    pub(crate) resembled: bool,
    /// Names that are assigned to no hidden effect.
    pub(crate) too_many: usize,
    /// With nothing hidden: whether anything was reported as missing.
    pub(crate) false_alarm: bool,
    /// With one parameter wrong and nothing hidden: whether it was reported, and nothing reported as missing.
    pub(crate) parameter_right: bool,
    /// Share of the gap that the program claims to have closed, of the worst signal.
    pub(crate) claimed_closed_ratio: Option<f64>,
    /// The same for all signals together, each in units of its noise.
    pub(crate) claimed_joint_ratio: Option<f64>,
    /// Whether the program claims that the residual of its model on the held-out record is within the range of a complete
    /// model.
    pub(crate) claimed_white: Option<bool>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct HiddenJudgement {
    pub(crate) effect: &'static str,
    #[serde(rename = "where", serialize_with = "as_text")]
    pub(crate) place: Place,
    pub(crate) class_size: usize,
    pub(crate) right: bool,
    pub(crate) where_right: bool,
    /// Its numbers against the truth, if the effect itself was named at its place.
    pub(crate) numbers: Vec<NumberJudgement>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct NumberJudgement {
    pub(crate) name: &'static str,
    pub(crate) amplitude: bool,
    /// |fitted - true| / |true|.
    pub(crate) off_ratio: f64,
    /// Standard error / |true|.
    pub(crate) error_ratio: Option<f64>,
    pub(crate) covered: Option<bool>,
}

fn as_text<S: Serializer>(place: &Place, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(place)
}

/// Judges the report of a program on a draw, given the class of each of its hidden effects.
pub(crate) fn judge(
    draw: &Draw,
    classes: &[Vec<Member>],
    taken: &Execution,
    report: &Result<Report, String>,
) -> Judgement {
    let error = match (taken.ended, report) {
        (ProgramEnd::TimedOut, _) => Some("took longer than its time limit".to_owned()),
        (ProgramEnd::Signalled(signal), _) => Some(format!("crashed with signal {signal}")),
        (ProgramEnd::NotStarted, _) => Some("could not be started".to_owned()),
        (ProgramEnd::Exited(code), Err(reason)) => Some(format!("{reason} (exit code {code})")),
        (ProgramEnd::Exited(_), Ok(report)) if report.verdict == Verdict::BadData => {
            Some("bad-data".to_owned())
        }
        (ProgramEnd::Exited(_), Ok(_)) => None,
    };
    let good = if error.is_none() { report.as_ref().ok() } else { None };
    let empty = Vec::new();
    let class = |at: usize| classes.get(at).unwrap_or(&empty);
    let hidden = &draw.recipe.hidden;
    let mut matched = good.map_or_else(Vec::new, |report| matching(report, hidden, &class));
    if good.is_some_and(|report| report.named.len() > matched.len() + MOST_BEYOND) {
        // A report that names everything distinguishes no effect.
        matched.clear();
    }
    let judged = hidden.iter().enumerate().map(|(at, hidden)| {
        let name = matched.iter().find(|(_, of)| *of == at).map(|(name, _)| *name);
        judge_hidden(hidden, class(at), name)
    });
    let names = good.map_or(&[][..], |report| &report.named);
    let first = names.first();
    let single = if draw.kind == Kind::Single { hidden.first() } else { None };
    let top = single.is_some_and(|hidden| first.is_some_and(|name| name.sheet.name == hidden.name));
    let verdict = good.map(|report| report.verdict);
    let missing = matches!(verdict, Some(Verdict::Named | Verdict::Ambiguous | Verdict::OutsideCatalogue));
    Judgement {
        called: called(verdict, first),
        error,
        hidden: judged.collect(),
        top,
        alone: top && verdict == Some(Verdict::Named) && names.len() == 1 && names[0].alternatives.is_empty(),
        resembled: single.is_some_and(|hidden| {
            let nearest = good.and_then(|report| report.nearest.as_ref());
            verdict == Some(Verdict::OutsideCatalogue)
                && nearest.is_some_and(|name| effects(hidden, class(0)).contains(name.sheet.name))
        }),
        too_many: names.len() - matched.len(),
        false_alarm: hidden.is_empty() && missing,
        parameter_right: draw.kind == Kind::Parameter
            && !missing
            && good.is_some_and(|report| reported(report, draw)),
        claimed_closed_ratio: good.and_then(Report::claimed_closed),
        claimed_joint_ratio: good.and_then(Report::claimed_joint),
        claimed_white: good.and_then(Report::claimed_white),
    }
}

/// Whether the wrong parameter is among those reported.
fn reported(report: &Report, draw: &Draw) -> bool {
    draw.recipe
        .wrong_parameters
        .iter()
        .all(|(name, _)| report.parameters.iter().any(|reported| reported.name == *name))
}

fn called(verdict: Option<Verdict>, first: Option<&Named>) -> String {
    match verdict {
        None | Some(Verdict::BadData) => "error",
        Some(Verdict::NothingMissing) => "nothing",
        Some(Verdict::ParametersOnly) => "parameter",
        Some(Verdict::OutsideCatalogue) => "outside",
        Some(Verdict::Ambiguous) => "ambiguous",
        Some(Verdict::Named) => first.map_or("error", |name| name.sheet.name),
    }
    .to_owned()
}

/// Names of the effects of a class, the true one included.
fn effects<'a>(hidden: &'a Hidden, class: &'a [Member]) -> BTreeSet<&'a str> {
    class
        .iter()
        .filter(|member| member.is_twin())
        .map(|member| member.effect.as_str())
        .chain([hidden.name])
        .collect()
}

/// The name of a class within an entry of the report; `None` when the entry does not stand for the class.
fn stands_for<'a>(
    entry: &'a Named,
    report: &Report,
    hidden: &Hidden,
    class: &[Member],
    alone: bool,
) -> Option<&'a Named> {
    let verdict = report.verdict;
    let effects = effects(hidden, class);
    let of_class = |name: &Named| effects.contains(name.sheet.name);
    // Of several names, an ambiguous verdict may have single ones without alternatives.
    if verdict != Verdict::Ambiguous || entry.alternatives.is_empty() && !alone {
        return of_class(entry).then_some(entry);
    }
    let all = || std::iter::once(entry).chain(&entry.alternatives);
    let beyond = all().filter(|name| !of_class(name)).count();
    if effects.len() < 2 || beyond > MOST_BEYOND {
        return None;
    }
    // Prefers the one at the right place.
    let at_place = |name: &&Named| of_class(name) && place_right(name, hidden, class);
    all().find(at_place).or_else(|| all().find(|name| of_class(name)))
}

fn place_right(name: &Named, hidden: &Hidden, class: &[Member]) -> bool {
    is_of_class(name.sheet.name, &name.place.to_string(), hidden, class)
}

/// Whether an effect at a place is the hidden one, or one of its class.
pub(crate) fn is_of_class(effect: &str, place: &str, hidden: &Hidden, class: &[Member]) -> bool {
    let twin = |member: &Member| member.is_twin() && member.effect == effect && member.place == place;
    effect == hidden.name && place == hidden.place.to_string() || class.iter().any(twin)
}

/// Assigns names to hidden effects: most effects, and among those assignments most right places.
fn matching<'a>(
    report: &'a Report,
    hidden: &[Hidden],
    class: &dyn Fn(usize) -> &'a Vec<Member>,
) -> Vec<(&'a Named, usize)> {
    /// Assigns the hidden effects from `at` on to the names that are left.
    fn assign<'a>(
        options: &[Vec<Option<(&'a Named, bool)>>],
        at: usize,
        used: u64,
    ) -> (usize, Vec<(&'a Named, usize)>) {
        let Some(row) = options.get(at) else { return (0, Vec::new()) };
        let mut best = assign(options, at + 1, used);
        for (entry, option) in row.iter().enumerate().take(64) {
            let Some((name, place)) = option else { continue };
            if used & (1 << entry) == 0 {
                let (worth, mut rest) = assign(options, at + 1, used | 1 << entry);
                let worth = worth + 2 * 8 + usize::from(*place);
                if worth > best.0 {
                    rest.push((name, at));
                    best = (worth, rest);
                }
            }
        }
        best
    }
    let options: Vec<Vec<_>> = hidden
        .iter()
        .enumerate()
        .map(|(at, effect)| {
            let option = |entry| {
                let name = stands_for(entry, report, effect, class(at), hidden.len() == 1)?;
                Some((name, place_right(name, effect, class(at))))
            };
            report.named.iter().map(option).collect()
        })
        .collect();
    assign(&options, 0, 0).1
}

fn judge_hidden(hidden: &Hidden, class: &[Member], name: Option<&Named>) -> HiddenJudgement {
    let exact = name.filter(|name| name.sheet.name == hidden.name && name.place == hidden.place);
    let keys = plant::effects::sheet(hidden.name).map_or(&[][..], |sheet| sheet.keys);
    let mut numbers = Vec::new();
    for (at, (key, truth)) in keys.iter().zip(&hidden.numbers).enumerate() {
        let reported =
            exact.and_then(|name| name.parameters.iter().find(|reported| reported.name == key.name));
        // A number in another unit does not count as reported; relative to a true 0 there is no error.
        let Some(reported) = reported.filter(|reported| reported.unit == key.unit.name() && *truth != 0.0)
        else {
            continue;
        };
        let off = (reported.value - truth).abs();
        let error = reported.standard_error.filter(|error| *error >= 0.0);
        numbers.push(NumberJudgement {
            name: key.name,
            amplitude: at == 0,
            off_ratio: off / truth.abs(),
            error_ratio: error.map(|error| error / truth.abs()),
            covered: error.map(|error| off <= 2.0 * error),
        });
    }
    HiddenJudgement {
        effect: hidden.name,
        place: hidden.place,
        class_size: effects(hidden, class).len(),
        right: name.is_some(),
        where_right: name.is_some_and(|name| place_right(name, hidden, class)),
        numbers,
    }
}

impl Member {
    /// Whether it is in the class, and not a parameter of the baseline.
    pub(crate) fn is_twin(&self) -> bool {
        self.cosine > TWIN_COSINE && !self.effect.starts_with("parameter:")
    }
}

#[cfg(test)]
pub(crate) mod tests;
