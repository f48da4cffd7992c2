//! Ping-pong: round trips of 16 bytes between two processes, as a reference for those of rig and controller.
//!
//! ```text
//!   ping (this process)                    pong (a child of the same program)
//!     at t_n = t_0 + n · interval   16 bytes ──────►  answers at once
//!     reads the answer  ◄────────── 16 bytes
//! ```
//! Both have the same FIFO priority and lock their memory; each may be pinned. On a bus they are peers like emulator and
//! controller and wait as the controller does (poll, then a batch); on a bare pair of sockets they use blocking reads, the
//! minimum for two process switches on this kernel. The 16 bytes are a `struct can_frame`.
//!
//! # Terms
//! - *Round trip*: from before sending until the answer is read, both switches included.
//! - *To arrival*: until the answer arrives at our queue, by the kernel's stamp. The rig's round trip is measured so, since the
//!   rig does not wait for the answer but finds it at its next cycle.

pub(crate) mod cli;
mod rally;
mod transport;

use crate::{say, warn};
use cli::{PingPongArguments, PongArguments};
use latency::kinds::{PING_PONG, TO_ARRIVAL};
use protocol::bus::{self, BusError, BusUrl, StampClock};
use protocol::exit::Exit;
use rally::{PingPongResult, PingSchedule};
use realtime::{Clock, Grants, Interrupt, MonotonicClock, Percentiles, Request, write_hlog};
use runlog::ping_pong::{PingPongFigures, PingPongFile};
use runlog::run_folder::{FileError, SCHEMA_VERSION, write_json};
use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use transport::{BusTransport, FrameTransport, SocketTransport};

/// Time without pings after which the answering process ends.
const SILENCE: Duration = Duration::from_secs(10);

#[derive(Debug, thiserror::Error)]
pub(crate) enum PingPongError {
    #[error("{what}: {reason}")]
    System { what: &'static str, reason: String },
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("no answer {0}; an embedded bus needs a host: 'emulator bus --bus URL'")]
    Silent(String),
    #[error(transparent)]
    File(#[from] FileError),
}

impl PingPongError {
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Bus(_) | Self::Silent(_) => Exit::BusFailed,
            Self::System { .. } | Self::File(_) => Exit::BadInput,
        }
    }

    fn system(what: &'static str, reason: impl ToString) -> Self {
        Self::System { what, reason: reason.to_string() }
    }
}

/// Measures as asked, prints the figures, and writes them where asked.
pub(crate) fn run(arguments: &PingPongArguments) -> Result<Exit, PingPongError> {
    let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let interrupt =
        Interrupt::install().map_err(|error| PingPongError::system("no signal handler", error))?;
    // Before this process acquires real-time privileges, which the child would inherit.
    let (mut transport, mut other) = open(arguments)?;
    let played = play(arguments, &mut *transport, &interrupt);
    // On a socket pair the child ends when we close ours; on a bus it would wait for more.
    drop(transport);
    let _ = other.kill();
    let _ = other.wait();
    let (rally, grants) = played?;
    let figures = figures(arguments, &rally, &grants);
    print_figures(&name(arguments), &figures);
    if let Some(path) = &arguments.json {
        add(path, &name(arguments), figures)?;
    }
    if let Some(path) = &arguments.out {
        let tag = format!("{PING_PONG}{}", name(arguments));
        let length = Duration::from_secs_f64(arguments.seconds);
        let to_arrival = format!("{tag}{TO_ARRIVAL}");
        let mut parts = vec![(tag.as_str(), rally.round_trip_ns.histogram())];
        if arguments.bus.is_some() {
            parts.push((&to_arrival, rally.to_arrival_ns.histogram()));
        }
        write_hlog(path, &parts, started.as_secs_f64(), length)
            .map_err(|error| FileError::write(path, error))?;
    }
    Ok(if interrupt.came() { Exit::Interrupted } else { Exit::Good })
}

/// Answers pings; the process that [`run`] starts.
pub(crate) fn pong(arguments: &PongArguments) -> Result<Exit, PingPongError> {
    // The parent may be killed and could not end this process then.
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))
        .map_err(|errno| PingPongError::system("no signal when the parent ends", errno))?;
    let mut transport = match &arguments.bus {
        Some(url) => on_bus(url)?,
        None => on_socket(io::stdin().as_fd().try_clone_to_owned())?,
    };
    let _grants = grants(arguments.priority, arguments.cpu);
    rally::answer(&mut *transport, &MonotonicClock, SILENCE);
    Ok(Exit::Good)
}

fn play(
    arguments: &PingPongArguments,
    transport: &mut dyn FrameTransport,
    interrupt: &Interrupt,
) -> Result<(PingPongResult, Grants), PingPongError> {
    let grants = grants((!arguments.no_realtime).then_some(arguments.priority), arguments.cpu);
    let interval = Duration::from_micros(arguments.interval_us);
    let pings = (arguments.seconds * 1e6 / arguments.interval_us as f64).round().max(1.0) as u64;
    let gone = |_| PingPongError::Silent("any more: the process that answers has ended".into());
    if !rally::serve(transport, &MonotonicClock, interrupt).map_err(gone)? && !interrupt.came() {
        let bus = arguments.bus.as_ref().map_or_else(String::new, |bus| format!(" on {bus}"));
        let up = if transport.is_up() { "" } else { ", which is down" };
        return Err(PingPongError::Silent(format!("within 5 s{bus}{up}")));
    }
    let rally =
        rally::ask(transport, &MonotonicClock, PingSchedule { interval, pings }, interrupt).map_err(gone)?;
    Ok((rally, grants))
}

