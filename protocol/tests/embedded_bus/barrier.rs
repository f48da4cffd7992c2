//! The lockstep barrier over real sockets: the same order whatever the timing, and a name when a member does not answer.

use super::support::*;
use protocol::bus::control::{Control, Kind, Role};
use protocol::bus::host::Host;
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{Bus, HostedRig, Received, SendError, WireOptions};
use protocol::can::CanFrame;
use std::path::Path;
use std::time::Duration;

const CYCLES: u32 = 40;
/// A frame that both members send, so that the identifier alone does not give the order.
const SHARED_ID: u16 = 0x155;

fn host(path: &Path, members: usize) -> RunningHost {
    let barrier = BarrierConfig { members, echo_ids: vec![] };
    RunningHost::start(path, WireOptions::default(), Some(barrier))
}

fn frame(id: u16, name: u8, cycle: u32) -> CanFrame {
    let [low, high, ..] = cycle.to_le_bytes();
    CanFrame::new(id, &[name, low, high])
}

fn as_text(log: &mut String, cycle: u32, frames: &[CanFrame]) {
    for frame in frames {
        log.push_str(&format!("{cycle} {frame}\n"));
    }
}

/// Sleeps that differ from cycle to cycle and from pattern to pattern.
fn dawdle(pattern: u64, who: u64, cycle: u32) {
    let mixed = (pattern * 31 + who * 17 + u64::from(cycle)).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60;
    if pattern > 0 && mixed < 8 {
        std::thread::sleep(Duration::from_micros(mixed * 300));
    }
}

/// Where the rig is: a peer like any other, or in one thread with the host, as in the emulator that hosts its bus.
#[derive(Clone, Copy, Debug)]
enum RigAt {
    Socket,
    Host,
}

/// A bus with a barrier for so many members, and its rig; a host that serves in a thread of its own is the last.
fn rig_and_host(path: &Path, rig_at: RigAt, members: usize) -> (Box<dyn Bus>, Option<RunningHost>) {
    match rig_at {
        RigAt::Socket => {
            let host = host(path, members);
            (joined(path, Role::Rig, "rig"), Some(host))
        }
        RigAt::Host => {
            let barrier = BarrierConfig { members, echo_ids: vec![] };
            let host = Host::bind(path, WireOptions::default(), Some(barrier)).unwrap();
            let mut rig = Box::new(HostedRig::new(host, Box::new(|age_ns| now_ns().saturating_sub(age_ns))));
            rig.join_lockstep(Role::Rig, "rig").unwrap();
            (rig, None)
        }
    }
}

/// One run of a rig and two members: what rig, members and a listener heard, by cycle.
fn run(pattern: u64, rig_at: RigAt) -> [String; 4] {
    let place = Place::new();
    let path = place.socket();
    let (mut rig, _host) = rig_and_host(&path, rig_at, 2);
    let mut listener = open(&path);
    // Names and order of joining are against each other: the name decides.
    let order =
        if pattern.is_multiple_of(2) { [("b", b'b'), ("a", b'a')] } else { [("a", b'a'), ("b", b'b')] };
    let mut logs = std::thread::scope(|scope| {
        let members = order.map(|(name, letter)| {
            let mut member = joined(&path, Role::Member, name);
            scope.spawn(move || {
                let mut log = String::new();
                for cycle in 0..CYCLES {
                    as_text(&mut log, cycle, &go(member.as_mut(), cycle));
                    dawdle(pattern, letter.into(), cycle);
                    for id in [SHARED_ID, 0x110 + u16::from(letter)] {
                        member.send(&frame(id, letter, cycle)).unwrap();
                    }
                    dawdle(pattern, u64::from(letter) + 9, cycle);
                    member.done(cycle);
                }
                // Stays until the rig has heard the last: a member that is gone would be another run.
                as_text(&mut log, CYCLES, &go(member.as_mut(), CYCLES));
                (name, log)
            })
        });
        let mut log = String::new();
        for cycle in 0..=CYCLES {
            as_text(&mut log, cycle, &go(rig.as_mut(), cycle));
            dawdle(pattern, 1, cycle);
            for id in [0x121, 0x120] {
                rig.send(&frame(id, b'r', cycle)).unwrap();
            }
            rig.done(cycle);
        }
        // A rig that is its own host has to serve the last round.
        while !members.iter().all(|member| member.is_finished()) {
            rig.receive();
        }
        let mut members = members.map(|member| member.join().unwrap());
        members.sort();
        vec![log, std::mem::take(&mut members[0].1), std::mem::take(&mut members[1].1)]
    });
    let mut heard = String::new();
    // The rig's frames of the last cycle are the last that anybody hears.
    let last = frame(0x121, b'r', CYCLES);
    as_text(&mut heard, 0, &frames_until(listener.as_mut(), |frame| *frame == last));
    logs.push(heard);
    logs.try_into().unwrap()
}

