//! Telemetry: records for viewers, as packets over a Unix stream; commands of viewers, as lines.
//!
//! ```text
//!   emulator ──► [length u32 LE][kind u8][payload of that length] … ──► viewer
//!            ◄── a command of the console, one a line                ◄──
//! ```
//!
//! | kind | payload |
//! |---|---|
//! | 0 description | JSON, once, first: a [`Description`] |
//! | 1 cycle | u64 LE number of the cycle, then an f64 LE for each column of the description |
//! | 2 event | JSON: an [`EventMessage`], `cycle` and `kind` as `summary.json` has them, and `text` for a person |
//! | 3 histogram | a line of `emulator.hlog`: one second of one stage, HdrHistogram V2 in base64; of no time in lockstep: none |
//! | 4 loss | u64 LE: records that this viewer's buffer had no room for, in all |
//! | 5 answer | JSON, one for each line asked, in their order: an [`Answer`], `ok`, and `text` for a person |
//!
//! The stream is lossy: a viewer that reads too slowly misses whole records, never parts of one, and is given how many before the
//! next that it gets. Events that came before a viewer did follow the description, so that it knows what is broken and loaded:
//! the first thousand of each kind, and of late wake-ups the description counts the others.
//! Nothing that a viewer does or leaves undone reaches the run, save commands of a run with `--console`.

mod description;

use crate::event::{Event, EventKind, FaultMark};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

pub use description::{
    Column, Description, DroppedEvents, Experiment, FaultEntry, FaultGroup, FaultKey, RigFigures, SetUp,
    Table,
};

/// Longest payload: the description, which holds the table of faults with all their places.
pub const LONGEST_PAYLOAD: usize = 1 << 20;
/// Longest line that is read as a command, in bytes.
pub const LONGEST_LINE: usize = 200;
/// Bytes before a payload.
const HEAD: usize = 5;
/// Bytes of a number.
const WORD: usize = 8;

/// What a packet holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// What the run is, and what the columns of its cycles are.
    Description,
    /// Values of one cycle, in the order of the description's columns.
    Cycle,
    /// One event of the run, JSON.
    Event,
    /// A second of a stage.
    Histogram,
    /// Records that a viewer missed.
    Loss,
    /// The answer to a line.
    Answer,
}

/// In the order of their numbers.
const KINDS: [Kind; 6] =
    [Kind::Description, Kind::Cycle, Kind::Event, Kind::Histogram, Kind::Loss, Kind::Answer];

/// A packet as a viewer reads it. Texts in JSON stand as they came: a viewer may pass them on, or read them by their type.
#[derive(Clone, Debug, PartialEq)]
pub enum Packet {
    /// A [`Description`], JSON.
    Description(String),
    /// A cycle: its number, and a value for each column.
    Cycle(u64, Vec<f64>),
    /// An [`EventMessage`], JSON.
    Event(String),
    /// A line of an interval log.
    Histogram(String),
    /// Records missed so far.
    Loss(u64),
    /// An [`Answer`], JSON.
    Answer(String),
}

/// An event as a viewer gets it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EventMessage<M = FaultMark> {
    /// The rig's cycle in which it was noticed.
    pub cycle: u64,
    /// What happened, with its numbers.
    pub kind: EventKind<M>,
    /// The event in words, for a person.
    pub text: String,
}

/// The answer to a command.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Whether the command is obeyed.
    pub ok: bool,
    /// Why it is not, or what there is to say; may be empty.
    pub text: String,
}

impl<M> EventMessage<M> {
    /// The event with its words.
    pub fn new(event: Event<M>, text: String) -> Self {
        let Event { cycle, kind } = event;
        Self { cycle, kind, text }
    }
}

/// A stream that is none of telemetry; nothing can be read of it any more.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TelemetryError {
    /// No packet is as long.
    #[error("a packet of {0} bytes: {LONGEST_PAYLOAD} at most")]
    TooLong(usize),
    /// No packet is of this kind.
    #[error("a packet of kind {0}, which is not known")]
    Kind(u8),
    /// The payload is not as its kind has it.
    #[error("a packet of kind {0:?} whose {1} bytes are not as they should be")]
    Payload(Kind, usize),
}

/// Appends a packet of text or bytes.
///
/// # Panics
/// When the payload is longer than [`LONGEST_PAYLOAD`]: only a description could be, which has a tenth of it.
pub fn write_packet(out: &mut Vec<u8>, kind: Kind, payload: &[u8]) {
    out.extend(head_of(kind, payload.len()));
    out.extend(payload);
}

