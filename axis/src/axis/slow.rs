//! Status and values of an axis: what they are, and when they are sent: every ten cycles, and at once when the status is another.

use super::AxisController;
use nominal::Axis;
use protocol::frames::{ChainStatus, ChainValues, DRIVE_CHAIN_VALUES, MainChainState};

const PERIOD: u64 = protocol::periods::CHAIN_CYCLES;
/// Cycles within the period in which status and values of drive and load are sent: none falls on the rig's tick (0) or status
/// (5), nor on another.
const PHASES: [[u64; 2]; 2] = [[2, 3], [7, 8]];

/// Positions and forces that the values can carry; those of both axes are alike.
const LEAST_M: f64 = DRIVE_CHAIN_VALUES.signals[0].min;
const MOST_M: f64 = DRIVE_CHAIN_VALUES.signals[0].max;
const MOST_N: f64 = DRIVE_CHAIN_VALUES.signals[2].max;

/// When status and values were sent last, for when they are due next.
pub(super) struct StatusSchedule {
    phases: [u64; 2],
    reported: ChainStatus,
    /// Periods of status and values in which they were sent last.
    periods: [u64; 2],
}

pub(super) struct Due {
    pub(super) status: bool,
    pub(super) values: bool,
    /// The state of the main chain differs from the last one sent.
    pub(super) state_changed: bool,
}

impl StatusSchedule {
    pub(super) fn new(axis: Axis) -> Self {
        Self { phases: PHASES[axis.index()], reported: ChainStatus::default(), periods: [0; 2] }
    }

    /// Frames due in `cycle`; they count as sent.
    pub(super) fn due(&mut self, cycle: u64, status: &ChainStatus) -> Due {
        let changed = *status != self.reported;
        let state_changed = status.main_chain != self.reported.main_chain;
        // Counted, so that a cycle that was skipped puts off what was due in it and does not drop it.
        let periods = self.phases.map(|phase| (cycle + PERIOD - phase) / PERIOD);
        let [status_due, values] = [0, 1].map(|which| changed || periods[which] != self.periods[which]);
        (self.periods, self.reported) = (periods, *status);
        Due { status: status_due, values, state_changed }
    }
}

impl AxisController {
    /// States of the chains as they are sent to the partner and the rig.
    pub(crate) fn status(&self) -> ChainStatus {
        let (main_chain, ok, repetition) =
            self.supervisory.output.map_or((MainChainState::WaitingForRig, false, 0), |output| {
                (output.state, output.ok, output.repetition)
            });
        ChainStatus {
            main_chain,
            force_chain: self.demand_generator.force_chain(main_chain),
            matching_chain: self.demand_generator.matching_chain(),
            emergency_stop_chain: self.supervisory.stop.state(),
            ok,
            experiment: self.main_config.experiment,
            // The counter wraps as its field in rig.dbc does.
            repetition: repetition as u8,
        }
    }

    pub(super) fn values(&self) -> ChainValues {
        let average_m = self.average.value();
        let demand = self.request.as_ref().map(|request| request.demand);
        let set_position_m = match demand {
            Some(demand) if self.demand_generator.is_position() => demand.position.position_m,
            _ => average_m,
        };
        let now_m = self.average.last();
        ChainValues {
            averaged_position_m: average_m.clamp(LEAST_M, MOST_M),
            position_set_point_m: set_position_m.clamp(LEAST_M, MOST_M),
            force_set_point_n: demand.map_or(0.0, |demand| demand.force.force_n.clamp(-MOST_N, MOST_N)),
            control_error_m: if self.demand_generator.is_position() { set_position_m - now_m } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skipped_cycle_puts_off_what_was_due_in_it() {
        let mut schedule = StatusSchedule::new(Axis::Drive);
        let status = ChainStatus::default();
        let sent = |schedule: &mut StatusSchedule, cycles: std::ops::Range<u64>| {
            cycles.filter(|cycle| schedule.due(*cycle, &status).status).collect::<Vec<_>>()
        };
        assert_eq!(sent(&mut schedule, 0..25), [2, 12, 22]);
        assert_eq!(sent(&mut schedule, 35..45), [35, 42]);
    }

    #[test]
    fn another_status_is_sent_at_once() {
        let mut schedule = StatusSchedule::new(Axis::Load);
        for cycle in 0..20 {
            let _ = schedule.due(cycle, &ChainStatus::default());
        }
        let other = ChainStatus { ok: true, ..ChainStatus::default() };
        let due = schedule.due(20, &other);
        assert!(due.status && due.values && !due.state_changed);
        assert!(!schedule.due(21, &other).status);
    }
}
