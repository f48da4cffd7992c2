//! Programs under `bench can` that are stopped, killed, flood the bus or open a thousand sockets: the rig goes on, and what is
//! lost is counted where it is lost.

use rustix::process::Signal;
use std::fs;
use std::time::{Duration, Instant};
use system_tests::foreign_python::python;
use system_tests::process_table::ProcessStat;
use system_tests::socketcan::{built, guest, shell, start, start_python};
use system_tests::{PATIENCE, Pace, Packet, Peer, RESTLESS, Running, SHORT, Scene, count, turn, wait_until};

/// Rows of the rig's record that must follow: it goes on.
const GOES_ON: usize = 200;

#[test]
fn guests_that_are_stopped_killed_or_flood_do_not_stop_the_rig() {
    let _turn = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(Pace::Real, 500);

    // Stopped, with a socket whose queue fills, and the one who answers its calls as well.
    let listener = start(&scene, "", &[&"candump", &"vcan0"]);
    wait_until("frames at the listener", || listener.stdout().lines().count() > 100);
    listener.stop();
    scene.wait_for_more_rows("emulator", GOES_ON);
    listener.signal(Signal::CONT);

    // Killed and started again fifty times, in the middle of its calls.
    for _ in 0..50 {
        let guest = start(&scene, "", &[&"candump", &"vcan0"]);
        wait_until("a frame at the listener", || !guest.stdout().is_empty());
        guest.kill();
    }
    scene.wait_for_more_rows("emulator", GOES_ON);

    // As fast as it can, on an identifier that is nobody's.
    let flood = shell(&scene, "", "timeout 3 cangen vcan0 -I 7F5 -L 8 -g 0 -i; true");
    scene.wait_for_more_rows("emulator", GOES_ON);
    flood.wait().expect_code(0);

    // A thousand sockets in a hundred processes.
    let crowd = start(&scene, "", &[&built("many-sockets"), &"vcan0", &"100", &"10"]);
    scene.wait_for_more_rows("emulator", GOES_ON);
    crowd.wait().expect_code(0).expect_stdout(&["1000 sockets, each has received"]);

    assert!(listener.stdout().lines().count() > 200);
    drop(listener);
    controller.interrupt();
    emulator.interrupt();
    let summary = scene.summary();
    // What the flood cost is reported as a loss at a peer's queue, if it cost anything; the commands were never disputed.
    assert_eq!(count(&summary, "/drive_commands/two_sources"), 0);
    assert_eq!(count(&summary, "/frames_malformed"), 0);
}

#[test]
fn a_flood_through_it_arrives_whole_and_in_order() {
    let scene = Scene::new(SHORT);
    let flow = built("frame-flow");
    // Sender and receiver are programs of their own; the bus and its queues are between them.
    let mut pair = start(&scene, "--pair", &[&flow, &"receive", &"vcan0", &"20000"]);
    pair.wait_for("ready");
    start(&scene, "", &[&flow, &"send", &"vcan0", &"20000", &"4000"]).wait().expect_code(0);
    let received = pair.wait().expect_code(0);
    received.expect_stdout(&["out of order 0"]);
    let number_after = |what: &str| -> u64 {
        let after = received.stdout.split(what).nth(1).unwrap_or_else(|| panic!("{}", received.stdout));
        after.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
    };
    assert_eq!(
        number_after("received ") + number_after("lost at its queue ") + number_after("missing elsewhere "),
        20_000
    );
    assert_eq!(number_after("missing elsewhere "), 0, "{}", received.stdout);
}

const SENDER: &str = include_str!("../python/guests/fills_the_bus.py");

