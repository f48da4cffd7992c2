//! `measurement.csv`, what sensors and valves show, and `truth.csv`, what only a simulation knows: a row each cycle.
//!
//! Columns of the first are those of rig-model.md, no others. The second has those of the plant's true states and then one for
//! each term that a switched-on effect adds to a balance; without effects there is none. Numbers are written with the fewest
//! digits that read back to the same bits. Whoever owns the plant, emulator or rehearsal, writes the same files.

use crate::run_folder::{LineFile, MEASUREMENT_CSV, TRUTH_CSV};
use crate::telemetry::SetUp;
use std::io::{self, Write};
use std::path::Path;

macro_rules! measured {
    ($($column:literal),*) => {
        /// Columns of `measurement.csv` after `time_s` for one axis, each prefixed there with `drive_` or `load_`.
        pub const AXIS_COLUMNS: [&str; 5] = [$($column),*];
        /// Columns of `measurement.csv` after `time_s`.
        pub const MEASURED: [&str; 2 * AXIS_COLUMNS.len()] =
            [$(concat!("drive_", $column),)* $(concat!("load_", $column)),*];
    };
}

measured!("valve", "position_m", "force_N", "pressure_a_Pa", "pressure_b_Pa");

/// Writes the head of `measurement.csv`, whose comment line says how the rig was set up.
///
/// # Errors
/// What `out` says.
pub fn write_measurement_head(out: &mut impl Write, set_up: SetUp) -> io::Result<()> {
    let SetUp { linked, added_mass_kg } = set_up;
    writeln!(out, "# linked={linked} added_mass_kg={added_mass_kg}\ntime_s,{}", MEASURED.join(","))
}

/// Writes one row of `measurement.csv`, the values of [`MEASURED`].
///
/// # Errors
/// What `out` says.
pub fn write_measurement(
    out: &mut impl Write,
    cycle: u64,
    mut values: impl Iterator<Item = f64>,
) -> io::Result<()> {
    write_time(out, cycle)?;
    values.try_for_each(|value| write!(out, ",{value}"))?;
    writeln!(out)
}

/// Writes one row of `truth.csv`.
fn write_truth(out: &mut impl Write, cycle: u64, mut values: impl Iterator<Item = f64>) -> io::Result<()> {
    write_time(out, cycle)?;
    // Debug, for tiny numbers with an exponent: Display would spell out their zeros.
    values.try_for_each(|value| write!(out, ",{value:?}"))?;
    writeln!(out)
}

fn write_time(out: &mut impl Write, cycle: u64) -> io::Result<()> {
    write!(out, "{}.{:03}", cycle / 1000, cycle % 1000)
}

/// Both files of a run, while it goes on.
pub struct CycleTables {
    measurement: LineFile,
    truth: LineFile,
}

impl CycleTables {
    /// Creates both files in the folder and writes their heads; `truth` has the columns of `truth.csv` after `time_s`.
    ///
    /// # Errors
    /// The system's, with a file that cannot be created or written.
    pub fn create<'a>(
        folder: &Path,
        set_up: SetUp,
        mut truth: impl Iterator<Item = &'a str>,
    ) -> io::Result<Self> {
        let mut measurement = LineFile::create(&folder.join(MEASUREMENT_CSV))?;
        write_measurement_head(measurement.lines(), set_up)?;
        let mut file = LineFile::create(&folder.join(TRUTH_CSV))?;
        write!(file.lines(), "time_s")?;
        truth.try_for_each(|column| write!(file.lines(), ",{column}"))?;
        writeln!(file.lines())?;
        Ok(Self { measurement, truth: file })
    }

    /// Adds the row of a cycle to each: the values of [`MEASURED`], and those of the columns that the file was created with.
    ///
    /// # Errors
    /// The system's: the disk is full.
    pub fn write(
        &mut self,
        cycle: u64,
        measured: impl Iterator<Item = f64>,
        truth: impl Iterator<Item = f64>,
    ) -> io::Result<()> {
        write_measurement(self.measurement.lines(), cycle, measured)?;
        write_truth(self.truth.lines(), cycle, truth)?;
        self.files().into_iter().try_for_each(LineFile::write_when_full)
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// As [`CycleTables::write`].
    pub fn write_out(&mut self) -> io::Result<()> {
        self.files().into_iter().try_for_each(LineFile::write_out)
    }

    /// The files themselves.
    pub fn files(&mut self) -> [&mut LineFile; 2] {
        [&mut self.measurement, &mut self.truth]
    }
}
