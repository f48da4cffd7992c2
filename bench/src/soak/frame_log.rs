//! Content of `bus.log`: number of frames of each identifier, and the counters of the first and the last command of each axis.
//!
//! The log is the rig's record in the format of candump: `(stamp) interface identifier#data`. It is read as a stream, so that
//! memory does not depend on its length.

use super::account::Counts;
use super::segment_files::counts;
use protocol::bus::OTHERS;
use protocol::can::CanFrame;
use protocol::frames::{DRIVE_VALVE_COMMAND, Frame, LOAD_VALVE_COMMAND, MESSAGES};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FrameLog {
    /// Frames by the name of their identifier.
    pub frames: Counts,
    /// Counters (4 bits) of the first and the last command, by the name of their identifier.
    pub counters: BTreeMap<String, (u8, u8)>,
}

/// Reads a log to its last whole line.
pub(super) fn read(path: &Path) -> io::Result<FrameLog> {
    let mut reader = BufReader::with_capacity(1 << 18, File::open(path)?);
    let mut frames: BTreeMap<Vec<u8>, u64> = BTreeMap::new();
    let mut counters = BTreeMap::new();
    let mut line = Vec::new();
    loop {
        line.clear();
        if reader.read_until(b'\n', &mut line)? == 0 || line.pop() != Some(b'\n') {
            break;
        }
        let Some((id, data)) = identifier_and_data(&line) else { continue };
        match frames.get_mut(id) {
            Some(count) => *count += 1,
            None => drop(frames.insert(id.to_vec(), 1)),
        }
        if let Some((name, alive)) = command(id, data) {
            counters.entry(name.to_owned()).or_insert((alive, alive)).1 = alive;
        }
    }
    let frames = counts(frames.iter().map(|(id, count)| (String::from_utf8_lossy(id).into_owned(), *count)));
    Ok(FrameLog { frames, counters })
}

/// Name of an identifier as peers count it; those outside `rig.dbc` share one.
pub(super) fn known_name(name: &str) -> String {
    let known = name.len() == 3
        && u16::from_str_radix(name, 16).is_ok_and(|id| MESSAGES.iter().any(|spec| spec.id == id));
    if known { name.to_owned() } else { OTHERS.to_owned() }
}

fn identifier_and_data(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let frame = line.rsplit(|byte| *byte == b' ').next()?;
    let hash = frame.iter().position(|byte| *byte == b'#')?;
    Some((&frame[..hash], &frame[hash + 1..]))
}

/// Identifier and counter of a valve command.
fn command(id: &[u8], data: &[u8]) -> Option<(&'static str, u8)> {
    let (name, id) = match id {
        b"110" => ("110", DRIVE_VALVE_COMMAND.id),
        b"111" => ("111", LOAD_VALVE_COMMAND.id),
        _ => return None,
    };
    let mut bytes = [0; 8];
    let pairs = data.chunks_exact(2);
    let len = pairs.len().min(bytes.len());
    for (byte, pair) in bytes.iter_mut().zip(pairs) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    match Frame::decode(&CanFrame::new(id, &bytes[..len])) {
        Ok(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => {
            Some((name, command.alive))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::ValveCommand;

    fn command_line(alive: u8) -> String {
        let command = ValveCommand { opening: 0.5, alive, echo: 7, enable: true };
        let frame = Frame::DriveValveCommand(command).encode().unwrap();
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        format!("(0000000012.000100) bus0 110#{data}\n")
    }

    #[test]
    fn identifiers_are_counted_and_the_first_and_last_counter_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bus.log");
        let sensors = "(0000000012.000000) bus0 120#0102030405060708\n";
        let lines =
            [sensors, &command_line(3), sensors, &command_line(9), "(0000000012.1) bus0 7FF#\n", sensors];
        // The last line lacks its end.
        std::fs::write(&path, lines.concat().trim_end()).unwrap();
        let log = read(&path).unwrap();
        assert_eq!(log.frames, Counts::from([("110", 2), ("120", 2), ("others", 1)]));
        assert_eq!(log.counters, BTreeMap::from([("110".to_owned(), (3, 9))]));
    }

    #[test]
    fn only_plain_identifiers_of_the_catalogue_have_names_of_their_own() {
        assert_eq!(known_name("121"), "121");
        assert!(["7FF", "80000110", "zzz", "0110"].iter().all(|name| known_name(name) == OTHERS));
    }
}
