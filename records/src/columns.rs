//! Records of any plant: named columns of a text table over time, without a rig's channels.
//!
//! A missing cell is `None`, never NaN and never interpolated; time is checked by whoever uses it.

use super::calendar::CalendarTime;
use super::table::{Layout, Separator, Table};
use super::{ReadError, Warning};
use std::path::{Path, PathBuf};

/// What a cell with a time of a calendar holds.
const CALENDAR: &str =
    "a time such as 2026-11-27T14:05:03.250, in all rows with a zone (Z or +01:00) or in none";

/// How a table is laid out, and which columns are wanted.
#[derive(Clone, Debug)]
pub struct ColumnOptions<'a> {
    /// Column of the time.
    pub time: &'a str,
    /// Seconds in a unit of that column.
    pub time_unit_s: f64,
    /// It holds times of a calendar, which become seconds since the first row.
    pub is_calendar: bool,
    /// Columns that must be there.
    pub columns: &'a [&'a str],
    /// One character, or `whitespace`.
    pub separator: &'a str,
    /// Whether decimals are written with a comma.
    pub is_decimal_comma: bool,
    /// Prefix of a comment line.
    pub comment: &'a str,
    /// Lines before the head.
    pub skip_lines: u64,
    /// Cells without a value, beside empty ones.
    pub absent: &'a [String],
}

/// Columns over time.
#[derive(Clone, Debug)]
pub struct Columns {
    /// The file that was read.
    pub file: PathBuf,
    /// Time of each row, s: from the first row on where it is that of a calendar.
    pub time_s: Vec<f64>,
    /// Line of each row, from 1.
    pub lines: Vec<u64>,
    /// Those that were wanted, in their order, as they are written.
    pub values: Vec<Vec<Option<f64>>>,
    /// The row of units, where the table has one.
    pub units: Option<UnitRow>,
    /// What the reader noticed.
    pub warnings: Vec<Warning>,
}

/// A row of units under the head.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitRow {
    /// Its line, from 1.
    pub line: u64,
    /// What it says of the time.
    pub time: String,
    /// What it says of the wanted columns, in their order; without brackets around it.
    pub columns: Vec<String>,
}

/// Reads the wanted columns of a table.
///
/// # Errors
/// [`ReadError`] with file, line, column, value and what is allowed.
pub fn read_columns(file: &Path, options: &ColumnOptions<'_>) -> Result<Columns, ReadError> {
    let separator = match options.separator.as_bytes() {
        [character] if character.is_ascii() => Separator::Character(*character),
        _ if options.separator == "whitespace" => Separator::Whitespace,
        _ => {
            let reason =
                format!("separator = \"{}\"; allowed is one character, or \"whitespace\"", options.separator);
            return Err(ReadError::Open { file: file.into(), reason });
        }
    };
    let comment = Some(options.comment.to_owned()).filter(|comment| !comment.is_empty());
    let layout = Layout { separator, comment, skip_lines: options.skip_lines, head: true };
    let mut table = Table::read(file, &layout)?;
    let time = table.required(options.time)?;
    let places =
        options.columns.iter().map(|column| table.required(column)).collect::<Result<Vec<_>, _>>()?;
    let units = unit_row(&mut table, (time, &places), options)?;
    let mut columns = Columns {
        units,
        file: file.into(),
        time_s: Vec::with_capacity(table.rows.len()),
        lines: Vec::with_capacity(table.rows.len()),
        values: vec![Vec::with_capacity(table.rows.len()); places.len()],
        warnings: Vec::new(),
    };
    let mut first = None;
    for (line, row) in &table.rows {
        let cell = |place: usize| row.get(place).unwrap_or_default();
        let value = |place: usize| table.number(*line, place, cell(place), options.is_decimal_comma);
        columns.time_s.push(match options.is_calendar {
            true => {
                let since_s =
                    CalendarTime::parse(cell(time)).and_then(|now| now.since_s(*first.get_or_insert(now)));
                since_s.ok_or_else(|| table.refused(*line, options.time, cell(time), CALENDAR))?
            }
            false => value(time)? * options.time_unit_s,
        });
        columns.lines.push(*line);
        for (place, values) in places.iter().zip(&mut columns.values) {
            let is_absent = cell(*place).is_empty() || options.absent.iter().any(|text| text == cell(*place));
            values.push(if is_absent { None } else { Some(value(*place)?) });
        }
    }
    if table.cut.is_some() {
        let text = "the last line is cut, and left out: its writer was killed".to_owned();
        columns.warnings.push(Warning { line: table.cut, text });
    }
    Ok(columns)
}

