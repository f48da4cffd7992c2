//! Changes of parameters while running: polls the program files and passes changed numbers to the loop.
//!
//! It runs in the recorder's thread. An invalid file changes nothing and is reported; so are changes that need a restart
//! (another algorithm, library or linearisation, or a number that is fixed at the start).

use axis_control::node::Change;
use axis_control::program::Variable;
use axis_control::program::file::{FixedSettings, Source};
use axis_control::setup::Inputs;
use crossbeam_channel::Sender;
use nominal::{Axis, RigParameters};
use settings::SettingsError;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

const POLL_PERIOD: Duration = Duration::from_millis(250);

struct ProgramFile {
    axis: Axis,
    path: PathBuf,
    changed: Option<SystemTime>,
    text: String,
    fixed: FixedSettings,
    variables: Vec<Variable>,
    values: Vec<f64>,
}

pub(crate) struct Reloader {
    rig: RigParameters,
    files: Vec<ProgramFile>,
    changes: Sender<Change>,
    last_poll: Instant,
}

impl Reloader {
    pub(crate) fn new(inputs: &Inputs, axes: &[Axis], changes: Sender<Change>) -> Self {
        let watched = |axis: &Axis| {
            let source = inputs.programs[axis.index()].as_ref()?;
            ProgramFile::new(source, *axis, &inputs.rig).ok()
        };
        let files = axes.iter().filter_map(watched).collect();
        Self { rig: inputs.rig.clone(), files, changes, last_poll: Instant::now() }
    }

    pub(crate) fn poll(&mut self) {
        if self.last_poll.elapsed() < POLL_PERIOD {
            return;
        }
        self.last_poll = Instant::now();
        for file in &mut self.files {
            let changed = std::fs::metadata(&file.path).and_then(|file| file.modified()).ok();
            if changed == file.changed {
                continue;
            }
            file.changed = changed;
            if let Err(problem) = file.take_over(&self.rig, &self.changes) {
                protocol::say!("controller: {problem}; the numbers in use stay");
            }
        }
    }
}

impl ProgramFile {
    fn new(source: &Source, axis: Axis, rig: &RigParameters) -> Result<Self, SettingsError> {
        let fixed = source.fixed_settings()?;
        let program = source.program(axis, rig, false)?;
        let (variables, values) = (program.variables().to_vec(), program.values().to_vec());
        let path = source.path.clone();
        let changed = std::fs::metadata(&path).and_then(|file| file.modified()).ok();
        Ok(Self { axis, path, changed, text: source.text.clone(), fixed, variables, values })
    }

    /// Queues the numbers that changed: all of them, or none with the reason.
    fn take_over(&mut self, rig: &RigParameters, changes: &Sender<Change>) -> Result<(), String> {
        let source = Source::read(&self.path).map_err(|error| error.to_string())?;
        if source.text == self.text {
            return Ok(());
        }
        let reported = |problem: String| format!("{}: {problem}", self.path.display());
        // Checked before the library is loaded.
        let fixed = source.fixed_settings().map_err(|error| error.to_string())?;
        if let Some(problem) = fixed_change(&self.fixed, &fixed) {
            return Err(reported(problem));
        }
        let new = Self::new(&source, self.axis, rig).map_err(|error| error.to_string())?;
        let names = |of: &Self| of.variables.iter().map(|variable| variable.name.clone()).collect::<Vec<_>>();
        if names(&new) != names(self) {
            return Err(reported("a change of the algorithm needs a restart".into()));
        }
        let differs = |place: &usize| new.values[*place] != self.values[*place];
        let places: Vec<_> = (0..new.values.len()).filter(differs).collect();
        for place in &places {
            let Variable { name, parameter } = &self.variables[*place];
            let task = name.strip_suffix(parameter.name.as_ref()).unwrap_or_default();
            let _ = parameter
                .check_change(new.values[*place])
                .map_err(|error| reported(format!("{task}{error}")))?;
        }
        for place in places {
            let (name, value) = (&self.variables[place].name, new.values[place]);
            let change = Change { axis: self.axis, place, value };
            changes.try_send(change).map_err(|_| "too many changes at a time".to_owned())?;
            protocol::say!("controller: {}.{name} is {value} now", self.axis.name());
            self.values[place] = value;
        }
        self.text = source.text;
        Ok(())
    }
}

