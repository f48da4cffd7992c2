//! What crosses the wire: rig.dbc, typed frames, buses.

pub mod can;
