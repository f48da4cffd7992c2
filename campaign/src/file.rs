//! The campaign file: the run, its factors, the columns to collect.
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
//! (`command.rs`); `figures` are the keys of its answer that are collected, and `programs = ["NAME", …]` the programs that it
//! starts: results of another version of one of them do not belong to this campaign.

use crate::factor::{self, Changes, Factor, FileChoice};
use figures::top::POSITIONS;
use settings::{Section, SettingsError, Source};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::DeValue;

/// Content of a campaign file; paths are relative to its folder.
#[derive(Clone, Debug)]
pub(crate) struct CampaignFile {
    pub path: PathBuf,
    pub text: String,
    pub title: String,
    pub kind: Kind,
    pub programs: Vec<String>,
    /// Runs of each combination of lists.
    pub draws: u64,
    /// Seed of everything that is drawn.
    pub seed: u64,
    /// Runs of a part; `None`: by the number of runs.
    pub runs_per_part: Option<u64>,
    pub factors: Vec<Factor>,
    /// Columns to collect; empty means all figures of an experiment.
    pub figures: Vec<String>,
    /// Columns of which the page shows the largest values, each with its run.
    pub worst: Vec<String>,
    /// Pairs of columns, truth and answer, whose confusion matrices the page shows.
    pub confusion: Vec<[String; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Experiment(ExperimentKind),
    /// A program that answers with a line of JSON.
    Command(Vec<String>),
}

/// An experiment on the simulated rig.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ExperimentKind {
    /// Name or path; `None` where it is varied.
    pub experiment: Option<String>,
    /// Path of the rig file; `None` where it is varied, and for the shipped one.
    pub rig: Option<String>,
    /// Longest run, s of the rig's time.
    pub longest_s: f64,
    /// In one process or in several.
    pub pace: Pace,
}

/// How the rig is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// In the process of its controllers, without a bus.
    Rehearsal,
    /// Emulator and controllers as processes on an embedded bus, in lockstep.
    Lockstep,
}

const PACES: [(&str, Pace); 2] = [("rehearsal", Pace::Rehearsal), ("lockstep", Pace::Lockstep)];

/// Keys of campaigns of an experiment alone.
const OF_AN_EXPERIMENT: [&str; 4] = ["experiment", "rig", "seconds", "pace"];
const OTHERS: [&str; 8] =
    ["title", "command", "programs", "draws", "seed", "runs_per_part", "collect", "vary"];

/// Longest that a process of a run may take, s of the wall clock.
pub(crate) const LONGEST_WALL_S: f64 = 3600.0;
/// Longest run when nothing is said, s.
const LONGEST_S: f64 = 600.0;
/// Longest run that may be asked for, s: more than a day.
const MOST_S: f64 = 1e5;
/// Most runs of a combination.
const MOST_DRAWS: u64 = 1_000_000_000;
/// Most runs that are written together.
const MOST_PER_PART: u64 = 100_000;

impl CampaignFile {
    pub(crate) fn read(path: &Path) -> Result<Self, SettingsError> {
        let text = std::fs::read_to_string(path).map_err(|error| SettingsError::unreadable(path, &error))?;
        Self::from_toml(&text, path)
    }

    /// Parses a text; `path` names the file in messages, and paths are relative to its folder.
    pub(crate) fn from_toml(text: &str, path: &Path) -> Result<Self, SettingsError> {
        let source = Source::parse(text, path)?;
        let mut root = source.root();
        root.allow(&[&OTHERS[..], &OF_AN_EXPERIMENT].concat())?;
        let title = root.needed_text("title", "what the campaign is called")?.text;
        let kind = kind(&mut root)?;
        let mut factors: Vec<Factor> = Vec::new();
        for mut section in root.sections("vary")? {
            let factor = factor::read(&mut section)?;
            check_factor(&factor, &kind, &factors).map_err(|problem| section.wrong(&problem))?;
            factors.push(factor);
        }
        let chosen = |factor: &Factor| factor.changes == Changes::File(FileChoice::Experiment);
        if let (Kind::Experiment(ExperimentKind { experiment: None, .. }), false) =
            (&kind, factors.iter().any(chosen))
        {
            let problem =
                "experiment: name one, or let a [[vary]] choose = \"experiment\", or give a command";
            return Err(root.wrong(problem));
        }
        let mut collect = root.section_or_empty("collect")?;
        collect.allow(&["figures", "worst", "confusion"])?;
        let mut file = Self {
            path: path.to_owned(),
            programs: root.texts("programs")?,
            text: text.to_owned(),
            title,
            draws: root.whole("draws", [1, MOST_DRAWS])?.unwrap_or(1),
            seed: root.whole("seed", [0, u64::MAX])?.unwrap_or(1),
            runs_per_part: root.whole("runs_per_part", [1, MOST_PER_PART])?,
            figures: collect.texts("figures")?,
            worst: collect.texts("worst")?,
            confusion: Vec::new(),
            kind,
            factors,
        };
        file.check_figures(&collect)?;
        file.confusion = confusion(&mut collect)?;
        file.check_shown(&collect)?;
        Ok(file)
    }

    /// The absolute folder that its paths are relative to.
    pub(crate) fn folder(&self) -> Result<PathBuf, SettingsError> {
        let folder = self.path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        std::path::absolute(folder).map_err(|error| SettingsError::unreadable(&self.path, &error))
    }

