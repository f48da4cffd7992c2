//! The rig behind a CAN bus: the plant in real time or in lockstep, recorded.
//!
//! It cannot tell whose controller sits on the bus, and puts nothing on it that the rig would not send. What only a
//! simulation knows goes to `truth.csv`.
//!
//! | file | holds |
//! |---|---|
//! | [`station`] | one cycle: sensors out, commands in, records, step |
//! | [`pace`] | what moves it from cycle to cycle: the clock, or the barrier |
//! | [`exchange`] | when sensors went out and the commands that answer them came |
//! | [`telegrams`], [`wire_limits`] | the frames that the rig sends, and whether its numbers fit them |
//! | [`recording`] | the queues out of the 1 ms path, the files, and the evidence of real time |
//! | `finish` | histograms, summary, exit code |
//! | [`faults`] | what is broken on purpose, when, and how it is told |
//! | [`console`] | what a person types |
//! | [`telemetry`] | who looks on |
//! | [`seal`], [`catalogue`] | drawing effects that nobody knows, listing those that there are |
//! | [`run`], [`inputs`], [`summary`], [`host_thread`], [`cli`] | around it |

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
pub mod pace;
pub mod recording;
pub mod run;
pub mod seal;
pub mod station;
pub mod summary;
pub mod telegrams;
pub mod telemetry;
pub mod wire_limits;
