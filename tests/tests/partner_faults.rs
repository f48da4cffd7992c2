//! A process for each axis, and one of them fails the other: a safe state within a stated time, by name, and nothing else stops.
//!
//! Times are the rig's own, counted in its cycles; what the machine takes is nobody's business here. A partner is lost 100 cycles
//! after its last status, which it sends each 10: at most 110 after it died, and one for the way of a frame.

use protocol::frames::{
    EmergencyStop, EmergencyStopReason, Frame, RunControl, RunControlCommand, ValveCommand,
};
use rustix::process::Signal;
use system_tests::bus_cycles::{LoggedFrame, by_cycle};
use system_tests::exit::BOUND_BROKEN;
use system_tests::{
    CompletedProcess, LINKED, Pace, Running, SHORT, Scene, bus_log_to_last_whole_line, count, events, json,
    run_both, turn,
};

/// Range of the echo as rig.dbc has it, not as the code does.
const ECHO_RANGE: u64 = 4096;
/// Cycles from the partner's last frame to the emergency stop.
const LOST_AT_LATEST: u64 = LOST_AFTER + 10 + 1;
/// Cycles from its last status.
const LOST_AFTER: u64 = 100;

/// The axis that fails, and the other.
const PAIRS: [(&str, &str); 2] = [("load", "drive"), ("drive", "load")];

/// The linked experiment with so much more to do that it is under way when it is disturbed.
fn long() -> String {
    LINKED.replace("duration_s = 0.5", "duration_s = 60.0")
}

struct PairRun {
    scene: Scene,
    emulator: Running,
    failing: Running,
    other: Running,
}

impl PairRun {
    /// Both controllers in the middle of the experiment.
    fn in_experiment(pace: Pace, failing: &str, other: &str) -> Self {
        let scene = Scene::new(&long());
        let members = if pace == Pace::Lockstep { "--members 2" } else { "" };
        let emulator = scene.emulator(pace).with(members).start();
        let [failing, mut other] = [failing, other].map(|axis| scene.axis_controller(pace, axis).start());
        other.wait_for("experiment: ");
        let mut run = Self { scene, emulator, failing, other };
        run.scene.wait_for_more_rows("emulator", 600);
        run.other.wait_for("experiment: ");
        run
    }
}

fn command(frame: &Frame, axis: &str) -> Option<ValveCommand> {
    match (axis, frame) {
        ("drive", Frame::DriveValveCommand(command)) | ("load", Frame::LoadValveCommand(command)) => {
            Some(*command)
        }
        _ => None,
    }
}

fn stop(frame: &Frame, axis: &str) -> Option<EmergencyStop> {
    match (axis, frame) {
        ("drive", Frame::DriveEmergencyStop(stop)) | ("load", Frame::LoadEmergencyStop(stop)) => Some(*stop),
        _ => None,
    }
}

fn is_status(frame: &Frame, axis: &str) -> bool {
    matches!((axis, frame), ("drive", Frame::DriveChainStatus(_)) | ("load", Frame::LoadChainStatus(_)))
}

/// Holds what the log says of an axis that was lost and of the other, which trips the emergency stop. The time is counted by the
/// echoes of their commands, which name the rig's cycles also where some were skipped.
#[track_caller]
fn expect_lost(log: &[LoggedFrame], lost: &str, other: &str, grace: u64) {
    let tripped = log.iter().position(|logged| stop(&logged.frame, other).is_some());
    let tripped = tripped.unwrap_or_else(|| panic!("{other} never trips the emergency stop"));
    let call = stop(&log[tripped].frame, other).expect("found by it");
    assert_eq!(call, EmergencyStop { reason: EmergencyStopReason::PartnerLost, release: false });
    // The command of the same cycle stands before it or after it: on a bus the emergency stop goes first.
    let commands =
        |of: &[LoggedFrame]| of.iter().filter_map(|logged| command(&logged.frame, other)).collect::<Vec<_>>();
    let (before, after) = (commands(&log[..tripped]), commands(&log[tripped..]));
    assert!(before.len() > 1000 && after.len() > 1000, "{} and {} commands", before.len(), after.len());
    assert!(before[..before.len() - 1].iter().any(|command| command.enable), "{other} was under way");
    let open = after.iter().find(|command| command.enable || command.opening != 0.0);
    assert_eq!(open, None, "{other} opens its valve after the trip");
    let last = before[before.len() - 1];
    let shut = if last.enable { after[0] } else { last };
    let spoke = |what: &dyn Fn(&Frame) -> bool| {
        let place = log[..tripped].iter().rposition(|logged| what(&logged.frame)).expect("it spoke before");
        // Named by the sensors that its last command until then answers.
        let named = log[..=place].iter().rev().find_map(|logged| command(&logged.frame, lost));
        u64::from(named.expect("it commanded before").echo)
    };
    let passed = |since: u64| (u64::from(shut.echo) + ECHO_RANGE - since) % ECHO_RANGE;
    let since_status = passed(spoke(&|frame| is_status(frame, lost)));
    let since_death = passed(spoke(&|frame| command(frame, lost).is_some()));
    eprintln!(
        "{lost} lost: {since_status} cycles after its last status, {since_death} after its last command"
    );
    assert!(since_status >= LOST_AFTER, "{lost} was given up {since_status} cycles after its last status");
    assert!(since_death <= LOST_AT_LATEST + grace, "{lost} was given up {since_death} cycles after its end");
}

