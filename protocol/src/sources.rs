//! Detects from the 4-bit counters whether one or two senders use a command identifier.
//!
//! One sender's counter goes up by one a frame; lost frames make it jump by at most the cycles that passed. Two senders
//! on one identifier break that rule with at least every second frame, whatever their counters are:
//!
//! ```text
//!   one sender, one frame lost:   4 5 . 7 8        steps 1 . 2 1      no break (two cycles passed)
//!   a restart:                    4 5 6 0 1        steps 1 1 10 1     one break
//!   two senders:                  4 11 5 12 6 13   steps 7 10 7 10    all breaks
//!   two in step:                  4 4 5 5 6 6      steps 0 1 0 1      every second one
//! ```
//!
//! A sender that stood still answers several cycles at once, so the cycles that passed are those of the answers where these
//! are more. Cycles are those that were sent: what a late rig skipped is no silence of a sender. Four breaks within 20
//! cycles raise the fault; it ends when none was seen for 20 cycles, which is what one sender falling silent brings about
//! (bus.md, Frames).

use crate::frames::ALIVE_RANGE;

/// Cycles that a break is remembered, and that a fault lasts without one.
pub const SILENCE_CYCLES: u64 = 20;
/// Breaks within [`SILENCE_CYCLES`] that raise the fault: a restart makes one, two in quick succession two.
const BREAKS_TO_LATCH: usize = 4;

/// Step of the counter from the frame before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The sender's next frame, after `lost` that never came.
    Continues {
        /// Frames lost since the one before.
        lost: u64,
    },
    /// Not a continuation: a restart, or another sender.
    Breaks,
}

/// Counter of the last frame, the cycle in which it came and the cycle that it answered.
struct LastFrame {
    alive: u8,
    cycle: u64,
    answered: u64,
}

/// Detects two senders by the counter of one command identifier.
#[derive(Default)]
pub struct TwoSenderDetector {
    last: Option<LastFrame>,
    breaks: [Option<u64>; BREAKS_TO_LATCH],
    two_sources: bool,
}

impl TwoSenderDetector {
    /// Takes note of a frame with counter `alive` that came in `cycle` and answers the cycle `answered`.
    pub fn note(&mut self, alive: u8, cycle: u64, answered: u64) -> Step {
        let step = match &self.last {
            None => Step::Continues { lost: 0 },
            // After a silence the command was stale, which is reported; what comes now may be a restart, so that its
            // counter says nothing about loss.
            Some(last) if cycle - last.cycle > SILENCE_CYCLES => Step::Continues { lost: 0 },
            Some(last) => {
                let ahead = (ALIVE_RANGE + u64::from(alive) - u64::from(last.alive)) % ALIVE_RANGE;
                let passed = (cycle - last.cycle).max(answered.saturating_sub(last.answered));
                // A frame may come late into the next cycle, so one more than the cycles that passed.
                let allowed = passed + 1;
                match ahead {
                    // Sixteen lost frames look like none; the cycles that passed distinguish them.
                    0 if passed >= ALIVE_RANGE => Step::Continues { lost: ALIVE_RANGE - 1 },
                    1.. if ahead <= allowed => Step::Continues { lost: ahead - 1 },
                    _ => Step::Breaks,
                }
            }
        };
        self.last = Some(LastFrame { alive, cycle, answered });
        if step == Step::Breaks {
            self.breaks.rotate_left(1);
            self.breaks[BREAKS_TO_LATCH - 1] = Some(cycle);
            self.two_sources |= self.breaks[0].is_some_and(|oldest| cycle - oldest < SILENCE_CYCLES);
        }
        step
    }

    /// Whether two senders are at work, as of `cycle`.
    pub fn two_sources(&mut self, cycle: u64) -> bool {
        let newest = self.breaks[BREAKS_TO_LATCH - 1];
        if newest.is_none_or(|newest| cycle - newest >= SILENCE_CYCLES) {
            self.two_sources = false;
        }
        self.two_sources
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds one frame a cycle from each sender whose counters start at `starts`, for `cycles` cycles.
    fn feed(detector: &mut TwoSenderDetector, starts: &[u8], cycles: std::ops::Range<u64>) {
        for cycle in cycles {
            for start in starts {
                detector.note(((u64::from(*start) + cycle) % 16) as u8, cycle, cycle);
            }
        }
    }

    #[test]
    fn two_senders_are_found_whatever_their_counters() {
        for first in 0..16 {
            for second in 0..16 {
                let mut detector = TwoSenderDetector::default();
                feed(&mut detector, &[first, second], 0..20);
                assert!(detector.two_sources(19), "counters starting at {first} and {second}");
            }
        }
    }

    #[test]
    fn one_sender_is_never_two_even_with_loss_and_restarts() {
        let mut detector = TwoSenderDetector::default();
        feed(&mut detector, &[3], 0..50);
        feed(&mut detector, &[3], 60..70);
        // Two restarts in quick succession.
        feed(&mut detector, &[9], 70..73);
        feed(&mut detector, &[1], 73..90);
        assert!(!detector.two_sources(89));
    }

    #[test]
    fn the_fault_goes_when_one_sender_has_been_silent_for_twenty_cycles() {
        let mut detector = TwoSenderDetector::default();
        feed(&mut detector, &[0, 5], 0..40);
        assert!(detector.two_sources(40));
        feed(&mut detector, &[0], 40..60);
        assert!(detector.two_sources(59), "still within twenty cycles of the last break");
        feed(&mut detector, &[0], 60..61);
        assert!(!detector.two_sources(60));
    }

    #[test]
    fn lost_frames_are_counted_by_the_gap() {
        let mut detector = TwoSenderDetector::default();
        detector.note(4, 10, 9);
        assert_eq!(detector.note(5, 11, 10), Step::Continues { lost: 0 });
        assert_eq!(detector.note(8, 14, 13), Step::Continues { lost: 2 });
        assert_eq!(detector.note(9, 14, 13), Step::Continues { lost: 0 });
        assert_eq!(detector.note(9, 15, 14), Step::Breaks);
        assert_eq!(detector.note(13, 36, 35), Step::Continues { lost: 0 }, "after a silence of 21 cycles");
    }

    #[test]
    fn a_frame_lost_out_of_a_burst_is_counted() {
        let mut detector = TwoSenderDetector::default();
        detector.note(4, 10, 9);
        // The sender stood still for five cycles and answers them at once; the third answer is lost.
        assert_eq!(detector.note(5, 15, 10), Step::Continues { lost: 0 });
        assert_eq!(detector.note(6, 15, 11), Step::Continues { lost: 0 });
        assert_eq!(detector.note(8, 15, 13), Step::Continues { lost: 1 });
        assert_eq!(detector.note(9, 15, 14), Step::Continues { lost: 0 });
    }
}
