//! Names of a run's files; its JSON files, frames and time stamps, and the report of `discrepancy close`, each written and read
//! by one type.
//!
//! | file | holds |
//! |---|---|
//! | [`run_folder`], [`process`] | names of files and processes, writing without half a file |
//! | [`summary`], [`controller_report`], [`conditions`], [`ping_pong`] | the JSON files of a run |
//! | [`timing`], [`timing_recorder`], [`flight_dump`] | stamps of each cycle, what is recorded of them, the last second |
//! | [`cycle_tables`] | `measurement.csv` and `truth.csv` |
//! | [`candump`], [`event`], [`probe`] | `bus.log`; events of a run; gaps of a spinning thread |
//! | [`telemetry`] | the stream to viewers |
//! | [`discrepancy_report`] | `report.json` of `discrepancy close` |
//! | [`golden`] | golden files for tests |

#![warn(missing_docs)] // an interface of other crates

mod axis;
pub mod candump;
pub mod conditions;
pub mod controller_report;
pub mod cycle_tables;
pub mod discrepancy_report;
pub mod event;
pub mod flight_dump;
pub mod golden;
pub mod ping_pong;
pub mod probe;
pub mod process;
pub mod run_folder;
pub mod summary;
pub mod telemetry;
pub mod timing;
pub mod timing_recorder;

pub use axis::Axis;
