//! The last minute as a record: `measurement.csv` and `bus.log` in the forms of a run, which `discrepancy check` reads.

use super::columns::{AXES, MEASURED, MEASURED_COUNT};
use protocol::candump::{self, FrameRecord};
use protocol::run_folder::LineFile;
use std::collections::VecDeque;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Longest record, s.
pub const LONGEST_S: f64 = 60.0;
/// Cycles that are kept.
const CYCLES_KEPT: usize = 60_000;
/// Frames that are kept: those of a minute, with room for noise.
const FRAMES_KEPT: usize = 600_000;

/// What sensors and valves showed in a cycle, and whether the rods were linked with how many weights.
#[derive(Clone, Copy, Debug)]
struct Measured {
    cycle: u64,
    values: [f64; MEASURED_COUNT],
}

/// The last minute.
#[derive(Debug, Default)]
pub struct Minute {
    cycles: VecDeque<Measured>,
    /// Stamped with the time of day.
    frames: VecDeque<FrameRecord>,
}

/// A record that is to be written; it owns what it needs, so that another thread can.
pub struct Saved {
    folder: PathBuf,
    interface: String,
    linked: bool,
    added_mass_kg: f64,
    cycles: Vec<Measured>,
    frames: Vec<FrameRecord>,
}

/// How the rig is set up while a record is saved.
#[derive(Clone, Copy, Debug)]
pub struct SetUp {
    /// Whether the rods are linked.
    pub linked: bool,
    /// Weights on the carriage, kg.
    pub added_mass_kg: f64,
}

impl Minute {
    /// Takes a cycle whose measured values are all there.
    pub fn cycle(&mut self, cycle: u64, values: [Option<f64>; MEASURED_COUNT]) {
        let told: Vec<f64> = values.into_iter().flatten().collect();
        if let Ok(values) = told.try_into() {
            self.cycles.push_back(Measured { cycle, values });
            if self.cycles.len() > CYCLES_KEPT {
                self.cycles.pop_front();
            }
        }
    }

    /// Takes a frame of the bus, sent or heard.
    pub fn frame(&mut self, record: FrameRecord) {
        self.frames.push_back(record);
        if self.frames.len() > FRAMES_KEPT {
            self.frames.pop_front();
        }
    }

    /// The last so many seconds, to be written to a folder of their own in `folder`.
    #[must_use]
    pub fn last(&self, seconds: f64, folder: &Path, interface: &str, set_up: SetUp) -> Saved {
        let newest = self.cycles.back().map_or(0, |measured| measured.cycle);
        let from = newest.saturating_sub((seconds * 1000.0) as u64);
        let newest_ns = self.frames.back().map_or(0, |record| record.stamp_ns);
        let from_ns = newest_ns.saturating_sub((seconds * 1e9) as u64);
        let SetUp { linked, added_mass_kg } = set_up;
        Saved {
            folder: folder.join(format!("saved-{}", newest_ns / 1_000_000)),
            interface: interface.to_owned(),
            linked,
            added_mass_kg,
            cycles: self.cycles.iter().filter(|measured| measured.cycle > from).copied().collect(),
            frames: self.frames.iter().filter(|record| record.stamp_ns > from_ns).copied().collect(),
        }
    }
}

impl Saved {
    /// Writes it, and gives the folder.
    ///
    /// # Errors
    /// What the system says, with the file's name; an error too when there is nothing to write.
    pub fn write(self) -> io::Result<PathBuf> {
        if self.frames.is_empty() && self.cycles.is_empty() {
            return Err(io::Error::other("nothing was heard yet"));
        }
        std::fs::create_dir_all(&self.folder)?;
        let mut log = LineFile::create(&self.folder.join("bus.log"))?;
        for record in &self.frames {
            candump::write_line(log.lines(), &self.interface, 0, record)?;
            log.write_when_full()?;
        }
        log.write_out()?;
        if self.cycles.is_empty() {
            // Only telemetry tells which valve opening acted in which cycle.
            return Ok(self.folder);
        }
        let mut table = LineFile::create(&self.folder.join("measurement.csv"))?;
        write!(table.lines(), "# linked={} added_mass_kg={}\ntime_s", self.linked, self.added_mass_kg)?;
        for axis in AXES {
            MEASURED.iter().try_for_each(|column| write!(table.lines(), ",{axis}_{column}"))?;
        }
        writeln!(table.lines())?;
        for Measured { cycle, values } in &self.cycles {
            write!(table.lines(), "{}.{:03}", cycle / 1000, cycle % 1000)?;
            values.iter().try_for_each(|value| write!(table.lines(), ",{value}"))?;
            writeln!(table.lines())?;
            table.write_when_full()?;
        }
        table.write_out()?;
        Ok(self.folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::can::CanFrame;

    #[test]
    fn a_record_has_the_seconds_that_were_asked_for() {
        let mut minute = Minute::default();
        for cycle in 0..3000 {
            minute.cycle(cycle, [Some(0.25); MEASURED_COUNT]);
            let frame = CanFrame::new(0x120, &[0; 8]);
            minute.frame(FrameRecord { stamp_ns: 1_000_000_000 + cycle * 1_000_000, frame });
        }
        let mut lacking = [Some(0.25); MEASURED_COUNT];
        lacking[3] = None;
        minute.cycle(3000, lacking);
        let folder = tempfile::tempdir().unwrap();
        let set_up = SetUp { linked: true, added_mass_kg: 2.5 };
        let saved = minute.last(1.0, folder.path(), "bus0", set_up).write().unwrap();
        let table = std::fs::read_to_string(saved.join("measurement.csv")).unwrap();
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(lines[0], "# linked=true added_mass_kg=2.5");
        assert!(lines[1].starts_with("time_s,drive_valve,drive_position_m,drive_force_N"), "{}", lines[1]);
        assert_eq!((lines.len(), lines[2].split(',').next()), (1002, Some("2.000")));
        assert_eq!(std::fs::read_to_string(saved.join("bus.log")).unwrap().lines().count(), 1000);
        assert!(Minute::default().last(1.0, folder.path(), "bus0", set_up).write().is_err());
    }
}
