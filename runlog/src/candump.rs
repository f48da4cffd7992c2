//! Logs as `candump -L` writes them: a line, written and read, and a [`LogReader`] over a whole one.
//!
//! `(SSSSSSSSSS.UUUUUU) IFACE ID#HEX`, six decimals, upper case, no comments: python-can, cantools and SavvyCAN read it. Readers
//! take anything: what is no line is reported with its column, and a [`LogReader`] adds the line.

mod reader;

use protocol::can::{CanFrame, ERROR_FLAG, ERROR_MASK, EXTENDED_FLAG, REMOTE_FLAG, STANDARD_MASK};
use std::io::{self, Write};

pub use reader::{LogError, LogLine, LogProblem, LogReader, MOST_LINE_BYTES};

/// A frame and its time.
#[derive(Clone, Copy, Debug)]
pub struct FrameRecord {
    /// When it was sent or arrived, in ns of the run's clock.
    pub stamp_ns: u64,
    /// Identifier and data as on the wire.
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

/// What is wrong with a line of a log, and from which character on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}: {problem}")]
pub struct LineError {
    /// Character at which it begins, from 1.
    pub column: usize,
    /// What, and what would be right.
    pub problem: &'static str,
}

/// A line of a log: a frame with its time, and where it was seen.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// Name of the interface.
    pub interface: &'a str,
    /// Identifier as it stands in the line: 3 hexadecimal digits, or 8 for an extended frame and an error frame.
    pub identifier: &'a str,
    /// The frame and its time; ns since the log's epoch.
    pub record: FrameRecord,
}

/// Reads one line, stamps and all, from whatever interface it is; `None` when it is none ([`parse_line`] says why).
#[must_use]
pub fn read_line(line: &str) -> Option<FrameRecord> {
    parse_line(line).ok().map(|line| line.record)
}

/// Reads one line. Nothing is allocated.
///
/// Seconds may have any number of digits and fractions up to nine, as tools other than ours write them; a direction after
/// the data (`candump -x`) is passed over.
///
/// # Errors
/// [`LineError`] with the column, from 1.
pub fn parse_line(line: &str) -> Result<Line<'_>, LineError> {
    let at = |part: &str, problem| {
        // `part` is a piece of `line`: its place is the distance of the two.
        let bytes = part.as_ptr() as usize - line.as_ptr() as usize;
        LineError { column: line[..bytes].chars().count() + 1, problem }
    };
    let text = line.trim_end();
    let inner =
        text.strip_prefix('(').ok_or_else(|| at(text, "a line begins with '(SECONDS.MICROSECONDS)'"))?;
    let (stamp, rest) = inner.split_once(") ").ok_or_else(|| at(inner, "the time stamp ends with ') '"))?;
    let stamp_ns = read_stamp(stamp).ok_or_else(|| {
        at(stamp, "a time stamp is SECONDS.FRACTION in digits, the fraction of 1 to 9, below 584 years")
    })?;
    let rest = rest.trim_start();
    let (interface, frame) =
        rest.split_once(' ').ok_or_else(|| at(rest, "after the time stamp come interface and frame"))?;
    let word = frame.trim_start().split(' ').next().filter(|word| !word.is_empty());
    let word = word.ok_or_else(|| at(frame, "after the interface comes a frame, as 120#0011"))?;
    let (id, data) =
        word.split_once('#').ok_or_else(|| at(word, "a frame is IDENTIFIER#DATA, as 120#0011"))?;
    let raw_id = read_identifier(id).map_err(|problem| at(id, problem))?;
    let frame = read_frame(raw_id, data).map_err(|problem| at(data, problem))?;
    Ok(Line { interface, identifier: id, record: FrameRecord { stamp_ns, frame } })
}

fn read_stamp(stamp: &str) -> Option<u64> {
    let (seconds, fraction) = stamp.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let fraction_ns = fraction.parse::<u64>().ok()? * 10_u64.pow(9 - fraction.len() as u32);
    seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(fraction_ns)
}

