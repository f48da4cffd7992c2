//! A campaign file: what is run, what is varied, what is collected.
//!
//! ```toml
//! title = "Gain of the position loop over friction"
//! experiment = "point-to-point"    # name of a shipped one, or a path from this file; a [[vary]] may choose among several
//! rig = "rig.toml"                 # path from this file; left out: the shipped rig
//! seconds = 10.0                   # longest run, s of the rig's time; left out: 600
//! pace = "rehearsal"               # or "lockstep": emulator and controllers as processes
//! draws = 50                       # runs of each combination of lists; default 1
//! seed = 1                         # of all that is drawn
//! runs_per_part = 8                # runs that are written together; left out: by the number of runs
//!
//! [collect]
//! figures = ["position_error_dynamic_m", "force_settling_s"]      # left out: all of `bench figures`
//! worst = ["position_error_dynamic_m"]                           # of which the page shows the largest
//!
//! [[vary]]                         # see factor.rs
//! set = "drive.algorithm.gain_per_s"
//! list = [20, 25, 30]
//! ```
//!
//! In place of an experiment, `command = ["PROGRAM", "ARGUMENT", …]` runs anything that answers with a line of JSON
//! (`command.rs`); `figures` are the keys of its answer that are collected, and `programs = ["NAME", …]` those that it starts
//! in its turn: results of another version of one of them are none of this campaign's.

use crate::factor::{Changes, Factor, FileChoice, VaryTable};
use crate::figures;
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A campaign as its file asks for it; paths are from the file's folder.
#[derive(Clone, Debug)]
pub struct CampaignFile {
    pub path: PathBuf,
    pub text: String,
    pub title: String,
    pub kind: Kind,
    pub programs: Vec<String>,
    /// Runs of each combination of lists.
    pub draws: u64,
    /// Of all that is drawn.
    pub seed: u64,
    /// Runs that are written together; by the number of runs where it is left out.
    pub runs_per_part: Option<u64>,
    pub factors: Vec<Factor>,
    /// Columns that are collected; of an experiment all figures when there are none.
    pub figures: Vec<String>,
    /// Of these the page shows the largest.
    pub worst: Vec<String>,
    /// Columns of truth and answer, of which the page shows a confusion matrix.
    pub confusion: Vec<[String; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    Experiment(ExperimentKind),
    /// A program that answers with a line of JSON.
    Command(Vec<String>),
}

/// An experiment on the simulated rig.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentKind {
    /// Name or path, unless it is varied.
    pub experiment: Option<String>,
    /// Path of the rig file, unless it is varied or the shipped one.
    pub rig: Option<String>,
    /// Longest run, s of the rig's time.
    pub longest_s: f64,
    /// In one process or in several.
    pub pace: Pace,
}

/// How the rig is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pace {
    /// In the process of its controllers, without a bus.
    #[default]
    Rehearsal,
    /// Emulator and controllers as processes on an embedded bus, in lockstep.
    Lockstep,
}

/// A campaign file that cannot be used: file, line, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: {message}")]
pub struct FileError {
    pub file: String,
    pub line: usize,
    pub message: String,
}

