//! Protocol state of one client: input bytes, output actions. No socket, no clock: the time is an argument.
//!
//! ```text
//!                "< hi >"          < open NAME >          < rawmode >
//!   connected ────────────► Greeted ────────────► Opened ────────────► Raw ── frames, 30 ms after the ok
//!                              │  "< ok >"           │      "< ok >"    │
//!                              └── unknown bus, bytes that are no request, or not raw within 10 s: disconnected
//! ```
//!
//! In every state `< echo >` is answered by itself, and what is not understood by `< error … >`. `< send … >` is accepted from
//! `Opened` on, as by socketcand, and not answered. The pause before the first frame is for python-can, which compares one
//! whole read with `< ok >`.
//!
//! Source: socketcand, `doc/protocol.md`.

use super::parser::{Parser, Refusal, Request};
use protocol::can::CanFrame;
use std::fmt::Write;

/// First text that a client receives.
pub(crate) const GREETING: &str = "< hi >";
/// Time between the answer to `< rawmode >` and the first frame, ms.
pub(crate) const PAUSE_MS: u64 = 30;
/// Longest time from the greeting to raw mode, ms.
pub(crate) const RAW_MODE_WITHIN_MS: u64 = 10_000;
/// Refused requests after which a session ends.
pub(crate) const MOST_REFUSED: u64 = 100;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Send this text to the client.
    Reply(String),
    Send(CanFrame),
    /// Send the replies, then end the connection for this reason.
    Disconnect(DisconnectReason),
}

/// Why the gateway ends a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum DisconnectReason {
    NotTheProtocol,
    UnknownBus,
    NoRawMode,
    /// Too many requests were refused.
    TooManyRefused,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Greeted,
    Opened,
    Raw { since_ms: u64 },
    Closed,
}

#[derive(Clone, Debug)]
pub(crate) struct Session {
    state: State,
    parser: Parser,
    began_ms: u64,
    /// Requests refused so far.
    pub(crate) refused: u64,
    read_only: bool,
}

impl Session {
    /// A client greeted at `now_ms`, of any clock; a `read_only` one may not send.
    pub(crate) fn new(now_ms: u64, read_only: bool) -> Self {
        Self { state: State::Greeted, parser: Parser::default(), began_ms: now_ms, refused: 0, read_only }
    }

    /// Processes input; `bus` is the name of the bus. Appends the actions in order.
    pub(crate) fn take(&mut self, bytes: &[u8], bus: &str, now_ms: u64, actions: &mut Vec<Action>) {
        for byte in bytes {
            if self.state == State::Closed {
                return;
            }
            match self.parser.push(*byte) {
                None => {}
                Some(Ok(request)) => self.answer(request, bus, now_ms, actions),
                Some(Err(refusal)) => self.refuse(refusal, actions),
            }
        }
    }

    /// Whether the client is in raw mode, so that frames of the bus are queued for it.
    pub(crate) fn is_raw(&self) -> bool {
        matches!(self.state, State::Raw { .. })
    }

    /// Whether the pause after the answer to `< rawmode >` is over.
    pub(crate) fn pause_is_over(&self, now_ms: u64) -> bool {
        match self.state {
            State::Raw { since_ms } => now_ms.saturating_sub(since_ms) >= PAUSE_MS,
            _ => true,
        }
    }

    /// Whether the client has taken too long to reach raw mode.
    pub(crate) fn is_overdue(&self, now_ms: u64) -> bool {
        matches!(self.state, State::Greeted | State::Opened)
            && now_ms.saturating_sub(self.began_ms) >= RAW_MODE_WITHIN_MS
    }

    fn answer(&mut self, request: Request, bus: &str, now_ms: u64, actions: &mut Vec<Action>) {
        match (request, self.state) {
            (Request::Echo, _) => actions.push(reply("< echo >")),
            (Request::Open(name), State::Greeted) if name == bus => {
                self.state = State::Opened;
                actions.push(reply("< ok >"));
            }
            (Request::Open(_), State::Greeted) => {
                actions.push(reply("< error could not open bus >"));
                self.disconnect(DisconnectReason::UnknownBus, actions);
            }
            (Request::RawMode, State::Opened) => {
                self.state = State::Raw { since_ms: now_ms };
                actions.push(reply("< ok >"));
            }
            (Request::Send(frame), State::Opened | State::Raw { .. }) if !self.read_only => {
                actions.push(Action::Send(frame));
            }
            // Out of order, or not allowed.
            _ => self.refuse(Refusal::UnknownCommand, actions),
        }
    }

    fn refuse(&mut self, refusal: Refusal, actions: &mut Vec<Action>) {
        self.refused += 1;
        let text = match refusal {
            Refusal::UnknownCommand => "< error unknown command >",
            Refusal::Malformed => "< error malformed command >",
            Refusal::TooLong => "< error command too long >",
            Refusal::NotTheProtocol => return self.disconnect(DisconnectReason::NotTheProtocol, actions),
        };
        actions.push(reply(text));
        if self.refused >= MOST_REFUSED {
            self.disconnect(DisconnectReason::TooManyRefused, actions);
        }
    }

