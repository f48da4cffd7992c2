//! What the writer keeps of time: histograms second by second, the timing table, arrivals, and the flight recorder.
//!
//! ```text
//!   rows, round trips ──► StageAccount ──► emulator.hlog          (a line for each second and tag)
//!   rows ───────────────► emulator-timing.csv                     (with --full-timing)
//!   frames received ────► Arrivals ──► summary.json
//!   rows, frames ───────► FlightRecorder ──► flight/emulator-…/   (late, slow, missed; faults; SIGUSR1)
//! ```
//! In real time only: simulated time is never late.

use crate::event::Event;
use crate::exchange::{AxisCycle, RoundTrip, TimingRecord};
use crate::pace::CYCLE;
use protocol::frames::{Frame, MESSAGES, MessageSpec, RIG_STATUS};
use realtime::flight::{Dump, Lateness, MOST_DUMPS, keep_first};
use realtime::stages::Further;
use realtime::{
    ArrivalFigures, Arrivals, CycleStages, FlightRecorder, IntervalLog, Percentiles, Severity, StageAccount,
    StageFigures, Stamped, Trigger, VitalCounts, VitalTotals, WallClockStep, WallClockWatch,
};
use runlog::candump::FrameRecord;
use runlog::flight_dump::{self, Log};
use runlog::run_folder::LineFile;
use runlog::timing::{self, CycleTiming};
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of this process in tags and folders.
pub const PROCESS: &str = "emulator";
/// Names of the axes in tags.
const AXES: [&str; 2] = ["drive", "load"];
/// Cycles whose vitals are left out of the totals: memory is touched for the first time.
const WARM_UP_CYCLES: u64 = 1000;
/// Steps of the wall clock that are kept.
const MOST_STEPS: usize = 100;

/// What to keep.
#[derive(Clone, Debug)]
pub struct EvidenceSetup {
    /// Whether every row is written.
    pub full_timing: bool,
    /// Lateness that freezes the flight recorder; `None` without one.
    pub flight_late: Option<Duration>,
    /// Start of the run in s since 1970.
    pub started_unix_s: f64,
    /// The same moment on the monotonic clock.
    pub base: realtime::Instant,
    /// Whether somebody takes the lines of the log too: [`Evidence::new_lines`].
    pub told: bool,
}

/// What `summary.json` says of it.
#[derive(Clone, Debug, Default)]
pub struct EvidenceReport {
    /// Stages of the cycle; `None` when nothing was measured.
    pub stages: Option<StageFigures>,
    /// Sensors handed over to command received, drive and load.
    pub round_trip_ns: Option<[Percentiles; 2]>,
    /// Age of commands when they begin to act, drive and load.
    pub command_age_ns: Option<[Percentiles; 2]>,
    /// Cycles sent, by the age in cycles of the command that acted.
    pub command_age_cycles: CommandAges,
    /// How regularly cyclic frames came.
    pub arrivals: Vec<ArrivalFigures>,
    /// The flight recorder's dumps.
    pub flight: FlightFigures,
    /// Steps of the wall clock.
    pub wall_clock_steps: Vec<WallClockStep>,
    /// What the kernel counted after the first second.
    pub vitals: VitalTotals,
}

/// Cycles sent, by the age in cycles of the command that acted over them; a cycle without a command is in none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CommandAges {
    /// Drive axis.
    pub drive: BTreeMap<u64, u64>,
    /// Load axis.
    pub load: BTreeMap<u64, u64>,
}

/// Dumps of the flight recorder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FlightFigures {
    /// Those in the folder.
    pub dumps: u64,
    /// Those that gave way to more severe ones, or were not worth a place.
    pub dropped: u64,
}

/// A row in the ring.
struct Row(CycleTiming);

impl Stamped for Row {
    fn at_ns(&self) -> u64 {
        self.0.woke_ns
    }
}

/// A frame in the ring.
struct Passed(FrameRecord);

impl Stamped for Passed {
    fn at_ns(&self) -> u64 {
        self.0.stamp_ns
    }
}

/// Keeps it all.
pub struct Evidence {
    folder: PathBuf,
    log: Log,
    account: StageAccount,
    round_trip: [Further; 2],
    /// Those of cycles whose rows are to come.
    trips: VecDeque<RoundTrip>,
    command_age: [Further; 2],
    ages: CommandAges,
    table: Option<LineFile>,
    arrivals: Vec<(u16, Arrivals)>,
    flight: Option<(FlightRecorder<Row, Passed>, Lateness)>,
    newest: CycleStages,
    wall_clock: WallClockWatch,
    steps: Vec<WallClockStep>,
    vitals: VitalTotals,
}

