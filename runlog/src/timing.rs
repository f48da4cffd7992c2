//! When everything of a cycle happened: rows of `emulator-timing.csv`, `controller-timing.csv` and a flight recorder's dump.
//!
//! Both processes write the same columns on the same clock (CLOCK_MONOTONIC, one for all processes of a host), so that a row of
//! the rig and a row of a controller of one cycle tell how long a frame was on its way between them:
//!
//! ```text
//!   rig         due ─ woke ─ send ─ receive ─ step ─ done          due: the cycle's scheduled time
//!                            │sensors handed over      ▲command that answers an earlier cycle arrived
//!                            ▼ one way                 │ one way
//!   controller               due ─ woke ─ receive ─ step ─ send ─ done   due: arrival of the sensors that wake it
//! ```
//!
//! Stamps are ns of that clock, 0 where there is none; stages are lengths in ns. Counts are those of the cycle alone.

use realtime::{CycleStages, VitalCounts};
use std::io::{self, Write};
use std::num::ParseIntError;

/// The exchange of sensors and command of one axis in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exchange {
    /// Rig: when the sensors of this cycle were handed to the bus. Controller: when they arrived at its queue. 0: not.
    pub sensors_ns: u64,
    /// Rig: when the command that acts from this cycle on arrived, if a new one does. Controller: when its answer was handed to
    /// the bus. 0: none.
    pub command_ns: u64,
    /// Cycle whose sensors that command answers; meaningless when `command_ns` is 0.
    pub answers: u64,
}

/// One cycle of one process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleTiming {
    /// The rig's cycle.
    pub cycle: u64,
    /// Cycles right before this one that the rig missed, or that the controller never had sensors of.
    pub skipped: u64,
    /// When it was due.
    pub due_ns: u64,
    /// When the thread woke for it.
    pub woke_ns: u64,
    /// Length of the stage that takes frames.
    pub receive_ns: u64,
    /// Length of the stage that computes.
    pub step_ns: u64,
    /// Length of the stage that sends frames.
    pub send_ns: u64,
    /// When everything of the cycle was done; of a controller, without a wait in between for the other axis's sensors.
    pub done_ns: u64,
    /// Exchange of the drive axis.
    pub drive: Exchange,
    /// Exchange of the load axis.
    pub load: Exchange,
    /// The kernel's counters over the cycle.
    pub vitals: VitalCounts,
}

