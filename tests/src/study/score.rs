//! All cases of a study, or of all its shards: rates with intervals, confusion matrix, parameters, time.

use crate::study::campaign::{RunResult, read_result};
use crate::study::classes::{DrawClasses, Member, read_draw};
use crate::study::draws::{Draw, Kind, Shape, Shard};
use crate::study::folder::{FolderError, Study, draw_as_json};
use crate::study::judge::{Judgement, judge};
use crate::study::leave_out::{self, Expectations, LeftOut};
use crate::study::limits::Limits;
use crate::study::program::Identity;
use crate::study::report;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

pub mod tables;

pub use tables::Tables;

/// Multiple of its limit from which an effect must be named.
pub const CLEAR: f64 = 3.0;

/// A study that was scored.
#[derive(Debug, Serialize)]
pub struct Score {
    /// Of [`crate::study::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// What its results are called.
    pub label: String,
    /// Which program.
    pub program: Identity,
    /// Of all random numbers.
    pub seed: u64,
    /// How many draws of what.
    pub shape: Shape,
    /// Shards it was put together from.
    pub shards: u32,
    /// Draws whose classes are not known: there an effect is alone in its class.
    pub without_classes: usize,
    /// What the cases say together; with effects left out, only what makes sense then.
    pub tables: Tables,
    /// What they say when the hidden effects were left out of the program's catalogue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leave_out: Option<leave_out::Tables>,
    /// The cases.
    pub cases: Vec<Case>,
}

/// One draw and what became of it.
#[derive(Debug, Clone, Serialize)]
pub struct Case {
    /// Number of the draw.
    pub number: usize,
    /// What it is about.
    pub kind: Kind,
    /// Its recipe.
    pub recipe: Value,
    /// For each hidden effect its amplitude over the committed limit, or its strength in this record where it has no limit.
    pub over_limit: Vec<Option<f64>>,
    /// Whether two or more hidden effects are of different classes, and all three times above their limits.
    pub separable: bool,
    /// Whether its form is not the catalogue's.
    pub foreign_form: bool,
    /// Whether parameters are off besides.
    pub wrong_parameters: bool,
    /// Whether its noise is coloured and its sampling jitters.
    pub coloured_noise: bool,
    /// What it came to.
    pub judgement: Judgement,
    /// What it came to when the hidden effect was left out of the program's catalogue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
    /// Wall time of the program, s.
    pub wall_s: f64,
    /// Largest resident set of the program, KiB.
    pub memory_kib: u64,
    /// The command that repeats it, as far as the program goes.
    pub repeat: String,
}

/// Why a study cannot be scored.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// A file of a study.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// No folder was given.
    #[error("no study to score: give its folder")]
    Nothing,
    /// The folders are parts of different studies.
    #[error("{left} and {right} are parts of different studies or of different shards: score those of one")]
    Mixed {
        /// One folder.
        left: String,
        /// Another one.
        right: String,
    },
    /// A shard is there twice.
    #[error("{left} and {right} are the same shard: give each once")]
    Doubled {
        /// One folder.
        left: String,
        /// Another one.
        right: String,
    },
    /// Shards are missing.
    #[error("shards {missing} of {parts} are missing: run them, or give their folders")]
    MissingShards {
        /// Which.
        missing: String,
        /// Of how many.
        parts: u32,
    },
    /// Draws have no result.
    #[error(
        "{folder}: {count} draws have no result under the label '{label}', the first is {first}: run the study to its end"
    )]
    MissingRuns {
        /// Folder of the study.
        folder: String,
        /// Label of the results.
        label: String,
        /// How many.
        count: usize,
        /// The first of them.
        first: usize,
    },
    /// Results are of different programs.
    #[error("draw {number} was run with {other:?}, the others with {program:?}: score one program at a time")]
    Programs {
        /// Number of the draw.
        number: usize,
        /// Its program.
        other: Box<Identity>,
        /// That of the first draw.
        program: Box<Identity>,
    },
    /// Effects were left out, and what must show then is not known.
    #[error("effects were left out of the program's catalogue: tests/study/outside-expected.json is wanted")]
    NoExpectations,
}

