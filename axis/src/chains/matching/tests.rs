//! Tests of the matching chain: its edges, its average, and what breaks it off.

use super::*;
use crate::chains::until_another;
use MatchingChainState as S;
use proptest::prelude::*;
use protocol::frames::{ChainStatus, ChainValues};

const OFFSET_M: f64 = 0.8e-3;

struct Play {
    chain: MatchingChain,
    inputs: MatchingInputs,
    values: Vec<f64>,
    drive_m: f64,
    received: bool,
}

impl Play {
    fn new() -> Self {
        let inputs = MatchingInputs {
            asked: true,
            linked: true,
            still: true,
            position_m: 0.1 + OFFSET_M,
            partner: Partner { status: Some(ChainStatus::default()), ..Partner::default() },
            ..MatchingInputs::default()
        };
        let values = Parameters::TABLE.iter().map(|parameter| parameter.default).collect();
        Self { chain: MatchingChain::default(), inputs, values, drive_m: 0.1, received: true }
    }

    fn step(&mut self) -> MatchingOutput {
        self.inputs.cycle += 1;
        if self.received && self.inputs.cycle % 10 == 1 {
            self.inputs.partner.received = Some(self.inputs.cycle);
            let averaged_position_m = self.drive_m;
            self.inputs.partner.values = Some(ChainValues { averaged_position_m, ..ChainValues::default() });
        }
        self.chain.advance(&self.inputs, &self.values)
    }

    /// Cycles until another state, and that state; after 100 s the same one.
    fn next(&mut self) -> (u64, S) {
        until_another(self.chain.entered.state, || self.step().state)
    }

    fn to(state: S) -> Self {
        let mut play = Self::new();
        while play.chain.entered.state != state {
            play.next();
        }
        play
    }

    fn cause(&self) -> MatchingCause {
        self.chain.entered.cause
    }
}

#[test]
fn linked_axes_at_rest_are_matched() {
    let mut play = Play::new();
    assert_eq!(play.next(), (1, S::WaitingForRest));
    assert_eq!(play.next(), (200, S::Averaging));
    assert_eq!(play.next(), (500, S::Matched));
    let output = play.step();
    assert!(output.matched && (output.offset_m - OFFSET_M).abs() < 1e-12, "{output:?}");
}

#[test]
fn noise_is_averaged_away() {
    let mut play = Play::to(S::Averaging);
    for cycle in 0..500_u64 {
        play.inputs.position_m = 0.1 + OFFSET_M + if cycle.is_multiple_of(2) { 1e-4 } else { -1e-4 };
        play.drive_m = 0.1 + if (cycle / 10).is_multiple_of(2) { 5e-5 } else { -5e-5 };
        play.step();
    }
    let output = play.step();
    assert!(output.matched && (output.offset_m - OFFSET_M).abs() < 5e-6, "{output:?}");
}

#[test]
fn nothing_is_averaged_before_rest_and_linkage() {
    let cases: [fn(&mut Play); 4] = [
        |play| play.inputs.linked = false,
        |play| play.inputs.still = false,
        |play| play.received = false,
        |play| play.drive_m += 1e-4,
    ];
    for spoil in cases {
        let mut play = Play::new();
        play.step();
        for _ in 0..10_000 {
            spoil(&mut play);
            assert_eq!(play.step().state, S::WaitingForRest);
        }
        spoil(&mut play);
        assert_eq!(play.step().fault, Some(Fault::MatchingTimeout), "10 s are over");
        assert_eq!(play.chain.entered.cycle, 10_002);
    }
}

#[test]
fn what_moves_while_averaging_breaks_it_off() {
    type Spoil = fn(&mut Play);
    let cases: [(Spoil, MatchingCause, u64); 5] = [
        (|play| play.inputs.linked = false, MatchingCause::NotLinked, 1),
        (|play| play.inputs.position_m += 0.31e-3, MatchingCause::Moved, 1),
        (|play| play.drive_m += 0.31e-3, MatchingCause::Moved, 20),
        (|play| play.received = false, MatchingCause::Silent, 101),
        (|play| play.inputs.position_m = f64::NAN, MatchingCause::Moved, 1),
    ];
    for (spoil, cause, within) in cases {
        let mut play = Play::to(S::Averaging);
        for _ in 0..50 {
            play.step();
        }
        spoil(&mut play);
        let (cycles, state) = play.next();
        assert_eq!((state, play.cause()), (S::WaitingForRest, cause));
        assert!(cycles <= within, "{cause:?}: {cycles}");
    }
}

