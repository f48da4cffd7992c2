//! Checks of all expressions: names, numbers of arguments, dimensions, and that nothing depends on itself.

use crate::compile::tapes;
use crate::expression::{Binary, Kind, Place, Wrong};
use crate::file::{Change, Expression, Model, Target};
use crate::names::{DEEPEST_CHAIN, Symbol, chain, function, resolve};
use crate::rows::reads_inputs_alone;
use crate::units::{Dimension, Unit};
use std::collections::HashMap;

/// Checks a model.
pub(crate) fn check(model: &Model) -> Result<(), Wrong> {
    let mut dimensions = Dimensions { model, known: HashMap::new(), open: Vec::new() };
    for index in 0..model.definitions.len() {
        dimensions.definition(index, 0)?;
    }
    for state in &model.states {
        let wanted = state.unit.dimension.over(Dimension::TIME);
        dimensions.expression(
            &state.derivative,
            state.suspect,
            wanted,
            &format!("the rate of {}", state.name),
        )?;
    }
    for memory in &model.memories {
        dimensions.expression(&memory.update, memory.suspect, memory.unit.dimension, &memory.name)?;
    }
    for output in &model.outputs {
        dimensions.expression(&output.value, None, output.unit.dimension, &output.name)?;
    }
    if let Some(condition) = &model.rows.condition {
        dimensions.expression(condition, None, Dimension::NONE, "where")?;
    }
    for expression in model.rows.condition.iter().chain(&model.rows.folds) {
        dimensions.node(expression.root, None)?;
        reads_inputs_alone(model, expression.root)?;
    }
    for (index, suspect) in model.suspects.iter().enumerate() {
        let wanted = match suspect.change {
            Change::Multiply => Dimension::NONE,
            _ => dimensions.target(suspect.target)?,
        };
        dimensions.expression(&suspect.expression, Some(index), wanted, &suspect.name)?;
    }
    let is_suspect = |index: &usize| !model.suspects[*index].is_term;
    let all: Vec<usize> = (0..model.suspects.len()).filter(is_suspect).collect();
    tapes(model, &all).map(|_| ())
}

/// The SI unit of a definition.
pub(crate) fn definition_unit(model: &Model, index: usize) -> Unit {
    let mut dimensions = Dimensions { model, known: HashMap::new(), open: Vec::new() };
    let dimension = dimensions.definition(index, 0).ok().flatten().unwrap_or_default();
    Unit { text: dimension.to_string(), dimension, factor: 1.0 }
}

/// `None` is the dimension of 0, which is any.
type Measure = Option<Dimension>;

struct Dimensions<'a> {
    model: &'a Model,
    known: HashMap<usize, Measure>,
    open: Vec<usize>,
}

