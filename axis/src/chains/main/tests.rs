//! Tests of the main chain alone, and of two that talk to each other.

mod edges;
mod partner;

use super::*;
use crate::chains::duo::{AxisPair, SimulatedAxis, alone, short};
use crate::chains::settled::ControlError;
use crate::chains::{AfterStop, Console, Partner};
use MainChainState as S;
use protocol::frames::ChainStatus;

const RUNNING: [S; 6] =
    [S::InitialPositioning, S::Preparing, S::InitialForce, S::Settling, S::Experiment, S::FinalSettling];

fn order(axis: &SimulatedAxis) -> Vec<S> {
    axis.state_log.iter().map(|(_, state)| *state).collect()
}

/// What an axis at the start is given in a cycle in which its partner says this.
fn reported(cycle: u64, status: ChainStatus) -> MainInputs {
    MainInputs {
        cycle,
        measurement: Some(AxisMeasurement { position_m: 0.1, error: ControlError::None }),
        partner: Partner { status: Some(status), values: None, received: Some(cycle) },
        ..MainInputs::default()
    }
}

/// Two in `state`, on the way through one repetition.
fn both_in(state: S) -> AxisPair {
    let mut pair = AxisPair::new(&short());
    // Without a step to take, preparing is over at once.
    pair.axes.iter_mut().for_each(|axis| axis.prepared = state != S::Preparing);
    pair.run_to(state);
    pair.run(20);
    assert_eq!(pair.states(), [state; 2], "{:?}", pair.axes[0].state_log);
    pair
}

#[test]
fn alone_the_chain_goes_from_the_rig_to_done() {
    let mut pair = alone(short());
    pair.run(3000);
    let seen = &pair.axes[0].state_log;
    let expected = [S::InitialPositioning, S::Preparing, S::InitialForce, S::Settling, S::Experiment];
    assert_eq!(order(&pair.axes[0]), [&expected[..], &[S::FinalSettling, S::Done]].concat());
    // 0.5 s, 1 cycle, 0.2 s, 0.3 s, 1 s, 0.3 s.
    let times: Vec<u64> = seen.iter().map(|(cycle, _)| *cycle).collect();
    assert_eq!(times, [0, 500, 501, 701, 1001, 2001, 2301]);
}

#[test]
fn two_chains_go_together_and_never_stand_more_than_a_cycle_apart() {
    let mut pair = AxisPair::new(&short());
    // One is slower everywhere.
    pair.axes[1].position_m = 0.2;
    pair.run(4000);
    assert_eq!(pair.states(), [S::Done; 2]);
    let [first, second] = &pair.axes;
    assert_eq!(order(first), order(second));
    for (a, b) in first.state_log.iter().zip(&second.state_log) {
        assert!(a.0.abs_diff(b.0) <= 1, "{a:?} {b:?}");
    }
    // The way of 0.1 m takes 1 s, for both.
    assert!(first.state_log[2].0 >= 1000, "{:?}", first.state_log);
}

#[test]
fn the_approach_begins_where_the_carriage_is() {
    let mut pair = alone(short());
    pair.axes[0].position_m = 0.33;
    pair.step();
    let Phase::Approach { elapsed_s, from_m, duration_s } = pair.axes[0].output.unwrap().phase else {
        panic!("{:?}", pair.axes[0].output)
    };
    assert_eq!((elapsed_s, from_m), (0.0, 0.33));
    assert!((duration_s - 2.3).abs() < 1e-9, "0.23 m at 0.1 m/s, not {duration_s} s");
}

#[test]
fn an_axis_that_is_not_positioned_is_ready_at_once() {
    let mut pair = alone(MainConfig { start_m: None, ..short() });
    pair.run(2);
    assert_eq!(pair.axes[0].state(), S::Preparing);
}

