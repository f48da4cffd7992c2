//! Reads `measurement.csv`: the columns of rig-model.md in any order, those of the load optional.
//!
//! ```text
//! # linked=true added_mass_kg=0          optional; without it: unlinked, no weights
//! time_s,drive_valve,drive_position_m,…  one row for each millisecond
//! ```

use super::table::{Layout, Table};
use super::{Channel, Form, ReadError, Record, RigSetup, Signal, UnlistedColumns};
use plant::{Axis, PERIOD_S};
use std::path::Path;

pub(super) fn read(file: &Path, unknown: UnlistedColumns) -> Result<Record, ReadError> {
    let table = Table::read(file, &Layout::default())?;
    let mut record = Record::new(file, Form::Measurement, RigSetup::default());
    record.nominal_period_s = Some(PERIOD_S);
    read_comments(&table, unknown, &mut record)?;
    let time = table.required("time_s")?;
    let places = channels(&table, unknown, &mut record)?;
    for (line, row) in &table.rows {
        let cell = |place: usize| row.get(place).unwrap_or_default();
        record.push_row(*line, table.number(*line, time, cell(time), false)?);
        for (channel, place) in &places {
            if !cell(*place).is_empty() {
                record.put(*channel, table.number(*line, *place, cell(*place), false)?);
            }
        }
    }
    record.warn_cut(table.cut);
    Ok(record)
}

/// The first comment holds the set-up of the rig; others are ignored, and a blind record has none.
fn read_comments(table: &Table, unknown: UnlistedColumns, record: &mut Record) -> Result<(), ReadError> {
    for (place, (line, text)) in table.comments.iter().enumerate() {
        let words = text.trim_start_matches('#').split_whitespace();
        if place == 0 && *line == 1 && text.contains('=') {
            for word in words {
                read_setup(table, *line, word, unknown, record)?;
            }
        } else if unknown == UnlistedColumns::Refused {
            let allowed = "one comment in the first line, # linked=true added_mass_kg=0";
            return Err(not_blind(table, *line, text, allowed));
        }
    }
    Ok(())
}

fn not_blind(table: &Table, line: u64, text: &str, allowed: &str) -> ReadError {
    let message = format!("'{text}' is refused in a blind record; allowed are {allowed}");
    ReadError::at(&table.file, line, message)
}

fn read_setup(
    table: &Table,
    line: u64,
    word: &str,
    unknown: UnlistedColumns,
    record: &mut Record,
) -> Result<(), ReadError> {
    let (key, value) = word.split_once('=').unwrap_or((word, ""));
    let refused = |allowed| table.refused(line, key, value, allowed);
    match key {
        "linked" => record.setup.linked = value.parse().map_err(|_| refused("true or false"))?,
        "added_mass_kg" => {
            let mass_kg = value.parse().ok().filter(|mass_kg: &f64| mass_kg.is_finite() && *mass_kg >= 0.0);
            record.setup.added_mass_kg = mass_kg.ok_or_else(|| refused("a number of kg, not below 0"))?;
        }
        _ if unknown == UnlistedColumns::Refused => {
            return Err(not_blind(table, line, word, "linked, added_mass_kg"));
        }
        _ => record
            .warn(line, format!("'{word}' in the first line is ignored; known are linked, added_mass_kg")),
    }
    Ok(())
}

/// The channels of the table with their places.
fn channels(
    table: &Table,
    unknown: UnlistedColumns,
    record: &mut Record,
) -> Result<Vec<(Channel, usize)>, ReadError> {
    let mut places = Vec::new();
    for (place, column) in table.head.iter().enumerate() {
        if let Some(channel) = Channel::of_mapping(column).filter(|channel| !channel.foreign_only()) {
            record.add(channel);
            places.push((channel, place));
        } else if column != "time_s" {
            if unknown == UnlistedColumns::Refused {
                return Err(not_blind(table, table.head_line, column, &allowed_columns()));
            }
            record.warn(table.head_line, format!("column {column} is ignored: no record has it"));
        }
    }
    if !Axis::ALL.into_iter().any(|axis| record.has_axis(axis)) {
        table.required("drive_position_m")?;
    }
    for axis in Axis::ALL.into_iter().filter(|axis| record.has_axis(*axis)).collect::<Vec<_>>() {
        for signal in Signal::ALL {
            let channel = Channel::Of(axis, signal);
            if !channel.foreign_only() && record.channel(channel).is_none() {
                record.warn(
                    table.head_line,
                    format!("column {channel} is missing: what it shows cannot be seen"),
                );
            }
        }
    }
    Ok(places)
}

