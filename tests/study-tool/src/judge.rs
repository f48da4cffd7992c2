//! One case: what was hidden against what was named.
//!
//! An effect's *class* are all (effect, place) whose signature in this very record is more than 0.95 alike
//! ([`super::classes`]), and itself. The rules:
//!
//! - A name is *right* when it is of the class, and at most two names stand beside those that are. Said as `ambiguous`, it is
//!   right only where the class has more than one effect, when one of its alternatives or itself is of the class, and at most
//!   two of them lie beyond it.
//! - It is right *alone* when it is the only one, has no alternatives, and is the effect itself.
//! - `where` is right when the name's place is that of the truth, or effect and place are of the class.
//! - With several effects hidden, each name can stand for one class only; names that stand for none are too many.
//! - With nothing hidden every name is a false alarm, and so is `outside-catalogue`; a parameter is none.

use crate::classes::{Member, TWIN_COSINE};
use crate::draws::{Draw, Kind};
use crate::program::{Ended, Taken};
use crate::report::{Named, Report, Verdict};
use plant::effects::sheet::Place;
use record_maker::Hidden;
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;

/// Most alternatives of an ambiguous verdict that may lie beyond the class.
const MOST_BEYOND: usize = 2;

#[derive(Debug, Clone, Serialize)]
pub struct Judgement {
    /// What it was called: an effect, or `nothing`, `parameter`, `outside`, `ambiguous`, `error`.
    pub called: String,
    pub error: Option<String>,
    /// For each hidden effect whether a name of its class was there, and at the right place.
    pub hidden: Vec<HiddenJudged>,
    /// Whether the first name is the one hidden effect itself.
    pub top: bool,
    pub alone: bool,
    /// Whether something was said to be outside the catalogue and to resemble the one hidden effect, or one of its class.
    pub resembled: bool,
    /// Names that stand for nothing hidden.
    pub too_many: usize,
    /// With nothing hidden: whether anything was called missing.
    pub false_alarm: bool,
    /// With one parameter off and nothing hidden: whether it was reported, and nothing else called missing.
    pub parameter_right: bool,
    /// Share of the gap that the program claims to have closed, the worst signal.
    pub claimed_closed_ratio: Option<f64>,
    /// The same of all signals together, each in units of its noise.
    pub claimed_joint_ratio: Option<f64>,
    /// Whether the program claims that its model leaves no more on the held-out record than nothing missing would.
    pub claimed_white: Option<bool>,
}

#[derive(Debug, Clone, Serialize)]
pub struct HiddenJudged {
    pub effect: &'static str,
    #[serde(rename = "where", serialize_with = "as_text")]
    pub place: Place,
    pub class_size: usize,
    pub right: bool,
    pub where_right: bool,
    /// Its numbers against the truth, when the effect itself was named at its place.
    pub numbers: Vec<NumberJudged>,
}

#[derive(Debug, Clone, Serialize)]
pub struct NumberJudged {
    pub name: &'static str,
    pub amplitude: bool,
    /// |fitted - true| / |true|.
    pub off_ratio: f64,
    /// Standard error / |true|.
    pub error_ratio: Option<f64>,
    pub covered: Option<bool>,
}

fn as_text<S: Serializer>(place: &Place, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(place)
}

