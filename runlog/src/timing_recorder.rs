//! The timing of one process, recorded by its writer thread: histograms second by second, the timing table, arrivals, the
//! flight recorder.
//!
//! ```text
//!   rows, waits ──► StageAccount ──► PROCESS.hlog             (a line for each second and tag)
//!   rows ─────────► PROCESS-timing.csv                        (with --full-timing)
//!   frames ───────► Arrivals of each cyclic frame
//!   rows, frames ─► FlightRecorder ──► flight/PROCESS-…/      (late, slow, overrun; fault; SIGUSR1)
//! ```
//! In real time only: simulated time is never late.

use crate::candump::FrameRecord;
use crate::flight_dump::{self, DumpName, Event, FrameLogFormat};
use crate::process::Process;
use crate::run_folder::{LineFile, SCHEMA_VERSION};
use crate::timing::{self, CycleTiming};
use protocol::frames::{Frame, MessageSpec};
use protocol::periods::CYCLE;
use realtime::flight::{Dump, Lateness, MOST_DUMPS, keep_first};
use realtime::{
    ArrivalFigures, Arrivals, CycleStages, FlightRecorder, Instant, IntervalLog, Severity, StageAccount,
    StageFigures, Stamped, Trigger, VitalTotals,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Start of a run that the totals of counters leave out: first touches of memory, first frames of each kind.
pub const WARM_UP_CYCLES: u64 = 1000;
/// The same for a process without a schedule.
const WARM_UP_NS: u64 = 1_000_000_000;
/// Longest time from a wake-up to a row that answers after it; beyond, no answer follows, such as before the first tick.
const ANSWER_NS: u64 = 1_000_000_000;

/// When the cycles of a process are due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Every period: a missed cycle was due too.
    EveryPeriod,
    /// When the sensors that wake it arrive. Sensors that were overtaken are reported by [`TimingRecorder::waited`], so the
    /// skipped cycles of a row add no samples. An overrun is a cycle without an answer; `late_ns` of its event is the wait.
    OnArrival,
}

/// What to record, and where.
#[derive(Clone, Debug)]
pub struct TimingSetup {
    /// The run's folder.
    pub folder: PathBuf,
    /// Whose name its files and tags have.
    pub process: Process,
    /// When its cycles are due.
    pub activation: Activation,
    /// Whether every row is written.
    pub full_timing: bool,
    /// Lateness and execution time that freeze the flight recorder; `None` without one.
    pub flight_late: Option<Duration>,
    /// How the frames of a dump are written.
    pub log: FrameLogFormat,
    /// Start of the run, s since 1970.
    pub started_unix_s: f64,
    /// The same moment on the monotonic clock.
    pub started: Instant,
    /// Whether the lines of the `.hlog` are kept for [`StageAccount::take_copy`].
    pub copies_lines: bool,
}

/// The timing of a run, as the reports of both programs have it; empty in simulated time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TimingFigures {
    /// Percentiles of the stages.
    #[serde(flatten)]
    pub stages: StageFigures,
    /// How regularly each cyclic frame came.
    pub arrivals: Vec<ArrivalFigures>,
    /// The kernel's counters after the first second.
    pub vitals: VitalTotals,
    /// Dumps of the flight recorder.
    pub flight: FlightFigures,
}

/// Dumps of the flight recorder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FlightFigures {
    /// Dumps in the folder.
    pub dumps: u64,
    /// Dumps that gave way to more severe ones, or were not written.
    pub dropped: u64,
}

/// Cycles sent, by the age in cycles of the command that acted over them; a cycle without a command is in none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct CommandAges {
    /// Drive axis.
    pub drive: BTreeMap<u64, u64>,
    /// Load axis.
    pub load: BTreeMap<u64, u64>,
}

/// In the ring by the time at which the thread woke.
impl Stamped for CycleTiming {
    fn at_ns(&self) -> u64 {
        self.woke_ns
    }
}

impl Stamped for FrameRecord {
    fn at_ns(&self) -> u64 {
        self.stamp_ns
    }
}

type Ring = FlightRecorder<CycleTiming, FrameRecord>;

