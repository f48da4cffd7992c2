//! `recvmsg`, `recvmmsg` and `recvfrom` with an address: a message with the metadata that the kernel would return.
//!
//! The message is taken from the guest's end by a copy of its descriptor, so that the order with native reads is kept, and
//! written into the guest's memory with the address of the interface, the flags, the control messages of the kernel (time
//! stamps) and the count of lost frames. A call that would block is kept and tried again after a delivery; a message whose call
//! a signal ended goes to the next call.

#![allow(unsafe_code)] // recvmsg, nothing else

use crate::abi::{self, u32_at, u64_at};
use crate::caller::Caller;
use crate::isotp::LONGEST_PDU;
use crate::notification::{Answer, Notification};
use crate::socket::{GuestSocket, MessageMetadata};
use crate::supervisor::Supervisor;
use crate::transport;
use rustix::fs::{OFlags, fcntl_getfl};
use rustix::io::Errno;
use rustix::net::sockopt::{Timeout, socket_timeout};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::time::Instant;

/// `sizeof(struct msghdr)` and `sizeof(struct mmsghdr)`, and the offset of the length in the latter.
const HEADER_BYTES: usize = 56;
const LONG_HEADER_BYTES: u64 = 64;
/// Longest message of a guest, one of the transport protocol, and some bytes more to detect longer ones.
pub(crate) const LONGEST_MESSAGE: usize = LONGEST_PDU + 48;
/// The same for other protocols: a message of the broadcast manager.
pub(crate) const LONGEST_OTHER: usize = 8192;
/// Flags that a transport socket accepts.
const TRANSPORT_FLAGS: i32 = libc::MSG_DONTWAIT | libc::MSG_TRUNC | libc::MSG_PEEK;
/// Capacity for the kernel's control messages.
const CONTROL_WORDS: usize = 32;
/// `sizeof(struct cmsghdr)`.
const CONTROL_HEADER_BYTES: usize = 16;
/// Most parts of a buffer, and most messages of a call: the kernel's limits.
const MOST_PARTS: u64 = 1024;

/// A message taken from a guest's queue.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    bytes: Vec<u8>,
    /// Control messages of the kernel: time stamps.
    control: Vec<u8>,
    metadata: MessageMetadata,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct WaitingCall {
    pub(crate) notification: Notification,
    /// Deadline by its socket's time-out.
    pub(crate) deadline: Option<Instant>,
}

/// The parts of a guest's `struct msghdr`.
pub(crate) struct Header {
    pub(crate) name: u64,
    pub(crate) name_bytes: i32,
    parts: Vec<(u64, usize)>,
    control: u64,
    control_bytes: usize,
}

impl Header {
    /// Reads one at an address.
    ///
    /// # Errors
    /// `EFAULT`, or `EMSGSIZE` for too many parts.
    pub(crate) fn read(caller: Caller, address: u64) -> Result<Self, Errno> {
        let header: [u8; HEADER_BYTES] = caller.read_array(address)?;
        let count = u64_at(&header, 24);
        if count > MOST_PARTS {
            return Err(Errno::MSGSIZE);
        }
        let mut bytes = vec![0; count as usize * 16];
        caller.read(u64_at(&header, 16), &mut bytes)?;
        let part = |part: &[u8]| (u64_at(part, 0), u64_at(part, 8) as usize);
        Ok(Self {
            name: u64_at(&header, 0),
            name_bytes: u32_at(&header, 8) as i32,
            parts: bytes.chunks_exact(16).map(part).collect(),
            control: u64_at(&header, 32),
            control_bytes: u64_at(&header, 40) as usize,
        })
    }

    /// The joined content of the parts, up to the longest message.
    ///
    /// # Errors
    /// `EFAULT`.
    pub(crate) fn gather(&self, caller: Caller) -> Result<Vec<u8>, Errno> {
        let mut bytes = Vec::new();
        for (address, length) in &self.parts {
            let more = (*length).min(LONGEST_MESSAGE - bytes.len());
            let from = bytes.len();
            bytes.resize(from + more, 0);
            caller.read(*address, &mut bytes[from..])?;
        }
        Ok(bytes)
    }

