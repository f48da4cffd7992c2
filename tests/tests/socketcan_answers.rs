//! `bench can` answers as the kernel does: programs whose output was recorded on vcan (`vm_vcan.rs`) print the same on the
//! embedded bus, without CAN in the kernel.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use system_tests::foreign_python::tools_path;
use system_tests::socketcan::{self, built, expected, guest, start};
use system_tests::{CompletedProcess, Running, SHORT, Scene, shipped_programs, turn, wait_until, workspace};

/// What a program prints, on a bus of its own.
#[track_caller]
fn output_of(scene: &Scene, program: &Path) -> CompletedProcess {
    start(scene, "--pair", &[&program, &"vcan0"]).wait()
}

#[track_caller]
fn answers_as_on_vcan(program: &Path) {
    let answered = output_of(&Scene::new(SHORT), program);
    let difference = socketcan::first_difference(&answered.stdout, &socketcan::expected_answers());
    assert_eq!(difference, None, "{}", answered.stderr);
    let dropped =
        format!("{} messages of the program were accepted and dropped", socketcan::DIFFERENCES.len());
    let answered = answered.expect_code(0).expect_stderr(&[&dropped, "kernel answers: No such device"]);
    answered.expect_stderr(&["CAN_TP16 is not served"]);
}

#[test]
fn every_system_call_answers_as_on_vcan() {
    answers_as_on_vcan(&built("socketcan-answers"));
}

/// The same program with another C library inside, which makes other calls for the same functions.
#[test]
fn every_system_call_of_a_program_of_musl_answers_as_on_vcan() {
    let folder = tempfile::tempdir().unwrap();
    answers_as_on_vcan(&socketcan::build(folder.path(), "socketcan-answers", "musl-gcc"));
}

#[test]
fn a_statically_linked_program_of_rust_prints_what_it_prints_on_vcan() {
    let program = socketcan::payload().join("static-guest");
    assert!(is_statically_linked(&program), "{} asks for a dynamic linker", program.display());
    let ended = output_of(&Scene::new(SHORT), &program).expect_code(0);
    let recorded = fs::read_to_string(expected().join("rust.txt")).unwrap();
    assert_eq!(socketcan::first_difference(&ended.stdout, &recorded), None, "{}", ended.stderr);
}

/// Whether an ELF of 64 bits has no segment that names its interpreter, PT_INTERP.
fn is_statically_linked(program: &Path) -> bool {
    let bytes = fs::read(program).unwrap();
    let number = |at: usize, length: usize| {
        bytes[at..at + length].iter().rev().fold(0_usize, |number, byte| number << 8 | usize::from(*byte))
    };
    let (first, size, count) = (number(32, 8), number(54, 2), number(56, 2));
    (0..count).all(|place| number(first + place * size, 4) != 3)
}

/// What a script leaves that starts programs. The rest of the bus is in another process: a bus that has other peers.
fn texts_of(script: &str) -> BTreeMap<String, String> {
    let scene = Scene::new(SHORT);
    let _host = scene.bus_host("");
    let folder = scene.path("texts");
    let url = format!("vcan2={}", scene.url());
    let script = socketcan::payload().join(script);
    let command = ["sh".as_ref(), script.as_os_str(), "vcan2".as_ref(), folder.as_os_str()];
    let mut can = guest(&scene, &format!("--interface {url}"), &command);
    let mut path = shipped_programs().into_os_string();
    path.push(":");
    path.push(tools_path());
    can.env("PATH", path);
    can.env("RIG", workspace().join("plant/rig.toml"));
    can.env("EXPERIMENT", workspace().join("controller/experiments/point-to-point.toml"));
    can.env("AIRBENCH_SHARE", workspace());
    Running::start(&script.display().to_string(), &mut can).wait().expect_code(0);
    socketcan::texts(&folder)
}

#[test]
fn can_utils_print_what_they_print_on_vcan() {
    let mut expected = socketcan::texts(&expected().join("can-utils"));
    expected.remove("down");
    assert_eq!(texts_of("can-utils.sh"), expected);
}

#[test]
fn isotpsend_and_isotprecv_print_what_they_print_on_vcan() {
    assert_eq!(texts_of("isotp.sh"), socketcan::texts(&expected().join("isotp")));
}

#[test]
fn cansniffer_canbusload_python_can_a_program_of_go_and_the_firmware_print_what_they_print_on_vcan() {
    assert_eq!(texts_of("programs.sh"), socketcan::texts(&expected().join("programs")));
}

/// How often a machine may stand still for so long that a controller, as it must, takes its sensors for lost.
const ATTEMPTS: usize = 4;

