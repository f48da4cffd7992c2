//! Tests of the matching chain: its edges, its average, and what breaks it off.

use super::*;
use crate::chains::until_another;
use MatchingChainState as S;
use proptest::prelude::*;
use protocol::frames::{ChainStatus, ChainValues};

const OFFSET_M: f64 = 0.8e-3;

struct ChainBench {
    chain: MatchingChain,
    inputs: MatchingInputs,
    values: Vec<f64>,
    drive_m: f64,
    received: bool,
}

impl ChainBench {
    fn new() -> Self {
        let inputs = MatchingInputs {
            requested: true,
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
        let mut bench = Self::new();
        while bench.chain.entered.state != state {
            bench.next();
        }
        bench
    }
}

#[test]
fn linked_axes_at_rest_are_matched() {
    let mut bench = ChainBench::new();
    assert_eq!(bench.next(), (1, S::WaitingForRest));
    assert_eq!(bench.next(), (200, S::Averaging));
    assert_eq!(bench.next(), (500, S::Matched));
    let output = bench.step();
    assert!(output.matched && (output.offset_m - OFFSET_M).abs() < 1e-12, "{output:?}");
}

#[test]
fn noise_is_averaged_away() {
    let mut bench = ChainBench::to(S::Averaging);
    for cycle in 0..500_u64 {
        bench.inputs.position_m = 0.1 + OFFSET_M + if cycle.is_multiple_of(2) { 1e-4 } else { -1e-4 };
        bench.drive_m = 0.1 + if (cycle / 10).is_multiple_of(2) { 5e-5 } else { -5e-5 };
        bench.step();
    }
    let output = bench.step();
    assert!(output.matched && (output.offset_m - OFFSET_M).abs() < 5e-6, "{output:?}");
}

#[test]
fn nothing_is_averaged_before_rest_and_linkage() {
    let cases: [fn(&mut ChainBench); 4] = [
        |bench| bench.inputs.linked = false,
        |bench| bench.inputs.still = false,
        |bench| bench.received = false,
        |bench| bench.drive_m += 1e-4,
    ];
    for disturb in cases {
        let mut bench = ChainBench::new();
        bench.step();
        for _ in 0..10_000 {
            disturb(&mut bench);
            assert_eq!(bench.step().state, S::WaitingForRest);
        }
        disturb(&mut bench);
        assert_eq!(bench.step().fault, Some(Fault::MatchingTimeout), "10 s are over");
        assert_eq!(bench.chain.entered.cycle, 10_002);
    }
}

#[test]
fn what_moves_while_averaging_breaks_it_off() {
    type Disturbance = fn(&mut ChainBench);
    let cases: [(Disturbance, MatchingCause, u64); 5] = [
        (|bench| bench.inputs.linked = false, MatchingCause::NotLinked, 1),
        (|bench| bench.inputs.position_m += 0.31e-3, MatchingCause::Moved, 1),
        (|bench| bench.drive_m += 0.31e-3, MatchingCause::Moved, 20),
        (|bench| bench.received = false, MatchingCause::Silent, 101),
        (|bench| bench.inputs.position_m = f64::NAN, MatchingCause::Moved, 1),
    ];
    for (disturb, cause, within) in cases {
        let mut bench = ChainBench::to(S::Averaging);
        for _ in 0..50 {
            bench.step();
        }
        disturb(&mut bench);
        let (cycles, state) = bench.next();
        assert_eq!((state, bench.chain.entered.cause), (S::WaitingForRest, cause));
        assert!(cycles <= within, "{cause:?}: {cycles}");
    }
}

#[test]
fn averaging_that_is_broken_off_again_and_again_ends() {
    let mut bench = ChainBench::new();
    for cycle in 0..11_000 {
        if cycle % 600 == 0 {
            bench.inputs.position_m += 1e-3;
        }
        bench.step();
    }
    assert_eq!(bench.step().fault, Some(Fault::MatchingTimeout));
}

#[test]
fn averaging_that_is_longer_than_the_time_out_ends_too() {
    let mut bench = ChainBench::new();
    bench.values[0] = 60.0;
    bench.next();
    assert_eq!([bench.next().1, bench.next().1], [S::Averaging, S::Fault]);
}

#[test]
fn an_offset_that_no_sensor_has_is_a_fault() {
    for (offset_m, state) in [(5.1e-3, S::Fault), (-5.1e-3, S::Fault), (4.9e-3, S::Matched)] {
        let mut bench = ChainBench::new();
        bench.inputs.position_m = 0.1 + offset_m;
        let last = [bench.next().1, bench.next().1, bench.next().1][2];
        assert_eq!(last, state);
        let output = bench.step();
        assert_eq!(output.fault, (state == S::Fault).then_some(Fault::OffsetImplausible));
        assert_eq!(output.offset_m != 0.0, state == S::Matched, "an implausible offset is not used");
    }
}

#[test]
fn a_matched_offset_holds_until_the_next() {
    let mut bench = ChainBench::to(S::Matched);
    bench.inputs.requested = false;
    bench.inputs.linked = false;
    assert_eq!(bench.next(), (100_000, S::Matched));
    bench.inputs.linked = true;
    bench.inputs.requested = true;
    bench.inputs.position_m += 1e-3;
    assert_eq!(bench.next(), (1, S::WaitingForRest));
    assert!((bench.step().offset_m - OFFSET_M).abs() < 1e-12);
    assert_eq!([bench.next().1, bench.next().1], [S::Averaging, S::Matched]);
    assert!((bench.step().offset_m - OFFSET_M - 1e-3).abs() < 1e-12);
}

#[test]
fn what_is_no_longer_asked_is_given_up() {
    for state in [S::WaitingForRest, S::Averaging] {
        let mut bench = ChainBench::to(state);
        bench.inputs.requested = false;
        assert_eq!((bench.step().state, bench.chain.entered.cause), (S::Idle, MatchingCause::NotRequested));
    }
    let mut bench = ChainBench::new();
    bench.inputs.linked = false;
    while bench.chain.entered.state != S::Fault {
        bench.next();
    }
    assert_eq!(bench.next().1, S::Fault);
    bench.inputs.requested = false;
    assert_eq!(bench.step().state, S::Idle);
}

#[test]
fn a_new_rig_has_no_offset() {
    let mut bench = ChainBench::to(S::Matched);
    bench.chain.restart(3);
    bench.inputs.requested = false;
    let output = bench.step();
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
        let mut bench = ChainBench::new();
        for (cycles, [still, received], rare, position_m) in row {
            bench.inputs.cycle += cycles;
            bench.inputs.requested = rare != 0;
            bench.inputs.linked = rare != 1;
            bench.inputs.still = still || rare > 3;
            bench.received = received;
            bench.inputs.position_m = position_m;
            let before = bench.chain.entered.state;
            let output = bench.step();
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