/// Judges what a program said about a draw, given the class of each of its hidden effects.
pub fn judge(
    draw: &Draw,
    classes: &[Vec<Member>],
    taken: &Taken,
    report: &Result<Report, String>,
) -> Judgement {
    let error = match (taken.ended, report) {
        (Ended::TimedOut, _) => Some("took longer than its time limit".to_owned()),
        (Ended::Signalled(signal), _) => Some(format!("crashed with signal {signal}")),
        (Ended::NotStarted, _) => Some("could not be started".to_owned()),
        (Ended::Exited(code), Err(reason)) => Some(format!("{reason} (exit code {code})")),
        (Ended::Exited(_), Ok(report)) if report.verdict == Verdict::BadData => Some("bad-data".to_owned()),
        (Ended::Exited(_), Ok(_)) => None,
    };
    let good = if error.is_none() { report.as_ref().ok() } else { None };
    let empty = Vec::new();
    let class = |at: usize| classes.get(at).unwrap_or(&empty);
    let hidden = &draw.recipe.hidden;
    let mut matched = good.map_or_else(Vec::new, |report| matching(report, hidden, &class));
    if good.is_some_and(|report| report.named.len() > matched.len() + MOST_BEYOND) {
        // Whoever names everything has named nothing.
        matched.clear();
    }
    let judged = hidden.iter().enumerate().map(|(at, hidden)| {
        let name = matched.iter().find(|(_, of)| *of == at).map(|(name, _)| *name);
        hidden_judged(hidden, class(at), name)
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

/// Whether the one wrong parameter is among those reported.
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

/// Names of effects in a class, the true one included.
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
    // Of several names an ambiguous verdict may be sure of one.
    if verdict != Verdict::Ambiguous || entry.alternatives.is_empty() && !alone {
        return of_class(entry).then_some(entry);
    }
    let all = || std::iter::once(entry).chain(&entry.alternatives);
    let beyond = all().filter(|name| !of_class(name)).count();
    if effects.len() < 2 || beyond > MOST_BEYOND {
        return None;
    }
    // The one at the right place, if there is one.
    let at_place = |name: &&Named| of_class(name) && place_right(name, hidden, class);
    all().find(at_place).or_else(|| all().find(|name| of_class(name)))
}

fn place_right(name: &Named, hidden: &Hidden, class: &[Member]) -> bool {
    let own = name.sheet.name == hidden.name && name.place == hidden.place;
    let twin = |member: &Member| {
        member.is_twin() && member.effect == name.sheet.name && member.place == name.place.to_string()
    };
    own || class.iter().any(twin)
}

/// Which name stands for which hidden effect: the assignment that serves most, and among those most right places.
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
        let Some(own) = options.get(at) else { return (0, Vec::new()) };
        let mut best = assign(options, at + 1, used);
        for (entry, option) in own.iter().enumerate().take(64) {
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
        .map(|(at, own)| {
            let option = |entry| {
                let name = stands_for(entry, report, own, class(at), hidden.len() == 1)?;
                Some((name, place_right(name, own, class(at))))
            };
            report.named.iter().map(option).collect()
        })
        .collect();
    assign(&options, 0, 0).1
}

fn hidden_judged(hidden: &Hidden, class: &[Member], name: Option<&Named>) -> HiddenJudged {
    let own = name.filter(|name| name.sheet.name == hidden.name && name.place == hidden.place);
    let keys = plant::effects::sheet(hidden.name).map_or(&[][..], |sheet| sheet.keys);
    let mut numbers = Vec::new();
    for (at, (key, truth)) in keys.iter().zip(&hidden.numbers).enumerate() {
        let reported = own.and_then(|name| name.parameters.iter().find(|reported| reported.name == key.name));
        // A number in another unit is not reported at all; relative to nothing there is no error.
        let Some(reported) = reported.filter(|reported| reported.unit == key.unit.name() && *truth != 0.0)
        else {
            continue;
        };
        let off = (reported.value - truth).abs();
        let error = reported.standard_error.filter(|error| *error >= 0.0);
        numbers.push(NumberJudged {
            name: key.name,
            amplitude: at == 0,
            off_ratio: off / truth.abs(),
            error_ratio: error.map(|error| error / truth.abs()),
            covered: error.map(|error| off <= 2.0 * error),
        });
    }
    HiddenJudged {
        effect: hidden.name,
        place: hidden.place,
        class_size: effects(hidden, class).len(),
        right: name.is_some(),
        where_right: name.is_some_and(|name| place_right(name, hidden, class)),
        numbers,
    }
}

impl Member {
    /// Whether it is in the class, and no parameter of the baseline.
    pub fn is_twin(&self) -> bool {
        self.cosine > TWIN_COSINE && !self.effect.starts_with("parameter:")
    }
}

#[cfg(test)]
pub(crate) mod tests;
