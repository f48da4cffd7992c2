//! Sessions, byte by byte: what the standard's commands answer, in which order, and what is refused.

use super::*;
use crate::image::tests::{ActionLog, image};
use crate::image::{CONTROL, PARAMETERS, SIGNAL};
use crate::lock;
use crate::packet::{ERROR, RESPONSE};
use proptest::prelude::*;

const SECRET: &[u8] = b"sixteen bytes ok";

/// A slave under test, and the actions that it called.
struct SlaveBench {
    slave: Slave,
    log: ActionLog,
}

impl SlaveBench {
    fn new() -> Self {
        let texts = TextLocations { a2l: (0, 11), file: (1, 2), epk: (3, 4), event: (5, 6) };
        let lock = Lock::new(Some(SECRET.to_vec()), [9; 16]);
        let slave = Slave::new(image(), texts, lock, 1);
        Self { slave, log: ActionLog::default() }
    }

    fn connected() -> Self {
        let mut bench = Self::new();
        bench.good(&[0xFF, 0]);
        bench
    }

    fn unlocked() -> Self {
        let mut bench = Self::connected();
        let seed = bench.seed();
        bench.unlock(key(seed));
        assert!(bench.slave.is_unlocked());
        bench
    }

    fn command(&mut self, packet: &[u8]) -> Option<Packet> {
        self.slave.command(packet, 1234, &mut self.log)
    }

    #[track_caller]
    fn good(&mut self, packet: &[u8]) -> [u8; 7] {
        let answer = self.command(packet).expect("an answer");
        assert_eq!(answer[0], RESPONSE, "{packet:02X?} is refused: {answer:02X?}");
        answer[1..].try_into().unwrap()
    }

    #[track_caller]
    fn refused(&mut self, packet: &[u8], why: Refusal) {
        let answer = self.command(packet).expect("an answer");
        assert_eq!(answer[..2], [ERROR, why as u8], "{packet:02X?}");
    }

    fn to(&mut self, address: u32) {
        let [a, b, c, d] = address.to_le_bytes();
        self.good(&[0xF6, 0, 0, 0, a, b, c, d]);
    }

    fn seed(&mut self) -> [u8; lock::BYTES] {
        let first = self.good(&[0xF8, 0, 1]);
        let second = self.good(&[0xF8, 1, 0]);
        assert_eq!((first[0], second[0]), (8, 2));
        [&first[1..7], &second[1..3]].concat().try_into().unwrap()
    }

    fn unlock(&mut self, key: [u8; lock::BYTES]) -> Option<Packet> {
        let [a, b, c, d, e, f, g, h] = key;
        self.good(&[0xF7, 8, a, b, c, d, e, f]);
        self.command(&[0xF7, 2, g, h])
    }

    fn write(&mut self, value: f64) -> Packet {
        let [a, b, c, d, e, f, g, h] = value.to_le_bytes();
        self.to(PARAMETERS);
        self.good(&[0xF0, 6, a, b, c, d, e, f]);
        self.command(&[0xF0, 2, g, h]).expect("an answer")
    }
}

fn key(seed: [u8; lock::BYTES]) -> [u8; lock::BYTES] {
    lock::key(SECRET, seed)
}

#[test]
fn nothing_is_answered_before_connect_and_after_disconnect() {
    let mut bench = SlaveBench::new();
    for packet in [&[][..], &[0xFD], &[0xF5, 4], &[0x00; 8]] {
        assert_eq!(bench.command(packet), None);
    }
    assert_eq!(bench.good(&[0xFF, 0]), [0x05, 0x80, 8, 8, 0, 1, 1]);
    assert_eq!(bench.good(&[0xFD])[..2], [0, 1], "calibration is protected");
    bench.good(&[0xFE]);
    assert_eq!(bench.command(&[0xFD]), None);
}

#[test]
fn what_the_slave_is_can_be_asked_for() {
    let mut bench = SlaveBench::connected();
    assert_eq!(bench.good(&[0xFB]), [0, 1, 0, 43, 0, 0, 1]);
    assert_eq!(bench.good(&[0xFA, 4]), [0, 0, 0, 11, 0, 0, 0]);
    assert_eq!(bench.good(&[0xF5, 7]), *b"descrip");
    assert_eq!(bench.good(&[0xF5, 4])[..4], *b"tion");
    bench.refused(&[0xF5, 1], Refusal::AccessDenied);
    assert_eq!(bench.good(&[0xFA, 9]), [0; 7], "an identification that is not offered has no length");
    bench.refused(&[0xFC], Refusal::Synch);
    bench.refused(&[0xEA], Refusal::Unknown);
    bench.refused(&[0xF6, 0, 0], Refusal::Syntax);
    bench.refused(&[0xF6, 0, 0, 1, 0, 0, 0, 0x10], Refusal::AccessDenied);
}

