//! Rows of `measurement.csv` (what sensors and valves show) and `truth.csv` (what only a simulation knows).
//!
//! Columns of the first are those of rig-model.md, no others. The second has those of [`Truth`] and then one for each term that a
//! switched-on effect adds to a balance ([`crate::Plant::term_names`]); without effects there is none. Numbers are written
//! with the fewest digits that read back
//! to the same bits. Whoever owns the plant, emulator or rehearsal, writes the same files.

use crate::effects::Terms;
use crate::sensors::AxisReadings;
use crate::state::Axis;
use crate::truth::Truth;
use std::io::{self, Write};

/// One row of `measurement.csv` and of `truth.csv`.
#[derive(Clone, Debug)]
pub struct CycleRecord {
    /// Cycle number; the row's time is this many milliseconds.
    pub cycle: u64,
    /// Valve openings acting over the cycle, drive and load, -1 to 1.
    pub valve: [f64; 2],
    /// Sensors sampled at the cycle's start, drive and load.
    pub readings: [AxisReadings; 2],
    /// What only a simulation knows.
    pub truth: Truth,
    /// What each switched-on effect adds to its balance: room for all of them, so that a record is copied and not allocated.
    pub terms: Terms,
}

/// Columns of `measurement.csv` after `time_s`, for one axis; each is prefixed with `drive_` or `load_`.
pub const AXIS_COLUMNS: [&str; 5] = ["valve", "position_m", "force_N", "pressure_a_Pa", "pressure_b_Pa"];

/// Writes the head of `measurement.csv`, whose comment line says how the rig was set up.
///
/// # Errors
/// What `out` says.
pub fn write_measurement_head(out: &mut impl Write, linked: bool, added_mass_kg: f64) -> io::Result<()> {
    write!(out, "# linked={linked} added_mass_kg={added_mass_kg}\ntime_s")?;
    measurement_columns().try_for_each(|column| write!(out, ",{column}"))?;
    writeln!(out)
}

/// Columns of `measurement.csv` after `time_s`.
pub fn measurement_columns() -> impl Iterator<Item = String> {
    Axis::ALL
        .into_iter()
        .flat_map(|axis| AXIS_COLUMNS.iter().map(move |column| format!("{}_{column}", axis.name())))
}

impl CycleRecord {
    /// The values of [`measurement_columns`].
    pub fn measured(&self) -> impl Iterator<Item = f64> {
        self.valve.iter().zip(&self.readings).flat_map(|(valve, axis)| {
            let readings = [&axis.position, &axis.force, &axis.pressure_a, &axis.pressure_b];
            std::iter::once(*valve).chain(readings.map(|reading| reading.value))
        })
    }
}

/// Writes one row of `measurement.csv`.
///
/// # Errors
/// What `out` says.
pub fn write_measurement(out: &mut impl Write, record: &CycleRecord) -> io::Result<()> {
    write_time(out, record.cycle)?;
    record.measured().try_for_each(|value| write!(out, ",{value}"))?;
    writeln!(out)
}

/// Writes the head of `truth.csv`; `terms` are the names of the plant's terms.
///
/// # Errors
/// What `out` says.
pub fn write_truth_head(out: &mut impl Write, terms: &[String]) -> io::Result<()> {
    write!(out, "time_s,{}", Truth::COLUMNS.join(","))?;
    terms.iter().try_for_each(|term| write!(out, ",{term}"))?;
    writeln!(out)
}

/// Writes one row of `truth.csv`.
///
/// # Errors
/// What `out` says.
pub fn write_truth(out: &mut impl Write, record: &CycleRecord) -> io::Result<()> {
    write_time(out, record.cycle)?;
    // Debug, for tiny numbers with an exponent: Display would spell out their zeros.
    let values = record.truth.values();
    values.iter().chain(record.terms.values()).try_for_each(|value| write!(out, ",{value:?}"))?;
    writeln!(out)
}

fn write_time(out: &mut impl Write, cycle: u64) -> io::Result<()> {
    write!(out, "{}.{:03}", cycle / 1000, cycle % 1000)
}
