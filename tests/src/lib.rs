//! What the whole-system tests stand on: the shipped programs as processes, a peer on their bus, and their files.
//!
//! ```text
//!   Scene ── a folder of its own: socket, rig file, experiment file, one output folder for each program
//!     └─ Launch ── command line ──► Running ── signals, deadlines, stderr ──► CompletedProcess ── exit code
//!   Peer ─── the embedded bus as a foreign program sees it: raw packets in and out
//!   records ─ measurement.csv, truth.csv, bus.log, summary.json, read as strictly as they are promised;
//!             axis_table the tables of the controllers, bus_cycles the log by the rig's cycles
//!   exit ──── exit codes as they are promised
//!   broken ── a run with injected faults, and its files
//!   xcp ───── a client of the controllers' XCP, packet by packet, and the foreign one in Python
//!   foreign_python  scripts with the packages that the product is held against
//!   guest ─── a virtual machine with real SocketCAN, and what came back from it
//!   gateway ─ the gateway as a process, and a client of its protocol
//!   onlooker  a viewer of the telemetry, and the live page as programs see it
//!   discrepancy  the workflow as a program
//!   hidden ── effects: each, drawn, all at the ends of their ranges
//!   firmware  a controller in C, for Linux and as an ELF, and how well it positions
//!   c_algorithm  algorithms in C, built as a user builds them
//!   disturb ─ disturbances whose cause a report has to name
//!   noise ── a babbling node, and whether any of its commands acted
//!   pairs ─── runs with something and without, in turns, and the table of what it costs
//!   socketcan  programs of SocketCAN under `bench can`, and what was recorded of them on vcan
//!   process_table  processes of this machine: names, parents, states, command lines
//!   stalls ── whether the machine kept a program from running
//!   viewers ─ ten of the live page, for scripts/viewers
//! ```
//!
//! Everything here panics where a test would have to fail: a file that is missing or not whole, a program that does not start,
//! answer or end as it should. Nothing here waits without a limit; what is waited for, and what the programs said, stands in the
//! panic. Programs are killed with their whole process group when their [`Running`] goes. No test asserts on timing: a
//! limit is a protection against hanging, many times longer than what it limits takes.

pub mod account;
mod axis_table;
mod binaries;
pub mod broken;
pub mod bus_cycles;
pub mod c_algorithm;
pub mod discrepancy;
pub mod disturb;
pub mod events;
pub mod exit;
pub mod firmware;
pub mod foreign_python;
pub mod gateway;
pub mod guest;
pub mod hidden;
mod launch;
pub mod load;
pub mod noise;
pub mod onlooker;
pub mod pairs;
mod peer;
mod process;
pub mod process_table;
mod records;
mod scene;
pub mod skip;
pub mod small_disk;
pub mod socketcan;
pub mod stalls;
pub mod turn;
pub mod viewers;
pub mod xcp;

pub use axis_table::AxisTable;
pub use binaries::{
    Build, Program, executable, install, script, shipped_experiments, shipped_programs, workspace,
};
pub use launch::{Launch, Pace, both_good, run_both};
pub use peer::{Packet, Peer};
pub use process::{CompletedProcess, PATIENCE, Running, wait_until};
pub use records::{
    Table, bus_log, bus_log_to_last_whole_line, count, count_of_id, dropped_at_queue, expect_same,
    expect_whole_lines, find, json, same, text, timing_rows,
};
pub use scene::{LINKED, PROGRAM, RESTLESS, SHORT, Scene};
