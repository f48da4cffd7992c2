//! How old an echo is, in cycles that were really sent.
//!
//! A command answers the sensors of one cycle and carries the low 12 bits of its number. Its age is the number of
//! cycles sent since; a cycle that was skipped after a late wake-up was never sent and ages nothing (bus.md, Time).
//! An echo of a cycle that was never sent has no age: it is stale whatever it says.
//!
//! ```text
//!   cycle      7   8   9  [10  11  12]  13       10..12 skipped
//!   sent no.   7   8   9                10
//!   echo 9 at cycle 13: age 1            echo 11: never sent
//! ```

use crate::frames::ECHO_RANGE;

/// The last [`ECHO_RANGE`] cycles, and which of them were sent.
pub struct LiveCycles {
    /// For each low part of a cycle number, how many cycles had been sent when its sensors were.
    sent_count: Box<[Option<u64>; ECHO_RANGE as usize]>,
    /// Cycles sent so far.
    pub(crate) sent: u64,
}

impl LiveCycles {
    /// The cycles from `first` on, `count` of them, were skipped.
    pub fn skipped(&mut self, first: u64, count: u64) {
        // More than the whole range says the same as the whole range.
        for cycle in first..first + count.min(ECHO_RANGE) {
            self.sent_count[slot(cycle)] = None;
        }
    }

    /// The sensors of `cycle` were sent.
    pub fn sent(&mut self, cycle: u64) {
        self.sent += 1;
        self.sent_count[slot(cycle)] = Some(self.sent);
    }

    /// Cycles sent since the one that `echo` answers, the newest sent cycle having age 0; `None` when the echo's
    /// cycle was never sent.
    #[must_use]
    pub fn age(&self, echo: u16) -> Option<u64> {
        self.sent_count[slot(u64::from(echo))].map(|count| self.sent - count)
    }
}

/// No cycle was sent yet.
impl Default for LiveCycles {
    fn default() -> Self {
        Self { sent_count: Box::new([None; ECHO_RANGE as usize]), sent: 0 }
    }
}

fn slot(cycle: u64) -> usize {
    (cycle % ECHO_RANGE) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent_up_to(cycle: u64) -> LiveCycles {
        let mut cycles = LiveCycles::default();
        (0..=cycle).for_each(|cycle| cycles.sent(cycle));
        cycles
    }

    #[test]
    fn age_counts_cycles_since_the_echoed_one() {
        let cycles = sent_up_to(5000);
        assert_eq!(cycles.age((5000 % 4096) as u16), Some(0));
        assert_eq!(cycles.age((4999 % 4096) as u16), Some(1));
        assert_eq!(cycles.age((4980 % 4096) as u16), Some(20));
    }

    #[test]
    fn skipped_cycles_do_not_age_a_command() {
        let mut cycles = sent_up_to(100);
        cycles.skipped(101, 300);
        cycles.sent(401);
        assert_eq!(cycles.age(100), Some(1));
        assert_eq!(cycles.age(99), Some(2));
    }

    #[test]
    fn the_echo_of_a_cycle_that_was_never_sent_has_no_age() {
        let mut cycles = sent_up_to(100);
        assert_eq!(cycles.age(101), None);
        cycles.skipped(101, 10);
        assert_eq!(cycles.age(105), None);
    }

    #[test]
    fn a_stall_longer_than_the_echo_range_leaves_no_old_echo_valid() {
        let mut cycles = sent_up_to(100);
        cycles.skipped(101, 9000);
        assert!((0..4096).all(|echo| cycles.age(echo).is_none()));
    }
}
