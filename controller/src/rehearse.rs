//! `controller rehearse`: a rehearsal with the files of a run.
//!
//! It leaves the files of a run, without those of the bus: no `bus.log`, no latencies.

use crate::cli::RehearseArguments;
use crate::recording::{Tables, sentence};
use crate::report::{self, Report};
use crate::run::RunError;
use algorithms::guard::{HANG_MESSAGE, HangDetector};
use axis_control::node::NodeEvent;
use axis_control::setup::Inputs;
use nominal::Axis;
use protocol::bus::BusCounters;
use protocol::exit::Exit;
use protocol::periods::CYCLE_S;
use realtime::Interrupt;
use rehearsal::{Rehearsal, cycle_tables};
use runlog::flight_dump;
use runlog::process::Process;
use runlog::run_folder::{
    RUN_JSON, SCHEMA_VERSION, SUMMARY_JSON, clear, clear_results, controller_results, write_json,
};
use runlog::summary::{REHEARSAL, RehearsalDescription, RehearsalEvent, RehearsalSummary};
use runlog::timing_recorder::TimingFigures;
use std::path::Path;
use std::time::{Duration, Instant};

/// Rehearses an experiment.
///
/// # Errors
/// [`RunError`] when it cannot start or be saved; the result is the exit code.
pub(crate) fn run(arguments: &RehearseArguments) -> Result<Exit, RunError> {
    let inputs = Inputs::read(&arguments.files)?;
    let file = arguments.files.experiment.display().to_string();
    let scene = rehearsal::scene(&inputs, &file).map_err(RunError::input)?;
    let mut rehearsal = rehearsal::of_inputs(&inputs, &scene, arguments.seed, arguments.files.repeat)
        .map_err(RunError::input)?;
    let interrupt =
        Interrupt::install().map_err(|error| RunError::Input(format!("cannot watch for Ctrl-C: {error}")))?;
    let out = &arguments.files.out;
    std::fs::create_dir_all(out)
        .and_then(|()| clear_results(out))
        .and_then(|()| clear_timing(out))
        .map_err(|error| RunError::Output(format!("{}: {error}", out.display())))?;
    end_when_hung();
    let started = Instant::now();
    let mut files = cycle_tables(out, &scene, &rehearsal).map_err(RunError::output)?;
    let mut axes = Tables::create(out, &Axis::ALL).map_err(RunError::output)?;
    let cycles = (arguments.seconds * 1000.0).round() as u64;
    let (mut reported, mut news) = (Vec::new(), Vec::new());
    let mut interrupted = false;
    while rehearsal.cycles() < cycles && !rehearsal.ended() && !interrupted {
        let rehearsed = rehearsal.step(|cycle, outcome| reported.push(event(cycle, outcome)));
        let cycle = &rehearsed.cycle;
        files
            .write(cycle.cycle, cycle.measured(), cycle.known_to_simulation())
            .and_then(|()| rehearsed.axes.iter().flatten().try_for_each(|record| axes.write(record)))
            .map_err(RunError::output)?;
        for item in rehearsal.take_news() {
            protocol::say!("controller: {}", sentence(item));
            news.push(item);
        }
        interrupted = interrupt.came();
    }
    files.write_out().and_then(|()| axes.write_out()).map_err(RunError::output)?;
    if let Some(error) = rehearsal.encode_error() {
        let cycle = rehearsal.cycles();
        return Err(RunError::Input(format!(
            "the simulated rig broke in cycle {cycle}: {error}; check the rig file"
        )));
    }
    let finished =
        FinishedRehearsal { rehearsal, interrupted, reported, news, took_s: started.elapsed().as_secs_f64() };
    save(arguments, &inputs, &scene, finished)
}

/// Removes the timing files of runs in real time.
fn clear_timing(out: &Path) -> std::io::Result<()> {
    for process in Process::ALL {
        if process != Process::Emulator {
            clear(out, &controller_results(process))?;
        }
        flight_dump::clear(out, process.name())?;
    }
    Ok(())
}

