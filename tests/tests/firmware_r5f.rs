//! The firmware on the Cortex-R5F of Debian's QEMU, unmodified, under `bench can` and in real time: `scripts/qemu-r5f`.
//!
//! For function: what QEMU does late is not judged.

use protocol::frames::{Frame, MainChainState};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::time::Duration;
use system_tests::firmware::{Positioned, build, positioned_where_it_ran};
use system_tests::foreign_python::{python, tools_path};
use system_tests::stalls::StallDetector;
use system_tests::{
    Build, PATIENCE, Pace, Packet, Program, Running, Scene, count, executable, shipped_programs, turn,
    workspace,
};
use tempfile::TempDir;

/// The first of two repetitions: out, a rest, back, a rest.
const REPETITION_CYCLES: u32 = 8_000;
/// How often a machine may stand still for too long.
const ATTEMPTS: usize = 3;
/// A program that was kept from a processor for so long may have missed what has to happen within 20 cycles.
const STALL: Duration = Duration::from_millis(15);
/// QEMU 7.2 ends so when a frame meets a receive FIFO that is full and half read, as that of a core may be that was held up
/// (docs/qemu.md).
const QEMU_BROKE: &str = "fifo8_push: Assertion";

static BUILT: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for elf in ["firmware-qemu-r5f.elf", "firmware-zynqmp-r5f.elf"] {
        build(folder.path(), &[folder.path().join(elf).to_str().expect("text")]);
    }
    folder
});

fn elf() -> PathBuf {
    BUILT.path().join("firmware-qemu-r5f.elf")
}

/// The same, but that it takes sensors for lost after half a second: to its clock a machine that stands still is a rig that is
/// silent.
fn patient_elf(folder: &Path) -> PathBuf {
    for codec in ["rig.c", "rig.h"] {
        std::fs::copy(BUILT.path().join(codec), folder.join(codec)).expect("the codec");
    }
    let elf = folder.join("firmware-qemu-r5f.elf");
    build(folder, &["DEFINES=-DSENSORS_LOST_MS=500", elf.to_str().expect("text")]);
    elf
}

fn scene() -> Scene {
    Scene::new("title = \"r5f\"\n[rig]\ncarriage_position_m = 0.15\n")
}

/// `scripts/qemu-r5f`, before what only computes, if that is allowed.
fn script() -> Command {
    let mut command = Command::new("nice");
    command.args(["-n", "-10"]).arg(workspace().join("scripts/qemu-r5f"));
    command.env("AIRBENCH_BIN_DIR", shipped_programs()).env("PATH", tools_path());
    command
}

fn qemu(scene: &Scene, elf: &Path) -> Command {
    let mut command = script();
    command.arg("--elf").arg(elf).arg("--bus").arg(scene.url());
    command
}

/// Returns so many cycles after the firmware began its experiment.
fn until_in_experiment(scene: &Scene, cycles: u32) {
    let peer = scene.peer();
    let (mut now, mut began) = (0, None);
    while began.is_none_or(|began| now < began + cycles) {
        let Some(Packet::Frame(frame)) = peer.receive(PATIENCE) else { panic!("the rig has gone") };
        match Frame::decode(&frame) {
            Ok(Frame::Tick(tick)) => now = tick.cycle,
            Ok(Frame::DriveChainStatus(status)) if status.main_chain == MainChainState::Experiment => {
                began.get_or_insert(now);
            }
            _ => {}
        }
    }
}

/// One repetition; `None` when the machine stood still for so long that nothing can be said.
fn positions(elf: &Path) -> Option<Positioned> {
    let scene = scene();
    let emulator = scene.emulator(Pace::Real).with("--seconds 200").start();
    let qemu = Running::start("qemu-r5f", &mut qemu(&scene, elf));
    until_in_experiment(&scene, REPETITION_CYCLES + 10);
    emulator.interrupt().expect_code(130);
    let ended = qemu.wait();
    if ended.stderr.contains(QEMU_BROKE) {
        return None;
    }
    // Its bus has gone with the rig.
    ended.expect_code(0);
    let summary = scene.summary();
    assert_eq!(count(&summary, "/frames_malformed"), 0);
    eprintln!("{}", summary["drive_commands"]);
    assert_eq!(count(&summary, "/drive_commands/breaks"), 0, "its counters go up by one");
    let done = positioned_where_it_ran(&scene.bus_log(), 1);
    eprintln!("{done:?}");
    (done.rests > 0 && done.cycles > done.left_out).then_some(done)
}

