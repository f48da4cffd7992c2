//! `close`, `name` and `explain` of a model file of any plant.

use super::{CommandError, Exit, NameArguments, RecordArguments, print, progress, read_report, spare};
use crate::cli::{ExplainArguments, NewArguments, ReadArguments, SimulateArguments};
use crate::folder::{self, Folder};
use model_fit::{
    AlternativeResidual, ClosedModel, Explanation, ModelReport, NewModel, Roles, Search, Verdict, close,
    explained, extended, new_model, preview_records, read, simulate,
};
use pagekit::significant;
use runlog::run_folder::{REPORT_HTML, REPORT_JSON};
use serde::de::{DeserializeOwned, Error as _};
use serde_json::{Error, Value};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub(super) fn close_command(arguments: &NameArguments, tests: &[PathBuf]) -> Result<Exit, CommandError> {
    let NameArguments { records, without, marginal_likelihoods, .. } = arguments;
    no_options_of_a_rig(&records.read, without, *marginal_likelihoods)?;
    let out = records.out.clone().unwrap_or_else(|| PathBuf::from("discrepancy-results"));
    let out = Folder::open(&out, [&records.rig].into_iter().chain(&records.train).chain(tests))?;
    let model = PathBuf::from(records.rig.file_name().unwrap_or("model.toml".as_ref()));
    for name in [Path::new(REPORT_JSON), Path::new(REPORT_HTML), &model] {
        out.file(name)?;
    }
    let mut progress = progress();
    let search = match arguments {
        NameArguments { discover: true, .. } => Search::NothingNamed,
        NameArguments { no_discover: true, .. } => Search::Never,
        _ => Search::MoreThanNoise,
    };
    let closed = close(&records.rig, (&records.train, tests), search, &mut progress)?;
    // A formula that was not asked for explains nothing.
    let is_unexplained = closed.is_unexplained()
        || !arguments.discover
            && closed.report.verdict == Verdict::OutsideCatalogue
            && closed.report.named.is_empty();
    print(&in_words(&closed.report))?;
    if let Some(why) = &closed.not_judged {
        print(&format!("The model was not judged on the held-out record: {why}\n"))?;
    }
    out.clear(&model)?;
    out.write_json(REPORT_JSON, &closed.report)?;
    out.write(REPORT_HTML, &closed.page)?;
    if let Some(extended) = &closed.extended {
        out.write(&model, extended)?;
    }
    progress(&format!("report.json and report.html are in {}", out.path.display()));
    Ok(match closed {
        ClosedModel { not_judged: Some(_), .. } => Exit::BadInput,
        _ if !records.read.strict => Exit::Good,
        _ if is_unexplained || !tests.is_empty() && !closed.is_confirmed() => Exit::BoundBroken,
        _ => Exit::Good,
    })
}

/// `check` of records with a model file: what can be said before anything is fitted.
pub(super) fn check_command(arguments: &RecordArguments, out: Option<&Folder>) -> Result<Exit, CommandError> {
    no_options_of_a_rig(&arguments.read, &[], false)?;
    let all = preview_records(&arguments.rig, &arguments.train)?;
    let mut text = String::new();
    for one in &all {
        let _ = writeln!(text, "{}: {} rows, {:.3} s: can be used", one.record, one.rows, one.length_s);
        one.notes.iter().for_each(|note| text.push_str(&format!("  {note}\n")));
    }
    print(&text)?;
    if let Some(out) = out {
        out.write_json("checks.json", &all)?;
    }
    Ok(Exit::Good)
}

/// Refuses what belongs to a rig file.
fn no_options_of_a_rig(
    read: &ReadArguments,
    without: &[String],
    marginal_likelihoods: bool,
) -> Result<(), CommandError> {
    let given = [
        ("--mapping", read.mapping.is_some(), "[record] of the model file says how records are read"),
        ("--without", !without.is_empty(), "take the suspect out of the model file"),
        ("--marginal-likelihoods", marginal_likelihoods, "its report has the gains of suspects"),
    ];
    match given.iter().find(|(_, given, _)| *given) {
        Some((option, _, instead)) => {
            Err(CommandError::BadData(format!("{option}: not for a model file: {instead}")))
        }
        None => Ok(()),
    }
}

/// `extend`: the text of a model file with what its report names.
pub(super) fn extended_text(model: &Path, text: &str, report: &Path) -> Result<String, CommandError> {
    let report: ModelReport =
        with_keys((report, report_of(report, true)?), &["schema_version", "named", "parameters"])?;
    let is_of = report.is_of(&read(model)?);
    let extended = is_of.and_then(|()| extended(text, model.parent().unwrap_or(Path::new("")), &report));
    extended.map_err(|why| CommandError::BadData(format!("{}: {why}", model.display())))
}

/// Reads the report of a model file, or of a rig file, and refuses one of the other.
pub(super) fn report_of(file: &Path, is_of_model: bool) -> Result<Value, CommandError> {
    let report = read_report(file)?;
    if report.get("headline").is_some() != is_of_model && report.get("schema_version").is_some() {
        let [is, should] = if is_of_model { ["rig", "model"] } else { ["model", "rig"] };
        return Err(CommandError::BadData(format!(
            "{}: the report of a {is} file, and a {should} file is to be extended: give the report.json of its close",
            file.display()
        )));
    }
    Ok(report)
}

