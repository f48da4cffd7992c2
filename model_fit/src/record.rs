//! A record as a model reads it: inputs at every sample, outputs where they were measured, all in SI.

use super::filter::LowPass;
use super::look::{self, Column, StuckFrom};
use super::processing::{Grid, RecordInfo};
use super::unit_row::{self, UnitMismatch};
use model::{Input, Model};
use records::{ColumnOptions, Columns, ReadError, read_columns};
use std::path::{Path, PathBuf};

/// Fewest samples of a record.
pub(super) const FEWEST_ROWS: usize = 8;
/// Share of an input's samples that may be missing; the message of [`RecordError::Input`] says it.
const MOST_MISSING: f64 = 0.2;

/// Why a record cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum RecordError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("{file}:{line}: {time_s} s: time does not grow: sort the rows, or split the record there")]
    Time { file: String, line: u64, time_s: f64 },
    #[error("{file}: {rows} rows; {FEWEST_ROWS} are needed")]
    Few { file: String, rows: usize },
    #[error(
        "{file}: column {column} of input {name} has no value in {percent:.0} % of the rows; 20 % may lack one"
    )]
    Input { file: String, column: String, name: String, percent: f64 },
    #[error("{file}: column {column} of output {name} has no value at all")]
    Output { file: String, column: String, name: String },
    #[error(
        "{file}:{line}: column {column} is stuck from there, with other stretches for more than half of its samples: look at the sensor and its cable, and record again"
    )]
    Stuck { file: String, line: u64, column: String },
    #[error(
        "{file}:{line}: {time_s} s: its distance is not that of the first samples: name the period of an even grid, period_s under [record]"
    )]
    Uneven { file: String, line: u64, time_s: f64 },
    #[error("{file}:{line}: {time_s} s: {rows} rows cannot reach as far at a period of {period_s} s")]
    Far { file: String, line: u64, time_s: f64, rows: usize, period_s: f64 },
    #[error(transparent)]
    UnitMismatch(Box<UnitMismatch>),
    #[error("{file}: low_pass_hz of input {name} is {edge_hz}; allowed is below half of {sampling_hz} Hz")]
    Edge { file: String, name: String, edge_hz: f64, sampling_hz: f64 },
    #[error(
        "{file}: parameters.{name}.values of the model has no value of this record; it has {known}: name its file there"
    )]
    Unlisted { file: String, name: String, known: String },
    #[error("{file}: {rows} rows meet [rows] of the model; {FEWEST_ROWS} are needed: {why}")]
    FewMeet { file: String, rows: usize, why: String },
}

/// A record of a model.
#[derive(Clone, Debug)]
pub(crate) struct MeasuredRecord {
    pub(crate) name: String,
    /// Times of all samples, over which the model is simulated.
    pub(crate) sampled_s: Vec<f64>,
    /// Of each input its samples.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// Samples that are rows, on which the model is compared, and their times.
    pub(crate) rows: Vec<usize>,
    pub(crate) time_s: Vec<f64>,
    /// Of each output what was measured, at the rows.
    pub(crate) outputs: Vec<Vec<Option<f64>>>,
    /// What measured and modelled outputs go through.
    pub(crate) thinning: Option<LowPass>,
    /// Where it was read from, by which known values are found.
    pub(crate) file: PathBuf,
    /// Rows that judge, and what the folds of the model go over, at the rows.
    pub(crate) is_judged: Vec<bool>,
    pub(crate) folds: Vec<Vec<f64>>,
    /// What a person should know about it.
    pub(crate) notes: Vec<String>,
}

impl MeasuredRecord {
    pub(crate) fn read(model: &Model, file: &Path) -> Result<Self, RecordError> {
        let layout = &model.record;
        let columns = model.inputs.iter().filter(|input| input.rate_of.is_none());
        let inputs = columns.map(|input| input.column.as_str());
        let wanted: Vec<&str> =
            inputs.chain(model.outputs.iter().map(|output| output.column.as_str())).collect();
        let options = ColumnOptions {
            time: &layout.time_column,
            time_unit_s: layout.time_unit_s,
            is_calendar: layout.is_calendar,
            columns: &wanted,
            separator: &layout.separator,
            is_decimal_comma: layout.is_decimal_comma,
            comment: &layout.comment,
            skip_lines: layout.skip_lines,
            absent: &layout.absent,
        };
        Self::of(model, read_columns(file, &options)?)
    }

