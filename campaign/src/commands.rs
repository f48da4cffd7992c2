//! The subcommands of the program.

use crate::campaign::{Campaign, CampaignError, InstallPaths};
use crate::child::TimeLimit;
use crate::cli::{Cli, Command, CommonArguments, PlanArguments, RepeatArguments, RunArguments};
use crate::engine::{EngineError, Start, StartReport, duration_text};
use crate::file::LONGEST_WALL_S;
use crate::merge::{MergeError, merge};
use crate::outcome::EndState;
use crate::page::page;
use crate::parts::write_whole;
use crate::shard::{Shard, ShardError};
use clap::Parser as _;
use protocol::exit::Exit;
use runlog::run_folder::{REPORT_HTML, SCHEMA_VERSION};
use serde_json::json;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Why a subcommand failed.
#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error(transparent)]
    Shard(#[from] ShardError),
    #[error(transparent)]
    Merge(#[from] MergeError),
    #[error("{0}: {1}")]
    File(String, io::Error),
    #[error("run {run}: the campaign has runs 0 to {last}")]
    NoSuchRun { run: u64, last: u64 },
}

/// Runs the program `campaign` with the arguments of the process.
pub fn main() -> ExitCode {
    let exit = run(&Cli::parse()).unwrap_or_else(|error| {
        say(&error.to_string());
        Exit::BadInput
    });
    exit.into()
}

fn run(cli: &Cli) -> Result<Exit, CommandError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second signal ends the process at once; parts are whole or absent in any case.
        let code = Exit::Interrupted as i32;
        signal_hook::flag::register_conditional_shutdown(signal, code, Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .map_err(|error| CommandError::File("signals".into(), error))?;
    }
    match &cli.command {
        Command::Plan(arguments) => plan(arguments),
        Command::Run(arguments) => start(arguments, &stop),
        Command::Merge(arguments) => {
            let campaign = read(&arguments.common)?;
            let usual = vec![default_out(&arguments.common.file)];
            let folders = if arguments.folders.is_empty() { &usual } else { &arguments.folders };
            let to = arguments.to.as_ref().unwrap_or(&folders[0]);
            results(&campaign, folders, to, arguments.expect_passed)
        }
        Command::Repeat(arguments) => repeat(arguments, &stop),
    }
}

fn say(line: &str) {
    eprintln!("campaign: {line}");
}

fn read(common: &CommonArguments) -> Result<Campaign, CommandError> {
    let program_folder = || std::env::current_exe().ok().and_then(|path| Some(path.parent()?.to_owned()));
    let programs = common.programs.clone().or_else(program_folder).unwrap_or_default();
    let install_paths = InstallPaths { shipped: common.shipped.clone(), programs };
    Ok(Campaign::read(&common.file, &install_paths)?)
}

