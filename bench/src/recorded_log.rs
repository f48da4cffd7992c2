//! A recorded log of the bus (`candump -L`), checked to its last line before it is used.
//!
//! A run's folder stands for its `bus.log`; with the start of cycle 0 from its `summary.json`, times count from there, as in
//! `measurement.csv`. Times of a log alone count from its first frame.
//!
//! Frames are kept in memory, 33 bytes each: an hour of a rig with both controllers some 600 MB.

use crate::warn;
use runlog::candump::{LogError, LogLine, LogReader};
use runlog::run_folder::{BUS_LOG, SUMMARY_JSON};
use runlog::summary::JoinedSummary;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Largest distance of cycle 0 from the log's first frame, s: beyond it the summary is of another run.
const NEAR_ZERO_S: f64 = 60.0;

const MOST_INTERFACES: usize = 64;

#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordedLogError {
    #[error("cannot read {file}: {reason}; give a run's folder, or a log of 'candump -L'")]
    Open { file: PathBuf, reason: String },
    #[error("{file}:{error}")]
    Line {
        file: PathBuf,
        /// Line, column and what is wrong.
        error: LogError,
    },
    #[error("{file}:{line}: more than {MOST_INTERFACES} interfaces: is this a log of 'candump -L'?")]
    ManyInterfaces {
        file: PathBuf,
        /// Line of the first frame beyond the limit.
        line: u64,
    },
    #[error("{0} holds no frame")]
    Empty(PathBuf),
}

#[derive(Clone, Debug)]
pub(crate) struct RecordedLog {
    pub file: PathBuf,
    /// Its frames in the order of the file; at least one.
    pub frames: Vec<LogLine>,
    /// For each frame the index of its interface in `interfaces`.
    pub seen_at: Vec<u8>,
    /// Names of the interfaces, in order of appearance.
    pub interfaces: Vec<String>,
    /// Number of the last line, if it was incomplete and left out.
    pub cut_line: Option<u64>,
    /// Start of cycle 0, ns since the log's epoch, where the run's summary has it.
    pub cycle_zero_ns: Option<u64>,
}

impl RecordedLog {
    /// Reads `path`, a run's folder or a log; with `interface`, the frames of that interface alone.
    pub(crate) fn read(path: &Path, interface: Option<&str>) -> Result<Self, RecordedLogError> {
        let file = if path.is_dir() { path.join(BUS_LOG) } else { path.to_owned() };
        let opened = File::open(&file).map_err(|error| {
            let (file, reason) = (file.clone(), error.to_string());
            RecordedLogError::Open { file, reason }
        })?;
        let mut reader = LogReader::new(BufReader::with_capacity(1 << 20, opened));
        let (mut frames, mut seen_at, mut interfaces) = (Vec::new(), Vec::new(), Vec::<String>::new());
        loop {
            match reader.read() {
                Ok(Some((_, name))) if interface.is_some_and(|wanted| wanted != name) => {}
                Ok(Some((line, name))) => {
                    let known = interfaces.iter().position(|known| known == name);
                    if known.is_none() && interfaces.len() == MOST_INTERFACES {
                        return Err(RecordedLogError::ManyInterfaces { file, line: line.line });
                    }
                    let place = known.unwrap_or_else(|| {
                        interfaces.push(name.to_owned());
                        interfaces.len() - 1
                    });
                    frames.push(line);
                    seen_at.push(place as u8); // below the most
                }
                Ok(None) => break,
                Err(error) => return Err(RecordedLogError::Line { file, error }),
            }
        }
        let Some(first): Option<&LogLine> = frames.first() else { return Err(RecordedLogError::Empty(file)) };
        let cycle_zero_ns = reported_zero_ns(&file, first.record.stamp_ns);
        Ok(Self { file, cut_line: reader.cut_line, frames, seen_at, interfaces, cycle_zero_ns })
    }

    /// Origin of times, ns since the log's epoch: cycle 0, or the first frame.
    pub(crate) fn origin_ns(&self) -> u64 {
        self.cycle_zero_ns.unwrap_or_else(|| self.frames[0].record.stamp_ns)
    }

    /// Warns of an incomplete last line.
    pub(crate) fn warn_of_cut_line(&self) {
        if let Some(line) = self.cut_line {
            let file = self.file.display();
            warn(&format!("{file}:{line}: the last line is cut, and left out: its writer was killed"));
        }
    }
}

/// Start of cycle 0, from the `summary.json` beside a run's log.
fn reported_zero_ns(file: &Path, first_ns: u64) -> Option<u64> {
    if file.file_name()? != BUS_LOG {
        return None;
    }
    let summary = JoinedSummary::read(&file.parent()?.join(SUMMARY_JSON)).ok()?;
    let zero_s = summary.bus_log_cycle_zero_s?;
    // Stamps of a log are whole microseconds, and so is its origin: an f64 of this size is not exact below them.
    let near = zero_s >= 0.0 && (zero_s - first_ns as f64 * 1e-9).abs() < NEAR_ZERO_S;
    near.then(|| (zero_s * 1e6).round() as u64 * 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        (folder, file)
    }

    #[test]
    fn a_wrong_line_is_refused_with_file_line_and_column() {
        let (_folder, file) = written("a.log", "(0.000001) a 120#\n(0.000002) a 120#0\n\n");
        let error = RecordedLog::read(&file, None).unwrap_err().to_string();
        assert!(error.contains("a.log:2:18: a byte has two digits"), "{error}");
    }

    #[test]
    fn one_interface_of_several_can_be_taken() {
        let (_folder, file) = written("a.log", "(0.1) a 120#\n(0.2) b 121#\n(0.3) a 122#\n(0.");
        let all = RecordedLog::read(&file, None).unwrap();
        assert_eq!((all.frames.len(), all.interfaces.len(), all.cut_line), (3, 2, Some(4)));
        assert_eq!(all.seen_at, [0, 1, 0]);
        assert_eq!(RecordedLog::read(&file, Some("b")).unwrap().frames[0].line, 2);
        assert!(matches!(RecordedLog::read(&file, Some("c")), Err(RecordedLogError::Empty(_))));
    }

    #[test]
    fn interfaces_without_end_are_refused() {
        let text: String = (0..70).map(|number| format!("(0.1) can{number} 120#\n")).collect();
        let (_folder, file) = written("a.log", &text);
        let error = RecordedLog::read(&file, None).unwrap_err().to_string();
        assert!(error.contains("a.log:65: more than 64 interfaces"), "{error}");
    }

    #[test]
    fn times_count_from_cycle_zero_where_the_summary_is_of_this_run() {
        let (folder, _file) = written("bus.log", "(1700000000.000500) a 120#\n");
        let origin_ns = || RecordedLog::read(folder.path(), None).unwrap().origin_ns();
        assert_eq!(origin_ns(), 1_700_000_000_000_500_000);
        for (zero, expected_ns) in
            [("1700000000.000123", 1_700_000_000_000_123_000), ("1.5", 1_700_000_000_000_500_000)]
        {
            let summary = format!("{{\"bus_log_cycle_zero_s\": {zero}}}");
            std::fs::write(folder.path().join("summary.json"), summary).unwrap();
            assert_eq!(origin_ns(), expected_ns);
        }
    }
}
