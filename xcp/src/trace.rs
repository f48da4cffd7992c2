//! The trigger buffer of the paper's controllers: up to four signals, sampled around the moment in which a fifth crosses a
//! threshold.
//!
//! ```text
//!   idle ── arm ──► filling ── pre-trigger samples are there ──► armed ── source crosses the threshold ──► triggered
//!    ▲                                                                                                        │
//!    └───────────── arm = 0, or the rig restarted ───────────── ready ◄────────── length samples are there ───┘
//! ```
//!
//! A sample is taken every `sample_time_cycles`; each compares the source with its value in the sample before. The first sample
//! beyond the threshold is number `pre_trigger_samples`, counted from 0. Skipped cycles leave no sample; each sample holds its
//! cycle. Settings apply from the next arming on. The buffer is allocated at the start.

use crate::signals::{COUNT, Format};
use settings::parameters::{Declaration, Parameter, declare};

/// Samples that the buffer holds at most.
pub(crate) const CAPACITY: usize = 4096;
/// Number of signals that the buffer records.
pub(crate) const CHANNELS: usize = 4;

/// Last place of the table of signals.
const LAST: f64 = (COUNT - 1) as f64;

settings::parameters! {
    /// Writable values besides the parameters of the program. Whole numbers are counts of four bytes, others floats of eight.
    pub(crate) struct Controls {
        source as "trace.source": signal(17.0, "signal that is compared with the threshold, by its place"),
        threshold as "trace.threshold": declare("", [-1e9, 1e9], 0.0, "threshold, in the unit of the source"),
        slope as "trace.slope": declare("", [0.0, 3.0], 0.0, "0 rising, 1 falling, 2 either, 3 at once").whole(),
        pre_trigger_samples as "trace.pre_trigger_samples": declare("", [0.0, CAPACITY as f64 - 1.0], 100.0,
            "samples before the trigger; below the length").whole(),
        length_samples as "trace.length_samples": declare("", [1.0, CAPACITY as f64], 1000.0, "samples in all").whole(),
        sample_time_cycles as "trace.sample_time_cycles": declare("cycles", [1.0, 60_000.0], 1.0,
            "cycles of 1 ms from sample to sample").whole(),
        channel_1 as "trace.channel_1": signal(1.0, "signal that is recorded, by its place"),
        channel_2 as "trace.channel_2": signal(5.0, "signal that is recorded, by its place"),
        channel_3 as "trace.channel_3": signal(15.0, "signal that is recorded, by its place"),
        channel_4 as "trace.channel_4": signal(17.0, "signal that is recorded, by its place"),
        arm as "trace.arm": declare("", [0.0, 1.0], 0.0, "1 arms, 0 disarms; reads 1 until it is ready").whole(),
        load_set as "set.load": declare("", [0.0, 1.0], 0.0, "1 loads the parameter set that was stored last").whole(),
    }
}

/// The controls in the order of their addresses.
pub(crate) const CONTROLS: &[Parameter] = Controls::TABLE;
/// Their values, in this order.
pub(crate) type ControlValues = [f64; CONTROLS.len()];

const fn signal(default: f64, meaning: &'static str) -> Declaration {
    declare("", [0.0, LAST], default, meaning).whole()
}

/// How a control lies in memory.
pub(crate) fn control_format(place: usize) -> Format {
    if CONTROLS[place].whole { Format::Long } else { Format::Double }
}

pub(crate) const STATES: &[&str] = &["idle", "filling", "armed", "triggered", "ready"];

/// State of the trigger buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum State {
    /// Not recording; samples stay readable.
    Idle = 0,
    /// Recording the samples before the trigger.
    Filling = 1,
    Armed = 2,
    /// Recording the samples after the trigger.
    Triggered = 3,
    Ready = 4,
}

/// Name and meaning of the counts that the buffer reports, four bytes each, in this order.
pub(crate) const STATUS: [(&str, &str); 4] = [
    ("trace.state", "what the trigger buffer does"),
    ("trace.samples", "samples that can be read"),
    ("trace.trigger_cycle", "the rig's cycle of the trigger; 0 before it"),
    ("trace.triggers", "how often it has triggered since the start"),
];

/// Settings, as they were at arming.
#[derive(Clone, Copy)]
struct Settings {
    source: usize,
    threshold: f64,
    slope: u8,
    pre_trigger_samples: usize,
    length_samples: usize,
    sample_time_cycles: u64,
    channels: [usize; CHANNELS],
}

