//! The commands of the study, for `scripts/study`: see [`cli::Command`].

mod cli;
mod one;
mod scores;

use clap::Parser;
use cli::{
    Cli, Command, CosinesArguments, DrawsArguments, FormsArguments, LedgerArguments, LimitsArguments,
    ResolveArguments, TwinsArguments,
};
use record_maker::Form;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use study::classes::{Classes, DrawClasses};
use study::draws::Draw;
use study::folder::{Study, read, write_whole};
use study::forms::{OTHERS, Selection};
use study::ledger::Ledger;
use study::resolve::Table;
use study::twins::Twins;
use study::twins::search::search;
use study::{compute, document, forms};

/// Exit code of an interrupted study: finished steps are kept.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second signal ends the study at once; its folder stays valid.
        let registered =
            signal_hook::flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&stop))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)));
        if let Err(error) = registered {
            eprintln!("study: signals cannot be caught: {error}");
        }
    }
    let done = match Cli::parse().command {
        Command::One(arguments) => return one::one(&arguments, &stop),
        Command::Draws(arguments) => draws(&arguments),
        Command::Limits(arguments) => limits(&arguments),
        Command::Cosines(arguments) => cosines(&arguments, &stop),
        Command::Forms(arguments) => forms(&arguments, &stop),
        Command::Twins(arguments) => twins(&arguments, &stop),
        Command::Score(arguments) => scores::score(&arguments),
        Command::Worlds(arguments) => scores::worlds(&arguments),
        Command::Compare(arguments) => scores::compare(&arguments),
        Command::Curve(arguments) => scores::curve(&arguments),
        Command::Ledger(arguments) => ledger(&arguments),
        Command::Resolve(arguments) => resolve(&arguments),
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

/// Result of a command of the study.
type CommandResult = Result<(), Box<dyn Error>>;

fn say(line: &str) {
    eprintln!("study: {line}");
}

fn committed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

const PAGE: &str = "docs/study.md";
/// Seeds and their openings.
const SEEDS_PAGE: &str = "docs/seeds.md";
/// Tables of studies of earlier programs.
const EARLIER: &str = "docs/study-earlier.md";
const FORMS_PAGE: &str = "docs/record-maker.md";
const LIMITS: &str = "study/limits.json";
const CLASSES: &str = "study/classes.json";
const LEDGER: &str = "study/evidence/ledger.toml";
const EXPECTED: &str = "study/outside-expected.json";

fn draws(arguments: &DrawsArguments) -> CommandResult {
    admit(arguments.plan.seed)?;
    let study = Study::begin(&arguments.out, &arguments.plan.plan())?;
    say(&format!("{} draws in {}", study.draws.len(), arguments.out.display()));
    Ok(())
}

fn limits(arguments: &LimitsArguments) -> CommandResult {
    let limits = compute::limits(arguments.seed, &say)?;
    if arguments.write {
        write_whole(&committed(LIMITS), format!("{:#}\n", serde_json::json!(limits)).as_bytes())?;
    }
    put_or_say(arguments.write, PAGE, "limits", &document::limit_table(&limits))
}

fn cosines(arguments: &CosinesArguments, stop: &AtomicBool) -> CommandResult {
    let study = Study::open(&arguments.out)?;
    compute::classes(&study, arguments.done.as_deref(), arguments.jobs, stop, &say)?;
    if arguments.write && !stop.load(Ordering::Relaxed) {
        let classes = compute::collected(&study)?;
        let text = document::twin_table(&classes);
        write_whole(&committed(CLASSES), compute::classes_text(&classes).as_bytes())?;
        document::put(&committed(PAGE), "twins", &text)?;
    }
    Ok(())
}

fn forms(arguments: &FormsArguments, stop: &AtomicBool) -> CommandResult {
    let kinds = if arguments.far_only { &[Form::Far][..] } else { &OTHERS };
    let of = Selection { effects: &arguments.effects, place: arguments.place.as_deref(), forms: kinds };
    let residuals = forms::residuals(&of, arguments.jobs, stop, &say)?;
    let text = forms::table(&residuals);
    if stop.load(Ordering::Relaxed) {
        return Ok(());
    }
    put_or_say(arguments.write, FORMS_PAGE, "forms", &text)
}

fn ledger(arguments: &LedgerArguments) -> CommandResult {
    let text = Ledger::read(&committed(LEDGER))?.markdown();
    put_or_say(arguments.write, SEEDS_PAGE, "ledger", &text)
}

/// Puts a table between its marks of a page, or says it.
fn put_or_say(write: bool, page: &str, name: &str, table: &str) -> CommandResult {
    if write {
        document::put(&committed(page), name, table)?;
    } else {
        say(&format!("\n{table}"));
    }
    Ok(())
}

/// Refuses a seed that is neither for development nor in the ledger.
fn admit(seed: u64) -> CommandResult {
    Ok(Ledger::read(&committed(LEDGER))?.admit(seed)?)
}

fn twins(arguments: &TwinsArguments, stop: &AtomicBool) -> CommandResult {
    admit(arguments.seed)?;
    let TwinsArguments { out, seed, count, jobs } = arguments;
    if out.join("twins.json").exists() {
        return Err(format!("{} has twins already: give another folder", out.display()).into());
    }
    let twins = search(*seed, *count, *jobs, stop, &say)?;
    // An interrupted search keeps the twins of its complete rounds.
    if !twins.twins.is_empty() {
        std::fs::create_dir_all(out)?;
        twins.save(out)?;
    }
    for (reason, count) in &twins.refused {
        say(&format!("refused {count}: {reason}"));
    }
    Ok(())
}

fn resolve(arguments: &ResolveArguments) -> CommandResult {
    if arguments.twins {
        return resolve_twins(arguments);
    }
    let study = Study::open(&arguments.out)?;
    let table = Table::of(&study, &arguments.label)?;
    let text = table.markdown();
    let path = |extension: &str| study.root.join(format!("resolve-{}.{extension}", arguments.label));
    write_whole(&path("json"), format!("{:#}\n", serde_json::json!(table)).as_bytes())?;
    write_whole(&path("md"), text.as_bytes())?;
    if arguments.write {
        document::put(&committed(EARLIER), "resolve", &text)?;
    }
    say(&format!("\n{text}"));
    say(&path("json").display().to_string());
    Ok(())
}

fn resolve_twins(arguments: &ResolveArguments) -> CommandResult {
    let ResolveArguments { out, label, write, .. } = arguments;
    let table = study::twins::tables::Table::of(&Twins::open(out)?, out, label)?;
    let text = table.markdown();
    let path = out.join(format!("twins-{label}.json"));
    write_whole(&path, format!("{:#}\n", serde_json::json!(table)).as_bytes())?;
    if *write {
        document::put(&committed(PAGE), "twins-table", &text)?;
    }
    say(&format!("\n{text}"));
    say(&path.display().to_string());
    Ok(())
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