#[test]
fn each_phase_belongs_to_its_state() {
    let mut pair = alone(short());
    pair.axes[0].prepared = false;
    let mut seen = vec![];
    for cycle in 0..4000 {
        pair.axes[0].prepared = cycle > 700;
        pair.step();
        let output = pair.axes[0].output.unwrap();
        let expected = match output.phase {
            Phase::Shut => [S::WaitingForRig; 2],
            Phase::Approach { .. } => [S::InitialPositioning; 2],
            Phase::Prepare => [S::Preparing; 2],
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
    let mut pair = alone(short());
    pair.run_to(S::Experiment);
    assert_eq!(pair.axes[0].output.unwrap().phase, Phase::Experiment { elapsed_s: 0.0 });
    pair.run(250);
    assert_eq!(pair.axes[0].output.unwrap().phase, Phase::Experiment { elapsed_s: 0.25 });
}

#[test]
fn repetitions_begin_with_the_initial_positioning() {
    let mut pair = AxisPair::new(&MainConfig { repetitions: Some(3), ..short() });
    pair.run(9000);
    let seen = order(&pair.axes[0]);
    assert_eq!(seen.iter().filter(|state| **state == S::InitialPositioning).count(), 3);
    assert_eq!((pair.states(), pair.axes[0].output.unwrap().repetition), ([S::Done; 2], 2));
}

#[test]
fn forever_goes_past_the_wrap_of_the_repetition() {
    let tiny = Lengths { experiment_s: 0.01, ..Lengths::default() };
    let config = MainConfig {
        repetitions: None,
        lengths: tiny,
        longest_lengths: tiny,
        settling_s: 0.0,
        start_m: None,
        ..short()
    };
    let mut pair = AxisPair::new(&config);
    pair.run(20_000);
    let repetition = pair.axes[0].output.unwrap().repetition;
    assert!(repetition > 300, "{repetition}");
    assert_eq!(pair.faults(), [None; 2]);
}

#[test]
fn skipped_cycles_pass_for_the_experiment_too() {
    let mut pair = alone(short());
    pair.run_to(S::Experiment);
    pair.cycle += 999;
    pair.run(2);
    assert_eq!(pair.axes[0].state(), S::FinalSettling);
}

#[test]
fn on_start_waits_in_settling_without_a_time_out() {
    let mut pair = AxisPair::new(&MainConfig { start: Start::OnStart, repetitions: Some(2), ..short() });
    pair.run(30_000);
    assert_eq!(pair.states(), [S::Settling; 2]);
    pair.console.start = true;
    pair.run(20);
    assert_eq!(pair.states(), [S::Experiment; 2]);
    pair.run(6000);
    assert_eq!(pair.states(), [S::Done; 2], "one start is for all repetitions");
}

#[test]
fn a_start_before_settling_is_none() {
    let mut pair = AxisPair::new(&MainConfig { start: Start::OnStart, ..short() });
    pair.run(100);
    pair.console.start = true;
    pair.run(5000);
    assert_eq!(pair.states(), [S::Settling; 2]);
}

#[test]
fn a_start_that_only_one_heard_travels_by_the_ok_flag() {
    let mut pair = AxisPair::new(&MainConfig { start: Start::OnStart, ..short() });
    pair.run(3000);
    let status = ChainStatus { main_chain: S::Settling, ..ChainStatus::default() };
    let console = Console { start: true, ..Console::default() };
    pair.axes[1].supervisory.main.advance(&MainInputs { console, ..reported(pair.cycle, status) });
    pair.run(10);
    assert_eq!(pair.states(), [S::Experiment; 2]);
}

#[test]
fn an_abort_ends_every_state_and_does_not_trip() {
    for state in RUNNING {
        let mut pair = both_in(state);
        pair.console.abort = true;
        pair.step();
        assert_eq!(pair.states(), [S::Aborted; 2], "{state}");
        assert_eq!(pair.axes[0].output.unwrap().phase, Phase::Shut);
        assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::Console);
        pair.run(5000);
        assert_eq!(pair.states(), [S::Aborted; 2], "a person's abort is not undone by itself");
        assert_eq!(pair.axes[0].stop_state(), EmergencyStopChainState::Ready);
        pair.console.start = true;
        pair.run(10);
        assert_eq!(pair.states(), [S::InitialPositioning; 2]);
        assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::Started);
    }
}

#[test]
fn an_abort_that_only_one_heard_ends_both() {
    for state in RUNNING {
        let mut pair = both_in(state);
        pair.axes[1].supervisory.main.enter(
            S::Aborted,
            MainCause::Console,
            &MainInputs { cycle: pair.cycle, ..Default::default() },
        );
        // Within the grace of a start it waits for a partner that is still aborted.
        pair.run(if state == S::InitialPositioning { 100 } else { 2 });
        assert_eq!(pair.states(), [S::Aborted; 2], "{state}");
        assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::PartnerAborted);
    }
}

#[test]
fn waiting_and_done_can_be_aborted_too() {
    let mut pair = AxisPair::new(&short());
    pair.axes[0].sensors = false;
    pair.run(10);
    assert_eq!(pair.axes[0].state(), S::WaitingForRig);
    pair.console.abort = true;
    pair.step();
    assert_eq!(pair.axes[0].state(), S::Aborted);

    let mut pair = both_in(S::Done);
    pair.console.abort = true;
    pair.step();
    assert_eq!(pair.states(), [S::Aborted; 2]);
}

#[test]
fn an_emergency_stop_aborts_every_state_and_the_run_begins_again_by_itself() {
    for state in RUNNING.into_iter().chain([S::Done]) {
        let mut pair = both_in(state);
        pair.console_holds = true;
        pair.step();
        assert_eq!(pair.states(), [S::Aborted; 2], "{state}");
        assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::EmergencyStop);
        pair.axes.iter_mut().for_each(|axis| (axis.position_m, axis.prepared) = (0.15, true));
        pair.stop_and_release();
        assert_eq!(pair.states(), [S::Aborted; 2]);
        // Recovered for 0.2 s.
        pair.run(210);
        assert_eq!(pair.states(), [S::InitialPositioning; 2], "{state}");
        assert_eq!(pair.axes[0].supervisory.main.entered.cause, MainCause::Recovered);
        let phase = pair.axes[0].output.unwrap().phase;
        assert!(matches!(phase, Phase::Approach { from_m: 0.15, .. }), "{phase:?}");
        pair.run(6000);
        assert_eq!(pair.states(), [S::Done; 2], "{state}");
    }
}