/// State and samples of the trigger buffer, a ring of [`CAPACITY`] places for each channel.
#[derive(Clone)]
pub(crate) struct Trace {
    settings: Settings,
    state: State,
    cycles: Vec<u32>,
    values: [Vec<f64>; CHANNELS],
    next: usize,
    held: usize,
    /// Samples that are still to come after the trigger.
    to_come: usize,
    /// Value of the source in the last sample.
    before: Option<f64>,
    due: u64,
    trigger_cycle: u32,
    triggers: u32,
}

impl Default for Trace {
    fn default() -> Self {
        Self {
            settings: Settings::of(&Controls::default()),
            state: State::Idle,
            cycles: vec![0; CAPACITY],
            values: std::array::from_fn(|_| vec![0.0; CAPACITY]),
            next: 0,
            held: 0,
            to_come: 0,
            before: None,
            due: 0,
            trigger_cycle: 0,
            triggers: 0,
        }
    }
}

impl Settings {
    fn of(controls: &Controls) -> Self {
        let Controls { channel_1, channel_2, channel_3, channel_4, .. } = *controls;
        Self {
            source: controls.source as usize,
            threshold: controls.threshold,
            slope: controls.slope as u8,
            pre_trigger_samples: controls.pre_trigger_samples as usize,
            length_samples: controls.length_samples as usize,
            sample_time_cycles: controls.sample_time_cycles as u64,
            channels: [channel_1, channel_2, channel_3, channel_4].map(|place| place as usize),
        }
    }
}

impl Trace {
    /// Whether the pre-trigger is shorter than the buffer.
    pub(crate) fn can_arm(controls: &Controls) -> bool {
        controls.pre_trigger_samples < controls.length_samples
    }

    /// Discards all samples and starts with these settings, whose ranges were checked.
    pub(crate) fn arm(&mut self, controls: &Controls) {
        self.settings = Settings::of(controls);
        self.state = State::Filling;
        (self.next, self.held, self.before, self.due, self.trigger_cycle) = (0, 0, None, 0, 0);
    }

    /// Stops, and keeps the samples.
    pub(crate) fn disarm(&mut self) {
        self.state = State::Idle;
    }

    /// Stops a recording that a restart of the rig has cut.
    pub(crate) fn restart(&mut self) {
        if self.runs() {
            self.disarm();
        }
    }

    pub(crate) fn runs(&self) -> bool {
        matches!(self.state, State::Filling | State::Armed | State::Triggered)
    }

    pub(crate) fn take(&mut self, cycle: u64, signals: &[f64; COUNT]) {
        if !self.runs() || cycle < self.due {
            return;
        }
        self.due = cycle + self.settings.sample_time_cycles;
        self.put(cycle, signals);
        let source = signals[self.settings.source];
        let before = self.before.replace(source);
        if self.state == State::Filling && self.held > self.settings.pre_trigger_samples {
            self.state = State::Armed;
        }
        match self.state {
            State::Armed if self.crosses(before, source) => {
                (self.trigger_cycle, self.triggers) = (cycle as u32, self.triggers.wrapping_add(1));
                self.held = self.settings.pre_trigger_samples + 1;
                self.to_come = self.settings.length_samples - self.held;
                self.state = if self.to_come == 0 { State::Ready } else { State::Triggered };
            }
            State::Triggered => {
                self.to_come -= 1;
                if self.to_come == 0 {
                    self.state = State::Ready;
                }
            }
            _ => {}
        }
    }

    fn put(&mut self, cycle: u64, signals: &[f64; COUNT]) {
        self.cycles[self.next] = cycle as u32;
        for (values, channel) in self.values.iter_mut().zip(self.settings.channels) {
            values[self.next] = signals[channel];
        }
        self.next = (self.next + 1) % CAPACITY;
        self.held = (self.held + 1).min(self.settings.length_samples);
    }

    fn crosses(&self, before: Option<f64>, source: f64) -> bool {
        let Settings { threshold, slope, .. } = self.settings;
        let rises = before.is_some_and(|before| before < threshold && source >= threshold);
        let falls = before.is_some_and(|before| before > threshold && source <= threshold);
        match slope {
            0 => rises,
            1 => falls,
            2 => rises || falls,
            _ => true,
        }
    }

    /// The counts of [`STATUS`], in its order.
    pub(crate) fn reported(&self) -> [u32; STATUS.len()] {
        [self.state as u32, self.samples() as u32, self.trigger_cycle, self.triggers]
    }

