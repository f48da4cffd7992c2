//! What breaks on purpose in a cycle of the rig, and the bench's frames about it.

use super::{FAULTS, Station};
use crate::event::{Event, EventKind};
use crate::faults::course::{Broken, FaultCourse};
use crate::faults::mark::Mark;
use crate::telegrams;
use protocol::bus::Bus;

impl Station {
    /// Lets begin and end what is due, before the sensors are sampled.
    pub(super) fn begin_faults(&mut self, cycle: u64) {
        let Self { plant, sensors, inputs, faults, recorder, .. } = self;
        faults.begin_cycle(cycle, Broken { plant, sensors, inputs }, |mark| {
            recorder.event(Event { cycle, kind: EventKind::Fault(mark) });
        });
        self.hands[FAULTS] = self.faults.hands();
    }

    /// Lets a person do something to what is broken.
    pub(super) fn break_or_mend(
        &mut self,
        cycle: u64,
        act: impl FnOnce(&mut FaultCourse, Broken<'_>, &mut dyn FnMut(Mark)),
    ) {
        let Self { plant, sensors, inputs, faults, recorder, .. } = self;
        act(faults, Broken { plant, sensors, inputs }, &mut |mark| {
            recorder.event(Event { cycle, kind: EventKind::Fault(mark) });
        });
    }

    /// Tells the bench what began and ended, where it listens.
    pub(super) fn send_fault_marks(&mut self, bus: &mut dyn Bus) {
        while let Some((number, begins)) = self.faults.next_to_tell() {
            if self.bench_frames {
                self.send(&telegrams::fault_mark(number, begins), bus);
            }
        }
    }
}