fn expect_partner_lost(ended: CompletedProcess, axis: &str) -> CompletedProcess {
    let named = format!("stopped before the end: {axis}: partner-lost");
    ended.expect_code(BOUND_BROKEN).expect_stderr(&[named.as_str(), "fell silent for 100 ms"])
}

#[test]
fn a_controller_that_is_killed_is_noticed_by_the_other_which_shuts_its_valve_and_trips_the_emergency_stop() {
    for (lost, other) in PAIRS {
        let PairRun { scene, emulator, failing, other: left } =
            PairRun::in_experiment(Pace::Lockstep, lost, other);
        failing.kill();
        expect_partner_lost(left.wait(), other);
        // Two seconds after the fault nobody is left in the barrier.
        emulator.wait().expect_code(3);
        expect_lost(&by_cycle(&scene.bus_log()), lost, other, 0);
        let report = json(&scene.path("controller").join(format!("controller-{other}.json")));
        assert_eq!(report["axes"][other]["chain_state"], "fault");
        assert_eq!(report["axes"][other]["emergency_stop_state"], "waiting-for-release");
        let measurement = scene.measurement();
        let supply = scene.truth().column("supply_pressure_Pa");
        // Discharge with 0.05 s, for the 2 s that the controller keeps its valve shut.
        assert!((supply[supply.len() - 1] - 101_325.0).abs() < 1.0, "the supply is discharged");
        for valve in ["drive_valve", "load_valve"] {
            let openings = measurement.column(valve);
            assert!(openings.iter().any(|opening| *opening != 0.0), "{valve} moved before");
            let still = &openings[openings.len() - 1800..];
            assert!(still.iter().all(|opening| *opening == 0.0), "{valve} is shut afterwards");
        }
    }
}

#[test]
fn a_controller_that_stands_still_is_noticed_by_the_other_and_ends_too_when_it_goes_on() {
    let _machine = turn::take();
    for (lost, other) in PAIRS {
        let PairRun { scene, mut emulator, failing, other: left } =
            PairRun::in_experiment(Pace::Real, lost, other);
        failing.signal(Signal::STOP);
        emulator.wait_for("emergency stop");
        failing.signal(Signal::CONT);
        expect_partner_lost(left.wait(), other);
        failing.wait().expect_code(BOUND_BROKEN).expect_stderr(&["stopped before the end"]);
        emulator.interrupt();
        // In real time the last status may have been a cycle that was missed: one more period.
        expect_lost(&by_cycle(&scene.bus_log()), lost, other, 10);
    }
}

#[test]
fn a_controller_whose_partner_never_comes_gives_up_after_10_s_and_says_what_to_do() {
    for axis in ["drive", "load"] {
        let scene = Scene::new(LINKED);
        let emulator = scene.emulator(Pace::Lockstep).start();
        let controller = scene.axis_controller(Pace::Lockstep, axis).start();
        let ended = controller.wait().expect_code(BOUND_BROKEN);
        ended.expect_stderr(&["partner-missing", "was not heard", "start it, or use --alone"]);
        emulator.wait();
        let table = scene.axis_table(axis);
        let fault = table.cycles()[table.first("main_chain", "fault", 0)];
        // Ten seconds of the rig's time from the first sensors and status on.
        assert!((10_000..10_020).contains(&fault), "given up in cycle {fault}");
        assert!(table.numbers("enabled").iter().all(|enabled| *enabled == 0.0), "the valve was never opened");
    }
}

#[test]
fn alone_no_partner_is_waited_for_nor_missed() {
    let scene = Scene::new(SHORT);
    run_both(
        &scene.emulator(Pace::Lockstep),
        &scene.axis_controller(Pace::Lockstep, "drive").with("--alone"),
    );
    let report = json(&scene.path("controller/controller-drive.json"));
    assert_eq!(report["axes"]["drive"]["chain_state"], "done");
    assert!(count(&report, "/cycles_answered") > 1500);
    // Both axes of one process are never alone.
    let refused = scene.controller(Pace::Lockstep).with("--alone").start().wait();
    refused.expect_code(2).expect_stderr(&["--alone needs --axis drive or --axis load"]);
}

