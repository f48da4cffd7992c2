//! Compiles the benchmark's floor, `src/floor.c`, with the system's C compiler at -O3.

fn main() {
    println!("cargo::rerun-if-changed=src/floor.c");
    cc::Build::new().file("src/floor.c").opt_level(3).compile("floor");
}
