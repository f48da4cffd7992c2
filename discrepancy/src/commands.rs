//! What each command does: reads, runs the steps, writes the files and says in a few lines what came out.
//!
//! Results go to files and standard output; progress goes to standard error. A record that cannot be used leaves a report with
//! the verdict `bad-data`, and the exit code for bad input.

use crate::calibrate::calibrate;
use crate::cli::{
    Cli, CloseArguments, Command, ExtendArguments, NextArguments, RecordArguments, VerifyArguments,
};
use crate::engine::Engine;
use crate::parameters::COUNT;
use crate::refit::Around;
use crate::report::{NamedEffect, Quantity, Report, Verdict, Verification};
use crate::workflow::{self, Outcome, RigFile, Task, WorkflowError, close, open};
use crate::{balance, locate, page, verify};
use plant::effects::{SHEETS, sheet};
use protocol::exit::Exit;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Why a command did not do what it should.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// A step of the workflow.
    #[error(transparent)]
    Workflow(#[from] WorkflowError),
    /// A model of one balance.
    #[error(transparent)]
    Balance(#[from] balance::BalanceError),
    /// A file that cannot be written or read.
    #[error("{file}: {why}")]
    File {
        /// The file.
        file: PathBuf,
        /// What the system said.
        why: io::Error,
    },
    /// A report that is none.
    #[error("{file}: {why}: give the report.json of a close")]
    Report {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        why: serde_json::Error,
    },
    /// A record cannot be used.
    #[error("{0}")]
    BadData(String),
    /// The catalogue does not have what is to be left out.
    #[error("--without {name}: unknown effect; the catalogue has {known}")]
    UnknownEffect {
        /// As given.
        name: String,
        /// All names.
        known: String,
    },
}

impl CommandError {
    /// The exit code.
    #[must_use]
    pub fn exit(&self) -> Exit {
        Exit::BadInput
    }
}

/// Runs a command.
///
/// # Errors
/// [`CommandError`] with file, line, key and what to do.
pub fn run(cli: &Cli) -> Result<Exit, CommandError> {
    match &cli.command {
        Command::Close(arguments) => {
            threads(arguments.records.threads);
            close_command(arguments)
        }
        Command::Name(arguments) => {
            threads(arguments.threads);
            close_command(&CloseArguments { records: arguments.clone(), test: Vec::new() })
        }
        Command::Check(arguments) => check_command(arguments),
        Command::Calibrate(arguments) => {
            threads(arguments.threads);
            calibrate_command(arguments)
        }
        Command::Locate(arguments) => {
            threads(arguments.threads);
            locate_command(arguments)
        }
        Command::Extend(arguments) => extend_command(arguments),
        Command::Verify(arguments) => verify_command(arguments),
        Command::Next(arguments) => next_command(arguments),
    }
}

/// So many threads for all that follows.
fn threads(count: Option<usize>) {
    if let Some(count) = count {
        // Only the first call of a process sets them, and this is it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
    }
}

/// Tells what is going on, with the time since the start.
fn progress() -> impl FnMut(&str) {
    let began = Instant::now();
    move |text: &str| eprintln!("discrepancy: {:5.1} s: {text}", began.elapsed().as_secs_f64())
}

fn close_command(arguments: &CloseArguments) -> Result<Exit, CommandError> {
    let records = &arguments.records;
    let out = records.out.clone().unwrap_or_else(|| PathBuf::from("discrepancy"));
    known_effects(&records.without)?;
    arguments.test.iter().try_for_each(|test| is_there(test))?;
    std::fs::create_dir_all(&out).map_err(|why| CommandError::File { file: out.clone(), why })?;
    let mut progress = progress();
    let text = std::fs::read_to_string(&records.rig)
        .map_err(|why| CommandError::File { file: records.rig.clone(), why })?;
    let outcome = if balance::is_model_file(&text) {
        let tests: Vec<&Path> = arguments.test.iter().map(PathBuf::as_path).collect();
        let report = balance::close_on(&records.rig, &records.train, &tests, &mut progress)?;
        let extended = balance::extended_model_text(&records.rig, &report).ok();
        Outcome { report, extended, pictures: page::Pictures::default(), experiment: None, not_judged: None }
    } else {
        let task = Task {
            rig: records.rig.clone(),
            train: records.train.clone(),
            test: one_test(arguments)?,
            options: records.options(),
            without: records.without.clone(),
        };
        close(&task, &mut progress)?
    };
    let Outcome { report, extended, pictures, experiment, not_judged } = &outcome;
    write_json(&out.join("report.json"), report)?;
    write(&out.join("report.html"), &page::page(report, pictures))?;
    let model = records.rig.file_name().map_or_else(|| PathBuf::from("rig.toml"), PathBuf::from);
    if let Some(extended) = extended {
        write(&out.join(model), extended)?;
    }
    let proposed = report.next.as_ref().and_then(|next| next.experiment.as_ref());
    if let Some((name, experiment)) = proposed.zip(experiment.as_ref()) {
        write(&out.join(name), experiment)?;
    }
    progress(&format!("{} and report.html are in {}", "report.json", out.display()));
    print(&in_words(report));
    if let Some(why) = not_judged {
        print(&format!("The model was not judged on the held-out record: {why}\n"));
    }
    let is_good = report.verdict != Verdict::BadData && not_judged.is_none();
    Ok(if is_good { Exit::Good } else { Exit::BadInput })
}

/// An effect that is not left out because its name was mistyped would be found.
fn known_effects(without: &[String]) -> Result<(), CommandError> {
    let Some(name) = without.iter().find(|name| sheet(name).is_none()) else { return Ok(()) };
    let known = SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>().join(", ");
    Err(CommandError::UnknownEffect { name: name.clone(), known })
}

/// A held-out record that is missing is told before a minute of work, without being opened.
fn is_there(file: &Path) -> Result<(), CommandError> {
    std::fs::metadata(file)
        .map_or_else(|why| Err(CommandError::File { file: file.to_owned(), why }), |_| Ok(()))
}

/// The held-out record of a rig: one at a time.
fn one_test(arguments: &CloseArguments) -> Result<Option<PathBuf>, CommandError> {
    match arguments.test.as_slice() {
        [] => Ok(None),
        [one] => Ok(Some(one.clone())),
        many => Err(CommandError::BadData(format!(
            "--test: {} records: a rig is judged on one at a time; judge the others with verify",
            many.len()
        ))),
    }
}

fn check_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let rig = RigFile::read(&arguments.rig)?.rig;
    let mut all = Vec::new();
    let mut text = String::new();
    for path in &arguments.train {
        let record = crate::records::read(path, &arguments.options()).map_err(WorkflowError::from)?;
        let report = crate::check::check(&record, &rig).report;
        let fit = if report.usable { "can be used" } else { "cannot be used" };
        let _ = writeln!(text, "{}: {} rows, {:.3} s: {fit}", report.file, report.rows, report.length_s);
        for finding in &report.findings {
            let _ = writeln!(text, "  {}{}", if finding.fatal { "fatal: " } else { "" }, finding.text);
        }
        for (channel, check) in &report.channels {
            let told = |value: Option<f64>| value.map_or("unknown".to_owned(), significant);
            let (noise, quantum) = (told(check.noise), told(check.quantum));
            let _ = writeln!(
                text,
                "  {channel}: noise {noise}, quantum {quantum}, {:.2} % unusable",
                check.unusable * 100.0
            );
        }
        all.push(report);
    }
    print(&text);
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).map_err(|why| CommandError::File { file: out.clone(), why })?;
        write_json(&out.join("checks.json"), &all)?;
    }
    Ok(if all.iter().all(|report| report.usable) { Exit::Good } else { Exit::BadInput })
}

