//! One run of the rig: reads files, opens the bus, starts threads, saves everything however it ends.
//!
//! ```text
//!   main ─ waits, prints progress, handles signals
//!    ├─ bus host    serves the embedded bus (FIFO, one above the rig loop)
//!    ├─ writer      empties the queues into the run's folder, and serves viewers
//!    ├─ console     reads standard input, if asked to
//!    └─ rig loop    the 1 ms path
//! ```

use crate::cli::RunArguments;
use crate::console::{self, Command, Console};
use crate::faults::schedule::FaultSchedule;
use crate::finish::finish;
use crate::inputs::{Inputs, Script};
use crate::node::{EmulatorNode, NodeFigures, NodeParts};
use crate::pace::{self, Limits, Pace, RunContext, RunOutcome, Shared};
use crate::recording::rig_timing::PROCESS;
use crate::recording::writer::{Writer, WriterSetup};
use crate::recording::{self, Recorder};
use crate::telemetry::{RunFacts, Telemetry};
use crossbeam_channel::Receiver;
use plant::{People, Sensors};
use protocol::bus::host::{Host, HostReport};
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{
    self, Bus, BusCounters, BusError, BusUrl, HostThread, HostedRig, StampClock, WireOrders,
};
use protocol::exit::Exit;
use realtime::{
    Clock, Continued, Freeze, Grants, Interrupt, Machine, MonotonicClock, PeriodicConfig, Request,
    allocations,
};
use runlog::flight_dump::{self, FrameLogFormat};
use runlog::process::Process;
use runlog::run_folder::{RUN_JSON, SCHEMA_VERSION, clear_results, write_json};
use runlog::summary::RunDescription;
use runlog::timing_recorder::{Activation, TimingSetup};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::ScopedJoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Interface name in the log of the embedded bus, and of every lockstep run, so that logs can be compared.
const EMBEDDED_INTERFACE: &str = "bus0";
const PROGRESS_PERIOD: Duration = Duration::from_secs(5);

/// Why a run cannot start.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    /// A file that cannot be read or is invalid.
    #[error("{0}")]
    Input(String),
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A file of the run's folder that cannot be written.
    #[error("cannot write {file}: {reason}; choose another folder with --out")]
    Output { file: String, reason: String },
}

impl RunError {
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Input(_)
            | Self::Output { .. }
            | Self::Bus(BusError::NoBarrier { .. } | BusError::TooSlow { .. }) => Exit::BadInput,
            Self::Bus(_) => Exit::BusFailed,
        }
    }

    pub(crate) fn output(file: &Path, error: &io::Error) -> Self {
        Self::Output { file: file.display().to_string(), reason: error.to_string() }
    }
}

/// Runs the rig.
///
/// # Errors
/// [`RunError`] when the run cannot start; the result of a run is the exit code.
pub(crate) fn run(arguments: &RunArguments) -> Result<Exit, RunError> {
    let lockstep = arguments.pace == Pace::Lockstep;
    if lockstep && matches!(arguments.bus, BusUrl::Can { .. }) {
        return Err(BusError::NoBarrier { url: arguments.bus.to_string() }.into());
    }
    // All checks come before the folder is changed: it may hold an earlier run.
    let inputs = Inputs::read(&arguments.rig, arguments.experiment.as_deref(), arguments.sealed.as_deref())?;
    let script = arguments.faults.as_deref().map(Script::read).transpose()?;
    if let Some(script) = script.as_ref().filter(|_| !matches!(arguments.bus, BusUrl::Unix { .. })) {
        script.check_host(false)?;
    }
    let periodic = loop_config(arguments)?;
    let shared = install_signals()?;

    // Lockstep uses simulated time, so that the log does not depend on the machine.
    let simulated_ns = Arc::new(AtomicU64::new(0));
    let OpenedBus { mut bus, host, orders } = open_bus(arguments, stamp_clock(lockstep, &simulated_ns))?;
    let checked = script.as_ref().map_or(Ok(()), |script| script.check_host(orders.is_some()));
    let started = RunStart::now(lockstep);
    let limits =
        console::Limits { added_limit_kg: inputs.rig.mass().added_limit_kg, hosts_bus: orders.is_some() };
    let (console, typed) = arguments.console.then(|| console::open(limits)).unzip();
    let writer = match checked.and_then(|()| open_folder(arguments, &inputs, &started, console.clone())) {
        Ok(writer) => writer,
        Err(error) => {
            // A panic of the host would hide this error.
            if let Some(Ok(Err(failure))) = host.map(HostThread::join) {
                protocol::say!("emulator: the bus host failed: {failure}");
            }
            return Err(error);
        }
    };
    let (recorder, records) = recording::queues(lockstep);
    // From this thread: a thread started by the rig loop would inherit its priority.
    if let Some(console) = console {
        console.listen();
    }
    let by_script = script.as_ref().map(|script| &script.script);
    let faults = FaultSchedule::new(by_script, arguments.console, orders);

    std::thread::scope(|scope| {
        // The writer owns the receivers: when it fails, no sender blocks on a full queue.
        let for_writer = &shared;
        let writer = scope.spawn(move || writer.run(&records, for_writer));
        let bus = bus.as_mut();
        let work = RigLoop {
            arguments,
            inputs: &inputs,
            started: &started,
            simulated_ns: &simulated_ns,
            periodic,
            console: typed,
            script: script.as_ref(),
            faults,
        };
        let rig_loop = scope.spawn(|| work.run(recorder, bus, &shared));
        print_progress(&rig_loop, &shared);
        let outcome = join(rig_loop);
        let written = join(writer);
        let thread_report = host.and_then(stop_host);
        let mut outcome = outcome?;
        outcome.host = outcome.host.or(thread_report);
        finish(arguments, &started, outcome, written)
    })
}

