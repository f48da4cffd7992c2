//! Checks of all expressions: names, numbers of arguments, dimensions, and that nothing depends on itself.

use crate::compile::{frictions_hold, tapes};
use crate::file::{Change, Expression, Model, Target};
use crate::file_units::unit_of;
use crate::names::{DEEPEST_CHAIN, Symbol, chain, resolve};
use crate::rows::{reads_inputs_alone, reads_numbers_alone};
use crate::units::{Dimension, Unit};
use expression::constants::constants;
use expression::dimensions::{Dimensions, Measure};
use expression::grammar::{ExpressionError, Kind, Node, NodeId};
use std::collections::HashMap;

pub(crate) fn check(model: &Model) -> Result<(), ExpressionError> {
    let mut dimensions = Checker { model, known: HashMap::new(), open: Vec::new() };
    for index in 0..model.definitions.len() {
        dimensions.definition(index, 0)?;
    }
    for state in &model.states {
        let wanted = state.unit.dimension.over(Dimension::TIME);
        dimensions.check(&state.derivative, state.suspect, wanted, &format!("the rate of {}", state.name))?;
    }
    for memory in &model.memories {
        let (suspect, unit, name) = (memory.suspect, memory.unit.dimension, &memory.name);
        dimensions.check(&memory.update, suspect, unit, name)?;
        if let Some(start) = &memory.start {
            dimensions.check(start, suspect, unit, &format!("the start of {name}"))?;
            reads_numbers_alone(model, start.root, suspect)?;
        }
    }
    for friction in &model.frictions {
        let (unit, name) = (friction.unit.dimension, &friction.name);
        dimensions.check(&friction.sliding, friction.suspect, unit, &format!("sliding of {name}"))?;
        dimensions.check(&friction.breakaway, friction.suspect, unit, &format!("breakaway of {name}"))?;
    }
    for output in &model.outputs {
        dimensions.check(&output.value, None, output.unit.dimension, &output.name)?;
    }
    if let Some(condition) = &model.rows.condition {
        dimensions.check(condition, None, Dimension::NONE, "where")?;
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
        dimensions.check(&suspect.expression, Some(index), wanted, &suspect.name)?;
    }
    let is_suspect = |index: &usize| !model.suspects[*index].is_term;
    let all: Vec<usize> = (0..model.suspects.len()).filter(is_suspect).collect();
    let constants = constants(&model.nodes)?;
    delays_look_back(model, &constants)?;
    frictions_hold(model, &all)?;
    tapes(model, &all).map(|_| ())
}

/// Refuses a delay by a constant below 0, which would read what is still to come.
fn delays_look_back(model: &Model, constants: &[Option<f64>]) -> Result<(), ExpressionError> {
    for node in model.nodes.all() {
        if let Kind::Call(name, arguments) = &node.kind
            && name == "delay"
            && let Some(by) = arguments.get(1)
            && let Some(value) = constants[*by as usize].filter(|value| *value < 0.0)
        {
            let why = format!("delay: {value} s looks into the future: a delay is at least 0");
            return Err(ExpressionError::new(model.nodes.get(*by).at, why));
        }
    }
    Ok(())
}

impl Model {
    /// The unit of a definition, as it follows from what it is made of, in those of the file.
    #[must_use]
    pub fn definition_unit(&self, index: usize) -> Unit {
        let mut dimensions = Checker { model: self, known: HashMap::new(), open: Vec::new() };
        let dimension = dimensions.definition(index, 0).ok().flatten().unwrap_or_default();
        unit_of(self, dimension)
    }
}

/// The unit of a suspect's expression, in those of the file.
pub(crate) fn suspect_unit(model: &Model, index: usize) -> Unit {
    let suspect = &model.suspects[index];
    let dimension = match suspect.change {
        Change::Multiply => Dimension::NONE,
        Change::Add | Change::Replace => target_dimension(model, suspect.target).unwrap_or_default(),
    };
    unit_of(model, dimension)
}

