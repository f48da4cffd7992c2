//! Terms outside the catalogue: the worst balance, the variables of its unknown input, its curve, a formula.
//!
//! ```text
//!   unknown inputs ──► balance ──► dependence on each variable ──► pairs ──► parsimony ──► curve ──► formula
//! ```
//!
//! The unknown inputs are those of the calibrated model. A balance within its noise that depends on no variable is not reported.
//!
//! Of variables with nearly the same R2 the simplest comes first. Where a pair has a much higher R2 than any one, as for a
//! friction over position, the pair leads, with a surface beside the curve. A constant is the variable `constant`.
//!
//! Source: discrepancy-notes.md, 9 and Pipeline 8.

pub(crate) mod dependence;
pub(crate) mod formula;

use crate::locate::maps::{map, surface};
use crate::locate::{HISTORY_COMPLEXITY, TIME, UnknownSeries, VARIABLES};
use crate::report::{Curve, Dependence, LocatedTerm, UncataloguedTerm};
pub(crate) use dependence::SHIFTS;
use dependence::{Bins, Sample};

/// Share of the best R2 that is nearly as good.
const TIE_R2_RATIO: f64 = 0.9;
/// Least gain in R2 of a pair.
const MIN_PAIR_R2_GAIN: f64 = 0.15;
/// Least R2 of a variable of a pair; below, its bins overfit.
const MIN_MARGINAL_R2: f64 = -0.1;
/// R2 above which a variable precedes the constant: a law through 0 has a mean too.
const R2_BEFORE_CONSTANT: f64 = 0.5;
/// Birge ratio that is significant by itself.
const MIN_BIRGE_RATIO: f64 = 1.15;
/// Significance of R2 against shifted series where the Birge ratio is not significant, in standard deviations. One-sided, a
/// normal variable exceeds it with probability 1.3e-12; the margin is for some hundred tests and for tails that are not normal.
const MIN_SHIFT_Z: f64 = 7.0;
/// Significance of a mean, in standard errors from the propagated noise (z test).
const MIN_MEAN_Z: f64 = 6.0;
/// Name of the constant term (the intercept).
pub(crate) const CONSTANT: &str = "constant";
/// Variables of a located term that come first.
const LOCATED: usize = 2;
/// Fewest short windows of a balance.
const MIN_SHORT_WINDOWS: usize = 100;

struct BalanceTests<'a> {
    series: &'a UnknownSeries,
    sample: Sample,
    /// For each variable R2, p value, and the significance of R2 against shifted series.
    tests: Vec<(f64, f64, f64)>,
}