#[test]
fn the_order_of_frames_does_not_depend_on_timing() {
    let first = run(0, RigAt::Socket);
    for pattern in 0..=4 {
        for rig_at in [RigAt::Socket, RigAt::Host] {
            assert_eq!(run(pattern, rig_at), first, "timing pattern {pattern}, rig at {rig_at:?}");
        }
    }
    // And it is the order of the contract: cycle k's frames of both members before Go(k + 1), by identifier, then name.
    let [rig, a, ..] = first;
    let of_cycle = |log: &str, cycle: u32| -> Vec<String> {
        log.lines().filter_map(|line| line.strip_prefix(&format!("{cycle} "))).map(Into::into).collect()
    };
    assert_eq!(of_cycle(&rig, 0), Vec::<String>::new());
    assert_eq!(of_cycle(&rig, 3), ["155#610200", "155#620200", "171#610200", "172#620200"]);
    // A member hears the other's frames of k - 1 and the rig's of k before Go(k).
    assert_eq!(of_cycle(&a, 3), ["155#620200", "172#620200", "120#720300", "121#720300"]);
}

#[test]
fn a_stranger_cannot_speak_for_a_member() {
    let place = Place::new();
    let path = place.socket();
    let host = host(&path, 1);
    let [mut rig, mut member] =
        [(Role::Rig, "rig"), (Role::Member, "drive")].map(|(role, name)| joined(&path, role, name));
    let stranger = raw_client(&path);
    let mut heard = Vec::new();
    for cycle in 0..20 {
        heard.extend(go(rig.as_mut(), cycle));
        rig.done(cycle);
        go(member.as_mut(), cycle);
        for kind in [Kind::Done, Kind::Go { members: 9 }, Kind::TimedOut] {
            send_raw(&stranger, &Control::named(kind, cycle, "drive").to_bytes());
        }
        // Long enough for a host that believes the stranger to give the rig its Go before the member's frame.
        std::thread::sleep(Duration::from_millis(10));
        member.send(&frame(0x110, 0, cycle)).unwrap();
        member.done(cycle);
    }
    heard.extend(go(rig.as_mut(), 20));
    assert_eq!(heard, (0..20).map(|cycle| frame(0x110, 0, cycle)).collect::<Vec<_>>());
    assert_eq!(member.receive(), Received::Nothing);
    assert_eq!((rig.counters().malformed, member.counters().malformed), (0, 0));
    // Only the host says Go and TimedOut.
    assert_eq!(host.stop().malformed, 40);
}

/// A second emulator that is started on a bus in lockstep must not end the run of the first.
#[test]
fn a_second_rig_does_not_take_the_barrier_over() {
    let place = Place::new();
    let path = place.socket();
    let host = host(&path, 1);
    let mut rig = joined(&path, Role::Rig, "rig");
    let mut member = joined(&path, Role::Member, "drive");
    go(rig.as_mut(), 0);
    let second = raw_client(&path);
    send_raw(&second, &Control::named(Kind::Join(Role::Rig), 0, "second").to_bytes());
    send_raw(&second, &Control::new(Kind::Done, 0).to_bytes());
    // Long enough for a host that takes the second for the rig to give the member its Go without the rig's frame.
    std::thread::sleep(Duration::from_millis(50));
    rig.send(&frame(0x120, b'r', 0)).unwrap();
    rig.done(0);
    assert_eq!(go(member.as_mut(), 0), [frame(0x120, b'r', 0)]);
    member.done(0);
    go(rig.as_mut(), 1);
    host.stop();
}

