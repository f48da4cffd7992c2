//! Tests of the main chain alone, and of two that talk to each other.

use super::*;
use crate::chains::duo::{Duo, One, short};
use crate::chains::settled::ControlError;
use crate::chains::{AfterStop, Console, Partner};
use MainChainState as S;
use proptest::prelude::*;
use protocol::frames::ChainStatus;

const RUNNING: [S; 6] =
    [S::InitialPositioning, S::Preparing, S::InitialForce, S::Settling, S::Experiment, S::FinalSettling];

fn alone(config: MainConfig) -> Duo {
    let mut duo = Duo::new(&MainConfig { partner_needed: false, ..config });
    duo.axes[1].alive = false;
    duo
}

fn order(one: &One) -> Vec<S> {
    one.seen.iter().map(|(_, state)| *state).collect()
}

/// Two in `state`, on the way through one repetition.
fn both_in(state: S) -> Duo {
    let mut duo = Duo::new(&short());
    // Without a step to take, preparing is over at once.
    duo.axes.iter_mut().for_each(|axis| axis.prepared = state != S::Preparing);
    duo.run_to(state);
    duo.run(20);
    assert_eq!(duo.states(), [state; 2], "{:?}", duo.axes[0].seen);
    duo
}

/// Keeps both in a waiting state by taking what the first axis's condition needs.
fn hold(duo: &mut Duo, index: usize, state: S) {
    match state {
        S::Preparing => duo.axes[index].prepared = false,
        S::Settling | S::FinalSettling => {
            duo.axes[index].error = ControlError::Position { error_m: 0.1 };
        }
        _ => {}
    }
}

#[test]
fn alone_the_chain_goes_from_the_rig_to_done() {
    let mut duo = alone(short());
    duo.run(3000);
    let seen = &duo.axes[0].seen;
    let expected = [S::InitialPositioning, S::Preparing, S::InitialForce, S::Settling, S::Experiment];
    assert_eq!(order(&duo.axes[0]), [&expected[..], &[S::FinalSettling, S::Done]].concat());
    // 0.5 s, 1 cycle, 0.2 s, 0.3 s, 1 s, 0.3 s.
    let times: Vec<u64> = seen.iter().map(|(cycle, _)| *cycle).collect();
    assert_eq!(times, [0, 500, 501, 701, 1001, 2001, 2301]);
}

#[test]
fn two_chains_go_together_and_never_stand_more_than_a_cycle_apart() {
    let mut duo = Duo::new(&short());
    // One is slower everywhere.
    duo.axes[1].position_m = 0.2;
    duo.run(4000);
    assert_eq!(duo.states(), [S::Done; 2]);
    let [first, second] = &duo.axes;
    assert_eq!(order(first), order(second));
    for (a, b) in first.seen.iter().zip(&second.seen) {
        assert!(a.0.abs_diff(b.0) <= 1, "{a:?} {b:?}");
    }
    // The way of 0.1 m takes 1 s, for both.
    assert!(first.seen[2].0 >= 1000, "{:?}", first.seen);
}

#[test]
fn the_approach_begins_where_the_carriage_is() {
    let mut duo = alone(short());
    duo.axes[0].position_m = 0.33;
    duo.step();
    let Phase::Approach { elapsed_s, from_m, duration_s } = duo.axes[0].output.unwrap().phase else {
        panic!("{:?}", duo.axes[0].output)
    };
    assert_eq!((elapsed_s, from_m), (0.0, 0.33));
    assert!((duration_s - 2.3).abs() < 1e-9, "0.23 m at 0.1 m/s, not {duration_s} s");
}

#[test]
fn an_axis_that_is_not_positioned_is_ready_at_once() {
    let mut duo = alone(MainConfig { start_m: None, ..short() });
    duo.run(2);
    assert_eq!(duo.axes[0].state(), S::Preparing);
}

