//! One connection to the live page: its socket, its request, and its bounded queue.
//!
//! A client that is behind misses whole events, counted; one that takes nothing for long, or does not get to the point of its
//! request, is parted with. Neither costs anybody else anything.

use super::http::{self, Progress, Request, Status};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::os::fd::BorrowedFd;
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Asking,
    /// Its request is being obeyed elsewhere.
    Waiting,
    Streaming,
    /// It gets its answer, and then its end.
    Ending,
    /// It has its answer; what it still sends is read, since a socket closed on unread bytes may take the answer back.
    Closing,
}

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
                self.answer(http::message_response(status, "this request cannot be read"), now_ms);
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
            self.answer(http::message_response(Status::NoAnswer, "there was no answer in time"), now_ms);
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

/// Waits at the door and for clients, each with whether it has something to write; `other` wakes too. Tells which clients have
/// sent something, and whether somebody waits at the door.
pub fn wait<'a>(
    door: &TcpListener,
    clients: impl Iterator<Item = (&'a TcpStream, bool)>,
    other: Option<BorrowedFd<'a>>,
    milliseconds: i64,
) -> io::Result<(Vec<usize>, bool)> {
    let mut polled = vec![PollFd::new(door, PollFlags::IN)];
    polled.extend(clients.map(|(stream, writes)| {
        PollFd::new(stream, if writes { PollFlags::IN | PollFlags::OUT } else { PollFlags::IN })
    }));
    let count = polled.len();
    polled.extend(other.map(|socket| PollFd::from_borrowed_fd(socket, PollFlags::IN)));
    match poll(&mut polled, Some(&Timespec { tv_sec: 0, tv_nsec: milliseconds * 1_000_000 })) {
        Ok(_) | Err(rustix::io::Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    let reported =
        |polled: &PollFd<'_>| polled.revents().intersects(PollFlags::IN | PollFlags::HUP | PollFlags::ERR);
    Ok((
        (1..count).filter(|place| reported(&polled[*place])).map(|place| place - 1).collect(),
        reported(&polled[0]),
    ))
}

/// Whether a socket that does not block has nothing to say yet.
pub fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// What to say to whom there is no room for.
pub(super) fn refusal() -> Vec<u8> {
    http::message_response(Status::Busy, "too many clients; --clients N allows more")
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVENTS: &str = "GET /api/events HTTP/1.1\r\nHost: localhost:1\r\n\r\n";

    /// A client that came at 0 ms, and its far end.
    fn pair() -> (Client, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let far = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (Client::new(listener.accept().unwrap().0, 1, 0).unwrap(), far)
    }

    /// Has it ask at `now_ms`, and waits until that is there.
    fn ask(client: &mut Client, far: &mut TcpStream, now_ms: u64) {
        far.write_all(EVENTS.as_bytes()).unwrap();
        while client.read(now_ms).is_none() {
            std::thread::yield_now();
        }
    }

    fn is_gone(client: &mut Client, now_ms: u64) -> bool {
        client.write(now_ms);
        client.is_gone()
    }

    #[test]
    fn one_that_does_not_get_to_the_point_is_parted_with_whatever_it_sends_meanwhile() {
        let (mut client, mut far) = pair();
        far.write_all(b"GET /").unwrap();
        while client.incoming.is_empty() {
            assert_eq!(client.read(REQUEST_MS - 1), None);
        }
        assert!(!is_gone(&mut client, REQUEST_MS - 1));
        assert!(is_gone(&mut client, REQUEST_MS));
    }

    #[test]
    fn an_answer_that_does_not_come_is_told_in_time() {
        let (mut client, mut far) = pair();
        ask(&mut client, &mut far, 1000);
        client.write(1000 + ANSWER_MS - 1);
        assert_eq!(client.stage, Stage::Waiting);
        // In this turn it is answered, in the next one that is written.
        (0..2).for_each(|_| client.write(1000 + ANSWER_MS));
        assert_eq!(client.stage, Stage::Closing);
        let mut answer = String::new();
        far.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 504"), "{answer}");
        client.answer(http::message_response(Status::Good, "too late"), 1000 + ANSWER_MS);
        assert!(!client.has_something_to_write());
        // It has its answer and does not go.
        assert!(!is_gone(&mut client, 1000 + ANSWER_MS + CLOSING_MS - 1));
        assert!(is_gone(&mut client, 1000 + ANSWER_MS + CLOSING_MS));
    }

    #[test]
    fn a_listener_that_takes_nothing_is_parted_with_and_a_slow_one_is_not() {
        let (mut client, mut far) = pair();
        ask(&mut client, &mut far, 0);
        client.stream_events(0);
        let event: Arc<[u8]> = vec![b'x'; QUEUE / 4].into();
        while client.missed == 0 {
            client.offer(&event, 0);
            client.write(0);
        }
        assert!(!is_gone(&mut client, STUCK_MS - 1));
        // It reads all that the kernel holds for it: room for more.
        let mut bytes = vec![0; QUEUE];
        while client.last_progress_ms == 0 {
            let _ = far.read(&mut bytes).unwrap();
            client.write(STUCK_MS - 1);
        }
        assert!(!is_gone(&mut client, STUCK_MS));
        // It reads no more; what it read before may have made some more room.
        let mut now_ms = STUCK_MS;
        while !is_gone(&mut client, now_ms) {
            assert!(client.has_something_to_write() && now_ms < 10 * STUCK_MS, "{now_ms} ms");
            now_ms += STUCK_MS;
        }
    }
}