/// Takes the first row out where it holds texts alone: no row of a record, whose time is a number or a time of a calendar.
fn unit_row(
    table: &mut Table,
    (time, places): (usize, &[usize]),
    options: &ColumnOptions<'_>,
) -> Result<Option<UnitRow>, ReadError> {
    let Some((line, row)) = table.rows.first() else { return Ok(None) };
    let is_value = |cell: &str| {
        let number = if options.is_decimal_comma { cell.replacen(',', ".", 1) } else { cell.to_owned() };
        number.parse::<f64>().is_ok() || CalendarTime::parse(cell).is_some()
    };
    if row.iter().any(is_value) || row.iter().all(str::is_empty) {
        return Ok(None);
    }
    let of = |place: usize| {
        let cell = row.get(place).unwrap_or_default().trim();
        let inner = [('[', ']'), ('(', ')')]
            .into_iter()
            .find_map(|(open, close)| cell.strip_prefix(open)?.strip_suffix(close));
        inner.unwrap_or(cell).trim().to_owned()
    };
    let found =
        UnitRow { line: *line, time: of(time), columns: places.iter().map(|place| of(*place)).collect() };
    table.rows.remove(0);
    if table.rows.is_empty() {
        return Err(ReadError::Empty { file: table.file.clone() });
    }
    Ok(Some(found))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, columns: &[&str]) -> Result<Columns, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("any.csv");
        std::fs::write(&path, text).unwrap();
        let absent = ["-".to_owned()];
        let options = ColumnOptions {
            time: "Zeit",
            time_unit_s: 1e-3,
            is_calendar: false,
            columns,
            separator: ";",
            is_decimal_comma: true,
            comment: "%",
            skip_lines: 0,
            absent: &absent,
        };
        read_columns(&path, &options)
    }

    #[test]
    fn wanted_columns_are_read_with_their_holes() {
        let text = "% any plant\nZeit;u;y\n0;1,5;2\n10;;-\n30;3;4\n40;5";
        let columns = read(text, &["y", "u"]).unwrap();
        assert_eq!(columns.time_s, [0.0, 0.01, 0.03]);
        assert_eq!(columns.values, [[Some(2.0), None, Some(4.0)], [Some(1.5), None, Some(3.0)]]);
        assert_eq!((columns.lines, columns.warnings[0].line), (vec![3, 4, 5], Some(6)));
    }

    #[test]
    fn times_of_a_calendar_are_seconds_since_the_first_row() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("any.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            let options = ColumnOptions {
                time: "at",
                time_unit_s: 1.0,
                is_calendar: true,
                columns: &["u"],
                separator: ",",
                is_decimal_comma: false,
                comment: "#",
                skip_lines: 0,
                absent: &[],
            };
            read_columns(&path, &options).map_err(|error| error.to_string())
        };
        let text = "at,u\n2026-11-27T23:59:59.5Z,1\n2026-11-28T00:00:00.25Z,2\n";
        assert_eq!(read(text).unwrap().time_s, [0.0, 0.75]);
        for (from, to) in [("00.25Z", "00.25"), ("2026-11-28T00", "28.11.2026 00")] {
            let message = read(&text.replace(from, to)).unwrap_err();
            let expected = "allowed is a time such as 2026-11-27T14:05:03.250, in all rows with a zone";
            assert!(message.contains("any.csv:3: at = '") && message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_row_of_texts_under_the_head_holds_units() {
        let columns = read("Zeit;u;y\nms;[mm];-\n0;1,5;2\n10;3;4\n", &["y", "u"]).unwrap();
        let units = UnitRow { line: 2, time: "ms".into(), columns: vec!["-".into(), "mm".into()] };
        assert_eq!((columns.units, columns.lines.as_slice()), (Some(units), &[3, 4][..]));
        assert_eq!(read("Zeit;u\n0;1\n", &["u"]).unwrap().units, None);
        // A number in it, or a place below, makes it a row that is wrong.
        for text in ["Zeit;u\nms;1\n0;1\n", "Zeit;u\n0;1\nms;mm\n"] {
            assert!(read(text, &["u"]).unwrap_err().to_string().contains("allowed is a finite number"));
        }
        assert!(read("Zeit;u\nms;mm\n", &["u"]).unwrap_err().to_string().contains("has no rows"));
    }

    #[test]
    fn a_missing_column_and_a_text_are_refused_with_their_line() {
        let message = read("Zeit;u\n0;1\n", &["y"]).unwrap_err().to_string();
        assert!(message.contains("any.csv:1: column y is missing; the file has Zeit, u"), "{message}");
        let message = read("Zeit;u\n0;1\n5;x\n", &["u"]).unwrap_err().to_string();
        assert!(message.contains("any.csv:3: u = 'x'; allowed is a finite number"), "{message}");
    }
}