fn calibrate_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let (rig_file, courses) = courses(arguments)?;
    let engine = Engine::new(&courses, &rig_file.rig);
    let ones = [1.0; COUNT];
    let around = Around { columns: engine.parameter_columns(&rig_file.rig, &ones), factors: ones };
    let quantities = calibrate(&engine, &around).quantities(&engine);
    let mut text = String::new();
    for own in &quantities {
        let _ = match (own.standard_error, own.before) {
            (Some(_), Some(before)) => writeln!(text, "{} (rig file: {before})", quantity_in_words(own)),
            (Some(_), None) => writeln!(text, "{}", quantity_in_words(own)),
            (None, _) => writeln!(text, "{}: these records cannot tell", own.name),
        };
    }
    print(&text);
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).map_err(|why| CommandError::File { file: out.clone(), why })?;
        write_json(&out.join("parameters.json"), &quantities)?;
        let known: Vec<Quantity> =
            quantities.into_iter().filter(|own| own.standard_error.is_some()).collect();
        let records: Vec<String> = arguments.train.iter().map(|path| path.display().to_string()).collect();
        let text = crate::extend::extend(&rig_file.text, &rig_file.file, &[], &known, &records)
            .map_err(WorkflowError::from)?;
        write(&out.join("rig.toml"), &text)?;
    }
    Ok(Exit::Good)
}

