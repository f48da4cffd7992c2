//! The integration tests of `realtime`, one executable; `allocations.rs` needs a process of its own.

mod common;

mod hlog;
mod periodic;
mod stages;