#[test]
fn each_phase_belongs_to_its_state() {
    let mut duo = alone(short());
    duo.axes[0].prepared = false;
    let mut seen = vec![];
    for cycle in 0..4000 {
        duo.axes[0].prepared = cycle > 700;
        duo.step();
        let output = duo.axes[0].output.unwrap();
        let expected = match output.phase {
            Phase::Shut => [S::WaitingForRig; 2],
            Phase::Approach { .. } => [S::InitialPositioning; 2],
            Phase::Prepare { .. } => [S::Preparing; 2],
            Phase::RampForce { .. } => [S::InitialForce; 2],
            Phase::HoldStart => [S::Settling; 2],
            Phase::Experiment { .. } => [S::Experiment; 2],
            Phase::HoldEnd => [S::FinalSettling, S::Done],
        };
        assert!(expected.contains(&output.state), "{output:?}");
        seen.push(output.state);
    }
    assert_eq!(*seen.last().unwrap(), S::Done);
}

#[test]
fn the_experiments_time_begins_at_zero() {
    let mut duo = alone(short());
    duo.run_to(S::Experiment);
    assert_eq!(duo.axes[0].output.unwrap().phase, Phase::Experiment { elapsed_s: 0.0 });
    duo.run(250);
    assert_eq!(duo.axes[0].output.unwrap().phase, Phase::Experiment { elapsed_s: 0.25 });
}

#[test]
fn repetitions_begin_with_the_initial_positioning() {
    let mut duo = Duo::new(&MainConfig { repetitions: Some(3), ..short() });
    duo.run(9000);
    let seen = order(&duo.axes[0]);
    assert_eq!(seen.iter().filter(|state| **state == S::InitialPositioning).count(), 3);
    assert_eq!((duo.states(), duo.axes[0].output.unwrap().repetition), ([S::Done; 2], 2));
}

#[test]
fn forever_goes_past_the_wrap_of_the_repetition() {
    let tiny = Lengths { experiment_s: 0.01, ..Lengths::default() };
    let config =
        MainConfig { repetitions: None, own: tiny, either: tiny, settling_s: 0.0, start_m: None, ..short() };
    let mut duo = Duo::new(&config);
    duo.run(20_000);
    let repetition = duo.axes[0].output.unwrap().repetition;
    assert!(repetition > 300, "{repetition}");
    assert_eq!(duo.faults(), [None; 2]);
}

#[test]
fn skipped_cycles_pass_for_the_experiment_too() {
    let mut duo = alone(short());
    duo.run_to(S::Experiment);
    duo.cycle += 999;
    duo.run(2);
    assert_eq!(duo.axes[0].state(), S::FinalSettling);
}

#[test]
fn on_start_waits_in_settling_without_a_time_out() {
    let mut duo = Duo::new(&MainConfig { start: Start::OnStart, repetitions: Some(2), ..short() });
    duo.run(30_000);
    assert_eq!(duo.states(), [S::Settling; 2]);
    duo.console.start = true;
    duo.run(20);
    assert_eq!(duo.states(), [S::Experiment; 2]);
    duo.run(6000);
    assert_eq!(duo.states(), [S::Done; 2], "one start is for all repetitions");
}

#[test]
fn a_start_before_settling_is_none() {
    let mut duo = Duo::new(&MainConfig { start: Start::OnStart, ..short() });
    duo.run(100);
    duo.console.start = true;
    duo.run(5000);
    assert_eq!(duo.states(), [S::Settling; 2]);
}

#[test]
fn a_start_that_only_one_heard_travels_by_the_ok_flag() {
    let mut duo = Duo::new(&MainConfig { start: Start::OnStart, ..short() });
    duo.run(3000);
    duo.axes[1].main.advance(&MainInputs {
        cycle: duo.cycle,
        own: Some(OwnAxis { position_m: 0.1, error: ControlError::None }),
        partner: Partner {
            status: Some(ChainStatus { main_chain: S::Settling, ..ChainStatus::default() }),
            values: None,
            heard: Some(duo.cycle),
        },
        console: Console { start: true, ..Console::default() },
        ..MainInputs::default()
    });
    duo.run(10);
    assert_eq!(duo.states(), [S::Experiment; 2]);
}