/// Ends the process when an algorithm does not return and blocks its thread.
fn end_when_hung() {
    std::thread::spawn(|| {
        let mut detector = HangDetector::default();
        while !detector.is_hung() {
            std::thread::sleep(Duration::from_millis(100));
        }
        protocol::say!("controller: {HANG_MESSAGE}");
        std::process::exit(Exit::BoundBroken as i32);
    });
}

struct FinishedRehearsal {
    rehearsal: Rehearsal,
    interrupted: bool,
    reported: Vec<RehearsalEvent>,
    news: Vec<NodeEvent>,
    took_s: f64,
}

fn event(cycle: u64, outcome: impl std::fmt::Debug) -> RehearsalEvent {
    RehearsalEvent { cycle, what: format!("{outcome:?}") }
}

fn save(
    arguments: &RehearseArguments,
    inputs: &Inputs,
    scene: &impl serde::Serialize,
    finished: FinishedRehearsal,
) -> Result<Exit, RunError> {
    let node = finished.rehearsal.node();
    let axes = report::of_node(node, inputs);
    let stopped = report::stopped(&axes);
    let (exit, ended_because) = match stopped {
        _ if finished.interrupted => {
            (Exit::Interrupted, "interrupted; everything recorded so far is saved".into())
        }
        Some((name, axis)) => {
            (Exit::BoundBroken, format!("stopped before the end: {name}: {}", axis.chain_cause))
        }
        None if axes.values().all(report::is_done) => (Exit::Good, "the controllers are done".to_owned()),
        None if arguments.files.repeat => (Exit::Good, "the time asked for is over".to_owned()),
        None => (Exit::BoundBroken, "the time asked for was over before the experiment was done".to_owned()),
    };
    let cycles = finished.rehearsal.cycles();
    let simulated_s = cycles as f64 * CYCLE_S;
    protocol::say!(
        "controller: {ended_because}; {simulated_s} s rehearsed in {:.2} s, {:.0} times real time",
        finished.took_s,
        simulated_s / finished.took_s
    );
    let out = &arguments.files.out;
    let report = Report {
        schema_version: SCHEMA_VERSION,
        command_line: std::env::args().collect(),
        version: env!("CARGO_PKG_VERSION").into(),
        title: inputs.experiment.title.clone(),
        started_unix_s: None,
        ended_well: Some(exit == Exit::Good),
        ended_because: ended_because.clone(),
        cycles_answered: node.answered,
        rig_cycles_skipped: 0,
        frames_ignored: node.ignored,
        bus: BusCounters::default(),
        frames_late: 0,
        frames_duplicate: 0,
        timing: TimingFigures::default(),
        allocations_in_cycle: None,
        records_dropped: Some(node.records_dropped),
        sensors_before_start: 0,
        timing_dropped: 0,
        realtime_granted: Vec::new(),
        realtime_refused: Vec::new(),
        axes,
        news: finished.news,
    };
    write_json(&out.join(Process::Controller.report()), &report).map_err(RunError::output)?;
    let run = RehearsalDescription {
        schema_version: SCHEMA_VERSION,
        pace: REHEARSAL.into(),
        seed: arguments.seed,
        rig_toml: inputs.rig_toml.clone(),
        experiment_toml: inputs.experiment_toml.clone(),
        rig_setup: scene,
    };
    write_json(&out.join(RUN_JSON), &run).map_err(RunError::output)?;
    let summary = RehearsalSummary {
        schema_version: SCHEMA_VERSION,
        cycles,
        ended_because,
        passed: exit == Exit::Good,
        events: finished.reported,
        ..RehearsalSummary::default()
    };
    write_json(&out.join(SUMMARY_JSON), &summary).map_err(RunError::output)?;
    Ok(exit)
}
