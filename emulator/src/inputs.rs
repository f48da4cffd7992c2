//! What a run reads before it starts: rig file and experiment file, checked, with messages a person can act on.

use crate::experiment::RigSection;
use crate::run::RunError;
use plant::{Plant, RigParameters};
use std::path::Path;

/// Everything that was read.
pub struct Inputs {
    /// The rig file as it stands.
    pub rig_toml: String,
    /// The experiment file as it stands.
    pub experiment_toml: Option<String>,
    /// Its `[rig]`.
    pub section: RigSection,
    /// The rig's numbers.
    pub rig: RigParameters,
    /// The plant in its initial state.
    pub plant: Plant,
}

impl Inputs {
    /// Reads and checks both files.
    ///
    /// # Errors
    /// [`RunError::Input`] with file, line, key, value and allowed range.
    pub fn read(rig: &Path, experiment: Option<&Path>) -> Result<Self, RunError> {
        let rig_toml = read(rig)?;
        let parameters = RigParameters::from_toml(&rig_toml, &rig.display().to_string())
            .map_err(|error| RunError::Input(error.to_string()))?;
        let experiment_toml = experiment.map(read).transpose()?;
        let section = match (&experiment_toml, experiment) {
            (Some(text), Some(path)) => {
                RigSection::from_toml(text, &path.display().to_string()).map_err(RunError::Input)?
            }
            _ => RigSection::default(),
        };
        let plant = Plant::new(&parameters, &section.setup()).map_err(|error| {
            let file = experiment.map_or("default setup".into(), |path| path.display().to_string());
            let line = experiment_toml.as_deref().and_then(|text| line_of_key(text, &error.to_string()));
            let place = line.map_or(file.clone(), |line| format!("{file}:{line}"));
            RunError::Input(format!("{place}: [rig] {error}"))
        })?;
        Ok(Self { rig_toml, experiment_toml, section, rig: parameters, plant })
    }
}

/// Line, from 1, of the key that `message` begins with; `None` when the file leaves it at its default.
fn line_of_key(text: &str, message: &str) -> Option<usize> {
    let key = message.split(' ').next()?;
    let table = text.lines().position(|line| line.trim() == "[rig]")?;
    let within = text.lines().skip(table).position(|line| line.trim_start().starts_with(key))?;
    Some(table + within + 1)
}

fn read(path: &Path) -> Result<String, RunError> {
    std::fs::read_to_string(path)
        .map_err(|error| RunError::Input(format!("cannot read {}: {error}", path.display())))
}
