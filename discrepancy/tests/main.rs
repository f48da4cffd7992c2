//! The integration tests of `discrepancy`, one executable.

#[path = "common/gridded.rs"]
mod gridded;
mod real;
#[path = "common/record.rs"]
mod record;

mod bad_records;
mod bus_log;
mod calibrate;
mod locate;
mod name;
mod outside_expected;
mod passage;
mod real_models;
mod real_records;
mod tabulate;
