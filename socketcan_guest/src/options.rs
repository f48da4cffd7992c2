//! `setsockopt` and `getsockopt`: those of `CAN_RAW` and `CAN_ISOTP`, and those of all sockets that a Unix socket answers
//! differently.

use crate::abi::{SOL_CAN_ISOTP, SOL_CAN_RAW};
use crate::caller::Caller;
use crate::notification::{Answer, Notification};
use crate::raw::RawOptions;
use crate::socket::Kind;
use crate::supervisor::Supervisor;
use rustix::io::Errno;
use std::os::fd::AsFd;

impl Supervisor {
    /// `setsockopt(fd, level, option, value, length)`.
    pub(crate) fn set_option(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        let (level, option) = (notification.int(1), notification.int(2));
        let value = self.read_value(notification)?;
        let Some(socket) = self.sockets.get_mut(&inode) else { return Ok(Answer::Continue) };
        if level == libc::SOL_SOCKET {
            let number = value.get(..4).map(|four| u32::from_ne_bytes(four.try_into().expect("four bytes")));
            match (option, number) {
                (libc::SO_RCVBUF | libc::SO_RCVBUFFORCE, Some(bytes)) => {
                    socket.resize_queue(bytes as usize);
                    // The guest's end stores it, for `getsockopt`.
                    return Ok(Answer::Continue);
                }
                (libc::SO_RXQ_OVFL, Some(wanted)) => {
                    socket.reports_dropped = wanted != 0;
                    return Ok(Answer::Value(0));
                }
                // Raw CAN sockets are bound by `bind`; the kernel accepts the option without effect.
                (libc::SO_BINDTODEVICE, _) => {
                    let end = value.iter().position(|byte| *byte == 0).unwrap_or(value.len());
                    let is_ours = self.interfaces.iter().any(|known| known.name.as_bytes() == &value[..end]);
                    return Ok(if is_ours { Answer::Value(0) } else { Answer::Continue });
                }
                _ => return Ok(Answer::Continue),
            }
        }
        match &mut socket.kind {
            Kind::Raw(raw) if level == SOL_CAN_RAW => raw.set(option, &value),
            Kind::Transport(transport) if level == SOL_CAN_ISOTP => transport.protocol.set(option, &value),
            Kind::Raw(_) | Kind::Transport(_) => Err(Errno::INVAL),
            Kind::Bcm(_) => Err(Errno::OPNOTSUPP),
        }?;
        Ok(Answer::Value(0))
    }

    /// The value of `setsockopt`. A value longer than allowed is refused unread, as by the kernel, since it may not be mapped.
    fn read_value(&self, notification: &Notification) -> Result<Vec<u8>, Errno> {
        let length = usize::try_from(notification.int(4)).ok();
        let length = length.filter(|length| *length <= RawOptions::LONGEST_VALUE).ok_or(Errno::INVAL)?;
        let mut value = vec![0; length];
        Caller::new(notification.thread).read(notification.arguments[3], &mut value)?;
        self.listener.check_alive(notification.id).map(|()| value)
    }

    /// `getsockopt(fd, level, option, value, length)`.
    pub(crate) fn get_option(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        let Some((inode, end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        let Some(socket) = self.sockets.get_mut(&inode) else { return Ok(Answer::Continue) };
        let (level, option) = (notification.int(1), notification.int(2));
        let is_raw = socket.raw().is_some();
        let number = |number: i32| Ok((number.to_ne_bytes().to_vec(), true));
        let (value, may_be_cut) = match (level, option) {
            (libc::SOL_SOCKET, libc::SO_TYPE) => {
                number(if is_raw { libc::SOCK_RAW } else { libc::SOCK_DGRAM })
            }
            (libc::SOL_SOCKET, libc::SO_DOMAIN) => number(crate::abi::AF_CAN),
            // The kernel does not store it for CAN.
            (libc::SOL_SOCKET, libc::SO_PROTOCOL) => number(0),
            (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => number(socket.reports_dropped.into()),
            (libc::SOL_SOCKET, libc::SO_ERROR) => {
                number(socket.take_error(end.as_fd()).map_or(0, Errno::raw_os_error))
            }
            (libc::SOL_SOCKET, _) => return Ok(Answer::Continue),
            _ => match &socket.kind {
                Kind::Bcm(_) => Err(Errno::OPNOTSUPP),
                Kind::Raw(raw) if level == SOL_CAN_RAW => raw.get(option),
                Kind::Transport(transport) if level == SOL_CAN_ISOTP => {
                    transport.protocol.get(option).map(|value| (value, true))
                }
                Kind::Raw(_) | Kind::Transport(_) => Err(Errno::INVAL),
            },
        }?;
        self.write_value(notification, &value, may_be_cut)?;
        Ok(Answer::Value(0))
    }

    /// Writes a value and its length.
    ///
    /// # Errors
    /// `ERANGE` with the required length, for a value that may not be truncated.
    fn write_value(&self, notification: &Notification, value: &[u8], may_be_cut: bool) -> Result<(), Errno> {
        let caller = Caller::new(notification.thread);
        let [_, _, _, value_at, length_at, _] = notification.arguments;
        let room = caller.read_room(length_at)?;
        self.listener.check_alive(notification.id)?;
        if room < value.len() && !may_be_cut {
            caller.write(length_at, &(value.len() as i32).to_ne_bytes())?;
            return Err(Errno::RANGE);
        }
        let value = &value[..value.len().min(room)];
        caller.write(length_at, &(value.len() as i32).to_ne_bytes())?;
        caller.write(value_at, value)
    }
}
