//! The command line of the controller, apart from the program: manual pages and completions are made from it.

pub mod cli;
