//! The integration tests of `latency`, one executable.

#[path = "report_page/sample.rs"]
mod sample;

mod report_page;
