//! Reads the tables of a model file.

mod frictions;
mod inputs;
mod suspects;

use crate::file::{
    Definition, Expression, Memory, Model, Output, Parameter, RecordLayout, Solver, Start, State, Table,
};
use crate::names::named_parts;
use crate::rows::Rows;
use crate::units::{Dimension, Unit};
use expression::compile::RESERVED;
use expression::grammar::{Nodes, is_name_character};
use settings::{Result, Section, Source, Text};
use std::path::Path;

/// Unit of a column that holds times of a calendar.
const CALENDAR: &str = "iso8601";
/// Points from which fits start unless the file says how many.
const STARTS: usize = 8;
/// Most names of each kind.
const MOST_NAMES: usize = 500;

/// Tables and keys of a model file.
const TOP: &str = "name record solver held_out fit rows tables inputs parameters states memory friction define outputs \
                   terms suspects";

struct Reader<'a> {
    source: &'a Source<'a>,
    model: Model,
    /// Place names of suspects with what stands there, for when all names are known.
    starts: Vec<(usize, Text)>,
}

pub(crate) fn model(source: &Source<'_>, file: &Path) -> Result<Model> {
    let mut root = source.root();
    root.allow(&TOP.split_whitespace().collect::<Vec<_>>())?;
    let stem = file.file_stem().map_or_else(|| "model".into(), |stem| stem.to_string_lossy().into_owned());
    let name = root.text("name")?.map_or(stem, |text| text.text);
    let record = record(&mut root, source)?;
    let solver = solver(&mut root)?;
    let mut start_samples = 0;
    if let Some(mut held_out) = root.section("held_out")? {
        start_samples = one_or(&mut held_out, "start_samples", 0.0, [0.0, 1e6])? as usize;
        held_out.finish()?;
    }
    let mut starts = STARTS;
    if let Some(mut fit) = root.section("fit")? {
        starts = one_or(&mut fit, "starts", STARTS as f64, [0.0, 1000.0])? as usize;
        fit.finish()?;
    }
    let rows = root.section("rows")?;
    let model = Model {
        name,
        record,
        start_samples,
        starts,
        rows: Rows::default(),
        solver,
        inputs: Vec::new(),
        parameters: Vec::new(),
        states: Vec::new(),
        memories: Vec::new(),
        frictions: Vec::new(),
        definitions: Vec::new(),
        outputs: Vec::new(),
        suspects: Vec::new(),
        tables: Vec::new(),
        nodes: Nodes::default(),
        text: source.text().into(),
        file: file.into(),
    };
    let mut reader = Reader { source, model, starts: Vec::new() };
    reader.tables(&mut root)?;
    reader.inputs(&mut root)?;
    reader.members(&mut root, None)?;
    reader.outputs(&mut root)?;
    if let Some(rows) = rows {
        reader.rows(rows)?;
    }
    for section in root.sections("terms")? {
        reader.suspect(section, true)?;
    }
    for section in root.sections("suspects")? {
        reader.suspect(section, false)?;
    }
    if reader.model.outputs.is_empty() {
        return Err(root.wrong("[outputs] is missing: what of this model is measured?"));
    }
    reader.resolve_starts()?;
    Ok(reader.model)
}

