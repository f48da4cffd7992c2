//! The integration tests of `bench`, one executable.

#[path = "report_page/sample.rs"]
mod sample;

mod folders;
mod measuring;
mod report_page;