    fn disconnect(&mut self, why: DisconnectReason, actions: &mut Vec<Action>) {
        self.state = State::Closed;
        actions.push(Action::Disconnect(why));
    }
}

fn reply(text: &str) -> Action {
    Action::Reply(text.into())
}

/// Appends a frame as clients read it, with `stamp_ns` since the Unix epoch; returns false for remote requests and error
/// frames, which the protocol cannot carry to python-can.
pub(crate) fn write_frame(text: &mut String, frame: &CanFrame, stamp_ns: u64) -> bool {
    use protocol::can::{ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};
    let raw_id = frame.raw_id();
    if raw_id & (ERROR_FLAG | REMOTE_FLAG) != 0 {
        return false;
    }
    let (id, digits) = if raw_id & EXTENDED_FLAG == 0 { (raw_id, 3) } else { (raw_id & !EXTENDED_FLAG, 8) };
    let (seconds, microseconds) = (stamp_ns / 1_000_000_000, stamp_ns / 1000 % 1_000_000);
    // Writing to a String cannot fail.
    let _ = write!(text, "< frame {id:0digits$X} {seconds}.{microseconds:06} ");
    frame.data().iter().for_each(|byte| {
        let _ = write!(text, "{byte:02X}");
    });
    text.push_str(" >");
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::can::{ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};

    /// What a session that began at 0 does on `text` at `now_ms`.
    fn talk(session: &mut Session, text: &str, now_ms: u64) -> Vec<Action> {
        let mut actions = Vec::new();
        session.take(text.as_bytes(), "bus0", now_ms, &mut actions);
        actions
    }

    #[test]
    fn every_edge_of_the_diagram() {
        let mut session = Session::new(0, false);
        assert_eq!(talk(&mut session, "< rawmode >", 1), [reply("< error unknown command >")]);
        assert_eq!(talk(&mut session, "< send 123 0 >", 1), [reply("< error unknown command >")]);
        assert_eq!(talk(&mut session, "< open bus0 >", 2), [reply("< ok >")]);
        assert!(!session.is_raw());
        assert_eq!(talk(&mut session, "< send 123 0 >", 3), [Action::Send(CanFrame::new(0x123, &[]))]);
        assert_eq!(talk(&mut session, "< rawmode >", 5), [reply("< ok >")]);
        assert!(session.is_raw() && !session.pause_is_over(34) && session.pause_is_over(35));
        assert_eq!(talk(&mut session, "< echo >", 40), [reply("< echo >")]);
        assert_eq!(talk(&mut session, "< open bus0 >", 40), [reply("< error unknown command >")]);
        assert_eq!(session.refused, 3);
    }

    #[test]
    fn another_bus_another_protocol_and_babble_are_parted_with() {
        let open = talk(&mut Session::new(0, false), "< open can7 >< open bus0 >", 0);
        assert_eq!(
            open,
            [reply("< error could not open bus >"), Action::Disconnect(DisconnectReason::UnknownBus)]
        );
        let http = talk(&mut Session::new(0, false), "POST / HTTP/1.1\r\n\r\n< open bus0 >", 0);
        assert_eq!(http, [Action::Disconnect(DisconnectReason::NotTheProtocol)]);
        let babble = talk(&mut Session::new(0, false), &"< x >".repeat(1000), 0);
        assert_eq!(babble.len() as u64, MOST_REFUSED + 1);
        assert_eq!(babble.last(), Some(&Action::Disconnect(DisconnectReason::TooManyRefused)));
    }

    #[test]
    fn who_does_not_get_to_raw_mode_is_overdue_and_a_client_in_raw_mode_never() {
        let mut session = Session::new(500, false);
        assert!(
            !session.is_overdue(500 + RAW_MODE_WITHIN_MS - 1) && session.is_overdue(500 + RAW_MODE_WITHIN_MS)
        );
        talk(&mut session, "< open bus0 >< rawmode >", 600);
        assert!(!session.is_overdue(u64::MAX));
    }

    #[test]
    fn a_read_only_client_sends_nothing() {
        let mut session = Session::new(0, true);
        let actions = talk(&mut session, "< open bus0 >< rawmode >< send 108 2 1 0 >", 0);
        assert_eq!(actions, [reply("< ok >"), reply("< ok >"), reply("< error unknown command >")]);
    }

    #[test]
    fn frames_are_written_as_python_can_reads_them() {
        let written = |frame: &CanFrame| {
            let mut text = String::new();
            write_frame(&mut text, frame, 12_000_345_678).then_some(text)
        };
        let cases = [
            (CanFrame::new(0x1A, &[0xAB, 1]), Some("< frame 01A 12.000345 AB01 >")),
            (CanFrame::from_raw(EXTENDED_FLAG | 0x1A, &[7]), Some("< frame 0000001A 12.000345 07 >")),
            // Two spaces: python-can wants the third word, even an empty one.
            (CanFrame::new(0x7FF, &[]), Some("< frame 7FF 12.000345  >")),
            (CanFrame::from_raw(REMOTE_FLAG | 0x1A, &[]), None),
            (CanFrame::from_raw(ERROR_FLAG | 4, &[0; 8]), None),
        ];
        for (frame, expected) in cases {
            assert_eq!(written(&frame).as_deref(), expected, "{frame}");
        }
    }
}
