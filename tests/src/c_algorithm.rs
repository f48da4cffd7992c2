//! Own algorithms in C, built as a user builds them.

use crate::binaries::workspace;
use crate::scene::Scene;
use std::process::Command;

/// Builds a source of the checkout as `own_algorithm.so` in the scene, by the line that the head of the shipped example names.
pub fn build_strictly(scene: &Scene, source: &str) {
    build(scene, source, &["-O2", "-Wall", "-Wextra", "-Werror"]);
}

/// Builds a library that fails when `when` holds, an expression in C of `count` (of steps since the reset) and `ready`, as
/// `own_algorithm.so` in the scene.
pub fn failing(scene: &Scene, when: &str, options: &[&str]) {
    let when = format!("-DWHEN=({when})");
    build(scene, "tests/c/failing.c", &[options, &[when.as_str()]].concat());
}

fn build(scene: &Scene, source: &str, options: &[&str]) {
    let mut compiler = Command::new("gcc");
    compiler.args(["-std=c11", "-fPIC", "-shared"]).args(options).arg("-I");
    compiler.args(["controller/include", source].map(|path| workspace().join(path)));
    let built = compiler.arg("-o").arg(scene.path("own_algorithm.so")).arg("-lm").output().expect("gcc");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
}

/// A program file that names it.
pub const PROGRAM: &str = r#"title = "own"
[algorithm]
library = "own_algorithm.so"
gain_per_s = 20.0
"#;
