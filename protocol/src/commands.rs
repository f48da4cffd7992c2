//! Takes the valve commands of one axis from the bus and decides which opening acts.
//!
//! [`CommandIntake::take`] stores a command when it arrives; it acts from the start of the next cycle (bus.md, Time). There
//! [`CommandIntake::latch`] drops one that has grown older than 20 cycles, and notes whether two senders dispute the valve;
//! [`CommandIntake::opening`] is 0 in both cases. A frame whose echo is older than 20 cycles, or answers no cycle that was
//! sent, is counted and never stored.

use crate::frames::ValveCommand;
use crate::live_cycles::LiveCycles;
use crate::sources::{Step, TwoSenderDetector};
use serde::{Deserialize, Serialize};

/// Age in cycles beyond which a command is stale (bus.md, Time).
pub const STALE_AFTER_CYCLES: u64 = 20;

/// Counters of one axis's commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct CommandCounters {
    /// Commands taken over, whether or not a later one of the same cycle replaced them.
    pub accepted: u64,
    /// Commands refused because their echo was too old, or answered no cycle that was sent.
    pub refused_stale: u64,
    /// Times that the acting command grew stale and the valve was shut.
    pub expired: u64,
    /// Commands that never came, by the gaps in the sender's counter.
    pub lost: u64,
    /// Times that the sender's counter jumped further than cycles had passed: what was lost there is unknown.
    pub breaks: u64,
    /// Accepted commands that came a cycle or more later than the cycle after the one that they answer.
    pub late: u64,
    /// Commands equal to the one before, counter and all; accepted all the same, and distinguished by [`TwoSenderDetector`].
    pub duplicate: u64,
    /// Times that the fault `two-sources` began.
    pub two_sources: u64,
}

/// A change that `latch` found, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The command grew stale: valve shut.
    Expired,
    /// A fresh command came after the valve had been shut for want of one.
    Fresh,
    /// Two senders use the identifier: valve shut.
    TwoSources,
    /// One of the two has fallen silent: the commands of the other act again.
    OneSource,
}

/// The command path of one axis.
#[derive(Default)]
pub struct CommandIntake {
    sources: TwoSenderDetector,
    /// Acts from the next latch on, unless that drops it.
    stored: Option<ValveCommand>,
    /// The last one accepted, dropped or not.
    last: Option<ValveCommand>,
    /// An accepted command was there, and grew stale.
    expired: bool,
    disputed: bool,
    refused_since_accepted: u64,
    /// Counters since the start.
    pub counters: CommandCounters,
}

impl CommandIntake {
    /// Takes a well-formed command that arrived before the start of the newest sent cycle. True when it was accepted.
    pub fn take(&mut self, command: ValveCommand, live: &LiveCycles) -> bool {
        let Some(age) = live.age(command.echo).filter(|age| *age <= STALE_AFTER_CYCLES) else {
            self.counters.refused_stale += 1;
            self.refused_since_accepted += 1;
            return false;
        };
        self.counters.late += u64::from(age > 1);
        self.counters.duplicate += u64::from(self.last.replace(command) == Some(command));
        match self.sources.note(command.alive, live.sent, live.sent - age) {
            // A refused frame leaves a gap in the counters of those accepted, but it came.
            Step::Continues { lost } => {
                self.counters.lost += lost.saturating_sub(self.refused_since_accepted);
            }
            Step::Breaks => self.counters.breaks += 1,
        }
        self.refused_since_accepted = 0;
        self.counters.accepted += 1;
        self.stored = Some(command);
        true
    }

    /// Decides whether the command that `take` stored acts over the cycle that was sent last: drops a stale one, and notes a
    /// dispute of two senders.
    pub fn latch(&mut self, live: &LiveCycles) -> Option<Change> {
        let too_old =
            |command: &ValveCommand| live.age(command.echo).is_none_or(|age| age > STALE_AFTER_CYCLES);
        let expired = self.stored.as_ref().is_some_and(too_old);
        if expired {
            self.stored = None;
            self.counters.expired += 1;
        }
        // In cycles that were sent, as all ages are: a stall of the rig is no silence of the sender.
        let disputed = self.sources.two_sources(live.sent);
        let dispute_changed = disputed != self.disputed;
        self.disputed = disputed;
        self.counters.two_sources += u64::from(dispute_changed && disputed);
        // One message a cycle is enough: the dispute explains more than the age.
        if dispute_changed {
            self.expired |= expired;
            return Some(if disputed { Change::TwoSources } else { Change::OneSource });
        }
        if expired {
            self.expired = true;
            return Some(Change::Expired);
        }
        let fresh = self.stored.is_some() && std::mem::take(&mut self.expired);
        fresh.then_some(Change::Fresh)
    }

