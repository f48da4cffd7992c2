//! The program `bench`, and those of its commands that are small: runs compared and drawn, references to measure beside, soaks,
//! logs, doors to the bus. Figures of a run, latency reports and the live page are crates of their own: `figures`, `latency`,
//! `live`; the look of all pages is `pagekit`.
//!
//! | file | holds |
//! |---|---|
//! | [`drawing`] | panels on one time axis, as SVG |
//! | [`picture`] | the pictures of a run: all of it, and around its step or its emergency stop |
//! | [`runs`] | several runs: whether they are of one experiment, their figures |
//! | [`compare`] | runs side by side: figures with their change, curves over each other |
//! | [`spread`] | how much the figures of repetitions spread |
//! | [`probe`] | gaps that a spinning thread sees: did the machine stand still, or did another thread run |
//! | [`ping_pong`] | round trips of 16 bytes between two processes, as a reference |
//! | [`can`] | any SocketCAN program on an embedded bus |
//! | [`conformance`] | whether a foreign controller keeps the contract of the bus |
//! | [`gateway`] | a door to a bus for clients of the socketcand protocol |
//! | [`soak`] | emulator and controllers over hours, every frame accounted for |
//! | [`recorded_log`] | a log of the bus, checked to its last line |
//! | [`export`] | a log as CSV, MDF4, ASC, BLF |
//! | [`replay`] | a log put back on a bus, by absolute time |
//! | [`export_fmu`] | the plant as an FMU |
//! | [`cli`], [`program`] | the command line, and what runs its commands |

mod can;
pub mod cli;
mod compare;
mod conformance;
mod drawing;
mod export;
mod export_fmu;
mod gateway;
mod junit;
mod picture;
mod ping_pong;
mod probe;
pub mod program;
mod recorded_log;
mod replay;
mod runs;
mod soak;
mod spread;

use std::io::Write;

/// A line to standard output. A reader that has gone, as `| head` does, has seen enough.
pub(crate) fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// A line to standard error, where nobody may be there to read it.
pub(crate) fn warn(line: &str) {
    let _ = writeln!(std::io::stderr(), "bench: {line}");
}
