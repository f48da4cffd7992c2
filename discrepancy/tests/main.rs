//! The integration tests of `discrepancy`, one executable.

mod adequacy;
mod advice;
mod bad_records;
mod balances;
mod bus_log;
mod calibrate;
mod chamber;
mod discover;
mod locate;
mod looks;
mod model_files;
mod name;
mod numbers;
mod outside_expected;
mod passage;
mod real;
mod real_models;
mod real_records;
mod record;
mod tabulate;
mod together;
