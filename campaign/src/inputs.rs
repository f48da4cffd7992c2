//! The files that a campaign names, read once before the first run, and their hashes.

use crate::edits::{self, EditError, sibling_path};
use crate::factor::{Changes, Factor, FileChoice, Value, Values};
use crate::file::{CampaignFile, ExperimentKind};
use crate::parts::hash;
use axis_control::experiment::Experiment;
use axis_control::program::file::Source;
use plant::RigParameters;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The shipped rig's name in results.
const SHIPPED: &str = "shipped";

/// Files of a campaign of experiments.
#[derive(Debug)]
pub(crate) struct CampaignInputs {
    /// Experiments by the name that the file gives them.
    experiments: BTreeMap<String, TextFile>,
    /// Rigs by the name that the file gives them.
    rigs: BTreeMap<String, RigFile>,
    programs: BTreeMap<PathBuf, Source>,
    /// Names and hashes of the files that experiments and programs name: tables of set-points, libraries.
    further: BTreeSet<(String, String)>,
    folders: Folders,
    /// Names of the experiment and the rig for runs that do not vary them.
    defaults: [String; 2],
}

/// Folders in which the names of files are looked up.
#[derive(Debug)]
struct Folders {
    /// Folder of the campaign's file.
    campaign: PathBuf,
    /// Folder with the shipped `experiments` and `programs`.
    shipped: PathBuf,
}

impl Folders {
    /// The file of this name: a path relative to `base`, or a name in a shipped folder.
    fn file(&self, name: &str, folder: &str, base: &Path) -> PathBuf {
        if name.ends_with(".toml") {
            base.join(name)
        } else {
            self.shipped.join(folder).join(format!("{name}.toml"))
        }
    }

    /// A program as an experiment names it.
    fn program(&self, name: &str, experiment: &Path) -> PathBuf {
        self.file(name, "programs", experiment.parent().unwrap_or(Path::new("")))
    }