    /// Distributes bytes over the parts; the excess is dropped.
    ///
    /// # Errors
    /// `EFAULT`.
    pub(crate) fn scatter(&self, caller: Caller, mut bytes: &[u8]) -> Result<(), Errno> {
        for (address, length) in &self.parts {
            let (here, rest) = bytes.split_at(bytes.len().min(*length));
            caller.write(*address, here)?;
            bytes = rest;
        }
        Ok(())
    }

    /// Writes the address of the sender, if it is asked for; the header is at `at`.
    ///
    /// # Errors
    /// `EFAULT`, or `EINVAL` for a negative length.
    pub(crate) fn write_name(&self, caller: Caller, at: u64, address: &[u8]) -> Result<(), Errno> {
        if self.name == 0 {
            return Ok(());
        }
        let room = usize::try_from(self.name_bytes).map_err(|_| Errno::INVAL)?;
        caller.write_address((self.name, at + 8), room, address)
    }

    /// Capacity of the parts, bytes.
    pub(crate) fn room(&self) -> usize {
        self.parts.iter().fold(0, |sum, (_, length)| sum.saturating_add(*length))
    }
}

impl Supervisor {
    /// Answers a receiving call on a guest's socket.
    pub(crate) fn receive(&mut self, notification: &Notification) -> Answer {
        let Some((inode, end)) = self.guest_socket(notification) else {
            let links = !self.link_requests.is_empty();
            return links.then(|| self.receive_links(notification)).flatten().unwrap_or(Answer::Continue);
        };
        match self.try_to_receive(notification, inode, end.as_fd()) {
            Answer::Error(Errno::AGAIN) if may_wait(notification, end.as_fd()) => {
                let timeout = socket_timeout(&end, Timeout::Recv).ok().flatten();
                let deadline = timeout.map(|timeout| Instant::now() + timeout);
                let waiting = WaitingCall { notification: *notification, deadline };
                self.sockets.get_mut(&inode).expect("it is there").waiting.push_back(waiting);
                self.waiting_calls += 1;
                Answer::Deferred
            }
            answer => answer,
        }
    }

    /// Retries the calls that wait for a message of this socket, in order.
    pub(crate) fn serve_waiting(&mut self, inode: u64) {
        while let Some(call) = self.sockets.get_mut(&inode).and_then(|socket| socket.waiting.pop_front()) {
            self.waiting_calls -= 1;
            // A call that a signal ended is repeated by its caller.
            if !self.listener.is_alive(call.notification.id) {
                continue;
            }
            // The number may stand for another descriptor by now, as after a close by another thread.
            let answer = match self.find_socket(&call.notification) {
                Some((found, end)) if found == inode => {
                    self.try_to_receive(&call.notification, inode, end.as_fd())
                }
                _ => Answer::Error(Errno::BADF),
            };
            if answer == Answer::Error(Errno::AGAIN) {
                self.sockets.get_mut(&inode).expect("it is there").waiting.push_front(call);
                self.waiting_calls += 1;
                return;
            }
            self.listener.answer(call.notification.id, answer);
        }
    }

    /// Answers the call when there is a message; `EAGAIN` otherwise.
    fn try_to_receive(&mut self, notification: &Notification, inode: u64, end: BorrowedFd<'_>) -> Answer {
        let Some(socket) = self.sockets.get_mut(&inode) else { return Answer::Continue };
        let mut flags = notification.int(flags_at(notification));
        if notification.call == libc::SYS_recvmmsg {
            // The kernel clears it in `do_recvmmsg`.
            flags &= !libc::MSG_WAITFORONE;
        }
        if let Some(transport) = socket.transport() {
            if flags & !TRANSPORT_FLAGS != 0 {
                return Answer::Error(Errno::INVAL);
            }
            if transport.protocol.identifiers.is_none() {
                return Answer::Error(Errno::ADDRNOTAVAIL);
            }
        }
        if flags & libc::MSG_ERRQUEUE != 0 {
            return Answer::Error(Errno::AGAIN);
        }
        if !self.listener.is_alive(notification.id) {
            return Answer::Error(Errno::INTR);
        }
        let caller = Caller::new(notification.thread);
        let mut taken = Vec::new();
        let answer = match notification.call {
            libc::SYS_recvmmsg => receive_many(socket, caller, notification, end, flags, &mut taken),
            libc::SYS_recvmsg => {
                receive_one(socket, caller, notification.arguments[1], end, flags, &mut taken)
            }
            _ => receive_from(socket, caller, notification, end, flags, &mut taken),
        };
        let answer = answer.map_or_else(Answer::Error, |value| Answer::Value(value as i64));
        if answer != Answer::Error(Errno::AGAIN) {
            let answered = self.listener.answer(notification.id, answer);
            if !answered && flags & libc::MSG_PEEK == 0 {
                taken.into_iter().rev().for_each(|message| socket.returned.push_front(message));
            }
            return Answer::Deferred;
        }
        answer
    }
}