    fn of(model: &Model, columns: Columns) -> Result<Self, RecordError> {
        let Columns { file, time_s, lines, mut values, units, warnings } = columns;
        all_listed(model, &file)?;
        let file = file.display().to_string();
        if time_s.len() < FEWEST_ROWS {
            return Err(RecordError::Few { file, rows: time_s.len() });
        }
        if let Some(row) = (1..time_s.len()).find(|row| time_s[*row] <= time_s[row - 1]) {
            return Err(RecordError::Time { file, line: lines[row], time_s: time_s[row] });
        }
        let mut notes: Vec<String> = warnings.into_iter().map(|warning| warning.text).collect();
        if let Some(units) = units {
            notes.extend(unit_row::compared(model, &file, &units)?);
        }
        notes.extend(model.record.period_s.and_then(|period_s| look::period(period_s, &time_s)));
        let measured: Vec<&Input> = model.inputs.iter().filter(|input| input.rate_of.is_none()).collect();
        for (input, values) in measured.iter().zip(&values) {
            let missing = values.iter().filter(|value| value.is_none()).count();
            let share = missing as f64 / values.len() as f64;
            if share > MOST_MISSING {
                let (column, name) = (input.column.clone(), input.name.clone());
                return Err(RecordError::Input { file, column, name, percent: share * 100.0 });
            }
            if missing > 0 {
                notes.push(format!(
                    "{missing} samples of {} are missing and filled by its hold",
                    input.column
                ));
            }
        }
        for (output, values) in model.outputs.iter().zip(&values[measured.len()..]) {
            if values.iter().all(Option::is_none) {
                let (column, name) = (output.column.clone(), output.name.clone());
                return Err(RecordError::Output { file, column, name });
            }
        }
        notes.extend(twice(model));
        notes.extend(look::holes(&time_s, &lines, !model.states.is_empty()));
        let of_inputs = measured.iter().map(|input| Column { name: &input.column, output: None });
        let of_outputs =
            model.outputs.iter().map(|output| Column { name: &output.column, output: Some(output) });
        for (column, values) in of_inputs.chain(of_outputs).zip(&mut values) {
            match column.check_values(values, &lines) {
                Ok(seen) => notes.extend(seen),
                Err(StuckFrom(row)) => {
                    let (line, column) = (lines[row], column.name.to_owned());
                    return Err(RecordError::Stuck { file, line, column });
                }
            }
        }
        let grid = Grid::of(model, &file, &time_s, &lines)?;
        let holds = measured.iter().map(|input| (input.hold, input.unit.factor * input.scale));
        let samples: Vec<Vec<f64>> = holds
            .zip(&values)
            .map(|((hold, factor), values)| grid.filled(&time_s, values, hold, factor))
            .collect();
        let inputs = grid.inputs(model, &file, samples)?;
        let outputs = model
            .outputs
            .iter()
            .zip(&values[measured.len()..])
            .map(|(output, values)| grid.outputs(&time_s, values, output.unit.factor * output.scale));
        let outputs = outputs.collect();
        let name =
            Path::new(&file).file_name().map_or(file.clone(), |name| name.to_string_lossy().into_owned());
        grid.compared(model, RecordInfo { file, name, notes }, inputs, outputs)
    }
}

/// Columns that stand for several outputs.
fn twice(model: &Model) -> impl Iterator<Item = String> + '_ {
    model.outputs.iter().enumerate().filter_map(|(place, output)| {
        let first = model.outputs[..place].iter().find(|other| other.column == output.column)?;
        let (column, first, name) = (&output.column, &first.name, &output.name);
        Some(format!("column {column} is both {first} and {name}: its noise counts as two measurements"))
    })
}

