//! The program: parses the command line, runs its command, returns its exit code.

use crate::cli::{Cli, Command, CompareArguments, ReportArguments, SpreadArguments};
use crate::conformance::{self, ConformanceError};
use crate::gateway::{self, GatewayError};
use crate::ping_pong::{self, PingPongError};
use crate::replay::ReplayError;
use crate::runs::{self, Run, RunsError};
use crate::soak::processes::become_child;
use crate::{can, compare, export, export_fmu, probe, replay, say, soak, spread};
use clap::Parser;
use figures::{SummaryError, sum_up, thresholds};
use latency::ReportError;
use live::LiveError;
use protocol::exit::Exit;
use runlog::run_folder::{FileError, write_json};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Runs the command that the process's arguments name; returns the exit code of the process.
pub fn main() -> ExitCode {
    match Cli::parse().command {
        Command::Summary { folder } => bad_input(sum_up(&folder)),
        Command::Compare(arguments) => bad_input(compare_runs(&arguments)),
        Command::Spread(arguments) => bad_input(spread_runs(&arguments)),
        Command::Report(arguments) => bad_input(report_on(&arguments)),
        Command::Cause { file } => bad_input(name_cause(&file)),
        Command::Figures => {
            print(&figures::list());
            Exit::Good.into()
        }
        Command::CheckExperiment { file } => bad_input(thresholds::check_file(&file).map(|()| Exit::Good)),
        Command::LatencyTable(arguments) => bad_input(latency::table::table(&arguments).map(|text| {
            print(&text);
            Exit::Good
        })),
        Command::Replay(arguments) => reported(replay::run(&arguments), ReplayError::exit),
        Command::ExportFmu(arguments) => bad_input(export_fmu::run(&arguments)),
        Command::Export(arguments) => bad_input(export::run(&arguments)),
        Command::Probe(arguments) => bad_input(probe::run(&arguments)),
        Command::PingPong(arguments) => reported(ping_pong::run(&arguments), PingPongError::exit),
        Command::Pong(arguments) => reported(ping_pong::pong(&arguments), PingPongError::exit),
        Command::CheckController(arguments) => reported(conformance::run(&arguments), ConformanceError::exit),
        Command::Gateway(arguments) => reported(gateway::run(&arguments), GatewayError::exit),
        Command::Can(arguments) => can::run(&arguments),
        Command::Watch(arguments) => reported(live::run(&arguments), LiveError::exit),
        Command::Soak(arguments) => bad_input(soak::run(&arguments)),
        Command::SoakChild(arguments) => {
            eprintln!("bench: {:?}: {}", arguments.command[0], become_child(&arguments));
            Exit::BadInput.into()
        }
    }
}

/// Exit code of a command, with its error on standard error.
fn reported<E: Display>(done: Result<Exit, E>, exit: impl Fn(&E) -> Exit) -> ExitCode {
    done.unwrap_or_else(|error| {
        eprintln!("bench: {error}");
        exit(&error)
    })
    .into()
}

/// The same of a command whose errors are all bad input.
fn bad_input(done: Result<Exit, impl Display>) -> ExitCode {
    reported(done, |_| Exit::BadInput)
}

fn print(text: &str) {
    say(text.trim_end());
}

fn sum_up(folder: &Path) -> Result<Exit, SummaryError> {
    let summed_up = sum_up::sum_up(folder)?;
    print(&summed_up.text);
    Ok(if summed_up.passed { Exit::Good } else { Exit::BoundBroken })
}

fn read_runs(folders: &[PathBuf], anyway: bool) -> Result<Vec<Run>, RunsError> {
    let runs = runs::read(folders)?;
    if !anyway {
        runs::expect_one_experiment(&runs)?;
    }
    Ok(runs)
}

fn compare_runs(arguments: &CompareArguments) -> Result<Exit, RunsError> {
    let runs = read_runs(&arguments.folders, arguments.anyway)?;
    let (grid, pictures) = if arguments.differences {
        (compare::differences::table(&runs), compare::differences::pictures(&runs))
    } else {
        (compare::table(&runs), compare::overlay::pictures(&runs))
    };
    print(&grid.markdown());
    if let Some(out) = &arguments.out {
        let page = compare::write(&runs, &grid, &pictures, out)?;
        print(&format!("\n  page in {}", page.display()));
    }
    Ok(Exit::Good)
}

fn spread_runs(arguments: &SpreadArguments) -> Result<Exit, RunsError> {
    let runs = read_runs(&arguments.folders, arguments.anyway)?;
    let markdown = spread::table(&runs).markdown();
    print(&markdown);
    if let Some(out) = &arguments.out {
        let (table, json) = (out.join("spread.md"), out.join("spread.json"));
        std::fs::create_dir_all(out).map_err(|error| FileError::write(out, error))?;
        std::fs::write(&table, markdown).map_err(|error| FileError::write(&table, error))?;
        write_json(&json, &spread::json(&runs)).map_err(|error| FileError::write(&json, error))?;
    }
    Ok(Exit::Good)
}

fn report_on(arguments: &ReportArguments) -> Result<Exit, ReportError> {
    let selected = latency::choice::select_runs(&arguments.folders, &arguments.group)?;
    if arguments.compare && selected.len() < 2 {
        return Err(ReportError::OneRun);
    }
    let compare = arguments.compare || !arguments.group.is_empty();
    let mut report = latency::make_report(&selected, arguments.title.as_deref(), compare);
    if let Some(file) = &arguments.bounds {
        report.judge(file)?;
    }
    let out = arguments.out.clone().unwrap_or_else(|| latency::choice::default_out(&selected));
    latency::output::write(&report, &out, arguments.markdown_only)?;
    print(&latency::markdown::table(&report.report));
    print(&format!("\n  report in {}", out.display()));
    Ok(if report.is_broken() { Exit::BoundBroken } else { Exit::Good })
}

fn name_cause(file: &Path) -> Result<Exit, ReportError> {
    let (name, sentence) = latency::report_cause::name(&latency::report_cause::read(file)?);
    eprintln!("{sentence}");
    print(&name);
    Ok(Exit::Good)
}
