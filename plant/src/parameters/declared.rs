//! Reads `[[terms]]` of a rig file, and `[[suspects]]` of a file beside one.
//!
//! ```text
//! [[terms]]
//! name = "eddy-brake"
//! place = "drive.force"          # drive or load; force, flow-a, flow-b, position-reading, force-reading, pressure-a-reading, …
//! add = "-(c0 + c1*x)*v"         # over x, v, p_a, p_b, u, s, t, F
//! parameters.c0 = { unit = "N s/m", value = 40, range = [0, 200] }
//! parameters.c1 = { unit = "N s/m^2", value = 120, range = [0, 500] }
//! ```
//!
//! A term may keep values from step to step, here a play between the axis and what brakes it:
//!
//! ```text
//! add = "-k*w"
//! memory.w = { unit = "m", range = [0, 1], start = "x", update = "min(max(w, x - g), x + g)" }    # over dt and w too
//! ```
//!
//! Curves that a term reads stand under its `tables`, or under `[tables]` of the file for all of its terms:
//!
//! ```text
//! add = "-c*drag(x)*v"
//! tables.drag = { x_unit = "mm", x = [0, 100, 500], y = [0.2, 1, 1.4] }
//! ```
//!
//! A term needs the value of each number, and its range is that value alone where the file gives none. A suspect needs ranges,
//! and its values are those at which it adds nothing, 0 where the file gives none.

use super::laws::{Laws, bound_law};
use super::reader::ParameterError;
use crate::effects::declared::{
    Declared, MOST_PARAMETERS, MOST_REMEMBERED, MOST_TERMS, Number, SENSOR_FORCE, Target, VARIABLES,
    dimension, variables,
};
use crate::effects::remembered::{MemoryVariable, STEP};
use crate::effects::sheet;
use crate::effects::sheet::PlaceKind;
use crate::state::Axis;
use expression::compile::RESERVED;
use expression::curve::Table;
use expression::formula::{Formula, SymbolTable, Variable};
use expression::grammar::is_name_character;
use expression::units::Unit;
use settings::{Result, Section, Source, Text};
use std::fmt::Write as _;
use std::path::Path;

/// Values of the variables at which a suspect that is off must add nothing, in their order: rest and motion of a rig.
const OFF_AT: [[f64; 8]; 3] = [
    [0.0, 0.0, 101_325.0, 101_325.0, 0.0, 0.0, 0.0, 0.0],
    [0.13, 0.7, 5e5, 2.5e5, 0.6, 0.5, 1.7, 35.0],
    [0.41, -0.9, 2e5, 6e5, -0.3, -0.4, 9.0, -80.0],
];

/// The suspects of a file beside a rig file; `file` is only its name for messages.
///
/// # Errors
/// [`ParameterError`] with file, line and column: no TOML, unknown and missing keys, expressions that are none, of another
/// dimension than their place, or not proven finite, and suspects that add something when they are off.
pub fn suspects(text: &str, file: &str) -> Result<Vec<Declared>, ParameterError> {
    suspects_using(text, file, &|_| Err("no library is known here".into()))
}

/// The same of a file that may use the laws of libraries.
///
/// # Errors
/// As [`suspects`], and a law that there is none of, or that lacks a variable or a range.
pub fn suspects_using(text: &str, file: &str, laws: Laws<'_>) -> Result<Vec<Declared>, ParameterError> {
    let suspects = read_with(text, file, "suspects", Some(laws))?;
    if suspects.is_empty() {
        return Err(ParameterError::at(file, 1, "no [[suspects]] in this file"));
    }
    Ok(suspects)
}

/// The terms under a key of a file. Other keys are the caller's, except in a file of suspects, which has none.
pub(super) fn read(text: &str, file: &str, key: &str) -> Result<Vec<Declared>, ParameterError> {
    read_with(text, file, key, None)
}

fn read_with(
    text: &str,
    file: &str,
    key: &str,
    laws: Option<Laws<'_>>,
) -> Result<Vec<Declared>, ParameterError> {
    let source = Source::parse(text, Path::new(file))?.with_columns();
    let mut root = source.root();
    let mut all: Vec<Declared> = Vec::new();
    let of_file = tables(&mut root, &source)?;
    for section in root.sections(key)? {
        if all.len() == MOST_TERMS {
            return Err(section.wrong(&format!("more than {MOST_TERMS} of a kind in one file")).into());
        }
        let mut reader = Reader { source: &source, is_suspect: key == "suspects", laws, of_file: &of_file };
        let at = section.at("name");
        let term = reader.term(section)?;
        if let Some(other) = all.iter().find(|other| other.is_same(&term)) {
            let why = format!("name: {} is at {} already", term.name, other.place());
            return Err(source.wrong_from(at, &why).into());
        }
        all.push(term);
    }
    if key == "suspects" {
        root.finish()?;
    }
    Ok(all)
}

