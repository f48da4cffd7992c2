//! State of a `CAN_RAW` socket: filters and options, and which frames pass.
//!
//! ```text
//!   error frame    passes where (class & mask) != 0: of CAN_RAW_ERR_FILTER, or of a filter whose mask has the error flag
//!   any other      passes a filter where (id & mask) == (filter & mask), or != with CAN_INV_FILTER
//!                  passes the list where one filter lets it pass; with CAN_RAW_JOIN_FILTERS where all do
//! ```
//!
//! Source: Linux 6.1 `net/can/raw.c` (`raw_rcv`, `raw_setsockopt`, `raw_getsockopt`), `net/can/af_can.c` (`find_rcv_list`,
//! `can_rcv_filter`).

use crate::abi::{INVERTED_FLAG, u32_at};
use protocol::can::{ERROR_FLAG, ERROR_MASK, EXTENDED_FLAG, REMOTE_FLAG, STANDARD_MASK};
use rustix::io::Errno;

/// Options of `SOL_CAN_RAW`.
const FILTER: i32 = 1;
const ERROR_FILTER: i32 = 2;
const LOOPBACK: i32 = 3;
const RECEIVE_OWN: i32 = 4;
const FD_FRAMES: i32 = 5;
const JOIN_FILTERS: i32 = 6;
const XL_FRAMES: i32 = 7;

/// `sizeof(struct can_filter)`.
const FILTER_BYTES: usize = 8;
/// `CAN_RAW_FILTER_MAX`.
const MOST_FILTERS: usize = 512;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Filter {
    id: u32,
    mask: u32,
}

impl Filter {
    fn is_passed_by(self, id: u32) -> bool {
        let mut mask = self.mask;
        if mask & ERROR_FLAG != 0 {
            return id & ERROR_FLAG != 0 && id & mask & ERROR_MASK != 0;
        }
        if id & ERROR_FLAG != 0 {
            return false;
        }
        // A filter for 11-bit identifiers only.
        if mask & EXTENDED_FLAG != 0 && self.id & EXTENDED_FLAG == 0 {
            mask &= STANDARD_MASK | EXTENDED_FLAG | REMOTE_FLAG;
        }
        let is_inverted = self.id & INVERTED_FLAG != 0;
        (id & mask == self.id & !INVERTED_FLAG & mask) != is_inverted
    }
}

#[derive(Clone, Debug)]
pub(crate) struct RawOptions {
    filters: Vec<Filter>,
    /// The other options as set, by their numbers; any value but 0 switches on.
    numbers: [u32; XL_FRAMES as usize + 1],
}

impl Default for RawOptions {
    fn default() -> Self {
        let mut numbers = [0; XL_FRAMES as usize + 1];
        numbers[LOOPBACK as usize] = 1;
        Self { filters: vec![Filter { id: 0, mask: 0 }], numbers }
    }
}

impl RawOptions {
    /// Whether the other guests on the interface receive the frames of this socket.
    pub(crate) fn loops_back(&self) -> bool {
        self.is_on(LOOPBACK)
    }

    pub(crate) fn receives_what_it_sends(&self) -> bool {
        self.is_on(RECEIVE_OWN)
    }

    fn is_on(&self, option: i32) -> bool {
        self.numbers[option as usize] != 0
    }

    /// Whether a frame of this identifier, flags included, passes.
    pub(crate) fn passes(&self, id: u32) -> bool {
        let passed = self.filters.iter().filter(|filter| filter.is_passed_by(id)).count();
        let by_error_filter = id & ERROR_FLAG != 0 && id & self.numbers[ERROR_FILTER as usize] != 0;
        let count = passed + usize::from(by_error_filter);
        // The kernel counts the matches of an entry of its lists, whichever option created it.
        if self.is_on(JOIN_FILTERS) && self.filters.len() > 1 {
            count >= self.filters.len()
        } else {
            count > 0
        }
    }

