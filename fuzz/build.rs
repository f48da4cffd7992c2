//! Builds the library of the `plugin` target: its descriptor is what the fuzzer says.

use std::path::PathBuf;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=plugin/library.c");
    println!("cargo::rerun-if-changed=../controller/include/airbench_algorithm.h");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo says where")).join("libfuzzed.so");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let built = Command::new(compiler)
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-I../controller/include", "plugin/library.c", "-o"])
        .arg(&out)
        .status();
    assert!(built.is_ok_and(|status| status.success()), "no C compiler could build plugin/library.c");
    println!("cargo::rustc-env=FUZZED_LIBRARY={}", out.display());
}
