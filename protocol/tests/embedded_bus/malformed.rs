//! Packets that are no frames: counted where they arrive, delivered to nobody, and no harm to anyone else.

use super::support::*;
use protocol::bus::Received;
use protocol::can::{CAN_FRAME_BYTES, CanFrame};

/// Packets of every length that is no frame, and frames of every length byte that classic CAN does not have.
fn malformed_packets() -> Vec<Vec<u8>> {
    let lengths = (1..=64).chain([65, 72, 100, 1000]).filter(|length| *length != CAN_FRAME_BYTES);
    let frames = (9..=u8::MAX).map(|length| {
        let mut frame = CanFrame::new(0x110, &[0; 8]).to_bytes();
        frame[4] = length;
        frame.to_vec()
    });
    lengths.map(|length| vec![0x11; length]).chain(frames).collect()
}

#[test]
fn the_host_counts_malformed_packets_and_passes_none_on() {
    let (place, host, [mut listener, _other]) = served();
    let client = raw_client(&place.socket());
    let packets = malformed_packets();
    for packet in &packets {
        send_raw(&client, packet);
    }
    send_raw(&client, &CanFrame::new(FENCE_ID, &[]).to_bytes());
    assert_eq!(frames_until_fence(listener.as_mut()), []);
    assert_eq!(listener.counters().malformed, 0, "a malformed packet reached another peer");
    let report = host.stop();
    assert_eq!((report.malformed, report.frames), (packets.len() as u64, 2));
    assert_eq!(report.peers[2].frames_received, 1);
}

#[test]
fn a_packet_without_bytes_ends_its_senders_connection_and_no_other() {
    let (place, host, [mut one, mut two]) = served();
    let client = raw_client(&place.socket());
    // A socket cannot distinguish it from a peer that closed.
    send_raw(&client, &[]);
    let mut bytes = [0_u8; 16];
    assert_eq!(rustix::net::recv(&client, &mut bytes, rustix::net::RecvFlags::empty()).unwrap().0, 0);
    one.send(&numbered(1, 1)).unwrap();
    assert_eq!(next_frame(two.as_mut()).0, numbered(1, 1));
    host.stop();
}

#[test]
fn a_peer_counts_what_a_foreign_host_sends_malformed() {
    let (_place, mut peer, host) = foreign_host();
    let packets = malformed_packets();
    // In rounds that fit the queue, so that sending never waits for a peer that is not read in between.
    for round in packets.chunks(FITS_ANY_QUEUE / 2) {
        for packet in round {
            send_raw(&host, packet);
        }
        assert_eq!(peer.receive(), Received::Nothing);
    }
    let frame = CanFrame::new(0x120, &[1]);
    send_raw(&host, &frame.to_bytes());
    assert_eq!(next_frame(peer.as_mut()).0, frame);
    assert_eq!((peer.counters().malformed, peer.counters().received), (packets.len() as u64, 1));
    assert!(peer.is_up());
}
