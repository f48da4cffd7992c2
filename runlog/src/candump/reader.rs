//! A log from whatever can be read by lines, frame by frame; hostile bytes give an error with line and column, never more.
//!
//! Empty lines are passed over. A last line without its line feed that is none is cut: its writer was killed in the midst. It
//! is left out and reported ([`LogReader::cut_line`]). A line is at most [`MOST_LINE_BYTES`] long, so that a file
//! without line feeds, or an endless one, fills no memory.

use super::{FrameRecord, parse_line};
use std::io::{self, BufRead, Read};

/// Longest line of a log, bytes; candump writes 60.
pub const MOST_LINE_BYTES: usize = 1024;

/// A frame of a log, and its line.
#[derive(Clone, Copy, Debug)]
pub struct LogLine {
    /// Line, from 1.
    pub line: u64,
    /// The frame and its time; ns since the log's epoch.
    pub record: FrameRecord,
}

/// Why a log cannot be read on.
#[derive(Debug, thiserror::Error)]
#[error("{line}:{column}: {problem}")]
pub struct LogError {
    /// Line, from 1.
    pub line: u64,
    /// Character, from 1.
    pub column: usize,
    /// What is wrong there.
    pub problem: LogProblem,
}

/// What is wrong with a log.
#[derive(Debug, thiserror::Error)]
pub enum LogProblem {
    /// A line that candump would not write.
    #[error("{0}; a line looks like '(1700000000.123456) can0 120#0011'")]
    Line(&'static str),
    /// Bytes that are no text.
    #[error("bytes that are no UTF-8: is this a log of 'candump -L'?")]
    NoText,
    /// A line that does not end.
    #[error("a line of more than {MOST_LINE_BYTES} bytes: is this a log of 'candump -L'?")]
    LongLine,
    /// The file, or what stands in its place, gave up.
    #[error("cannot be read: {0}")]
    Read(io::Error),
}

/// Reads a log from `R`; ends after the first error.
#[derive(Debug)]
pub struct LogReader<R> {
    input: R,
    bytes: Vec<u8>,
    line: u64,
    /// The last line, when it is not whole; known at the end.
    pub cut_line: Option<u64>,
    ended: bool,
}

impl<R: BufRead> LogReader<R> {
    /// A reader before the first line.
    pub fn new(input: R) -> Self {
        Self { input, bytes: Vec::with_capacity(128), line: 0, cut_line: None, ended: false }
    }

    /// The next frame with its interface; the iterator leaves that out.
    ///
    /// # Errors
    /// [`LogError`] with line and column; there is nothing after it.
    pub fn read(&mut self) -> Result<Option<(LogLine, &str)>, LogError> {
        if self.ended {
            return Ok(None);
        }
        loop {
            self.line += 1;
            self.bytes.clear();
            let most = MOST_LINE_BYTES as u64 + 1;
            let read = self.input.by_ref().take(most).read_until(b'\n', &mut self.bytes);
            let whole = self.bytes.ends_with(b"\n");
            match read {
                Err(error) => return Err(self.fails(1, LogProblem::Read(error))),
                Ok(0) => {
                    self.ended = true;
                    return Ok(None);
                }
                Ok(_) if !whole && self.bytes.len() > MOST_LINE_BYTES => {
                    return Err(self.fails(MOST_LINE_BYTES, LogProblem::LongLine));
                }
                Ok(_) if self.bytes.trim_ascii().is_empty() => {}
                Ok(_) => break self.understand(whole),
            }
        }
    }

    fn understand(&mut self, whole: bool) -> Result<Option<(LogLine, &str)>, LogError> {
        let line = self.line;
        let problem = match std::str::from_utf8(&self.bytes) {
            Ok(text) => match parse_line(text) {
                // Twice, because a loan that is returned in one arm lasts through all of them.
                Ok(_) => None,
                Err(wrong) => Some((wrong.column, LogProblem::Line(wrong.problem))),
            },
            Err(wrong) => Some((wrong.valid_up_to() + 1, LogProblem::NoText)),
        };
        match problem {
            Some(_) if !whole => {
                self.ended = true;
                self.cut_line = Some(line);
                Ok(None)
            }
            Some((column, problem)) => Err(self.fails(column, problem)),
            None => {
                let text = std::str::from_utf8(&self.bytes).unwrap_or_default();
                let read = parse_line(text).ok();
                Ok(read.map(|read| (LogLine { line, record: read.record }, read.interface)))
            }
        }
    }

    fn fails(&mut self, column: usize, problem: LogProblem) -> LogError {
        self.ended = true;
        LogError { line: self.line, column, problem }
    }
}

impl<R: BufRead> Iterator for LogReader<R> {
    type Item = Result<LogLine, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().map(|read| read.map(|(line, _)| line)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(text: &[u8]) -> (Vec<(u64, u64)>, Option<u64>, Option<String>) {
        let mut reader = LogReader::new(text);
        let (mut read, mut error) = (Vec::new(), None);
        for line in reader.by_ref() {
            match line {
                Ok(line) => read.push((line.line, line.record.stamp_ns)),
                Err(wrong) => error = Some(wrong.to_string()),
            }
        }
        (read, reader.cut_line, error)
    }

    #[test]
    fn frames_come_with_their_lines_and_a_cut_last_line_is_left_out() {
        let whole = b"(0.000001) a 1FF#\r\n\n(0.000002) b 120#00 R\n(0.000003) c 120#R";
        assert_eq!(stamps(whole), (vec![(1, 1000), (3, 2000), (4, 3000)], None, None));
        assert_eq!(stamps(b"(0.000001) a 1FF#\n(0.0"), (vec![(1, 1000)], Some(2), None));
        assert_eq!(stamps(b""), (vec![], None, None));
    }

    #[test]
    fn a_malformed_line_is_reported_by_line_and_column_and_ends_the_log() {
        let (read, _, error) = stamps(b"(0.000001) a 1FF#\n(0.000002) a 1FF#1\n(0.000003) a 1FF#\n");
        assert_eq!(read.len(), 1);
        assert!(error.is_some_and(|text| text.starts_with("2:18: a byte has two digits")));
        let (_, _, error) = stamps(b"(0.000001) a 1F\xff#\n");
        assert!(error.is_some_and(|text| text.starts_with("1:16: bytes that are no UTF-8")));
        let (_, _, error) = stamps(&[b'('; 5000]);
        assert!(error.is_some_and(|text| text.starts_with("1:1024: a line of more than")));
    }

    #[test]
    fn a_read_error_is_reported() {
        struct FailingReader;
        impl Read for FailingReader {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(io::Error::other("unplugged"))
            }
        }
        let mut reader = LogReader::new(io::BufReader::new(FailingReader));
        assert!(reader.next().unwrap().unwrap_err().to_string().contains("unplugged"));
        assert!(reader.next().is_none());
    }
}
