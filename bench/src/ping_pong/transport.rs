//! Transport of ping and pong: a bus, waited for as the controller waits, or a bare pair of sockets with blocking reads.

use protocol::bus::{Bus, Received};
use protocol::can::{CAN_FRAME_BYTES, CanFrame};
use rustix::io::Errno;
use rustix::net::sockopt::{Timeout, set_socket_timeout};
use rustix::net::{RecvFlags, SendFlags, recv, send};
use std::os::fd::OwnedFd;
use std::time::Duration;

/// The other end has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Disconnected;

/// A transport of 16-byte frames between two processes.
pub(super) trait FrameTransport {
    /// Sends a frame; false when it was dropped.
    fn send(&mut self, frame: &CanFrame) -> bool;

    /// Waits for frames for a while and passes each on, with its arrival in ns of CLOCK_MONOTONIC where that is known.
    fn wait(&mut self, take: &mut dyn FnMut(&CanFrame, Option<u64>)) -> Result<(), Disconnected>;

    fn is_up(&self) -> bool;
}

/// Longest wait, as of the controller.
pub(super) const LONGEST_WAIT: Duration = Duration::from_millis(20);

/// A bus: poll, then a batch with `recvmmsg`, as the controller does.
pub(super) struct BusTransport(pub(super) Box<dyn Bus>);

impl FrameTransport for BusTransport {
    fn send(&mut self, frame: &CanFrame) -> bool {
        self.0.send(frame).is_ok()
    }

    fn wait(&mut self, take: &mut dyn FnMut(&CanFrame, Option<u64>)) -> Result<(), Disconnected> {
        self.0.wait_readable(LONGEST_WAIT);
        while let Received::Frame(frame, stamp_ns) = self.0.receive() {
            take(&frame, Some(stamp_ns));
        }
        Ok(())
    }

    fn is_up(&self) -> bool {
        self.0.is_up()
    }
}

/// One end of a pair of SEQPACKET sockets with blocking reads.
pub(super) struct SocketTransport(OwnedFd);

impl SocketTransport {
    pub(super) fn new(socket: OwnedFd) -> rustix::io::Result<Self> {
        set_socket_timeout(&socket, Timeout::Recv, Some(LONGEST_WAIT))?;
        Ok(Self(socket))
    }
}

impl FrameTransport for SocketTransport {
    fn send(&mut self, frame: &CanFrame) -> bool {
        send(&self.0, &frame.to_bytes(), SendFlags::NOSIGNAL).is_ok()
    }

    fn wait(&mut self, take: &mut dyn FnMut(&CanFrame, Option<u64>)) -> Result<(), Disconnected> {
        let mut bytes = [0; CAN_FRAME_BYTES];
        match recv(&self.0, &mut bytes, RecvFlags::empty()) {
            Ok((CAN_FRAME_BYTES, _)) => {
                if let Some(frame) = CanFrame::from_bytes(&bytes) {
                    take(&frame, None);
                }
                Ok(())
            }
            Ok((0, _)) | Err(Errno::CONNRESET | Errno::PIPE) => Err(Disconnected),
            _ => Ok(()),
        }
    }

    fn is_up(&self) -> bool {
        true
    }
}
