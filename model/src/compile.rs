//! From expressions to tapes, with suspects in their places.
//!
//! ```text
//!   equation of its file ──► + the suspects that are switched on, in their order ──► tape of rates, outputs, memories
//! ```

use crate::file::{Change, Expression, Model, State, Target};
use crate::inputs::Inputs;
use crate::names::{DEEPEST_CHAIN, Symbol, chain, name_of, resolve};
use crate::tape::{Builder, Code, Leaves, Register, Registers, Tape};
use expression::compile::Compile;
use expression::grammar::{Kind, Node, Place, Wrong};
use std::collections::HashMap;

/// The tapes of a model with some suspects.
#[derive(Clone, Debug)]
pub(crate) struct Tapes {
    pub(crate) rates: Tape,
    pub(crate) outputs: Tape,
    pub(crate) updates: Tape,
    /// Of each friction that is there the force that holds its speed, that at which it breaks away, and by how much a unit of
    /// force brakes it.
    pub(crate) guards: Tape,
    /// States, memories and frictions that are there, in the order of the tapes' results.
    pub(crate) states: Vec<usize>,
    pub(crate) memories: Vec<usize>,
    pub(crate) frictions: Vec<usize>,
}

fn leaves(model: &Model) -> Leaves {
    Leaves {
        inputs: model.inputs.len(),
        states: model.states.len(),
        parameters: model.parameters.len(),
        memories: model.memories.len() + model.frictions.len(),
    }
}

/// Where the direction of a friction stands: 1 or -1 where it slides, 0 where it holds.
pub(crate) fn direction_of(leaves: Leaves, model: &Model, friction: usize) -> Register {
    leaves.memory(model.memories.len() + friction)
}

/// The tapes with these suspects.
pub(crate) fn tapes(model: &Model, suspects: &[usize]) -> Result<Tapes, Wrong> {
    let is_there = |owner: Option<usize>| model.is_there(owner, suspects);
    let states: Vec<usize> =
        (0..model.states.len()).filter(|index| is_there(model.states[*index].suspect)).collect();
    let memories: Vec<usize> =
        (0..model.memories.len()).filter(|index| is_there(model.memories[*index].suspect)).collect();
    let frictions: Vec<usize> =
        (0..model.frictions.len()).filter(|index| is_there(model.frictions[*index].suspect)).collect();
    let curves = || model.tables.iter().map(|table| table.curve.clone()).collect();
    let mut compiler = Compiler::new(model, suspects);
    let rates = states.iter().map(|state| compiler.rate(*state)).collect::<Result<Vec<_>, _>>()?;
    let rates = compiler.builder.tape(&rates, curves());
    let mut compiler = Compiler::new(model, suspects);
    let outputs = (0..model.outputs.len()).map(|output| compiler.symbol(Symbol::Output(output), 0));
    let outputs = outputs.collect::<Result<Vec<_>, _>>()?;
    let outputs = compiler.builder.tape(&outputs, curves());
    let mut compiler = Compiler::new(model, suspects);
    let updates = memories.iter().map(|index| {
        let memory = &model.memories[*index];
        compiler.node(memory.update.root, Scope { suspect: memory.suspect, before: None })
    });
    let updates = updates.collect::<Result<Vec<_>, _>>()?;
    let updates = compiler.builder.tape(&updates, curves());
    let mut compiler = Compiler::new(model, suspects);
    let guards = frictions.iter().map(|friction| compiler.guards(*friction));
    let guards = guards.collect::<Result<Vec<_>, _>>()?.concat();
    let guards = compiler.builder.tape(&guards, curves());
    Ok(Tapes { rates, outputs, updates, guards, states, memories, frictions })
}

/// Whether the force of each friction stands in the equation of its speed, and in a way that says which force holds it.
pub(crate) fn frictions_hold(model: &Model, suspects: &[usize]) -> Result<(), Wrong> {
    for (index, friction) in model.frictions.iter().enumerate() {
        let mut compiler = Compiler::new(model, suspects);
        let force = direction_of(compiler.builder.leaves(), model, index);
        let rate = compiler.held((index, force))?;
        let (name, state) = (&friction.name, &model.states[friction.velocity].name);
        let why = match compiler.builder.degree(rate, force) {
            Some(0) => format!("the equation of {state} does not read {name}, which is to hold it"),
            Some(_) => continue,
            None => {
                format!("the equation of {state} is not linear in {name}: no force is known that holds it")
            }
        };
        return Err(Wrong::new(model.states[friction.velocity].derivative.at, why));
    }
    Ok(())
}

