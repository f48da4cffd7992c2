//! Files of a record, in two folders: `measurement.csv` for the program under study, `truth.csv` and `truth.json` for the
//! judge.
//!
//! The measurement holds time and the columns of the recorded axes only [rig-model.md, Measurement file]. Numbers have the
//! fewest digits that read back to the same bits.

use super::{Experiment, MakeError, Recipe, Record, Row, hidden, simulate};
use plant::{Axis, RigParameters};
use runlog::cycle_tables::AXIS_COLUMNS;
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::Path;

/// Name of a column, and its value in a row for an axis.
type Column = (&'static str, fn(&Row, usize) -> f64);

const TRUE: [Column; 21] = [
    ("extension_m", |row, i| row.axes[i].extension_m),
    ("rod_velocity_m_per_s", |row, i| row.axes[i].rod_velocity_m_per_s),
    ("rod_acceleration_m_per_s2", |row, i| row.axes[i].rod_acceleration_m_per_s2),
    ("spool", |row, i| row.axes[i].spool),
    ("pressure_a_Pa", |row, i| row.axes[i].pressure_pa[0]),
    ("pressure_b_Pa", |row, i| row.axes[i].pressure_pa[1]),
    ("stored_air_a_J", |row, i| row.axes[i].stored_air_j[0]),
    ("stored_air_b_J", |row, i| row.axes[i].stored_air_j[1]),
    ("temperature_a_K", |row, i| row.axes[i].temperature_k[0]),
    ("temperature_b_K", |row, i| row.axes[i].temperature_k[1]),
    ("flow_a_m3_per_s", |row, i| row.axes[i].flow_m3_per_s[0]),
    ("flow_b_m3_per_s", |row, i| row.axes[i].flow_m3_per_s[1]),
    ("edge_flow_a_m3_per_s", |row, i| row.axes[i].edge_flow_m3_per_s[0]),
    ("edge_flow_b_m3_per_s", |row, i| row.axes[i].edge_flow_m3_per_s[1]),
    ("exhaust_pressure_Pa", |row, i| row.axes[i].exhaust_pressure_pa),
    ("pneumatic_force_N", |row, i| row.axes[i].pneumatic_force_n),
    ("friction_N", |row, i| row.axes[i].friction_n),
    ("position_without_noise_m", |row, i| row.without_noise[i][0]),
    ("force_without_noise_N", |row, i| row.without_noise[i][1]),
    ("pressure_a_without_noise_Pa", |row, i| row.without_noise[i][2]),
    ("pressure_b_without_noise_Pa", |row, i| row.without_noise[i][3]),
];

/// Simulates a record and writes it: `measurement.csv` into one folder, `truth.csv` and `truth.json` into another.
///
/// # Errors
/// As [`simulate`], and [`MakeError::File`] when a file cannot be written.
pub fn make(recipe: &Recipe, rig: &RigParameters, measurement: &Path, truth: &Path) -> Result<(), MakeError> {
    write(&simulate(recipe, rig)?, measurement, truth)
}

/// Writes the files of a record into both folders, which are created if missing.
///
/// # Errors
/// [`MakeError::File`] when a file cannot be written.
pub fn write(record: &Record, measurement: &Path, truth: &Path) -> Result<(), MakeError> {
    save(measurement, "measurement.csv", &measurement_csv(record))?;
    save(truth, "truth.csv", &truth_csv(record))?;
    let mut text = format!("{:#}", truth_json(&record.recipe)?);
    text.push('\n');
    save(truth, "truth.json", text.as_bytes())
}

/// Writes only what the sensors read, as file `name` of a folder, which is created if missing.
///
/// # Errors
/// [`MakeError::File`] when the file cannot be written.
pub fn write_measurement(record: &Record, folder: &Path, name: &str) -> Result<(), MakeError> {
    save(folder, name, &measurement_csv(record))
}

fn save(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), MakeError> {
    let path = folder.join(name);
    let failed = |error| MakeError::File { path: path.display().to_string(), error };
    std::fs::create_dir_all(folder).map_err(failed)?;
    std::fs::write(&path, bytes).map_err(failed)
}

fn recorded(record: &Record) -> impl Iterator<Item = Axis> + use<> {
    let (both, one) = (record.recipe.both_axes, record.recipe.axis);
    Axis::ALL.into_iter().filter(move |axis| both || *axis == one)
}

pub(super) fn measurement_csv(record: &Record) -> Vec<u8> {
    let mut out = Vec::with_capacity(record.rows.len() * 64);
    put(&mut out, format_args!("# linked={} added_mass_kg={}\ntime_s", record.linked, record.added_mass_kg));
    for axis in recorded(record) {
        AXIS_COLUMNS.iter().for_each(|column| put(&mut out, format_args!(",{}_{column}", axis.name())));
    }
    for (cycle, row) in record.rows.iter().enumerate() {
        put(&mut out, format_args!("\n{}.{:03}", cycle / 1000, cycle % 1000));
        for axis in recorded(record) {
            let readings = &row.readings[axis.index()];
            let [position, force] = [readings.position.value, readings.force.value];
            let [a, b] = [readings.pressure_a.value, readings.pressure_b.value];
            put(&mut out, format_args!(",{},{position},{force},{a},{b}", row.valve[axis.index()]));
        }
    }
    out.push(b'\n');
    out
}

fn truth_csv(record: &Record) -> Vec<u8> {
    let mut out = Vec::with_capacity(record.rows.len() * 400);
    put(&mut out, format_args!("time_s"));
    for axis in recorded(record) {
        TRUE.iter().for_each(|(column, _)| put(&mut out, format_args!(",{}_{column}", axis.name())));
    }
    put(&mut out, format_args!(",supply_pressure_Pa,linkage_contact_force_N"));
    for (cycle, row) in record.rows.iter().enumerate() {
        put(&mut out, format_args!("\n{}.{:03}", cycle / 1000, cycle % 1000));
        for axis in recorded(record) {
            // Debug formatting for tiny numbers, which has an exponent: Display would write their zeros.
            TRUE.iter().for_each(|(_, of)| put(&mut out, format_args!(",{:?}", of(row, axis.index()))));
        }
        put(&mut out, format_args!(",{:?},{:?}", row.supply_pressure_pa, row.contact_force_n));
    }
    out.push(b'\n');
    out
}

/// The complete recipe: effects with place and numbers as reports name them.
fn truth_json(recipe: &Recipe) -> Result<Value, MakeError> {
    let effect = |hidden: &super::Hidden| {
        let keys = hidden::sheet(hidden)?.keys.iter().zip(&hidden.numbers);
        let parameters: Vec<_> = keys
            .map(|(key, value)| json!({ "name": key.name, "value": value, "unit": key.unit.name() }))
            .collect();
        let place = json!({
            "axis": hidden.place.part.name(),
            "element": hidden.place.element.map(|element| element.name()),
        });
        Ok(json!({ "effect": hidden.name, "where": place, "parameters": parameters }))
    };
    let background = recipe.background.as_ref().map(|background| {
        let effects = background.effects.iter().map(effect).collect::<Result<Vec<_>, MakeError>>()?;
        Ok::<Value, MakeError>(background.as_json(effects))
    });
    let background = background.transpose()?;
    let experiment = match recipe.experiment {
        Experiment::Train => json!("train"),
        Experiment::HeldOut(number) => json!({ "held-out": number }),
    };
    let wrong: Vec<_> = recipe
        .wrong_parameters
        .iter()
        .map(|(name, factor)| json!({ "name": name, "factor": factor }))
        .collect();
    let mut truth = json!({
        "schema_version": 1,
        "seed": recipe.seed,
        "axis": recipe.axis.name(),
        "both_axes": recipe.both_axes,
        "unlinked": recipe.unlinked,
        "hidden": recipe.hidden.iter().map(effect).collect::<Result<Vec<_>, MakeError>>()?,
        "foreign_form": recipe.form.is_foreign(),
        "wrong_parameters": wrong,
        "coloured_noise": recipe.coloured_noise,
        "jitter": recipe.jitter,
        "noise": recipe.noise,
        "background": background,
        "experiment": experiment,
    });
    // Written only when set, so that the truth of older records keeps its bytes.
    if recipe.form.is_far() {
        truth["far_form"] = json!(true);
    }
    Ok(truth)
}

fn put(out: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    out.write_fmt(text).expect("memory takes every byte");
}
