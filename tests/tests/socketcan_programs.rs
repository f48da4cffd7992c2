//! Foreign programs and our own, unmodified, on the embedded bus by `bench can`: python-can, firmware in C, `scripts/run`.

use protocol::can::CanFrame;
use rustix::process::Signal;
use std::ffi::OsStr;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;
use system_tests::foreign_python::python;
use system_tests::socketcan::{built, guest, shell, start};
use system_tests::{
    Build, PATIENCE, Pace, Packet, Program, Running, SHORT, Scene, count, executable, firmware, install,
    json, shipped_programs, turn, wait_until, workspace,
};
use tempfile::TempDir;

#[test]
fn python_can_sends_filters_repeats_and_listens() {
    let scene = Scene::new(SHORT);
    let _host = scene.bus_host("");
    let script = workspace().join("tests/python/socketcan_guest.py");
    let running = start(&scene, "", &[&python(), &script, &"vcan0", &"echo"]);
    let peer = scene.peer();
    let mut answered = 0;
    while answered < 100 {
        match peer.receive(PATIENCE) {
            Some(Packet::Frame(frame)) if frame.standard_id() == Some(0x3A0) => {
                peer.send(&CanFrame::new(0x3A1, frame.data()).to_bytes());
                answered += 1;
            }
            Some(Packet::Frame(_)) => {}
            other => panic!("no frame but {other:?}; {}", running.stderr()),
        }
    }
    running.wait().expect_code(0).expect_stdout(&[
        "a limited task ends after 5",
        "a notifier hears all",
        "no CAN FD",
        "answered by another peer",
    ]);
}

#[test]
fn the_firmware_for_socketcan_controls_the_rig_on_the_embedded_bus() {
    let folder = tempfile::tempdir().unwrap();
    let built = firmware::build(folder.path(), &["STATIC=-static"]);
    let _turn = turn::take();
    let scene = Scene::new("title = \"firmware\"\n[rig]\ncarriage_position_m = 0.15\n");
    let emulator = scene.emulator(Pace::Real).with("--seconds 4").start();
    let running = start(&scene, "", &[&built.join("firmware-socketcan"), &"vcan0"]);
    emulator.wait().expect_code(0);
    // Its bus has gone with the rig.
    running.wait().expect_code(0);
    let summary = scene.summary();
    assert_eq!(count(&summary, "/frames_malformed"), 0);
    // It answers from its first sensors on; a machine that stands still skips cycles, and those need no answer.
    let (accepted, cycles) = (count(&summary, "/drive_commands/accepted"), count(&summary, "/cycles"));
    assert!(accepted > cycles / 2 && accepted > 100, "{accepted} commands in {cycles} cycles");
}

#[test]
fn scripts_run_takes_the_interface_for_a_bus() {
    let _turn = turn::take();
    let scene = Scene::new(SHORT);
    let run = workspace().join("scripts/run");
    let (out, experiment) = (scene.path("run"), scene.path("experiment.toml"));
    let command: [&dyn AsRef<OsStr>; 6] = [&run, &"--bus", &"can://vcan0", &"--out", &out, &experiment];
    let mut can = guest(&scene, "--pair", &command);
    let ended = Running::start("scripts/run", can.env("AIRBENCH_BIN_DIR", shipped_programs())).wait();
    ended.expect_stdout(&["can://vcan0"]);
    let summary = json(&out.join("summary.json"));
    let commands = count(&summary, "/drive_commands/accepted");
    assert!(commands > 500, "{commands} commands: {}", ended.stderr);
    assert_eq!(count(&summary, "/frames_malformed"), 0);
    // A machine that stands still may let the axis miss its rest, which is 1; the bus never failed.
    assert!(matches!(ended.code, Some(0 | 1)), "{:?}: {}", ended.code, ended.stderr);
}

#[test]
fn two_foreign_programs_meet_on_a_bus_without_a_rig() {
    let scene = Scene::new(SHORT);
    let mut pair =
        Running::start("pair", Program::Bench.command().args(["can", "--pair", "--bus", &scene.url()]));
    pair.wait_for("hosting");
    let listener = start(&scene, "", &[&"candump", &"-n", &"3", &"vcan0,5A5:7FF"]);
    scene.wait_for_peers(1);
    // Frames before candump has bound its socket pass it by.
    while listener.stdout().lines().count() < 3 {
        let cangen: [&dyn AsRef<OsStr>; 8] = [&"cangen", &"vcan0", &"-n", &"3", &"-I", &"5A5", &"-g", &"1"];
        start(&scene, "", &cangen).wait().expect_code(0);
    }
    listener.wait().expect_code(0);
    pair.interrupt().expect_stderr(&["the bus carried", "0 did not fit"]);
}

