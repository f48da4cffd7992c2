//! One connection: its socket, its session, its bounded queue, and its counters.
//!
//! Frames of the bus wait in the queue until the socket accepts them; what does not fit is lost to this client alone, and
//! counted. A reply that does not fit ends the connection: the client sends requests and does not read.

use super::session::{Action, DisconnectReason, GREETING, Session};
use live::client::{SEND_BUFFER, STALLED_MS, is_not_ready};
use protocol::can::CanFrame;
use rustix::net::sockopt;
use serde::Serialize;
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// Longest text of a frame: "< frame 1FFFFFFF 4294967295.999999 0011223344556677 >".
pub(super) const LONGEST_FRAME: usize = 53;
/// Room for replies beside the frames, bytes.
const REPLIES: usize = 4096;
/// Idle time before the first keep-alive probe, and time between probes.
const KEEP_ALIVE: [Duration; 2] = [Duration::from_secs(30), Duration::from_secs(10)];
/// Most bytes read from a client in one turn, so that a flood does not delay the others.
const READ_A_TURN: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum EndReason {
    /// The client closed the connection, or its machine failed.
    ByClient,
    /// It read nothing for [`STALLED_MS`], or sent requests without reading the answers.
    ReadsNothing,
    WithGateway,
    #[serde(untagged)]
    Disconnected(DisconnectReason),
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct ClientReport {
    pub(super) address: SocketAddr,
    /// Frames of the bus queued for it.
    pub(super) frames_to_client: u64,
    /// Frames lost to its full queue.
    pub(super) frames_lost: u64,
    /// Frames that it sent and the bus accepted.
    pub(super) frames_from_client: u64,
    /// Frames that it sent and the bus did not accept.
    pub(super) frames_not_taken: u64,
    pub(super) requests_refused: u64,
    /// Why the connection ended; `None` while it is open.
    pub(super) ended: Option<EndReason>,
}

pub(super) struct Client {
    pub(super) stream: TcpStream,
    session: Session,
    outgoing: VecDeque<u8>,
    most_bytes: usize,
    /// Bytes at the front of the queue that are not subject to the pause.
    at_once: usize,
    last_progress_ms: u64,
    pub(super) report: ClientReport,
    announced: bool,
    pub(super) lost_reported: u64,
}

impl Client {
    /// Accepts a client and sends the greeting.
    pub(super) fn new(
        stream: TcpStream,
        address: SocketAddr,
        now_ms: u64,
        queue_frames: u32,
        read_only: bool,
    ) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER)?;
        sockopt::set_socket_keepalive(&stream, true)?;
        sockopt::set_tcp_keepidle(&stream, KEEP_ALIVE[0])?;
        sockopt::set_tcp_keepintvl(&stream, KEEP_ALIVE[1])?;
        let mut client = Self {
            stream,
            session: Session::new(now_ms, read_only),
            outgoing: VecDeque::new(),
            most_bytes: queue_frames as usize * LONGEST_FRAME,
            at_once: 0,
            last_progress_ms: now_ms,
            report: ClientReport {
                address,
                frames_to_client: 0,
                frames_lost: 0,
                frames_from_client: 0,
                frames_not_taken: 0,
                requests_refused: 0,
                ended: None,
            },
            announced: false,
            lost_reported: 0,
        };
        client.reply(GREETING);
        Ok(client)
    }

    pub(super) fn is_raw(&self) -> bool {
        self.session.is_raw()
    }

    /// Whether output may be written now.
    pub(super) fn has_something_to_write(&self, now_ms: u64) -> bool {
        self.ready_bytes(now_ms) > 0
    }

    /// Whether output waits for the end of the pause.
    pub(super) fn is_pausing(&self, now_ms: u64) -> bool {
        !self.session.pause_is_over(now_ms)
    }

    /// Announces the client once, when it enters raw mode.
    pub(super) fn announce(&mut self) {
        if self.is_raw() && !std::mem::replace(&mut self.announced, true) {
            eprintln!("gateway: client {} is on the bus", self.report.address);
        }
    }

    /// Queues a frame's text, or counts it as lost.
    pub(super) fn queue_frame(&mut self, text: &str, now_ms: u64) {
        if self.outgoing.len() + text.len() > self.most_bytes {
            self.report.frames_lost += 1;
            return;
        }
        if self.outgoing.is_empty() {
            self.last_progress_ms = now_ms;
        }
        self.outgoing.extend(text.as_bytes());
        self.report.frames_to_client += 1;
    }

    /// Processes input; `send` puts a frame on the bus and returns whether it was accepted.
    pub(super) fn read(&mut self, bus: &str, now_ms: u64, mut send: impl FnMut(&CanFrame) -> bool) {
        let mut bytes = [0; READ_A_TURN];
        let read = match self.stream.read(&mut bytes) {
            Ok(read) if read > 0 => read,
            Err(error) if is_not_ready(&error) => return,
            _ => return self.end(EndReason::ByClient),
        };
        let mut actions = Vec::new();
        self.session.take(&bytes[..read], bus, now_ms, &mut actions);
        self.report.requests_refused = self.session.refused;
        for action in actions {
            match action {
                Action::Reply(text) => self.reply(&text),
                Action::Send(frame) if send(&frame) => self.report.frames_from_client += 1,
                Action::Send(_) => self.report.frames_not_taken += 1,
                Action::Disconnect(why) => {
                    self.write(now_ms);
                    self.end(EndReason::Disconnected(why));
                }
            }
        }
    }

    /// Writes what the socket accepts, and ends a connection that stalls or does not reach raw mode.
    pub(super) fn write(&mut self, now_ms: u64) {
        loop {
            let ready = self.ready_bytes(now_ms);
            if ready == 0 {
                break;
            }
            let front = self.outgoing.as_slices().0;
            match self.stream.write(&front[..front.len().min(ready)]) {
                Ok(written) if written > 0 => {
                    self.outgoing.drain(..written);
                    self.at_once = self.at_once.saturating_sub(written);
                    self.last_progress_ms = now_ms;
                }
                Err(error) if is_not_ready(&error) => break,
                _ => return self.end(EndReason::ByClient),
            }
        }
        if self.session.is_overdue(now_ms) {
            self.end(EndReason::Disconnected(DisconnectReason::NoRawMode));
        } else if !self.outgoing.is_empty() && now_ms.saturating_sub(self.last_progress_ms) >= STALLED_MS {
            self.end(EndReason::ReadsNothing);
        }
    }

    /// Ends the connection; the first reason is kept.
    pub(super) fn end(&mut self, why: EndReason) {
        self.report.ended.get_or_insert(why);
    }

    fn ready_bytes(&self, now_ms: u64) -> usize {
        if self.session.pause_is_over(now_ms) { self.outgoing.len() } else { self.at_once }
    }

    fn reply(&mut self, text: &str) {
        if self.outgoing.len() + text.len() > self.most_bytes + REPLIES {
            return self.end(EndReason::ReadsNothing);
        }
        self.outgoing.extend(text.as_bytes());
        self.at_once = self.outgoing.len();
    }
}
