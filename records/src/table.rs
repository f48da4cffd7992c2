//! A text table as rows of cells, each with the line that a person finds it on.
//!
//! Comments and blank lines are taken out before the `csv` crate sees the text, which counts lines without them; the numbers of
//! those that stay are kept beside it.

use super::ReadError;
use std::path::{Path, PathBuf};

/// How a file is laid out.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) separator: Separator,
    /// Prefix of a comment line.
    pub(super) comment: Option<String>,
    /// Lines before the head that are no table.
    pub(super) skip_lines: u64,
    /// Whether the first row names the columns; else they are called 1, 2, 3 …
    pub(super) head: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// One character, outside of quotes.
    Character(u8),
    /// Any run of white space.
    Whitespace,
}

impl Default for Layout {
    fn default() -> Self {
        Self { separator: Separator::Character(b','), comment: Some("#".into()), skip_lines: 0, head: true }
    }
}

pub(super) struct Table {
    pub(super) file: PathBuf,
    /// Names of the columns.
    pub(super) head: Vec<String>,
    /// Line of the head, from 1.
    pub(super) head_line: u64,
    /// Comment lines with their numbers.
    pub(super) comments: Vec<(u64, String)>,
    pub(super) rows: Vec<(u64, csv::StringRecord)>,
    /// The last line, when it is not whole: somebody was killed while writing.
    pub(super) cut: Option<u64>,
}

/// The cells of a line, as a table with this separator has them: quoted ones may hold it.
#[must_use]
pub fn cells(line: &str, separator: u8) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    let row = reader.records().next().and_then(Result::ok);
    row.map_or(Vec::new(), |row| row.iter().map(str::to_owned).collect())
}

impl Table {
    pub(super) fn read(file: &Path, layout: &Layout) -> Result<Self, ReadError> {
        let bytes = std::fs::read(file)
            .map_err(|error| ReadError::Open { file: file.into(), reason: error.to_string() })?;
        Self::parse(file, &String::from_utf8_lossy(&bytes), layout)
    }

    fn parse(file: &Path, text: &str, layout: &Layout) -> Result<Self, ReadError> {
        let (mut kept, mut numbers, mut comments) =
            (String::with_capacity(text.len()), Vec::new(), Vec::new());
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        for (number, line) in (1..).zip(text.lines()).skip(layout.skip_lines as usize) {
            let comment = layout.comment.as_ref().is_some_and(|prefix| line.starts_with(prefix.as_str()));
            if comment {
                comments.push((number, line.to_owned()));
            } else if !line.trim().is_empty() {
                numbers.push(number);
                match layout.separator {
                    Separator::Character(_) => kept.push_str(line),
                    Separator::Whitespace => {
                        kept.push_str(&line.split_whitespace().collect::<Vec<_>>().join(" "));
                    }
                }
                kept.push('\n');
            }
        }
        let separator = match layout.separator {
            Separator::Character(character) => character,
            Separator::Whitespace => b' ',
        };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(separator)
            .trim(csv::Trim::All)
            .from_reader(kept.as_bytes());
        let mut rows = Vec::with_capacity(numbers.len());
        for row in reader.records() {
            let row =
                row.map_err(|error| ReadError::Open { file: file.into(), reason: error.to_string() })?;
            let place = row.position().map_or(0, |position| position.line() as usize - 1);
            rows.push((numbers.get(place).copied().unwrap_or(0), row));
        }
        if rows.is_empty() {
            return Err(ReadError::Empty { file: file.into() });
        }
        let (head_line, head) = if layout.head {
            let (line, head) = rows.remove(0);
            (line, head.iter().map(str::to_owned).collect())
        } else {
            (rows[0].0, (1..=rows[0].1.len()).map(|place| place.to_string()).collect())
        };
        let mut table = Self { file: file.into(), head, head_line, comments, rows, cut: None };
        table.check(text.ends_with('\n'))?;
        Ok(table)
    }

