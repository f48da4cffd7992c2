//! Detects lasting saturation of the axis's sensors from the flags of the rig's status.
//!
//! Force and pressure sensors count. The position sensor does not: at an end of the stroke noise alone saturates it. A flag
//! covers the cycles since the status before and holds until the next one; half a second is 50 statuses. Only cycles of a
//! run that were answered with a fresh status count: after an emergency stop trapped air may press for any time, and a
//! person must be able to release the stop.

use crate::chains::Fault;
use crate::chains::main::Phase;
use nominal::Axis;
use protocol::frames::RigStatus;

/// Cycles after which a sensor that is saturated in all of them is a fault.
const LONGEST: u32 = 500;

/// For how long each of the axis's sensors has been saturated: force, pressures of cap and rod side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Range([u32; 3]);

impl Range {
    pub(super) fn take(&mut self, axis: Axis, rig: Option<&RigStatus>, phase: Phase) -> Option<Fault> {
        let Some(rig) = rig.filter(|_| phase != Phase::Shut) else {
            *self = Self::default();
            return None;
        };
        let saturated = match axis {
            Axis::Drive => {
                [rig.drive_force_saturated, rig.drive_pressure_a_saturated, rig.drive_pressure_b_saturated]
            }
            Axis::Load => {
                [rig.load_force_saturated, rig.load_pressure_a_saturated, rig.load_pressure_b_saturated]
            }
        };
        for (count, saturated) in self.0.iter_mut().zip(saturated) {
            *count = if saturated { *count + 1 } else { 0 };
        }
        (self.0.iter().any(|count| *count > LONGEST)).then_some(Fault::LimitExceeded)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(rig: &RigStatus, axis: Axis, phase: Phase) -> Option<usize> {
        let mut range = Range::default();
        (0..2000).position(|_| range.take(axis, Some(rig), phase) == Some(Fault::LimitExceeded))
    }

    #[test]
    fn force_or_pressure_beyond_the_range_for_half_a_second_of_a_run_is_a_fault() {
        let force = RigStatus { drive_force_saturated: true, ..RigStatus::default() };
        let pressure = RigStatus { load_pressure_b_saturated: true, ..RigStatus::default() };
        assert_eq!(first(&force, Axis::Drive, Phase::HoldStart), Some(500));
        assert_eq!(first(&pressure, Axis::Load, Phase::HoldStart), Some(500));
        assert_eq!(first(&force, Axis::Load, Phase::HoldStart), None, "the other axis's");
        assert_eq!(first(&force, Axis::Drive, Phase::Shut), None, "not in a run");
    }

    #[test]
    fn a_carriage_at_its_end_is_none() {
        let ends = RigStatus {
            drive_position_saturated: true,
            load_position_saturated: true,
            ..RigStatus::default()
        };
        for axis in Axis::ALL {
            assert_eq!(first(&ends, axis, Phase::HoldStart), None);
        }
    }

    #[test]
    fn a_status_within_the_range_begins_the_count_anew() {
        let force = RigStatus { drive_force_saturated: true, ..RigStatus::default() };
        let mut range = Range::default();
        for cycle in 0..5000 {
            let rig = if cycle % 400 < 10 { RigStatus::default() } else { force };
            assert_eq!(range.take(Axis::Drive, Some(&rig), Phase::HoldEnd), None, "cycle {cycle}");
        }
    }
}
