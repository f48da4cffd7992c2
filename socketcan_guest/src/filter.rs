//! The seccomp filter that selects the system calls to answer here; all others run natively.
//!
//! The filter sees the call's number and its six arguments, but neither memory nor descriptors. Calls are selected by their
//! arguments where possible (`socket` by its family, `setsockopt` by its level); others (`recvmsg`) are notified for every
//! descriptor, and continue natively when the descriptor is no CAN socket. Calls at data rate stay native: `read`, `recv`,
//! `poll`, `select`, `epoll_wait`, and `write` and `send` of 16 bytes.
//!
//! | call | notified when |
//! |---|---|
//! | `socket` | the family is `AF_CAN` |
//! | `bind`, `connect`, `listen`, `accept`, `shutdown`, `getsockname`, `getpeername` | always |
//! | `recvmsg`, `recvmmsg`, `sendmsg`, `sendmmsg` | always: address, flags and control messages are in memory |
//! | `recvfrom`, `sendto` | there is an address; or the length sent is not that of a frame |
//! | `write` | the length is neither a frame's nor an eventfd's |
//! | `ioctl` | the request is one of sockets and interfaces, 0x89xx |
//! | `setsockopt`, `getsockopt` | the level is one of CAN, or the option is one that a Unix socket answers differently |
//!
//! Written by hand: `seccompiler` 0.5 builds filters but has no notification, `libseccomp` needs a system library, and the
//! program is short.
//!
//! Source: `seccomp(2)`, `seccomp_unotify(2)`; Linux `include/uapi/linux/filter.h`.

#![allow(unsafe_code)] // prctl and seccomp, nothing else

use crate::abi::{AF_CAN, SOL_CAN_FIRST, SOL_CAN_LAST};
use libc::sock_filter;
use protocol::can::CAN_FRAME_BYTES;
use std::io;
use std::os::fd::{FromRawFd, OwnedFd};

/// Length of a write to an eventfd, by which programs wake their threads at a high rate.
const EVENTFD_BYTES: u32 = 8;

/// Options of `SOL_SOCKET` to set that affect more than the guest's end of the socket pair.
const SET_OPTIONS: [i32; 8] = [
    libc::SO_RCVBUF,
    libc::SO_RCVBUFFORCE,
    libc::SO_RXQ_OVFL,
    libc::SO_BINDTODEVICE,
    libc::SO_ATTACH_FILTER,
    libc::SO_ATTACH_BPF,
    libc::SO_TIMESTAMPING,
    libc::SO_PASSCRED,
];
/// Options of `SOL_SOCKET` to get that a Unix socket answers with its own type.
const GET_OPTIONS: [i32; 5] =
    [libc::SO_TYPE, libc::SO_DOMAIN, libc::SO_PROTOCOL, libc::SO_RXQ_OVFL, libc::SO_ERROR];

/// Calls that are always notified.
const ALWAYS: [libc::c_long; 12] = [
    libc::SYS_bind,
    libc::SYS_connect,
    libc::SYS_listen,
    libc::SYS_accept,
    libc::SYS_accept4,
    libc::SYS_shutdown,
    libc::SYS_getsockname,
    libc::SYS_getpeername,
    libc::SYS_recvmsg,
    libc::SYS_recvmmsg,
    libc::SYS_sendmsg,
    libc::SYS_sendmmsg,
];

#[cfg(target_arch = "x86_64")]
const ARCHITECTURE: u32 = 0xC000_003E;
#[cfg(target_arch = "aarch64")]
const ARCHITECTURE: u32 = 0xC000_00B7;

/// First number of the x32 calls, which share the architecture of x86-64 and have other structures.
const X32_FIRST: u32 = 0x4000_0000;

const OFFSET_NUMBER: u32 = 0;
const OFFSET_ARCHITECTURE: u32 = 4;

/// Offset of the low and the high half of an argument in `struct seccomp_data`, on a little-endian machine.
const fn argument(index: u32) -> (u32, u32) {
    (16 + 8 * index, 20 + 8 * index)
}

const LOAD: u32 = libc::BPF_LD | libc::BPF_W | libc::BPF_ABS;
const AND: u32 = libc::BPF_ALU | libc::BPF_AND | libc::BPF_K;
const EQUAL: u32 = libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K;
const AT_LEAST: u32 = libc::BPF_JMP | libc::BPF_JGE | libc::BPF_K;
const ABOVE: u32 = libc::BPF_JMP | libc::BPF_JGT | libc::BPF_K;
const RETURN: u32 = libc::BPF_RET | libc::BPF_K;

const fn step(code: u32, value: u32) -> sock_filter {
    sock_filter { code: code as u16, jt: 0, jf: 0, k: value }
}

const ALLOW: sock_filter = step(RETURN, libc::SECCOMP_RET_ALLOW);
const NOTIFY: sock_filter = step(RETURN, libc::SECCOMP_RET_USER_NOTIF);

