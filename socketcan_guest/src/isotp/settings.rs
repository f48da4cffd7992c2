//! Options of a transport socket, and their effect on frames.

use super::DATA_BYTES;
use rustix::io::Errno;
use std::time::Duration;

/// Options of `SOL_CAN_ISOTP`.
const OPTIONS: i32 = 1;
const FLOW_CONTROL: i32 = 2;
const SENT_GAP: i32 = 3;
const RECEIVED_GAP: i32 = 4;
const LINK_LAYER: i32 = 5;

/// `flags` of `struct can_isotp_options`.
pub(super) mod flag {
    pub(in super::super) const LISTEN_MODE: u32 = 0x0001;
    pub(in super::super) const EXTEND_ADDR: u32 = 0x0002;
    pub(in super::super) const TX_PADDING: u32 = 0x0004;
    pub(in super::super) const RX_PADDING: u32 = 0x0008;
    pub(in super::super) const CHK_PAD_LEN: u32 = 0x0010;
    pub(in super::super) const CHK_PAD_DATA: u32 = 0x0020;
    pub(in super::super) const HALF_DUPLEX: u32 = 0x0040;
    pub(in super::super) const FORCE_TXSTMIN: u32 = 0x0080;
    pub(in super::super) const FORCE_RXSTMIN: u32 = 0x0100;
    pub(in super::super) const RX_EXT_ADDR: u32 = 0x0200;
    pub(in super::super) const WAIT_TX_DONE: u32 = 0x0400;
    pub(in super::super) const SF_BROADCAST: u32 = 0x0800;
    pub(in super::super) const CF_BROADCAST: u32 = 0x1000;
}

/// `CAN_ISOTP_FRAME_TXTIME_ZERO`; 0 leaves the time as it is.
const NO_FRAME_TIME: u32 = u32::MAX;
const CLASSIC_MTU: u8 = 16;
const FD_MTU: u8 = 72;

/// The options of an ISO-TP socket, as `setsockopt` set them.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    flags: u32,
    /// As set, ns; the effective value is `frame_time_ns`.
    given_frame_time_ns: u32,
    address: u8,
    sent_padding: u8,
    received_padding: u8,
    pub(super) received_address: u8,
    frame_time_ns: u32,
    /// Block size, STmin and number of waits of our flow control frames.
    flow_control: [u8; 3],
    sent_gap_ns: u32,
    received_gap_ns: u32,
    /// MTU, data length, flags.
    link_layer: [u8; 3],
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            flags: 0,
            given_frame_time_ns: 50_000,
            address: 0,
            sent_padding: 0xCC,
            received_padding: 0xCC,
            received_address: 0,
            frame_time_ns: 50_000,
            flow_control: [0; 3],
            sent_gap_ns: 0,
            received_gap_ns: 0,
            link_layer: [CLASSIC_MTU, DATA_BYTES as u8, 0],
        }
    }
}

impl Settings {
    /// `setsockopt`.
    ///
    /// # Errors
    /// `EINVAL` for a wrong length, both kinds of broadcast at once, or an unsupported link layer; `ENOPROTOOPT`.
    pub(super) fn set(&mut self, option: i32, value: &[u8]) -> Result<(), Errno> {
        let number = || value.try_into().map(u32::from_ne_bytes).map_err(|_| Errno::INVAL);
        let three = || <[u8; 3]>::try_from(value).map_err(|_| Errno::INVAL);
        match option {
            OPTIONS => self.set_options(value.try_into().map_err(|_| Errno::INVAL)?)?,
            FLOW_CONTROL => self.flow_control = three()?,
            SENT_GAP => self.sent_gap_ns = number()?,
            RECEIVED_GAP => self.received_gap_ns = number()?,
            LINK_LAYER => {
                let link_layer @ [mtu, data_length, flags] = three()?;
                let is_classic = mtu == CLASSIC_MTU && usize::from(data_length) == DATA_BYTES && flags == 0;
                let is_fd = mtu == FD_MTU && [8, 12, 16, 20, 24, 32, 48, 64].contains(&data_length);
                if !is_classic && !is_fd {
                    return Err(Errno::INVAL);
                }
                self.link_layer = link_layer;
            }
            _ => return Err(Errno::NOPROTOOPT),
        }
        Ok(())
    }