impl FileError {
    fn of(path: &Path, error: &std::io::Error) -> Self {
        FileError { file: path.display().to_string(), line: 1, message: error.to_string() }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    title: String,
    experiment: Option<String>,
    rig: Option<String>,
    command: Option<Spanned<Vec<String>>>,
    programs: Option<Spanned<Vec<String>>>,
    seconds: Option<Spanned<f64>>,
    pace: Option<Spanned<Pace>>,
    draws: Option<Spanned<u64>>,
    seed: Option<u64>,
    runs_per_part: Option<Spanned<u64>>,
    #[serde(default)]
    collect: Collect,
    #[serde(default)]
    vary: Vec<Spanned<VaryTable>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Collect {
    figures: Vec<Spanned<String>>,
    worst: Vec<Spanned<String>>,
    confusion: Vec<Spanned<[String; 2]>>,
}

/// Longest that a process of a run may take, s of the wall clock.
pub const LONGEST_WALL_S: f64 = 3600.0;
/// Longest run when nothing is said, s.
const LONGEST_S: f64 = 600.0;
/// Longest run that may be asked for, s: more than a day.
const MOST_S: f64 = 1e5;
/// Most runs of a combination.
const MOST_DRAWS: u64 = 1_000_000_000;
/// Most runs that are written together.
const MOST_PER_PART: u64 = 100_000;

impl CampaignFile {
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = std::fs::read_to_string(path).map_err(|error| FileError::of(path, &error))?;
        Self::from_toml(&text, path)
    }

    /// The same of a text; `path` is for messages and as the place that paths are from.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, FileError> {
        let at = At { text, path };
        let form: Form = toml::from_str(text)
            .map_err(|error| at.error(&error.span().unwrap_or(0..0), error.message().to_owned()))?;
        let kind = at.kind(&form)?;
        let mut factors: Vec<Factor> = Vec::new();
        for vary in form.vary {
            let span = vary.span();
            let reported = |reported: String| at.error(&span, format!("[[vary]]: {reported}"));
            let factor = vary.into_inner().factor().map_err(reported)?;
            check_factor(&factor, &kind, &factors).map_err(reported)?;
            factors.push(factor);
        }
        let chosen = |factor: &Factor| factor.changes == Changes::File(FileChoice::Experiment);
        if let (Kind::Experiment(ExperimentKind { experiment: None, .. }), false) =
            (&kind, factors.iter().any(chosen))
        {
            let reported =
                "experiment: name one, or let a [[vary]] choose = \"experiment\", or give a command";
            return Err(at.error(&(0..0), reported.into()));
        }
        let programs = form.programs.map(Spanned::into_inner).unwrap_or_default();
        let file = Self {
            path: path.to_owned(),
            programs,
            text: text.to_owned(),
            title: form.title,
            draws: at.whole(form.draws, "draws", MOST_DRAWS)?.unwrap_or(1),
            seed: form.seed.unwrap_or(1),
            runs_per_part: at.whole(form.runs_per_part, "runs_per_part", MOST_PER_PART)?,
            figures: at.figures(&form.collect.figures, &kind, &factors)?,
            worst: form.collect.worst.iter().map(|name| name.as_ref().clone()).collect(),
            confusion: form.collect.confusion.iter().map(|pair| pair.as_ref().clone()).collect(),
            kind,
            factors,
        };
        file.check_collected(&at, &form.collect)?;
        Ok(file)
    }

    /// The folder that its paths are from, absolute.
    ///
    /// # Errors
    /// [`FileError`] where the system does not tell where this process is.
    pub fn folder(&self) -> Result<PathBuf, FileError> {
        let folder = self.path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        std::path::absolute(folder).map_err(|error| FileError::of(&self.path, &error))
    }

    /// What the page shows is among what is varied or collected.
    fn check_collected(&self, at: &At<'_>, collect: &Collect) -> Result<(), FileError> {
        let own = |name: &String| {
            self.figures.contains(name)
                || self.factors.iter().any(|factor| factor.name == *name)
                || (matches!(self.kind, Kind::Experiment(_)) && figures::is_known(name))
        };
        let reported = |name: &String| format!("{name} is neither varied nor collected");
        for name in &collect.worst {
            if !own(name.as_ref()) {
                return Err(at.error(&name.span(), format!("collect.worst: {}", reported(name.as_ref()))));
            }
        }
        for pair in &collect.confusion {
            if let Some(name) = pair.as_ref().iter().find(|name| !own(name)) {
                return Err(at.error(&pair.span(), format!("collect.confusion: {}", reported(name))));
            }
        }
        Ok(())
    }
}

/// A text and where it comes from.
struct At<'a> {
    text: &'a str,
    path: &'a Path,
}

