//! Passes the commit of the build to the program, for the record of a run. In this crate and not in a library, since the script
//! runs after each commit and all dependents are rebuilt.
//!
//! Nothing here can fail a build: outside git, or without git, the commit is unknown.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=AIRBENCH_BUILD_COMMIT={}", commit().as_deref().unwrap_or("unknown"));
}

/// The commit that is checked out, if this checkout is the top of a git repository.
fn commit() -> Option<String> {
    let top = answer("git", &["rev-parse", "--show-toplevel"])?;
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?.canonicalize().ok()?;
    if Path::new(&top).canonicalize().ok()? != ours {
        return None;
    }
    // The log of HEAD grows with each commit and each checkout. A missing path would run this script on every build.
    if let Some(log) = answer("git", &["rev-parse", "--path-format=absolute", "--git-path", "logs/HEAD"])
        && Path::new(&log).exists()
    {
        println!("cargo::rerun-if-changed={log}");
    }
    answer("git", &["rev-parse", "--short=12", "HEAD"])
}

fn answer(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty() && !text.contains('\n')).then_some(text)
}