#[test]
fn control_packets_reach_nobody_who_did_not_join() {
    let place = Place::new();
    let path = place.socket();
    let host = RunningHost::plain(&path);
    let [mut one, mut two] = connected(&path);
    // A host without a barrier is asked to join, and given things.
    one.join_lockstep(Role::Member, "drive").unwrap();
    one.done(0);
    send_fence(one.as_mut());
    one.done(1); // what a member posts leaves with its word
    assert_eq!(frames_until_fence(two.as_mut()), []);
    assert_eq!(two.counters().malformed, 0);
    two.send(&numbered(1, 1)).unwrap();
    assert_eq!(next_frame(one.as_mut()).0, numbered(1, 1));
    host.stop();
}

#[test]
fn a_member_that_leaves_does_not_hold_the_barrier() {
    let place = Place::new();
    let path = place.socket();
    let host = host(&path, 2);
    let mut rig = joined(&path, Role::Rig, "rig");
    let [mut stays, mut leaves] = ["stays", "leaves"].map(|name| joined(&path, Role::Member, name));
    go(rig.as_mut(), 0);
    rig.done(0);
    go(stays.as_mut(), 0);
    go(leaves.as_mut(), 0);
    stays.done(0);
    drop(leaves);
    let (_, control) = until_word(rig.as_mut());
    assert_eq!((control.kind, control.cycle), (Kind::Go { members: 1 }, 1));
    let report = host.stop();
    assert_eq!(
        report.peers.iter().map(|peer| peer.name.as_str()).collect::<Vec<_>>(),
        ["rig", "stays", "leaves"]
    );
}

#[test]
fn the_rig_receives_the_name_of_a_member_that_is_never_done() {
    // Both at once, because each takes the 5 s of the contract.
    std::thread::scope(|scope| {
        for rig_at in [RigAt::Socket, RigAt::Host] {
            scope.spawn(move || a_silent_member_is_named(rig_at));
        }
    });
}

fn a_silent_member_is_named(rig_at: RigAt) {
    let place = Place::new();
    let path = place.socket();
    let (mut rig, _host) = rig_and_host(&path, rig_at, 2);
    let [mut good, mut silent] = ["good", "silent"].map(|name| joined(&path, Role::Member, name));
    go(rig.as_mut(), 0);
    rig.done(0);
    good.done(0); // may come before its Go: it is the cycle that counts
    let (frames, control) = until_word(rig.as_mut());
    assert_eq!(
        (frames.len(), control.kind, control.name().as_str()),
        (0, Kind::TimedOut, "silent"),
        "{rig_at:?}"
    );
    go(silent.as_mut(), 0);
}

/// Old commands replayed after a reconnect are what users of such tools complain about.
#[test]
fn what_a_member_posts_while_the_bus_is_down_is_dropped_and_never_sent() {
    let place = Place::new();
    let path = place.socket();
    let first = RunningHost::plain(&path);
    let mut member = joined(&path, Role::Member, "drive");
    first.stop();
    wait_until_down(member.as_mut());
    assert_eq!(member.send(&frame(0x110, 0, 0)), Err(SendError::Down));
    assert_eq!((member.counters().sent, member.counters().dropped_on_send), (0, 1));
    let second = RunningHost::plain(&path);
    let mut listener = open(&path);
    wait_until_up(member.as_mut());
    send_fence(member.as_mut());
    member.done(1);
    assert_eq!(frames_until_fence(listener.as_mut()), []);
    second.stop();
}