    /// Samples that can be read: none before the trigger.
    pub(crate) fn samples(&self) -> usize {
        let triggered = matches!(self.state, State::Triggered | State::Ready)
            || self.state == State::Idle && self.trigger_cycle != 0;
        if triggered { self.held } else { 0 }
    }

    /// Cycle of sample `number`, the oldest being 0; 0 for one that is not there.
    pub(crate) fn cycle(&self, number: usize) -> u32 {
        self.place(number).map_or(0, |place| self.cycles[place])
    }

    /// Value of sample `number` of a channel; 0 for one that is not there.
    pub(crate) fn value(&self, channel: usize, number: usize) -> f64 {
        self.place(number).map_or(0.0, |place| self.values[channel][place])
    }

    fn place(&self, number: usize) -> Option<usize> {
        (number < self.samples()).then(|| (self.next + CAPACITY - self.held + number) % CAPACITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The source is signal 3, and the first channel is that.
    fn controls() -> Controls {
        let places = Controls { source: 3.0, channel_1: 3.0, ..Controls::default() };
        Controls { pre_trigger_samples: 3.0, length_samples: 8.0, threshold: 50.0, ..places }
    }

    fn armed(controls: Controls) -> Trace {
        let mut trace = Trace::default();
        trace.arm(&controls);
        trace
    }

    fn run(trace: &mut Trace, cycles: impl Iterator<Item = u64>, source: impl Fn(u64) -> f64) {
        for cycle in cycles {
            let mut signals = [0.0; COUNT];
            signals[3] = source(cycle);
            trace.take(cycle, &signals);
        }
    }

    fn cycles(trace: &Trace) -> Vec<u32> {
        (0..trace.samples()).map(|number| trace.cycle(number)).collect()
    }

    #[test]
    fn the_samples_lie_around_the_trigger_whatever_came_before() {
        for start in [0, 40, 10_000] {
            let mut trace = armed(controls());
            run(&mut trace, 0..start + 100, |cycle| cycle as f64 - start as f64);
            let trigger = (start + 50) as u32;
            assert_eq!((trace.state, trace.reported()[2]), (State::Ready, trigger));
            assert_eq!(cycles(&trace), (trigger - 3..trigger + 5).collect::<Vec<_>>());
            assert_eq!(trace.value(0, 3), 50.0);
        }
    }

    #[test]
    fn nothing_triggers_before_the_pre_trigger_is_filled() {
        let mut trace = armed(controls());
        run(&mut trace, 0..20, |cycle| if cycle == 2 { 60.0 } else { 0.0 });
        assert_eq!((trace.state, trace.samples()), (State::Armed, 0));
    }

    #[test]
    fn slopes_are_distinguished() {
        // Up at 10, down at 20.
        let pulse = |cycle| if (10..20).contains(&cycle) { 60.0 } else { 0.0 };
        for (slope, trigger) in [(0.0, 10), (1.0, 20), (2.0, 10), (3.0, 3)] {
            let mut trace = armed(Controls { slope, ..controls() });
            run(&mut trace, 0..40, pulse);
            assert_eq!(trace.reported()[2], trigger, "slope {slope}");
        }
    }

    #[test]
    fn samples_are_so_many_cycles_apart_and_say_what_was_skipped() {
        let mut trace = armed(Controls { sample_time_cycles: 10.0, threshold: 60.0, ..controls() });
        run(&mut trace, (0..200).filter(|cycle| *cycle != 70), |cycle| cycle as f64);
        assert_eq!(cycles(&trace), [30, 40, 50, 60, 71, 81, 91, 101]);
    }

    #[test]
    fn the_whole_buffer_can_be_used() {
        let most = CAPACITY as f64;
        let all = Controls {
            length_samples: most,
            pre_trigger_samples: most - 1.0,
            threshold: 9000.0,
            ..controls()
        };
        let mut trace = armed(all);
        run(&mut trace, 0..9100, |cycle| cycle as f64);
        assert_eq!((trace.state, trace.samples()), (State::Ready, CAPACITY));
        assert_eq!((trace.cycle(0), trace.cycle(CAPACITY - 1)), (9000 - CAPACITY as u32 + 1, 9000));
        assert_eq!(trace.cycle(CAPACITY), 0, "beyond the end there is nothing");
    }

    #[test]
    fn a_pre_trigger_as_long_as_the_buffer_cannot_be_armed() {
        let of = |length_samples, pre_trigger_samples| Controls {
            length_samples,
            pre_trigger_samples,
            ..controls()
        };
        assert!(!Trace::can_arm(&of(100.0, 100.0)));
        assert!(Trace::can_arm(&of(100.0, 99.0)));
    }
}
