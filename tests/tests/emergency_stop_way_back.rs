//! Emergency stop at full speed and the way back: the air stays in the chambers, the carriage stands, and it begins anew
//! where it is.
//!
//! Times and ways are the rig's; they are reported, and held against what `bench summary` makes of the same files.

use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame, RunControl, RunControlCommand};
use rustix::process::Signal;
use serde_json::Value;
use system_tests::bus_cycles::by_cycle;
use system_tests::{
    AxisTable, CompletedProcess, LINKED, Pace, Program, Scene, Table, bus_log, c_algorithm, json, turn,
};

/// 0.3 m in 0.5 s: 1.2 m/s at its fastest, which the valve gives for a moment only.
const FAST: &str = include_str!("../scenes/fast.toml");
/// The experiment begins in cycle 710, and half of the way is done 250 ms later.
const TRIP: usize = 1000;
const RELEASE: usize = 2500;
/// 0.2 s after the supply is back at nine tenths, 0.65 s after the release, and some.
const START: usize = 4000;
const CHAMBERS: [&str; 4] =
    ["drive_stored_air_a_J", "drive_stored_air_b_J", "load_stored_air_a_J", "load_stored_air_b_J"];
/// A Bestehorn sinoid at 0.1 m/s on average reaches twice that; half as much again for the control error.
const RESTART_M_PER_MS: f64 = 0.3e-3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StopSource {
    Bus,
    /// The script at the rig's own button.
    Rig,
    /// The drive's controller, whose algorithm returns no number at full speed.
    Controller,
}

fn stop(release: bool) -> Frame {
    Frame::ConsoleEmergencyStop(EmergencyStop { reason: EmergencyStopReason::Operator, release })
}

/// Runs with a console that says something in some cycles, everything into one folder. Returns how the controller ended.
fn run(scene: &Scene, mut say: impl FnMut(usize) -> Option<Frame>) -> CompletedProcess {
    let out = scene.path("run");
    let options = "--members 2 --seconds 30";
    let emulator = scene.emulator(Pace::Lockstep).out(&out).with(options).start();
    let controller = scene.controller(Pace::Lockstep).out(&out).start();
    scene.peer().be_console(|cycle| say(cycle as usize));
    emulator.wait();
    controller.wait()
}

fn tripped(source: StopSource) -> Scene {
    let script = format!("[[rig.event]]\nat_s = {}\ndo = \"emergency-stop\"\n", TRIP as f64 * 1e-3);
    let scene = Scene::new(&if source == StopSource::Rig { format!("{FAST}{script}") } else { FAST.into() });
    if source == StopSource::Controller {
        c_algorithm::failing(&scene, "count > 200 && ready->set_position_m > 0.28", &[]);
        scene.write("program.toml", c_algorithm::PROGRAM);
    }
    let ended = run(&scene, |cycle| (source == StopSource::Bus && cycle == TRIP).then(|| stop(false)));
    let cause =
        if source == StopSource::Controller { "controller-fault" } else { "the emergency stop is tripped" };
    ended.expect_code(1).expect_stderr(&["stopped before the end: drive", cause]);
    scene
}

fn figures(scene: &Scene) -> Value {
    // Its code is that of the run, which was stopped; its figures are what is wanted.
    Program::Bench.start(&[&"summary", &scene.path("run")]).wait();
    json(&scene.path("run/summary.json"))
}

fn first(column: &[f64], from: usize, what: impl Fn(f64) -> bool) -> usize {
    from + column[from..].iter().position(|value| what(*value)).expect("it happens")
}