/// Our end, and the process at the other end.
fn open(arguments: &PingPongArguments) -> Result<(Box<dyn FrameTransport>, Child), PingPongError> {
    let program = std::env::current_exe();
    let program = program.map_err(|error| PingPongError::system("this program's own path", error))?;
    let mut command = Command::new(program);
    command.arg("pong").stdin(Stdio::null());
    if !arguments.no_realtime {
        command.args(["--priority", &arguments.priority.to_string()]);
    }
    if let Some(cpu) = arguments.peer_cpu {
        command.args(["--cpu", &cpu.to_string()]);
    }
    let transport = match &arguments.bus {
        Some(url) => {
            command.args(["--bus", &url.to_string()]);
            on_bus(url)?
        }
        None => {
            let pair = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None);
            let (ours, theirs) = pair.map_err(|errno| PingPongError::system("no pair of sockets", errno))?;
            command.stdin(Stdio::from(theirs));
            on_socket(Ok(ours))?
        }
    };
    let other = command.spawn().map_err(|error| PingPongError::system("no second process", error))?;
    Ok((transport, other))
}

fn on_bus(url: &BusUrl) -> Result<Box<dyn FrameTransport>, PingPongError> {
    let clock: StampClock = Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns));
    Ok(Box::new(BusTransport(bus::open(url, clock)?)))
}

fn on_socket(socket: io::Result<OwnedFd>) -> Result<Box<dyn FrameTransport>, PingPongError> {
    let refused = |reason: String| PingPongError::System { what: "no socket to read from", reason };
    let socket = socket.map_err(|error| refused(error.to_string()))?;
    Ok(Box::new(SocketTransport::new(socket).map_err(|errno| refused(errno.to_string()))?))
}

/// Acquires real-time privileges for this thread and warns of refusals.
pub(crate) fn grants(priority: Option<u8>, cpu: Option<usize>) -> Grants {
    let request = match priority {
        Some(priority) => Request::for_a_loop(priority, cpu),
        None => Request { cpu, ..Request::default() },
    };
    let grants = realtime::acquire(&request);
    grants.refusals.iter().for_each(|refusal| warn(&format!("warning: {refusal}")));
    grants
}

fn name(arguments: &PingPongArguments) -> String {
    let usual = if arguments.socketpair { "socketpair" } else { "bus" };
    arguments.name.clone().unwrap_or_else(|| usual.to_owned())
}

fn figures(arguments: &PingPongArguments, rally: &PingPongResult, grants: &Grants) -> PingPongFigures {
    PingPongFigures {
        round_trip_ns: rally.round_trip_ns.percentiles(),
        to_arrival_ns: arguments.bus.as_ref().map(|_| rally.to_arrival_ns.percentiles()),
        sent: rally.sent,
        answered: rally.answered,
        lost: rally.sent - rally.answered,
        skipped: rally.skipped,
        interval_us: arguments.interval_us,
        priority: arguments.priority,
        cpu: arguments.cpu,
        peer_cpu: arguments.peer_cpu,
        bus: arguments.bus.as_ref().map(ToString::to_string),
        granted: grants.granted.clone(),
        refused: grants.refusals.iter().map(ToString::to_string).collect(),
    }
}

fn print_figures(name: &str, figures: &PingPongFigures) {
    let us = |ns: Option<u64>| ns.map_or_else(|| "-".to_owned(), |ns| format!("{:.1}", ns as f64 / 1e3));
    let line = |what: &str, of: &Percentiles| {
        format!(
            "{name} {what}: p50 {} p90 {} p99 {} p99.9 {} max {} us, {} samples",
            us(of.p50),
            us(of.p90),
            us(of.p99),
            us(of.p999),
            us(of.max),
            of.count
        )
    };
    say(&line("round trip", &figures.round_trip_ns));
    if let Some(to_arrival_ns) = &figures.to_arrival_ns {
        say(&line("to arrival", to_arrival_ns));
    }
    if figures.lost + figures.skipped > 0 {
        say(&format!("{name}: {} pings lost, {} left out", figures.lost, figures.skipped));
    }
}

/// Adds the figures to a file of several ping-pongs.
fn add(path: &Path, name: &str, figures: PingPongFigures) -> Result<(), FileError> {
    let refused = |reason: String| FileError::write(path, reason);
    let mut file: PingPongFile = match std::fs::read_to_string(path) {
        Ok(text) => serde_json::from_str(&text).map_err(|error| refused(format!("not ours: {error}")))?,
        Err(error) if error.kind() == io::ErrorKind::NotFound => PingPongFile::default(),
        Err(error) => return Err(refused(error.to_string())),
    };
    file.schema_version = SCHEMA_VERSION;
    file.figures.insert(name.into(), figures);
    let command: Vec<String> = std::env::args().collect();
    file.commands.insert(name.into(), command.join(" "));
    // As a JSON value, whose keys are sorted.
    let file = serde_json::to_value(file).map_err(|error| refused(error.to_string()))?;
    write_json(path, &file).map_err(|error| refused(error.to_string()))
}
