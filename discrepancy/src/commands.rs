//! The commands: read, run the steps, write the files, print a summary.
//!
//! Results go to files and standard output; progress goes to standard error. A record that cannot be used leaves a report with
//! the verdict `bad-data`, and the exit code for bad input. What was found is printed before it is written, so that a full disk
//! takes the files alone.

mod any_plant;
mod libraries;
mod text;

use crate::calibrate::calibrate;
use crate::calibrate::finer::calibrate_tables;
use crate::cli::{
    Cli, Command, ExtendArguments, NameArguments, NextArguments, RecordArguments, VerifyArguments,
};
use crate::engine::Engine;
use crate::folder::{self, Folder, FolderError};
use crate::gridded_record::GriddedRecord;
use crate::refit::Linearisation;
use crate::report::{HeldOutFinding, Report, SignalMisfit, Verdict, Verification};
use crate::suspects::{self, Suspect};
use crate::workflow::{self, Outcome, RigFile, Task, WorkflowError, close, open};
use crate::{locate, page, verify};
use model_fit::{is_model_file, successor};
use plant::effects::{SHEETS, sheet};
use protocol::exit::Exit;
use runlog::run_folder::{REPORT_HTML, REPORT_JSON};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Instant;
use text::{in_words, quantity_in_words, significant};

/// Keys without which the report of a rig file says nothing of an extended one.
const OF_RIG: [&str; 3] = ["named", "parameters", "inputs"];