impl Evidence {
    /// Opens the files in `folder`.
    ///
    /// # Errors
    /// Names the file that cannot be made.
    pub fn create(folder: PathBuf, log: Log, setup: &EvidenceSetup) -> io::Result<Self> {
        let mut account = StageAccount::new(PROCESS, CYCLE);
        let round_trip = AXES.map(|axis| account.add(&format!("{axis}-round-trip")));
        let command_age = AXES.map(|axis| account.add(&format!("{axis}-command-age")));
        let hlog = folder.join(format!("{PROCESS}.hlog"));
        let log_file = IntervalLog::create(&hlog, setup.started_unix_s, setup.base)?;
        account.log_to(if setup.told { log_file.with_copy() } else { log_file });
        let mut table = None;
        if setup.full_timing {
            let mut file = LineFile::create(&folder.join(format!("{PROCESS}-timing.csv")))?;
            timing::write_head(file.lines())?;
            table = Some(file);
        }
        let flight =
            setup.flight_late.map(|limit| (FlightRecorder::new(), Lateness { limit, period: CYCLE }));
        let heard = MESSAGES.iter().filter(|message| is_heard_cyclically(message));
        let arrivals = heard.map(|message| (message.id, arrivals_of(message))).collect();
        Ok(Self {
            folder,
            log,
            account,
            round_trip,
            trips: VecDeque::new(),
            command_age,
            ages: CommandAges::default(),
            table,
            arrivals,
            flight,
            newest: CycleStages::default(),
            wall_clock: WallClockWatch::new(),
            steps: Vec::new(),
            vitals: VitalTotals::default(),
        })
    }

    /// Takes what the loop tells of a cycle.
    ///
    /// # Errors
    /// What the system says when a file cannot be written.
    pub fn timing(&mut self, record: &TimingRecord) -> io::Result<()> {
        match record {
            TimingRecord::Cycle { row, axes } => self.cycle(row, axes),
            TimingRecord::Stopped { first, skipped, late_ns, woke_ns } => {
                self.account.record_missed(*late_ns, *skipped);
                let severity = Severity::Overrun { ns: *late_ns };
                let at = realtime::Instant::from_nanos(*woke_ns);
                self.freeze(Trigger { severity, cycle: *first, at, late_ns: *late_ns, slow_ns: 0 });
                Ok(())
            }
        }
    }

    fn cycle(&mut self, row: &CycleTiming, axes: &[AxisCycle; 2]) -> io::Result<()> {
        let stages = stages_of(row);
        self.account.record(&stages)?;
        self.newest = stages;
        self.record_trips(row.cycle);
        for (axis, cycle) in axes.iter().enumerate() {
            if let Some(ns) = cycle.age_ns(row.due_ns) {
                self.account.record_further(self.command_age[axis], ns);
            }
            if cycle.age_cycles > 0 {
                let ages = if axis == 0 { &mut self.ages.drive } else { &mut self.ages.load };
                *ages.entry(cycle.age_cycles).or_default() += 1;
            }
        }
        if row.cycle >= WARM_UP_CYCLES {
            self.vitals.add(&counts_of(row));
        }
        if let Some((flight, lateness)) = &mut self.flight {
            flight.row(Row(*row));
            if let Some(trigger) = lateness.judge(&stages) {
                self.freeze(trigger);
            }
        }
        let Some(table) = &mut self.table else { return Ok(()) };
        timing::write_row(table.lines(), row)?;
        table.write_when_full()
    }

    /// Takes a round trip. It waits for the row of its cycle, and so belongs to the second of that, however late both are taken.
    pub fn round_trip(&mut self, trip: RoundTrip) {
        self.trips.push_back(trip);
    }

    /// Records the round trips up to this cycle.
    fn record_trips(&mut self, cycle: u64) {
        while let Some(RoundTrip { axis, ns, .. }) = self.trips.pop_front_if(|trip| trip.cycle <= cycle) {
            self.account.record_further(self.round_trip[axis], ns);
        }
    }

    /// Takes a frame that was sent or received.
    pub fn frame(&mut self, record: &FrameRecord) {
        let id = record.frame.standard_id();
        let heard = self.arrivals.iter_mut().find(|(heard, _)| Some(*heard) == id);
        if let Some((_, arrivals)) = heard.filter(|_| Frame::decode(&record.frame).is_ok()) {
            arrivals.note(realtime::Instant::from_nanos(record.stamp_ns));
        }
        if let Some((flight, _)) = &mut self.flight {
            flight.frame(Passed(*record));
        }
    }

    /// Takes an event: a fault freezes the recorder.
    pub fn event(&mut self, event: &Event) {
        if event.kind.is_fault() {
            self.freeze(Trigger::other(Severity::Fault, event.cycle, self.newest_done()));
        }
    }

    /// What is due at `now`, after everything was taken; `asked` when a signal asked for a dump.
    ///
    /// # Errors
    /// What the system says when a file cannot be written.
    pub fn poll(&mut self, now: realtime::Instant, asked: bool) -> io::Result<()> {
        if asked {
            self.freeze(Trigger::other(Severity::Signal, self.newest.cycle, now));
        }
        let step = self.wall_clock.look();
        self.steps.extend(step.filter(|_| self.steps.len() < MOST_STEPS));
        self.account.advance(now)?;
        let Self { flight: Some((flight, _)), folder, log, .. } = self else { return Ok(()) };
        let mut written = Ok(());
        flight.advance(now, |dump| keep_first(&mut written, write_dump(folder, log, &dump)));
        written
    }

