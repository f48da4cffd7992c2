//! The rig of the emulator: the plant with people and injected faults.

use crate::event::{EventKind, of_outcome};
use crate::faults::mark::Mark;
use crate::faults::schedule::{FaultSchedule, FaultTargets};
use plant::scene::{Action, HandForces, RigCall, StopHolder};
use plant::{AxisReadings, CycleRecord, People, Plant, Sensors};
use rig_node::{HandForceSource, PeopledPlant, RigCondition, SimulatedRig};

/// The plant with people and faults.
pub(crate) struct BreakableRig {
    peopled: PeopledPlant,
    faults: FaultSchedule,
}

impl BreakableRig {
    pub(crate) fn new(mut plant: Plant, mut sensors: Sensors, people: People, faults: FaultSchedule) -> Self {
        if faults.possible {
            plant.expect_faults();
            sensors.seed_faults(faults.seed);
        }
        Self { peopled: PeopledPlant::new(plant, sensors, people), faults }
    }

    pub(crate) fn plant(&self) -> &Plant {
        self.peopled.plant()
    }

    /// Forces of a hand, from now on.
    pub(crate) fn hand_forces(&mut self, source: HandForceSource) -> &mut HandForces {
        self.peopled.hand_forces(source)
    }

    pub(crate) fn act(&mut self, action: Action, mut on_event: impl FnMut(EventKind)) {
        self.peopled.act(action, |outcome| on_event(of_outcome(outcome)));
    }

    /// Starts or ends faults by hand.
    pub(crate) fn break_or_mend(
        &mut self,
        act: impl FnOnce(&mut FaultSchedule, FaultTargets<'_>, &mut dyn FnMut(Mark)),
        mut on_event: impl FnMut(EventKind),
    ) {
        let (plant, sensors, inputs) = self.peopled.parts();
        let broken = FaultTargets { plant, sensors, inputs };
        act(&mut self.faults, broken, &mut |mark| on_event(EventKind::Fault(mark)));
    }

    /// The next mark for the bench's frame: number of the fault, and whether it begins.
    pub(crate) fn next_fault_mark(&mut self) -> Option<(u16, bool)> {
        self.faults.pending_marks.pop_front()
    }
}

impl SimulatedRig for BreakableRig {
    type Cycle = CycleRecord;
    type Event = EventKind;

    fn sample(&mut self, cycle: u64, on_event: &mut dyn FnMut(EventKind)) -> [AxisReadings; 2] {
        self.peopled.let_people_act(cycle, |outcome| on_event(of_outcome(outcome)));
        let (plant, sensors, inputs) = self.peopled.parts();
        let broken = FaultTargets { plant, sensors, inputs };
        self.faults.begin_cycle(cycle, broken, |mark| on_event(EventKind::Fault(mark)));
        *self.peopled.hand_forces(HandForceSource::Faults) = self.faults.overlay.hands;
        self.peopled.sample_sensors()
    }

    fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        self.peopled.rig_call(cycle)
    }

    fn emergency_stop(&mut self, holder: StopHolder, release: bool) -> Option<EventKind> {
        self.peopled.emergency_stop(holder, release).map(of_outcome)
    }

    fn condition(&self) -> RigCondition {
        self.peopled.condition()
    }

    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> CycleRecord {
        let mut record = self.peopled.step(cycle, valve);
        if self.faults.possible {
            record.terms.push(self.faults.active() as f64);
        }
        record
    }
}
