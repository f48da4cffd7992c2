//! One connection to the live page: its socket, its request, and its bounded queue.
//!
//! A client that is behind misses whole events, counted; one that takes nothing for long, or does not get to the point of its
//! request, is parted with. Neither costs anybody else anything.

use super::http::{self, Progress, Request, Status};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;

/// Bytes of events that wait for a client: some ten seconds of them.
const QUEUE: usize = 1 << 20;
/// What the kernel may hold for a client, bytes; it takes twice of it.
const SEND_BUFFER: usize = 64 << 10;
/// A request comes within so long.
const REQUEST_MS: u64 = 10_000;
/// Something was queued for so long, and the client took nothing.
const STUCK_MS: u64 = 30_000;
/// How long a client that has its answer may take to go.
const CLOSING_MS: u64 = 2_000;
/// What is done elsewhere, by the emulator or on the disk, is answered within so long.
const ANSWER_MS: u64 = 5_000;
/// Bytes taken from a client in one turn.
const READ_A_TURN: usize = 16 << 10;

/// What a client is here for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// It asks.
    Asking,
    /// Its request is being obeyed elsewhere.
    Waiting,
    /// It gets events.
    Streaming,
    /// It gets its answer, and then its end.
    Ending,
    /// It has its answer; what it still sends is read, since a socket closed on unread bytes may take the answer back.
    Closing,
}

/// A connection.
pub(super) struct Client {
    /// Tells it from all that came before.
    pub(super) number: u64,
    stream: TcpStream,
    stage: Stage,
    incoming: Vec<u8>,
    outgoing: VecDeque<Arc<[u8]>>,
    /// Bytes of the first piece that were written.
    written: usize,
    queued: usize,
    came_ms: u64,
    last_progress_ms: u64,
    /// Events that its queue had no room for.
    pub(super) missed: u64,
    gone: bool,
}

impl Client {
    /// One that has come.
    pub(super) fn new(stream: TcpStream, number: u64, now_ms: u64) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER)?;
        Ok(Self {
            number,
            stream,
            stage: Stage::Asking,
            incoming: Vec::new(),
            outgoing: VecDeque::new(),
            written: 0,
            queued: 0,
            came_ms: now_ms,
            last_progress_ms: now_ms,
            missed: 0,
            gone: false,
        })
    }

    pub(super) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    pub(super) fn has_something_to_write(&self) -> bool {
        !self.outgoing.is_empty()
    }

    pub(super) fn is_streaming(&self) -> bool {
        self.stage == Stage::Streaming
    }

    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }

    /// Takes what has come; a request, when it is whole.
    pub(super) fn read(&mut self, now_ms: u64) -> Option<Request> {
        let mut bytes = [0; READ_A_TURN];
        let read = match self.stream.read(&mut bytes) {
            Ok(read) if read > 0 => read,
            Err(error) if is_for_later(&error) => return None,
            Ok(_) | Err(_) => {
                self.gone = true;
                return None;
            }
        };
        if self.stage != Stage::Asking {
            // It had its say.
            return None;
        }
        self.incoming.extend(&bytes[..read]);
        match http::parse(&self.incoming) {
            Progress::Partial => None,
            Progress::Whole(request) => {
                self.incoming = Vec::new();
                (self.stage, self.last_progress_ms) = (Stage::Waiting, now_ms);
                Some(request)
            }
            Progress::Refused(status) => {
                self.incoming = Vec::new();
                self.answer(http::said(status, "this request cannot be read"), now_ms);
                None
            }
        }
    }

    /// Gives it its answer, after which it goes; one that comes too late is none.
    pub(super) fn answer(&mut self, response: Vec<u8>, now_ms: u64) {
        if matches!(self.stage, Stage::Asking | Stage::Waiting) {
            self.stage = Stage::Ending;
            self.queue(response.into(), now_ms);
        }
    }

    /// Makes it a listener to events.
    pub(super) fn stream_events(&mut self, now_ms: u64) {
        self.stage = Stage::Streaming;
        self.queue(http::stream_head().into(), now_ms);
    }

    /// Queues an event for a listener, or counts it as missed.
    pub(super) fn offer(&mut self, event: &Arc<[u8]>, now_ms: u64) {
        if self.queued + event.len() > QUEUE {
            self.missed += 1;
        } else {
            self.queue(Arc::clone(event), now_ms);
        }
    }

    fn queue(&mut self, piece: Arc<[u8]>, now_ms: u64) {
        if self.outgoing.is_empty() {
            self.last_progress_ms = now_ms;
        }
        self.queued += piece.len();
        self.outgoing.push_back(piece);
    }

    /// Writes what the socket takes, and parts with a client that is done or stands still.
    pub(super) fn write(&mut self, now_ms: u64) {
        while let Some(front) = self.outgoing.front() {
            match self.stream.write(&front[self.written..]) {
                Ok(0) => return self.gone = true,
                Ok(taken) => {
                    self.last_progress_ms = now_ms;
                    self.written += taken;
                    if self.written == front.len() {
                        self.queued -= self.written;
                        self.written = 0;
                        self.outgoing.pop_front();
                    }
                }
                Err(error) if is_for_later(&error) => break,
                Err(_) => return self.gone = true,
            }
        }
        if self.stage == Stage::Waiting && now_ms.saturating_sub(self.last_progress_ms) >= ANSWER_MS {
            self.answer(http::said(Status::NoAnswer, "there was no answer in time"), now_ms);
        }
        if self.stage == Stage::Ending && self.outgoing.is_empty() {
            // One that is gone already is as good as shut down.
            let _ = self.stream.shutdown(Shutdown::Write);
            self.stage = Stage::Closing;
        }
        let since_ms = |then_ms: u64| now_ms.saturating_sub(then_ms);
        self.gone |= match self.stage {
            Stage::Asking => since_ms(self.came_ms) >= REQUEST_MS,
            Stage::Closing => since_ms(self.last_progress_ms) >= CLOSING_MS,
            _ => !self.outgoing.is_empty() && since_ms(self.last_progress_ms) >= STUCK_MS,
        };
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// What to say to whom there is no room for.
pub(super) fn refusal() -> Vec<u8> {
    http::said(Status::Busy, "too many clients; --clients N allows more")
}
