//! The protocol against itself and against frames by hand; against the kernel's own it is held by
//! `tests/tests/socketcan_answers.rs`.

use super::*;

const ONE: Identifiers = Identifiers { sent: 0x7E0, received: 0x7E8 };
const OTHER: Identifiers = Identifiers { sent: 0x7E8, received: 0x7E0 };

/// An end with these options: flags, extended address, and block size and STmin of its flow control.
fn end(identifiers: Identifiers, flags: u32, address: u8, [block_size, stmin]: [u8; 2]) -> IsoTp {
    let mut end = IsoTp::default();
    let options = [&flags.to_ne_bytes()[..], &[0; 4], &[address, 0xAA, 0xAA, 0]].concat();
    end.set(1, &options).unwrap();
    end.set(2, &[block_size, stmin, 0]).unwrap();
    end.bind(identifiers, true).unwrap();
    end
}

fn take(end: &mut IsoTp, frame: &FrameBytes, now: Instant) -> Vec<Event> {
    let mut events = Vec::new();
    end.take_frame(frame, now, &mut events);
    events
}

/// Sends a message to the other end and gives what that received, the data of all frames, and the time that it took.
fn carry(one: &mut IsoTp, other: &mut IsoTp, message: &[u8]) -> (Vec<u8>, Vec<Vec<u8>>, Duration) {
    let began = Instant::now();
    let (mut now, mut frames) = (began, Vec::new());
    let mut next = Some(one.start(message, now).unwrap());
    loop {
        let Some(frame) = next else { panic!("nothing is due") };
        frames.push(frame[8..8 + usize::from(frame[4])].to_vec());
        for event in take(other, &frame, now) {
            match event {
                Event::Received(message) => return (message, frames, now - began),
                Event::Reply(frame) => {
                    frames.push(frame[8..8 + usize::from(frame[4])].to_vec());
                    assert_eq!(take(one, &frame, now), []);
                }
                other => panic!("{other:?}"),
            }
        }
        now = one.due().expect("it goes on");
        next = one.take_due(now).map(|(frame, _)| frame);
    }
}

#[test]
fn every_length_arrives_whole_in_every_kind_of_frame() {
    let plain = (0, 0);
    let extended = (flag::EXTEND_ADDR, 0x55);
    let padded = (flag::TX_PADDING | flag::RX_PADDING | flag::CHK_PAD_LEN | flag::CHK_PAD_DATA, 0);
    for (flags, address) in [plain, extended, padded] {
        for length in [1, 6, 7, 8, 12, 13, 14, 4095, 4096, 66000] {
            let (mut one, mut other) =
                (end(ONE, flags, address, [0, 0]), end(OTHER, flags, address, [3, 0xF1]));
            let message: Vec<u8> = (0..length).map(|byte| byte as u8).collect();
            let (received, ..) = carry(&mut one, &mut other, &message);
            assert_eq!(received, message, "{length} bytes, flags {flags:#x}");
            assert!(!one.is_sending() && other.due().is_none());
        }
    }
}

#[test]
fn blocks_and_gaps_are_those_of_the_flow_control() {
    let (mut one, mut other) = (end(ONE, 0, 0, [0, 0]), end(OTHER, 0, 0, [2, 20]));
    let (_, frames, took) = carry(&mut one, &mut other, &[0x11; 6 + 4 * 7]);
    let heads: Vec<u8> = frames.iter().map(|data| data[0]).collect();
    assert_eq!(heads, [0x10, 0x30, 0x21, 0x22, 0x30, 0x23, 0x24]);
    // The first frame of a block comes at once; 50 us are the frame time that nobody changed.
    assert_eq!(took, 2 * (Duration::from_millis(20) + Duration::from_micros(50)));
}

