//! The embedded bus as a foreign program sees it: a Unix SEQPACKET socket, packets in and out, nothing checked.
//!
//! The products' own client cannot send what is malformed; this one can.

use crate::process::PATIENCE;
use protocol::bus::control::{Control, Kind, Role};
use protocol::can::CanFrame;
use protocol::frames::Frame;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, Shutdown, SocketAddrUnix, SocketFlags, SocketType, connect, recv,
    send, shutdown, socket_with,
};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::{Duration, Instant};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packet {
    Frame(CanFrame),
    /// A packet of the barrier.
    Control(Control),
    /// The host has gone, or has parted with us.
    Closed,
}

pub struct Peer {
    socket: OwnedFd,
}

impl Peer {
    /// Connects, trying until a host is there.
    pub fn connect(path: &Path) -> Self {
        let flags = SocketFlags::CLOEXEC;
        let until = Instant::now() + PATIENCE;
        loop {
            let socket =
                socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None).expect("a socket");
            match connect(&socket, &SocketAddrUnix::new(path).expect("a path short enough")) {
                Ok(()) => return Self { socket },
                Err(error) => {
                    assert!(Instant::now() < until, "no host at {}: {error}", path.display());
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        }
    }

    pub fn send(&self, packet: &[u8]) {
        send(&self.socket, packet, SendFlags::NOSIGNAL).expect("the host takes the packet");
    }

    /// Sends a frame whose values are in range.
    pub fn send_frame(&self, frame: &Frame) {
        self.send(&frame.encode().expect("in range").to_bytes());
    }

    /// Goes, as a program does that dies: the host sees the end, and so does the next [`Peer::receive`].
    pub fn leave(&self) {
        shutdown(&self.socket, Shutdown::Both).expect("it is connected");
    }

    /// Sends a packet as it is; `false` when there is no host any more.
    pub fn try_send(&self, packet: &[u8]) -> bool {
        send(&self.socket, packet, SendFlags::NOSIGNAL).is_ok()
    }

    /// The next packet; `None` when none comes within `patience`.
    pub fn receive(&self, patience: Duration) -> Option<Packet> {
        let timeout = Timespec::try_from(patience).expect("a short time");
        if poll(&mut [PollFd::new(&self.socket, PollFlags::IN)], Some(&timeout)) == Ok(0) {
            return None;
        }
        let mut bytes = [0; 64];
        let length = match recv(&self.socket, &mut bytes, RecvFlags::empty()) {
            Ok((length, _)) => length,
            Err(rustix::io::Errno::CONNRESET) => 0,
            Err(error) => panic!("the bus cannot be read: {error}"),
        };
        let bytes = &bytes[..length];
        if bytes.is_empty() {
            return Some(Packet::Closed);
        }
        if let Some(control) = Control::from_bytes(bytes) {
            return Some(Packet::Control(control));
        }
        let frame = bytes.try_into().ok().and_then(CanFrame::from_bytes);
        Some(Packet::Frame(frame.unwrap_or_else(|| panic!("the host sent {bytes:02X?}"))))
    }

    pub fn frames_to_the_end(&self) -> Vec<CanFrame> {
        let mut frames = Vec::new();
        loop {
            match self.receive(PATIENCE) {
                Some(Packet::Frame(frame)) => frames.push(frame),
                Some(Packet::Control(_)) => {}
                Some(Packet::Closed) => return frames,
                None => panic!("the bus is silent after {} frames, and there", frames.len()),
            }
        }
    }

    /// Takes part in the lockstep barrier as a console that says something in some cycles.
    pub fn be_console(&self, mut say: impl FnMut(u32) -> Option<Frame>) {
        self.take_part("console", |peer, cycle, _| {
            say(cycle).iter().for_each(|frame| peer.send_frame(frame))
        });
    }

    /// Takes part in the lockstep barrier until the host goes: `act` is given the cycle and its frames, and sends through the
    /// peer what it likes before the member is done.
    pub fn take_part(&self, name: &str, mut act: impl FnMut(&Self, u32, &[CanFrame])) {
        self.send(&Control::named(Kind::Join(Role::Member), 0, name).to_bytes());
        let mut frames = Vec::new();
        loop {
            match self.receive(PATIENCE).expect("the barrier goes on") {
                Packet::Frame(frame) => frames.push(frame),
                Packet::Control(control) => {
                    act(self, control.cycle, &frames);
                    frames.clear();
                    let done = Control::new(Kind::Done, control.cycle).to_bytes();
                    // The host may have gone since: the next receive shows it.
                    let _ = send(&self.socket, &done, SendFlags::NOSIGNAL);
                }
                Packet::Closed => return,
            }
        }
    }
}