#[test]
fn at_full_speed_the_carriage_stands_in_time_and_the_air_stays_in_the_chambers_whoever_trips() {
    for source in [StopSource::Bus, StopSource::Rig, StopSource::Controller] {
        let scene = tripped(source);
        let truth = Table::read(&scene.path("run/truth.csv"));
        let supply = truth.column("supply_pressure_Pa");
        let velocity = truth.column("drive_rod_velocity_m_per_s");
        let position = truth.column("drive_position_m");
        let fell = first(&supply, 0, |pressure| pressure < 700_000.0);
        let trip = fell - 1;
        assert!((TRIP - 60..TRIP + 60).contains(&trip), "{source:?}: tripped in cycle {trip}");
        assert!(velocity[trip] > 0.5, "{source:?}: {} m/s is no full speed", velocity[trip]);
        let slow = |from: &usize| velocity[*from..*from + 100].iter().all(|speed| speed.abs() < 1e-3);
        let rest = (trip..velocity.len() - 100).find(slow).expect("it comes to rest");
        let way_m = position[rest] - position[trip];
        eprintln!(
            "{source:?}: at {:.2} m/s, {} ms and {:.1} mm to standstill",
            velocity[trip],
            rest - trip,
            way_m * 1e3
        );
        // Viscous friction of 1.1 kN s/m against trapped air of some 6 kN/m: 0.2 s, seven times that from 0.7 m/s to 1 mm/s, and
        // b v / k of way at most, which the stroke leaves.
        assert!(rest - trip < 2000, "{source:?}: {} ms", rest - trip);
        assert!(way_m > 0.0 && way_m < 0.2, "{source:?}: {way_m} m");

        let shut = truth.column("check_valves_shut");
        let shut_from = first(&shut, trip, |shut| shut != 0.0);
        // Discharge with 0.05 s: 7 bar fall below 2.5 bar after 70 ms.
        assert!((65..76).contains(&(shut_from - trip)), "{source:?}: shut after {} ms", shut_from - trip);
        assert!(shut[shut_from..].iter().all(|shut| *shut == 1.0), "{source:?}: and stay shut");
        assert!(shut.len() - shut_from > 1000);
        for chamber in CHAMBERS {
            let air = &truth.column(chamber)[shut_from..];
            let change = air.iter().map(|stored| (stored / air[0] - 1.0).abs()).fold(0.0, f64::max);
            assert!(change < 1e-9, "{source:?}: {chamber} changes by {change} of its air");
        }
        let summary = figures(&scene);
        let figure = |name: &str| {
            summary["figures"][name].as_f64().unwrap_or_else(|| panic!("{source:?}: no {name}: {summary:#}"))
        };
        assert!((figure("stop_time_s") - (rest - trip) as f64 * 1e-3).abs() < 2.5e-3, "{source:?}");
        assert!((figure("stop_way_m") - way_m).abs() < 1e-3, "{source:?}");
        assert!(figure("air_mass_change_while_shut_ratio") < 1e-9, "{source:?}");
    }
}

/// Stops, releases and starts again; the aborted repetition is driven anew.
fn back(after: &str) -> Scene {
    let scene = Scene::new(&FAST.replace("\"end\"", &format!("\"{after}\"")));
    let start = Frame::RunControl(RunControl { command: RunControlCommand::Start, experiment: 7 });
    let ended = run(&scene, |cycle| match cycle {
        TRIP => Some(stop(false)),
        RELEASE => Some(stop(true)),
        START => Some(start),
        _ => None,
    });
    ended.expect_code(0);
    scene
}

fn expect_smooth_restart(scene: &Scene, after: &str) -> AxisTable {
    let drive = AxisTable::read(&scene.path("run/controller-drive.csv"));
    let aborted = drive.first("main_chain", "aborted", 0);
    assert_eq!(drive.cycles()[aborted], TRIP + 1, "heard in the next cycle");
    assert_eq!(drive.texts("main_chain")[aborted - 1], "experiment");
    let again = drive.first("main_chain", "initial-positioning", aborted);
    assert!(drive.numbers("enabled")[aborted..again].iter().all(|enabled| *enabled == 0.0), "{after}");
    // Where the carriage is: the sensor's noise is 20 um, and the sinoid begins with nothing.
    let (set, is) = (drive.numbers("set_position_m")[again], drive.numbers("position_m")[again]);
    assert!(
        (set - is).abs() < 1e-4,
        "{after}: the set-point begins at {set} m, the carriage stands at {is} m"
    );
    assert!((is - 0.1).abs() > 0.1, "{after}: far from the start, at {is} m");

    let truth = Table::read(&scene.path("run/truth.csv"));
    let (shut, position) = (truth.column("check_valves_shut"), truth.column("drive_position_m"));
    let shut_from = first(&shut, TRIP, |shut| shut != 0.0);
    let open = first(&shut, shut_from, |shut| shut == 0.0);
    let begins = drive.cycles()[again];
    assert!(open > RELEASE && begins > open, "{after}: open in {open}, begins in {begins}");
    let settled = drive.cycles()[drive.first("main_chain", "settling", again)];
    let jump = |rows: std::ops::Range<usize>| {
        let steps = position[rows].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        steps * 1e3
    };
    let (creep, restart) = (jump(open..begins), jump(begins..settled));
    eprintln!(
        "{after}: at most {creep:.3} mm/ms while the supply comes back, {restart:.3} mm/ms on the way to the start"
    );
    assert!(creep < RESTART_M_PER_MS * 1e3 && restart < RESTART_M_PER_MS * 1e3, "{after}");

    assert_eq!(drive.states("main_chain").iter().filter(|state| **state == "experiment").count(), 2);
    let report = json(&scene.path("run/controller.json"));
    assert_eq!(report["axes"]["drive"]["repetitions_done"], 1, "{after}: the aborted one, again");
    let last = position[position.len() - 1];
    assert!((last - 0.4).abs() < 0.002, "{after}: driven to its end, {last} m");
    drive
}

