//! One run of the controllers: reads files, opens the bus, starts threads, saves everything however it ends.

use crate::Node;
use crate::cli::{Axes, Pace, RunArguments};
use crate::pace::{self, RunContext, RunEnd, RunOutcome};
use crate::recording::{Tables, Writer, WriterResult};
use crate::reload::Reloader;
use crate::report::{self, AxisReport, Report};
use crate::timing::Stopwatch;
use crate::timing::setup::{self, RunStart};
use algorithms::guard::HANG_MESSAGE;
use axis_control::axis::AxisController;
use axis_control::node::{Change, ControllerNode, NodeQueues};
use axis_control::setup::{InputError, Inputs, Mode};
use crossbeam_channel::{Sender, bounded};
use nominal::Axis;
use plugin::PluginError;
use protocol::bus::{self, Bus, BusCounters, BusError, BusUrl};
use protocol::exit::Exit;
use realtime::{Clock, Continued, Freeze, Grants, Interrupt, MonotonicClock, Request, allocations};
use runlog::controller_report::IgnoredFrames;
use runlog::flight_dump;
use runlog::run_folder::{SCHEMA_VERSION, clear, controller_results, write_json};
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;
use xcp::a2l::{self, AxisDescription};
use xcp::config::XcpConfig;
use xcp::parameter_files::{AxisParameters, ParameterFileWorker};
use xcp::port::{Port, Queues};

/// Capacity of the queue of rows: 16 s of both axes.
const ROW_QUEUE: usize = 32 * 1024;
const NEWS_QUEUE: usize = 1024;
const CHANGE_QUEUE: usize = 1024;
const MESSAGE_QUEUE: usize = 1024;
/// At most one copy of an axis's parameters is in transit.
const RETURNED_QUEUE: usize = 2;

#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    #[error("{0}")]
    Input(String),
    #[error(transparent)]
    Files(#[from] InputError),
    #[error(transparent)]
    Plugin(#[from] PluginError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("cannot write {0}; choose another folder with --out")]
    Output(String),
}

impl RunError {
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Bus(BusError::NoBarrier { .. }) => Exit::BadInput,
            Self::Bus(_) => Exit::BusFailed,
            _ => Exit::BadInput,
        }
    }

    pub(crate) fn input(error: impl ToString) -> Self {
        Self::Input(error.to_string())
    }

    pub(crate) fn output(error: impl ToString) -> Self {
        Self::Output(error.to_string())
    }
}

/// Runs the controllers.
///
/// # Errors
/// [`RunError`] when the run cannot start or be saved; the result is the exit code.
pub(crate) fn run(arguments: &RunArguments) -> Result<Exit, RunError> {
    if arguments.pace == Pace::Lockstep && matches!(arguments.bus, BusUrl::Can { .. }) {
        return Err(BusError::NoBarrier { url: arguments.bus.to_string() }.into());
    }
    if arguments.alone && arguments.axis == Axes::Both {
        return Err(RunError::Input("--alone needs --axis drive or --axis load".into()));
    }
    let inputs = Inputs::read(&arguments.files)?;
    let xcp = XcpConfig::from_option(arguments.xcp.as_ref()).map_err(RunError::input)?;
    let real_time = arguments.pace == Pace::Real;
    let mode = Mode { partner_needed: !arguments.alone, real_time, forever: arguments.files.repeat };
    let axes = arguments.axis.list();
    let controllers =
        axes.iter().map(|axis| inputs.controller(*axis, mode)).collect::<Result<Vec<_>, _>>()?;
    let process = report::process(axes);
    let out = &arguments.files.out;
    std::fs::create_dir_all(out)
        .and_then(|()| clear(out, &controller_results(process)))
        .and_then(|()| clear(out, &axes.iter().map(|axis| a2l::file_name(*axis)).collect::<Vec<_>>()))
        .and_then(|()| flight_dump::clear(out, process.name()))
        .map_err(|error| RunError::Output(format!("{}: {error}", out.display())))?;
    let tables = Tables::create(out, axes).map_err(RunError::output)?;
    let signals =
        Signals::install().map_err(|error| RunError::Input(format!("cannot watch for signals: {error}")))?;
    let mut bus =
        bus::open(&arguments.bus, Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns)))?;

    let (record_sender, records) = bounded(ROW_QUEUE);
    let (news_sender, news) = bounded(NEWS_QUEUE);
    let (change_sender, changes) = bounded(CHANGE_QUEUE);
    let node_queues = NodeQueues { records: record_sender, news: news_sender, changes, waits: !real_time };
    let (mut ports, parameter_files) = match &xcp {
        Some(config) => open_xcp(arguments, &inputs, config, &controllers, &change_sender)?,
        None => (Vec::new(), None),
    };
    let port_of = |axis| Some(ports.swap_remove(ports.iter().position(|port: &Port| port.axis == axis)?));
    let node = ControllerNode::with_ports(controllers, node_queues, port_of);
    let reloader = arguments.watch.then(|| Reloader::new(&inputs, axes, change_sender));
    let started = RunStart::now();
    let timing = real_time.then(|| setup::begin(arguments, &started, signals.freeze)).transpose()?;
    let (stopwatch, timing) = timing.unzip();
    std::thread::scope(|scope| {
        // The writer owns the receivers: when it fails, no sender blocks on a full queue.
        let asking = &signals.interrupt;
        let writer = scope.spawn(move || {
            let writer = Writer { tables, records, news, reloader, parameter_files, timing };
            writer.run(|| asking.ask(), || end_hung(out, axes))
        });
        let bus = bus.as_mut();
        let (interrupt, continued) = (&signals.interrupt, signals.continued);
        let parts = ControlLoop { arguments, inputs: &inputs, node, stopwatch, bus, interrupt, continued };
        let work = scope.spawn(|| parts.run());
        let finished = join(work);
        let written = join(writer);
        save(arguments, &inputs, FinishedRun { started, finished: finished?, written })
    })
}

