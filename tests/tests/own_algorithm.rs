//! An own algorithm as a shared library, from its C file to the end of a run; and libraries that fail while the carriage moves.

use protocol::frames::{EmergencyStopReason, Frame};
use system_tests::bus_cycles::by_cycle;
use system_tests::{CompletedProcess, Pace, SHORT, Scene, c_algorithm, turn};

/// A scene whose drive is controlled by the scene's own_algorithm.so.
fn scene() -> Scene {
    let scene = Scene::new(SHORT);
    scene.write("program.toml", c_algorithm::PROGRAM);
    scene
}

/// Runs in lockstep to the controller's end, whichever it is.
fn run(scene: &Scene) -> CompletedProcess {
    let emulator = scene.emulator(Pace::Lockstep).with("--seconds 20").start();
    let ended = scene.controller(Pace::Lockstep).start().wait();
    emulator.wait();
    ended
}

#[test]
fn the_example_in_c_drives_the_experiment() {
    let scene = scene();
    c_algorithm::build_strictly(&scene, "controller/examples-c/position_pi.c");
    // A slow integral and a wide dead zone: with the defaults it hunts about the friction and never comes to rest.
    let tuned = "integral_time_s = 2.0\ndead_zone_m = 0.001\n";
    scene.write("program.toml", &format!("{}{tuned}", c_algorithm::PROGRAM));
    run(&scene).expect_code(0);
    let drive = &scene.report()["axes"]["drive"];
    assert_eq!(drive["chain_state"], "done");
    assert_eq!(drive["variables"]["algorithm.dead_zone_m"], 0.001, "its own parameter, by its own name");
    let error_m = drive["position_error_dynamic_m"].as_f64().expect("a figure");
    // 0.05 m in 0.4 s at 20 /s; it would be 0.05 m if nobody drove, and done needs 2 mm at rest.
    assert!(error_m < 0.03, "{error_m} m");
    let measured = scene.measurement();
    let last = measured.column("drive_position_m")[measured.len() - 1];
    assert!((last - 0.15).abs() < 0.002, "{last} m");
}

#[test]
fn a_library_that_returns_no_number_is_latched_with_the_valve_shut_and_trips_the_emergency_stop() {
    // While the carriage moves: its set-point is a quarter of a second long above this speed.
    let scene = scene();
    c_algorithm::failing(&scene, "count > 200 && ready->set_velocity_m_per_s > 0.1", &[]);
    let ended = run(&scene).expect_code(1);
    ended.expect_stderr(&["stopped before the end: drive: controller-fault", "returned NaN or infinity"]);
    let table = scene.axis_table("drive");
    let (velocity, enabled) = (table.numbers("set_velocity_m_per_s"), table.numbers("enabled"));
    let failed = velocity.iter().position(|velocity| *velocity > 0.1).expect("it got that far");
    assert_eq!(table.texts("main_chain")[failed], "experiment");
    assert!(enabled[10..failed].iter().all(|enabled| *enabled == 1.0), "the valve acts before");
    // In the very cycle, and for good, though the set-point is slower later on.
    assert!(enabled[failed..].iter().all(|enabled| *enabled == 0.0), "the valve is shut from then on");
    assert!(table.numbers("opening")[failed..].iter().all(|opening| *opening == 0.0));
    let stop = by_cycle(&scene.bus_log()).into_iter().find_map(|logged| match logged.frame {
        Frame::DriveEmergencyStop(stop) => Some((logged.cycle, stop)),
        _ => None,
    });
    let (cycle, stop) = stop.expect("the drive trips the emergency stop");
    assert_eq!(cycle, table.cycles()[failed] as u64, "in the same cycle");
    assert_eq!((stop.reason, stop.release), (EmergencyStopReason::ControllerFault, false));
    let report = scene.report();
    let fault = report["axes"]["drive"]["algorithm_fault"].as_str().expect("it is named");
    assert!(fault.contains("is not a number"), "{fault}");
    let valve = scene.measurement().column("drive_valve");
    let acts = cycle as usize + 1;
    assert!(valve[acts..].iter().all(|opening| *opening == 0.0), "what acts is shut a cycle later");
}

#[test]
fn an_infinite_result_during_the_approach_is_latched_too() {
    let scene = scene();
    c_algorithm::failing(&scene, "count == 300", &["-DRESULT=INFINITY"]);
    run(&scene).expect_code(1).expect_stderr(&["drive: controller-fault"]);
    let table = scene.axis_table("drive");
    let fault = table.first("main_chain", "fault", 0);
    assert_eq!(table.states("main_chain"), ["waiting-for-rig", "initial-positioning", "fault"]);
    assert!(table.numbers("enabled")[fault..].iter().all(|enabled| *enabled == 0.0));
}

/// Each step takes 2 ms for as long as the approach lasts: not too slow once, but ten times running.
#[test]
fn a_library_that_is_too_slow_is_latched_in_real_time_whatever_the_state() {
    let scene = scene();
    let slow = "count > 150 && (usleep(2000), 0)";
    c_algorithm::failing(&scene, slow, &["-D_DEFAULT_SOURCE", "-include", "unistd.h"]);
    let _machine = turn::take();
    let emulator = scene.emulator(Pace::Real).with("--seconds 20").start();
    let ended = scene.controller(Pace::Real).start().wait().expect_code(1);
    ended.expect_stderr(&["drive: controller-fault", "exceeded its time limit"]);
    let table = scene.axis_table("drive");
    let state = table.texts("main_chain")[table.first("main_chain", "fault", 0) - 1];
    assert_eq!(state, "initial-positioning", "latched where it became slow");
    drop(emulator);
}

#[test]
fn a_library_that_never_returns_ends_the_controller_with_what_was_recorded() {
    let scene = scene();
    c_algorithm::failing(
        &scene,
        "count > 200 && (pause(), 0)",
        &["-D_DEFAULT_SOURCE", "-include", "unistd.h"],
    );
    let _machine = turn::take();
    let emulator = scene.emulator(Pace::Real).with("--seconds 20").start();
    scene.controller(Pace::Real).start().wait().expect_code(1).expect_stderr(&["has not returned for 2 s"]);
    assert!(scene.report()["ended_because"].as_str().expect("a reason").contains("has not returned"));
    // All that was answered before is on disk.
    assert!(scene.axis_table("drive").cycles().len() > 150);
    drop(emulator);
}

#[test]
fn a_library_of_another_version_is_refused_before_anything_runs() {
    let scene = scene();
    c_algorithm::failing(&scene, "0", &["-DVERSION=99"]);
    let emulator = scene.emulator(Pace::Lockstep).with("--join-timeout 1").start();
    let ended = scene.controller(Pace::Lockstep).start().wait().expect_code(2);
    ended.expect_stderr(&["own_algorithm.so", "version", "99"]);
    assert!(!scene.path("controller/controller.json").exists(), "nothing ran");
    assert!(!scene.path("controller/controller-drive.csv").exists(), "nothing was made");
    emulator.wait().expect_code(3).expect_stderr(&["not all members joined"]);
}
