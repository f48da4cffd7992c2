//! A viewer: its socket, its bounded buffer, and its commands.

use crate::console::{self, Console};
use runlog::telemetry::{Answer, LONGEST_LINE, write_answer, write_loss};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;

/// Capacity of the buffer of a viewer, bytes: more than a second of 1 kHz with all effects on, whose cycles have some 2 kB
/// each.
const BUFFER: usize = 4 << 20;
/// Room for answers beside the records, bytes.
const ANSWERS: usize = 64 << 10;
/// Most bytes read from a viewer in one turn, so that a flood does not delay the others.
const READ_A_TURN: usize = 4096;

pub(super) struct Viewer {
    stream: UnixStream,
    outgoing: VecDeque<u8>,
    /// It lost a record, and its buffer is more than half full: one long gap is better than many short ones.
    behind: bool,
    lost: u64,
    lost_reported: u64,
    /// The current line, incomplete; too long when it exceeds [`LONGEST_LINE`].
    line: Vec<u8>,
    gone: bool,
}

impl Viewer {
    /// A new viewer with a non-blocking socket.
    pub(super) fn new(stream: UnixStream) -> Self {
        Self {
            stream,
            outgoing: VecDeque::new(),
            behind: false,
            lost: 0,
            lost_reported: 0,
            line: Vec::new(),
            gone: false,
        }
    }

    /// Puts a packet into the buffer, or counts it as lost.
    pub(super) fn offer(&mut self, packet: &[u8]) {
        let room = if self.behind { BUFFER / 2 } else { BUFFER };
        self.behind = self.outgoing.len() + packet.len() > room;
        if self.behind {
            self.lost += 1;
            return;
        }
        if self.lost > self.lost_reported {
            // The loss is reported before the next packet.
            let mut loss = Vec::new();
            write_loss(&mut loss, self.lost);
            self.outgoing.extend(loss);
            self.lost_reported = self.lost;
        }
        self.outgoing.extend(packet);
    }