fn record(root: &mut Section<'_>, source: &Source<'_>) -> Result<RecordLayout> {
    let mut layout = RecordLayout {
        period_s: None,
        time_column: "t_s".into(),
        time_unit_s: 1.0,
        is_calendar: false,
        separator: ",".into(),
        is_decimal_comma: false,
        comment: "#".into(),
        skip_lines: 0,
        absent: Vec::new(),
    };
    let Some(mut section) = root.section("record")? else { return Ok(layout) };
    if let Some(column) = section.text("time")? {
        layout.time_column = column.text;
    }
    layout.is_calendar = section.peek("unit") == Some(CALENDAR);
    let unit = if layout.is_calendar {
        section.text("unit").map(|_| Unit::one())?
    } else {
        unit(&mut section, source)?
    };
    if section.has("unit") && !layout.is_calendar {
        if unit.dimension != Dimension::TIME {
            return Err(
                section.wrong_at("unit", "unit: no unit of time; allowed is s, ms, us, min, h, or iso8601")
            );
        }
        layout.time_unit_s = unit.factor;
    }
    let period_s = one_or(&mut section, "period_s", 1.0, [1e-9, 1e6])?;
    layout.period_s = section.has("period_s").then_some(period_s);
    if let Some(separator) = section.text("separator")? {
        layout.separator = separator.text;
    }
    layout.is_decimal_comma = section.choice("decimal", &[(".", false), (",", true)])?;
    if let Some(comment) = section.text("comment")? {
        layout.comment = comment.text;
    }
    layout.skip_lines = one_or(&mut section, "skip_lines", 0.0, [0.0, 1e6])? as u64;
    layout.absent = section.texts("absent")?;
    section.finish()?;
    Ok(layout)
}

fn solver(root: &mut Section<'_>) -> Result<Solver> {
    let Some(mut section) = root.section("solver")? else {
        return Ok(Solver::Adaptive { relative_tolerance: 1e-6 });
    };
    let is_fixed = section.choice("method", &[("adaptive", false), ("fixed", true)])?;
    let solver = if is_fixed {
        if !section.has("step_s") {
            return Err(section.wrong("step_s is missing: the longest step of method = \"fixed\", s"));
        }
        Solver::Fixed { step_s: one_or(&mut section, "step_s", 0.0, [1e-12, 1e6])? }
    } else {
        let relative_tolerance = one_or(&mut section, "relative_tolerance", 1e-6, [1e-12, 0.1])?;
        Solver::Adaptive { relative_tolerance }
    };
    section.finish()?;
    Ok(solver)
}

/// The number under a key, in its range.
fn one_or(section: &mut Section<'_>, key: &str, default: f64, [least, most]: [f64; 2]) -> Result<f64> {
    match section.numbers(key)?.as_slice() {
        [] => Ok(default),
        [one] if (least..=most).contains(one) => Ok(*one),
        _ => Err(section.wrong_at(key, &format!("{key}: allowed is one number, {least} to {most}"))),
    }
}

/// The unit of a section, 1 when it is absent.
fn unit(section: &mut Section<'_>, source: &Source<'_>) -> Result<Unit> {
    unit_of(section, source, "unit")
}

fn unit_of(section: &mut Section<'_>, source: &Source<'_>, key: &str) -> Result<Unit> {
    let Some(text) = section.text(key)? else { return Ok(Unit::one()) };
    Unit::parse(&text.text).map_err(|error| source.wrong_from(text.at + error.at, &error.why))
}

/// The factor that brings what stands in a column to its unit.
fn scale(section: &mut Section<'_>) -> Result<f64> {
    match one_or(section, "scale", 1.0, [-1e12, 1e12])? {
        0.0 => Err(section.wrong_at("scale", "scale: allowed is a number that is not 0")),
        scale => Ok(scale),
    }
}

fn range(section: &mut Section<'_>, unit: &Unit) -> Result<[f64; 2]> {
    match section.numbers("range")?.as_slice() {
        [] => Ok([f64::NEG_INFINITY, f64::INFINITY]),
        [least, most] if least < most => Ok([least * unit.factor, most * unit.factor]),
        given => {
            let why = format!("range: {given:?} is none; allowed is [least, largest], the least first");
            Err(section.wrong_at("range", &why))
        }
    }
}

