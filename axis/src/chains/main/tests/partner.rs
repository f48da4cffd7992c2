//! Two main chains: a partner that is silent, late, slow, or begins anew, and the time-outs of each state.

use super::*;

/// Keeps an axis in a waiting state by taking what its condition needs.
fn hold(pair: &mut AxisPair, index: usize, state: S) {
    match state {
        S::Preparing => pair.axes[index].prepared = false,
        S::Settling | S::FinalSettling => {
            pair.axes[index].error = ControlError::Position { error_m: 0.1 };
        }
        _ => {}
    }
}

#[test]
fn a_partner_that_falls_silent_is_lost_after_a_hundred_cycles() {
    for state in RUNNING {
        let mut pair = both_in(state);
        let silent_from = pair.cycle;
        // Neither may go on in the meantime.
        hold(&mut pair, 0, state);
        pair.axes[1].alive = false;
        while pair.axes[0].state() != S::Fault {
            pair.step();
            assert!(pair.cycle < silent_from + 1000, "{state}");
        }
        assert_eq!(pair.faults()[0], Some(Fault::PartnerLost), "{state}");
        let cycles = pair.cycle - silent_from;
        assert!((100..=104).contains(&cycles), "{state}: {cycles}");
        pair.run(300);
        assert_eq!(pair.axes[0].stop_state(), EmergencyStopChainState::WaitingForRelease);
    }
}

#[test]
fn a_lost_partner_cannot_be_released_before_it_is_heard() {
    let mut pair = both_in(S::Experiment);
    pair.axes[1].received = false;
    pair.run(500);
    assert_eq!(pair.faults(), [Some(Fault::PartnerLost), None]);
    pair.console.release = true;
    pair.run(1000);
    assert_eq!(pair.axes[0].supervisory.stop.holds(), Some(Fault::PartnerLost));
    pair.axes[1].received = true;
    pair.run(1000);
    assert_eq!(pair.axes[0].supervisory.stop.holds(), Some(Fault::PartnerLost), "the release came too early");
    pair.console.release = true;
    pair.run(400);
    assert_eq!(pair.states(), [S::InitialPositioning; 2]);
}

#[test]
fn status_frames_may_be_lost_for_a_while() {
    let mut pair = AxisPair::new(&short());
    for round in 0..60 {
        pair.axes[round % 2].received = false;
        pair.run(90);
        pair.axes[round % 2].received = true;
        pair.run(10);
    }
    assert_eq!((pair.states(), pair.faults()), ([S::Done; 2], [None; 2]));
}

#[test]
fn a_partner_may_be_silent_when_done() {
    let mut pair = both_in(S::Done);
    pair.axes[1].alive = false;
    pair.run(1000);
    assert_eq!(pair.axes[0].state(), S::Done);
}

#[test]
fn a_partner_that_is_never_heard_is_missing_after_ten_seconds() {
    let mut pair = AxisPair::new(&short());
    pair.axes[1].alive = false;
    pair.run(10_001);
    assert_eq!(pair.axes[0].state(), S::WaitingForRig);
    pair.step();
    assert_eq!(pair.faults()[0], Some(Fault::PartnerMissing));
}

#[test]
fn a_partner_without_sensors_is_not_ok() {
    let mut pair = AxisPair::new(&short());
    pair.axes[1].sensors = false;
    pair.run(10_002);
    assert_eq!(pair.faults()[0], Some(Fault::PartnerNotOk));
}

#[test]
fn a_partner_with_another_experiment_is_named_so() {
    let mut pair = AxisPair::new(&short());
    pair.axes[1] = SimulatedAxis::new(MainConfig { experiment: 8, ..short() });
    pair.run(10_002);
    assert_eq!(pair.faults()[0], Some(Fault::PartnerOtherExperiment));
}

#[test]
fn a_partner_that_comes_late_is_waited_for() {
    let mut pair = AxisPair::new(&short());
    pair.axes[1].alive = false;
    pair.run(9000);
    pair.axes[1].alive = true;
    pair.run(5000);
    assert_eq!(pair.states(), [S::Done; 2]);
}

