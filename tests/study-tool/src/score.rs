//! Score of a study, from one folder or from several: rates with intervals, confusion matrix, parameters, time.

use crate::classes::{DrawClasses, Member, read_draw};
use crate::draws::{Draw, Kind, Shape, is_beyond_drawn};
use crate::folder::{FolderError, Study, draw_as_json};
use crate::judge::{Judgement, judge};
use crate::leave_out::{self, Expectations, LeaveOutJudgement};
use crate::limits::Limits;
use crate::probability::{self, JudgedExplanation};
use crate::program::Identity;
use crate::report::{self, Report};
use crate::step::{RunResult, read_result};
use discrepancy::report::Quantity;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

pub mod tables;

pub use tables::Tables;

/// Multiple of the limit from which an effect must be named.
pub(crate) const CLEAR: f64 = 3.0;

/// The score of the results under a label.
#[derive(Debug, Serialize)]
pub struct Score {
    pub(crate) schema_version: u32,
    pub(crate) label: String,
    pub(crate) program: Identity,
    pub(crate) seed: u64,
    pub(crate) shape: Shape,
    /// Draws whose classes are not known: there the class is the effect alone.
    pub(crate) without_classes: usize,
    /// Tables over all cases; with effects left out, only those that apply then.
    pub tables: Tables,
    /// Tables of the cases whose hidden effects were left out of the program's catalogue; `None` for the whole catalogue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leave_out: Option<leave_out::Tables>,
    pub(crate) cases: Vec<Case>,
}

/// One draw and the judgement of its result.
#[derive(Debug, Clone, Serialize)]
pub struct Case {
    pub(crate) number: usize,
    pub(crate) kind: Kind,
    pub(crate) recipe: Value,
    /// For each hidden effect its amplitude over the committed limit, or its strength in this record where it has no limit.
    pub(crate) over_limit: Vec<Option<f64>>,
    /// Whether two or more hidden effects are of different classes, each at least three times above its limit.
    pub(crate) separable: bool,
    pub(crate) foreign_form: bool,
    /// Whether the rig has model errors beside what is hidden.
    pub(crate) background: bool,
    /// Whether an amplitude lies beyond its drawn range.
    pub(crate) beyond_drawn: bool,
    pub(crate) wrong_parameters: bool,
    /// Whether its noise is coloured and its sampling jitters.
    pub(crate) coloured_noise: bool,
    pub(crate) judgement: Judgement,
    /// Probabilities of the explanations, and which are right.
    pub(crate) explanations: Vec<JudgedExplanation>,
    /// Chi2 per degree of freedom of the rig file on the held-out record, as reported.
    pub(crate) rig_file_chi2: Option<f64>,
    /// Relative errors of reported parameters of the baseline that the rig file has right.
    pub(crate) parameter_errors: Vec<f64>,
    /// The judgement with the hidden effect left out of the program's catalogue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) left_out: Option<LeaveOutJudgement>,
    pub(crate) wall_s: f64,
    pub(crate) memory_kib: u64,
    /// The command that repeats the run of the program.
    pub(crate) repeat: String,
}

#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("no study to score: give its folder")]
    Empty,
    #[error("{left} and {right} are of different studies: score those of one")]
    DifferentStudies { left: String, right: String },
    #[error(
        "draw {number} has a result in {left} and in {right}: give each folder once, or delete one of them"
    )]
    Duplicate { number: usize, left: String, right: String },
    #[error(
        "{folders}: {count} draws have no result under the label '{label}', the first is {first}: run the study to its end"
    )]
    MissingRuns { folders: String, label: String, count: usize, first: usize },
    #[error("draw {number} was run with {other:?}, the others with {program:?}: score one program at a time")]
    Programs { number: usize, other: Box<Identity>, program: Box<Identity> },
    #[error("effects were left out of the program's catalogue: tests/study/outside-expected.json is wanted")]
    NoExpectations,
}

#[derive(Debug, Clone, Copy)]
pub struct ScoreInputs<'a> {
    /// The committed limits; without them no case has a ratio to its limit.
    pub limits: Option<&'a Limits>,
    /// Classes that are known beforehand, by the number of the draw; others are read from the folder.
    pub classes: Option<&'a BTreeMap<usize, DrawClasses>>,
    /// Where effects that are left out are expected to show; required for such results.
    pub expectations: Option<&'a Expectations>,
    /// Whether draws without a result are skipped; otherwise they are an error.
    pub partly: bool,
}