/// A memory variable, as it is written.
struct MemoryText {
    name: String,
    unit: Unit,
    range: [f64; 2],
    start: Text,
    update: Text,
}

impl MemoryText {
    fn variable(&self) -> Variable<'_> {
        let range = self.range.map(|end| end * self.unit.factor);
        Variable { name: &self.name, dimension: self.unit.dimension, range }
    }

    fn with(&self, (start_formula, update_formula): (Formula, Formula)) -> MemoryVariable {
        MemoryVariable {
            name: self.name.clone(),
            unit: self.unit.clone(),
            range: self.range,
            start: self.start.text.clone(),
            update: self.update.text.clone(),
            start_formula,
            update_formula,
        }
    }
}

/// The curves under `tables` of a section.
fn tables(section: &mut Section<'_>, source: &Source<'_>) -> Result<Vec<Table>> {
    let Some(mut all) = section.section("tables")? else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for name in all.keys() {
        is_name(&all, &name)?;
        if RESERVED.contains(&name.as_str()) {
            let why = format!("{name}: the name has a meaning in expressions: choose another");
            return Err(all.wrong_at(&name, &why));
        }
        let Some(mut one) = all.section(&name)? else { continue };
        let from = unit_at(&mut one, source, "x_unit")?;
        let to = unit_at(&mut one, source, "y_unit")?;
        let (x, y) = (one.numbers("x")?, one.numbers("y")?);
        let table = Table::new(name, (x, from), (y, to));
        found.push(table.map_err(|(key, why)| one.wrong_at(key, &why))?);
        one.finish()?;
    }
    all.finish()?;
    Ok(found)
}

/// Refuses a key that no expression could read.
fn is_name(section: &Section<'_>, name: &str) -> Result<()> {
    let begins = name.starts_with(|first: char| first.is_alphabetic() || first == '_');
    if begins && name.chars().all(is_name_character) && name.chars().count() <= 64 {
        return Ok(());
    }
    Err(section.wrong_at(name, &format!("{name}: a name has letters, digits and _ alone")))
}

/// The unit under a key, 1 when it is absent.
pub(super) fn unit_at(section: &mut Section<'_>, source: &Source<'_>, key: &str) -> Result<Unit> {
    let Some(text) = section.text(key)? else { return Ok(Unit::one()) };
    Unit::parse(&text.text).map_err(|wrong| source.wrong_from(text.at + wrong.at, &wrong.why))
}

struct Reader<'a> {
    source: &'a Source<'a>,
    is_suspect: bool,
    /// Libraries whose laws the file may use.
    laws: Option<Laws<'a>>,
    /// Curves of the file, for all of its terms.
    of_file: &'a [Table],
}

