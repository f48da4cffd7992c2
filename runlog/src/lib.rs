//! The files and records of a run: each is written and read by one type.

pub mod candump;
pub mod flight_dump;
pub mod run_folder;
pub mod telemetry;
pub mod timing;
pub mod timing_recorder;
