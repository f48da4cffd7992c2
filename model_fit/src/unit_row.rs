//! A row of units under the head of a record, held against the units of the model file.

use super::record::RecordError;
use model::{Dimension, Model, Unit, with_powers};
use records::UnitRow;

/// Relative difference of two units that counts as none: roundings of their factors.
const FACTOR_TOLERANCE: f64 = 1e-9;

/// A unit of the row that is not that of the model file.
#[derive(Debug, thiserror::Error)]
#[error(
    "{file}:{line}: the row of units has {written} for column {column}, and the model file reads {read}: write \
     unit = \"{written}\" under [{table}], or mend the row"
)]
pub struct UnitMismatch {
    file: String,
    line: u64,
    column: String,
    written: String,
    /// Unit and scale of the file, in words.
    read: String,
    table: String,
}

/// A column as the model file reads it.
struct ModelColumn<'a> {
    column: &'a str,
    /// Table of the file that says so.
    table: String,
    dimension: Dimension,
    factor: f64,
    /// Unit and scale, in words.
    words: String,
}

/// Refuses a row that says otherwise than the model file, and notes what it could not compare.
pub(super) fn compared(model: &Model, file: &str, row: &UnitRow) -> Result<Option<String>, RecordError> {
    let of = |column, table, (unit, scale): (&Unit, f64)| {
        let scaled = if scale == 1.0 { String::new() } else { format!("{scale} ") };
        let words = format!("{scaled}{}", unit.text);
        ModelColumn { column, table, dimension: unit.dimension, factor: unit.factor * scale, words }
    };
    let inputs = model.inputs.iter().filter(|input| input.rate_of.is_none());
    let inputs = inputs.map(|one| of(&one.column, format!("inputs.{}", one.name), (&one.unit, one.scale)));
    let outputs = model.outputs.iter();
    let outputs = outputs.map(|one| of(&one.column, format!("outputs.{}", one.name), (&one.unit, one.scale)));
    let layout = &model.record;
    let second = Unit { text: "s".into(), dimension: Dimension::TIME, factor: 1.0 };
    let time = of(&layout.time_column, "record".into(), (&second, layout.time_unit_s));
    let time = (!layout.is_calendar).then_some((time, &row.time));
    let mut unread = Vec::new();
    for (read, cell) in time.into_iter().chain(inputs.chain(outputs).zip(&row.columns)) {
        if cell.chars().all(|character| "-–—".contains(character)) {
            continue;
        }
        let Ok(unit) = Unit::parse(cell).or_else(|_| Unit::parse(&with_powers(cell))) else {
            unread.push(format!("'{cell}' of {}", read.column));
            continue;
        };
        if unit.dimension != read.dimension || (unit.factor / read.factor - 1.0).abs() > FACTOR_TOLERANCE {
            let (file, line, column) = (file.to_owned(), row.line, read.column.to_owned());
            let (written, read, table) = (unit.text, read.words, read.table);
            let other = UnitMismatch { file, line, column, written, read, table };
            return Err(RecordError::UnitMismatch(Box::new(other)));
        }
    }
    Ok((!unread.is_empty()).then(|| {
        let (line, unread) = (row.line, unread.join(", "));
        format!(
            "line {line} is taken as a row of units and left out; no unit that could be compared: {unread}"
        )
    }))
}

#[cfg(test)]
mod tests {
    use crate::record::MeasuredRecord;
    use model::Model;
    use std::path::Path;

    fn notes(units: &str) -> Result<Vec<String>, String> {
        let model = "[record]\ntime = \"t\"\nunit = \"ms\"\n[inputs.u]\nunit = \"m\"\nscale = 1e-3\n\
                     [outputs.y]\nunit = \"N/mm^2\"\nvalue = \"u*1[MPa/m]\"\n";
        let file = tempfile::NamedTempFile::new().unwrap();
        let rows: String = (0..9).map(|row| format!("{row},{},{}\n", row * row, row % 4)).collect();
        std::fs::write(file.path(), format!("t,u,y\n{units}\n{rows}")).unwrap();
        let model = Model::parse(model, Path::new("m.toml")).unwrap();
        MeasuredRecord::read(&model, file.path()).map(|read| read.notes).map_err(|error| error.to_string())
    }

    #[test]
    fn a_row_that_agrees_is_passed_over_and_another_is_refused_with_what_to_write() {
        for units in ["ms,mm,N/mm^2", "[ms],[mm],[N/mm2]", "ms,-,MPa", ",mm,"] {
            assert_eq!(notes(units).unwrap(), [""; 0], "{units}");
        }
        for (units, message) in [
            (
                "s,mm,MPa",
                ":2: the row of units has s for column t, and the model file reads 0.001 s: write unit = \"s\" under [record]",
            ),
            ("ms,m,MPa", "column u, and the model file reads 0.001 m: write unit = \"m\" under [inputs.u]"),
            ("ms,mm,kPa", "has kPa for column y, and the model file reads N/mm^2"),
            ("ms,mm,mm", "has mm for column y"),
        ] {
            let error = notes(units).unwrap_err();
            assert!(error.contains(message), "{units}: {error}");
        }
        let unread = notes("ms,counts,MPa").unwrap();
        assert!(
            unread[0].contains("line 2 is taken as a row of units") && unread[0].contains("'counts' of u")
        );
    }
}
