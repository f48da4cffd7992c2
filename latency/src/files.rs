//! What a run left in its folder, read as far as it is there: what is missing or damaged is reported, and the rest is used.

use super::hlog::{self, BorrowedInterval};
use super::joined::Series;
use super::json_files::{ControllerFile, RunFile, SummaryFile};
use super::kinds::{PING_PONG, PING_PONGS, ROUND_TRIPS};
use super::reference::{self, Reference};
use super::samples::Samples;
use protocol::periods::CYCLE_S;
use realtime::machine::Hypervisor;
use realtime::{Grant, Machine};
use runlog::conditions::Conditions;
use runlog::controller_report::ControllerReport;
use runlog::flight_dump::{self, DumpName, EVENT_JSON, TIMING_CSV};
use runlog::ping_pong::PingPongFile;
use runlog::probe::{self, Gap};
use runlog::process::{HLOG_END, Process};
use runlog::run_folder::{
    CONDITIONS_JSON, CYCLICTEST_JSON, PING_PONG_JSON, PROBE_CSV, RUN_JSON, SUMMARY_JSON, read_json,
};
use runlog::summary::{ProcessReport, RunDescription, Summary};
use runlog::timing::{self, CycleTiming};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The emulator among the processes of a run.
pub(crate) const EMULATOR: &str = Process::Emulator.name();

/// Longest interval of a log whose maximum is one of a second; older logs hold the run in one interval.
const LONGEST_SECOND_S: f64 = 1.5;

/// What a run left in its folder.
#[derive(Clone, Debug, Default)]
pub struct RunFiles {
    /// The run's folder.
    pub(crate) folder: PathBuf,
    /// `summary.json`; `None` when missing.
    pub(crate) summary: Option<SummaryFile>,
    /// `run.json`; `None` when missing.
    pub(crate) run: Option<RunFile>,
    /// `conditions.json`; `None` when missing.
    pub(crate) conditions: Option<Conditions>,
    /// `controller*.json` by process.
    pub(crate) controllers: BTreeMap<String, ControllerFile>,
    /// Distributions of all logs by tag, with the maximum of each second.
    pub(crate) logged: BTreeMap<String, Series>,
    /// End of the last interval of a log, s from its base time.
    pub(crate) logged_until_s: f64,
    /// Rows of each process, rising by cycle: of the whole run, or those of the flight recorder.
    pub(crate) rows: BTreeMap<String, Vec<CycleTiming>>,
    /// Whether the rows are those of the whole run.
    pub(crate) whole: bool,
    /// Lateness of a process in a cycle as the flight recorder noted it, ns; it counts sensors that waited and were overtaken.
    pub(crate) recorded_late_ns: BTreeMap<String, BTreeMap<u64, u64>>,
    /// Gaps that the probe saw; nothing when it did not run.
    pub(crate) gaps: Option<Vec<Gap>>,
    /// `cyclictest.json`; `None` when missing.
    pub(crate) reference: Option<Reference>,
    /// Ping-pongs beside this run, by tag.
    pub(crate) ping_pongs: BTreeMap<String, Samples>,
    /// `ping-pong.json`; empty when missing.
    pub(crate) ping_pong: PingPongFile,
    /// What is missing or damaged, a sentence each.
    pub(crate) lacks: Vec<String>,
}

/// Whether a folder holds anything of a run.
pub(crate) fn is_run(folder: &Path) -> bool {
    let emulator = Process::Emulator;
    let names = [emulator.report(), RUN_JSON.to_owned(), emulator.hlog(), emulator.timing()];
    names.iter().any(|name| folder.join(name).is_file())
}

