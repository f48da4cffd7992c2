//! Table of all ambiguous draws of a label: what the proposed experiments resolve, class by class.

use super::{Outcome, ambiguous, judge, label, leaves_open, names, read_resolution};
use crate::SCHEMA_VERSION;
use crate::compare::{grid, reported};
use crate::draws::{Draw, Kind, Shape};
use crate::folder::{FolderError, Study};
use crate::interval::Rate;
use crate::program::Identity;
use crate::report::{self, Named, Report};
use crate::step::read_result;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;

/// Target of the share that an experiment resolves.
const WANTED: &str = "at least 80 %";

/// Outcomes of the ambiguous draws of a label, as `resolve-LABEL.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Table {
    pub(crate) schema_version: u32,
    pub(crate) label: String,
    /// The program; `None` without results.
    pub(crate) program: Option<Identity>,
    pub(crate) seed: u64,
    pub(crate) shape: Shape,
    pub(crate) singles: usize,
    /// Draws of one effect whose report is ambiguous.
    pub(crate) open: usize,
    /// Those of the ambiguous ones whose truth is not among the names: not considered further.
    pub(crate) truth_not_among: usize,
    /// Class by class, the most frequent first.
    pub(crate) classes: Vec<Class>,
    pub(crate) all: Class,
    pub(crate) cases: Vec<Case>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Case {
    pub(crate) number: usize,
    pub(crate) truth: String,
    /// Names that were not distinguished, each with its place, the best first.
    pub(crate) between: Vec<String>,
    pub(crate) class: String,
    /// The measurement that would distinguish them where no experiment does.
    pub(crate) otherwise: Option<String>,
    /// The proposed experiment; `None` where none distinguishes them.
    pub(crate) experiment: Option<String>,
    /// Its outcome; `None` where none was proposed, or it was not run yet.
    pub(crate) outcome: Option<Outcome>,
    /// Why it was not run, or why there is no good report.
    pub(crate) problem: Option<String>,
    /// Names of the report on both records, alternatives in brackets.
    pub(crate) named: Vec<String>,
}

/// The draws that left the same effects ambiguous.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Class {
    /// The effects, in alphabetical order.
    pub(crate) name: String,
    pub(crate) ambiguous: usize,
    /// Draws for which no experiment is proposed.
    pub(crate) no_experiment: usize,
    /// Measurements that would distinguish these, and how often each was named.
    pub(crate) otherwise: BTreeMap<String, usize>,
    pub(crate) experiments: BTreeMap<String, usize>,
    /// Resolved ones of the proposed experiments that were run.
    pub(crate) resolved: Rate,
    pub(crate) still_ambiguous: usize,
    pub(crate) wrong: usize,
    pub(crate) errors: usize,
    pub(crate) not_run: usize,
}

impl Table {
    /// Collects the table of the results so far.
    pub fn of(study: &Study, run_label: &str) -> Result<Self, FolderError> {
        let (mut singles, mut open, mut program, mut cases) = (0, 0, None, Vec::new());
        for draw in study.draws.iter().filter(|draw| draw.kind == Kind::Single) {
            let folder = study.run(run_label, draw.number);
            if !folder.exists() {
                continue;
            }
            singles += 1;
            program = Some(read_result(&folder.join("result.json"))?.program);
            let Ok(report) = report::read(&folder.join("report.json")) else { continue };
            open += usize::from(leaves_open(&report));
            if let Some(entry) = ambiguous(draw, &report) {
                cases.push(case(study, run_label, draw, (&report, entry))?);
            }
        }
        let mut classes: BTreeMap<&str, Vec<&Case>> = BTreeMap::new();
        for case in &cases {
            classes.entry(&case.class).or_default().push(case);
        }
        let mut classes: Vec<Class> =
            classes.into_iter().map(|(name, cases)| Class::of(name, &cases)).collect();
        classes.sort_by_key(|class| std::cmp::Reverse(class.ambiguous));
        Ok(Table {
            schema_version: SCHEMA_VERSION,
            label: run_label.to_owned(),
            program,
            seed: study.plan.seed,
            shape: study.plan.shape,
            singles,
            open,
            truth_not_among: open - cases.len(),
            classes,
            all: Class::of("all", &cases.iter().collect::<Vec<_>>()),
            cases,
        })
    }

