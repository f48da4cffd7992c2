//! The study's commands, for `scripts/study`: draws, limits, cosines, run, score, compare, curve, resolve.

mod cli;
mod resolve;
mod scores;

use clap::Parser;
use cli::{Cli, Command, CosinesArguments, DrawsArguments, LimitsArguments, RunArguments};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use system_tests::study::campaign::{Campaign, CampaignEnd, make_record};
use system_tests::study::classes::{Classes, DrawClasses, read_draw};
use system_tests::study::draws::{Draw, Kind};
use system_tests::study::folder::{Plan, Study, read, write_whole};
use system_tests::study::leave_out::left_out;
use system_tests::study::program::Program;
use system_tests::study::{compute, document};

/// Exit code of a study that was told to stop: everything that is done is kept.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second one ends the study at once; its folder stays good.
        let registered =
            signal_hook::flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&stop))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)));
        if let Err(error) = registered {
            eprintln!("study: signals cannot be caught: {error}");
        }
    }
    let done = match Cli::parse().command {
        Command::Draws(arguments) => draws(&arguments),
        Command::Limits(arguments) => limits(&arguments),
        Command::Cosines(arguments) => cosines(&arguments, &stop),
        Command::Run(arguments) => run(&arguments, &stop),
        Command::Score(arguments) => scores::score(&arguments),
        Command::Compare(arguments) => scores::compare(&arguments),
        Command::Curve(arguments) => scores::curve(&arguments),
        Command::Resolve(arguments) => resolve::resolve(&arguments, &stop),
    };
    match done {
        Ok(()) if stop.load(Ordering::Relaxed) => ExitCode::from(INTERRUPTED),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("study: {error}");
            ExitCode::from(2)
        }
    }
}

type Done = Result<(), Box<dyn Error>>;

fn say(line: &str) {
    eprintln!("study: {line}");
}

/// Where the committed files are.
fn committed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

const PAGE: &str = "docs/study.md";
const LIMITS: &str = "study/limits.json";
const CLASSES: &str = "study/classes.json";
const EXPECTED: &str = "study/outside-expected.json";

fn draws(arguments: &DrawsArguments) -> Done {
    let plan = Plan { shard: arguments.shard, ..Plan::new(arguments.seed, arguments.shape()) };
    let study = Study::begin(&arguments.out, &plan)?;
    say(&format!("{} draws in {}", study.draws.len(), arguments.out.display()));
    Ok(())
}

fn limits(arguments: &LimitsArguments) -> Done {
    let limits = compute::limits(arguments.seed, &say)?;
    let text = document::limit_table(&limits);
    if arguments.write {
        write_whole(&committed(LIMITS), format!("{:#}\n", serde_json::json!(limits)).as_bytes())?;
        document::put(&committed(PAGE), "limits", &text)?;
    } else {
        say(&format!("\n{text}"));
    }
    Ok(())
}

fn cosines(arguments: &CosinesArguments, stop: &AtomicBool) -> Done {
    let study = Study::open(&arguments.out)?;
    compute::classes(&study, arguments.jobs, stop, &say)?;
    if arguments.write && !stop.load(Ordering::Relaxed) {
        let classes = compute::collected(&study)?;
        let text = document::twin_table(&classes);
        write_whole(&committed(CLASSES), compute::classes_text(&classes).as_bytes())?;
        document::put(&committed(PAGE), "twins", &text)?;
    }
    Ok(())
}

fn run(arguments: &RunArguments, stop: &AtomicBool) -> Done {
    let study = Study::open(&arguments.out)?;
    let limit = Duration::from_secs_f64(arguments.time_limit.max(0.001));
    let program =
        arguments.program.as_ref().map(|path| program(path, &arguments.arguments, limit)).transpose()?;
    let classes = if arguments.leave_out { classes_for(&study)? } else { BTreeMap::new() };
    let without = |draw: &Draw| left_out(draw, classes.get(&draw.number));
    let campaign = Campaign {
        study: &study,
        program: program.as_ref(),
        label: &arguments.label,
        make: &make_record,
        without: if arguments.leave_out { Some(&without) } else { None },
        only: &arguments.only,
        jobs: arguments.jobs,
        keep_truth: arguments.keep_truth,
        drop_records: arguments.drop_records,
        least_free_mib: arguments.least_free,
        stop,
        say: &say,
    };
    told(campaign.run()?);
    Ok(())
}

fn program(path: &Path, arguments: &[String], limit: Duration) -> Result<Program, String> {
    Program::new(path, arguments.to_owned(), limit)
        .map_err(|error| format!("--program {}: {error}", path.display()))
}

fn told(end: CampaignEnd) {
    match end {
        CampaignEnd::Complete => say("complete"),
        CampaignEnd::Stopped(left) => {
            say(&format!("stopped, {left} draws are left: the same command goes on"))
        }
    }
}

/// All classes that are known of a study: committed, or computed for it.
fn classes_for(study: &Study) -> Result<BTreeMap<usize, DrawClasses>, Box<dyn Error>> {
    let mut classes = known_classes(&study.draws)?;
    for number in study.draws.iter().map(|draw| draw.number) {
        let path = study.class(number);
        if !classes.contains_key(&number) && path.exists() {
            classes.insert(number, read_draw(&path, number)?);
        }
    }
    let single = || study.draws.iter().filter(|draw| draw.kind == Kind::Single);
    let unknown = single().filter(|draw| !classes.contains_key(&draw.number)).count();
    if unknown > 0 {
        say(&format!(
            "of {unknown} draws the classes are not known: there only the effect itself is left out"
        ));
    }
    Ok(classes)
}

/// The committed classes of these draws, by their numbers.
fn known_classes(draws: &[Draw]) -> Result<BTreeMap<usize, DrawClasses>, Box<dyn Error>> {
    let classes = read_if_there::<Classes>(&committed(CLASSES))?;
    Ok(classes.map_or_else(BTreeMap::new, |classes| classes.of_draws(draws)))
}

fn read_if_there<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, Box<dyn Error>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = read(path)?;
    serde_json::from_str(&text).map(Some).map_err(|error| format!("{}: {error}", path.display()).into())
}
