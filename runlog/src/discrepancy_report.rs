//! `report.json` of `discrepancy close` with a rig file. Schema: `discrepancy/docs/report.md`.
//!
//! Lists have a deterministic order, and nothing depends on time, threads or machine: two runs write the same bytes. Only `gap`
//! and `verification` know the held-out record.
//!
//! Fields with `skip_deserializing` are for people and for other languages: no program here reads them back, and a number that
//! is not finite is null there. Reports of earlier versions, and of the programs that the study compares, lack some fields.

mod declared;
mod explanation;
mod fit;
mod location;
mod next;
mod objection;
mod outside;
mod record_check;
mod significance;
mod verdict;
mod verification;

pub use declared::DeclaredSuspect;
pub use explanation::{Explanation, ExplanationKind, Features, Marginal};
pub use fit::{Convergence, Outcome};
pub use location::{BalanceBar, LocatedTerm, LocatedVariable, Location, RegimeCell, UnknownInput, strongest};
pub use next::{NextExperiment, SecondExperiment};
pub use objection::HeldOutFinding;
pub use outside::{Curve, Dependence, Surface, TableTerm, UncataloguedTerm};
pub use record_check::{ChannelCheck, Finding, RecordCheck};
use serde::{Deserialize, Deserializer, Serialize};
pub use significance::{DrawnRecords, Significance, StoppingReason};
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
pub use verdict::Verdict;
pub use verification::{BeforeAfter, SignalMisfit, Verification};

/// Version of the schema; a new optional field does not change it.
pub const SCHEMA_VERSION: u32 = 1;

/// What the workflow found in records of a rig, and how far the extended model agrees with a held-out record.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA_VERSION`] of the program that wrote it; 0 where it wrote none.
    #[serde(default)]
    pub schema_version: u32,
    /// Of the training records alone.
    pub verdict: Verdict,
    /// The verdict in a sentence or two.
    #[serde(default)]
    pub summary: String,
    /// File names of rig and records as given.
    #[serde(default)]
    pub inputs: InputFiles,
    /// Missing effects, the best first.
    #[serde(default)]
    pub named: Vec<NamedEffect>,
    /// Effects that are too small to be named, the best first; the extended rig file has them.
    #[serde(default)]
    pub small: Vec<NamedEffect>,
    /// Baseline parameters that were significantly off.
    #[serde(default)]
    pub parameters: Vec<Quantity>,
    /// Parameters that the model moved by an insignificant amount, or beside something outside the catalogue; the extended rig
    /// file has them.
    #[serde(default, rename = "carried")]
    pub insignificant: Vec<Quantity>,
    /// Whether the model of the search leaves no more than noise on the searched part of the training records, and the verdict is
    /// not outside the catalogue; null where none was judged.
    pub adequate: Option<bool>,
    /// How the fit of the reported model ended; null where none was fitted.
    #[serde(skip_deserializing)]
    pub fit: Option<Convergence>,
    /// The missing term outside the catalogue.
    pub outside: Option<UncataloguedTerm>,
    /// The effect of the catalogue that comes nearest to a term outside it.
    #[serde(default)]
    pub nearest: Option<NamedEffect>,
    /// Where an inadequate model, or the nearest effect, still disagrees with the training records.
    #[serde(skip_deserializing)]
    pub remaining: Option<LocatedTerm>,
    /// Per signal of the held-out record, as `drive_position_m`; empty without `--test`.
    #[serde(default, rename = "gap")]
    pub misfit: BTreeMap<String, SignalMisfit>,
    /// Further figures of the held-out record; null without `--test`.
    pub verification: Option<Verification>,
    /// Suspects of a file beside the rig file; absent without one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub suspects: Vec<DeclaredSuspect>,
    /// All candidates, the best first.
    #[serde(skip_deserializing)]
    pub candidates: Vec<Candidate>,
    /// All explanations that were weighed: nothing, parameters, sets of effects with the reported one first, none of these.
    #[serde(default)]
    pub explanations: Vec<Explanation>,
    /// The tests of the set of effects that is named, or would be; null where none would.
    #[serde(skip_deserializing)]
    pub significance: Option<Significance>,
    /// Effects that the training records do not excite.
    #[serde(default)]
    pub not_excited: Vec<EffectPlace>,
    /// Amplitude of each other effect at which the expected linear gain reaches the threshold: found in about half of the records
    /// or fewer, since the penalties of the penalised loss are ignored.
    #[serde(skip_deserializing)]
    pub detection_limits: Vec<DetectionLimit>,
    /// Where model and records disagree.
    pub location: Option<Location>,
    /// Whether each record can be used, and what is odd about it.
    #[serde(skip_deserializing)]
    pub checks: Vec<RecordCheck>,
    /// The experiment that resolves the ambiguity, or why there is none.
    pub next: Option<NextExperiment>,
}

