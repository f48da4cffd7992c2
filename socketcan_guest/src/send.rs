//! Messages from a guest: written natively, or by a call with an address or with a length other than that of a frame.
//!
//! A frame goes to the bus, and then, unless the socket has switched that off, to all other sockets of guests on the interface.
//! A native write has already been accepted; if the kernel would have refused it, a warning goes to standard error.

use crate::abi::{self, MOST_DATA, identifier};
use crate::bcm::Action;
use crate::bus_peer::{FrameBytes, SendResult};
use crate::caller::Caller;
use crate::notification::{Answer, Notification};
use crate::receive::{Header, LONGEST_MESSAGE, LONGEST_OTHER, blocks};
use crate::socket::{Kind, MessageMetadata};
use crate::supervisor::{Supervisor, wall_clock_ns};
use crate::transport::SendingCall;
use rustix::io::Errno;
use rustix::net::{RecvFlags, recv};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;

/// Most messages taken from a guest in one turn.
const BATCH: usize = 16;
/// Most batches taken before a call is answered: more than a queue holds.
const BATCHES: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FrameOrigin {
    /// Received from the bus.
    Bus,
    /// Sent by the socket of a guest with this inode.
    Guest(u64),
}

impl Supervisor {
    /// `write` of a length other than a frame's. The kernel checks the interface before the length.
    pub(crate) fn write(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        self.send_bytes_at(notification, inode, end.as_fd(), None)
    }