fn allowed_columns() -> String {
    let known = Channel::ALL.into_iter().filter(|channel| !channel.foreign_only());
    let mut names = vec!["time_s".to_owned()];
    names.extend(known.map(Channel::column));
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: &str =
        "time_s,drive_pressure_a_Pa,drive_valve,drive_position_m,drive_force_N,drive_pressure_b_Pa\n";

    fn written(text: &str, unknown: UnlistedColumns) -> Result<Record, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("measurement.csv");
        std::fs::write(&path, text).unwrap();
        read(&path, unknown)
    }

    fn is_refused(text: &str, unknown: UnlistedColumns, hint: &str) {
        let message = written(text, unknown).expect_err(text).to_string();
        assert!(message.contains(hint), "{message}");
    }

    #[test]
    fn columns_come_in_any_order_and_the_load_may_be_missing() {
        let text = format!("# linked=true added_mass_kg=7.5\n{DRIVE}0.001,1e5,0.5,0.1,-3,2e5\n");
        let record = written(&text, UnlistedColumns::Refused).unwrap();
        assert_eq!(record.setup, RigSetup { linked: true, added_mass_kg: 7.5 });
        assert_eq!(record.time_s(), [0.001]);
        assert_eq!(record.value(Channel::Of(Axis::Drive, Signal::PressureA), 0), Some(1e5));
        assert_eq!(record.value(Channel::Of(Axis::Drive, Signal::Valve), 0), Some(0.5));
        assert!(!record.has_axis(Axis::Load));
        assert_eq!((record.line(0), &record.warnings[..]), (3, &[][..]));
    }

    #[test]
    fn an_empty_cell_is_no_value_and_a_missing_line_no_row() {
        let text = format!("{DRIVE}0,1e5,0,0.1,,2e5\n0.003,1e5,0,,1,2e5\n");
        let record = written(&text, UnlistedColumns::Ignored).unwrap();
        assert_eq!((record.setup, record.len()), (RigSetup::default(), 2));
        let force = record.channel(Channel::Of(Axis::Drive, Signal::Force)).unwrap();
        assert_eq!(force, [None, Some(1.0)]);
    }

    #[test]
    fn unknown_columns_are_ignored_with_a_warning_and_refused_when_blind() {
        let text = "time_s,drive_position_m,truth\n0,0.1,5\n";
        let record = written(text, UnlistedColumns::Ignored).unwrap();
        assert!(record.warnings[0].text.contains("column truth is ignored"), "{:?}", record.warnings);
        let blind = UnlistedColumns::Refused;
        is_refused(text, blind, "'truth' is refused in a blind record; allowed are time_s, drive_valve");
        is_refused("# seed=7\ntime_s,drive_valve\n0,0\n", blind, "'seed=7'");
        is_refused("time_s,drive_valve\n# hint\n0,0\n", blind, ":2: '# hint'");
    }

    #[test]
    fn what_cannot_be_read_is_reported_with_line_column_and_value() {
        for (text, hint) in [
            ("time_s,drive_valve\n0,x\n", "measurement.csv:2: drive_valve = 'x'; allowed is a finite number"),
            ("time_s,drive_valve\n0,NaN\n", "drive_valve = 'NaN'"),
            ("time_s,drive_valve\n,0\n", "time_s = ''"),
            ("drive_valve\n0\n", "column time_s is missing; the file has drive_valve"),
            ("time_s,a\n0,1\n", "column drive_position_m is missing"),
            ("# linked=maybe\ntime_s,drive_valve\n0,1\n", "linked = 'maybe'; allowed is true or false"),
            ("# added_mass_kg=-1\ntime_s,drive_valve\n0,1\n", "added_mass_kg = '-1'"),
        ] {
            is_refused(text, UnlistedColumns::Ignored, hint);
        }
    }
}
