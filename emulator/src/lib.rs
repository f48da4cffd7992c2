//! The rig behind a CAN bus: the plant in real time or in lockstep, recorded.
//!
//! It cannot tell whose controller sits on the bus, and puts nothing on it that the rig would not send. What only a
//! simulation knows goes to `truth.csv`. Which command acts: `protocol::commands`.
//!
//! | file | holds |
//! |---|---|
//! | [`node`], `rig` | the node of the bus with console and records; plant, people and faults behind it |
//! | [`pace`] | what moves it from cycle to cycle: the clock, or the barrier |
//! | [`exchange`] | when sensors went out and the commands that answer them came |
//! | [`wire_limits`] | whether the numbers of a rig fit the frames |
//! | [`recording`] | the queues out of the 1 ms path, the files, and the timing of the rig |
//! | `finish` | histograms, summary, exit code |
//! | [`faults`] | what is broken on purpose, when, and how it is reported |
//! | [`console`] | what a person types |
//! | [`telemetry`] | who looks on |
//! | [`seal`], [`catalogue`] | drawing effects that nobody knows, listing those that there are |
//! | [`run`], [`inputs`], [`host_thread`], [`cli`], [`program`] | around it |

pub mod bus_load;
pub mod catalogue;
pub mod cli;
pub mod console;
pub mod event;
pub mod exchange;
pub mod faults;
mod finish;
pub mod host_thread;
pub mod inputs;
pub mod node;
pub mod pace;
pub mod program;
pub mod recording;
mod rig;
pub mod run;
pub mod seal;
pub mod telemetry;
pub mod wire_limits;
