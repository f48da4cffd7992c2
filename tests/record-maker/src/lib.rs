//! Blind records for the study of the workflow: a rig of its own, with hidden effects, under the real controllers.
//!
//! ```text
//!   Recipe ─► true numbers, hidden laws ─► Rig (steps of 10 us) ◄── Rehearsal: frames, station, controllers, the bus' timing
//!                                            │
//!                                            └─► Record ─► measurement.csv | truth.csv, truth.json in another folder
//! ```
//!
//! The one who names the effect must not be helped by the one who hides it: integrator, step, friction, random numbers and (on
//! demand) the laws' own forms are other ones than the plant's. Of `plant` it takes the nominal numbers, the data sheets of
//! the effects and the types of tables and scenes. What it is, and how far its null record lies from the plant:
//! `docs/record-maker.md`.
//!
//! | file | holds |
//! |---|---|
//! | `numbers.rs` | true numbers of the rig, some off by a few per cent |
//! | `background.rs` | errors of the whole model, each small |
//! | `form.rs` | which form a recipe's laws have |
//! | `hidden.rs` | from a recipe's effects to laws |
//! | `valve.rs`, `port.rs`, `axis.rs`, `motion.rs`, `coupling.rs` | the laws, all forms of each |
//! | `rig.rs` | steps, stick and slip, delays |
//! | `sensing.rs`, `noise.rs` | sensors |
//! | `closed_loop.rs` | the rig under the controllers, the record |
//! | `files.rs` | files of a record |
//! | `comparison.rs` | a null record against the plant |
//!
//! Source: rig-model.md, effects.md; discrepancy-notes.md, Blind protocol.

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

/// How long a record is, rows of 1 ms.
pub const ROWS: usize = 20_000;

/// Everything that a record follows from: equal recipes give equal bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Of the noise and the sampling instants.
    pub seed: u64,
    /// The axis that is recorded and moves; both when `both_axes`.
    pub axis: Axis,
    /// Both axes, linked: the drive positioned, the load pressing.
    pub both_axes: bool,
    /// With `both_axes`: the rods are apart, and both axes positioned.
    pub unlinked: bool,
    pub hidden: Vec<Hidden>,
    /// Functional form of all of them, and of what is in the background.
    pub form: Form,
    /// Names of [`PARAMETERS`] and the factors by which the true numbers differ from the rig file's, 0.5 to 2.
    pub wrong_parameters: Vec<(String, f64)>,
    /// Noise with a correlation of 5 ms and the same rms, in place of white noise.
    pub coloured_noise: bool,
    /// Sampling instants that are off by 0.1 ms rms, the same for all sensors of a row.
    pub jitter: bool,
    /// Rms of the noise in units of the rig file's; rounding stays.
    pub noise: f64,
    /// Errors of the whole model beside what is hidden.
    pub background: Option<Background>,
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

#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    pub name: &'static str,
    pub place: Place,
    /// One number for each key of its sheet, in the file's units.
    pub numbers: Vec<f64>,
}

/// Experiments of 20 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Experiment {
    /// The shipped `identification` in 20 s.
    Train,
    /// 0: point-to-point moves; 1: random steps with rests.
    HeldOut(u8),
}

#[derive(Debug, Clone)]
pub struct Record {
    pub recipe: Recipe,
    pub linked: bool,
    pub added_mass_kg: f64,
    /// A row for each millisecond.
    pub rows: Vec<Row>,
}

/// One millisecond; arrays of two hold drive and load.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Nominal time of the sample, s.
    pub time_s: f64,
    /// Valve commands acting over the millisecond that follows.
    pub valve: [f64; 2],
    pub readings: [AxisReadings; 2],
    /// The same at the nominal time without noise and rounding: position m, force N, pressures Pa. Sensor effects are in it.
    pub without_noise: [[f64; 4]; 2],
    pub axes: [TrueAxis; 2],
    pub supply_pressure_pa: f64,
    /// Contact force F_c of the linkage, N, positive in +x on the carriage.
    pub contact_force_n: f64,
}

/// True state of one axis and what acts on it, in its own extension; flows into the chambers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TrueAxis {
    pub extension_m: f64,
    /// Its rate, m/s; exactly 0 while friction holds it.
    pub rod_velocity_m_per_s: f64,
    /// Rate of the velocity, m/s^2.
    pub rod_acceleration_m_per_s2: f64,
    pub spool: f64,
    /// Absolute pressures of a and b, Pa.
    pub pressure_pa: [f64; 2],
    /// p V of a and b, J.
    pub stored_air_j: [f64; 2],
    /// T of a and b, K.
    pub temperature_k: [f64; 2],
    /// Lagged net normal flows, m^3/s.
    pub flow_m3_per_s: [f64; 2],
    /// Normal flows through the valve, m^3/s.
    pub edge_flow_m3_per_s: [f64; 2],
    /// Pressure behind the exhaust edges, Pa.
    pub exhaust_pressure_pa: f64,
    /// Pneumatic force F_pn, N.
    pub pneumatic_force_n: f64,
    /// All friction, viscous included; what holds a resting piston, N.
    pub friction_n: f64,
}

#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    #[error("{name} = {factor}: allowed are the names {PARAMETERS:?}, with factors from 0.5 to 2")]
    WrongParameter { name: String, factor: f64 },
    #[error("{name}: the catalogue has no such effect; see plant::effects::SHEETS")]
    UnknownEffect { name: String },
    #[error("{name} at {place}: {rule}")]
    Place { name: &'static str, place: Place, rule: &'static str },
    #[error("{name}: {numbers:?}: allowed is {allowed}")]
    Numbers { name: &'static str, numbers: Vec<f64>, allowed: String },
    #[error("held-out experiment {number}: allowed are 0 and 1")]
    Experiment { number: u8 },
    #[error(transparent)]
    Run(#[from] InputError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("{file}: the record maker plays no [[rig.hand]] and no [[rig.event]]")]
    People { file: String },
    #[error("a controller tripped the emergency stop at {at_s} s")]
    Stopped { at_s: f64 },
    #[error("{file}: is not done after {length_s} s")]
    Unfinished { file: String, length_s: f64 },
    #[error("the {axis} axis is in no state of a rig at {at_s} s")]
    NoState { axis: &'static str, at_s: f64 },
    #[error("{path}: {error}")]
    File { path: String, error: std::io::Error },
}
