//! The sensors of one axis fall silent while the rig goes on: that axis shuts its valve and trips the emergency stop.
//!
//! The test plays the rig, for no wire loses frames of one identifier alone. It goes on when the axis whose sensors come has
//! answered, so that times are counted in its own cycles, whatever the machine does.

use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame, MainChainState, RigStatus, Sensors, Tick};
use std::time::Duration;
use system_tests::{PATIENCE, Pace, Packet, Peer, SHORT, Scene};

const SILENT_FROM: u64 = 800;
/// Five ticks, one every ten cycles.
const AT_EARLIEST: u64 = SILENT_FROM + 40;
const AT_LATEST: u64 = SILENT_FROM + 60;
const CYCLES: u64 = 4000;

/// What the controllers did, by the rig's cycles.
#[derive(Debug, Default)]
struct Reactions {
    stop: Option<(u64, EmergencyStop)>,
    /// The other axis says that it aborted.
    aborted: Option<u64>,
    /// Commands of the silent axis that open its valve from its last sensors on.
    opened: Vec<u64>,
}

/// Publishes a cycle of a rig whose carriage rests at 0.1 m; `silent` gets no sensors.
fn publish(peer: &Peer, cycle: u64, silent: Option<&str>, emergency_stop: bool) {
    let sensors = Sensors {
        position_m: 0.1,
        pressure_a_pa: 4e5,
        pressure_b_pa: 4e5,
        alive: (cycle % 16) as u8,
        ..Sensors::default()
    };
    if silent != Some("drive") {
        peer.send_frame(&Frame::DriveSensors(sensors));
    }
    if silent != Some("load") {
        peer.send_frame(&Frame::LoadSensors(Sensors { position_m: 0.5, ..sensors }));
    }
    if cycle.is_multiple_of(10) {
        peer.send_frame(&Frame::Tick(Tick { cycle: cycle as u32, ..Tick::default() }));
    }
    if cycle % 10 == 5 {
        peer.send_frame(&Frame::RigStatus(RigStatus {
            supply_pressure_pa: 7e5,
            emergency_stop,
            ..RigStatus::default()
        }));
    }
}

/// Plays the rig; `silent` names the axis whose sensors stop.
fn play(peer: &Peer, silent: &str) -> Reactions {
    let mut reactions = Reactions::default();
    for cycle in 0..CYCLES {
        publish(peer, cycle, (cycle >= SILENT_FROM).then_some(silent), reactions.stop.is_some());
        loop {
            let Some(packet) = peer.receive(if cycle == 0 { PATIENCE } else { Duration::from_secs(2) })
            else {
                // The controllers have ended: two seconds after the fault.
                return reactions;
            };
            let Packet::Frame(frame) = packet else { continue };
            match (silent, Frame::decode(&frame)) {
                ("drive", Ok(Frame::DriveEmergencyStop(stop)))
                | ("load", Ok(Frame::LoadEmergencyStop(stop))) => {
                    reactions.stop = reactions.stop.or(Some((cycle, stop)));
                }
                ("drive", Ok(Frame::LoadChainStatus(status)))
                | ("load", Ok(Frame::DriveChainStatus(status)))
                    if status.main_chain == MainChainState::Aborted =>
                {
                    reactions.aborted = reactions.aborted.or(Some(cycle));
                }
                ("drive", Ok(Frame::DriveValveCommand(command)))
                | ("load", Ok(Frame::LoadValveCommand(command)))
                    if cycle > SILENT_FROM && command.enable =>
                {
                    reactions.opened.push(cycle);
                }
                ("drive", Ok(Frame::LoadValveCommand(command)))
                | ("load", Ok(Frame::DriveValveCommand(command)))
                    if u64::from(command.echo) == cycle % 4096 =>
                {
                    break;
                }
                _ => {}
            }
        }
    }
    reactions
}

#[test]
fn an_axis_without_sensors_trips_the_emergency_stop_after_five_ticks_of_the_rig() {
    for silent in ["drive", "load"] {
        let scene = Scene::new(SHORT);
        let host = scene.bus_host("");
        let rig = scene.peer();
        let controller = scene.controller(Pace::Real).with("--no-realtime --bus-grace 60").start();
        scene.wait_for_peers(2);
        let reactions = play(&rig, silent);
        let ended = controller.wait().expect_code(1);
        ended.expect_stderr(&[&format!("stopped before the end: {silent}: sensor-loss")]);
        let (cycle, stop) = reactions.stop.expect("it trips the emergency stop");
        assert_eq!((stop.reason, stop.release), (EmergencyStopReason::SensorLoss, false), "{silent}");
        eprintln!("{silent}: emergency stop {} cycles after the last sensors", cycle - SILENT_FROM + 1);
        assert!((AT_EARLIEST..=AT_LATEST).contains(&cycle), "{silent}: in cycle {cycle}");
        // By the stop itself, not by the rig's status five cycles after the tick.
        let aborted = reactions.aborted.expect("the other axis aborts");
        assert!(aborted - cycle <= 2, "{silent}: the other axis aborts {} cycles later", aborted - cycle);
        assert!(reactions.opened.is_empty(), "{silent}: opened without sensors in {:?}", reactions.opened);
        let report = scene.report();
        assert_eq!(report["axes"][silent]["chain_state"], "fault");
        let other = if silent == "drive" { "load" } else { "drive" };
        assert_eq!(report["axes"][other]["chain_state"], "aborted", "{other} follows");
        drop(host);
    }
}