#[test]
fn a_value_is_written_after_unlock_alone() {
    let mut bench = SlaveBench::connected();
    bench.to(PARAMETERS);
    bench.refused(&[0xF0, 4, 0, 0, 0, 0], Refusal::AccessLocked);
    assert!(bench.log.set.is_empty());
    let mut bench = SlaveBench::unlocked();
    assert_eq!(bench.write(30.5)[0], RESPONSE);
    assert_eq!(bench.log.set, [(0, 30.5)]);
    assert_eq!(bench.write(200.5)[..2], [ERROR, Refusal::OutOfRange as u8]);
    assert_eq!(bench.log.set.len(), 1);
    bench.to(PARAMETERS + 16);
    let [a, b, c, d, e, f, g, h] = 16.0_f64.to_le_bytes();
    bench.good(&[0xF0, 6, a, b, c, d, e, f]);
    bench.refused(&[0xF0, 2, g, h], Refusal::WriteProtected);
    bench.to(SIGNAL);
    bench.refused(&[0xF0, 4, 0, 0, 0, 0], Refusal::WriteProtected);
    // Whoever comes next finds it shut.
    bench.good(&[0xFF, 0]);
    bench.to(PARAMETERS);
    bench.refused(&[0xF0, 4, 0, 0, 0, 0], Refusal::AccessLocked);
}

#[test]
fn a_wrong_key_ends_the_session_and_measuring_needs_none() {
    let mut bench = SlaveBench::connected();
    assert_eq!(bench.good(&[0xF8, 0, 4])[0], 0, "DAQ is open");
    let mut wrong = key(bench.seed());
    wrong[7] ^= 1;
    assert_eq!(bench.unlock(wrong).unwrap()[..2], [ERROR, Refusal::AccessLocked as u8]);
    assert_eq!(bench.command(&[0xFD]), None, "the session is over");
    bench.good(&[0xFF, 0]);
    bench.refused(&[0xF8, 0, 1], Refusal::AccessDenied);
    assert_eq!(bench.slave.counters.wrong_keys, 1);
}

#[test]
fn a_session_that_falls_silent_is_shut_after_a_minute() {
    let mut bench = SlaveBench::unlocked();
    let pass = |bench: &mut SlaveBench, cycles: u64| {
        (0..cycles).for_each(|cycle| bench.slave.cycle(cycle, &[0.0; COUNT], &[25.0, 1.0, 15.0]));
    };
    pass(&mut bench, IDLE_CYCLES - 1);
    assert_eq!(bench.good(&[0xFD])[1], 0, "a command keeps it open");
    pass(&mut bench, IDLE_CYCLES - 1);
    assert!(bench.slave.is_unlocked());
    pass(&mut bench, 1);
    assert_eq!(bench.good(&[0xFD])[1], CALIBRATION);
    assert_eq!(bench.good(&[0xF8, 0, 1])[0], 8, "and a key opens it again");
}

#[test]
fn a_block_is_answered_at_its_end_and_taken_whole() {
    let mut bench = SlaveBench::unlocked();
    let bytes = [30.5_f64, 4.0, 15.0].map(f64::to_le_bytes).concat();
    let packet = |code: u8, left: usize, part: &[u8]| [&[code, left as u8][..], part].concat();
    bench.to(PARAMETERS);
    assert_eq!(bench.command(&packet(0xF0, 24, &bytes[..6])), None);
    assert_eq!(bench.command(&packet(0xEF, 18, &bytes[6..12])), None);
    assert_eq!(bench.command(&packet(0xEF, 12, &bytes[12..18])), None);
    assert!(bench.log.set.is_empty());
    bench.good(&packet(0xEF, 6, &bytes[18..]));
    assert_eq!(bench.log.set, [(0, 30.5), (1, 4.0)]);
    // A rest that is not the awaited one, and a block in the midst of a block.
    for second in [packet(0xEF, 17, &bytes[6..12]), packet(0xF0, 2, &bytes[6..8])] {
        bench.to(PARAMETERS);
        assert_eq!(bench.command(&packet(0xF0, 24, &bytes[..6])), None);
        bench.refused(&second, Refusal::Sequence);
        bench.refused(&packet(0xEF, 18, &bytes[6..12]), Refusal::Sequence);
    }
    bench.refused(&[0xF0, 0], Refusal::OutOfRange);
    bench.refused(&[0xF0, 6, 1], Refusal::Syntax);
    assert_eq!(bench.log.set.len(), 2);
}