    /// Valve opening that acts, in -1 to 1.
    #[must_use]
    pub fn opening(&self) -> f64 {
        match &self.stored {
            Some(command) if command.enable && !self.disputed => command.opening,
            _ => 0.0,
        }
    }

    /// Age of the acting command in cycles, 1 being the least; `None` without one.
    #[must_use]
    pub fn age_cycles(&self, live: &LiveCycles) -> Option<u64> {
        self.stored.as_ref().and_then(|command| live.age(command.echo))
    }

    /// The same when it is obeyed: not while two senders dispute it.
    #[must_use]
    pub fn obeyed_age_cycles(&self, live: &LiveCycles) -> Option<u64> {
        if self.disputed { None } else { self.age_cycles(live) }
    }

    /// Whether the valve is shut because two senders dispute it.
    #[must_use]
    pub fn disputed(&self) -> bool {
        self.disputed
    }

    /// Whether the valve is shut because no fresh command is there.
    #[must_use]
    pub fn stale(&self) -> bool {
        self.stored.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An intake and its cycles, with a sender that answers each cycle unless asked not to.
    #[derive(Default)]
    struct Bench {
        intake: CommandIntake,
        live: LiveCycles,
        cycle: u64,
        alive: u8,
    }

    impl Bench {
        fn command(&mut self, opening: f64, echo: u64) -> ValveCommand {
            self.alive = (self.alive + 1) % 16;
            ValveCommand { opening, alive: self.alive, echo: (echo % 4096) as u16, enable: true }
        }

        /// Sends the sensors of the next cycle, having first taken an answer to the last one, if any.
        fn cycle(&mut self, answer: Option<f64>) -> Option<Change> {
            if let Some(opening) = answer {
                let command = self.command(opening, self.cycle - 1);
                self.intake.take(command, &self.live);
            }
            self.live.sent(self.cycle);
            let change = self.intake.latch(&self.live);
            self.cycle += 1;
            change
        }
    }

    #[test]
    fn a_command_acts_in_the_next_cycle_and_is_held() {
        let mut bench = Bench::default();
        bench.cycle(None);
        assert_eq!(bench.intake.opening(), 0.0);
        bench.cycle(Some(0.5));
        assert_eq!((bench.intake.opening(), bench.intake.age_cycles(&bench.live)), (0.5, Some(1)));
        bench.cycle(None);
        assert_eq!((bench.intake.opening(), bench.intake.age_cycles(&bench.live)), (0.5, Some(2)));
    }

    #[test]
    fn a_command_older_than_twenty_cycles_shuts_the_valve_until_a_fresh_one() {
        let mut bench = Bench::default();
        bench.cycle(None);
        bench.cycle(Some(0.5));
        let changes: Vec<_> = (2..=20).filter_map(|_| bench.cycle(None)).collect();
        assert_eq!((changes.as_slice(), bench.intake.opening()), (&[][..], 0.5));
        assert_eq!(bench.cycle(None), Some(Change::Expired));
        assert_eq!(bench.intake.opening(), 0.0);
        assert_eq!(bench.cycle(Some(0.25)), Some(Change::Fresh));
        assert_eq!(bench.intake.opening(), 0.25);
    }

    #[test]
    fn a_command_that_grew_stale_in_a_dispute_does_not_act_when_it_ends() {
        let mut bench = Bench::default();
        bench.cycle(None);
        for _ in 0..30 {
            let intruder = ValveCommand { opening: 1.0, alive: 15 - bench.alive, echo: 0, enable: true };
            let intruder = ValveCommand { echo: (bench.cycle - 1) as u16, ..intruder };
            bench.intake.take(intruder, &bench.live);
            bench.cycle(Some(0.5));
        }
        // Both fall silent: the dispute and the command's life end within the same few cycles.
        for _ in 0..30 {
            bench.cycle(None);
            let age = bench.intake.age_cycles(&bench.live);
            assert!(bench.intake.opening() == 0.0 || age.is_some_and(|age| age <= STALE_AFTER_CYCLES));
        }
        assert!(bench.intake.stale());
    }

    #[test]
    fn a_stale_echo_is_counted_and_never_applied() {
        let mut bench = Bench::default();
        bench.cycle(None);
        for _ in 0..100 {
            bench.cycle(Some(0.5));
        }
        for echo in [0, 79, 500, 4000] {
            let command = bench.command(-1.0, echo);
            assert!(!bench.intake.take(command, &bench.live), "echo {echo}");
        }
        assert_eq!((bench.intake.opening(), bench.intake.counters.refused_stale), (0.5, 4));
    }

    #[test]
    fn a_refused_frame_is_not_counted_as_lost_as_well() {
        let mut bench = Bench::default();
        bench.cycle(None);
        (0..40).for_each(|_| assert_eq!(bench.cycle(Some(0.5)), None));
        let stale = bench.command(0.5, 2);
        bench.intake.take(stale, &bench.live);
        bench.cycle(Some(0.5));
        assert_eq!((bench.intake.counters.refused_stale, bench.intake.counters.lost), (1, 0));
    }

    #[test]
    fn the_last_of_several_commands_in_a_cycle_counts() {
        let mut bench = Bench::default();
        bench.cycle(None);
        for opening in [0.1, 0.2, 0.3] {
            let command = bench.command(opening, 0);
            bench.intake.take(command, &bench.live);
        }
        bench.cycle(None);
        assert_eq!(bench.intake.opening(), 0.3);
    }

    #[test]
    fn a_command_that_does_not_enable_keeps_the_valve_shut() {
        let mut bench = Bench::default();
        bench.cycle(None);
        let command = ValveCommand { enable: false, ..bench.command(0.5, 0) };
        bench.intake.take(command, &bench.live);
        bench.cycle(None);
        assert_eq!((bench.intake.opening(), bench.intake.stale()), (0.0, false));
    }

    #[test]
    fn a_late_command_and_one_that_comes_twice_are_counted_and_obeyed() {
        let mut bench = Bench::default();
        bench.cycle(None);
        bench.cycle(Some(0.5));
        bench.cycle(None);
        let late = bench.command(0.25, 0);
        assert!(bench.intake.take(late, &bench.live));
        assert_eq!((bench.intake.counters.late, bench.intake.counters.duplicate), (1, 0));
        bench.cycle(Some(0.5));
        let again = ValveCommand { alive: bench.alive, ..bench.intake.stored.unwrap() };
        assert!(bench.intake.take(again, &bench.live));
        assert_eq!((bench.intake.counters.late, bench.intake.counters.duplicate), (1, 1));
        assert_eq!(bench.intake.opening(), 0.5);
    }

    #[test]
    fn two_senders_in_step_with_the_same_words_are_two_all_the_same() {
        let mut bench = Bench::default();
        bench.cycle(None);
        for _ in 0..30 {
            let command = bench.command(0.5, bench.cycle - 1);
            bench.intake.take(command, &bench.live);
            bench.intake.take(command, &bench.live);
            bench.cycle(None);
        }
        assert_eq!((bench.intake.opening(), bench.intake.counters.two_sources), (0.0, 1));
        assert_eq!(bench.intake.counters.duplicate, 30);
    }

    #[test]
    fn two_senders_shut_the_valve_until_one_is_silent() {
        let mut bench = Bench::default();
        bench.cycle(None);
        let mut changes = Vec::new();
        for _ in 0..30 {
            let intruder = ValveCommand { opening: 1.0, alive: 15 - bench.alive, echo: 0, enable: true };
            let intruder = ValveCommand { echo: (bench.cycle - 1) as u16, ..intruder };
            bench.intake.take(intruder, &bench.live);
            changes.extend(bench.cycle(Some(0.5)));
        }
        assert_eq!((changes.as_slice(), bench.intake.opening()), (&[Change::TwoSources][..], 0.0));
        let changes: Vec<_> = (0..30).filter_map(|_| bench.cycle(Some(0.5))).collect();
        assert_eq!((changes.as_slice(), bench.intake.opening()), (&[Change::OneSource][..], 0.5));
        assert_eq!(bench.intake.counters.two_sources, 1);
    }
}