/// A column: its name in the head line, and the number that it holds.
type Column = (&'static str, fn(&mut CycleTiming) -> &mut u64);

/// Columns in their order. The only place where they stand.
const COLUMNS: [Column; 21] = [
    ("cycle", |row| &mut row.cycle),
    ("skipped", |row| &mut row.skipped),
    ("due_ns", |row| &mut row.due_ns),
    ("woke_ns", |row| &mut row.woke_ns),
    ("receive_ns", |row| &mut row.receive_ns),
    ("step_ns", |row| &mut row.step_ns),
    ("send_ns", |row| &mut row.send_ns),
    ("done_ns", |row| &mut row.done_ns),
    ("drive_sensors_ns", |row| &mut row.drive.sensors_ns),
    ("drive_command_ns", |row| &mut row.drive.command_ns),
    ("drive_answers_cycle", |row| &mut row.drive.answers),
    ("load_sensors_ns", |row| &mut row.load.sensors_ns),
    ("load_command_ns", |row| &mut row.load.command_ns),
    ("load_answers_cycle", |row| &mut row.load.answers),
    ("minor_faults", |row| &mut row.vitals.minor_faults),
    ("major_faults", |row| &mut row.vitals.major_faults),
    ("voluntary_switches", |row| &mut row.vitals.voluntary_switches),
    ("involuntary_switches", |row| &mut row.vitals.involuntary_switches),
    ("run_delay_ns", |row| &mut row.vitals.run_delay_ns),
    ("continued", |row| &mut row.vitals.continued),
    ("cpu", |row| &mut row.vitals.cpu),
];

fn names() -> [&'static str; COLUMNS.len()] {
    COLUMNS.map(|(name, _)| name)
}

impl CycleTiming {
    /// The values in the order of [`COLUMNS`].
    #[must_use]
    pub fn values(mut self) -> [u64; COLUMNS.len()] {
        COLUMNS.map(|(_, number)| *number(&mut self))
    }

    /// The stages of the cycle.
    #[must_use]
    pub fn stages(&self) -> CycleStages {
        let Self { cycle, skipped, due_ns, woke_ns, receive_ns, step_ns, send_ns, done_ns, .. } = *self;
        CycleStages { cycle, skipped, due_ns, woke_ns, receive_ns, step_ns, send_ns, done_ns }
    }

    /// The row with these values.
    #[must_use]
    pub fn from_values(values: &[u64; COLUMNS.len()]) -> Self {
        let mut row = Self::default();
        COLUMNS.iter().zip(values).for_each(|((_, number), value)| *number(&mut row) = *value);
        row
    }
}

/// Writes the head line.
///
/// # Errors
/// What `out` says.
pub fn write_head(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", names().join(","))
}

/// Writes a row.
///
/// # Errors
/// What `out` says.
pub fn write_row(out: &mut impl Write, row: &CycleTiming) -> io::Result<()> {
    for (place, value) in row.values().iter().enumerate() {
        if place > 0 {
            out.write_all(b",")?;
        }
        write!(out, "{value}")?;
    }
    out.write_all(b"\n")
}

/// What a table of cycles has wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// Not the columns that this version writes.
    #[error("line 1: columns are not those of a timing table: {0}")]
    Head(String),
    /// A row that is cut short or longer.
    #[error("line {line}: {found} values where {} are expected", COLUMNS.len())]
    Width {
        /// Line in the file, from 1.
        line: usize,
        /// Values found.
        found: usize,
    },
    /// A value that is no whole number.
    #[error("line {line}, {column}: {reason}")]
    Value {
        /// Line in the file, from 1.
        line: usize,
        /// Name of the column.
        column: &'static str,
        /// What the parser said.
        reason: ParseIntError,
    },
}

/// Reads a table; a last line without its end, which a killed process may leave, is left out.
///
/// # Errors
/// [`TableError`] with line and column.
pub fn read(text: &str) -> Result<Vec<CycleTiming>, TableError> {
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut lines = whole.lines().enumerate();
    let head = lines.next().map_or("", |(_, head)| head);
    if !head.split(',').eq(names()) {
        return Err(TableError::Head(head.chars().take(200).collect()));
    }
    lines.map(|(index, line)| read_row(line, index + 1)).collect()
}

fn read_row(text: &str, line: usize) -> Result<CycleTiming, TableError> {
    let mut values = [0; COLUMNS.len()];
    let found = text.split(',').count();
    if found != COLUMNS.len() {
        return Err(TableError::Width { line, found });
    }
    for ((value, column), cell) in values.iter_mut().zip(names()).zip(text.split(',')) {
        *value = cell.parse().map_err(|reason| TableError::Value { line, column, reason })?;
    }
    Ok(CycleTiming::from_values(&values))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(start: u64) -> CycleTiming {
        CycleTiming::from_values(&std::array::from_fn(|place| start + place as u64))
    }

    #[test]
    fn a_table_reads_what_was_written_and_leaves_out_a_half_line() {
        let rows = [row(0), row(100)];
        assert_eq!(row(7).values(), std::array::from_fn(|place| 7 + place as u64));
        let mut text = Vec::new();
        write_head(&mut text).unwrap();
        rows.iter().for_each(|row| write_row(&mut text, row).unwrap());
        text.extend_from_slice(b"3,4");
        assert_eq!(read(std::str::from_utf8(&text).unwrap()).unwrap(), rows);
    }

    #[test]
    fn a_malformed_table_is_refused_with_its_place() {
        assert!(matches!(read("a,b\n"), Err(TableError::Head(_))));
        let head = names().join(",");
        let reported = read(&format!("{head}\n1,2\n")).unwrap_err().to_string();
        assert!(reported.starts_with("line 2: 2 values"), "{reported}");
        let values = ["1"; COLUMNS.len()].join(",").replacen("1,", "x,", 1);
        let reported = read(&format!("{head}\n{values}\n")).unwrap_err().to_string();
        assert!(reported.starts_with("line 2, cycle: "), "{reported}");
    }
}
