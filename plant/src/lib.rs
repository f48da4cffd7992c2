//! Physics of the servo-pneumatic rig: two axes, linkage, sensors.
//!
//! A [`Plant`] is a rig ([`RigParameters`]) and a [`State`]; [`Plant::step`] moves it by one period of 1 ms under
//! [`Inputs`], [`Plant::truth`] names every force and flow at an instant, [`Sensors`] make readings of it.
//! The crate has no clock, no input or output, no thread, no log, and allocates nothing in its step.
//!
//! Where things are computed, in the order of a step:
//!
//! | file | law |
//! |---|---|
//! | `valve.rs` | command to spool, K_V tables, flow through an edge |
//! | `supply.rs` | supply node, emergency stop, check valves |
//! | `chamber.rs` | volumes, pressures, flow lag and its bounds, pneumatic force |
//! | `linkage.rs` | gap and contact force |
//! | `motion.rs` | friction, stick and slip, end stops, motion under a held force |
//! | `integrator.rs` | the substep that puts them together; without a corner: `integrator/smooth.rs` |
//! | `lanes.rs` | numbers of both axes side by side: what all of these are written over |
//! | `batch.rs` | many rigs at once |
//! | `truth.rs` | the list of all terms at an instant |
//! | `sensors.rs` | noise, rounding, saturation |
//! | `faults.rs` | what is broken, over all of these |
//! | `effects.rs` | what the baseline leaves out; friction with effects: `effects/friction.rs` |
//! | `cycle_record.rs` | what is recorded of a cycle |
//!
//! [`scene`] is what people do to it: setup, hands, emergency stop, linkage and weights, as an experiment file declares it.
//!
//! ```
//! use plant::{Inputs, Plant, RigParameters, Sensors, Setup};
//!
//! let rig = RigParameters::baseline();
//! let mut plant = Plant::new(&rig, &Setup::default())?;
//! let mut sensors = Sensors::new(&rig, 1);
//! let inputs = Inputs { valve: [0.3, 0.0], ..Inputs::default() };
//! for _ in 0..200 {
//!     let [drive, _load] = sensors.sample(&plant, &inputs); // at t_k, before the step
//!     assert!(drive.position.value < 0.5);
//!     plant.step(&inputs); // to t_k + 1 ms
//! }
//! assert!(plant.state().axes[0].extension_m > 0.1);
//! # Ok::<(), plant::SetupError>(())
//! ```
//!
//! Source of the model: rig-model.md, after Neugebauer, Quellmalz, Schönherr, Schlegel, "Control of a servo-pneumatic
//! experimental rig", The Archive of Mechanical Engineering LVIII (2011) no. 2, DOI 10.2478/v10180-011-0014-6.

#![warn(missing_docs)] // an interface of other crates

mod batch;
mod chamber;
mod cycle_record;
pub mod effects;
pub mod faults;
mod integrator;
mod lanes;
mod linkage;
mod motion;
pub mod parameters;
mod plant;
pub mod scene;
mod sensors;
mod setup;
mod state;
mod supply;
mod truth;
mod valve;

pub use batch::{Batch, Registers};
pub use cycle_record::CycleRecord;
pub use integrator::PERIOD_S;
pub use parameters::{ParameterError, RigParameters};
pub use plant::{LinkRefused, Plant};
pub use scene::{People, Scene, SceneError};
pub use sensors::{AxisReadings, Reading, Sensors};
pub use setup::{Setup, SetupError};
pub use state::{Axis, AxisState, Inputs, State};
pub use truth::{AxisTruth, Truth};
pub use valve::{StaticValve, quantise_valve};
