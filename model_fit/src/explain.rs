//! A model file in words: equations, numbers, units, suspects; with records also what these can tell apart.

use super::explain_page::page;
use super::report::{friction, notes_of, numbers, place, significant, term};
use super::structure::{Advice, Structure, structure};
use super::{ModelError, bounds, look, read, read_with_notes, select};
use model::{
    Hold, Input, Model, Parameter, Program, RecordLayout, Rows, Smoothing, Solver, Start, Suspect, Table,
};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A model file in words.
pub struct Explanation {
    /// Plain text for a terminal, with line ends.
    pub text: String,
    /// As a page, its equations set.
    pub page: String,
}

/// Explains a model file. With training records the model is fitted to them, and what they can tell apart is added.
///
/// # Errors
/// [`ModelError`] for a model or a record that cannot be used.
pub fn explain(file: &Path, train: &[PathBuf]) -> Result<String, ModelError> {
    explained(file, train).map(|explained| explained.text)
}

/// The same, and the page of it.
///
/// # Errors
/// Those of [`explain`].
pub fn explained(file: &Path, train: &[PathBuf]) -> Result<Explanation, ModelError> {
    let model = read(file)?;
    let mut text = in_words(&model);
    if train.is_empty() {
        let page = page(&model, &[], &text);
        return Ok(Explanation { text, page });
    }
    let records = read_with_notes(&model, train)?;
    let baseline = select::fitted(&model, &records, &[], None)?;
    let weak = bounds::remarks(&numbers(&baseline, &baseline, false));
    let notes: Vec<String> = look::beyond_reach(&baseline).into_iter().chain(notes_of(&records)).collect();
    if !notes.is_empty() {
        let _ = write!(text, "\nnotes\n  {}\n", notes.join("\n  "));
    }
    let identifiability = structure_in_words(&structure(&baseline, &baseline), weak);
    let _ = write!(text, "\nwhat these records can tell apart\n  {}\n", identifiability.join("\n  "));
    let page = page(&model, &identifiability, &text);
    Ok(Explanation { text, page })
}

pub(crate) fn in_words(model: &Model) -> String {
    let mut text = format!("{}\n", model.name);
    let mut section = |name: &str, lines: Vec<String>| {
        if !lines.is_empty() {
            let _ = write!(text, "\n{name}\n");
            lines.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
        }
    };
    section("record", record(&model.record));
    section("inputs", model.inputs.iter().map(|one| input(model, one)).collect());
    section("equations", equations(model, None).collect());
    section("with", definitions(model, None).collect());
    section("memory", memories(model, None).collect());
    section("friction", frictions(model, None).collect());
    let output = |output: &model::Output| {
        let noise = output.noise_si.map_or("noise estimated".into(), |noise| {
            format!("noise {} {}", significant(noise / output.unit.factor), output.unit.text)
        });
        let error = match output.model_error_si {
            0.0 => String::new(),
            error => {
                format!(
                    ", error of the model {} {}",
                    significant(error / output.unit.factor),
                    output.unit.text
                )
            }
        };
        let column = column(&output.column, output.scale);
        format!("{} [{}] = {}    {noise}{error}, {column}", output.name, output.unit.text, output.value.text)
    };
    section("tables", model.tables.iter().map(table).collect());
    section("outputs", model.outputs.iter().map(output).collect());
    section("parameters", parameters(model, None).collect());
    section("rows", rows(&model.rows));
    section("held out", vec![held_out(model.start_samples)]);
    section("fit", vec![fit(model.starts)]);
    let suspect = |index: usize| {
        let suspect = &model.suspects[index];
        let decoy = if suspect.is_decoy { ", a decoy" } else { "" };
        let head = format!("{}{decoy}, {}: {}", suspect.name, place(model, index), term(model, index));
        let owner = Some(index);
        let brought = kind(suspect)
            .into_iter()
            .chain(equations(model, owner))
            .chain(definitions(model, owner))
            .chain(memories(model, owner))
            .chain(frictions(model, owner))
            .chain(parameters(model, owner));
        std::iter::once(head).chain(brought.map(|line| format!("  {line}")))
    };
    for (name, is_term) in [("terms", true), ("suspects", false)] {
        let all = (0..model.suspects.len()).filter(|index| model.suspects[*index].is_term == is_term);
        let prior = match all.clone().count() {
            count if is_term || count == 0 => None,
            count => Some(format!("before the records as likely as none of them: 1/{} each", count + 1)),
        };
        section(name, prior.into_iter().chain(all.flat_map(suspect)).collect());
    }
    let operations = Program::new(model, &[]).map_or(0, |program| program.operations());
    let _ = write!(text, "\n{}; {operations} operations for all rates\n", solver(model.solver));
    text
}

