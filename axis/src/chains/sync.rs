//! Where the partner stands, seen from this axis's main chain.
//!
//! ```text
//!   waiting-for-rig │ initial-positioning … final-settling │ … again, repetition + 1 … │ done
//!   ───────────────────────────────────────────────────────────────────────────────────────► order
//! ```
//!
//! Nobody leaves a state before the partner is ready to, so in order the two differ by one state at most: who is further behind
//! has begun anew. Aborted and fault have no place in the order. The repetition crosses the wire in 8 bits; what counts is the
//! shorter way round.

use super::Partner;
use protocol::frames::{ChainStatus, MainChainState};

/// States of one repetition, initial positioning to final settling.
const STATES: i32 = 6;

/// The partner, seen from a place in the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// Not heard, or not lately.
    Silent,
    Aborted,
    Fault,
    /// It is where only a chain that began anew can be.
    Restarted,
    Behind,
    /// In the same state, and whether it is ready to leave.
    SameState {
        ok: bool,
    },
    Ahead,
}

impl Relation {
    /// Whether the partner lets a chain leave its state.
    pub(super) fn ok(self) -> bool {
        matches!(self, Self::SameState { ok: true } | Self::Ahead)
    }
}

/// How the partner stands to a chain in `state` of `repetition`, not in waiting-for-rig, aborted or fault.
pub(super) fn relation(state: MainChainState, repetition: u32, partner: &Partner, cycle: u64) -> Relation {
    use MainChainState as S;
    let Some(status) = partner.fresh(cycle) else { return Relation::Silent };
    match status.main_chain {
        S::Aborted => return Relation::Aborted,
        S::Fault => return Relation::Fault,
        S::WaitingForRig if state == S::InitialPositioning && repetition == 0 => return Relation::Behind,
        S::WaitingForRig => return Relation::Restarted,
        _ => {}
    }
    let ahead = STATES * i32::from(repetitions_ahead(repetition, status))
        + i32::from(status.main_chain.raw())
        - i32::from(state.raw());
    match ahead {
        ..-1 => Relation::Restarted,
        -1 => Relation::Behind,
        0 => Relation::SameState { ok: status.ok },
        1.. => Relation::Ahead,
    }
}

/// How many repetitions the partner is ahead of `repetition`, the shorter way round.
pub(super) fn repetitions_ahead(repetition: u32, partner: &ChainStatus) -> i8 {
    partner.repetition.wrapping_sub(repetition as u8).cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use MainChainState as S;

    fn seen(chain: (S, u32), partner: (S, u8, bool)) -> Relation {
        let (main_chain, repetition, ok) = partner;
        let status = ChainStatus { main_chain, repetition, ok, ..ChainStatus::default() };
        let partner = Partner { status: Some(status), received: Some(0), ..Partner::default() };
        relation(chain.0, chain.1, &partner, 0)
    }

    #[test]
    fn the_order_goes_through_states_and_repetitions() {
        let chain = (S::Experiment, 3);
        for (partner, expected) in [
            ((S::Experiment, 3, false), Relation::SameState { ok: false }),
            ((S::Experiment, 3, true), Relation::SameState { ok: true }),
            ((S::FinalSettling, 3, false), Relation::Ahead),
            ((S::Done, 3, true), Relation::Ahead),
            ((S::InitialPositioning, 4, false), Relation::Ahead),
            ((S::Settling, 3, true), Relation::Behind),
            ((S::InitialForce, 3, true), Relation::Restarted),
            ((S::FinalSettling, 2, true), Relation::Restarted),
            ((S::WaitingForRig, 3, true), Relation::Restarted),
            ((S::WaitingForRig, 0, true), Relation::Restarted),
            ((S::Aborted, 3, true), Relation::Aborted),
            ((S::Fault, 3, true), Relation::Fault),
        ] {
            assert_eq!(seen(chain, partner), expected, "{partner:?}");
        }
    }

    #[test]
    fn the_end_of_a_repetition_is_one_state_before_the_next() {
        assert_eq!(seen((S::InitialPositioning, 1), (S::FinalSettling, 0, true)), Relation::Behind);
        assert_eq!(seen((S::FinalSettling, 0), (S::InitialPositioning, 1, true)), Relation::Ahead);
    }

    #[test]
    fn a_partner_may_be_waiting_for_the_rig_at_the_very_start_only() {
        assert_eq!(seen((S::InitialPositioning, 0), (S::WaitingForRig, 0, true)), Relation::Behind);
        assert_eq!(seen((S::InitialPositioning, 256), (S::WaitingForRig, 0, true)), Relation::Restarted);
        assert_eq!(seen((S::Preparing, 0), (S::WaitingForRig, 0, true)), Relation::Restarted);
    }

    #[test]
    fn the_repetition_wraps() {
        assert_eq!(seen((S::InitialPositioning, 256), (S::FinalSettling, 255, true)), Relation::Behind);
        assert_eq!(seen((S::FinalSettling, 255), (S::InitialPositioning, 0, true)), Relation::Ahead);
        assert_eq!(seen((S::Experiment, 511), (S::Experiment, 255, true)), Relation::SameState { ok: true });
        assert_eq!(seen((S::Experiment, 300), (S::Experiment, 44, true)), Relation::SameState { ok: true });
    }

    #[test]
    fn only_an_ok_here_or_a_later_state_lets_go() {
        use Relation::{Aborted, Ahead, Behind, Fault, Restarted, SameState, Silent};
        for hold in [Silent, Aborted, Fault, Restarted, Behind, SameState { ok: false }] {
            assert!(!hold.ok(), "{hold:?}");
        }
        assert!(Ahead.ok() && SameState { ok: true }.ok());
    }
}
