//! Schedule of the faults of a run: evaluated once for every cycle, missed ones included.
//!
//! ```text
//!   Waiting ── its time, and its condition ──► Active ── its time, a person mends it, the piston hit ──► Over
//!      └────── its time passes before its condition holds ────────────────────────────────────────────────┘
//! ```
//!
//! Nothing allocates after construction; without waiting and active faults a cycle costs one comparison.

use super::Fault;
use super::mark::{Cause, Mark};
use super::overlay::{Overlay, on_wire};
use super::script::{Condition, FaultEnd, FaultScript};
use super::table::Kind;
use plant::{Axis, Inputs, Plant, Sensors};
use protocol::bus::{WireOrder, WireOrders};
use runlog::event::FaultChange;
use std::collections::VecDeque;

/// Most faults injected by hand at once.
const MOST_BY_HAND: usize = 64;
/// Capacity of the queue of marks to the bench: all faults of a script may begin in one cycle and end in the next.
const MARKS: usize = 2048;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Waiting { from: u64, when: Option<Condition>, until: Option<FaultEnd> },
    Active { until: Option<u64> },
    Over,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    number: u16,
    fault: Fault,
    cause: Cause,
    state: State,
}

pub(crate) struct FaultSchedule {
    entries: Vec<Entry>,
    room: usize,
    /// Whether a fault waits or is active.
    busy: bool,
    next_number: u16,
    /// Seed of all random faults.
    pub(crate) seed: u64,
    orders: Option<WireOrders>,
    pub(crate) overlay: Overlay,
    /// Marks for the bench's frame: number of the fault, and whether it begins.
    pub(crate) pending_marks: VecDeque<(u16, bool)>,
    /// Whether faults are possible in this run.
    pub(crate) possible: bool,
}

/// The objects that faults act on in a cycle.
pub(crate) struct FaultTargets<'a> {
    /// The plant at the start of the cycle.
    pub plant: &'a mut Plant,
    pub sensors: &'a mut Sensors,
    /// Inputs of the plant in the cycle before.
    pub inputs: &'a Inputs,
}

impl FaultSchedule {
    /// The faults of a script, with room for faults by hand if `by_hand`. `orders` is the queue to the host of the bus, if
    /// there is one.
    pub(crate) fn new(script: Option<&FaultScript>, by_hand: bool, orders: Option<WireOrders>) -> Self {
        let planned = script.map_or(&[][..], |script| &script.faults);
        let possible = script.is_some() || by_hand;
        let room = planned.len() + if by_hand { MOST_BY_HAND } else { 0 };
        let mut entries = Vec::with_capacity(room);
        entries.extend(planned.iter().zip(1..).map(|(planned, number)| Entry {
            number,
            fault: planned.fault,
            cause: Cause::Script { line: planned.line },
            state: State::Waiting { from: planned.from, when: planned.when, until: planned.until },
        }));
        Self {
            busy: !entries.is_empty(),
            next_number: entries.len() as u16 + 1,
            entries,
            room,
            seed: script.map_or(1, |script| script.seed),
            orders,
            overlay: Overlay::default(),
            pending_marks: VecDeque::with_capacity(if possible { MARKS } else { 0 }),
            possible,
        }
    }

    /// Number of active faults.
    pub(crate) fn active(&self) -> usize {
        if !self.busy {
            return 0;
        }
        self.entries.iter().filter(|entry| matches!(entry.state, State::Active { .. })).count()
    }

    /// Starts and ends the faults that are due in `cycle`, before the sensors are sampled.
    pub(crate) fn begin_cycle(
        &mut self,
        cycle: u64,
        broken: FaultTargets<'_>,
        mut on_mark: impl FnMut(Mark),
    ) {
        if !self.busy {
            return;
        }
        let mut truth = None;
        let mut changed = false;
        for place in 0..self.entries.len() {
            let entry = self.entries[place];
            match entry.state {
                State::Over => {}
                State::Waiting { from, .. } if cycle < from => {}
                State::Waiting { until: Some(FaultEnd::Cycle(to)), .. } if cycle >= to => {
                    self.entries[place].state = State::Over;
                    self.report(place, FaultChange::NeverBegan, &mut on_mark);
                }
                State::Waiting { when, until, .. } => {
                    let met = when.is_none_or(|when| {
                        let truth = truth.get_or_insert_with(|| broken.plant.truth(broken.inputs));
                        when.holds(truth, broken.inputs.valve)
                    });
                    if met {
                        let until = until.map(|until| match until {
                            FaultEnd::Cycle(to) => to,
                            FaultEnd::After(cycles) => cycle + cycles,
                        });
                        self.start(place, until, broken.plant, &mut on_mark);
                        changed = true;
                    }
                }
                State::Active { until } => {
                    let mended = until.is_some_and(|until| cycle >= until);
                    if mended || has_hit(&entry.fault, broken.plant) {
                        self.stop(place, &mut on_mark);
                        changed = true;
                    }
                }
            }
        }
        if changed {
            self.apply(broken);
        }
        self.busy = self.entries.iter().any(|entry| entry.state != State::Over);
    }

