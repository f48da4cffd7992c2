//! Matching chain of the load axis: with linked axes, average both measured positions and take the difference as the offset of
//! the load's sensor.
//!
//! ```text
//!          asked                     linked, both at rest                time over
//!   Idle ────────► WaitingForRest ───────────────────────► Averaging ─────────────────► Matched
//!    ▲                  ▲   │ ▲                             │     │                        │
//!    │                  │   │ └─ not linked, partner ───────┘     │ offset implausible,    │ asked anew
//!    │                  │   │    silent, somebody moved           ▼ too long               │
//!    │                  │   └───── too long ──────────────────► Fault                      │
//!    │                  └──────────────────────────────────────────────────────────────────┘
//!    └── any: the rig restarted; waiting, averaging, fault: no longer asked
//! ```
//!
//! offset = mean of the load's position sensor - mean of the drive's `averaged_position`, in rig coordinates; the load's
//! position is its sensor less the offset. The load eye may lie anywhere in the gap of the linkage, so ±0.1 mm
//! remain, besides the drive sensor's own error: the offset makes both axes agree, not either of them true.
//! A matched offset holds until the next one, or until the rig restarts.

use super::{Fault, Partner, StateEntry, cycles};
use protocol::frames::MatchingChainState;
use settings::parameters::declare;

/// Section of a program file that holds the numbers of the chain; also the task in their names as variables.
pub const TABLE: &str = "matching-chain";

settings::parameters! {
    /// Times of rest and averaging, and bounds on movement and offset.
    pub struct Parameters {
        average_s: declare("s", [0.01, 60.0], 0.5, "time over which both positions are averaged"),
        rest_s: declare("s", [0.0, 60.0], 0.2, "how long the partner must have been at rest before"),
        moved_m: declare("m", [1e-5, 0.1], 0.3e-3, "range of a position that counts as movement"),
        offset_most_m: declare("m", [1e-4, 0.5], 5e-3, "largest plausible offset"),
        match_timeout_s: declare("s", [0.1, 600.0], 10.0, "how long matching may take").at_start_only(),
    }
}

/// The partner's averaged position is taken each so many cycles, its period.
const SAMPLE_CYCLES: u64 = 10;

/// Inputs of the chain in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MatchingInputs {
    pub(crate) cycle: u64,
    pub(crate) requested: bool,
    pub(crate) linked: bool,
    /// This axis keeps still: see [`settled`](super::settled).
    pub(crate) still: bool,
    /// Position sensor of this axis, without any offset, m.
    pub(crate) position_m: f64,
    pub(crate) partner: Partner,
}

/// State of the chain after a cycle, and its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MatchingOutput {
    pub(crate) state: MatchingChainState,
    /// The last matched offset, to be taken from this axis's sensor, m; 0 before.
    pub(crate) offset_m: f64,
    pub(crate) matched: bool,
    pub(crate) fault: Option<Fault>,
}

/// Why the chain entered its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MatchingCause {
    /// The controller or the rig began.
    Began,
    Requested,
    NotRequested,
    AtRest,
    NotLinked,
    Silent,
    Moved,
    Averaged,
    Fault(Fault),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Positions {
    sum_m: f64,
    count: f64,
    low_m: f64,
    high_m: f64,
}

impl Positions {
    const NONE: Self = Self { sum_m: 0.0, count: 0.0, low_m: f64::INFINITY, high_m: f64::NEG_INFINITY };

    fn take(&mut self, position_m: f64) {
        self.sum_m += position_m;
        self.count += 1.0;
        self.low_m = self.low_m.min(position_m);
        self.high_m = self.high_m.max(position_m);
    }

    /// Before the first position there is no movement; what is no number is one.
    fn moved(&self, most_m: f64) -> bool {
        let still = self.high_m - self.low_m <= most_m && self.sum_m.is_finite();
        self.count > 0.0 && !still
    }

    fn mean_m(&self) -> f64 {
        self.sum_m / self.count
    }
}

/// State of the chain; each holds what it needs and nothing else. `began` is when matching was asked for. The
/// partner has not moved since `rest_since`; its position was taken last when it was `sampled`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Idle,
    WaitingForRest { began: u64, partner: Positions, rest_since: u64 },
    Averaging { began: u64, positions: Positions, partner: Positions, sampled: Option<u64> },
    Matched,
    Fault { fault: Fault },
}

/// The matching chain of an axis; the default is idle, without an offset.
#[derive(Clone, Debug)]
pub(crate) struct MatchingChain {
    state: State,
    requested: bool,
    offset_m: f64,
    pub(crate) entered: StateEntry<MatchingChainState, MatchingCause>,
}

impl Default for MatchingChain {
    fn default() -> Self {
        let entered = StateEntry { cycle: 0, state: MatchingChainState::Idle, cause: MatchingCause::Began };
        Self { state: State::Idle, requested: false, offset_m: 0.0, entered }
    }
}

impl MatchingChain {
    /// Moves on by one edge at most, with `values` in the order of [`Parameters`].
    ///
    /// # Panics
    /// When `values` is not as long as the table.
    pub(crate) fn advance(&mut self, inputs: &MatchingInputs, values: &[f64]) -> MatchingOutput {
        let numbers = Parameters::of(values);
        self.note(inputs, &numbers);
        if let Some((state, cause)) = self.decide(inputs, &numbers) {
            self.enter(state, cause, inputs.cycle);
        }
        self.requested = inputs.requested;
        self.output()
    }

