//! Exports frames and tables of a run to the formats of other tools: CSV, MDF4, MCAP, ASC, BLF, and a trace of its timing.
//!
//! ```text
//!   bus.log ─► recorded_log.rs ─┬─► signals.rs (rig.dbc) ─┬─► table.rs   CSV
//!                               │                         ├─► mdf4.rs    MDF4
//!                               │                         └─► mcap.rs    MCAP ◄── run_table.rs ◄── measurement.csv …
//!                               ├─► frames ─────────────────► trace.rs   trace ◄── *-timing.csv, faults.csv
//!                               └─► frames ── python-can ───► foreign.rs ASC, BLF
//! ```
//!
//! Files are written as `FILE.part` and renamed when complete. The formats are described in `bench/docs/logs.md`.

pub(crate) mod cli;
mod controllers;
mod foreign;
mod mcap;
mod mdf4;
mod run_table;
mod signals;
mod table;
mod trace;

use crate::recorded_log::{RecordedLog, RecordedLogError};
use crate::{say, warn};
use cli::{ExportArguments, Format};
use protocol::exit::Exit;
use runlog::run_folder::{FileError, MEASUREMENT_CSV};
use signals::{LEFT_OUT, Signals};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use table::TimeAxis;

/// Most rows with a fixed period: a log with a gap of years must not fill the disk.
const MOST_HELD_ROWS: u64 = 100_000_000;

#[derive(Debug, thiserror::Error)]
pub(crate) enum ExportError {
    #[error(transparent)]
    Log(#[from] RecordedLogError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(
        "{python}: {reason}; asc and blf want a python with python-can 4 ('python3 -m venv VENV', \
         'VENV/bin/pip install python-can==4.6.1'): name it with --python VENV/bin/python, or in AIRBENCH_PYTHON"
    )]
    Python { python: PathBuf, reason: String },
    #[error("--every-ms goes with --to csv: the others hold every frame with its own time")]
    EveryMs,
    #[error(
        "a row every {every_ms} ms makes more than {MOST_HELD_ROWS} rows of this log: cut it, or take a longer time"
    )]
    TooManyRows {
        /// Time between two rows, ms.
        every_ms: u32,
    },
}

/// Exports a log and prints a summary.
///
/// # Errors
/// [`ExportError`]; the file is unchanged or absent then.
pub(crate) fn run(arguments: &ExportArguments) -> Result<Exit, ExportError> {
    let ExportArguments { to, out, every_ms, .. } = arguments;
    if every_ms.is_some() && *to != Format::Csv {
        return Err(ExportError::EveryMs);
    }
    let log = RecordedLog::read(&arguments.source, arguments.interface.as_deref())?;
    log.warn_of_cut_line();
    let part = part_of(out);
    let done = match to {
        Format::Csv | Format::Mdf4 => as_signals(&part, &log, *to, *every_ms),
        Format::Mcap => as_recording(&part, &log),
        Format::Trace => as_trace(&part, &log),
        Format::Asc | Format::Blf => as_frames(&part, &log, *to, arguments.python.as_deref()),
    };
    let renamed = done.and_then(|reported| {
        std::fs::rename(&part, out).map_err(|error| FileError::write(out, error))?;
        Ok(reported)
    });
    let (reported, exit) = renamed.inspect_err(|_| {
        // An incomplete file is of no use; a failure to remove it changes nothing.
        let _ = std::fs::remove_file(&part);
    })?;
    say(&format!("{}: {reported}", out.display()));
    Ok(exit)
}

type ExportResult = (String, Exit);