#[test]
fn a_program_that_does_not_notice_the_end_of_its_bus_is_ended_with_it() {
    let scene = Scene::new(SHORT);
    let host = scene.bus_host("");
    let sleeper = start(&scene, "--end-with-bus", &[&"sleep", &"1000"]);
    let mut waiter = shell(&scene, "", "read line; exit 7");
    scene.wait_for_peers(2);
    host.interrupt();
    sleeper.wait().expect_code(128 + 15);
    waiter.wait_for("is down");
    waiter.type_line("");
    waiter.wait().expect_code(7);
}

#[test]
fn interfaces_of_several_buses_are_distinguished() {
    let (scene, other) = (Scene::new(SHORT), Scene::new(SHORT));
    let (_one, _two) = (scene.bus_host(""), other.bus_host(""));
    let options = format!("--interface can0={} --interface can1={}", scene.url(), other.url());
    let line = "candump -n 4 any & \
                until cansend can0 001#; cansend can1 002#; sleep 0.05; ! kill -0 $!; do :; done; wait $!";
    let ended = shell(&scene, &options, line).wait().expect_code(0);
    for (interface, identifier) in [("can0", "001"), ("can1", "002")] {
        let lines = ended.stdout.lines().filter(|line| line.contains(interface));
        assert!(lines.clone().count() > 0, "{}", ended.stdout);
        assert!(lines.clone().all(|line| line.contains(identifier)), "{}", ended.stdout);
    }
}

#[test]
fn canbusload_and_cansniffer_show_the_traffic() {
    let scene = Scene::new(SHORT);
    let _host = scene.bus_host("");
    // Both draw on a terminal until they are interrupted.
    let line = "cangen vcan0 -I 5A5 -L 8 -D 11223344 -g 2 & generator=$!; \
                timeout -s INT 3 canbusload vcan0@500000; \
                timeout -s INT 2 cansniffer vcan0 -t 0 </dev/null; kill $generator; true";
    let ended = shell(&scene, "", line).wait().expect_code(0);
    // Frames of a second, bits of a second, load.
    let busy = |line: &str| {
        let words: Vec<_> = line.split_whitespace().collect();
        words.first() == Some(&"vcan0@500000") && words.get(1).is_some_and(|frames| *frames != "0")
    };
    assert!(ended.stdout.lines().any(busy), "{}", ended.stdout);
    ended.expect_stdout(&["5A5"]);
}

#[test]
fn it_works_for_an_ordinary_user_without_capabilities_and_in_a_user_namespace() {
    let (folder, bench) = for_everybody();
    let line =
        "candump -n 1 vcan0 & until cansend vcan0 123#42; sleep 0.05; ! kill -0 $!; do :; done; wait $!";
    let ways: &[&[&str]] = if rustix::process::getuid().is_root() {
        &[
            &ORDINARY_USER,
            &[
                "setpriv",
                "--reuid=65534",
                "--regid=65534",
                "--clear-groups",
                "unshare",
                "--user",
                "--map-root-user",
            ],
        ]
    } else {
        &[&["env"], &["unshare", "--user", "--map-root-user"]]
    };
    for (number, way) in ways.iter().enumerate() {
        // A machine may forbid user namespaces; nobody can be in one then.
        let mut probe = Command::new(way[0]);
        if !probe.args(&way[1..]).arg("true").output().is_ok_and(|ended| ended.status.success()) {
            let name = "it_works_for_an_ordinary_user_without_capabilities_and_in_a_user_namespace";
            system_tests::skip::report(name, "unshare --user is not permitted here");
            continue;
        }
        let url = format!("unix://{}/bus{number}", folder.path().display());
        let mut command = Command::new(way[0]);
        command.args(&way[1..]).arg(&bench).args(["can", "--pair", "--bus", &url, "--", "sh", "-c", line]);
        let ended = Running::start("bench can", command.current_dir(folder.path())).wait().expect_code(0);
        ended.expect_stdout(&["123   [1]  42"]);
    }
}

/// Runs a program of root's as an ordinary user without capabilities.
const ORDINARY_USER: [&str; 6] =
    ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--inh-caps=-all", "--bounding-set=-all"];

/// A folder that every user may write to, with `bench` in it.
fn for_everybody() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o777)).unwrap();
    let bench = folder.path().join("bench");
    install(&std::fs::read(executable(Program::Bench, Build::Shipped)).unwrap(), &bench);
    (folder, bench)
}

/// What a program writes natively right before its end is still in its queue then, where `bench can` has no priority above it.
/// It was lost: of 10 times 200 frames 656 reached the bus.
#[test]
fn what_was_written_last_reaches_the_bus_when_the_program_has_ended() {
    let (folder, bench) = for_everybody();
    let url = format!("unix://{}/bus", folder.path().display());
    let can = |options: &[&str]| {
        let way = if rustix::process::getuid().is_root() { &ORDINARY_USER[..] } else { &["env"] };
        let mut command = Command::new(way[0]);
        command.args(&way[1..]).arg(&bench).args(["can", "--bus", &url]).args(options);
        Running::start("bench can", command.current_dir(folder.path()))
    };
    let mut pair = can(&["--pair"]);
    pair.wait_for("hosting");
    for _ in 0..10 {
        can(&["--", "cangen", "vcan0", "-n", "200", "-g", "0", "-I", "7F6"]).wait().expect_code(0);
    }
    pair.interrupt().expect_stderr(&["the bus carried 2000 frames"]);
}