#[test]
fn a_bus_that_stands_still_refuses_with_enobufs_holds_native_senders_and_loses_nothing_it_accepted() {
    let (scene, host, peer) = Scene::with_bus();
    let mut running = start_python(&scene, "", SENDER);
    wait_until("the sender", || running.stdout().contains("ready"));
    host.stop();
    running.type_line("go");
    wait_until("the sender to be held", || running.stdout().contains("natively"));
    let said = running.stdout();
    assert!(said.contains("refused with ENOBUFS"), "{said}");
    let accepted: usize = said.split("accepted ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    host.signal(Signal::CONT);
    for number in 0..accepted {
        let frame = peer.receive(PATIENCE);
        assert!(
            matches!(frame, Some(Packet::Frame(_))),
            "{frame:?} in place of frame {number} of {accepted}"
        );
    }
    running.type_line("go");
    running.wait().expect_code(0);
    assert_eq!(peer.receive(Duration::from_millis(100)), None);
}

const TRANSPORT_SENDER: &str = include_str!("../python/guests/fills_the_bus_isotp.py");

/// The next message of a broadcast sender at a peer; frames of others are passed over.
fn next_message(peer: &Peer) -> Option<Vec<u8>> {
    let (mut message, mut length) = (Vec::new(), 0);
    loop {
        let Some(Packet::Frame(frame)) = peer.receive(PATIENCE) else { return None };
        match (frame.standard_id(), frame.data()) {
            (Some(0x7E0), [0x10, bytes, data @ ..]) => {
                assert!(message.is_empty(), "a message in the middle of another: {message:?}, {frame:?}");
                (length, message) = (usize::from(*bytes), data.to_vec());
            }
            (Some(0x7E0), [_, data @ ..]) => message.extend(data),
            _ => {}
        }
        if length > 0 && message.len() >= length {
            message.truncate(length);
            return Some(message);
        }
    }
}

#[test]
fn a_bus_that_stands_still_holds_native_messages_of_the_transport_protocol_and_loses_none() {
    let (scene, host, peer) = Scene::with_bus();
    let mut running = start_python(&scene, "", TRANSPORT_SENDER);
    wait_until("the sender", || running.stdout().contains("ready"));
    host.stop();
    running.type_line("go");
    wait_until("the messages to be written", || running.stdout().contains("written"));
    assert!(running.stdout().contains("refused with ENOBUFS"), "{}", running.stdout());
    // It waits for the bus and does not ask it again and again.
    let used_s = || ProcessStat::of(running.number()).expect("it runs").used_s;
    let (began, used_before_s) = (Instant::now(), used_s());
    std::thread::sleep(Duration::from_millis(500));
    let (used_now_s, passed_s) = (used_s() - used_before_s, began.elapsed().as_secs_f64());
    assert!(used_now_s < 0.1 * passed_s, "{used_now_s} s of a processor in {passed_s} s");
    host.signal(Signal::CONT);
    let expected = |number: u8| vec![number; if number.is_multiple_of(3) { 8 } else { 16 }];
    for number in 0..40 {
        assert_eq!(next_message(&peer), Some(expected(number)), "{}", running.stderr());
    }
    // It listens to its guest again, and notices its end.
    running.type_line("go");
    assert_eq!(next_message(&peer), Some(vec![40; 8]), "{}", running.stderr());
    let ended = running.wait().expect_code(0);
    assert!(!ended.stderr.contains("dropped"), "{}", ended.stderr);
}

#[test]
fn a_sender_that_is_killed_while_it_waits_leaves_no_socket_behind() {
    let scene = Scene::new(SHORT);
    // Nobody answers the first, whose channel the second waits for.
    let line = "echo ready; read go; for n in 1 2 3; do \
                isotpsend -s 12$n -d 32$n -D 20 vcan0; isotpsend -s 12$n -d 32$n -D 20 vcan0 & sleep 0.3; kill -KILL $!; wait; \
                done; echo done; read go";
    let mut running = shell(&scene, "--pair", line);
    let open = |running: &Running| {
        let links = fs::read_dir(format!("/proc/{}/fd", running.number())).unwrap().flatten();
        let files = links.filter_map(|link| fs::read_link(link.path()).ok());
        files.filter(|file| file.to_string_lossy().starts_with("socket:")).count()
    };
    wait_until("the shell", || running.stdout().contains("ready"));
    let before = open(&running);
    running.type_line("go");
    wait_until("the senders", || running.stdout().contains("done"));
    wait_until("their sockets to be closed", || open(&running) == before);
    running.type_line("go");
    running.wait().expect_code(0);
}

const QUEUER: &str = include_str!("../python/guests/queues_to_nobody.py");

#[test]
fn it_ends_soon_after_a_program_that_left_hundreds_of_messages_to_nobody() {
    let scene = Scene::new(SHORT);
    // One after the other they would take a second each, longer than a test waits.
    let ended = start_python(&scene, "--pair", QUEUER).wait().expect_code(0);
    let number = |text: &str, before: &str| -> Option<usize> {
        text.split(before).nth(1)?.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
    };
    let accepted = number(&ended.stdout, "accepted ").expect("a number");
    assert!(accepted > 300, "its own queue and more: {accepted}");
    let line =
        ended.stderr.lines().find(|line| line.contains("accepted and dropped")).expect("it is reported");
    let dropped = number(line, "bench can: ").expect("a number");
    // All but those that were begun, one a second.
    assert!(dropped < accepted && dropped > accepted - 20, "{dropped} of {accepted}");
}

const HURRIED: &str = include_str!("../python/guests/closes_in_a_message.py");

#[test]
fn a_sender_that_does_not_wait_leaves_the_message_of_a_closed_socket_whole() {
    let scene = Scene::new(SHORT);
    let ended = start_python(&scene, "--pair", HURRIED).wait().expect_code(0);
    ended.expect_stdout(&["second waits its turn", "sendmmsg of none 0", "recvmmsg for one EAGAIN"]);
}

const ORPHAN: &str = include_str!("../python/guests/outlives_bench_can.py");

#[test]
fn a_program_ends_with_a_bench_can_that_is_killed_and_its_children_get_enosys() {
    let scene = Scene::new(SHORT);
    let python = python();
    let left = scene.path("left");
    // The shell is the program, and looks at nothing; the other is its child.
    let line = format!(
        "{} -c \"$ORPHAN\" {} & echo shell $$; trap '' TERM; while :; do sleep 0.1; done",
        python.display(),
        left.display()
    );
    let mut can = guest(&scene, "--pair", &["sh", "-c", &line]);
    let running = Running::start("bench can", can.env("ORPHAN", ORPHAN));
    wait_until("the child", || running.stdout().contains("waits"));
    let said = running.stdout();
    let shell = said.lines().find_map(|line| line.strip_prefix("shell ")).expect("the shell's number");
    let shell = shell.parse().expect("a number");
    let is_alive = || ProcessStat::is_alive(shell);
    assert!(is_alive(), "{said}");
    assert_eq!(running.kill().signal, Some(9));
    wait_until("the shell's end", || !is_alive());
    wait_until("the child's words", || fs::read_to_string(&left).is_ok_and(|words| words.len() == 16));
    assert_eq!(fs::read_to_string(&left).unwrap().trim_end(), "ENOSYS ENOSYS");
}
