//! A `bus.log` by the rig's cycles.

use crate::records;
use protocol::can::CanFrame;
use protocol::frames::Frame;
use std::path::Path;

/// A frame that `rig.dbc` knows, with the cycle whose sensors are the last before it.
#[derive(Clone, Copy, Debug)]
pub struct Logged {
    /// The rig's cycle; in real time without those that it skipped.
    pub cycle: u64,
    pub frame: Frame,
}

/// The frames of a log that was closed properly.
pub fn read(log: &Path) -> Vec<Logged> {
    by_cycle(&records::bus_log(log))
}

/// The frames of a log whose writer still writes, or was killed.
pub fn read_to_last_whole_line(log: &Path) -> Vec<Logged> {
    by_cycle(&records::bus_log_to_last_whole_line(log))
}

fn by_cycle(frames: &[CanFrame]) -> Vec<Logged> {
    let mut sensors = 0_u64;
    let mut logged = Vec::new();
    for frame in frames {
        let Ok(frame) = Frame::decode(frame) else { continue };
        sensors += u64::from(matches!(frame, Frame::DriveSensors(_)));
        logged.push(Logged { cycle: sensors.saturating_sub(1), frame });
    }
    logged
}