#[test]
fn an_abort_ends_every_state_and_does_not_trip() {
    for state in RUNNING {
        let mut duo = both_in(state);
        duo.console.abort = true;
        duo.step();
        assert_eq!(duo.states(), [S::Aborted; 2], "{state}");
        assert_eq!(duo.axes[0].output.unwrap().phase, Phase::Shut);
        assert_eq!(duo.axes[0].main.entered().cause, MainCause::Console);
        duo.run(5000);
        assert_eq!(duo.states(), [S::Aborted; 2], "a person's abort is not undone by itself");
        assert_eq!(duo.axes[0].stop_state(), EmergencyStopChainState::Ready);
        duo.console.start = true;
        duo.run(10);
        assert_eq!(duo.states(), [S::InitialPositioning; 2]);
        assert_eq!(duo.axes[0].main.entered().cause, MainCause::Started);
    }
}

#[test]
fn an_abort_that_only_one_heard_ends_both() {
    for state in RUNNING {
        let mut duo = both_in(state);
        duo.axes[1]
            .main
            .enter_aborted(MainCause::Console, &MainInputs { cycle: duo.cycle, ..Default::default() });
        // Within the grace of a start it waits for a partner that is still aborted.
        duo.run(if state == S::InitialPositioning { 100 } else { 2 });
        assert_eq!(duo.states(), [S::Aborted; 2], "{state}");
        assert_eq!(duo.axes[0].main.entered().cause, MainCause::PartnerAborted);
    }
}

#[test]
fn waiting_and_done_can_be_aborted_too() {
    let mut duo = Duo::new(&short());
    duo.axes[0].sensors = false;
    duo.run(10);
    assert_eq!(duo.axes[0].state(), S::WaitingForRig);
    duo.console.abort = true;
    duo.step();
    assert_eq!(duo.axes[0].state(), S::Aborted);

    let mut duo = both_in(S::Done);
    duo.console.abort = true;
    duo.step();
    assert_eq!(duo.states(), [S::Aborted; 2]);
}

#[test]
fn an_emergency_stop_aborts_every_state_and_the_run_begins_again_by_itself() {
    for state in RUNNING.into_iter().chain([S::Done]) {
        let mut duo = both_in(state);
        duo.console_holds = true;
        duo.step();
        assert_eq!(duo.states(), [S::Aborted; 2], "{state}");
        assert_eq!(duo.axes[0].main.entered().cause, MainCause::EmergencyStop);
        duo.axes.iter_mut().for_each(|axis| (axis.position_m, axis.prepared) = (0.15, true));
        duo.stop_and_release();
        assert_eq!(duo.states(), [S::Aborted; 2]);
        // Recovered for 0.2 s.
        duo.run(210);
        assert_eq!(duo.states(), [S::InitialPositioning; 2], "{state}");
        assert_eq!(duo.axes[0].main.entered().cause, MainCause::Recovered);
        let phase = duo.axes[0].output.unwrap().phase;
        assert!(matches!(phase, Phase::Approach { from_m: 0.15, .. }), "{phase:?}");
        duo.run(6000);
        assert_eq!(duo.states(), [S::Done; 2], "{state}");
    }
}

#[test]
fn after_an_emergency_stop_the_end_is_the_end() {
    let mut duo = Duo::new(&MainConfig { after_emergency_stop: AfterStop::End, ..short() });
    duo.run_to(S::Experiment);
    duo.stop_and_release();
    for _ in 0..20 {
        duo.console.start = true;
        duo.run(200);
        assert_eq!(duo.states(), [S::Aborted; 2]);
    }
}