#[test]
fn a_partner_that_begins_anew_is_a_fault() {
    for state in RUNNING {
        let mut pair = both_in(state);
        hold(&mut pair, 0, state);
        pair.axes[1] = SimulatedAxis::new(short());
        pair.run(4);
        if state == S::InitialPositioning {
            assert_eq!(pair.states(), [state; 2], "it just began: the other joins");
            continue;
        }
        assert_eq!(pair.faults()[0], Some(Fault::PartnerRestarted), "{state}");
        pair.run(100);
        assert_eq!(pair.states(), [S::Fault, S::Aborted], "{state}");
    }
}

#[test]
fn an_axis_that_does_not_settle_ends_in_a_fault_of_that_name() {
    for (state, fault) in [
        (S::Preparing, Fault::PreparationTimeout),
        (S::Settling, Fault::SettlingTimeout),
        (S::FinalSettling, Fault::SettlingTimeout),
    ] {
        let mut pair = AxisPair::new(&short());
        pair.axes[1].prepared = true;
        if state == S::FinalSettling {
            pair.run_to(S::Experiment);
        }
        hold(&mut pair, 0, state);
        pair.run_to(state);
        let since = pair.cycle;
        pair.run_to(S::Fault);
        assert_eq!(pair.faults()[0], Some(fault));
        // 2 s beyond the 0.3 s that settling takes.
        let expected = if state == S::Preparing { 2000 } else { 2300 };
        let cycles = pair.cycle - since;
        assert!(cycles.abs_diff(expected) <= 2, "{state}: {cycles}");
        pair.run(3);
        assert_eq!(pair.states()[1], S::Aborted);
    }
}

#[test]
fn a_partner_that_does_not_get_ready_ends_in_a_fault_of_that_name() {
    // The partner's chain is held in each state by a length of its own that nobody knows of.
    let endless = 1e4;
    let slow = |state| match state {
        S::InitialPositioning => MainConfig { start_m: Some(0.1 + 0.1 * endless), ..short() },
        S::InitialForce => {
            MainConfig { lengths: Lengths { initial_force_s: endless, ..short().lengths }, ..short() }
        }
        S::Experiment => {
            MainConfig { lengths: Lengths { experiment_s: endless, ..short().lengths }, ..short() }
        }
        S::Preparing => MainConfig {
            prepares: true,
            lengths: Lengths { prepare_s: endless, ..short().lengths },
            ..short()
        },
        _ => MainConfig { settling_timeout_s: endless, ..short() },
    };
    for state in RUNNING {
        let mut pair = AxisPair::new(&short());
        pair.axes[1] = SimulatedAxis::new(slow(state));
        pair.axes[1].prepared = state != S::Preparing;
        if state == S::FinalSettling {
            pair.run_to(S::Experiment);
        }
        if matches!(state, S::Settling | S::FinalSettling) {
            hold(&mut pair, 1, state);
        }
        pair.run_to(state);
        let since = pair.cycle;
        pair.run_to(S::Fault);
        assert_eq!(pair.faults()[0], Some(Fault::PartnerNotOk), "{state}");
        let length_s = match state {
            S::InitialPositioning => short().approach_longest_s,
            S::Preparing => 0.0,
            S::InitialForce => 0.2,
            S::Experiment => 1.0,
            _ => 0.3,
        };
        let cycles = (pair.cycle - since) as f64 * 1e-3;
        assert!((cycles - length_s - 2.1).abs() < 0.01, "{state}: {cycles} s");
    }
}

#[test]
fn a_slow_partner_is_waited_for_when_its_length_is_known() {
    let long = Lengths { experiment_s: 6.0, ..short().lengths };
    let mut pair = AxisPair::new(&MainConfig { longest_lengths: long, ..short() });
    pair.axes[1] = SimulatedAxis::new(MainConfig { lengths: long, longest_lengths: long, ..short() });
    pair.run(9000);
    assert_eq!(pair.states(), [S::Done; 2]);
}

