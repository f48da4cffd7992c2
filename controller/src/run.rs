//! One run of the controllers: files read, bus opened, threads started, everything saved however it ends.

use crate::algorithms::position_p;
use crate::axes::DriveAxis;
use crate::cli::{Pace, RunArguments};
use crate::experiment::section::Source;
use crate::experiment::{Experiment, ExperimentError, RunSection, SetPoints};
use crate::linearisation::{Law, Linearisation};
use crate::main_chain::Course;
use crate::pace::{self, End, Paced};
use crate::parameters::Parameter;
use crate::recording;
use crate::rig_view::PerAxis;
use crate::station::{IgnoredFrames, News, Outlets, Station};
use crossbeam_channel::bounded;
use plant::RigParameters;
use protocol::bus::{self, Bus, BusCounters, BusError, BusUrl};
use protocol::exit::Exit;
use protocol::frames::{DRIVE_CHAIN_VALUES, MainChainState};
use protocol::run_folder::{LineFile, SCHEMA_VERSION, write_json};
use realtime::{Clock, Grants, Interrupt, MonotonicClock, Percentiles, Request};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Name in the lockstep barrier.
const MEMBER_NAME: &str = "controller";
/// Rows that fit the queue: 16 s.
const ROW_QUEUE: usize = 16 * 1024;
const NEWS_QUEUE: usize = 1024;

/// What keeps the controllers from running.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file cannot be read, or says something that is not allowed.
    #[error("{0}")]
    Input(String),
    /// The experiment file.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The output folder.
    #[error("cannot write {0}; choose another folder with --out")]
    Output(String),
}

impl RunError {
    /// The exit code that the error leads to.
    #[must_use]
    pub fn exit(&self) -> Exit {
        match self {
            Self::Bus(BusError::NoBarrier { .. }) => Exit::BadInput,
            Self::Bus(_) => Exit::BusFailed,
            _ => Exit::BadInput,
        }
    }
}

/// `controller.json`: what the controllers were run with and what they counted.
#[derive(Debug, Serialize)]
struct Report {
    schema_version: u32,
    command_line: Vec<String>,
    version: &'static str,
    title: String,
    position_p: PositionGains,
    started_unix_s: Option<f64>,
    ended_well: bool,
    ended_because: &'static str,
    chain_state: &'static str,
    repetitions_done: u32,
    position_error_dynamic_m: Option<f64>,
    position_error_static_m: Option<f64>,
    cycles_answered: u64,
    rig_cycles_skipped: u64,
    sensors_received: PerAxis,
    sensors_lost: PerAxis,
    frames_ignored: IgnoredFrames,
    bus: BusCounters,
    wakeup_ns: Percentiles,
    execution_ns: Percentiles,
    period_error_ns: Percentiles,
    allocations_in_cycle: Option<u64>,
    records_dropped: u64,
    realtime_granted: Vec<String>,
    realtime_refused: Vec<String>,
    news: Vec<News>,
}

/// Runs the controllers as the command line asks.
///
/// # Errors
/// [`RunError`] when the run cannot start or be saved; how it went is the exit code.
pub fn run(arguments: &RunArguments) -> Result<Exit, RunError> {
    if arguments.pace == Pace::Lockstep && matches!(arguments.bus, BusUrl::Can { .. }) {
        return Err(BusError::NoBarrier { url: arguments.bus.to_string() }.into());
    }
    let rig_toml = read(&arguments.rig)?;
    let rig = RigParameters::from_toml(&rig_toml, &arguments.rig.display().to_string())
        .map_err(|error| RunError::Input(error.to_string()))?;
    let (stroke_m, most_m) = (rig.cylinder().stroke_m, DRIVE_CHAIN_VALUES.signals[0].max);
    if stroke_m > most_m {
        let file = arguments.rig.display();
        return Err(RunError::Input(format!(
            "{file}: cylinder.stroke_mm: {stroke_m} m; rig.dbc carries positions of at most {most_m} m"
        )));
    }
    let text = read(&arguments.experiment)?;
    let experiment = Experiment::from_toml(&text, &arguments.experiment, rig.cylinder().stroke_m)?;
    let (course, gains) = provisional_course(&experiment, &arguments.experiment)?;
    std::fs::create_dir_all(&arguments.out)
        .map_err(|error| RunError::Output(format!("{}: {error}", arguments.out.display())))?;
    let table = LineFile::create(&arguments.out.join("controller.csv"))
        .map_err(|error| RunError::Output(error.to_string()))?;
    let interrupt =
        Interrupt::watch().map_err(|error| RunError::Input(format!("cannot watch for Ctrl-C: {error}")))?;
    let mut bus =
        bus::open(&arguments.bus, Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns)))?;

    let (record_sender, records) = bounded(ROW_QUEUE);
    let (news_sender, news) = bounded(NEWS_QUEUE);
    let waits = arguments.pace == Pace::Lockstep;
    let outlets = Outlets { records: record_sender, news: news_sender, waits };
    let drive = DriveAxis::new(
        course,
        gains.values(),
        Linearisation::new(&rig, Law::ChokedExhaust),
        arguments.repeat,
    );
    let started = Instant::now();
    std::thread::scope(|scope| {
        // The writer owns the receiving ends: when it fails, nobody waits for room in its queues.
        let asking = &interrupt;
        let writer = scope.spawn(move || recording::run(table, &records, &news, || asking.ask()));
        let work = scope.spawn(|| work(arguments, drive, outlets, bus.as_mut(), &interrupt));
        let finished = join(work);
        let (told, failure) = join(writer);
        save(arguments, (experiment.title, gains), started, finished?, told, failure.is_some())
    })
}

