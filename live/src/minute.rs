//! A record of the last minute: `measurement.csv` and `bus.log` in the formats of a run, which `discrepancy check` reads.

use crate::push_newest;
use protocol::periods::CYCLE_NS;
use runlog::candump::{self, FrameRecord};
use runlog::cycle_tables::{MEASURED, write_measurement, write_measurement_head};
use runlog::run_folder::{BUS_LOG, LineFile, MEASUREMENT_CSV};
use runlog::telemetry::SetUp;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};

/// Longest record, s.
pub(crate) const LONGEST_S: f64 = 60.0;
const CYCLES_KEPT: usize = 60_000;
/// Frames that are kept: those of a minute, with a reserve.
const FRAMES_KEPT: usize = 600_000;

/// Measured values of a cycle.
#[derive(Clone, Copy, Debug)]
struct Measured {
    cycle: u64,
    values: [f64; MEASURED.len()],
}

#[derive(Debug, Default)]
pub(crate) struct RecentRecord {
    cycles: VecDeque<Measured>,
    /// Stamped with the time of day.
    frames: VecDeque<FrameRecord>,
    /// Cycle in which linkage or weights changed last.
    changed: u64,
}

/// A record to be written; it owns its data, so that another thread can write it.
pub(crate) struct SavedRecord {
    folder: PathBuf,
    interface: String,
    set_up: SetUp,
    cycles: Vec<Measured>,
    frames: Vec<FrameRecord>,
    /// Why it is shorter than requested, for the message.
    cut: String,
}

impl RecentRecord {
    /// Adds a cycle; ignored if a measured value is missing.
    pub(crate) fn cycle(&mut self, cycle: u64, values: [Option<f64>; MEASURED.len()]) {
        let reported: Vec<f64> = values.into_iter().flatten().collect();
        if let Ok(values) = reported.try_into() {
            push_newest(&mut self.cycles, CYCLES_KEPT, Measured { cycle, values });
        }
    }

    /// Adds a frame of the bus, sent or received.
    pub(crate) fn frame(&mut self, record: FrameRecord) {
        push_newest(&mut self.frames, FRAMES_KEPT, record);
    }

    /// Records that linkage or weights changed in this cycle.
    pub(crate) fn change(&mut self, cycle: u64) {
        self.changed = cycle;
    }

    /// The last `seconds`, to be written to a new folder in `folder`. A record has one set-up, so it begins no earlier than the
    /// last change of it.
    pub(crate) fn last(&self, seconds: f64, folder: &Path, interface: &str, set_up: SetUp) -> SavedRecord {
        let newest = self.cycles.back().map_or(0, |measured| measured.cycle);
        let oldest = self.cycles.front().map_or(0, |measured| measured.cycle);
        let (mut cycles, mut cut) = ((seconds * 1000.0) as u64, String::new());
        if self.changed > oldest.max(newest.saturating_sub(cycles)) {
            cycles = newest.saturating_sub(self.changed);
            cut = format!(" ({} s, since linkage or weights changed before)", cycles as f64 / 1000.0);
        }
        let from = newest.saturating_sub(cycles);
        let newest_ns = self.frames.back().map_or(0, |record| record.stamp_ns);
        let from_ns = newest_ns.saturating_sub(cycles * CYCLE_NS);
        SavedRecord {
            folder: folder.join(format!("saved-{}", newest_ns / 1_000_000)),
            interface: interface.to_owned(),
            set_up,
            cycles: self.cycles.iter().filter(|measured| measured.cycle > from).copied().collect(),
            frames: self.frames.iter().filter(|record| record.stamp_ns > from_ns).copied().collect(),
            cut,
        }
    }
}

impl SavedRecord {
    /// Writes the record and returns a message with its folder.
    ///
    /// # Errors
    /// The error of the system with the name of the file; an error too for an empty record.
    pub(crate) fn write(self) -> io::Result<String> {
        if self.frames.is_empty() && self.cycles.is_empty() {
            return Err(io::Error::other("nothing was heard yet, or not since linkage or weights changed"));
        }
        let reported = format!("saved in {}{}", self.folder.display(), self.cut);
        std::fs::create_dir_all(&self.folder)?;
        let mut log = LineFile::create(&self.folder.join(BUS_LOG))?;
        for record in &self.frames {
            candump::write_line(log.lines(), &self.interface, 0, record)?;
            log.write_when_full()?;
        }
        log.write_out()?;
        if self.cycles.is_empty() {
            // Telemetry alone says which valve opening acted in which cycle.
            return Ok(reported);
        }
        let mut table = LineFile::create(&self.folder.join(MEASUREMENT_CSV))?;
        write_measurement_head(table.lines(), self.set_up)?;
        for Measured { cycle, values } in &self.cycles {
            write_measurement(table.lines(), *cycle, values.iter().copied())?;
            table.write_when_full()?;
        }
        table.write_out()?;
        Ok(reported)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::can::CanFrame;

    const SET_UP: SetUp = SetUp { linked: true, added_mass_kg: 2.5 };

    /// Three seconds, and a cycle that lacks a value.
    fn minute() -> RecentRecord {
        let mut minute = RecentRecord::default();
        for cycle in 0..3000 {
            minute.cycle(cycle, [Some(0.25); MEASURED.len()]);
            let frame = CanFrame::new(0x120, &[0; 8]);
            minute.frame(FrameRecord { stamp_ns: 1_000_000_000 + cycle * 1_000_000, frame });
        }
        let mut lacking = [Some(0.25); MEASURED.len()];
        lacking[3] = None;
        minute.cycle(3000, lacking);
        minute
    }

    /// Saves so many seconds: the message after the folder's name, and the lines of `measurement.csv` and `bus.log`.
    fn saved(minute: &RecentRecord, seconds: f64) -> (String, Vec<String>, usize) {
        let folder = tempfile::tempdir().unwrap();
        let reported = minute.last(seconds, folder.path(), "bus0", SET_UP).write().unwrap();
        let reported = reported.strip_prefix("saved in ").unwrap();
        let (path, rest) = reported.split_once(' ').unwrap_or((reported, ""));
        let table = std::fs::read_to_string(Path::new(path).join("measurement.csv")).unwrap();
        let log = std::fs::read_to_string(Path::new(path).join("bus.log")).unwrap();
        (rest.to_owned(), table.lines().map(str::to_owned).collect(), log.lines().count())
    }

    #[test]
    fn a_record_has_the_seconds_that_were_asked_for() {
        let (rest, lines, frames) = saved(&minute(), 1.0);
        assert_eq!((rest.as_str(), lines[0].as_str()), ("", "# linked=true added_mass_kg=2.5"));
        assert!(lines[1].starts_with("time_s,drive_valve,drive_position_m,drive_force_N"), "{}", lines[1]);
        assert_eq!((lines.len(), lines[2].split(',').next(), frames), (1002, Some("2.000"), 1000));
        let nothing = RecentRecord::default().last(1.0, Path::new("/nowhere"), "bus0", SET_UP);
        assert!(nothing.write().is_err());
    }

    #[test]
    fn a_record_begins_where_its_set_up_did() {
        let mut minute = minute();
        minute.change(2499);
        let (rest, lines, frames) = saved(&minute, 1.0);
        assert_eq!(rest, "(0.5 s, since linkage or weights changed before)");
        assert_eq!((lines.len(), lines[2].split(',').next(), frames), (502, Some("2.500"), 500));
        assert_eq!(saved(&minute, 0.25).0, "", "no change in the last quarter of a second");
    }
}
