//! `socket`, `bind`, `connect`, `getsockname`, and the calls that CAN sockets do not support.
//!
//! Source: Linux 6.1 `net/can/af_can.c` (`can_create`), `net/can/raw.c` (`raw_bind`, `raw_getname`, `raw_ops`), `net/can/bcm.c`
//! (`bcm_connect`, `bcm_ops`).

use crate::abi::{self, CAN_BCM, CAN_ISOTP, CAN_PROTOCOLS, CAN_RAW};
use crate::bcm::BroadcastManager;
use crate::caller::Caller;
use crate::notification::{Answer, Notification};
use crate::raw::RawOptions;
use crate::socket::{self, Kind};
use crate::supervisor::{Supervisor, inode_of};
use crate::transport::Transport;
use rustix::io::Errno;
use std::io;
use std::os::fd::AsFd;

const UNSUPPORTED_PROTOCOLS: [(i32, &str); 4] =
    [(3, "CAN_TP16"), (4, "CAN_TP20"), (5, "CAN_MCNET"), (7, "CAN_J1939")];

impl Supervisor {
    /// `socket(AF_CAN, type, protocol)`.
    pub(crate) fn make_socket(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let (kind_and_flags, protocol) = (notification.int(1), notification.int(2));
        let flags = libc::SOCK_CLOEXEC | libc::SOCK_NONBLOCK;
        let kind = kind_and_flags & 0xF;
        if kind_and_flags & !(flags | 0xF) != 0 || !(0..CAN_PROTOCOLS).contains(&protocol) {
            return Err(Errno::INVAL);
        }
        let (expected, socket_kind) = match protocol {
            CAN_RAW => (libc::SOCK_RAW, Kind::Raw(RawOptions::default())),
            CAN_BCM => (libc::SOCK_DGRAM, Kind::Bcm(Box::<BroadcastManager>::default())),
            CAN_ISOTP => (libc::SOCK_DGRAM, Kind::Transport(Box::<Transport>::default())),
            other => {
                if let Some((_, name)) = UNSUPPORTED_PROTOCOLS.iter().find(|(number, _)| *number == other) {
                    self.warn_once(&format!(
                        "socket: {name} is not served; the call fails with EPROTONOSUPPORT"
                    ));
                }
                return Err(Errno::PROTONOSUPPORT);
            }
        };
        if kind != expected {
            return Err(Errno::PROTOTYPE);
        }
        let injected = self.inject_socket(notification, socket_kind, kind_and_flags);
        injected.map_err(|error| Errno::from_io_error(&error).unwrap_or(Errno::NOMEM))?;
        Ok(Answer::Deferred)
    }

    fn inject_socket(&mut self, notification: &Notification, kind: Kind, flags: i32) -> io::Result<()> {
        let non_blocking = flags & libc::SOCK_NONBLOCK != 0;
        let (socket, guest_end) = socket::make(kind, non_blocking, &self.accounting)?;
        let inode = inode_of(guest_end.as_fd()).ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
        self.add_socket(inode, socket)?;
        // The guest may use it at once, so it is registered before.
        let injected =
            self.listener.inject(notification.id, guest_end.as_fd(), flags & libc::SOCK_CLOEXEC != 0);
        if injected.is_err() {
            self.remove_socket(inode);
        }
        injected
    }

    /// `bind`: to an interface, or with index 0 to any.
    pub(crate) fn bind(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        if self.sockets.get(&inode).is_some_and(|socket| socket.transport().is_some()) {
            return self.bind_transport(notification, inode);
        }
        let interface = self.read_interface(notification)?;
        let Some(socket) = self.sockets.get_mut(&inode) else { return Ok(Answer::Continue) };
        if socket.raw().is_none() {
            return Err(Errno::OPNOTSUPP);
        }
        if socket.interface == Some(interface) {
            return Ok(Answer::Value(0));
        }
        let is_down = match self.interfaces.iter().find(|known| known.index == interface) {
            Some(known) => !known.is_up,
            None if interface == 0 => false,
            None => return Err(Errno::NODEV),
        };
        socket.interface = Some(interface);
        if is_down {
            self.deliver_error(inode, interface, Errno::NETDOWN);
        }
        Ok(Answer::Value(0))
    }

    /// `connect`, which binds a broadcast manager; raw sockets do not support it.
    pub(crate) fn connect(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        let interface = self.read_interface(notification);
        let Some(socket) = self.sockets.get_mut(&inode) else { return Ok(Answer::Continue) };
        if !matches!(socket.kind, Kind::Bcm(_)) {
            return Err(Errno::OPNOTSUPP);
        }
        let interface = interface?;
        if socket.interface.is_some() {
            return Err(Errno::ISCONN);
        }
        if interface != 0 && !self.interfaces.iter().any(|known| known.index == interface) {
            return Err(Errno::NODEV);
        }
        socket.interface = Some(interface);
        Ok(Answer::Value(0))
    }

    /// The interface in the address of `bind(fd, address, length)`.
    fn read_interface(&self, notification: &Notification) -> Result<u32, Errno> {
        if notification.int(2) < abi::ADDRESS_BYTES as i32 {
            return Err(Errno::INVAL);
        }
        let address: [u8; abi::ADDRESS_BYTES] =
            Caller::new(notification.thread).read_array(notification.arguments[1])?;
        self.listener.check_alive(notification.id)?;
        abi::interface_of(&address).ok_or(Errno::INVAL)
    }

    /// `getsockname(fd, address, length)`.
    pub(crate) fn get_name(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        let Some(socket) = self.sockets.get(&inode) else { return Ok(Answer::Continue) };
        let interface = socket.interface.unwrap_or(0);
        let address = match &socket.kind {
            Kind::Raw(_) => abi::address(interface).to_vec(),
            Kind::Transport(transport) => transport.address(interface).to_vec(),
            Kind::Bcm(_) => return Err(Errno::OPNOTSUPP),
        };
        let [_, at, length_at, ..] = notification.arguments;
        let caller = Caller::new(notification.thread);
        let room = caller.read_room(length_at)?;
        self.listener.check_alive(notification.id)?;
        caller.write_address((at, length_at), room, &address)?;
        Ok(Answer::Value(0))
    }

    /// Calls of connected sockets.
    pub(crate) fn unsupported(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        match self.guest_socket(notification) {
            Some(_) => Err(Errno::OPNOTSUPP),
            None => Ok(Answer::Continue),
        }
    }
}
