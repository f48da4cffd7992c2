//! The report of a model file, in the model's own names and units.

mod judgement;

use super::adequacy::Residual;
use super::discover::{DiscoveredTerm, Located};
use super::held_out::{Alternative, HeldOutResidual, Traces};
use super::judge::{by_effect, is_one_effect};
use super::record::MeasuredRecord;
use super::select::{AcceptedSuspect, Fitted, SearchResult};
use super::structure::Structure;
use super::{bounds, covariance, look};
use crate::Verdict;
use crate::estimator::Outcome;
use crate::held_out::WORSE;
use judgement::judgement;
use model::{Change, Model};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of `report.json` of a model file.
pub(super) const SCHEMA_VERSION: u32 = 1;

/// `report.json`. Fields with `skip_deserializing` are for people and for other languages: no program here reads them back. Those
/// of before 0.1.0 lack some.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ModelReport {
    /// 1; a report with another version extends no model file.
    pub schema_version: u32,
    /// Path of the model file as it was given.
    pub model: String,
    /// Name of the model, as its file says.
    pub name: String,
    /// Names of the files of the training records, without folders.
    pub train: Vec<String>,
    /// By the training records alone; a held-out record sets `confirmed` and `taken_back`.
    pub verdict: Verdict,
    /// What was found, or was not, in a sentence.
    pub headline: String,
    /// Whether held-out records get better with what was named; `None` without any, or where nothing was named.
    pub confirmed: Option<bool>,
    /// Whether a held-out record that gets worse takes back what `named` and `discovered` have.
    pub taken_back: bool,
    /// Whether residuals of the reported model on the training records are no more than noise and declared error.
    pub adequate: bool,
    /// Its residual of each output, and the noise.
    #[serde(skip_deserializing)]
    pub residuals: Vec<Residual>,
    /// Numbers of the extended model, with what they were beside the model alone.
    pub parameters: Vec<ParameterEstimate>,
    /// Residuals on the training records.
    #[serde(skip_deserializing)]
    pub training: Vec<ResidualComparison>,
    /// Residuals on each held-out record.
    #[serde(skip_deserializing)]
    pub held_out: Vec<ResidualComparison>,
    /// The same with each alternative in place of what was named.
    #[serde(skip_deserializing)]
    pub held_out_alternatives: Vec<AlternativeResidual>,
    /// Missing suspects in the order in which they were taken; empty where none passed its gates.
    pub named: Vec<NamedSuspect>,
    /// Where nothing was named and a search found some: terms that no suspect describes.
    pub discovered: Vec<DiscoveredTerm>,
    /// Where the residual of the model alone comes from, whatever the suspects are; `None` where no place explains enough of it.
    #[serde(skip_deserializing)]
    pub located: Option<Located>,
    /// Every suspect beside the model alone, the most likely first.
    #[serde(skip_deserializing)]
    pub suspects: Vec<SuspectJudgement>,
    /// Identifiability of numbers and suspects on the training records.
    #[serde(skip_deserializing)]
    pub structure: Structure,
    /// Remarks on records, fits and numbers, in sentences.
    pub notes: Vec<String>,
    /// How many of them, the first, say that the model explains nothing of an output.
    #[serde(skip)]
    pub unreached: usize,
    /// States, definitions, outputs and suspects as the file has them.
    pub equations: Vec<String>,
    /// What it declares beside them: records, columns, units, ranges, known numbers.
    pub declared: Vec<String>,
}

