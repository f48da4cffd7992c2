//! One line of a candump log, as `candump -L` writes it.
//!
//! `(SSSSSSSSSS.UUUUUU) IFACE ID#HEX`, six decimals, upper case, no comments: python-can, cantools and SavvyCAN read it.

use crate::can::{CanFrame, ERROR_FLAG, EXTENDED_FLAG, REMOTE_FLAG};
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

/// Reads one line, stamps and all, from whatever interface it is; `None` when it is none.
///
/// Seconds may have any number of digits and fractions up to nine, as tools other than ours write them; a direction after
/// the data (`candump -x`) is passed over.
#[must_use]
pub fn read_line(line: &str) -> Option<FrameRecord> {
    let (stamp, rest) = line.trim_end().strip_prefix('(')?.split_once(") ")?;
    let (seconds, fraction) = stamp.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let fraction_ns = fraction.parse::<u64>().ok()? * 10_u64.pow(9 - fraction.len() as u32);
    let stamp_ns = seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(fraction_ns)?;
    let (_interface, frame) = rest.trim_start().split_once(' ')?;
    let (id, data) = frame.split_whitespace().next()?.split_once('#')?;
    Some(FrameRecord { stamp_ns, frame: read_frame(id, data)? })
}

fn read_frame(id: &str, data: &str) -> Option<CanFrame> {
    let hex = |text: &str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !hex(id) {
        return None;
    }
    let number = u32::from_str_radix(id, 16).ok()?;
    let raw_id = match id.len() {
        3 if number < 0x800 => number,
        // An error frame brings its flag along.
        8 if number & ERROR_FLAG == 0 => number | EXTENDED_FLAG,
        8 => number,
        _ => return None,
    };
    if let Some(length) = data.strip_prefix('R') {
        let known = length.is_empty() || length.parse::<u8>().is_ok_and(|length| length <= 8);
        return known.then(|| CanFrame::from_raw(raw_id | REMOTE_FLAG, &[]));
    }
    if !hex(data) {
        return None;
    }
    let mut bytes = [0; 8];
    let pairs = data.as_bytes().chunks(2);
    let count = pairs.len();
    for (byte, pair) in bytes.get_mut(..count)?.iter_mut().zip(pairs) {
        let text = std::str::from_utf8(pair).ok().filter(|text| text.len() == 2)?;
        *byte = u8::from_str_radix(text, 16).ok()?;
    }
    Some(CanFrame::from_raw(raw_id, &bytes[..count]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_written_reads_back() {
        for frame in [
            CanFrame::new(0x120, &[0xAB, 0, 1]),
            CanFrame::new(0x7FF, &[]),
            CanFrame::from_raw(EXTENDED_FLAG | 0x1234_5678, &[1; 8]),
            CanFrame::from_raw(REMOTE_FLAG | 0x123, &[]),
            CanFrame::from_raw(ERROR_FLAG | 4, &[0; 8]),
        ] {
            let mut line = Vec::new();
            write_line(&mut line, "bus0", 0, &FrameRecord { stamp_ns: 1_234_567_000, frame }).unwrap();
            let read = read_line(std::str::from_utf8(&line).unwrap()).unwrap();
            assert_eq!((read.stamp_ns, read.frame), (1_234_567_000, frame));
        }
    }

    #[test]
    fn what_is_no_line_of_a_log_is_refused() {
        for line in [
            "",
            "# bus",
            "(1.000000) bus0 120",
            "(1.000000) bus0 120#ABC",
            "(1.000000) bus0 120#+1",
            "(1.000000) bus0 820#00",
            "(1.000000) bus0 120#001122334455667788",
            "(1) bus0 120#00",
            "(x.000000) bus0 120#00",
            "(1.000000) bus0 12#00",
        ] {
            assert!(read_line(line).is_none(), "{line}");
        }
        assert!(read_line("(1700000000.123456789) can0 120#00 R").is_some(), "candump -x");
    }

    #[test]
    fn a_line_is_what_candump_writes() {
        let record = FrameRecord { stamp_ns: 1_234_567_890, frame: CanFrame::new(0x120, &[0xAB, 0, 1]) };
        let mut line = Vec::new();
        write_line(&mut line, "vcan0", 1_700_000_000_000_000_000, &record).unwrap();
        assert_eq!(String::from_utf8(line).unwrap(), "(1700000001.234567) vcan0 120#AB0001\n");
    }
}