    /// Checks that collected columns have distinct names.
    fn check_figures(&self, collect: &Section<'_>) -> Result<(), SettingsError> {
        let experiment = matches!(self.kind, Kind::Experiment(_));
        if self.figures.is_empty() && !experiment {
            return Err(collect.wrong("figures: name the keys of the command's answer"));
        }
        let mut taken: Vec<&str> = RESERVED.to_vec();
        taken.extend(self.factors.iter().map(|factor| factor.name.as_str()));
        for (place, name) in self.figures.iter().enumerate() {
            let refused = |problem: String| collect.refused_item("figures", place, &problem);
            check_column(name, &taken).map_err(refused)?;
            if experiment && !is_figure(name) {
                return Err(refused(format!("no figure {name}; `bench figures` lists them")));
            }
            taken.push(name);
        }
        Ok(())
    }

    /// Checks that the columns of the page are factors or collected.
    fn check_shown(&self, collect: &Section<'_>) -> Result<(), SettingsError> {
        let is_column = |name: &String| {
            self.figures.contains(name)
                || self.factors.iter().any(|factor| factor.name == *name)
                || (matches!(self.kind, Kind::Experiment(_)) && is_figure(name))
        };
        let worst = self.worst.iter().map(std::slice::from_ref).enumerate().map(|item| ("worst", item));
        let confusion = self.confusion.iter().map(|pair| &pair[..]).enumerate();
        for (key, (place, names)) in worst.chain(confusion.map(|item| ("confusion", item))) {
            if let Some(name) = names.iter().find(|name| !is_column(name)) {
                let problem = format!("{name} is neither varied nor collected");
                return Err(collect.refused_item(key, place, &problem));
            }
        }
        Ok(())
    }
}

/// Whether an experiment has a figure of this name: those of `bench figures`, and those of the position in a summary.
pub(crate) fn is_figure(name: &str) -> bool {
    POSITIONS.contains(&name) || figures::definition(name).is_some()
}

/// Reads the pairs of columns, truth and answer.
fn confusion(collect: &mut Section<'_>) -> Result<Vec<[String; 2]>, SettingsError> {
    let list = collect.list("confusion")?.unwrap_or_default();
    let pair = |item: &Spanned<DeValue<'_>>| -> Option<[String; 2]> {
        let names = item.get_ref().as_array()?.iter().map(|name| name.get_ref().as_str().map(str::to_owned));
        names.collect::<Option<Vec<_>>>()?.try_into().ok()
    };
    let allowed = "allowed are pairs of columns, [\"truth\", \"answer\"]";
    list.iter().map(pair).collect::<Option<_>>().ok_or_else(|| collect.refused("confusion", allowed))
}

fn kind(root: &mut Section<'_>) -> Result<Kind, SettingsError> {
    let command = root.texts("command")?;
    if root.has("command") {
        let problem = if command.is_empty() {
            "needs at least the program"
        } else if OF_AN_EXPERIMENT.iter().any(|key| root.has(key)) {
            "experiment, rig, seconds and pace belong to a campaign of experiments"
        } else {
            return Ok(Kind::Command(command));
        };
        return Err(root.refused("command", problem));
    }
    if root.has("programs") {
        let problem = "it is what a command starts; a campaign of experiments knows its programs";
        return Err(root.refused("programs", problem));
    }
    let longest_s = root.finite("seconds")?.unwrap_or(LONGEST_S);
    if longest_s <= 0.0 || longest_s > MOST_S {
        return Err(root.refused("seconds", &format!("allowed is more than 0, to {MOST_S}")));
    }
    Ok(Kind::Experiment(ExperimentKind {
        experiment: root.text("experiment")?.map(|experiment| experiment.text),
        rig: root.text("rig")?.map(|rig| rig.text),
        longest_s,
        pace: root.choice("pace", &PACES)?,
    }))
}

fn check_factor(factor: &Factor, kind: &Kind, before: &[Factor]) -> Result<(), String> {
    let Factor { name, changes, .. } = factor;
    if before
        .iter()
        .any(|other| other.name == *name || (other.changes == *changes && *changes != Changes::CommandValue))
    {
        return Err(format!("name: {name} is varied twice; give one of them another name, or leave one out"));
    }
    check_column(name, RESERVED).map_err(|reported| format!("name = {reported}"))?;
    if is_figure(name) {
        return Err(format!("name = \"{name}\": a figure has this name, choose another"));
    }
    match (kind, changes) {
        (Kind::Command(_), Changes::CommandValue) => Ok(()),
        (Kind::Command(_), _) => {
            Err("name: a command receives name and value: leave out what is changed, give a name".into())
        }
        (Kind::Experiment(_), Changes::CommandValue) => {
            Err("rig: needs exactly one of rig, experiment, set, fault, choose".into())
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

/// Columns that every table of runs has.
pub(crate) const RESERVED: &[&str] = &["run", "draw", "seed", "ended", "because", "simulated_s", "passed"];

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<CampaignFile, SettingsError> {
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
    fn a_bad_file_is_refused_with_file_line_and_what_would_be_right() {
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
            let error = read(&text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("camp/aign.toml:{line}: ")), "{text}: {error}");
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn a_command_is_given_its_values_by_name() {
        let text = "title = \"t\"\ncommand = [\"judge\"]\n[collect]\nfigures = [\"named\"]\n\
                    confusion = [[\"hidden\", \"named\"]]\n[[vary]]\nname = \"hidden\"\nlist = [\"a\", \"b\"]\n";
        let file = read(text).unwrap();
        assert_eq!(file.factors[0].changes, Changes::CommandValue);
        assert_eq!(file.confusion, [["hidden".to_owned(), "named".to_owned()]]);
    }
}
