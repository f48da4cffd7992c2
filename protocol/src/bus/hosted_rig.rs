//! The rig's own peer when it hosts the lockstep barrier: it serves the bus itself while it waits for its turn.
//!
//! In lockstep nothing else could run meanwhile, so a thread for the host would only add two switches to every cycle, which is
//! most of a cycle's cost. The barrier, its order and its packets are the host's own, the same as through a socket.

use super::control::Role;
use super::host::{ForRig, FromRig, Host, HostReport};
use super::{Bus, BusCounters, BusError, FrameSink, Received, SendError, StampClock};
use crate::can::{CanFrame, ERROR_FLAG};
use rustix::time::Timespec;
use std::time::Duration;

/// Longest wait for a packet in one receive call.
const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// The rig on the bus that it hosts.
pub struct HostedRig {
    host: Host,
    clock: StampClock,
    counters: BusCounters,
    serving: bool,
}

impl HostedRig {
    /// Takes over a host that was bound with a barrier.
    #[must_use]
    pub fn new(host: Host, clock: StampClock) -> Self {
        Self { host, clock, counters: BusCounters::default(), serving: true }
    }

    fn take(&mut self) -> Option<Received> {
        loop {
            match self.host.next_for_rig()? {
                // As at a socket's peer: counted, and no message to anybody.
                ForRig::Frame(frame) if frame.raw_id() & ERROR_FLAG != 0 => self.counters.error_frames += 1,
                ForRig::Frame(frame) => {
                    self.counters.received += 1;
                    self.counters.received_by_id.count(&frame);
                    return Some(Received::Frame(frame, (self.clock)(0)));
                }
                ForRig::Barrier(control) => return Some(Received::Barrier(control)),
            }
        }
    }

    fn serve(&mut self, patience: Timespec) {
        self.serving &= self.host.turn(patience).is_ok();
    }
}

impl FrameSink for HostedRig {
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError> {
        self.counters.sent += 1;
        self.counters.sent_by_id.count(frame);
        self.host.take_from_rig(FromRig::Frame(*frame));
        Ok((self.clock)(0))
    }
}

impl Bus for HostedRig {
    fn receive(&mut self) -> Received {
        if let Some(received) = self.take() {
            return received;
        }
        self.serve(PATIENCE);
        self.take().unwrap_or(Received::Nothing)
    }

    fn wait_readable(&mut self, timeout: Duration) {
        self.serve(Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: i64::from(timeout.subsec_nanos()) });
    }

    fn is_up(&self) -> bool {
        self.serving
    }

    fn counters(&self) -> &BusCounters {
        &self.counters
    }

    fn join_lockstep(&mut self, role: Role, name: &str) -> Result<(), BusError> {
        assert!(role == Role::Rig && name == "rig", "only the rig lives with its host");
        if self.host.join_rig_here() { Ok(()) } else { Err(BusError::NoBarrier { url: "this host".into() }) }
    }

    fn done(&mut self, cycle: u32) {
        self.host.take_from_rig(FromRig::Done(cycle));
    }

    fn host_report(&self) -> Option<HostReport> {
        Some(self.host.report())
    }
}