fn locate_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let (rig_file, courses) = courses(arguments)?;
    let mut progress = progress();
    let located = locate::locate(&rig_file.rig, &courses, &mut progress);
    let mut text = String::new();
    for bar in &located.location.balances {
        let _ = writeln!(
            text,
            "{}: {:.2} times its noise, rms {:.4} {}",
            bar.balance, bar.over_noise, bar.rms, bar.unit
        );
    }
    print(&text);
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).map_err(|why| CommandError::File { file: out.clone(), why })?;
        write_json(&out.join("location.json"), &located.location)?;
    }
    Ok(Exit::Good)
}

fn extend_command(arguments: &ExtendArguments) -> Result<Exit, CommandError> {
    let rig_file = RigFile::read(&arguments.rig)?;
    let report = read_report(&arguments.report)?;
    let text = workflow::extended(&rig_file, &report).map_err(WorkflowError::from)?;
    write(&arguments.out, &text)?;
    Ok(Exit::Good)
}

fn verify_command(arguments: &VerifyArguments) -> Result<Exit, CommandError> {
    let [before, after] = [RigFile::read(&arguments.rig)?.rig, RigFile::read(&arguments.extended)?.rig];
    let options = crate::records::ReadOptions { mapping: arguments.mapping.clone(), ..Default::default() };
    let opened = open(&arguments.test, &options, &before)?;
    let Some(course) = opened.course else {
        return Err(CommandError::BadData(format!("{} cannot be used: see check", arguments.test.display())));
    };
    let verified = verify::verify(&before, &after, &course, &mut progress());
    let mut text = String::new();
    for (signal, gap) in &verified.gap {
        let closed = gap.closed.map_or("no gap".into(), |closed| format!("{:.1} % closed", closed * 100.0));
        let _ = writeln!(
            text,
            "{signal}: before {:.4e}, after {:.4e}, noise {:.4e}: {closed}",
            gap.before, gap.after, gap.floor
        );
    }
    let Verification { chi2_before, chi2_after, chi2_null, confirmed, .. } = &verified.verification;
    let _ = writeln!(
        text,
        "chi2 {chi2_before:.3} before, {chi2_after:.3} after, {:.3} to {:.3} when nothing is missing: {}",
        chi2_null[0],
        chi2_null[1],
        if *confirmed { "confirmed" } else { "not confirmed" }
    );
    print(&text);
    Ok(if *confirmed { Exit::Good } else { Exit::BoundBroken })
}

