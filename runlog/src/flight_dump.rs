//! What a flight recorder leaves of an event: a folder with the cycles, the frames and what happened.
//!
//! ```text
//!   flight/controller-0000012345-late/     PROCESS-CYCLE-TRIGGER
//!     timing.csv    cycles around the event, as in the timing tables
//!     bus.log       frames that the process took and sent meanwhile, in candump's form
//!     event.json    what happened; written last, so that a folder with it is whole
//! ```

use crate::candump::{self, FrameRecord};
use crate::run_folder::{BUS_LOG, named, write_json};
use crate::timing::{CycleTiming, write_head, write_row};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Folder of the dumps in a run's folder.
pub const FOLDER: &str = "flight";
/// What happened, in the folder of a dump.
pub const EVENT_JSON: &str = "event.json";
/// Cycles around the event, in the folder of a dump.
pub const TIMING_CSV: &str = "timing.csv";

/// What happened, and when; as it stands in `event.json`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Event {
    /// See [`crate::run_folder::SCHEMA_VERSION`]; 0 in a file that does not say it.
    pub schema_version: u32,
    /// Whose recorder: `emulator`, `controller`, `controller-drive`, `controller-load`.
    pub process: String,
    /// What froze it: `overrun`, `late`, `slow`, `fault`, `signal`.
    pub trigger: String,
    /// The rig's cycle in which it was noticed.
    pub cycle: u64,
    /// When, on CLOCK_MONOTONIC, ns.
    pub at_monotonic_ns: u64,
    /// Lateness of the wake-up, ns.
    pub late_ns: u64,
    /// Length of the work, ns.
    pub slow_ns: u64,
    /// Start of the window, CLOCK_MONOTONIC, ns.
    pub window_from_ns: u64,
    /// End of the window, CLOCK_MONOTONIC, ns.
    pub window_to_ns: u64,
}

impl Event {
    /// Name of its folder.
    #[must_use]
    pub fn name(&self) -> DumpName {
        DumpName { process: self.process.clone(), cycle: self.cycle, trigger: self.trigger.clone() }
    }
}

/// Name of a dump's folder: PROCESS-CYCLE-TRIGGER.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DumpName {
    /// As [`Event::process`]; it may have a dash.
    pub process: String,
    /// As [`Event::cycle`].
    pub cycle: u64,
    /// As [`Event::trigger`]; it has no dash.
    pub trigger: String,
}

impl fmt::Display for DumpName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{:010}-{}", self.process, self.cycle, self.trigger)
    }
}

impl DumpName {
    /// Reads the name of a folder, with any number of digits; `None` for one that is no dump.
    #[must_use]
    pub fn parse(folder: &str) -> Option<Self> {
        let mut parts = folder.rsplitn(3, '-');
        let (trigger, cycle, process) = (parts.next()?, parts.next()?, parts.next()?);
        let cycle = cycle.parse().ok().filter(|_| cycle.bytes().all(|byte| byte.is_ascii_digit()))?;
        Some(Self { process: process.into(), cycle, trigger: trigger.into() })
    }
}

/// The dumps of a run in alphabetical order, each with its folder as it is called; none without [`FOLDER`].
///
/// # Errors
/// What the system says, with the folder's name.
pub fn list(run: &Path) -> io::Result<Vec<(String, DumpName)>> {
    let folder = run.join(FOLDER);
    let entries = match fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(named(&folder, &error)),
    };
    let mut dumps = Vec::new();
    for entry in entries {
        let name = entry.map_err(|error| named(&folder, &error))?.file_name().into_string();
        dumps.extend(name.ok().and_then(|name| DumpName::parse(&name).map(|parsed| (name, parsed))));
    }
    dumps.sort_by(|(one, _), (other, _)| one.cmp(other));
    Ok(dumps)
}

/// How frames are written down.
#[derive(Clone, Debug)]
pub struct FrameLogFormat {
    /// Name of the interface in each line.
    pub interface: String,
    /// What turns stamps of CLOCK_MONOTONIC into those of the log, ns.
    pub epoch_offset_ns: u64,
}

