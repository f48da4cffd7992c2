//! Parameters changed while running: the program files are looked at, and numbers that changed are handed to the loop.
//!
//! It runs in the recorder's thread. A file that is wrong changes nothing and says why; what needs more than a number (another
//! algorithm, another linearisation) needs another start, and says so.

use crate::program::file::Source;
use crate::setup::Inputs;
use crate::station::Change;
use crossbeam_channel::Sender;
use plant::{Axis, RigParameters};
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

/// How often the files are looked at.
const LOOK_PERIOD: Duration = Duration::from_millis(250);

/// A file that is watched.
struct Watched {
    axis: Axis,
    path: PathBuf,
    changed: Option<SystemTime>,
    text: String,
    names: Vec<String>,
    values: Vec<f64>,
}

/// Watches the program files of a process.
pub struct Watcher {
    rig: RigParameters,
    files: Vec<Watched>,
    changes: Sender<Change>,
    looked: Instant,
}

impl Watcher {
    /// Watches the programs of `axes`, from now on.
    #[must_use]
    pub fn new(inputs: &Inputs, axes: &[Axis], changes: Sender<Change>) -> Self {
        let watched = |axis: &Axis| {
            let source = inputs.programs[axis.index()].as_ref()?;
            let (names, values) = variables(source, *axis, &inputs.rig).ok()?;
            let path = source.path.clone();
            let changed = std::fs::metadata(&path).and_then(|file| file.modified()).ok();
            Some(Watched { axis: *axis, path, changed, text: source.text.clone(), names, values })
        };
        let files = axes.iter().filter_map(watched).collect();
        Self { rig: inputs.rig.clone(), files, changes, looked: Instant::now() }
    }

    /// Looks at the files when it is time to.
    pub fn look(&mut self) {
        if self.looked.elapsed() < LOOK_PERIOD {
            return;
        }
        self.looked = Instant::now();
        for file in &mut self.files {
            let changed = std::fs::metadata(&file.path).and_then(|file| file.modified()).ok();
            if changed == file.changed {
                continue;
            }
            file.changed = changed;
            if let Err(problem) = file.take_over(&self.rig, &self.changes) {
                eprintln!("controller: {problem}; the numbers in use stay");
            }
        }
    }
}

impl Watched {
    fn take_over(&mut self, rig: &RigParameters, changes: &Sender<Change>) -> Result<(), String> {
        let source = Source::read(&self.path).map_err(|error| error.to_string())?;
        if source.text == self.text {
            return Ok(());
        }
        let (names, values) = variables(&source, self.axis, rig)?;
        if names != self.names {
            return Err(format!("{}: another algorithm needs another start", self.path.display()));
        }
        for (place, value) in values.iter().enumerate() {
            if *value != self.values[place] {
                let change = Change { axis: self.axis, place, value: *value };
                changes.try_send(change).map_err(|_| "too many changes at a time".to_owned())?;
                eprintln!("controller: {}.{} is {value} now", self.axis.name(), names[place]);
                self.values[place] = *value;
            }
        }
        self.text = source.text;
        Ok(())
    }
}

fn variables(source: &Source, axis: Axis, rig: &RigParameters) -> Result<(Vec<String>, Vec<f64>), String> {
    let program = source.program(axis, rig, false).map_err(|error| error.to_string())?;
    let names = program.variables().iter().map(|variable| variable.name.clone()).collect();
    Ok((names, program.values().to_vec()))
}
