//! Numbers and layouts of Linux' CAN interface, as compiled into programs.
//!
//! Structures are read from and written to a guest's memory as bytes; their offsets are those of 64-bit Linux.
//!
//! Source: Linux `include/uapi/linux/can.h`, `can/raw.h`, `can/bcm.h`, `if.h`, `if_arp.h`, `sockios.h`.

use protocol::can::{CAN_FRAME_BYTES, ERROR_FLAG};

pub(crate) const AF_CAN: i32 = 29;
/// Offset of the data in a frame.
pub(crate) const CAN_FRAME_DATA_AT: usize = 8;
/// Largest data length of a classic frame.
pub(crate) const MOST_DATA: u8 = 8;

/// `SOL_CAN_BASE`, the lowest level of CAN's options.
pub(crate) const SOL_CAN_FIRST: i32 = 100;
/// `SOL_CAN_J1939`, the highest.
pub(crate) const SOL_CAN_LAST: i32 = 107;
pub(crate) const SOL_CAN_RAW: i32 = 101;
pub(crate) const SOL_CAN_ISOTP: i32 = 106;

/// Protocols of `AF_CAN`.
pub(crate) const CAN_RAW: i32 = 1;
pub(crate) const CAN_BCM: i32 = 2;
pub(crate) const CAN_ISOTP: i32 = 6;
/// One more than the largest protocol of the kernel's table.
pub(crate) const CAN_PROTOCOLS: i32 = 8;

/// Inverts a filter; in a filter the bit of error frames has this meaning.
pub(crate) const INVERTED_FLAG: u32 = ERROR_FLAG;

/// Bytes of `struct sockaddr_can` that the kernel requires and returns: family, two of padding, index of the interface.
pub(crate) const ADDRESS_BYTES: usize = 8;

pub(crate) fn address(interface: u32) -> [u8; ADDRESS_BYTES] {
    let mut bytes = [0; ADDRESS_BYTES];
    bytes[..2].copy_from_slice(&(AF_CAN as u16).to_ne_bytes());
    bytes[4..].copy_from_slice(&interface.to_ne_bytes());
    bytes
}

/// Index of the interface in an address; `None` when it is too short or of another family.
pub(crate) fn interface_of(address: &[u8]) -> Option<u32> {
    let address: &[u8; ADDRESS_BYTES] = address.get(..ADDRESS_BYTES)?.try_into().ok()?;
    let [f0, f1, _, _, index @ ..] = *address;
    (i32::from(u16::from_ne_bytes([f0, f1])) == AF_CAN).then_some(u32::from_ne_bytes(index))
}

/// A frame's identifier, flags included.
pub(crate) fn identifier(frame: &[u8; CAN_FRAME_BYTES]) -> u32 {
    u32_at(frame, 0)
}

/// A classic frame.
pub(crate) fn frame(id: u32, data: &[u8]) -> [u8; CAN_FRAME_BYTES] {
    let mut frame = [0; CAN_FRAME_BYTES];
    frame[..4].copy_from_slice(&id.to_ne_bytes());
    frame[4] = data.len() as u8;
    frame[CAN_FRAME_DATA_AT..CAN_FRAME_DATA_AT + data.len()].copy_from_slice(data);
    frame
}

/// The native 32-bit number at an offset.
pub(crate) fn u32_at(bytes: &[u8], offset: usize) -> u32 {
    let four = bytes[offset..offset + 4].try_into();
    u32::from_ne_bytes(four.expect("a slice of four bytes"))
}

/// The native 64-bit number at an offset.
pub(crate) fn u64_at(bytes: &[u8], offset: usize) -> u64 {
    let eight = bytes[offset..offset + 8].try_into();
    u64::from_ne_bytes(eight.expect("a slice of eight bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_as_it_is_written() {
        assert_eq!(interface_of(&address(7)), Some(7));
        assert_eq!(address(7)[..2], 29_u16.to_ne_bytes());
        assert_eq!(interface_of(&address(7)[..7]), None);
        assert_eq!(interface_of(&[2, 0, 0, 0, 7, 0, 0, 0]), None);
    }
}