/// What a score is made with besides the results.
#[derive(Debug, Clone, Copy)]
pub struct Known<'a> {
    /// The committed limits.
    pub limits: Option<&'a Limits>,
    /// Classes that are known beforehand, by the number of the draw.
    pub classes: Option<&'a BTreeMap<usize, DrawClasses>>,
    /// What must show of effects that are left out.
    pub expectations: Option<&'a Expectations>,
}

/// Scores a study, given as a whole or as all of its shards.
///
/// # Errors
/// [`ScoreError`] when anything is missing, doubled or mixed.
pub fn score(folders: &[PathBuf], label: &str, known: Known<'_>) -> Result<Score, ScoreError> {
    let studies = folders.iter().map(|folder| Study::open(folder)).collect::<Result<Vec<_>, _>>()?;
    check_shards(&studies)?;
    let mut cases = Vec::new();
    let mut program: Option<Identity> = None;
    let mut without_classes = 0;
    let leave_out = leaves_out(&studies, label)?;
    for study in &studies {
        check_complete(study, label, leave_out)?;
        for draw in wanted(study, leave_out) {
            let folder = study.run(label, draw.number);
            let result = read_result(&folder.join("result.json"))?;
            let own = program.get_or_insert_with(|| result.program.clone());
            if *own != result.program {
                let (other, program) = (Box::new(result.program), Box::new(own.clone()));
                return Err(ScoreError::Programs { number: draw.number, other, program });
            }
            let classes = classes_of(study, draw, known)?;
            without_classes += usize::from(classes.is_none() && !draw.recipe.hidden.is_empty());
            let report = report::read(&folder.join("report.json"));
            let mut case = case(study, draw, &result, &report, classes.as_ref(), known.limits);
            if leave_out {
                let expectations = known.expectations.ok_or(ScoreError::NoExpectations)?;
                let good = report.as_ref().ok().filter(|_| case.judgement.error.is_none());
                case.left_out = Some(leave_out::judge(draw, &result.without, expectations, good));
                case.repeat.push_str(" --leave-out");
            }
            cases.push(case);
        }
    }
    cases.sort_by_key(|case| case.number);
    let (Some(first), Some(program)) = (studies.first(), program) else { return Err(ScoreError::Nothing) };
    let mut tables = Tables::of(&cases);
    if leave_out {
        // Nobody names what is not in the catalogue.
        tables.headline = leave_out::tables::headline(&cases);
        tables.splits.clear();
        tables.effects.clear();
        tables.nothing_hidden.clear();
    }
    Ok(Score {
        schema_version: crate::study::SCHEMA_VERSION,
        label: label.to_owned(),
        program,
        seed: first.plan.seed,
        shape: first.plan.shape,
        shards: first.plan.shard.parts,
        without_classes,
        tables,
        leave_out: leave_out.then(|| leave_out::Tables::of(&cases)),
        cases,
    })
}

