//! `report.json`: results of the workflow. Schema: `discrepancy/docs/report.md`.
//!
//! Lists have a deterministic order, and nothing depends on time, threads or machine: two runs write the same bytes. Only `gap`
//! and `verification` know the held-out record.

mod declared;
mod next;
mod objection;

use crate::name::{ExplanationKind, Features};
pub use declared::DeclaredSuspect;
pub use model_fit::Verdict;
use model_fit::estimator::Convergence;
pub use next::{Next, SecondExperiment};
pub(crate) use objection::Objection;
use plant::effects::sheet::{Part, Place};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the schema; a new optional field does not change it.
pub const SCHEMA_VERSION: u32 = 1;

#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    pub schema_version: u32,
    pub verdict: Verdict,
    /// The verdict in a sentence or two.
    pub summary: String,
    /// File names of rig and records as given.
    pub inputs: InputFiles,
    /// Missing effects, the best first.
    pub named: Vec<NamedEffect>,
    /// Effects that are too small to be named, the best first; the extended rig file has them.
    pub small: Vec<NamedEffect>,
    /// Baseline parameters that were significantly off.
    pub parameters: Vec<Quantity>,
    /// Parameters that the model moved by an insignificant amount, or beside something outside the catalogue; the extended rig
    /// file has them.
    #[serde(rename = "carried")]
    pub(crate) insignificant: Vec<Quantity>,
    /// Whether the model of the search leaves no more than noise on the searched part of the training records, and the verdict is
    /// not outside the catalogue; null where none was judged.
    pub adequate: Option<bool>,
    /// How the fit of the reported model ended; null where none was fitted.
    pub(crate) fit: Option<Convergence>,
    /// The missing term outside the catalogue.
    pub outside: Option<Outside>,
    /// The effect of the catalogue that comes nearest to a term outside it.
    pub nearest: Option<NamedEffect>,
    /// Where an inadequate model, or the nearest effect, still disagrees with the training records.
    pub remaining: Option<LocatedTerm>,
    /// Per signal of the held-out record, as `drive_position_m`; empty without `--test`.
    #[serde(rename = "gap")]
    pub misfit: BTreeMap<String, Misfit>,
    /// Further figures of the held-out record; null without `--test`.
    pub verification: Option<Verification>,
    /// Suspects of a file beside the rig file; absent without one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub suspects: Vec<DeclaredSuspect>,
    /// All candidates, the best first.
    pub candidates: Vec<Candidate>,
    /// All explanations that were weighed: nothing, parameters, sets of effects with the reported one first, none of these.
    pub explanations: Vec<Explanation>,
    /// Effects that the training records do not excite.
    pub(crate) not_excited: Vec<EffectPlace>,
    /// Amplitude of each other effect at which the expected linear gain reaches the threshold: found in about half of the records
    /// or fewer, since the penalties of the objective are ignored.
    pub(crate) detection_limits: Vec<DetectionLimit>,
    /// Where model and records disagree.
    pub location: Option<Location>,
    /// Fitness of the records.
    pub checks: Vec<RecordCheck>,
    /// The experiment that resolves the ambiguity, or why there is none.
    pub next: Option<Next>,
}

/// Files of a run of the workflow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InputFiles {
    pub rig: String,
    pub train: Vec<String>,
    /// Axes that all of them show, drive or load; empty for a model of one balance and for records that cannot be used.
    #[serde(default)]
    pub axes: Vec<String>,
    /// Share of them that was searched; the final fit uses all.
    #[serde(default = "all")]
    pub searched_share: f64,
}

fn all() -> f64 {
    1.0
}

