//! Files of a run's folder, written so that a reader never sees an incomplete line or JSON file.
//!
//! Tables grow by whole lines; JSON appears at once by being renamed. A process that is killed leaves files that read
//! to their last line.

use crate::axis::Axis;
use crate::process::Process;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Version of the JSON files; goes up when a key changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// Lines are written together up to this many bytes.
const BATCH_BYTES: usize = 256 << 10;

/// Name of a new run's folder, by the time in seconds since 1970 and the process that asks.
#[must_use]
pub fn new_folder() -> PathBuf {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    PathBuf::from(format!("runs/{}-{}", now.as_secs(), std::process::id()))
}

/// What made a run.
pub const RUN_JSON: &str = "run.json";
/// What the emulator counted and, after `bench summary`, what the run adds up to.
pub const SUMMARY_JSON: &str = "summary.json";
/// Sensors and valves, a row for each cycle.
pub const MEASUREMENT_CSV: &str = "measurement.csv";
/// What only a simulation knows, a row for each cycle.
pub const TRUTH_CSV: &str = "truth.csv";
/// Every frame of the bus.
pub const BUS_LOG: &str = "bus.log";
/// Table of the faults that were put into a run; only runs in which there can be some have it.
pub const FAULTS_CSV: &str = "faults.csv";
/// Pair, group and load of a run that is measured.
pub const CONDITIONS_JSON: &str = "conditions.json";
/// Latencies of cyclictest beside a run.
pub const CYCLICTEST_JSON: &str = "cyclictest.json";
/// Ping-pongs beside a run.
pub const PING_PONG_JSON: &str = "ping-pong.json";
/// Gaps that `bench probe` saw beside a run.
pub const PROBE_CSV: &str = "probe.csv";
/// Frames that the gateway carried and lost.
pub const GATEWAY_JSON: &str = "gateway.json";
/// What a program that evaluates runs or records found.
pub const REPORT_JSON: &str = "report.json";
/// The same as a page.
pub const REPORT_HTML: &str = "report.html";
/// Results of a soak.
pub const SOAK_JSON: &str = "soak.json";
/// Curves of a run.
pub const PICTURE_SVG: &str = "picture.svg";
/// Curves around a step.
pub const STEP_SVG: &str = "step.svg";
/// Curves around an emergency stop.
pub const STOP_SVG: &str = "stop.svg";

/// Table of what the controller of an axis computed, whichever process that is in.
#[must_use]
pub fn controller_csv(axis: Axis) -> String {
    format!("{}.csv", Process::ControllerOf(axis).name())
}

/// Files that programs write at the end of a run, or at its start in one go, and the emulator's own that it does not make in
/// every run; those of an earlier run are removed. What grows during a run is not among them, tables,
/// `*.hlog` and dumps of the flight recorder ([`crate::flight_dump::clear`]): its writer makes it anew at its own start, and a
/// controller may start before the rig. A controller's file whose axis no report of the run names is therefore of an earlier run.
#[must_use]
pub fn results() -> Vec<String> {
    let mut names = Vec::from([RUN_JSON, PICTURE_SVG, STEP_SVG, STOP_SVG, FAULTS_CSV].map(str::to_owned));
    names.extend(Process::ALL.map(Process::report));
    names.extend([Process::Emulator.hlog(), Process::Emulator.timing()]);
    names
}

/// Files of a controller that it does not make in every run: it removes them at its start.
#[must_use]
pub fn controller_results(controller: Process) -> [String; 2] {
    [controller.hlog(), controller.timing()]
}

/// Removes these files of an earlier run from `folder`.
///
/// # Errors
/// As [`clear_results`].
pub fn clear(folder: &Path, names: &[impl AsRef<str>]) -> io::Result<()> {
    for path in names.iter().map(|name| folder.join(name.as_ref())) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(named(&path, &error)),
            _ => {}
        }
    }
    Ok(())
}

/// Removes what an earlier run left of [`results`] in `folder`, so that two runs are never taken for one.
///
/// # Errors
/// What the system says, with the file's name.
pub fn clear_results(folder: &Path) -> io::Result<()> {
    clear(folder, &results())
}

/// A file that grows by whole lines.
pub struct LineFile {
    file: File,
    path: PathBuf,
    buffer: Vec<u8>,
    /// Bytes of whole lines in the file.
    length: u64,
}

