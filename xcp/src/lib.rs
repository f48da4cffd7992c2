//! XCP on CAN: measuring, tuning and a triggered trace of a running controller, by the tools of the field.
//!
//! ```text
//!   bus ─ 0x1E0 ─► port ─► slave ─► image ◄── signals, parameters        one slave for each axis
//!       ◄ 0x1E1 ──┘          ├── lock: seed and key                      0x1E2 and 0x1E3: the load's
//!                            ├── daq: lists
//!                            └── trace: trigger buffer
//!                 port ─► queue ─► parameter_files, in the recorder's thread: files, messages
//! ```
//!
//! Off without `--xcp`. [`slave`] is a function over bytes; [`port`] puts it on the bus, after the commands to the valves. All
//! parameters and signals stand in tables, from which [`a2l`] generates the file that tools read. For users:
//! `controller/docs/xcp.md`.

#![warn(missing_docs)] // an interface of other crates

pub mod a2l;
pub mod alone;
pub mod config;
mod daq;
pub mod image;
pub mod lock;
mod packet;
pub mod parameter_files;
pub mod port;
pub mod signals;
pub mod slave;
mod trace;

use nominal::Axis;
use protocol::frames::{DRIVE_XCP_COMMAND, DRIVE_XCP_RESPONSE, LOAD_XCP_COMMAND, LOAD_XCP_RESPONSE};

/// Name of the only event: the controller answered the sensors of a cycle.
pub(crate) const EVENT_NAME: &str = "cycle of 1 ms";

/// CAN identifiers of an axis: commands to its slave, responses and DAQ packets from it.
pub(crate) fn identifiers(axis: Axis) -> (u16, u16) {
    match axis {
        Axis::Drive => (DRIVE_XCP_COMMAND.id, DRIVE_XCP_RESPONSE.id),
        Axis::Load => (LOAD_XCP_COMMAND.id, LOAD_XCP_RESPONSE.id),
    }
}
