//! Every disturbance of a run is named from its report alone; `scripts/disturb` does it ten times each, for the docs.

use std::time::Duration;
use system_tests::disturb::{self, Disturbance};
use system_tests::{skip, turn};

#[track_caller]
fn is_named(disturbance: Disturbance) {
    if disturbance.needs_root() && !rustix::process::geteuid().is_root() {
        return skip::tell(&format!("{}_is_named", disturbance.name()), "needs root");
    }
    let _machine = turn::take();
    let named = disturb::run(disturbance, Duration::from_millis(700));
    assert_eq!(named.cause, disturbance.name(), "{}", named.sentence);
}

#[test]
fn nothing_is_named_nothing() {
    is_named(Disturbance::Nothing);
}

#[test]
fn a_stopped_emulator_is_named() {
    is_named(Disturbance::EmulatorStopped);
}

#[test]
fn a_stopped_controller_is_named() {
    is_named(Disturbance::ControllerStopped);
}

#[test]
fn a_cpu_hog_is_named() {
    is_named(Disturbance::CpuContention);
}

#[test]
fn a_storm_of_page_faults_is_named() {
    is_named(Disturbance::PageFaults);
}

#[test]
fn a_listener_that_does_not_read_is_named() {
    is_named(Disturbance::SlowListener);
}

#[test]
fn a_lossy_wire_is_named() {
    is_named(Disturbance::FrameLoss);
}

#[test]
fn a_step_of_the_wall_clock_is_named() {
    is_named(Disturbance::ClockStep);
}
