//! ASC and BLF by python-can: no Rust library writes BLF, and python-can follows the conventions of both formats.
//!
//! The Python process gets the frames of the log as candump lines, so that its input has been checked. It reads back what it
//! wrote and compares (`bench/python/convert_log.py`).

use super::ExportError;
use super::cli::Format;
use crate::recorded_log::RecordedLog;
use runlog::candump::write_line;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};

const SCRIPT: &str = include_str!("../../python/convert_log.py");
/// Exit code of the script where python-can is not installed.
const NO_PYTHON_CAN: i32 = 77;

/// Writes `out`, whatever its extension, and returns the differences found when reading it back.
pub(super) fn write(
    out: &Path,
    log: &RecordedLog,
    format: Format,
    python: &Path,
) -> Result<Option<String>, ExportError> {
    let kind = if format == Format::Asc { "asc" } else { "blf" };
    let failed = |reason: String| ExportError::Python { python: python.to_owned(), reason };
    let mut child = Command::new(python)
        .arg("-c")
        .arg(SCRIPT)
        .arg(kind)
        .arg(out)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| failed(error.to_string()))?;
    if let Some(input) = child.stdin.take() {
        let mut lines = BufWriter::new(input);
        // Channels of these formats are numbers.
        let names: Vec<_> = (0..log.interfaces.len()).map(|number| format!("can{number}")).collect();
        // A script that ended early reports by its exit code.
        let _ = log
            .frames
            .iter()
            .zip(&log.seen_at)
            .try_for_each(|(logged, place)| {
                write_line(&mut lines, &names[usize::from(*place)], 0, &logged.record)
            })
            .and_then(|()| lines.flush());
    }
    let done = child.wait_with_output().map_err(|error| failed(error.to_string()))?;
    if done.status.code() == Some(NO_PYTHON_CAN) {
        return Err(failed("it has no python-can".into()));
    }
    if !done.status.success() {
        let output = String::from_utf8_lossy(&done.stderr);
        return Err(failed(output.lines().last().unwrap_or("it failed").to_owned()));
    }
    let reported = String::from_utf8_lossy(&done.stdout).trim().to_owned();
    Ok((reported != format!("equal {}", log.frames.len())).then_some(reported))
}