impl Default for InputFiles {
    fn default() -> Self {
        InputFiles { rig: String::new(), train: Vec::new(), axes: Vec::new(), searched_share: all() }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Where {
    /// drive, load, linkage or supply.
    pub axis: String,
    /// a, b, position or force; null for an effect of a whole axis.
    pub element: Option<String>,
}

impl From<Place> for Where {
    fn from(place: Place) -> Self {
        let name = place.to_string();
        let (axis, element) =
            name.split_once('.').map_or((name.as_str(), None), |(axis, element)| (axis, Some(element)));
        debug_assert!(place.element.is_some() == element.is_some() || matches!(place.part, Part::Linkage));
        Where { axis: axis.to_owned(), element: element.map(str::to_owned) }
    }
}

/// A number with its unit and its standard error.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Quantity {
    /// Key of the effect's sheet, or `parameter:…`.
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// Unit of the rig file; empty for a plain number.
    pub unit: String,
    /// One standard error; null when the records do not bound the number. Of the final model it is half of the half-width of a
    /// calibrated 95.4 % interval: one-step jackknife with frozen window weights, widened by a Student t factor.
    pub standard_error: Option<f64>,
    /// Value in the rig file; null where it has none.
    pub before: Option<f64>,
}

/// A missing effect with its numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NamedEffect {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: Where,
    /// Its numbers, in the order of its sheet.
    pub parameters: Vec<Quantity>,
    /// Share of the excess of the training records that it removes.
    pub share_explained: f64,
    /// Coefficient of variation between windows, in shares of its response; null where none was computed.
    #[serde(default)]
    pub amplitude_variation: Option<f64>,
    /// Effects that explain these records as well.
    pub alternatives: Vec<NamedEffect>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectPlace {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: Where,
}

#[derive(Clone, Debug, Serialize)]
pub struct Candidate {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: Where,
    /// Screened gain over the null threshold of the final model; above 1 it exceeds what chance gives the best candidate; no test
    /// of this effect.
    pub(crate) score: f64,
    /// Share of the excess that it removes alone, after its refit; null when it was not refitted.
    pub share_explained: Option<f64>,
    /// How its refit ended; null when it was not refitted alone.
    pub(crate) fit: Option<Convergence>,
    /// Its amplitude, refitted or linear, in the unit of its sheet.
    pub amplitude: f64,
    /// Unit of the amplitude.
    pub unit: String,
    /// Outcome, in words.
    #[serde(rename = "fate")]
    pub decision: String,
}

/// An explanation of the training records.
#[derive(Clone, Debug, Serialize)]
pub struct Explanation {
    pub kind: ExplanationKind,
    /// Sets of effects that the records cannot tell apart, the best first; empty without effects.
    pub sets: Vec<Vec<EffectPlace>>,
    /// Those of all explanations sum to one.
    pub probability: f64,
    /// What the records say about it; null for none of these.
    pub evidence: Option<Features>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct DetectionLimit {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: Where,
    /// Key of the amplitude.
    pub name: String,
    /// Change from the value at which the rig is the baseline.
    pub value: f64,
    pub unit: String,
}

/// A disagreement that no effect of the catalogue explains.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outside {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// Variables that it depends on, strongest first.
    pub variables: Vec<Dependence>,
    /// The missing term over its first variable.
    pub curve: Option<Curve>,
    /// The same over its first two, where their joint R2 is much larger.
    pub(crate) surface: Option<Surface>,
    /// A short formula, if one fits.
    pub formula: Option<String>,
    /// Whether the extended rig file has it, as the tables.
    pub added: bool,
    pub why_not: Option<String>,
    /// The terms that were added, each a table; empty when none.
    pub tables: Vec<TableTerm>,
    /// Share of the disagreement of the training records, beside parameters alone, that goes with the tables; null when none.
    pub share_explained: Option<f64>,
}

/// The balance that disagrees most, and what its unknown input depends on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LocatedTerm {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// What its unknown input depends on, strongest first; names as in [`Dependence::variable`].
    pub variables: Vec<LocatedVariable>,
}

