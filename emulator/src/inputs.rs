//! Input files of a run: rig, experiment and sealed file, checked, with messages that name the remedy.
//!
//! Sealed effects go into the plant alone: everything that describes the run is made from the rig file. Errors of a sealed file
//! are reported with line and key, since no run begins then.

use crate::faults::NEEDS_HOST;
use crate::faults::overlay::on_wire;
use crate::faults::script::FaultScript;
use crate::run::RunError;
use crate::wire_limits;
use plant::{Plant, RigParameters, Scene};
use runlog::telemetry::SetUp;
use std::path::{Path, PathBuf};

/// The checked inputs.
pub(crate) struct Inputs {
    /// Text of the rig file.
    pub rig_toml: String,
    /// Text of the experiment file.
    pub experiment_toml: Option<String>,
    /// Its `[rig]`: set-up, hands, and actions of people.
    pub scene: Scene,
    /// The rig's parameters in the rig file, without sealed effects.
    pub rig: RigParameters,
    /// Whether a sealed file was read.
    pub sealed: bool,
    /// The plant in its initial state, with sealed effects.
    pub plant: Plant,
}

impl Inputs {
    /// Set-up of the rig at the start.
    pub(crate) fn set_up(&self) -> SetUp {
        SetUp { linked: self.scene.linked, added_mass_kg: self.scene.added_mass_kg }
    }

    /// Reads and checks the files; `sealed` replaces the file that the experiment names.
    pub(crate) fn read(
        rig: &Path,
        experiment: Option<&Path>,
        sealed: Option<&Path>,
    ) -> Result<Self, RunError> {
        let rig_toml = read(rig)?;
        let parameters = RigParameters::from_toml(&rig_toml, &rig.display().to_string())
            .map_err(|error| RunError::Input(error.to_string()))?;
        wire_limits::check(&parameters).map_err(|misfit| {
            let line = parameters.line(&format!("{}.{}", misfit.table, misfit.key));
            RunError::Input(format!("{}:{line}: {misfit}", rig.display()))
        })?;
        let experiment_toml = experiment.map(read).transpose()?;
        let scene = match (&experiment_toml, experiment) {
            (Some(text), Some(path)) => Scene::from_toml(text, &path.display().to_string(), &parameters)
                .map_err(|error| RunError::Input(error.to_string()))?,
            _ => Scene::default(),
        };
        let sealed = sealed.map(Path::to_path_buf).or_else(|| named_by(experiment, &scene));
        let simulated = match &sealed {
            Some(path) => parameters
                .with_effects_of(&read(path)?, &path.display().to_string())
                .map_err(|error| RunError::Input(error.to_string()))?,
            None => parameters.clone(),
        };
        // Values of the file were checked; a default may not fit a rig of another size.
        let plant = Plant::new(&simulated, &scene.setup()).map_err(|error| {
            let file = experiment.unwrap_or(Path::new("default setup"));
            RunError::Input(format!("{}: [rig] {error}", file.display()))
        })?;
        Ok(Self { rig_toml, experiment_toml, scene, rig: parameters, sealed: sealed.is_some(), plant })
    }
}

pub(crate) struct Script {
    /// Text of the file.
    pub toml: String,
    /// The parsed script.
    pub script: FaultScript,
    file: String,
}

impl Script {
    pub(crate) fn read(path: &Path) -> Result<Self, RunError> {
        let (toml, file) = (read(path)?, path.display().to_string());
        let script =
            FaultScript::from_toml(&toml, &file).map_err(|error| RunError::Input(error.to_string()))?;
        Ok(Self { toml, script, file })
    }

    /// Refuses faults of the bus unless this emulator hosts it.
    pub(crate) fn check_host(&self, hosts_bus: bool) -> Result<(), RunError> {
        let planned = self.script.faults.iter().find(|planned| on_wire(&planned.fault).is_some());
        match planned.filter(|_| !hosts_bus) {
            Some(planned) => Err(RunError::Input(format!(
                "{}:{}: {}: {NEEDS_HOST}",
                self.file, planned.line, planned.fault.spec.name
            ))),
            None => Ok(()),
        }
    }
}

/// The sealed file of an experiment, relative to its folder.
fn named_by(experiment: Option<&Path>, scene: &Scene) -> Option<PathBuf> {
    let folder = experiment.and_then(Path::parent).unwrap_or(Path::new(""));
    scene.sealed.as_ref().map(|sealed| folder.join(sealed))
}

fn read(path: &Path) -> Result<String, RunError> {
    std::fs::read_to_string(path)
        .map_err(|error| RunError::Input(format!("cannot read {}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misfit_is_reported_with_the_line_of_its_key_however_the_file_is_written() {
        let text = RigParameters::BASELINE_TOML
            .replacen("[sensors]", "[ sensors ] # of both axes", 1)
            .replacen("position_range_mm = 500", "\"position_range_mm\" = 800", 1);
        let line = text.lines().position(|line| line.starts_with("\"position_range_mm\"")).unwrap() + 1;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("rig.toml");
        std::fs::write(&file, text).unwrap();
        let error = Inputs::read(&file, None, None).err().expect("it does not fit the wire").to_string();
        let place = format!("{}:{line}: sensors.position_range_mm: ", file.display());
        assert!(error.contains(&place), "{error}");
    }
}
