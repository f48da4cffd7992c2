//! Expressions as text: what model files and rig files write as an equation or a term.
//!
//! ```text
//!   text ──► tree ──┬─► dimensions ──► tape: bytecode with derivatives          (model files)
//!                   └─► bounds: proven finite over the ranges of its names ──► formula: on the stack   (terms of a rig)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `grammar` | text to tree, refused at the byte where it goes wrong |
//! | `units` | units and dimensions |
//! | `dimensions` | the dimension of a tree |
//! | `bounds` | the smallest and the largest value of a tree |
//! | `constants` | what numbers alone are, and where they are none |
//! | `compile` | tree to operations |
//! | `operation` | what an operation does, and its derivatives |
//! | `tape` | operations in their order, computed with or without derivatives |
//! | `curve` | tables |
//! | `inputs` | inputs over time between their samples |
//! | `past` | earlier values of what is integrated |
//! | `mathml` | a tree as a formula that browsers set |
//! | `formula` | one expression over named variables |
//!
//! Grammar and functions: `docs/model-files.md`.

#![warn(missing_docs)] // an interface of other crates

mod bounds;
pub mod compile;
pub mod constants;
pub mod curve;
pub mod dimensions;
pub mod formula;
pub mod grammar;
pub mod inputs;
pub mod mathml;
mod operation;
pub mod past;
pub mod tape;
pub mod units;
