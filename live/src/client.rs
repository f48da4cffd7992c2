//! One connection to the live page: its socket, its request, and its bounded queue.
//!
//! A slow client misses whole events, which are counted. A client that reads nothing for long, or does not complete its
//! request, is disconnected. Neither affects other clients.

use super::http::{self, Progress, Request, Status};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::os::fd::BorrowedFd;
use std::sync::Arc;

/// Capacity of the event queue of a client, bytes: some ten seconds.
const QUEUE: usize = 1 << 20;
/// Send buffer of a client's socket, here and at the gateway, bytes; the kernel doubles it.
pub const SEND_BUFFER: usize = 64 << 10;
/// Longest time until a request is complete.
const REQUEST_MS: u64 = 10_000;
/// Longest time with a queue of which the client reads nothing, here and at the gateway.
pub const STALLED_MS: u64 = 30_000;
/// Longest time between the response and the end of the connection.
const CLOSING_MS: u64 = 2_000;
/// Longest time for an answer from the emulator or the disk.
const ANSWER_MS: u64 = 5_000;
/// Most bytes read from a client in one turn.
const READ_A_TURN: usize = 16 << 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    ReadingRequest,
    /// Its request is in progress elsewhere.
    AwaitingAnswer,
    Streaming,
    /// Its response is being sent.
    SendingAnswer,
    /// The response is sent. Further input is read and discarded, since closing a socket with unread bytes may discard the
    /// response.
    Closing,
}

pub(super) struct Client {
    /// Unique number of the connection.
    pub(super) number: u64,
    pub(super) stream: TcpStream,
    stage: Stage,
    incoming: Vec<u8>,
    outgoing: VecDeque<Arc<[u8]>>,
    /// Bytes of the first piece that were written.
    written: usize,
    queued: usize,
    connected_ms: u64,
    last_progress_ms: u64,
    /// Events lost to a full queue.
    pub(super) missed: u64,
    pub(super) gone: bool,
}

impl Client {
    pub(super) fn new(stream: TcpStream, number: u64, now_ms: u64) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER)?;
        Ok(Self {
            number,
            stream,
            stage: Stage::ReadingRequest,
            incoming: Vec::new(),
            outgoing: VecDeque::new(),
            written: 0,
            queued: 0,
            connected_ms: now_ms,
            last_progress_ms: now_ms,
            missed: 0,
            gone: false,
        })
    }

    pub(super) fn has_something_to_write(&self) -> bool {
        !self.outgoing.is_empty()
    }

    pub(super) fn is_streaming(&self) -> bool {
        self.stage == Stage::Streaming
    }

    /// Reads from the socket; returns the request when it is complete.
    pub(super) fn read(&mut self, now_ms: u64) -> Option<Request> {
        let mut bytes = [0; READ_A_TURN];
        let read = match self.stream.read(&mut bytes) {
            Ok(read) if read > 0 => read,
            Err(error) if is_not_ready(&error) => return None,
            Ok(_) | Err(_) => {
                self.gone = true;
                return None;
            }
        };
        if self.stage != Stage::ReadingRequest {
            // One request a connection: further input is discarded.
            return None;
        }
        self.incoming.extend(&bytes[..read]);
        match http::parse(&self.incoming) {
            Progress::Partial => None,
            Progress::Whole(request) => {
                self.incoming = Vec::new();
                (self.stage, self.last_progress_ms) = (Stage::AwaitingAnswer, now_ms);
                Some(request)
            }
            Progress::Refused(status) => {
                self.incoming = Vec::new();
                self.answer(http::message_response(status, "this request cannot be read"), now_ms);
                None
            }
        }
    }

    /// Queues the response, after which the connection ends; ignored if the connection has had a response.
    pub(super) fn answer(&mut self, response: Vec<u8>, now_ms: u64) {
        if matches!(self.stage, Stage::ReadingRequest | Stage::AwaitingAnswer) {
            self.stage = Stage::SendingAnswer;
            self.queue(response.into(), now_ms);
        }
    }

    pub(super) fn stream_events(&mut self, now_ms: u64) {
        self.stage = Stage::Streaming;
        self.queue(http::stream_head().into(), now_ms);
    }

    /// Queues an event for a subscriber, or counts it as missed.
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

    /// Writes what the socket accepts, and marks the client as gone when it is done or has timed out.
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
                Err(error) if is_not_ready(&error) => break,
                Err(_) => return self.gone = true,
            }
        }
        if self.stage == Stage::AwaitingAnswer && now_ms.saturating_sub(self.last_progress_ms) >= ANSWER_MS {
            self.answer(http::message_response(Status::NoAnswer, "there was no answer in time"), now_ms);
        }
        if self.stage == Stage::SendingAnswer && self.outgoing.is_empty() {
            // Fails where the client has disconnected.
            let _ = self.stream.shutdown(Shutdown::Write);
            self.stage = Stage::Closing;
        }
        let since_ms = |then_ms: u64| now_ms.saturating_sub(then_ms);
        self.gone |= match self.stage {
            Stage::ReadingRequest => since_ms(self.connected_ms) >= REQUEST_MS,
            Stage::Closing => since_ms(self.last_progress_ms) >= CLOSING_MS,
            _ => !self.outgoing.is_empty() && since_ms(self.last_progress_ms) >= STALLED_MS,
        };
    }
}

/// Waits until the listener or a client is readable, a client with output is writable, or `other` is readable; at most
/// `milliseconds`. `clients` are sockets, each with whether output waits for it. Returns the indices of the readable clients,
/// and whether a connection waits at the listener.
///
/// # Errors
/// The error of `poll`; a signal only ends the wait.
pub fn wait<'a>(
    listener: &TcpListener,
    clients: impl Iterator<Item = (&'a TcpStream, bool)>,
    other: Option<BorrowedFd<'a>>,
    milliseconds: i64,
) -> io::Result<(Vec<usize>, bool)> {
    let mut polled = vec![PollFd::new(listener, PollFlags::IN)];
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

/// Whether an error of a non-blocking socket only says that it is not ready.
pub fn is_not_ready(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Response to a client beyond the limit of clients.
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
        client.gone
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
    fn an_answer_that_does_not_come_is_a_gateway_timeout() {
        let (mut client, mut far) = pair();
        ask(&mut client, &mut far, 1000);
        client.write(1000 + ANSWER_MS - 1);
        assert_eq!(client.stage, Stage::AwaitingAnswer);
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
        assert!(!is_gone(&mut client, STALLED_MS - 1));
        // It reads all that the kernel holds for it: room for more.
        let mut bytes = vec![0; QUEUE];
        while client.last_progress_ms == 0 {
            let _ = far.read(&mut bytes).unwrap();
            client.write(STALLED_MS - 1);
        }
        assert!(!is_gone(&mut client, STALLED_MS));
        // It reads no more; what it read before may have made some more room.
        let mut now_ms = STALLED_MS;
        while !is_gone(&mut client, now_ms) {
            assert!(client.has_something_to_write() && now_ms < 10 * STALLED_MS, "{now_ms} ms");
            now_ms += STALLED_MS;
        }
    }
}
