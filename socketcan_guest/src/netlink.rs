//! The list of interfaces by rtnetlink, as requested by `ip link`, `getifaddrs`, `if_nameindex` and Go's `net`.
//!
//! Such a request goes to the kernel; the supervisor reads its answer, inserts the interfaces of the guests before the end of a
//! list, and replaces the error about an unknown interface. A datagram has several complete messages, each a `struct nlmsghdr`
//! and its payload.
//!
//! ```text
//!   offset  0       4     6      8         12    16
//!           length  type  flags  sequence  port  struct ifinfomsg (16 bytes), attributes
//! ```
//!
//! Source: `netlink(7)`, `rtnetlink(7)`; Linux `include/uapi/linux/if_link.h`.

#![allow(unsafe_code)] // recvfrom, nothing else

use crate::abi::u32_at;
use crate::caller::Caller;
use crate::interface::Interface;
use crate::notification::{Answer, Notification};
use crate::receive::Header;
use crate::supervisor::{Supervisor, inode_of};
use rustix::io::Errno;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};

/// `sizeof(struct nlmsghdr)` and of `struct ifinfomsg`.
const HEADER: usize = 16;
const INFO: usize = 16;

/// Types of messages.
const ERROR: u16 = 2;
const DONE: u16 = 3;
const NEW_LINK: u16 = 16;
const GET_LINK: u16 = 18;
/// `NLM_F_DUMP`: the whole list. `NLM_F_MULTI`: one message of several.
const DUMP: u16 = 0x300;
const MULTI: u16 = 2;

/// Attributes of a link.
const MTU: u16 = 4;
const NAME: u16 = 3;
const QUEUEING: u16 = 6;
const QUEUE_LENGTH: u16 = 13;
const STATE: u16 = 16;
const LINK_MODE: u16 = 17;
const LINK_INFO: u16 = 18;
const GROUP: u16 = 27;
const ALTERNATIVE_NAME: u16 = 53;
/// Within `LINK_INFO`.
const KIND: u16 = 1;

/// `IFF_LOWER_UP`.
const LOWER_UP: u32 = 0x1_0000;
/// `IFF_NOARP`, `IFF_RUNNING`, `IFF_UP`.
const NO_ARP: u32 = 0x80;
const RUNNING: u32 = 0x40;
const UP: u32 = 0x1;

/// `sizeof(struct sockaddr_nl)`.
const ADDRESS_BYTES: u32 = 12;
/// Longest datagram of the kernel's answer, with room for the guests' interfaces.
const LONGEST_DATAGRAM: usize = 1 << 16;
/// Most requests with pending answers; the oldest is dropped for a new one.
const MOST_REQUESTS: usize = 64;
const LONGEST_REQUEST: usize = 1024;

/// A request for links that a guest has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LinkRequest {
    /// Inode of the guest's socket.
    inode: u64,
    sequence: u32,
    /// Index of the one interface requested; `None` for the whole list.
    asks_for: Option<usize>,
}

impl Supervisor {
    /// Records a request for links that a guest sends on another socket.
    pub(crate) fn note_link_request(&mut self, notification: &Notification) {
        let caller = Caller::new(notification.thread);
        let [_, buffer, length, ..] = notification.arguments;
        let bytes = if matches!(notification.call, libc::SYS_sendmsg) {
            Header::read(caller, buffer).and_then(|header| header.gather(caller))
        } else {
            let mut bytes = vec![0; (length as usize).min(LONGEST_REQUEST)];
            caller.read(buffer, &mut bytes).map(|()| bytes)
        };
        let Some((sequence, asks_for)) = bytes.ok().and_then(|bytes| self.read_request(&bytes)) else {
            return;
        };
        let Ok(end) = caller.descriptor(notification.int(0)) else { return };
        if rustix::net::sockopt::socket_domain(&end) != Ok(rustix::net::AddressFamily::NETLINK) {
            return;
        }
        let Some(inode) = inode_of(end.as_fd()) else { return };
        self.link_requests.retain(|request| request.inode != inode);
        if self.link_requests.len() == MOST_REQUESTS {
            self.link_requests.remove(0);
        }
        self.link_requests.push(LinkRequest { inode, sequence, asks_for });
    }

    /// Sequence number and interface of a request that concerns the guests' interfaces.
    fn read_request(&self, bytes: &[u8]) -> Option<(u32, Option<usize>)> {
        let (kind, flags) = kind_and_flags(bytes.get(..HEADER)?);
        if kind != GET_LINK {
            return None;
        }
        let sequence = u32_at(bytes, 8);
        if flags & DUMP == DUMP {
            return Some((sequence, None));
        }
        if bytes.len() < HEADER + INFO {
            return None;
        }
        let index = u32_at(bytes, HEADER + 4);
        let end = (u32_at(bytes, 0) as usize).min(bytes.len());
        let mut name = None;
        let mut attributes = &bytes[HEADER + INFO..end.max(HEADER + INFO)];
        while let Some(head) = attributes.get(..4) {
            let length = usize::from(u16::from_ne_bytes([head[0], head[1]]));
            let value = attributes.get(4..length)?;
            if [NAME, ALTERNATIVE_NAME].contains(&u16::from_ne_bytes([head[2], head[3]])) {
                name = Some(value.split(|byte| *byte == 0).next().unwrap_or_default());
            }
            attributes = attributes.get(length.next_multiple_of(4)..).unwrap_or_default();
        }
        let is_meant = |known: &Interface| known.index == index || name == Some(known.name.as_bytes());
        self.interfaces.iter().position(is_meant).map(|place| (sequence, Some(place)))
    }