fn read_identifier(id: &str) -> Result<u32, &'static str> {
    let number = u32::from_str_radix(id, 16).ok().filter(|_| is_hex(id));
    let number = number.ok_or("an identifier is hexadecimal")?;
    match id.len() {
        3 if number <= STANDARD_MASK => Ok(number),
        3 => Err("an identifier of 3 digits is at most 7FF"),
        // An error frame brings its flag along.
        8 if number <= ERROR_FLAG | ERROR_MASK => {
            Ok(if number < ERROR_FLAG { number | EXTENDED_FLAG } else { number })
        }
        8 => Err("an identifier of 8 digits is at most 1FFFFFFF, that of an error frame at most 3FFFFFFF"),
        _ => Err("an identifier has 3 digits, or 8 when it is extended"),
    }
}

fn read_frame(raw_id: u32, data: &str) -> Result<CanFrame, &'static str> {
    if data.starts_with('#') {
        return Err("this is a CAN FD frame ('##'), and only classic frames are read");
    }
    if let Some(length) = data.strip_prefix('R') {
        let asked = match length.as_bytes() {
            [] => Some(0),
            [digit @ b'0'..=b'8'] => Some(usize::from(digit - b'0')),
            _ => None,
        };
        let asked = asked.ok_or("after the 'R' of a remote request comes nothing, or a length of 0 to 8")?;
        return Ok(CanFrame::from_raw(raw_id | REMOTE_FLAG, &[0; 8][..asked]));
    }
    if !is_hex(data) {
        return Err("data are hexadecimal digits");
    }
    let mut bytes = [0; 8];
    let count = data.len() / 2;
    if count > bytes.len() {
        return Err("data are at most 8 bytes");
    }
    if data.len() % 2 == 1 {
        return Err("a byte has two digits");
    }
    for (byte, pair) in bytes.iter_mut().zip(data.as_bytes().chunks(2)) {
        let digit = |digit: u8| char::from(digit).to_digit(16).unwrap_or(0) as u8;
        *byte = digit(pair[0]) << 4 | digit(pair[1]);
    }
    Ok(CanFrame::from_raw(raw_id, &bytes[..count]))
}

fn is_hex(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_hexdigit())
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
            CanFrame::from_raw(REMOTE_FLAG | 0x123, &[0; 5]),
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
    fn a_malformed_line_is_refused_with_its_column() {
        for (line, column, words) in [
            ("", 1, "begins with"),
            ("(1.0 bus0 120#00", 2, "ends with ') '"),
            ("(1.0x) bus0 120#00", 2, "in digits"),
            ("(1.0) bus0", 7, "interface and frame"),
            ("(1.0) büs0 12#00", 12, "3 digits"),
            ("(1.0) bus0 800#00", 12, "at most 7FF"),
            ("(1.0) bus0 120#0", 16, "two digits"),
            ("(1.0) bus0 120##100", 16, "CAN FD"),
            ("(1.0) bus0 120#R9", 16, "length of 0 to 8"),
            ("(1.0) bus0 40000000#", 12, "at most 1FFFFFFF"),
            ("(1.0) bus0 120#001122334455667788", 16, "at most 8 bytes"),
            ("(18446744074.0) bus0 120#00", 2, "584 years"),
        ] {
            let error = parse_line(line).unwrap_err();
            assert!(error.column == column && error.problem.contains(words), "{line}: {error}");
        }
        let line = parse_line("(1.0) vcan0 120#00").unwrap();
        assert_eq!((line.interface, line.identifier), ("vcan0", "120"));
    }

    #[test]
    fn a_line_is_what_candump_writes() {
        let record = FrameRecord { stamp_ns: 1_234_567_890, frame: CanFrame::new(0x120, &[0xAB, 0, 1]) };
        let mut line = Vec::new();
        write_line(&mut line, "vcan0", 1_700_000_000_000_000_000, &record).unwrap();
        assert_eq!(String::from_utf8(line).unwrap(), "(1700000001.234567) vcan0 120#AB0001\n");
    }
}