#[test]
fn silence_of_the_other_side_ends_a_message_on_both_sides() {
    let now = Instant::now();
    let mut one = end(ONE, 0, 0, [0, 0]);
    let first = one.start(&[1; 20], now).unwrap();
    let mut events = Vec::new();
    one.advance(now + PEER_TIMEOUT - Duration::from_nanos(1), &mut events);
    assert!(events.is_empty() && one.is_sending());
    one.advance(now + PEER_TIMEOUT, &mut events);
    assert_eq!(events, [Event::SendingFailed(Errno::COMM)]);
    assert!(!one.is_sending());

    let mut other = end(OTHER, 0, 0, [0, 0]);
    assert_eq!(take(&mut other, &first, now).len(), 1);
    let mut events = Vec::new();
    other.advance(now + PEER_TIMEOUT, &mut events);
    assert_eq!(events, [Event::ReceivingFailed(Errno::TIMEDOUT)]);
}

#[test]
fn an_interface_without_room_is_tried_again_until_two_seconds_are_over() {
    let now = Instant::now();
    let mut one = end(ONE, flag::CF_BROADCAST, 0, [0, 0]);
    let _ = one.start(&[1; 20], now).unwrap();
    let (mut at, mut events, mut tries) = (now, Vec::new(), 0);
    while events.is_empty() {
        at = one.due().unwrap();
        let (frame, before) = one.take_due(at).unwrap();
        assert_eq!(frame[8..10], [0x21, 1]);
        one.put_back(before, at, &mut events);
        tries += 1;
    }
    assert_eq!(events, [Event::SendingFailed(Errno::COMM)]);
    assert!(tries > 1900 && at - now >= INTERFACE_TIMEOUT, "{tries}");
}

