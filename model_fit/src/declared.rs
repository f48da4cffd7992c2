//! What a model file declares beside its equations: records, columns, units, ranges, known numbers. A report has it, so that
//! `extend` tells another version of the file by the line that differs.
//!
//! Values from which numbers are fitted are left out: a report has its own. Values are written in full.

use super::explain::{column, fit, held_out, input, kind, record, rows, solver};
use model::{Memory, Model, Output, Parameter, Start, State, Table};

/// A line for each of them, in the order of the file's tables.
pub(super) fn declared(model: &Model) -> Vec<String> {
    let suspects = model.suspects.iter().flat_map(|suspect| {
        let decoy = suspect.is_decoy.then(|| "a decoy".to_owned());
        let term = suspect.is_term.then(|| "a term of the model".to_owned());
        let all = decoy.into_iter().chain(term).chain(kind(suspect));
        all.map(|line| format!("{}: {line}", suspect.name)).collect::<Vec<_>>()
    });
    let record = record(&model.record).into_iter().map(|line| format!("record: {line}"));
    let rows = rows(&model.rows).into_iter().map(|line| format!("rows: {line}"));
    record
        .chain(rows)
        .chain([
            format!("held out: {}", held_out(model.start_samples)),
            format!("fit: {}", fit(model.starts)),
        ])
        .chain([solver(model.solver)])
        .chain(model.inputs.iter().map(|one| format!("input {}", input(model, one))))
        .chain(model.outputs.iter().map(output))
        .chain(model.states.iter().map(|one| state(model, one)))
        .chain(model.memories.iter().map(memory))
        .chain(model.tables.iter().map(table))
        .chain(model.parameters.iter().map(|one| parameter(model, one)))
        .chain(suspects)
        .collect()
}

fn output(output: &Output) -> String {
    let noise =
        output.noise_si.map_or(String::new(), |noise| format!(", noise {}", noise / output.unit.factor));
    let error = match output.model_error_si {
        0.0 => String::new(),
        error => format!(", error of the model {}", error / output.unit.factor),
    };
    let column = column(&output.column, output.scale);
    format!("output {} [{}], {column}{noise}{error}", output.name, output.unit.text)
}

fn state(model: &Model, state: &State) -> String {
    let factor = state.unit.factor;
    let start = match state.start {
        Start::Known { value_si } => format!("starts at {}", value_si / factor),
        Start::Fitted { range_si: [least, most], .. } => {
            format!("starts within {} to {}", least / factor, most / factor)
        }
        Start::Record { output } => format!("starts at the first sample of {}", model.outputs[output].name),
        Start::Input { input } => format!("starts at the first sample of {}", model.inputs[input].name),
    };
    format!("state {} [{}] {start}", owned(model, &state.name, state.suspect), state.unit.text)
}

fn memory(memory: &Memory) -> String {
    let start = match &memory.start {
        Some(start) => start.text.clone(),
        None => (memory.start_si / memory.unit.factor).to_string(),
    };
    format!("memory {} [{}] from {start} becomes {}", memory.name, memory.unit.text, memory.update.text)
}

/// A point that is another one shows in the area under the curve.
fn table(table: &Table) -> String {
    let points: Vec<[f64; 2]> = table.curve.points().collect();
    let area: f64 =
        points.windows(2).map(|pair| (pair[1][0] - pair[0][0]) * (pair[1][1] + pair[0][1]) / 2.0).sum();
    let area = area / table.from.factor / table.to.factor;
    let (name, count) = (&table.name, points.len());
    format!("table {name}: {count} points, {} over {}, area {area}", table.to.text, table.from.text)
}

fn parameter(model: &Model, parameter: &Parameter) -> String {
    let value = |value: &f64| (value / parameter.unit.factor).to_string();
    let (unit, first) = (&parameter.unit.text, value(&parameter.values_si[0]));
    let what = match (parameter.of_records_si.as_slice(), parameter.tolerance_si) {
        ([], _) if parameter.is_fixed => format!("known: {first}"),
        ([], tolerance) => {
            let [least, most] = parameter.range_si.map(|end| value(&end));
            let prior =
                tolerance.map_or(String::new(), |tolerance| format!(", {first} ± {}", value(&tolerance)));
            let each = if parameter.is_per_record { ", one for each record" } else { "" };
            format!("fitted within {least} to {most}{prior}{each}")
        }
        (of_records, _) => {
            let of_record = |(record, si): &(String, f64)| format!("{} of {record}", value(si));
            format!("known: {}", of_records.iter().map(of_record).collect::<Vec<_>>().join(", "))
        }
    };
    format!("number {} [{unit}] {what}", owned(model, &parameter.name, parameter.suspect))
}

/// A name with the suspect or term that it belongs to.
fn owned(model: &Model, name: &str, suspect: Option<usize>) -> String {
    suspect.map_or(name.to_owned(), |suspect| format!("{name} of {}", model.suspects[suspect].name))
}