/// A port for each controller, and the worker for their files; writes their A2L files into the run's folder.
fn open_xcp(
    arguments: &RunArguments,
    inputs: &Inputs,
    config: &XcpConfig,
    controllers: &[AxisController],
    changes: &Sender<Change>,
) -> Result<(Vec<Port>, Option<ParameterFileWorker>), RunError> {
    let out = &arguments.files.out;
    let (message_sender, messages) = bounded(MESSAGE_QUEUE);
    let (mut ports, mut axes) = (Vec::new(), Vec::new());
    for controller in controllers {
        let (axis, program) = (controller.axis, &controller.program);
        let (returned_sender, returned) = bounded(RETURNED_QUEUE);
        let queues = Queues { messages: message_sender.clone(), returned };
        let title = inputs.program_title(axis);
        // In simulated time runs repeat exactly, seeds included.
        let random = if arguments.pace == Pace::Real { random()? } else { [0; 16] };
        ports.push(Port::new(controller, &title, config, random, queues).map_err(RunError::input)?);
        let (variables, values) = (program.variables().to_vec(), program.values().to_vec());
        let described = AxisDescription { axis, title: &title, variables: &variables };
        let path = out.join(a2l::file_name(axis));
        let text = a2l::text(&described).map_err(RunError::input)?;
        std::fs::write(&path, text)
            .map_err(|error| RunError::Output(format!("{}: {error}", path.display())))?;
        axes.push(AxisParameters { axis, variables, values, returned: returned_sender });
    }
    Ok((ports, Some(ParameterFileWorker::new(messages, axes, changes.clone(), out))))
}

/// Start of the seeds, from the random source of the system.
fn random() -> Result<[u8; 16], RunError> {
    const SOURCE: &str = "/dev/urandom";
    let mut bytes = [0; 16];
    let read = std::fs::File::open(SOURCE).and_then(|mut source| source.read_exact(&mut bytes));
    read.map_err(|error| {
        RunError::Input(format!("cannot read {SOURCE}: {error}; --xcp needs it for its seeds"))
    })?;
    Ok(bytes)
}

struct Signals {
    interrupt: Interrupt,
    freeze: Freeze,
    continued: Continued,
}

impl Signals {
    fn install() -> io::Result<Self> {
        Ok(Self {
            interrupt: Interrupt::install()?,
            freeze: Freeze::install()?,
            continued: Continued::install()?,
        })
    }
}

/// Ends the process whose algorithm does not return; its thread cannot be stopped.
fn end_hung(out: &Path, axes: &[Axis]) {
    protocol::say!("controller: {HANG_MESSAGE}");
    let exit = Exit::BoundBroken;
    let report = serde_json::json!({
        "schema_version": SCHEMA_VERSION, "ended_well": false, "ended_because": HANG_MESSAGE,
    });
    if let Err(error) = write_json(&out.join(report::process(axes).report()), &report) {
        protocol::say!("controller: cannot write {error}");
    }
    std::process::exit(exit as i32);
}

struct LoopResult {
    outcome: RunOutcome,
    grants: Grants,
    bus: BusCounters,
    axes: BTreeMap<String, AxisReport>,
    answered: u64,
    skipped: u64,
    ignored: IgnoredFrames,
    records_dropped: u64,
}

struct FinishedRun {
    started: RunStart,
    finished: LoopResult,
    written: WriterResult,
}

struct ControlLoop<'a> {
    arguments: &'a RunArguments,
    inputs: &'a Inputs,
    node: Node,
    stopwatch: Option<Stopwatch<MonotonicClock>>,
    bus: &'a mut dyn Bus,
    interrupt: &'a Interrupt,
    continued: Continued,
}