impl RunFiles {
    /// Reads the folder of a run that ended. What is missing or damaged stands in `lacks`.
    pub(crate) fn read(folder: &Path) -> Self {
        let mut run = Self { folder: folder.into(), ..Self::default() };
        run.summary = SummaryFile::of(run.json(SUMMARY_JSON));
        run.run = RunFile::of(run.json(RUN_JSON));
        run.conditions = run.json(CONDITIONS_JSON);
        run.note_misfit(SUMMARY_JSON, run.summary.as_ref().and_then(|file| file.misfit.clone()));
        run.note_misfit(RUN_JSON, run.run.as_ref().and_then(|file| file.misfit.clone()));
        for process in Process::ALL {
            if process != Process::Emulator {
                let name = process.report();
                if let Some(file) = ControllerFile::of(run.json(&name)) {
                    run.note_misfit(&name, file.misfit.clone());
                    run.controllers.insert(process.name().into(), file);
                }
            }
            run.take_log(&process.hlog());
            if let Some(rows) = run.parse(&process.timing(), timing::read) {
                run.whole = true;
                run.rows.insert(process.name().into(), rows);
            }
        }
        run.take_flights();
        run.gaps = run.parse(PROBE_CSV, probe::read);
        run.reference = run.parse(CYCLICTEST_JSON, reference::read);
        run.take_ping_pongs();
        run.tell_what_is_missing();
        run
    }

    /// Reads `run.json` of a run that still goes on, unless it was read before. Returns whether it is known; a file that is not
    /// whole yet is not.
    pub fn read_description(&mut self, folder: &Path) -> bool {
        if self.run.is_none() {
            self.run = read_json::<Value>(&folder.join(RUN_JSON)).ok().and_then(RunFile::of);
        }
        self.run.is_some()
    }

    /// The text of a file, nothing when it is not there.
    fn text(&mut self, name: &str) -> Option<String> {
        match std::fs::read_to_string(self.folder.join(name)) {
            Ok(text) => Some(text),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => {
                self.lacks.push(format!("{name} cannot be read and was left out: {error}"));
                None
            }
        }
    }

    fn parse<T, E: Display>(&mut self, name: &str, read: impl Fn(&str) -> Result<T, E>) -> Option<T> {
        let text = self.text(name)?;
        match read(&text) {
            Ok(parsed) => Some(parsed),
            Err(error) => {
                self.lacks.push(format!("{name} is damaged and was left out: {error}"));
                None
            }
        }
    }

    fn json<T: DeserializeOwned + Default>(&mut self, name: &str) -> T {
        self.parse(name, |text| serde_json::from_str(text)).unwrap_or_default()
    }

    /// A log, up to where it is damaged.
    fn take_log(&mut self, name: &str) {
        let Some(text) = self.text(name) else { return };
        let read = hlog::each(&text, |interval| self.take_interval(interval));
        if let Err(error) = read {
            self.lacks.push(format!("{name} is damaged and was read up to there: {error}"));
        }
    }

    /// The ping-pongs that `scripts/latency` put beside the run.
    fn take_ping_pongs(&mut self) {
        self.ping_pong = self.json(PING_PONG_JSON);
        for (name, _) in PING_PONGS {
            let file = format!("{PING_PONG}{name}{HLOG_END}");
            let Some(intervals) = self.parse(&file, hlog::read) else { continue };
            for interval in intervals {
                self.ping_pongs.entry(interval.tag).or_default().add(&interval.samples);
            }
        }
    }

    pub(crate) fn take_interval(&mut self, interval: BorrowedInterval<'_>) {
        let BorrowedInterval { tag, start_s, duration_s, histogram } = interval;
        // Logs from before the load axis had a round trip of its own name the drive's without its axis.
        let tag = if tag == "round-trip" { ROUND_TRIPS[0] } else { tag };
        let series = self.logged.entry(tag.to_owned()).or_default();
        series.samples.add_histogram(histogram);
        if !histogram.is_empty() && duration_s <= LONGEST_SECOND_S {
            let largest = series.maxima_ns.entry(start_s as u64).or_default();
            *largest = histogram.max().max(*largest);
        }
        self.logged_until_s = self.logged_until_s.max(start_s + duration_s);
    }

    /// What the flight recorder's dumps tell, and their rows for processes that did not write all of theirs.
    fn take_flights(&mut self) {
        let mut taken: BTreeMap<String, BTreeMap<u64, CycleTiming>> = BTreeMap::new();
        for (folder, DumpName { process, .. }) in flight_dump::list(&self.folder).unwrap_or_default() {
            if Process::of_name(&process).is_none() {
                continue;
            }
            let dump = format!("{}/{folder}", flight_dump::FOLDER);
            let event = self.parse(&format!("{dump}/{EVENT_JSON}"), |text| serde_json::from_str(text));
            if let Some(flight_dump::Event { cycle, late_ns, .. }) = event {
                self.recorded_late_ns.entry(process.clone()).or_default().insert(cycle, late_ns);
            }
            if self.rows.contains_key(&process) {
                continue;
            }
            let rows = self.parse(&format!("{dump}/{TIMING_CSV}"), timing::read).unwrap_or_default();
            taken.entry(process).or_default().extend(rows.into_iter().map(|row| (row.cycle, row)));
        }
        for (process, rows) in taken {
            self.rows.insert(process, rows.into_values().collect());
        }
    }

