//! Messages of the broadcast manager: a head of 56 bytes, then frames.
//!
//! ```text
//!   offset  0       4      8      16           32           48      52           56
//!           opcode  flags  count  ival1        ival2        can_id  frame count  frames, 16 bytes each
//!                                 s, us (i64)  s, us (i64)
//! ```

use crate::abi::{MOST_DATA, u32_at, u64_at};
use crate::bus_peer::FrameBytes;
use protocol::can::CAN_FRAME_BYTES;
use rustix::io::Errno;
use std::time::Duration;

/// `sizeof(struct bcm_msg_head)`.
pub(super) const HEAD_BYTES: usize = 56;

/// Opcodes of `struct bcm_msg_head`.
pub(super) mod opcode {
    pub(in crate::bcm) const TX_SETUP: u32 = 1;
    pub(in crate::bcm) const TX_DELETE: u32 = 2;
    pub(in crate::bcm) const TX_READ: u32 = 3;
    pub(in crate::bcm) const TX_SEND: u32 = 4;
    pub(in crate::bcm) const RX_SETUP: u32 = 5;
    pub(in crate::bcm) const RX_DELETE: u32 = 6;
    pub(in crate::bcm) const RX_READ: u32 = 7;
    pub(in crate::bcm) const TX_STATUS: u32 = 8;
    pub(in crate::bcm) const TX_EXPIRED: u32 = 9;
    pub(in crate::bcm) const RX_STATUS: u32 = 10;
    pub(in crate::bcm) const RX_TIMEOUT: u32 = 11;
    pub(in crate::bcm) const RX_CHANGED: u32 = 12;
}

/// Flags of `struct bcm_msg_head`.
pub(super) mod flag {
    pub(in crate::bcm) const SETTIMER: u32 = 0x1;
    pub(in crate::bcm) const STARTTIMER: u32 = 0x2;
    pub(in crate::bcm) const TX_COUNTEVT: u32 = 0x4;
    pub(in crate::bcm) const TX_ANNOUNCE: u32 = 0x8;
    pub(in crate::bcm) const TX_CP_CAN_ID: u32 = 0x10;
    pub(in crate::bcm) const RX_FILTER_ID: u32 = 0x20;
    pub(in crate::bcm) const RX_CHECK_DLC: u32 = 0x40;
    pub(in crate::bcm) const RX_NO_AUTOTIMER: u32 = 0x80;
    pub(in crate::bcm) const RX_ANNOUNCE_RESUME: u32 = 0x100;
    pub(in crate::bcm) const TX_RESET_MULTI_IDX: u32 = 0x200;
    pub(in crate::bcm) const RX_RTR_FRAME: u32 = 0x400;
    pub(in crate::bcm) const CAN_FD_FRAME: u32 = 0x800;
}

/// `BCM_TIMER_SEC_MAX`: 400 days.
const LONGEST_S: i64 = 400 * 24 * 60 * 60;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    pub(super) opcode: u32,
    pub(super) flags: u32,
    pub(super) count: u32,
    pub(super) interval_1: Duration,
    pub(super) interval_2: Duration,
    pub(super) id: u32,
    pub(super) frame_count: u32,
}

impl Head {
    /// Parses the head and the complete frames after it.
    ///
    /// # Errors
    /// `EINVAL` for a length that fits no message, for frames of CAN FD, and for an invalid time.
    pub(super) fn read(bytes: &[u8]) -> Result<(Self, Vec<FrameBytes>), Errno> {
        if bytes.len() < HEAD_BYTES || !(bytes.len() - HEAD_BYTES).is_multiple_of(CAN_FRAME_BYTES) {
            return Err(Errno::INVAL);
        }
        let flags = u32_at(bytes, 4);
        if flags & flag::CAN_FD_FRAME != 0 {
            return Err(Errno::INVAL);
        }
        let interval = |offset| match interval(u64_at(bytes, offset) as i64, u64_at(bytes, offset + 8) as i64)
        {
            None if flags & flag::SETTIMER != 0 => Err(Errno::INVAL),
            interval => Ok(interval.unwrap_or_default()),
        };
        let head = Self {
            opcode: u32_at(bytes, 0),
            flags,
            count: u32_at(bytes, 8),
            interval_1: interval(16)?,
            interval_2: interval(32)?,
            id: u32_at(bytes, 48),
            frame_count: u32_at(bytes, 52),
        };
        let frames = bytes[HEAD_BYTES..].chunks_exact(CAN_FRAME_BYTES);
        Ok((head, frames.map(|frame| frame.try_into().expect("16 bytes")).collect()))
    }

    /// The frames that the head announces.
    ///
    /// # Errors
    /// `EFAULT` when there are fewer, as when the kernel reads beyond the message; `EINVAL` for one of more than 8 bytes.
    pub(super) fn announced(&self, mut frames: Vec<FrameBytes>) -> Result<Vec<FrameBytes>, Errno> {
        let count = self.frame_count as usize;
        if frames.len() < count {
            return Err(Errno::FAULT);
        }
        frames.truncate(count);
        if frames.iter().any(|frame| frame[4] > MOST_DATA) { Err(Errno::INVAL) } else { Ok(frames) }
    }

    /// Bytes of a message with this head.
    pub(super) fn message_bytes(&self) -> usize {
        HEAD_BYTES + self.frame_count as usize * CAN_FRAME_BYTES
    }

    /// A message to the guest.
    pub(super) fn with(&self, opcode: u32, frames: &[FrameBytes]) -> Vec<u8> {
        let mut bytes = vec![0; HEAD_BYTES];
        let mut put =
            |offset: usize, value: &[u8]| bytes[offset..offset + value.len()].copy_from_slice(value);
        put(0, &opcode.to_ne_bytes());
        put(4, &self.flags.to_ne_bytes());
        put(8, &self.count.to_ne_bytes());
        for (offset, interval) in [(16, self.interval_1), (32, self.interval_2)] {
            put(offset, &interval.as_secs().to_ne_bytes());
            put(offset + 8, &u64::from(interval.subsec_micros()).to_ne_bytes());
        }
        put(48, &self.id.to_ne_bytes());
        put(52, &(frames.len() as u32).to_ne_bytes());
        bytes.extend(frames.iter().flatten());
        bytes
    }
}

fn interval(seconds: i64, microseconds: i64) -> Option<Duration> {
    let is_one = (0..=LONGEST_S).contains(&seconds) && (0..1_000_000).contains(&microseconds);
    is_one.then(|| Duration::new(seconds as u64, microseconds as u32 * 1000))
}