    /// `setsockopt`.
    ///
    /// # Errors
    /// `EINVAL` for a wrong length, and for CAN FD off where CAN XL, which includes it, is on; `ENOPROTOOPT` for an option that
    /// Linux 6.1 does not know.
    pub(crate) fn set(&mut self, option: i32, value: &[u8]) -> Result<(), Errno> {
        if option == FILTER {
            if !value.len().is_multiple_of(FILTER_BYTES) || value.len() > MOST_FILTERS * FILTER_BYTES {
                return Err(Errno::INVAL);
            }
            let filter = |bytes: &[u8]| Filter { id: u32_at(bytes, 0), mask: u32_at(bytes, 4) };
            self.filters = value.chunks_exact(FILTER_BYTES).map(filter).collect();
            return Ok(());
        }
        if !(ERROR_FILTER..=XL_FRAMES).contains(&option) {
            return Err(Errno::NOPROTOOPT);
        }
        let number = u32::from_ne_bytes(value.try_into().map_err(|_| Errno::INVAL)?);
        if option == FD_FRAMES && self.is_on(XL_FRAMES) && number == 0 {
            return Err(Errno::INVAL);
        }
        if option == XL_FRAMES && number != 0 {
            self.numbers[FD_FRAMES as usize] = number;
        }
        self.numbers[option as usize] = if option == ERROR_FILTER { number & ERROR_MASK } else { number };
        Ok(())
    }

    /// `getsockopt`: the whole value, and whether it may be truncated.
    ///
    /// # Errors
    /// `ENOPROTOOPT`.
    pub(crate) fn get(&self, option: i32) -> Result<(Vec<u8>, bool), Errno> {
        match option {
            FILTER => {
                let bytes = |filter: &Filter| [filter.id.to_ne_bytes(), filter.mask.to_ne_bytes()].concat();
                Ok((self.filters.iter().flat_map(bytes).collect(), false))
            }
            ERROR_FILTER..=XL_FRAMES => Ok((self.numbers[option as usize].to_ne_bytes().to_vec(), true)),
            _ => Err(Errno::NOPROTOOPT),
        }
    }

    /// Longest value of `setsockopt`.
    pub(crate) const LONGEST_VALUE: usize = MOST_FILTERS * FILTER_BYTES;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_filters(filters: &[(u32, u32)]) -> RawOptions {
        let mut options = RawOptions::default();
        let bytes: Vec<u8> =
            filters.iter().flat_map(|(id, mask)| [id.to_ne_bytes(), mask.to_ne_bytes()].concat()).collect();
        options.set(FILTER, &bytes).unwrap();
        options
    }

    #[test]
    fn masks_inverted_filters_and_an_empty_list() {
        assert!(RawOptions::default().passes(0x123));
        assert!(!with_filters(&[]).passes(0x123));
        let one = with_filters(&[(0x120, 0x7F0)]);
        assert!(one.passes(0x12F) && one.passes(0x8000_0125) && !one.passes(0x130));
        let standard_only = with_filters(&[(0x120, 0x8000_07FF)]);
        assert!(standard_only.passes(0x120) && !standard_only.passes(0x8000_0120));
        let inverted = with_filters(&[(INVERTED_FLAG | 0x120, 0x7FF)]);
        assert!(!inverted.passes(0x120) && inverted.passes(0x121));
    }

    #[test]
    fn joined_filters_must_all_pass() {
        let list = [(INVERTED_FLAG | 0x120, 0x7FF), (INVERTED_FLAG | 0x121, 0x7FF)];
        let mut options = with_filters(&list);
        assert!(options.passes(0x120) && options.passes(0x121), "the other one lets it pass");
        options.set(JOIN_FILTERS, &1_u32.to_ne_bytes()).unwrap();
        assert!(!options.passes(0x120) && !options.passes(0x121) && options.passes(0x122));
    }

    #[test]
    fn error_frames_pass_the_error_filter_alone() {
        let mut options = RawOptions::default();
        assert!(!options.passes(ERROR_FLAG | 0x40));
        options.set(ERROR_FILTER, &0x40_u32.to_ne_bytes()).unwrap();
        assert!(options.passes(ERROR_FLAG | 0x40) && !options.passes(ERROR_FLAG | 0x80));
        assert!(with_filters(&[(0, ERROR_FLAG | 0x40)]).passes(ERROR_FLAG | 0x40));
    }

    #[test]
    fn wrong_lengths_and_unknown_options_are_refused_as_the_kernel_does() {
        let mut options = RawOptions::default();
        assert_eq!(options.set(FILTER, &[0; 7]), Err(Errno::INVAL));
        assert_eq!(options.set(LOOPBACK, &[1]), Err(Errno::INVAL));
        assert_eq!(options.set(8, &1_u32.to_ne_bytes()), Err(Errno::NOPROTOOPT));
        assert_eq!(options.get(8), Err(Errno::NOPROTOOPT));
    }
}