    /// Says that a file is not as its type has it, if so.
    fn note_misfit(&mut self, name: &str, misfit: Option<String>) {
        if let Some(reason) = misfit {
            self.lacks.push(format!("{name} is not as this version writes it: {reason}"));
        }
    }

    fn tell_what_is_missing(&mut self) {
        let mut lack = |what: &str| self.lacks.push(what.to_owned());
        if self.summary.is_none() {
            lack(
                "no readable summary.json: the emulator was killed or still runs; what it counted is not known",
            );
        }
        if self.run.is_none() {
            lack("no readable run.json: machine and command line are not known");
        }
        if self.controllers.is_empty() {
            lack("no readable controller*.json: what the controllers counted is not known");
        }
        if self.logged.is_empty() {
            lack("no readable *.hlog: percentiles are those of the summaries, without histogram and maxima");
        }
        if !self.whole {
            lack(
                "no *-timing.csv (run with --full-timing): no one-way latencies, and late cycles are known \
                 only from the flight recorder",
            );
        }
    }

    /// When the run began, s since 1970; nothing when it is not reported.
    pub(crate) fn started_unix_s(&self) -> Option<f64> {
        self.description()?.started_unix_s
    }

    /// Length of the run, s: its cycles, or what the logs hold.
    pub(crate) fn duration_s(&self) -> f64 {
        let cycles = self.counted().and_then(|summary| summary.cycles);
        cycles.map_or(self.logged_until_s, |cycles| cycles as f64 * CYCLE_S)
    }

    /// `summary.json`; `None` when missing.
    pub(crate) fn counted(&self) -> Option<&Summary> {
        self.summary.as_ref().map(|file| &file.summary)
    }

    /// `run.json`; `None` when missing.
    pub(crate) fn description(&self) -> Option<&RunDescription> {
        self.run.as_ref().map(|file| &file.description)
    }

    /// The machine in `run.json`; without facts when missing.
    pub(crate) fn machine(&self) -> Cow<'_, Machine> {
        self.description().map_or_else(Cow::default, |description| Cow::Borrowed(&description.machine))
    }

    /// The hypervisor in `run.json`; not recorded when missing.
    pub(crate) fn hypervisor(&self) -> Hypervisor {
        self.run.as_ref().map(|file| file.hypervisor.clone()).unwrap_or_default()
    }

    /// `conditions.json`; empty when missing.
    pub(crate) fn circumstances(&self) -> Conditions {
        self.conditions.clone().unwrap_or_default()
    }

    /// Each `controller*.json` by process.
    pub(crate) fn controller_reports(&self) -> impl Iterator<Item = (&str, &ControllerReport)> {
        self.controllers.iter().map(|(process, file)| (process.as_str(), &file.report))
    }

    /// Figures that `summary.json` and each `controller*.json` have in common, by process.
    pub(crate) fn process_reports(&self) -> impl Iterator<Item = (&str, &ProcessReport)> {
        let emulator = self.summary.iter().map(|file| (EMULATOR, &file.process));
        emulator.chain(self.controllers.iter().map(|(process, file)| (process.as_str(), &file.process)))
    }

    /// `summary.json` and each `controller*.json` as they stand, by process.
    pub(crate) fn reports_as_they_stand(&self) -> impl Iterator<Item = (&str, &Value)> {
        let emulator = self.summary.iter().map(|file| (EMULATOR, &file.json));
        emulator.chain(self.controllers.iter().map(|(process, file)| (process.as_str(), &file.json)))
    }

    /// What each process was granted for real time.
    pub(crate) fn granted(&self) -> impl Iterator<Item = (&str, &[Grant])> {
        let emulator = self.run.iter().map(|file| (EMULATOR, file.granted.as_slice()));
        emulator
            .chain(self.controllers.iter().map(|(process, file)| (process.as_str(), file.granted.as_slice())))
    }
}