#[test]
fn malformed_frames_are_answered_as_the_kernel_does() {
    let now = Instant::now();
    let with = |data: &[u8]| frame(OTHER.received, data);
    let mut other = end(OTHER, 0, 0, [0, 0]);
    for ignored in [&[0x00, 1][..], &[0x03, 1, 2], &[0x10, 20, 1, 2], &[0x10, 5, 1, 2, 3, 4, 5, 6], &[0x40]] {
        assert_eq!(take(&mut other, &with(ignored), now), [], "{ignored:?}");
    }
    let too_long = with(&[0x10, 0, 0, 1, 1, 0xD1, 1, 2]);
    assert_eq!(take(&mut other, &too_long, now), [Event::Reply(frame(OTHER.sent, &[0x32, 0, 0]))]);
    let _ = take(&mut other, &with(&[0x10, 20, 1, 2, 3, 4, 5, 6]), now);
    let wrong_number = with(&[0x22, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(take(&mut other, &wrong_number, now), [Event::ReceivingFailed(Errno::ILSEQ)]);
}

/// An end with these flags, frame time, and forced STmin in both directions, ns.
fn timed_end(identifiers: Identifiers, flags: u32, frame_time_ns: u32, st_min_ns: u32) -> IsoTp {
    let mut end = IsoTp::default();
    let options = [&flags.to_ne_bytes()[..], &frame_time_ns.to_ne_bytes(), &[0, 0xAA, 0xAA, 0]].concat();
    end.set(1, &options).unwrap();
    end.set(3, &st_min_ns.to_ne_bytes()).unwrap();
    end.set(4, &st_min_ns.to_ne_bytes()).unwrap();
    end.bind(identifiers, true).unwrap();
    end
}

#[test]
fn the_time_between_consecutive_frames_is_forced_stmin_and_frame_time() {
    // The first consecutive frame comes at once, the second one STmin after it.
    for (flags, frame_time_ns, expected_us) in [
        (0, 0, 20_050),
        (0, u32::MAX, 20_000),
        (0, 300_000, 20_300),
        (flag::FORCE_TXSTMIN, 0, 7_050),
        (flag::FORCE_TXSTMIN, u32::MAX, 7_000),
    ] {
        let mut one = timed_end(ONE, flags, frame_time_ns, 7_000_000);
        let (_, _, took) = carry(&mut one, &mut end(OTHER, 0, 0, [0, 20]), &[1; 20]);
        assert_eq!(took, Duration::from_micros(expected_us), "flags {flags:#x}, frame time {frame_time_ns}");
    }
}

#[test]
fn consecutive_frames_that_come_too_early_do_not_count() {
    let (now, at) = (Instant::now(), Duration::from_millis);
    let mut other = timed_end(OTHER, flag::FORCE_RXSTMIN, 0, 5_000_000);
    let with = |data: &[u8]| frame(OTHER.received, data);
    assert_eq!(take(&mut other, &with(&[0x10, 20, 1, 2, 3, 4, 5, 6]), now).len(), 1);
    assert_eq!(take(&mut other, &with(&[0x21, 7, 8, 9, 10, 11, 12, 13]), now + at(1)), []);
    let last = with(&[0x22, 14, 15, 16, 17, 18, 19, 20]);
    assert_eq!(take(&mut other, &last, now + at(5)), []);
    assert_eq!(take(&mut other, &last, now + at(6)), [Event::Received((1..=20).collect())]);
}

#[test]
fn a_listener_hears_a_message_and_says_nothing() {
    let now = Instant::now();
    let mut other = end(OTHER, flag::LISTEN_MODE, 0, [1, 0]);
    let with = |data: &[u8]| frame(OTHER.received, data);
    assert_eq!(take(&mut other, &with(&[0x10, 20, 1, 2, 3, 4, 5, 6]), now), []);
    assert_eq!(other.due(), None);
    assert_eq!(take(&mut other, &with(&[0x21, 7, 8, 9, 10, 11, 12, 13]), now), []);
    let last = with(&[0x22, 14, 15, 16, 17, 18, 19, 20]);
    assert_eq!(take(&mut other, &last, now), [Event::Received((1..=20).collect())]);
}

#[test]
fn half_duplex_hears_no_message_while_it_sends_and_no_flow_control_while_it_receives() {
    let now = Instant::now();
    let with = |data: &[u8]| frame(ONE.received, data);
    for (flags, heard) in [(flag::HALF_DUPLEX, 0), (0, 1)] {
        let mut one = end(ONE, flags, 0, [0, 0]);
        let _ = one.start(&[1; 20], now).unwrap();
        assert_eq!(take(&mut one, &with(&[2, 1, 2]), now).len(), heard);
        assert!(one.is_sending());
    }
    for (flags, is_due_now) in [(flag::HALF_DUPLEX, false), (0, true)] {
        let mut one = end(ONE, flags, 0, [0, 0]);
        assert_eq!(take(&mut one, &with(&[0x10, 20, 1, 2, 3, 4, 5, 6]), now).len(), 1);
        let _ = one.start(&[1; 20], now).unwrap();
        let _ = take(&mut one, &with(&[0x30, 0, 0]), now);
        assert_eq!(one.take_due(now).is_some(), is_due_now);
    }
}

#[test]
fn identifiers_of_29_bits_are_distinguished_from_those_of_11() {
    let (low, high) = (0x18DA_F110 | EXTENDED_FLAG, 0x18DA_10F1 | EXTENDED_FLAG);
    let one = Identifiers { sent: low, received: high };
    let (mut one, mut other) =
        (end(one, 0, 0, [0, 0]), end(Identifiers { sent: high, received: low }, 0, 0, [0, 0]));
    assert_eq!(carry(&mut one, &mut other, &[7; 30]).0, [7; 30]);
    let now = Instant::now();
    let short = Identifiers { sent: 0x7E0, received: 0x110 };
    let long = Identifiers { sent: 0x7E0, received: 0x110 | EXTENDED_FLAG };
    for (identifiers, other) in [(short, long.received), (long, short.received)] {
        let mut end = end(identifiers, 0, 0, [0, 0]);
        assert_eq!(take(&mut end, &frame(other, &[1, 9]), now), []);
        assert_eq!(take(&mut end, &frame(identifiers.received, &[1, 9]), now), [Event::Received(vec![9])]);
    }
    let beyond = Identifiers { sent: 0x2000_0000 | EXTENDED_FLAG, received: 0x7E8 };
    assert_eq!(IsoTp::default().check(beyond), Err(Errno::INVAL));
}
