//! What names in expressions mean: quantities of the model, and functions.

use crate::file::{Model, Target};
use expression::grammar::Wrong;

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
const OWN: char = '#';

/// Such a name.
pub(crate) fn own_name(name: &str) -> String {
    format!("{OWN}{name}")
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

fn own(model: &Model, name: &str, suspect: Option<usize>) -> Option<Symbol> {
    let is_it = |(other, of): (&String, Option<usize>)| other == name && of.is_some() && of == suspect;
    let parameter = model.parameters.iter().position(|one| is_it((&one.name, one.suspect)));
    let state = || model.states.iter().position(|one| is_it((&one.name, one.suspect)));
    let memory = || model.memories.iter().position(|one| is_it((&one.name, one.suspect)));
    let friction = || model.frictions.iter().position(|one| is_it((&one.name, one.suspect)));
    parameter
        .map(Symbol::Parameter)
        .or_else(|| state().map(Symbol::State))
        .or_else(|| memory().map(Symbol::Memory))
        .or_else(|| friction().map(Symbol::Friction))
}

pub(crate) fn resolve(model: &Model, name: &str, suspect: Option<usize>, at: usize) -> Result<Symbol, Wrong> {
    match name {
        "t" => return Ok(Symbol::Time),
        "pi" => return Ok(Symbol::Pi),
        _ => {}
    }
    if let Some(name) = name.strip_prefix(OWN) {
        return own(model, name, suspect).ok_or_else(|| Wrong::new(at, format!("'{name}' is unknown")));
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
    let find = |mut names: Box<dyn Iterator<Item = (&String, Option<usize>)> + '_>| {
        names.position(|(other, of)| other == name && seen(of))
    };
    let parameters = find(Box::new(model.parameters.iter().map(|one| (&one.name, one.suspect))));
    let states = find(Box::new(model.states.iter().map(|one| (&one.name, one.suspect))));
    let memories = find(Box::new(model.memories.iter().map(|one| (&one.name, one.suspect))));
    let frictions = find(Box::new(model.frictions.iter().map(|one| (&one.name, one.suspect))));
    let definitions = find(Box::new(model.definitions.iter().map(|one| (&one.name, one.suspect))));
    let inputs = model.inputs.iter().position(|one| one.name == name);
    let symbol = inputs
        .map(Symbol::Input)
        .or(states.map(Symbol::State))
        .or(parameters.map(Symbol::Parameter))
        .or(memories.map(Symbol::Memory))
        .or(frictions.map(Symbol::Friction))
        .or(definitions.map(Symbol::Definition));
    symbol.ok_or_else(|| {
        let known: Vec<&str> = model
            .inputs
            .iter()
            .map(|one| &one.name)
            .chain(model.states.iter().filter(|one| seen(one.suspect)).map(|one| &one.name))
            .chain(model.parameters.iter().filter(|one| seen(one.suspect)).map(|one| &one.name))
            .chain(model.memories.iter().filter(|one| seen(one.suspect)).map(|one| &one.name))
            .chain(model.frictions.iter().filter(|one| seen(one.suspect)).map(|one| &one.name))
            .chain(model.definitions.iter().filter(|one| seen(one.suspect)).map(|one| &one.name))
            .map(String::as_str)
            .take(30)
            .collect();
        Wrong::new(at, format!("'{name}' is unknown here; known are t, pi, {}", known.join(", ")))
    })
}
