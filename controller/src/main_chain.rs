//! Main chain of the drive: from a rig at rest anywhere through the experiment to done.
//!
//! ```text
//!                    sensors            at start            still for settling_s
//!   WaitingForRig ───────────► InitialPositioning ──► Settling ──────────────► Experiment
//!        ▲                          │                    │                       │  last repetition driven
//!        │ rig restarted            │                    │                       ▼
//!        └──────────────────────────┴────────────────────┴──────────────── FinalSettling ──► Done
//!
//!   any ── emergency stop, or abort by the console ──► Aborted (valve shut; the controllers end)
//! ```
//!
//! Time is the rig's: cycles of 1 ms by number, so that cycles that the rig skipped pass for the experiment too, and the
//! chain runs on the virtual clock of its tests.

use crate::set_point::{Motion, SetPoint, SmoothWay};
use protocol::frames::MainChainState;

/// Speed of the initial positioning on average, m/s: gentle beside any experiment.
const INITIAL_SPEED_M_PER_S: f64 = 0.1;
/// Shortest initial positioning, s.
const SHORTEST_INITIAL_S: f64 = 0.5;
/// Seconds of one cycle.
const CYCLE_S: f64 = 1e-3;

/// State of the chain; each holds what it needs and nothing else.
#[derive(Clone, Debug, PartialEq)]
enum State {
    WaitingForRig,
    InitialPositioning { since: u64, way: SmoothWay, duration_s: f64 },
    Settling { since: u64 },
    Experiment { since: u64, repetition: u32 },
    FinalSettling { since: u64 },
    Done,
    Aborted,
}

/// What the chain drives through.
#[derive(Clone, Debug)]
pub struct Course {
    /// The drive's motion.
    pub motion: Motion,
    /// How often it is driven through.
    pub repetitions: u32,
    /// How long the axis must stand still before and after, s.
    pub settling_s: f64,
}

/// The chain.
#[derive(Debug)]
pub struct MainChain {
    experiment: Course,
    /// Repeat the experiment until the rig ends.
    forever: bool,
    state: State,
}

impl MainChain {
    /// A chain that waits for the rig.
    #[must_use]
    pub fn new(experiment: Course, forever: bool) -> Self {
        Self { experiment, forever, state: State::WaitingForRig }
    }

    /// Moves on at `cycle` with the measured position, and tells the set-point; `None` shuts the valve.
    pub fn advance(&mut self, cycle: u64, position_m: f64, emergency_stop: bool) -> Option<SetPoint> {
        if emergency_stop {
            self.abort();
        }
        while let Some(next) = self.decide(cycle, position_m) {
            self.state = next;
        }
        self.set_point(cycle)
    }

    /// Somebody ends the experiment.
    pub fn abort(&mut self) {
        self.state = State::Aborted;
    }

    /// The rig's time began again: so does the chain.
    pub fn restart(&mut self) {
        self.state = State::WaitingForRig;
    }

    /// The state to go to, if any.
    fn decide(&self, cycle: u64, position_m: f64) -> Option<State> {
        let settled = |since| elapsed_s(since, cycle) >= self.experiment.settling_s;
        match &self.state {
            State::WaitingForRig => {
                let (way, duration_s) = initial_way(position_m, self.experiment.motion.start_m());
                Some(State::InitialPositioning { since: cycle, way, duration_s })
            }
            State::InitialPositioning { since, duration_s, .. } => {
                (elapsed_s(*since, cycle) >= *duration_s).then_some(State::Settling { since: cycle })
            }
            State::Settling { since } => {
                settled(*since).then_some(State::Experiment { since: cycle, repetition: 0 })
            }
            State::Experiment { since, repetition } => {
                if elapsed_s(*since, cycle) < self.experiment.motion.duration_s() {
                    return None;
                }
                let repetition = repetition + 1;
                let again = self.forever || repetition < self.experiment.repetitions;
                Some(if again {
                    State::Experiment { since: cycle, repetition }
                } else {
                    State::FinalSettling { since: cycle }
                })
            }
            State::FinalSettling { since } => settled(*since).then_some(State::Done),
            State::Done | State::Aborted => None,
        }
    }

    fn set_point(&self, cycle: u64) -> Option<SetPoint> {
        let profile = &self.experiment.motion;
        match &self.state {
            State::WaitingForRig | State::Aborted => None,
            State::InitialPositioning { since, way, .. } => Some(way.position(elapsed_s(*since, cycle))),
            State::Settling { .. } => Some(SetPoint::at_rest(profile.start_m())),
            State::Experiment { since, .. } => Some(profile.at(elapsed_s(*since, cycle))),
            State::FinalSettling { .. } | State::Done => Some(profile.at(profile.duration_s())),
        }
    }