impl LineFile {
    /// Makes the file, replacing one that is there.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create(path).map_err(|error| named(path, &error))?;
        Ok(Self { file, path: path.into(), buffer: Vec::with_capacity(2 * BATCH_BYTES), length: 0 })
    }

    /// Where whole lines are appended; [`LineFile::write_when_full`] follows each.
    pub fn lines(&mut self) -> &mut Vec<u8> {
        &mut self.buffer
    }

    /// Writes the lines out when there are many.
    ///
    /// # Errors
    /// As [`LineFile::write_out`].
    pub fn write_when_full(&mut self) -> io::Result<()> {
        if self.buffer.len() >= BATCH_BYTES { self.write_out() } else { Ok(()) }
    }

    /// Writes all lines out.
    ///
    /// # Errors
    /// What the system says, with the file's name; the lines of this batch are gone then.
    pub fn write_out(&mut self) -> io::Result<()> {
        let result = self.file.write_all(&self.buffer).map_err(|error| named(&self.path, &error));
        match result {
            Ok(()) => self.length += self.buffer.len() as u64,
            Err(_) => self.cut_half_line(),
        }
        self.buffer.clear();
        result
    }

    /// A disk that is full takes a part of a batch: what it took of the last line goes again.
    fn cut_half_line(&mut self) {
        let taken = self.file.stream_position().map_or(0, |end| end.saturating_sub(self.length)) as usize;
        let taken = &self.buffer[..taken.min(self.buffer.len())];
        self.length += taken.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end as u64 + 1);
        // A file that cannot be cut keeps its half line; the error that led here is reported in any case.
        let _ = self.file.set_len(self.length);
    }
}

/// A file that cannot be read or written, with what the system or the parser said.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It is missing, or is not what it should be.
    #[error("cannot read {}: {reason}", .0.display(), reason = .1)]
    Read(PathBuf, String),
    /// The system refuses.
    #[error("cannot write {}: {reason}", .0.display(), reason = .1)]
    Write(PathBuf, String),
}

impl FileError {
    /// A file that cannot be read.
    pub fn read(file: &Path, reason: impl ToString) -> Self {
        Self::Read(file.into(), reason.to_string())
    }

    /// A file that cannot be written.
    pub fn write(file: &Path, reason: impl ToString) -> Self {
        Self::Write(file.into(), reason.to_string())
    }
}

/// Reads a text.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_text(path: &Path) -> Result<String, FileError> {
    std::fs::read_to_string(path).map_err(|error| FileError::read(path, error))
}

/// Reads a file of JSON as its type.
///
/// # Errors
/// [`FileError::Read`]: it cannot be read, or is not as the type has it.
pub fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    serde_json::from_str(&read_text(path)?).map_err(|error| FileError::read(path, error))
}

/// A file as JSON with its keys in alphabetical order, whatever the order of its type.
///
/// # Panics
/// For a type that is no JSON, which is a mistake in the type.
#[must_use]
pub fn in_order(file: &impl serde::Serialize) -> serde_json::Value {
    serde_json::to_value(file).expect("the files of a run are JSON")
}

/// Writes `value` as pretty JSON by [`write_whole`].
///
/// # Errors
/// What the system says, with the file's name.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> io::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    write_whole(path, &text).map_err(|error| named(path, &error))
}

/// Writes a file under a temporary name and renames it; what is no file, such as a terminal, is written as it stands.
///
/// # Errors
/// What the system says; then the file that was there before is as it was.
pub fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    // A device in whose place a file is put is gone for the whole machine.
    if std::fs::metadata(path).is_ok_and(|existing| !existing.is_file() && !existing.is_dir()) {
        return std::fs::write(path, text);
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let temporary = path.with_file_name(name);
    // A name that is on the disk before what it names is that of an empty file after a power cut.
    let written = File::create(&temporary)
        .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    written.inspect_err(|_| {
        // Half a file is no use; that it cannot be taken away changes nothing of what is reported.
        let _ = std::fs::remove_file(&temporary);
    })
}

pub(crate) fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_an_earlier_run_go_and_everything_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let others = ["bus.log", "notes.txt"];
        for name in results().iter().map(String::as_str).chain(others) {
            std::fs::write(folder.path().join(name), "of an earlier run").unwrap();
        }
        // Twice, because a folder without results is as good.
        for _ in 0..2 {
            clear_results(folder.path()).unwrap();
            let mut left: Vec<_> =
                std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            left.sort();
            assert_eq!(left, others);
        }
    }

    #[test]
    fn a_result_that_cannot_be_removed_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("summary.json")).unwrap();
        let message = clear_results(folder.path()).unwrap_err().to_string();
        assert!(message.contains("summary.json: "), "{message}");
    }

    #[test]
    fn a_file_is_written_whole_or_stays_and_a_device_stays_a_device() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        write_whole(&path, "before").unwrap();
        std::fs::create_dir(folder.path().join("a.json.part")).unwrap();
        assert!(write_whole(&path, "after").is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");

        let device = folder.path().join("out");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        write_whole(&device, "x").unwrap();
        assert!(std::fs::symlink_metadata(&device).unwrap().is_symlink(), "no file took its place");
    }
}
