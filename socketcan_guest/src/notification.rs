//! Notifications of the kernel: a pending call, and its answer.
//!
//! A notification ends with its caller, or when a signal interrupts the call; its number is never reused. Data read from the
//! caller's memory are valid only if the notification is alive afterwards.
//!
//! Source: `seccomp_unotify(2)`.

#![allow(unsafe_code)] // the ioctls of the listener, nothing else

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};

/// A pending system call.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Notification {
    /// Number of the notification.
    pub(crate) id: u64,
    /// The calling thread.
    pub(crate) thread: i32,
    pub(crate) call: i64,
    pub(crate) arguments: [u64; 6],
}

impl Notification {
    pub(crate) fn int(&self, index: usize) -> i32 {
        self.arguments[index] as i32
    }
}

/// End of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// It returns this value.
    Value(i64),
    /// It fails.
    Error(Errno),
    /// The kernel executes it.
    Continue,
    /// Answered later by the holder of the notification.
    Deferred,
}

/// Descriptor for notifications.
pub(crate) struct Listener(OwnedFd);

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl Listener {
    pub(crate) fn new(descriptor: OwnedFd) -> Self {
        Self(descriptor)
    }

    /// The next notification, without blocking; `None` when there is none, or its caller has gone.
    pub(crate) fn next(&self) -> Option<Notification> {
        // Receiving blocks when there is none.
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        let mut set = [PollFd::new(self, PollFlags::IN)];
        if poll(&mut set, Some(&now)) != Ok(1) || !set[0].revents().contains(PollFlags::IN) {
            return None;
        }
        // SAFETY: all zeros is a valid value, and required by the kernel.
        let mut notification: libc::seccomp_notif = unsafe { std::mem::zeroed() };
        // SAFETY: the kernel fills the structure of its own type.
        let received =
            unsafe { libc::ioctl(self.0.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_RECV, &raw mut notification) };
        (received == 0).then(|| Notification {
            id: notification.id,
            thread: notification.pid as i32,
            call: i64::from(notification.data.nr),
            arguments: notification.data.args,
        })
    }

    /// Whether the caller still waits.
    pub(crate) fn is_alive(&self, id: u64) -> bool {
        // SAFETY: the kernel reads the number.
        unsafe { libc::ioctl(self.0.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_ID_VALID, &raw const id) == 0 }
    }

    /// Checks the same before an answer: memory of a caller that has gone may belong to another process.
    ///
    /// # Errors
    /// `EINTR`.
    pub(crate) fn check_alive(&self, id: u64) -> Result<(), Errno> {
        if self.is_alive(id) { Ok(()) } else { Err(Errno::INTR) }
    }

    /// Answers; false when the caller waits no more. [`Answer::Deferred`] does nothing.
    pub(crate) fn answer(&self, id: u64, answer: Answer) -> bool {
        let mut response = libc::seccomp_notif_resp { id, val: 0, error: 0, flags: 0 };
        match answer {
            Answer::Value(value) => response.val = value,
            Answer::Error(error) => response.error = -error.raw_os_error(),
            Answer::Continue => response.flags = libc::SECCOMP_USER_NOTIF_FLAG_CONTINUE as u32,
            Answer::Deferred => return true,
        }
        // SAFETY: the kernel reads the structure of its own type.
        unsafe { libc::ioctl(self.0.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_SEND, &raw mut response) == 0 }
    }

    /// Installs a descriptor of this file at the lowest free number of the caller, and answers with the number in one step, so
    /// that no signal comes between.
    ///
    /// # Errors
    /// `EMFILE` when the caller has no free number; `ENOENT` when it waits no more. The call is not answered then.
    pub(crate) fn inject(&self, id: u64, file: BorrowedFd<'_>, close_on_exec: bool) -> io::Result<()> {
        let request = libc::seccomp_notif_addfd {
            id,
            flags: libc::SECCOMP_ADDFD_FLAG_SEND as u32,
            srcfd: file.as_raw_fd() as u32,
            newfd: 0,
            newfd_flags: if close_on_exec { libc::O_CLOEXEC as u32 } else { 0 },
        };
        // SAFETY: the kernel reads the structure of its own type.
        let number =
            unsafe { libc::ioctl(self.0.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_ADDFD, &raw const request) };
        if number < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
    }
}
