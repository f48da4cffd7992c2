//! Own algorithms in C, built as a user builds them.

use crate::binaries::workspace;
use crate::scene::Scene;
use std::path::Path;
use std::process::Command;

/// A position controller that works, until what `-DWHEN` names holds: from then on it returns `-DRESULT`, no number without it.
const SOURCE: &str = r#"
#include "airbench_algorithm.h"
#include <math.h>
#include <stdlib.h>
#ifndef VERSION
#define VERSION AIRBENCH_INTERFACE_VERSION
#endif
#ifndef RESULT
#define RESULT NAN
#endif
static void *create(const struct airbench_rig *rig) { (void)rig; return calloc(1, sizeof(long)); }
static void destroy(void *self) { free(self); }
static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)ready, (void)parameters;
    *(long *)self = 0;
}
static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    const long count = ++*(long *)self;
    (void)count;
    if (WHEN) return RESULT;
    return parameters[0] * (ready->set_position_m - ready->position_m) + ready->set_velocity_m_per_s;
}
AIRBENCH_EXPORT const struct airbench_algorithm *airbench_algorithm_entry(uint32_t version)
{
    static const struct airbench_parameter parameters[] = {{"gain_per_s", "1/s", 0.0, 100.0, 20.0, "gain"}};
    static const struct airbench_algorithm algorithm = {
        VERSION, sizeof(struct airbench_algorithm), "fails", "works until it does not", AIRBENCH_POSITION, 1,
        parameters, create, destroy, reset, step,
    };
    (void)version;
    return &algorithm;
}
"#;

/// Builds the shipped example as `own_algorithm.so` in the scene, by the line that its head names.
pub fn shipped_example(scene: &Scene) {
    let source = workspace().join("controller/examples-c/position_pi.c");
    build(scene, &source, &["-O2", "-Wall", "-Wextra", "-Werror"]);
}

/// Builds a library that fails when `when` holds, an expression in C of `count` (of steps since the reset) and `ready`, as
/// `own_algorithm.so` in the scene.
pub fn failing(scene: &Scene, when: &str, options: &[&str]) {
    let source = scene.write("failing.c", SOURCE);
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
