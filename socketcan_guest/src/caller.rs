//! The thread of a call: its memory and its descriptors.
//!
//! `dup`, `fork` and `SCM_RIGHTS` give a socket several descriptors; a copy of the descriptor and its inode identify the
//! socket. The copy is closed after the answer, so that the guest's last close is the last close.
//!
//! Both need the permission to trace the guest, which the parent of a process has unless a container or the Yama module denies
//! it, or the guest's file is executable but not readable.

#![allow(unsafe_code)] // process_vm_readv and process_vm_writev, nothing else

use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, PidfdGetfdFlags, pidfd_getfd, pidfd_open};
use std::os::fd::OwnedFd;

/// `PIDFD_THREAD`, since Linux 6.9.
const ANY_THREAD: PidfdFlags = PidfdFlags::from_bits_retain(libc::O_EXCL as u32);

/// A thread of a guest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Caller(i32);

impl Caller {
    pub(crate) fn new(thread: i32) -> Self {
        Self(thread)
    }

    /// Copies from its memory.
    ///
    /// # Errors
    /// `EFAULT` when not all of it is mapped, `EPERM` without permission.
    pub(crate) fn read(self, address: u64, bytes: &mut [u8]) -> Result<(), Errno> {
        if bytes.is_empty() {
            return Ok(());
        }
        let here = libc::iovec { iov_base: bytes.as_mut_ptr().cast(), iov_len: bytes.len() };
        let there = libc::iovec { iov_base: address as *mut _, iov_len: bytes.len() };
        // SAFETY: `here` is a buffer of ours; `there` belongs to another process and only the kernel follows it.
        let copied = unsafe { libc::process_vm_readv(self.0, &raw const here, 1, &raw const there, 1, 0) };
        moved(copied, bytes.len())
    }

    pub(crate) fn read_array<const N: usize>(self, address: u64) -> Result<[u8; N], Errno> {
        let mut bytes = [0; N];
        self.read(address, &mut bytes)?;
        Ok(bytes)
    }

    /// Capacity for an address or a value, from its length: a `socklen_t` that the call also returns.
    ///
    /// # Errors
    /// `EINVAL` for a negative one; otherwise as [`Caller::read`].
    pub(crate) fn read_room(self, length_at: u64) -> Result<usize, Errno> {
        let room = i32::from_ne_bytes(self.read_array(length_at)?);
        usize::try_from(room).map_err(|_| Errno::INVAL)
    }

    /// Writes as much of an address as there is room for, and its whole length; `places` are those of both.
    ///
    /// # Errors
    /// As [`Caller::read`].
    pub(crate) fn write_address(self, places: (u64, u64), room: usize, address: &[u8]) -> Result<(), Errno> {
        self.write(places.0, &address[..address.len().min(room)])?;
        self.write(places.1, &(address.len() as i32).to_ne_bytes())
    }

    /// Copies into its memory.
    ///
    /// # Errors
    /// As [`Caller::read`].
    pub(crate) fn write(self, address: u64, bytes: &[u8]) -> Result<(), Errno> {
        if bytes.is_empty() {
            return Ok(());
        }
        let here = libc::iovec { iov_base: bytes.as_ptr().cast_mut().cast(), iov_len: bytes.len() };
        let there = libc::iovec { iov_base: address as *mut _, iov_len: bytes.len() };
        // SAFETY: as above; the kernel only reads `here`.
        let copied = unsafe { libc::process_vm_writev(self.0, &raw const here, 1, &raw const there, 1, 0) };
        moved(copied, bytes.len())
    }

    /// A copy of one of its descriptors.
    ///
    /// # Errors
    /// `EBADF` for an unknown number, `EPERM` without permission.
    pub(crate) fn descriptor(self, number: i32) -> Result<OwnedFd, Errno> {
        let thread = Pid::from_raw(self.0).ok_or(Errno::SRCH)?;
        let process = match pidfd_open(thread, ANY_THREAD) {
            // Before Linux 6.9 only the first thread of a process can be opened.
            Err(Errno::INVAL) => pidfd_open(first_thread(self.0).ok_or(Errno::SRCH)?, PidfdFlags::empty())?,
            opened => opened?,
        };
        pidfd_getfd(process, number, PidfdGetfdFlags::empty())
    }
}

fn moved(copied: isize, wanted: usize) -> Result<(), Errno> {
    match usize::try_from(copied) {
        Ok(copied) if copied == wanted => Ok(()),
        Ok(_) => Err(Errno::FAULT),
        Err(_) => Err(Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::FAULT)),
    }
}

/// The process of a thread, by its first thread. Threads of a process share their descriptors, except after a rare `unshare`.
fn first_thread(thread: i32) -> Option<Pid> {
    let status = std::fs::read_to_string(format!("/proc/{thread}/status")).ok()?;
    let number = status.lines().find_map(|line| line.strip_prefix("Tgid:"))?;
    Pid::from_raw(number.trim().parse().ok()?)
}
