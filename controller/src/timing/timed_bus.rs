//! A bus that stamps the duration of sending, and the time of sending of the command of each axis.

use super::{StampedFrame, Stopwatch};
use protocol::bus::control::Role;
use protocol::bus::{Bus, BusCounters, BusError, Received, SendError};
use protocol::can::CanFrame;
use protocol::frames::{DRIVE_VALVE_COMMAND, LOAD_VALVE_COMMAND};
use realtime::Clock;
use std::time::Duration;

pub(crate) struct TimedBus<'a, C> {
    stopwatch: &'a mut Stopwatch<C>,
    bus: &'a mut dyn Bus,
}

impl<'a, C> TimedBus<'a, C> {
    pub(super) fn new(stopwatch: &'a mut Stopwatch<C>, bus: &'a mut dyn Bus) -> Self {
        Self { stopwatch, bus }
    }
}

impl<C: Clock + Send> Bus for TimedBus<'_, C> {
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError> {
        let began_ns = self.stopwatch.now_ns();
        let sent = self.bus.send(frame);
        let ended_ns = self.stopwatch.now_ns();
        let wake_up = &mut self.stopwatch.wake_up;
        wake_up.send_ns += ended_ns.saturating_sub(began_ns);
        if let Ok(stamp_ns) = sent {
            match frame.standard_id() {
                Some(id) if id == DRIVE_VALVE_COMMAND.id => wake_up.handed_ns[0] = stamp_ns,
                Some(id) if id == LOAD_VALVE_COMMAND.id => wake_up.handed_ns[1] = stamp_ns,
                _ => {}
            }
            self.stopwatch.queue_frame(StampedFrame { stamp_ns, frame: *frame, sent: true });
        }
        sent
    }

    fn receive(&mut self) -> Received {
        self.bus.receive()
    }

    fn wait_readable(&mut self, timeout: Duration) {
        self.bus.wait_readable(timeout);
    }

    fn is_up(&self) -> bool {
        self.bus.is_up()
    }

    fn counters(&self) -> &BusCounters {
        self.bus.counters()
    }

    fn join_lockstep(&mut self, role: Role, name: &str) -> Result<(), BusError> {
        self.bus.join_lockstep(role, name)
    }

    fn done(&mut self, cycle: u32) {
        self.bus.done(cycle);
    }
}
