//! How a table is laid out, as far as it can be seen: separator, decimal sign, head, cells without a value.

use super::NewError;
use model::{Unit, with_powers};
use records::CalendarTime;
use std::path::Path;

/// Rows that are looked at.
const LOOKED_AT: usize = 500;

/// A table as a model file describes it.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) separator: String,
    pub(super) is_decimal_comma: bool,
    /// Lines above the head.
    pub(super) skip_lines: u64,
    /// Cells that hold no value.
    pub(super) absent: Vec<String>,
    pub(super) head: Vec<String>,
    /// Units of the columns, where a row under the head has them.
    pub(super) units: Option<Vec<String>>,
    pub(super) is_number: Vec<bool>,
    /// Whether each column holds times of a calendar.
    pub(super) is_calendar: Vec<bool>,
}

impl Table {
    /// The unit of a column in the row under the head.
    pub(super) fn unit(&self, column: usize) -> Option<&str> {
        self.units
            .as_ref()
            .and_then(|units| units.get(column))
            .map(String::as_str)
            .filter(|unit| !is_missing(unit))
    }

    pub(super) fn of(record: &Path, text: &str) -> Result<Self, NewError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines: Vec<(usize, &str)> = text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
            .take(LOOKED_AT)
            .collect();
        let no_head = || NewError::Head { file: record.display().to_string() };
        // In the last line that is looked at there are numbers, whatever stands above.
        let separator = separator(lines.last().ok_or_else(no_head)?.1);
        let cells: Vec<Vec<String>> = lines.iter().map(|(_, line)| split(line, separator)).collect();
        let decimal = |is_comma: bool| {
            let is_number = move |cell: &String| {
                is_missing(cell) || number(cell, is_comma).is_some() || CalendarTime::parse(cell).is_some()
            };
            let named = |row: &[String]| row.iter().any(|cell| cell.chars().any(char::is_alphabetic));
            let full = |row: &[String], next: &[String]| row.len() == next.len() && row.len() > 1;
            (1..cells.len()).find(|row| {
                let (head, first) = (&cells[row - 1], &cells[*row]);
                full(head, first)
                    && named(head)
                    && !head.iter().all(is_number)
                    && first.iter().filter(|cell| is_number(cell)).count() * 2 > first.len()
            })
        };
        let commas = cells
            .iter()
            .skip(1)
            .flatten()
            .filter(|cell| number(cell, false).is_none() && number(cell, true).is_some());
        let is_decimal_comma = separator != "," && commas.count() > 0;
        let first = decimal(is_decimal_comma).ok_or_else(no_head)?;
        let under = first - 1;
        let has_units =
            under > 0 && is_unit_row(&cells[under]) && is_names(&cells[under - 1], cells[under].len());
        let units = has_units.then(|| cells[under].iter().map(|cell| bare(cell).to_owned()).collect());
        let head_at = under - usize::from(has_units);
        let head: Vec<String> = cells[head_at].clone();
        let mut absent: Vec<String> = Vec::new();
        for cell in cells[first..].iter().flatten().filter(|cell| !cell.is_empty() && is_missing(cell)) {
            if !absent.contains(cell) {
                absent.push(cell.clone());
            }
        }
        let is_number = |column: usize| {
            let cell = |row: &Vec<String>| {
                row.get(column)
                    .is_none_or(|cell| is_missing(cell) || number(cell, is_decimal_comma).is_some())
            };
            cells[first..].iter().all(cell)
        };
        let is_number = (0..head.len()).map(is_number).collect();
        let is_time = |column: usize, row: usize| {
            cells[row].get(column).is_some_and(|cell| CalendarTime::parse(cell).is_some())
        };
        let is_calendar: Vec<bool> = (0..head.len()).map(|column| is_time(column, first)).collect();
        for column in (0..head.len()).filter(|column| is_calendar[*column]) {
            if let Some(row) = (first..cells.len()).find(|row| !is_time(column, *row)) {
                return Err(NewError::Calendar {
                    file: record.display().to_string(),
                    line: lines[row].0 as u64 + 1,
                    column: head[column].clone(),
                    cell: cells[row].get(column).cloned().unwrap_or_default(),
                });
            }
        }
        let skip_lines = lines[head_at].0 as u64;
        // Comments above the head are passed over as it is.
        let is_comment = |line: &str| line.trim().is_empty() || line.trim_start().starts_with('#');
        let is_clean = text.lines().take(skip_lines as usize).all(is_comment);
        let skip_lines = if is_clean { 0 } else { skip_lines };
        Ok(Self {
            separator: separator.into(),
            is_decimal_comma,
            skip_lines,
            absent,
            head,
            units,
            is_number,
            is_calendar,
        })
    }
}

/// A cell without brackets around it.
fn bare(cell: &str) -> &str {
    cell.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')'])
}

/// Whether each cell is a unit, or none, and one of them is.
fn is_unit_row(row: &[String]) -> bool {
    let is_unit = |cell: &&str| Unit::parse(&with_powers(cell)).is_ok() || ["degC", "°C"].contains(cell);
    let cells: Vec<&str> = row.iter().map(|cell| bare(cell)).collect();
    cells.iter().any(is_unit) && cells.iter().all(|cell| is_missing(cell) || is_unit(cell))
}

/// Whether so many names stand in a row.
fn is_names(row: &[String], count: usize) -> bool {
    row.len() == count && row.iter().all(|cell| cell.chars().any(char::is_alphabetic))
}

fn separator(line: &str) -> &'static str {
    // Outside of quotes.
    let line: String = line.split('"').step_by(2).collect();
    let count = |character: char| line.matches(character).count();
    match () {
        () if count(';') > 0 => ";",
        () if count('\t') > 0 => "\t",
        () if count(',') > 0 => ",",
        () => "whitespace",
    }
}

fn split(line: &str, separator: &str) -> Vec<String> {
    if separator == "whitespace" {
        return line.split_whitespace().map(str::to_owned).collect();
    }
    records::cells(line, separator.as_bytes()[0])
}

fn number(cell: &str, is_comma: bool) -> Option<f64> {
    let text = if is_comma { cell.replace(',', ".") } else { cell.to_owned() };
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

fn is_missing(cell: &str) -> bool {
    cell.is_empty() || ["nan", "na", "n/a", "null", "none", "-"].contains(&cell.to_lowercase().as_str())
}
