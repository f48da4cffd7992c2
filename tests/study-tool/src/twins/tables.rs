//! Results of a program on twins: its report on the record, and whether the experiment that it proposed distinguished them.

use super::Twins;
use super::certificate::probability;
use crate::SCHEMA_VERSION;
use crate::compare::{grid, reported};
use crate::draws::Draw;
use crate::folder::{FolderError, Study};
use crate::interval::Rate;
use crate::program::{Execution, Identity};
use crate::report::{self, Report};
use crate::resolve::{self, Outcome, ambiguous, judge, leaves_open};
use crate::step::read_result;
use crate::target::{self, Target};
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// Targets for all twins, in the exact world and with a background.
const WANTED: [Target; 2] = [Target::AtLeast(80), Target::AtLeast(70)];

/// Judgement of the report on the first record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum FirstAnswer {
    /// The truth is among names that explain the record alike.
    Ambiguous,
    /// One name, the true one.
    Right,
    /// The truth is named together with another effect, or something outside the catalogue is missing too.
    NotAlone,
    /// Names without the truth, no ambiguity.
    Wrong,
    /// Ambiguous names without the truth.
    TruthNotAmong,
    NoName,
    Error,
}

/// One twin in one world.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Case {
    pub(crate) number: usize,
    pub(crate) background: bool,
    pub(crate) hidden: String,
    pub(crate) rival: String,
    pub(crate) first: FirstAnswer,
    /// Whether the rival is among the names of the first report.
    pub(crate) rival_named: bool,
    /// Names of the first and second report, alternatives in brackets.
    pub(crate) named: [Vec<String>; 2],
    pub(crate) experiment: Option<String>,
    /// The best experiment of the certificate, and the share of right decisions of an oracle with it.
    pub(crate) certified: Option<(String, f64)>,
    /// Of an ambiguous one whose proposed experiment was run; `None` where none was proposed.
    pub(crate) outcome: Option<Outcome>,
    /// Whether the rival is among the names of the second report.
    pub(crate) rival_left: bool,
    pub(crate) problem: Option<String>,
    pub(crate) wall_s: f64,
}

/// Results of the twins of a folder, as `twins-LABEL.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Table {
    pub(crate) schema_version: u32,
    pub(crate) label: String,
    pub(crate) program: Option<Identity>,
    pub(crate) seed: u64,
    pub(crate) cases: Vec<Case>,
}

impl Table {
    /// Collects the table of the results so far.
    pub fn of(twins: &Twins, root: &Path, label: &str) -> Result<Self, FolderError> {
        let study = twins.study(root);
        let resolved = resolve::Table::of(&study, label)?;
        let mut cases = Vec::new();
        for draw in study.draws.iter().filter(|draw| study.run(label, draw.number).exists()) {
            cases.push(case(twins, &study, label, draw, &resolved)?);
        }
        let (label, seed) = (label.to_owned(), twins.seed);
        Ok(Table { schema_version: SCHEMA_VERSION, label, program: resolved.program, seed, cases })
    }

    pub fn markdown(&self) -> String {
        let program = self.program.as_ref().map_or_else(|| "no program".to_owned(), Identity::reported);
        let mut text = format!("{} ({program}), twins of seed {}.\n\n", self.label, self.seed);
        let heads = ["", "exact world", "wanted", "background", "wanted"].map(str::to_owned);
        text.push_str(&grid(&heads, self.rows()));
        text.push('\n');
        let heads = [
            "twin",
            "hidden",
            "rival",
            "best of the certificate",
            "at first",
            "proposed",
            "then",
            "named at last",
        ];
        text.push_str(&grid(&heads.map(str::to_owned), self.cases.iter().map(Case::cells)));
        text
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let row =
            |what: &str, of: &dyn Fn(&Case) -> bool, is: &dyn Fn(&Case) -> bool, wanted: [Target; 2]| {
                let cells = |background: bool, wanted: Target| {
                    let cases = self.cases.iter().filter(|case| case.background == background && of(case));
                    let rate = Rate::of(cases, is);
                    let outcome = target::Outcome::of(&rate, wanted);
                    let wanted = outcome.map_or_else(String::new, |outcome| format!("{wanted}: {outcome}"));
                    [reported(&rate), wanted]
                };
                let [exact, beside] = [cells(false, wanted[0]), cells(true, wanted[1])];
                [&[what.to_owned()][..], &exact[..], &beside[..]].concat()
            };
        let all = |_: &Case| true;
        let open = |case: &Case| case.first == FirstAnswer::Ambiguous;
        let first = |first: FirstAnswer| move |case: &Case| case.first == first;
        let then = |outcome: Outcome| move |case: &Case| case.outcome == Some(outcome);
        let none = [Target::Component; 2];
        let right_at_last =
            |case: &Case| case.first == FirstAnswer::Right || case.outcome == Some(Outcome::Resolved);
        vec![
            row("of all: the right one named at the end", &all, &right_at_last, WANTED),
            row("ambiguous at first, the truth among the names", &all, &open, none),
            row("of these: the rival among the names", &open, &|case| case.rival_named, none),
            row("of these: told apart by the proposed experiment", &open, &then(Outcome::Resolved), none),
            row("of these: still ambiguous", &open, &then(Outcome::StillAmbiguous), none),
            row(
                "of these: still ambiguous, the rival gone",
                &open,
                &|case| case.outcome == Some(Outcome::StillAmbiguous) && !case.rival_left,
                none,
            ),
            row("of these: the truth gone", &open, &then(Outcome::Wrong), none),
            row("of these: no good report", &open, &then(Outcome::Error), none),
            row("of these: no experiment proposed", &open, &|case| case.experiment.is_none(), none),
            row("right name at once", &all, &first(FirstAnswer::Right), none),
            row("right name at once, not alone", &all, &first(FirstAnswer::NotAlone), none),
            row("wrong name at once", &all, &first(FirstAnswer::Wrong), none),
            row("ambiguous without the truth", &all, &first(FirstAnswer::TruthNotAmong), none),
            row("no name", &all, &first(FirstAnswer::NoName), none),
            row("no good report", &all, &first(FirstAnswer::Error), none),
        ]
    }
}

