//! Where the baseline and the records disagree: unknown inputs of every balance, window by window.
//!
//! ```text
//!   record ──► short windows of 20 ms ──► unknown force, flows, sensor offset ──► bars, regimes, maps, series
//! ```
//!
//! A balance is closed when its unknown input is as large as its propagated noise. Otherwise a term is missing, and its
//! dependence on position, speed and pressures suggests which. A leak does not raise the force, since windows start at the
//! measured pressures; a sensor fault raises two balances in a ratio fixed by geometry ([`ratio`]).
//!
//! Source: discrepancy-notes.md, 2 and 9, and Pipeline 4. Unknown inputs: Gillijns, De Moor 2007, Automatica 43(1).

pub(crate) mod estimate;
pub(crate) mod linkage;
pub(crate) mod maps;
pub(crate) mod noise_colour;
pub(crate) mod ratio;
pub(crate) mod regime;
pub(crate) mod simulated;

use crate::gridded_record::GriddedRecord;
use crate::report::{BalanceBar, Location, RegimeCell, UnknownInput};
use estimate::{Unknowns, estimate};
use plant::{Axis, PERIOD_S, RigParameters};
use regime::{REGIMES, Regimes};

/// Periods of a short window; those of the fits are longer ([`crate::windows::WINDOW_PERIODS`]).
pub(crate) const SHORT_WINDOW_PERIODS: usize = 20;
/// What an unknown input may depend on.
pub const VARIABLES: [WindowVariable; 19] = [
    variable("x", "m", 0, 1),
    variable("v", "m/s", 0, 1),
    variable("|v|", "m/s", 1, 2),
    variable("sign(v)", "", 0, 2),
    variable("p_a", "Pa", 0, 1),
    variable("p_b", "Pa", 0, 1),
    variable("p_a-p_b", "Pa", 1, 3),
    variable("u", "", 0, 1),
    variable("du/dt", "1/s", 2, 2),
    variable("F", "N", 1, 1),
    variable("t", "s", 3, 1),
    variable("dp/dt", "Pa/s", 2, 2),
    variable("change of u (2 ms)", "", HISTORY_COMPLEXITY, 6),
    variable("change of u (10 ms)", "", HISTORY_COMPLEXITY, 6),
    variable("last movement of u", "", HISTORY_COMPLEXITY, 6),
    variable("last movement of x", "", HISTORY_COMPLEXITY, 6),
    variable("change of p (0.1 s)", "Pa", HISTORY_COMPLEXITY, 6),
    variable("change of p (1 s)", "Pa", HISTORY_COMPLEXITY, 6),
    variable("mean |v| (1 s)", "m/s", HISTORY_COMPLEXITY, 6),
];
/// Complexity of history variables, which depend on the periods before.
pub(crate) const HISTORY_COMPLEXITY: usize = 4;
/// Indices of some of them.
pub(crate) const POSITION: usize = 0;
pub(crate) const VELOCITY: usize = 1;
pub(crate) const SPEED: usize = 2;
pub(crate) const DIRECTION: usize = 3;
pub(crate) const PRESSURE_DIFFERENCE: usize = 6;
pub(crate) const FORCE: usize = 9;
pub(crate) const TIME: usize = 10;
/// Most points of a series in the report.
const SERIES: usize = 1500;

/// Regressor of an unknown input.
#[derive(Clone, Copy, Debug)]
pub struct WindowVariable {
    /// As in reports, `|v|` or `p_a-p_b`.
    pub name: &'static str,
    /// Its unit; empty for a number.
    pub(crate) unit: &'static str,
    /// Complexity: of variables that explain nearly as much the simplest comes first.
    pub(crate) complexity: usize,
    /// Nodes in a formula.
    pub(crate) nodes: usize,
}

const fn variable(name: &'static str, unit: &'static str, complexity: usize, nodes: usize) -> WindowVariable {
    WindowVariable { name, unit, complexity, nodes }
}

/// Where baseline and records disagree.
#[derive(Clone, Debug)]
pub struct Located {
    /// For the report: balances, regimes, maps and series.
    pub location: Location,
    /// Unknown inputs, one series for each observable balance.
    pub unknowns: Vec<UnknownSeries>,
}

/// Unknown input of one balance over time.
#[derive(Clone, Debug)]
pub struct UnknownSeries {
    /// As in [`BalanceBar::balance`].
    pub balance: String,
    /// N or Nl/min.
    pub(crate) unit: &'static str,
    /// Short windows in which it is observable, in the order of the records.
    pub points: Vec<UnknownPoint>,
}

