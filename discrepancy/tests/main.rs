//! The integration tests of `discrepancy`, one executable.

mod bad_records;
mod bus_log;
mod calibrate;
mod locate;
mod name;
mod outside_expected;
mod passage;
mod real;
mod real_records;
mod record;
mod tabulate;
