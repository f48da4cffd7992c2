//! Tests of the force chain: its edges, its times, and what it asks for.

use super::*;
use crate::chains::until_another;
use ForceChainState as S;
use proptest::prelude::*;

struct ChainBench {
    chain: ForceChain,
    inputs: ForceInputs,
    values: Vec<f64>,
}

impl ChainBench {
    fn new(request: ForceRequest) -> Self {
        let inputs = ForceInputs { request, ..ForceInputs::default() };
        let values = Parameters::TABLE.iter().map(|parameter| parameter.default).collect();
        Self { chain: ForceChain::default(), inputs, values }
    }

    fn step(&mut self) -> ForceOutput {
        self.inputs.cycle += 1;
        self.chain.advance(&self.inputs, &self.values)
    }

    /// Cycles until another state, and that state; after 100 s the same one.
    fn next(&mut self) -> (u64, S) {
        until_another(self.chain.entered.state, || self.step().state)
    }

    /// A chain in a state of manual mode.
    fn to(state: S) -> Self {
        let mut bench = Self::new(ForceRequest::Manual);
        bench.inputs.force_n = 50.0;
        bench.next();
        while bench.chain.entered.state != state {
            bench.inputs.velocity_m_per_s = if state == S::Moving { 0.1 } else { 0.0 };
            bench.next();
        }
        bench
    }
}

#[test]
fn a_high_force_limits_the_velocity_at_first() {
    let mut bench = ChainBench::new(ForceRequest::Manual);
    bench.inputs.force_n = -81.0;
    let output = bench.step();
    assert_eq!((output.state, output.limit_m_per_s), (S::Limited, Some(0.02)));
    assert!(!output.feed_forward && !output.dead_zone);
    assert_eq!(bench.next(), (100_000, S::Limited));
    bench.inputs.force_n = -79.0;
    // The first low sample, and 50 ms.
    assert_eq!(bench.next(), (51, S::Standstill));
    bench.inputs.force_n = 1000.0;
    assert_eq!(bench.next(), (100_000, S::Standstill), "only at first");
}

#[test]
fn a_force_that_is_low_for_a_moment_stays_limited() {
    let mut bench = ChainBench::new(ForceRequest::Manual);
    for cycle in 0..1000 {
        bench.inputs.force_n = if cycle % 50 == 0 { 81.0 } else { 0.0 };
        assert_eq!(bench.step().state, S::Limited);
    }
}

#[test]
fn significant_movement_has_a_hysteresis_in_velocity_and_time() {
    let mut bench = ChainBench::to(S::Standstill);
    bench.inputs.velocity_m_per_s = 0.0099;
    assert_eq!(bench.next(), (100_000, S::Standstill));
    bench.inputs.velocity_m_per_s = -0.0101;
    assert_eq!(bench.next(), (21, S::Moving));
    bench.inputs.velocity_m_per_s = -0.0051;
    assert_eq!(bench.next(), (100_000, S::Moving));
    // The mean velocity of 5.1 mm/s comes to 5 mm/s within 150 ms ln(5.1/5) = 3 ms at rest, and stays for 100 ms.
    bench.inputs.velocity_m_per_s = 0.0;
    let (cycles, state) = bench.next();
    assert!((101..110).contains(&cycles) && state == S::Standstill, "{cycles} {state}");
}

#[test]
fn a_rod_that_bounces_within_the_gap_goes_nowhere() {
    let mut bench = ChainBench::to(S::Moving);
    // 10 mm/s to and fro, 40 ms each way: 0.4 mm, twice the gap.
    let still = (0..2000_u64).any(|cycle| {
        bench.inputs.velocity_m_per_s = if cycle % 80 < 40 { 0.01 } else { -0.01 };
        bench.step().state == S::Standstill
    });
    assert!(still);
}

#[test]
fn noise_of_the_velocity_moves_nothing() {
    let mut bench = ChainBench::to(S::Standstill);
    for cycle in 0..1000 {
        bench.inputs.velocity_m_per_s = if cycle % 20 == 0 { 0.0 } else { 0.02 };
        assert_eq!(bench.step().state, S::Standstill);
    }
}

#[test]
fn the_case_distinction_is_feed_forward_or_a_dead_zone() {
    for (state, feed_forward, dead_zone) in [(S::Standstill, false, true), (S::Moving, true, false)] {
        let output = ChainBench::to(state).step();
        assert_eq!((output.feed_forward, output.dead_zone), (feed_forward, dead_zone), "{state}");
        assert_eq!((output.limit_m_per_s, output.set_force_n), (None, Some(0.0)));
    }
}

#[test]
fn a_low_mean_force_at_standstill_is_relieved() {
    let mut bench = ChainBench::new(ForceRequest::Relieve);
    bench.inputs.force_n = 19.0;
    assert_eq!(bench.next().1, S::Limited);
    assert_eq!(bench.next().1, S::Standstill);
    assert_eq!(bench.next(), (301, S::Done));
    let output = bench.step();
    assert!(output.relieved && output.dead_zone && !output.feed_forward);
    assert_eq!(output.set_force_n, Some(0.0));
}

#[test]
fn a_force_that_swings_is_not_relieved() {
    let mut bench = ChainBench::new(ForceRequest::Relieve);
    for cycle in 0..7000_u64 {
        // A swing of 200 ms, which a mean over 50 ms still shows.
        bench.inputs.force_n = if cycle % 200 < 100 { 70.0 } else { -70.0 };
        bench.step();
    }
    assert_eq!(bench.chain.entered.state, S::Standstill);
}