impl Dimensions<'_> {
    fn expression(
        &mut self,
        expression: &Expression,
        suspect: Option<usize>,
        wanted: Dimension,
        what: &str,
    ) -> Result<(), Wrong> {
        match self.node(expression.root, suspect)? {
            Some(found) if found != wanted => {
                Err(Wrong::new(expression.at, format!("{what} is in {wanted}, and this is in {found}")))
            }
            _ => Ok(()),
        }
    }

    fn target(&mut self, target: Target) -> Result<Dimension, Wrong> {
        let model = self.model;
        Ok(match target {
            Target::Input(index) => model.inputs[index].unit.dimension,
            Target::State(index) => model.states[index].unit.dimension.over(Dimension::TIME),
            Target::Definition(index) => self.definition(index, 0)?.unwrap_or_default(),
            Target::Output(index) => model.outputs[index].unit.dimension,
        })
    }

    fn definition(&mut self, index: usize, at: usize) -> Result<Measure, Wrong> {
        if let Some(known) = self.known.get(&index) {
            return Ok(*known);
        }
        let definition = &self.model.definitions[index];
        if self.open.contains(&index) {
            return Err(Wrong::new(at, format!("{} depends on itself", definition.name)));
        }
        if self.open.len() >= DEEPEST_CHAIN {
            return Err(Wrong::new(at, chain()));
        }
        self.open.push(index);
        let measure = self.node(definition.value.root, definition.suspect)?;
        self.open.pop();
        self.known.insert(index, measure);
        Ok(measure)
    }

    fn node(&mut self, place: Place, suspect: Option<usize>) -> Result<Measure, Wrong> {
        let model = self.model;
        let node = model.nodes.get(place);
        match &node.kind {
            Kind::Number(value, None) => Ok((*value != 0.0).then_some(Dimension::NONE)),
            Kind::Number(_, Some(unit)) => Ok(Some(unit.dimension)),
            Kind::Name(name) => {
                if let Some(suspect) = suspect.map(|index| &model.suspects[index])
                    && let Target::Output(output) = suspect.target
                    && model.outputs[output].name == *name
                {
                    return Ok(Some(model.outputs[output].unit.dimension));
                }
                Ok(Some(match resolve(model, name, suspect, node.at)? {
                    Symbol::Time => Dimension::TIME,
                    Symbol::Pi => Dimension::NONE,
                    Symbol::Input(index) => model.inputs[index].unit.dimension,
                    Symbol::State(index) => model.states[index].unit.dimension,
                    Symbol::Parameter(index) => model.parameters[index].unit.dimension,
                    Symbol::Memory(index) => model.memories[index].unit.dimension,
                    Symbol::Output(index) => model.outputs[index].unit.dimension,
                    Symbol::Definition(index) => return self.definition(index, node.at),
                }))
            }
            Kind::Negation(inner) => self.node(*inner, suspect),
            Kind::Binary(operator, left, right) => {
                let [a, b] = [self.node(*left, suspect)?, self.node(*right, suspect)?];
                match operator {
                    Binary::Add | Binary::Subtract => same(a, b, node.at, "sum"),
                    Binary::Multiply => Ok(a.zip(b).map(|(a, b)| a.times(b))),
                    Binary::Divide => Ok(a.map(|a| a.over(b.unwrap_or_default()))),
                    Binary::Power => self.power(a, b, *right, node.at),
                    Binary::And | Binary::Or => Ok(Some(Dimension::NONE)),
                    _ => same(a, b, node.at, "comparison").map(|_| Some(Dimension::NONE)),
                }
            }
            Kind::Call(name, arguments) => self.call(name, arguments, node.at, suspect),
        }
    }

    fn power(&self, base: Measure, exponent: Measure, place: Place, at: usize) -> Result<Measure, Wrong> {
        if exponent.is_some_and(|exponent| exponent != Dimension::NONE) {
            return Err(Wrong::new(at, "an exponent has no unit"));
        }
        let Some(base) = base.filter(|base| *base != Dimension::NONE) else { return Ok(base) };
        let number = match &self.model.nodes.get(place).kind {
            Kind::Number(value, None) => Some(*value),
            Kind::Negation(inner) => match &self.model.nodes.get(*inner).kind {
                Kind::Number(value, None) => Some(-value),
                _ => None,
            },
            _ => None,
        };
        let power = number.and_then(|number| base.to_the(number));
        let why = || {
            format!(
                "a value in {base} has a power with a number as exponent alone: divide it by a scale first"
            )
        };
        power.map(Some).ok_or_else(|| Wrong::new(at, why()))
    }

    fn call(
        &mut self,
        name: &str,
        arguments: &[Place],
        at: usize,
        suspect: Option<usize>,
    ) -> Result<Measure, Wrong> {
        let model = self.model;
        let table = model.tables.iter().find(|table| table.name == name);
        let least = match (name, table, function(name)) {
            ("delay", ..) => 2,
            ("not", ..) | (_, Some(_), _) => 1,
            (.., Some((_, least))) => least,
            _ => {
                let known = "abs, sign, min, max, sqrt, exp, log, tanh, sin, cos, atan, if, not, delay, and the tables";
                return Err(Wrong::new(at, format!("'{name}' is no function; known are {known}")));
            }
        };
        let takes_more = matches!(name, "min" | "max");
        if arguments.len() < least || !takes_more && arguments.len() > least {
            let more = if takes_more { " or more" } else { "" };
            return Err(Wrong::new(
                at,
                format!("{name} has {} arguments; it takes {least}{more}", arguments.len()),
            ));
        }
        let measures =
            arguments.iter().map(|argument| self.node(*argument, suspect)).collect::<Result<Vec<_>, _>>()?;
        let needs = |measure: Measure, wanted: Dimension| match measure {
            Some(found) if found != wanted => {
                Err(Wrong::new(at, format!("{name} takes a value in {wanted}, and this is in {found}")))
            }
            _ => Ok(()),
        };
        if let Some(table) = table {
            needs(measures[0], table.from)?;
            return Ok(Some(table.to));
        }
        match name {
            "abs" => Ok(measures[0]),
            "sign" | "not" => Ok(Some(Dimension::NONE)),
            "sqrt" => Ok(measures[0].and_then(|measure| measure.to_the(0.5))),
            "min" | "max" => {
                measures[1..].iter().try_fold(measures[0], |all, more| same(all, *more, at, name))
            }
            "if" => same(measures[1], measures[2], at, name),
            "delay" => needs(measures[1], Dimension::TIME).map(|()| measures[0]),
            _ => needs(measures[0], Dimension::NONE).map(|()| Some(Dimension::NONE)),
        }
    }
}

fn same(a: Measure, b: Measure, at: usize, what: &str) -> Result<Measure, Wrong> {
    match (a, b) {
        (Some(a), Some(b)) if a != b => {
            Err(Wrong::new(at, format!("{what} of a value in {a} and one in {b}")))
        }
        _ => Ok(a.or(b)),
    }
}