fn next_command(arguments: &NextArguments) -> Result<Exit, CommandError> {
    let rig_file = RigFile::read(&arguments.rig)?;
    let report = read_report(&arguments.report)?;
    let Some(proposal) = workflow::proposal(&rig_file, &report, &mut progress()) else {
        print("The report names nothing that cannot be told apart.\n");
        return Ok(Exit::Good);
    };
    print(&format!("{}\n", proposal.next.reason));
    match (&proposal.experiment_toml, &proposal.next.otherwise) {
        (Some(experiment), _) => write(&arguments.out, experiment)?,
        (None, Some(otherwise)) => print(&format!("{otherwise}\n")),
        (None, None) => {}
    }
    Ok(Exit::Good)
}

fn courses(arguments: &RecordArguments) -> Result<(RigFile, Vec<crate::course::Course>), CommandError> {
    let rig_file = RigFile::read(&arguments.rig)?;
    let mut courses = Vec::new();
    for path in &arguments.train {
        let opened = open(path, &arguments.options(), &rig_file.rig)?;
        let Some(course) = opened.course else {
            let fatal = opened.checked.report.findings.into_iter().filter(|finding| finding.fatal);
            return Err(CommandError::BadData(
                fatal.map(|finding| finding.text).collect::<Vec<_>>().join("\n"),
            ));
        };
        courses.push(course);
    }
    Ok((rig_file, courses))
}

fn read_report(path: &Path) -> Result<workflow::Told, CommandError> {
    let bytes = std::fs::read(path).map_err(|why| CommandError::File { file: path.to_owned(), why })?;
    serde_json::from_slice(&bytes).map_err(|why| CommandError::Report { file: path.to_owned(), why })
}

fn write(file: &Path, text: &str) -> Result<(), CommandError> {
    std::fs::write(file, text).map_err(|why| CommandError::File { file: file.to_owned(), why })
}

fn write_json(file: &Path, value: &impl Serialize) -> Result<(), CommandError> {
    let mut text = serde_json::to_string_pretty(value).expect("reports hold nothing that JSON does not");
    text.push('\n');
    write(file, &text)
}

/// Standard output; a reader that has gone is no matter.
fn print(text: &str) {
    let _ = io::stdout().write_all(text.as_bytes());
}

/// The verdict and the names in a few lines.
fn in_words(report: &Report) -> String {
    let mut text = format!("{}\n", report.summary);
    for named in &report.named {
        let _ = writeln!(text, "  {}", effect_in_words(named));
        for other in &named.alternatives {
            let _ = writeln!(text, "    or {}", effect_in_words(other));
        }
    }
    for own in &report.parameters {
        let _ = writeln!(text, "  {}", quantity_in_words(own));
    }
    for (signal, gap) in &report.gap {
        if let Some(closed) = gap.closed {
            let _ = writeln!(text, "  {signal}: {:.1} % of the gap to the noise closed", closed * 100.0);
        }
    }
    text
}

fn effect_in_words(named: &NamedEffect) -> String {
    let place = workflow::place_name(&named.place);
    let numbers: Vec<String> = named.parameters.iter().map(quantity_in_words).collect();
    format!("{} {place}: {}", named.effect, numbers.join(", "))
}

/// Four digits that count.
fn significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    format!("{value:.digits$}", digits = (3.0 - magnitude).clamp(0.0, 12.0) as usize)
}

/// `leakage_nl_per_min = 2.513 +- 0.041 Nl/min`: rounded to the second digit of the standard error.
fn quantity_in_words(own: &Quantity) -> String {
    let value = match own.standard_error.filter(|error| *error > 0.0) {
        Some(error) => {
            let digits = (1.0 - error.log10().floor()).clamp(0.0, 12.0) as usize;
            format!("{:.digits$} +- {error:.digits$}", own.value)
        }
        None => significant(own.value),
    };
    format!("{} = {value} {}", own.name, own.unit).trim_end().to_owned()
}