    /// The table in Markdown, with a heading line.
    pub fn markdown(&self) -> String {
        let identity = self.program.as_ref().map_or("no program".to_owned(), Identity::reported);
        let mut text = String::new();
        let _ = writeln!(
            text,
            "{} ({identity}), seed {}: of {} draws of one effect {} were left ambiguous, in {} of them without the truth among \
             the names; of the rest:\n",
            self.label, self.seed, self.singles, self.open, self.truth_not_among
        );
        let heads = [
            "not told apart",
            "draws",
            "no experiment can",
            "what would",
            "proposed",
            "resolved of those run",
            "still ambiguous",
            "wrong",
            "error",
            "not run",
        ]
        .map(str::to_owned);
        text.push_str(&grid(&heads, self.classes.iter().chain([&self.all]).map(Class::cells)));
        let _ = writeln!(text, "\nWanted: {WANTED} of those that an experiment can resolve, class by class.");
        text
    }
}

impl Class {
    fn of(name: &str, cases: &[&Case]) -> Self {
        let count = |is: &dyn Fn(&Case) -> bool| cases.iter().filter(|case| is(case)).count();
        let ended = |outcome| count(&|case| case.outcome == Some(outcome));
        let tally = |of: &dyn Fn(&Case) -> Option<String>| {
            let mut tally = BTreeMap::new();
            for reported in cases.iter().filter_map(|case| of(case)) {
                *tally.entry(reported).or_default() += 1;
            }
            tally
        };
        let is_none = |case: &Case| case.experiment.is_none();
        let run = count(&|case| case.outcome.is_some());
        Class {
            name: name.to_owned(),
            ambiguous: cases.len(),
            no_experiment: count(&is_none),
            otherwise: tally(&|case| case.otherwise.clone().filter(|_| is_none(case))),
            experiments: tally(&|case| case.experiment.clone()),
            resolved: Rate::new(ended(Outcome::Resolved), run),
            still_ambiguous: ended(Outcome::StillAmbiguous),
            wrong: ended(Outcome::Wrong),
            errors: ended(Outcome::Error),
            not_run: count(&|case| case.experiment.is_some() && case.outcome.is_none()),
        }
    }

    fn cells(&self) -> Vec<String> {
        let listed = |tally: &BTreeMap<String, usize>| {
            tally.iter().map(|(what, count)| format!("{what} ({count})")).collect::<Vec<_>>().join("; ")
        };
        // For all classes together the list would be as long as the table.
        let all = |text: String| if self.name == "all" { String::new() } else { text };
        let proposed: usize = self.experiments.values().sum();
        vec![
            self.name.clone(),
            self.ambiguous.to_string(),
            self.no_experiment.to_string(),
            all(listed(&self.otherwise)),
            if self.name == "all" { proposed.to_string() } else { listed(&self.experiments) },
            reported(&self.resolved),
            self.still_ambiguous.to_string(),
            self.wrong.to_string(),
            self.errors.to_string(),
            self.not_run.to_string(),
        ]
    }
}

fn case(
    study: &Study,
    run_label: &str,
    draw: &Draw,
    (report, entry): (&Report, &Named),
) -> Result<Case, FolderError> {
    let hidden = &draw.recipe.hidden[0];
    let next = report.next.clone().unwrap_or_default();
    let mut case = Case {
        number: draw.number,
        truth: format!("{} {}", hidden.name, hidden.place),
        between: names(entry).map(titled).collect(),
        class: class(entry),
        otherwise: next.otherwise,
        experiment: report.proposed().map(str::to_owned),
        outcome: None,
        problem: None,
        named: Vec::new(),
    };
    let folder = study.run(&label(run_label), draw.number);
    if !folder.exists() || case.experiment.is_none() {
        return Ok(case);
    }
    let resolution = read_resolution(&folder.join("resolution.json"))?;
    let report = report::read(&folder.join("report.json"));
    case.outcome = Some(resolution.taken.map_or(Outcome::Error, |taken| judge(hidden, &taken, &report)));
    case.problem = resolution.problem.or_else(|| {
        let reported = fs::read_to_string(folder.join("stderr.txt")).unwrap_or_default();
        let last = reported.lines().last().unwrap_or_default();
        report.as_ref().err().map(|error| format!("{error}: {last}"))
    });
    case.named = report.iter().flat_map(|report| &report.named).map(with_alternatives).collect();
    Ok(case)
}

/// The effects of an entry and its alternatives; one alone means the same effect at another place.
fn class(entry: &Named) -> String {
    let effects: BTreeSet<&str> = names(entry).map(|name| name.sheet.name).collect();
    match effects.iter().collect::<Vec<_>>()[..] {
        [one] => format!("{one} at another place"),
        _ => effects.into_iter().collect::<Vec<_>>().join(", "),
    }
}

pub(crate) fn titled(name: &Named) -> String {
    format!("{} {}", name.sheet.name, name.place)
}

pub(crate) fn with_alternatives(entry: &Named) -> String {
    let others: Vec<_> = entry.alternatives.iter().map(titled).collect();
    if others.is_empty() { titled(entry) } else { format!("{} [{}]", titled(entry), others.join(", ")) }
}
