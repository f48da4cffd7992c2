//! Noise on the bus while the loop runs, and whether any of its commands ever acted.
//!
//! Frames are drawn over all identifiers, lengths and data, a quarter of them on the two identifiers of valve commands. Those
//! that happen to be as `rig.dbc` says are drawn again: a sensor frame or an emergency stop of a stranger is one, since CAN
//! knows no sender, and what it does is its meaning and not a fault. Whether a command is one is decided here, from the
//! contract: a decoder that took wrong ones would otherwise keep them from being sent to it.
//!
//! It is not can-utils' cangen that makes the noise: that one speaks SocketCAN alone, holds no rate, counts nothing by kind, and
//! sends what happens to be an emergency stop. `tests/tests/vm_cards.rs` has it fill a card's queue.
//!
//! What acted is judged by what the controllers themselves recorded of their commands, not by what the rig made of the bus.

use crate::launch::Pace;
use crate::peer::Peer;
use crate::records::count;
use crate::scene::{RESTLESS, Scene};
use protocol::can::{CanFrame, EXTENDED_FLAG, REMOTE_FLAG};
use protocol::frames::{DecodeError, Frame};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use runlog::Axis;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const COMMANDS: [u32; 2] = [0x110, 0x111];
const COMMAND_BYTES: usize = 5;
/// Bits of its fourth byte that no signal covers.
const RESERVED: u8 = 0xE0;
/// The one of the 4096 openings on the wire that is none: -2048.
const NO_OPENING: u16 = 0x800;
/// Frames are sent in bursts, as far apart.
const BURST: Duration = Duration::from_millis(1);
/// A command is stale when it answers a cycle that is so many cycles ago.
const STALE_CYCLES: usize = 20;
/// Steps of the opening on the wire, from shut to open.
const OPENING_STEPS: f64 = 2047.0;
/// An opening is rounded to a step of the wire.
const ROUNDING_STEPS: f64 = 0.51;
/// Frames of noise in a second.
pub const PER_SECOND: u32 = 10_000;

#[derive(Clone, Copy, Debug, Default)]
pub struct NoiseCounts {
    pub frames: u64,
    /// Those on an identifier of `rig.dbc`, wrong in length, value or checksum.
    pub malformed: u64,
    pub duration_s: f64,
}

/// A babbling node, until it is stopped.
pub struct Noise {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<NoiseCounts>,
}

impl Noise {
    /// Sends so many frames a second to the embedded bus at `socket`; the same ones for the same seed.
    pub fn start(socket: &Path, per_second: u32, seed: u64) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let peer = Peer::connect(socket);
        let until = Arc::clone(&stop);
        let thread = std::thread::spawn(move || babble(&peer, per_second, seed, &until));
        Self { stop, thread }
    }

    pub fn end(self) -> NoiseCounts {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().expect("the noise does not panic")
    }
}

fn babble(peer: &Peer, per_second: u32, seed: u64, stop: &AtomicBool) -> NoiseCounts {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut sent = NoiseCounts::default();
    let began = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        let due = (began.elapsed().as_secs_f64() * f64::from(per_second)) as u64;
        while sent.frames < due {
            let (frame, malformed) = wrong_frame(&mut random);
            if !peer.try_send(&frame.to_bytes()) {
                stop.store(true, Ordering::Relaxed); // the bus has gone
                break;
            }
            sent.frames += 1;
            sent.malformed += u64::from(malformed);
        }
        // A node takes what passes; one that does not would be a second disturbance.
        while peer.receive(Duration::ZERO).is_some_and(|packet| packet != crate::peer::Packet::Closed) {}
        std::thread::sleep(BURST);
    }
    sent.duration_s = began.elapsed().as_secs_f64();
    sent
}

/// A frame that is not as `rig.dbc` says, and whether its identifier is one of it.
fn wrong_frame(random: &mut Pcg64) -> (CanFrame, bool) {
    loop {
        let word = random.next_u64();
        let data = random.next_u64().to_le_bytes();
        let (kind, id) = (word % 32, (word >> 8) as u32);
        let length = (word >> 40) as usize % 9;
        let frame = match kind {
            // A checksum of eight bits lets one in 256 of these pass for a command: those are not sent.
            0..4 => CanFrame::from_raw(COMMANDS[id as usize % 2], &data[..COMMAND_BYTES]),
            4..8 => CanFrame::from_raw(COMMANDS[id as usize % 2], &data[..length]),
            8 => CanFrame::from_raw(EXTENDED_FLAG | (id % (1 << 29)), &data[..length]),
            9 => CanFrame::from_raw(REMOTE_FLAG | (id % 0x800), &[]),
            _ => CanFrame::from_raw(id % 0x800, &data[..length]),
        };
        if frame.standard_id().is_some_and(|id| COMMANDS.contains(&u32::from(id))) {
            if is_command(&frame) {
                continue;
            }
            return (frame, true);
        }
        match Frame::decode(&frame) {
            Ok(_) => {}
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                return (frame, false);
            }
            Err(_) => return (frame, true),
        }
    }
}

/// Whether a frame on the identifier of a command is one: length, checksum, reserved bits and range, as the contract has them.
fn is_command(frame: &CanFrame) -> bool {
    let [a, b, _, d, crc] = *frame.data() else { return false };
    let [low, high, ..] = frame.raw_id().to_le_bytes();
    let sum = [low, high].iter().chain(&frame.data()[..4]).fold(0xFF_u8, |sum, byte| {
        (0..8).fold(sum ^ byte, |sum, _| if sum & 0x80 == 0 { sum << 1 } else { (sum << 1) ^ 0x1D })
    });
    crc == sum ^ 0xFF && d & RESERVED == 0 && u16::from_le_bytes([a, b]) & 0xFFF != NO_OPENING
}

