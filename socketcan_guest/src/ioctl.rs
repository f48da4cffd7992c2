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
    pub(crate) fn ioctl(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        match notification.arguments[1] as u32 {
            request @ (SIOCGSTAMP | SIOCGSTAMPNS | SIOCGSTAMP_NEW | SIOCGSTAMPNS_NEW) => {
                self.last_stamp(notification, request)
            }
            request => self.ask_interface(notification, request),
        }
    }

    fn ask_interface(&mut self, notification: &Notification, request: u32) -> Result<Answer, Errno> {
        let caller = Caller::new(notification.thread);
        let at = notification.arguments[2];
        // A request with another argument than `struct ifreq` is not answered here.
        let Ok(asked) = caller.read_array::<REQUEST_BYTES>(at) else { return Ok(Answer::Continue) };
        let alive = self.listener.check_alive(notification.id);
        if request == SIOCGIFNAME {
            let index = crate::abi::u32_at(&asked, ANSWER as usize);
            let known = self.interfaces.iter().find(|known| known.index == index);
            let Some(known) = known else { return Ok(Answer::Continue) };
            alive?;
            caller.write(at, &known.name_field())?;
        } else {
            let known = interface::named(&self.interfaces, &asked);
            let Some(answer) = known.and_then(|known| known.answer(request)) else {
                return Ok(Answer::Continue);
            };
            alive?;
            caller.write(at + ANSWER, &answer?)?;
        }
        Ok(Answer::Value(0))
    }

    /// `ENOENT` before the first frame, as from the kernel, which keeps stamps from the first request on.
    fn last_stamp(&mut self, notification: &Notification, request: u32) -> Result<Answer, Errno> {
        let Some((inode, _end)) = self.guest_socket(notification) else { return Ok(Answer::Continue) };
        let Some(socket) = self.sockets.get_mut(&inode) else { return Ok(Answer::Continue) };
        let stamp_ns = socket.last_stamp_ns().ok_or(Errno::NOENT)?;
        let (seconds, rest) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        let is_ns = matches!(request, SIOCGSTAMPNS | SIOCGSTAMPNS_NEW);
        let rest = if is_ns { rest } else { rest / 1000 };
        let bytes = [seconds.to_ne_bytes(), rest.to_ne_bytes()].concat();
        self.listener.check_alive(notification.id)?;
        Caller::new(notification.thread).write(notification.arguments[2], &bytes)?;
        Ok(Answer::Value(0))
    }
}