/// Gains of the position control.
#[derive(Clone, Copy, Debug, Serialize)]
struct PositionGains {
    gain_per_s: f64,
    velocity_feed_forward: f64,
}

impl PositionGains {
    fn values(self) -> [f64; 2] {
        [self.gain_per_s, self.velocity_feed_forward]
    }
}

static EVERY: Parameter =
    Parameter::new(("every_cycles", "cycles"), [1.0, 1.0], 1.0, "cycles between two steps");

/// Provisional, until axes take whole experiments and programs: the drive's motion, and two gains out of its program.
fn provisional_course(experiment: &Experiment, file: &Path) -> Result<(Course, PositionGains), RunError> {
    let drive = experiment.drive.as_ref();
    let Some((drive, SetPoints::Positions(motion))) = drive.map(|drive| (drive, &drive.set_points)) else {
        return Err(RunError::Input(format!(
            "{}: [drive] with set-points of position is needed",
            file.display()
        )));
    };
    let path = drive.program_path(file);
    let text = read(&path)?;
    let source = Source::parse(&text, &path)?;
    let mut algorithm = source
        .root()
        .section("algorithm")?
        .ok_or_else(|| RunError::Input(format!("{}: [algorithm] is missing", path.display())))?;
    algorithm.choice("name", &[(position_p::KIND.name, ())])?;
    algorithm.whole_or_default(&EVERY)?;
    let [gain, feed_forward] = position_p::KIND.parameters else { unreachable!("position-p has two gains") };
    let gain_per_s = algorithm.number_or_default(gain)?;
    let velocity_feed_forward = algorithm.number_or_default(feed_forward)?;
    algorithm.finish()?;
    let RunSection { repetitions, settling_s, .. } = experiment.run;
    let course = Course { motion: motion.clone(), repetitions, settling_s };
    Ok((course, PositionGains { gain_per_s, velocity_feed_forward }))
}

struct Finished {
    paced: Paced,
    grants: Grants,
    bus: BusCounters,
    state: MainChainState,
    repetitions: u32,
    errors_m: [Option<f64>; 2],
    answered: u64,
    skipped: u64,
    received: PerAxis,
    lost: PerAxis,
    ignored: IgnoredFrames,
    records_dropped: u64,
}

fn work(
    arguments: &RunArguments,
    drive: DriveAxis,
    outlets: Outlets,
    bus: &mut dyn Bus,
    interrupt: &Interrupt,
) -> Result<Finished, RunError> {
    let grants = acquire_realtime(arguments);
    let mut station = Station::new(drive, outlets);
    let grace = Duration::from_secs_f64(arguments.bus_grace);
    let paced = match arguments.pace {
        Pace::Real => pace::run_real(&mut station, bus, &MonotonicClock, grace, interrupt),
        Pace::Lockstep => pace::run_lockstep(&mut station, bus, MEMBER_NAME, grace, interrupt)?,
    };
    let drive = station.drive();
    Ok(Finished {
        paced,
        grants,
        bus: *bus.counters(),
        state: drive.state(),
        repetitions: drive.status().repetition.into(),
        errors_m: [drive.figures().dynamic_m(), drive.figures().static_m()],
        answered: station.answered(),
        skipped: station.view().skipped(),
        received: station.view().received(),
        lost: station.view().lost(),
        ignored: station.ignored(),
        records_dropped: station.records_dropped(),
    })
}