/// How a table under a key is written.
fn example(key: &str, name: &str) -> Option<String> {
    let keys = match key {
        "inputs" => "unit = \"V\"",
        "parameters" => "unit = \"kg\", value = 2",
        "states" => "unit = \"m\", start = 0, derivative = \"v\"",
        "outputs" => "unit = \"m\", value = \"x\"",
        "tables" => "x = [0, 1], y = [0, 2]",
        "memory" => "unit = \"m\", start = 0, update = \"max(w, x)\"",
        "friction" => "unit = \"N\", velocity = \"v\", sliding = \"coulomb\"",
        _ => return None,
    };
    Some(format!("{key}.{name} = {{ {keys} }}"))
}

/// The tables under a key, by their names.
pub(crate) fn named<'a>(section: &mut Section<'a>, key: &str) -> Result<Vec<(String, Section<'a>)>> {
    let Some(mut all) = section.section_as(key, example(key, "NAME").as_deref())? else {
        return Ok(Vec::new());
    };
    let mut found = Vec::new();
    for name in all.keys() {
        let inner = all.section_as(&name, example(key, &name).as_deref())?.expect("it is one of the keys");
        found.push((name, inner));
    }
    Ok(found)
}

impl Reader<'_> {
    fn expression(&mut self, text: Text) -> Result<Expression> {
        let root = self.model.nodes.parse(&text.text, text.at);
        let root = root.map_err(|wrong| self.source.wrong_from(wrong.at, &wrong.why))?;
        Ok(Expression { text: text.text.trim().into(), root, at: text.at })
    }

    /// A name that is new, is one, and means nothing else.
    fn is_new(&self, name: &str, suspect: Option<usize>, section: &Section<'_>) -> Result<()> {
        let begins = name.starts_with(|first: char| first.is_alphabetic() || first == '_');
        if !begins || !name.chars().all(is_name_character) || name.chars().count() > 64 {
            let allowed =
                "a name has letters, digits and _, begins with no digit, and has at most 64 of them";
            return Err(section.wrong(allowed));
        }
        if RESERVED.contains(&name) {
            return Err(section.wrong("the name has a meaning in expressions: choose another"));
        }
        let model = &self.model;
        let local = |of: Option<usize>| of.is_none() || of == suspect;
        let taken = named_parts(model).any(|(_, other, of)| other == name && local(of))
            || model.outputs.iter().any(|output| output.name == name)
            || model.tables.iter().any(|table| table.name == name);
        if taken {
            return Err(section.wrong("the name is taken: each stands once in a file"));
        }
        let most = [model.inputs.len(), model.parameters.len(), model.states.len(), model.definitions.len()];
        if most.into_iter().any(|count| count >= MOST_NAMES) {
            return Err(section.wrong(&format!("more than {MOST_NAMES} of a kind in one file")));
        }
        Ok(())
    }

    fn tables(&mut self, root: &mut Section<'_>) -> Result<()> {
        for (name, mut section) in named(root, "tables")? {
            self.is_new(&name, None, &section)?;
            let from = unit_of(&mut section, self.source, "x_unit")?;
            let to = unit_of(&mut section, self.source, "y_unit")?;
            let (x, y) = (section.numbers("x")?, section.numbers("y")?);
            let table = Table::new(name, (x, from), (y, to));
            let table = table.map_err(|(key, why)| section.wrong_at(key, &why))?;
            section.finish()?;
            self.model.tables.push(table);
        }
        Ok(())
    }

    /// Parameters, states, memories and definitions, of the model or of a suspect.
    fn members(&mut self, parent: &mut Section<'_>, suspect: Option<usize>) -> Result<()> {
        for (name, section) in named(parent, "parameters")? {
            self.is_new(&name, suspect, &section)?;
            let parameter = Parameter {
                name,
                unit: Unit::one(),
                values_si: Vec::new(),
                tolerance_si: None,
                range_si: [f64::NEG_INFINITY, f64::INFINITY],
                is_fixed: false,
                is_per_record: false,
                of_records_si: Vec::new(),
                is_bound_by_samples: false,
                suspect,
            };
            self.parameter(section, parameter)?;
        }
        for (name, mut section) in named(parent, "states")? {
            self.is_new(&name, suspect, &section)?;
            let unit = unit(&mut section, self.source)?;
            let start = self.start(&mut section, &unit)?;
            let derivative =
                section.needed_text("derivative", "the state's rate of change, an expression")?;
            let derivative = self.expression(derivative)?;
            section.finish()?;
            self.model.states.push(State { name, unit, start, derivative, suspect });
        }
        for (name, mut section) in named(parent, "memory")? {
            self.is_new(&name, suspect, &section)?;
            let unit = unit(&mut section, self.source)?;
            let (start_si, start) = match section.peek("start") {
                Some(_) => (0.0, section.text("start")?.map(|text| self.expression(text)).transpose()?),
                None => (one_or(&mut section, "start", 0.0, [-1e300, 1e300])? * unit.factor, None),
            };
            let update = section.needed_text("update", "its value after a step, an expression")?;
            let update = self.expression(update)?;
            section.finish()?;
            self.model.memories.push(Memory { name, unit, start_si, start, update, suspect });
        }
        self.frictions(parent, suspect)?;
        let Some(mut section) = parent.section("define")? else { return Ok(()) };
        for name in section.keys() {
            let text = section.needed_text(&name, "an expression")?;
            self.is_new(&name, suspect, &section).map_err(|error| {
                self.source.wrong_from(text.at, error.to_string().rsplit(": ").next().unwrap_or(""))
            })?;
            let value = self.expression(text)?;
            self.model.definitions.push(Definition { name, value, suspect });
        }
        section.finish()
    }

    /// A parameter with what the file says of it in place of what it is without.
    fn parameter(&mut self, mut section: Section<'_>, before: Parameter) -> Result<()> {
        // Each key is asked for, so that a message of one that is misspelt names it.
        let given = unit(&mut section, self.source)?;
        let unit = if section.has("unit") { given } else { before.unit };
        let values = section.numbers("value")?;
        let values_si: Vec<f64> = match values.as_slice() {
            [] if !section.has("value") => before.values_si,
            values => values.iter().map(|value| value * unit.factor).collect(),
        };
        let of_records_si = self.of_records(&mut section, &unit)?;
        let values_si = of_records_si.first().map_or(values_si, |(_, first)| vec![*first]);
        if values_si.is_empty() || values_si.len() > 8 {
            return Err(
                section.wrong_at("value", "value: allowed is a number, or up to 8 from which a fit starts")
            );
        }
        let given = range(&mut section, &unit)?;
        let has_range = section.has("range");
        let range_si = if has_range { given } else { before.range_si };
        let [least, most] = range_si;
        if let Some(outside) = values_si.iter().find(|value| !(least..=most).contains(*value)) {
            // In the digits of an f32, which hide the rounding of the unit.
            let [outside, least, most] = [*outside, least, most].map(|si| (si / unit.factor) as f32);
            let why = format!("value: {outside} is not within its range, {least} to {most}");
            return Err(section.wrong_at("value", &why));
        }
        let tolerance_si = match section.numbers("tolerance")?.as_slice() {
            [] => None,
            [one] if *one > 0.0 => Some(one * unit.factor),
            _ => return Err(section.wrong_at("tolerance", "tolerance: allowed is a number above 0")),
        };
        let given = section.flag("fixed")?;
        let is_fixed =
            if section.has("fixed") { given } else { before.is_fixed } || !of_records_si.is_empty();
        let is_per_record = section.flag("per_record")?;
        if is_fixed && is_per_record {
            return Err(section
                .wrong_at("per_record", "per_record: the number is fixed, so that no record has its own"));
        }
        section.finish()?;
        let is_bound_by_samples = before.is_bound_by_samples && !has_range;
        self.model.parameters.push(Parameter {
            unit,
            values_si,
            tolerance_si,
            range_si,
            is_fixed,
            is_per_record,
            of_records_si,
            is_bound_by_samples,
            ..before
        });
        Ok(())
    }

    /// Known values of records, by the end of their path.
    fn of_records(&self, section: &mut Section<'_>, unit: &Unit) -> Result<Vec<(String, f64)>> {
        let Some(mut given) = section.section("values")? else { return Ok(Vec::new()) };
        let more = ["value", "range", "tolerance", "per_record"].into_iter().find(|key| section.has(key));
        if let Some(key) = more {
            let why = format!("{key}: the number is known of each record under values, and has none");
            return Err(section.wrong_at(key, &why));
        }
        let mut all = Vec::new();
        for name in given.keys() {
            match given.numbers(&name)?.as_slice() {
                [value] => all.push((name, value * unit.factor)),
                _ => return Err(given.wrong_at(&name, &format!("{name}: allowed is one number"))),
            }
        }
        if all.is_empty() {
            return Err(given.wrong("values is empty: the file name of each record, and its value"));
        }
        given.finish()?;
        Ok(all)
    }

    fn start(&mut self, section: &mut Section<'_>, unit: &Unit) -> Result<Start> {
        let range_si = range(section, unit)?;
        let guess = section.numbers("guess")?;
        if section.peek("start").is_none() {
            let value_si = one_or(section, "start", f64::NAN, [-1e300, 1e300])? * unit.factor;
            if value_si.is_nan() {
                let allowed = "a number, \"fitted\" with a guess, or the name of an output or input";
                return Err(section.wrong(&format!("start is missing: allowed is {allowed}")));
            }
            return Ok(Start::Known { value_si });
        }
        let text = section.needed_text("start", "")?;
        if text.text == "fitted" {
            let [guess] = guess.as_slice() else {
                return Err(section.wrong("guess is missing: where the fit of the start begins"));
            };
            let guess_si = (guess * unit.factor).clamp(range_si[0], range_si[1]);
            return Ok(Start::Fitted { guess_si, range_si });
        }
        // The outputs are read later.
        self.starts.push((self.model.states.len(), text));
        Ok(Start::Record { output: usize::MAX })
    }

    fn resolve_starts(&mut self) -> Result<()> {
        for (state, text) in &self.starts {
            let output = self.model.outputs.iter().position(|output| output.name == text.text);
            let input = self.model.inputs.iter().position(|input| input.name == text.text);
            let found = output.map(|output| (Start::Record { output }, &self.model.outputs[output].unit));
            let found = found.or(input.map(|input| (Start::Input { input }, &self.model.inputs[input].unit)));
            let Some((start, unit)) = found else {
                let why = format!(
                    "'{}' is no output and no input; allowed is a number, \"fitted\", or the name of one",
                    text.text
                );
                return Err(self.source.wrong_from(text.at, &why));
            };
            if unit.dimension != self.model.states[*state].unit.dimension {
                return Err(self.source.wrong_from(text.at, "it has another unit than the state"));
            }
            self.model.states[*state].start = start;
        }
        Ok(())
    }

    fn outputs(&mut self, root: &mut Section<'_>) -> Result<()> {
        for (name, mut section) in named(root, "outputs")? {
            self.is_new(&name, None, &section)?;
            let column = section.text("column")?.map_or_else(|| name.clone(), |text| text.text);
            let (unit, scale) = (unit(&mut section, self.source)?, scale(&mut section)?);
            let value = section.needed_text("value", "what the model says it is, an expression")?;
            let value = self.expression(value)?;
            let noise = one_or(&mut section, "noise", 0.0, [0.0, 1e300])?;
            let noise_si = (noise > 0.0).then_some(noise * unit.factor);
            let model_error_si = one_or(&mut section, "model_error", 0.0, [0.0, 1e300])? * unit.factor;
            section.finish()?;
            let output = Output { name, column, scale, unit, value, suspect: None, noise_si, model_error_si };
            self.model.outputs.push(output);
        }
        Ok(())
    }
}
