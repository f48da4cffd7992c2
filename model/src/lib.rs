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
//! | `rows` | which rows count, and over what a model is judged |
//! | `library` | ready suspects in variables of their own |
//! | `names` | what names mean |
//! | `check`, `file_units` | names, numbers of arguments, dimensions; these in units of the file |
//! | `compile` | suspects in their places, bytecode |
//! | `simulate`, `failure` | integration with sensitivities; why it ends |
//!
//! Grammar, units and bytecode of expressions are in the crate `expression`.
//!
//! Keys and examples: `docs/model-files.md`.

#![warn(missing_docs)] // an interface of other crates

use expression::{inputs, tape, units};

mod check;
mod compile;
mod failure;
mod file;
mod file_units;
mod library;
mod names;
mod read;
mod rows;
mod simulate;

pub use expression::compile::RESERVED;
pub use expression::grammar::{DEEPEST, MOST_NODES, is_name_character};
pub use expression::inputs::{Hold, Inputs};
pub use expression::mathml::{Operand, bracketed as in_brackets, name as mathml_name};
pub use expression::units::{Dimension, Unit, UnitError, with_powers};
pub use failure::Failure;
pub use file::{
    Change, Definition, Expression, Friction, Input, Memory, Model, Output, Parameter, Part, RecordLayout,
    Smoothing, Solver, Start, State, Suspect, Table, Target,
};
pub use library::{
    Entry, EntryFriction, EntryMemory, EntryParameter, EntryState, Library, LibrarySuspect, Quantity,
    Variable,
};
pub use rows::Rows;
pub use simulate::{Direction, Program, Simulator};
