//! The sequence chains of one axis controller: state machines that say what is asked of the axis, and do nothing else.
//!
//! ```text
//!   rig status, console, a trip ───► emergency_stop ─┐ state
//!   sensors, console, partner ─────────────────────► main ─► Phase ─► axis ─┬─► force     (relieving, manual mode, names)
//!                                     ▲                                     └─► matching  (offset of the load's sensor)
//!                                     └───────────── prepared, fault ◄──────────┘
//! ```
//!
//! [`leading`] wires the first two. Both axes run the same main chain and know each other through [`Partner`] alone: an OK flag,
//! the states of the chains and a few values. What the partner sends in a cycle is seen in the next one.
//!
//! Every chain has the same form: `advance` notes what it is given, without a change of state, asks the pure `decide` for at most
//! one edge, and goes it through `enter`, the only writer of its state, which notes the cause. So every state lasts for at least
//! one cycle and shows in the record. Nothing here allocates, sleeps, reads or prints.
//!
//! Time is the rig's: cycles of 1 ms by number. Cycles may be skipped, so all times are differences of numbers, never counts of
//! calls.

#[cfg(test)]
mod duo;
mod emergency_stop;
mod fault;
pub mod force;
pub(crate) mod leading;
pub mod main;
pub mod matching;
pub mod settled;
mod sync;

pub use fault::Fault;

use protocol::frames::{ChainStatus, ChainValues, RunControl, RunControlCommand};
use protocol::periods::CYCLE_S;

/// Cycles after which a partner that is needed counts as lost: ten periods of its status. Those that the axis answered itself
/// count: when the rig skips cycles, or this process is held up, the partner is not to blame.
pub(crate) const PARTNER_LOST_CYCLES: u64 = 100;

/// What was received from the other axis's controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Partner {
    pub(crate) status: Option<ChainStatus>,
    pub(crate) values: Option<ChainValues>,
    /// Cycle in which its last status came.
    pub(crate) received: Option<u64>,
}

impl Partner {
    /// The partner's status if it is not older than [`PARTNER_LOST_CYCLES`] at `cycle`.
    ///
    /// A status "from later" is of another rig's time and counts by its distance too.
    pub(crate) fn fresh(&self, cycle: u64) -> Option<&ChainStatus> {
        let received = self.received.filter(|received| cycle.abs_diff(*received) <= PARTNER_LOST_CYCLES);
        received.and(self.status.as_ref())
    }
}

/// Commands of the console since the last cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Console {
    /// `RunControl` start of this experiment, or of any (number 0).
    pub(crate) start: bool,
    /// `RunControl` abort, whatever its number.
    pub(crate) abort: bool,
    /// EmergencyStop frame of the console with release.
    pub(crate) release: bool,
}

impl Console {
    /// Takes a `RunControl` frame; a start of another experiment than number `experiment` is not for this one.
    pub(crate) fn take_run_control(&mut self, frame: &RunControl, experiment: u8) {
        match frame.command {
            RunControlCommand::Start if [0, experiment].contains(&frame.experiment) => self.start = true,
            RunControlCommand::Abort => self.abort = true,
            RunControlCommand::Start | RunControlCommand::None => {}
        }
    }
}

/// What follows when the rig has recovered from an emergency stop.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize, clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum AfterStop {
    /// Nothing: the run is over.
    #[default]
    End,
    /// The aborted repetition begins anew by itself.
    Restart,
    /// It begins anew on `RunControl` start.
    OnStart,
}

/// The state of a chain, and when and why it was entered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StateEntry<State, Cause> {
    pub(crate) cycle: u64,
    pub(crate) state: State,
    pub(crate) cause: Cause,
}

/// Seconds from cycle `since` to `cycle`; 0 when it lies ahead.
fn elapsed_s(since: u64, cycle: u64) -> f64 {
    cycle.saturating_sub(since) as f64 * CYCLE_S
}

/// Whole cycles of a time; 0 for what is no time.
fn cycles(seconds: f64) -> u64 {
    (seconds / CYCLE_S).round() as u64
}

/// Cycles until another state than `before`, and that state; after 100 s the same one.
#[cfg(test)]
fn until_another<S: Copy + PartialEq>(before: S, mut step: impl FnMut() -> S) -> (u64, S) {
    (1..=100_000)
        .map(|cycles| (cycles, step()))
        .find(|(_, state)| *state != before)
        .unwrap_or((100_000, before))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partner_is_fresh_for_a_hundred_cycles() {
        let partner =
            Partner { status: Some(ChainStatus::default()), received: Some(1000), ..Partner::default() };
        for (cycle, fresh) in [(1000, true), (1100, true), (1101, false), (900, true), (899, false)] {
            assert_eq!(partner.fresh(cycle).is_some(), fresh, "cycle {cycle}");
        }
        assert!(Partner::default().fresh(0).is_none());
    }

    #[test]
    fn a_start_is_taken_with_the_experiments_number_or_none() {
        for (experiment, taken) in [(0, true), (9, true), (8, false)] {
            let mut console = Console::default();
            console.take_run_control(&RunControl { command: RunControlCommand::Start, experiment }, 9);
            assert_eq!(console, Console { start: taken, ..Console::default() });
        }
    }

    #[test]
    fn an_abort_is_taken_whatever_its_number() {
        let mut console = Console::default();
        console.take_run_control(&RunControl { command: RunControlCommand::Abort, experiment: 8 }, 9);
        assert_eq!(console, Console { abort: true, ..Console::default() });
    }

    #[test]
    fn a_time_that_is_none_has_no_cycles() {
        assert_eq!([0.0, 0.5, -1.0, f64::NAN].map(cycles), [0, 500, 0, 0]);
    }
}