    /// The rig's time begins anew at `cycle`: so does the chain, without an offset.
    pub(crate) fn restart(&mut self, cycle: u64) {
        *self = Self::default();
        self.entered.cycle = cycle;
    }

    fn note(&mut self, inputs: &MatchingInputs, numbers: &Parameters) {
        let cycle = inputs.cycle;
        let partner_m = partner_position_m(inputs);
        match &mut self.state {
            State::WaitingForRest { partner, rest_since, .. } => {
                if let Some(position_m) = partner_m {
                    partner.take(position_m);
                }
                if partner_m.is_none() || partner.moved(numbers.moved_m) {
                    (*partner, *rest_since) = (Positions::NONE, cycle);
                }
            }
            State::Averaging { positions, partner, sampled, .. } => {
                positions.take(inputs.position_m);
                let due = sampled.is_none_or(|last| cycle.saturating_sub(last) >= SAMPLE_CYCLES);
                if let Some(position_m) = partner_m.filter(|_| due) {
                    partner.take(position_m);
                    *sampled = Some(cycle);
                }
            }
            _ => {}
        }
    }

    fn decide(
        &self,
        inputs: &MatchingInputs,
        numbers: &Parameters,
    ) -> Option<(MatchingChainState, MatchingCause)> {
        use MatchingChainState as S;
        let passed = |since: u64| inputs.cycle.saturating_sub(since);
        let too_long = |began: u64| {
            let late = passed(began) > cycles(numbers.match_timeout_s);
            late.then_some((S::Fault, MatchingCause::Fault(Fault::MatchingTimeout)))
        };
        match &self.state {
            State::Matched | State::Idle if !inputs.requested => None,
            _ if !inputs.requested => Some((S::Idle, MatchingCause::NotRequested)),
            State::Idle => Some((S::WaitingForRest, MatchingCause::Requested)),
            State::Matched => (!self.requested).then_some((S::WaitingForRest, MatchingCause::Requested)),
            State::Fault { .. } => None,
            State::WaitingForRest { began, rest_since, .. } => {
                let at_rest = inputs.still && passed(*rest_since) >= cycles(numbers.rest_s);
                let go = at_rest && inputs.linked && partner_position_m(inputs).is_some();
                go.then_some((S::Averaging, MatchingCause::AtRest)).or_else(|| too_long(*began))
            }
            State::Averaging { began, positions, partner, .. } => {
                let moved = positions.moved(numbers.moved_m) || partner.moved(numbers.moved_m);
                let back = |cause| Some((S::WaitingForRest, cause));
                let over = passed(self.entered.cycle) >= cycles(numbers.average_s);
                match partner_position_m(inputs) {
                    _ if !inputs.linked => back(MatchingCause::NotLinked),
                    None => back(MatchingCause::Silent),
                    _ if moved => back(MatchingCause::Moved),
                    _ if over => Some(Self::judge(positions.mean_m() - partner.mean_m(), numbers)),
                    _ => too_long(*began),
                }
            }
        }
    }

    fn judge(offset_m: f64, numbers: &Parameters) -> (MatchingChainState, MatchingCause) {
        if offset_m.abs() <= numbers.offset_most_m {
            return (MatchingChainState::Matched, MatchingCause::Averaged);
        }
        (MatchingChainState::Fault, MatchingCause::Fault(Fault::OffsetImplausible))
    }

    fn output(&self) -> MatchingOutput {
        let fault = match self.state {
            State::Fault { fault } => Some(fault),
            _ => None,
        };
        let matched = self.state == State::Matched;
        MatchingOutput { state: self.entered.state, offset_m: self.offset_m, matched, fault }
    }

    fn enter(&mut self, state: MatchingChainState, cause: MatchingCause, now: u64) {
        use MatchingChainState as S;
        let [positions, partner] = [Positions::NONE; 2];
        let began = self.began(now);
        self.state = match (state, cause) {
            (S::Idle, _) => State::Idle,
            (S::WaitingForRest, _) => State::WaitingForRest { began, partner, rest_since: now },
            (S::Averaging, _) => State::Averaging { began, positions, partner, sampled: None },
            (S::Matched, _) => {
                if let State::Averaging { positions, partner, .. } = &self.state {
                    self.offset_m = positions.mean_m() - partner.mean_m();
                }
                State::Matched
            }
            (S::Fault, MatchingCause::Fault(fault)) => State::Fault { fault },
            (S::Fault, _) => unreachable!("only a fault leads to fault"),
        };
        self.entered = StateEntry { cycle: now, state, cause };
    }

    /// When matching was asked for; `now` when it was not.
    fn began(&self, now: u64) -> u64 {
        match self.state {
            State::WaitingForRest { began, .. } | State::Averaging { began, .. } => began,
            State::Idle | State::Matched | State::Fault { .. } => now,
        }
    }
}

fn partner_position_m(inputs: &MatchingInputs) -> Option<f64> {
    inputs.partner.fresh(inputs.cycle)?;
    inputs.partner.values.map(|values| values.averaged_position_m)
}

#[cfg(test)]
mod tests;