/// A parameter: estimate, error, and the estimate without the named suspects.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// In the model file; of a number of one record with the record's name, a fitted start as `start of x in a.csv`.
    pub name: String,
    /// The term or suspect that it belongs to; `None` for a number of the model.
    pub(crate) suspect: Option<String>,
    /// Unit of value, error and baseline; empty in a report that lacks it.
    #[serde(default)]
    pub unit: String,
    /// Estimate of the extended model.
    pub value: f64,
    /// By coloured residuals or by blocks of time, the larger, and by a law that is only near; `None` where the records do not
    /// determine it, or it is at the end of its range.
    pub standard_error: Option<f64>,
    /// Fitted without what was named.
    pub(crate) baseline: Option<f64>,
    /// Whether the estimate is at the end of its range, within rounding.
    pub is_at_bound: bool,
    /// Its range has values of one sign alone.
    #[serde(skip)]
    pub(crate) is_of_one_sign: bool,
    /// What the file says it is, within how much.
    #[serde(skip)]
    pub(crate) expected: Option<[f64; 2]>,
}

/// Residuals of an output under both models.
#[derive(Clone, Debug, Serialize)]
pub struct ResidualComparison {
    /// Name of the record's file, without folders; `training` for all training records together.
    pub record: String,
    /// Its name in the model file.
    pub output: String,
    /// Unit of both root mean squares.
    pub unit: String,
    /// Root mean square of measured less the model alone.
    pub rms_before: f64,
    /// Root mean square of measured less the extended model.
    pub rms_after: f64,
    /// After over before.
    pub ratio: Option<f64>,
    /// Number of samples in both.
    pub rows: usize,
}

/// Residuals of a held-out record with an alternative in place of the named suspect.
#[derive(Clone, Debug, Serialize)]
pub struct AlternativeResidual {
    /// Name of the alternative.
    pub suspect: String,
    /// Name of the suspect whose place it takes.
    pub instead_of: String,
    /// As of the reported model, with the alternative in `rms_after`.
    #[serde(flatten)]
    pub residual: ResidualComparison,
}

/// A suspect that is missing in the model.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NamedSuspect {
    /// Its name in the model file.
    pub suspect: String,
    /// What it is one form of.
    pub effect: Option<String>,
    /// The input, equation, definition or output that it changes, such as `equation of v`.
    #[serde(default)]
    pub place: String,
    /// How it stands there.
    #[serde(default)]
    pub term: String,
    #[serde(default)]
    pub(crate) share_explained: f64,
    /// Others that explain the records as well, also where they fail another gate than the likelihood.
    #[serde(default)]
    pub alternatives: Vec<String>,
}

/// Likelihood gain, gates and probability of a suspect.
#[derive(Clone, Debug, Serialize)]
pub struct SuspectJudgement {
    /// Its name in the model file.
    pub suspect: String,
    pub(crate) place: String,
    /// Whether the file has it as a decoy: one that does better than every suspect ends the search.
    pub is_decoy: bool,
    /// Posterior among all suspects and none of them, beside the model alone, 0 to 1.
    pub probability: f64,
    /// Twice the gain in log likelihood, and what chance is granted of it.
    pub(crate) gain: f64,
    pub(crate) penalty: f64,
    /// Share of the residual power, on folds in time.
    pub(crate) share: f64,
    /// Mean gain of a fold over its standard error.
    #[serde(rename = "clustered_t")]
    pub(crate) fold_t: f64,
    /// What became of it, and by which gate, in words.
    pub decision: String,
    pub(crate) numbers: Vec<ParameterEstimate>,
}