    /// Reads the kernel's answer to a recorded request; `None` for other messages.
    pub(crate) fn receive_links(&mut self, notification: &Notification) -> Option<Answer> {
        let caller = Caller::new(notification.thread);
        let end = caller.descriptor(notification.int(0)).ok()?;
        let inode = inode_of(end.as_fd())?;
        let place = self.link_requests.iter().position(|request| request.inode == inode)?;
        let request = self.link_requests[place];
        let is_message = notification.call == libc::SYS_recvmsg;
        let flags = notification.int(if is_message { 2 } else { 3 });
        if notification.call == libc::SYS_recvmmsg || !self.listener.is_alive(notification.id) {
            return None;
        }
        let (datagram, address) = match receive(end.as_fd(), flags & libc::MSG_PEEK) {
            Ok(received) => received,
            // The kernel answers at once, so there is no answer, and the guest may wait for it.
            Err(Errno::AGAIN) => return None,
            Err(error) => return Some(Answer::Error(error)),
        };
        let (datagram, is_over) = with_guest_interfaces(&datagram, &request, &self.interfaces);
        if is_over && flags & libc::MSG_PEEK == 0 {
            self.link_requests.remove(place);
        }
        let written = if is_message {
            write_message(caller, notification.arguments[1], &datagram, &address)
        } else {
            write_from(caller, notification, &datagram, &address)
        };
        Some(match written {
            Ok(_) if flags & libc::MSG_TRUNC != 0 => Answer::Value(datagram.len() as i64),
            Ok(length) => Answer::Value(length as i64),
            Err(error) => Answer::Error(error),
        })
    }
}

fn kind_and_flags(message: &[u8]) -> (u16, u16) {
    (u16::from_ne_bytes([message[4], message[5]]), u16::from_ne_bytes([message[6], message[7]]))
}

/// A datagram with the guests' interfaces, and whether it ends the answer.
fn with_guest_interfaces(
    datagram: &[u8],
    request: &LinkRequest,
    interfaces: &[Interface],
) -> (Vec<u8>, bool) {
    let (mut bytes, mut rest, mut is_over) = (Vec::with_capacity(datagram.len() + 1024), datagram, false);
    while rest.len() >= HEADER {
        let length = (u32_at(rest, 0) as usize).clamp(HEADER, rest.len());
        let (message, after) = rest.split_at(length.next_multiple_of(4).min(rest.len()));
        let (kind, _) = kind_and_flags(message);
        let (sequence, port) = (u32_at(message, 8), u32_at(message, 12));
        match (kind, request.asks_for) {
            (DONE, None) if sequence == request.sequence => {
                for interface in interfaces {
                    bytes.extend(link(interface, MULTI, sequence, port));
                }
                bytes.extend(message);
                is_over = true;
            }
            (ERROR, Some(place)) if sequence == request.sequence => {
                bytes.extend(link(&interfaces[place], 0, sequence, port));
                is_over = true;
            }
            _ => bytes.extend(message),
        }
        rest = after;
    }
    (bytes, is_over)
}

/// RTM_NEWLINK of an interface, in the form of a vcan.
fn link(interface: &Interface, flags: u16, sequence: u32, port: u32) -> Vec<u8> {
    let state = if interface.is_up { NO_ARP | RUNNING | UP | LOWER_UP } else { NO_ARP };
    let mut message = vec![0; HEADER];
    message.extend([0, 0]);
    message.extend(crate::interface::HARDWARE.to_ne_bytes());
    message.extend(interface.index.to_ne_bytes());
    message.extend(state.to_ne_bytes());
    message.extend([0; 4]);
    let attribute = |kind: u16, value: &[u8]| {
        let mut attribute = (4 + value.len() as u16).to_ne_bytes().to_vec();
        attribute.extend(kind.to_ne_bytes());
        attribute.extend(value);
        attribute.resize(attribute.len().next_multiple_of(4), 0);
        attribute
    };
    let text = |text: &str| [text.as_bytes(), &[0]].concat();
    message.extend(attribute(NAME, &text(&interface.name)));
    message.extend(attribute(QUEUE_LENGTH, &crate::interface::TRANSMIT_QUEUE.to_ne_bytes()));
    // IF_OPER_UNKNOWN, as for every vcan; IF_OPER_DOWN.
    message.extend(attribute(STATE, &[if interface.is_up { 0 } else { 2 }]));
    message.extend(attribute(LINK_MODE, &[0]));
    message.extend(attribute(MTU, &crate::interface::MTU.to_ne_bytes()));
    message.extend(attribute(GROUP, &[0; 4]));
    message.extend(attribute(QUEUEING, &text("noqueue")));
    message.extend(attribute(LINK_INFO, &attribute(KIND, &text("vcan"))));
    let length = message.len() as u32;
    message[..4].copy_from_slice(&length.to_ne_bytes());
    message[4..6].copy_from_slice(&NEW_LINK.to_ne_bytes());
    message[6..8].copy_from_slice(&flags.to_ne_bytes());
    message[8..12].copy_from_slice(&sequence.to_ne_bytes());
    message[12..16].copy_from_slice(&port.to_ne_bytes());
    message
}

