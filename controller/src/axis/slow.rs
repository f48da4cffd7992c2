//! When status and values of an axis are sent: every ten cycles, and at once when the status is another.

use plant::Axis;
use protocol::frames::ChainStatus;

/// Period of status and values, in cycles.
const PERIOD: u64 = 10;
/// Cycles within the period in which status and values of drive and load are sent: none falls on the rig's tick (0) or status
/// (5), nor on another.
const PHASES: [[u64; 2]; 2] = [[2, 3], [7, 8]];

/// What was sent last.
pub(super) struct Slow {
    phases: [u64; 2],
    told: ChainStatus,
    /// Periods of status and values in which they were sent last.
    periods: [u64; 2],
}

/// What is to be sent.
pub(super) struct Due {
    pub(super) status: bool,
    pub(super) values: bool,
    /// The main chain is in another state than was told last.
    pub(super) other_state: bool,
}

impl Slow {
    pub(super) fn new(axis: Axis) -> Self {
        Self { phases: PHASES[axis.index()], told: ChainStatus::default(), periods: [0; 2] }
    }

    /// What is due in `cycle`, and counts as sent.
    pub(super) fn due(&mut self, cycle: u64, status: &ChainStatus) -> Due {
        let changed = *status != self.told;
        let other_state = status.main_chain != self.told.main_chain;
        // Counted, so that a cycle that was skipped puts off what was due in it and does not drop it.
        let periods = self.phases.map(|phase| (cycle + PERIOD - phase) / PERIOD);
        let [status_due, values] = [0, 1].map(|which| changed || periods[which] != self.periods[which]);
        (self.periods, self.told) = (periods, *status);
        Due { status: status_due, values, other_state }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skipped_cycle_puts_off_what_was_due_in_it() {
        let mut slow = Slow::new(Axis::Drive);
        let status = ChainStatus::default();
        let sent = |slow: &mut Slow, cycles: std::ops::Range<u64>| {
            cycles.filter(|cycle| slow.due(*cycle, &status).status).collect::<Vec<_>>()
        };
        assert_eq!(sent(&mut slow, 0..25), [2, 12, 22]);
        assert_eq!(sent(&mut slow, 35..45), [35, 42]);
    }

    #[test]
    fn another_status_is_sent_at_once() {
        let mut slow = Slow::new(Axis::Load);
        (0..20).for_each(|cycle| drop(slow.due(cycle, &ChainStatus::default())));
        let other = ChainStatus { ok: true, ..ChainStatus::default() };
        let due = slow.due(20, &other);
        assert!(due.status && due.values && !due.other_state);
        assert!(!slow.due(21, &other).status);
    }
}
