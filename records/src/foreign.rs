//! Reads a foreign CSV by a mapping file.

use super::mapping::TimeSource;
use super::table::Table;
use super::{Channel, Form, Mapping, ReadError, Record};
use std::path::Path;

pub(super) fn read(file: &Path, mapping: &Mapping) -> Result<Record, ReadError> {
    let table = Table::read(file, &mapping.layout)?;
    let mut record = Record::new(file, Form::Foreign, mapping.setup);
    record.nominal_period_s = mapping.nominal_period_s;
    let time = match &mapping.time {
        TimeSource::Column { column, factor } => Some((table.required(column)?, *factor)),
        TimeSource::Counted { .. } => None,
    };
    let mut places = Vec::new();
    for mapped in &mapping.channels {
        match table.place(&mapped.column) {
            Some(place) => {
                record.add(mapped.channel);
                places.push((mapped, place));
            }
            None if mapped.optional => {
                let text = format!("column {} is missing: no {}", mapped.column, mapped.channel);
                record.warn(table.head_line, text);
            }
            None => _ = table.required(&mapped.column)?,
        }
    }
    for (place, column) in table.head.iter().enumerate() {
        let used =
            places.iter().any(|(_, used)| *used == place) || time.is_some_and(|(used, _)| used == place);
        if !used && !mapping.ignore.contains(column) {
            let advice =
                format!("column {column} is not in the mapping: ignored; list it under ignore to say so");
            record.warn(table.head_line, advice);
        }
    }
    for (number, (line, row)) in table.rows.iter().enumerate() {
        let cell = |place: usize| row.get(place).unwrap_or_default();
        let value = |place: usize| table.number(*line, place, cell(place), mapping.decimal_comma);
        let time_s = match (time, &mapping.time) {
            (Some((place, factor)), _) => value(place)? * factor,
            (None, TimeSource::Counted { period_s }) => number as f64 * period_s,
            (None, TimeSource::Column { .. }) => unreachable!("its place was found above"),
        };
        let mut present = Vec::new();
        for (mapped, place) in &places {
            if !mapping.absent.iter().any(|text| text == cell(*place)) {
                present.push((mapped.channel, value(*place)? * mapped.slope + mapped.intercept));
            }
        }
        if !goes_on(&record, time_s, &present) {
            record.push_row(*line, time_s);
        }
        present.into_iter().for_each(|(channel, value)| record.put(channel, value));
    }
    record.warn_cut(table.cut);
    Ok(record)
}

/// Whether a row only adds channels that the row before lacks, within half the nominal period: recorders that stamp each channel
/// write such rows.
fn goes_on(record: &Record, time_s: f64, present: &[(Channel, f64)]) -> bool {
    let (Some(period_s), Some(before_s)) = (record.nominal_period_s, record.time_s().last()) else {
        return false;
    };
    let row = record.len() - 1;
    (0.0..0.5 * period_s).contains(&(time_s - before_s))
        && present.iter().all(|(channel, _)| record.value(*channel, row).is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Signal;
    use plant::Axis;

    const X: Channel = Channel::Of(Axis::Drive, Signal::Position);
    const P: Channel = Channel::Of(Axis::Drive, Signal::PressureA);

    fn mapped(csv: &str, toml: &str) -> Result<Record, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("foreign.csv");
        std::fs::write(&path, csv).unwrap();
        read(&path, &Mapping::from_toml(toml, Path::new("m.toml")).unwrap())
    }

    #[test]
    fn a_german_table_reads_as_any_other() {
        let csv = "% Prüfstand 3\nZeit;Weg;Druck\n0,0;12,5;1,0\n\n10,2;-;1,5\n% Pause\n313,0;13,5;\n";
        let toml = r#"
            separator = ";"
            decimal = ","
            comment = "%"
            absent = ["-"]
            [time]
            column = "Zeit"
            unit = "ms"
            [channels.drive_position_m]
            column = "Weg"
            unit = "mm"
            [channels.drive_pressure_a_Pa]
            column = "Druck"
            unit = "bar"
            pressure = "gauge"
        "#;
        let record = mapped(csv, toml).unwrap();
        assert_eq!(record.time_s(), [0.0, 0.010_199_999_999_999_999, 0.313]);
        assert_eq!(record.channel(X).unwrap(), [Some(0.0125), None, Some(0.0135)]);
        assert_eq!(record.channel(P).unwrap(), [Some(201_325.0), Some(251_325.0), None]);
        assert_eq!((record.line(0), record.line(1), record.line(2)), (3, 5, 7));
        assert_eq!(record.warnings, []);
    }

    #[test]
    fn rows_without_time_are_counted_and_columns_without_names_too() {
        let toml = r#"
            separator = "whitespace"
            head = false
            [time]
            period_s = 0.002
            [channels.drive_position_m]
            column = "2"
            unit = "m"
        "#;
        let record = mapped("  9  0.1\n  8  0.2\n", toml).unwrap();
        assert_eq!((record.time_s(), record.nominal_period_s), (&[0.0, 0.002][..], Some(0.002)));
        assert_eq!(record.channel(X).unwrap(), [Some(0.1), Some(0.2)]);
        assert!(record.warnings[0].text.contains("column 1 is not in the mapping"));
    }

    #[test]
    fn channels_that_were_stamped_one_by_one_are_rows_of_the_period_that_was_meant() {
        let toml = |meant: &str| {
            format!(
                "[time]\ncolumn = \"t\"\n{meant}\n[channels.drive_position_m]\ncolumn = \"x\"\nunit = \"m\"\n\
                 [channels.drive_pressure_a_Pa]\ncolumn = \"p\"\nunit = \"Pa\"\npressure = \"absolute\"\n"
            )
        };
        let csv = "t,x,p\n0,1,\n0.0001,,5\n0.001,2,\n0.0011,,6\n0.0012,3,\n";
        let record = mapped(csv, &toml("nominal_period_s = 0.001")).unwrap();
        assert_eq!(record.time_s(), [0.0, 0.001, 0.0012], "a second reading is a row of its own");
        assert_eq!(record.channel(P).unwrap(), [Some(5.0), Some(6.0), None]);
        assert_eq!(mapped(csv, &toml("")).unwrap().len(), 5);
    }

    #[test]
    fn a_column_may_be_missing_only_where_the_mapping_says_so() {
        let toml = |optional| {
            format!(
                "[time]\ncolumn = \"t\"\n[channels.drive_position_m]\ncolumn = \"x\"\nunit = \"m\"\noptional = {optional}\n"
            )
        };
        let record = mapped("t,y\n0,1\n", &toml(true)).unwrap();
        assert_eq!((record.channel(X), record.warnings.len()), (None, 2));
        let message = mapped("t,y\n0,1\n", &toml(false)).unwrap_err().to_string();
        assert!(message.contains("foreign.csv:1: column x is missing; the file has t, y"), "{message}");
        let message = mapped("t,x\n0,1\n0.1,1e\n", &toml(false)).unwrap_err().to_string();
        assert!(message.contains("foreign.csv:3: x = '1e'; allowed is a finite number"), "{message}");
    }
}
