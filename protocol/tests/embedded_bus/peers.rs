//! What peers see of each other: echo rule, order, stamps, and a host that comes, goes and comes back.

use super::support::*;
use protocol::bus::{Bus, Received, SendError};
use protocol::can::CanFrame;
use std::time::Duration;

#[test]
fn a_sender_does_not_hear_itself_and_everyone_else_does() {
    let (_place, host, [mut sender, mut other, mut third]) = served();
    let frame = CanFrame::new(0x123, &[1, 2, 3]);
    sender.send(&frame).unwrap();
    for peer in [&mut other, &mut third] {
        assert_eq!(frames_until(peer.as_mut(), |next| *next == frame), []);
    }
    // Sent after `other` had heard the frame: whatever the sender's queue got of it would lie before this.
    send_fence(other.as_mut());
    assert_eq!(frames_until_fence(sender.as_mut()), []);
    assert_eq!((sender.counters().sent, sender.counters().received), (1, 2)); // the hello and the fence
    drop((sender, other, third));
    assert_eq!(host.stop().frames, 3);
}

#[test]
fn all_peers_hear_the_same_frames_in_the_same_order() {
    const SENDERS: usize = 3;
    const EACH: usize = FITS_ANY_QUEUE / (SENDERS + 1);
    let (_place, host, [mut one, mut two, a, b, c]) = served();
    let senders = [a, b, c];
    std::thread::scope(|scope| {
        for (id, mut sender) in (0x100..).zip(senders) {
            scope.spawn(move || {
                for number in 0..EACH {
                    sender.send(&numbered(id, number)).unwrap();
                    std::thread::yield_now();
                }
                // Leaving with unread frames is another test's matter.
                while sender.counters().received < ((SENDERS - 1) * EACH) as u64 {
                    next_frame(sender.as_mut());
                }
            });
        }
    });
    let take = |peer: &mut dyn Bus| -> Vec<CanFrame> {
        let mut frames = Vec::new();
        while frames.len() < SENDERS * EACH {
            frames.push(next_frame(peer).0);
            frames.retain(|frame| frame.standard_id() != Some(HELLO_ID));
        }
        frames
    };
    let heard = take(one.as_mut());
    assert!(heard == take(two.as_mut()), "two listeners heard the same frames in another order");
    for id in 0x100..0x100 + SENDERS as u16 {
        let of_sender: Vec<_> =
            heard.iter().filter(|frame| frame.standard_id() == Some(id)).copied().collect();
        let sent: Vec<_> = (0..EACH).map(|number| numbered(id, number)).collect();
        assert!(of_sender == sent, "sender {id:#x}: {of_sender:?}");
    }
    assert!(host.stop().peers.iter().all(|peer| peer.dropped_at_queue.is_empty()));
}

#[test]
fn a_frame_is_stamped_when_it_arrives_and_not_when_it_is_read() {
    // The host serves peers in the order of connecting: what the witness has heard is in the reader's queue.
    let (_place, _host, [mut reader, mut witness, mut sender]) = served();
    let before_ns = now_ns();
    let sent_ns = sender.send(&CanFrame::new(0x42, &[])).unwrap();
    let after_send_ns = now_ns();
    frames_until(witness.as_mut(), |frame| frame.standard_id() == Some(0x42));
    let in_queue_ns = now_ns();
    std::thread::sleep(Duration::from_millis(30));
    let (frame, arrived_ns) = next_frame(reader.as_mut());
    assert_eq!(frame.standard_id(), Some(0x42));
    assert!((before_ns..=after_send_ns).contains(&sent_ns), "{before_ns} {sent_ns} {after_send_ns}");
    // The wall clock, in which the kernel stamps, and the monotonic one are read one after the other: that gap is far
    // below the 30 ms that the frame waited, unless the wall clock is stepped by hand in between.
    let slack_ns = 10_000_000;
    assert!(arrived_ns + slack_ns >= before_ns, "arrived at {arrived_ns}, sent after {before_ns}");
    assert!(arrived_ns <= in_queue_ns + slack_ns, "arrived at {arrived_ns}, was there at {in_queue_ns}");
}

#[test]
fn a_peer_opened_before_its_host_connects_when_the_host_comes() {
    let place = Place::new();
    let mut early = open(&place.socket());
    assert!(!early.is_up());
    assert_eq!(early.send(&CanFrame::new(0x99, &[])), Err(SendError::Down));
    let host = RunningHost::plain(&place.socket());
    wait_until_up(early.as_mut());
    let mut late = open(&place.socket());
    send_fence(late.as_mut());
    assert_eq!(frames_until_fence(early.as_mut()), []);
    early.send(&CanFrame::new(0x55, &[])).unwrap();
    // Had the frame sent too early been kept, it would come first.
    assert_eq!(next_frame(late.as_mut()).0.standard_id(), Some(0x55));
    let counters = early.counters();
    assert_eq!((counters.sent, counters.dropped_on_send), (1, 1));
    assert_eq!((counters.disconnects, counters.reconnects), (0, 0), "it was never gone, only not yet there");
    assert_eq!(host.stop().frames, 2);
}