#[test]
fn manual_mode_is_never_done() {
    let mut bench = ChainBench::to(S::Standstill);
    bench.inputs.force_n = 0.0;
    assert_eq!(bench.next(), (100_000, S::Standstill));
}

#[test]
fn a_relief_that_takes_too_long_is_a_fault_from_each_state() {
    for (force_n, velocity_m_per_s, last) in
        [(500.0, 0.0, S::Limited), (70.0, 0.0, S::Standstill), (70.0, 0.1, S::Moving)]
    {
        let mut bench = ChainBench::new(ForceRequest::Relieve);
        (bench.inputs.force_n, bench.inputs.velocity_m_per_s) = (force_n, velocity_m_per_s);
        let mut before = S::Idle;
        while bench.chain.entered.state != S::Fault {
            before = bench.chain.entered.state;
            bench.next();
        }
        assert_eq!(before, last);
        assert_eq!(bench.step().fault, Some(Fault::RelieveTimeout));
        let cycles = bench.chain.entered.cycle;
        let timeout = super::cycles(Parameters::default().relieve_timeout_s);
        assert!((timeout..=timeout + 3).contains(&cycles), "{last}: {cycles}");
        bench.inputs.request = ForceRequest::Manual;
        assert_eq!(bench.step().state, S::Fault);
        bench.inputs.request = ForceRequest::Idle;
        assert_eq!(bench.step().state, S::Idle);
    }
}

#[test]
fn what_is_asked_names_the_rest_from_everywhere() {
    let asks = [
        (ForceRequest::Idle, S::Idle),
        (ForceRequest::InitialRamp, S::InitialRamp),
        (ForceRequest::LoadProfile, S::LoadProfile),
        (ForceRequest::Done, S::Done),
        (ForceRequest::Relieve, S::Limited),
        (ForceRequest::Manual, S::Limited),
    ];
    for (first, _) in asks {
        for (request, state) in asks {
            let mut bench = ChainBench::new(first);
            for _ in 0..200 {
                bench.step();
            }
            bench.inputs.request = request;
            let output = bench.step();
            if first != request {
                assert_eq!(output.state, state, "{first:?} {request:?}");
                assert_eq!(output.set_force_n.is_some(), state == S::Limited);
                assert!(!output.relieved);
            }
        }
    }
}

#[test]
fn parameters_act_at_once() {
    let mut bench = ChainBench::to(S::Standstill);
    bench.inputs.velocity_m_per_s = 0.005;
    bench.step();
    bench.values[3] = 0.004;
    assert_eq!(bench.next(), (21, S::Moving));
}

#[test]
fn skipped_cycles_pass() {
    let mut bench = ChainBench::to(S::Standstill);
    bench.inputs.velocity_m_per_s = 0.1;
    bench.step();
    bench.inputs.cycle += 19;
    assert_eq!(bench.step().state, S::Moving);
}

#[test]
fn a_new_rig_makes_idle() {
    let mut bench = ChainBench::to(S::Moving);
    bench.chain.restart(7);
    assert_eq!(bench.chain.entered, StateEntry { cycle: 7, state: S::Idle, cause: ForceCause::Began });
    bench.inputs.cycle = 7;
    assert_eq!(bench.step().state, S::Limited, "what is asked is asked anew");
}

#[test]
fn the_defaults_lie_in_their_ranges() {
    for parameter in Parameters::TABLE {
        assert_eq!(parameter.check(parameter.default), Ok(parameter.default), "{}", parameter.name);
    }
}

proptest! {
    #[test]
    fn whatever_comes_feed_forward_and_dead_zone_exclude_each_other(
        row in prop::collection::vec(
            (1_u64..40, 0_u8..60, prop_oneof![-300.0..300.0, Just(f64::NAN)], prop_oneof![-0.02..0.02, Just(f64::NAN)]),
            1..400,
        ),
    ) {
        let mut bench = ChainBench::new(ForceRequest::Relieve);
        for (cycles, request, force_n, velocity_m_per_s) in row {
            bench.inputs.cycle += cycles;
            bench.inputs.force_n = force_n;
            bench.inputs.velocity_m_per_s = velocity_m_per_s;
            bench.inputs.request = match request {
                0 => ForceRequest::Idle,
                1 => ForceRequest::InitialRamp,
                2 => ForceRequest::LoadProfile,
                3 => ForceRequest::Done,
                4 => ForceRequest::Manual,
                5 => ForceRequest::Relieve,
                _ => bench.inputs.request,
            };
            let before = bench.chain.entered.state;
            let output = bench.step();
            prop_assert!(!(output.feed_forward && output.dead_zone));
            prop_assert_eq!(output.limit_m_per_s.is_some(), output.state == S::Limited);
            prop_assert_eq!(output.fault.is_some(), output.state == S::Fault);
            let by_itself = match before {
                S::Limited => &[S::Standstill, S::Fault][..],
                S::Standstill => &[S::Moving, S::Done, S::Fault],
                S::Moving => &[S::Standstill, S::Fault],
                _ => &[],
            };
            let cause = bench.chain.entered.cause;
            let same = output.state == before;
            let allowed = same || by_itself.contains(&output.state) || matches!(cause, ForceCause::Requested(_));
            prop_assert!(allowed, "{before} -> {}", output.state);
        }
    }
}
