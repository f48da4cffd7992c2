//! The files and records of a run, and the report of `discrepancy close`: each is written and read by one type.

#![warn(missing_docs)] // an interface of other crates

mod axis;
pub mod candump;
pub mod conditions;
pub mod controller_report;
pub mod discrepancy_report;
pub mod event;
pub mod flight_dump;
pub mod golden;
pub mod ping_pong;
pub mod process;
pub mod run_folder;
pub mod summary;
pub mod telemetry;
pub mod timing;
pub mod timing_recorder;

pub use axis::Axis;
