//! `ioctl` of sockets: requests about an interface by its name, on any socket, and the stamp of the last frame.

use crate::caller::Caller;
use crate::interface::{self, REQUEST_BYTES, SIOCGIFNAME};
use crate::notification::{Answer, Notification};
use crate::supervisor::Supervisor;
use rustix::io::Errno;

/// The stamp of the last frame read, in us and in ns, and the same with 64-bit times for 32-bit programs.
const SIOCGSTAMP: u32 = 0x8906;
const SIOCGSTAMPNS: u32 = 0x8907;
const SIOCGSTAMP_NEW: u32 = 0x8010_8906;
const SIOCGSTAMPNS_NEW: u32 = 0x8010_8907;

/// Offset of the answer in a request, after the name.
const ANSWER: u64 = 16;

impl Supervisor {
    /// `ioctl(fd, request, argument)`.
    pub(crate) fn ioctl(&mut self, notification: &Notification) -> Answer {
        match notification.arguments[1] as u32 {
            request @ (SIOCGSTAMP | SIOCGSTAMPNS | SIOCGSTAMP_NEW | SIOCGSTAMPNS_NEW) => {
                self.last_stamp(notification, request)
            }
            request => self.ask_interface(notification, request),
        }
    }

    fn ask_interface(&mut self, notification: &Notification, request: u32) -> Answer {
        let caller = Caller::new(notification.thread);
        let at = notification.arguments[2];
        // A request with another argument than `struct ifreq` is not answered here.
        let Ok(asked) = caller.read_array::<REQUEST_BYTES>(at) else { return Answer::Continue };
        let alive = self.listener.check_alive(notification.id);
        let written = if request == SIOCGIFNAME {
            let index = crate::abi::u32_at(&asked, ANSWER as usize);
            let known = self.interfaces.iter().find(|known| known.index == index);
            let Some(known) = known else { return Answer::Continue };
            alive.and_then(|()| caller.write(at, &known.name_field()))
        } else {
            let known = interface::named(&self.interfaces, &asked);
            let Some(answer) = known.and_then(|known| known.answer(request)) else { return Answer::Continue };
            alive.and(answer).and_then(|answer| caller.write(at + ANSWER, &answer))
        };
        written.map_or_else(Answer::Error, |()| Answer::Value(0))
    }

    /// `ENOENT` before the first frame, as from the kernel, which keeps stamps from the first request on.
    fn last_stamp(&mut self, notification: &Notification, request: u32) -> Answer {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Answer::Continue };
        let Some(socket) = self.sockets.get_mut(&inode) else { return Answer::Continue };
        let Some(stamp_ns) = socket.last_stamp_ns() else { return Errno::NOENT.into() };
        let (seconds, rest) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        let is_ns = matches!(request, SIOCGSTAMPNS | SIOCGSTAMPNS_NEW);
        let rest = if is_ns { rest } else { rest / 1000 };
        let bytes = [seconds.to_ne_bytes(), rest.to_ne_bytes()].concat();
        let caller = Caller::new(notification.thread);
        let alive = self.listener.check_alive(notification.id);
        let written = alive.and_then(|()| caller.write(notification.arguments[2], &bytes));
        written.map_or_else(Answer::Error, |()| Answer::Value(0))
    }
}
