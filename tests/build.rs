//! Compiles the benchmark's floor, `benches/floor.c`, with the system's C compiler at -O3.
//!
//! The archive is linked by `benches/period.rs` alone (`#[link]` there), so no other target carries it.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=benches/floor.c");
    // No cargo_metadata: it would link the archive into this package's library instead of into the benchmark.
    cc::Build::new().file("benches/floor.c").opt_level(3).cargo_metadata(false).compile("floor");
    println!("cargo::rustc-link-search=native={}", env::var("OUT_DIR").expect("cargo sets OUT_DIR"));
}
