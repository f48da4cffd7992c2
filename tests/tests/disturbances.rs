//! Every disturbance of a run is named from its report alone; `scripts/disturb` does it ten times each, for the docs.

use std::time::Duration;
use system_tests::disturb::{self, Disturbance};
use system_tests::{skip, turn};

/// What other programs and the host may add to any run.
const OF_THE_MACHINE: [&str; 4] = ["cpu-contention", "machine-stood-still", "unexplained", "unknown"];

/// The report finds what was injected and, beside it, nothing but what the machine did meanwhile. Only contention by other
/// programs may be named before it: the report cannot know that it was not meant.
#[track_caller]
fn is_named(disturbance: Disturbance) {
    if disturbance.needs_root() && !rustix::process::geteuid().is_root() {
        return skip::report(&format!("{}_is_named", disturbance.name()), "needs root");
    }
    let _machine = turn::take();
    let named = disturb::run(disturbance, Duration::from_millis(700));
    let injected = disturbance.name();
    let found = |cause: &str| named.findings.iter().any(|finding| finding == cause);
    assert!(disturbance == Disturbance::Nothing || found(injected), "{injected} is not in {named:?}");
    let of_machine = |cause: &str| OF_THE_MACHINE.contains(&cause);
    let others: Vec<_> =
        named.findings.iter().filter(|cause| *cause != injected && !of_machine(cause)).collect();
    assert!(others.is_empty(), "nobody did {others:?}: {named:?}");
    assert!([injected, "cpu-contention"].contains(&named.cause.as_str()), "{named:?}");
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