/// Describes the term outside the catalogue, in the balance and over the variables of `located` where there is one; `None` where
/// no balance is significant.
pub fn outside(
    unknowns: &[UnknownSeries],
    located: Option<&LocatedTerm>,
    progress: &mut dyn FnMut(&str),
) -> Option<UncataloguedTerm> {
    let mut best: Option<(f64, BalanceTests<'_>)> = None;
    for series in unknowns.iter().filter(|series| series.points.len() >= MIN_SHORT_WINDOWS) {
        progress(&format!("outside: {}", series.balance));
        let sample = Sample::of(series);
        let tests: Vec<_> = (0..VARIABLES.len()).map(|variable| sample.test(variable)).collect();
        // Whether there is a term is judged without history variables: more tests would find more by chance.
        let plain =
            VARIABLES.iter().zip(&tests).filter(|(variable, _)| variable.complexity < HISTORY_COMPLEXITY);
        let shift_z = plain.map(|(_, test)| test.2).fold(0.0, f64::max);
        let lifted = series.birge_ratio().is_some_and(|ratio| ratio > MIN_BIRGE_RATIO);
        let is_located = located.is_some_and(|located| located.balance == series.balance);
        if !is_located && !lifted && shift_z < MIN_SHIFT_Z && sample.mean_over_error().abs() < MIN_MEAN_Z {
            continue;
        }
        let excess = if is_located { f64::INFINITY } else { sample.excess() };
        if best.as_ref().is_none_or(|(most, _)| excess > *most) {
            best = Some((excess, BalanceTests { series, sample, tests }));
        }
    }
    best.map(|(_, tests)| tests.report(located.filter(|located| located.balance == tests.series.balance)))
}

/// The places of its variables among [`VARIABLES`], taken out of `order`.
fn places(located: &LocatedTerm, order: &mut Vec<usize>) -> Vec<usize> {
    let place = |name: &str| VARIABLES.iter().position(|known| known.name == name);
    let places: Vec<usize> =
        located.variables.iter().take(LOCATED).filter_map(|variable| place(&variable.variable)).collect();
    order.retain(|variable| !places.contains(variable));
    places
}

impl BalanceTests<'_> {
    fn report(&self, located: Option<&LocatedTerm>) -> UncataloguedTerm {
        let (mut order, mut pair) = self.order();
        if let Some(located) = located {
            let first = places(located, &mut order);
            pair = pair.filter(|pair| pair.iter().all(|variable| first.contains(variable)));
            order.splice(0..0, first);
        }
        let constant = self.sample.constant_share();
        let explained = order.first().map_or(0.0, |first| self.tests[*first].0);
        let mut variables: Vec<Dependence> = order
            .iter()
            .map(|variable| {
                let (r2, p_value, _) = self.tests[*variable];
                Dependence { variable: VARIABLES[*variable].name.to_owned(), r2, p_value }
            })
            .collect();
        let mean = self.sample.mean_over_error().abs();
        let located_at = located.and_then(|located| {
            located.variables.iter().take(LOCATED).position(|variable| variable.variable == CONSTANT)
        });
        let is_constant = mean > MIN_MEAN_Z && constant > explained * (1.0 - constant);
        if located_at.is_some() || located.is_none() && is_constant {
            // No permutation p value: a circular shift leaves the mean unchanged. The z test above decides; the smallest p value
            // that shifts can give stands for it. Its share is in sample and of the raw sum of squares.
            let p_value = 1.0 / (SHIFTS as f64 + 1.0);
            let by_share = usize::from(explained > R2_BEFORE_CONSTANT);
            let place = located_at.unwrap_or(by_share).min(variables.len());
            variables.insert(place, Dependence { variable: CONSTANT.to_owned(), r2: constant, p_value });
        }
        let formula =
            if variables.is_empty() { None } else { formula::formula(&self.sample, self.series.unit) };
        UncataloguedTerm {
            balance: self.series.balance.clone(),
            curve: order.first().map(|first| smooth(map(self.series, *first), VARIABLES[*first].name)),
            surface: pair.map(|pair| surface(self.series, pair)),
            formula,
            variables,
            ..UncataloguedTerm::default()
        }
    }

    /// Variables with positive R2, strongest first, simplest first among nearly equal ones; and the pair where it leads.
    fn order(&self) -> (Vec<usize>, Option<[usize; 2]>) {
        let r2 = |variable: &usize| self.tests[*variable].0;
        let mut order: Vec<usize> = (0..VARIABLES.len()).filter(|variable| r2(variable) > 0.0).collect();
        order.sort_by(|left, right| r2(right).total_cmp(&r2(left)));
        let Some(most) = order.first().map(r2) else { return (order, None) };
        let near = order.iter().take_while(|variable| r2(variable) >= TIE_R2_RATIO * most).count();
        order[..near].sort_by_key(|variable| VARIABLES[*variable].complexity);
        let Some((mut pair, _)) = self.pair().filter(|(_, together)| *together > most + MIN_PAIR_R2_GAIN)
        else {
            return (order, None);
        };
        pair.sort_by(|left, right| r2(right).total_cmp(&r2(left)));
        order.retain(|variable| !pair.contains(variable));
        order.splice(0..0, pair);
        (order, Some(pair))
    }

    /// The pair of variables with the largest R2, without time, which with another would identify single windows.
    fn pair(&self) -> Option<([usize; 2], f64)> {
        let mut best: Option<([usize; 2], f64)> = None;
        for left in 0..VARIABLES.len() {
            for right in left + 1..VARIABLES.len() {
                let is_half = |at: usize| {
                    at != TIME
                        && VARIABLES[at].complexity < HISTORY_COMPLEXITY
                        && self.tests[at].0 > MIN_MARGINAL_R2
                };
                if !is_half(left) || !is_half(right) {
                    continue;
                }
                let r2 = self.sample.explained(&Bins::of_pair(&self.sample, left, right), 0);
                if best.is_none_or(|(_, most)| r2 > most) {
                    best = Some(([left, right], r2));
                }
            }
        }
        best
    }
}

/// Smooths a map by weighted means of neighbouring bins, its band accordingly.
fn smooth(mut curve: Curve, variable: &str) -> Curve {
    let weights: Vec<f64> = curve.band.iter().map(|band| band.powi(-2)).collect();
    let values = curve.value.clone();
    for at in 0..values.len() {
        let (mut sum, mut weight, mut squares) = (0.0, 0.0, 0.0);
        for near in at.saturating_sub(1)..(at + 2).min(values.len()) {
            let share = weights[near] * if near == at { 2.0 } else { 1.0 };
            sum += share * values[near];
            weight += share;
            squares += share * share / weights[near];
        }
        curve.value[at] = sum / weight;
        curve.band[at] = squares.sqrt() / weight;
    }
    variable.clone_into(&mut curve.variable);
    curve
}