#[test]
fn checksums_are_those_of_ieee() {
    let mut bench = SlaveBench::connected();
    bench.good(&[0xFA, 4]);
    // CRC-32 of "description", by zlib.
    let [kind, _, _, sum @ ..] = bench.good(&[0xF3, 0, 0, 0, 11, 0, 0, 0]);
    assert_eq!((kind, u32::from_le_bytes(sum)), (0x09, 0x6DE4_4026));
    bench.to(PARAMETERS);
    bench.refused(&[0xF3, 0, 0, 0, 0, 0, 0, 0], Refusal::OutOfRange);
    bench.refused(&[0xF3, 0, 0, 0, 1, 16, 0, 0], Refusal::OutOfRange);
    bench.refused(&[0xF3, 0, 0, 0, 25, 0, 0, 0], Refusal::AccessDenied);
}

#[test]
fn a_set_is_stored_once_at_a_time_and_reported() {
    let mut bench = SlaveBench::connected();
    bench.refused(&[0xF9, 1, 0, 0], Refusal::AccessLocked);
    let mut bench = SlaveBench::unlocked();
    bench.refused(&[0xF9, 2, 0, 0], Refusal::OutOfRange);
    bench.good(&[0xF9, 1, 0, 0]);
    assert_eq!(bench.log.stored, [[25.0, 1.0, 15.0]]);
    assert_eq!(bench.good(&[0xFD])[0], STORING);
    bench.refused(&[0xF9, 1, 0, 0], Refusal::Busy);
    assert_eq!(bench.slave.stored(), Some([EVENT, EVENT_STORED, 0, 0, 0, 0, 0, 0]));
    assert_eq!(bench.good(&[0xFD])[0], 0);
    bench.to(CONTROL + 8 * crate::trace::Controls::load_set as u32);
    bench.good(&[0xF0, 4, 1, 0, 0, 0]);
    assert_eq!(bench.log.loads, 1);
}

#[test]
fn a_list_is_made_read_back_and_sends() {
    let mut bench = SlaveBench::connected();
    assert_eq!(bench.good(&[0xDA]), [0x13, 8, 0, 1, 0, 0, 0]);
    assert_eq!(bench.good(&[0xD9]), [1, 7, 1, 0, 0x62, 1, 0]);
    assert_eq!(bench.good(&[0xD7, 0, 0, 0])[..5], [4, 8, 6, 1, 6]);
    bench.good(&[0xD6]);
    bench.good(&[0xD5, 0, 1, 0]);
    bench.good(&[0xD4, 0, 0, 0, 1]);
    bench.good(&[0xD3, 0, 0, 0, 0, 2]);
    bench.good(&[0xE2, 0, 0, 0, 0, 0]);
    bench.good(&[0xE1, 0xFF, 4, 0, 0, 0, 0, 0x30]);
    bench.good(&[0xE1, 0xFF, 1, 0, 4 * 19, 0, 0, 0x30]);
    bench.refused(&[0xE1, 0xFF, 1, 0, 0, 0, 0, 0x30], Refusal::Sequence);
    bench.good(&[0xE2, 0, 0, 0, 0, 1]);
    assert_eq!(bench.good(&[0xDB]), [0xFF, 1, 0, 4 * 19, 0, 0, 0x30]);
    bench.good(&[0xE0, 0x10, 0, 0, 0, 0, 2, 0]);
    assert_eq!(bench.good(&[0xDE, 2, 0, 0])[0], 0);
    bench.good(&[0xDD, 1]);
    assert_eq!(bench.good(&[0xDF, 0, 0, 0]), [0x50, 0, 0, 0, 0, 2, 0]);
    assert_eq!(bench.good(&[0xFD])[0], DAQ_RUNNING);
    assert_eq!(bench.good(&[0xDC]), [0, 0, 0, 0xD2, 4, 0, 0], "cycle 1234");
    let mut packets = Vec::new();
    for cycle in 0..5 {
        bench.slave.cycle(cycle, &[5.0; COUNT], &[25.0, 1.0, 15.0]);
        packets.extend(bench.slave.next_daq());
    }
    let packet = |cycle| [0, cycle, 0, 5, 0, 0, 0, 5];
    assert_eq!(packets, [packet(0), packet(2), packet(4)]);
    bench.good(&[0xFE]);
    bench.slave.cycle(6, &[5.0; COUNT], &[25.0, 1.0, 15.0]);
    assert_eq!(bench.slave.next_daq(), None, "nobody is sent to");
}

