//! All files of a report: for programs, for merge requests, for people, for the tools that others use.
//!
//! | file | for |
//! |---|---|
//! | `report.json` | programs |
//! | `report.md` | merge requests |
//! | `report.html` | people |
//! | `latency.hlog` | HdrHistogram's tools: each distribution of each run under its tag |
//! | `jitterdebugger.json` | jitterplot and its like |

use super::hlog::{self, Interval};
use super::{ReportError, ReportWithSources, jitterdebugger, markdown, page};
use runlog::run_folder::{REPORT_HTML, REPORT_JSON, write_json};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes the files into `folder`, or only the Markdown.
///
/// # Errors
/// [`ReportError::Write`] with the file that cannot be written.
pub fn write(made: &ReportWithSources, folder: &Path, markdown_only: bool) -> Result<(), ReportError> {
    std::fs::create_dir_all(folder).map_err(|error| ReportError::write(folder, error))?;
    let text = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|error| ReportError::write(&path, error))
    };
    text("report.md", markdown::summary(&made.report))?;
    if markdown_only {
        return Ok(());
    }
    text(REPORT_HTML, page::page(&made.report))?;
    let path = folder.join(REPORT_JSON);
    write_json(&path, &made.report).map_err(|error| ReportError::write(&path, error))?;
    let path = folder.join("jitterdebugger.json");
    write_json(&path, &jitterdebugger::value(&made.sums, &made.runs))
        .map_err(|error| ReportError::write(&path, error))?;
    let path = folder.join("latency.hlog");
    log(made, &path).map_err(|error| ReportError::write(&path, error))
}

/// Each distribution of each run as one interval, from the run's start on; the base time is that of the first run.
fn log(made: &ReportWithSources, path: &Path) -> std::io::Result<()> {
    let starts = made.runs.iter().filter_map(super::files::RunFiles::started_unix_s);
    let base_unix_s = starts.fold(f64::INFINITY, f64::min);
    let base_unix_s = if base_unix_s.is_finite() { base_unix_s } else { 0.0 };
    let mut intervals = Vec::new();
    for (run, series) in made.runs.iter().zip(&made.series) {
        let start_s = (run.started_unix_s().unwrap_or(base_unix_s) - base_unix_s).max(0.0);
        let duration_s = run.duration_s();
        let of = |(tag, series): (&String, &super::joined::Series)| Interval {
            tag: tag.clone(),
            start_s,
            duration_s,
            samples: series.samples.clone(),
        };
        intervals.extend(series.iter().map(of));
    }
    // Readers expect intervals in the order of time.
    intervals.sort_by(|a, b| a.start_s.total_cmp(&b.start_s).then_with(|| a.tag.cmp(&b.tag)));
    let mut file = BufWriter::new(File::create(path)?);
    hlog::write(&mut file, base_unix_s, &intervals)?;
    file.flush()
}