    /// Starts a fault by hand, from this cycle on.
    pub(crate) fn break_by_hand(
        &mut self,
        fault: Fault,
        broken: FaultTargets<'_>,
        mut on_mark: impl FnMut(Mark),
    ) {
        let (number, cause) = (self.next_number, Cause::Console);
        self.entries.retain(|entry| entry.state != State::Over || entry.cause != Cause::Console);
        let wire = on_wire(&fault).is_none() || self.orders.is_some();
        if self.entries.len() >= self.room || number == u16::MAX || !wire {
            on_mark(Mark { number, what: FaultChange::Refused, fault, cause });
            return;
        }
        self.next_number += 1;
        self.entries.push(Entry { number, fault, cause, state: State::Active { until: None } });
        self.start(self.entries.len() - 1, None, broken.plant, &mut on_mark);
        self.apply(broken);
        self.busy = true;
    }

    /// Ends active faults of any origin: all of them, or those with the name and place of `like`.
    pub(crate) fn mend(
        &mut self,
        like: Option<&Fault>,
        broken: FaultTargets<'_>,
        mut on_mark: impl FnMut(Mark),
    ) {
        for place in 0..self.entries.len() {
            let Entry { fault, state, .. } = self.entries[place];
            let meant = like.is_none_or(|like| {
                like.spec.name == fault.spec.name && like.place_index() == fault.place_index()
            });
            if meant && matches!(state, State::Active { .. }) {
                self.stop(place, &mut on_mark);
            }
        }
        self.apply(broken);
    }

    fn start(&mut self, place: usize, until: Option<u64>, plant: &mut Plant, on_mark: &mut impl FnMut(Mark)) {
        let Entry { number, fault, .. } = self.entries[place];
        let mut state = State::Active { until };
        if fault.spec.kind == Kind::Unlink {
            // An unlinking happens once and is not repeated.
            plant.unlink();
            state = State::Over;
        }
        let refused = on_wire(&fault).is_some_and(|(fault, frames)| {
            // Each fault has its own random numbers.
            let order = WireOrder::Begin { number, fault, frames, seed: self.seed ^ u64::from(number) << 32 };
            !self.orders.as_ref().is_some_and(|orders| orders.give(order))
        });
        self.entries[place].state = if refused { State::Over } else { state };
        self.report(place, if refused { FaultChange::Refused } else { FaultChange::Begins }, on_mark);
    }

    fn stop(&mut self, place: usize, on_mark: &mut impl FnMut(Mark)) {
        let Entry { number, fault, .. } = self.entries[place];
        if on_wire(&fault).is_some()
            && let Some(orders) = &self.orders
            && !orders.give(WireOrder::End { number })
        {
            // The queue of the host is full: tried again in the next cycle.
            self.entries[place].state = State::Active { until: Some(0) };
            return;
        }
        self.entries[place].state = State::Over;
        self.report(place, FaultChange::Ends, on_mark);
    }

    fn report(&mut self, place: usize, what: FaultChange, on_mark: &mut impl FnMut(Mark)) {
        let Entry { number, fault, cause, .. } = self.entries[place];
        on_mark(Mark { number, what, fault, cause });
        let happened = matches!(what, FaultChange::Begins | FaultChange::Ends);
        if happened && self.pending_marks.len() < self.pending_marks.capacity() {
            self.pending_marks.push_back((number, what == FaultChange::Begins));
        }
    }

    /// Applies all active faults to plant and sensors.
    fn apply(&mut self, broken: FaultTargets<'_>) {
        let before = self.overlay;
        self.overlay = Overlay::default();
        for entry in self.entries.iter().filter(|entry| matches!(entry.state, State::Active { .. })) {
            self.overlay.put(&entry.fault, broken.plant.rig());
        }
        if self.overlay.plant != before.plant {
            broken.plant.set_faults(&self.overlay.plant);
        }
        if self.overlay.sensors != before.sensors {
            broken.sensors.set_faults(&self.overlay.sensors);
        }
    }
}

/// Whether a push towards an end of the stroke has reached it.
fn has_hit(fault: &Fault, plant: &Plant) -> bool {
    if fault.spec.kind != Kind::EndStopHit {
        return false;
    }
    let axis = Axis::ALL[fault.place_index()];
    let extension_m = plant.state().axis(axis).extension_m;
    // Away from the other end, where it may have begun.
    let towards_far_end = fault.values[0] > 0.0;
    plant.at_an_end(axis) && (extension_m > 0.0) == towards_far_end
}

#[cfg(test)]
mod tests;
