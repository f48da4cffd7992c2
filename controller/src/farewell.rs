//! The end of a run in real time: everything that was sent to us is received and counted before we go.
//!
//! The rig says several times that it ends, and whoever shares the bus may still speak; a controller that left at the first word
//! would leave frames in its queue that the bus delivered and that nobody received, and the account would have an open end.

use protocol::bus::{Bus, Received};
use std::time::{Duration, Instant};

/// Silence of the bus after which nothing more is expected: five times what lies between two farewells of the rig.
const QUIET: Duration = Duration::from_millis(50);
/// Longest stay on a bus that others keep busy.
const LONGEST: Duration = Duration::from_millis(300);

/// Takes what is still said on the bus when `rig_ended`, then takes leave and what had arrived by then. The frames are
/// counted by the bus and have no other effect.
pub(crate) fn hear_out(bus: &mut dyn Bus, rig_ended: bool) {
    let began = Instant::now();
    let mut last_heard = began;
    while rig_ended && bus.is_up() && last_heard.elapsed() < QUIET && began.elapsed() < LONGEST {
        bus.wait_readable(QUIET);
        if take_all(bus) > 0 {
            last_heard = Instant::now();
        }
    }
    bus.leave();
    take_all(bus);
}

fn take_all(bus: &mut dyn Bus) -> u64 {
    let mut taken = 0;
    while let Received::Frame(..) = bus.receive() {
        taken += 1;
    }
    taken
}
