//! Programs under `bench can` that are stopped, killed, flood the bus or open a thousand sockets: the rig goes on, and what is
//! lost is counted where it is lost.

use rustix::process::Signal;
use std::time::Duration;
use system_tests::foreign_python::python;
use system_tests::launch::Pace;
use system_tests::peer::Packet;
use system_tests::process::{PATIENCE, Running, wait_until};
use system_tests::records::{count, json};
use system_tests::scene::{RESTLESS, SHORT, Scene};
use system_tests::socketcan::{built, guest, shell};
use system_tests::turn;

/// Rows of the rig's record that must follow: it goes on.
const GOES_ON: usize = 200;

#[test]
fn guests_that_are_stopped_killed_or_flood_do_not_stop_the_rig() {
    let _turn = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(Pace::Real, 500);

    // Stopped, with a socket whose queue fills, and the one who answers its calls as well.
    let listener = Running::start("candump", &mut guest(&scene, "", &["candump", "vcan0"]));
    wait_until("frames at the listener", || listener.stdout().lines().count() > 100);
    listener.stop();
    scene.wait_for_more_rows("emulator", GOES_ON);
    listener.signal(Signal::CONT);

    // Killed and started again fifty times, in the middle of its calls.
    for _ in 0..50 {
        let guest = Running::start("candump", &mut guest(&scene, "", &["candump", "vcan0"]));
        wait_until("a frame at the listener", || !guest.stdout().is_empty());
        let _ = guest.kill();
    }
    scene.wait_for_more_rows("emulator", GOES_ON);

    // As fast as it can, on an identifier that is nobody's.
    let flood = shell(&scene, "", "timeout 3 cangen vcan0 -I 7F5 -L 8 -g 0 -i; true");
    scene.wait_for_more_rows("emulator", GOES_ON);
    let _ = flood.wait().expect_code(0);

    // A thousand sockets in a hundred processes.
    let many = built("many-sockets");
    let crowd = Running::start(
        "many sockets",
        &mut guest(&scene, "", &[many.as_os_str(), "vcan0".as_ref(), "100".as_ref(), "10".as_ref()]),
    );
    scene.wait_for_more_rows("emulator", GOES_ON);
    let crowd = crowd.wait().expect_code(0);
    crowd.expect_printed(&["1000 sockets, each has received"]);

    assert!(listener.stdout().lines().count() > 200);
    drop(listener);
    let _ = controller.interrupt();
    let _ = emulator.interrupt();
    let summary = json(&scene.path("emulator/summary.json"));
    // What the flood cost is told as a loss at a peer's queue, if it cost anything; the rig's own commands were never disputed.
    assert_eq!(count(&summary, "/drive_commands/two_sources"), 0);
    assert_eq!(count(&summary, "/frames_malformed"), 0);
}

#[test]
fn a_flood_through_it_arrives_whole_and_in_order() {
    let scene = Scene::new(SHORT);
    let flow = built("frame-flow");
    // Sender and receiver are programs of their own; the bus and its queues are between them.
    let mut pair = Running::start(
        "receiver",
        &mut guest(
            &scene,
            "--pair",
            &[flow.as_os_str(), "receive".as_ref(), "vcan0".as_ref(), "20000".as_ref()],
        ),
    );
    pair.wait_for("ready");
    let sender = [flow.as_os_str(), "send".as_ref(), "vcan0".as_ref(), "20000".as_ref(), "4000".as_ref()];
    let _ = Running::start("sender", &mut guest(&scene, "", &sender)).wait().expect_code(0);
    let received = pair.wait().expect_code(0);
    received.expect_printed(&["out of order 0"]);
    let told = |what: &str| -> u64 {
        let after = received.stdout.split(what).nth(1).unwrap_or_else(|| panic!("{}", received.stdout));
        after.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
    };
    assert_eq!(told("received ") + told("lost at its queue ") + told("missing elsewhere "), 20_000);
    assert_eq!(told("missing elsewhere "), 0, "{}", received.stdout);
}

/// Sends by an address until the bus takes no more, then natively until its own queue does not.
const SENDER: &str = "
import errno, socket, struct, sys
can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
can.bind(('vcan0',))
frame = struct.pack('=IB3x8s', 0x7F7, 8, bytes(8))
print('ready', flush=True)
sys.stdin.readline()
addressed, native = 0, 0
try:
    while True:
        can.sendto(frame, ('vcan0',))
        addressed += 1
except OSError as refused:
    print('refused with', errno.errorcode[refused.errno], flush=True)
can.setblocking(False)
try:
    while True:
        can.send(frame)
        native += 1
except BlockingIOError:
    print('accepted', addressed + native, 'of them natively', native, flush=True)
sys.stdin.readline()
";

#[test]
fn a_bus_that_stands_still_refuses_with_enobufs_holds_native_senders_and_loses_nothing_it_accepted() {
    let scene = Scene::new(SHORT);
    let host = scene.bus_host("");
    let peer = scene.peer();
    let python = python();
    let command = [python.as_os_str(), "-c".as_ref(), SENDER.as_ref()];
    let mut running = Running::start("sender", &mut guest(&scene, "", &command));
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
    let _ = running.wait().expect_code(0);
    assert_eq!(peer.receive(Duration::from_millis(100)), None);
}
