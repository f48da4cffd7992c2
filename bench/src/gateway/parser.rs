//! Parser of the requests of the socketcand protocol, in bounded memory.
//!
//! ```text
//!   stream  = { white space | "<" words ">" }        no line ends; a request may come in pieces
//!   words   = "open" NAME | "rawmode" | "echo" | "send" ID LEN { BYTE }
//!   ID      = 1 to 8 hex digits; BYTE = 1 or 2 hex digits; LEN = 0 to 8, as many bytes follow
//! ```
//!
//! An identifier is extended (29 bits) when it has 8 digits (python-can), has bit 31 set (SavvyCAN: id | 0x80000000) or exceeds
//! 11 bits (socketcand). Remote requests, error frames and CAN FD are refused.
//!
//! Anything but white space between requests is [`Refusal::NotTheProtocol`]: a web page that posts to the port sends an HTTP
//! request line first and must not reach its body.
//!
//! Source: socketcand, `doc/protocol.md`; python-can 4, `interfaces/socketcand`; SavvyCAN, `socketcand.cpp`.

use protocol::bus::LONGEST_NAME;
use protocol::can::{CanFrame, EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK};

/// Longest request in bytes without brackets: twice the longest valid one.
pub(super) const LONGEST_REQUEST: usize = 128;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Use the bus of this name.
    Open(String),
    /// Receive every frame from now on.
    RawMode,
    Echo,
    Send(CanFrame),
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// A command outside the grammar above.
    UnknownCommand,
    /// A known command with wrong arguments.
    Malformed,
    /// More than [`LONGEST_REQUEST`] bytes; skipped to its end.
    TooLong,
    /// Bytes outside `< … >`: the client speaks another protocol.
    NotTheProtocol,
}

/// State of the parser.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ParserState {
    #[default]
    Between,
    Inside,
    Skipping,
}

/// Incremental parser.
#[derive(Clone, Debug)]
pub(super) struct Parser {
    state: ParserState,
    bytes: [u8; LONGEST_REQUEST],
    length: usize,
}

impl Default for Parser {
    fn default() -> Self {
        Self { state: ParserState::default(), bytes: [0; LONGEST_REQUEST], length: 0 }
    }
}

impl Parser {
    /// Takes the next byte; returns the request that it completes.
    pub(super) fn push(&mut self, byte: u8) -> Option<Result<Request, Refusal>> {
        match (self.state, byte) {
            (ParserState::Between, b'<') => {
                (self.state, self.length) = (ParserState::Inside, 0);
                None
            }
            (ParserState::Between, byte) => {
                (!byte.is_ascii_whitespace()).then_some(Err(Refusal::NotTheProtocol))
            }
            (ParserState::Inside, b'>') => {
                self.state = ParserState::Between;
                Some(read(&self.bytes[..self.length]))
            }
            // The request before was incomplete: a new one begins.
            (ParserState::Inside, b'<') => {
                self.length = 0;
                Some(Err(Refusal::Malformed))
            }
            (ParserState::Inside, _) if self.length == LONGEST_REQUEST => {
                self.state = ParserState::Skipping;
                Some(Err(Refusal::TooLong))
            }
            (ParserState::Inside, byte) => {
                self.bytes[self.length] = byte;
                self.length += 1;
                None
            }
            (ParserState::Skipping, b'>') => {
                self.state = ParserState::Between;
                None
            }
            (ParserState::Skipping, _) => None,
        }
    }
}

/// The request between the brackets.
///
/// # Errors
/// Why it is refused; never [`Refusal::TooLong`] or [`Refusal::NotTheProtocol`].
pub(super) fn read(bytes: &[u8]) -> Result<Request, Refusal> {
    let text = std::str::from_utf8(bytes).map_err(|_| Refusal::Malformed)?;
    let mut words = text.split_ascii_whitespace();
    let command = words.next().ok_or(Refusal::Malformed)?;
    let request = match command {
        "open" => {
            let name = words.next().filter(|name| name.len() <= LONGEST_NAME).ok_or(Refusal::Malformed)?;
            Request::Open(name.into())
        }
        "rawmode" => Request::RawMode,
        "echo" => Request::Echo,
        "send" => Request::Send(frame(&mut words).ok_or(Refusal::Malformed)?),
        _ => return Err(Refusal::UnknownCommand),
    };
    if words.next().is_some() { Err(Refusal::Malformed) } else { Ok(request) }
}