/// The dimension of an expression of the model's own names; that of 0 is none.
pub(crate) fn dimension(model: &Model, root: NodeId) -> Result<Dimension, ExpressionError> {
    let mut dimensions = Checker { model, known: HashMap::new(), open: Vec::new() };
    Ok(dimensions.node(root, None)?.unwrap_or_default())
}

/// The dimension of what stands at a place; of a state that of its rate.
pub(crate) fn target_dimension(model: &Model, target: Target) -> Result<Dimension, ExpressionError> {
    Checker { model, known: HashMap::new(), open: Vec::new() }.target(target)
}

struct Checker<'a> {
    model: &'a Model,
    known: HashMap<usize, Measure>,
    open: Vec<usize>,
}

impl Checker<'_> {
    fn check(
        &mut self,
        expression: &Expression,
        suspect: Option<usize>,
        wanted: Dimension,
        what: &str,
    ) -> Result<(), ExpressionError> {
        self.expression(expression.root, suspect, wanted, (expression.at, what))
    }

    fn target(&mut self, target: Target) -> Result<Dimension, ExpressionError> {
        let model = self.model;
        Ok(match target {
            Target::Input(index) => model.inputs[index].unit.dimension,
            Target::State(index) => model.states[index].unit.dimension.over(Dimension::TIME),
            Target::Definition(index) => self.definition(index, 0)?.unwrap_or_default(),
            Target::Output(index) => model.outputs[index].unit.dimension,
        })
    }

    fn definition(&mut self, index: usize, at: usize) -> Result<Measure, ExpressionError> {
        if let Some(known) = self.known.get(&index) {
            return Ok(*known);
        }
        let definition = &self.model.definitions[index];
        if self.open.contains(&index) {
            return Err(ExpressionError::new(at, format!("{} depends on itself", definition.name)));
        }
        if self.open.len() >= DEEPEST_CHAIN {
            return Err(ExpressionError::new(at, chain()));
        }
        self.open.push(index);
        let mut measure = self.node(definition.value.root, definition.suspect)?;
        // What a suspect puts in place of a bare 0 has one unit.
        if self.model.suspects.iter().any(|suspect| suspect.target == Target::Definition(index)) {
            measure = Some(measure.unwrap_or_default());
        }
        self.open.pop();
        self.known.insert(index, measure);
        Ok(measure)
    }
}

impl Dimensions for Checker<'_> {
    /// The suspect that the expression belongs to.
    type Scope = Option<usize>;

    fn at(&self, place: NodeId) -> Node {
        self.model.nodes.get(place).clone()
    }

    fn named(&mut self, name: &str, at: usize, suspect: Option<usize>) -> Result<Measure, ExpressionError> {
        let model = self.model;
        Ok(Some(match resolve(model, name, suspect, at)? {
            Symbol::Time => Dimension::TIME,
            Symbol::Pi => Dimension::NONE,
            Symbol::Input(index) => model.inputs[index].unit.dimension,
            Symbol::State(index) => model.states[index].unit.dimension,
            Symbol::Parameter(index) => model.parameters[index].unit.dimension,
            Symbol::Memory(index) => model.memories[index].unit.dimension,
            Symbol::Friction(index) => model.frictions[index].unit.dimension,
            Symbol::Output(index) => model.outputs[index].unit.dimension,
            Symbol::Before(suspect) => self.target(model.suspects[suspect].target)?,
            Symbol::Definition(index) => return self.definition(index, at),
        }))
    }

    fn arguments(&self, name: &str) -> Option<usize> {
        let is_table = self.model.tables.iter().any(|table| table.name == name);
        if name == "delay" { Some(2) } else { is_table.then_some(1) }
    }

    fn in_units(&self, dimension: Dimension) -> String {
        unit_of(self.model, dimension).text
    }

    fn functions(&self) -> &'static str {
        ", delay, and the tables"
    }

    fn called(&mut self, name: &str, measures: &[Measure], at: usize) -> Result<Measure, ExpressionError> {
        if let Some(table) = self.model.tables.iter().find(|table| table.name == name) {
            self.takes(name, measures[0], table.from.dimension, at)?;
            return Ok(Some(table.to.dimension));
        }
        self.takes(name, measures[1], Dimension::TIME, at).map(|()| measures[0])
    }
}