impl Reader<'_> {
    fn term(&mut self, mut section: Section<'_>) -> Result<Declared> {
        let used = match self.laws {
            Some(laws) => bound_law(&mut section, self.source, laws)?,
            None => None,
        };
        let name = match &used {
            Some(used) => used.name.clone(),
            None => section.needed_text("name", "what reports call it")?.text,
        };
        let is_plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
        if name.is_empty() || name.len() > 64 || !name.chars().all(is_plain) {
            return Err(section.wrong_at("name", "name: allowed are up to 64 of a-z, A-Z, 0-9, - and _"));
        }
        if sheet(&name).is_some() {
            return Err(section.wrong_at("name", "name: an effect of the catalogue has it"));
        }
        let places = || -> Vec<(String, Axis, Target)> {
            let one = |axis: Axis| {
                Target::ALL.map(|target| (format!("{}.{}", axis.name(), target.name()), axis, target))
            };
            Axis::ALL.into_iter().flat_map(one).collect()
        };
        let allowed = || places().into_iter().map(|(name, ..)| name).collect::<Vec<_>>().join(", ");
        let place = section.needed_text("place", &format!("what it adds to, one of {}", allowed()))?;
        let Some((_, axis, target)) = places().into_iter().find(|(name, ..)| *name == place.text) else {
            let why = format!("place = \"{}\"; allowed is {}", place.text, allowed());
            return Err(self.source.wrong_from(place.at, &why));
        };
        let library = used.as_ref().map(|used| used.at);
        let (add, at, numbers) = match used {
            Some(used) => (used.add, used.at, used.numbers),
            None => {
                let add = section.needed_text("add", "the expression that is added")?;
                (add.text, add.at, self.named(&mut section, "parameters", MOST_PARAMETERS, Self::number)?)
            }
        };
        if numbers.len() > MOST_PARAMETERS {
            return Err(section.wrong(&format!("more than {MOST_PARAMETERS} names under parameters")));
        }
        let kept = self.named(&mut section, "memory", MOST_REMEMBERED, Self::memory_variable)?;
        let mut curves = tables(&mut section, self.source)?;
        let others: Vec<Table> = self
            .of_file
            .iter()
            .filter(|one| curves.iter().all(|curve| curve.name != one.name))
            .cloned()
            .collect();
        curves.extend(others);
        let twins = section.texts("twins")?;
        section.finish()?;

        let ways: Vec<Variable<'_>> = kept.iter().map(MemoryText::variable).collect();
        let mut before = variables();
        if target.kind() != PlaceKind::Channel
            && numbers.iter().any(|number| number.name == before[SENSOR_FORCE].name)
        {
            // The number stands for itself.
            before[SENSOR_FORCE].name = "";
        }
        let variables = [before.clone(), ways.clone()].concat();
        let taken = variables.iter().map(|one| one.name).chain((!kept.is_empty()).then_some(STEP.0));
        if let Some(number) = numbers.iter().find(|number| taken.clone().any(|name| name == number.name)) {
            return Err(section.wrong(&format!("parameters.{}: a variable has this name", number.name)));
        }
        let all = VARIABLES.iter().map(|one| one.0).chain([STEP.0]);
        if let Some(one) = kept.iter().find(|kept| all.clone().any(|name| name == kept.name)) {
            return Err(section.wrong(&format!("memory.{}: a variable has this name", one.name)));
        }
        let parameters: Vec<Variable<'_>> = numbers
            .iter()
            .map(|number| Variable {
                name: &number.name,
                dimension: number.unit.dimension,
                range: number.range.map(|end| end * number.unit.factor),
            })
            .collect();
        let wanted = (dimension(target.unit()), place.text.as_str());
        let symbols = SymbolTable { variables: &variables, parameters: &parameters, tables: &curves };
        let formula = Formula::compile((&add, at), symbols, wanted).map_err(|wrong| {
            match library {
                // The expression is the library's, so that the file has no place of its parts.
                Some(used) => self.source.wrong_from(used, &format!("{}, in {add}", wrong.why)),
                None => self.source.wrong_from(wrong.at, &wrong.why),
            }
        })?;
        let (name_of_step, unit_of_step, range) = STEP;
        let step = Variable { name: name_of_step, dimension: dimension(unit_of_step), range };
        let while_kept = [before.clone(), ways.clone(), vec![step]].concat();
        let memory = kept
            .iter()
            .map(|one| {
                let compiled = |text: &Text, variables: &[Variable<'_>]| {
                    let wanted = (one.unit.dimension, one.name.as_str());
                    Formula::compile((&text.text, text.at), SymbolTable { variables, ..symbols }, wanted)
                        .map_err(|wrong| self.source.wrong_from(wrong.at, &wrong.why))
                };
                let formulas = (compiled(&one.start, &before)?, compiled(&one.update, &while_kept)?);
                Ok(one.with(formulas))
            })
            .collect::<Result<Vec<_>>>()?;
        let reads = |table: &Table| {
            let kept = memory.iter().flat_map(|one| [&one.start_formula, &one.update_formula]);
            [&formula].into_iter().chain(kept).any(|formula| formula.reads_table(&table.name))
        };
        let read: Vec<Table> = curves.iter().filter(|table| reads(table)).cloned().collect();
        let mut term = Declared { name, axis, target, add, numbers, memory, tables: read, twins, formula };
        term.set_formulas();
        if self.is_suspect {
            self.adds_nothing(&term, at)?;
        }
        Ok(term)
    }

    /// Refuses a suspect that is not off at the values of its file.
    fn adds_nothing(&self, term: &Declared, at: usize) -> Result<()> {
        let is_off = |number: &&Number| number.value == 0.0;
        let Some(first) = term.numbers.first().filter(is_off) else {
            let why = "the first of its parameters is its amplitude, and has no value: it is 0 where the suspect is off";
            return Err(self.source.wrong_from(at, why));
        };
        // Whatever it keeps.
        let end = |end: usize| term.memory.iter().map(|one| one.range[end] * one.unit.factor).collect();
        let kept: [Vec<f64>; 2] = [end(0), end(1)];
        let each = OFF_AT.iter().flat_map(|values| kept.iter().map(move |kept| (values, kept)));
        let Some(added) =
            each.map(|(values, kept)| term.value_keeping(values, kept)).find(|value| *value != 0.0)
        else {
            return Ok(());
        };
        let off: Vec<&str> = term.numbers.iter().filter(is_off).map(|number| number.name.as_str()).collect();
        let (unit, many) = (term.target.unit(), if off.len() > 1 { "are" } else { "is" });
        let why = format!(
            "where {} {many} 0 a suspect adds nothing, and this adds {added} {unit}: begin with {}*(...)",
            off.join(", "),
            first.name
        );
        Err(self.source.wrong_from(at, &why))
    }

    /// What stands under the names of a table, at most so many.
    fn named<T>(
        &self,
        section: &mut Section<'_>,
        table: &str,
        most: usize,
        one: impl Fn(&Self, String, Section<'_>) -> Result<T>,
    ) -> Result<Vec<T>> {
        let Some(mut all) = section.section(table)? else { return Ok(Vec::new()) };
        let names = all.keys();
        if names.len() > most {
            return Err(all.wrong(&format!("more than {most} names under {table}")));
        }
        let mut found = Vec::new();
        for name in names {
            is_name(&all, &name)?;
            let Some(section) = all.section(&name)? else { continue };
            found.push(one(self, name, section)?);
        }
        all.finish()?;
        Ok(found)
    }

    /// What the term keeps, its expressions as they are written.
    fn memory_variable(&self, name: String, mut section: Section<'_>) -> Result<MemoryText> {
        let unit = unit_at(&mut section, self.source, "unit")?;
        let range = match section.numbers("range")?.as_slice() {
            [least, most] if least < most && least.abs().max(most.abs()) <= 1e12 => [*least, *most],
            _ => {
                let why = "range: needed are two numbers that it stays within, and within 1e12 of 0";
                return Err(section.wrong_at("range", why));
            }
        };
        let start = section.needed_text("start", "the expression of its value where the plant begins")?;
        let update =
            section.needed_text("update", "the expression that renews it at the end of a substep")?;
        section.finish()?;
        Ok(MemoryText { name, unit, range, start, update })
    }

    fn number(&self, name: String, mut section: Section<'_>) -> Result<Number> {
        let unit = unit_at(&mut section, self.source, "unit")?;
        let value = match section.numbers("value")?.as_slice() {
            [one] => *one,
            [] if self.is_suspect => 0.0,
            _ => return Err(section.wrong_at("value", "value: needed is one number")),
        };
        let range = match section.numbers("range")?.as_slice() {
            [least, most] if least <= most && least.abs().max(most.abs()) <= 1e12 => [*least, *most],
            [] if !self.is_suspect => [value; 2],
            _ => {
                let why = "range: needed are two numbers, the least and the largest value, within 1e12 of 0";
                return Err(section.wrong_at("range", why));
            }
        };
        let [least, most] = range;
        if !(least..=most).contains(&value) || self.is_suspect && least == most {
            let why = format!("range: {least} to {most} must hold more than the value, {value}");
            return Err(section.wrong_at("range", &why));
        }
        let prior = match section.numbers("prior")?.as_slice() {
            [] => None,
            [one] if *one > 0.0 => Some(*one),
            _ => return Err(section.wrong_at("prior", "prior: allowed is one number above 0")),
        };
        section.finish()?;
        Ok(Number { name, unit, value, range, prior })
    }
}