/// Scores a study whose results are in one folder or in several, as machines without a common disk leave them.
///
/// # Errors
/// [`ScoreError`] when results are missing, duplicate, or of different studies or programs.
pub fn score(folders: &[PathBuf], label: &str, known: ScoreInputs<'_>) -> Result<Score, ScoreError> {
    let studies = folders.iter().map(|folder| Study::open(folder)).collect::<Result<Vec<_>, _>>()?;
    let first = studies.first().ok_or(ScoreError::Empty)?;
    if let Some(other) = studies.iter().find(|study| study.plan != first.plan) {
        return Err(ScoreError::DifferentStudies { left: name(first), right: name(other) });
    }
    let leave_out = leaves_out(&studies, label)?;
    let mut cases = Vec::new();
    let mut program: Option<Identity> = None;
    let mut without_classes = 0;
    for (study, draw) in places(&studies, label, leave_out, known.partly)? {
        let result = read_result(&study.run(label, draw.number).join("result.json"))?;
        let first_program = program.get_or_insert_with(|| result.program.clone());
        if *first_program != result.program {
            let (other, program) = (Box::new(result.program), Box::new(first_program.clone()));
            return Err(ScoreError::Programs { number: draw.number, other, program });
        }
        let classes = classes_of(study, draw, known)?;
        without_classes += usize::from(classes.is_none() && !draw.recipe.hidden.is_empty());
        cases.push(case(study, draw, label, &result, classes.as_ref(), known)?);
    }
    let program = program.ok_or(ScoreError::Empty)?;
    let mut tables = Tables::of(&cases);
    if leave_out {
        // Names do not apply without the effect in the catalogue.
        tables.headline = leave_out::tables::headline(&cases);
        tables.splits.clear();
        tables.effects.clear();
        tables.nothing_hidden.clear();
    }
    Ok(Score {
        schema_version: crate::SCHEMA_VERSION,
        label: label.to_owned(),
        program,
        seed: first.plan.seed,
        shape: first.plan.shape,
        without_classes,
        tables,
        leave_out: leave_out.then(|| leave_out::Tables::of(&cases)),
        cases,
    })
}

/// Judges one draw that has a result under the label.
pub fn one(study: &Study, draw: &Draw, label: &str, known: ScoreInputs<'_>) -> Result<Case, ScoreError> {
    let result = read_result(&study.run(label, draw.number).join("result.json"))?;
    let classes = classes_of(study, draw, known)?;
    case(study, draw, label, &result, classes.as_ref(), known)
}

fn name(study: &Study) -> String {
    study.root.display().to_string()
}

/// The study that has the result of each draw.
fn places<'a>(
    studies: &'a [Study],
    label: &str,
    leave_out: bool,
    partly: bool,
) -> Result<Vec<(&'a Study, &'a Draw)>, ScoreError> {
    let mut places = Vec::new();
    let mut missing = Vec::new();
    // With effects left out, only draws of one effect are run.
    let wanted = |draw: &&Draw| !leave_out || draw.kind == Kind::Single;
    for draw in studies.iter().take(1).flat_map(|study| &study.draws).filter(wanted) {
        let mut with_result = studies.iter().filter(|study| study.run(label, draw.number).exists());
        match (with_result.next(), with_result.next()) {
            (None, _) => missing.push(draw.number),
            (Some(study), None) => places.push((study, draw)),
            (Some(one), Some(other)) => {
                let (left, right) = (name(one), name(other));
                return Err(ScoreError::Duplicate { number: draw.number, left, right });
            }
        }
    }
    let Some(first) = missing.first().filter(|_| !partly) else { return Ok(places) };
    let folders = studies.iter().map(name).collect::<Vec<_>>().join(", ");
    Err(ScoreError::MissingRuns { folders, label: label.to_owned(), count: missing.len(), first: *first })
}

/// Whether the hidden effects were left out, by the first result of any folder.
fn leaves_out(studies: &[Study], label: &str) -> Result<bool, FolderError> {
    let paths = studies
        .iter()
        .flat_map(|study| study.draws.iter().map(|draw| study.run(label, draw.number).join("result.json")));
    let first = paths.into_iter().find(|path| path.exists());
    Ok(first.map(|path| read_result(&path)).transpose()?.is_some_and(|result| result.program.leave_out))
}

fn classes_of(
    study: &Study,
    draw: &Draw,
    known: ScoreInputs<'_>,
) -> Result<Option<DrawClasses>, FolderError> {
    if let Some(classes) = known.classes.and_then(|classes| classes.get(&draw.number)) {
        return Ok(Some(classes.clone()));
    }
    let path = study.class(draw.number);
    if path.exists() { read_draw(&path, draw.number).map(Some) } else { Ok(None) }
}