/// Installs the handlers of SIGINT and SIGTERM.
pub(crate) fn install_interrupt() -> Result<Interrupt, RunError> {
    Interrupt::install().map_err(|error| RunError::Input(format!("cannot watch for Ctrl-C: {error}")))
}

fn install_signals() -> Result<Shared, RunError> {
    let refused = |error| RunError::Input(format!("cannot watch for SIGUSR1 and SIGCONT: {error}"));
    Ok(Shared {
        interrupt: install_interrupt()?,
        freeze: Freeze::install().map_err(refused)?,
        continued: Continued::install().map_err(refused)?,
        ..Shared::default()
    })
}

/// Start of a run's clock, in the clocks of its files.
pub(crate) struct RunStart {
    /// Seconds since 1970; `None` in lockstep.
    pub(crate) unix_s: Option<f64>,
    /// Offset from the run's clock to the stamps of `bus.log`, ns.
    pub(crate) epoch_offset_ns: u64,
    /// The start on CLOCK_MONOTONIC, the clock of all stamps.
    pub(crate) monotonic: realtime::Instant,
}

impl RunStart {
    fn now(lockstep: bool) -> Self {
        let monotonic = MonotonicClock.now();
        if lockstep {
            return Self { unix_s: None, epoch_offset_ns: 0, monotonic };
        }
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let epoch_offset_ns = (unix.as_nanos() as u64).saturating_sub(monotonic.as_nanos());
        Self { unix_s: Some(unix.as_secs_f64()), epoch_offset_ns, monotonic }
    }
}

pub(crate) struct LoopOutcome {
    pub(crate) run: RunOutcome,
    pub(crate) figures: NodeFigures,
    pub(crate) bus: BusCounters,
    pub(crate) host: Option<HostReport>,
}

/// Inputs of the rig loop's thread.
struct RigLoop<'a> {
    arguments: &'a RunArguments,
    inputs: &'a Inputs,
    started: &'a RunStart,
    simulated_ns: &'a AtomicU64,
    periodic: PeriodicConfig,
    console: Option<Receiver<Command>>,
    script: Option<&'a Script>,
    faults: FaultSchedule,
}

impl RigLoop<'_> {
    fn run(self, recorder: Recorder, bus: &mut dyn Bus, shared: &Shared) -> Result<LoopOutcome, RunError> {
        let Self { arguments, inputs, started, simulated_ns, periodic, console, script, faults } = self;
        let grants = acquire_realtime(arguments);
        describe(arguments, inputs, script, started, &grants)?;
        let mut node = EmulatorNode::new(NodeParts {
            plant: inputs.plant.clone(),
            people: People::new(&inputs.scene),
            faults,
            console,
            sensors: Sensors::new(&inputs.rig, arguments.seed),
            recorder,
            bench_frames: !arguments.no_bench_frames,
            lockstep: arguments.pace == Pace::Lockstep,
        });
        let limits = Limits {
            cycles: arguments.seconds.map(|seconds| (seconds * 1000.0).round() as u64),
            bus_grace: Duration::from_secs_f64(arguments.bus_grace),
            join: Duration::from_secs_f64(arguments.join_timeout),
            cycle: Duration::from_secs_f64(arguments.lockstep_timeout),
        };
        let context = RunContext { node: &mut node, bus, limits: &limits, shared };
        let run = match arguments.pace {
            Pace::Real => pace::real::run(context, MonotonicClock, periodic),
            Pace::Lockstep => pace::lockstep::run(context, simulated_ns)?,
        };
        // Dropping the node drops the senders of the queues, so that the writer ends.
        let host = bus.host_report();
        Ok(LoopOutcome { run, figures: node.into_figures(), bus: *bus.counters(), host })
    }
}