impl At<'_> {
    fn error(&self, span: &Range<usize>, message: String) -> FileError {
        let line = settings::line_of(self.text, span.start);
        FileError { file: self.path.display().to_string(), line, message }
    }

    fn kind(&self, form: &Form) -> Result<Kind, FileError> {
        if let Some(command) = &form.command {
            let given =
                [form.experiment.is_some(), form.rig.is_some(), form.seconds.is_some(), form.pace.is_some()];
            let reported = if command.as_ref().is_empty() {
                "command: needs at least the program"
            } else if given.contains(&true) {
                "command: experiment, rig, seconds and pace belong to a campaign of experiments"
            } else {
                return Ok(Kind::Command(command.as_ref().clone()));
            };
            return Err(self.error(&command.span(), reported.into()));
        }
        if let Some(programs) = &form.programs {
            let reported = "programs: what a command starts; a campaign of experiments knows its programs";
            return Err(self.error(&programs.span(), reported.into()));
        }
        if let Some(seconds) = form.seconds.as_ref().filter(|s| !(s.as_ref() > &0.0 && s.as_ref() <= &MOST_S))
        {
            let reported = format!("seconds = {}: allowed is more than 0, to {MOST_S}", seconds.as_ref());
            return Err(self.error(&seconds.span(), reported));
        }
        Ok(Kind::Experiment(ExperimentKind {
            experiment: form.experiment.clone(),
            rig: form.rig.clone(),
            longest_s: form.seconds.as_ref().map_or(LONGEST_S, |seconds| *seconds.as_ref()),
            pace: form.pace.as_ref().map_or(Pace::default(), |pace| *pace.as_ref()),
        }))
    }

    fn whole(&self, number: Option<Spanned<u64>>, name: &str, most: u64) -> Result<Option<u64>, FileError> {
        match number {
            Some(number) if !(1..=most).contains(number.as_ref()) => {
                let reported = format!("{name} = {}: allowed is 1 to {most}", number.as_ref());
                Err(self.error(&number.span(), reported))
            }
            number => Ok(number.map(Spanned::into_inner)),
        }
    }

    fn figures(
        &self,
        names: &[Spanned<String>],
        kind: &Kind,
        factors: &[Factor],
    ) -> Result<Vec<String>, FileError> {
        let mut taken: Vec<&str> = RESERVED.to_vec();
        taken.extend(factors.iter().map(|factor| factor.name.as_str()));
        for name in names {
            check_column(name.as_ref(), &taken)
                .map_err(|reported| self.error(&name.span(), format!("collect.figures: {reported}")))?;
            taken.push(name.as_ref());
        }
        let experiment = matches!(kind, Kind::Experiment(_));
        if let Some(name) = names.iter().find(|name| experiment && !figures::is_known(name.as_ref())) {
            let reported =
                format!("collect.figures: no figure {}; `bench figures` lists them", name.as_ref());
            return Err(self.error(&name.span(), reported));
        }
        if names.is_empty() && !experiment {
            return Err(self.error(&(0..0), "collect.figures: name the keys of the command's answer".into()));
        }
        Ok(names.iter().map(|name| name.as_ref().clone()).collect())
    }
}

/// Whether a factor fits the campaign and those before it.
fn check_factor(factor: &Factor, kind: &Kind, before: &[Factor]) -> Result<(), String> {
    let Factor { name, changes, .. } = factor;
    if before
        .iter()
        .any(|other| other.name == *name || (other.changes == *changes && *changes != Changes::Passed))
    {
        return Err(format!("{name} is varied twice; give one of them another name, or leave one out"));
    }
    check_column(name, RESERVED).map_err(|reported| format!("name = {reported}"))?;
    if figures::is_known(name) {
        return Err(format!("name = \"{name}\": a figure has this name, choose another"));
    }
    match (kind, changes) {
        (Kind::Command(_), Changes::Passed) => Ok(()),
        (Kind::Command(_), _) => {
            Err("a command is told name and value: leave out what is changed, give a name".into())
        }
        (Kind::Experiment(_), Changes::Passed) => {
            Err("needs exactly one of rig, experiment, set, fault, choose".into())
        }
        (Kind::Experiment(ExperimentKind { pace: Pace::Rehearsal, .. }), Changes::Fault(_)) => {
            Err("fault: a rehearsal has no rig process that could break; use pace = \"lockstep\"".into())
        }
        (Kind::Experiment(kind), Changes::File(FileChoice::Experiment)) if kind.experiment.is_some() => {
            Err("choose = \"experiment\": there is an experiment above already".into())
        }
        (Kind::Experiment(kind), Changes::File(FileChoice::Rig)) if kind.rig.is_some() => {
            Err("choose = \"rig\": there is a rig above already".into())
        }
        _ => Ok(()),
    }
}