fn stem(file: &Path) -> String {
    file.file_stem().map_or_else(|| "campaign".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn default_out(file: &Path) -> PathBuf {
    Path::new("runs/campaigns").join(stem(file))
}

fn plan(arguments: &PlanArguments) -> Result<Exit, CommandError> {
    let campaign = read(&arguments.common)?;
    let parts = &campaign.parts;
    if arguments.json {
        let reported = json!({
            "schema_version": SCHEMA_VERSION,
            "title": campaign.file.title,
            "campaign": parts.campaign,
            "program": parts.program,
            "runs": parts.runs,
            "parts": parts.count(),
            "runs_per_part": parts.runs_per_part,
            "columns": parts.columns,
        });
        return writeln!(io::stdout(), "{reported:#}")
            .map(|()| Exit::Good)
            .map_err(|error| CommandError::File("standard output".into(), error));
    }
    say(&format!(
        "{}: {} runs ({} combinations, {} draws) in {} parts of {}",
        campaign.file.title,
        parts.runs,
        campaign.points.combinations,
        campaign.file.draws,
        parts.count(),
        parts.runs_per_part
    ));
    for run in 0..parts.runs.min(arguments.first) {
        let point = campaign.points.point(run);
        let values = campaign.points.factors.iter().zip(&point.values);
        let reported: Vec<_> = values.map(|(factor, value)| format!("{} = {value}", factor.name)).collect();
        say(&format!("run {run}: draw {}, seed {}; {}", point.draw, point.seed, reported.join(", ")));
    }
    Ok(Exit::Good)
}

fn start(arguments: &RunArguments, stop: &AtomicBool) -> Result<Exit, CommandError> {
    let campaign = read(&arguments.common)?;
    let shard = match arguments.shard {
        Some(asked) => asked.shard(|name| std::env::var(name).ok())?,
        None => Shard::WHOLE,
    };
    let out = arguments.out.clone().unwrap_or_else(|| default_out(&arguments.common.file));
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = arguments.jobs.map_or_else(cores, |jobs| jobs as usize);
    let start = Start { campaign: &campaign, out: &out, shard, jobs, stop, say: &say };
    let done = start.run()?;
    say(&reported(&done, jobs));
    if stop.load(Ordering::Relaxed) {
        say(&format!("stopped; {} parts are missing, the same command goes on", done.missing));
        return Ok(Exit::Interrupted);
    }
    if shard == Shard::WHOLE {
        return results(&campaign, std::slice::from_ref(&out), &out, arguments.expect_passed);
    }
    say(&format!("shard {shard} is complete in {}", out.display()));
    Ok(Exit::Good)
}

fn reported(done: &StartReport, jobs: usize) -> String {
    let StartReport { runs, simulated_s, wall_s, .. } = *done;
    let mut reported = format!("{runs} runs in {}", duration_text(wall_s));
    if simulated_s > 0.0 && wall_s > 0.0 {
        let rate = simulated_s / wall_s;
        reported += &format!(
            "; {simulated_s:.0} s of the rig's time, {rate:.0} simulated seconds per second, {:.0} per second and core",
            rate / jobs as f64
        );
    }
    reported
}

/// Merges, and writes the page.
fn results(
    campaign: &Campaign,
    folders: &[PathBuf],
    to: &Path,
    expect_passed: bool,
) -> Result<Exit, CommandError> {
    let began = Instant::now();
    let results = merge(campaign, folders, to)?;
    // Absolute, so that the command does not depend on the folder of the merge.
    let file = std::fs::canonicalize(&campaign.file.path).unwrap_or_else(|_| campaign.file.path.clone());
    let file = quoted(&file.display().to_string());
    let command = |run: u64| format!("scripts/campaign repeat {file} {run}");
    let path = to.join(REPORT_HTML);
    write_whole(&path, page(campaign, &results, &command).as_bytes())
        .map_err(|error| CommandError::File(path.display().to_string(), error))?;
    say(&format!(
        "{} runs merged in {:.2} s: {} and {}",
        results.runs,
        began.elapsed().as_secs_f64(),
        to.join("runs.csv").display(),
        path.display()
    ));
    if expect_passed && !results.all_passed() {
        say("not all runs came to their end and kept their bounds");
        return Ok(Exit::BoundBroken);
    }
    Ok(Exit::Good)
}

/// A word quoted for a shell.
fn quoted(word: &str) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "/._-+:@%".contains(letter);
    if word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

fn repeat(arguments: &RepeatArguments, stop: &AtomicBool) -> Result<Exit, CommandError> {
    let campaign = read(&arguments.common)?;
    let (run, last) = (arguments.run, campaign.parts.runs - 1);
    if run > last {
        return Err(CommandError::NoSuchRun { run, last });
    }
    let point = campaign.points.point(run);
    let usual = || PathBuf::from(format!("runs/{}-run-{run}", stem(&arguments.common.file)));
    let out = arguments.out.clone().unwrap_or_else(usual);
    let mut files = String::new();
    // Only an experiment leaves its files in the folder.
    if campaign.experiment().is_some() {
        std::fs::create_dir_all(&out)
            .map_err(|error| CommandError::File(out.display().to_string(), error))?;
        files = format!("; all its files are in {}", out.display());
    }
    let limit = TimeLimit::of(LONGEST_WALL_S, stop);
    let Some(outcome) = campaign.repeat(&point, &out, limit)? else { return Ok(Exit::Interrupted) };
    let because = if outcome.because.is_empty() { String::new() } else { format!(": {}", outcome.because) };
    say(&format!("run {run} {}{because}{files}", outcome.ended.name()));
    say(campaign.row(&point, &outcome).trim_end());
    Ok(if outcome.ended == EndState::Failed { Exit::BusFailed } else { Exit::Good })
}
