//! The program `bench` and its smaller commands: comparisons of runs, reference measurements, soaks, logs,
//! gateways to the bus. Figures of a run, latency reports and the live page are crates of their own: `figures`, `latency`,
//! `live`; the style of all pages is `pagekit`.
//!
//! | file | holds |
//! |---|---|
//! | [`runs`] | several runs: whether they are of one experiment, their figures |
//! | [`compare`] | runs side by side: figures with their change, curves over each other |
//! | [`spread`] | the spread of figures over repetitions |
//! | [`probe`] | scheduling gaps: whether the machine stood still, or another thread ran |
//! | [`ping_pong`] | round trips of 16 bytes between two processes, as a reference |
//! | [`can`] | any SocketCAN program on an embedded bus |
//! | [`conformance`] | whether a foreign controller keeps the contract of the bus |
//! | [`gateway`] | a gateway to a bus for clients of the socketcand protocol |
//! | [`soak`] | emulator and controllers over hours, every frame accounted for |
//! | [`recorded_log`] | a log of the bus, checked to its last line |
//! | [`export`] | a log as CSV, MDF4, ASC, BLF; a run as MCAP, or as a trace for Perfetto |
//! | [`replay`] | a log sent on a bus, by absolute time |
//! | [`export_fmu`] | the plant as an FMU |
//! | [`cli`], [`program`] | the command line, and the dispatch of its commands |

#![warn(missing_docs)] // an interface of other crates

mod can;
pub mod cli;
mod compare;
mod conformance;
mod export;
mod export_fmu;
mod gateway;
mod junit;
mod ping_pong;
mod probe;
pub mod program;
mod recorded_log;
mod replay;
mod runs;
mod soak;
mod spread;

use std::io::Write;

/// Prints a line; a closed pipe, as of `| head`, is no error.
pub(crate) fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints a warning, if there is a standard error.
pub(crate) fn warn(line: &str) {
    let _ = writeln!(std::io::stderr(), "bench: {line}");
}