fn flags_at(notification: &Notification) -> usize {
    if notification.call == libc::SYS_recvmsg { 2 } else { 3 }
}

fn may_wait(notification: &Notification, end: BorrowedFd<'_>) -> bool {
    let flags = notification.int(flags_at(notification));
    flags & (libc::MSG_DONTWAIT | libc::MSG_ERRQUEUE) == 0 && blocks(end)
}

/// Whether calls on a descriptor block.
pub(crate) fn blocks(end: BorrowedFd<'_>) -> bool {
    fcntl_getfl(end).is_ok_and(|flags| !flags.contains(OFlags::NONBLOCK))
}

/// `recvfrom(fd, buffer, length, flags, address, address length)`.
fn receive_from(
    socket: &mut GuestSocket,
    caller: Caller,
    notification: &Notification,
    end: BorrowedFd<'_>,
    flags: i32,
    taken: &mut Vec<Message>,
) -> Result<usize, Errno> {
    let [_, buffer, length, _, name, name_length] = notification.arguments;
    let room = caller.read_room(name_length)?;
    let message = take(socket, end, flags)?;
    let bytes = &message.bytes[..message.bytes.len().min(length as usize)];
    caller.write(buffer, bytes)?;
    caller.write_address((name, name_length), room, &sender(socket, &message))?;
    let length = reported_length(socket, flags, bytes.len(), &message);
    taken.push(message);
    Ok(length)
}

/// The source address of a message: its interface, and for the transport protocol zeros.
fn sender(socket: &GuestSocket, message: &Message) -> Vec<u8> {
    let mut address = abi::address(message.metadata.interface).to_vec();
    if socket.transport().is_some() {
        address.resize(transport::ADDRESS_BYTES, 0);
    }
    address
}

/// Return value of a call that put `length` bytes into the buffer; with `MSG_TRUNC` the transport protocol returns the whole
/// length.
fn reported_length(socket: &GuestSocket, flags: i32, length: usize, message: &Message) -> usize {
    let whole = flags & libc::MSG_TRUNC != 0 && socket.transport().is_some();
    if whole { message.bytes.len() } else { length }
}

/// Writes one message into the `struct msghdr` at an address.
fn receive_one(
    socket: &mut GuestSocket,
    caller: Caller,
    header_at: u64,
    end: BorrowedFd<'_>,
    flags: i32,
    taken: &mut Vec<Message>,
) -> Result<usize, Errno> {
    let header = Header::read(caller, header_at)?;
    let message = take(socket, end, flags)?;
    let length = message.bytes.len().min(header.room());
    header.scatter(caller, &message.bytes[..length])?;
    let mut out_flags = message.metadata.flags as i32 | flags & libc::MSG_CMSG_CLOEXEC;
    if length < message.bytes.len() {
        out_flags |= libc::MSG_TRUNC;
    }
    header.write_name(caller, header_at, &sender(socket, &message))?;
    let mut control = message.control.clone();
    if socket.reports_dropped && message.metadata.dropped != 0 {
        control.extend(overflow_message(message.metadata.dropped));
    }
    if control.len() > header.control_bytes {
        control.truncate(header.control_bytes);
        out_flags |= libc::MSG_CTRUNC;
    }
    caller.write(header.control, &control)?;
    caller.write(header_at + 40, &(control.len() as u64).to_ne_bytes())?;
    caller.write(header_at + 48, &out_flags.to_ne_bytes())?;
    let length = reported_length(socket, flags, length, &message);
    taken.push(message);
    Ok(length)
}