impl Case {
    fn cells(&self) -> Vec<String> {
        let best = self.certified.as_ref().map(|(name, share)| format!("{name} {:.0} %", 1e2 * share));
        vec![
            format!("{}{}", self.number, if self.background { ", background" } else { "" }),
            self.hidden.clone(),
            self.rival.clone(),
            best.unwrap_or_default(),
            [&[word(self.first)][..], &self.named[0][..]].concat().join("; "),
            self.experiment.clone().unwrap_or_default(),
            self.outcome.map(word).unwrap_or_default(),
            self.named[1].join("; "),
        ]
    }
}

/// The word of a value in `twins-LABEL.json`.
fn word(value: impl Serialize) -> String {
    json!(value).as_str().unwrap_or_default().to_owned()
}

fn case(
    twins: &Twins,
    study: &Study,
    label: &str,
    draw: &Draw,
    resolved: &resolve::Table,
) -> Result<Case, FolderError> {
    let (number, folder) = (draw.number, study.run(label, draw.number));
    let twin = twins.of_draw(number).expect("a draw of these twins");
    let taken = read_result(&folder.join("result.json"))?.taken;
    let report = report::read(&folder.join("report.json"));
    let then = resolved.cases.iter().find(|case| case.number == number);
    let with_both = report::read(&study.run(&resolve::label(label), number).join("report.json")).ok();
    let listed = |report: Option<&Report>| -> Vec<String> {
        report.iter().flat_map(|report| &report.named).map(resolve::tables::with_alternatives).collect()
    };
    let has_rival = |report: Option<&Report>| {
        let all = report.into_iter().flat_map(|report| &report.named).flat_map(resolve::names);
        all.map(resolve::tables::titled).any(|name| name == twin.rival.title())
    };
    Ok(Case {
        number,
        background: draw.recipe.background.is_some(),
        hidden: twin.hidden.title(),
        rival: twin.rival.title(),
        first: first(draw, &taken, &report),
        rival_named: has_rival(report.as_ref().ok()),
        named: [listed(report.as_ref().ok()), listed(with_both.as_ref())],
        experiment: then.and_then(|case| case.experiment.clone()),
        certified: twin.best().map(|(name, distance)| (name.to_owned(), probability(distance))),
        outcome: then.and_then(|case| case.outcome),
        rival_left: has_rival(with_both.as_ref()),
        problem: then.and_then(|case| case.problem.clone()),
        wall_s: taken.wall_s,
    })
}

/// Judges the report on the record of a twin.
pub(super) fn first(draw: &Draw, taken: &Execution, report: &Result<Report, String>) -> FirstAnswer {
    match (judge(&draw.recipe.hidden[0], taken, report), report) {
        (Outcome::Error, _) | (_, Err(_)) => FirstAnswer::Error,
        (_, Ok(report)) if ambiguous(draw, report).is_some() => FirstAnswer::Ambiguous,
        (Outcome::Resolved, _) => FirstAnswer::Right,
        (Outcome::StillAmbiguous, _) => FirstAnswer::NotAlone,
        (_, Ok(report)) if report.named.is_empty() => FirstAnswer::NoName,
        (_, Ok(report)) if leaves_open(report) => FirstAnswer::TruthNotAmong,
        _ => FirstAnswer::Wrong,
    }
}
