//! Plants as files: a TOML file holds inputs, states with their equations, parameters, outputs and suspects; here it becomes a
//! program that is integrated with derivatives by what is fitted.
//!
//! ```text
//!   text ──► Model: tables, expressions, checked ──► Program: bytecode ──► Simulator: outputs and their slopes
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `file`, `read` | the file as data; its reader |
//! | `expression` | the grammar of expressions |
//! | `rows` | which rows count, and over what a model is judged |
//! | `units` | units and dimensions |
//! | `names` | what names mean |
//! | `check` | names, numbers of arguments, dimensions |
//! | `compile` | suspects in their places, bytecode |
//! | `tape` | bytecode with forward derivatives |
//! | `inputs` | inputs between their samples |
//! | `simulate` | integration with sensitivities |
//!
//! Keys and examples: `docs/model-files.md`.

#![warn(missing_docs)] // an interface of other crates

mod check;
mod compile;
mod expression;
mod file;
mod inputs;
mod names;
mod read;
mod rows;
mod simulate;
mod tape;
mod units;

pub use expression::{DEEPEST, MOST_NODES};
pub use file::{
    Change, Definition, Expression, Input, Memory, Model, Output, Parameter, RecordLayout, Smoothing, Solver,
    Start, State, Suspect, Target,
};
pub use inputs::{Hold, Inputs};
pub use rows::Rows;
pub use simulate::{Direction, Failure, Program, Simulator};
pub use units::{Dimension, Unit, UnitError};
