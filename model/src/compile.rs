//! From expressions to tapes, with suspects in their places.
//!
//! ```text
//!   equation of its file ──► + the suspects that are switched on, in their order ──► tape of rates, outputs, memories
//! ```

use crate::file::{Change, Expression, Memory, Model, Parameter, State, Suspect, Target};
use crate::inputs::Inputs;
use crate::names::{DEEPEST_CHAIN, Symbol, chain, name_of, resolve};
use crate::tape::{Builder, Code, LeafLayout, Register, Registers, Tape};
use expression::compile::Compile;
use expression::grammar::{ExpressionError, Kind, Node, NodeId};
use expression::past::NONE;
use std::collections::HashMap;

/// The tapes of a model with some suspects.
#[derive(Clone, Debug)]
pub(crate) struct Tapes {
    pub(crate) rates: Tape,
    pub(crate) outputs: Tape,
    pub(crate) updates: Tape,
    /// Starts of memories, expressions of parameters; empty where all are numbers of the file.
    pub(crate) starts: Option<Tape>,
    /// Of each friction that is there the force that holds its speed, that at which it breaks away, and by how much a unit of
    /// force brakes it.
    pub(crate) guards: Tape,
    /// States, memories and frictions that are there, in the order of the tapes' results.
    pub(crate) states: Vec<usize>,
    pub(crate) memories: Vec<usize>,
    pub(crate) frictions: Vec<usize>,
}

fn leaves(model: &Model) -> LeafLayout {
    LeafLayout {
        inputs: model.inputs.len(),
        states: model.states.len(),
        parameters: model.parameters.len(),
        memories: model.memories.len() + model.frictions.len(),
    }
}

/// Where the direction of a friction stands: 1 or -1 where it slides, 0 where it holds.
pub(crate) fn direction_of(leaves: LeafLayout, model: &Model, friction: usize) -> Register {
    leaves.memory(model.memories.len() + friction)
}

/// A tape whose results are registers of a compiler of its own.
fn tape<'a>(
    model: &'a Model,
    suspects: &'a [usize],
    results: impl FnOnce(&mut Compiler<'a>) -> Result<Vec<Register>, ExpressionError>,
) -> Result<Tape, ExpressionError> {
    let mut compiler = Compiler::new(model, suspects);
    let results = results(&mut compiler)?;
    Ok(compiler.builder.tape(&results, model.tables.iter().map(|table| table.curve.clone()).collect()))
}

pub(crate) fn tapes(model: &Model, suspects: &[usize]) -> Result<Tapes, ExpressionError> {
    let is_there = |owner: Option<usize>| model.is_there(owner, suspects);
    let states: Vec<usize> =
        (0..model.states.len()).filter(|index| is_there(model.states[*index].suspect)).collect();
    let memories: Vec<usize> =
        (0..model.memories.len()).filter(|index| is_there(model.memories[*index].suspect)).collect();
    let frictions: Vec<usize> =
        (0..model.frictions.len()).filter(|index| is_there(model.frictions[*index].suspect)).collect();
    let scope = |suspect| Scope { suspect, before: None };
    let rates = tape(model, suspects, |compiler| states.iter().map(|state| compiler.rate(*state)).collect())?;
    let outputs = tape(model, suspects, |compiler| {
        (0..model.outputs.len()).map(|output| compiler.symbol(Symbol::Output(output), 0)).collect()
    })?;
    let of_memories = || memories.iter().map(|index| &model.memories[*index]);
    let updates = tape(model, suspects, |compiler| {
        of_memories().map(|memory| compiler.node(memory.update.root, scope(memory.suspect))).collect()
    })?;
    let starts = tape(model, suspects, |compiler| {
        let start = |memory: &Memory| match &memory.start {
            Some(start) => compiler.node(start.root, scope(memory.suspect)),
            None => Ok(compiler.builder.constant(memory.start_si)),
        };
        of_memories().map(start).collect()
    })?;
    let starts = of_memories().any(|memory| memory.start.is_some()).then_some(starts);
    let guards = tape(model, suspects, |compiler| {
        let guards = frictions.iter().map(|friction| compiler.guards(*friction));
        Ok(guards.collect::<Result<Vec<_>, _>>()?.concat())
    })?;
    Ok(Tapes { rates, outputs, updates, starts, guards, states, memories, frictions })
}