/// A variable that the disagreement of a balance depends on.
#[derive(Clone, Debug, Serialize)]
pub struct LocatedVariable {
    pub variable: String,
    /// Log evidence of a term over this variable against none; null for linked rods, where windows of 20 ms decide.
    pub(crate) log_evidence: Option<f64>,
    /// Share of the explained loss, or of the variance of the unknown input on folds it was not fitted on.
    pub(crate) share: f64,
}

impl From<Outside> for LocatedTerm {
    fn from(outside: Outside) -> Self {
        let Outside { balance, variables, .. } = outside;
        let of = |Dependence { variable, r2, .. }: Dependence| LocatedVariable {
            variable,
            log_evidence: None,
            share: r2.clamp(0.0, 1.0),
        };
        LocatedTerm { balance, variables: variables.into_iter().map(of).collect() }
    }
}

impl LocatedTerm {
    /// Its strongest variable, in a sentence.
    pub(crate) fn strongest(&self) -> &str {
        strongest(self.variables.first().map(|variable| variable.variable.as_str()))
    }
}

/// The strongest variable, in a sentence.
pub(crate) fn strongest(first: Option<&str>) -> &str {
    first.unwrap_or("nothing that was measured")
}

/// A term that the extended rig file has as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableTerm {
    /// `drive.force`, `drive.flow-a` and so on.
    pub balance: String,
    /// x, v, |v|, sign(v), u, p_a, p_b, p_a-p_b or x sign(v).
    pub variable: String,
    pub(crate) variable_unit: String,
    /// Unit of the term, N or Nl/min.
    pub unit: String,
    /// Points, growing.
    pub at: Vec<f64>,
    /// The term there; a straight line between points, constant beyond them.
    pub value: Vec<f64>,
}

/// Statistical dependence of a disagreement on a variable.
#[derive(Clone, Debug, Serialize)]
pub struct Dependence {
    /// x, v, |v|, sign(v), p_a, p_b, p_a-p_b, u, du/dt, F, t, dp/dt, or constant for a term that is always there.
    pub variable: String,
    /// Share of the variance explained on folds it was not fitted on.
    pub(crate) r2: f64,
    /// Permutation p value over 200 circular shifts: (1 + shifts that reach R2) / 201. The entry `constant` is no permutation p
    /// value, since a shift leaves the mean unchanged: a z test of the mean decides on it, and it always has 1/201 here.
    pub(crate) p_value: f64,
}

/// A smooth curve with a band.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// The variable, and its unit.
    pub variable: String,
    pub(crate) variable_unit: String,
    pub unit: String,
    /// Values of the variable.
    pub at: Vec<f64>,
    /// The term there.
    pub value: Vec<f64>,
    /// Two standard errors of it.
    pub band: Vec<f64>,
}

/// A surface over two variables with a band; null where too few points are.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Surface {
    pub variables: [String; 2],
    pub(crate) variable_units: [String; 2],
    pub unit: String,
    /// Values of the first variable, and of the second.
    pub at: [Vec<f64>; 2],
    /// The term there: a row for each value of the second variable.
    pub value: Vec<Vec<Option<f64>>>,
    /// Two standard errors of it.
    pub band: Vec<Vec<Option<f64>>>,
}

/// The misfit of a signal of the held-out record, rms over windows, in the signal's unit.
#[derive(Clone, Debug, Serialize)]
pub struct Misfit {
    /// Baseline against measurement.
    pub before: f64,
    /// Extended model against measurement.
    pub after: f64,
    /// Noise of the sensor alone.
    pub floor: f64,
    /// Closed share of the excess power over the floor, 1 - (after^2 - floor^2) / (before^2 - floor^2), at most 1; null when the
    /// excess is insignificant.
    pub closed: Option<f64>,
}