/// A report with all of these keys, which each version of a close wrote.
pub(super) fn with_keys<T: DeserializeOwned>(
    (file, report): (&Path, Value),
    keys: &[&'static str],
) -> Result<T, CommandError> {
    let missing = keys.iter().find(|key| report.get(key).is_none());
    let read = missing.map_or_else(|| serde_json::from_value(report), |key| Err(Error::missing_field(key)));
    read.map_err(|why| CommandError::Report { file: file.to_owned(), why })
}

/// `simulate`: a model file beside a record, with the values of the file.
pub(super) fn simulate_command(arguments: &SimulateArguments) -> Result<Exit, CommandError> {
    let SimulateArguments { model, record, out } = arguments;
    out.as_deref().map_or(Ok(()), is_new)?;
    let simulated = simulate(model, record)?;
    let mut text = String::new();
    for one in &simulated.outputs {
        let [residual, signal] = [one.rms, one.signal_rms].map(significant::short);
        let _ = writeln!(
            text,
            "{}: leaves {residual} {unit} rms; its mean alone would leave {signal} {unit}",
            one.output,
            unit = one.unit
        );
    }
    simulated.notes.iter().for_each(|note| text.push_str(&format!("  {note}\n")));
    print(&text)?;
    if let Some(out) = out {
        folder::write(out, &simulated.table)?;
    }
    Ok(Exit::Good)
}

/// Refuses to write over a file.
fn is_new(out: &Path) -> Result<(), CommandError> {
    if !out.exists() {
        return Ok(());
    }
    Err(CommandError::BadData(format!("--out {}: there is a file already: name another", out.display())))
}

/// `explain`: a model file in words, and on a page.
pub(super) fn explain_command(arguments: &ExplainArguments) -> Result<Exit, CommandError> {
    let ExplainArguments { model, train, html } = arguments;
    if let Some(html) = html {
        let read = [model].into_iter().chain(train).collect::<Vec<_>>();
        let refused = || format!("--html {}: it is read here: name another", html.display());
        spare(html, &read).map_err(|_| CommandError::BadData(refused()))?;
    }
    let Explanation { text, page } = explained(model, train)?;
    if let Some(html) = html {
        folder::write(html, &page)?;
    }
    print(&text)?;
    Ok(Exit::Good)
}

/// `new`: a first model file, printed or written where nothing stands yet.
pub(super) fn new_command(arguments: &NewArguments) -> Result<Exit, CommandError> {
    let NewArguments { record, inputs, outputs, out } = arguments;
    let NewModel { text, has_input } = new_model(record, Roles { inputs, outputs })?;
    if !has_input {
        progress()(
            "no column was taken as an input, so that nothing drives this model: --inputs COLUMN names them",
        );
    }
    let Some(out) = out else {
        print(&text)?;
        return Ok(Exit::Good);
    };
    is_new(out)?;
    folder::write(out, &text)?;
    Ok(Exit::Good)
}

/// What a person reads first.
fn in_words(report: &ModelReport) -> String {
    let mut text = format!("{}: {}.\n", report.name, report.headline);
    report.notes.iter().for_each(|note| text.push_str(&format!("  note: {note}\n")));
    for one in report.training.iter().chain(&report.held_out) {
        let _ = writeln!(
            text,
            "{}: {} {:.4} {} rms with the model, {:.4} extended",
            one.record, one.output, one.rms_before, one.unit, one.rms_after
        );
    }
    for AlternativeResidual { suspect, instead_of, residual } in &report.held_out_alternatives {
        let _ = writeln!(
            text,
            "{}: {} {:.4} {} rms with {suspect} in place of {instead_of}",
            residual.record, residual.output, residual.rms_after, residual.unit
        );
    }
    for residual in &report.residuals {
        let what = if residual.is_noise { "mostly noise" } else { "more than noise" };
        let _ = writeln!(text, "what is left on the training records is {what}: {}", residual.in_words());
    }
    for number in &report.parameters {
        let error = match number.standard_error {
            Some(error) => format!("± {}", significant::short(error)),
            None if number.is_at_bound => "at the end of its range".to_owned(),
            None => "not determined".to_owned(),
        };
        let _ = writeln!(
            text,
            "  {} = {} {error} {}",
            number.name,
            significant::short(number.value),
            number.unit
        );
    }
    for suspect in &report.suspects {
        let _ = writeln!(
            text,
            "  suspect {}: {} (beside the model alone its probability is {:.3})",
            suspect.suspect, suspect.decision, suspect.probability
        );
    }
    if let Some(located) = report.located_in_words() {
        let _ = writeln!(text, "  {located}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_report_of_a_rig_file_extends_no_model_file_and_the_other_way_round() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let read = |text: &str, is_of_model| {
            std::fs::write(file.path(), text).unwrap();
            report_of(file.path(), is_of_model).map_err(|why| why.to_string())
        };
        let of_rig = r#"{"schema_version": 1, "summary": ""}"#;
        let of_model = r#"{"schema_version": 1, "headline": ""}"#;
        assert!(read(of_rig, false).is_ok() && read(of_model, true).is_ok());
        for (text, is_of_model, said) in [
            (of_rig, true, "the report of a rig file, and a model file is to be extended"),
            (of_model, false, "the report of a model file, and a rig file is to be extended"),
        ] {
            let refused = read(text, is_of_model).unwrap_err();
            assert!(refused.contains(said), "{refused}");
        }
    }
}