/// Ten packets that no key is needed for: each is right by itself, and the last one once ended the controller a cycle later.
#[test]
fn a_list_that_outgrew_its_packet_once_it_was_selected_is_not_started() {
    const STAMP: &[u8] = &[0xE0, 0x10, 0, 0, 0, 0, 1, 0];
    const SELECT: &[u8] = &[0xDE, 2, 0, 0];
    const POINT: &[u8] = &[0xE2, 0, 0, 0, 0, 0];
    const SEVEN_BYTES: &[u8] = &[0xE1, 0xFF, 7, 0, 0, 0, 0, 0x30];
    const FIVE_BYTES: &[u8] = &[0xE1, 0xFF, 5, 0, 0, 0, 0, 0x30];
    for changes in
        [&[POINT, SEVEN_BYTES, SELECT, STAMP][..], &[POINT, FIVE_BYTES, STAMP, SELECT, POINT, SEVEN_BYTES]]
    {
        let mut bench = SlaveBench::connected();
        for packet in [&[0xD6][..], &[0xD5, 0, 1, 0], &[0xD4, 0, 0, 0, 1], &[0xD3, 0, 0, 0, 0, 1]] {
            bench.good(packet);
        }
        changes.iter().for_each(|packet| _ = bench.good(packet));
        bench.refused(&[0xDD, 1], Refusal::DaqConfig);
        bench.slave.cycle(0, &[5.0; COUNT], &[25.0, 1.0, 15.0]);
        assert_eq!(bench.slave.next_daq(), None);
    }
}

/// Commands that mean something, with fields that may not.
fn packets() -> impl Strategy<Value = Vec<u8>> {
    let any_packet = prop::collection::vec(any::<u8>(), 0..12);
    let command = (0xD0_u8..=0xFF, prop::collection::vec(0_u8..12, 0..8));
    let written =
        (prop_oneof![Just(0xF0_u8), Just(0xEF)], 0_u8..16, prop::collection::vec(any::<u8>(), 0..7));
    let address = (prop_oneof![Just(0xF6_u8), Just(0xF4)], 0_u32..0x60, 0_u32..40_000)
        .prop_map(|(code, high, low)| [&[code, 3, 0, 0][..], &(high << 24 | low).to_le_bytes()].concat());
    prop_oneof![
        any_packet,
        command.prop_map(|(code, fields)| [&[code][..], &fields].concat()),
        written.prop_map(|(code, count, part)| [&[code, count][..], &part].concat()),
        address,
    ]
}

proptest! {
    /// Whatever is said, in whatever order: an answer of eight bytes or none, and never a parameter out of its range.
    #[test]
    fn any_packets_leave_every_parameter_in_its_range(
        packets in prop::collection::vec(packets(), 0..200),
        unlocked in any::<bool>(),
    ) {
        let mut bench = if unlocked { SlaveBench::unlocked() } else { SlaveBench::connected() };
        for (packet, cycle) in packets.iter().zip(0..) {
            if let Some(answer) = bench.command(packet) {
                prop_assert!(answer[0] >= ERROR);
            }
            let parameters: [f64; 3] = bench.slave.image.parameters().try_into().unwrap();
            bench.slave.cycle(cycle, &[cycle as f64; COUNT], &parameters);
            let _ = bench.slave.next_daq();
        }
        prop_assert!(unlocked || bench.log.set.is_empty());
        let [gain, every, timeout]: [f64; 3] = bench.slave.image.parameters().try_into().unwrap();
        prop_assert!((0.0..=200.0).contains(&gain) && (1.0..=1000.0).contains(&every) && every.fract() == 0.0);
        prop_assert_eq!(timeout, 15.0, "it is read at the start only");
    }
}
