//! The sending side.

use super::settings::{Settings, flag};
use super::{DATA_BYTES, Event, INTERFACE_TIMEOUT, Incoming, LONGEST_PDU, PEER_TIMEOUT, kind};
use rustix::io::Errno;
use std::time::{Duration, Instant};

/// Longest message whose length fits the 12 bits of a first frame.
const LONGEST_IN_12_BITS: usize = 4095;
/// Time until the next attempt at a full interface.
const RETRY: Duration = Duration::from_millis(1);
const FLOW_CONTROL_BYTES: usize = 3;

#[derive(Clone, Copy, Debug, Default)]
enum State {
    #[default]
    Idle,
    /// Waits for a flow control frame, until a deadline; the first one sets block size and STmin.
    Awaits { is_first: bool, until: Instant },
    /// The next consecutive frame is due, and must be accepted before a deadline.
    Sends { due: Instant, until: Instant },
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Progress {
    state: State,
    /// Bytes that have been sent.
    sent: usize,
    /// Number of the next frame, modulo 16.
    sequence: u8,
    sent_in_block: u8,
}

/// The sending side of a socket, with the message in progress, if any.
#[derive(Debug, Default)]
pub(super) struct Sender {
    message: Vec<u8>,
    st_min: Duration,
    /// Frames of a block, 0 without blocks.
    block_size: u8,
    progress: Progress,
}

impl Sender {
    pub(super) fn is_busy(&self) -> bool {
        !matches!(self.progress.state, State::Idle)
    }

    /// The data of the first frame.
    pub(super) fn start(
        &mut self,
        message: &[u8],
        settings: &Settings,
        now: Instant,
    ) -> Result<Vec<u8>, Errno> {
        *self = Self::default();
        let room = DATA_BYTES - settings.address_bytes() - 1;
        let is_single = message.len() <= room;
        if message.is_empty() || message.len() > LONGEST_PDU || settings.has(flag::SF_BROADCAST) && !is_single
        {
            return Err(Errno::INVAL);
        }
        let length = message.len() as u32;
        if is_single {
            return Ok(settings.data_of(&[kind::SINGLE | length as u8], message));
        }
        let [l3, l2, l1, l0] = length.to_be_bytes();
        let head = if message.len() > LONGEST_IN_12_BITS {
            vec![kind::FIRST, 0, l3, l2, l1, l0]
        } else {
            vec![kind::FIRST | l1, l0]
        };
        let sent = DATA_BYTES - settings.address_bytes() - head.len();
        self.message = message.to_vec();
        let state = if settings.has(flag::CF_BROADCAST) {
            self.st_min = settings.st_min_of_a_broadcast();
            State::Sends { due: now + self.st_min, until: now + self.st_min + INTERFACE_TIMEOUT }
        } else {
            State::Awaits { is_first: true, until: now + PEER_TIMEOUT }
        };
        self.progress = Progress { state, sent, sequence: 1, sent_in_block: 0 };
        Ok(settings.data_of(&head, &message[..sent]))
    }

    /// The data of the consecutive frame that is due, which counts as sent, and the progress before it.
    pub(super) fn take_due(&mut self, settings: &Settings, now: Instant) -> Option<(Vec<u8>, Progress)> {
        let before @ Progress { state, sent, sequence, sent_in_block } = self.progress;
        if !matches!(state, State::Sends { due, .. } if due <= now) {
            return None;
        }
        let room = DATA_BYTES - settings.address_bytes() - 1;
        let payload = &self.message[sent..self.message.len().min(sent + room)];
        let sent = sent + payload.len();
        let sent_in_block = sent_in_block.wrapping_add(1);
        let state = if sent >= self.message.len() {
            State::Idle
        } else if self.block_size > 0 && sent_in_block >= self.block_size {
            State::Awaits { is_first: false, until: now + PEER_TIMEOUT }
        } else {
            State::Sends { due: now + self.st_min, until: now + self.st_min + INTERFACE_TIMEOUT }
        };
        self.progress = Progress { state, sent, sequence: (sequence + 1) % 16, sent_in_block };
        Some((settings.data_of(&[kind::CONSECUTIVE | sequence], payload), before))
    }

    pub(super) fn put_back(&mut self, before: Progress, now: Instant, events: &mut Vec<Event>) {
        match before.state {
            State::Sends { until, .. } if now < until => {
                self.progress = Progress { state: State::Sends { due: now + RETRY, until }, ..before };
            }
            _ => self.fail(Errno::COMM, events),
        }
    }

    pub(super) fn take_flow_control(&mut self, incoming: Incoming<'_>, events: &mut Vec<Event>) {
        let Incoming { data, length, settings, now } = incoming;
        let State::Awaits { is_first, .. } = self.progress.state else { return };
        let at = settings.address_bytes();
        let end = at + FLOW_CONTROL_BYTES;
        if length < end || settings.checks_padding() && !settings.is_padded_right(data, length, end) {
            return self.fail(Errno::BADMSG, events);
        }
        if is_first {
            self.block_size = data[at + 1];
            self.st_min = settings.st_min(data[at + 2]);
        }
        match data[at] & 0x0F {
            0 => {
                self.progress.sent_in_block = 0;
                self.progress.state = State::Sends { due: now, until: now + INTERFACE_TIMEOUT };
            }
            1 => self.progress.state = State::Awaits { is_first: false, until: now + PEER_TIMEOUT },
            2 => self.fail(Errno::MSGSIZE, events),
            // An unknown status: the kernel ends the message silently.
            _ => self.progress.state = State::Idle,
        }
    }

    pub(super) fn due(&self) -> Option<Instant> {
        match self.progress.state {
            State::Idle => None,
            State::Awaits { until, .. } => Some(until),
            State::Sends { due, .. } => Some(due),
        }
    }

    pub(super) fn advance(&mut self, now: Instant, events: &mut Vec<Event>) {
        if matches!(self.progress.state, State::Awaits { until, .. } if until <= now) {
            self.fail(Errno::COMM, events);
        }
    }

    fn fail(&mut self, error: Errno, events: &mut Vec<Event>) {
        *self = Self::default();
        events.push(Event::SendingFailed(error));
    }
}
