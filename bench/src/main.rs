//! Process beside plant and controller: sums up, judges, draws and compares what they left behind.

use bench::cli::{CheckArguments, Cli, Command, CompareArguments, SpreadArguments};
use bench::runs::{self, Run, RunsError};
use bench::soak::cli::SoakArguments;
use bench::soak::processes::become_child;
use bench::{SummaryError, compare, figures, join, picture, spread, table, thresholds};
use clap::Parser;
use protocol::exit::Exit;
use protocol::run_folder::write_json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Summary(arguments) => sum_up(&arguments.folder).map_err(RunsError::from),
        Command::Compare(arguments) => compare_runs(&arguments),
        Command::Spread(arguments) => spread_runs(&arguments),
        Command::Figures => {
            print(&figures::list());
            Ok(Exit::Good)
        }
        Command::CheckExperiment(arguments) => check(&arguments).map_err(RunsError::from),
        Command::Soak(arguments) => return soak(&arguments),
        Command::SoakChild(arguments) => {
            eprintln!("bench: {:?}: {}", arguments.command[0], become_child(&arguments));
            return Exit::BadInput.into();
        }
    };
    let exit = done.unwrap_or_else(|error| {
        eprintln!("bench: {error}");
        Exit::BadInput
    });
    exit.into()
}

fn soak(arguments: &SoakArguments) -> ExitCode {
    let exit = bench::soak::run(arguments).unwrap_or_else(|error| {
        eprintln!("soak: {error}");
        Exit::BadInput
    });
    exit.into()
}

fn print(text: &str) {
    // A reader that has gone, as `| head` does, has seen enough.
    let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
}

fn sum_up(folder: &Path) -> Result<Exit, SummaryError> {
    let joined = join::join(folder)?;
    let pictures = picture::draw(folder, &joined.record)?;
    print(&table::table(&joined));
    let others = if joined.is_rehearsal() { "" } else { "bus.log, " };
    print(&format!(
        "\n  files in {}: {}, summary.json, measurement.csv, truth.csv, {others}…",
        folder.display(),
        pictures.join(", ")
    ));
    Ok(if joined.passed() { Exit::Good } else { Exit::BoundBroken })
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
    let grid = compare::table(&runs);
    print(&grid.markdown());
    if let Some(out) = &arguments.out {
        let page = compare::write(&runs, &grid, out)?;
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
        std::fs::create_dir_all(out).map_err(|error| SummaryError::write(out, error))?;
        std::fs::write(&table, markdown).map_err(|error| SummaryError::write(&table, error))?;
        write_json(&json, &spread::json(&runs)).map_err(|error| SummaryError::write(&json, error))?;
    }
    Ok(Exit::Good)
}

fn check(arguments: &CheckArguments) -> Result<Exit, SummaryError> {
    let file = &arguments.file;
    let text = std::fs::read_to_string(file).map_err(|error| SummaryError::read(file, error))?;
    let experiment: toml::Table = text.parse().map_err(|error| SummaryError::read(file, error))?;
    let passed = experiment.get("passed").map(|passed| passed.as_table().ok_or("[passed] is no table"));
    let passed = passed.transpose().map_err(|error| SummaryError::read(file, error))?;
    passed.map_or(Ok(()), thresholds::check)?;
    Ok(Exit::Good)
}
