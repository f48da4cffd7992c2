//! A rehearsal made of files, and the tables of the rig that it leaves.

use crate::{Rehearsal, RehearsalParts};
use axis_control::setup::{InputError, Inputs, Mode};
use plant::{Axis, Scene, SetupError, Truth};
use runlog::cycle_tables::CycleTables;
use runlog::telemetry::SetUp;
use std::io;
use std::path::Path;

/// Files of which no rehearsal can be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum RehearsalError {
    #[error("{0}")]
    Scene(String),
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    Setup(#[from] SetupError),
}

/// The scene of the experiment that was read; `file` is for messages.
///
/// # Errors
/// [`RehearsalError::Scene`], for a sealed rig too.
pub fn scene(inputs: &Inputs, file: &str) -> Result<Scene, RehearsalError> {
    let scene = Scene::from_toml(&inputs.experiment_toml, file, &inputs.rig)
        .map_err(|error| RehearsalError::Scene(error.to_string()))?;
    if scene.sealed.is_some() {
        return Err(RehearsalError::Scene(format!(
            "{file}: rig.sealed: a rehearsal runs the plant inside the controller, which must not read a sealed file; use \
             'emulator run' and 'controller run', or scripts/run without --rehearse"
        )));
    }
    Ok(scene)
}

/// A rehearsal of what was read.
///
/// # Errors
/// [`RehearsalError::Input`] for controllers that cannot be set up, [`RehearsalError::Setup`] for a plant that cannot.
pub fn of_inputs(
    inputs: &Inputs,
    scene: &Scene,
    seed: u64,
    forever: bool,
) -> Result<Rehearsal, RehearsalError> {
    let mode = Mode { partner_needed: true, real_time: false, forever };
    let controllers =
        Axis::ALL.into_iter().map(|axis| inputs.controller(axis, mode)).collect::<Result<_, _>>()?;
    Ok(Rehearsal::new(RehearsalParts { rig: &inputs.rig, scene, seed, controllers })?)
}

/// `measurement.csv` and `truth.csv` of a rehearsal, with their heads, in the folder.
///
/// # Errors
/// The system's, with a file that cannot be created or written.
pub fn cycle_tables(folder: &Path, scene: &Scene, rehearsal: &Rehearsal) -> io::Result<CycleTables> {
    let terms = rehearsal.plant().term_names();
    let truth = Truth::COLUMNS.into_iter().chain(terms.iter().map(String::as_str));
    let set_up = SetUp { linked: scene.linked, added_mass_kg: scene.added_mass_kg };
    CycleTables::create(folder, set_up, truth)
}
