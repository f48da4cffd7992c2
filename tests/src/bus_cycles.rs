//! A `bus.log` by the rig's cycles.

use protocol::can::CanFrame;
use protocol::frames::Frame;

/// A frame that `rig.dbc` knows, with the cycle whose sensors are the last before it.
#[derive(Clone, Copy, Debug)]
pub struct LoggedFrame {
    /// The rig's cycle; in real time without those that it skipped.
    pub cycle: u64,
    pub frame: Frame,
}

/// Frames of a log, which began with the run.
pub fn by_cycle(frames: &[CanFrame]) -> Vec<LoggedFrame> {
    let mut sensors = 0_u64;
    let mut logged = Vec::new();
    for frame in frames {
        let Ok(frame) = Frame::decode(frame) else { continue };
        sensors += u64::from(matches!(frame, Frame::DriveSensors(_)));
        logged.push(LoggedFrame { cycle: sensors.saturating_sub(1), frame });
    }
    logged
}
