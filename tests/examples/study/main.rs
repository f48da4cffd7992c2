//! The study's commands, for `scripts/study`: draws, limits, cosines, run, score.

mod cli;

use clap::Parser;
use cli::{Cli, Command, CosinesArguments, DrawsArguments, LimitsArguments, RunArguments, ScoreArguments};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use system_tests::study::campaign::{Campaign, CampaignEnd, make_record};
use system_tests::study::classes::{Classes, DrawClasses};
use system_tests::study::folder::{Plan, Study, read, write_whole};
use system_tests::study::limits::Limits;
use system_tests::study::program::Program;
use system_tests::study::score::{Known, score};
use system_tests::study::{compute, document, page};

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
        Command::Score(arguments) => scored(&arguments),
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
    let program = match &arguments.program {
        Some(path) => Some(
            Program::new(path, arguments.arguments.clone(), limit)
                .map_err(|error| format!("--program {}: {error}", path.display()))?,
        ),
        None => None,
    };
    let campaign = Campaign {
        study: &study,
        program: program.as_ref(),
        label: &arguments.label,
        make: &make_record,
        only: &arguments.only,
        jobs: arguments.jobs,
        keep_truth: arguments.keep_truth,
        drop_records: arguments.drop_records,
        least_free_mib: arguments.least_free,
        stop,
        say: &say,
    };
    match campaign.run()? {
        CampaignEnd::Complete => say("complete"),
        CampaignEnd::Stopped(left) => {
            say(&format!("stopped, {left} draws are left: the same command goes on"))
        }
    }
    Ok(())
}

fn scored(arguments: &ScoreArguments) -> Done {
    let limits: Option<Limits> = read_if_there(&committed(LIMITS))?;
    let known = known_classes(&arguments.folders)?;
    let score = score(
        &arguments.folders,
        &arguments.label,
        Known { limits: limits.as_ref(), classes: known.as_ref() },
    )?;
    let folder = arguments.to.as_ref().unwrap_or(&arguments.folders[0]);
    let path = |extension: &str| folder.join(format!("score-{}.{extension}", arguments.label));
    write_whole(&path("json"), format!("{:#}\n", serde_json::json!(score)).as_bytes())?;
    write_whole(&path("html"), page::page(&score).as_bytes())?;
    for line in &score.tables.headline {
        let rate = &line.rate;
        say(&format!("{}: {} of {} (wanted: {})", line.name, rate.count, rate.of, line.wanted));
    }
    say(&path("html").display().to_string());
    Ok(())
}

/// The committed classes, when they are those of the same study.
fn known_classes(folders: &[PathBuf]) -> Result<Option<BTreeMap<usize, DrawClasses>>, Box<dyn Error>> {
    let Some(classes) = read_if_there::<Classes>(&committed(CLASSES))? else { return Ok(None) };
    let Some(folder) = folders.first() else { return Ok(None) };
    let plan = Study::open(folder)?.plan;
    let same = (plan.seed, plan.shape) == (classes.plan.seed, classes.plan.shape);
    Ok(same.then(|| classes.draws.into_iter().map(|draw| (draw.number, draw)).collect()))
}

fn read_if_there<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, Box<dyn Error>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = read(path)?;
    serde_json::from_str(&text).map(Some).map_err(|error| format!("{}: {error}", path.display()).into())
}