/// Whether a column of the result may have this name beside those that are `taken`.
fn check_column(name: &str, taken: &[&str]) -> Result<(), String> {
    if taken.contains(&name) {
        return Err(format!("\"{name}\": another column of the result has this name, choose another"));
    }
    if name.is_empty() || name.contains([',', '"', '\n', '\r']) {
        return Err(format!(
            "{name:?}: a column's name has no comma, no quote, no new line, and is not empty"
        ));
    }
    Ok(())
}

/// Columns that every result has.
pub const RESERVED: &[&str] = &["run", "draw", "seed", "ended", "because", "simulated_s", "passed"];

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<CampaignFile, FileError> {
        CampaignFile::from_toml(text, Path::new("camp/aign.toml"))
    }

    const PLAIN: &str = "title = \"t\"\nexperiment = \"step\"\n";

    #[test]
    fn what_is_left_out_has_its_usual_value() {
        let file = read(PLAIN).unwrap();
        assert_eq!((file.draws, file.seed, file.runs_per_part), (1, 1, None));
        let Kind::Experiment(kind) = &file.kind else { panic!("an experiment") };
        assert_eq!((kind.longest_s, kind.pace), (600.0, Pace::Rehearsal));
    }

    #[test]
    fn what_is_wrong_is_told_with_file_line_and_what_would_be_right() {
        let after = |more: &str| format!("{PLAIN}{more}");
        let ask = |more: &str| format!("title = \"t\"\ncommand = [\"x\"]\n[collect]\n{more}\n");
        for (text, line, words) in [
            (after("draws = 0\n"), 3, "1 to"),
            (after("seconds = -1.0\n"), 3, "more than 0"),
            (after("pace = \"fast\"\n"), 3, "lockstep"),
            (after("colour = 1\n"), 3, "colour"),
            (after("[collect]\nfigures = [\"beauty\"]\n"), 4, "bench figures"),
            (after("[collect]\nworst = [\"beauty\"]\n"), 4, "neither varied"),
            (after("[[vary]]\nrig = \"a.b\"\n"), 3, "either list"),
            (after("[[vary]]\nrig = \"a.b\"\nname = \"seed\"\nlist = [1]\n"), 3, "another"),
            (after("[[vary]]\nfault = \"x\"\nkey = \"y\"\nlist = [1]\n"), 3, "lockstep"),
            (after("[[vary]]\nchoose = \"experiment\"\nlist = [\"step\"]\n"), 3, "already"),
            (after("[[vary]]\nname = \"x\"\nlist = [1]\n"), 3, "exactly one"),
            (after("[[vary]]\nrig = \"a.b\"\nlist = [1]\n[[vary]]\nrig = \"a.b\"\nlist = [2]\n"), 6, "twice"),
            (after("programs = [\"x\"]\n"), 3, "what a command starts"),
            (after("[[vary]]\nrig = \"a.b\"\nname = \"a,b\"\nlist = [1]\n"), 3, "no comma"),
            (ask("figures = [\"x\", \"y\", \"x\"]"), 4, "another column"),
            (ask("figures = [\"seed\"]"), 4, "another column"),
            (ask("figures = [\"hidden\"]\n[[vary]]\nname = \"hidden\"\nlist = [1]"), 4, "another column"),
            ("title = \"t\"\ncommand = []\n".into(), 2, "at least the program"),
            ("title = \"t\"\ncommand = [\"x\"]\n".into(), 1, "collect.figures"),
            ("experiment = \"step\"\n".into(), 1, "title"),
            ("title = \"t\"\n".into(), 1, "name one"),
        ] {
            let error = read(&text).unwrap_err();
            assert_eq!(error.line, line, "{text}: {error}");
            assert!(error.to_string().starts_with("camp/aign.toml:"), "{error}");
            assert!(error.message.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn a_command_is_told_its_values_by_name() {
        let text = "title = \"t\"\ncommand = [\"judge\"]\n[collect]\nfigures = [\"named\"]\n\
                    confusion = [[\"hidden\", \"named\"]]\n[[vary]]\nname = \"hidden\"\nlist = [\"a\", \"b\"]\n";
        let file = read(text).unwrap();
        assert_eq!(file.factors[0].changes, Changes::Passed);
        assert_eq!(file.confusion, [["hidden".to_owned(), "named".to_owned()]]);
    }
}