/// Whether the force of each friction stands in the equation of its speed, and in a way that says which force holds it.
pub(crate) fn frictions_hold(model: &Model, suspects: &[usize]) -> Result<(), ExpressionError> {
    for (index, friction) in model.frictions.iter().enumerate() {
        let mut compiler = Compiler::new(model, suspects);
        let force = direction_of(compiler.builder.leaves, model, index);
        let rate = compiler.rate_under_force((index, force))?;
        let (name, state) = (&friction.name, &model.states[friction.velocity].name);
        let why = match compiler.builder.degree(rate, force) {
            Some(0) => format!("the equation of {state} does not read {name}, which is to hold it"),
            Some(_) => continue,
            None => {
                format!("the equation of {state} is not linear in {name}: no force is known that holds it")
            }
        };
        return Err(ExpressionError::new(model.states[friction.velocity].derivative.at, why));
    }
    Ok(())
}

impl Model {
    /// Values of an expression of inputs and fixed numbers, at each sample.
    ///
    /// # Panics
    /// For an expression that was not checked with this model.
    #[must_use]
    pub fn at_samples(&self, expression: &Expression, inputs: &Inputs<'_>) -> Vec<f64> {
        let scope = Scope { suspect: None, before: None };
        let tape = tape(self, &[], |compiler| Ok(vec![compiler.node(expression.root, scope)?]))
            .expect("it was checked when the file was read");
        let leaves = tape.leaves;
        let mut registers = Registers::new(&tape, 0, |_| false);
        for (index, parameter) in self.parameters.iter().enumerate() {
            registers.set(leaves.parameter(index), parameter.values_si[0]);
        }
        tape.prepare(&mut registers);
        let value = |(row, time_s): (usize, &f64)| {
            registers.set(0, *time_s);
            for (index, samples) in inputs.samples_si.iter().enumerate() {
                registers.set(leaves.input(index), samples[row]);
            }
            tape.evaluate(&mut registers, inputs, &NONE);
            registers.value(tape.result(0))
        };
        inputs.time_s.iter().enumerate().map(value).collect()
    }
}

/// Whether a suspect at an input is one that delays it.
pub(crate) fn delays_its_place(model: &Model, suspect: usize) -> bool {
    let is_place = |argument: NodeId| match &model.nodes.get(argument).kind {
        Kind::Name(name) => resolve(model, name, Some(suspect), 0) == Ok(Symbol::Before(suspect)),
        _ => false,
    };
    let delays = |node: &Node| match &node.kind {
        Kind::Call(name, arguments) => name == "delay" && is_place(arguments[0]),
        _ => false,
    };
    let Suspect { target, expression, .. } = &model.suspects[suspect];
    matches!(target, Target::Input(_)) && model.nodes.tree(expression.root).any(delays)
}

/// Where an expression stands: the suspect whose own names it may use, and the value that its place has without it.
#[derive(Clone, Copy)]
struct Scope {
    suspect: Option<usize>,
    before: Option<Register>,
}

struct Compiler<'a> {
    model: &'a Model,
    suspects: &'a [usize],
    builder: Builder,
    known: HashMap<Symbol, Register>,
    /// Symbols that are being computed: one that comes again depends on itself.
    open: Vec<Symbol>,
    /// The friction of whose speed the rate is computed, with its assumed force; and the delay at which it is computed.
    held: Option<(usize, Register)>,
    held_delay: Option<Register>,
    instant: DelayedInstant,
}

/// The earlier instant at which the argument of a delay is computed, with all that it reads.
#[derive(Default)]
struct DelayedInstant {
    /// Register of the delay, and the byte of the file at which it stands; `None` for the present.
    delay: Option<(Register, usize)>,
    /// Registers of symbols that were computed already, for each delay.
    known: HashMap<(Register, Symbol), Register>,
    /// Delays that were computed: delays of delays multiply.
    count: usize,
}

