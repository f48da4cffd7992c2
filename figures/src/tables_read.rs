//! The tables of a run's folder as columns: numbers over time, and states over time.

use crate::SummaryError;
use crate::series::{Series, Span};
use runlog::run_folder::FileError;
use std::collections::BTreeMap;
use std::path::Path;

/// A state of a chain, and for how long it lasted.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpan {
    /// The state's name, as `rig.dbc` has it.
    pub state: String,
    /// From its first row to that of the next state.
    pub span: Span,
}

/// Columns that were asked for, as far as the table has them.
#[derive(Clone, Debug, Default)]
pub struct Table {
    numbers: BTreeMap<&'static str, Series>,
    states: BTreeMap<&'static str, Vec<StateSpan>>,
}

impl Table {
    /// The numbers of a column; no samples when the table lacks it.
    pub fn numbers(&self, name: &str) -> &Series {
        self.numbers.get(name).unwrap_or(Series::NONE)
    }

    /// The states of a column; none when the table lacks it.
    pub fn states(&self, name: &str) -> &[StateSpan] {
        self.states.get(name).map_or(&[], Vec::as_slice)
    }

    /// The stretches of a column in which the state is one of `wanted`; neighbours become one.
    pub fn in_state(&self, name: &str, wanted: &[&str]) -> Vec<Span> {
        let mut spans: Vec<Span> = Vec::new();
        for entry in self.states(name).iter().filter(|entry| wanted.contains(&entry.state.as_str())) {
            match spans.last_mut() {
                Some(last) if entry.span.from_s <= last.to_s => last.to_s = entry.span.to_s,
                _ => spans.push(entry.span),
            }
        }
        spans
    }

    /// The part of the table inside `span`.
    #[must_use]
    pub fn within(&self, span: &Span) -> Self {
        let numbers = self.numbers.iter().map(|(name, column)| (*name, column.within(span)));
        // The last state of a table may have a single row, and so no length.
        let inside = |entry: &StateSpan| {
            let lone = || span.holds(entry.span.from_s).then_some(entry.span);
            let common = entry.span.common(span).or_else(lone)?;
            Some(StateSpan { state: entry.state.clone(), span: common })
        };
        let states =
            self.states.iter().map(|(name, column)| (*name, column.iter().filter_map(inside).collect()));
        Self { numbers: numbers.collect(), states: states.collect() }
    }

    /// Puts in a column of numbers, in place of one of the same name.
    pub fn set_numbers(&mut self, name: &'static str, column: Series) {
        self.numbers.insert(name, column);
    }

    /// Puts in a column of states, in place of one of the same name.
    pub fn set_states(&mut self, name: &'static str, column: Vec<StateSpan>) {
        self.states.insert(name, column);
    }
}

/// Reads the named columns of a table that has `time_s`; an empty cell is no sample, and a column that the table lacks has none.
///
/// Comment lines start with `#`.
///
/// # Errors
/// [`SummaryError::File`] with file and line: no `time_s`, a number that is none or not finite.
pub fn read(path: &Path, numbers: &[&'static str], states: &[&'static str]) -> Result<Table, SummaryError> {
    let refused = |reason: String| SummaryError::from(FileError::read(path, reason));
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| refused(error.to_string()))?;
    let head = reader.headers().map_err(|error| refused(error.to_string()))?.clone();
    let place = |name: &str| head.iter().position(|column| column == name);
    let time = place("time_s").ok_or_else(|| refused("column time_s is missing".into()))?;
    let placed = |names: &[&'static str]| -> Vec<_> {
        names.iter().filter_map(|name| Some((*name, place(name)?))).collect()
    };
    let (number_places, state_places) = (placed(numbers), placed(states));
    let mut number_columns = vec![Series::default(); number_places.len()];
    let mut state_columns: Vec<Vec<StateSpan>> = vec![Vec::new(); state_places.len()];
    let mut row = csv::StringRecord::new();
    while reader.read_record(&mut row).map_err(|error| refused(error.to_string()))? {
        let line = row.position().map_or(0, csv::Position::line);
        let number = |place: usize| {
            let cell = row.get(place).unwrap_or_default();
            cell.parse::<f64>()
                .ok()
                .filter(|number| number.is_finite())
                .ok_or_else(|| refused(format!("line {line}: '{cell}' is no finite number")))
        };
        let time_s = number(time)?;
        for (column, (_, place)) in number_columns.iter_mut().zip(&number_places) {
            if !row.get(*place).unwrap_or_default().is_empty() {
                column.push(time_s, number(*place)?);
            }
        }
        for (column, (_, place)) in state_columns.iter_mut().zip(&state_places) {
            enter(column, row.get(*place).unwrap_or_default(), time_s);
        }
    }
    let numbers = number_places.iter().map(|(name, _)| *name).zip(number_columns).collect();
    let states = state_places.iter().map(|(name, _)| *name).zip(state_columns).collect();
    Ok(Table { numbers, states })
}

/// Puts the state of a row into a column: a state lasts until the row of the next one, the last one until its last row; an empty
/// state is none.
pub fn enter(column: &mut Vec<StateSpan>, state: &str, time_s: f64) {
    if let Some(last) = column.last_mut() {
        last.span.to_s = time_s;
        if last.state == state {
            return;
        }
    }
    if !state.is_empty() {
        column.push(StateSpan { state: state.into(), span: Span { from_s: time_s, to_s: time_s } });
    }
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
        let read = read(&path, &["a", "b", "c"], &[]).unwrap();
        assert_eq!(read.numbers("a"), &Series::from_iter([(0.0, 5.0), (0.001, 6.0)]));
        assert_eq!(read.numbers("b"), &Series::from_iter([(0.0, 1.0)]));
        assert!(read.numbers("c").is_empty());
    }

    #[test]
    fn a_state_lasts_until_the_next() {
        let (_folder, path) =
            table("time_s,s\n0.0,settling\n0.1,settling\n0.2,experiment\n0.3,done\n0.4,done\n");
        let read = read(&path, &[], &["s"]).unwrap();
        let reported: Vec<_> = read
            .states("s")
            .iter()
            .map(|entry| (entry.state.as_str(), entry.span.from_s, entry.span.to_s))
            .collect();
        assert_eq!(reported, [("settling", 0.0, 0.2), ("experiment", 0.2, 0.3), ("done", 0.3, 0.4)]);
        assert_eq!(read.in_state("s", &["settling", "experiment"]), [Span { from_s: 0.0, to_s: 0.3 }]);
    }

    #[test]
    fn a_malformed_table_is_refused_with_its_line() {
        for (text, hint) in [
            ("time_s,a\n0.0,x\n", "line 2: 'x'"),
            ("time_s,a\n0.0,NaN\n", "line 2: 'NaN'"),
            ("a,b\n0.0,1\n", "column time_s is missing"),
            ("time_s,a\n0.0\n", "t.csv"),
        ] {
            let (_folder, path) = table(text);
            let message = read(&path, &["a"], &[]).unwrap_err().to_string();
            assert!(message.contains(hint), "{text}: {message}");
        }
    }
}
