//! Packets of XCP on CAN: commands, refusals, and reading and writing their fields, in Intel byte order.
//!
//! A packet is 1 to 8 bytes; what we send is padded to 8 with zeros, as `rig.dbc` says.
//!
//! Source: ASAM MCD-1 XCP 1.1, part 2 (protocol layer) and part 3 (XCP on CAN).

/// Bytes of a packet: MAX_CTO and MAX_DTO.
pub(crate) const BYTES: usize = 8;
pub(crate) type Packet = [u8; BYTES];

/// First byte of a positive response.
pub(crate) const RESPONSE: u8 = 0xFF;
/// First byte of an error packet.
pub(crate) const ERROR: u8 = 0xFE;
/// First byte of an event.
pub(crate) const EVENT: u8 = 0xFD;
/// Event: the parameter set was stored.
pub(crate) const EVENT_STORED: u8 = 0x03;
/// Highest first byte of a DAQ packet.
pub(crate) const LAST_PID: u8 = 0xFB;

/// Commands by their first byte, under the names of the standard.
pub(crate) mod command {
    pub(crate) const CONNECT: u8 = 0xFF;
    pub(crate) const DISCONNECT: u8 = 0xFE;
    pub(crate) const GET_STATUS: u8 = 0xFD;
    pub(crate) const SYNCH: u8 = 0xFC;
    pub(crate) const GET_COMM_MODE_INFO: u8 = 0xFB;
    pub(crate) const GET_ID: u8 = 0xFA;
    pub(crate) const SET_REQUEST: u8 = 0xF9;
    pub(crate) const GET_SEED: u8 = 0xF8;
    pub(crate) const UNLOCK: u8 = 0xF7;
    pub(crate) const SET_MTA: u8 = 0xF6;
    pub(crate) const UPLOAD: u8 = 0xF5;
    pub(crate) const SHORT_UPLOAD: u8 = 0xF4;
    pub(crate) const BUILD_CHECKSUM: u8 = 0xF3;
    pub(crate) const DOWNLOAD: u8 = 0xF0;
    pub(crate) const DOWNLOAD_NEXT: u8 = 0xEF;
    pub(crate) const CLEAR_DAQ_LIST: u8 = 0xE3;
    pub(crate) const SET_DAQ_PTR: u8 = 0xE2;
    pub(crate) const WRITE_DAQ: u8 = 0xE1;
    pub(crate) const SET_DAQ_LIST_MODE: u8 = 0xE0;
    pub(crate) const GET_DAQ_LIST_MODE: u8 = 0xDF;
    pub(crate) const START_STOP_DAQ_LIST: u8 = 0xDE;
    pub(crate) const START_STOP_SYNCH: u8 = 0xDD;
    pub(crate) const GET_DAQ_CLOCK: u8 = 0xDC;
    pub(crate) const READ_DAQ: u8 = 0xDB;
    pub(crate) const GET_DAQ_PROCESSOR_INFO: u8 = 0xDA;
    pub(crate) const GET_DAQ_RESOLUTION_INFO: u8 = 0xD9;
    pub(crate) const GET_DAQ_EVENT_INFO: u8 = 0xD7;
    pub(crate) const FREE_DAQ: u8 = 0xD6;
    pub(crate) const ALLOC_DAQ: u8 = 0xD5;
    pub(crate) const ALLOC_ODT: u8 = 0xD4;
    pub(crate) const ALLOC_ODT_ENTRY: u8 = 0xD3;
}

/// Why a command is refused; the number crosses the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Refusal {
    /// The answer to SYNCH: the command processor is reset.
    Synch = 0x00,
    /// An earlier request is not finished.
    Busy = 0x10,
    DaqActive = 0x11,
    Unknown = 0x20,
    /// Too short.
    Syntax = 0x21,
    OutOfRange = 0x22,
    /// Never written, or only at the start.
    WriteProtected = 0x23,
    /// No such memory, or not now.
    AccessDenied = 0x24,
    AccessLocked = 0x25,
    Sequence = 0x29,
    /// Lists that cannot run with these settings.
    DaqConfig = 0x2A,
    MemoryOverflow = 0x30,
}

#[derive(Clone, Copy)]
pub(crate) struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// Byte `at`.
    ///
    /// # Errors
    /// [`Refusal::Syntax`] when the packet is shorter; the same for all fields.
    pub(crate) fn byte(self, at: usize) -> Result<u8, Refusal> {
        self.0.get(at).copied().ok_or(Refusal::Syntax)
    }

    /// The two bytes from `at` on.
    pub(crate) fn word(self, at: usize) -> Result<u16, Refusal> {
        Ok(u16::from_le_bytes([self.byte(at)?, self.byte(at + 1)?]))
    }

    /// The four bytes from `at` on.
    pub(crate) fn long(self, at: usize) -> Result<u32, Refusal> {
        let [low, high] = [self.word(at)?, self.word(at + 2)?];
        Ok(u32::from(low) | u32::from(high) << 16)
    }

    pub(crate) fn bytes(self, at: usize, count: usize) -> Result<&'a [u8], Refusal> {
        self.0.get(at..at + count).ok_or(Refusal::Syntax)
    }
}

/// A positive response with these bytes after its first.
///
/// # Panics
/// With more than 7 bytes, which no command here has.
pub(crate) fn response(bytes: &[u8]) -> Packet {
    let mut packet = [0; BYTES];
    packet[0] = RESPONSE;
    packet[1..=bytes.len()].copy_from_slice(bytes);
    packet
}

pub(crate) fn refusal(why: Refusal) -> Packet {
    [ERROR, why as u8, 0, 0, 0, 0, 0, 0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_that_is_not_there_is_a_syntax_error() {
        let fields = Fields(&[0xF6, 0x01, 0x02, 0x03, 0x04]);
        assert_eq!(fields.long(1), Ok(0x0403_0201));
        assert_eq!(fields.long(2), Err(Refusal::Syntax));
        assert_eq!(fields.bytes(3, 3), Err(Refusal::Syntax));
    }
}