#[test]
fn with_restart_the_aborted_repetition_begins_anew_by_itself_without_a_jump() {
    let scene = back("restart");
    let drive = expect_smooth_restart(&scene, "restart");
    let chain = ["ready", "tripped", "waiting-for-release", "recovering", "ready"];
    assert_eq!(drive.states("emergency_stop_chain"), chain);
    let begins = drive.cycles()[drive.first("main_chain", "initial-positioning", TRIP)];
    assert!(begins < START, "by itself, in cycle {begins}");
    let summary = figures(&scene);
    let jump = summary["figures"]["restart_jump_m"].as_f64().expect("bench summary tells it");
    eprintln!("bench summary: {:.2} mm in the 0.2 s after the valve is commanded again", jump * 1e3);
    // A sinoid of at least 0.5 s, and where the carriage was released at all.
    assert!(jump < 200.0 * RESTART_M_PER_MS, "{jump} m");
}

#[test]
fn on_start_the_aborted_repetition_waits_for_the_console_and_begins_anew_without_a_jump() {
    let drive = expect_smooth_restart(&back("on-start"), "on-start");
    let chain = ["ready", "tripped", "waiting-for-release", "recovering", "waiting-for-start", "ready"];
    assert_eq!(drive.states("emergency_stop_chain"), chain);
    let begins = drive.cycles()[drive.first("main_chain", "initial-positioning", TRIP)];
    assert!((START + 1..START + 4).contains(&begins), "{begins}");
}

/// The first time that the set-point is past 0.28 m, and never again.
const FAILS_ONCE: &str = "({ static int failed; const int now = !failed && count > 200 && ready->set_position_m > 0.28; failed |= now; now; })";

#[test]
fn a_controllers_own_fault_is_released_by_the_console_and_the_repetition_begins_anew() {
    let scene = Scene::new(&FAST.replace("\"end\"", "\"restart\""));
    c_algorithm::failing(&scene, FAILS_ONCE, &[]);
    scene.write("program.toml", c_algorithm::PROGRAM);
    run(&scene, |cycle| (cycle == RELEASE).then(|| stop(true))).expect_code(0);
    let drive = AxisTable::read(&scene.path("run/controller-drive.csv"));
    let chain = ["ready", "tripped", "waiting-for-release", "recovering", "ready"];
    assert_eq!(drive.states("emergency_stop_chain"), chain);
    let states = drive.states("main_chain");
    assert_eq!(states.iter().filter(|state| **state == "fault").count(), 1, "{states:?}");
    assert_eq!(states.iter().filter(|state| **state == "experiment").count(), 2, "{states:?}");
    assert_eq!(states.last(), Some(&"done"));
    let withdrawn = by_cycle(&bus_log(&scene.path("run/bus.log")))
        .into_iter()
        .filter(|logged| matches!(logged.frame, Frame::DriveEmergencyStop(stop) if stop.release));
    assert_eq!(withdrawn.count(), 1, "it withdraws its own stop with one frame");
}

#[test]
fn a_partner_that_was_lost_and_is_back_lets_the_run_begin_anew_after_the_release() {
    let _machine = turn::take();
    let scene = Scene::new(&LINKED.replace("[run]\n", "[run]\nafter_emergency_stop = \"restart\"\n"));
    let emulator = scene.emulator(Pace::Real).start();
    let [mut drive, load] = ["drive", "load"].map(|axis| scene.axis_controller(Pace::Real, axis).start());
    drive.wait_for("experiment: ");
    load.signal(Signal::STOP);
    drive.wait_for("partner-lost");
    load.signal(Signal::CONT);
    // The load has heard of it, and tripped is left after 1 s at the latest.
    scene.wait_for_more_rows("emulator", 1500);
    scene.peer().send_frame(&stop(true));
    for controller in [drive, load] {
        controller.wait().expect_code(0);
    }
    emulator.signal(Signal::INT);
    emulator.wait();
    for (axis, ended) in [("drive", "fault"), ("load", "aborted")] {
        let table = scene.axis_table(axis);
        let states = table.states("main_chain");
        assert!(states.contains(&ended), "{axis}: {states:?}");
        assert_eq!(states.iter().filter(|state| **state == "experiment").count(), 2, "{axis}: {states:?}");
        assert_eq!(states.last(), Some(&"done"), "{axis}");
    }
}

#[test]
fn nothing_starts_or_is_released_while_the_stop_is_held() {
    let scene = Scene::new(&FAST.replace("\"end\"", "\"restart\""));
    let held = run(&scene, |cycle| (cycle == TRIP).then(|| stop(false)));
    held.expect_code(1).expect_stderr(&["drive: the emergency stop is tripped"]);
    let drive = AxisTable::read(&scene.path("run/controller-drive.csv"));
    assert_eq!(drive.states("emergency_stop_chain").last(), Some(&"waiting-for-release"));
    assert!(drive.numbers("enabled")[TRIP + 2..].iter().all(|enabled| *enabled == 0.0), "shut for 29 s");
    let released = by_cycle(&bus_log(&scene.path("run/bus.log")))
        .into_iter()
        .any(|logged| matches!(logged.frame, Frame::DriveEmergencyStop(_) | Frame::LoadEmergencyStop(_)));
    assert!(!released, "the controllers hold no stop of their own, and withdraw none");
}
