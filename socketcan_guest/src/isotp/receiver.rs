//! The receiving side.

use super::settings::flag;
use super::{DATA_BYTES, Event, Incoming, LONGEST_PDU, PEER_TIMEOUT};
use rustix::io::Errno;
use std::time::Instant;

/// Statuses of our flow control frames.
const CONTINUE_TO_SEND: u8 = 0;
const OVERFLOW: u8 = 2;

/// A message after its first frame.
#[derive(Debug)]
struct Reception {
    length: usize,
    bytes: Vec<u8>,
    /// Number of the next frame, modulo 16.
    sequence: u8,
    received_in_block: u8,
    /// Deadline of the next frame; a listener does not wait for the second.
    until: Option<Instant>,
    last: Option<Instant>,
}

/// The receiving side of a socket, with the message in progress, if any.
#[derive(Debug, Default)]
pub(super) struct Receiver(Option<Reception>);

impl Receiver {
    pub(super) fn is_busy(&self) -> bool {
        self.0.is_some()
    }

    pub(super) fn due(&self) -> Option<Instant> {
        self.0.as_ref()?.until
    }

    pub(super) fn advance(&mut self, now: Instant, events: &mut Vec<Event>) {
        if self.due().is_some_and(|until| until <= now) {
            self.0 = None;
            events.push(Event::ReceivingFailed(Errno::TIMEDOUT));
        }
    }

    /// A single frame ends a reception in progress.
    pub(super) fn take_single(&mut self, incoming: Incoming<'_>, events: &mut Vec<Event>) {
        let Incoming { data, length, settings, .. } = incoming;
        self.0 = None;
        let begin = settings.address_bytes() + 1;
        let count = usize::from(data[begin - 1] & 0x0F);
        let end = begin + count;
        if count == 0 || end > length {
            return;
        }
        let is_right = !settings.checks_padding() || settings.is_padded_right(data, length, end);
        events.push(if is_right {
            Event::Received(data[begin..end].to_vec())
        } else {
            Event::ReceivingFailed(Errno::BADMSG)
        });
    }

    /// Returns the data of a flow control frame.
    pub(super) fn take_first(&mut self, incoming: Incoming<'_>) -> Option<Vec<u8>> {
        let Incoming { data, length, settings, now } = incoming;
        self.0 = None;
        // A first frame has the full length.
        if length != DATA_BYTES {
            return None;
        }
        let at = settings.address_bytes();
        let in_12_bits = usize::from(data[at] & 0x0F) << 8 | usize::from(data[at + 1]);
        let (count, begin) = match in_12_bits {
            0 => {
                let bytes = data[at + 2..at + 6].try_into().expect("four bytes");
                (u32::from_be_bytes(bytes) as usize, at + 6)
            }
            count => (count, at + 2),
        };
        // The message would fit a single frame.
        if count + begin < DATA_BYTES {
            return None;
        }
        if count > LONGEST_PDU {
            return Some(settings.flow_control_of(OVERFLOW));
        }
        let answers = !settings.has(flag::LISTEN_MODE);
        self.0 = Some(Reception {
            length: count,
            bytes: data[begin..DATA_BYTES].to_vec(),
            sequence: 1,
            received_in_block: 0,
            until: answers.then(|| now + PEER_TIMEOUT),
            last: None,
        });
        answers.then(|| settings.flow_control_of(CONTINUE_TO_SEND))
    }

    /// Returns the data of a flow control frame at the end of a block.
    pub(super) fn take_consecutive(
        &mut self,
        incoming: Incoming<'_>,
        events: &mut Vec<Event>,
    ) -> Option<Vec<u8>> {
        let Incoming { data, length, settings, now } = incoming;
        let reception = self.0.as_mut()?;
        if let Some(least) = settings.least_received_gap() {
            if reception.last.is_some_and(|last| now - last < least) {
                return None;
            }
            reception.last = Some(now);
        }
        reception.until = None;
        let begin = settings.address_bytes() + 1;
        let left = reception.length - reception.bytes.len();
        // Only the last frame may be shorter than 8 bytes.
        if length < DATA_BYTES && left > DATA_BYTES - begin {
            return None;
        }
        if data[begin - 1] & 0x0F != reception.sequence {
            self.0 = None;
            events.push(Event::ReceivingFailed(Errno::ILSEQ));
            return None;
        }
        reception.sequence = (reception.sequence + 1) % 16;
        let end = length.min(begin + left).max(begin);
        reception.bytes.extend(&data[begin..end]);
        if reception.bytes.len() >= reception.length {
            let message = self.0.take().map(|reception| reception.bytes);
            let is_right = !settings.checks_padding() || settings.is_padded_right(data, length, end);
            events.push(match message {
                Some(message) if is_right => Event::Received(message),
                _ => Event::ReceivingFailed(Errno::BADMSG),
            });
            return None;
        }
        reception.received_in_block = reception.received_in_block.wrapping_add(1);
        let block_size = settings.block_size();
        if block_size == 0 || reception.received_in_block < block_size {
            reception.until = Some(now + PEER_TIMEOUT);
            return None;
        }
        if settings.has(flag::LISTEN_MODE) {
            return None;
        }
        (reception.received_in_block, reception.last) = (0, None);
        reception.until = Some(now + PEER_TIMEOUT);
        Some(settings.flow_control_of(CONTINUE_TO_SEND))
    }
}