/// A condition that decides the call when it holds, and otherwise falls through to the next.
const fn when(test: u32, value: u32, decision: sock_filter) -> [sock_filter; 2] {
    [sock_filter { code: test as u16, jt: 0, jf: 1, k: value }, decision]
}

/// Instructions that decide a call of this number; the last is a decision.
fn conditions_of(call: libc::c_long) -> Vec<sock_filter> {
    let load = |index: u32| step(LOAD, argument(index).0);
    let frame = CAN_FRAME_BYTES as u32;
    let mut steps = Vec::new();
    match call {
        libc::SYS_socket => {
            steps.push(load(0));
            steps.extend(when(EQUAL, AF_CAN as u32, NOTIFY));
        }
        libc::SYS_ioctl => {
            steps.extend([load(1), step(AND, 0xFF00)]);
            steps.extend(when(EQUAL, 0x8900, NOTIFY));
        }
        libc::SYS_setsockopt | libc::SYS_getsockopt => {
            steps.push(load(1));
            // The levels of CAN, which are contiguous.
            steps.extend(when(ABOVE, SOL_CAN_LAST as u32, ALLOW));
            steps.extend(when(AT_LEAST, SOL_CAN_FIRST as u32, NOTIFY));
            steps.push(sock_filter { code: EQUAL as u16, jt: 1, jf: 0, k: libc::SOL_SOCKET as u32 });
            steps.extend([ALLOW, load(2)]);
            let options = if call == libc::SYS_setsockopt { &SET_OPTIONS[..] } else { &GET_OPTIONS[..] };
            options.iter().for_each(|option| steps.extend(when(EQUAL, *option as u32, NOTIFY)));
        }
        libc::SYS_recvfrom => steps.extend(notify_with_address()),
        libc::SYS_sendto => {
            steps.extend(notify_with_address());
            steps.push(load(2));
            steps.extend(when(EQUAL, frame, ALLOW));
            steps.push(NOTIFY);
        }
        libc::SYS_write => {
            steps.push(load(2));
            steps.extend(when(EQUAL, frame, ALLOW));
            steps.extend(when(EQUAL, EVENTFD_BYTES, ALLOW));
            steps.push(NOTIFY);
        }
        _ => steps.push(NOTIFY),
    }
    steps.push(ALLOW);
    steps
}

/// Notifies `recvfrom` and `sendto` with an address, the fifth argument.
fn notify_with_address() -> Vec<sock_filter> {
    let (low, high) = argument(4);
    let not_zero =
        |offset| [step(LOAD, offset), sock_filter { code: EQUAL as u16, jt: 1, jf: 0, k: 0 }, NOTIFY];
    [not_zero(low), not_zero(high)].concat()
}

/// The whole filter. Calls of another architecture, as of a 32-bit program, are allowed and see no CAN.
pub(crate) fn program() -> Vec<sock_filter> {
    let mut steps = vec![step(LOAD, OFFSET_ARCHITECTURE)];
    steps.push(sock_filter { code: EQUAL as u16, jt: 1, jf: 0, k: ARCHITECTURE });
    steps.extend([ALLOW, step(LOAD, OFFSET_NUMBER)]);
    steps.extend(when(AT_LEAST, X32_FIRST, ALLOW));
    for call in ALWAYS {
        steps.extend(when(EQUAL, call as u32, NOTIFY));
    }
    let others = [
        libc::SYS_write,
        libc::SYS_ioctl,
        libc::SYS_recvfrom,
        libc::SYS_sendto,
        libc::SYS_socket,
        libc::SYS_setsockopt,
        libc::SYS_getsockopt,
    ];
    for call in others {
        let conditions = conditions_of(call);
        steps.push(sock_filter { code: EQUAL as u16, jt: 0, jf: conditions.len() as u8, k: call as u32 });
        steps.extend(conditions);
    }
    steps.push(ALLOW);
    steps
}

