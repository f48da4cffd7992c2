//! Emergency stop over the bus: who stops must release, the record shows what acts, and the run ends by itself.

use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame};
use system_tests::exit::BOUND_BROKEN;
use system_tests::{Pace, RESTLESS, Scene};

/// The carriage moves by then.
const TRIP: u32 = 900;
const FOREIGN_RELEASE: u32 = 1400;
const RELEASE: u32 = 1900;
const CYCLES: usize = 2600;

fn stop(release: bool) -> EmergencyStop {
    EmergencyStop { reason: EmergencyStopReason::Operator, release }
}

/// What the console and the load controller say in a cycle.
fn said_in(cycle: u32) -> Option<Frame> {
    match cycle {
        TRIP => Some(Frame::ConsoleEmergencyStop(stop(false))),
        FOREIGN_RELEASE => Some(Frame::LoadEmergencyStop(stop(true))),
        RELEASE => Some(Frame::ConsoleEmergencyStop(stop(true))),
        _ => None,
    }
}

#[test]
fn a_stop_is_released_by_its_sender_alone_and_the_record_shows_the_valve_that_acts() {
    let scene = Scene::new(RESTLESS);
    let options = format!("--members 2 --seconds {}", CYCLES as f64 * 1e-3);
    let (emulator, controller) = scene.start(Pace::Lockstep, &options, "--repeat");
    // A member stops and releases, for the whole of it.
    scene.peer().be_console(said_in);
    emulator.wait().expect_code(0);
    controller.wait();
    let truth = scene.truth();
    let measurement = scene.measurement();
    let (supply, valve) = (truth.column("supply_pressure_Pa"), measurement.column("drive_valve"));
    // Said in cycle k, heard at k + 1 (bus.md, Lockstep).
    let (tripped, released) = (TRIP as usize + 1, RELEASE as usize + 1);
    assert!(valve[..tripped].iter().any(|opening| *opening != 0.0), "the axis was moving before");
    assert!(
        valve[tripped..].iter().all(|opening| *opening == 0.0),
        "the valve that acts is shut from the trip on"
    );
    // Discharge with 0.05 s: after 0.5 s what is left of 6 bar is 6 bar e^-10, 27 Pa.
    let discharged = supply[FOREIGN_RELEASE as usize];
    assert!((discharged - 101_325.0).abs() < 50.0, "supply is {discharged} Pa");
    let still = supply[released];
    assert!(still <= discharged, "a release by another sender changed the supply to {still} Pa");
    // Recovery with 0.3 s: after 0.69 s of it nine tenths of the way are done.
    assert!(supply[CYCLES - 1] > 600_000.0, "supply came back to {} Pa only", supply[CYCLES - 1]);
}

#[test]
fn the_controllers_end_an_aborted_experiment_by_themselves() {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.start(Pace::Lockstep, "--members 2 --seconds 10", "--repeat");
    scene.peer().be_console(|cycle| (cycle == TRIP).then(|| Frame::ConsoleEmergencyStop(stop(false))));
    controller.wait().expect_code(BOUND_BROKEN).expect_stderr(&["aborted", "emergency stop"]);
    emulator.wait();
    let report = scene.report();
    assert_eq!(report["axes"]["drive"]["chain_state"], "aborted");
    assert_eq!(report["ended_well"], false);
}
