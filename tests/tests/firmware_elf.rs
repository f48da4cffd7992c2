//! The firmware as the ELF of an STM32F103, in an emulator of that chip and in lockstep with the rig: `scripts/mcu`.
//!
//! The emulator counts one clock for each instruction; what a real core takes is counted apart, in
//! `tests/python/cortex_m3_cycles.py`.

use protocol::frames::{
    EmergencyStop, EmergencyStopReason, Frame, MainChainState, RunControl, RunControlCommand, ValveCommand,
};
use runlog::candump::read_line;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use system_tests::firmware::{build, expect_every_cycle_answered, positioned};
use system_tests::foreign_python::{light_path, run_script_of, tools_path};
use system_tests::{
    Build, Pace, Program, Running, Scene, both_good, count, count_of_id, executable, expect_same, json,
    workspace,
};
use tempfile::TempDir;

/// The approach, 1 s, settling, 2 s, and the first of two repetitions, 8 s: the shortest run with all bounds in it.
const ONE_REPETITION_S: f64 = 11.01;
/// Into its first move; a second run that is the same for so long is the same.
const MOVING_S: f64 = 4.0;
/// Clocks of a millisecond at 8 MHz.
const CLOCKS: u64 = 8000;

static BUILT: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    build(folder.path(), &["elf"]);
    folder
});

fn elf() -> PathBuf {
    BUILT.path().join("firmware-stm32f103.elf")
}

/// `scripts/mcu` with the ELF; its report lies in the scene as `mcu.json`.
fn mcu(scene: &Scene) -> Running {
    Running::start("mcu", &mut mcu_command(scene))
}

fn mcu_command(scene: &Scene) -> Command {
    let mut command = Command::new(workspace().join("scripts/mcu"));
    command.env("PYTHONPATH", light_path()).arg("--elf").arg(elf()).arg("--bus").arg(scene.url());
    command.arg("--report").arg(scene.path("mcu.json"));
    command
}

fn scene(more: &str) -> Scene {
    Scene::new(&format!("title = \"elf\"\n[rig]\ncarriage_position_m = 0.15\n{more}"))
}

#[test]
fn it_positions_within_the_bounds_and_twice_with_the_same_bytes() {
    let run = |seconds: f64| {
        let scene = scene("");
        let options = format!("--members 1 --join-timeout 300 --seconds {seconds}");
        let emulator = scene.emulator(Pace::Lockstep).with(&options).start();
        both_good(emulator, mcu(&scene));
        scene
    };
    let [one, other] = std::thread::scope(|threads| {
        let runs = [ONE_REPETITION_S, MOVING_S].map(|seconds| threads.spawn(move || run(seconds)));
        runs.map(|run| run.join().expect("it runs"))
    });
    // The last frames of a run say that it ends.
    for (file, last_lines) in [("emulator/bus.log", 10), ("emulator/measurement.csv", 0)] {
        let [one, other] =
            [&one, &other].map(|scene| std::fs::read_to_string(scene.path(file)).expect("a file of the run"));
        let lines = other.lines().count() - last_lines;
        assert!(
            lines > 3000 && one.lines().take(lines).eq(other.lines().take(lines)),
            "{file} differs in a second run"
        );
    }
    let summary = one.summary();
    let cycles = count(&summary, "/cycles");
    expect_every_cycle_answered(&summary);
    positioned(&one.bus_log(), 1).expect_whole(1, 790);

    // The core's time is the bus's: 10 ms before the first cycle and one for each.
    let report = json(&one.path("mcu.json"));
    eprintln!("{report}");
    assert_eq!(count(&report, "/cycles"), cycles);
    assert_eq!(count(&report, "/core_clocks"), (10 + cycles) * CLOCKS);
    assert_eq!((count(&report, "/frames_lost_at_fifo"), count(&report, "/frames_refused")), (0, 0));
    assert_eq!(count(&report, "/frames_from_core"), count(&summary, "/frames_received"));
    let (used, stack) = (count(&report, "/stack_used_bytes"), count(&report, "/stack_bytes"));
    assert!(used > 64 && used <= stack / 2, "{used} bytes of {stack} used");
}

