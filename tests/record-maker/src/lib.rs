//! Blind records for the study of the workflow: a simulated rig with hidden effects under the real controllers.
//!
//! ```text
//!   Recipe ─► true numbers, hidden laws ─► Rig (steps of 10 us) ◄── Rehearsal: frames, controllers, the timing of the bus
//!                                            │
//!                                            └─► Record ─► measurement.csv | truth.csv, truth.json in another folder
//! ```
//!
//! The simulation that hides an effect must not help the program that names it: integrator, step, friction, random numbers and
//! (on demand) the functional forms of the laws differ from the plant's. From `plant` come the nominal numbers, the data sheets
//! of the effects and the types of tables and scenes. Description, and how far the null record lies from the plant:
//! `docs/record-maker.md`.
//!
//! | file | holds |
//! |---|---|
//! | `numbers.rs` | true numbers of the rig, some wrong by a few per cent |
//! | `background.rs` | model errors of the whole rig, each small |
//! | `form.rs` | functional form of the laws |
//! | `hidden.rs` | laws of the effects of a recipe |
//! | `valve.rs`, `port.rs`, `axis.rs`, `motion.rs`, `coupling.rs` | the laws, all forms of each |
//! | `rig.rs` | steps, stick and slip, delays |
//! | `sensing.rs`, `noise.rs` | sensors |
//! | `closed_loop.rs` | the rig under the controllers, the record |
//! | `files.rs` | files of a record |
//! | `comparison.rs` | a null record against the plant |
//!
//! Source: rig-model.md, effects.md; discrepancy-notes.md, Blind protocol.

#![warn(missing_docs)] // an interface of other crates

mod axis;
mod background;
mod closed_loop;
pub mod comparison;
mod coupling;
mod files;
mod form;
mod hidden;
mod motion;
mod noise;
mod numbers;
mod port;
mod rig;
mod sensing;
#[cfg(test)]
mod tests;
mod valve;

pub use background::Background;
pub use closed_loop::{replay, simulate, simulate_proposed};
pub use files::{make, write, write_measurement};
pub use form::Form;
pub use numbers::PARAMETERS;

use axis_control::setup::InputError;
use plant::effects::sheet::Place;
use plant::{Axis, AxisReadings, SceneError};

/// Length of a record, rows of 1 ms.
pub const ROWS: usize = 20_000;

/// Everything that determines a record: equal recipes give equal bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Seed of the noise and of the sampling instants.
    pub seed: u64,
    /// The axis that moves and is recorded; ignored when `both_axes`.
    pub axis: Axis,
    /// Both axes are linked: the drive is positioned, the load applies a force.
    pub both_axes: bool,
    /// With `both_axes`: the rods are not linked, and both axes are positioned.
    pub unlinked: bool,
    /// Hidden effects; none in a null record.
    pub hidden: Vec<Hidden>,
    /// Functional form of all hidden effects, and of those of the background.
    pub form: Form,
    /// Names of [`PARAMETERS`] and the factors by which the true numbers differ from the rig file's, 0.5 to 2.
    pub wrong_parameters: Vec<(String, f64)>,
    /// Noise with a correlation of 5 ms and the same rms, in place of white noise.
    pub coloured_noise: bool,
    /// Sampling instants that are off by 0.1 ms rms, the same for all sensors of a row.
    pub jitter: bool,
    /// Rms of the noise in units of the rig file's; rounding stays.
    pub noise: f64,
    /// Model errors of the whole rig beside the hidden effects.
    pub background: Option<Background>,
    /// The experiment that the controllers run.
    pub experiment: Experiment,
}

impl Default for Recipe {
    /// The null record of the drive.
    fn default() -> Self {
        Recipe {
            seed: 1,
            axis: Axis::Drive,
            both_axes: false,
            unlinked: false,
            hidden: Vec::new(),
            form: Form::Catalogue,
            wrong_parameters: Vec::new(),
            coloured_noise: false,
            jitter: false,
            noise: 1.0,
            background: None,
            experiment: Experiment::Train,
        }
    }
}

/// A hidden effect: its place and its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// Name of its sheet in [`plant::effects::SHEETS`].
    pub name: &'static str,
    /// One of the places of its sheet.
    pub place: Place,
    /// One number for each key of its sheet, in the units of the rig file.
    pub numbers: Vec<f64>,
}

