//! Passes to the crate what it is built with, so that a run's record can say it: compiler, target, profile.
//!
//! Not from which commit: all crates would be built anew after each one. That is reported by the program that writes the record.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    set_env("RUSTC", answer(&rustc, &["--version"]));
    for (name, variable) in [("TARGET", "TARGET"), ("PROFILE", "PROFILE"), ("OPT_LEVEL", "OPT_LEVEL")] {
        set_env(name, std::env::var(variable).ok());
    }
}

fn set_env(name: &str, value: Option<String>) {
    println!("cargo::rustc-env=AIRBENCH_BUILD_{name}={}", value.as_deref().unwrap_or("unknown"));
}

fn answer(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty() && !text.contains('\n')).then_some(text)
}
