//! Own algorithms in C, built as a user builds them.

use crate::binaries::workspace;
use crate::scene::Scene;
use std::path::Path;
use std::process::Command;

/// Builds the shipped example as `own_algorithm.so` in the scene, by the line that its head names.
pub fn shipped_example(scene: &Scene) {
    let source = workspace().join("controller/examples-c/position_pi.c");
    build(scene, &source, &["-O2", "-Wall", "-Wextra", "-Werror"]);
}

/// Builds a library that fails when `when` holds, an expression in C of `count` (of steps since the reset) and `ready`, as
/// `own_algorithm.so` in the scene.
pub fn failing(scene: &Scene, when: &str, options: &[&str]) {
    let source = workspace().join("tests/c/failing.c");
    let when = format!("-DWHEN=({when})");
    build(scene, &source, &[options, &[when.as_str()]].concat());
}

/// Builds the library that faults pages as `own_algorithm.so` in the scene.
pub fn page_faulting(scene: &Scene) {
    build(scene, &workspace().join("tests/c/page_faults.c"), &["-O2", "-Wall", "-Wextra", "-Werror"]);
}

fn build(scene: &Scene, source: &Path, options: &[&str]) {
    let mut compiler = Command::new("gcc");
    compiler.args(["-std=c11", "-fPIC", "-shared"]).args(options).arg("-I");
    compiler.arg(workspace().join("controller/include")).arg(source);
    let built = compiler.arg("-o").arg(scene.path("own_algorithm.so")).arg("-lm").output().expect("gcc");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
}

/// A program file that names it.
pub const PROGRAM: &str = r#"title = "own"
[algorithm]
library = "own_algorithm.so"
gain_per_s = 20.0
"#;
