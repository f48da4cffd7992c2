//! Process 2, the program of the axis controllers: command line, runs on a bus and rehearsals, records.
//!
//! | file | holds |
//! |---|---|
//! | [`cli`], [`listing`] | command line, and the commands that print |
//! | [`run`], [`pace`] | a run: threads; the loop over frames or the barrier, and its end |
//! | [`rehearse`] | the command of a rehearsal |
//! | [`timing`] | time stamps of a cycle; histograms, timing tables, flight recorder |
//! | [`recording`], [`report`] | tables and report of a run |
//! | [`reload`] | changed numbers of program files, applied while running |

#![warn(missing_docs)] // an interface of other crates

pub mod cli;
mod listing;
mod pace;
mod recording;
mod rehearse;
mod reload;
mod report;
mod run;
mod timing;

use crate::cli::{Cli, Command};
use crate::run::RunError;
use clap::Parser;
use plugin::command;
use std::process::ExitCode;

/// The node with the controllers of a process, each with an XCP port if asked for.
type Node = axis_control::node::ControllerNode<xcp::port::Port>;

/// Runs the command that the process's arguments name; returns the exit code of the process.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Rehearse(arguments) => rehearse::run(&arguments),
        Command::Algorithms => Ok(listing::print()),
        Command::Parameters(files) => listing::print_parameters(&files),
        Command::A2l(arguments) => listing::print_a2l(&arguments),
        Command::CheckLibrary(library) => command::check_library(&library.file).map_err(RunError::from),
        Command::ProbeLibrary(library) => Ok(command::probe_library(&library.file)),
    };
    let exit = result.unwrap_or_else(|error| {
        protocol::say!("controller: {error}");
        error.exit()
    });
    exit.into()
}