#[test]
fn it_positions_within_the_bounds_in_real_time() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let elf = patient_elf(folder.path());
    let _turn = turn::take();
    let done = (1..=ATTEMPTS)
        .find_map(|attempt| {
            let stalls = StallDetector::of(elf.to_str().expect("text"));
            let done = positions(&elf);
            let stalled = stalls.longest();
            eprintln!("attempt {attempt} of {ATTEMPTS}: kept from running for {stalled:?}");
            // Nothing but a machine that stood still is a reason to try it again.
            done.filter(|done| done.keeps_the_bounds() || stalled < STALL || attempt == ATTEMPTS)
        })
        .expect("a machine that does not stand still");
    assert!(done.set_points > 100 && done.keeps_the_bounds(), "{done:?}");
    assert!(done.position_error_dynamic_m > 5e-4, "a real loop has errors: {done:?}");
}

/// The checks of function. Its times, and whether it answers all sensors, are QEMU's and this machine's.
const CHECKS: [&str; 15] = [
    "regular answers",
    "regular every-cycle",
    "regular length",
    "regular checksum",
    "regular reserved-bits",
    "regular range",
    "regular counter",
    "regular identifiers",
    "noise every-cycle",
    "emergency-stop valve-shut",
    "emergency-stop to-the-end",
    "sensor-loss valve-shut",
    "sensor-loss no-invented-echo",
    "sensor-loss told",
    "sensor-loss to-the-end",
];

/// What the check of controllers prints, and which of [`CHECKS`] did not pass.
fn checked() -> (String, Vec<&'static str>) {
    let mut check = Program::Bench.command();
    check.args(["check-controller", "--seconds", "1", "--missing", "0.2", "--patience", "60", "--"]);
    let script = script();
    check.arg(script.get_program()).args(script.get_args());
    check.envs(script.get_envs().filter_map(|(name, value)| Some((name, value?))));
    check.arg("--elf").arg(elf()).args(["--bus", "{bus}"]);
    let ended = Running::start("check", &mut check).wait();
    eprintln!("{}", ended.stdout);
    let passed = |name: &&str| {
        let line = ended.stdout.lines().find(|line| line.contains(name));
        line.is_some_and(|line| line.contains("passed"))
    };
    let others = CHECKS.into_iter().filter(|name| !passed(name)).collect();
    (ended.stdout + &ended.stderr, others)
}

#[test]
fn the_check_of_controllers_passes_its_function() {
    let elf = elf();
    let _turn = turn::take();
    for attempt in 1..=ATTEMPTS {
        let stalls = StallDetector::of(elf.to_str().expect("text"));
        let (words, others) = checked();
        let stalled = stalls.longest();
        eprintln!(
            "attempt {attempt} of {ATTEMPTS}: not passed: {others:?}; kept from running for {stalled:?}"
        );
        if others.is_empty() {
            return;
        }
        // Nothing but a machine that stood still is a reason to try it again.
        assert!(stalled >= STALL && attempt < ATTEMPTS, "{others:?}, {stalled:?}: {words}");
    }
}

