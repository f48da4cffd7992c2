//! An HdrHistogram log that grows while a run goes on: a line for each second and tag.
//!
//! The sum of a tag's lines is the whole run, and the largest value of a line is the maximum of its second. Lines reach the
//! file when their second is over, in one write: a process that is killed leaves what it measured but for the last second, and
//! no half line.
//!
//! ```text
//!   #[StartTime: …] #[BaseTime: …]
//!   Tag=emulator-wakeup,0.000,1.000,84351.000,HISTFAAA…
//!   Tag=emulator-step,0.000,1.000,…
//!   Tag=emulator-wakeup,1.000,1.000,…
//! ```
//! A tag that has no sample in a second has no line for it. An event belongs to the second in which it was over.
//!
//! # Source
//! As [`crate::histogram`].

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::clock::Instant;
use crate::deflate::DeflateSerializer;
use crate::histogram::{Percentiles, Recorder, start_of_log, tag, write_head, write_interval};

/// Length of an interval.
const INTERVAL_NS: u64 = 1_000_000_000;
/// How long after the end of a second its last samples may still come out of a queue, when nothing newer comes.
const LAST_CALL_NS: u64 = 250_000_000;

/// Samples under one tag: those of the whole run, and those of the second that is going on.
#[derive(Debug)]
pub struct TaggedRecorder {
    tag: String,
    whole: Recorder,
    interval: Recorder,
}

impl TaggedRecorder {
    /// A recorder without samples, whose lines in the log begin with `Tag=` and this tag.
    #[must_use]
    pub fn new(tag: String) -> Self {
        Self { tag, whole: Recorder::new(), interval: Recorder::new() }
    }

    /// Counts a sample of so many ns.
    pub fn record(&mut self, ns: u64) {
        self.each(|recorder| recorder.record(ns));
    }

    /// Does the same to both.
    pub(crate) fn each(&mut self, mut record: impl FnMut(&mut Recorder)) {
        record(&mut self.whole);
        record(&mut self.interval);
    }

    /// Percentiles of the whole run, ns.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        self.whole.percentiles()
    }
}

/// A log of which lines up to the last full second are in the file.
pub struct IntervalLog {
    path: PathBuf,
    file: File,
    serializer: DeflateSerializer,
    base: Instant,
    /// Start of the second that is going on, in ns after the base.
    from_ns: u64,
    lines: Vec<u8>,
    /// Bytes of whole lines in the file.
    length: u64,
    /// Lines written since they were taken, where somebody takes them.
    copy: Option<Vec<u8>>,
}

impl IntervalLog {
    /// Makes the file and writes its head.
    ///
    /// - `started_unix_s`: start of the log in s since 1970.
    /// - `base`: the same moment on the clock of the samples.
    ///
    /// # Errors
    /// What the system says, with the file's name; [`io::ErrorKind::InvalidInput`] when the start is no time.
    pub fn create(path: &Path, started_unix_s: f64, base: Instant) -> io::Result<Self> {
        let started = start_of_log(started_unix_s)?;
        let file = File::create(path).map_err(|error| named(path, &error))?;
        let mut log = Self {
            path: path.into(),
            file,
            serializer: DeflateSerializer::new(),
            base,
            from_ns: 0,
            lines: Vec::new(),
            length: 0,
            copy: None,
        };
        write_head(&mut log.lines, started)?;
        log.write_out()?;
        Ok(log)
    }

    /// Keeps a copy of the lines written from now on, for whoever looks on.
    #[must_use]
    pub fn with_copy(mut self) -> Self {
        self.copy = Some(Vec::new());
        self
    }

    /// The lines since they were taken the last time.
    pub(crate) fn take_copy(&mut self) -> Vec<u8> {
        self.copy.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Whether `at` lies in a later second than the one that is going on.
    pub(crate) fn is_over(&self, at: Instant) -> bool {
        self.since_base_ns(at) >= self.from_ns + INTERVAL_NS
    }

    /// The same when nothing newer comes: with some time for what may still be in a queue.
    pub(crate) fn is_long_over(&self, now: Instant) -> bool {
        self.since_base_ns(now) >= self.from_ns + INTERVAL_NS + LAST_CALL_NS
    }

    /// Writes the second that is going on, and begins the one that `at` lies in.
    pub(crate) fn turn<'a>(
        &mut self,
        at: Instant,
        recorders: impl Iterator<Item = &'a mut TaggedRecorder>,
    ) -> io::Result<()> {
        let at_ns = self.since_base_ns(at);
        let whole = at_ns >= self.from_ns + INTERVAL_NS;
        // The last second of a run may be shorter.
        let length_ns = if whole { INTERVAL_NS } else { (at_ns - self.from_ns.min(at_ns)).max(1_000_000) };
        let interval = (Duration::from_nanos(self.from_ns), Duration::from_nanos(length_ns));
        for TaggedRecorder { tag: name, interval: recorder, .. } in recorders {
            if recorder.histogram().is_empty() {
                continue;
            }
            write_interval(
                &mut self.lines,
                &mut self.serializer,
                tag(name)?,
                recorder.histogram(),
                interval,
            )?;
            recorder.reset();
        }
        self.from_ns = at_ns - at_ns % INTERVAL_NS;
        if let Some(copy) = &mut self.copy {
            copy.extend(&self.lines);
        }
        self.write_out()
    }

    fn since_base_ns(&self, at: Instant) -> u64 {
        at.as_nanos().saturating_sub(self.base.as_nanos())
    }

    fn write_out(&mut self) -> io::Result<()> {
        let written = self.file.write_all(&self.lines).map_err(|error| named(&self.path, &error));
        match written {
            Ok(()) => self.length += self.lines.len() as u64,
            // A full disk takes a part: it goes again. If it cannot, the error that led here is reported in any case.
            Err(_) => drop(self.file.set_len(self.length)),
        }
        self.lines.clear();
        written
    }
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}