/// Unknown input of a balance in one short window.
#[derive(Clone, Copy, Debug)]
pub struct UnknownPoint {
    /// Index of its short window in the record.
    pub(crate) window: usize,
    /// Estimate, in the series' unit; positive along the extension of the axis, or into the chamber.
    pub(crate) value: f64,
    /// Its null standard deviation.
    pub(crate) deviation: f64,
    /// In the order of [`VARIABLES`], positions and speeds along the extension of the axis.
    pub(crate) variables: [f64; VARIABLES.len()],
    /// Sensitivity of the estimate to an offset of the pressure sensors a and b, per Pa.
    pub(crate) per_pressure_offset: [f64; 2],
    pub(crate) regimes: Regimes,
}

impl UnknownSeries {
    /// As in [`BalanceBar::birge_ratio`]. `None` without a point.
    pub(crate) fn birge_ratio(&self) -> Option<f64> {
        birge_ratio(self.points.iter())
    }
}

fn birge_ratio<'a>(points: impl Iterator<Item = &'a UnknownPoint>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for point in points {
        sum += (point.value / point.deviation).powi(2);
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// Estimates the unknown inputs of all records under a baseline; `progress` gets a line for each record.
pub fn locate(rig: &RigParameters, gridded: &[GriddedRecord], progress: &mut dyn FnMut(&str)) -> Located {
    let mut unknowns = Unknowns::default();
    for (index, gridded) in gridded.iter().enumerate() {
        progress(&format!("locate: {} of {}, {:.0} s", index + 1, gridded.len(), seconds(gridded.len())));
        estimate(rig, gridded, &mut unknowns);
    }
    let series = unknowns.into_series();
    let bars = series.iter().filter_map(bar).collect();
    let regimes = series.iter().flat_map(cells).collect();
    let mut notes = Vec::new();
    for axis in Axis::ALL {
        notes.extend(ratio::notes(axis, &series));
    }
    let location = Location {
        balances: bars,
        regimes,
        maps: maps::maps(&series),
        series: series.iter().filter(|series| !series.points.is_empty()).map(thinned).collect(),
        dependence: None,
        sensor_ratio: (!notes.is_empty()).then(|| notes.join("; ")),
    };
    Located { location, unknowns: series }
}

fn seconds(periods: usize) -> f64 {
    periods as f64 * PERIOD_S
}

fn bar(series: &UnknownSeries) -> Option<BalanceBar> {
    let birge_ratio = series.birge_ratio()?;
    let squares: f64 = series.points.iter().map(|point| point.value.powi(2)).sum();
    Some(BalanceBar {
        balance: series.balance.clone(),
        birge_ratio,
        rms: (squares / series.points.len() as f64).sqrt(),
        unit: series.unit.to_owned(),
    })
}

fn cells(series: &UnknownSeries) -> Vec<RegimeCell> {
    let cell = |regime: &&'static str| {
        let within = || series.points.iter().filter(|point| point.regimes.contains(regime));
        Some(RegimeCell {
            balance: series.balance.clone(),
            regime: (*regime).to_owned(),
            windows: within().count(),
            birge_ratio: birge_ratio(within())?,
        })
    };
    REGIMES.iter().filter_map(cell).collect()
}

/// Decimates a series for a picture by weighted means of neighbours.
fn thinned(series: &UnknownSeries) -> UnknownInput {
    let join = series.points.len().div_ceil(SERIES).max(1);
    let (balance, unit) = (series.balance.clone(), series.unit.to_owned());
    let mut thin = UnknownInput { balance, unit, ..UnknownInput::default() };
    let mut variances = 0.0;
    for points in series.points.chunks(join) {
        let (mut weights, mut values, mut times_s) = (0.0, 0.0, 0.0);
        for point in points {
            let weight = point.deviation.powi(-2);
            weights += weight;
            values += weight * point.value;
            times_s += point.variables[TIME];
        }
        thin.time_s.push(times_s / points.len() as f64);
        thin.value.push(values / weights);
        variances += 1.0 / weights;
    }
    thin.noise = (variances / thin.value.len() as f64).sqrt();
    thin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_places_are_those_of_the_table() {
        let places = [POSITION, VELOCITY, SPEED, DIRECTION, PRESSURE_DIFFERENCE, FORCE, TIME];
        let named = places.map(|place| VARIABLES[place].name);
        assert_eq!(named, ["x", "v", "|v|", "sign(v)", "p_a-p_b", "F", "t"]);
    }
}
