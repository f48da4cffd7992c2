//! The integration tests of `plant`, one executable; `allocation.rs` needs a process of its own.

mod reference;
mod scenario;
mod windows;

mod accuracy;
mod batch;
mod closed_forms;
mod declared;
mod determinism;
mod effects;
mod effects_file;
mod effects_sheets;
mod faults;
mod laws;
mod parameters;
mod properties;
mod rig;
mod scene;
mod sealed_file;
mod sensors;
mod tabulated;
mod truth;