/// Values of an expression of inputs and fixed numbers at each sample.
pub(crate) fn at_samples(model: &Model, expression: &Expression, inputs: &Inputs<'_>) -> Vec<f64> {
    let mut compiler = Compiler::new(model, &[]);
    let result = compiler.node(expression.root, Scope { suspect: None, before: None });
    let result = result.expect("it was checked when the file was read");
    let curves = model.tables.iter().map(|table| table.curve.clone()).collect();
    let tape = compiler.builder.tape(&[result], curves);
    let leaves = tape.leaves;
    let mut registers = Registers::new(&tape, 0, |_| false);
    for (index, parameter) in model.parameters.iter().enumerate() {
        registers.set(leaves.parameter(index), parameter.values_si[0]);
    }
    tape.prepare(&mut registers);
    let value = |(row, time_s): (usize, &f64)| {
        registers.set(0, *time_s);
        for (index, samples) in inputs.samples_si.iter().enumerate() {
            registers.set(leaves.input(index), samples[row]);
        }
        tape.evaluate(&mut registers, inputs);
        registers.value(tape.result(0))
    };
    inputs.time_s.iter().enumerate().map(value).collect()
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
    /// The friction of whose speed the rate is computed, and the force that it has there.
    held: Option<(usize, Register)>,
}

impl<'a> Compiler<'a> {
    fn new(model: &'a Model, suspects: &'a [usize]) -> Self {
        let builder = Builder::new(leaves(model));
        Self { model, suspects, builder, known: HashMap::new(), open: Vec::new(), held: None }
    }

    fn rate(&mut self, state: usize) -> Result<Register, Wrong> {
        let model = self.model;
        let State { derivative, suspect, .. } = &model.states[state];
        let base = self.node(derivative.root, Scope { suspect: *suspect, before: None })?;
        let rate = self.changed(Target::State(state), base, None)?;
        let holds = |index: &usize| {
            let friction = &model.frictions[*index];
            friction.velocity == state && model.is_there(friction.suspect, self.suspects)
        };
        match (0..model.frictions.len()).find(holds) {
            // Exactly at rest, where the sum of forces would leave a rounding error.
            Some(friction) if self.held.is_none() => {
                let direction = direction_of(self.builder.leaves(), model, friction);
                let zero = self.builder.constant(0.0);
                Ok(self.builder.push(Code::Select, &[direction, rate, zero]))
            }
            _ => Ok(rate),
        }
    }

    /// The rate of a friction's speed where this is its force.
    fn held(&mut self, held: (usize, Register)) -> Result<Register, Wrong> {
        let known = core::mem::take(&mut self.known);
        let open = core::mem::take(&mut self.open);
        self.held = Some(held);
        let rate = self.rate(self.model.frictions[held.0].velocity);
        self.held = None;
        (self.known, self.open) = (known, open);
        rate
    }

    /// The force that holds a friction's speed, and what a unit of force does to its rate.
    fn holding(&mut self, friction: usize) -> Result<[Register; 2], Wrong> {
        let [zero, one] = [0.0, 1.0].map(|force| self.builder.constant(force));
        let without = self.held((friction, zero))?;
        let with_one = self.held((friction, one))?;
        let braked = self.builder.push(Code::Subtract, &[without, with_one]);
        Ok([self.builder.push(Code::Divide, &[without, braked]), braked])
    }

    fn guards(&mut self, friction: usize) -> Result<[Register; 3], Wrong> {
        let [holding, braked] = self.holding(friction)?;
        let element = &self.model.frictions[friction];
        let scope = Scope { suspect: element.suspect, before: None };
        let sliding = self.node(element.sliding.root, scope)?;
        let breakaway = self.node(element.breakaway.root, scope)?;
        let zero = self.builder.constant(0.0);
        let largest = self.builder.push(Code::Max, &[breakaway, sliding]);
        Ok([holding, self.builder.push(Code::Max, &[largest, zero]), braked])
    }

    /// The force of a friction: what holds, or the sliding force against the motion.
    fn force(&mut self, friction: usize, at: usize) -> Result<Register, Wrong> {
        let model = self.model;
        let element = &model.frictions[friction];
        match self.held {
            Some((held, force)) if held == friction => return Ok(force),
            Some((held, _)) => {
                let state = &model.states[model.frictions[held].velocity].name;
                let why = format!("the equation of {state} reads {} beside its own friction", element.name);
                return Err(Wrong::new(at, why));
            }
            None => {}
        }
        let direction = direction_of(self.builder.leaves(), model, friction);
        let [holding, _] = self.holding(friction)?;
        let sliding = self.node(element.sliding.root, Scope { suspect: element.suspect, before: None })?;
        let sliding = self.builder.push(Code::Multiply, &[direction, sliding]);
        Ok(self.builder.push(Code::Select, &[direction, sliding, holding]))
    }