#[test]
fn after_an_emergency_stop_a_person_may_be_asked() {
    let mut duo = Duo::new(&MainConfig { after_emergency_stop: AfterStop::OnStart, ..short() });
    duo.run_to(S::Experiment);
    duo.stop_and_release();
    duo.run(5000);
    assert_eq!(duo.states(), [S::Aborted; 2]);
    assert_eq!(duo.axes[0].stop_state(), EmergencyStopChainState::WaitingForStart);
    duo.console.start = true;
    duo.run(10);
    assert_eq!(duo.states(), [S::InitialPositioning; 2]);
}

#[test]
fn the_cut_off_repetition_is_repeated() {
    let mut duo = Duo::new(&MainConfig { repetitions: Some(3), ..short() });
    duo.run_to(S::FinalSettling);
    duo.run(1000);
    assert_eq!(duo.axes[0].output.unwrap().repetition, 1);
    duo.stop_and_release();
    duo.run(300);
    assert_eq!((duo.states(), duo.axes[1].output.unwrap().repetition), ([S::InitialPositioning; 2], 1));
}

#[test]
fn a_person_who_aborts_during_an_emergency_stop_is_obeyed() {
    let mut duo = both_in(S::Experiment);
    duo.console_holds = true;
    duo.run(200);
    duo.console.abort = true;
    duo.stop_and_release();
    duo.run(5000);
    assert_eq!(duo.states(), [S::Aborted; 2]);
}

#[test]
fn a_fault_of_the_axis_ends_every_state_and_trips() {
    for state in RUNNING.into_iter().chain([S::Done]) {
        let mut duo = both_in(state);
        duo.axes[0].fault = Some(Fault::LimitExceeded);
        duo.step();
        assert_eq!(duo.faults()[0], Some(Fault::LimitExceeded), "{state}");
        assert_eq!(duo.axes[0].output.unwrap().phase, Phase::Shut);
        duo.step();
        assert_eq!(duo.states(), [S::Fault, S::Aborted], "the partner is stopped in the next cycle");
        assert_eq!(duo.axes[0].stop.holds(), Some(Fault::LimitExceeded));
        duo.run(5000);
        assert_eq!(duo.states(), [S::Fault, S::Aborted], "nobody has released");
        duo.axes[0].fault = None;
        duo.console.release = true;
        duo.run(300);
        assert_eq!(duo.states(), [S::InitialPositioning; 2], "{state}");
    }
}

#[test]
fn a_partner_that_falls_silent_is_lost_after_a_hundred_cycles() {
    for state in RUNNING {
        let mut duo = both_in(state);
        let silent_from = duo.cycle;
        // Neither may go on in the meantime.
        hold(&mut duo, 0, state);
        duo.axes[1].alive = false;
        while duo.axes[0].state() != S::Fault {
            duo.step();
            assert!(duo.cycle < silent_from + 1000, "{state}");
        }
        assert_eq!(duo.faults()[0], Some(Fault::PartnerLost), "{state}");
        let cycles = duo.cycle - silent_from;
        assert!((100..=104).contains(&cycles), "{state}: {cycles}");
        duo.run(300);
        assert_eq!(duo.axes[0].stop_state(), EmergencyStopChainState::WaitingForRelease);
    }
}

#[test]
fn a_lost_partner_cannot_be_released_before_it_is_heard() {
    let mut duo = both_in(S::Experiment);
    duo.axes[1].heard = false;
    duo.run(500);
    assert_eq!(duo.faults(), [Some(Fault::PartnerLost), None]);
    duo.console.release = true;
    duo.run(1000);
    assert_eq!(duo.axes[0].stop.holds(), Some(Fault::PartnerLost));
    duo.axes[1].heard = true;
    duo.run(1000);
    assert_eq!(duo.axes[0].stop.holds(), Some(Fault::PartnerLost), "the release came too early");
    duo.console.release = true;
    duo.run(400);
    assert_eq!(duo.states(), [S::InitialPositioning; 2]);
}

#[test]
fn status_frames_may_be_lost_for_a_while() {
    let mut duo = Duo::new(&short());
    for round in 0..60 {
        duo.axes[round % 2].heard = false;
        duo.run(90);
        duo.axes[round % 2].heard = true;
        duo.run(10);
    }
    assert_eq!((duo.states(), duo.faults()), ([S::Done; 2], [None; 2]));
}