pub(crate) fn report(file: &Path, found: &SearchResult<'_>, structure: &Structure) -> ModelReport {
    let fitting = &found.baseline.fitting;
    let model = fitting.model;
    let effect = |suspect: usize| {
        let suspect = &model.suspects[suspect];
        suspect.effect.as_ref().unwrap_or(&suspect.name).as_str()
    };
    let names: Vec<&str> =
        found.accepted.iter().map(|accepted| effect(accepted.evaluation.suspect)).collect();
    // Forms of one effect that cannot be told apart are one finding.
    let pairs = found
        .accepted
        .iter()
        .flat_map(|accepted| accepted.alternatives.iter().map(|other| (*other, accepted.evaluation.suspect)));
    let others: Vec<usize> =
        pairs.filter(|(other, of)| effect(*other) != effect(*of)).map(|(one, _)| one).collect();
    let is_near_another = found.accepted.iter().any(|accepted| {
        accepted.near.iter().any(|other| !is_one_effect(model, *other, accepted.evaluation.suspect))
    });
    let verdict = match () {
        () if found.decoy.is_some() => Verdict::OutsideCatalogue,
        () if !others.is_empty() || is_near_another => Verdict::Ambiguous,
        () if found.accepted.is_empty() => Verdict::NothingMissing,
        () => Verdict::Named,
    };
    let named: Vec<NamedSuspect> = found
        .accepted
        .iter()
        .map(|accepted| NamedSuspect {
            suspect: model.suspects[accepted.evaluation.suspect].name.clone(),
            effect: model.suspects[accepted.evaluation.suspect].effect.clone(),
            place: place(model, accepted.evaluation.suspect),
            term: term(model, accepted.evaluation.suspect),
            share_explained: accepted.evaluation.share,
            alternatives: accepted
                .alternatives
                .iter()
                .chain(&accepted.near)
                .map(|other| model.suspects[*other].name.clone())
                .collect(),
        })
        .collect();
    let headline = match verdict {
        Verdict::NothingMissing if found.first.is_empty() => {
            "The model was fitted; it has no suspects".to_owned()
        }
        Verdict::NothingMissing => "No suspect is missing beyond doubt".to_owned(),
        Verdict::OutsideCatalogue => {
            let decoy = &model.suspects[found.decoy.expect("of this verdict")].name;
            format!(
                "Something is missing that is no suspect: the decoy {decoy} does better than each of them"
            )
        }
        Verdict::Ambiguous if !others.is_empty() => {
            let others = by_effect(model, &others);
            format!("{} is missing, or {others}: the records cannot tell", names.join(" and "))
        }
        _ => format!("{} {} missing", names.join(" and "), if names.len() == 1 { "is" } else { "are" }),
    };
    let either = |all: &[usize]| {
        all.iter().map(|one| model.suspects[*one].name.as_str()).collect::<Vec<_>>().join(" or ")
    };
    let name = |accepted: &AcceptedSuspect| model.suspects[accepted.evaluation.suspect].name.as_str();
    let forms = found.accepted.iter().filter(|one| others.is_empty() && !one.alternatives.is_empty());
    let forms: String = forms
        .map(|one| {
            let others = either(&one.alternatives);
            format!(", in the form of {} or {others}: the records cannot tell", name(one))
        })
        .collect();
    let near = found.accepted.iter().filter(|one| !one.near.is_empty());
    let near: String =
        near.map(|one| format!("; {} cannot be told from {}", name(one), either(&one.near))).collect();
    let headline = headline + &forms + &near;
    let mut suspects: Vec<SuspectJudgement> =
        found.first.iter().map(|evaluation| judgement(fitting, evaluation, found)).collect();
    suspects.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.gain.total_cmp(&a.gain)));
    let mut notes = look::beyond_reach(&found.baseline);
    let unreached = notes.len();
    notes.extend(notes_of(fitting.records));
    let failed = found.failed.iter();
    notes.extend(failed.map(|(suspect, why)| {
        format!("suspect {}: cannot be simulated: {why}", model.suspects[*suspect].name)
    }));
    notes.extend(found.notes.iter().cloned());
    for (name, fitted) in [("the model alone", &found.baseline), ("the extended model", &found.extended)] {
        // Which number ended there is said by itself.
        let doubt = fitted.convergence.doubt().filter(|_| fitted.convergence.outcome != Outcome::Bound);
        notes.extend(doubt.map(|doubt| format!("{name}: {doubt}")));
    }
    let parameters = numbers(&found.extended, &found.baseline, !found.accepted.is_empty());
    notes.extend(bounds::remarks(&parameters));
    let [before, after] = [found.baseline.rms_si(), found.extended.rms_si()];
    let training = (0..model.outputs.len()).map(|output| {
        comparison_of(
            model,
            "training",
            output,
            [before[output], after[output]],
            fitting.count(output) as usize,
        )
    });
    ModelReport {
        schema_version: SCHEMA_VERSION,
        model: file.display().to_string(),
        name: model.name.clone(),
        train: fitting.records.iter().map(|record| record.name.clone()).collect(),
        verdict,
        headline,
        adequate: true,
        parameters,
        training: training.collect(),
        named,
        suspects,
        structure: structure.clone(),
        notes,
        unreached,
        ..ModelReport::default()
    }
}