#[test]
fn averaging_that_is_broken_off_again_and_again_ends() {
    let mut play = Play::new();
    for cycle in 0..11_000 {
        if cycle % 600 == 0 {
            play.inputs.position_m += 1e-3;
        }
        play.step();
    }
    assert_eq!(play.step().fault, Some(Fault::MatchingTimeout));
}

#[test]
fn averaging_that_is_longer_than_the_time_out_ends_too() {
    let mut play = Play::new();
    play.values[0] = 60.0;
    play.next();
    assert_eq!([play.next().1, play.next().1], [S::Averaging, S::Fault]);
}

#[test]
fn an_offset_that_no_sensor_has_is_a_fault() {
    for (offset_m, state) in [(5.1e-3, S::Fault), (-5.1e-3, S::Fault), (4.9e-3, S::Matched)] {
        let mut play = Play::new();
        play.inputs.position_m = 0.1 + offset_m;
        let last = [play.next().1, play.next().1, play.next().1][2];
        assert_eq!(last, state);
        let output = play.step();
        assert_eq!(output.fault, (state == S::Fault).then_some(Fault::OffsetImplausible));
        assert_eq!(output.offset_m != 0.0, state == S::Matched, "an implausible offset is not used");
    }
}

#[test]
fn a_matched_offset_holds_until_the_next() {
    let mut play = Play::to(S::Matched);
    play.inputs.asked = false;
    play.inputs.linked = false;
    assert_eq!(play.next(), (100_000, S::Matched));
    play.inputs.linked = true;
    play.inputs.asked = true;
    play.inputs.position_m += 1e-3;
    assert_eq!(play.next(), (1, S::WaitingForRest));
    assert!((play.step().offset_m - OFFSET_M).abs() < 1e-12);
    assert_eq!([play.next().1, play.next().1], [S::Averaging, S::Matched]);
    assert!((play.step().offset_m - OFFSET_M - 1e-3).abs() < 1e-12);
}

#[test]
fn what_is_no_longer_asked_is_given_up() {
    for state in [S::WaitingForRest, S::Averaging] {
        let mut play = Play::to(state);
        play.inputs.asked = false;
        assert_eq!((play.step().state, play.cause()), (S::Idle, MatchingCause::NotAsked));
    }
    let mut play = Play::new();
    play.inputs.linked = false;
    while play.chain.entered.state != S::Fault {
        play.next();
    }
    assert_eq!(play.next().1, S::Fault);
    play.inputs.asked = false;
    assert_eq!(play.step().state, S::Idle);
}

#[test]
fn a_new_rig_has_no_offset() {
    let mut play = Play::to(S::Matched);
    play.chain.restart(3);
    play.inputs.asked = false;
    let output = play.step();
    assert_eq!((output.state, output.offset_m), (S::Idle, 0.0));
}

#[test]
fn the_defaults_lie_in_their_ranges() {
    for parameter in Parameters::TABLE {
        assert_eq!(parameter.check(parameter.default), Ok(parameter.default), "{}", parameter.name);
    }
}

proptest! {
    #[test]
    fn whatever_comes_only_the_diagrams_edges_are_gone(
        row in prop::collection::vec(
            (0_u64..60, any::<[bool; 2]>(), 0_u8..30, prop_oneof![20 => Just(0.1), 1 => -1.0..1.0, 1 => Just(f64::NAN)]),
            1..400,
        ),
    ) {
        let mut play = Play::new();
        for (cycles, [still, received], rare, position_m) in row {
            play.inputs.cycle += cycles;
            play.inputs.asked = rare != 0;
            play.inputs.linked = rare != 1;
            play.inputs.still = still || rare > 3;
            play.received = received;
            play.inputs.position_m = position_m;
            let before = play.chain.entered.state;
            let output = play.step();
            let allowed = match before {
                S::Idle => &[S::WaitingForRest][..],
                S::WaitingForRest => &[S::Averaging, S::Fault, S::Idle],
                S::Averaging => &[S::Matched, S::WaitingForRest, S::Fault, S::Idle],
                S::Matched => &[S::WaitingForRest],
                S::Fault => &[S::Idle],
            };
            prop_assert!(output.state == before || allowed.contains(&output.state), "{before} -> {}", output.state);
            prop_assert!(output.offset_m.abs() <= 5e-3);
            prop_assert_eq!(output.matched, output.state == S::Matched);
        }
    }
}
