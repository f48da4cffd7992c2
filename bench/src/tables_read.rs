//! `measurement.csv` and `controller.csv` as columns of numbers.

use crate::SummaryError;
use std::path::Path;

/// Reads the named columns of a table, in the order of `names`; an empty cell is NaN-free: the row is left out of it.
///
/// Each column is a row of (time in s, value). Comment lines start with `#`.
///
/// # Errors
/// [`SummaryError::Read`] with file and line: a column that is missing, a cell that is no finite number.
pub fn columns(path: &Path, names: &[&str]) -> Result<Vec<Vec<(f64, f64)>>, SummaryError> {
    let refused = |reason: String| SummaryError::read(path, reason);
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| refused(error.to_string()))?;
    let head = reader.headers().map_err(|error| refused(error.to_string()))?.clone();
    let place = |name: &str| {
        head.iter()
            .position(|column| column == name)
            .ok_or_else(|| refused(format!("column {name} is missing")))
    };
    let time = place("time_s")?;
    let places = names.iter().map(|name| place(name)).collect::<Result<Vec<_>, _>>()?;
    let mut columns = vec![Vec::new(); names.len()];
    for row in reader.records() {
        let row = row.map_err(|error| refused(error.to_string()))?;
        let line = row.position().map_or(0, csv::Position::line);
        let number = |place: usize| {
            let cell = row.get(place).unwrap_or_default();
            cell.parse::<f64>()
                .ok()
                .filter(|number| number.is_finite())
                .ok_or_else(|| refused(format!("line {line}: '{cell}' is no finite number")))
        };
        let time_s = number(time)?;
        for (column, place) in columns.iter_mut().zip(&places) {
            if !row.get(*place).unwrap_or_default().is_empty() {
                column.push((time_s, number(*place)?));
            }
        }
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        std::fs::write(&path, text).unwrap();
        (folder, path)
    }

    #[test]
    fn columns_are_found_by_name_and_empty_cells_left_out() {
        let (_folder, path) = table("# linked=true\nb,time_s,a\n1,0.000,5\n,0.001,6\n");
        let read = columns(&path, &["a", "b"]).unwrap();
        assert_eq!(read, [vec![(0.0, 5.0), (0.001, 6.0)], vec![(0.0, 1.0)]]);
    }

    #[test]
    fn what_cannot_be_read_is_told_with_its_line() {
        for (text, hint) in [
            ("time_s,a\n0.0,x\n", "line 2: 'x'"),
            ("time_s,a\n0.0,NaN\n", "line 2: 'NaN'"),
            ("time_s,b\n0.0,1\n", "column a is missing"),
            ("time_s,a\n0.0\n", "t.csv"),
        ] {
            let (_folder, path) = table(text);
            let message = columns(&path, &["a"]).unwrap_err().to_string();
            assert!(message.contains(hint), "{text}: {message}");
        }
    }
}