/// Experiments of 20 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Experiment {
    /// The shipped `identification`, 20 s.
    Train,
    /// 0: point-to-point moves; 1: random steps with rests.
    HeldOut(u8),
}

/// A simulated record: what the sensors read, and the truth.
#[derive(Debug, Clone)]
pub struct Record {
    /// The recipe that gave it.
    pub recipe: Recipe,
    /// The rods of both axes are linked.
    pub linked: bool,
    /// Mass of the weights on the carriage, kg.
    pub added_mass_kg: f64,
    /// A row for each millisecond.
    pub rows: Vec<Row>,
}

/// One millisecond; arrays of two hold drive and load.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Nominal time of the sample, s.
    pub time_s: f64,
    /// Valve commands of the following millisecond, -1 to 1.
    pub valve: [f64; 2],
    /// What the sensors read.
    pub readings: [AxisReadings; 2],
    /// Sensor values at the nominal time without noise and rounding, sensor effects included: position m, force N, pressures a
    /// and b Pa.
    pub without_noise: [[f64; 4]; 2],
    /// True states.
    pub axes: [TrueAxis; 2],
    /// Absolute supply pressure at the valves, Pa.
    pub supply_pressure_pa: f64,
    /// Contact force F_c of the linkage, N, positive in +x on the carriage.
    pub contact_force_n: f64,
}

/// True state of one axis and what acts on it, along its extension; flows into the chambers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TrueAxis {
    /// Extension of the rod, m.
    pub extension_m: f64,
    /// Velocity of the rod, m/s; exactly 0 while friction holds the piston.
    pub rod_velocity_m_per_s: f64,
    /// Rate of the velocity, m/s^2.
    pub rod_acceleration_m_per_s2: f64,
    /// Spool position, -1 to 1.
    pub spool: f64,
    /// Absolute pressures of a and b, Pa.
    pub pressure_pa: [f64; 2],
    /// p V of chambers a and b, J.
    pub stored_air_j: [f64; 2],
    /// T of chambers a and b, K.
    pub temperature_k: [f64; 2],
    /// Lagged net normal flows, m^3/s.
    pub flow_m3_per_s: [f64; 2],
    /// Normal flows through the valve, m^3/s.
    pub edge_flow_m3_per_s: [f64; 2],
    /// Pressure behind the exhaust edges, Pa.
    pub exhaust_pressure_pa: f64,
    /// Pneumatic force F_pn, N.
    pub pneumatic_force_n: f64,
    /// Friction, viscous included; at rest the force that holds the piston, N.
    pub friction_n: f64,
}

/// Why no record was made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // each says itself what it is
pub enum MakeError {
    #[error("{name} = {factor}: allowed are the names {PARAMETERS:?}, with factors from 0.5 to 2")]
    WrongParameter { name: String, factor: f64 },
    #[error("{name}: the catalogue has no such effect; see plant::effects::SHEETS")]
    UnknownEffect { name: String },
    /// An effect at a place that its sheet or the record does not have.
    #[error("{name} at {place}: {rule}")]
    Place { name: &'static str, place: Place, rule: &'static str },
    /// Numbers of an effect, in the units of the rig file, that its sheet does not allow.
    #[error("{name}: {numbers:?}: allowed is {allowed}")]
    Numbers { name: &'static str, numbers: Vec<f64>, allowed: String },
    #[error("held-out experiment {number}: allowed are 0 and 1")]
    Experiment { number: u8 },
    /// The files of the experiment are not valid.
    #[error(transparent)]
    Run(#[from] InputError),
    /// The scene of the experiment is not valid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An experiment with hands or events, which the record maker does not simulate.
    #[error("{file}: the record maker plays no [[rig.hand]] and no [[rig.event]]")]
    People { file: String },
    #[error("a controller tripped the emergency stop at {at_s} s")]
    Stopped { at_s: f64 },
    /// A proposed experiment that does not end within the time that a record may last.
    #[error("{file}: is not done after {length_s} s")]
    Unfinished { file: String, length_s: f64 },
    /// A state with a number that is not finite, or a pressure that is not positive.
    #[error("the {axis} axis is in no state of a rig at {at_s} s")]
    NoState { axis: &'static str, at_s: f64 },
    /// A file could not be read or written.
    #[error("{path}: {error}")]
    File { path: String, error: std::io::Error },
}
