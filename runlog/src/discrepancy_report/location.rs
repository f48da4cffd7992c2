//! Where the rig file and the training records disagree.

use super::{Curve, Dependence, UncataloguedTerm};
use serde::{Deserialize, Serialize};

/// Where the baseline and the training records disagree.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Location {
    /// Unknown input of each balance.
    #[serde(skip_deserializing)]
    pub balances: Vec<BalanceBar>,
    /// The same by regime.
    #[serde(skip_deserializing)]
    pub regimes: Vec<RegimeCell>,
    /// Unknown inputs over their strongest variables.
    #[serde(skip_deserializing)]
    pub maps: Vec<Curve>,
    /// Series of the unknown inputs, thinned out for a picture.
    #[serde(skip_deserializing)]
    pub series: Vec<UnknownInput>,
    /// The balance that disagrees most under the rig file's own values, and what it depends on; null where none does.
    pub dependence: Option<LocatedTerm>,
    /// Balances that move together as a fault of a sensor would move them, in words; null when none do.
    pub sensor_ratio: Option<String>,
}

/// How much a balance disagrees.
#[derive(Clone, Debug, Serialize)]
pub struct BalanceBar {
    /// `drive.flow-a`, `drive.flow-b`, `drive.force`, `drive.force-sensor`, the load's, `linkage`.
    pub balance: String,
    /// Birge ratio about 0, the root of chi2 per window: rms of the unknown input over its propagated noise; 1 for a closed
    /// balance.
    #[serde(rename = "over_noise")]
    pub birge_ratio: f64,
    /// rms of the unknown input, in `unit`.
    pub rms: f64,
    /// N or Nl/min.
    pub unit: String,
}

/// The disagreement of a balance in a regime.
#[derive(Clone, Debug, Serialize)]
pub struct RegimeCell {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// hold, onset, motion-out, motion-in, near-ends, valve-edge.
    pub regime: String,
    /// Number of its windows.
    pub windows: usize,
    /// As in [`BalanceBar::birge_ratio`].
    #[serde(rename = "over_noise")]
    pub birge_ratio: f64,
}

/// The unknown input of a balance over time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct UnknownInput {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// N or Nl/min.
    pub unit: String,
    /// Of each value; thinned out.
    pub time_s: Vec<f64>,
    /// At `time_s`, in `unit`.
    pub value: Vec<f64>,
    /// Propagated noise, one standard deviation.
    pub noise: f64,
}

/// The balance that disagrees most, and what its unknown input depends on.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct LocatedTerm {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// What its unknown input depends on, strongest first; names as in [`Dependence::variable`].
    pub variables: Vec<LocatedVariable>,
}

/// A variable that the disagreement of a balance depends on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LocatedVariable {
    /// As in [`Dependence::variable`].
    pub variable: String,
    /// Log evidence of a term over this variable against none; null for linked rods, where short windows of 20 ms decide.
    #[serde(skip_deserializing)]
    pub log_evidence: Option<f64>,
    /// Share of the explained loss, or of the variance of the unknown input on folds it was not fitted on.
    #[serde(skip_deserializing)]
    pub share: f64,
}

impl From<UncataloguedTerm> for LocatedTerm {
    fn from(outside: UncataloguedTerm) -> Self {
        let UncataloguedTerm { balance, variables, .. } = outside;
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
    #[must_use]
    pub fn strongest(&self) -> &str {
        strongest(self.variables.first().map(|variable| variable.variable.as_str()))
    }
}

/// The strongest variable, in a sentence.
#[must_use]
pub fn strongest(first: Option<&str>) -> &str {
    first.unwrap_or("nothing that was measured")
}
