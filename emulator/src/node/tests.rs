//! What acts and what is recorded in cycles that were missed.

use super::*;
use crate::recording::{self, Records};
use plant::{RigParameters, Scene};
use protocol::bus::control::Role;
use protocol::bus::{BusCounters, BusError, FrameSink, Received, SendError};
use protocol::frames::ValveCommand;
use std::time::Instant;

/// A bus without other nodes.
#[derive(Default)]
struct EmptyBus(BusCounters);

impl FrameSink for EmptyBus {
    fn send(&mut self, _frame: &CanFrame) -> Result<u64, SendError> {
        Ok(1)
    }
}

impl Bus for EmptyBus {
    fn receive(&mut self) -> Received {
        Received::Nothing
    }

    fn wait_readable(&mut self, _timeout: Duration) {}

    fn is_up(&self) -> bool {
        true
    }

    fn counters(&self) -> &BusCounters {
        &self.0
    }

    fn join_lockstep(&mut self, _role: Role, _name: &str) -> Result<(), BusError> {
        Ok(())
    }

    fn done(&mut self, _cycle: u32) {}
}

fn node(scene: &str) -> (EmulatorNode, Records) {
    let rig = RigParameters::baseline();
    let scene = Scene::from_toml(scene, "test", &rig).unwrap();
    let (recorder, records) = recording::queues(false);
    let parts = NodeParts {
        plant: Plant::new(&rig, &scene.setup()).unwrap(),
        sensors: Sensors::new(&rig, 1),
        people: People::new(&scene),
        faults: FaultSchedule::new(None, false, None),
        console: None,
        recorder,
        bench_frames: true,
        lockstep: false,
    };
    (EmulatorNode::new(parts), records)
}

/// Sends the sensors of `cycle`, which are answered with this opening of the drive's valve from the second cycle on.
fn live(node: &mut EmulatorNode, cycle: u64, opening: f64) {
    node.publish(cycle, false, &mut EmptyBus::default());
    if let Some(echo) = cycle.checked_sub(1) {
        let alive = (cycle % 16) as u8;
        let command = ValveCommand { opening, alive, echo: echo as u16, enable: true };
        let frame = Frame::DriveValveCommand(command).encode().unwrap();
        node.take(&frame, 0, cycle);
    }
    node.act(cycle);
}

#[test]
fn a_stop_within_missed_cycles_shuts_the_valve_from_its_cycle_to_its_release() {
    let scene = "[[rig.event]]\nat_s = 0.004\ndo = \"emergency-stop\"\n[[rig.event]]\nat_s = 0.007\ndo = \"release\"\n";
    let (mut node, records) = node(scene);
    (0..3).for_each(|cycle| live(&mut node, cycle, 0.5));
    node.miss(3, 7);
    let openings: Vec<_> = records.cycles.try_iter().map(|record| record.valve[0]).collect();
    let open = plant::quantise_valve(0.5);
    let expected = [0.0, open, open, open, 0.0, 0.0, 0.0, open, open, open];
    assert_eq!(openings, expected);
}

#[test]
fn a_writer_that_does_not_write_is_waited_for_once_in_a_stall_and_one_that_is_gone_not_at_all() {
    let (mut node, records) = node("");
    let mut cycle = 0;
    while !node.recorder.is_full() {
        node.advance(cycle);
        cycle += 1;
    }
    let began = Instant::now();
    node.miss(cycle, 3);
    let took = began.elapsed().as_secs_f64();
    // One wait is 2 s of sleeps of a millisecond, each of which may be late; three would be 6 s.
    assert!((2.0..5.0).contains(&took), "{took} s");
    drop(records);
    let began = Instant::now();
    node.miss(cycle + 3, 3);
    assert!(began.elapsed().as_secs_f64() < 1.0);
}

/// A rig that stood still while its interface went down and came back never saw it down, and reported nothing.
#[test]
fn a_bus_lost_and_back_between_two_cycles_is_reported() {
    let (mut node, records) = node("");
    let mut bus = EmptyBus::default();
    node.publish(0, false, &mut bus);
    (bus.0.disconnects, bus.0.reconnects) = (1, 1);
    node.publish(1, false, &mut bus);
    node.publish(2, false, &mut bus);
    let reported: Vec<_> = records.events.try_iter().map(|event| (event.cycle, event.kind)).collect();
    assert_eq!(reported, [(1, EventKind::BusLost), (1, EventKind::BusBack)]);
}