/// Refuses a record that a number lacks whose known values differ by record.
fn all_listed(model: &Model, file: &Path) -> Result<(), RecordError> {
    let Some(one) = model.parameters.iter().find(|one| one.known_si(file).is_none()) else { return Ok(()) };
    let known: Vec<&str> = one.of_records_si.iter().map(|(record, _)| record.as_str()).collect();
    let (file, name) = (file.display().to_string(), one.name.clone());
    Err(RecordError::Unlisted { file, name, known: known.join(", ") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<MeasuredRecord, RecordError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let model = "[record]\ntime = \"t\"\n[inputs.u]\nunit = \"mm\"\nhold = \"linear\"\n\
                     [outputs.y]\nunit = \"mm\"\nvalue = \"u\"\n";
        MeasuredRecord::read(&Model::parse(model, Path::new("m.toml")).unwrap(), file.path())
    }

    #[test]
    fn holes_of_an_input_are_filled_and_those_of_an_output_stay() {
        let measured =
            read("t,u,y\n0,1,1\n1,,\n3,4,2\n4,5,\n5,6,3\n6,7,\n7,8,\n8,,4\n9,10,4\n10,11,\n11,12,\n")
                .unwrap();
        let expected = [1.0, 2.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0];
        assert_eq!(measured.inputs[0].len(), expected.len());
        for (value, expected) in measured.inputs[0].iter().zip(expected) {
            assert!((value - expected * 1e-3).abs() < 1e-15, "{value} m for {expected} mm");
        }
        assert_eq!(measured.outputs[0][..3], [Some(1e-3), None, Some(2e-3)]);
        assert!(measured.notes[0].contains("2 samples of u are missing"), "{:?}", measured.notes);
    }

    #[test]
    fn a_period_that_is_not_that_of_the_rows_is_noted() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let rows: String = (0..200).map(|row| format!("{},{},1\n", f64::from(row) * 0.01, row % 7)).collect();
        std::fs::write(file.path(), format!("t,u,y\n{rows}")).unwrap();
        let notes = |period: &str| {
            let model = format!(
                "[record]\ntime = \"t\"\nperiod_s = {period}\n[inputs.u]\n[outputs.y]\nvalue = \"u\"\n"
            );
            let read = MeasuredRecord::read(&Model::parse(&model, Path::new("m.toml")).unwrap(), file.path());
            read.unwrap().notes.into_iter().filter(|note| note.contains("period_s")).collect::<Vec<_>>()
        };
        assert_eq!(
            notes("0.1"),
            [
                "period_s under [record] is 0.1 s, 10.00 times the usual distance of the rows, 0.0100 s: rows between are passed \
                 over; is the time in another unit?"
            ]
        );
        assert!(notes("0.001")[0].contains("samples between the rows are straight lines"));
        assert_eq!((notes("0.01").len(), notes("0.02").len()), (0, 0));
    }

    #[test]
    fn a_column_of_two_outputs_is_noted() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "t_s,y\n0,1\n1,2\n2,4\n3,3\n4,5\n5,1\n6,2\n7,8\n").unwrap();
        let notes = |second: &str| {
            let text = format!(
                "[outputs.y]\nvalue = \"1\"\n[outputs.again]\ncolumn = \"{second}\"\nvalue = \"t/1[s]\"\n"
            );
            MeasuredRecord::read(&Model::parse(&text, Path::new("m.toml")).unwrap(), file.path())
                .unwrap()
                .notes
        };
        assert!(notes("t_s").iter().all(|note| !note.contains("two measurements")));
        let expected = "column y is both y and again: its noise counts as two measurements";
        assert!(notes("y").iter().any(|note| note == expected), "{:?}", notes("y"));
    }

    #[test]
    fn a_record_that_cannot_be_used_says_why() {
        let rows =
            |change: &str| format!("t,u,y\n0,1,1\n1,1,1\n2,1,1\n3,1,1\n4,1,1\n5,1,1\n6,1,1\n{change}\n");
        assert!(read(&rows("7,1,1")).is_ok());
        for (last, hint) in [("6,1,1", ":9: 6 s: time does not grow"), ("# none", "7 rows; 8 are needed")] {
            let message = read(&rows(last)).unwrap_err().to_string();
            assert!(message.contains(hint), "{message}");
        }
        let message = read(&rows("7,1,1").replace(",1,1", ",,1")).unwrap_err().to_string();
        assert!(message.contains("no value in 100 % of the rows"), "{message}");
        let message = read(&rows("7,1,1").replace(",1,1", ",1,")).unwrap_err().to_string();
        assert!(message.contains("no value at all"), "{message}");
    }
}
