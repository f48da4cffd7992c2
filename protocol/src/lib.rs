//! What crosses the wire: rig.dbc, typed frames, buses.
//!
//! | file | holds |
//! |---|---|
//! | [`frames`], [`checksum`], [`periods`] | frames generated from `rig.dbc`, checksum of commands, when frames are sent |
//! | [`can`] | a CAN frame as the kernel lays it out |
//! | [`bus`] | buses by URL: SocketCAN, the embedded bus and its host, the lockstep barrier, faults of the wire |
//! | [`commands`], [`sources`], [`live_cycles`] | which valve command acts: age, two senders, cycles that were sent |
//! | [`bus_load`], [`response_time`], [`wire_time`] | load, worst-case response times, a wire that keeps time |
//! | [`exit`], [`mod@say`], [`socket_file`] | exit codes, whole lines on a shared terminal, sockets as files |

#![warn(missing_docs)] // an interface of other crates

pub mod bus;
pub mod bus_load;
pub mod can;
pub mod checksum;
pub mod commands;
pub mod exit;
pub mod frames;
pub mod live_cycles;
pub mod periods;
pub mod response_time;
pub mod say;
pub mod socket_file;
pub mod sources;
pub mod wire_time;