const NOISE: std::ops::Range<u64> = 200..300;
const LOSS: std::ops::Range<u64> = 403..503;
const RELEASED: u64 = 700;
const STARTED: u64 = 900;
const STOPPED: u64 = 1400;
const END: u64 = 1700;

/// The frames of the run by their stamps, which are simulated time; those that no receiver knows left out.
fn by_cycle(scene: &Scene) -> Vec<(u64, Frame)> {
    let path = scene.path("emulator/bus.log");
    let text = std::fs::read_to_string(&path).expect("bus.log");
    let records = text.lines().map(|line| read_line(line).unwrap_or_else(|| panic!("{line}")));
    records
        .filter_map(|record| Some((record.stamp_ns / 1_000_000, Frame::decode(&record.frame).ok()?)))
        .collect()
}

/// Faults and events in simulated time, and what the ELF is seen to do then.
#[test]
fn noise_does_not_move_it_and_sensor_loss_and_the_emergency_stop_shut_its_valve_in_time() {
    let stop = format!("event = [{{ at_s = {}, do = \"emergency-stop\" }}]\n", STOPPED as f64 * 1e-3);
    let scene = scene(&stop);
    // A node that babbles at the highest priority while sensors are cut short; later no sensors for 100 ms.
    let fault = |what: &str, during: &std::ops::Range<u64>| {
        let (from_s, for_s) = (during.start as f64 * 1e-3, (during.end - during.start) as f64 * 1e-3);
        format!("[[fault]]\n{what}\nfrom_s = {from_s}\nfor_s = {for_s}\n")
    };
    let faults = [
        "seed = 5\n".into(),
        fault("name = \"babbling-node\"\nid = 16\nframes_per_ms = 3", &NOISE),
        fault("name = \"wrong-length\"\nat = \"bus.DriveSensors\"\nprobability = 0.3", &NOISE),
        fault("name = \"bus-loss\"\nat = \"bus.DriveSensors\"", &LOSS),
    ];
    let script = scene.write("faults.toml", &faults.concat());
    let options = format!(
        "--members 2 --join-timeout 300 --seconds {} --faults {}",
        END as f64 * 1e-3,
        script.display()
    );
    let emulator = scene.emulator(Pace::Lockstep).with(&options).start();
    let mcu = mcu(&scene);
    let release = EmergencyStop { reason: EmergencyStopReason::Operator, release: true };
    let start = RunControl { command: RunControlCommand::Start, experiment: 8 };
    scene.peer().be_console(|cycle| match u64::from(cycle) {
        RELEASED => Some(Frame::ConsoleEmergencyStop(release)),
        STARTED => Some(Frame::RunControl(start)),
        _ => None,
    });
    both_good(emulator, mcu);

    let frames = by_cycle(&scene);
    let commands: BTreeMap<u64, ValveCommand> = frames
        .iter()
        .filter_map(|(cycle, frame)| match frame {
            Frame::DriveValveCommand(command) => Some((*cycle, *command)),
            _ => None,
        })
        .collect();
    let open = |cycles: std::ops::Range<u64>| {
        commands.range(cycles).filter(|(_, command)| command.enable || command.opening != 0.0).count() as u64
    };
    let silent =
        |cycles: std::ops::Range<u64>| cycles.filter(|cycle| !commands.contains_key(cycle)).count() as u64;
    let mut states: Vec<(u64, MainChainState)> = frames
        .iter()
        .filter_map(|(cycle, frame)| match frame {
            Frame::DriveChainStatus(status) => Some((*cycle, status.main_chain)),
            _ => None,
        })
        .collect();
    states.dedup_by_key(|(_, state)| *state);
    let tripped: Vec<u64> = frames
        .iter()
        .filter(|(_, frame)| matches!(frame, Frame::DriveEmergencyStop(stop) if !stop.release))
        .map(|(cycle, _)| *cycle)
        .collect();
    let summary = scene.summary();
    let report = json(&scene.path("mcu.json"));
    eprintln!("{states:?}\n{tripped:?}\n{}\n{report}", summary["bus_host"]["faults"]);

    use MainChainState::{Aborted, Fault, InitialPositioning};
    let [
        (0, InitialPositioning),
        (fault, Fault),
        (released, Aborted),
        (started, InitialPositioning),
        (stopped, Aborted),
    ] = states[..]
    else {
        panic!("other states: {states:?}");
    };
    // The noise: sensors that are whole are answered, the others are not, and nothing else comes of it.
    let cut = count_of_id(&summary["bus_host"]["faults"]["wrong-length"], "120");
    assert!((10..60).contains(&cut), "{cut} sensors cut short");
    assert_eq!((silent(0..NOISE.start), silent(NOISE), silent(NOISE.end..LOSS.start)), (0, cut, 0));
    assert_eq!(open(1..LOSS.start), LOSS.start - 1 - cut, "it went on moving");
    assert!(count(&report, "/frames_filtered") >= 300, "the babble ends at its filters: {report}");
    assert_eq!((count(&report, "/frames_lost_at_fifo"), count(&report, "/frames_refused")), (0, 0));
    // 50 of its own milliseconds after the last sensors it trips the emergency stop; its timer runs at some phase of the cycle.
    let last = LOSS.start - 1;
    assert!((last + 49..=last + 50).contains(&fault), "fault in cycle {fault}");
    assert_eq!(tripped, [fault, fault + 100, fault + 200], "and repeats it until it is released");
    assert_eq!(
        (silent(LOSS), silent(LOSS.end..END)),
        (LOSS.end - LOSS.start, 0),
        "it answers again with sensors"
    );
    // What is said in a cycle acts in the next one.
    assert_eq!((released, started), (RELEASED + 1, STARTED + 1));
    assert_eq!(open(LOSS.start..started), 0, "the valve stays shut until it is started again");
    assert!(open(started + 1..STOPPED) > 300, "then it moves");
    // The rig's stop reaches it in the cycle in which it is tripped.
    assert!((STOPPED..=STOPPED + 1).contains(&stopped), "stopped in cycle {stopped}");
    assert_eq!(open(stopped + 1..END), 0, "and its valve stays shut");
}

