//! The integration tests of `model`, one executable; its allocator counts.

mod delays;
mod files;
mod friction;
mod integration;
mod jumps;
mod libraries;
mod schema;

#[global_allocator]
static ALLOCATOR: realtime::allocations::CountingAllocator = realtime::allocations::CountingAllocator;

use model::{Direction, Failure, Inputs, Model, Program, Simulator, Start};
use realtime::allocations::{count_scope, counted, reset};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// What it gives, and its calls to the allocator. The count is one of all threads, so one test at a time has it.
pub(crate) fn counting<R>(run: impl FnOnce() -> R) -> (R, u64) {
    static COUNT: Mutex<()> = Mutex::new(());
    let _mine = COUNT.lock().unwrap_or_else(PoisonError::into_inner);
    reset();
    let scope = count_scope();
    let result = run();
    drop(scope);
    (result, counted())
}

pub(crate) fn read(text: &str) -> Model {
    Model::parse(text, Path::new("model.toml")).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn refused(text: &str) -> String {
    Model::parse(text, Path::new("model.toml")).expect_err(text).to_string()
}

/// Refuses a file with each replacement of a part of it, all with their place and with these words.
pub(crate) fn refuses_each(text: &str, replacements: &[(&str, &str, &str)]) {
    let mut wrong = Vec::new();
    for (from, to, message) in replacements {
        assert!(text.contains(from), "{from}");
        let found = refused(&text.replacen(from, to, 1));
        if !found.contains(message) || !found.starts_with("model.toml:") {
            wrong.push(format!("{from} -> {to}\n  {found}\n  {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// First values of a model's parameters, states and memories.
pub(crate) fn first_values(model: &Model) -> [Vec<f64>; 3] {
    let start = |start: Start| match start {
        Start::Known { value_si } | Start::Fitted { guess_si: value_si, .. } => value_si,
        Start::Record { .. } | Start::Input { .. } => 0.0,
    };
    [
        model.parameters.iter().map(|parameter| parameter.values_si[0]).collect(),
        model.states.iter().map(|state| start(state.start)).collect(),
        model.memories.iter().map(|memory| memory.start_si).collect(),
    ]
}

/// Derivatives of all outputs in a direction, row by row: central differences over a share of the value.
pub(crate) fn differences(
    program: &Program,
    direction: Direction,
    inputs: &Inputs<'_>,
    (values, share): (&[Vec<f64>; 3], f64),
) -> Vec<f64> {
    let (set, index) = match direction {
        Direction::Parameter(index) => (0, index),
        Direction::Start(index) => (1, index),
    };
    let step = share * values[set][index];
    let moved = |by: f64| {
        let mut values = values.clone();
        values[set][index] += by;
        simulated(program, &[], inputs, &values).unwrap()
    };
    let (ahead, behind) = (moved(step), moved(-step));
    ahead.iter().zip(&behind).map(|(ahead, behind)| (ahead.0 - behind.0) / (2.0 * step)).collect()
}

/// All outputs, row by row, of a model with these suspects and its first values.
pub(crate) fn outputs(model: &Model, suspects: &[usize], inputs: &Inputs<'_>) -> Result<Vec<f64>, Failure> {
    let program = Program::new(model, suspects).expect("it compiles");
    let rows = simulated(&program, &[], inputs, &first_values(model))?;
    Ok(rows.into_iter().map(|(value, _)| value).collect())
}

/// Values and derivatives of all outputs, row by row.
pub(crate) fn simulated(
    program: &Program,
    directions: &[Direction],
    inputs: &Inputs<'_>,
    values: &[Vec<f64>; 3],
) -> Result<Vec<(f64, Vec<f64>)>, Failure> {
    let mut all = Vec::new();
    let values = [&values[0][..], &values[1], &values[2]];
    Simulator::new(program, directions)
        .run(inputs, values, |_, _, value, slope| all.push((value, slope.to_vec())))?;
    Ok(all)
}
