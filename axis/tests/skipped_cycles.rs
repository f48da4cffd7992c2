//! A rig that skips cycles, or a process that misses some: nothing that was due is dropped, and nobody is blamed for silence.

use axis_control::axis::{Answer, AxisController};
use plant::Axis;
use protocol::frames::{ChainStatus, Frame, MainChainState, RigStatus, Sensors};

const NUMBER: u8 = 9;

/// The drive's controller for the shipped experiment load-step.
fn drive() -> AxisController {
    crate::controller(Axis::Drive, &crate::shipped("controller/experiments/load-step.toml"), true, &[])
}

fn answer(drive: &mut AxisController, cycle: u64) -> Answer {
    let sensors = Sensors { position_m: 0.3, pressure_a_pa: 4e5, pressure_b_pa: 4e5, ..Sensors::default() };
    let rig = RigStatus { supply_pressure_pa: 7e5, linked: true, ..RigStatus::default() };
    drive.answer(cycle, &sensors, Some(&rig))
}

fn speak(drive: &mut AxisController) {
    let main_chain = drive.state();
    let status = ChainStatus { main_chain, ok: true, experiment: NUMBER, ..ChainStatus::default() };
    drive.receive(&Frame::LoadChainStatus(status));
}

/// Positioned on its way, in the cycle after which nothing was heard of the partner any more.
fn under_way() -> (AxisController, u64) {
    let mut drive = drive();
    for cycle in 0..200 {
        speak(&mut drive);
        answer(&mut drive, cycle);
    }
    assert_eq!(drive.state(), MainChainState::InitialPositioning);
    (drive, 199)
}

#[test]
fn a_partner_is_lost_after_100_cycles_of_silence() {
    let (mut drive, received) = under_way();
    for cycle in received + 1..=received + 100 {
        answer(&mut drive, cycle);
        assert_eq!(drive.state(), MainChainState::InitialPositioning, "cycle {cycle}");
    }
    answer(&mut drive, received + 101);
    assert_eq!(drive.state(), MainChainState::Fault);
}

#[test]
fn cycles_that_nobody_answered_are_no_silence_of_the_partner() {
    let (mut drive, received) = under_way();
    let skipped = 150;
    for cycle in received + 1 + skipped..=received + 100 + skipped {
        answer(&mut drive, cycle);
        assert_eq!(drive.state(), MainChainState::InitialPositioning, "cycle {cycle}");
    }
    // Those that were answered count as ever.
    answer(&mut drive, received + 101 + skipped);
    assert_eq!(drive.state(), MainChainState::Fault);
}

#[test]
fn a_status_that_was_due_in_a_cycle_that_was_skipped_is_sent_in_the_next() {
    let spoken = |cycles: &mut dyn Iterator<Item = u64>| -> Vec<u64> {
        let mut drive = drive();
        answer(&mut drive, 0);
        cycles.filter(|cycle| answer(&mut drive, *cycle).status.is_some()).collect()
    };
    // Nothing else changes while it waits for its partner.
    assert_eq!(spoken(&mut (1..60)), [2, 12, 22, 32, 42, 52]);
    assert_eq!(spoken(&mut (1..60).step_by(4)), [5, 13, 25, 33, 45, 53]);
    assert_eq!(spoken(&mut (25..60).step_by(10)), [25, 35, 45, 55]);
}
