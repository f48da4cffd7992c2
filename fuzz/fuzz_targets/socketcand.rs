//! The gateway's clients: any bytes in any pieces end in answers, frames or the end of the connection, the same ones however they
//! are cut up.
#![no_main]

use gateway::session::{Action, Session};
use libfuzzer_sys::fuzz_target;

/// The two files alone: `bench` as a whole is half of what the fuzz targets would compile.
#[allow(dead_code, unreachable_pub)]
#[path = "../../bench/src/gateway"]
mod gateway {
    mod parser;
    pub mod session;
}

/// What the bus is called.
const BUS: &str = "can0";
/// Longest answer: those of the protocol are short, and none repeats what a client said.
const LONGEST_REPLY: usize = 40;

fuzz_target!(|input: (u8, &[u8])| {
    let (piece, bytes) = input;
    let whole = said(bytes.chunks(bytes.len().max(1)));
    assert_eq!(whole, said(bytes.chunks(usize::from(piece).max(1))), "in pieces of {piece}");
    for (at, action) in whole.iter().enumerate() {
        match action {
            Action::Reply(text) => assert!(text.len() <= LONGEST_REPLY, "{text}"),
            Action::Send(frame) => assert!(frame.data().len() <= 8),
            Action::Disconnect(_) => assert_eq!(at + 1, whole.len(), "something after the end of the connection"),
        }
    }
});

fn said<'a>(pieces: impl Iterator<Item = &'a [u8]>) -> Vec<Action> {
    let mut session = Session::new(0, false);
    let mut actions = Vec::new();
    pieces.for_each(|piece| session.take(piece, BUS, 0, &mut actions));
    actions
}
