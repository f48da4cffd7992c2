//! A record as a model reads it: inputs at every sample, outputs where they were measured, all in SI.

use model::{Hold, Model};
use records::{ColumnOptions, Columns, ReadError, read_columns};
use std::path::Path;

/// Fewest samples of a record.
const FEWEST_ROWS: usize = 8;
/// Share of an input's samples that may be missing; the message of [`RecordError::Input`] says it.
const MOST_MISSING: f64 = 0.2;

/// Why a record cannot be used.
#[derive(Debug, thiserror::Error)]
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
}

/// A record of a model.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    pub(crate) name: String,
    pub(crate) time_s: Vec<f64>,
    /// Of each input its samples.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// Of each output its samples.
    pub(crate) outputs: Vec<Vec<Option<f64>>>,
    /// What a person should know about it.
    pub(crate) notes: Vec<String>,
}

impl Measured {
    pub(crate) fn read(model: &Model, file: &Path) -> Result<Self, RecordError> {
        let layout = &model.record;
        let inputs = model.inputs.iter().map(|input| input.column.as_str());
        let wanted: Vec<&str> =
            inputs.chain(model.outputs.iter().map(|output| output.column.as_str())).collect();
        let options = ColumnOptions {
            time: &layout.time_column,
            time_unit_s: layout.time_unit_s,
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
        let Columns { file, time_s, lines, values, warnings } = columns;
        let file = file.display().to_string();
        if time_s.len() < FEWEST_ROWS {
            return Err(RecordError::Few { file, rows: time_s.len() });
        }
        if let Some(row) = (1..time_s.len()).find(|row| time_s[*row] <= time_s[row - 1]) {
            return Err(RecordError::Time { file, line: lines[row], time_s: time_s[row] });
        }
        let mut notes: Vec<String> = warnings.into_iter().map(|warning| warning.text).collect();
        let count = model.inputs.len();
        let mut inputs = Vec::with_capacity(count);
        for (input, values) in model.inputs.iter().zip(&values) {
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
            inputs.push(filled(&time_s, values, input.hold, input.unit.factor));
        }
        let mut outputs = Vec::with_capacity(model.outputs.len());
        for (output, values) in model.outputs.iter().zip(&values[count..]) {
            if values.iter().all(Option::is_none) {
                let (column, name) = (output.column.clone(), output.name.clone());
                return Err(RecordError::Output { file, column, name });
            }
            outputs.push(values.iter().map(|value| value.map(|value| value * output.unit.factor)).collect());
        }
        let name =
            Path::new(&file).file_name().map_or(file.clone(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, time_s, inputs, outputs, notes })
    }
}

/// Missing samples by the hold of their input: the last value, or straight between neighbours.
fn filled(time_s: &[f64], values: &[Option<f64>], hold: Hold, factor: f64) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_some()).collect();
    let value = |place: usize| values[known[place]].expect("it is known") * factor;
    (0..values.len())
        .map(|row| {
            let right = known.partition_point(|known| *known <= row);
            match (right, hold) {
                (0, _) => value(0),
                (right, Hold::Linear) if right < known.len() => {
                    let [from_s, to_s] = [time_s[known[right - 1]], time_s[known[right]]];
                    let share = (time_s[row] - from_s) / (to_s - from_s);
                    value(right - 1) + share * (value(right) - value(right - 1))
                }
                (right, _) => value(right - 1),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Measured, RecordError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let model = "[record]\ntime = \"t\"\n[inputs.u]\nunit = \"mm\"\nhold = \"linear\"\n\
                     [outputs.y]\nunit = \"mm\"\nvalue = \"u\"\n";
        Measured::read(&Model::parse(model, Path::new("m.toml")).unwrap(), file.path())
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
