//! The latency report: what runs left behind, joined on one clock, its worst events explained, a reference beside it.
//!
//! | file | holds |
//! |---|---|
//! | [`model`] | what a report says: `report.json` |
//! | [`choice`] | which runs, in which groups |
//! | [`files`] | what a run left in its folder |
//! | [`json_files`] | its JSON files as their types |
//! | [`frame_faults`] | lost, late, duplicate and malformed frames in them |
//! | [`hlog`] | interval logs, read and written |
//! | [`probe`] | whether the spin-gap probe watched a CPU |
//! | [`mod@reference`] | cyclictest's own JSON |
//! | [`kinds`] | the distributions that a report knows |
//! | [`samples`] | percentiles, bins |
//! | [`joined`] | rows of rig and controllers on one clock |
//! | [`distributions`] | distributions of each run, and all runs added up |
//! | [`parts`] | the runs one by one |
//! | [`explain`] | late cycles with their causes |
//! | [`findings`] | what disturbed the runs as a whole |
//! | [`report_cause`] | the one cause of a whole report; that of an event is in `explain/rules.rs` |
//! | [`ratios`] | ours against the reference, pair by pair |
//! | [`tallies`] | counts that a reader looks for first |
//! | [`conditions`] | where and how it was measured |
//! | [`claim`] | whether that supports a latency claim |
//! | [`controlled`] | what was not controlled |
//! | [`comparison`] | groups of runs side by side |
//! | [`bounds`] | a threshold file held against a report |
//! | [`resolution`] | whether pairs suffice to say that a ratio keeps its bound |
//! | [`markdown`] | the summary for a merge request, and the short table |
//! | [`jitterdebugger`] | wake-up latencies in its JSON |
//! | [`output`] | all files of a report |
//! | [`page`] | the report as one page |
//! | [`table`] | the table of ratios that `scripts/latency` ends with |

#![warn(missing_docs)] // an interface of other crates

mod bounds;
pub mod choice;
pub mod claim;
mod comparison;
pub mod conditions;
mod controlled;
mod distributions;
mod explain;
pub mod files;
mod findings;
mod frame_faults;
pub mod hlog;
mod jitterdebugger;
mod joined;
mod json_files;
pub mod kinds;
pub mod markdown;
pub mod model;
pub mod output;
pub mod page;
mod parts;
mod probe;
mod ratios;
mod reference;
pub mod report_cause;
mod resolution;
pub mod samples;
pub mod table;
mod tallies;

#[cfg(test)]
mod made_up;

use self::choice::SelectedRun;
use self::files::RunFiles;
use self::joined::Series;
use self::model::{Report, SCHEMA, SCHEMA_VERSION};
use self::resolution::Verdict;
use self::samples::Samples;
use runlog::run_folder::{FileError, read_text};
use settings::SettingsError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Events that a report shows.
const WORST: usize = 10;

/// What keeps a report from being made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A folder that is no run and holds none.
    #[error(
        "{0} holds no run, nor do the folders in it: name a folder with summary.json, run.json, emulator.hlog or \
         emulator-timing.csv"
    )]
    NoRun(PathBuf),
    /// A comparison of one run.
    #[error(
        "--compare: one run cannot be compared; name another folder, or put folders into groups with --group NAME=FOLDER"
    )]
    OneRun,
    /// A group that is not written as NAME=FOLDER.
    #[error("--group {0}: write it as NAME=FOLDER")]
    Group(String),
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A threshold file with a mistake.
    #[error(transparent)]
    Bounds(#[from] SettingsError),
    /// A file of the report that cannot be written.
    #[error("cannot write {file}: {reason}; choose another folder with --out")]
    Write {
        /// The file, or the folder that cannot be made.
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
}

impl ReportError {
    fn write(file: &Path, reason: impl ToString) -> Self {
        Self::Write { file: file.into(), reason: reason.to_string() }
    }
}

/// A report with the runs and distributions that its files are made of.
#[derive(Debug)]
pub struct ReportWithSources {
    /// What `report.json` holds.
    pub report: Report,
    /// The runs that it is of, in its order.
    pub(crate) runs: Vec<RunFiles>,
    /// The distributions of each run, by tag.
    pub(crate) series: Vec<BTreeMap<String, Series>>,
    /// Those of all runs.
    pub(crate) sums: BTreeMap<String, Samples>,
}

/// Makes the report of these runs, with groups side by side if asked for.
pub fn make_report(selected: &[SelectedRun], title: Option<&str>, compare: bool) -> ReportWithSources {
    let runs = selected.iter().map(|selected| RunFiles::read(&selected.folder)).collect();
    let groups: Vec<_> = selected.iter().map(|selected| selected.group.as_deref()).collect();
    from_files(runs, &groups, title, compare)
}

/// Makes the report of runs that were read; `groups` may name the group of each.
pub(crate) fn from_files(
    mut runs: Vec<RunFiles>,
    groups: &[Option<&str>],
    title: Option<&str>,
    compare: bool,
) -> ReportWithSources {
    let series: Vec<_> = runs.iter_mut().map(distributions::of_run).collect();
    let sums = distributions::add_up(&series);
    let part = |(place, run): (usize, &RunFiles)| {
        let group = groups.get(place).copied().flatten();
        parts::part(run, group, distributions::percentiles_of_run(run, &series[place]))
    };
    let parts: Vec<_> = runs.iter().enumerate().map(part).collect();
    let mut events: Vec<_> =
        runs.iter().enumerate().flat_map(|(place, run)| explain::events(place, run)).collect();
    explain::sort_by_severity(&mut events);
    let mut events = explain::one_of_each_moment(events);
    let findings = findings::find(&runs, &events);
    events.truncate(WORST);
    events.iter_mut().for_each(|event| explain::beside::add(event, &runs[event.run]));
    let conditions = conditions::conditions(&runs);
    let report = Report {
        schema: SCHEMA.into(),
        schema_version: SCHEMA_VERSION,
        title: title.map_or_else(|| default_title(&runs), str::to_owned),
        made_unix_s: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |now| now.as_secs() as f64),
        claim: claim::claim(&runs, &conditions),
        conditions,
        distributions: distributions::shown(&series, &sums),
        ratios: ratios::ratios(&parts),
        worst: events,
        findings,
        comparison: if compare { comparison::compare(&parts) } else { None },
        runs: parts,
        bounds: Vec::new(),
    };
    ReportWithSources { report, runs, series, sums }
}

/// Adds a text to a list unless it is there.
fn add_new(list: &mut Vec<String>, text: String) {
    if !list.contains(&text) {
        list.push(text);
    }
}

fn default_title(runs: &[RunFiles]) -> String {
    match runs {
        [one] => format!("Latency report of {}", one.folder.display()),
        _ => format!("Latency report of {} runs", runs.len()),
    }
}

impl ReportWithSources {
    /// Holds the bounds of a threshold file against the report.
    ///
    /// # Errors
    /// [`ReportError::File`] and [`ReportError::Bounds`]: the file cannot be read, or bounds what no report has.
    pub fn judge(&mut self, file: &Path) -> Result<(), ReportError> {
        let text = read_text(file)?;
        self.report.bounds = bounds::judge(&text, file, &self.report)?;
        Ok(())
    }

    /// Whether a bound was broken; one that is not resolved was not.
    pub fn is_broken(&self) -> bool {
        self.report.bounds.iter().any(|bound| bound.verdict() == Verdict::Broken)
    }
}

#[cfg(test)]
mod tests;
