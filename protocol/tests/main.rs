//! The integration tests of `protocol`, one executable; `descriptors.rs` needs a process of its own.

#[path = "../generator/emit.rs"]
mod emit;
#[path = "../generator/model.rs"]
mod model;
#[path = "../generator/source.rs"]
mod source;

mod codec_build;
mod codec_cantools;
mod codec_catalogue;
mod codec_errors;
mod codec_round_trip;
mod embedded_bus;
mod modelled_wire;
