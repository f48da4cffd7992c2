//! Where the real records lie, beside the project on some machines only.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

pub(crate) fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the records; without it the test is reported as skipped, here and in the list of `scripts/test`.
pub(crate) fn data(test: &str) -> Option<PathBuf> {
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