fn case(
    study: &Study,
    draw: &Draw,
    label: &str,
    result: &RunResult,
    classes: Option<&DrawClasses>,
    known: ScoreInputs<'_>,
) -> Result<Case, ScoreError> {
    let recipe = &draw.recipe;
    let report = report::read(&study.run(label, draw.number).join("report.json"));
    let members: Vec<Vec<Member>> = classes.map_or_else(Vec::new, |classes| {
        classes.hidden.iter().map(|hidden| hidden.members.clone()).collect()
    });
    let over_limit: Vec<_> =
        (0..recipe.hidden.len()).map(|at| over_limit(draw, at, classes, known.limits)).collect();
    let twins = recipe.hidden.iter().enumerate().any(|(at, _)| {
        let others = recipe.hidden.iter().enumerate().filter(|(other, _)| *other != at);
        let class = members.get(at);
        others.into_iter().any(|(_, other)| {
            class.is_some_and(|class| {
                class.iter().any(|member| member.is_twin() && member.effect == other.name)
            })
        })
    });
    let clear = over_limit.iter().all(|ratio| ratio.is_some_and(|ratio| ratio >= CLEAR));
    let judgement = judge(&with_nearest_laws(draw, classes), &members, &result.taken, &report);
    let good = report.as_ref().ok().filter(|_| judgement.error.is_none());
    let left_out = if result.program.leave_out {
        let expectations = known.expectations.ok_or(ScoreError::NoExpectations)?;
        Some(leave_out::judge(draw, &result.without, expectations, good))
    } else {
        None
    };
    let step = if left_out.is_some() { "leave-out" } else { "run" };
    let (root, number) = (study.root.display(), draw.number);
    Ok(Case {
        number,
        kind: draw.kind,
        recipe: draw_as_json(draw),
        separable: recipe.hidden.len() > 1 && clear && !twins,
        over_limit,
        foreign_form: recipe.form.is_foreign(),
        background: recipe.background.is_some(),
        beyond_drawn: recipe.hidden.iter().any(is_beyond_drawn),
        wrong_parameters: !recipe.wrong_parameters.is_empty(),
        coloured_noise: recipe.coloured_noise,
        explanations: good
            .map_or_else(Vec::new, |good| probability::judge(draw, &members, left_out.is_some(), good)),
        rig_file_chi2: good
            .and_then(|good| Some(good.verification.as_ref()?.chi2_before))
            .filter(|chi2| chi2.is_finite()),
        parameter_errors: good.map_or_else(Vec::new, |good| parameters_off(draw, good)),
        judgement,
        left_out,
        wall_s: result.taken.wall_s,
        memory_kib: result.taken.memory_kib,
        repeat: format!(
            "scripts/study one {step} --out {root} --draw {number} --label again --program PROGRAM"
        ),
    })
}

/// A draw whose effects of another form have the numbers of the nearest law.
fn with_nearest_laws(draw: &Draw, classes: Option<&DrawClasses>) -> Draw {
    let mut draw = draw.clone();
    let classes = classes.map_or(&[][..], |classes| &classes.hidden);
    for (hidden, class) in draw.recipe.hidden.iter_mut().zip(classes) {
        if let Some(nearest) = &class.nearest {
            hidden.numbers.clone_from(&nearest.numbers);
        }
    }
    draw
}

fn parameters_off(draw: &Draw, report: &Report) -> Vec<f64> {
    let wrong = |name: &str| draw.recipe.wrong_parameters.iter().any(|(parameter, _)| parameter == name);
    // A program that does not state the file's value has still reported the parameter.
    let off =
        |quantity: &Quantity| quantity.before.map_or(0.0, |before| (quantity.value / before - 1.0).abs());
    report.parameters.iter().filter(|quantity| !wrong(&quantity.name)).map(off).collect()
}

/// Ratio of a hidden effect to its limit.
fn over_limit(draw: &Draw, at: usize, classes: Option<&DrawClasses>, limits: Option<&Limits>) -> Option<f64> {
    let hidden = &draw.recipe.hidden[at];
    let sheet = plant::effects::sheet(hidden.name)?;
    // Without a limit: its strength in this record.
    let ratio = limits?.ratio(sheet, hidden.place, hidden.numbers[0]);
    ratio.or_else(|| Some(classes?.hidden.get(at)?.strength))
}

#[cfg(test)]
pub(crate) mod tests;