pub(super) fn solver(solver: Solver) -> String {
    match solver {
        Solver::Adaptive { relative_tolerance } => {
            format!("integrated: adaptive, relative tolerance {relative_tolerance:e}")
        }
        Solver::Fixed { step_s } => format!("integrated: fixed steps of at most {step_s:e} s"),
    }
}

/// What a suspect is beside its law.
pub(super) fn kind(suspect: &Suspect) -> Vec<String> {
    let mut lines = Vec::new();
    lines.extend(suspect.library.iter().map(|library| format!("from the library: {library}")));
    lines.extend(
        suspect
            .effect
            .iter()
            .map(|effect| format!("a form of {effect}: forms that cannot be told apart are one finding")),
    );
    if suspect.is_local {
        lines.push("local: bands of the folds do not judge it".into());
    }
    if !suspect.twins.is_empty() {
        lines.push(format!("does the same as {}", suspect.twins.join(", ")));
    }
    lines
}

fn table(table: &Table) -> String {
    let Table { name, curve, from, to, .. } = table;
    let point = |point: Option<[f64; 2]>| {
        let [x, y] = point.expect("a table has two points at least");
        format!(
            "{} {} at {} {}",
            significant(y / to.factor),
            to.text,
            significant(x / from.factor),
            from.text
        )
    };
    let mut points = curve.points();
    let count = points.len();
    let (first, last) = (point(points.next()), point(points.next_back()));
    format!("{name}: {count} points from {first} to {last}, straight between them and level beyond")
}

pub(super) fn held_out(start_samples: usize) -> String {
    match start_samples {
        0 => "every sample is scored".to_owned(),
        samples => format!("the first {samples} samples of a record are for its start, and not scored"),
    }
}

pub(super) fn fit(starts: usize) -> String {
    match starts {
        0 => "starts from the values of the file alone".to_owned(),
        starts => {
            format!("starts from the values of the file, and from the best of {starts} points around them")
        }
    }
}

/// How a record is laid out; cells as they are read from a text table.
pub(super) fn record(layout: &RecordLayout) -> Vec<String> {
    let unit = match layout.time_unit_s {
        _ if layout.is_calendar => "times of a calendar (ISO 8601)".to_owned(),
        1.0 => "in s".to_owned(),
        unit_s => format!("in units of {unit_s} s"),
    };
    let mut lines = vec![format!("time from column {}, {unit}", layout.time_column)];
    lines.extend(layout.period_s.map(|period_s| format!("on an even grid of {period_s} s")));
    let (separator, comment) = (&layout.separator, &layout.comment);
    let decimal = if layout.is_decimal_comma { "comma" } else { "point" };
    lines.push(format!("separator {separator:?}, decimal {decimal}, comments begin with {comment:?}"));
    if layout.skip_lines > 0 {
        lines.push(format!("lines before the head: {}", layout.skip_lines));
    }
    if !layout.absent.is_empty() {
        let absent = layout.absent.iter().map(|cell| format!("{cell:?}")).collect::<Vec<_>>();
        lines.push(format!("no value: {}", absent.join(", ")));
    }
    lines
}

pub(super) fn input(model: &Model, input: &Input) -> String {
    let from = match input.rate_of {
        Some(of) => format!("the rate of {}", model.inputs[of].name),
        None => format!("from {}", column(&input.column, input.scale)),
    };
    let hold = match input.hold {
        Hold::Zero => "kept between samples",
        Hold::Linear => "straight between samples",
    };
    let smoothed = smoothed(input.smoothing);
    format!("{} [{}] {from}{smoothed}, {hold}", input.name, input.unit.text)
}

pub(super) fn column(name: &str, scale: f64) -> String {
    if scale == 1.0 { format!("column {name}") } else { format!("column {name} times {scale}") }
}

// What follows is of a suspect, or of the model itself.

fn equations(model: &Model, of: Option<usize>) -> impl Iterator<Item = String> {
    model.states.iter().filter(move |one| one.suspect == of).map(|one| equation(model, one))
}

fn equation(model: &Model, state: &model::State) -> String {
    let unit = &state.unit;
    let start = match state.start {
        Start::Known { value_si } => format!("starts at {}", significant(value_si / unit.factor)),
        Start::Fitted { .. } => "its start is fitted in each record".into(),
        Start::Record { output } => format!("starts at the first sample of {}", model.outputs[output].name),
        Start::Input { input } => format!("starts at the first sample of {}", model.inputs[input].name),
    };
    format!("d{}/dt = {}    {} in {}, {start}", state.name, state.derivative.text, state.name, unit.text)
}

fn definitions(model: &Model, suspect: Option<usize>) -> impl Iterator<Item = String> {
    let of_suspect = model.definitions.iter().enumerate().filter(move |(_, one)| one.suspect == suspect);
    of_suspect.map(|(index, one)| {
        format!("{} = {}    in {}", one.name, one.value.text, model.definition_unit(index).text)
    })
}

