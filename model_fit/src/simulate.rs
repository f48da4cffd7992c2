//! A model file simulated over a record with the values of the file: no fit, no suspect.
//!
//! The table has the columns of the record that the model reads, in their units, and what the model says beside each output.

use super::fit::Fitting;
use super::record::MeasuredRecord;
use super::stats::mean_and_variance;
use super::{ModelError, look, read};
use model::{Model, Program, Start};
use std::fmt::Write as _;
use std::path::Path;

/// Predictions of a model for a record.
#[derive(Clone, Debug)]
pub struct SimulatedRecord {
    /// A row for each compared sample, separated by commas.
    pub table: String,
    /// One for each output, in the order of the model file.
    pub outputs: Vec<SimulatedOutput>,
    /// What the record looks like, and of what a fit would find another value.
    pub notes: Vec<String>,
}

/// An output of a simulation, in its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedOutput {
    /// Its name in the model file.
    pub output: String,
    /// Unit of both root mean squares, as the model file has it.
    pub unit: String,
    /// Root mean square of measured less modelled.
    pub rms: f64,
    /// The same of measured less its mean.
    pub signal_rms: f64,
}

/// Simulates a model file over a record.
///
/// # Errors
/// [`ModelError`] for a model or a record that cannot be used, and for values at which the model cannot be simulated.
pub fn simulate(file: &Path, record: &Path) -> Result<SimulatedRecord, ModelError> {
    let model = read(file)?;
    let mut records = [MeasuredRecord::read(&model, record)?];
    look::beside_model(&model, &mut records);
    let program = Program::new(&model, &[])?;
    let fitting = Fitting::new(&model, program, &records, &[]);
    let predicted = fitting.residuals(&fitting.start())?.pop().expect("one record");
    let record = &records[0];
    let outputs = model.outputs.iter().zip(&predicted).zip(&record.outputs);
    let outputs = outputs.map(|((output, [residual, _]), measured)| {
        let residual: Vec<f64> = residual.iter().copied().filter(|value| !value.is_nan()).collect();
        let squares: f64 = residual.iter().map(|value| value * value).sum();
        let measured: Vec<f64> = measured.iter().flatten().copied().collect();
        SimulatedOutput {
            output: output.name.clone(),
            unit: output.unit.text.clone(),
            rms: (squares / residual.len() as f64).sqrt() / output.unit.factor,
            signal_rms: mean_and_variance(&measured).1.sqrt() / output.unit.factor,
        }
    });
    let outputs = outputs.collect();
    let predicted: Vec<&Vec<f64>> = predicted.iter().map(|[_, predicted]| predicted).collect();
    let mut notes = record.notes.clone();
    notes.extend(open(&model));
    Ok(SimulatedRecord { table: table(&model, record, &predicted), outputs, notes })
}

/// What a fit would find: said, since the simulation takes the first value.
fn open(model: &Model) -> Option<String> {
    let is_fitted = |start: &Start| matches!(start, Start::Fitted { .. });
    let states = model.states.iter().filter(|state| state.suspect.is_none() && is_fitted(&state.start));
    let names: Vec<&str> = states.map(|state| state.name.as_str()).collect();
    (!names.is_empty())
        .then(|| format!("the start of {} is fitted by a close; here its guess is taken", names.join(", ")))
}

/// The columns: the time, inputs, and each output as it was measured and as the model says.
fn table(model: &Model, record: &MeasuredRecord, predicted: &[&Vec<f64>]) -> String {
    let layout = &model.record;
    let time = if layout.is_calendar { "t_s" } else { layout.time_column.as_str() };
    let mut head: Vec<String> = vec![time.to_owned()];
    let mut columns: Vec<Vec<Option<f64>>> =
        vec![record.time_s.iter().map(|time_s| Some(time_s / layout.time_unit_s)).collect()];
    let mut add = |name: String, values: Vec<Option<f64>>| {
        if !head.contains(&name) {
            head.push(name);
            columns.push(values);
        }
    };
    for (input, samples) in
        model.inputs.iter().zip(&record.inputs).filter(|(input, _)| input.rate_of.is_none())
    {
        let factor = input.unit.factor * input.scale;
        let values = record.rows.iter().map(|row| Some(samples[*row] / factor));
        add(input.column.clone(), values.collect());
    }
    for ((output, measured), predicted) in model.outputs.iter().zip(&record.outputs).zip(predicted) {
        let factor = output.unit.factor * output.scale;
        add(output.column.clone(), measured.iter().map(|value| value.map(|value| value / factor)).collect());
        let predicted = predicted.iter().map(|value| Some(value / factor).filter(|value| value.is_finite()));
        add(format!("{}_model", output.name), predicted.collect());
    }
    let quoted = |name: &String| match name.contains([',', '"', '\n']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.clone(),
    };
    let mut text = head.iter().map(quoted).collect::<Vec<_>>().join(",");
    text.push('\n');
    for row in 0..record.time_s.len() {
        for (place, column) in columns.iter().enumerate() {
            let comma = if place > 0 { "," } else { "" };
            let _ = match column[row] {
                Some(value) => write!(text, "{comma}{}", rounded(value)),
                None => write!(text, "{comma}"),
            };
        }
        text.push('\n');
    }
    text
}

/// Ten digits: rounding by the conversion to SI and back is none of the record's.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}
