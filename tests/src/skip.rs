//! A test that cannot run here says so: on the terminal, and in the list that `scripts/test` prints at its end.

use std::fs::OpenOptions;
use std::io::Write;

/// Reports that the test `name` was skipped, and why; CI fails unless the name stands in `.ci/allowed-skips`.
pub fn report(name: &str, reason: &str) {
    eprintln!("SKIPPED {name}: {reason}");
    let Some(list) = std::env::var_os("AIRBENCH_SKIPS") else { return };
    let written = OpenOptions::new().create(true).append(true).open(list).and_then(|mut file| {
        // One write for a line, so that tests that run beside each other do not mix theirs.
        file.write_all(format!("{name}: {reason}\n").as_bytes())
    });
    written.expect("AIRBENCH_SKIPS names a file that can be written");
}
