//! The rig behind a CAN bus: the plant in real time or in lockstep, recorded.
//!
//! It does not know which controller is on the bus, and sends only what the rig would send. Values that only a simulation knows
//! go to `truth.csv`. Which command acts: `protocol::commands`.
//!
//! | file | holds |
//! |---|---|
//! | [`node`], `rig` | the node of the bus with console and records; plant, people and faults behind it |
//! | [`pace`] | the loop over cycles: the clock, or the barrier |
//! | [`exchange`] | time stamps of sensors sent and of the commands that answer them |
//! | [`wire_limits`] | whether the numbers of a rig fit the frames |
//! | [`recording`] | the queues out of the 1 ms path, the files, and the timing of the rig |
//! | `finish` | histograms, summary, exit code |
//! | [`faults`] | fault injection: table, schedule, record |
//! | [`console`] | typed commands |
//! | [`telemetry`] | the stream to viewers |
//! | [`seal`], [`catalogue`] | drawing hidden effects, listing all effects |
//! | [`run`], [`inputs`], [`cli`], [`program`] | runs, their inputs, the command line |

#![warn(missing_docs)] // an interface of other crates

mod bus_load;
mod catalogue;
pub mod cli;
mod console;
mod event;
mod exchange;
pub mod faults;
mod finish;
mod inputs;
mod node;
mod pace;
pub mod program;
mod recording;
mod rig;
mod run;
mod seal;
mod telemetry;
mod wire_limits;
