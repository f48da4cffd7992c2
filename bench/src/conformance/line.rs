//! The bus as the rig has it, cycle by cycle, in real time or in the barrier.
//!
//! ```text
//!   real      t_k: frames out ── controllers answer ── t_k+1: what came belongs to cycle k
//!   lockstep  Go(k): frames out, done(k) ── members post ── Go(k+1): what came belongs to cycle k
//! ```
//!
//! Deadlines are absolute. When this process itself is late by a cycle or more, time goes on from there, and the cycle is
//! reported as disturbed: it says nothing of the controller.

use super::cli::{CheckPace, ConformanceArguments};
use protocol::bus::control::{Kind, Role};
use protocol::bus::host::Host;
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{self, Bus, BusError, BusUrl, HostedRig, Received, StampClock};
use protocol::can::CanFrame;
use protocol::periods::CYCLE;
use realtime::{Clock, Instant, MonotonicClock};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Lateness of this process that spoils a cycle's times.
const DISTURBED: Duration = Duration::from_micros(100);
/// How long members of the barrier may take to join.
const JOIN_PATIENCE: Duration = Duration::from_secs(30);

/// Why a cycle was not completed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Broken {
    /// Lockstep: somebody did not answer within the barrier's patience.
    TimedOut(String),
    NobodyThere,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    /// When its sensors were handed to the bus, ns.
    pub(super) stamp_ns: u64,
    /// This process was late, before or after.
    pub(super) disturbed: bool,
}

/// The bus, and who serves it.
pub(super) struct Line {
    bus: Box<dyn Bus>,
    server: Option<Server>,
    /// In real time, when the next cycle is due.
    due: Option<Instant>,
    barrier_cycle: u32,
}

impl Line {
    /// Takes the bus into service; on `can://` connects.
    pub(super) fn open(url: &BusUrl, arguments: &ConformanceArguments) -> Result<Self, BusError> {
        let clock =
            || -> StampClock { Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns)) };
        let lockstep = arguments.pace != CheckPace::Real;
        let (bus, server): (Box<dyn Bus>, _) = match url {
            BusUrl::Can { .. } if lockstep => return Err(BusError::NoBarrier { url: url.to_string() }),
            BusUrl::Can { .. } => (bus::open(url, clock())?, None),
            BusUrl::Unix { path, wire } if lockstep => {
                let echo = arguments.pace == CheckPace::LockstepEcho;
                let config = BarrierConfig {
                    members: usize::from(!echo),
                    echo_ids: echo.then(|| arguments.axis.command().id).into_iter().collect(),
                };
                let mut rig = HostedRig::new(Host::bind(path, *wire, Some(config))?, clock());
                rig.join_lockstep(Role::Rig, "rig")?;
                (Box::new(rig), None)
            }
            BusUrl::Unix { path, wire } => {
                let server = Server::start(Host::bind(path, *wire, None)?);
                (bus::open(url, clock())?, Some(server))
            }
        };
        Ok(Self { bus, server, due: (!lockstep).then(|| MonotonicClock.now()), barrier_cycle: 0 })
    }

    /// Waits until the barrier begins; in real time there is nothing to wait for.
    pub(super) fn begin(&mut self) -> Result<(), Broken> {
        if self.due.is_none() {
            self.wait_for_go(JOIN_PATIENCE, &mut |_, _| {})?;
        }
        self.due = self.due.map(|_| MonotonicClock.now());
        Ok(())
    }

    /// One cycle: sends its frames, waits for its end, and hands on what came in it.
    pub(super) fn exchange(
        &mut self,
        frames: &[CanFrame],
        mut take: impl FnMut(&CanFrame, u64),
    ) -> Result<Sent, Broken> {
        let stamp_ns = MonotonicClock.now().as_nanos();
        for frame in frames {
            // What a full queue drops shows as a cycle without an answer.
            let _ = self.bus.send(frame);
        }
        let Some(due) = self.due else {
            self.bus.done(self.barrier_cycle);
            self.barrier_cycle += 1;
            self.wait_for_go(bus::host::BARRIER_TIMEOUT * 2, &mut take)?;
            return Ok(Sent { stamp_ns, disturbed: false });
        };
        let began_late = MonotonicClock.now().saturating_duration_since(due);
        let next = due + CYCLE;
        MonotonicClock.wait_until(next);
        let late = MonotonicClock.now().saturating_duration_since(next);
        while let Received::Frame(frame, stamp_ns) = self.bus.receive() {
            take(&frame, stamp_ns);
        }
        self.due = Some(if late >= CYCLE { MonotonicClock.now() } else { next });
        Ok(Sent { stamp_ns, disturbed: late > DISTURBED || began_late > DISTURBED })
    }

    fn wait_for_go(
        &mut self,
        patience: Duration,
        take: &mut dyn FnMut(&CanFrame, u64),
    ) -> Result<(), Broken> {
        let until = MonotonicClock.now() + patience;
        loop {
            match self.bus.receive() {
                Received::Frame(frame, stamp_ns) => take(&frame, stamp_ns),
                Received::Barrier(control) => match control.kind {
                    // Without members it would go on by itself.
                    Kind::Go { members: 0 } => return Err(Broken::NobodyThere),
                    Kind::Go { .. } if control.cycle == self.barrier_cycle => return Ok(()),
                    Kind::TimedOut => return Err(Broken::TimedOut(control.name())),
                    _ => {}
                },
                Received::Nothing if MonotonicClock.now() >= until => return Err(Broken::NobodyThere),
                Received::Nothing => {}
            }
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            server.stop.store(true, Ordering::Relaxed);
            // It ends by itself; what it counted is not asked for.
            let _ = server.thread.join();
        }
    }
}

/// The host of an embedded bus, in a thread of its own.
struct Server {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Server {
    fn start(host: Host) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            // Above the loop, as the emulator's host; the loop tells what is refused.
            let fifo_priority = Some(super::FIFO_PRIORITY + 1);
            let request =
                realtime::Request { fifo_priority, timer_slack: true, ..realtime::Request::default() };
            let _grants = realtime::acquire(&request);
            if let Err(error) = host.serve(&stopped) {
                eprintln!("bench: the bus host failed: {error}");
            }
        });
        Self { stop, thread }
    }
}
