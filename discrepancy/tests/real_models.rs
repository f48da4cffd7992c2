//! The real records beside the project closed by the models that ship: figures of effects.md, names, held-out ratios; skipped aloud
//! where the records are not there.

use discrepancy::balance::{close, extended_model_text};
use discrepancy::report::{Report, Verdict};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the records; without it the test is told as skipped, here and in the list of `scripts/test`.
fn data(test: &str) -> Option<PathBuf> {
    let folder = crate_folder().parent()?.join("../shared/data");
    if folder.is_dir() {
        return Some(folder);
    }
    let reason = format!("{} is not there", folder.display());
    eprintln!("SKIPPED {test}: {reason}");
    if let Some(list) = std::env::var_os("AIRBENCH_SKIPS") {
        let written = OpenOptions::new().create(true).append(true).open(list);
        let written = written.and_then(|mut file| file.write_all(format!("{test}: {reason}\n").as_bytes()));
        written.expect("AIRBENCH_SKIPS names a file that can be written");
    }
    None
}

fn run(model: &Path, train: &[PathBuf], test: &Path) -> Report {
    close(model, train, Some(test), &mut |_| {}).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn show() {
    let Some(folder) = data("show") else { return };
    let emps = folder.join("emps");
    let r = run(&crate_folder().join("models/emps.toml"), &[emps.join("emps_train.csv")], &emps.join("emps_test_pulses.csv"));
    println!("{}", serde_json::to_string_pretty(&r).unwrap());
    for seal in ["O-ring257", "X-ring257"] {
        let f = |bar: u32| folder.join(format!("cylinder-friction/cyl25_friction_{seal}_{bar}bar.csv"));
        for t in [3, 7] {
        let r = run(&crate_folder().join("models/cylinder-friction.toml"), &[f(1), f(5)], &f(t));
        println!("{}", serde_json::to_string_pretty(&r).unwrap());
        println!("{}", extended_model_text(&crate_folder().join("models/cylinder-friction.toml"), &r).unwrap());
        }
        let _ = Verdict::Named;
    }
}
