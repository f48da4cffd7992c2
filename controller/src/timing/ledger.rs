//! What was stamped, recorded: histograms second by second, the timing table, arrivals, the flight recorder.
//!
//! ```text
//!   [measured] ──► StageAccount ──► controller.hlog        [frames] ──► arrivals of each cyclic frame
//!              ──► controller-timing.csv, if asked for               ──► flight recorder's frames
//!              ──► flight recorder's rows ── late, slow, overrun; a fault; SIGUSR1 ──► flight/controller-…/
//! ```
//!
//! It belongs to the recorder's thread, which may wait for the disk. *Late* is the longest wait of sensors that ended with a
//! wake-up, *slow* the work of a cycle. *Overrun* is a cycle that has no answer, be its sensors overtaken, lost, or
//! never sent: how late we were ourselves says `late_ns` of the event.

use super::{Measured, Passed};
use crossbeam_channel::Receiver;
use protocol::frames::{Frame, MessageSpec};
use realtime::flight::{Dump, Lateness, MOST_DUMPS, keep_first};
use realtime::{
    ArrivalFigures, Arrivals, Clock, CycleStages, FlightRecorder, Freeze, Instant, IntervalLog,
    MonotonicClock, Severity, StageAccount, StageFigures, Stamped, Trigger, VitalCounts, VitalTotals,
};
use runlog::flight_dump::{self, Event, Log};
use runlog::run_folder::LineFile;
use runlog::timing::{CycleTiming, write_head, write_row};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Time from one cycle to the next.
const PERIOD: Duration = Duration::from_millis(1);
/// Start of a run that the totals of the vitals leave out: memory is touched for the first time.
const WARM_UP_NS: u64 = 1_000_000_000;

/// Longest time from a wake-up to a row that answers after it; beyond, nobody answers, such as before the first tick.
const ANSWER_NS: u64 = 1_000_000_000;

/// What a ledger is made of.
pub struct LedgerSetup {
    /// The run's folder.
    pub folder: PathBuf,
    /// Name of the process in files and tags.
    pub process: String,
    /// Whether every cycle is written.
    pub full_timing: bool,
    /// Longest wait and longest work that freeze no flight recorder; `None` without one.
    pub flight_late: Option<Duration>,
    /// How the frames of a dump are written.
    pub log: Log,
    /// Start of the run, s since 1970.
    pub started_unix_s: f64,
    /// The same on the clock of the stamps.
    pub started: Instant,
    /// Set by SIGUSR1.
    pub freeze: Freeze,
    /// Rows and waits.
    pub measured: Receiver<Measured>,
    /// Frames.
    pub frames: Receiver<Passed>,
}

/// What a run's timing was, for its report.
#[derive(Clone, Debug, Serialize)]
pub struct TimingFigures {
    /// Percentiles of the stages.
    #[serde(flatten)]
    pub stages: StageFigures,
    /// How regularly each cyclic frame came.
    pub arrivals: Vec<ArrivalFigures>,
    /// What the kernel counted after the first second.
    pub vitals: VitalTotals,
    /// What the flight recorder wrote.
    pub flight: FlightFigures,
}

/// Account of a flight recorder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FlightFigures {
    /// Dumps in the folder.
    pub dumps: u64,
    /// Dumps that gave way to more severe ones, or were not written.
    pub dropped: u64,
}

impl TimingFigures {
    /// Of a run whose time is not real.
    #[must_use]
    pub fn none() -> Self {
        Self {
            stages: StageAccount::new("none", PERIOD).figures(),
            arrivals: Vec::new(),
            vitals: VitalTotals::default(),
            flight: FlightFigures::default(),
        }
    }
}

/// A row in the ring, by the time at which the thread woke for it.
struct Row(CycleTiming);

impl Stamped for Row {
    fn at_ns(&self) -> u64 {
        self.0.woke_ns
    }
}

impl Stamped for Passed {
    fn at_ns(&self) -> u64 {
        self.stamp_ns
    }
}

/// A flight recorder and where its dumps go.
struct Flight {
    ring: FlightRecorder<Row, Passed>,
    lateness: Lateness,
    newest_cycle: u64,
    freeze: Freeze,
    folder: PathBuf,
    process: String,
    log: Log,
}

/// Records what was measured.
pub struct Ledger {
    measured: Receiver<Measured>,
    frames: Receiver<Passed>,
    account: StageAccount,
    table: Option<LineFile>,
    arrivals: BTreeMap<u16, Arrivals>,
    flight: Option<Flight>,
    vitals: VitalTotals,
    first_ns: Option<u64>,
    /// Sensors that begin no row and wait for the row that answers after them.
    waiting: Vec<Wait>,
}

