//! The checksum of command frames: CRC-8 SAE J1850 over identifier and data.
//!
//! A valve command that was corrupted, or that was meant for the other axis, must not move a valve. The identifier is part of the
//! sum so that the second is found too.
//!
//! ```text
//! crc = CRC-8(id low byte, id high byte, data before the crc)   polynomial 0x1D, start 0xFF, final xor 0xFF
//! ```
//!
//! Source: SAE J1850; parameters as `CRC-8/SAE-J1850` in Cook's catalogue of CRC algorithms.

use crc::{CRC_8_SAE_J1850, Crc};

const ALGORITHM: Crc<u8> = Crc::<u8>::new(&CRC_8_SAE_J1850);

/// The checksum of a frame with identifier `id` whose data before the checksum's byte are `data`.
#[must_use]
pub fn of(id: u16, data: &[u8]) -> u8 {
    let mut digest = ALGORITHM.digest();
    digest.update(&id.to_le_bytes());
    digest.update(data);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Frame, ValveCommand};

    #[test]
    fn check_value_is_that_of_the_catalogue() {
        assert_eq!(ALGORITHM.checksum(b"123456789"), 0x4B);
    }

    /// Data before the checksum from cantools 45.1 (`get_message_by_name(name).encode(values)`), checksum from crccheck 1.3.1
    /// (`crccheck.crc.Crc8SaeJ1850.calc(frame_id.to_bytes(2, "little") + data[:4])`).
    #[test]
    fn golden_frames_are_those_of_cantools_and_crccheck() {
        let command = |opening, alive, echo, enable| ValveCommand { opening, alive, echo, enable };
        let golden = [
            (Frame::DriveValveCommand(command(0.0, 0, 0, false)), "110#0000000088"),
            (Frame::LoadValveCommand(command(-1.0, 15, 4095, true)), "111#01F8FF1FE0"),
            (Frame::DriveValveCommand(command(0.5, 7, 0x123, true)), "110#00742311B7"),
        ];
        for (frame, expected) in golden {
            assert_eq!(frame.encode().unwrap().to_string(), expected);
        }
    }

    #[test]
    fn the_other_axis_has_another_checksum() {
        assert_ne!(of(0x110, &[1, 2, 3, 4]), of(0x111, &[1, 2, 3, 4]));
    }
}