    /// Lines of the log that are new.
    pub fn new_lines(&mut self) -> Vec<u8> {
        self.account.take_copy()
    }

    /// Writes the table out.
    ///
    /// # Errors
    /// What the system says.
    pub fn flush(&mut self) -> io::Result<()> {
        self.table.as_mut().map_or(Ok(()), LineFile::write_out)
    }

    /// Writes what is left, and tells the figures, those of a failed file too.
    pub fn finish(mut self, now: realtime::Instant) -> (EvidenceReport, io::Result<()>) {
        let mut written = self.flush();
        self.record_trips(u64::MAX);
        if let Some((flight, _)) = &mut self.flight {
            let (folder, log) = (&self.folder, &self.log);
            flight.finish(|dump| keep_first(&mut written, write_dump(folder, log, &dump)));
        }
        written = written.and(self.account.finish(now).map(drop));
        let of = |further: [Further; 2]| further.map(|further| self.account.further(further));
        let flight = self.flight.as_ref();
        let report = EvidenceReport {
            stages: Some(self.account.figures()),
            round_trip_ns: Some(of(self.round_trip)),
            command_age_ns: Some(of(self.command_age)),
            arrivals: self
                .arrivals
                .iter()
                .map(|(_, arrivals)| arrivals.figures())
                .filter(|it| it.count > 0)
                .collect(),
            flight: flight.map_or(FlightFigures::default(), |(flight, _)| FlightFigures {
                dumps: flight.dumps(),
                dropped: flight.dropped(),
            }),
            command_age_cycles: self.ages,
            wall_clock_steps: self.steps,
            vitals: self.vitals,
        };
        (report, written)
    }

    fn freeze(&mut self, trigger: Trigger) {
        let Some((flight, _)) = &mut self.flight else { return };
        flight.trigger(trigger);
        if trigger.severity == Severity::Signal {
            let folder = self.folder.join(flight_dump::FOLDER);
            let folder = folder.display();
            if flight.will_keep(Severity::Signal) {
                eprintln!("emulator: asked for the last seconds; they go to {folder}");
            } else {
                eprintln!(
                    "emulator: asked for the last seconds, but {folder} has {MOST_DUMPS} dumps that were asked for, and no more \
                     are kept; move it away and start anew"
                );
            }
        }
    }

    fn newest_done(&self) -> realtime::Instant {
        realtime::Instant::from_nanos(self.newest.done_ns)
    }
}

fn write_dump(folder: &Path, log: &Log, dump: &Dump<'_, Row, Passed>) -> io::Result<()> {
    if let Some(less_severe) = dump.replaces {
        let name = flight_dump::name(PROCESS, less_severe.cycle, &less_severe.severity.to_string());
        flight_dump::remove(folder, &name)?;
    }
    let Trigger { severity, cycle, at, late_ns, slow_ns } = dump.trigger;
    let event = flight_dump::Event {
        process: PROCESS.into(),
        trigger: severity.to_string(),
        cycle,
        at_monotonic_ns: at.as_nanos(),
        late_ns,
        slow_ns,
        window_from_ns: dump.from.as_nanos(),
        window_to_ns: dump.to.as_nanos(),
        ..flight_dump::Event::default()
    };
    let rows = dump.rows.iter().map(|row| &row.0);
    let frames = dump.frames.iter().map(|passed| (passed.0.stamp_ns, &passed.0.frame));
    flight_dump::write(folder, &event, rows, frames, log)
}

/// Whether others than the rig send it without end.
fn is_heard_cyclically(message: &MessageSpec) -> bool {
    message.sender != RIG_STATUS.sender
        && message.cycle_time_ms > 0
        && message.send_type.starts_with("Cyclic")
}

fn arrivals_of(message: &MessageSpec) -> Arrivals {
    let arrivals = Arrivals::new(message.name, Duration::from_millis(message.cycle_time_ms.into()));
    if message.send_type == "Cyclic" { arrivals } else { arrivals.on_change_too() }
}

/// The row as the account takes it.
fn stages_of(row: &CycleTiming) -> CycleStages {
    CycleStages {
        cycle: row.cycle,
        skipped: row.skipped,
        due_ns: row.due_ns,
        woke_ns: row.woke_ns,
        receive_ns: row.receive_ns,
        step_ns: row.step_ns,
        send_ns: row.send_ns,
        done_ns: row.done_ns,
    }
}

/// The vitals of a row as the totals take them.
fn counts_of(row: &CycleTiming) -> VitalCounts {
    let vitals = &row.vitals;
    VitalCounts {
        minor_faults: vitals.minor_faults,
        major_faults: vitals.major_faults,
        voluntary_switches: vitals.voluntary_switches,
        involuntary_switches: vitals.involuntary_switches,
        run_delay_ns: vitals.run_delay_ns,
        continued: vitals.continued,
        cpu: vitals.cpu,
    }
}

#[cfg(test)]
mod tests;
