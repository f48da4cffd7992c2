//! A SocketCAN program of Rust, by the crate `socketcan`: static-guest INTERFACE prints what each call gives.
//!
//! `tests/expected/socketcan/rust.txt` is its output on vcan. It is linked statically, with a C library inside, so that no
//! preloaded library would reach it; the crate waits by `poll` and reads time stamps by `recvmsg`.

#![allow(clippy::print_stdout)] // what it is for

use socketcan::{
    CanDataFrame, CanFdSocket, CanFilter, CanFrame, CanRemoteFrame, CanSocket, EmbeddedFrame as _,
    ExtendedId, Frame as _, Socket, SocketOptions as _, StandardId,
};
use std::fmt::Debug;
use std::io;
use std::thread;
use std::time::{Duration, SystemTime};

/// How long a frame is waited for that does not come.
const SILENCE: Duration = Duration::from_millis(100);
/// The same for one that comes.
const PATIENCE: Duration = Duration::from_secs(20);

/// A line: what was called, and what it gave; of an error the number's name, which is the same in every C library.
fn tell(what: &str, given: io::Result<impl Debug>) {
    match given {
        Ok(value) => println!("{what}: {value:?}"),
        Err(error) => println!("{what}: {:?}, errno {:?}", error.kind(), error.raw_os_error()),
    }
}

fn frame(id: u16, data: &[u8]) -> CanFrame {
    let id = StandardId::new(id).expect("11 bits");
    CanFrame::Data(CanDataFrame::new(id, data).expect("up to 8 bytes"))
}

/// A frame's parts: identifier, whether it is extended, whether it is remote, length, data.
fn parts(frame: &CanFrame) -> (u32, bool, bool, usize, Vec<u8>) {
    (frame.raw_id(), frame.is_extended(), frame.is_remote_frame(), frame.dlc(), frame.data().to_vec())
}

fn main() -> io::Result<()> {
    let interface = std::env::args().nth(1).unwrap_or_default();
    tell("no interface", CanSocket::open("none0").map(drop));
    let (one, other) = (CanSocket::open(&interface)?, CanSocket::open(&interface)?);

    let extended = ExtendedId::new(0x1234_5678).expect("29 bits");
    let sent = [
        frame(0x123, &[1, 2, 3]),
        frame(0x7FF, &[]),
        CanFrame::Data(CanDataFrame::new(extended, &[9; 8]).expect("8 bytes")),
        CanFrame::Remote(CanRemoteFrame::new_remote(extended, 4).expect("a length up to 8")),
    ];
    for frame in &sent {
        tell("write", one.write_frame(frame));
        tell("read", other.read_frame_timeout(PATIENCE).map(|frame| parts(&frame)));
    }
    tell("nothing to read", one.read_frame_timeout(SILENCE));
    one.set_nonblocking(true)?;
    tell("nothing to read without waiting", one.read_frame());
    one.set_nonblocking(false)?;
    one.set_read_timeout(SILENCE)?;
    tell("nothing to read with a time-out of the socket", one.read_frame());

    other.set_filters(&[CanFilter::new(0x120, 0x7F0), CanFilter::new_inverted(0x400, 0x400)])?;
    for id in [0x12F, 0x430, 0x3FF] {
        one.write_frame(&frame(id, &[]))?;
    }
    for _ in 0..3 {
        let passed = other.read_frame_timeout(SILENCE).map(|frame| frame.raw_id());
        tell("of 12F, 430 and 3FF pass", passed);
    }
    other.set_filter_drop_all()?;
    one.write_frame(&frame(0x123, &[]))?;
    tell("without a filter", other.read_frame_timeout(SILENCE));
    other.set_filter_accept_all()?;

    tell("loopback", one.loopback());
    tell("own messages", one.recv_own_msgs());
    one.set_recv_own_msgs(true)?;
    tell("own messages", one.recv_own_msgs());
    one.write_frame(&frame(0x124, &[7]))?;
    tell("an own one", one.read_frame_timeout(PATIENCE).map(|frame| parts(&frame)));
    one.set_loopback(false)?;
    one.write_frame(&frame(0x125, &[]))?;
    tell("the other had 124", other.read_frame_timeout(PATIENCE).map(|frame| frame.raw_id()));
    tell("and not 125", other.read_frame_timeout(SILENCE));
    one.set_loopback(true)?;
    tell("error filter", one.set_error_filter(0x44).and_then(|()| one.error_filter()));
    tell("join filters", one.set_join_filters(true).and_then(|()| one.join_filters()));

    other.set_recv_timestamp(true)?;
    let began = SystemTime::now();
    one.write_frame(&frame(0x126, &[]))?;
    let stamped = other.read_frame_with_timestamp().map(|(frame, stamp)| {
        let now = SystemTime::now();
        (frame.raw_id(), began <= stamp && stamp <= now)
    });
    tell("with a stamp of between", stamped);

    tell("a socket for CAN FD", CanFdSocket::open(&interface).map(drop));

    // A thread answers while this one waits.
    let answering = thread::spawn(move || {
        for _ in 0..50 {
            let asked = other.read_frame_timeout(PATIENCE)?;
            other.write_frame(&frame(0x3B1, asked.data()))?;
        }
        io::Result::Ok(())
    });
    one.set_recv_own_msgs(false)?;
    // The own one of 126.
    while one.read_frame_timeout(SILENCE).is_ok() {}
    let mut answers = 0;
    for number in 0..50 {
        one.write_frame(&frame(0x3B0, &[number]))?;
        answers += u32::from(one.read_frame_timeout(PATIENCE)?.data() == [number]);
    }
    tell("answers of a thread", Ok(answers));
    tell("the thread", answering.join().map_err(|_| io::Error::other("it panicked"))?);
    Ok(())
}