    /// What the file says of a place, without terms and suspects; of a state it is its value, not its rate.
    fn base(&mut self, target: Target) -> Result<Register, Wrong> {
        let model = self.model;
        let (root, suspect) = match target {
            Target::Input(index) => return Ok(self.builder.leaves().input(index)),
            Target::State(index) => return Ok(self.builder.leaves().state(index)),
            Target::Definition(index) => {
                let definition = &model.definitions[index];
                (definition.value.root, definition.suspect)
            }
            Target::Output(index) => (model.outputs[index].value.root, None),
        };
        self.node(root, Scope { suspect, before: None })
    }

    fn whole(&mut self, target: Target, until: Option<usize>) -> Result<Register, Wrong> {
        let base = self.base(target)?;
        self.changed(target, base, until)
    }

    /// A value with the suspects at its place, or with those that act before this one.
    fn changed(&mut self, target: Target, base: Register, until: Option<usize>) -> Result<Register, Wrong> {
        let mut value = base;
        let terms = (0..self.model.suspects.len()).filter(|index| self.model.suspects[*index].is_term);
        for index in terms.chain(self.suspects.iter().copied()) {
            let suspect = &self.model.suspects[index];
            if until == Some(index) {
                break;
            }
            if suspect.target != target {
                continue;
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

    fn symbol(&mut self, symbol: Symbol, at: usize) -> Result<Register, Wrong> {
        let leaves = self.builder.leaves();
        if let Some(register) = self.known.get(&symbol) {
            return Ok(*register);
        }
        if let Some(first) = self.open.iter().position(|open| *open == symbol) {
            let circle: Vec<&str> =
                self.open[first..].iter().map(|open| name_of(self.model, *open)).collect();
            return Err(Wrong::new(
                at,
                format!("{} depends on itself by way of {}", circle[0], circle.join(", ")),
            ));
        }
        if self.open.len() >= DEEPEST_CHAIN {
            return Err(Wrong::new(at, chain()));
        }
        self.open.push(symbol);
        let register = match symbol {
            Symbol::Time => 0,
            Symbol::Pi => self.builder.constant(core::f64::consts::PI),
            Symbol::Input(index) => self.whole(Target::Input(index), None)?,
            Symbol::State(index) => leaves.state(index),
            Symbol::Parameter(index) => leaves.parameter(index),
            Symbol::Memory(index) => leaves.memory(index),
            Symbol::Friction(index) => self.force(index, at)?,
            Symbol::Definition(index) => self.whole(Target::Definition(index), None)?,
            Symbol::Output(index) => self.whole(Target::Output(index), None)?,
            Symbol::Before(suspect) => self.whole(self.model.suspects[suspect].target, Some(suspect))?,
        };
        self.open.pop();
        self.known.insert(symbol, register);
        Ok(register)
    }
}

impl Compile for Compiler<'_> {
    type Scope = Scope;

    fn at(&self, place: Place) -> Node {
        self.model.nodes.get(place).clone()
    }

    fn builder(&mut self) -> &mut Builder {
        &mut self.builder
    }

    fn named(&mut self, name: &str, at: usize, scope: Scope) -> Result<Register, Wrong> {
        match (resolve(self.model, name, scope.suspect, at)?, scope.before) {
            (Symbol::Before(_), Some(before)) => Ok(before),
            (symbol, _) => self.symbol(symbol, at),
        }
    }

    fn called(
        &mut self,
        name: &str,
        arguments: &[Place],
        at: usize,
        scope: Scope,
    ) -> Result<Option<Register>, Wrong> {
        if name == "delay" {
            let Kind::Name(input) = &self.model.nodes.get(arguments[0]).kind else {
                return Err(Wrong::new(at, "delay: the first argument is the name of an input"));
            };
            let input = self.model.inputs.iter().position(|one| one.name == *input);
            let Some(input) = input else {
                return Err(Wrong::new(at, "delay: the first argument is the name of an input"));
            };
            let earlier = self.node(arguments[1], scope)?;
            return Ok(Some(self.builder.push(Code::Delayed(input as u16), &[earlier])));
        }
        let Some(table) = self.model.tables.iter().position(|table| table.name == name) else {
            return Ok(None);
        };
        let operand = self.node(arguments[0], scope)?;
        Ok(Some(self.builder.push(Code::Table(table as u16), &[operand])))
    }
}
