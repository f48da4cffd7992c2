//! One classic CAN frame, laid out as the kernel lays out `struct can_frame`.
//!
//! The same 16 bytes travel on a SocketCAN socket and on the embedded bus, so that a frame has one
//! form in this project and a foreign client that speaks `struct can_frame` needs no translation.
//!
//! Source: Linux `include/uapi/linux/can.h`; for the text, `lib.c` of can-utils.

use std::fmt;

/// Bytes of one `struct can_frame`.
pub const CAN_FRAME_BYTES: usize = 16;

/// Flag of an extended (29-bit) identifier.
pub const EXTENDED_FLAG: u32 = 0x8000_0000;
/// Flag of a remote transmission request.
pub const REMOTE_FLAG: u32 = 0x4000_0000;
/// Flag of an error frame.
pub const ERROR_FLAG: u32 = 0x2000_0000;
/// Bits of an 11-bit identifier.
pub const STANDARD_MASK: u32 = 0x7FF;
/// Bits of a 29-bit identifier.
pub const EXTENDED_MASK: u32 = 0x1FFF_FFFF;
/// Bits of an error frame's class.
pub const ERROR_MASK: u32 = EXTENDED_MASK;

/// A classic CAN frame: identifier with the kernel's flags, and 0 to 8 bytes of data.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    can_id: u32,
    len: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A data frame with an 11-bit identifier.
    ///
    /// # Panics
    /// If `id` exceeds 11 bits or `data` 8 bytes: both come from `rig.dbc`, which the generator of the frames checks.
    #[must_use]
    pub fn new(id: u16, data: &[u8]) -> Self {
        assert!(u32::from(id) <= STANDARD_MASK, "identifier {id:#x} exceeds 11 bits");
        Self::from_raw(u32::from(id), data)
    }

    /// A frame from an identifier that carries the kernel's flags, as a foreign client sent it.
    ///
    /// # Panics
    /// If `data` is longer than 8 bytes.
    #[must_use]
    pub fn from_raw(can_id: u32, data: &[u8]) -> Self {
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(data);
        Self { can_id, len: data.len() as u8, data: bytes }
    }

    /// The frame in 16 bytes of `struct can_frame`; `None` when the length byte says more than 8.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; CAN_FRAME_BYTES]) -> Option<Self> {
        let [i0, i1, i2, i3, len, _, _, _, data @ ..] = *bytes;
        if len > 8 {
            return None;
        }
        let mut frame = Self { can_id: u32::from_ne_bytes([i0, i1, i2, i3]), len, data };
        // Bytes beyond the length are not part of the frame; clearing them makes equality mean what it says.
        frame.data[usize::from(len)..].fill(0);
        Some(frame)
    }

    /// The 16 bytes of `struct can_frame`.
    #[must_use]
    pub fn to_bytes(self) -> [u8; CAN_FRAME_BYTES] {
        let mut bytes = [0; CAN_FRAME_BYTES];
        bytes[..4].copy_from_slice(&self.can_id.to_ne_bytes());
        bytes[4] = self.len;
        bytes[8..].copy_from_slice(&self.data);
        bytes
    }

    /// Identifier with the kernel's flags in its three highest bits.
    #[must_use]
    pub fn raw_id(&self) -> u32 {
        self.can_id
    }

    /// The 11-bit identifier of a plain data frame; `None` for extended, remote and error frames.
    #[must_use]
    pub fn standard_id(&self) -> Option<u16> {
        (self.can_id <= STANDARD_MASK).then_some(self.can_id as u16)
    }

    /// The data, 0 to 8 bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}

impl fmt::Display for CanFrame {
    /// As `candump -L` writes it: `123#0011AABB`, with 8 digits for 29 bits; `123#R` is a remote request, and an error
    /// frame keeps its flag: `20000004#...`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.can_id & ERROR_FLAG != 0 {
            write!(f, "{:08X}#", self.can_id & (ERROR_FLAG | EXTENDED_MASK))?;
        } else if self.can_id & EXTENDED_FLAG != 0 {
            write!(f, "{:08X}#", self.can_id & EXTENDED_MASK)?;
        } else {
            write!(f, "{:03X}#", self.can_id & STANDARD_MASK)?;
        }
        if self.can_id & REMOTE_FLAG != 0 {
            // A request carries no data, but may say how much it asks for.
            return if self.len == 0 { write!(f, "R") } else { write!(f, "R{}", self.len) };
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_the_kernels_struct() {
        let frame = CanFrame::new(0x123, &[1, 2, 3]);
        let mut expected = [0; 16];
        expected[..4].copy_from_slice(&0x123_u32.to_ne_bytes());
        expected[4] = 3;
        expected[8..11].copy_from_slice(&[1, 2, 3]);
        assert_eq!(frame.to_bytes(), expected);
        assert_eq!(CanFrame::from_bytes(&expected), Some(frame));
    }

    #[test]
    fn length_beyond_eight_is_no_frame() {
        let mut bytes = CanFrame::new(1, &[]).to_bytes();
        bytes[4] = 9;
        assert_eq!(CanFrame::from_bytes(&bytes), None);
    }

    #[test]
    fn extended_remote_and_error_frames_have_no_standard_id() {
        for flag in [EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG] {
            assert_eq!(CanFrame::from_raw(flag | 0x110, &[]).standard_id(), None);
        }
    }

    #[test]
    fn text_is_that_of_candump() {
        let both = EXTENDED_FLAG | REMOTE_FLAG;
        // The texts are those of sprint_canframe in can-utils' lib.c.
        for (raw_id, data, text) in [
            (0x11, &[0xAB, 1][..], "011#AB01"),
            (EXTENDED_FLAG | 0x110, &[], "00000110#"),
            (EXTENDED_FLAG | 0x1FFF_FFFF, &[7], "1FFFFFFF#07"),
            (REMOTE_FLAG | 0x110, &[], "110#R"),
            (REMOTE_FLAG | 0x110, &[0; 5], "110#R5"),
            (both | 0x110, &[], "00000110#R"),
            (ERROR_FLAG | 0x4, &[0, 0x40], "20000004#0040"),
            (ERROR_FLAG | EXTENDED_FLAG | 0x4, &[], "20000004#"),
        ] {
            assert_eq!(CanFrame::from_raw(raw_id, data).to_string(), text);
        }
    }
}