#[test]
fn two_axes_that_hunt_each_other_do_not_wait_for_ever() {
    let mut pair = AxisPair::new(&short());
    pair.run_to(S::Settling);
    for round in 0..10 {
        // Each is settled for a moment while the other is not.
        for index in [0, 1] {
            let error_m = if round % 2 == index { 0.1 } else { 0.0 };
            pair.axes[index].error = ControlError::Position { error_m };
        }
        pair.run(550);
    }
    assert!(pair.states().contains(&S::Fault), "{:?}", pair.states());
}

/// An aborted pair on the way back, whose second axis is held up for `cycles` by its sensors.
fn recovering_apart(cycles: u64) -> AxisPair {
    let mut pair = both_in(S::Experiment);
    pair.stop_and_release();
    pair.axes[1].sensors = false;
    pair.run_to(S::InitialPositioning);
    pair.run(cycles);
    assert_eq!(pair.states()[1], S::Aborted);
    pair.axes[1].sensors = true;
    pair
}

#[test]
fn a_partner_that_is_a_little_later_on_the_way_back_is_waited_for() {
    let mut pair = recovering_apart(90);
    pair.run(6000);
    assert_eq!(pair.states(), [S::Done; 2]);
}

#[test]
fn a_partner_that_stays_aborted_on_the_way_back_ends_it_until_a_person_starts() {
    let mut pair = recovering_apart(110);
    assert_eq!(pair.states(), [S::Aborted; 2]);
    assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::PartnerAborted);
    // The second still goes by itself, is left alone, and gives up too.
    pair.run(1000);
    assert_eq!(pair.states(), [S::Aborted; 2]);
    pair.console.start = true;
    pair.run(6000);
    assert_eq!(pair.states(), [S::Done; 2]);
}

#[test]
fn both_go_on_with_the_later_repetition() {
    let mut pair = AxisPair::new(&MainConfig { repetitions: Some(9), ..short() });
    pair.run_to(S::Experiment);
    pair.stop_and_release();
    for (index, repetition) in [(0, 6), (1, 7)] {
        pair.axes[index].supervisory.main.repetition = repetition;
    }
    pair.run(300);
    assert_eq!(pair.states(), [S::InitialPositioning; 2]);
    assert_eq!([0, 1].map(|index| pair.axes[index].output.unwrap().repetition), [7; 2]);
}

#[test]
fn nobody_goes_back_before_the_partner_has_ended_and_its_emergency_stop_chain_is_ready() {
    use EmergencyStopChainState as Stop;
    for (main_chain, emergency_stop_chain, state) in [
        (S::Aborted, Stop::Recovering, S::Aborted),
        (S::Aborted, Stop::WaitingForStart, S::Aborted),
        (S::Experiment, Stop::Ready, S::Aborted),
        (S::Aborted, Stop::Ready, S::InitialPositioning),
        (S::Fault, Stop::Ready, S::InitialPositioning),
    ] {
        let mut pair = both_in(S::Experiment);
        pair.console_holds = true;
        pair.step();
        let status = ChainStatus { main_chain, emergency_stop_chain, ..ChainStatus::default() };
        let output = pair.axes[0].supervisory.main.advance(&reported(pair.cycle, status));
        assert_eq!(output.state, state, "{main_chain} {emergency_stop_chain}");
    }
}

#[test]
fn a_partner_that_had_ended_before_ends_the_waiting_for_the_rig_too() {
    for (main_chain, cause) in [(S::Aborted, MainCause::PartnerAborted), (S::Fault, MainCause::PartnerFault)]
    {
        let mut chain = MainChain::new(short());
        for cycle in 0..102 {
            let status = ChainStatus { main_chain, ..ChainStatus::default() };
            let output = chain.advance(&reported(cycle, status));
            // A rig that began anew has both in waiting, and the last status may be of before.
            let expected = if cycle > 100 { S::Aborted } else { S::WaitingForRig };
            assert_eq!(output.state, expected, "cycle {cycle}");
        }
        assert_eq!(chain.entered.cause, cause);
    }
}