impl ModelReport {
    /// What held-out records say of what was named. One that gets worse takes the name back.
    pub(crate) fn judge(
        &mut self,
        model: &Model,
        (judged, alternatives): (&[HeldOutResidual], &[Alternative]),
        traces: &[Traces],
    ) {
        let name = |suspect: usize| model.suspects[suspect].name.clone();
        let comparison = |one: &HeldOutResidual| {
            comparison_of(model, &traces[one.record].record, one.output, one.rms_si, one.scored_rows)
        };
        let of_alternative = |alternative: &Alternative| {
            let [suspect, instead_of] = [alternative.suspect, alternative.instead_of].map(name);
            let of = |one: &HeldOutResidual| {
                let (suspect, instead_of) = (suspect.clone(), instead_of.clone());
                AlternativeResidual { suspect, instead_of, residual: comparison(one) }
            };
            alternative.judged.iter().map(of).collect::<Vec<_>>()
        };
        self.held_out_alternatives = alternatives.iter().flat_map(of_alternative).collect();
        self.held_out = judged.iter().map(comparison).collect();
        if self.named.is_empty() && self.discovered.is_empty() {
            return;
        }
        let worse: Vec<&ResidualComparison> =
            self.held_out.iter().filter(|one| one.rms_after > WORSE * one.rms_before).collect();
        let better = self.held_out.iter().any(|one| one.rms_after < one.rms_before / WORSE);
        self.confirmed = Some(better && worse.is_empty());
        if let Some(ResidualComparison { record, output, unit, rms_before, rms_after, .. }) = worse.first() {
            let [before, after] = [rms_before, rms_after].map(|rms| significant(*rms));
            self.headline = format!(
                "{} taken back: on {record} {output} gets worse, {before} to {after} {unit} rms; \
                 the training records alone say: {}",
                self.found_in_words(),
                self.headline
            );
            self.taken_back = true;
            return;
        }
        let about = match () {
            () if better => match self.much_worse().first() {
                Some(much) => format!("; better on what was held out, though {much}"),
                None => "; confirmed on what was held out".to_owned(),
            },
            () => "; what was held out gets neither better nor worse with it".to_owned(),
        };
        self.headline += &about;
    }

    /// What was found, as the beginning of a sentence.
    fn found_in_words(&self) -> String {
        let names: Vec<&str> =
            self.named.iter().map(|one| one.effect.as_ref().unwrap_or(&one.suspect).as_str()).collect();
        match names.len() {
            0 => "What the search found is".to_owned(),
            1 => format!("{} is", names[0]),
            _ => format!("{} are", names.join(" and ")),
        }
    }
}

/// Notes of records, with their names.
pub(super) fn notes_of(records: &[MeasuredRecord]) -> Vec<String> {
    let of = |record: &MeasuredRecord| {
        record.notes.iter().map(|note| format!("{}: {note}", record.name)).collect::<Vec<_>>()
    };
    records.iter().flat_map(of).collect()
}

pub(crate) fn significant(value: f64) -> String {
    pagekit::significant::short(value)
}

fn comparison_of(
    model: &Model,
    record: &str,
    output: usize,
    rms_si: [f64; 2],
    rows: usize,
) -> ResidualComparison {
    let output = &model.outputs[output];
    let [rms_before, rms_after] = rms_si.map(|rms| rms / output.unit.factor);
    let ratio = (rms_before > 0.0).then(|| rms_after / rms_before);
    let (record, name, unit) = (record.to_owned(), output.name.clone(), output.unit.text.clone());
    ResidualComparison { record, output: name, unit, rms_before, rms_after, ratio, rows }
}