    /// The state as the bus names it.
    #[must_use]
    pub fn state(&self) -> MainChainState {
        match self.state {
            State::WaitingForRig => MainChainState::WaitingForRig,
            State::InitialPositioning { .. } => MainChainState::InitialPositioning,
            State::Settling { .. } => MainChainState::Settling,
            State::Experiment { .. } => MainChainState::Experiment,
            State::FinalSettling { .. } => MainChainState::FinalSettling,
            State::Done => MainChainState::Done,
            State::Aborted => MainChainState::Aborted,
        }
    }

    /// How often the experiment has been driven through.
    #[must_use]
    pub fn repetition(&self) -> u32 {
        match self.state {
            State::Experiment { repetition, .. } => repetition,
            State::FinalSettling { .. } | State::Done => self.experiment.repetitions,
            _ => 0,
        }
    }
}

fn elapsed_s(since: u64, cycle: u64) -> f64 {
    cycle.saturating_sub(since) as f64 * CYCLE_S
}

/// A gentle way from where the carriage is to where the experiment starts.
fn initial_way(from_m: f64, to_m: f64) -> (SmoothWay, f64) {
    let duration_s = ((to_m - from_m).abs() / INITIAL_SPEED_M_PER_S).max(SHORTEST_INITIAL_S);
    (SmoothWay::new(from_m, to_m, duration_s), duration_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(repetitions: u32, forever: bool) -> MainChain {
        let motion = Motion::along(SmoothWay::new(0.1, 0.4, 3.0)).then_rest(1.0);
        let experiment = Course { motion, repetitions, settling_s: 0.5 };
        MainChain::new(experiment, forever)
    }

    /// Cycle at which each state is first seen, with the carriage always at `position_m`.
    fn edges(chain: &mut MainChain, position_m: f64, cycles: u64) -> Vec<(u64, MainChainState)> {
        let mut seen = vec![];
        for cycle in 0..cycles {
            chain.advance(cycle, position_m, false);
            if seen.last().is_none_or(|(_, state)| *state != chain.state()) {
                seen.push((cycle, chain.state()));
            }
        }
        seen
    }

    #[test]
    fn the_chain_goes_from_the_rig_to_done() {
        use MainChainState::{Done, Experiment, FinalSettling, InitialPositioning, Settling};
        // 0.1 m at 0.1 m/s is 1 s; settling 0.5 s; 3 s and 1 s of experiment, twice; settling again.
        let expected = [
            (0, InitialPositioning),
            (1000, Settling),
            (1500, Experiment),
            (9500, FinalSettling),
            (10_000, Done),
        ];
        assert_eq!(edges(&mut chain(2, false), 0.2, 11_000), expected);
    }

    #[test]
    fn a_carriage_near_the_start_is_still_moved_gently() {
        assert_eq!(edges(&mut chain(1, false), 0.1001, 600)[1], (500, MainChainState::Settling));
    }

    #[test]
    fn forever_never_ends() {
        let mut chain = chain(1, true);
        assert_eq!(edges(&mut chain, 0.1, 60_000).last().unwrap().1, MainChainState::Experiment);
        assert_eq!(chain.repetition(), 14);
    }

    #[test]
    fn the_set_point_begins_where_the_carriage_is() {
        let set_point = chain(1, false).advance(7, 0.33, false).unwrap();
        assert_eq!(set_point.position_m, 0.33);
    }

    #[test]
    fn a_restarted_rig_restarts_the_chain_from_every_state() {
        for cycles in [1, 600, 1200, 5200, 7000] {
            let mut chain = chain(1, false);
            edges(&mut chain, 0.1, cycles);
            chain.restart();
            assert_eq!(chain.state(), MainChainState::WaitingForRig);
            assert_eq!(chain.advance(0, 0.25, false).unwrap().position_m, 0.25);
        }
    }

    #[test]
    fn an_abort_shuts_the_valve() {
        let mut chain = chain(1, false);
        edges(&mut chain, 0.1, 2000);
        chain.abort();
        assert_eq!((chain.advance(2000, 0.1, false), chain.state()), (None, MainChainState::Aborted));
    }

    #[test]
    fn an_emergency_stop_shuts_the_valve_from_every_state_and_stays() {
        for cycles in [0, 1, 600, 1200, 5200, 7000] {
            let mut chain = chain(1, false);
            edges(&mut chain, 0.1, cycles);
            assert_eq!(chain.advance(cycles, 0.1, true), None);
            assert_eq!(chain.advance(cycles + 1, 0.1, false), None);
            assert_eq!(chain.state(), MainChainState::Aborted);
        }
    }
}
