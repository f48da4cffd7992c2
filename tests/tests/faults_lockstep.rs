//! Faults of the lockstep barrier: nobody hangs, the culprit is named, the exit code says which kind it was.

use rustix::process::Signal;
use system_tests::exit::{BUS_FAILED, LOCKSTEP_TIMEOUT};
use system_tests::{Pace, RESTLESS, SHORT, Scene, both_good, count, expect_whole_lines};

fn expect_complete(scene: &Scene) {
    assert_eq!(count(&scene.summary(), "/cycles"), scene.measurement().len() as u64);
}

#[test]
fn a_member_that_is_never_done_ends_the_run_by_its_name() {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(Pace::Lockstep, 600);
    controller.signal(Signal::STOP);
    emulator
        .wait()
        .expect_code(LOCKSTEP_TIMEOUT)
        .expect_stderr(&["lockstep: 'controller' was not done within the time of --lockstep-timeout"]);
    expect_complete(&scene);
    controller.signal(Signal::CONT);
    let code = controller.wait().code;
    assert!(matches!(code, Some(BUS_FAILED | LOCKSTEP_TIMEOUT)), "the controller ends too, with {code:?}");
    let _ = expect_whole_lines(&scene.path("controller/controller-drive.csv"));
}

#[test]
fn a_barrier_that_nobody_joins_is_given_up() {
    let scene = Scene::new(SHORT);
    let emulator = scene.emulator(Pace::Lockstep).with("--join-timeout 0.3").start();
    emulator.wait().expect_code(BUS_FAILED).expect_stderr(&["not all members joined", "--members"]);
    assert_eq!(count(&scene.summary(), "/cycles"), 0);
}

#[test]
fn a_barrier_that_one_of_two_joins_is_given_up_and_the_one_ends_too() {
    let scene = Scene::new(SHORT);
    let (emulator, controller) = scene.start(Pace::Lockstep, "--members 2 --join-timeout 0.5", "");
    emulator.wait().expect_code(BUS_FAILED).expect_stderr(&["not all members joined"]);
    controller.wait().expect_code(BUS_FAILED);
}

#[test]
fn a_member_that_is_killed_ends_the_run_and_what_was_recorded_stays() {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(Pace::Lockstep, 600);
    controller.kill();
    emulator.wait().expect_code(BUS_FAILED).expect_stderr(&["all members left the barrier"]);
    expect_complete(&scene);
}

#[test]
fn an_emulator_that_is_killed_ends_the_member() {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(Pace::Lockstep, 600);
    emulator.kill();
    controller.wait().expect_code(BUS_FAILED);
    let rows = expect_whole_lines(&scene.path("controller/controller-drive.csv"));
    assert_eq!(count(&scene.report(), "/cycles_answered"), rows as u64);
}

#[test]
fn a_bus_without_a_barrier_is_given_up() {
    let scene = Scene::new(SHORT);
    let host = scene.bus_host("");
    let (emulator, controller) = scene.start(Pace::Lockstep, "--join-timeout 0.3", "--bus-grace 0.5");
    emulator.wait().expect_code(BUS_FAILED);
    controller.wait().expect_code(BUS_FAILED);
    drop(host);
}

/// A second emulator started by mistake on the bus of a lockstep run joined the barrier as the rig in the first one's
/// place: the first waited for a Go that never came, and lost its run ten seconds later.
#[test]
fn a_second_emulator_on_the_bus_does_not_take_the_first_ones_place() {
    let scene = Scene::new(RESTLESS);
    let (emulator, mut controller) = scene.start(Pace::Lockstep, "--seconds 60", "--repeat");
    controller.wait_for(": drive experiment");
    let second = scene.emulator(Pace::Lockstep).out(&scene.path("second")).with("--join-timeout 1").start();
    let second = second.wait();
    assert_eq!(second.code, Some(BUS_FAILED), "the second is refused; it said:\n{}", second.stderr);
    both_good(emulator, controller);
    assert_eq!(count(&scene.summary(), "/cycles"), 60_000);
}