/// What tells a model from another one: its equations and suspects, not its numbers.
pub(super) fn equations(model: &Model) -> Vec<String> {
    let is_of_model = |suspect: Option<usize>| suspect.is_none();
    let states = model.states.iter().filter(|one| is_of_model(one.suspect));
    let definitions = model.definitions.iter().filter(|one| is_of_model(one.suspect));
    states
        .map(|one| format!("d{}/dt = {}", one.name, one.derivative.text))
        .chain(definitions.map(|one| format!("{} = {}", one.name, one.value.text)))
        .chain(model.frictions.iter().filter(|one| is_of_model(one.suspect)).map(|one| friction(model, one)))
        .chain(model.outputs.iter().map(|one| format!("output {} = {}", one.name, one.value.text)))
        .chain(
            (0..model.suspects.len()).map(|one| {
                format!("{}, {}: {}", model.suspects[one].name, place(model, one), term(model, one))
            }),
        )
        .collect()
}

/// Dry friction in words.
pub(crate) fn friction(model: &Model, friction: &model::Friction) -> String {
    let (name, velocity) = (&friction.name, &model.states[friction.velocity].name);
    let (sliding, breakaway) = (&friction.sliding.text, &friction.breakaway.text);
    let unit = &friction.unit.text;
    format!("{name} = {sliding} against {velocity}, which it holds at rest up to {breakaway}    in {unit}")
}

pub(crate) fn place(model: &Model, suspect: usize) -> String {
    let target = model.suspects[suspect].target;
    let kind = match target {
        model::Target::Input(_) => "input",
        model::Target::State(_) => "equation of",
        model::Target::Definition(_) => "definition",
        model::Target::Output(_) => "output",
    };
    format!("{kind} {}", model.target_name(target))
}

pub(crate) fn term(model: &Model, suspect: usize) -> String {
    let suspect = &model.suspects[suspect];
    let name = model.target_name(suspect.target);
    let text = &suspect.expression.text;
    match (suspect.change, suspect.target) {
        (Change::Add, model::Target::State(_)) => format!("d{name}/dt = … + ({text})"),
        (Change::Multiply, model::Target::State(_)) => format!("d{name}/dt = (…) * ({text})"),
        (Change::Replace, model::Target::State(_)) => format!("d{name}/dt = {text}"),
        (Change::Add, _) => format!("{name} + ({text})"),
        (Change::Multiply, _) => format!("{name} * ({text})"),
        (Change::Replace, _) => text.clone(),
    }
}

/// Numbers of a fit, with their errors.
pub(super) fn numbers(fitted: &Fitted<'_>, baseline: &Fitted<'_>, has_law: bool) -> Vec<ParameterEstimate> {
    let fitting = &fitted.fitting;
    let errors = covariance::errors(fitted, baseline, has_law);
    let all = fitting.unknowns.iter().zip(&fitted.point.values_si).zip(errors);
    all.map(|((unknown, value), error)| {
        let unit = fitting.unit_of(unknown);
        let is_at_bound = bounds::is_at_bound(*value, unknown.range_si);
        ParameterEstimate {
            name: fitting.name_of(unknown),
            suspect: fitting.suspect_of(unknown).map(|suspect| fitting.model.suspects[suspect].name.clone()),
            unit: unit.text.clone(),
            value: value / unit.factor,
            standard_error: error.filter(|_| !is_at_bound).map(|error| error.total() / unit.factor),
            baseline: covariance::before(baseline, unknown.id).map(|before| before / unit.factor),
            is_at_bound,
            is_of_one_sign: unknown.range_si[0] >= 0.0 || unknown.range_si[1] <= 0.0,
            expected: unknown.prior_si.map(|prior| prior.map(|value| value / unit.factor)),
        }
    })
    .collect()
}