#[test]
fn the_check_of_controllers_passes_it() {
    let scene = scene("");
    let mut check = Program::Bench.command();
    check.env("PYTHONPATH", light_path());
    check.args(["check-controller", "--pace", "lockstep", "--seconds", "1", "--junit"]);
    check.arg(scene.path("result.xml")).arg("--").arg(workspace().join("scripts/mcu"));
    check.arg("--elf").arg(elf()).args(["--bus", "{bus}"]);
    let ended = Running::start("check", &mut check).wait().expect_code(0);
    let passed = |name: &str| {
        let line = ended.stdout.lines().find(|line| line.contains(name));
        assert!(line.is_some_and(|line| line.contains("passed")), "{name}: {}", ended.stdout);
    };
    ["regular", "noise", "emergency-stop", "sensor-loss"].iter().for_each(|session| passed(session));
    eprintln!("{}", ended.stdout);
}

#[test]
fn gdb_stops_the_core_while_the_rig_waits_and_the_run_is_the_same_to_the_byte() {
    let run = |gdb: bool| {
        let scene = scene("");
        let options = "--members 1 --seconds 0.3 --join-timeout 300 --lockstep-timeout 300";
        let emulator = scene.emulator(Pace::Lockstep).with(options).start();
        let mut command = mcu_command(&scene);
        let mut mcu = Running::start("mcu", if gdb { command.args(["--gdb", "0"]) } else { &mut command });
        if gdb {
            mcu.wait_for("halted at reset");
            let said = mcu.stderr();
            let port = said.rsplit_once("target remote :").expect("a port").1;
            let port = port.trim_end().trim_end_matches('\'');
            // Longer than the 5 s that a member has otherwise.
            let commands = [
                &format!("target remote :{port}"),
                "break motion_step if fw.cycle == 123",
                "continue",
                "backtrace",
                "print fw.cycle",
                "print milliseconds",
                "finish",
                "stepi",
                "shell sleep 6",
                "detach",
            ];
            let mut debugger = Command::new("gdb-multiarch");
            debugger.env("PATH", tools_path()).args(["-nx", "-batch"]).arg(elf());
            debugger.args(commands.iter().flat_map(|command| ["-ex", command]));
            let ended = Running::start("gdb", &mut debugger).wait().expect_code(0);
            // It has been on for 10 ms before the first cycle.
            ended.expect_stdout(&[
                "motion_step (control=",
                "take_sensors",
                "$1 = 123",
                "$2 = 133",
                "Value returned is",
            ]);
        }
        both_good(emulator, mcu);
        scene
    };
    let [plain, debugged] = [run(false), run(true)];
    let [plain, debugged] = [&plain, &debugged].map(|scene| scene.path("emulator"));
    expect_same(&plain, &debugged, &["bus.log", "measurement.csv"], "differs under the debugger");
}

