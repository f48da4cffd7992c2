//! The bits of a frame on the wire, with the stuffing bits that its content makes necessary.
//!
//! ```text
//!   standard  SOF, identifier 11, RTR, IDE 0, r0 0, DLC 4, data, CRC 15                           stuffed
//!   extended  SOF, identifier 11, SRR 1, IDE 1, identifier 18, RTR, r1 0, r0 0, DLC 4, data, CRC   stuffed
//!   both      CRC delimiter, ACK, ACK delimiter, end of frame 7, intermission 3                   not stuffed: 13
//! ```
//!
//! After five equal bits the sender adds one of the other kind, which counts as the first of the next run. The worst case of a
//! sequence of s bits is therefore (s - 1) / 4 stuffing bits: [`crate::bus_load::worst_case_bits`]. Real frames do not quite
//! reach it: the bits RTR, IDE, r0 and DLC are given. Of all frames with an 11-bit identifier and 8 bytes, 147 sequences
//! would have 23 of the 24 stuffing bits, and none of them carries its own CRC: the longest real ones have 22, 133 bits in
//! all (searched, 2026).
//!
//! Source: ISO 11898-1, frame formats, bit stuffing, CRC-15.

use crate::can::{CanFrame, EXTENDED_FLAG, REMOTE_FLAG, STANDARD_MASK};
use crc::{CRC_15_CAN, Crc};

/// Bits after the CRC, which are not stuffed: CRC delimiter, acknowledgement 2, end of frame 7, intermission 3.
pub const TAIL_BITS: u32 = 13;
/// Bits between two frames.
pub const INTERMISSION_BITS: u32 = 3;
/// Equal bits after which the other kind is stuffed in.
const LONGEST_RUN: u32 = 5;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_15_CAN);

/// Bits from start of frame to CRC, the first one highest among `count`. At most 118, those of an extended frame of 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BitSequence {
    bits: u128,
    count: u32,
}

impl BitSequence {
    /// Adds the low `count` bits of `value`, the highest of them first.
    fn push(&mut self, value: u32, count: u32) {
        self.bits = (self.bits << count) | u128::from(value & ((1 << count) - 1));
        self.count += count;
    }

    /// The CRC-15 of all bits so far. It starts at 0, so that zeros ahead of the first bit change nothing.
    fn crc(self) -> u32 {
        u32::from(CRC.checksum(&self.bits.to_be_bytes()))
    }

    /// The bits, the first one first.
    pub fn iter(self) -> impl Iterator<Item = bool> {
        (0..self.count).rev().map(move |place| self.bits >> place & 1 == 1)
    }

    /// Bits that stuffing adds.
    #[must_use]
    pub fn stuffing(self) -> u32 {
        let (mut added, mut run, mut last) = (0, 0, None);
        for bit in self.iter() {
            run = if last == Some(bit) { run + 1 } else { 1 };
            last = Some(bit);
            if run == LONGEST_RUN {
                (added, run, last) = (added + 1, 1, Some(!bit));
            }
        }
        added
    }
}

/// Bits of a frame from start of frame to CRC, before stuffing.
#[must_use]
pub fn sequence(frame: &CanFrame) -> BitSequence {
    let mut bits = BitSequence::default();
    let raw_id = frame.raw_id();
    let remote = u32::from(raw_id & REMOTE_FLAG != 0);
    bits.push(0, 1);
    if raw_id & EXTENDED_FLAG == 0 {
        bits.push(raw_id, 11);
        bits.push(remote << 2, 3);
    } else {
        bits.push(raw_id >> 18, 11);
        bits.push(0b11, 2);
        bits.push(raw_id, 18);
        bits.push(remote << 2, 3);
    }
    // A request says how much it asks for and carries nothing.
    bits.push(frame.data().len() as u32, 4);
    if remote == 0 {
        frame.data().iter().for_each(|byte| bits.push(u32::from(*byte), 8));
    }
    bits.push(bits.crc(), 15);
    bits
}

/// Bits that a frame occupies the wire for, intermission included.
#[must_use]
pub fn on_the_wire(frame: &CanFrame) -> u32 {
    let sequence = sequence(frame);
    sequence.count + sequence.stuffing() + TAIL_BITS
}

