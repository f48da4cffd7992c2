//! One line of a candump log, as `candump -L` writes it.
//!
//! `(SSSSSSSSSS.UUUUUU) IFACE ID#HEX`, six decimals, upper case, no comments: python-can, cantools and SavvyCAN read it.

use crate::can::CanFrame;
use std::io::{self, Write};

/// A frame and its time.
#[derive(Clone, Copy, Debug)]
pub struct FrameRecord {
    /// When it was sent or arrived, in ns of the run's clock.
    pub stamp_ns: u64,
    /// The frame.
    pub frame: CanFrame,
}

/// Writes one frame; `epoch_offset_ns` turns the run's clock into the log's.
///
/// # Errors
/// What `out` says.
pub fn write_line(
    out: &mut impl Write,
    interface: &str,
    epoch_offset_ns: u64,
    record: &FrameRecord,
) -> io::Result<()> {
    let microseconds = (record.stamp_ns + epoch_offset_ns) / 1000;
    let (seconds, fraction) = (microseconds / 1_000_000, microseconds % 1_000_000);
    writeln!(out, "({seconds:010}.{fraction:06}) {interface} {}", record.frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_what_candump_writes() {
        let record = FrameRecord { stamp_ns: 1_234_567_890, frame: CanFrame::new(0x120, &[0xAB, 0, 1]) };
        let mut line = Vec::new();
        write_line(&mut line, "vcan0", 1_700_000_000_000_000_000, &record).unwrap();
        assert_eq!(String::from_utf8(line).unwrap(), "(1700000001.234567) vcan0 120#AB0001\n");
    }
}
