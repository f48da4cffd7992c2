//! What an axis controller keeps and what it forgets: after a fault of its own, with a rig that began anew, with a rig that fell
//! silent about itself, with rods that are not linked. On the virtual clock, under a partner that goes along.

use axis_control::axis::{Answer, AxisController};
use axis_control::chains::Fault;
use axis_control::chains::main::MainCause;
use plant::Axis;
use protocol::frames::{
    ChainStatus, ChainValues, EmergencyStop, EmergencyStopChainState, EmergencyStopReason, Frame,
    MainChainState, RigStatus, Sensors,
};

const PRESSED_N: f64 = 100.0;

fn linked() -> RigStatus {
    RigStatus { supply_pressure_pa: 7e5, linked: true, ..RigStatus::default() }
}

fn apart() -> RigStatus {
    RigStatus { linked: false, ..linked() }
}

/// The controller of `axis` for a shipped experiment; after an emergency stop it begins anew by itself.
fn controller(axis: Axis, experiment: &str, partner_needed: bool) -> AxisController {
    let folder = tempfile::tempdir().unwrap();
    let shipped = crate::shipped(&format!("controller/experiments/{experiment}.toml"));
    let text = std::fs::read_to_string(shipped).unwrap();
    let restart = "[run]\nafter_emergency_stop = \"restart\"\n";
    let place = if text.contains("[run]\n") { "[run]\n" } else { "[rig]\n" };
    let restart = if place == "[rig]\n" { format!("{restart}[rig]\n") } else { restart.into() };
    let restarts = folder.path().join("experiment.toml");
    std::fs::write(&restarts, text.replacen(place, &restart, 1)).unwrap();
    let programs = crate::shipped("controller/programs").display().to_string();
    crate::controller(axis, &restarts, partner_needed, &["--programs".into(), programs])
}

/// An axis at rest, 0.1 m from the drive's end; the noise is a few steps of the wire.
fn sensors(cycle: u64) -> Sensors {
    let noise = (cycle % 7) as f64 - 3.0;
    Sensors {
        position_m: 0.1 + 1e-5 * noise,
        force_n: 0.5 * noise,
        pressure_a_pa: 4e5 + 50.0 * noise,
        pressure_b_pa: 4e5,
        alive: (cycle % 16) as u8,
    }
}

/// A cycle with a partner that goes along.
fn step(controller: &mut AxisController, cycle: u64, sensors: &Sensors, rig: Option<&RigStatus>) -> Answer {
    use MainChainState::{Experiment, FinalSettling, InitialForce, Settling};
    // What is asked for is there at once.
    let presses = matches!(controller.state(), InitialForce | Settling | Experiment | FinalSettling);
    let force_n = sensors.force_n + if presses && rig.is_none_or(|rig| rig.linked) { PRESSED_N } else { 0.0 };
    let answer = controller.answer(cycle, &Sensors { force_n, ..*sensors }, rig);
    if let Some(status) = answer.status {
        let (status, values) = (
            ChainStatus { ok: true, ..status },
            ChainValues { averaged_position_m: 0.0992, ..ChainValues::default() },
        );
        let frames = match controller.axis {
            Axis::Drive => [Frame::LoadChainStatus(status), Frame::LoadChainValues(values)],
            Axis::Load => [Frame::DriveChainStatus(status), Frame::DriveChainValues(values)],
        };
        frames.iter().for_each(|frame| controller.receive(frame));
    }
    answer
}

/// Runs until `state`, with a rig that says `rig`; the cycle after.
fn run_to(controller: &mut AxisController, state: MainChainState, rig: &RigStatus) -> u64 {
    for cycle in 0..60_000 {
        step(controller, cycle, &sensors(cycle), Some(rig));
        if controller.state() == state {
            return cycle + 1;
        }
    }
    panic!("{state} was not reached, but {:?}: {}", controller.state(), controller.cause())
}