/// Writes a dump into the run's folder.
///
/// # Errors
/// What the system says, with the file's name.
pub fn write<'a>(
    run: &Path,
    event: &Event,
    rows: impl IntoIterator<Item = &'a CycleTiming>,
    frames: impl IntoIterator<Item = &'a FrameRecord>,
    log: &FrameLogFormat,
) -> io::Result<()> {
    let folder = run.join(FOLDER).join(event.name().to_string());
    fs::create_dir_all(&folder).map_err(|error| named(&folder, &error))?;
    write_file(&folder.join(TIMING_CSV), |out| {
        write_head(out)?;
        rows.into_iter().try_for_each(|row| write_row(out, row))
    })?;
    write_file(&folder.join(BUS_LOG), |out| {
        frames
            .into_iter()
            .try_for_each(|record| candump::write_line(out, &log.interface, log.epoch_offset_ns, record))
    })?;
    write_json(&folder.join(EVENT_JSON), event)
}

/// Removes a dump, that one more severe may take its place.
///
/// # Errors
/// What the system says, with the folder's name.
pub fn remove(run: &Path, name: &str) -> io::Result<()> {
    let folder = run.join(FOLDER).join(name);
    match fs::remove_dir_all(&folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(named(&folder, &error)),
        _ => Ok(()),
    }
}

/// Removes the dumps that an earlier run of `process` left.
///
/// # Errors
/// What the system says, with the folder's name.
pub fn clear(run: &Path, process: &str) -> io::Result<()> {
    let dumps = list(run)?;
    dumps.iter().filter(|(_, name)| name.process == process).try_for_each(|(folder, _)| remove(run, folder))
}

fn write_file(
    path: &PathBuf,
    write: impl FnOnce(&mut BufWriter<fs::File>) -> io::Result<()>,
) -> io::Result<()> {
    let written = fs::File::create(path).map(BufWriter::new).and_then(|mut out| {
        write(&mut out)?;
        out.flush()
    });
    written.map_err(|error| named(path, &error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing;
    use protocol::can::CanFrame;

    fn event(process: &str, cycle: u64) -> Event {
        Event { process: process.into(), trigger: "late".into(), cycle, ..Event::default() }
    }

    #[test]
    fn a_dump_holds_cycles_frames_and_what_happened() {
        let run = tempfile::tempdir().unwrap();
        let rows = [CycleTiming { cycle: 41, ..CycleTiming::default() }, CycleTiming::default()];
        let frame = FrameRecord { stamp_ns: 1_234_567_890, frame: CanFrame::new(0x120, &[0xAB, 0, 1]) };
        let log = FrameLogFormat { interface: "vcan0".into(), epoch_offset_ns: 1_700_000_000_000_000_000 };
        write(run.path(), &event("controller", 42), &rows, [&frame], &log).unwrap();
        let read = |name: &str| {
            fs::read_to_string(run.path().join("flight/controller-0000000042-late").join(name)).unwrap()
        };
        assert_eq!(timing::read(&read("timing.csv")).unwrap(), rows);
        assert_eq!(read("bus.log"), "(1700000001.234567) vcan0 120#AB0001\n");
        let reported: serde_json::Value = serde_json::from_str(&read("event.json")).unwrap();
        assert_eq!((&reported["trigger"], &reported["cycle"]), (&"late".into(), &42.into()));
    }

    #[test]
    fn a_name_that_was_written_reads_back_and_others_are_no_dumps() {
        let name = event("controller-drive", 42).name();
        assert_eq!(name.to_string(), "controller-drive-0000000042-late");
        assert_eq!(DumpName::parse(&name.to_string()), Some(name));
        assert_eq!(DumpName::parse("emulator-7-late"), Some(event("emulator", 7).name()), "fewer digits");
        for other in ["notes", "emulator-7", "controller-drive-late", "emulator-x-late", "emulator-+7-late"] {
            assert_eq!(DumpName::parse(other), None, "{other}");
        }
    }

    #[test]
    fn a_process_clears_its_own_dumps_alone() {
        let run = tempfile::tempdir().unwrap();
        clear(run.path(), "controller").unwrap();
        let log = FrameLogFormat { interface: "bus0".into(), epoch_offset_ns: 0 };
        for process in ["controller", "controller-drive", "emulator"] {
            write(run.path(), &event(process, 7), &[], [], &log).unwrap();
        }
        fs::create_dir(run.path().join(FOLDER).join("notes")).unwrap();
        clear(run.path(), "controller").unwrap();
        let entries = fs::read_dir(run.path().join(FOLDER)).unwrap();
        let mut left: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        left.sort();
        assert_eq!(left, ["controller-drive-0000000007-late", "emulator-0000000007-late", "notes"]);
        remove(run.path(), "emulator-0000000007-late").unwrap();
        remove(run.path(), "emulator-0000000007-late").unwrap();
    }
}