/// Writes the available messages into the `struct mmsghdr`s at an address; returns their number. It does not wait for more when
/// it has one, as with `MSG_WAITFORONE`.
fn receive_many(
    socket: &mut GuestSocket,
    caller: Caller,
    notification: &Notification,
    end: BorrowedFd<'_>,
    flags: i32,
    taken: &mut Vec<Message>,
) -> Result<usize, Errno> {
    let [_, headers, count, ..] = notification.arguments;
    let mut received = 0;
    for number in 0..count.min(MOST_PARTS) {
        let header_at = headers + number * LONG_HEADER_BYTES;
        match receive_one(socket, caller, header_at, end, flags, taken) {
            Ok(length) => {
                caller.write(header_at + HEADER_BYTES as u64, &(length as u32).to_ne_bytes())?;
                received += 1;
            }
            Err(error) if received == 0 => return Err(error),
            Err(_) => break,
        }
    }
    Ok(received)
}

/// `SO_RXQ_OVFL` in the form of the kernel.
fn overflow_message(dropped: u32) -> Vec<u8> {
    let mut message = Vec::with_capacity(24);
    message.extend((CONTROL_HEADER_BYTES + 4).to_ne_bytes());
    message.extend(libc::SOL_SOCKET.to_ne_bytes());
    message.extend(libc::SO_RXQ_OVFL.to_ne_bytes());
    message.extend(dropped.to_ne_bytes());
    message.extend([0; 4]); // the next would be aligned
    message
}

/// The next message of a guest's queue, without blocking.
fn take(socket: &mut GuestSocket, end: BorrowedFd<'_>, flags: i32) -> Result<Message, Errno> {
    let peeks = flags & libc::MSG_PEEK != 0;
    let returned = if peeks { socket.returned.front().cloned() } else { socket.returned.pop_front() };
    if let Some(message) = returned {
        return Ok(message);
    }
    let metadata = socket.next_metadata();
    let room = if socket.transport().is_some() { LONGEST_MESSAGE } else { LONGEST_OTHER };
    let (bytes, control) = take_bytes(end, room, flags & libc::MSG_PEEK)?;
    if bytes.is_empty() {
        if peeks {
            // An error is reported once.
            let _ = take_bytes(end, room, 0);
        }
        return Err(metadata.and_then(|metadata| metadata.error).unwrap_or(Errno::NETDOWN));
    }
    let unknown = MessageMetadata::new(socket.interface.unwrap_or(0), 0);
    Ok(Message { bytes, control, metadata: metadata.unwrap_or(unknown) })
}

/// A message with its control messages of the kernel.
fn take_bytes(end: BorrowedFd<'_>, room: usize, peek: i32) -> Result<(Vec<u8>, Vec<u8>), Errno> {
    let mut bytes = vec![0_u8; room];
    let mut control = [0_u64; CONTROL_WORDS];
    let mut part = libc::iovec { iov_base: bytes.as_mut_ptr().cast(), iov_len: bytes.len() };
    // SAFETY: a plain C structure for which all zeros is a valid value.
    let mut header: libc::msghdr = unsafe { std::mem::zeroed() };
    header.msg_iov = &raw mut part;
    header.msg_iovlen = 1;
    header.msg_control = control.as_mut_ptr().cast();
    header.msg_controllen = size_of_val(&control);
    // SAFETY: the header points to a part and a control buffer that outlive the call and have the sizes given.
    let received = unsafe { libc::recvmsg(end.as_raw_fd(), &raw mut header, libc::MSG_DONTWAIT | peek) };
    let Ok(received) = usize::try_from(received) else {
        return Err(Errno::from_io_error(&io::Error::last_os_error()).unwrap_or(Errno::IO));
    };
    bytes.truncate(received);
    let words = control.iter().flat_map(|word| word.to_ne_bytes());
    Ok((bytes, words.take(header.msg_controllen).collect()))
}