    fn set_options(&mut self, value: [u8; 12]) -> Result<(), Errno> {
        let [f0, f1, f2, f3, t0, t1, t2, t3, address, sent_padding, received_padding, received_address] =
            value;
        self.flags = u32::from_ne_bytes([f0, f1, f2, f3]);
        self.given_frame_time_ns = u32::from_ne_bytes([t0, t1, t2, t3]);
        (self.address, self.sent_padding, self.received_padding) = (address, sent_padding, received_padding);
        self.received_address = if self.has(flag::RX_EXT_ADDR) { received_address } else { address };
        let both = self.flags & flag::SF_BROADCAST != 0 && self.flags & flag::CF_BROADCAST != 0;
        if both {
            self.flags &= !flag::CF_BROADCAST;
        }
        match self.given_frame_time_ns {
            0 => {}
            NO_FRAME_TIME => self.frame_time_ns = 0,
            time_ns => self.frame_time_ns = time_ns,
        }
        if both { Err(Errno::INVAL) } else { Ok(()) }
    }

    /// `getsockopt`.
    ///
    /// # Errors
    /// `ENOPROTOOPT`.
    pub(super) fn get(&self, option: i32) -> Result<Vec<u8>, Errno> {
        Ok(match option {
            OPTIONS => {
                let bytes = [self.address, self.sent_padding, self.received_padding, self.received_address];
                [self.flags.to_ne_bytes(), self.given_frame_time_ns.to_ne_bytes(), bytes].concat()
            }
            FLOW_CONTROL => self.flow_control.to_vec(),
            SENT_GAP => self.sent_gap_ns.to_ne_bytes().to_vec(),
            RECEIVED_GAP => self.received_gap_ns.to_ne_bytes().to_vec(),
            LINK_LAYER => self.link_layer.to_vec(),
            _ => return Err(Errno::NOPROTOOPT),
        })
    }

    pub(super) fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }

    /// Whether it sends without flow control.
    pub(super) fn broadcasts(&self) -> bool {
        self.has(flag::SF_BROADCAST | flag::CF_BROADCAST)
    }

    pub(super) fn wants_can_fd(&self) -> bool {
        self.link_layer[0] == FD_MTU
    }

    /// Bytes of the extended address at the start of the data.
    pub(super) fn address_bytes(&self) -> usize {
        usize::from(self.has(flag::EXTEND_ADDR))
    }

    /// Frames of a block in our flow control; 0: no blocks.
    pub(super) fn block_size(&self) -> u8 {
        self.flow_control[0]
    }

    /// The time before each consecutive frame, by the peer's STmin.
    pub(super) fn st_min(&self, stmin: u8) -> Duration {
        let asked = match stmin {
            _ if self.has(flag::FORCE_TXSTMIN) => Duration::from_nanos(self.sent_gap_ns.into()),
            0..=0x7F => Duration::from_millis(stmin.into()),
            0xF1..=0xF9 => Duration::from_micros(100 * u64::from(stmin - 0xF0)),
            _ => Duration::from_millis(0x7F),
        };
        asked + Duration::from_nanos(self.frame_time_ns.into())
    }

    /// The same for a broadcast, which has no flow control.
    pub(super) fn st_min_of_a_broadcast(&self) -> Duration {
        let forced = self.has(flag::FORCE_TXSTMIN);
        Duration::from_nanos(if forced { self.sent_gap_ns } else { self.frame_time_ns }.into())
    }

    /// Consecutive frames closer together than this are ignored.
    pub(super) fn least_received_gap(&self) -> Option<Duration> {
        self.has(flag::FORCE_RXSTMIN).then(|| Duration::from_nanos(self.received_gap_ns.into()))
    }

    /// The data of a frame: extended address, head, payload, padding to 8 bytes if enabled.
    pub(super) fn data_of(&self, head: &[u8], payload: &[u8]) -> Vec<u8> {
        let address = [self.address];
        let mut data = [&address[..self.address_bytes()], head, payload].concat();
        if self.has(flag::TX_PADDING) {
            data.resize(DATA_BYTES, self.sent_padding);
        }
        data
    }

    pub(super) fn flow_control_of(&self, status: u8) -> Vec<u8> {
        let [block_size, stmin, _] = self.flow_control;
        self.data_of(&[super::kind::FLOW_CONTROL | status, block_size, stmin], &[])
    }

    /// Whether a wrong padding is an error.
    pub(super) fn checks_padding(&self) -> bool {
        self.has(flag::CHK_PAD_LEN | flag::CHK_PAD_DATA)
    }

    /// Whether the bytes after `end` are the requested padding, if any.
    pub(super) fn is_padded_right(&self, data: &[u8], length: usize, end: usize) -> bool {
        let (by_length, by_content) = (self.has(flag::CHK_PAD_LEN), self.has(flag::CHK_PAD_DATA));
        if !self.has(flag::RX_PADDING) {
            // Without padding a frame has its least length, and there is no content to compare.
            return if by_length { length == end } else { !by_content };
        }
        let padding = &data[end.min(length)..length];
        (!by_length || length == DATA_BYTES)
            && (!by_content || padding.iter().all(|byte| *byte == self.received_padding))
    }
}
