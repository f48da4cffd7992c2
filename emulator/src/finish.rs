//! The end of a run: writes `summary.json`, prints a few lines, chooses the exit code.

use crate::cli::RunArguments;
use crate::event::Event;
use crate::pace::RunEnd;
use crate::recording::writer::WriterReport;
use crate::run::{LoopOutcome, RunError, RunStart};
use protocol::exit::Exit;
use realtime::{Percentiles, Recorder as Histogram, allocations};
use runlog::run_folder::{SCHEMA_VERSION, SUMMARY_JSON, write_json};
use runlog::summary::Summary;
use std::collections::BTreeMap;
use std::path::Path;

/// Saves the remaining files, prints the result of the run, and returns the exit code.
pub(crate) fn finish(
    arguments: &RunArguments,
    started: &RunStart,
    outcome: LoopOutcome,
    written: WriterReport,
) -> Result<Exit, RunError> {
    let (exit, reason) = verdict(&outcome.run.end);
    protocol::say!("emulator: {reason}");
    let path = arguments.out.join(SUMMARY_JSON);
    let summary = summarise(outcome, written, started.epoch_offset_ns, reason, exit == Exit::Good);
    print_summary(&summary, &arguments.out);
    write_json(&path, &summary).map_err(|error| RunError::output(&path, &error))?;
    Ok(exit)
}

fn print_summary(summary: &Summary<Event>, folder: &Path) {
    let Summary { overruns, frames_sent, frames_received, frames_malformed, stale_commands, .. } = summary;
    let (cycles, skipped) = (summary.cycles.unwrap_or_default(), summary.skipped.unwrap_or_default());
    let frames_lost = summary.frames_lost.unwrap_or_default();
    protocol::say!("emulator: {cycles} cycles, {skipped} of them skipped in {overruns} overruns");
    protocol::say!(
        "emulator: {frames_sent} frames sent, {frames_received} received, {frames_lost} lost by their counters, \
         {frames_malformed} malformed, {stale_commands} stale commands"
    );
    if let Some(dropped) = summary.records_dropped.filter(|dropped| *dropped > 0) {
        protocol::say!("emulator: {dropped} records did not reach the files: the disk was too slow");
    }
    if summary.wakeup_ns.count > 0 {
        protocol::say!("emulator: wake-up {}", summary.wakeup_ns);
        protocol::say!("emulator: round trip {}", summary.round_trip_ns);
    }
    protocol::say!("emulator: files in {}", folder.display());
}

fn summarise(
    outcome: LoopOutcome,
    written: WriterReport,
    epoch_offset_ns: u64,
    ended_because: String,
    passed: bool,
) -> Summary<Event> {
    let LoopOutcome { run, figures, bus, host: bus_host } = outcome;
    let [drive_commands, load_commands] = figures.commands;
    let both = [drive_commands, load_commands];
    let lost = both.iter().map(|commands| commands.lost).sum();
    let loops = run.statistics.as_ref();
    let percentiles = |recorder: Option<&Histogram>| {
        recorder.map_or_else(|| Histogram::new().percentiles(), Histogram::percentiles)
    };
    let WriterReport { timing: rig_timing, events, event_count, .. } = written;
    let timing = rig_timing.timing;
    let [round_trip_ns, load_round_trip_ns] = rig_timing.round_trip_ns;
    let [drive_command_age_ns, load_command_age_ns] = rig_timing.command_age_ns;
    let of_loop =
        |pick: fn(&realtime::LoopStatistics) -> &Histogram| -> Percentiles { percentiles(loops.map(pick)) };
    Summary {
        schema_version: SCHEMA_VERSION,
        position_error_dynamic_m: None,
        position_error_static_m: None,
        bus_log_cycle_zero_s: (run.cycle_zero_ns + epoch_offset_ns) as f64 * 1e-9,
        cycles: Some(run.cycles),
        skipped: Some(figures.skipped),
        overruns: loops.map_or(0, |statistics| statistics.overruns),
        late_completions: loops.map_or(0, |statistics| statistics.late_completions),
        frames_sent: bus.sent,
        frames_received: bus.received,
        frames_lost: Some(lost),
        frames_lost_at_rig: Some(lost),
        frames_malformed: figures.frames.ignored.malformed + bus.malformed,
        frames_late: both.iter().map(|commands| commands.late).sum(),
        frames_duplicate: both.iter().map(|commands| commands.duplicate).sum(),
        stale_commands: both.iter().map(|commands| commands.refused_stale + commands.expired).sum(),
        wakeup_ns: of_loop(|statistics| &statistics.wakeup_ns),
        execution_ns: of_loop(|statistics| &statistics.execution_ns),
        period_error_ns: of_loop(|statistics| &statistics.period_error_ns),
        receive_ns: timing.stages.receive_ns,
        step_ns: timing.stages.step_ns,
        send_ns: timing.stages.send_ns,
        completion_ns: timing.stages.completion_ns,
        round_trip_ns,
        load_round_trip_ns,
        drive_command_age_ns,
        load_command_age_ns,
        command_age_cycles: rig_timing.command_age_cycles,
        arrivals: timing.arrivals,
        flight: timing.flight,
        wall_clock_steps: rig_timing.wall_clock_steps,
        vitals: timing.vitals,
        allocations_in_cycle: run.allocations.filter(|_| allocations::is_registered()),
        records_dropped: Some(figures.records_dropped),
        ended_because,
        passed: Some(passed),
        thresholds: BTreeMap::new(),
        drive_commands,
        load_commands,
        frames_ignored: figures.frames,
        bus,
        bus_host,
        event_count: Some(event_count),
        events,
    }
}

/// The exit code of an end, and its message.
fn verdict(end: &RunEnd) -> (Exit, String) {
    match end {
        RunEnd::ControllersDone => (Exit::Good, "the controllers are done".into()),
        RunEnd::TimeUp => (Exit::Good, "the time asked for is up".into()),
        RunEnd::Quit => (Exit::Good, "ended at the console".into()),
        RunEnd::Interrupted => (Exit::Interrupted, "interrupted; everything recorded so far is saved".into()),
        RunEnd::OutputFailed => (Exit::BadInput, "the output could not be written".into()),
        RunEnd::BusGone => (Exit::BusFailed, "the bus was gone for too long; see --bus-grace".into()),
        RunEnd::SecondRig => {
            (Exit::BusFailed, "another rig is on this bus already; stop it, or choose another --bus".into())
        }
        RunEnd::NobodyJoined => (
            Exit::BusFailed,
            "not all members joined the barrier in time; start 'controller run --pace lockstep', or see --members".into(),
        ),
        RunEnd::MembersLeft => (Exit::BusFailed, "all members left the barrier before they were done".into()),
        RunEnd::LockstepTimeout(name) => {
            (Exit::LockstepTimeout, format!("lockstep: '{name}' was not done within the time of --lockstep-timeout"))
        }
        RunEnd::Overrun(overrun) => (Exit::BoundBroken, overrun.to_string()),
        RunEnd::NotFinite => (
            Exit::BoundBroken,
            "fault not-finite: the plant's state is no longer finite; please report the rig file".into(),
        ),
    }
}
