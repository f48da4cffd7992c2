//! A foreign controller in lockstep: it joins by its echo, and neither a lossy wire nor its own full queue holds the barrier.

use super::support::*;
use protocol::bus::control::Role;
use protocol::bus::host::Host;
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{Bus, WireOptions};
use protocol::can::CanFrame;
use protocol::frames::{ALIVE_RANGE, DRIVE_VALVE_COMMAND, ECHO_RANGE, Frame, Sensors, ValveCommand};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

fn host(place: &Place, loss: f64) -> RunningHost {
    let barrier = BarrierConfig { members: 0, echo_ids: vec![DRIVE_VALVE_COMMAND.id] };
    RunningHost::start(&place.socket(), WireOptions { loss, seed: 3, timing: None }, Some(barrier))
}

fn sensors(cycle: u32) -> CanFrame {
    let alive = (u64::from(cycle) % ALIVE_RANGE) as u8;
    Frame::DriveSensors(Sensors { alive, ..Sensors::default() }).encode().unwrap()
}

fn command(cycle: u64) -> CanFrame {
    let (alive, echo) = ((cycle % ALIVE_RANGE) as u8, (cycle % ECHO_RANGE) as u16);
    let command = ValveCommand { opening: 0.0, alive, echo, enable: true };
    Frame::DriveValveCommand(command).encode().unwrap()
}

/// A stranger that never saw the sensors of a cycle once held the barrier until its time-out.
#[test]
fn lost_frames_do_not_hold_the_barrier_of_a_stranger() {
    const CYCLES: u32 = 500;
    let place = Place::new();
    let host = host(&place, 0.05);
    let mut rig = joined(&place.socket(), Role::Rig, "rig");
    let mut stranger = open(&place.socket());
    let answered = std::thread::scope(|scope| {
        // Answers sensors as they come, and knows the cycle by the counter alone, which jumps over what is lost.
        let answers = scope.spawn(|| {
            let (mut cycle, mut answers) = (0, 0);
            loop {
                let (frame, _) = next_frame(stranger.as_mut());
                if frame.standard_id() == Some(FENCE_ID) {
                    return answers;
                }
                let Ok(Frame::DriveSensors(sensors)) = Frame::decode(&frame) else { panic!("{frame}") };
                cycle += u64::from(sensors.alive).wrapping_sub(cycle) % ALIVE_RANGE;
                stranger.send(&command(cycle)).unwrap();
                answers += 1;
            }
        });
        // What comes before the rig's turn are commands.
        let mut commands = go(rig.as_mut(), 0).len();
        for cycle in 0..CYCLES {
            rig.send(&sensors(cycle)).unwrap();
            rig.done(cycle);
            commands += go(rig.as_mut(), cycle + 1).len();
        }
        // Of so many fences one gets through; without sensors nobody is done with this cycle, and nobody has to be.
        for _ in 0..20 {
            rig.send(&CanFrame::new(FENCE_ID, &[])).unwrap();
        }
        rig.done(CYCLES);
        let answers = answers.join().unwrap();
        let lost = host.stop().injected_loss.by_name();
        assert_eq!(answers + lost["120"], u64::from(CYCLES));
        assert_eq!(commands as u64 + lost["110"], answers);
        answers
    });
    // Binomial: 475 expected, standard deviation 5; five of them.
    assert!((450..500).contains(&answered), "{answered} of {CYCLES} answered");
}

/// Far more than a queue of 2 MiB holds at some 750 bytes a frame, twice over for the kernel's doubling.
const MORE_THAN_A_QUEUE: usize = 14_000;

/// Runs a foreign controller into a full queue: it answers cycle 0 and does not read in cycle 1, whose sensors it loses.
fn fill_the_queue_of(stranger: &mut dyn Bus, rig: &mut dyn Bus) {
    go(rig, 0);
    rig.send(&sensors(0)).unwrap();
    rig.done(0);
    assert_eq!(next_frame(stranger).0, sensors(0));
    stranger.send(&command(0)).unwrap();
    go(rig, 1);
    for number in 0..MORE_THAN_A_QUEUE {
        rig.send(&numbered(0x100, number)).unwrap();
    }
    rig.send(&sensors(1)).unwrap();
    rig.done(1);
}

/// One that answers and then stops reading, as a program in a debugger does, lets the others go on: after the barrier's time-out,
/// and then at once.
#[test]
fn the_full_queue_of_a_stranger_does_not_hold_the_barrier() {
    let place = Place::new();
    let barrier = BarrierConfig { members: 0, echo_ids: vec![DRIVE_VALVE_COMMAND.id] };
    let timeout = Duration::from_millis(300);
    let host = Host::bind(&place.socket(), WireOptions::default(), Some(barrier)).unwrap();
    let host = RunningHost::serve(host.with_barrier_timeout(timeout));
    let mut rig = joined(&place.socket(), Role::Rig, "rig");
    let mut stranger = open(&place.socket());
    fill_the_queue_of(stranger.as_mut(), rig.as_mut());
    go(rig.as_mut(), 2);
    for cycle in 2..50 {
        rig.send(&sensors(cycle)).unwrap();
        rig.done(cycle);
        go(rig.as_mut(), cycle + 1);
    }
    let dropped = host.stop().peers[1].dropped_at_queue.by_name();
    assert_eq!(dropped["120"], 49, "{dropped:?}");
}

/// Simulated time does not run away from a foreign controller that has something to read, though nothing to answer.
#[test]
fn a_stranger_that_lost_its_sensors_is_waited_for_until_it_has_read_the_rest() {
    let place = Place::new();
    let host = host(&place, 0.0);
    let mut rig = joined(&place.socket(), Role::Rig, "rig");
    let mut stranger = open(&place.socket());
    fill_the_queue_of(stranger.as_mut(), rig.as_mut());
    let has_read = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(50));
            has_read.store(true, Ordering::SeqCst);
            loop {
                let (frame, _) = next_frame(stranger.as_mut());
                if frame.standard_id() == Some(FENCE_ID) {
                    return;
                }
                // A host that had no processor for so long finds room in the queue, and its sensors arrive.
                if frame == sensors(1) {
                    stranger.send(&command(1)).unwrap();
                }
            }
        });
        go(rig.as_mut(), 2);
        assert!(has_read.load(Ordering::SeqCst), "the barrier went on without it");
        rig.send(&CanFrame::new(FENCE_ID, &[])).unwrap();
        rig.done(2);
    });
    host.stop();
}