/// Sensors that waited for a wake-up.
#[derive(Clone, Copy)]
struct Wait {
    arrived_ns: u64,
    woke_ns: u64,
}

impl Wait {
    fn ns(self) -> u64 {
        self.woke_ns.saturating_sub(self.arrived_ns)
    }
}

impl Ledger {
    /// Makes the files.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn create(setup: LedgerSetup) -> io::Result<Self> {
        let LedgerSetup { folder, process, log, freeze, .. } = setup;
        let mut account = StageAccount::new(&process, PERIOD);
        let hlog = folder.join(format!("{process}.hlog"));
        account.log_to(IntervalLog::create(&hlog, setup.started_unix_s, setup.started)?);
        let table = setup.full_timing.then(|| {
            let mut table = LineFile::create(&folder.join(format!("{process}-timing.csv")))?;
            write_head(table.lines())?;
            Ok::<_, io::Error>(table)
        });
        let flight = setup.flight_late.map(|limit| Flight {
            ring: FlightRecorder::new(),
            // Sensors that were overtaken say themselves how long they waited: nothing to add for them.
            lateness: Lateness { limit, period: Duration::ZERO },
            newest_cycle: 0,
            freeze,
            folder,
            process,
            log,
        });
        Ok(Self {
            measured: setup.measured,
            frames: setup.frames,
            account,
            table: table.transpose()?,
            arrivals: BTreeMap::new(),
            flight,
            vitals: VitalTotals::default(),
            first_ns: None,
            waiting: Vec::new(),
        })
    }

    /// Empties the queues, and writes what is over.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn look(&mut self) -> io::Result<()> {
        self.empty_queues()?;
        let now = MonotonicClock.now();
        if self.waiting.first().is_some_and(|wait| now.as_nanos().saturating_sub(wait.woke_ns) > ANSWER_NS) {
            self.give_up_waiting();
        }
        self.account.advance(now)?;
        let Some(flight) = &mut self.flight else { return Ok(()) };
        if flight.freeze.take() {
            flight.asked(now);
        }
        flight.advance(now)
    }

    fn empty_queues(&mut self) -> io::Result<()> {
        // No more than wait, so that no queue is emptied for ever while the other runs over.
        for _ in 0..self.frames.len() {
            let Ok(passed) = self.frames.try_recv() else { break };
            self.take_frame(passed);
        }
        for _ in 0..self.measured.len() {
            let Ok(measured) = self.measured.try_recv() else { break };
            match measured {
                Measured::Waited { arrived_ns, woke_ns } => {
                    self.waiting.push(Wait { arrived_ns, woke_ns });
                }
                Measured::Cycle(row) => self.take_row(row)?,
            }
        }
        Ok(())
    }

    /// Nobody answered after these sensors: they count with what they had waited when they were taken.
    fn give_up_waiting(&mut self) {
        for wait in self.waiting.drain(..) {
            self.account.record_waited(wait.ns(), wait.ns());
        }
    }

    fn take_frame(&mut self, passed: Passed) {
        let spec = passed.frame.standard_id().and_then(MessageSpec::by_id);
        let spec = spec.filter(|_| !passed.sent && Frame::decode(&passed.frame).is_ok());
        if let Some((spec, period)) = spec.and_then(cyclic) {
            let arrivals = self.arrivals.entry(spec.id).or_insert_with(|| {
                let arrivals = Arrivals::new(spec.name, period);
                if spec.send_type == "Cyclic" { arrivals } else { arrivals.on_change_too() }
            });
            arrivals.note(Instant::from_nanos(passed.stamp_ns));
        }
        if let Some(flight) = &mut self.flight {
            flight.ring.frame(passed);
        }
    }

    fn take_row(&mut self, row: CycleTiming) -> io::Result<()> {
        // Sensors that were overtaken tell themselves how long they waited.
        self.account.record(&CycleStages { skipped: 0, ..stages_of(&row) })?;
        let mut waited_ns = row.woke_ns.saturating_sub(row.due_ns);
        for wait in self.waiting.drain(..) {
            waited_ns = waited_ns.max(wait.ns());
            self.account.record_waited(wait.ns(), row.done_ns.saturating_sub(wait.arrived_ns));
        }
        let first_ns = *self.first_ns.get_or_insert(row.woke_ns);
        if row.woke_ns.saturating_sub(first_ns) > WARM_UP_NS {
            self.vitals.add(&counts(&row));
        }
        if let Some(table) = &mut self.table {
            write_row(table.lines(), &row)?;
            table.write_when_full()?;
        }
        let Some(flight) = &mut self.flight else { return Ok(()) };
        flight.take(row, waited_ns)
    }

    /// An axis is in fault since `cycle`.
    pub fn fault(&mut self, cycle: u64) {
        if let Some(flight) = &mut self.flight {
            flight.ring.trigger(Trigger::other(Severity::Fault, cycle, MonotonicClock.now()));
        }
    }

    /// Writes the rows of the table out.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn write_out(&mut self) -> io::Result<()> {
        self.table.as_mut().map_or(Ok(()), LineFile::write_out)
    }

    /// Writes all that is left.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn finish(&mut self) -> io::Result<()> {
        let mut written = self.empty_queues();
        self.give_up_waiting();
        keep_first(&mut written, self.account.finish(MonotonicClock.now()).map(drop));
        keep_first(&mut written, self.write_out());
        keep_first(&mut written, self.flight.as_mut().map_or(Ok(()), Flight::finish));
        written
    }

    /// The figures so far.
    #[must_use]
    pub fn figures(&self) -> TimingFigures {
        let ring = self.flight.as_ref().map(|flight| &flight.ring);
        TimingFigures {
            stages: self.account.figures(),
            arrivals: self.arrivals.values().map(Arrivals::figures).collect(),
            vitals: self.vitals,
            flight: ring.map_or(FlightFigures::default(), |ring| FlightFigures {
                dumps: ring.dumps(),
                dropped: ring.dropped(),
            }),
        }
    }
}

