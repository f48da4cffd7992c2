//! Losses add up: what the wire loses on purpose, and what a listener loses that does not read, are in the host's report by
//! identifier, and equal what the receivers missed.

use super::support::*;
use protocol::bus::host::HostReport;
use protocol::bus::{Received, WireOptions};
use protocol::can::CanFrame;
use std::collections::BTreeMap;

type FramesByName = BTreeMap<String, u64>;

const IDS: [u16; 3] = [0x110, 0x120, 0x121];

fn by_id(frames: &[CanFrame]) -> FramesByName {
    let mut table = FramesByName::new();
    for frame in frames {
        *table.entry(format!("{:03X}", frame.standard_id().expect("plain frames only"))).or_default() += 1;
    }
    table
}

/// `sent` less `received`, identifiers with nothing missing left out.
fn missing(sent: &[CanFrame], received: &[CanFrame]) -> FramesByName {
    let mut table = by_id(sent);
    for (id, count) in by_id(received) {
        *table.get_mut(&id).expect("nothing is received that was not sent") -= count;
    }
    table.retain(|_, count| *count > 0);
    table
}

/// Sends [`FITS_ANY_QUEUE`] frames over a wire that loses some, to two listeners.
fn over_lossy_wire(wire: WireOptions) -> (Vec<CanFrame>, [Vec<CanFrame>; 2], HostReport) {
    let place = Place::new();
    let host = RunningHost::start(&place.socket(), wire, None);
    // The sender connects last, so the listeners are in before its first frame, with no hello that could be lost.
    let [mut one, mut two, mut sender] = std::array::from_fn(|_| open(&place.socket()));
    let sent: Vec<_> = (0..FITS_ANY_QUEUE).map(|number| numbered(IDS[number % 3], number)).collect();
    for frame in &sent {
        sender.send(frame).unwrap();
    }
    // A fence may be lost too; some other gets through. One listener drops out of the loop when it heard one, and what
    // one hears the other hears.
    let received = std::thread::scope(|scope| {
        let listeners =
            [&mut one, &mut two].map(|listener| scope.spawn(|| frames_until_fence(listener.as_mut())));
        wait_for("a fence to get through", || {
            send_fence(sender.as_mut());
            listeners.iter().all(|listener| listener.is_finished()).then_some(())
        });
        listeners.map(|listener| listener.join().unwrap())
    });
    let report = host.stop();
    (sent, received, report)
}

#[test]
fn injected_loss_is_counted_by_identifier_as_the_receivers_missed_it() {
    let (sent, [one, two], report) = over_lossy_wire(WireOptions { loss: 0.3, seed: 7, timing: None });
    assert!(one == two, "a lost frame is lost for all: {} and {} heard", one.len(), two.len());
    let lost = missing(&sent, &one);
    let mut injected = report.injected_loss.by_name();
    injected.remove(&format!("{FENCE_ID:03X}"));
    assert_eq!(injected, lost);
    assert_eq!(lost.len(), IDS.len(), "with 60 of 200 expected lost, each identifier lost some: {lost:?}");
    assert!(report.frames >= sent.len() as u64, "lost frames were on the wire");
}

#[test]
fn the_same_seed_loses_the_same_frames() {
    let run = |seed| over_lossy_wire(WireOptions { loss: 0.3, seed, timing: None }).1[0].clone();
    let first = run(7);
    assert!(first == run(7), "the same seed lost other frames");
    assert!(first != run(8), "another seed lost the same frames");
}

#[test]
fn a_wire_without_loss_loses_nothing() {
    let (sent, received, report) = over_lossy_wire(WireOptions::default());
    assert!(
        received.iter().all(|received| *received == sent),
        "{:?}",
        received.map(|received| received.len())
    );
    assert!(report.injected_loss.is_empty());
}

#[test]
fn a_listener_that_does_not_read_loses_frames_that_are_accounted_for_and_nobody_else_does() {
    /// Far more than the 2 MiB of a queue hold at some 750 bytes a frame, twice over for the kernel's doubling.
    const FRAMES: usize = 14_000;
    const ROUND: usize = FITS_ANY_QUEUE / 2;
    let (_place, host, [mut listener, mut reader, mut sender]) = served();
    let sent: Vec<_> = (0..FRAMES).map(|number| numbered(IDS[number % 3], number)).collect();
    // The reader paces the sender: it must never be the one whose queue is full.
    for round in sent.chunks(ROUND) {
        for frame in round {
            sender.send(frame).unwrap();
        }
        for frame in round {
            assert_eq!(next_frame(reader.as_mut()).0, *frame);
        }
    }
    let mut heard = Vec::new();
    // A peer may say Nothing once between two batches; twice means that its queue is empty.
    let mut nothings = 0;
    while nothings < 2 {
        match listener.receive() {
            Received::Frame(frame, _) => heard.push(frame),
            _ => nothings += 1,
        }
    }
    heard.retain(|frame| frame.standard_id() != Some(HELLO_ID));
    // It is a peer like any other again as soon as it reads.
    send_fence(sender.as_mut());
    assert_eq!(frames_until_fence(listener.as_mut()).len(), 0);
    let report = host.stop();
    let [at_listener, at_reader, at_sender] = report.peers.as_slice() else {
        panic!("three peers: {:?}", report.peers)
    };
    let lost = missing(&sent, &heard);
    assert_eq!(lost.len(), IDS.len(), "{FRAMES} frames fit the queue: the test shows nothing");
    assert_eq!(at_listener.dropped_at_queue.by_name(), lost);
    assert!(at_reader.dropped_at_queue.is_empty() && at_sender.dropped_at_queue.is_empty());
    assert_eq!(at_sender.frames_received, FRAMES as u64 + 2); // with hello and fence
}