#[test]
fn a_host_that_went_and_came_back_is_counted_and_nothing_is_replayed() {
    const DROPPED: u64 = 5;
    let (place, first, [mut a, mut b]) = served();
    first.stop();
    for peer in [&mut a, &mut b] {
        wait_until_down(peer.as_mut());
    }
    for number in 0..DROPPED {
        assert_eq!(a.send(&CanFrame::new(0x99, &[number as u8])), Err(SendError::Down));
    }
    let second = RunningHost::plain(&place.socket());
    for peer in [&mut a, &mut b] {
        wait_until_up(peer.as_mut());
    }
    // `a` came back first and `b` is heard by it, so both are in.
    send_fence(b.as_mut());
    assert_eq!(frames_until_fence(a.as_mut()), []);
    a.send(&CanFrame::new(0x55, &[])).unwrap();
    assert_eq!(next_frame(b.as_mut()).0.standard_id(), Some(0x55));
    for peer in [&a, &b] {
        assert_eq!((peer.counters().disconnects, peer.counters().reconnects), (1, 1));
    }
    assert_eq!((a.counters().sent, a.counters().dropped_on_send), (1, DROPPED));
    assert_eq!(
        second.stop().frames,
        2,
        "the new host saw the fence and the fresh frame, and none of the old"
    );
}

#[test]
fn waiting_ends_at_once_while_frames_wait_to_be_taken() {
    let (_place, _host, [mut reader, mut witness, mut sender]) = served();
    // All are in the reader's queue when the witness, who connected later, has the last.
    for number in 0..3 {
        sender.send(&numbered(0x77, number)).unwrap();
    }
    send_fence(sender.as_mut());
    frames_until_fence(witness.as_mut());
    assert_eq!(next_frame(reader.as_mut()).0, numbered(0x77, 0));
    // No figure of speed: a wait that does not see the others lasts its whole time.
    let patience = Duration::from_secs(10);
    let began = std::time::Instant::now();
    reader.wait_readable(patience);
    assert!(began.elapsed() < patience, "slept although frames were waiting");
    assert_eq!(frames_until_fence(reader.as_mut()).len(), 2);
}

/// The rig sends before it reads, so it is its sending that connects it anew; what its old connection left unread, its end
/// above all, must not end the new one.
#[test]
fn a_peer_that_comes_back_by_sending_stays() {
    let (place, first, [mut a, b]) = served();
    drop(b);
    first.stop();
    wait_until_down(a.as_mut());
    let second = RunningHost::plain(&place.socket());
    wait_for("the peer to come back by sending", || {
        a.send(&CanFrame::new(HELLO_ID, &[])).is_ok().then_some(())
    });
    let mut b = open(&place.socket());
    for number in 0..20 {
        assert_eq!(a.receive(), Received::Nothing, "round {number}");
        assert!(a.is_up(), "round {number}");
        a.send(&numbered(0x55, number)).unwrap();
    }
    // `b` may have been accepted after the first of them, but hears the last whenever it was: that one is reported again.
    b.send(&CanFrame::new(HELLO_ID, &[])).unwrap();
    next_frame(a.as_mut());
    send_fence(a.as_mut());
    frames_until_fence(b.as_mut());
    assert_eq!((a.counters().disconnects, a.counters().reconnects), (1, 1));
    second.stop();
}

#[test]
fn what_a_host_delivered_before_it_went_can_still_be_read() {
    // What the witness has heard is in the reader's queue, the host serving peers in the order of connecting.
    let (_place, host, [mut reader, mut witness, mut sender]) = served();
    let sent: Vec<_> = (0..20).map(|number| numbered(0x77, number)).collect();
    for frame in &sent {
        sender.send(frame).unwrap();
    }
    send_fence(sender.as_mut());
    assert_eq!(frames_until_fence(witness.as_mut()), sent);
    host.stop();
    assert_eq!(frames_until_fence(reader.as_mut()), sent);
    wait_until_down(reader.as_mut());
}

/// The kernel reports a connection that was closed with unread packets before it hands out what came over it. A peer that
/// took this for the end once lost the rig's farewell to a host that stopped while a command was under way.
#[test]
fn what_a_host_sent_is_read_even_if_it_died_with_packets_unread() {
    let (_place, mut peer, host) = foreign_host();
    peer.send(&CanFrame::new(0x110, &[])).unwrap();
    send_raw(&host, &CanFrame::new(0x120, &[]).to_bytes());
    drop(host);
    assert_eq!(next_frame(peer.as_mut()).0.standard_id(), Some(0x120));
}

/// A program that sends one emergency stop and leaves, as `cansend` does, never reads: the rig's frames wait for it.
#[test]
fn the_last_frame_of_a_peer_that_leaves_without_reading_arrives() {
    const CLIENTS: u64 = 50;
    let place = Place::new();
    let host = RunningHost::plain(&place.socket());
    let (mut other, mut talker) = (open(&place.socket()), open(&place.socket()));
    let mut heard = Vec::new();
    for client in 0..CLIENTS {
        let leaving = raw_client(&place.socket());
        send_raw(&leaving, &CanFrame::new(HELLO_ID, &[]).to_bytes());
        heard.extend(frames_until(other.as_mut(), |frame| frame.standard_id() == Some(HELLO_ID)));
        talker.send(&CanFrame::new(0x120, &[])).unwrap();
        wait_for("the talker's frame to lie unread before the client", || {
            rustix::io::ioctl_fionread(&leaving).is_ok_and(|bytes| bytes > 0).then_some(())
        });
        send_raw(&leaving, &CanFrame::new(0x108, &[client as u8]).to_bytes());
        drop(leaving);
    }
    let stops =
        |heard: &[CanFrame]| heard.iter().filter(|frame| frame.standard_id() == Some(0x108)).count() as u64;
    while stops(&heard) < CLIENTS {
        heard.push(next_frame(other.as_mut()).0);
    }
    drop((other, talker));
    let taken: u64 = host.stop().peers.iter().map(|peer| peer.frames_received).sum();
    assert_eq!(taken, 3 * CLIENTS);
}