/// A datagram and its sender's address, without blocking.
fn receive(end: BorrowedFd<'_>, peek: i32) -> Result<(Vec<u8>, Vec<u8>), Errno> {
    let (mut bytes, mut address) = (vec![0_u8; LONGEST_DATAGRAM], vec![0_u8; ADDRESS_BYTES as usize]);
    let (into, from, mut length) = (bytes.as_mut_ptr().cast(), address.as_mut_ptr().cast(), ADDRESS_BYTES);
    let flags = libc::MSG_DONTWAIT | peek;
    // SAFETY: the buffers outlive the call and have the sizes given.
    let received =
        unsafe { libc::recvfrom(end.as_raw_fd(), into, LONGEST_DATAGRAM, flags, from, &raw mut length) };
    let received = usize::try_from(received)
        .map_err(|_| Errno::from_io_error(&io::Error::last_os_error()).unwrap_or(Errno::IO))?;
    bytes.truncate(received);
    address.truncate(length as usize);
    Ok((bytes, address))
}

/// Writes into a `struct msghdr`; returns the number of bytes that fit.
fn write_message(caller: Caller, at: u64, datagram: &[u8], address: &[u8]) -> Result<usize, Errno> {
    let header = Header::read(caller, at)?;
    let length = datagram.len().min(header.room());
    header.scatter(caller, &datagram[..length])?;
    header.write_name(caller, at, address)?;
    let out_flags = if length < datagram.len() { libc::MSG_TRUNC } else { 0 };
    caller.write(at + 40, &0_u64.to_ne_bytes())?;
    caller.write(at + 48, &out_flags.to_ne_bytes())?;
    Ok(length)
}

/// Writes for `recvfrom(fd, buffer, length, flags, address, address length)`.
fn write_from(
    caller: Caller,
    notification: &Notification,
    datagram: &[u8],
    address: &[u8],
) -> Result<usize, Errno> {
    let [_, buffer, length, _, name, name_length] = notification.arguments;
    let bytes = &datagram[..datagram.len().min(length as usize)];
    caller.write(buffer, bytes)?;
    caller.write_address((name, name_length), caller.read_room(name_length)?, address)?;
    Ok(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn message(kind: u16, sequence: u32) -> Vec<u8> {
        let mut message = vec![0; 20];
        message[0] = 20;
        message[4..6].copy_from_slice(&kind.to_ne_bytes());
        message[8..12].copy_from_slice(&sequence.to_ne_bytes());
        message
    }

    fn kinds(datagram: &[u8]) -> Vec<u16> {
        let (mut rest, mut kinds) = (datagram, Vec::new());
        while rest.len() >= HEADER {
            kinds.push(kind_and_flags(rest).0);
            rest = &rest[(u32_at(rest, 0) as usize).next_multiple_of(4)..];
        }
        kinds
    }

    #[test]
    fn interfaces_stand_before_the_end_of_the_list_that_was_asked_for() {
        let interfaces = [("vcan0", 100), ("vcan1", 101)]
            .map(|(name, index)| Interface::new(name, Path::new("/nowhere"), index));
        let request = LinkRequest { inode: 1, sequence: 7, asks_for: None };
        let more = [message(NEW_LINK, 7), message(NEW_LINK, 7)].concat();
        assert_eq!(with_guest_interfaces(&more, &request, &interfaces), (more, false));
        let end = [message(NEW_LINK, 7), message(DONE, 7)].concat();
        let (list, is_over) = with_guest_interfaces(&end, &request, &interfaces);
        assert_eq!((kinds(&list), is_over), (vec![NEW_LINK, NEW_LINK, NEW_LINK, DONE], true));
        let (other, is_over) = with_guest_interfaces(&message(DONE, 8), &request, &interfaces);
        assert_eq!((kinds(&other), is_over), (vec![DONE], false));
    }

    #[test]
    fn an_interface_that_the_kernel_does_not_have_is_described() {
        let interfaces = [Interface::new("vcan0", Path::new("/nowhere"), 100)];
        let request = LinkRequest { inode: 1, sequence: 7, asks_for: Some(0) };
        let (answer, is_over) = with_guest_interfaces(&message(ERROR, 7), &request, &interfaces);
        assert_eq!((kinds(&answer), is_over), (vec![NEW_LINK], true));
        assert_eq!(u32_at(&answer, HEADER + 4), 100);
        assert_eq!(answer.len(), u32_at(&answer, 0) as usize);
    }
}
