//! A gap: the interval in which a spinning thread did not run, and its cause.
//!
//! ```text
//!   looks at the clock   | | | | | |              | | | |        gap: from the last look before to the first one after
//!                                  └── length ────┘
//! ```
//! Another thread had the CPU if the kernel counted a switch away from the thread and the thread waited for most of the gap. A
//! switch alone is no proof: the counters reach back up to a millisecond, in which a short switch may have come before. Without
//! a switch the thread was running, and the CPU itself stood still: a hypervisor, the firmware (SMI), or interrupt work of the
//! kernel.

use realtime::VitalCounts;
use runlog::probe::Gap;

/// Period of reading the counters without a gap, so that they cover a gap and little before it.
const REFRESH_NS: u64 = 1_000_000;

/// Whether another thread had the CPU for most of `length_ns`, or the process was stopped: the spinning thread never yields by
/// itself.
fn was_preempted(counted: &VitalCounts, length_ns: u64) -> bool {
    let run_delay_is_unavailable = counted.run_delay_ns == 0;
    counted.voluntary_switches > 0
        || (counted.involuntary_switches > 0
            && (run_delay_is_unavailable || counted.run_delay_ns >= length_ns / 2))
}

/// Finds gaps in the readings of the clock on one CPU.
#[derive(Debug)]
pub(super) struct GapDetector {
    cpu: u64,
    gap_ns: u64,
    last_ns: u64,
    refreshed_ns: u64,
}

impl GapDetector {
    /// A detector whose first reading is `now_ns`.
    pub(super) fn new(cpu: u64, gap_ns: u64, now_ns: u64) -> Self {
        Self { cpu, gap_ns, last_ns: now_ns, refreshed_ns: now_ns }
    }

    /// The next reading; `counts` returns the counters since its last call.
    pub(super) fn look(&mut self, now_ns: u64, counts: impl FnOnce() -> VitalCounts) -> Option<Gap> {
        let from_ns = std::mem::replace(&mut self.last_ns, now_ns);
        let length_ns = now_ns - from_ns;
        let is_gap = length_ns > self.gap_ns;
        if !is_gap && now_ns - self.refreshed_ns < REFRESH_NS {
            return None;
        }
        self.refreshed_ns = now_ns;
        let another_ran = was_preempted(&counts(), length_ns);
        is_gap.then_some(Gap { cpu: self.cpu, from_ns, to_ns: now_ns, another_ran })
    }
}

/// Sum of the gaps of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct GapTotal {
    pub count: u64,
    pub longest_ns: u64,
    pub together_ns: u64,
}

impl GapTotal {
    pub(super) fn add(&mut self, gap: &Gap) {
        let length_ns = gap.to_ns - gap.from_ns;
        self.count += 1;
        self.longest_ns = self.longest_ns.max(length_ns);
        self.together_ns += length_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAP_NS: u64 = 100_000;

    fn counts(voluntary_switches: u64, involuntary_switches: u64, run_delay_ns: u64) -> VitalCounts {
        VitalCounts { voluntary_switches, involuntary_switches, run_delay_ns, ..VitalCounts::default() }
    }

    #[test]
    fn only_a_pause_longer_than_asked_is_a_gap_and_it_goes_from_look_to_look() {
        let mut detector = GapDetector::new(3, GAP_NS, 1_000);
        assert_eq!(detector.look(1_000 + GAP_NS, VitalCounts::default), None);
        let gap = detector.look(1_001 + 2 * GAP_NS, VitalCounts::default).expect("a nanosecond too long");
        assert_eq!(
            gap,
            Gap { cpu: 3, from_ns: 1_000 + GAP_NS, to_ns: 1_001 + 2 * GAP_NS, another_ran: false }
        );
        assert_eq!(detector.look(gap.to_ns + 50, VitalCounts::default), None, "a gap is reported once");
    }

    #[test]
    fn another_ran_if_it_took_the_cpu_for_most_of_the_gap() {
        for (counted, another_ran) in [
            (counts(0, 0, 0), false),
            (counts(0, 1, 500_000), true),
            (counts(0, 3, 1_000_000), true),
            // A short switch before the machine stood still.
            (counts(0, 1, 20_000), false),
            // A kernel that counts switches and no delays.
            (counts(0, 1, 0), true),
            // Stopped by a signal: the machine has nothing to do with it.
            (counts(1, 0, 2_000), true),
        ] {
            let mut detector = GapDetector::new(3, GAP_NS, 0);
            let gap = detector.look(1_000_000, || counted).expect("1 ms is a gap");
            assert_eq!(gap.another_ran, another_ran, "{counted:?}");
        }
    }

    #[test]
    fn counts_from_before_the_last_millisecond_are_forgotten() {
        let mut detector = GapDetector::new(3, GAP_NS, 0);
        let mut pending = counts(0, 1, 60_000);
        let mut asked = 0;
        for now_ns in (50_000..=1_000_000).step_by(50_000) {
            let reported = detector.look(now_ns, || {
                asked += 1;
                std::mem::take(&mut pending)
            });
            assert_eq!(reported, None);
        }
        assert_eq!(asked, 1, "read once a millisecond");
        let gap = detector.look(1_200_000, || pending).expect("200 us are a gap");
        assert!(!gap.another_ran, "the switch was long before");
    }

    #[test]
    fn totals_add_up() {
        let mut total = GapTotal::default();
        for (from_ns, to_ns) in [(0, 200_000), (500_000, 1_000_000)] {
            total.add(&Gap { cpu: 3, from_ns, to_ns, another_ran: false });
        }
        assert_eq!(total, GapTotal { count: 2, longest_ns: 500_000, together_ns: 700_000 });
    }
}
