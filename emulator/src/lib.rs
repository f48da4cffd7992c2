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

mod bus_load;
mod catalogue;
pub mod cli;
mod console;
mod event;
mod exchange;
pub mod faults;
mod finish;
mod host_thread;
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