/// Files of a run of the workflow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InputFiles {
    /// File name as given.
    pub rig: String,
    /// File names as given, in their order.
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

/// A place on the rig; as `drive` or `drive.a` where it is displayed.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RigPlace {
    /// drive, load, linkage or supply.
    pub axis: String,
    /// a, b, position or force; null for an effect of a whole axis.
    pub element: Option<String>,
}

impl RigPlace {
    /// The place that is displayed so.
    #[must_use]
    pub fn named(name: &str) -> Self {
        let (axis, element) =
            name.split_once('.').map_or((name, None), |(axis, element)| (axis, Some(element)));
        RigPlace { axis: axis.to_owned(), element: element.map(str::to_owned) }
    }
}

impl Display for RigPlace {
    fn fmt(&self, to: &mut Formatter<'_>) -> fmt::Result {
        match &self.element {
            Some(element) => write!(to, "{}.{element}", self.axis),
            None => to.write_str(&self.axis),
        }
    }
}

/// A number with its unit and its standard error.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Quantity {
    /// Key of the effect's sheet, or `parameter:…`.
    pub name: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// Unit of the rig file; empty for a plain number.
    pub unit: String,
    /// One standard error; null when the records do not bound the number. Of the final model it is half of the half-width of a
    /// nominal 95.4 % interval: one-step jackknife with frozen window weights, widened by a Student t factor.
    pub standard_error: Option<f64>,
    /// Value in the rig file, else the one at which the effect is off; null where there is neither.
    pub before: Option<f64>,
}

/// A missing effect with its numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Its name in the catalogue, or that of a suspect.
    pub effect: String,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: RigPlace,
    /// Its numbers, in the order of its sheet.
    #[serde(default)]
    pub parameters: Vec<Quantity>,
    /// Share of the excess of the training records that it removes.
    #[serde(default = "unknown", deserialize_with = "null_is_nan")]
    pub share_explained: f64,
    /// Coefficient of variation between windows, in shares of its response; null where none was computed.
    pub amplitude_variation: Option<f64>,
    /// Effects that explain these records as well.
    #[serde(default)]
    pub alternatives: Vec<NamedEffect>,
}

/// An effect without numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectPlace {
    /// As of a [`NamedEffect`].
    pub effect: String,
    /// As of a [`NamedEffect`].
    #[serde(rename = "where")]
    pub place: RigPlace,
}

/// An effect that was screened, and how far it got.
#[derive(Clone, Debug, Serialize)]
pub struct Candidate {
    /// As of a [`NamedEffect`].
    pub effect: String,
    /// As of a [`NamedEffect`].
    #[serde(rename = "where")]
    pub place: RigPlace,
    /// Screened gain over the null threshold of the final model; above 1 it exceeds what chance gives the best candidate; no test
    /// of this effect.
    pub score: f64,
    /// Share of the excess that it removes alone, after its refit; null when it was not refitted.
    pub share_explained: Option<f64>,
    /// How its refit ended; null when it was not refitted alone.
    pub fit: Option<Convergence>,
    /// Its amplitude, refitted or linear, in the unit of its sheet.
    pub amplitude: f64,
    /// Unit of the amplitude.
    pub unit: String,
    /// Why it is named or not, in words.
    #[serde(rename = "fate")]
    pub decision: String,
}

/// The amplitude from which an effect is found.
#[derive(Clone, Debug, Serialize)]
pub struct DetectionLimit {
    /// As of a [`NamedEffect`].
    pub effect: String,
    /// As of a [`NamedEffect`].
    #[serde(rename = "where")]
    pub place: RigPlace,
    /// Key of the amplitude.
    pub name: String,
    /// Change from the value at which the rig is the baseline.
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
}

/// A number that need not be finite, which is null where it is not.
fn null_is_nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

fn unknown() -> f64 {
    f64::NAN
}
