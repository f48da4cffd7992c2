//! SocketCAN for unmodified programs on a machine without CAN in the kernel: their CAN sockets are connected to embedded buses.
//!
//! ```text
//!   program, its threads and children                this process
//!   socket, bind, ioctl, recvmsg … ── seccomp ─────► supervisor ── answers, as net/can of the kernel would
//!   read, write, poll, select, epoll ─ natively ─► a pair of Unix sockets ─► supervisor ◄─► embedded bus (protocol::bus::host)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `launch` | start and end of the program |
//! | `filter` | the system calls that are answered here |
//! | `notification` | a pending call, and its answer |
//! | `caller` | the calling thread's memory and descriptors |
//! | `supervisor` | the loop over calls, sockets and buses |
//! | `interface`, `bus_peer` | an interface as guests see it, and the bus behind it |
//! | `socket` | a guest's socket: its queue, and the metadata of each frame in it |
//! | `raw` | filters and options of `CAN_RAW` |
//! | `bcm` | `CAN_BCM`: cyclic sending, changes, time-outs |
//! | `isotp`, `transport` | `CAN_ISOTP`: the protocol, and its sockets |
//! | `names`, `options`, `ioctl`, `receive`, `send` | the answers, by system call |
//! | `netlink` | the interfaces in the kernel's list of links |
//! | `abi` | numbers and layouts |
//!
//! A preloaded library would be simpler, but would not reach a statically linked program or one in Go; a kernel module needs a
//! kernel that loads it. What is supported, what is not, and the cost: `docs/socketcan-without-kernel.md`.

#![warn(missing_docs)] // an interface of other crates

mod abi;
mod bcm;
mod bus_peer;
mod caller;
mod filter;
mod interface;
mod ioctl;
mod isotp;
mod launch;
mod names;
mod netlink;
mod notification;
mod options;
mod raw;
mod receive;
mod send;
mod socket;
mod supervisor;
mod transport;

pub use launch::run;
use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// A CAN interface of the guest: its name, and the embedded bus behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedInterface {
    /// Name of the CAN interface, 1 to 15 bytes.
    pub name: String,
    /// Path of the bus's socket.
    pub path: PathBuf,
}

/// The program, and when it starts and ends.
#[derive(Debug)]
pub struct Guest<'a> {
    /// The program and its arguments.
    pub command: &'a [OsString],
    /// Longest wait for the hosts of the buses before it starts.
    pub patience: Duration,
    /// Whether it gets SIGTERM when the host of a bus ends, for programs that do not notice.
    pub ends_with_bus: bool,
}

/// Why a program cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum GuestError {
    /// More interfaces than [`run`] supports.
    #[error("at most {0} interfaces")]
    TooMany(usize),
    /// The bus has no host.
    #[error(
        "{name}: no host at unix://{path} for {waited_s} s (--wait-s); 'scripts/run --bus unix://{path}' hosts it, as do \
         'emulator run' and 'emulator bus'; --pair opens one without a rig"
    )]
    NoHost {
        /// Name of the CAN interface.
        name: String,
        /// Path of the bus's socket.
        path: String,
        /// Time that was waited for a host, s.
        waited_s: u64,
    },
    /// The kernel or a container refuses the filter.
    #[error("{}", refused(.0))]
    Filter(io::Error),
    /// Descriptors and memory of other processes are not accessible.
    #[error(
        "the CAN sockets of a program cannot be found: pidfd_getfd(2) or process_vm_readv(2): {0}; a container forbids it: allow \
         it, as docker run --cap-add SYS_PTRACE does, or --security-opt seccomp=unconfined, or systemd-nspawn \
         --system-call-filter=pidfd_getfd; Linux 5.6 or later is needed"
    )]
    ProcessAccess(io::Error),
    /// The program cannot be started.
    #[error("cannot start the command {}: {error}", name.display())]
    Command {
        /// The program, the first word of the command.
        name: OsString,
        /// Error of the system.
        error: io::Error,
    },
    /// The system refuses a thread, a descriptor or another resource.
    #[error("{0}")]
    System(io::Error),
}

/// Message with the remedy for a refused filter.
fn refused(error: &io::Error) -> String {
    let advice = match error.raw_os_error() {
        Some(libc::EBUSY) => {
            "it runs below another program with a seccomp listener; 'bench can' does not nest"
        }
        Some(libc::EPERM | libc::EACCES) => {
            "a container or sandbox forbids seccomp(2): allow it, as docker run --security-opt seccomp=unconfined does"
        }
        Some(libc::ENOSYS | libc::EINVAL) => {
            "this kernel has no seccomp user notification with injected descriptors: Linux 5.14 or later is needed, built with \
             CONFIG_SECCOMP_FILTER, and not emulated, as gVisor is"
        }
        _ => "see seccomp(2)",
    };
    format!("the system calls of a program cannot be answered here: {error}; {advice}")
}