    /// Reads commands, writes what the socket accepts, and returns whether it is still connected.
    pub(super) fn turn(&mut self, console: Option<&Console>) -> bool {
        self.read(console);
        while !self.gone && !self.outgoing.is_empty() {
            match self.stream.write(self.outgoing.as_slices().0) {
                Ok(0) => self.gone = true,
                Ok(written) => drop(self.outgoing.drain(..written)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => self.gone = true,
            }
        }
        !self.gone
    }

    fn read(&mut self, console: Option<&Console>) {
        let mut bytes = [0; READ_A_TURN];
        match self.stream.read(&mut bytes) {
            Ok(0) => self.gone = true,
            Ok(read) => bytes[..read].iter().for_each(|byte| self.take(*byte, console)),
            Err(error) => {
                self.gone |= !matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
            }
        }
    }

    fn take(&mut self, byte: u8, console: Option<&Console>) {
        if byte != b'\n' {
            if self.line.len() <= LONGEST_LINE {
                self.line.push(byte);
            }
            return;
        }
        let line = std::mem::take(&mut self.line);
        let answer = match console {
            None => Err("this run takes no commands: the emulator was started without --console".to_owned()),
            Some(_) if line.len() > LONGEST_LINE => Err(console::too_long()),
            Some(console) => console.execute(&String::from_utf8_lossy(&line)).map(str::to_owned),
        };
        let (ok, text) = match answer {
            Ok(text) => (true, text),
            Err(text) => (false, text),
        };
        if self.outgoing.len() > BUFFER + ANSWERS {
            // It sends commands and does not read the answers.
            self.gone = true;
            return;
        }
        let mut packet = Vec::new();
        write_answer(&mut packet, &Answer { ok, text });
        self.outgoing.extend(packet);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::console::{Command, Limits};
    use plant::scene::Action;
    use runlog::telemetry::{Decoder, Packet, write_cycle};

    /// A viewer and its far end.
    fn pair() -> (Viewer, UnixStream) {
        let (near, far) = UnixStream::pair().unwrap();
        near.set_nonblocking(true).unwrap();
        far.set_nonblocking(true).unwrap();
        (Viewer::new(near), far)
    }

    /// Everything that comes until nothing does any more.
    fn packets(viewer: &mut Viewer, far: &mut UnixStream) -> Vec<Packet> {
        let (mut decoder, mut bytes, mut packets) = (Decoder::default(), [0; 65536], Vec::new());
        loop {
            assert!(viewer.turn(None));
            let Ok(read) = far.read(&mut bytes) else { return packets };
            decoder.take(&bytes[..read]);
            packets.extend(std::iter::from_fn(|| decoder.packet().unwrap()));
        }
    }

    #[test]
    fn a_viewer_that_does_not_read_loses_whole_records_and_receives_their_number() {
        let (mut viewer, mut far) = pair();
        let mut record = Vec::new();
        write_cycle(&mut record, 0, [0.0; 100]);
        let cycles = 2 * (BUFFER / record.len()) as u64;
        for cycle in 0..cycles {
            record.clear();
            write_cycle(&mut record, cycle, [cycle as f64; 100]);
            viewer.offer(&record);
            assert!(viewer.turn(None), "a viewer that does not read is no reason to part");
        }
        assert!(viewer.outgoing.len() <= BUFFER);
        assert!(viewer.lost > 0);
        let before: Vec<_> = packets(&mut viewer, &mut far);
        viewer.offer(&record);
        let after = packets(&mut viewer, &mut far);
        assert_eq!(before.len() as u64 + viewer.lost, cycles);
        let [Packet::Loss(lost), Packet::Cycle(newest, _)] = after[..] else { panic!("{after:?}") };
        assert_eq!((lost, newest), (viewer.lost, cycles - 1));
    }

    #[test]
    fn a_second_at_1_khz_fits_with_every_effect_on() {
        let mut record = Vec::new();
        write_cycle(&mut record, 0, [0.0; 250]);
        assert!(record.len() * 1000 < BUFFER);
    }

    #[test]
    fn lines_are_obeyed_or_refused_one_by_one() {
        let limits = Limits { added_limit_kg: 20.0, hosts_bus: true };
        let (console, commands) = console::open(limits);
        let (mut viewer, mut far) = pair();
        far.write_all(b"stop\nweights 99\nst").unwrap();
        assert!(viewer.turn(Some(&console)));
        far.write_all(format!("op\n{}\n", "stop ".repeat(100)).as_bytes()).unwrap();
        assert!(viewer.turn(Some(&console)));
        let stop = Command::Act(Action::EmergencyStop);
        assert_eq!(commands.try_iter().collect::<Vec<_>>(), [stop, stop]);
        let answers = packets(&mut viewer, &mut far);
        let oks: Vec<_> = answers
            .iter()
            .map(|packet| match packet {
                Packet::Answer(text) => text.contains("\"ok\":true"),
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(oks, [true, false, true, false], "{answers:?}");
        far.write_all(b"stop\n").unwrap();
        assert!(viewer.turn(None));
        let refused = packets(&mut viewer, &mut far);
        assert!(matches!(&refused[..], [Packet::Answer(text)] if text.contains("--console")), "{refused:?}");
        assert_eq!(commands.try_iter().count(), 0);
    }

    #[test]
    fn one_that_asks_and_does_not_read_is_parted_with_and_so_is_one_that_goes() {
        let (mut viewer, mut far) = pair();
        let mut turns = 0;
        loop {
            let asked = far.write(&b"x\n".repeat(1000));
            if !viewer.turn(None) {
                break;
            }
            turns += 1;
            assert!(asked.is_ok() || turns < 1_000_000, "it is kept for ever");
        }
        let (mut viewer, far) = pair();
        drop(far);
        assert!(!viewer.turn(None));
    }
}