fn loop_config(arguments: &RunArguments) -> Result<PeriodicConfig, RunError> {
    let spin = arguments.spin_us.map(Duration::from_micros);
    let config = PeriodicConfig { period: protocol::periods::CYCLE, policy: arguments.overrun, spin };
    config.check().map_err(|error| RunError::Input(format!("--spin-us: {error}")))?;
    Ok(config)
}

fn acquire_realtime(arguments: &RunArguments) -> Grants {
    if arguments.pace == Pace::Lockstep || arguments.no_realtime {
        return Grants::default();
    }
    let grants = realtime::acquire(&Request::for_a_loop(arguments.fifo_priority, arguments.cpu));
    grants.refusals.iter().for_each(|refusal| protocol::say!("emulator: warning: {refusal}"));
    grants
}

/// The rig's peer, and the host of the bus.
struct OpenedBus {
    bus: Box<dyn Bus>,
    /// The thread that hosts the bus, if this process does.
    host: Option<HostThread>,
    /// Queue of orders to the wire of a bus that is hosted here.
    orders: Option<WireOrders>,
}

fn open_bus(arguments: &RunArguments, clock: StampClock) -> Result<OpenedBus, RunError> {
    let BusUrl::Unix { path, wire } = &arguments.bus else {
        return Ok(OpenedBus { bus: bus::open(&arguments.bus, clock)?, host: None, orders: None });
    };
    let lockstep = arguments.pace == Pace::Lockstep;
    let barrier = lockstep.then(|| BarrierConfig {
        members: arguments.members,
        echo_ids: arguments.lockstep_echo.iter().map(|axis| axis.command_id()).collect(),
    });
    match Host::bind(path, *wire, barrier) {
        Ok(host) if lockstep => {
            let orders = Some(host.wire_orders());
            let host = host.with_barrier_timeout(Duration::from_secs_f64(arguments.lockstep_timeout));
            Ok(OpenedBus { bus: Box::new(HostedRig::new(host, clock)), host: None, orders })
        }
        Ok(host) => {
            let orders = Some(host.wire_orders());
            let fifo = (!arguments.no_realtime).then_some(arguments.fifo_priority + 1);
            let host = Some(start_host(host, fifo));
            Ok(OpenedBus { bus: bus::open(&arguments.bus, clock)?, host, orders })
        }
        // A barrier has one rig, which hosts it: a second emulator would replace the first.
        Err(BusError::HostExists { .. }) if !lockstep => {
            protocol::say!("emulator: {} has a host already; joining it", arguments.bus);
            Ok(OpenedBus { bus: bus::open(&arguments.bus, clock)?, host: None, orders: None })
        }
        Err(error) => Err(error.into()),
    }
}

/// Starts the thread of the host, with FIFO priority if it is asked for and granted: the rig loop makes the same request and
/// reports refusals.
pub(crate) fn start_host(host: Host, fifo_priority: Option<u8>) -> HostThread {
    HostThread::start(host, move || realtime::acquire(&Request::for_a_server(fifo_priority)))
}

/// Stops the host and returns its counters; says why where it failed, and returns `None`.
pub(crate) fn stop_host(host: HostThread) -> Option<HostReport> {
    host.stop().inspect_err(|error| protocol::say!("emulator: the bus host failed: {error}")).ok()
}

fn stamp_clock(lockstep: bool, simulated_ns: &Arc<AtomicU64>) -> StampClock {
    if lockstep {
        let simulated_ns = Arc::clone(simulated_ns);
        Box::new(move |_age_ns| simulated_ns.load(Ordering::Relaxed))
    } else {
        Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns))
    }
}

