//! Time stamps of the exchange with a controller: sensors sent, answering command received, first cycle in which it acts.
//!
//! ```text
//!   t_7 ─ sensors 7 ──────────► t_8 ───────────► t_9          (rig's cycles)
//!          │   round trip   ▲    │
//!          │                └ command that answers 7 arrives, is taken and acts from t_8 on
//!          └─── command age ────┘
//! ```
//! The echo of a command holds 12 bits of the cycle's number; the whole number is the newest cycle with these bits.

use protocol::frames::ECHO_RANGE;
use runlog::timing::{CycleTiming, Exchange};

/// The exchange of a cycle, and the age of the command in effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AxisCycle {
    /// Stamps of the timing table.
    pub exchange: Exchange,
    /// Time of sending of the sensors that a newly acting command answers; meaningless without such a command.
    pub answered_sensors_ns: u64,
    /// Age of the command in effect, in cycles sent; 0 without one.
    pub age_cycles: u64,
}

/// Time stamps from the real-time thread.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "nearly all are the large one, and a box would allocate in the 1 ms path"
)]
pub(crate) enum TimingRecord {
    Cycle {
        row: CycleTiming,
        /// Exchange of drive and load.
        axes: [AxisCycle; 2],
    },
    /// The overrun that ended the run: cycles from `first` on were missed, and no cycle follows.
    Stopped { first: u64, skipped: u64, late_ns: u64, woke_ns: u64 },
}

/// Round trip of a command: from sending the sensors to the arrival of the command that answers them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundTrip {
    /// 0 for drive, 1 for load.
    pub axis: usize,
    /// The cycle in which it was taken.
    pub cycle: u64,
    /// From sending its sensors to its arrival, ns.
    pub ns: u64,
}

/// Times the exchange of one axis. Allocates nothing after the start.
pub(crate) struct ExchangeTimer {
    /// Time of sending of a cycle's sensors, by the cycle's low bits; 0: not sent.
    sent_ns: Box<[u64; ECHO_RANGE as usize]>,
    /// The last command taken in this cycle: arrival, and the cycle that it answers.
    taken: Option<(u64, u64)>,
    now: AxisCycle,
}

impl ExchangeTimer {
    /// Begins `cycle`, whose sensors were sent at `stamp_ns`, if at all.
    pub(crate) fn begin(&mut self, cycle: u64, stamp_ns: Option<u64>) {
        let sensors_ns = stamp_ns.unwrap_or(0);
        self.sent_ns[slot(cycle)] = sensors_ns;
        self.taken = None;
        self.now =
            AxisCycle { exchange: Exchange { sensors_ns, ..Exchange::default() }, ..AxisCycle::default() };
    }

    /// Records an accepted command that arrived at `stamp_ns` in `cycle`, the newest one; returns its round trip if its sensors
    /// were sent.
    pub(crate) fn taken(&mut self, echo: u16, stamp_ns: u64, cycle: u64) -> Option<u64> {
        let behind = cycle.wrapping_sub(u64::from(echo)) % ECHO_RANGE;
        self.taken = Some((stamp_ns, cycle.saturating_sub(behind)));
        let sent_ns = self.sent_ns[usize::from(echo)];
        (sent_ns != 0).then(|| stamp_ns.saturating_sub(sent_ns))
    }

    /// Records the age of the command in effect, if any; a command taken in this cycle is the one.
    pub(crate) fn latched(&mut self, age_cycles: Option<u64>) {
        let Some(age_cycles) = age_cycles else { return };
        self.now.age_cycles = age_cycles;
        if let Some((stamp_ns, answers)) = self.taken.take() {
            self.now.exchange.command_ns = stamp_ns;
            self.now.exchange.answers = answers;
            self.now.answered_sensors_ns = self.sent_ns[slot(answers)];
        }
    }

    pub(crate) fn cycle(&self) -> AxisCycle {
        self.now
    }
}

impl Default for ExchangeTimer {
    fn default() -> Self {
        Self { sent_ns: Box::new([0; ECHO_RANGE as usize]), taken: None, now: AxisCycle::default() }
    }
}

impl AxisCycle {
    /// Age in ns at the start of the first cycle in which the command acts, `due_ns`; `None` without a newly acting command.
    pub(crate) fn age_ns(&self, due_ns: u64) -> Option<u64> {
        let known = self.exchange.command_ns != 0 && self.answered_sensors_ns != 0;
        known.then(|| due_ns.saturating_sub(self.answered_sensors_ns))
    }
}

fn slot(cycle: u64) -> usize {
    (cycle % ECHO_RANGE) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_joined_to_its_sensors_across_the_end_of_the_echo() {
        let mut timer = ExchangeTimer::default();
        timer.begin(4095, Some(4_095_000_050));
        timer.begin(4096, Some(4_096_000_060));
        assert_eq!(timer.taken(4095, 4_095_000_400, 4096), Some(350));
        timer.latched(Some(1));
        let AxisCycle { exchange, age_cycles, .. } = timer.cycle();
        assert_eq!(
            exchange,
            Exchange { sensors_ns: 4_096_000_060, command_ns: 4_095_000_400, answers: 4095 }
        );
        assert_eq!((age_cycles, timer.cycle().age_ns(4_096_000_000)), (1, Some(999_950)));
    }

    #[test]
    fn a_held_command_has_an_age_and_is_not_new() {
        let mut timer = ExchangeTimer::default();
        timer.begin(7, Some(7));
        timer.begin(8, Some(8));
        timer.latched(Some(2));
        assert_eq!((timer.cycle().age_cycles, timer.cycle().exchange.command_ns), (2, 0));
        assert_eq!(timer.cycle().age_ns(9), None);
    }

    #[test]
    fn a_command_that_does_not_act_is_none_and_sensors_that_did_not_leave_have_no_round_trip() {
        let mut timer = ExchangeTimer::default();
        timer.begin(7, None);
        timer.begin(8, Some(8));
        assert_eq!(timer.taken(7, 20, 8), None);
        timer.latched(None);
        assert_eq!(
            timer.cycle(),
            AxisCycle { exchange: Exchange { sensors_ns: 8, ..Exchange::default() }, ..AxisCycle::default() }
        );
    }
}