/// Appends a cycle.
///
/// # Panics
/// As [`write_packet`].
pub fn write_cycle(out: &mut Vec<u8>, cycle: u64, values: impl IntoIterator<Item = f64>) {
    let head = out.len();
    out.extend(head_of(Kind::Cycle, 0));
    out.extend(cycle.to_le_bytes());
    values.into_iter().for_each(|value| out.extend(value.to_le_bytes()));
    let payload = out.len() - head - HEAD;
    out[head..head + HEAD].copy_from_slice(&head_of(Kind::Cycle, payload));
}

/// Appends a description.
///
/// # Panics
/// As [`write_packet`].
pub fn write_description(out: &mut Vec<u8>, description: &Description) {
    write_packet(out, Kind::Description, description.to_json().as_bytes());
}

/// Appends an event.
pub fn write_event(out: &mut Vec<u8>, message: &EventMessage<impl Serialize>) {
    write_json(out, Kind::Event, message);
}

/// Appends an answer.
pub fn write_answer(out: &mut Vec<u8>, answer: &Answer) {
    write_json(out, Kind::Answer, answer);
}

fn write_json(out: &mut Vec<u8>, kind: Kind, payload: &impl Serialize) {
    // A struct of numbers and words has a JSON form.
    if let Ok(json) = serde_json::to_vec(payload) {
        write_packet(out, kind, &json);
    }
}

/// Appends how many records a viewer has missed.
pub fn write_loss(out: &mut Vec<u8>, lost: u64) {
    write_packet(out, Kind::Loss, &lost.to_le_bytes());
}

fn head_of(kind: Kind, payload: usize) -> [u8; HEAD] {
    assert!(payload <= LONGEST_PAYLOAD, "{kind:?} of {payload} bytes");
    let [a, b, c, d] = (payload as u32).to_le_bytes();
    [a, b, c, d, kind as u8]
}

/// Turns a stream, in whatever pieces it comes, into packets.
#[derive(Debug, Default)]
pub struct Decoder {
    bytes: VecDeque<u8>,
}