#[test]
fn a_partner_may_be_silent_when_done() {
    let mut duo = both_in(S::Done);
    duo.axes[1].alive = false;
    duo.run(1000);
    assert_eq!(duo.axes[0].state(), S::Done);
}

#[test]
fn a_partner_that_is_never_heard_is_missing_after_ten_seconds() {
    let mut duo = Duo::new(&short());
    duo.axes[1].alive = false;
    duo.run(10_001);
    assert_eq!(duo.axes[0].state(), S::WaitingForRig);
    duo.step();
    assert_eq!(duo.faults()[0], Some(Fault::PartnerMissing));
}

#[test]
fn a_partner_without_sensors_is_not_ok() {
    let mut duo = Duo::new(&short());
    duo.axes[1].sensors = false;
    duo.run(10_002);
    assert_eq!(duo.faults()[0], Some(Fault::PartnerNotOk));
}

#[test]
fn a_partner_with_another_experiment_is_named_so() {
    let mut duo = Duo::new(&short());
    duo.axes[1] = One::new(MainConfig { experiment: 8, ..short() });
    duo.run(10_002);
    assert_eq!(duo.faults()[0], Some(Fault::PartnerOtherExperiment));
}

#[test]
fn a_partner_that_comes_late_is_waited_for() {
    let mut duo = Duo::new(&short());
    duo.axes[1].alive = false;
    duo.run(9000);
    duo.axes[1].alive = true;
    duo.run(5000);
    assert_eq!(duo.states(), [S::Done; 2]);
}

#[test]
fn a_partner_that_begins_anew_is_a_fault() {
    for state in RUNNING {
        let mut duo = both_in(state);
        hold(&mut duo, 0, state);
        duo.axes[1] = One::new(short());
        duo.run(4);
        if state == S::InitialPositioning {
            assert_eq!(duo.states(), [state; 2], "it just began: the other joins");
            continue;
        }
        assert_eq!(duo.faults()[0], Some(Fault::PartnerRestarted), "{state}");
        duo.run(100);
        assert_eq!(duo.states(), [S::Fault, S::Aborted], "{state}");
    }
}

#[test]
fn an_axis_that_does_not_settle_ends_in_a_fault_of_that_name() {
    for (state, fault) in [
        (S::Preparing, Fault::PreparationTimeout),
        (S::Settling, Fault::SettlingTimeout),
        (S::FinalSettling, Fault::SettlingTimeout),
    ] {
        let mut duo = Duo::new(&short());
        duo.axes[1].prepared = true;
        if state == S::FinalSettling {
            duo.run_to(S::Experiment);
        }
        hold(&mut duo, 0, state);
        duo.run_to(state);
        let since = duo.cycle;
        duo.run_to(S::Fault);
        assert_eq!(duo.faults()[0], Some(fault));
        // 2 s beyond the 0.3 s that settling takes.
        let expected = if state == S::Preparing { 2000 } else { 2300 };
        let cycles = duo.cycle - since;
        assert!(cycles.abs_diff(expected) <= 2, "{state}: {cycles}");
        duo.run(3);
        assert_eq!(duo.states()[1], S::Aborted);
    }
}