/// Rank of a frame in arbitration: the lower wins. Bits in the order in which they are sent: standard before extended with the
/// same first 11 bits, data before a request for them.
#[must_use]
pub fn arbitration_rank(frame: &CanFrame) -> u32 {
    let raw_id = frame.raw_id();
    let remote = u32::from(raw_id & REMOTE_FLAG != 0);
    if raw_id & EXTENDED_FLAG == 0 {
        return (raw_id & STANDARD_MASK) << 21 | remote << 20;
    }
    let (base, rest) = (raw_id >> 18 & STANDARD_MASK, raw_id & 0x3_FFFF);
    base << 21 | 0b11 << 19 | rest << 1 | remote
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus_load::worst_case_bits;
    use proptest::prelude::*;

    /// The algorithm as the standard writes it, bit by bit.
    fn crc_of_the_standard(bits: impl Iterator<Item = bool>) -> u32 {
        bits.fold(0, |crc: u32, bit| {
            let next = bit ^ (crc >> 14 & 1 == 1);
            let crc = crc << 1 & 0x7FFF;
            if next { crc ^ 0x4599 } else { crc }
        })
    }

    #[test]
    fn crc_is_that_of_the_catalogue_and_of_the_standard() {
        // The check value of CRC-15/CAN in Cook's catalogue.
        assert_eq!(CRC.checksum(b"123456789"), 0x059E);
        let sequence = sequence(&CanFrame::new(0x123, &[1, 2, 3]));
        let crc = (sequence.bits & 0x7FFF) as u32;
        assert_eq!(crc_of_the_standard(sequence.iter().take(sequence.count as usize - 15)), crc);
    }

    /// Nothing but zeros: 34 of them up to a CRC that is 0 too, one bit stuffed in after each fifth.
    #[test]
    fn the_frame_of_zeros_is_counted_by_hand() {
        let frame = CanFrame::new(0, &[]);
        assert_eq!(sequence(&frame), BitSequence { bits: 0, count: 34 });
        assert_eq!(on_the_wire(&frame), 34 + 6 + 13);
    }

    /// Start of frame, 0x555, RTR, IDE, r0, DLC 1, one byte 0x55, by hand: 0 10101010101 000 0001 01010101. One run of more
    /// than four: 000 and 000 of the DLC, with one bit stuffed in after the fifth; the rest is the CRC's.
    #[test]
    fn fields_are_in_the_order_of_the_standard() {
        let bits: String =
            sequence(&CanFrame::new(0x555, &[0x55])).iter().map(|bit| if bit { '1' } else { '0' }).collect();
        assert_eq!(bits[..27], *"010101010101000000101010101");
        let extended = sequence(&CanFrame::from_raw(EXTENDED_FLAG | REMOTE_FLAG | 0x1555_5555, &[0; 3]));
        let bits: String = extended.iter().map(|bit| if bit { '1' } else { '0' }).collect();
        assert_eq!(bits[..39], *"010101010101110101010101010101011000011");
        assert_eq!(extended.count, 39 + 15, "a request carries no data");
    }

    /// Five equal bits, then fours that alternate: the worst sequence that stuffing knows.
    #[test]
    fn the_worst_case_of_stuffing_is_reached_by_bits_and_not_by_frames() {
        let mut worst = BitSequence::default();
        worst.push(0, 1);
        while worst.count < 98 {
            worst.push(u32::from((worst.count - 1) / 4 % 2 == 1), 1);
        }
        assert_eq!(worst.count + worst.stuffing() + TAIL_BITS, worst_case_bits(8));
        assert_eq!(worst_case_bits(8), 135);
        // The longest real frame of 8 bytes.
        let frame = CanFrame::new(0x7FE, &[0x01, 0xE1, 0xE1, 0xE1, 0xE7, 0xC3, 0xC0, 0x1E]);
        assert_eq!(on_the_wire(&frame), 133);
        // Of 7 bytes, all but one.
        let frame = CanFrame::new(0x01F, &[0x87, 0x87, 0xC1, 0xE1, 0xE1, 0xE1, 0xE1]);
        assert_eq!(on_the_wire(&frame), worst_case_bits(7) - 1);
    }

    #[test]
    fn standard_wins_against_extended_and_data_against_requests() {
        let extended = EXTENDED_FLAG | 0x110 << 18;
        let in_order =
            [0x10F, 0x110, REMOTE_FLAG | 0x110, extended, extended | REMOTE_FLAG, extended | 1, 0x111];
        let ranks = in_order.map(|raw_id| arbitration_rank(&CanFrame::from_raw(raw_id, &[])));
        assert!(ranks.is_sorted_by(|one, other| one < other), "{ranks:X?}");
    }

    proptest! {
        #[test]
        fn no_frame_exceeds_the_worst_case(id in 0..0x800_u16, data in proptest::collection::vec(any::<u8>(), 0..=8)) {
            let bits = on_the_wire(&CanFrame::new(id, &data));
            prop_assert!(bits <= worst_case_bits(data.len() as u8));
            prop_assert!(bits >= 47 + 8 * data.len() as u32);
        }

        /// Bytes of which stuffing makes the most.
        #[test]
        fn nor_does_one_of_long_runs(id in 0..0x800_u16, data in proptest::collection::vec(
            proptest::sample::select(vec![0x0F_u8, 0xF0, 0x87, 0x78, 0xC3, 0x3C, 0xE1, 0x1E]), 0..=8)) {
            prop_assert!(on_the_wire(&CanFrame::new(id, &data)) <= worst_case_bits(data.len() as u8));
        }

        #[test]
        fn the_crc_is_always_that_of_the_standard(raw_id in 0..0x2000_0000_u32, extended: bool, data: [u8; 8]) {
            let raw_id = if extended { EXTENDED_FLAG | raw_id } else { raw_id & 0x7FF };
            let sequence = sequence(&CanFrame::from_raw(raw_id, &data));
            let expected = crc_of_the_standard(sequence.iter().take(sequence.count as usize - 15));
            prop_assert_eq!((sequence.bits & 0x7FFF) as u32, expected);
        }
    }
}