/// Most delays of a model, those within delays counted each time.
const MOST_DELAYS: usize = 1000;

impl<'a> Compiler<'a> {
    fn new(model: &'a Model, suspects: &'a [usize]) -> Self {
        let builder = Builder::new(leaves(model));
        let instant = DelayedInstant::default();
        let (known, open) = (HashMap::new(), Vec::new());
        Self { model, suspects, builder, known, open, held: None, held_delay: None, instant }
    }

    /// A state, a memory or the direction of a friction, at the instant that is computed.
    fn leaf_at_instant(&mut self, leaf: Register, name: &str) -> Result<Register, ExpressionError> {
        let Some((by, at)) = self.instant.delay else { return Ok(leaf) };
        if !self.builder.is_constant(by) {
            let why = format!("delay: the time by which {name} is late reads parameters and numbers alone");
            return Err(ExpressionError::new(at, why));
        }
        Ok(self.builder.push(Code::DelayedLeaf(leaf), &[by]))
    }

    fn rate(&mut self, state: usize) -> Result<Register, ExpressionError> {
        let model = self.model;
        let State { derivative, suspect, .. } = &model.states[state];
        let base = self.node(derivative.root, Scope { suspect: *suspect, before: None })?;
        let rate = self.with_suspects(Target::State(state), base, None)?;
        let holds = |index: &usize| {
            let friction = &model.frictions[*index];
            friction.velocity == state && model.is_there(friction.suspect, self.suspects)
        };
        match (0..model.frictions.len()).find(holds) {
            // Exactly at rest, where the sum of forces would leave a rounding error.
            Some(friction) if self.held.is_none() => {
                let direction = direction_of(self.builder.leaves, model, friction);
                let direction = self.leaf_at_instant(direction, &model.frictions[friction].name)?;
                let zero = self.builder.constant(0.0);
                Ok(self.builder.push(Code::Select, &[direction, rate, zero]))
            }
            _ => Ok(rate),
        }
    }

    /// The rate of a friction's speed under an assumed friction force.
    fn rate_under_force(&mut self, held: (usize, Register)) -> Result<Register, ExpressionError> {
        let known = core::mem::take(&mut self.known);
        let known_at_instant = core::mem::take(&mut self.instant.known);
        let open = core::mem::take(&mut self.open);
        self.held = Some(held);
        self.held_delay = self.instant.delay.map(|(by, _)| by);
        let rate = self.rate(self.model.frictions[held.0].velocity);
        self.held = None;
        (self.known, self.instant.known, self.open) = (known, known_at_instant, open);
        rate
    }

    /// The force that holds a friction's speed, and what a unit of force does to its rate.
    fn holding_force(&mut self, friction: usize) -> Result<[Register; 2], ExpressionError> {
        let [zero, one] = [0.0, 1.0].map(|force| self.builder.constant(force));
        let without = self.rate_under_force((friction, zero))?;
        let with_one = self.rate_under_force((friction, one))?;
        let braked = self.builder.push(Code::Subtract, &[without, with_one]);
        Ok([self.builder.push(Code::Divide, &[without, braked]), braked])
    }

    fn guards(&mut self, friction: usize) -> Result<[Register; 3], ExpressionError> {
        let [holding, braked] = self.holding_force(friction)?;
        let element = &self.model.frictions[friction];
        let scope = Scope { suspect: element.suspect, before: None };
        let sliding = self.node(element.sliding.root, scope)?;
        let breakaway = self.node(element.breakaway.root, scope)?;
        let zero = self.builder.constant(0.0);
        let largest = self.builder.push(Code::Max, &[breakaway, sliding]);
        Ok([holding, self.builder.push(Code::Max, &[largest, zero]), braked])
    }