#[test]
fn what_cannot_be_is_said_with_what_to_do() {
    let scene = Scene::new(SHORT);
    let absent = Running::start("no host", &mut guest(&scene, "--wait-s 0", &["true"])).wait().expect_code(3);
    absent.expect_stderr(&["no host at", "emulator run", "--pair"]);
    let bench = executable(Program::Bench, Build::Shipped);
    let inner = scene.url();
    let nested =
        [bench.as_os_str(), "can".as_ref(), "--bus".as_ref(), inner.as_ref(), "--".as_ref(), "true".as_ref()];
    let nested = Running::start("nested", &mut guest(&scene, "--pair", &nested)).wait().expect_code(2);
    nested.expect_stderr(&["does not nest"]);
    let missing = Running::start("missing", &mut guest(&scene, "--pair", &["/no/such/program"])).wait();
    missing.expect_code(2).expect_stderr(&["cannot start the command"]);
    let kernels = Program::Bench.start(&[&"can", &"--bus", &"can://vcan0", &"--", &"true"]).wait();
    kernels.expect_code(2).expect_stderr(&["embedded buses"]);
}

/// As in a container: Docker's default profile refuses the second to whoever has no CAP_SYS_PTRACE.
#[test]
fn a_sandbox_that_forbids_it_is_reported_with_what_to_allow() {
    // Numbers of system calls on x86-64.
    const SECCOMP: i32 = 317;
    const PIDFD_GETFD: i32 = 438;
    let scene = Scene::new(SHORT);
    let forbid = built("forbid");
    let bench = executable(Program::Bench, Build::Shipped);
    for (call, advice) in [(SECCOMP, "seccomp=unconfined"), (PIDFD_GETFD, "--cap-add SYS_PTRACE")] {
        let mut command = Command::new(&forbid);
        command.arg(call.to_string()).arg(&bench);
        command.args(["can", "--pair", "--bus", &scene.url(), "--", "true"]);
        Running::start("bench can", &mut command).wait().expect_code(2).expect_stderr(&[advice]);
    }
}

/// The runtime of Go makes its system calls by itself and waits in epoll; the program is linked statically, without a C library.
#[test]
fn a_program_of_go_finds_the_interface_reads_and_writes() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("listen-and-answer");
    let mut go = Command::new("go");
    go.args(["build", "-o"]).arg(&program).arg(workspace().join("tests/go/listen_and_answer.go"));
    go.env("GO111MODULE", "off").env("CGO_ENABLED", "0").env("GOCACHE", folder.path().join("cache"));
    let built = go.output().expect("go is missing: run scripts/test, which gets it");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));

    let scene = Scene::new(SHORT);
    let _host = scene.bus_host("");
    let running = start(&scene, "", &[&program, &"vcan0", &"50"]);
    let peer = scene.peer();
    wait_until("the program to bind its socket", || running.stdout().contains("bound to vcan0 mtu 16"));
    for number in 0..50 {
        peer.send(&CanFrame::new(0x3B0, &[number]).to_bytes());
        match peer.receive(PATIENCE) {
            Some(Packet::Frame(frame)) => assert_eq!(frame, CanFrame::new(0x3B1, &[number])),
            other => panic!("no answer but {other:?}: {}", running.stderr()),
        }
    }
    running.wait().expect_code(0);
}

#[test]
fn its_exit_code_is_the_programs_and_a_signal_goes_to_the_program() {
    let scene = Scene::new(SHORT);
    shell(&scene, "--pair", "exit 7").wait().expect_code(7);
    let mut running = shell(
        &scene,
        "--pair",
        "trap 'echo asked >&2; exit 9' TERM; echo ready >&2; while :; do sleep 0.1; done",
    );
    running.wait_for("ready");
    running.signal(Signal::TERM);
    running.wait().expect_code(9).expect_stderr(&["asked"]);
    shell(&scene, "--pair", "kill -KILL $$").wait().expect_code(128 + 9);
}

#[test]
fn a_program_waits_for_its_bus_and_a_person_can_end_the_waiting() {
    let scene = Scene::new(SHORT);
    let mut waiting = start(&scene, "--wait-s 300", &[&"true"]);
    waiting.wait_for("waiting for it");
    waiting.interrupt();
    let mut waiting = start(&scene, "--wait-s 300", &[&"cansend", &"vcan0", &"123#"]);
    waiting.wait_for("waiting for it");
    let _host = scene.bus_host("");
    waiting.wait().expect_code(0);
    wait_until("the socket's file", || scene.socket().exists());
}
