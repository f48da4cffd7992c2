//! What crosses the wire: rig.dbc, typed frames, buses.

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
