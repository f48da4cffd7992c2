//! The plant as a Functional Mock-up Unit: FMI 2.0 for co-simulation, for those who simulate elsewhere.
//!
//! ```text
//!   importer ──C──► abi.rs ──► simulation.rs ──► plant::Plant, plant::Sensors
//!                   unsafe     modes, time,
//!                   no panic   inputs            variables.rs: names, units, ranges, from the plant's tables
//!                   crosses                      description.rs: modelDescription.xml of them
//! ```
//!
//! The crate is built twice from one source: as the shared library inside an FMU, and as the library that `bench export-fmu`
//! asks for the description. The FMU carries its rig file (`resources/rig.toml`); at the start the shared library makes the
//! description anew from it and compares identities, so that an FMU put together from two builds is refused.
//!
//! The C interface is written here and not by a crate: the variables are rows of the plant's tables and of the rig file's
//! effects, known when the FMU is loaded; crates that write FMUs want them as fields of a struct.
//!
//! Source: Functional Mock-up Interface 2.0.4, <https://fmi-standard.org>; bus.md, Time, for when a command acts.

mod abi;
pub mod description;
pub mod simulation;
pub mod variables;

/// `modelIdentifier` of the FMU, and the name of its shared library without its ending.
pub const MODEL_IDENTIFIER: &str = "plant_fmu";
/// The rig file in the FMU's folder of resources.
pub const RIG_FILE: &str = "rig.toml";
