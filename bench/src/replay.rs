//! Sends a recorded log on a bus by absolute time, and measures the timing error.
//!
//! ```text
//!   bus.log ─► recorded_log.rs ─► schedule.rs: when is what due ─► listen: a live rig? ─► play.rs ─► replay.json, replay.hlog
//!                                   └─ kind.rs: whose frame is it       └─ refused
//! ```
//!
//! A log holds commands of the past. On a bus with a live rig its valves would follow them, and controllers would receive old
//! sensor values: both are refused before the first frame, and end the replay when a rig starts later.
//!
//! Nothing is sent from a log with an error in any line.

pub(crate) mod cli;
mod kind;
mod play;
mod schedule;

use crate::ping_pong::grants;
use crate::recorded_log::{RecordedLog, RecordedLogError};
use crate::say;
use cli::ReplayArguments;
use play::{ReplayEnd, ReplayStatistics, play, take_rig_frames};
use protocol::bus::{self, Bus, BusError, StampClock};
use protocol::exit::Exit;
use realtime::{Clock, Interrupt, MonotonicClock, write_hlog};
use runlog::run_folder::{FileError, SCHEMA_VERSION, write_json};
use schedule::{LONGEST, Schedule};
use serde_json::json;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Period of the polls for the bus.
const POLL_PERIOD: Duration = Duration::from_millis(10);

#[derive(Debug, thiserror::Error)]
pub(crate) enum ReplayError {
    #[error(transparent)]
    Log(#[from] RecordedLogError),
    #[error("{file} holds frames of {names}: choose one with --interface NAME")]
    Interfaces { file: PathBuf, names: String },
    #[error("{file}:{line}: this frame is more than {} days after the first one: cut the log", LONGEST.as_secs() / 86400)]
    TooLong { file: PathBuf, line: u64 },
    #[error("nothing of {0} is left to be sent")]
    Nothing(PathBuf),
    #[error(
        "a rig is live on {bus} ({received} of its frames in {listened_ms} ms), and the log holds {commands} commands and \
         {of_the_rig} frames of a rig, all of the past: leave them out with --leave-out commands,rig, or take another bus"
    )]
    LiveRig {
        bus: String,
        /// Frames received from the live rig.
        received: u64,
        listened_ms: u64,
        /// Commands among the frames to send.
        commands: u64,
        /// Frames of a rig among the frames to send.
        of_the_rig: u64,
    },
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("{0} is not there; an embedded bus needs a host: 'emulator bus --bus URL'")]
    NoBus(String),
    #[error("signals cannot be watched: {0}")]
    Signals(io::Error),
    #[error(transparent)]
    File(#[from] FileError),
}

impl ReplayError {
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Bus(_) | Self::NoBus(_) => Exit::BusFailed,
            _ => Exit::BadInput,
        }
    }
}

/// Replays a log and prints the statistics; writes them to a folder too, if asked.
///
/// # Errors
/// [`ReplayError`]: nothing was sent, except for [`ReplayError::File`].
pub(crate) fn run(arguments: &ReplayArguments) -> Result<Exit, ReplayError> {
    let log = RecordedLog::read(&arguments.source, arguments.interface.as_deref())?;
    log.warn_of_cut_line();
    if log.interfaces.len() > 1 {
        return Err(ReplayError::Interfaces { file: log.file, names: log.interfaces.join(", ") });
    }
    let schedule = Schedule::of(&log, &arguments.leave_out)
        .map_err(|long| ReplayError::TooLong { file: log.file.clone(), line: long.line })?;
    if schedule.frames.is_empty() {
        return Err(ReplayError::Nothing(log.file));
    }
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).map_err(|error| FileError::write(out, error))?;
    }
    let interrupt = Interrupt::install().map_err(ReplayError::Signals)?;
    let clock: StampClock = Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns));
    let mut bus = bus::open(&arguments.bus, clock)?;
    if !connected(bus.as_mut(), Duration::from_secs(arguments.wait_s), &interrupt) {
        let gone = Err(ReplayError::NoBus(arguments.bus.to_string()));
        return if interrupt.came() { Ok(Exit::Interrupted) } else { gone };
    }
    let received = listen(bus.as_mut(), Duration::from_millis(arguments.listen_ms), &interrupt);
    if received > 0 && schedule.disturbs_a_rig() {
        return Err(ReplayError::LiveRig {
            bus: arguments.bus.to_string(),
            received,
            listened_ms: arguments.listen_ms,
            commands: schedule.commands,
            of_the_rig: schedule.of_the_rig,
        });
    }
    let length_s = schedule.frames[schedule.frames.len() - 1].after_ns as f64 * 1e-9;
    say(&format!("replaying {} frames over {length_s:.3} s on {}", schedule.frames.len(), arguments.bus));
    let _grants = grants(arguments.priority, arguments.cpu);
    let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let spin = Duration::from_micros(arguments.spin_us);
    let played = play(bus.as_mut(), &MonotonicClock, &schedule, spin, &interrupt);
    print_statistics(&schedule, &played);
    if let Some(out) = &arguments.out {
        write(out, arguments, &log, &schedule, &played, started)?;
    }
    Ok(match played.end {
        ReplayEnd::Interrupted => Exit::Interrupted,
        ReplayEnd::LiveRig => Exit::BusFailed,
        ReplayEnd::Completed if played.dropped > 0 => Exit::BusFailed,
        ReplayEnd::Completed => Exit::Good,
    })
}

