//! A competitor of the workflow: least squares by multiple shooting over its catalogue, effects and parameters chosen by BIC.
//!
//! | file | holds |
//! |---|---|
//! | `selection.rs` | stepwise selection by the criterion |
//! | `rig_fit.rs` | least squares in the simulator |
//!
//! Records are read, checked, cut into windows and whitened by the code of the workflow, so that nothing but estimator and
//! decision differ. The held-out record is not opened.

mod rig_fit;
mod selection;

use clap::Parser;
use discrepancy::candidates::Candidate;
use discrepancy::engine::Engine;
use discrepancy::parameters::PARAMETERS;
use discrepancy::report::{NamedEffect, Quantity, Report, SCHEMA_VERSION, Verdict, place_of};
use discrepancy::workflow::{RigFile, open};
use rig_fit::{Fit, RigProblem, Term};
use selection::{Problem, Selected, select};
use std::error::Error;
use std::fs;
use std::path::PathBuf;

/// Chooses effects by BIC, fitted in the simulator by multiple shooting; writes report.json.
#[derive(Debug, Parser)]
#[command(name = "shooting-bic")]
enum Cli {
    /// As the workflow's command of this name.
    Close {
        #[arg(long)]
        rig: PathBuf,
        #[arg(long, required = true, num_args = 1..)]
        train: Vec<PathBuf>,
        /// Held-out record, as the workflow takes one; it is not opened.
        #[arg(long)]
        test: PathBuf,
        /// Folder that report.json goes into.
        #[arg(long)]
        out: PathBuf,
        /// Processors used; all by default.
        #[arg(long, default_value_t = 0)]
        threads: usize,
    },
}

fn main() -> Result<(), Box<dyn Error>> {
    let Cli::Close { rig, train, out, threads, .. } = Cli::parse();
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let rig = RigFile::read(&rig)?.rig;
    let mut records = Vec::new();
    for path in &train {
        records.extend(open(path, &records::ReadOptions::default(), &rig)?.gridded);
    }
    let report = if records.len() < train.len() {
        Report { schema_version: SCHEMA_VERSION, verdict: Verdict::BadData, ..Report::default() }
    } else {
        let measured = records[0].measured;
        if records.iter().any(|record| record.measured != measured) {
            return Err("the records do not show the same axes".into());
        }
        let engine = Engine::new(&records, &rig);
        let linked = records.iter().any(|record| record.linked);
        let problem = RigProblem::new(&engine, Candidate::all(&rig, measured, linked, &[]));
        let found =
            select(&problem, &mut |fit, criterion| eprintln!("BIC {criterion:.1}: {}", described(fit)));
        let found = found.ok_or("the rig file's own model cannot be simulated")?;
        report_of(&problem, &found, |at, factor| {
            let (value, unit) = PARAMETERS[at].value(&rig, measured);
            (value, value * factor, unit)
        })
    };
    fs::create_dir_all(&out)?;
    fs::write(out.join("report.json"), serde_json::to_string_pretty(&report)?)?;
    Ok(())
}

fn described(fit: &Fit) -> String {
    let term = |term: &Term| match term {
        Term::Effect { candidate, coordinates } => format!("{} {coordinates:.2?}", candidate.name()),
        Term::Parameter { at, factor } => format!("{} {factor:.3}", PARAMETERS[*at].name),
    };
    fit.terms.iter().map(term).collect::<Vec<_>>().join(", ")
}

/// The report of what was selected; `of_parameter` gives a parameter's value in the file, its value times a factor, and its unit.
fn report_of(
    problem: &RigProblem<'_>,
    Selected { fit, alternatives }: &Selected<RigProblem<'_>>,
    of_parameter: impl Fn(usize, f64) -> (f64, f64, &'static str),
) -> Report {
    let errors = fit.standard_errors(problem.count());
    let mut errors = errors.iter();
    let (mut named, mut parameters) = (Vec::new(), Vec::new());
    for (term, others) in fit.terms.iter().zip(alternatives) {
        match term {
            Term::Effect { candidate, coordinates } => {
                let errors: Vec<f64> = errors.by_ref().take(coordinates.len()).copied().collect();
                let others = others.iter().filter_map(|term| match term {
                    Term::Effect { candidate, coordinates } => {
                        Some(entry(candidate, coordinates, &[], Vec::new()))
                    }
                    Term::Parameter { .. } => None,
                });
                named.push(entry(candidate, coordinates, &errors, others.collect()));
            }
            Term::Parameter { at, factor } => {
                let (before, value, unit) = of_parameter(*at, *factor);
                let error = errors.next().map(|error| error * before.abs()).filter(|error| error.is_finite());
                let name = PARAMETERS[*at].name.to_owned();
                parameters.push(Quantity {
                    name,
                    value,
                    unit: unit.to_owned(),
                    standard_error: error,
                    before: Some(before),
                });
            }
        }
    }
    let verdict = match (named.is_empty(), parameters.is_empty()) {
        (true, true) => Verdict::NothingMissing,
        (true, false) => Verdict::ParametersOnly,
        _ if named.iter().any(|entry: &NamedEffect| !entry.alternatives.is_empty()) => Verdict::Ambiguous,
        _ => Verdict::Named,
    };
    Report { schema_version: SCHEMA_VERSION, verdict, named, parameters, ..Report::default() }
}

/// An effect with its numbers, in the units of its sheet; without errors where none are given.
fn entry(
    candidate: &Candidate,
    coordinates: &[f64],
    errors: &[f64],
    alternatives: Vec<NamedEffect>,
) -> NamedEffect {
    let values = candidate.effect_parameters(coordinates);
    let number = |(key, value): (usize, &f64)| Quantity {
        name: candidate.sheet.keys[key].name.to_owned(),
        value: *value,
        unit: candidate.sheet.keys[key].unit.name().to_owned(),
        standard_error: errors
            .get(key)
            .map(|error| error * candidate.slope(key, coordinates[key]).abs())
            .filter(|error| error.is_finite()),
        before: candidate.baseline(key),
    };
    let parameters = values.iter().enumerate().map(number).collect();
    NamedEffect {
        effect: candidate.sheet.name.to_owned(),
        place: place_of(candidate.place),
        parameters,
        share_explained: f64::NAN, // null: not computed
        amplitude_variation: None,
        alternatives,
    }
}
