//! A table of a run's folder, read row by row: `time_s` is its first column, and a comment line begins with `#`.
//!
//! The end of a column's name is its unit (`drive_position_m`); columns of words are listed by name.

use crate::warn;
use figures::record::CHAINS;
use runlog::run_folder::FileError;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Columns of `faults.csv` that hold words; of `controller-*.csv` it is [`CHAINS`].
const OF_FAULTS: [&str; 5] = ["what", "fault", "at", "numbers", "cause"];

pub(super) struct RunTable {
    file: PathBuf,
    lines: BufReader<File>,
    /// Line of `row`, from 1.
    line: u64,
    row: String,
    pub(super) names: Vec<String>,
}

impl RunTable {
    /// Opens a table and reads its head; `None` where there is no such file, or no head in it.
    ///
    /// # Errors
    /// The file cannot be read, or does not begin with `time_s`.
    pub(super) fn open(file: &Path) -> Result<Option<Self>, FileError> {
        let opened = match File::open(file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            opened => opened.map_err(|error| FileError::read(file, error))?,
        };
        let lines = BufReader::with_capacity(1 << 16, opened);
        let mut table = Self { file: file.to_owned(), lines, line: 0, row: String::new(), names: Vec::new() };
        if !table.read_line()? {
            return Ok(None);
        }
        table.names = table.row.split(',').map(str::to_owned).collect();
        if table.names[0] != "time_s" {
            return Err(table.refused("the first column is not time_s"));
        }
        Ok(Some(table))
    }

    /// Advances to the next row; returns its time since cycle 0, ns, or `None` at the end.
    ///
    /// # Errors
    /// A row of another width, or with an invalid time.
    pub(super) fn next_ns(&mut self) -> Result<Option<u64>, FileError> {
        if !self.read_line()? {
            return Ok(None);
        }
        let (found, expected) = (self.row.split(',').count(), self.names.len());
        if found != expected {
            return Err(self.refused(&format!("{found} values where {expected} are expected")));
        }
        let time_s = self.number(self.cells().next().unwrap_or_default())?;
        if time_s < 0.0 {
            return Err(self.refused("a time before cycle 0"));
        }
        Ok(Some((time_s * 1e9).round() as u64))
    }

    /// Cells of the row, in the order of the names.
    pub(super) fn cells(&self) -> impl Iterator<Item = &str> {
        self.row.split(',')
    }

    /// A cell of the row as a number.
    ///
    /// # Errors
    /// The cell is no finite number.
    pub(super) fn number(&self, cell: &str) -> Result<f64, FileError> {
        let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.refused(&format!("'{cell}' is no finite number")))
    }

    /// The next line that is no comment. An incomplete last line, which a killed process may leave, is skipped.
    fn read_line(&mut self) -> Result<bool, FileError> {
        loop {
            self.row.clear();
            self.line += 1;
            if let Err(error) = self.lines.read_line(&mut self.row) {
                return Err(self.refused(&error.to_string()));
            }
            match self.row.pop() {
                None => return Ok(false),
                Some('\n') if self.row.starts_with('#') => {}
                Some('\n') => return Ok(true),
                Some(_) => {
                    let file = self.file.display();
                    warn(&format!("{file}:{}: the last line is cut, and left out", self.line));
                    return Ok(false);
                }
            }
        }
    }

    fn refused(&self, reason: &str) -> FileError {
        FileError::read(&self.file, format!("line {}: {reason}", self.line))
    }
}

pub(super) fn holds_words(column: &str) -> bool {
    CHAINS.contains(&column) || OF_FAULTS.contains(&column)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(text: &str) -> Result<Option<RunTable>, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table.csv");
        std::fs::write(&file, text).unwrap();
        RunTable::open(&file)
    }

    #[test]
    fn rows_come_with_their_time_and_a_cut_one_does_not() {
        let mut table =
            opened("# linked=false\ntime_s,at_m\n0.001,2\n# more\n0.002,\n0.003,4").unwrap().unwrap();
        assert_eq!(table.names, ["time_s", "at_m"]);
        assert_eq!(table.next_ns().unwrap(), Some(1_000_000));
        assert_eq!(table.cells().collect::<Vec<_>>(), ["0.001", "2"]);
        assert_eq!(table.next_ns().unwrap(), Some(2_000_000));
        assert_eq!(table.next_ns().unwrap(), None);
    }

    #[test]
    fn a_malformed_row_is_refused_with_its_line() {
        for (text, reason) in [
            ("a,time_s\n", "line 1: the first column is not time_s"),
            ("time_s,a\n0.001\n", "line 2: 1 values where 2 are expected"),
            ("time_s,a\n-1,0\n", "line 2: a time before cycle 0"),
            ("#\ntime_s,a\nnan,0\n", "line 3: 'nan' is no finite number"),
        ] {
            let refused = opened(text).and_then(|table| table.unwrap().next_ns()).unwrap_err().to_string();
            assert!(refused.contains(reason), "{refused}");
        }
        assert!(opened("").unwrap().is_none() && opened("time_").unwrap().is_none());
    }

    #[test]
    fn each_column_of_the_rig_that_is_no_plain_number_has_a_unit() {
        for (column, expected) in [
            ("drive_position_m", "m"),
            ("drive_flow_a_m3_per_s", "m^3/s"),
            ("velocity_m_per_s", "m/s"),
            ("load_pressure_b_Pa", "Pa"),
            ("drive_valve", ""),
        ] {
            assert_eq!(settings::unit_of(column).unwrap_or_default(), expected, "{column}");
        }
    }
}