fn as_signals(
    part: &Path,
    log: &RecordedLog,
    format: Format,
    every_ms: Option<u32>,
) -> Result<ExportResult, ExportError> {
    let signals = signals_of(log, "are left out");
    let frames: usize = signals.messages.iter().map(|message| message.frames.len()).sum();
    let channels: usize = signals.messages.iter().map(|message| message.spec.signals.len()).sum();
    let origin_ns = log.origin_ns();
    let written = |error: &dyn std::fmt::Display| FileError::write(part, error);
    let rows = if format == Format::Csv {
        let stamps = || log.frames.iter().map(|logged| logged.record.stamp_ns);
        let length_ns = stamps().max().unwrap_or(0) - stamps().min().unwrap_or(0);
        if let Some(every_ms) = every_ms
            && length_ns / (u64::from(every_ms) * 1_000_000) > MOST_HELD_ROWS
        {
            return Err(ExportError::TooManyRows { every_ms });
        }
        let rows = create(part).and_then(|mut file| {
            let rows = table::write(&mut file, &signals, TimeAxis { origin_ns, every_ms })?;
            file.flush().map(|()| rows)
        });
        format!(" in {} rows", rows.map_err(|error| written(&error))?)
    } else {
        let path = part.to_str().ok_or_else(|| written(&"its name is no UTF-8"))?;
        mdf4::write(path, &signals, origin_ns).map_err(|error| written(&error))?;
        format!(" in {} groups", signals.messages.len())
    };
    let origin = if log.cycle_zero_ns.is_some() { "cycle 0" } else { "the first frame" };
    Ok((format!("{channels} signals of {frames} frames{rows}; time counts from {origin}"), Exit::Good))
}

/// The signals of a log; warns of frames without signals.
fn signals_of(log: &RecordedLog, consequence: &str) -> Signals {
    let signals = Signals::of(log);
    for (left_out, what) in signals.left_out.iter().zip(LEFT_OUT).filter(|(left_out, _)| left_out.frames > 0)
    {
        let (file, line, frames) = (log.file.display(), left_out.first_line, left_out.frames);
        warn(&format!("{file}:{line}: {frames} frames {what} {consequence}"));
    }
    signals
}

fn as_recording(part: &Path, log: &RecordedLog) -> Result<ExportResult, ExportError> {
    let signals = signals_of(log, "are in /can alone");
    let mcap::WriteCounts { channels, messages } = mcap::write(part, log, &signals, run_folder(log))?;
    Ok((format!("{messages} messages of {channels} channels"), Exit::Good))
}

fn as_trace(part: &Path, log: &RecordedLog) -> Result<ExportResult, ExportError> {
    let trace::WriteCounts { frames, cycles, faults } = trace::write(part, log, run_folder(log))?;
    if cycles == 0 {
        warn("no cycles: their timing is recorded in real time, by --full-timing of emulator and controller");
    }
    Ok((format!("{frames} frames, {cycles} cycles, {faults} marks of faults"), Exit::Good))
}

/// The run's folder if its tables can be aligned with the log; warns otherwise.
fn run_folder(log: &RecordedLog) -> Option<&Path> {
    let folder = log.file.parent()?;
    if log.cycle_zero_ns.is_some() {
        return Some(folder);
    }
    if folder.join(MEASUREMENT_CSV).exists() {
        let folder = folder.display();
        warn(&format!(
            "{folder}: no summary.json says when cycle 0 of this log was: the tables are left out"
        ));
    }
    None
}

fn as_frames(
    part: &Path,
    log: &RecordedLog,
    format: Format,
    python: Option<&Path>,
) -> Result<ExportResult, ExportError> {
    // Checks here that the file can be written, for a better message.
    create(part).map_err(|error| FileError::write(part, error))?;
    let named = std::env::var_os("AIRBENCH_PYTHON").map(PathBuf::from);
    let python = python.map(Path::to_owned).or(named).unwrap_or_else(|| "python3".into());
    let reported = format!("{} frames", log.frames.len());
    match foreign::write(part, log, format, &python)? {
        None => Ok((format!("{reported}, read back equal"), Exit::Good)),
        Some(output) => {
            warn(&format!(
                "the written file differs when it is read back: {output} (number of frames, first of them)"
            ));
            Ok((reported, Exit::BoundBroken))
        }
    }
}

fn create(path: &Path) -> io::Result<BufWriter<File>> {
    File::create(path).map(|file| BufWriter::with_capacity(1 << 20, file))
}

/// Path of the file while it is incomplete.
pub(crate) fn part_of(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".part");
    name.into()
}