    /// A program as a `[[vary]]` names it.
    fn chosen_program(&self, name: &str) -> PathBuf {
        self.file(name, "programs", &self.campaign)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TextFile {
    pub path: PathBuf,
    pub text: String,
}

#[derive(Debug)]
pub(crate) struct RigFile {
    pub file: TextFile,
    /// Its parameters, which the controllers know.
    pub nominal: RigParameters,
}

/// A file that a campaign names and that is missing or invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{campaign}: {message}")]
pub(crate) struct InputsError {
    campaign: String,
    message: String,
}

impl CampaignInputs {
    /// Reads all files; `shipped` is the folder with the shipped `experiments` and `programs`.
    pub(crate) fn read(
        file: &CampaignFile,
        kind: &ExperimentKind,
        shipped: &Path,
    ) -> Result<Self, InputsError> {
        let error = |message: String| InputsError { campaign: file.path.display().to_string(), message };
        let campaign = file.path.parent().unwrap_or(Path::new("")).to_owned();
        let folders = Folders { campaign, shipped: shipped.to_owned() };
        let read = |path: PathBuf| {
            let text = std::fs::read_to_string(&path)
                .map_err(|reported| error(format!("{}: {reported}", path.display())))?;
            Ok(TextFile { path, text })
        };
        let chosen = |choice| names(&file.factors, choice);
        let mut rigs = BTreeMap::new();
        for name in kind.rig.clone().into_iter().chain(chosen(FileChoice::Rig)) {
            rigs.insert(name.clone(), rig_file(read(folders.campaign.join(&name))?).map_err(error)?);
        }
        if rigs.is_empty() {
            let text = TextFile { path: "rig.toml".into(), text: RigParameters::BASELINE_TOML.to_owned() };
            rigs.insert(SHIPPED.to_owned(), rig_file(text).map_err(error)?);
        }
        let mut experiments = BTreeMap::new();
        for name in kind.experiment.clone().into_iter().chain(chosen(FileChoice::Experiment)) {
            experiments.insert(name.clone(), read(folders.file(&name, "experiments", &folders.campaign))?);
        }
        let first = |keys: Option<&String>| keys.cloned().unwrap_or_default();
        let defaults = [first(experiments.keys().next()), first(rigs.keys().next())];
        let mut programs = BTreeMap::new();
        let mut add = |path: PathBuf| {
            let source = Source::read(&path).map_err(|reported| error(reported.to_string()))?;
            programs.insert(path, source);
            Ok::<_, InputsError>(())
        };
        let stroke_m = rigs[&defaults[1]].nominal.cylinder().stroke_m;
        for TextFile { path, text } in experiments.values() {
            let experiment = Experiment::from_toml(text, path, stroke_m)
                .map_err(|reported| error(reported.to_string()))?;
            for section in [&experiment.drive, &experiment.load].into_iter().flatten() {
                add(folders.program(&section.program.written, path))?;
            }
        }
        for name in chosen(FileChoice::DriveProgram).iter().chain(&chosen(FileChoice::LoadProgram)) {
            add(folders.chosen_program(name))?;
        }
        let mut further = BTreeSet::new();
        let sources = programs.values().map(|source| (&source.path, &source.text));
        for (path, text) in experiments.values().map(|file| (&file.path, &file.text)).chain(sources) {
            let reported = |reported: EditError| error(format!("{}: {reported}", path.display()));
            for name in edits::files_beside(text, path).map_err(reported)? {
                let file = sibling_path(path, &name);
                let bytes = std::fs::read(&file)
                    .map_err(|reported| error(format!("{}: {reported}", file.display())))?;
                further.insert((name, hash(&bytes)));
            }
        }
        Ok(Self { experiments, rigs, programs, further, folders, defaults })
    }

    /// The experiment of this name, or the only one.
    ///
    /// # Panics
    /// If the campaign names no such file.
    pub(crate) fn experiment(&self, name: Option<&str>) -> &TextFile {
        &self.experiments[name.unwrap_or(&self.defaults[0])]
    }

    /// The rig of this name, or the only one.
    ///
    /// # Panics
    /// If the campaign names no such file.
    pub(crate) fn rig(&self, name: Option<&str>) -> &RigFile {
        &self.rigs[name.unwrap_or(&self.defaults[1])]
    }

    /// A program that an experiment names.
    pub(crate) fn program(&self, name: &str, experiment: &TextFile) -> Option<&Source> {
        self.programs.get(&self.folders.program(name, &experiment.path))
    }

    /// A program that a `[[vary]]` chooses.
    ///
    /// # Panics
    /// If the campaign names no such file.
    pub(crate) fn chosen_program(&self, name: &str) -> &Source {
        &self.programs[&self.folders.chosen_program(name)]
    }

    /// Name and hash of each file; names do not depend on the folder of the campaign.
    pub(crate) fn hashes(&self) -> BTreeSet<(String, String)> {
        let experiments = self.experiments.iter().map(|(name, file)| (name.as_str(), &file.text));
        let rigs = self.rigs.iter().map(|(name, rig)| (name.as_str(), &rig.file.text));
        let programs = self.programs.iter().map(|(path, source)| {
            (path.file_name().and_then(|name| name.to_str()).unwrap_or_default(), &source.text)
        });
        let texts = experiments.chain(rigs).chain(programs);
        let texts = texts.map(|(name, text)| (name.to_owned(), hash(text.as_bytes())));
        texts.chain(self.further.iter().cloned()).collect()
    }
}

fn names(factors: &[Factor], choice: FileChoice) -> Vec<String> {
    let lists = factors.iter().filter(|factor| factor.changes == Changes::File(choice));
    lists
        .flat_map(|factor| match &factor.values {
            Values::List(list) => list.iter().map(Value::to_string).collect(),
            Values::Range(_) => Vec::new(),
        })
        .collect()
}

fn rig_file(file: TextFile) -> Result<RigFile, String> {
    let nominal = RigParameters::from_toml(&file.text, &file.path.display().to_string())
        .map_err(|reported| reported.to_string())?;
    Ok(RigFile { file, nominal })
}