    fn check(&mut self, whole: bool) -> Result<(), ReadError> {
        let expected = self.head.len();
        for (place, column) in self.head.iter().enumerate() {
            if self.head[..place].contains(column) {
                let message = format!("column {column} stands twice: delete or rename one");
                return Err(ReadError::at(&self.file, self.head_line, message));
            }
        }
        if !whole && self.rows.last().is_some_and(|(_, row)| row.len() < expected) {
            self.cut = self.rows.pop().map(|(line, _)| line);
        }
        if let Some((line, row)) = self.rows.iter().find(|(_, row)| row.len() != expected) {
            let hint = match expected {
                1 => ": is another separator, or a decimal comma, to be named where the record is described?",
                _ => "",
            };
            let message = format!("{} cells, but the head has {expected}{hint}", row.len());
            return Err(ReadError::at(&self.file, *line, message));
        }
        if self.rows.is_empty() {
            return Err(ReadError::Empty { file: self.file.clone() });
        }
        Ok(())
    }

    pub(super) fn place(&self, column: &str) -> Option<usize> {
        self.head.iter().position(|name| name == column)
    }

    /// The place of a column that must be there.
    pub(super) fn required(&self, column: &str) -> Result<usize, ReadError> {
        self.place(column).ok_or_else(|| {
            let message = format!("column {column} is missing; the file has {}", self.head.join(", "));
            ReadError::at(&self.file, self.head_line, message)
        })
    }

    /// The number in a cell that is not empty.
    pub(super) fn number(&self, line: u64, place: usize, cell: &str, comma: bool) -> Result<f64, ReadError> {
        let parsed = if comma { cell.replacen(',', ".", 1).parse() } else { cell.parse::<f64>() };
        parsed.ok().filter(|number| number.is_finite()).ok_or_else(|| {
            let allowed = "a finite number, or an empty cell where there is no value";
            self.refused(line, &self.head[place], cell, allowed)
        })
    }

    pub(super) fn refused(&self, line: u64, what: &str, value: &str, allowed: &str) -> ReadError {
        ReadError::at(&self.file, line, format!("{what} = '{value}'; allowed is {allowed}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str, layout: &Layout) -> Result<Table, ReadError> {
        Table::parse(Path::new("a.csv"), text, layout)
    }

    #[test]
    fn rows_know_their_line_whatever_stands_between_them() {
        let text = "\u{feff}# one\r\n\r\na,b\r\n1,2\r\n# in the midst\r\n\r\n3,\"4\"\r\n";
        let table = parse(text, &Layout::default()).unwrap();
        assert_eq!((table.head.as_slice(), table.head_line), (&["a".to_owned(), "b".to_owned()][..], 3));
        let rows: Vec<_> = table.rows.iter().map(|(line, row)| (*line, row.get(1).unwrap())).collect();
        assert_eq!(rows, [(4, "2"), (7, "4")]);
        assert_eq!(table.comments, [(1, "# one".to_owned()), (5, "# in the midst".to_owned())]);
    }

    #[test]
    fn a_cut_last_line_is_left_out_and_reported() {
        let table = parse("a,b\n1,2\n3", &Layout::default()).unwrap();
        assert_eq!((table.rows.len(), table.cut), (1, Some(3)));
        assert_eq!(parse("a,b\n1,2\n3,4", &Layout::default()).unwrap().cut, None);
    }

    #[test]
    fn a_table_without_a_head_numbers_its_columns() {
        let layout =
            Layout { separator: Separator::Whitespace, head: false, skip_lines: 1, ..Layout::default() };
        let table = parse("title\n  1   2\n 3\t4 \n", &layout).unwrap();
        assert_eq!(table.head, ["1", "2"]);
        assert_eq!(table.rows[1].1.get(1), Some("4"));
    }

    #[test]
    fn what_is_no_table_is_reported_with_its_line() {
        for (text, hint) in [
            ("", "has no rows"),
            ("a,b\n", "has no rows"),
            ("a,a\n1,2\n", "a.csv:1: column a stands twice"),
            ("a,b\n1,2\n1,2,3\n", "a.csv:3: 3 cells, but the head has 2"),
            (
                "a;b\n1,2;2\n",
                "a.csv:2: 2 cells, but the head has 1: is another separator, or a decimal comma,",
            ),
            ("a,b\n1\n1,2\n", "a.csv:2: 1 cells"),
        ] {
            let message = parse(text, &Layout::default()).err().expect(text).to_string();
            assert!(message.contains(hint), "{message}");
        }
    }
}