#[test]
fn a_partner_that_does_not_get_ready_ends_in_a_fault_of_that_name() {
    // The partner's chain is held in each state by a length of its own that nobody knows of.
    let endless = 1e4;
    let slow = |state| match state {
        S::InitialPositioning => MainConfig { start_m: Some(0.1 + 0.1 * endless), ..short() },
        S::InitialForce => MainConfig { own: Lengths { initial_force_s: endless, ..short().own }, ..short() },
        S::Experiment => MainConfig { own: Lengths { experiment_s: endless, ..short().own }, ..short() },
        S::Preparing => {
            MainConfig { prepares: true, own: Lengths { prepare_s: endless, ..short().own }, ..short() }
        }
        _ => MainConfig { settling_timeout_s: endless, ..short() },
    };
    for state in RUNNING {
        let mut duo = Duo::new(&short());
        duo.axes[1] = One::new(slow(state));
        duo.axes[1].prepared = state != S::Preparing;
        if state == S::FinalSettling {
            duo.run_to(S::Experiment);
        }
        if matches!(state, S::Settling | S::FinalSettling) {
            hold(&mut duo, 1, state);
        }
        duo.run_to(state);
        let since = duo.cycle;
        duo.run_to(S::Fault);
        assert_eq!(duo.faults()[0], Some(Fault::PartnerNotOk), "{state}");
        let own_s = match state {
            S::InitialPositioning => short().approach_longest_s,
            S::Preparing => 0.0,
            S::InitialForce => 0.2,
            S::Experiment => 1.0,
            _ => 0.3,
        };
        let cycles = (duo.cycle - since) as f64 * 1e-3;
        assert!((cycles - own_s - 2.1).abs() < 0.01, "{state}: {cycles} s");
    }
}

#[test]
fn a_slow_partner_is_waited_for_when_its_length_is_known() {
    let long = Lengths { experiment_s: 6.0, ..short().own };
    let mut duo = Duo::new(&MainConfig { either: long, ..short() });
    duo.axes[1] = One::new(MainConfig { own: long, either: long, ..short() });
    duo.run(9000);
    assert_eq!(duo.states(), [S::Done; 2]);
}

#[test]
fn two_axes_that_hunt_each_other_do_not_wait_for_ever() {
    let mut duo = Duo::new(&short());
    duo.run_to(S::Settling);
    for round in 0..10 {
        // Each is settled for a moment while the other is not.
        for index in [0, 1] {
            let error_m = if round % 2 == index { 0.1 } else { 0.0 };
            duo.axes[index].error = ControlError::Position { error_m };
        }
        duo.run(550);
    }
    assert!(duo.states().contains(&S::Fault), "{:?}", duo.states());
}

#[test]
fn a_restarted_rig_restarts_the_chain_from_every_state() {
    let ends: [fn(&mut Duo); 2] =
        [|duo| duo.console.abort = true, |duo| duo.axes[0].fault = Some(Fault::SensorLoss)];
    let mut all: Vec<Duo> = RUNNING.into_iter().chain([S::Done]).map(both_in).collect();
    all.extend(ends.map(|end| {
        let mut duo = both_in(S::Experiment);
        end(&mut duo);
        duo.step();
        duo
    }));
    for mut duo in all {
        for axis in &mut duo.axes {
            axis.fault = None;
            axis.main.restart(0);
            axis.stop.restart(0);
            assert_eq!(axis.main.entered().cause, MainCause::RigRestarted);
        }
        assert_eq!(duo.states(), [S::WaitingForRig; 2]);
    }
}

#[test]
fn two_chains_begin_again_with_the_rigs_time() {
    let mut duo = both_in(S::Experiment);
    duo.cycle = 0;
    duo.axes.iter_mut().for_each(|axis| {
        axis.main.restart(0);
        axis.seen.clear();
    });
    duo.run(4000);
    assert_eq!((duo.states(), duo.faults()), ([S::Done; 2], [None; 2]), "{:?}", duo.axes[0].seen);
}

#[test]
fn a_cause_tells_people_why() {
    assert_eq!(
        MainCause::Fault(Fault::PartnerLost).to_string(),
        "partner-lost: the other axis's controller fell silent for 100 ms: see whether it still runs"
    );
}

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
        own in prop_oneof![9 => Just(true), 1 => Just(false)],
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
            own: own.then_some(OwnAxis { position_m, error: ControlError::None }),
            prepared,
            partner: Partner { status: Some(status), values: None, heard: Some(age) },
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
            inputs.partner.heard = inputs.partner.heard.map(|age| cycle.saturating_sub(age));
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