    /// The force of a friction: what holds, or the sliding force against the motion.
    fn force(&mut self, friction: usize, at: usize) -> Result<Register, ExpressionError> {
        let model = self.model;
        let element = &model.frictions[friction];
        let by = self.instant.delay.map(|(by, _)| by);
        match self.held {
            Some((held, _)) if by != self.held_delay => {
                let state = &model.states[model.frictions[held].velocity].name;
                let why = format!("the equation of {state} reads an earlier {}", element.name);
                return Err(ExpressionError::new(at, why));
            }
            Some((held, force)) if held == friction => return Ok(force),
            Some((held, _)) => {
                let state = &model.states[model.frictions[held].velocity].name;
                let why = format!("the equation of {state} reads {} beside its own friction", element.name);
                return Err(ExpressionError::new(at, why));
            }
            None => {}
        }
        let direction = direction_of(self.builder.leaves, model, friction);
        let direction = self.leaf_at_instant(direction, &element.name)?;
        let [holding, _] = self.holding_force(friction)?;
        let sliding = self.node(element.sliding.root, Scope { suspect: element.suspect, before: None })?;
        let sliding = self.builder.push(Code::Multiply, &[direction, sliding]);
        Ok(self.builder.push(Code::Select, &[direction, sliding, holding]))
    }

    /// What the file says of a place, without terms and suspects; of a state it is its value, not its rate.
    fn base(&mut self, target: Target) -> Result<Register, ExpressionError> {
        let model = self.model;
        let (root, suspect) = match target {
            Target::Input(index) => {
                return Ok(match self.instant.delay {
                    None => self.builder.leaves.input(index),
                    Some((by, _)) => self.builder.push(Code::DelayedInput(index as u16), &[by]),
                });
            }
            Target::State(index) => {
                let leaf = self.builder.leaves.state(index);
                return self.leaf_at_instant(leaf, &model.states[index].name);
            }
            Target::Definition(index) => {
                let definition = &model.definitions[index];
                (definition.value.root, definition.suspect)
            }
            Target::Output(index) => {
                let output = &model.outputs[index];
                (output.value.root, output.suspect)
            }
        };
        self.node(root, Scope { suspect, before: None })
    }

    fn target_value(&mut self, target: Target, until: Option<usize>) -> Result<Register, ExpressionError> {
        let base = self.base(target)?;
        self.with_suspects(target, base, until)
    }

    /// A value with the suspects at its place, or with those that act before this one.
    fn with_suspects(
        &mut self,
        target: Target,
        base: Register,
        until: Option<usize>,
    ) -> Result<Register, ExpressionError> {
        let mut value = base;
        for index in self.model.changes_of(target, self.suspects) {
            let suspect = &self.model.suspects[index];
            if until == Some(index) {
                break;
            }
            let scope = Scope { suspect: Some(index), before: Some(value) };
            let change = self.node(suspect.expression.root, scope)?;
            value = match suspect.change {
                Change::Add => self.builder.push(Code::Add, &[value, change]),
                Change::Multiply => self.builder.push(Code::Multiply, &[value, change]),
                Change::Replace => change,
            };
        }
        Ok(value)
    }

    fn symbol(&mut self, symbol: Symbol, at: usize) -> Result<Register, ExpressionError> {
        let leaves = self.builder.leaves;
        let known = match &self.instant.delay {
            None => self.known.get(&symbol),
            Some((by, _)) => self.instant.known.get(&(*by, symbol)),
        };
        if let Some(register) = known {
            return Ok(*register);
        }
        if let Some(first) = self.open.iter().position(|open| *open == symbol) {
            let circle: Vec<&str> =
                self.open[first..].iter().map(|open| name_of(self.model, *open)).collect();
            return Err(ExpressionError::new(
                at,
                format!("{} depends on itself by way of {}", circle[0], circle.join(", ")),
            ));
        }
        if self.open.len() >= DEEPEST_CHAIN {
            return Err(ExpressionError::new(at, chain()));
        }
        self.open.push(symbol);
        let register = match symbol {
            Symbol::Time => match &self.instant.delay {
                None => 0,
                Some((by, _)) => self.builder.push(Code::Subtract, &[0, *by]),
            },
            Symbol::Pi => self.builder.constant(core::f64::consts::PI),
            Symbol::Input(index) => self.target_value(Target::Input(index), None)?,
            Symbol::State(index) => self.leaf_at_instant(leaves.state(index), name_of(self.model, symbol))?,
            Symbol::Parameter(index) => leaves.parameter(index),
            Symbol::Memory(index) => {
                self.leaf_at_instant(leaves.memory(index), name_of(self.model, symbol))?
            }
            Symbol::Friction(index) => self.force(index, at)?,
            Symbol::Definition(index) => self.target_value(Target::Definition(index), None)?,
            Symbol::Output(index) => self.target_value(Target::Output(index), None)?,
            Symbol::Before(suspect) => {
                self.target_value(self.model.suspects[suspect].target, Some(suspect))?
            }
        };
        self.open.pop();
        match &self.instant.delay {
            None => self.known.insert(symbol, register),
            Some((by, _)) => self.instant.known.insert((*by, symbol), register),
        };
        Ok(register)
    }