#[test]
fn gdb_stops_it_while_the_rig_goes_on_and_a_fault_is_reported() {
    let _turn = turn::take();
    let scene = scene();
    let emulator = scene.emulator(Pace::Real).with("--seconds 200").start();
    let port = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).expect("a port").port();
    let qemu = Running::start("qemu-r5f", qemu(&scene, &elf()).args(["--gdb", &port.to_string()]));
    let commands = [
        "set tcp connect-timeout 60",
        &format!("target extended-remote 127.0.0.1:{port}"),
        "add-inferior",
        "inferior 2",
        "attach 2",
        &format!("file {}", elf().display()),
        "set schedule-multiple on",
        "break motion_step if fw.state == 1",
        "continue",
        "backtrace",
        "print fw.state",
        "finish",
        "stepi",
        "delete",
        // The rig does not wait: what comes meanwhile overflows the FIFO.
        "shell sleep 0.3",
        "tbreak answer",
        "continue",
        "set $pc = 0xC0000000",
        "continue",
    ];
    let mut debugger = Command::new("gdb-multiarch");
    debugger.env("PATH", tools_path()).args(["-nx", "-batch"]);
    debugger.args(commands.iter().flat_map(|command| ["-ex", command]));
    // When the program ends itself QEMU goes, which GDB takes for an error.
    Running::start("gdb", &mut debugger).wait().expect_stdout(&[
        "motion_step (control=",
        "firmware_receive",
        "$1 = APPROACH",
        "Value returned is",
    ]);
    qemu.wait().expect_code(3).expect_stderr(&["firmware: prefetch abort at 0xC0000000"]);
    emulator.interrupt().expect_code(130);
}

#[test]
fn its_clocks_go_at_the_rates_that_the_port_takes_them_for() {
    let _turn = turn::take();
    let mut command = Command::new(workspace().join("scripts/qemu-clock"));
    command.env("AIRBENCH_BIN_DIR", shipped_programs());
    command.env("AIRBENCH_PYTHON", python()).env("PATH", tools_path()).arg("10");
    let ended = Running::start("qemu-clock", &mut command).wait().expect_code(0);
    eprintln!("{}", ended.stdout);
    let report: serde_json::Value = serde_json::from_str(&ended.stdout).expect("JSON");
    assert!(count(&report, "/answers") > 50, "{report}");
    for counter in ["core", "ttc", "milliseconds"] {
        // Of a few seconds on a machine that may stand still; docs/qemu.md has a minute.
        let drift_ppm = report[counter]["drift_ppm"].as_f64().expect("a number");
        assert!(drift_ppm.abs() < 1e4, "{counter}: {report}");
    }
    Running::start("qemu-clock", command.arg("soon")).wait().expect_code(2);
}

#[test]
fn what_it_cannot_run_is_refused_in_words() {
    let host = executable(Program::Bench, Build::Shipped);
    let host = host.to_str().expect("text");
    let elf = elf();
    let elf = elf.to_str().expect("text");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["--elf", "/nowhere.elf"], 2, "/nowhere.elf: cannot be read"),
        (&["--elf", host], 2, "is no ELF of a 32-bit ARM"),
        (&[], 2, "no --elf"),
        (&["--elf", elf, "--gdb", "70000"], 2, "1 to 65535"),
        (&["--elf", elf, "--bus", "can://vcan0"], 2, "unix:///PATH"),
        (&["--fast"], 2, "unknown argument --fast"),
    ];
    for (arguments, code, words) in cases {
        Running::start("qemu-r5f", script().args(arguments)).wait().expect_code(code).expect_stderr(&[words]);
    }
}

#[test]
fn the_chips_own_elf_is_built_too_and_has_no_heap() {
    for name in ["zynqmp-r5f", "qemu-r5f"] {
        let path = BUILT.path().join(format!("firmware-{name}.elf.sizes"));
        let sizes = std::fs::read_to_string(&path).expect("sizes");
        let size = |section: &str| -> u64 {
            let line = sizes.lines().find(|line| line.split_whitespace().next() == Some(section));
            let bytes = line.and_then(|line| line.split_whitespace().nth(1)).expect("a size");
            bytes.parse().expect("a number")
        };
        // Of 64 KiB each.
        assert!((1000..16_000).contains(&size(".text")), "{sizes}");
        assert!(size(".bss") + size(".data") + size(".stack") < 4096, "{sizes}");
    }
}