/// Message about the first setting that needs a restart.
fn fixed_change(old: &FixedSettings, new: &FixedSettings) -> Option<String> {
    let mut keys = new.keys().chain(old.keys());
    let key = keys.find(|key| old.get(*key) != new.get(*key))?;
    let what = if key.ends_with("linearisation") { "linearisation" } else { "algorithm" };
    let reported =
        |settings: &FixedSettings| settings.get(key).map_or("left out".into(), |text| format!("\"{text}\""));
    Some(format!(
        "{key} is {} and was {}; a change of the {what} needs a restart",
        reported(new),
        reported(old)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::{Receiver, bounded};
    use tempfile::TempDir;

    const LOAD: &str = r#"title = "presses"
[algorithm]
name = "force-manual"
[post-controller]
linearisation = "choked-exhaust"
[giving-way]
name = "force-manual"
[force-chain]
high_force_n = 80.0
relieve_timeout_s = 15.0
[settled]
still_m = 0.001
"#;

    struct Bench {
        _folder: TempDir,
        watched: ProgramFile,
        changes: (Sender<Change>, Receiver<Change>),
    }

    impl Bench {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("load.toml");
            std::fs::write(&path, LOAD).unwrap();
            let watched =
                ProgramFile::new(&Source::read(&path).unwrap(), Axis::Load, &RigParameters::baseline())
                    .unwrap();
            Self { _folder: folder, watched, changes: bounded(8) }
        }

        fn edit(&mut self, from: &str, to: &str) -> Result<(), String> {
            assert!(LOAD.contains(from), "{from}");
            std::fs::write(&self.watched.path, LOAD.replacen(from, to, 1)).unwrap();
            self.watched.take_over(&RigParameters::baseline(), &self.changes.0)
        }
    }

    #[test]
    fn what_a_program_is_made_of_cannot_change_though_its_parameters_have_the_same_names() {
        for (from, to, words) in [
            (
                "choked-exhaust",
                "pressure-compensated",
                ["post-controller.linearisation", "pressure-compensated"],
            ),
            ("linearisation = \"choked-exhaust\"", "linearisation = \"magic\"", ["linearisation", "magic"]),
            ("name = \"force-manual\"", "name = \"force-p\"", ["algorithm.name", "force-p"]),
            ("name = \"force-manual\"", "library = \"own.so\"", ["algorithm.", "own.so"]),
            ("[giving-way]\nname", "[giving-way]\nlibrary", ["giving-way.", "force-manual"]),
            ("[giving-way]\nname = \"force-manual\"", "", ["giving-way.name", "left out"]),
        ] {
            let mut bench = Bench::new();
            let problem = bench.edit(from, to).unwrap_err();
            for word in words.into_iter().chain(["load.toml", "needs a restart"]) {
                assert!(problem.contains(word), "'{word}' is missing in: {problem}");
            }
            assert!(bench.changes.1.is_empty());
        }
        // What is left out and what is its default are the same.
        assert_eq!(Bench::new().edit("linearisation = \"choked-exhaust\"\n", ""), Ok(()));
    }

    #[test]
    fn another_library_under_the_same_table_is_another_algorithm() {
        let library = |name: &str| {
            let text = format!("title = \"t\"\n[algorithm]\nlibrary = \"{name}\"\n");
            Source { path: "p.toml".into(), title: "t".into(), text }.fixed_settings().unwrap()
        };
        let problem = fixed_change(&library("a.so"), &library("b.so")).unwrap();
        assert!(problem.starts_with("algorithm.library is \"b.so\" and was \"a.so\""), "{problem}");
        assert_eq!(fixed_change(&library("a.so"), &library("a.so")), None);
    }

    #[test]
    fn what_is_read_at_the_start_only_is_refused_and_nothing_else_of_that_edit_is_taken() {
        for (from, to, name) in [
            (
                "80.0\nrelieve_timeout_s = 15.0",
                "90.0\nrelieve_timeout_s = 20.0",
                "force-chain.relieve_timeout_s = 20",
            ),
            (
                "[settled]",
                "[matching-chain]\nmatch_timeout_s = 20.0\n[settled]",
                "matching-chain.match_timeout_s = 20",
            ),
            ("still_m = 0.001", "still_m = 0.002", "settled.still_m = 0.002"),
        ] {
            let mut bench = Bench::new();
            let problem = bench.edit(from, to).unwrap_err();
            assert!(problem.contains(name) && problem.contains("load.toml"), "{problem}");
            assert!(bench.changes.1.is_empty());
        }
    }

    #[test]
    fn a_number_that_may_change_is_handed_on() {
        let mut bench = Bench::new();
        assert_eq!(bench.edit("high_force_n = 80.0", "high_force_n = 90.0"), Ok(()));
        let change = bench.changes.1.try_recv().unwrap();
        assert_eq!((change.axis, change.value), (Axis::Load, 90.0));
        assert_eq!(bench.watched.variables[change.place].name, "force-chain.high_force_n");
        assert!(bench.changes.1.is_empty());
    }
}
