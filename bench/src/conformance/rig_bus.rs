//! The bus from the side of the rig, cycle by cycle, in real time or in the barrier.
//!
//! ```text
//!   real      t_k: frames out ── controllers answer ── t_k+1: what came belongs to cycle k
//!   lockstep  Go(k): frames out, done(k) ── members post ── Go(k+1): what came belongs to cycle k
//! ```
//!
//! Deadlines are absolute. When this process is late by a cycle or more, time continues from there, and the cycle is marked as
//! disturbed and not judged.

use super::cli::{CheckPace, ConformanceArguments};
use protocol::bus::control::{Kind, Role};
use protocol::bus::host::Host;
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{self, Bus, BusError, BusUrl, HostThread, HostedRig, Received, StampClock};
use protocol::can::CanFrame;
use protocol::periods::CYCLE;
use realtime::{Clock, Instant, MonotonicClock, Request};
use std::time::Duration;

/// Lateness of this process that disturbs the timing of a cycle.
const DISTURBED_ABOVE: Duration = Duration::from_micros(100);
/// Time within which members must join the barrier.
const JOIN_TIMEOUT: Duration = Duration::from_secs(30);

/// Why a cycle was not completed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum ExchangeError {
    #[error("{0} did not answer within the time-out of the barrier")]
    TimedOut(String),
    #[error("no controller is in the barrier")]
    NobodyThere,
}

/// When a cycle's sensors were sent, and whether that time can be judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExchangeTiming {
    /// When its sensors were sent, ns.
    pub(super) stamp_ns: u64,
    /// This process was late, before or after.
    pub(super) disturbed: bool,
}

/// The bus, and its host if it is embedded.
pub(super) struct RigBus {
    bus: Box<dyn Bus>,
    host: Option<HostThread>,
    /// In real time, when the next cycle is due.
    due: Option<Instant>,
    barrier_cycle: u32,
}

impl RigBus {
    /// Hosts the bus; on `can://` connects to it.
    pub(super) fn open(url: &BusUrl, arguments: &ConformanceArguments) -> Result<Self, BusError> {
        let clock =
            || -> StampClock { Box::new(|age_ns| MonotonicClock.now().as_nanos().saturating_sub(age_ns)) };
        let lockstep = arguments.pace != CheckPace::Real;
        let (bus, host): (Box<dyn Bus>, _) = match url {
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
                // Above the loop, as the emulator's host; the loop reports refusals.
                let request = Request::for_a_server(Some(super::FIFO_PRIORITY + 1));
                let host = Host::bind(path, *wire, None)?;
                let host = HostThread::start(host, move || realtime::acquire(&request));
                (bus::open(url, clock())?, Some(host))
            }
        };
        Ok(Self { bus, host, due: (!lockstep).then(|| MonotonicClock.now()), barrier_cycle: 0 })
    }

    /// Waits until the barrier begins; returns at once in real time.
    pub(super) fn begin(&mut self) -> Result<(), ExchangeError> {
        if self.due.is_none() {
            self.wait_for_go(JOIN_TIMEOUT, &mut |_, _| {})?;
        }
        self.due = self.due.map(|_| MonotonicClock.now());
        Ok(())
    }

    /// One cycle: sends its frames, waits for its end, and passes on the frames received in it.
    pub(super) fn exchange(
        &mut self,
        frames: &[CanFrame],
        mut take: impl FnMut(&CanFrame, u64),
    ) -> Result<ExchangeTiming, ExchangeError> {
        let stamp_ns = MonotonicClock.now().as_nanos();
        for frame in frames {
            // A frame lost to a full queue shows as a cycle without an answer.
            let _ = self.bus.send(frame);
        }
        let Some(due) = self.due else {
            self.bus.done(self.barrier_cycle);
            self.barrier_cycle += 1;
            self.wait_for_go(bus::host::BARRIER_TIMEOUT * 2, &mut take)?;
            return Ok(ExchangeTiming { stamp_ns, disturbed: false });
        };
        let began_late = MonotonicClock.now().saturating_duration_since(due);
        let next = due + CYCLE;
        MonotonicClock.wait_until(next);
        let late = MonotonicClock.now().saturating_duration_since(next);
        while let Received::Frame(frame, stamp_ns) = self.bus.receive() {
            take(&frame, stamp_ns);
        }
        self.due = Some(if late >= CYCLE { MonotonicClock.now() } else { next });
        Ok(ExchangeTiming { stamp_ns, disturbed: late > DISTURBED_ABOVE || began_late > DISTURBED_ABOVE })
    }

    fn wait_for_go(
        &mut self,
        patience: Duration,
        take: &mut dyn FnMut(&CanFrame, u64),
    ) -> Result<(), ExchangeError> {
        let until = MonotonicClock.now() + patience;
        loop {
            match self.bus.receive() {
                Received::Frame(frame, stamp_ns) => take(&frame, stamp_ns),
                Received::Barrier(control) => match control.kind {
                    // Without members the barrier would not wait.
                    Kind::Go { members: 0 } => return Err(ExchangeError::NobodyThere),
                    Kind::Go { .. } if control.cycle == self.barrier_cycle => return Ok(()),
                    Kind::TimedOut => return Err(ExchangeError::TimedOut(control.name())),
                    _ => {}
                },
                Received::Nothing if MonotonicClock.now() >= until => return Err(ExchangeError::NobodyThere),
                Received::Nothing => {}
            }
        }
    }
}

impl Drop for RigBus {
    fn drop(&mut self) {
        // Its counters are not needed.
        if let Some(Ok(Err(error))) = self.host.take().map(HostThread::join) {
            eprintln!("bench: the bus host failed: {error}");
        }
    }
}