/// Whether the folders are all shards of one study, each once.
fn check_shards(studies: &[Study]) -> Result<(), ScoreError> {
    let Some(first) = studies.first() else { return Err(ScoreError::Nothing) };
    let name = |study: &Study| study.root.display().to_string();
    for (at, study) in studies.iter().enumerate() {
        let (own, other) = (&study.plan, &first.plan);
        if (own.seed, own.shape, own.shard.parts) != (other.seed, other.shape, other.shard.parts) {
            return Err(ScoreError::Mixed { left: name(first), right: name(study) });
        }
        if let Some(twin) = studies[..at].iter().find(|twin| twin.plan.shard == own.shard) {
            return Err(ScoreError::Doubled { left: name(twin), right: name(study) });
        }
    }
    let parts = first.plan.shard.parts;
    let has = |part| studies.iter().any(|study| study.plan.shard == Shard { part, parts });
    let missing: Vec<_> = (0..parts).filter(|part| !has(*part)).map(|part| part.to_string()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(ScoreError::MissingShards { missing: missing.join(", "), parts })
}

/// Whether the hidden effects were left out: what the first result says, wherever it is.
fn leaves_out(studies: &[Study], label: &str) -> Result<bool, FolderError> {
    let paths = studies
        .iter()
        .flat_map(|study| study.draws.iter().map(|draw| study.run(label, draw.number).join("result.json")));
    let first = paths.into_iter().find(|path| path.exists());
    Ok(first.map(|path| read_result(&path)).transpose()?.is_some_and(|result| result.program.leave_out))
}

/// The draws that are scored: with effects left out those of one effect.
fn wanted(study: &Study, leave_out: bool) -> impl Iterator<Item = &Draw> {
    study.draws.iter().filter(move |draw| !leave_out || draw.kind == Kind::Single)
}

fn check_complete(study: &Study, label: &str, leave_out: bool) -> Result<(), ScoreError> {
    let missing: Vec<_> = wanted(study, leave_out)
        .map(|draw| draw.number)
        .filter(|number| !study.run(label, *number).exists())
        .collect();
    let Some(first) = missing.first() else { return Ok(()) };
    let folder = study.root.display().to_string();
    Err(ScoreError::MissingRuns { folder, label: label.to_owned(), count: missing.len(), first: *first })
}

fn classes_of(study: &Study, draw: &Draw, known: Known<'_>) -> Result<Option<DrawClasses>, FolderError> {
    if let Some(classes) = known.classes.and_then(|classes| classes.get(&draw.number)) {
        return Ok(Some(classes.clone()));
    }
    let path = study.class(draw.number);
    if path.exists() { read_draw(&path, draw.number).map(Some) } else { Ok(None) }
}

fn case(
    study: &Study,
    draw: &Draw,
    result: &RunResult,
    report: &Result<report::Report, String>,
    classes: Option<&DrawClasses>,
    limits: Option<&Limits>,
) -> Case {
    let recipe = &draw.recipe;
    let members: Vec<Vec<Member>> = classes.map_or_else(Vec::new, |classes| {
        classes.hidden.iter().map(|hidden| hidden.members.clone()).collect()
    });
    let over_limit: Vec<_> =
        (0..recipe.hidden.len()).map(|at| over_limit(draw, at, classes, limits)).collect();
    let twins = recipe.hidden.iter().enumerate().any(|(at, _)| {
        let others = recipe.hidden.iter().enumerate().filter(|(other, _)| *other != at);
        let own = members.get(at);
        others.into_iter().any(|(_, other)| {
            own.is_some_and(|own| own.iter().any(|member| member.is_twin() && member.effect == other.name))
        })
    });
    let clear = over_limit.iter().all(|ratio| ratio.is_some_and(|ratio| ratio >= CLEAR));
    let root = study.root.display();
    Case {
        number: draw.number,
        kind: draw.kind,
        recipe: draw_as_json(draw),
        separable: recipe.hidden.len() > 1 && clear && !twins,
        over_limit,
        foreign_form: recipe.foreign_form,
        wrong_parameters: !recipe.wrong_parameters.is_empty(),
        coloured_noise: recipe.coloured_noise,
        judgement: judge(draw, &members, &result.taken, report),
        left_out: None,
        wall_s: result.taken.wall_s,
        memory_kib: result.taken.memory_kib,
        repeat: format!(
            "scripts/study run --out {root} --only {} --label again --program PROGRAM",
            draw.number
        ),
    }
}

/// How far a hidden effect lies above its limit.
fn over_limit(draw: &Draw, at: usize, classes: Option<&DrawClasses>, limits: Option<&Limits>) -> Option<f64> {
    let hidden = &draw.recipe.hidden[at];
    let sheet = plant::effects::sheet(hidden.name)?;
    // What is always seen has no limit: there its signature in this record counts.
    let ratio = limits?.ratio(sheet, hidden.place, hidden.numbers[0]);
    ratio.or_else(|| Some(classes?.hidden.get(at)?.strength))
}

#[cfg(test)]
pub(in crate::study) mod tests;