/// Why a command ends without a result; the program then exits as for bad input.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum CommandError {
    #[error(transparent)]
    Workflow(#[from] WorkflowError),
    #[error(transparent)]
    Model(#[from] model_fit::ModelError),
    #[error(transparent)]
    New(#[from] model_fit::NewError),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("{file}: {why}")]
    File { file: PathBuf, why: io::Error },
    #[error("{file}: {why}: give the report.json of a close")]
    Report { file: PathBuf, why: serde_json::Error },
    #[error("{0}")]
    BadData(String),
    #[error("--without {name}: unknown effect; the catalogue has {known}")]
    UnknownEffect { name: String, known: String },
}

/// Runs a command, and returns its exit code: [`Exit`].
///
/// # Errors
/// [`CommandError`] with file, line, key and what to do.
pub fn run(cli: &Cli) -> Result<Exit, CommandError> {
    match &cli.command {
        Command::Close(arguments) => close_command(&arguments.name, &arguments.test),
        Command::Name(arguments) => close_command(arguments, &[]),
        Command::Check(arguments) => check_command(arguments),
        Command::Calibrate(arguments) => calibrate_command(arguments),
        Command::Locate(arguments) => locate_command(arguments),
        Command::Extend(arguments) => extend_command(arguments),
        Command::Verify(arguments) => verify_command(arguments),
        Command::Explain(arguments) => any_plant::explain_command(arguments),
        Command::Simulate(arguments) => any_plant::simulate_command(arguments),
        Command::New(arguments) => any_plant::new_command(arguments),
        Command::Suspects(arguments) => libraries::suspects_command(arguments.name.as_deref()),
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

/// Prints progress with the time since the start.
fn progress() -> impl FnMut(&str) {
    let began = Instant::now();
    move |text: &str| eprintln!("discrepancy: {:5.1} s: {text}", began.elapsed().as_secs_f64())
}

fn close_command(arguments: &NameArguments, tests: &[PathBuf]) -> Result<Exit, CommandError> {
    let NameArguments { records, without, suspects, marginal_likelihoods, discover, no_discover } = arguments;
    threads(records.threads);
    known_effects(without)?;
    tests.iter().try_for_each(|test| is_there(test))?;
    never_seen(&records.train, tests)?;
    let text = std::fs::read_to_string(&records.rig)
        .map_err(|why| CommandError::File { file: records.rig.clone(), why })?;
    if is_model_file(&text) {
        current_form(&records.rig, &text)?;
        if let Some(file) = suspects {
            return Err(CommandError::BadData(format!(
                "--suspects {}: beside a rig file alone; a model file has its own [[suspects]]",
                file.display()
            )));
        }
        return any_plant::close_command(arguments, tests);
    }
    if *discover || *no_discover {
        let why = "--discover, --no-discover: of a model file alone; the rig has its catalogue";
        return Err(CommandError::BadData(why.into()));
    }
    let model = PathBuf::from("rig.toml");
    let out = records.out.clone().unwrap_or_else(|| PathBuf::from("discrepancy-results"));
    let inputs = [&records.rig].into_iter().chain(&records.train).chain(tests);
    let out = Folder::open(&out, inputs.chain(&records.read.mapping).chain(suspects))?;
    // Reported before a minute of work.
    for name in [Path::new(REPORT_JSON), Path::new(REPORT_HTML), &model] {
        out.file(name)?;
    }
    let mut progress = progress();
    let task = Task {
        rig: records.rig.clone(),
        train: records.train.clone(),
        test: one_test(tests)?,
        options: records.read.options(),
        without: without.clone(),
        suspects: suspects.as_ref().map_or(Ok(Vec::new()), |file| read_suspects(file))?,
        marginal_likelihoods: *marginal_likelihoods,
    };
    let outcome = close(&task, &mut progress)?;
    let Outcome { report, extended, pictures, experiment, not_judged } = &outcome;
    print(&in_words(report))?;
    if let Some(why) = not_judged {
        print(&format!("The model was not judged on the held-out record: {why}\n"))?;
    }
    out.clear(&model)?;
    out.write_json(REPORT_JSON, report)?;
    out.write(REPORT_HTML, &page::page(report, pictures))?;
    if let Some(extended) = extended {
        out.write(&model, extended)?;
    }
    let proposed = report.next.as_ref().and_then(|next| next.experiment.as_ref());
    if let Some((name, experiment)) = proposed.zip(experiment.as_ref()) {
        out.write(name, experiment)?;
    }
    progress(&format!("report.json and report.html are in {}", out.path.display()));
    Ok(match not_judged {
        Some(_) => Exit::BadInput,
        None => exit_of(report, records.read.strict),
    })
}

/// The exit code of a judged report. A verdict that the held-out record contradicts is a broken bound for who asked to be
/// strict; one that it confirms, and that is not the whole, is none.
fn exit_of(report: &Report, strict: bool) -> Exit {
    let contradicted =
        report.held_out_finding().is_some_and(|objection| objection != HeldOutFinding::MoreMissing);
    match report.verdict {
        Verdict::BadData => Exit::BadInput,
        _ if strict && contradicted => Exit::BoundBroken,
        _ => Exit::Good,
    }
}

/// Models of one balance had another form, which says what to do instead.
fn current_form(file: &Path, text: &str) -> Result<(), CommandError> {
    let Some(successor) = successor(text) else { return Ok(()) };
    Err(CommandError::BadData(format!(
        "{}: kind: models of one balance are model files now: begin with discrepancy/models/{successor}, see docs/model-files.md",
        file.display()
    )))
}

/// No record is given twice, and none is held out that was trained on. Only names are looked at: nothing is opened.
fn never_seen(train: &[PathBuf], tests: &[PathBuf]) -> Result<(), CommandError> {
    let canonical = |file: &PathBuf| std::fs::canonicalize(file).unwrap_or_else(|_| file.clone());
    let mut seen = BTreeSet::new();
    if let Some(twice) = train.iter().find(|file| !seen.insert(canonical(file))) {
        let twice = twice.display();
        return Err(CommandError::BadData(format!(
            "--train {twice}: given twice: the same noise would count as two measurements"
        )));
    }
    let Some(test) = tests.iter().find(|file| seen.contains(&canonical(file))) else { return Ok(()) };
    let test = test.display();
    Err(CommandError::BadData(format!(
        "--test {test}: a training record as well: a model is judged on a record that it never saw"
    )))
}

/// An effect that is not left out because its name was mistyped would be found.
fn known_effects(without: &[String]) -> Result<(), CommandError> {
    let Some(name) = without.iter().find(|name| sheet(name).is_none()) else { return Ok(()) };
    let known = SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>().join(", ");
    Err(CommandError::UnknownEffect { name: name.clone(), known })
}

/// The suspects of a file beside a rig file.
fn read_suspects(file: &Path) -> Result<Vec<&'static Suspect>, CommandError> {
    let text =
        std::fs::read_to_string(file).map_err(|why| CommandError::File { file: file.to_owned(), why })?;
    Ok(suspects::read(&text, &file.display().to_string()).map_err(WorkflowError::from)?)
}

/// Refuses a missing held-out record before the work, without opening it.
fn is_there(file: &Path) -> Result<(), CommandError> {
    std::fs::metadata(file)
        .map_or_else(|why| Err(CommandError::File { file: file.to_owned(), why }), |_| Ok(()))
}

/// The held-out record of a rig: one at a time.
fn one_test(tests: &[PathBuf]) -> Result<Option<PathBuf>, CommandError> {
    match tests {
        [] => Ok(None),
        [one] => Ok(Some(one.clone())),
        many => Err(CommandError::BadData(format!(
            "--test: {} records: a rig is judged on one at a time; judge the others with verify",
            many.len()
        ))),
    }
}

fn check_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let out = folder(arguments)?;
    if std::fs::read_to_string(&arguments.rig).is_ok_and(|text| is_model_file(&text)) {
        return any_plant::check_command(arguments, out.as_ref());
    }
    let rig = RigFile::read(&arguments.rig)?.rig;
    let mut all = Vec::new();
    let mut text = String::new();
    for path in &arguments.train {
        let report = open(path, &arguments.read.options(), &rig)?.checked.report;
        let fit = if report.usable { "can be used" } else { "cannot be used" };
        let _ = writeln!(text, "{}: {} rows, {:.3} s: {fit}", report.file, report.rows, report.length_s);
        for finding in &report.findings {
            let _ = writeln!(text, "  {}{}", if finding.fatal { "fatal: " } else { "" }, finding.text);
        }
        for (channel, check) in &report.channels {
            let shown = |value: Option<f64>| value.map_or("unknown".to_owned(), significant);
            let (noise, quantum) = (shown(check.noise), shown(check.quantum));
            let _ = writeln!(
                text,
                "  {channel}: noise {noise}, quantum {quantum}, {:.2} % unusable",
                check.unusable * 100.0
            );
        }
        all.push(report);
    }
    print(&text)?;
    if let Some(out) = out {
        out.write_json("checks.json", &all)?;
    }
    Ok(if all.iter().all(|report| report.usable) { Exit::Good } else { Exit::BadInput })
}

fn calibrate_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let out = folder(arguments)?;
    let (rig_file, gridded) = gridded_records(arguments)?;
    let engine = Engine::new(&gridded, &rig_file.rig);
    let calibrated = calibrate(&engine, &Linearisation::at_baseline(&engine));
    let tables = calibrate_tables(&engine, &calibrated).ok_or_else(|| {
        CommandError::BadData("what fits these records best is out of the rig file's ranges".to_owned())
    })?;
    let quantities = tables.quantities;
    let mut text = String::new();
    for quantity in &quantities {
        let _ = match (quantity.standard_error, quantity.before) {
            (Some(_), Some(before)) => writeln!(text, "{} (rig file: {before})", quantity_in_words(quantity)),
            (Some(_), None) => writeln!(text, "{}", quantity_in_words(quantity)),
            (None, _) => writeln!(text, "{}: not determined by these records", quantity.name),
        };
    }
    print(&text)?;
    if let Some(out) = out {
        out.write_json("parameters.json", &quantities)?;
        let records: Vec<String> = arguments.train.iter().map(|path| path.display().to_string()).collect();
        let mass_axis = workflow::mass_axis(gridded[0].measured);
        let text =
            crate::extend::extend(&rig_file.text, &rig_file.file, &[], &tables.changed, mass_axis, &records)
                .map_err(WorkflowError::from)?;
        out.write("rig.toml", &text)?;
    }
    Ok(Exit::Good)
}

fn locate_command(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let out = folder(arguments)?;
    let (rig_file, gridded) = gridded_records(arguments)?;
    let mut progress = progress();
    let mut located = locate::locate(&rig_file.rig, &gridded, &mut progress);
    let engine = Engine::new(&gridded, &rig_file.rig);
    let dependence = workflow::term_of_rig_file(&engine, &located.unknowns, &mut progress);
    let mut text = String::new();
    for bar in &located.location.balances {
        let _ = writeln!(
            text,
            "{}: {:.2} times its noise, rms {:.4} {}",
            bar.balance, bar.birge_ratio, bar.rms, bar.unit
        );
    }
    if let Some(term) = &dependence {
        let _ = writeln!(text, "{} depends on {}", term.balance, term.strongest());
    }
    located.location.dependence = dependence;
    print(&text)?;
    if let Some(out) = out {
        out.write_json("location.json", &located.location)?;
    }
    Ok(Exit::Good)
}

fn extend_command(arguments: &ExtendArguments) -> Result<Exit, CommandError> {
    let text = std::fs::read_to_string(&arguments.rig)
        .map_err(|why| CommandError::File { file: arguments.rig.clone(), why })?;
    let text = if is_model_file(&text) {
        current_form(&arguments.rig, &text)?;
        any_plant::extended_text(&arguments.rig, &text, &arguments.report)?
    } else {
        let report = any_plant::report_of(&arguments.report, false)?;
        let report = any_plant::with_keys((&arguments.report, report), &OF_RIG)?;
        workflow::extended(&RigFile::read(&arguments.rig)?, &report).map_err(WorkflowError::from)?
    };
    spare(&arguments.out, &[&arguments.rig, &arguments.report])?;
    folder::write(&arguments.out, &text)?;
    Ok(Exit::Good)
}

fn verify_command(arguments: &VerifyArguments) -> Result<Exit, CommandError> {
    let inputs = [&arguments.rig, &arguments.extended, &arguments.test];
    let out = arguments.out.as_ref().map(|out| Folder::open(out, inputs)).transpose()?;
    let [before, after] = [RigFile::read(&arguments.rig)?.rig, RigFile::read(&arguments.extended)?.rig];
    let opened = open(&arguments.test, &arguments.read.options(), &before)?;
    let Some(gridded) = opened.gridded else { return Err(CommandError::BadData(opened.checked.why_not())) };
    let verified = verify::verify(&before, &after, &gridded, &mut progress());
    let mut text = String::new();
    for (signal, misfit) in &verified.misfit {
        let closed =
            misfit.closed.map_or("no gap".into(), |closed| format!("{:.1} % closed", closed * 100.0));
        let _ = writeln!(
            text,
            "{signal}: before {:.4e}, after {:.4e}, noise {:.4e}: {closed}",
            misfit.before, misfit.after, misfit.floor
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
    for (signal, error) in &verified.verification.free_run_nrmse_percent {
        let _ = writeln!(text, "{signal}: free run {:.2} % before, {:.2} % after", error.before, error.after);
    }
    verified.verification.physical.iter().for_each(|unphysical| text.push_str(&format!("{unphysical}\n")));
    print(&text)?;
    if let Some(out) = out {
        let shown = VerifiedFile { misfit: &verified.misfit, verification: &verified.verification };
        out.write_json("verification.json", &shown)?;
    }
    Ok(if *confirmed { Exit::Good } else { Exit::BoundBroken })
}

/// `verification.json`: these fields of a report.
#[derive(serde::Serialize)]
struct VerifiedFile<'a> {
    #[serde(rename = "gap")]
    misfit: &'a BTreeMap<String, SignalMisfit>,
    verification: &'a Verification,
}

fn next_command(arguments: &NextArguments) -> Result<Exit, CommandError> {
    let rig_file = RigFile::read(&arguments.rig)?;
    let report = any_plant::with_keys((&arguments.report, read_report(&arguments.report)?), &OF_RIG)?;
    let Some(proposal) = workflow::proposal(&rig_file, &report, &mut progress()) else {
        print("The report names nothing that cannot be told apart.\n")?;
        return Ok(Exit::Good);
    };
    print(&format!("{}\n", proposal.next.reason))?;
    match (&proposal.experiment_toml, &proposal.next.otherwise) {
        (Some(experiment), _) => {
            spare(&arguments.out, &[&arguments.rig, &arguments.report])?;
            folder::write(&arguments.out, experiment)?;
        }
        (None, Some(otherwise)) => print(&format!("{otherwise}\n"))?,
        (None, None) => {}
    }
    Ok(Exit::Good)
}

fn gridded_records(arguments: &RecordArguments) -> Result<(RigFile, Vec<GriddedRecord>), CommandError> {
    threads(arguments.threads);
    never_seen(&arguments.train, &[])?;
    let rig_file = RigFile::read(&arguments.rig)?;
    let mut all = Vec::new();
    for path in &arguments.train {
        let opened = open(path, &arguments.read.options(), &rig_file.rig)?;
        let Some(gridded) = opened.gridded else {
            return Err(CommandError::BadData(opened.checked.why_not()));
        };
        all.push(gridded);
    }
    workflow::on_shared_axes(&mut all)?;
    Ok((rig_file, all))
}

fn read_report(path: &Path) -> Result<serde_json::Value, CommandError> {
    let bytes = std::fs::read(path).map_err(|why| CommandError::File { file: path.to_owned(), why })?;
    serde_json::from_slice(&bytes).map_err(|why| CommandError::Report { file: path.to_owned(), why })
}

/// The output folder, opened before the work.
fn folder(arguments: &RecordArguments) -> Result<Option<Folder>, CommandError> {
    let inputs = || [&arguments.rig].into_iter().chain(&arguments.train).chain(&arguments.read.mapping);
    Ok(arguments.out.as_ref().map(|out| Folder::open(out, inputs())).transpose()?)
}

/// A file to be written that is none of those that are read.
fn spare(out: &Path, inputs: &[&PathBuf]) -> Result<(), CommandError> {
    let canonical = std::fs::canonicalize(out).ok();
    let is_input =
        canonical.is_some() && inputs.iter().any(|file| std::fs::canonicalize(file).ok() == canonical);
    if is_input { Err(FolderError::Input { file: out.to_owned() }.into()) } else { Ok(()) }
}

/// Standard output; a reader that has gone is no matter.
fn print(text: &str) -> Result<(), CommandError> {
    match io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush()) {
        Err(why) if why.kind() != io::ErrorKind::BrokenPipe => {
            Err(CommandError::File { file: "standard output".into(), why })
        }
        _ => Ok(()),
    }
}

/// Says on Ctrl-C and SIGTERM that nothing is written yet, and ends: what is written is written at the end, whole.
pub fn end_when_asked() {
    let asked = [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM];
    // Without a thread for it the signals end the program without a word, as they did before.
    let Ok(mut signals) = signal_hook::iterator::Signals::new(asked) else { return };
    let _ = thread::Builder::new().name("signals".into()).spawn(move || {
        if signals.forever().next().is_some() {
            eprintln!("discrepancy: interrupted; results are written at the end, so that there are none");
            std::process::exit(Exit::Interrupted as i32);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(verdict: Verdict, verification: Verification) -> Report {
        Report { verdict, verification: Some(verification), ..Report::default() }
    }

    /// Without and with `--strict`.
    fn exits(report: &Report) -> [Exit; 2] {
        [false, true].map(|strict| exit_of(report, strict))
    }

    #[test]
    fn only_who_is_strict_is_refused_a_finding_that_the_held_out_record_does_not_confirm() {
        let report =
            |verdict, confirmed| report(verdict, Verification { confirmed, ..Verification::default() });
        let unconfirmed = report(Verdict::Named, false);
        assert_eq!(exits(&unconfirmed), [Exit::Good, Exit::BoundBroken]);
        assert_eq!(exit_of(&report(Verdict::Named, true), true), Exit::Good);
        // Nothing was found, so that there is nothing to confirm.
        assert_eq!(exit_of(&report(Verdict::NothingMissing, false), true), Exit::Good);
        assert_eq!(exit_of(&report(Verdict::BadData, false), true), Exit::BadInput);
    }

    #[test]
    fn nothing_missing_that_the_held_out_record_contradicts_is_refused_to_who_is_strict() {
        let report = |verdict, confirmed, worse| {
            let more_missing = true;
            report(verdict, Verification { confirmed, worse, more_missing, ..Verification::default() })
        };
        let contradicted = report(Verdict::NothingMissing, false, false);
        assert_eq!(exits(&contradicted), [Exit::Good, Exit::BoundBroken]);
        assert_eq!(exit_of(&report(Verdict::NothingMissing, false, true), true), Exit::BoundBroken);
        // The finding is right, and not the whole.
        assert_eq!(exit_of(&report(Verdict::Named, true, false), true), Exit::Good);
        assert_eq!(exit_of(&report(Verdict::BadData, false, true), true), Exit::BadInput);
    }
}
