//! What an axis controller may know of the plant: the nominal numbers of `rig.toml`, and which axis is which.
//!
//! Controllers depend on this crate in place of `plant`, so that state, truth and laws of the simulated rig are out of their
//! reach: code that looks there does not compile.

pub use plant::parameters::VALVE_POINTS;
pub use plant::{Axis, RigParameters};
