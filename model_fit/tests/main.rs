//! The integration tests of `model-fit`, one executable.

mod adequacy;
mod advice;
mod balances;
mod chamber;
mod closing;
mod delayed;
mod discover;
mod first_model;
mod known_values;
mod library_fits;
mod looks;
mod model_files;
mod numbers;
mod pneumatic_axis;
#[path = "../../discrepancy/tests/real/mod.rs"]
mod real;
mod real_models;
mod stick_slip;
mod together;