/// Records the timing of a process.
pub struct TimingRecorder {
    folder: PathBuf,
    process: Process,
    activation: Activation,
    log: FrameLogFormat,
    /// The histograms, to which further ones may be added.
    pub account: StageAccount,
    table: Option<LineFile>,
    arrivals: BTreeMap<u16, Arrivals>,
    flight: Option<(Ring, Lateness)>,
    newest: CycleStages,
    first_woke_ns: Option<u64>,
    vitals: VitalTotals,
    /// Overtaken sensors that wait for the row that answers after them.
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

impl TimingRecorder {
    /// Opens the files.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn create(setup: TimingSetup) -> io::Result<Self> {
        let TimingSetup { folder, process, activation, log, .. } = setup;
        let mut account = StageAccount::new(process.name(), CYCLE);
        let hlog = folder.join(process.hlog());
        let hlog = IntervalLog::create(&hlog, setup.started_unix_s, setup.started)?;
        account.log_to(if setup.copies_lines { hlog.with_copy() } else { hlog });
        let table = setup.full_timing.then(|| {
            let mut table = LineFile::create(&folder.join(process.timing()))?;
            timing::write_head(table.lines())?;
            Ok::<_, io::Error>(table)
        });
        let period = if activation == Activation::EveryPeriod { CYCLE } else { Duration::ZERO };
        let flight = setup.flight_late.map(|limit| (Ring::default(), Lateness { limit, period }));
        Ok(Self {
            folder,
            process,
            activation,
            log,
            account,
            table: table.transpose()?,
            arrivals: BTreeMap::new(),
            flight,
            newest: CycleStages::default(),
            first_woke_ns: None,
            vitals: VitalTotals::default(),
            waiting: Vec::new(),
        })
    }

    /// Records a cycle.
    ///
    /// # Errors
    /// What the system says when a file cannot be written.
    pub fn row(&mut self, row: &CycleTiming) -> io::Result<()> {
        let stages = row.stages();
        let skipped = if self.activation == Activation::EveryPeriod { row.skipped } else { 0 };
        self.account.record(&CycleStages { skipped, ..stages })?;
        self.newest = stages;
        let mut waited_ns = stages.late_ns();
        for wait in self.waiting.drain(..) {
            waited_ns = waited_ns.max(wait.ns());
            self.account.record_waited(wait.ns(), row.done_ns.saturating_sub(wait.arrived_ns));
        }
        let first_ns = *self.first_woke_ns.get_or_insert(row.woke_ns);
        let warm = match self.activation {
            Activation::EveryPeriod => row.cycle >= WARM_UP_CYCLES,
            Activation::OnArrival => row.woke_ns.saturating_sub(first_ns) > WARM_UP_NS,
        };
        if warm {
            self.vitals.add(&row.vitals);
        }
        if let Some(table) = &mut self.table {
            timing::write_row(table.lines(), row)?;
            table.write_when_full()?;
        }
        let Some((ring, lateness)) = &mut self.flight else { return Ok(()) };
        ring.row(*row);
        // Overtaken sensors count: the cycle was due when the first of them arrived.
        let stages = CycleStages { due_ns: row.woke_ns.saturating_sub(waited_ns), ..stages };
        let Some(trigger) = lateness.judge(&stages) else { return Ok(()) };
        // Rows of a backlog may lie behind the window of an earlier event.
        let written = self.advance_flight(trigger.at);
        self.freeze(trigger);
        written
    }

    /// Sensors arrived that newer ones overtook before the thread woke. They count with the next row.
    pub fn waited(&mut self, arrived_ns: u64, woke_ns: u64) {
        self.waiting.push(Wait { arrived_ns, woke_ns });
    }

    /// No answer follows: the overtaken sensors count with their wait alone.
    fn give_up_waiting(&mut self) {
        for wait in self.waiting.drain(..) {
            self.account.record_waited(wait.ns(), wait.ns());
        }
    }

    /// Records missed cycles that no row follows: the overrun that ended the run.
    pub fn missed(&mut self, first: u64, skipped: u64, late_ns: u64, woke_ns: u64) {
        self.account.record_missed(late_ns, skipped);
        let (severity, at) = (Severity::Overrun { ns: late_ns }, Instant::from_nanos(woke_ns));
        self.freeze(Trigger { severity, cycle: first, at, late_ns, slow_ns: 0 });
    }

    /// Records a frame that was sent, or that `arrived` from another node.
    pub fn frame(&mut self, record: FrameRecord, arrived: bool) {
        let spec = record.frame.standard_id().and_then(MessageSpec::by_id);
        let spec = spec.filter(|_| arrived && Frame::decode(&record.frame).is_ok());
        if let Some((spec, period)) = spec.and_then(cyclic) {
            let arrivals = self.arrivals.entry(spec.id).or_insert_with(|| arrivals_of(spec, period));
            arrivals.note(Instant::from_nanos(record.stamp_ns));
        }
        if let Some((ring, _)) = &mut self.flight {
            ring.frame(record);
        }
    }

    /// A fault was latched in `cycle`.
    pub fn fault(&mut self, cycle: u64, at: Instant) {
        self.freeze(Trigger::other(Severity::Fault, cycle, at));
    }

    /// A person asked for the last seconds.
    pub fn signal(&mut self, now: Instant) {
        self.freeze(Trigger::other(Severity::Signal, self.newest.cycle, now));
        let Some((ring, _)) = &self.flight else { return };
        let folder = self.folder.join(flight_dump::FOLDER);
        let (program, folder) = (self.process.name().split('-').next().unwrap_or_default(), folder.display());
        if ring.will_keep(Severity::Signal) {
            eprintln!("{program}: asked for the last seconds; they go to {folder}");
        } else {
            eprintln!(
                "{program}: asked for the last seconds, but {folder} has {MOST_DUMPS} dumps that were asked for, and no more \
                 are kept; move it away and start anew"
            );
        }
    }

