//! Tells the crate what it is built with and from, so that a run's record can say it: compiler, target, profile, commit.
//!
//! Nothing here can fail a build: outside git, or without git, the commit is unknown.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    tell("RUSTC", answer(&rustc, &["--version"]));
    for (name, variable) in [("TARGET", "TARGET"), ("PROFILE", "PROFILE"), ("OPT_LEVEL", "OPT_LEVEL")] {
        tell(name, std::env::var(variable).ok());
    }
    tell("COMMIT", commit());
}

fn tell(name: &str, value: Option<String>) {
    println!("cargo::rustc-env=AIRBENCH_BUILD_{name}={}", value.as_deref().unwrap_or("unknown"));
}

/// The commit that is checked out, if this checkout is a git repository of its own and not a copy within somebody else's.
fn commit() -> Option<String> {
    let top = answer("git", &["rev-parse", "--show-toplevel"])?;
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?.canonicalize().ok()?;
    if Path::new(&top).canonicalize().ok()? != ours {
        return None;
    }
    // The log of HEAD grows with each commit and each checkout. A path that is not there would run this script every time.
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