fn open_folder(
    arguments: &RunArguments,
    inputs: &Inputs,
    started: &RunStart,
    console: Option<Console>,
) -> Result<Writer, RunError> {
    let terms = truth_columns(arguments, inputs);
    let telemetry = open_telemetry(arguments, inputs, started, &terms, console)?;
    let folder = arguments.out.as_path();
    std::fs::create_dir_all(folder)
        .and_then(|()| clear_results(folder))
        .and_then(|()| flight_dump::clear(folder, PROCESS))
        .map_err(|error| RunError::output(folder, &error))?;
    let interface = arguments.bus.interface().unwrap_or(EMBEDDED_INTERFACE);
    Writer::create(WriterSetup {
        folder: folder.into(),
        interface: interface.into(),
        epoch_offset_ns: started.epoch_offset_ns,
        set_up: inputs.set_up(),
        terms,
        faults: can_break(arguments),
        timing: started.unix_s.map(|started_unix_s| TimingSetup {
            folder: folder.into(),
            process: Process::Emulator,
            activation: Activation::EveryPeriod,
            full_timing: arguments.full_timing,
            flight_late: (!arguments.no_flight).then(|| Duration::from_micros(arguments.flight_late_us)),
            log: FrameLogFormat { interface: interface.into(), epoch_offset_ns: started.epoch_offset_ns },
            started_unix_s,
            started: started.monotonic,
            copies_lines: telemetry.is_some(),
        }),
        telemetry,
    })
    .map_err(|error| RunError::output(folder, &error))
}

fn open_telemetry(
    arguments: &RunArguments,
    inputs: &Inputs,
    started: &RunStart,
    terms: &[String],
    console: Option<Console>,
) -> Result<Option<Telemetry>, RunError> {
    let Some(path) = &arguments.telemetry else { return Ok(None) };
    let described = RunFacts { arguments, inputs, terms, started_unix_s: started.unix_s };
    let refused = |error| {
        let path = path.display();
        RunError::Input(format!(
            "cannot open telemetry {path}: {error}; choose another path with --telemetry"
        ))
    };
    Telemetry::open(path, &described, console).map(Some).map_err(refused)
}

/// Whether faults are possible in the run.
fn can_break(arguments: &RunArguments) -> bool {
    arguments.faults.is_some() || arguments.console
}

/// Columns of `truth.csv` after those of the baseline.
fn truth_columns(arguments: &RunArguments, inputs: &Inputs) -> Vec<String> {
    let mut columns = inputs.plant.term_names();
    columns.extend(can_break(arguments).then(|| "faults_active".to_owned()));
    columns
}

fn describe(
    arguments: &RunArguments,
    inputs: &Inputs,
    script: Option<&Script>,
    started: &RunStart,
    grants: &Grants,
) -> Result<(), RunError> {
    let description = RunDescription {
        schema_version: SCHEMA_VERSION,
        emulator_command_line: std::env::args().collect(),
        emulator_version: env!("CARGO_PKG_VERSION").into(),
        counts_allocations: allocations::is_registered(),
        started_unix_s: started.unix_s,
        pace: arguments.pace.to_string(),
        bus: arguments.bus.to_string(),
        seed: arguments.seed,
        rig_toml: inputs.rig_toml.clone(),
        experiment_toml: inputs.experiment_toml.clone(),
        faults_toml: script.map(|script| script.toml.clone()),
        rig_setup: inputs.scene.clone(),
        sealed: inputs.sealed,
        realtime_granted: grants.granted.clone(),
        realtime_refused: grants.refusals.iter().map(ToString::to_string).collect(),
        machine: Machine::read(env!("AIRBENCH_BUILD_COMMIT")),
    };
    let path = arguments.out.join(RUN_JSON);
    write_json(&path, &description).map_err(|error| RunError::output(&path, &error))
}

fn print_progress<T>(rig_loop: &ScopedJoinHandle<'_, T>, shared: &Shared) {
    let mut reported = Instant::now();
    while !rig_loop.is_finished() {
        std::thread::sleep(Duration::from_millis(10));
        if reported.elapsed() >= PROGRESS_PERIOD {
            reported = Instant::now();
            let seconds = shared.cycle.load(Ordering::Relaxed) as f64 / 1000.0;
            let skipped = shared.skipped.load(Ordering::Relaxed);
            let received = shared.controller_received.load(Ordering::Relaxed);
            let waiting = if received { "" } else { ", no valve command heard yet" };
            protocol::say!("emulator: {seconds:.0} s simulated, {skipped} cycles skipped{waiting}");
        }
    }
}

fn join<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