    /// `sendto(fd, buffer, length, flags, address, address length)`.
    pub(crate) fn send_to(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, end)) = self.guest_socket(notification) else {
            self.note_link_request(notification);
            return Ok(Answer::Continue);
        };
        let [.., name, name_length] = notification.arguments;
        let name = (name != 0).then_some((name, name_length as i32));
        self.send_bytes_at(notification, inode, end.as_fd(), name)
    }

    fn send_bytes_at(
        &mut self,
        notification: &Notification,
        inode: u64,
        end: BorrowedFd<'_>,
        name: Option<(u64, i32)>,
    ) -> Result<Answer, Errno> {
        let [_, buffer, length, ..] = notification.arguments;
        let caller = Caller::new(notification.thread);
        let mut bytes = vec![0; (length as usize).min(LONGEST_MESSAGE)];
        caller.read(buffer, &mut bytes)?;
        let name = read_name(caller, name)?;
        self.listener.check_alive(notification.id)?;
        let value = bytes.len() as i64;
        if self.is_transport(inode) {
            // The destination is set by `bind`, whatever address is given.
            return self.send_transport(inode, end, bytes, sending_call(notification, end, value));
        }
        self.send(inode, name.as_deref(), &bytes)?;
        Ok(Answer::Value(value))
    }

    fn is_transport(&self, inode: u64) -> bool {
        self.sockets.get(&inode).is_some_and(|socket| socket.transport().is_some())
    }

    /// `sendmsg` and `sendmmsg`.
    pub(crate) fn send_message(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, end)) = self.guest_socket(notification) else {
            self.note_link_request(notification);
            return Ok(Answer::Continue);
        };
        let caller = Caller::new(notification.thread);
        let at = notification.arguments[1];
        if self.is_transport(inode) {
            return self.send_transport_message(notification, inode, end.as_fd());
        }
        if notification.call == libc::SYS_sendmsg {
            let length = self.send_one(notification, inode, caller, at)?;
            return Ok(Answer::Value(length as i64));
        }
        let mut count = 0;
        for number in 0..notification.arguments[2].min(1024) {
            let at = at + number * 64;
            let sent = self
                .send_one(notification, inode, caller, at)
                .and_then(|length| caller.write(at + 56, &(length as u32).to_ne_bytes()));
            match sent {
                Ok(()) => count += 1,
                Err(error) if count == 0 => return Err(error),
                Err(_) => break,
            }
        }
        Ok(Answer::Value(count))
    }

    fn send_one(
        &mut self,
        notification: &Notification,
        inode: u64,
        caller: Caller,
        at: u64,
    ) -> Result<usize, Errno> {
        let header = Header::read(caller, at)?;
        let bytes = header.gather(caller)?;
        let name = read_name(caller, (header.name != 0).then_some((header.name, header.name_bytes)))?;
        self.listener.check_alive(notification.id)?;
        self.send(inode, name.as_deref(), &bytes)?;
        Ok(bytes.len())
    }

    /// Sends the first of several, as a call does that was interrupted.
    fn send_transport_message(
        &mut self,
        notification: &Notification,
        inode: u64,
        end: BorrowedFd<'_>,
    ) -> Result<Answer, Errno> {
        let caller = Caller::new(notification.thread);
        let at = notification.arguments[1];
        let is_one = notification.call == libc::SYS_sendmsg;
        if !is_one && notification.int(2) == 0 {
            return Ok(Answer::Value(0));
        }
        let bytes = Header::read(caller, at)?.gather(caller)?;
        self.listener.check_alive(notification.id)?;
        if !is_one {
            caller.write(at + 56, &(bytes.len() as u32).to_ne_bytes())?;
        }
        let value = if is_one { bytes.len() as i64 } else { 1 };
        self.send_transport(inode, end, bytes, sending_call(notification, end, value))
    }

    /// Sends for a guest; `name` is the given address.
    fn send(&mut self, inode: u64, name: Option<&[u8]>, bytes: &[u8]) -> Result<(), Errno> {
        let Some(socket) = self.sockets.get_mut(&inode) else { return Err(Errno::BADF) };
        let bound = socket.interface;
        match &mut socket.kind {
            // A frame written before still waits for the bus.
            Kind::Raw(_) if socket.held.is_some() => Err(Errno::NOBUFS),
            Kind::Raw(_) => {
                let interface = match name {
                    Some(name) => abi::interface_of(name).ok_or(Errno::INVAL)?,
                    None => bound.unwrap_or(0),
                };
                self.send_frame(inode, interface, bytes)
            }
            Kind::Bcm(manager) => {
                let bound = bound.ok_or(Errno::NOTCONN)?;
                let interface = match name {
                    Some(name) if bound == 0 => abi::interface_of(name).ok_or(Errno::INVAL)?,
                    _ => bound,
                };
                if interface != 0 && !self.interfaces.iter().any(|known| known.index == interface) {
                    return Err(Errno::NODEV);
                }
                let mut actions = Vec::new();
                manager.command(bytes, interface, Instant::now(), &mut actions)?;
                if let [Action::SendOnce(interface, frame)] = actions[..] {
                    return self.send_frame(inode, interface, &frame);
                }
                self.carry_out(inode, actions);
                Ok(())
            }
            Kind::Transport(_) => self.send_transport_natively(inode, bytes),
        }
    }

    /// Sends a frame of a guest on an interface.
    ///
    /// # Errors
    /// `ENXIO` without an interface, `EINVAL` for anything but a classic frame, `ENETDOWN` without a bus, `ENOBUFS` when the
    /// bus is full.
    pub(crate) fn send_frame(&mut self, inode: u64, interface: u32, bytes: &[u8]) -> Result<(), Errno> {
        let known = self.interfaces.iter_mut().find(|known| known.index == interface);
        let interface = known.ok_or(Errno::NXIO)?;
        let frame: &FrameBytes = bytes.try_into().map_err(|_| Errno::INVAL)?;
        if frame[4] > MOST_DATA {
            return Err(Errno::INVAL);
        }
        match interface.bus.send(frame) {
            SendResult::Accepted => {}
            SendResult::Full => return Err(Errno::NOBUFS),
            SendResult::Down => return Err(Errno::NETDOWN),
        }
        let index = interface.index;
        self.sent += 1;
        let loops_back =
            self.sockets.get(&inode).is_none_or(|socket| socket.raw().is_none_or(|raw| raw.loops_back()));
        if loops_back {
            self.distribute(index, frame, FrameOrigin::Guest(inode));
        }
        Ok(())
    }

    /// Delivers a frame to every guest's socket on the interface whose filters it passes.
    pub(crate) fn distribute(&mut self, interface: u32, frame: &FrameBytes, from: FrameOrigin) {
        let (id, stamp_ns, now) = (identifier(frame), wall_clock_ns(), Instant::now());
        let (mut wanted, mut transported) = (Vec::new(), Vec::new());
        for (inode, socket) in self.sockets.iter_mut().filter(|(_, socket)| socket.listens_on(interface)) {
            let sent_here = from == FrameOrigin::Guest(*inode);
            let mut actions = Vec::new();
            match &mut socket.kind {
                Kind::Raw(raw) => {
                    if !raw.passes(id) || sent_here && !raw.receives_what_it_sends() {
                        continue;
                    }
                    let local = if from == FrameOrigin::Bus { 0 } else { libc::MSG_DONTROUTE };
                    let flags = (local | if sent_here { libc::MSG_CONFIRM } else { 0 }) as u32;
                    socket.deliver(
                        frame,
                        MessageMetadata { interface, flags, dropped: 0, stamp_ns, error: None },
                    );
                }
                Kind::Bcm(manager) => manager.take_frame(interface, frame, now, &mut actions),
                Kind::Transport(_) if sent_here => {}
                Kind::Transport(transport) => {
                    let mut events = Vec::new();
                    let was_sending = transport.protocol.is_sending();
                    transport.protocol.take_frame(frame, now, &mut events);
                    if !events.is_empty() || was_sending && !transport.protocol.is_sending() {
                        transported.push((*inode, events));
                    }
                }
            }
            if !actions.is_empty() || !socket.waiting.is_empty() {
                wanted.push((*inode, actions));
            }
        }
        for (inode, actions) in wanted {
            self.carry_out(inode, actions);
            self.serve_waiting(inode);
        }
        for (inode, events) in transported {
            self.carry_out_transport(inode, events);
        }
    }

    /// Executes the actions of a broadcast manager.
    pub(crate) fn carry_out(&mut self, inode: u64, actions: Vec<Action>) {
        for action in actions {
            match action {
                // As in the kernel: frames that the interface does not accept are lost.
                Action::Send(interface, frame) | Action::SendOnce(interface, frame) => {
                    let _ = self.send_frame(inode, interface, &frame);
                }
                Action::Notify(interface, message) => {
                    self.deliver(inode, &message, MessageMetadata::new(interface, wall_clock_ns()));
                }
            }
        }
    }

    /// Takes all native writes of a guest; true when there is no end of them.
    pub(crate) fn take_all_from(&mut self, inode: u64) -> bool {
        (0..BATCHES).all(|_| self.take_from(inode))
    }

    /// Takes a few native writes of a guest, so that others have their turn; true when there may be more. A frame that the bus
    /// does not accept is held, which fills the queue of the guest.
    pub(crate) fn take_from(&mut self, inode: u64) -> bool {
        for _ in 0..BATCH {
            let Some(socket) = self.sockets.get(&inode).filter(|socket| socket.takes_more()) else {
                return false;
            };
            let (mut short, mut long) = ([0_u8; LONGEST_OTHER], Vec::new());
            let bytes = if socket.transport().is_some() {
                long.resize(LONGEST_MESSAGE, 0);
                &mut long[..]
            } else {
                &mut short[..]
            };
            match recv(socket.as_fd(), &mut *bytes, RecvFlags::DONTWAIT) {
                // A guest that closes the socket with unread frames is reported first, and once.
                Err(Errno::INTR | Errno::CONNRESET) => {}
                Err(Errno::AGAIN) => return false,
                // The end of a message in transfer is awaited, as `close` does in the kernel.
                Ok((_, 0)) | Err(_) if socket.has_more_to_send() => return false,
                Ok((_, 0)) | Err(_) => {
                    self.remove_socket(inode);
                    return false;
                }
                Ok((_, length)) => self.send_native(inode, &bytes[..length]),
            }
        }
        true
    }

    fn send_native(&mut self, inode: u64, bytes: &[u8]) {
        let sent = self.send(inode, None, bytes);
        self.note_native(inode, bytes, sent);
    }

    /// Processes the result of a native write: it is held where the bus is full.
    pub(crate) fn note_native(&mut self, inode: u64, bytes: &[u8], sent: Result<(), Errno>) {
        match sent {
            Err(Errno::NOBUFS) => {
                let socket = self.sockets.get_mut(&inode).expect("it has sent");
                let interface = socket.interface.unwrap_or(0);
                match socket.transport_mut() {
                    Some(transport) => transport.put_back(bytes),
                    None => socket.held = Some(bytes.try_into().expect("a frame")),
                }
                self.watch_socket(inode, false);
                let known = self.interfaces.iter().position(|known| known.index == interface);
                let place = known.expect("its bus has no room");
                let waiting = &mut self.interfaces[place].waiting;
                if !waiting.contains(&inode) {
                    waiting.push(inode);
                }
                self.watch_bus(place);
            }
            Err(error) => {
                self.refused_late += 1;
                self.warn_once(&format!(
                    "a write of {} bytes was accepted and dropped; the kernel answers: {}",
                    bytes.len(),
                    io::Error::from(error)
                ));
            }
            Ok(()) => {}
        }
    }

    /// The bus has room again: held frames are sent.
    pub(crate) fn release_held(&mut self, place: usize) {
        for inode in std::mem::take(&mut self.interfaces[place].waiting) {
            let Some(socket) = self.sockets.get_mut(&inode) else { continue };
            if socket.transport().is_some() {
                self.go_on_transport(inode);
            } else if let Some(frame) = socket.held.take() {
                self.send_native(inode, &frame);
                if self.sockets.get(&inode).is_some_and(|socket| socket.held.is_none()) {
                    self.watch_socket(inode, true);
                }
            }
        }
        self.watch_bus(place);
    }
}

/// A call that sends a message and returns `value` on success.
fn sending_call(notification: &Notification, end: BorrowedFd<'_>, value: i64) -> SendingCall {
    let flags = match notification.call {
        libc::SYS_sendto | libc::SYS_sendmmsg => notification.int(3),
        libc::SYS_sendmsg => notification.int(2),
        _ => 0,
    };
    let may_wait = flags & libc::MSG_DONTWAIT == 0 && blocks(end);
    SendingCall { id: notification.id, value, may_wait }
}

/// The address of a call, as bytes.
fn read_name(caller: Caller, name: Option<(u64, i32)>) -> Result<Option<Vec<u8>>, Errno> {
    let Some((address, length)) = name else { return Ok(None) };
    // At most as long as `struct sockaddr_storage`.
    let length = usize::try_from(length).ok().filter(|length| *length <= 128).ok_or(Errno::INVAL)?;
    let mut bytes = vec![0; length];
    caller.read(address, &mut bytes)?;
    Ok(Some(bytes))
}
