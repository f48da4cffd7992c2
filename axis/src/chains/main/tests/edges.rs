//! The main chain with inputs by chance: which edges there are, and what is shut.

use super::*;
use proptest::prelude::*;

/// Where the diagram's edges lead, besides those from any state.
fn follows(from: S) -> &'static [S] {
    match from {
        S::WaitingForRig => &[S::InitialPositioning],
        S::InitialPositioning => &[S::Preparing],
        S::Preparing => &[S::InitialForce],
        S::InitialForce => &[S::Settling],
        S::Settling => &[S::Experiment],
        S::Experiment => &[S::FinalSettling],
        S::FinalSettling => &[S::InitialPositioning, S::Done],
        S::Done => &[],
        S::Aborted | S::Fault => &[S::InitialPositioning],
    }
}

prop_compose! {
    fn any_inputs()(
        cycles in prop_oneof![4 => 1_u64..30, 1 => 0_u64..3000],
        sensors in prop_oneof![9 => Just(true), 1 => Just(false)],
        position_m in prop_oneof![9 => Just(0.1), 1 => -1.0..1.0, 1 => Just(f64::NAN)],
        prepared: bool,
        partner in (0_u8..10, any::<bool>(), 0_u8..3, 0_u64..150, 0_u8..5),
        stop in prop_oneof![9 => Just(0_u8), 1 => 0_u8..5],
        console in 0_u8..60,
        fault in 0_usize..400,
    ) -> (u64, MainInputs) {
        let (state, ok, repetition, age, stop_chain) = partner;
        let status = ChainStatus {
            main_chain: S::from_raw(state).unwrap(),
            ok,
            repetition,
            emergency_stop_chain: EmergencyStopChainState::from_raw(stop_chain / 4).unwrap(),
            ..ChainStatus::default()
        };
        (cycles, MainInputs {
            cycle: 0,
            measurement: sensors.then_some(AxisMeasurement { position_m, error: ControlError::None }),
            prepared,
            partner: Partner { status: Some(status), values: None, received: Some(age) },
            emergency_stop: EmergencyStopChainState::from_raw(stop).unwrap(),
            console: Console { start: console < 10, abort: console == 10, release: false },
            fault: Fault::ALL.get(fault).copied(),
        })
    }
}

proptest! {
    #[test]
    fn whatever_comes_only_the_diagrams_edges_are_gone(
        row in prop::collection::vec(any_inputs(), 1..400),
        follow in any::<bool>(),
    ) {
        let mut chain = MainChain::new(MainConfig { repetitions: Some(2), ..short() });
        let (mut cycle, mut before) = (0, S::WaitingForRig);
        for (cycles, mut inputs) in row {
            cycle += cycles;
            inputs.cycle = cycle;
            inputs.partner.received = inputs.partner.received.map(|age| cycle.saturating_sub(age));
            if follow {
                // A partner that goes along gets further than chance does.
                let status = ChainStatus { main_chain: before, ok: true, repetition: 0, ..ChainStatus::default() };
                inputs.partner.status = Some(status);
            }
            let output = chain.advance(&inputs);
            let shut = matches!(output.state, S::WaitingForRig | S::Aborted | S::Fault);
            prop_assert_eq!(output.phase == Phase::Shut, shut);
            prop_assert_eq!(output.fault.is_some(), output.state == S::Fault);
            if matches!(output.state, S::Aborted | S::Fault) {
                prop_assert!(!output.ok);
            }
            if inputs.emergency_stop != EmergencyStopChainState::Ready || inputs.console.abort || inputs.fault.is_some() {
                prop_assert!(matches!(output.state, S::Aborted | S::Fault));
            }
            let allowed = output.state == before
                || follows(before).contains(&output.state)
                || (output.state == S::Aborted && before != S::Fault)
                || output.state == S::Fault;
            prop_assert!(allowed, "{before} -> {}", output.state);
            before = output.state;
        }
    }
}