fn connected(bus: &mut dyn Bus, patience: Duration, interrupt: &Interrupt) -> bool {
    let until = MonotonicClock.now() + patience;
    loop {
        bus.receive();
        if bus.is_up() || interrupt.came() || MonotonicClock.now() >= until {
            return bus.is_up();
        }
        MonotonicClock.wait_until(MonotonicClock.now() + POLL_PERIOD);
    }
}

/// Number of frames of a rig received within `length`; a rig sends thousands a second.
fn listen(bus: &mut dyn Bus, length: Duration, interrupt: &Interrupt) -> u64 {
    let until = MonotonicClock.now() + length;
    let mut received = 0;
    while MonotonicClock.now() < until && !interrupt.came() {
        received += take_rig_frames(bus);
        MonotonicClock.wait_until(until.min(MonotonicClock.now() + POLL_PERIOD));
    }
    received + take_rig_frames(bus)
}

fn print_statistics(schedule: &Schedule, played: &ReplayStatistics) {
    let Schedule { left_out, error_frames, disordered, .. } = schedule;
    let total = schedule.frames.len();
    let how = match played.end {
        ReplayEnd::Completed => "",
        ReplayEnd::Interrupted => ", then interrupted",
        ReplayEnd::LiveRig => {
            ", then stopped: a rig came alive on the bus, and what follows would disturb it"
        }
    };
    say(&format!("sent {} of {total} frames{how}", played.sent));
    for (count, what) in [
        (*left_out, "frames of the log left out, as requested"),
        (*error_frames, "error frames of the log left out: nobody can send them"),
        (*disordered, "frames with a stamp before an earlier line's, sent with that one"),
        (played.dropped, "frames that the bus did not take"),
    ] {
        if count > 0 {
            say(&format!("{count} {what}"));
        }
    }
    say(&format!("timing error: {}", played.error_ns.percentiles()));
}

fn write(
    out: &Path,
    arguments: &ReplayArguments,
    log: &RecordedLog,
    schedule: &Schedule,
    played: &ReplayStatistics,
    started: Duration,
) -> Result<(), FileError> {
    let (table, histogram) = (out.join("replay.json"), out.join("replay.hlog"));
    let reported = json!({
        "schema": "airbench-replay",
        "schema_version": SCHEMA_VERSION,
        "log": log.file,
        "bus": arguments.bus.to_string(),
        "ended": played.end,
        "frames_in_log": log.frames.len(),
        "frames_scheduled": schedule.frames.len(),
        "frames_sent": played.sent,
        "frames_dropped": played.dropped,
        "frames_left_out": schedule.left_out,
        "error_frames_left_out": schedule.error_frames,
        "frames_disordered": schedule.disordered,
        "timing_error_ns": played.error_ns,
    });
    write_json(&table, &reported).map_err(|error| FileError::write(&table, error))?;
    let parts = [("replay-timing-error", played.error_ns.histogram())];
    let length = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().saturating_sub(started);
    write_hlog(&histogram, &parts, started.as_secs_f64(), length)
        .map_err(|error| FileError::write(&histogram, error))
}