/// Figures of both models on the held-out record.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    pub record: String,
    /// Windowed chi2 per degree of freedom of the baseline.
    pub(crate) chi2_before: f64,
    /// Of the extended model.
    pub(crate) chi2_after: f64,
    /// 95 % null range of the same.
    pub(crate) chi2_null: [f64; 2],
    /// Per signal: normalised rms error of a free run, in percent of the signal's range.
    pub(crate) free_run_nrmse_percent: BTreeMap<String, BeforeAfter>,
    /// Per signal: lag-1 autocorrelation of the windowed residuals.
    pub(crate) whiteness: BTreeMap<String, BeforeAfter>,
    /// Unphysical events of the free run, in words.
    pub(crate) physical: Vec<String>,
    /// Whether the extended model is better by more than three standard errors over independent windows and no signal worse by
    /// more than 2 %.
    pub confirmed: bool,
    /// Whether a signal's rms rises by more than 2 %.
    pub worse: bool,
    /// Whether `chi2_after` is not above its null range.
    pub adequate: bool,
    /// Whether the record shows more than the extended model has: `chi2_after` exceeds its null range, and the middle of it by
    /// the factor at which a model of the training records is not adequate.
    pub more_missing: bool,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct BeforeAfter {
    /// Baseline.
    pub before: f64,
    /// Extended model.
    pub after: f64,
}

/// Where the baseline and the training records disagree.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Location {
    pub balances: Vec<BalanceBar>,
    pub(crate) regimes: Vec<RegimeCell>,
    /// Unknown inputs over their strongest variables.
    pub(crate) maps: Vec<Curve>,
    /// Series of the unknown inputs, thinned out for a picture.
    pub series: Vec<UnknownInput>,
    /// The balance that disagrees most under the rig file's own values, and what it depends on; null where none does.
    pub dependence: Option<LocatedTerm>,
    /// Balances that move together as a fault of a sensor would move them, in words; null when none do.
    pub sensor_ratio: Option<String>,
}

#[derive(Clone, Debug, Serialize)]
pub struct BalanceBar {
    /// `drive.flow-a`, `drive.flow-b`, `drive.force`, `drive.force-sensor`, the load's, `linkage`.
    pub balance: String,
    /// rms of the unknown input over its propagated noise; 1 for a closed balance.
    pub over_noise: f64,
    /// rms of the unknown input.
    pub rms: f64,
    /// Its unit, N or Nl/min.
    pub unit: String,
}

/// The disagreement of a balance in a regime.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct RegimeCell {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// hold, onset, motion-out, motion-in, near-ends, valve-edge.
    pub(crate) regime: String,
    pub windows: usize,
    /// As in [`BalanceBar::over_noise`].
    pub over_noise: f64,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct UnknownInput {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    pub unit: String,
    pub time_s: Vec<f64>,
    pub value: Vec<f64>,
    /// Propagated noise, one standard deviation.
    pub noise: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct RecordCheck {
    pub file: String,
    /// Whether the workflow can use it.
    pub usable: bool,
    /// Samples and length.
    pub rows: usize,
    /// Last time minus first, s.
    pub length_s: f64,
    pub findings: Vec<Finding>,
    /// Noise and quantum of each channel, estimated from the record.
    pub channels: BTreeMap<String, ChannelCheck>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Finding {
    /// gap, repeated-time, jumping-time, clipped, stuck, wrong-unit, swapped-pressures, force-sign, lost-samples, …
    pub kind: String,
    /// Column, if it is about one.
    pub column: Option<String>,
    /// First line of the file that it is about.
    pub line: Option<u64>,
    /// Whether it makes the record unusable; otherwise it is tolerated, or the samples are left out.
    pub fatal: bool,
    /// What, where, and what to do.
    pub text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelCheck {
    /// Standard deviation of its noise, in SI; null when unknown.
    pub noise: Option<f64>,
    /// Smallest step between its values, in SI; null when it has none.
    pub quantum: Option<f64>,
    /// Share of samples that cannot be used.
    pub unusable: f64,
}

/// The words in a sentence: `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Decimals of a value that is rounded to the second digit of its standard error.
pub(crate) fn decimals(standard_error: f64) -> usize {
    (1.0 - standard_error.log10().floor()).clamp(0.0, 12.0) as usize
}