#[test]
fn emulator_and_controller_say_and_send_on_it_what_they_do_on_vcan() {
    let _turn = turn::take();
    let expected = socketcan::texts(&expected().join("own-programs"));
    for attempt in 1.. {
        let texts = texts_of("own-programs.sh");
        let is_stalled = texts.values().any(|text| turn::LATENESS.iter().any(|words| text.contains(words)));
        if attempt == ATTEMPTS || !is_stalled {
            assert_eq!(texts, expected);
            return;
        }
    }
}

#[test]
fn sockets_report_that_the_bus_went_down_and_go_on_when_it_is_back_as_on_vcan() {
    let scene = Scene::new(SHORT);
    let host = scene.bus_host("");
    let running = start(&scene, "", &[&built("socketcan-answers"), &"vcan0", &"down"]);
    wait_until("the sockets", || running.stdout().contains("ready"));
    host.interrupt();
    wait_until("the answers", || running.stdout().contains("all is seen"));
    let _host = scene.bus_host("");
    let ended = running.wait().expect_code(0);
    let expected = socketcan::recorded_except("down.txt", &socketcan::DIFFERENCES_WHEN_DOWN);
    assert_eq!(socketcan::first_difference(&ended.stdout, &expected), None, "{}", ended.stderr);
}

#[test]
fn a_listener_ends_with_network_is_down_as_on_vcan() {
    let scene = Scene::new(SHORT);
    let host = scene.bus_host("");
    let mut listener = start(&scene, "", &[&"candump", &"vcan0"]);
    scene.wait_for_peers(1);
    let peer = scene.peer();
    let mut tries = 0;
    // Until candump has bound its socket nothing reaches it.
    while !listener.stdout().contains("7E0") {
        tries += 1;
        assert!(tries < 3000, "candump shows nothing: {}", listener.stderr());
        peer.send(&protocol::can::CanFrame::new(0x7E0, &[]).to_bytes());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    host.interrupt();
    listener.wait_for("Network is down");
    let ended = listener.wait();
    let recorded = fs::read_to_string(expected().join("can-utils/down")).unwrap();
    assert!(recorded.starts_with("read: Network is down\ncandump 1\n"), "{recorded}");
    ended.expect_code(1).expect_stderr(&["read: Network is down", "vcan0 is down"]);
}

/// The page's table of system calls against the filter and the tests: every call that is answered stands in it, and every row
/// names what tests it.
#[test]
fn the_table_of_system_calls_names_every_call_and_tests_that_exist() {
    let read = |path: &str| fs::read_to_string(workspace().join(path)).unwrap();
    let page = read("docs/socketcan-without-kernel.md");
    let table = page.split("## System calls").nth(1).unwrap().split("*answers*").next().unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| call"))
        .map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect())
        .collect();
    assert!(rows.len() > 10 && rows.iter().all(|row| row.len() == 3), "{rows:?}");
    let quoted =
        |cell: &str| -> Vec<String> { cell.split('`').skip(1).step_by(2).map(str::to_owned).collect() };

    let filter = read("socketcan_guest/src/filter.rs");
    let program = filter.split("pub(crate) fn install").next().unwrap();
    let named: Vec<String> = rows.iter().flat_map(|row| quoted(row[0])).collect();
    for call in program.split("libc::SYS_").skip(1) {
        let call = call.split(|c: char| !c.is_alphanumeric()).next().unwrap().trim_end_matches('4');
        assert!(named.iter().any(|name| name == call), "{call} is answered and stands in no row");
    }

    let answers = read("tests/expected/socketcan/answers.txt");
    let headings: Vec<&str> = answers.lines().filter_map(|line| line.strip_prefix("# ")).collect();
    let tests =
        ["answers", "hostile", "programs"].map(|name| read(&format!("tests/tests/socketcan_{name}.rs")));
    let exists = |name: &str| {
        headings.contains(&name)
            || ["can-utils", "isotp"].iter().any(|folder| expected().join(folder).join(name).is_file())
            || workspace().join("socketcan_guest/src").join(name).is_file()
            || tests.iter().any(|text| text.contains(&format!("fn {name}()")))
    };
    let tested: Vec<String> = rows.iter().flat_map(|row| quoted(row[2])).collect();
    assert!(rows.iter().all(|row| !quoted(row[2]).is_empty()), "a row names no test: {rows:?}");
    for name in &tested {
        assert!(exists(name), "{name} is no heading, case, file or test");
    }
    for heading in headings {
        assert!(tested.iter().any(|name| name == heading), "no row names the answers of {heading}");
    }
}