#[test]
fn what_is_no_elf_of_the_chip_and_no_bus_is_refused_in_words() {
    let scene = scene("");
    let host = executable(Program::Bench, Build::Shipped);
    let cases = [
        (["--elf", "/nowhere.elf"], "/nowhere.elf: No such file"),
        (["--elf", host.to_str().expect("text")], "ELF"),
        (["--chip", "stm32f999"], "there is stm32f103"),
        (["--bus", "can://vcan0"], "unix:///PATH is expected"),
        (["--boot-ms", "0"], "--boot-ms: at least 1"),
    ];
    for (arguments, words) in cases {
        let mut command = mcu_command(&scene);
        Running::start("mcu", command.args(arguments)).wait().expect_code(2).expect_stderr(&[words]);
    }
}

#[test]
fn the_emulator_of_the_chip_differs_from_it_where_the_page_says() {
    let said = run_script_of("hil", "labwired_cases.py", &[elf()]);
    let cases: BTreeMap<String, serde_json::Value> = serde_json::from_str(&said).expect("JSON");
    let page = std::fs::read_to_string(workspace().join("docs/elf.md")).expect("docs/elf.md");
    assert_eq!(cases.len(), 7, "{said}");
    for (case, seen) in cases {
        assert_ne!(seen["chip"], seen["labwired"], "{case}: mended; the port need not go round any more");
        // Each row of the page begins with the manual's paragraph.
        let paragraph =
            case.rsplit_once('(').and_then(|(_, rest)| rest.split([',', ')']).next()).expect("one");
        assert!(page.contains(paragraph), "{paragraph} is not in docs/elf.md");
    }
}

#[test]
fn after_a_bus_that_took_nothing_it_sends_the_newest_command_and_no_old_one() {
    let said = run_script_of("hil", "stm32f103_stale.py", &[BUILT.path().join("firmware-count.elf")]);
    let seen: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(seen["given_up"], true, "the frame in a mailbox is taken back: {said}");
    assert_eq!(seen["command_cycles"], serde_json::json!([seen["newest_cycle"]]), "{said}");
    let sent: Vec<u64> = serde_json::from_value(seen["sent"].clone()).expect("identifiers");
    let different: std::collections::BTreeSet<_> = sent.iter().collect();
    assert_eq!(different.len(), sent.len(), "one of each: {said}");
    assert!(sent.len() == 3, "command, chain status and values: {said}");
}