#[test]
fn after_an_emergency_stop_the_end_is_the_end() {
    let mut pair = AxisPair::new(&MainConfig { after_emergency_stop: AfterStop::End, ..short() });
    pair.run_to(S::Experiment);
    pair.stop_and_release();
    for _ in 0..20 {
        pair.console.start = true;
        pair.run(200);
        assert_eq!(pair.states(), [S::Aborted; 2]);
    }
}

#[test]
fn after_an_emergency_stop_a_person_may_be_asked() {
    let mut pair = AxisPair::new(&MainConfig { after_emergency_stop: AfterStop::OnStart, ..short() });
    pair.run_to(S::Experiment);
    pair.stop_and_release();
    pair.run(5000);
    assert_eq!(pair.states(), [S::Aborted; 2]);
    assert_eq!(pair.axes[0].stop_state(), EmergencyStopChainState::WaitingForStart);
    pair.console.start = true;
    pair.run(10);
    assert_eq!(pair.states(), [S::InitialPositioning; 2]);
}

#[test]
fn the_cut_off_repetition_is_repeated() {
    let mut pair = AxisPair::new(&MainConfig { repetitions: Some(3), ..short() });
    pair.run_to(S::FinalSettling);
    pair.run(1000);
    assert_eq!(pair.axes[0].output.unwrap().repetition, 1);
    pair.stop_and_release();
    pair.run(300);
    assert_eq!((pair.states(), pair.axes[1].output.unwrap().repetition), ([S::InitialPositioning; 2], 1));
}

#[test]
fn a_person_who_aborts_during_an_emergency_stop_is_obeyed() {
    let mut pair = both_in(S::Experiment);
    pair.console_holds = true;
    pair.run(200);
    pair.console.abort = true;
    pair.stop_and_release();
    pair.run(5000);
    assert_eq!(pair.states(), [S::Aborted; 2]);
}

#[test]
fn a_fault_of_the_axis_ends_every_state_and_trips() {
    for state in RUNNING.into_iter().chain([S::Done]) {
        let mut pair = both_in(state);
        pair.axes[0].fault = Some(Fault::LimitExceeded);
        pair.step();
        assert_eq!(pair.faults()[0], Some(Fault::LimitExceeded), "{state}");
        assert_eq!(pair.axes[0].output.unwrap().phase, Phase::Shut);
        pair.step();
        assert_eq!(pair.states(), [S::Fault, S::Aborted], "the partner is stopped in the next cycle");
        assert_eq!(pair.axes[0].supervisory.stop.holds(), Some(Fault::LimitExceeded));
        pair.run(5000);
        assert_eq!(pair.states(), [S::Fault, S::Aborted], "nobody has released");
        pair.axes[0].fault = None;
        pair.console.release = true;
        pair.run(300);
        assert_eq!(pair.states(), [S::InitialPositioning; 2], "{state}");
    }
}

#[test]
fn a_restarted_rig_restarts_the_chain_from_every_state() {
    let ends: [fn(&mut AxisPair); 2] =
        [|pair| pair.console.abort = true, |pair| pair.axes[0].fault = Some(Fault::SensorLoss)];
    let mut all: Vec<AxisPair> = RUNNING.into_iter().chain([S::Done]).map(both_in).collect();
    all.extend(ends.map(|end| {
        let mut pair = both_in(S::Experiment);
        end(&mut pair);
        pair.step();
        pair
    }));
    for mut pair in all {
        for axis in &mut pair.axes {
            axis.fault = None;
            axis.supervisory.main.restart(0);
            axis.supervisory.stop.restart(0);
            assert_eq!(axis.supervisory.main.entered.cause, MainCause::RigRestarted);
        }
        assert_eq!(pair.states(), [S::WaitingForRig; 2]);
    }
}

#[test]
fn two_chains_begin_again_with_the_rigs_time() {
    let mut pair = both_in(S::Experiment);
    pair.cycle = 0;
    pair.axes.iter_mut().for_each(|axis| {
        axis.supervisory.main.restart(0);
        axis.state_log.clear();
    });
    pair.run(4000);
    assert_eq!((pair.states(), pair.faults()), ([S::Done; 2], [None; 2]), "{:?}", pair.axes[0].state_log);
}

#[test]
fn a_cause_tells_people_why() {
    assert_eq!(
        MainCause::Fault(Fault::PartnerLost).to_string(),
        "partner-lost: the other axis's controller fell silent for 100 ms: see whether it still runs"
    );
}
