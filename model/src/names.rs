//! What names in expressions mean: quantities of the model, and functions.

use crate::file::{Model, Target};
use expression::grammar::ExpressionError;

/// Definitions that stand in each other; with the depth of each it bounds the stack.
pub(crate) const DEEPEST_CHAIN: usize = 32;

pub(crate) fn chain() -> String {
    format!("definitions depend on each other more than {DEEPEST_CHAIN} deep: write one of them out")
}

/// What a name means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Symbol {
    Time,
    Pi,
    Input(usize),
    State(usize),
    Parameter(usize),
    Memory(usize),
    /// The force of dry friction.
    Friction(usize),
    Definition(usize),
    Output(usize),
    /// What the place of a suspect is without it.
    Before(usize),
}

/// Before a name that the suspect of a library gives to a number, state or memory of its own: no text has it, so that it means
/// nothing else even where the model has a name that reads the same.
const SUSPECT_MARK: char = '#';

/// Such a name.
pub(crate) fn marked_name(name: &str) -> String {
    format!("{SUSPECT_MARK}{name}")
}

pub(crate) fn name_of(model: &Model, symbol: Symbol) -> &str {
    match symbol {
        Symbol::Time => "t",
        Symbol::Pi => "pi",
        Symbol::Input(index) => &model.inputs[index].name,
        Symbol::State(index) => &model.states[index].name,
        Symbol::Parameter(index) => &model.parameters[index].name,
        Symbol::Memory(index) => &model.memories[index].name,
        Symbol::Friction(index) => &model.frictions[index].name,
        Symbol::Definition(index) => &model.definitions[index].name,
        Symbol::Output(index) => &model.outputs[index].name,
        Symbol::Before(suspect) => model.target_name(model.suspects[suspect].target),
    }
}

/// What a file gives names to, with the suspect that it belongs to, in the order in which a name is looked up.
pub(crate) fn named_parts(model: &Model) -> impl Iterator<Item = (Symbol, &String, Option<usize>)> {
    let inputs = model.inputs.iter().map(|one| (&one.name, None));
    let states = model.states.iter().map(|one| (&one.name, one.suspect));
    let parameters = model.parameters.iter().map(|one| (&one.name, one.suspect));
    let memories = model.memories.iter().map(|one| (&one.name, one.suspect));
    let frictions = model.frictions.iter().map(|one| (&one.name, one.suspect));
    let definitions = model.definitions.iter().map(|one| (&one.name, one.suspect));
    numbered(Symbol::Input, inputs)
        .chain(numbered(Symbol::State, states))
        .chain(numbered(Symbol::Parameter, parameters))
        .chain(numbered(Symbol::Memory, memories))
        .chain(numbered(Symbol::Friction, frictions))
        .chain(numbered(Symbol::Definition, definitions))
}

fn numbered<'a>(
    symbol: fn(usize) -> Symbol,
    names: impl Iterator<Item = (&'a String, Option<usize>)>,
) -> impl Iterator<Item = (Symbol, &'a String, Option<usize>)> {
    names.enumerate().map(move |(index, (name, suspect))| (symbol(index), name, suspect))
}

pub(crate) fn resolve(
    model: &Model,
    name: &str,
    suspect: Option<usize>,
    at: usize,
) -> Result<Symbol, ExpressionError> {
    match name {
        "t" => return Ok(Symbol::Time),
        "pi" => return Ok(Symbol::Pi),
        _ => {}
    }
    if let Some(name) = name.strip_prefix(SUSPECT_MARK) {
        let mut parts = named_parts(model).filter(|(_, _, of)| of.is_some() && *of == suspect);
        let found = parts.find(|(_, other, _)| *other == name).map(|(symbol, ..)| symbol);
        return found.ok_or_else(|| ExpressionError::new(at, format!("'{name}' is unknown")));
    }
    let owner = suspect.and_then(|index| model.suspects.get(index));
    // The file's own names alone may stand in what a suspect of a library is bound to.
    let is_closed = owner.is_some_and(|owner| owner.library.is_some());
    let seen = |of: Option<usize>| of.is_none() || of == suspect && !is_closed;
    if let Some(owner) = owner
        && !matches!(owner.target, Target::State(_))
        && model.target_name(owner.target) == name
        && let Some(suspect) = suspect
    {
        return Ok(Symbol::Before(suspect));
    }
    let mut parts = named_parts(model).filter(|(_, _, of)| seen(*of));
    parts.find(|(_, other, _)| *other == name).map(|(symbol, ..)| symbol).ok_or_else(|| {
        let parts = named_parts(model).filter(|(_, _, of)| seen(*of));
        let known: Vec<&str> = parts.map(|(_, name, _)| name.as_str()).take(30).collect();
        ExpressionError::new(at, format!("'{name}' is unknown here; known are t, pi, {}", known.join(", ")))
    })
}