fn acquire_realtime(arguments: &RunArguments) -> Grants {
    if arguments.pace == Pace::Lockstep || arguments.no_realtime {
        return Grants::default();
    }
    let grants = realtime::acquire(&Request::for_a_loop(arguments.fifo_priority, arguments.cpu));
    grants.refusals().iter().for_each(|refusal| eprintln!("controller: warning: {refusal}"));
    grants
}

fn save(
    arguments: &RunArguments,
    (title, position_p): (String, PositionGains),
    started: Instant,
    finished: Finished,
    news: Vec<News>,
    output_failed: bool,
) -> Result<Exit, RunError> {
    let Finished { paced, grants, bus, .. } = &finished;
    let done = finished.state == MainChainState::Done || arguments.repeat;
    let aborted = (Exit::BoundBroken, "aborted, by an emergency stop or by the console");
    let (exit, ended_because) = match paced.end {
        _ if output_failed => (Exit::BadInput, "the output could not be written"),
        End::Aborted => aborted,
        End::RigEnded if finished.state == MainChainState::Aborted => aborted,
        End::RigEnded if done => (Exit::Good, "done, and the rig has ended"),
        End::RigEnded => (Exit::BusFailed, "the rig ended before the experiment was done"),
        End::Interrupted => (Exit::Interrupted, "interrupted; everything recorded so far is saved"),
        End::BusGone => (
            Exit::BusFailed,
            "nothing to answer for too long; is 'emulator run' on this bus, in the same --pace? see --bus-grace",
        ),
        End::LockstepTimeout => (Exit::LockstepTimeout, "a member of the barrier was not done in time"),
    };
    eprintln!(
        "controller: {ended_because}; {} cycles answered, {} sensor frames lost",
        finished.answered,
        finished.lost.sum()
    );
    let real = arguments.pace == Pace::Real;
    let unix_s =
        SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().saturating_sub(started.elapsed());
    if real {
        let parts = [
            ("controller-wakeup", paced.wakeup_ns.histogram()),
            ("controller-execution", paced.execution_ns.histogram()),
            ("controller-period-error", paced.period_error_ns.histogram()),
        ];
        let path = arguments.out.join("controller.hlog");
        realtime::write_hlog(&path, &parts, unix_s.as_secs_f64(), started.elapsed())
            .map_err(|error| RunError::Output(format!("{}: {error}", path.display())))?;
    }
    let report = Report {
        schema_version: SCHEMA_VERSION,
        command_line: std::env::args().collect(),
        version: env!("CARGO_PKG_VERSION"),
        title,
        position_p,
        started_unix_s: real.then_some(unix_s.as_secs_f64()),
        ended_well: exit == Exit::Good,
        ended_because,
        chain_state: finished.state.name(),
        repetitions_done: finished.repetitions,
        position_error_dynamic_m: finished.errors_m[0],
        position_error_static_m: finished.errors_m[1],
        cycles_answered: finished.answered,
        rig_cycles_skipped: finished.skipped,
        sensors_received: finished.received,
        sensors_lost: finished.lost,
        frames_ignored: finished.ignored,
        bus: *bus,
        wakeup_ns: paced.wakeup_ns.percentiles(),
        execution_ns: paced.execution_ns.percentiles(),
        period_error_ns: paced.period_error_ns.percentiles(),
        allocations_in_cycle: paced.allocations.filter(|_| cfg!(feature = "count-allocations")),
        records_dropped: finished.records_dropped,
        realtime_granted: grants.granted().to_vec(),
        realtime_refused: grants.refusals().iter().map(ToString::to_string).collect(),
        news,
    };
    write_json(&arguments.out.join("controller.json"), &report)
        .map_err(|error| RunError::Output(error.to_string()))?;
    Ok(exit)
}

fn join<T>(thread: std::thread::ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn read(path: &Path) -> Result<String, RunError> {
    std::fs::read_to_string(path)
        .map_err(|error| RunError::Input(format!("cannot read {}: {error}", path.display())))
}