impl ControlLoop<'_> {
    /// Consumes the node, and with it the senders of the recorder's queues.
    fn run(self) -> Result<LoopResult, RunError> {
        let Self { arguments, inputs, mut node, stopwatch, bus, interrupt, continued } = self;
        let grants = acquire_realtime(arguments);
        let grace = Duration::from_secs_f64(arguments.bus_grace);
        let context = RunContext { node: &mut node, bus: &mut *bus, grace, interrupt };
        let outcome = match stopwatch {
            Some(stopwatch) => pace::run_real(context, stopwatch, continued),
            None => pace::run_lockstep(context, member_name(arguments.axis))?,
        };
        if arguments.pace == Pace::Real {
            pace::drain_and_leave(bus, outcome.end == RunEnd::RigEnded);
        }
        let mut axes = report::of_node(&node, inputs);
        for axis in Axis::ALL {
            if let (Some(report), Some(port)) = (axes.get_mut(axis.name()), node.port(axis)) {
                report.xcp = Some(port.counters());
            }
        }
        Ok(LoopResult {
            outcome,
            grants,
            bus: *bus.counters(),
            axes,
            answered: node.answered,
            skipped: node.view.skipped,
            ignored: node.ignored,
            records_dropped: node.records_dropped,
        })
    }
}

fn member_name(axes: Axes) -> &'static str {
    match axes {
        Axes::Drive => "drive-controller",
        Axes::Load => "load-controller",
        Axes::Both => "controller",
    }
}

fn acquire_realtime(arguments: &RunArguments) -> Grants {
    if arguments.pace == Pace::Lockstep || arguments.no_realtime {
        return Grants::default();
    }
    let grants = realtime::acquire(&Request::for_a_loop(arguments.fifo_priority, arguments.cpu));
    grants.refusals.iter().for_each(|refusal| protocol::say!("controller: warning: {refusal}"));
    grants
}

fn verdict(arguments: &RunArguments, run: &FinishedRun) -> (Exit, String) {
    let LoopResult { outcome, axes, .. } = &run.finished;
    let done = arguments.files.repeat || axes.values().all(report::is_done);
    let stopped = report::stopped(axes);
    let aborted = || {
        let why = stopped.map_or_else(String::new, |(name, axis)| format!(": {name}: {}", axis.chain_cause));
        (Exit::BoundBroken, format!("stopped before the end{why}"))
    };
    match outcome.end {
        _ if run.written.failure.is_some() => (Exit::BadInput, "the output could not be written".into()),
        RunEnd::Stopped => aborted(),
        RunEnd::RigEnded if stopped.is_some() => aborted(),
        RunEnd::RigEnded if done => (Exit::Good, "done, and the rig has ended".into()),
        RunEnd::RigEnded => (Exit::BusFailed, "the rig ended before the experiment was done".into()),
        RunEnd::Interrupted => (Exit::Interrupted, "interrupted; everything recorded so far is saved".into()),
        RunEnd::BusGone => (
            Exit::BusFailed,
            "no sensors or no bus for too long; is 'emulator run' on this bus, in the same --pace? see --bus-grace".into(),
        ),
        RunEnd::LockstepTimeout => {
            (Exit::LockstepTimeout, "a member of the barrier was not done in time".into())
        }
    }
}

fn save(arguments: &RunArguments, inputs: &Inputs, run: FinishedRun) -> Result<Exit, RunError> {
    let (exit, ended_because) = verdict(arguments, &run);
    let FinishedRun { started, finished, written } = run;
    let LoopResult { outcome, grants, bus, axes, .. } = finished;
    let sum = |of: fn(&AxisReport) -> u64| axes.values().map(of).sum::<u64>();
    protocol::say!(
        "controller: {ended_because}; {} cycles answered, {} sensor frames lost",
        finished.answered,
        sum(|axis| axis.sensors_lost.unwrap_or_default())
    );
    let real = arguments.pace == Pace::Real;
    let report = Report {
        schema_version: SCHEMA_VERSION,
        command_line: std::env::args().collect(),
        version: env!("CARGO_PKG_VERSION").into(),
        title: inputs.experiment.title.clone(),
        started_unix_s: real.then_some(started.unix_s),
        ended_well: Some(exit == Exit::Good),
        ended_because,
        cycles_answered: finished.answered,
        rig_cycles_skipped: finished.skipped,
        frames_ignored: finished.ignored,
        bus,
        frames_late: sum(|axis| axis.sensors_late),
        frames_duplicate: sum(|axis| axis.sensors_duplicate),
        timing: written.timing.unwrap_or_default(),
        allocations_in_cycle: outcome.allocations.filter(|_| allocations::is_registered()),
        records_dropped: Some(finished.records_dropped),
        sensors_before_start: outcome.stopwatch.before_start,
        timing_dropped: outcome.stopwatch.dropped,
        realtime_granted: grants.granted.clone(),
        realtime_refused: grants.refusals.iter().map(ToString::to_string).collect(),
        axes,
        news: written.reported,
    };
    let path = arguments.files.out.join(report::process(arguments.axis.list()).report());
    write_json(&path, &report).map_err(RunError::output)?;
    Ok(exit)
}

fn join<T>(thread: std::thread::ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
