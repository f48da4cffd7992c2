//! Generates the typed frames of `src/frames.rs` from `rig.dbc`, the one truth of what crosses the wire.
//!
//! ```text
//! rig.dbc --can-dbc--> syntax tree --model--> checked messages --emit--> OUT_DIR/rig_frames.rs
//! ```
//!
//! A syntax error, a construct that the generator does not know, or a rule of the project that the file breaks
//! fails the build with file and line.

#[path = "build/emit.rs"]
mod emit;
#[path = "build/model.rs"]
mod model;
#[path = "build/source.rs"]
mod source;

use std::path::PathBuf;
use std::{env, fs, process};

fn main() {
    println!("cargo::rerun-if-changed=rig.dbc");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=build");
    if let Err(problem) = generate() {
        println!("cargo::error={problem}");
        process::exit(1);
    }
}

fn generate() -> Result<(), String> {
    let text = fs::read_to_string("rig.dbc").map_err(|error| format!("protocol/rig.dbc: {error}"))?;
    let source = source::Source::new("protocol/rig.dbc", &text);
    let catalogue = model::Catalogue::read(&source)?;
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo did not set OUT_DIR")?).join("rig_frames.rs");
    fs::write(&out, emit::catalogue(&catalogue)).map_err(|error| format!("{}: {error}", out.display()))
}
