//! A bus that stamps the duration of sending, and the time of sending of the command of each axis.

use super::{StampedFrame, Stopwatch};
use protocol::bus::{FrameSink, SendError};
use protocol::can::CanFrame;
use protocol::frames::{DRIVE_VALVE_COMMAND, LOAD_VALVE_COMMAND};
use realtime::Clock;

pub(crate) struct TimedBus<'a, C> {
    pub(super) stopwatch: &'a mut Stopwatch<C>,
    pub(super) bus: &'a mut dyn FrameSink,
}

impl<C: Clock> FrameSink for TimedBus<'_, C> {
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
}