/// Installs the filter for this thread and what it starts; returns the descriptor for notifications.
///
/// `no_new_privs` is set first: it allows an unprivileged user to install a filter, and disables setuid programs.
///
/// # Errors
/// The error of `prctl` or `seccomp`: `EBUSY` below another listener, `ENOSYS` or `EINVAL` without user notification, `EPERM`
/// where a container forbids the call.
pub(crate) fn install() -> io::Result<OwnedFd> {
    let mut steps = program();
    let program = libc::sock_fprog { len: steps.len() as u16, filter: steps.as_mut_ptr() };
    // SAFETY: prctl with these arguments touches no memory.
    if unsafe { libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) } != 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: `program` points to `steps`, which outlive the call; the kernel copies them.
    let listener = unsafe {
        libc::syscall(
            libc::SYS_seccomp,
            libc::SECCOMP_SET_MODE_FILTER,
            libc::SECCOMP_FILTER_FLAG_NEW_LISTENER,
            &raw const program,
        )
    };
    if listener < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the kernel has just returned this descriptor.
    Ok(unsafe { OwnedFd::from_raw_fd(listener as i32) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decision of the filter, computed as the kernel's interpreter does for the instructions that occur.
    fn decision(number: libc::c_long, arguments: [u64; 6]) -> u32 {
        decision_on(ARCHITECTURE, number, arguments)
    }

    fn decision_on(architecture: u32, number: libc::c_long, arguments: [u64; 6]) -> u32 {
        let mut data = Vec::new();
        data.extend((number as u32).to_le_bytes());
        data.extend(architecture.to_le_bytes());
        data.extend(0_u64.to_le_bytes());
        arguments.iter().for_each(|argument| data.extend(argument.to_le_bytes()));
        let steps = program();
        let (mut at, mut value) = (0, 0_u32);
        loop {
            let step = &steps[at];
            at += 1;
            let jump = |holds: bool| usize::from(if holds { step.jt } else { step.jf });
            match u32::from(step.code) {
                LOAD => {
                    let from = step.k as usize;
                    value = u32::from_le_bytes(data[from..from + 4].try_into().unwrap());
                }
                AND => value &= step.k,
                EQUAL => at += jump(value == step.k),
                AT_LEAST => at += jump(value >= step.k),
                ABOVE => at += jump(value > step.k),
                RETURN => return step.k,
                other => panic!("an instruction {other} that nobody wrote"),
            }
        }
    }

    #[track_caller]
    fn assert_notified(expected: bool, number: libc::c_long, arguments: [u64; 6]) {
        let wanted = if expected { libc::SECCOMP_RET_USER_NOTIF } else { libc::SECCOMP_RET_ALLOW };
        assert_eq!(decision(number, arguments), wanted, "call {number} {arguments:?}");
    }

    #[test]
    fn what_runs_at_data_rate_stays_native() {
        for call in [libc::SYS_read, libc::SYS_poll, libc::SYS_epoll_wait, libc::SYS_select, libc::SYS_close]
        {
            assert_notified(false, call, [3, 1 << 40, 16, 0, 0, 0]);
        }
        assert_notified(false, libc::SYS_write, [3, 1 << 40, 16, 0, 0, 0]);
        assert_notified(false, libc::SYS_sendto, [3, 1 << 40, 16, 0, 0, 0]);
        assert_notified(false, libc::SYS_recvfrom, [3, 1 << 40, 16, 0, 0, 0]);
    }

    #[test]
    fn lengths_that_are_no_frames_are_notified() {
        for (length, expected) in
            [(0, true), (5, true), (8, false), (15, true), (16, false), (17, true), (72, true), (8200, true)]
        {
            assert_notified(expected, libc::SYS_write, [3, 1, length, 0, 0, 0]);
        }
        for (length, expected) in [(0, true), (8, true), (16, false), (72, true), (8200, true)] {
            assert_notified(expected, libc::SYS_sendto, [3, 1, length, 0, 0, 0]);
        }
    }

    #[test]
    fn an_address_is_seen_in_either_half_of_its_pointer() {
        for call in [libc::SYS_recvfrom, libc::SYS_sendto] {
            for address in [1_u64, 1 << 40] {
                assert_notified(true, call, [3, 1, 16, 0, address, 0]);
            }
        }
    }

    #[test]
    fn only_what_can_concern_can_is_taken_of_socket_ioctl_and_options() {
        assert_notified(true, libc::SYS_socket, [29, 3, 1, 0, 0, 0]);
        assert_notified(false, libc::SYS_socket, [2, 1, 0, 0, 0, 0]);
        for (request, expected) in [(0x8933, true), (0x8906, true), (0x8010_8906, true), (0x5401, false)] {
            assert_notified(expected, libc::SYS_ioctl, [3, request, 1, 0, 0, 0]);
        }
        for call in [libc::SYS_setsockopt, libc::SYS_getsockopt] {
            for level in [SOL_CAN_FIRST, 101, SOL_CAN_LAST] {
                assert_notified(true, call, [3, level as u64, 1, 1, 4, 0]);
            }
            for level in [0, 6, SOL_CAN_FIRST - 1, SOL_CAN_LAST + 1] {
                assert_notified(false, call, [3, level as u64, libc::SO_TYPE as u64, 1, 4, 0]);
            }
            assert_notified(false, call, [3, 1, libc::SO_TIMESTAMP as u64, 1, 4, 0]);
        }
        assert_notified(true, libc::SYS_setsockopt, [3, 1, libc::SO_RCVBUF as u64, 1, 4, 0]);
        assert_notified(false, libc::SYS_getsockopt, [3, 1, libc::SO_RCVBUF as u64, 1, 4, 0]);
        assert_notified(true, libc::SYS_getsockopt, [3, 1, libc::SO_DOMAIN as u64, 1, 4, 0]);
        assert_notified(true, libc::SYS_recvmsg, [3, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn calls_of_another_architecture_are_none_of_ours() {
        assert_eq!(decision_on(0x4000_0003, libc::SYS_bind, [0; 6]), libc::SECCOMP_RET_ALLOW);
        assert_notified(false, libc::SYS_bind | 0x4000_0000, [0; 6]);
    }
}