fn frictions(model: &Model, of: Option<usize>) -> impl Iterator<Item = String> {
    model.frictions.iter().filter(move |one| one.suspect == of).map(|one| friction(model, one))
}

fn memories(model: &Model, of: Option<usize>) -> impl Iterator<Item = String> {
    model.memories.iter().filter(move |one| one.suspect == of).map(memory)
}

fn memory(memory: &model::Memory) -> String {
    let start = match &memory.start {
        Some(start) => start.text.clone(),
        None => significant(memory.start_si / memory.unit.factor),
    };
    let (name, unit) = (&memory.name, &memory.unit.text);
    format!("{name} becomes {} after each step, from {start}    in {unit}", memory.update.text)
}

fn smoothed(smoothing: Smoothing) -> String {
    let Smoothing { low_pass_hz, low_pass_order, moving_average } = smoothing;
    let mut text = String::new();
    if low_pass_hz > 0.0 {
        let _ = write!(text, ", zero-phase Butterworth of order {low_pass_order} at {low_pass_hz} Hz");
    }
    if moving_average > 1 {
        let _ = write!(text, ", mean of {moving_average} samples");
    }
    text
}

pub(super) fn rows(rows: &Rows) -> Vec<String> {
    let mut lines = Vec::new();
    if rows.every > 1 {
        let Rows { every, order, ripple_decibel, edge, .. } = rows;
        lines.push(format!(
            "every {every} samples, behind a zero-phase Chebyshev I of order {order} and {ripple_decibel} dB, edge at {edge} of \
             their Nyquist frequency"
        ));
    }
    lines.extend(rows.condition.iter().map(|condition| format!("where {}", condition.text)));
    if rows.ends_s > 0.0 {
        lines.push(format!("within {} s of an end fitted, and no judge of suspects", rows.ends_s));
    }
    lines.extend(rows.folds.iter().map(|fold| format!("folds in time, and over {}", fold.text)));
    lines
}

fn parameters(model: &Model, of: Option<usize>) -> impl Iterator<Item = String> {
    let parameters = model.parameters.iter().filter(move |one| one.suspect == of);
    parameters.map(|one| format!("{} = {}", one.name, value_of(one)))
}

/// What is known of a number: value and unit, and whether it is fitted.
pub(super) fn value_of(parameter: &Parameter) -> String {
    let factor = parameter.unit.factor;
    let value = |value: &f64| significant(value / factor);
    if !parameter.of_records_si.is_empty() {
        let unit = &parameter.unit.text;
        let of = parameter.of_records_si.iter();
        let of = of.map(|(record, si)| format!("{} {unit} of {record}", value(si))).collect::<Vec<_>>();
        return format!("{}, known", of.join(", "));
    }
    let mut text = format!("{} {}", value(&parameter.values_si[0]), parameter.unit.text);
    if let [_, further @ ..] = parameter.values_si.as_slice()
        && !further.is_empty()
    {
        let _ = write!(
            text,
            " (a fit starts from {} too)",
            further.iter().map(value).collect::<Vec<_>>().join(", ")
        );
    }
    if parameter.is_fixed {
        return text + ", known";
    }
    let _ = match parameter.tolerance_si {
        Some(tolerance) => write!(text, " ± {}, fitted", significant(tolerance / factor)),
        None => write!(text, ", fitted"),
    };
    let [least, most] = parameter.range_si.map(|end| end / factor);
    if least.is_finite() || most.is_finite() {
        let _ = write!(text, " within {} to {}", significant(least), significant(most));
    }
    if parameter.is_per_record {
        text += ", one for each record";
    }
    text
}

fn structure_in_words(structure: &Structure, weak: Vec<String>) -> Vec<String> {
    let idle = structure.without_effect.iter().map(|name| format!("{name}: changes no output"));
    let is_moved = |name: &&String| !structure.without_effect.contains(name);
    let undetermined = structure.undetermined.iter().filter(is_moved);
    let undetermined = undetermined
        .map(|name| format!("{name}: not determined: other numbers move the outputs in the same way"));
    let hidden = structure.hidden.iter().filter(is_moved);
    let hidden = hidden.map(|name| format!("suspect {name}: looks like a change of the model's own numbers"));
    let twins = structure.twins.iter().map(|twins| {
        let [one, other] = &twins.suspects;
        format!("{one} and {other}: the same to these records (cosine {:.3})", twins.cosine)
    });
    let advice = structure.advice.iter().map(Advice::in_words);
    let mut lines: Vec<String> =
        idle.chain(undetermined).chain(weak).chain(hidden).chain(twins).chain(advice).collect();
    if lines.is_empty() {
        lines.push("every number, and every suspect from each other".into());
    }
    lines
}