impl Decoder {
    /// Takes a piece of the stream.
    pub fn take(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The next whole packet; `None` until more comes.
    ///
    /// # Errors
    /// [`TelemetryError`] when the stream is none of telemetry; it stays so.
    pub fn packet(&mut self) -> Result<Option<Packet>, TelemetryError> {
        let Some(&[a, b, c, d, number]) = self.bytes.make_contiguous().first_chunk::<HEAD>() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        if length > LONGEST_PAYLOAD {
            return Err(TelemetryError::TooLong(length));
        }
        let kind = *KINDS.get(usize::from(number)).ok_or(TelemetryError::Kind(number))?;
        if self.bytes.len() < HEAD + length {
            return Ok(None);
        }
        let payload = self.bytes.drain(..HEAD + length).skip(HEAD).collect();
        read(kind, payload).map(Some)
    }
}

fn read(kind: Kind, payload: Vec<u8>) -> Result<Packet, TelemetryError> {
    let wrong = TelemetryError::Payload(kind, payload.len());
    let text = |payload: Vec<u8>| String::from_utf8(payload).map_err(|_| wrong.clone());
    Ok(match kind {
        Kind::Description => Packet::Description(text(payload)?),
        Kind::Event => Packet::Event(text(payload)?),
        Kind::Histogram => Packet::Histogram(text(payload)?),
        Kind::Answer => Packet::Answer(text(payload)?),
        Kind::Loss => match words(&payload).as_deref() {
            Some(&[lost]) => Packet::Loss(lost),
            _ => return Err(wrong),
        },
        Kind::Cycle => match words(&payload).as_deref() {
            Some([cycle, values @ ..]) => {
                Packet::Cycle(*cycle, values.iter().copied().map(f64::from_bits).collect())
            }
            _ => return Err(wrong),
        },
    })
}

/// The payload as numbers of eight bytes, if it consists of such.
fn words(payload: &[u8]) -> Option<Vec<u64>> {
    let (words, []) = payload.as_chunks::<WORD>() else { return None };
    Some(words.iter().map(|word| u64::from_le_bytes(*word)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all_of(decoder: &mut Decoder) -> Vec<Packet> {
        std::iter::from_fn(|| decoder.packet().unwrap()).collect()
    }

    #[test]
    fn every_kind_comes_back() {
        let mut stream = Vec::new();
        write_packet(&mut stream, Kind::Description, b"{}");
        write_cycle(&mut stream, 7, [1.5, f64::NAN, -0.0]);
        write_packet(&mut stream, Kind::Event, "{\"text\": \"µ\"}".as_bytes());
        write_packet(&mut stream, Kind::Histogram, b"Tag=a,0,1,2,HISTF");
        write_loss(&mut stream, u64::MAX);
        write_packet(&mut stream, Kind::Answer, b"");
        let mut decoder = Decoder::default();
        decoder.take(&stream);
        let packets = all_of(&mut decoder);
        assert_eq!(packets[0], Packet::Description("{}".into()));
        let Packet::Cycle(7, values) = &packets[1] else { panic!("{packets:?}") };
        assert!(values[0] == 1.5 && values[1].is_nan() && values[2].is_sign_negative(), "to the bit");
        assert_eq!(packets[2], Packet::Event("{\"text\": \"µ\"}".into()));
        assert_eq!(packets[3], Packet::Histogram("Tag=a,0,1,2,HISTF".into()));
        assert_eq!(packets[4..], [Packet::Loss(u64::MAX), Packet::Answer(String::new())]);
    }

    #[test]
    fn events_and_answers_are_json_of_their_types() {
        let event = Event { cycle: 20, kind: EventKind::Weights { added_mass_kg: 2.5 } };
        let message = EventMessage::new(event, "weights on the carriage: 2.5 kg".into());
        let answer = Answer { ok: true, text: String::new() };
        let mut stream = Vec::new();
        write_event(&mut stream, &message);
        write_answer(&mut stream, &answer);
        let mut decoder = Decoder::default();
        decoder.take(&stream);
        let packets = all_of(&mut decoder);
        let [Packet::Event(event), Packet::Answer(answered)] = &packets[..] else { panic!("{packets:?}") };
        let expected = r#"{"cycle":20,"kind":{"weights":{"added_mass_kg":2.5}},"text":"weights on the carriage: 2.5 kg"}"#;
        assert_eq!((event.as_str(), answered.as_str()), (expected, r#"{"ok":true,"text":""}"#));
        assert_eq!(serde_json::from_str::<EventMessage>(event).unwrap(), message);
        assert_eq!(serde_json::from_str::<Answer>(answered).unwrap(), answer);
    }

    #[test]
    fn a_packet_is_as_the_head_of_this_file_says() {
        let mut stream = Vec::new();
        write_cycle(&mut stream, 258, [1.0]);
        let bits = 1.0f64.to_le_bytes();
        assert_eq!(stream, [&[16, 0, 0, 0, 1, 2, 1, 0, 0, 0, 0, 0, 0][..], &bits].concat());
    }

    #[test]
    fn what_is_no_telemetry_is_refused() {
        let refused = |bytes: &[u8]| {
            let mut decoder = Decoder::default();
            decoder.take(bytes);
            decoder.packet().unwrap_err()
        };
        assert_eq!(refused(&[0, 0, 0, 1, 1]), TelemetryError::TooLong(1 << 24));
        assert_eq!(refused(&[0, 0, 0, 0, 6]), TelemetryError::Kind(6));
        assert_eq!(refused(&[1, 0, 0, 0, 1, 0]), TelemetryError::Payload(Kind::Cycle, 1));
        assert_eq!(refused(&[0, 0, 0, 0, 1]), TelemetryError::Payload(Kind::Cycle, 0));
        assert_eq!(refused(&[0, 0, 0, 0, 4]), TelemetryError::Payload(Kind::Loss, 0));
        assert_eq!(refused(&[1, 0, 0, 0, 2, 0xFF]), TelemetryError::Payload(Kind::Event, 1));
    }

    proptest! {
        #[test]
        fn a_stream_reads_the_same_in_whatever_pieces(cut in 1usize..20, cycles in 0u64..20) {
            let mut stream = Vec::new();
            for cycle in 0..cycles {
                write_cycle(&mut stream, cycle, [cycle as f64; 3]);
                write_packet(&mut stream, Kind::Event, b"x");
            }
            let (mut decoder, mut packets) = (Decoder::default(), Vec::new());
            for piece in stream.chunks(cut) {
                decoder.take(piece);
                packets.extend(all_of(&mut decoder));
            }
            let mut expected = Vec::new();
            for cycle in 0..cycles {
                expected.push(Packet::Cycle(cycle, vec![cycle as f64; 3]));
                expected.push(Packet::Event("x".into()));
            }
            prop_assert_eq!(packets, expected);
        }

        #[test]
        fn no_bytes_make_the_decoder_panic(bytes: Vec<u8>) {
            let mut decoder = Decoder::default();
            decoder.take(&bytes);
            while let Ok(Some(_)) = decoder.packet() {}
        }
    }
}
