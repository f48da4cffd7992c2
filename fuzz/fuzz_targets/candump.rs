//! The reader of logs: any bytes end in frames or in an error with line and column, and a frame that was read is read back equal
//! from what is written of it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use runlog::candump::{FrameRecord, LogReader, parse_line, write_line};

fuzz_target!(|bytes: &[u8]| {
    let lines = bytes.iter().filter(|byte| **byte == b'\n').count() as u64 + 1;
    let mut reader = LogReader::new(bytes);
    while let Some(read) = reader.next() {
        match read {
            Ok(line) => {
                assert!((1..=lines).contains(&line.line));
                there_and_back(&line.record);
            }
            Err(error) => assert!((1..=lines).contains(&error.line) && error.column >= 1, "{error}"),
        }
    }
});

fn there_and_back(record: &FrameRecord) {
    let mut text = Vec::new();
    write_line(&mut text, "can0", 0, record).expect("memory takes it");
    let text = std::str::from_utf8(&text).expect("a log is text");
    let again = parse_line(text).expect("what was written is a line").record;
    // Lines have microseconds, and seconds of 10 digits at least.
    assert_eq!(again.stamp_ns, record.stamp_ns / 1000 * 1000, "{text}");
    assert_eq!(again.frame, record.frame, "{text}");
}
