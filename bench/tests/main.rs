//! The integration tests of `bench`, one executable.

mod folders;
mod measuring;