/// Parses ID LEN BYTE….
fn frame<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<CanFrame> {
    let digits = words.next()?;
    let number = hexadecimal(digits, 8)?;
    let id = number & !EXTENDED_FLAG;
    if id > EXTENDED_MASK {
        return None;
    }
    let extended = number != id || digits.len() == 8 || id > STANDARD_MASK;
    let length = hexadecimal(words.next()?, 1).filter(|length| *length <= 8)? as usize;
    let mut data = [0; 8];
    for byte in &mut data[..length] {
        *byte = hexadecimal(words.next()?, 2)? as u8;
    }
    Some(CanFrame::from_raw(if extended { id | EXTENDED_FLAG } else { id }, &data[..length]))
}

/// A number of 1 to `most` hex digits; `from_str_radix` alone would accept a sign.
fn hexadecimal(digits: &str, most: usize) -> Option<u32> {
    let fits = (1..=most).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    fits.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(stream: &[u8]) -> Vec<Result<Request, Refusal>> {
        let mut parser = Parser::default();
        stream.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    fn sent(stream: &str) -> Option<String> {
        match all(stream.as_bytes()).as_slice() {
            [Ok(Request::Send(frame))] => Some(frame.to_string()),
            _ => None,
        }
    }

    #[test]
    fn a_session_of_python_can_is_understood() {
        let requests = all(b"< open bus0 >< rawmode >< send 123 3 1 a ff >< send 123 0  >\n< echo >");
        let expected = [
            Ok(Request::Open("bus0".into())),
            Ok(Request::RawMode),
            Ok(Request::Send(CanFrame::new(0x123, &[1, 0x0A, 0xFF]))),
            Ok(Request::Send(CanFrame::new(0x123, &[]))),
            Ok(Request::Echo),
        ];
        assert_eq!(requests, expected);
    }

    #[test]
    fn extended_identifiers_come_in_three_ways() {
        for id in ["00000123", "80000123"] {
            assert_eq!(sent(&format!("< send {id} 1 07 >")).as_deref(), Some("00000123#07"), "{id}");
        }
        assert_eq!(sent("<send 1ABCDEF 0>").as_deref(), Some("01ABCDEF#"));
        assert_eq!(sent("< send 7ff 0 >").as_deref(), Some("7FF#"));
        assert_eq!(sent("< send 9FFFFFFF 0 >").as_deref(), Some("1FFFFFFF#"));
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        for words in [
            "",
            "123",
            "123 1",
            "123 2 1",
            "123 1 1 2",
            "123 9 1 2 3 4 5 6 7 8 9",
            "123 1 100",
            "123 1 -1",
            "123 1 +1",
            "123 1 g",
            "-123 0",
            "40000123 0",
            "20000004 0",
            "E0000000 0",
            "123456789 0",
            "123 08 1",
            "123 R",
            "x 0",
        ] {
            assert_eq!(all(format!("< send {words} >").as_bytes()), [Err(Refusal::Malformed)], "{words}");
        }
    }

    #[test]
    fn a_request_in_pieces_is_one_and_what_is_cut_off_is_none() {
        let mut parser = Parser::default();
        let pieces: [&[u8]; 3] = [b"< ra", b"wmo", b"de >"];
        let found: Vec<_> = pieces.concat().iter().filter_map(|byte| parser.push(*byte)).collect();
        assert_eq!(found, [Ok(Request::RawMode)]);
        assert_eq!(all(b"< open b< echo >"), [Err(Refusal::Malformed), Ok(Request::Echo)]);
    }

    #[test]
    fn an_overlong_request_is_skipped_and_refused_once() {
        let long = format!("< open {} >< echo >", "a".repeat(10_000));
        assert_eq!(all(long.as_bytes()), [Err(Refusal::TooLong), Ok(Request::Echo)]);
        let name = "a".repeat(LONGEST_NAME + 1);
        assert_eq!(all(format!("< open {name} >").as_bytes()), [Err(Refusal::Malformed)]);
    }

    #[test]
    fn other_protocols_are_none_of_ours() {
        assert_eq!(all(b"G"), [Err(Refusal::NotTheProtocol)]);
        assert_eq!(all(b"< add 1 2 123 1 0 >"), [Err(Refusal::UnknownCommand)]);
        assert_eq!(all(b"< \xFF >"), [Err(Refusal::Malformed)]);
        assert_eq!(all(b"<>"), [Err(Refusal::Malformed)]);
    }
}