#[test]
fn controllers_with_different_experiments_do_not_move_the_rig() {
    let scene = Scene::new(LINKED);
    let other = scene.write("other.toml", &LINKED.replace("number = 5", "number = 6"));
    let emulator = scene.emulator(Pace::Lockstep).with("--members 2").start();
    let drive = scene.axis_controller(Pace::Lockstep, "drive").start();
    let load = scene.axis_controller(Pace::Lockstep, "load").experiment(&other).start();
    for controller in [drive, load] {
        controller.wait().expect_code(BOUND_BROKEN).expect_stderr(&["stopped before the end"]);
    }
    emulator.wait();
    let said = ["drive", "load"].map(|axis| {
        let report = json(&scene.path("controller").join(format!("controller-{axis}.json")));
        report["axes"][axis]["chain_cause"].as_str().expect("a cause").to_owned()
    });
    assert!(said.iter().any(|cause| cause.contains("give both the same file")), "{said:?}");
    let measurement = scene.measurement();
    for valve in ["drive_valve", "load_valve"] {
        assert!(measurement.column(valve).iter().all(|opening| *opening == 0.0), "{valve}");
    }
}

#[test]
fn frames_lost_on_the_wire_do_not_stop_a_run() {
    let scene = Scene::new(LINKED);
    let lossy = format!("{}?loss=0.05&seed=3", scene.url());
    let emulator = scene.emulator(Pace::Lockstep).bus(lossy).with("--members 2").start();
    let controllers = ["drive", "load"].map(|axis| scene.axis_controller(Pace::Lockstep, axis).start());
    emulator.wait().expect_code(0);
    controllers.into_iter().for_each(|controller| drop(controller.wait().expect_code(0)));
    let summary = scene.summary();
    let lost = |id: &str| count(&summary, &format!("/bus_host/injected_loss/{id}"));
    // Of some 500 each: status of both chains.
    assert!(lost("150") > 10 && lost("152") > 10, "{:#}", summary["bus_host"]["injected_loss"]);
    assert_eq!(events::times(&events::all(&summary), "emergency-stop"), 0);
}

/// Runs both controllers beside a console that says something in a cycle.
fn with_console(
    experiment: &str,
    cycles: u32,
    say: impl FnMut(u32) -> Option<Frame>,
) -> (Scene, [CompletedProcess; 2]) {
    let scene = Scene::new(experiment);
    let options = format!("--members 3 --seconds {}", f64::from(cycles) * 1e-3);
    let emulator = scene.emulator(Pace::Lockstep).with(&options).start();
    let controllers = ["drive", "load"].map(|axis| scene.axis_controller(Pace::Lockstep, axis).start());
    scene.peer().be_console(say);
    emulator.wait();
    (scene, controllers.map(Running::wait))
}

fn run_control(command: RunControlCommand, experiment: u8) -> Option<Frame> {
    Some(Frame::RunControl(RunControl { command, experiment }))
}

#[test]
fn an_abort_by_the_console_stops_both_without_an_emergency_stop() {
    const ABORT: u32 = 3500;
    let say = |cycle| if cycle == ABORT { run_control(RunControlCommand::Abort, 0) } else { None };
    let (scene, ended) = with_console(&long(), 20_000, say);
    for ended in ended {
        ended.expect_code(BOUND_BROKEN).expect_stderr(&["aborted: the console ended the run"]);
    }
    for axis in ["drive", "load"] {
        let table = scene.axis_table(axis);
        let aborted = table.first("main_chain", "aborted", 0);
        // Said in a cycle, heard in the next.
        assert_eq!(table.cycles()[aborted], ABORT as usize + 1, "{axis}");
        assert_eq!(table.texts("main_chain")[aborted - 1], "experiment", "{axis} was under way");
        assert!(table.numbers("enabled")[aborted..].iter().all(|enabled| *enabled == 0.0), "{axis}");
        assert_eq!(table.states("emergency_stop_chain"), ["ready"], "{axis}");
    }
    let log = by_cycle(&bus_log_to_last_whole_line(&scene.path("emulator/bus.log")));
    let stops =
        log.iter().filter(|logged| ["drive", "load"].iter().any(|axis| stop(&logged.frame, axis).is_some()));
    assert_eq!(stops.count(), 0, "no emergency stop");
    let supply = scene.truth().column("supply_pressure_Pa");
    assert!(supply.iter().all(|pressure| *pressure == 700_000.0), "the supply stays");
}

#[test]
fn a_run_that_starts_on_command_waits_in_settling_for_its_own_number() {
    const START: u32 = 15_000;
    let on_start = LINKED.replacen("[run]\n", "[run]\nstart = \"on-start\"\n", 1);
    let say = |cycle| match cycle {
        6000 => run_control(RunControlCommand::Start, 77),
        START => run_control(RunControlCommand::Start, 5),
        _ => None,
    };
    let (scene, ended) = with_console(&on_start, 60_000, say);
    ended.into_iter().for_each(|ended| drop(ended.expect_code(0)));
    for axis in ["drive", "load"] {
        let table = scene.axis_table(axis);
        let settling = table.cycles()[table.first("main_chain", "settling", 0)];
        assert!(settling < 4000, "{axis} was ready for long: {settling}");
        let began = table.cycles()[table.first("main_chain", "experiment", 0)];
        // Heard in the next cycle; the other's OK comes another one later.
        let expected = START as usize + 1..=START as usize + 3;
        assert!(expected.contains(&began), "{axis} began in cycle {began}");
    }
}