#[test]
fn a_settling_timeout_alone_is_released_by_the_console_and_the_run_begins_anew() {
    let mut drive = controller(Axis::Drive, "point-to-point", false);
    // Far from the start, so that it never settles.
    let far = |cycle| Sensors { position_m: 0.4, ..sensors(cycle) };
    let mut cycle = 0;
    while drive.state() != MainChainState::Fault {
        drive.answer(cycle, &far(cycle), Some(&apart()));
        cycle += 1;
        assert!(cycle < 60_000, "{:?}", drive.state());
    }
    assert_eq!(drive.cause(), MainCause::Fault(Fault::SettlingTimeout));
    let (mut holds, mut withdrawn) = (true, 0);
    for passed in 0..4000 {
        if passed == 2000 {
            assert_eq!(drive.emergency_stop(), EmergencyStopChainState::WaitingForRelease);
            let reason = EmergencyStopReason::Operator;
            drive.receive(&Frame::ConsoleEmergencyStop(EmergencyStop { reason, release: true }));
        }
        let rig = RigStatus { emergency_stop: holds, check_valves_shut: holds, ..linked() };
        let answer = drive.answer(cycle + passed, &far(cycle), Some(&rig));
        if let Some(stop) = answer.emergency_stop {
            withdrawn += u32::from(stop.release);
            holds = !stop.release;
        }
    }
    assert_eq!(withdrawn, 1);
    assert_eq!(drive.emergency_stop(), EmergencyStopChainState::Ready);
    assert_eq!((drive.state(), drive.cause()), (MainChainState::InitialPositioning, MainCause::Recovered));
}

#[test]
fn a_restarted_controller_answers_as_a_new_one() {
    for axis in Axis::ALL {
        let mut used = controller(axis, "load-step", true);
        let cycles = run_to(&mut used, MainChainState::Experiment, &linked());
        if axis == Axis::Load {
            assert!((used.program.geometry().offset_m - 0.8e-3).abs() < 1e-4, "the offset was matched");
        }
        for cycle in cycles..cycles + 333 {
            step(&mut used, cycle, &sensors(cycle), Some(&linked()));
        }
        used.restart();
        let mut new = controller(axis, "load-step", true);
        for cycle in 0..cycles + 500 {
            let rig = (cycle > 5).then(linked);
            let [one, other] = [&mut used, &mut new].map(|controller| {
                let answer = step(controller, cycle, &sensors(cycle), rig.as_ref());
                let record = answer.record.map(|record| format!("{record:?}"));
                (answer.command, answer.emergency_stop, answer.status, answer.values, record)
            });
            assert_eq!(one, other, "{axis:?}, cycle {cycle}");
        }
        assert_eq!(format!("{:?}", used.figures), format!("{:?}", new.figures));
    }
}

#[test]
fn an_axis_that_presses_needs_linked_rods_before_and_in_the_experiment() {
    let mut load = controller(Axis::Load, "load-step", true);
    run_to(&mut load, MainChainState::Fault, &apart());
    assert_eq!(load.cause(), MainCause::Fault(Fault::NotLinked));

    let mut load = controller(Axis::Load, "load-step", true);
    let cycle = run_to(&mut load, MainChainState::Experiment, &linked());
    let answer = step(&mut load, cycle, &sensors(cycle), Some(&apart()));
    assert!(!answer.command.enable, "shut in the cycle that reports it");
    assert_eq!(answer.emergency_stop.map(|stop| stop.release), Some(false));
    step(&mut load, cycle + 1, &sensors(cycle), Some(&apart()));
    assert_eq!(load.cause(), MainCause::Fault(Fault::NotLinked));
}

#[test]
fn a_hand_may_move_an_axis_whose_rods_are_apart() {
    let mut load = controller(Axis::Load, "manual-let-go", true);
    run_to(&mut load, MainChainState::Done, &apart());
}

#[test]
fn a_rig_that_says_nothing_of_itself_for_a_while_ends_no_run() {
    let mut load = controller(Axis::Load, "load-step", true);
    let cycle = run_to(&mut load, MainChainState::Experiment, &linked());
    for cycle in cycle..cycle + 1000 {
        let answer = step(&mut load, cycle, &sensors(cycle), None);
        assert!(answer.command.enable, "cycle {cycle}");
    }
    assert_eq!(load.state(), MainChainState::Experiment);
}

#[test]
fn a_force_beyond_the_sensors_range_ends_the_run_after_half_a_second() {
    let mut drive = controller(Axis::Drive, "load-step", true);
    let cycle = run_to(&mut drive, MainChainState::Experiment, &linked());
    let beyond = RigStatus { drive_force_saturated: true, ..linked() };
    let ends = (cycle..cycle + 2000).find(|cycle| {
        step(&mut drive, *cycle, &sensors(*cycle), Some(&beyond));
        drive.state() == MainChainState::Fault
    });
    assert_eq!(ends, Some(cycle + 501));
    assert_eq!(drive.cause(), MainCause::Fault(Fault::LimitExceeded));
}
