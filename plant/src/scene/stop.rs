//! Holders of the emergency stop, and the rig's announcements of its own stop.
//!
//! ```text
//!   nobody ── any of the four stops ──► held ── each who stopped has released ──► nobody
//! ```
//!
//! The supply is discharged while anybody holds the stop; a release of one who does not hold it changes nothing. The rig
//! calls its own stop out on the bus, at once and every 100 ms while it holds it, and once when it releases (bus.md, Frames).

use crate::plant::Plant;

/// Cycles from one call of the rig to the next while it holds its emergency stop.
pub const REPEAT_CYCLES: u64 = 100;

/// Who can hold the emergency stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopHolder {
    /// Sender of the console's frame on the bus.
    Console,
    /// The rig's own button.
    Rig,
    /// The drive's controller.
    Drive,
    /// The load's controller.
    Load,
}

/// What the rig says about its own emergency stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigCall {
    /// It holds the stop.
    Stop,
    /// It has released it.
    Release,
}

/// Senders that hold the emergency stop now.
#[derive(Debug, Clone, Default)]
pub struct StopHolders {
    held: [bool; 4],
    /// Cycle from which on the rig calls next, while it holds.
    next_call: u64,
    release_to_call: bool,
}

impl StopHolders {
    /// Takes note of a stop or a release by one of them, and trips or releases the plant. The result says what changed there:
    /// true for tripped, false for released.
    pub fn take(&mut self, holder: StopHolder, release: bool, plant: &mut Plant) -> Option<bool> {
        let held = &mut self.held[holder as usize];
        if holder == StopHolder::Rig && *held == release {
            self.next_call = 0;
            self.release_to_call = release;
        }
        *held = !release;
        let stopped = self.held.contains(&true);
        if stopped == plant.emergency_stop() {
            return None;
        }
        if stopped {
            plant.trip_emergency_stop()
        } else {
            plant.release_emergency_stop()
        }
        Some(stopped)
    }

    /// What the rig has to say in `cycle`, if anything; what is given counts as said.
    pub fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        if self.held[StopHolder::Rig as usize] {
            let due = cycle >= self.next_call;
            if due {
                self.next_call = cycle + REPEAT_CYCLES;
            }
            return due.then_some(RigCall::Stop);
        }
        std::mem::take(&mut self.release_to_call).then_some(RigCall::Release)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RigParameters, Setup};

    fn plant() -> Plant {
        Plant::new(&RigParameters::baseline(), &Setup::default()).expect("a good setup")
    }

    #[test]
    fn the_stop_is_released_when_nobody_holds_it() {
        let (mut holders, mut plant) = (StopHolders::default(), plant());
        assert_eq!(holders.take(StopHolder::Drive, true, &mut plant), None);
        assert_eq!(holders.take(StopHolder::Rig, false, &mut plant), Some(true));
        assert_eq!(holders.take(StopHolder::Console, false, &mut plant), None);
        assert_eq!(holders.take(StopHolder::Rig, true, &mut plant), None);
        assert!(plant.emergency_stop(), "the console still holds it");
        assert_eq!(holders.take(StopHolder::Load, true, &mut plant), None);
        assert_eq!(holders.take(StopHolder::Console, true, &mut plant), Some(false));
        assert!(!plant.emergency_stop());
    }

    #[test]
    fn the_rig_calls_at_once_every_100_ms_and_once_at_the_release() {
        let (mut holders, mut plant) = (StopHolders::default(), plant());
        let mut calls = Vec::new();
        for cycle in 0..600 {
            match cycle {
                150 | 200 => _ = holders.take(StopHolder::Rig, false, &mut plant),
                400 | 450 => _ = holders.take(StopHolder::Rig, true, &mut plant),
                _ => {}
            }
            calls.extend(holders.rig_call(cycle).map(|call| (cycle, call)));
        }
        let stops = [150, 250, 350].map(|cycle| (cycle, RigCall::Stop));
        assert_eq!(calls, [&stops[..], &[(400, RigCall::Release)]].concat());
    }

    #[test]
    fn what_others_hold_the_rig_does_not_call_out() {
        let (mut holders, mut plant) = (StopHolders::default(), plant());
        holders.take(StopHolder::Load, false, &mut plant);
        assert_eq!(holders.rig_call(7), None);
        holders.take(StopHolder::Rig, true, &mut plant);
        assert_eq!(holders.rig_call(8), None, "it released nothing");
    }
}