/// A message that comes at a period, whatever happens, and that period.
fn cyclic(spec: &'static MessageSpec) -> Option<(&'static MessageSpec, Duration)> {
    spec.cycle_time().filter(|_| spec.send_type.starts_with("Cyclic")).map(|period| (spec, period))
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

fn counts(row: &CycleTiming) -> VitalCounts {
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

impl Flight {
    /// Takes a row after which sensors had waited for so long, and freezes when it is worth it.
    fn take(&mut self, row: CycleTiming, waited_ns: u64) -> io::Result<()> {
        self.newest_cycle = row.cycle;
        self.ring.row(Row(row));
        // Sensors that were overtaken count: the cycle is due when the first of them arrived.
        let stages = CycleStages { due_ns: row.woke_ns.saturating_sub(waited_ns), ..stages_of(&row) };
        let Some(trigger) = self.lateness.judge(&stages) else { return Ok(()) };
        // Rows of a backlog may lie behind the window of an earlier event.
        let written = self.advance(trigger.at);
        self.ring.trigger(trigger);
        written
    }

    fn advance(&mut self, now: Instant) -> io::Result<()> {
        let Self { ring, folder, process, log, .. } = self;
        let mut written = Ok(());
        ring.advance(now, |dump| keep_first(&mut written, write(&dump, folder, process, log)));
        written
    }

    fn finish(&mut self) -> io::Result<()> {
        let Self { ring, folder, process, log, .. } = self;
        let mut written = Ok(());
        ring.finish(|dump| keep_first(&mut written, write(&dump, folder, process, log)));
        written
    }

    /// Somebody asked.
    fn asked(&mut self, now: Instant) {
        self.ring.trigger(Trigger::other(Severity::Signal, self.newest_cycle, now));
        let folder = self.folder.join(flight_dump::FOLDER);
        let folder = folder.display();
        if self.ring.will_keep(Severity::Signal) {
            eprintln!("controller: asked for the last seconds; they go to {folder}");
        } else {
            eprintln!(
                "controller: asked for the last seconds, but {folder} has {MOST_DUMPS} dumps that were asked for, and no more \
                 are kept; move it away and start anew"
            );
        }
    }
}

fn write(dump: &Dump<'_, Row, Passed>, folder: &Path, process: &str, log: &Log) -> io::Result<()> {
    if let Some(gone) = dump.replaces {
        flight_dump::remove(folder, &flight_dump::name(process, gone.cycle, &gone.severity.to_string()))?;
    }
    let trigger = &dump.trigger;
    let event = Event {
        process: process.into(),
        trigger: trigger.severity.to_string(),
        cycle: trigger.cycle,
        at_monotonic_ns: trigger.at.as_nanos(),
        late_ns: trigger.late_ns,
        slow_ns: trigger.slow_ns,
        window_from_ns: dump.from.as_nanos(),
        window_to_ns: dump.to.as_nanos(),
        ..Event::default()
    };
    let frames = dump.frames.iter().map(|passed| (passed.stamp_ns, &passed.frame));
    flight_dump::write(folder, &event, dump.rows.iter().map(|row| &row.0), frames, log)
}

#[cfg(test)]
mod tests;