impl Declared {
    /// What a file says to have this term, numbers to the bit; `table` is `terms` or `suspects`.
    #[must_use]
    pub fn toml(&self, table: &str) -> String {
        let text = |text: &str| toml::Value::from(text).to_string();
        let mut out = format!(
            "[[{table}]]\nname = {}\nplace = {}\nadd = {}\n",
            text(&self.name),
            text(&self.place()),
            text(&self.add)
        );
        for number in &self.numbers {
            let [least, most] = number.range;
            let prior = number.prior.map_or(String::new(), |prior| format!(", prior = {prior:?}"));
            let _ = writeln!(
                out,
                "parameters.{} = {{ unit = {}, value = {:?}, range = [{least:?}, {most:?}]{prior} }}",
                number.name,
                text(&number.unit.text),
                number.value
            );
        }
        for MemoryVariable { name, unit, range: [least, most], start, update, .. } in &self.memory {
            let (unit, start, update) = (text(&unit.text), text(start), text(update));
            let _ = writeln!(
                out,
                "memory.{name} = {{ unit = {unit}, range = [{least:?}, {most:?}], start = {start}, update = {update} }}"
            );
        }
        for table in &self.tables {
            let (name, [x, y]) = (&table.name, &table.written);
            let (x_unit, y_unit) = (text(&table.from.text), text(&table.to.text));
            let _ = writeln!(
                out,
                "tables.{name} = {{ x_unit = {x_unit}, y_unit = {y_unit}, x = {x:?}, y = {y:?} }}"
            );
        }
        if !self.twins.is_empty() {
            let twins: Vec<String> = self.twins.iter().map(|twin| text(twin)).collect();
            let _ = writeln!(out, "twins = [{}]", twins.join(", "));
        }
        out
    }
}