    /// When the newest cycle was done.
    #[must_use]
    pub fn newest_done(&self) -> Instant {
        Instant::from_nanos(self.newest.done_ns)
    }

    /// Writes the second and the dumps that are over at `now`; after everything was taken from the queues.
    ///
    /// # Errors
    /// What the system says when a file cannot be written.
    pub fn advance(&mut self, now: Instant) -> io::Result<()> {
        if self.waiting.first().is_some_and(|wait| now.as_nanos().saturating_sub(wait.woke_ns) > ANSWER_NS) {
            self.give_up_waiting();
        }
        self.account.advance(now)?;
        self.advance_flight(now)
    }

    fn advance_flight(&mut self, now: Instant) -> io::Result<()> {
        let Self { flight: Some((ring, _)), folder, process, log, .. } = self else { return Ok(()) };
        let mut written = Ok(());
        ring.advance(now, |dump| keep_first(&mut written, write_dump(&dump, folder, *process, log)));
        written
    }

    /// Writes the rows of the table out.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn write_out(&mut self) -> io::Result<()> {
        self.table.as_mut().map_or(Ok(()), LineFile::write_out)
    }

    /// Writes what is left; the first failure counts.
    ///
    /// # Errors
    /// What the system says, with the file's name.
    pub fn finish(&mut self, now: Instant) -> io::Result<()> {
        self.give_up_waiting();
        let mut written = self.account.finish(now).map(drop);
        keep_first(&mut written, self.write_out());
        let Self { flight: Some((ring, _)), folder, process, log, .. } = self else { return written };
        ring.finish(|dump| keep_first(&mut written, write_dump(&dump, folder, *process, log)));
        written
    }

    /// The figures so far.
    #[must_use]
    pub fn figures(&self) -> TimingFigures {
        let dumps =
            |(ring, _): &(Ring, Lateness)| FlightFigures { dumps: ring.dumps(), dropped: ring.dropped };
        TimingFigures {
            stages: self.account.figures(),
            arrivals: self.arrivals.values().map(Arrivals::figures).collect(),
            vitals: self.vitals,
            flight: self.flight.as_ref().map(dumps).unwrap_or_default(),
        }
    }

    fn freeze(&mut self, trigger: Trigger) {
        if let Some((ring, _)) = &mut self.flight {
            ring.trigger(trigger);
        }
    }
}

/// A message that comes at a period, and that period.
fn cyclic(spec: &'static MessageSpec) -> Option<(&'static MessageSpec, Duration)> {
    spec.cycle_time().filter(|_| spec.send_type.starts_with("Cyclic")).map(|period| (spec, period))
}

fn arrivals_of(spec: &'static MessageSpec, period: Duration) -> Arrivals {
    let arrivals = Arrivals::new(spec.name, period);
    if spec.send_type == "Cyclic" { arrivals } else { arrivals.on_change_too() }
}

fn write_dump(
    dump: &Dump<'_, CycleTiming, FrameRecord>,
    folder: &Path,
    process: Process,
    log: &FrameLogFormat,
) -> io::Result<()> {
    if let Some(replaced) = dump.replaces {
        let (process, trigger) = (process.name().into(), replaced.severity.to_string());
        let name = DumpName { process, cycle: replaced.cycle, trigger };
        flight_dump::remove(folder, &name.to_string())?;
    }
    let Trigger { severity, cycle, at, late_ns, slow_ns } = dump.trigger;
    let event = Event {
        schema_version: SCHEMA_VERSION,
        process: process.name().into(),
        trigger: severity.to_string(),
        cycle,
        at_monotonic_ns: at.as_nanos(),
        late_ns,
        slow_ns,
        window_from_ns: dump.from.as_nanos(),
        window_to_ns: dump.to.as_nanos(),
    };
    flight_dump::write(folder, &event, dump.rows.iter().copied(), dump.frames.iter().copied(), log)
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::MESSAGES;

    #[test]
    fn a_frame_that_is_sent_on_change_too_has_no_account_of_bursts() {
        let bursts = |message: &'static MessageSpec| {
            let (spec, period) = cyclic(message).expect("a cyclic message");
            arrivals_of(spec, period).figures().bursts
        };
        let on_change = || MESSAGES.iter().filter(|message| message.send_type == "CyclicAndOnChange");
        assert!(on_change().count() > 0);
        on_change().for_each(|message| assert_eq!(bursts(message), None, "{}", message.name));
        let command = MESSAGES.iter().find(|message| message.name == "DriveValveCommand").unwrap();
        assert_eq!(bursts(command), Some(0));
    }
}