/// What became of a run in real time, with noise or without.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub sent: NoiseCounts,
    pub missed: u64,
    /// Its wake-ups that came late enough to be counted.
    pub overruns: u64,
    pub wakeup_p99_ns: u64,
    pub round_trip_p99_ns: u64,
    /// Commands of the controllers that never reached the rig.
    pub commands_lost: u64,
    /// Sensor frames of the drive that never reached its controller.
    pub sensors_lost: u64,
    pub malformed: u64,
    /// Frames that the rig counted as none of its own.
    pub unknown: u64,
    /// Commands that were refused as stale, or grew stale while acting.
    pub stale: u64,
    pub openings: OpeningCounts,
}

/// Runs rig and controllers in real time for so long, with so many frames of noise each second.
pub fn run(seconds: u32, per_second: u32, seed: u64) -> Outcome {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.start(Pace::Real, &format!("--seconds {seconds}"), "--repeat");
    scene.wait_for_rows("emulator", 200);
    let noise = (per_second > 0).then(|| Noise::start(&scene.socket(), per_second, seed));
    let limit = Duration::from_secs(u64::from(seconds)) + crate::process::PATIENCE;
    emulator.wait_within(limit).expect_code(0);
    let sent = noise.map(Noise::end).unwrap_or_default();
    controller.wait();
    outcome(&scene, sent)
}

fn outcome(scene: &Scene, sent: NoiseCounts) -> Outcome {
    let summary = scene.summary();
    let reported = scene.report();
    let of = |pointer: &str| count(&summary, pointer);
    let mut openings = OpeningCounts::default();
    Axis::NAMES.iter().for_each(|axis| openings.add(scene, axis));
    Outcome {
        sent,
        missed: of("/skipped"),
        overruns: of("/overruns"),
        wakeup_p99_ns: of("/wakeup_ns/p99"),
        round_trip_p99_ns: of("/round_trip_ns/p99"),
        commands_lost: of("/frames_lost_at_rig"),
        sensors_lost: count(&reported, "/axes/drive/sensors_lost"),
        malformed: of("/frames_ignored/malformed"),
        unknown: of("/frames_ignored/unknown"),
        stale: of("/stale_commands"),
        openings,
    }
}

/// Openings that acted against those that a controller recorded as sent.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpeningCounts {
    /// Openings that acted.
    pub acted: usize,
    /// Those that no controller had sent.
    pub not_sent: usize,
    /// Cycles in which a valve was shut though its controller wanted it open.
    pub shut: usize,
}

impl OpeningCounts {
    /// Adds those of an axis. The load's controller holds its valve shut throughout, so whatever acts there is wrong.
    fn add(&mut self, scene: &Scene, axis: &str) {
        let acted = scene.measurement().column(&format!("{axis}_valve"));
        let reported = scene.axis_table(axis);
        let (cycles, openings, enabled) =
            (reported.cycles(), reported.numbers("opening"), reported.numbers("enabled"));
        let mut answered = 0;
        for (cycle, acted) in acted.into_iter().enumerate() {
            answered += cycles[answered..].iter().take_while(|answers| **answers < cycle).count();
            let live = answered.saturating_sub(STALE_CYCLES)..answered;
            let sent = |row| if enabled[row] > 0.0 { openings[row] } else { 0.0 };
            let known = live.clone().any(|row| (sent(row) - acted).abs() * OPENING_STEPS < ROUNDING_STEPS);
            self.acted += 1;
            match acted {
                _ if known || live.is_empty() => {}
                0.0 => self.shut += 1,
                _ => self.not_sent += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::checksum;

    /// The first two are golden frames of cantools and crccheck, the others what they become by one mistake each.
    #[test]
    fn a_command_is_known_without_the_decoder() {
        let frame = |data: [u8; 4], crc| CanFrame::new(0x110, &[&data[..], &[crc]].concat());
        for (frame, expected) in [
            (frame([0, 0, 0, 0], 0x88), true),
            (frame([0, 0x74, 0x23, 0x11], 0xB7), true),
            (frame([0, 0x74, 0x23, 0x11], 0xB6), false),
            (CanFrame::new(0x111, &[0, 0, 0, 0, 0x88]), false),
            (CanFrame::new(0x110, &[0, 0, 0, 0]), false),
            (CanFrame::new(0x110, &[0, 0, 0, 0, 0x88, 0]), false),
            (frame([0, 0, 0, 0x20], checksum::of(0x110, &[0, 0, 0, 0x20])), false),
            (frame([0, 8, 0, 0], checksum::of(0x110, &[0, 8, 0, 0])), false),
        ] {
            assert_eq!((is_command(&frame), Frame::decode(&frame).is_ok()), (expected, expected), "{frame}");
        }
    }

    #[test]
    fn no_frame_of_the_noise_is_as_the_contract_says_and_many_look_like_commands() {
        let mut random = Pcg64::seed_from_u64(1);
        let frames: Vec<_> = (0..20_000).map(|_| wrong_frame(&mut random)).collect();
        assert!(frames.iter().all(|(frame, _)| Frame::decode(frame).is_err()));
        let like = |(frame, _): &&(CanFrame, bool)| {
            COMMANDS.contains(&frame.raw_id()) && frame.data().len() == COMMAND_BYTES
        };
        assert!(frames.iter().filter(like).count() > 2000);
        assert!(frames.iter().any(|(frame, malformed)| !malformed && frame.standard_id().is_none()));
    }
}