/// The ELF with an instruction of its own in place of a function's first.
fn patched(folder: &Path, function: &str, instruction: u16) -> PathBuf {
    let patched = folder.join("patched.elf");
    std::fs::copy(elf(), &patched).expect("a copy");
    let mut debugger = Command::new("gdb-multiarch");
    debugger.env("PATH", tools_path()).args(["-nx", "-batch", "--write"]).arg(&patched);
    debugger.args(["-ex", &format!("set {{short}}{function} = {instruction}")]);
    Running::start("gdb", &mut debugger).wait().expect_code(0);
    patched
}

#[test]
fn a_fault_and_the_end_of_main_are_reported() {
    const UDF: u16 = 0xDE00;
    const BX_LR: u16 = 0x4770;
    for (function, instruction, words) in [
        ("motion_step", UDF, "the core stopped: HardFault, pc 0x0800"),
        ("loop_run", BX_LR, "the core stopped: its main has returned"),
    ] {
        let scene = scene("");
        let emulator =
            scene.emulator(Pace::Lockstep).with("--members 1 --seconds 0.3 --join-timeout 300").start();
        let mut command = Command::new(workspace().join("scripts/mcu"));
        command.arg("--elf").arg(patched(&scene.path(""), function, instruction));
        Running::start("mcu", command.args(["--bus", &scene.url()]))
            .wait()
            .expect_code(3)
            .expect_stderr(&[words]);
        // The rig has lost its member, or never had it.
        drop(emulator);
    }
}

#[test]
fn a_millisecond_of_it_fits_into_that_of_a_real_cortex_m3() {
    let counted = run_script_of("hil", "cortex_m3_cycles.py", &[BUILT.path().join("firmware-count.elf")]);
    eprintln!("{counted}");
    let counted: serde_json::Value = serde_json::from_str(&counted).expect("JSON");
    let clocks = |kind: &str| count(&counted[kind], "/clocks");
    // The accesses to the CAN controller, and the timer's interrupt: 200 clocks at most (docs/elf.md).
    assert!(clocks("with status") + 200 < CLOCKS, "{counted}");
    // The sensors' frame and the command's own are on the wire for 111 and 95 us of the same millisecond.
    assert!(clocks("without") + (111 + 95) * CLOCKS / 1000 < CLOCKS, "{counted}");
}

#[test]
fn it_has_no_heap_and_the_build_tells_its_sizes() {
    let tool = |name: &str, option: &str, file: &Path| {
        let arm = workspace().join("target/tools/bin").join(format!("arm-none-eabi-{name}"));
        let program =
            if arm.exists() { arm.into_os_string() } else { format!("arm-none-eabi-{name}").into() };
        let output = Command::new(program).arg(option).arg(file).output().expect("the tool starts");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    };
    let symbols = tool("nm", "-A", &elf());
    assert!(symbols.contains("firmware_receive") && symbols.contains("__aeabi_fmul"), "{symbols}");
    for name in ["malloc", "_sbrk", "sbrk", "__heap_start", "printf"] {
        assert!(!symbols.split_whitespace().any(|word| word == name), "{name} is linked");
    }
    // 64 KiB of flash and 20 KiB of RAM are the chip's; what the build reports is far from both.
    let sizes = std::fs::read_to_string(BUILT.path().join("firmware-stm32f103.elf.sizes")).expect("sizes");
    let bytes = |section: &str| -> u64 {
        let line = sizes.lines().find(|line| line.split_whitespace().next() == Some(section));
        let number = line.and_then(|line| line.split_whitespace().nth(1)).and_then(|word| word.parse().ok());
        number.unwrap_or_else(|| panic!("{section} is not in\n{sizes}"))
    };
    eprintln!("{sizes}");
    assert!((4_000..16_000).contains(&bytes(".text")), "{sizes}");
    assert!(bytes(".data") + bytes(".bss") < 1_000 && bytes(".stack") == 2_048, "{sizes}");
}