    /// Delay, clamped at 0. A parameter that may be negative is an error; one whose range is at least 0 needs no clamp.
    fn duration(&mut self, by: NodeId, scope: Scope) -> Result<Register, ExpressionError> {
        let model = self.model;
        let node = model.nodes.get(by);
        let register = self.node(by, scope)?;
        if let Kind::Name(name) = &node.kind
            && let Symbol::Parameter(index) = resolve(model, name, scope.suspect, node.at)?
        {
            let Parameter { unit, values_si, range_si: [least, _], .. } = &model.parameters[index];
            let smallest =
                values_si.iter().copied().fold(if least.is_finite() { *least } else { 0.0 }, f64::min);
            if smallest < 0.0 {
                let (smallest, unit) = ((smallest / unit.factor) as f32, &unit.text);
                let why = format!("delay: '{name}' may be {smallest} {unit}: a delay is at least 0");
                return Err(ExpressionError::new(node.at, why));
            }
            if *least >= 0.0 {
                return Ok(register);
            }
        }
        let zero = self.builder.constant(0.0);
        Ok(self.builder.push(Code::Max, &[register, zero]))
    }

    /// An expression some time earlier, with the terms and suspects that change what it reads.
    fn delayed(
        &mut self,
        [delayed, by]: [NodeId; 2],
        at: usize,
        scope: Scope,
    ) -> Result<Register, ExpressionError> {
        let late_at = self.model.nodes.get(by).at;
        self.instant.count += 1;
        if self.instant.count > MOST_DELAYS {
            return Err(ExpressionError::new(
                at,
                format!("more than {MOST_DELAYS} delays, those of delays included"),
            ));
        }
        let by = self.duration(by, scope)?;
        let outer = self.instant.delay.take();
        self.instant.delay = Some(match outer {
            None => (by, late_at),
            Some((outer, outer_at)) => {
                let is_outer = !self.builder.is_constant(outer);
                let both = self.builder.push(Code::Add, &[outer, by]);
                (both, if is_outer { outer_at } else { late_at })
            }
        });
        let register = self.node(delayed, Scope { before: None, ..scope });
        self.instant.delay = outer;
        register
    }
}

impl Compile for Compiler<'_> {
    type Scope = Scope;

    fn at(&self, place: NodeId) -> Node {
        self.model.nodes.get(place).clone()
    }

    fn builder(&mut self) -> &mut Builder {
        &mut self.builder
    }

    fn named(&mut self, name: &str, at: usize, scope: Scope) -> Result<Register, ExpressionError> {
        match (resolve(self.model, name, scope.suspect, at)?, scope.before) {
            (Symbol::Before(_), Some(before)) => Ok(before),
            (symbol, _) => self.symbol(symbol, at),
        }
    }

    fn called(
        &mut self,
        name: &str,
        arguments: &[NodeId],
        at: usize,
        scope: Scope,
    ) -> Result<Option<Register>, ExpressionError> {
        if name == "delay" {
            return self.delayed([arguments[0], arguments[1]], at, scope).map(Some);
        }
        let Some(table) = self.model.tables.iter().position(|table| table.name == name) else {
            return Ok(None);
        };
        let operand = self.node(arguments[0], scope)?;
        Ok(Some(self.builder.push(Code::Table(table as u16), &[operand])))
    }
}
