//! Terms outside the catalogue as tables of the rig file: points and parameters fitted in the simulator.
//!
//! ```text
//!   balance of ──► each variable that the plant knows, screened ──► three fitted ──► the best: more points, while they pay
//!   `outside`      (of a flow: into a, into b, into both)           from the curve   └──► second variable?
//! ```
//!
//! The curve of an unknown input is shrunk by its prior, comes from independent short windows of 20 ms, and parameters have
//! absorbed a part of it. It only starts the fit. The loss, the windows and the penalty for each number are those of naming. A
//! table is not added if it lowers the training loss, or the five-fold cross-validated loss of the linearised model, by less than
//! [`LEAST_SHARE`].
//!
//! The parameters that were off in the calibration are fitted jointly. In the end all return to the rig file's values, and
//! forward selection readmits those that the tables need.
//!
//! Source: discrepancy-notes.md, Pipeline 8; [`crate::refit`] for the fit.

mod fit;

use crate::calibrate::quantity;
use crate::engine::Engine;
use crate::locate::maps::map;
use crate::locate::{UnknownPoint, UnknownSeries, VARIABLES};
use crate::name::{MIN_GAIN, share_removed};
use crate::parameters::{COUNT, with_factors};
use crate::refit::FittedModel;
use crate::report::{Quantity, TableTerm, UncataloguedTerm};
use fit::{FittedTable, Iterate, LinearisedTable, Model, TableLinearisation};
use plant::effects::tabulated::{self, Balance, Tabulated, Variable, interpolated};
use plant::{Axis, RigParameters};

/// Number of screened tables that are fitted.
const TRIED: usize = 3;
/// Points of a first table; a law over position and direction has two branches.
const KNOTS: usize = 8;
const DIRECTED_KNOTS: usize = 32;
/// Refinement factors.
const REFINEMENTS: [usize; 2] = [2, 4];
/// Maximum number of points of a table.
const MAX_KNOTS: usize = tabulated::POINTS[1];
/// Steps of a first fit, and of a final one.
const FIRST_STEPS: usize = 2;
const STEPS: usize = 5;
/// Share of the loss (L, priors and the penalty for points) that a table must remove, and a second one of the remaining loss.
const LEAST_SHARE: f64 = 0.05;
const LEAST_SHARE_OF_SECOND: f64 = 0.15;

#[derive(Clone, Debug)]
pub(crate) struct Tables {
    pub(crate) terms: Vec<TableTerm>,
    /// Parameters that are off beside them.
    pub(crate) parameters: Vec<Quantity>,
    /// Share of the loss under the parameters alone that the tables remove, at most 1.
    pub(crate) share_explained: f64,
}

/// Tables for an unknown input, or the reason why there are none; `reported` is the calibration with the needed parameters.
pub(crate) fn tabulate(
    engine: &Engine<'_>,
    calibrated: &FittedModel,
    reported: &FittedModel,
    outside: &UncataloguedTerm,
    unknowns: &[UnknownSeries],
    progress: &mut dyn FnMut(&str),
) -> Result<Tables, String> {
    let (axis, balance) = parse_balance(&outside.balance)
        .ok_or_else(|| format!("a table adds to a force or to a flow, and {} is neither", outside.balance))?;
    let rig = with_factors(&engine.rig, &calibrated.factors);
    let restarted = engine.is_linked().then(|| engine.with_starts_under(&rig));
    let engine = restarted.as_ref().unwrap_or(engine);
    let free = reported.factors.map(|factor| factor != 1.0);
    let without_tables = Model::without_tables(reported.factors, free);
    let parameters_alone =
        Iterate::of(engine, without_tables).ok_or("no rig can have the parameters that are off")?;
    let parameters_alone = fit::fit(engine, parameters_alone, FIRST_STEPS);
    let search = TableSearch { engine, axis, balance, unknowns };

    progress("a table for what is missing");
    let (first, used) = search.best(&parameters_alone, None).ok_or("no rig can have its curve")?;
    let mut best = search.refined(first);
    progress("a table over a second variable");
    if let Some((second, _)) = search.best(&best, Some(used))
        && best.loss - second.loss > LEAST_SHARE_OF_SECOND * best.loss.abs()
    {
        best = fit::fit(engine, second, STEPS);
    }
    let (best, off) = with_needed(engine, best);
    if best.loss > parameters_alone.loss - LEAST_SHARE * parameters_alone.loss.abs() {
        return Err("its table leaves the windows of the training records no better".to_owned());
    }
    let linearisation =
        TableLinearisation::of(engine, best.model.clone()).ok_or("no rig can have its neighbours")?;
    let bare = TableLinearisation::of(engine, parameters_alone.model.clone())
        .ok_or("no rig can have its neighbours")?;
    let unseen = bare.cross_validated_loss(engine, &parameters_alone);
    if linearisation.cross_validated_loss(engine, &best) > unseen - LEAST_SHARE * unseen.abs() {
        return Err("its table leaves windows that it was not fitted on no better".to_owned());
    }
    let fitted = best.as_fitted_model(engine, &linearisation);
    Ok(Tables {
        terms: best.model.tables.iter().map(|table| term(&table.table)).collect(),
        parameters: (0..COUNT).filter(|at| off[*at]).map(|at| quantity(engine, at, &fitted)).collect(),
        share_explained: share_removed(parameters_alone.loss, best.loss),
    })
}

/// The model with the needed parameters, and which; the others are at the rig file's values.
fn with_needed(engine: &Engine<'_>, best: Iterate) -> (Iterate, [bool; COUNT]) {
    let all = Model { free: [true; COUNT], ..best.model.clone() };
    let all_fixed = Iterate::of(engine, best.model.clone().with_fixed([false; COUNT]));
    let Some((linearisation, all_fixed)) = TableLinearisation::of(engine, all).zip(all_fixed) else {
        return (best, [true; COUNT]);
    };
    let linearisation = linearisation.columns_with(&[]);
    let bare = fit::steps(engine, all_fixed, &linearisation[COUNT..]);
    let needed = fit::needed(engine, &bare, &linearisation, MIN_GAIN);
    let Some(start) = Iterate::of(engine, bare.model.clone().with_fixed(needed)) else {
        return (bare, [false; COUNT]);
    };
    // The known linearisation serves for the first steps.
    let is_in = |at: &usize| needed.get(*at).is_none_or(|needed| *needed);
    let columns: Vec<&[f64]> = (0..linearisation.len()).filter(is_in).map(|at| linearisation[at]).collect();
    (fit::fit(engine, fit::steps(engine, start, &columns), STEPS), needed)
}

/// Argument of a table: a variable, or none for a constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Argument {
    Variable(Variable),
    Constant,
}

/// `drive.flow-a`; `None` for a balance that a table cannot add to.
fn parse_balance(balance: &str) -> Option<(Axis, Balance)> {
    let (axis, name) = balance.split_once('.')?;
    let axis = Axis::ALL.into_iter().find(|known| known.name() == axis)?;
    Some((axis, Balance::ALL.into_iter().find(|known| known.name() == name)?))
}

struct TableSearch<'a> {
    engine: &'a Engine<'a>,
    axis: Axis,
    balance: Balance,
    unknowns: &'a [UnknownSeries],
}

impl TableSearch<'_> {
    /// The best model with one more variable other than `used`; `None` where no rig can have any. All are screened linearly and
    /// the best are fitted.
    fn best(&self, from: &Iterate, used: Option<Argument>) -> Option<(Iterate, Argument)> {
        let sets: &[&[Balance]] = match self.balance {
            Balance::Force => &[&[Balance::Force]],
            Balance::FlowA => &[&[Balance::FlowA], &[Balance::FlowA, Balance::FlowB]],
            Balance::FlowB => &[&[Balance::FlowB], &[Balance::FlowA, Balance::FlowB]],
        };
        let linearisation = TableLinearisation::of(self.engine, from.model.clone())?;
        let all = Variable::ALL.into_iter().map(Argument::Variable).chain([Argument::Constant]);
        // Linearised once for each balance.
        let flat = |argument: Argument, balance: Balance| {
            let mut fitted = self.table(argument, balance)?;
            fitted.table.value.fill(0.0);
            linearisation.linearised_table(self.engine, fitted)
        };
        let flats: Vec<(Argument, Vec<LinearisedTable>)> = all
            .filter(|argument| Some(*argument) != used)
            .map(|argument| {
                (
                    argument,
                    sets[sets.len() - 1].iter().filter_map(|balance| flat(argument, *balance)).collect(),
                )
            })
            .collect();
        let mut screened: Vec<(f64, Argument, Vec<&LinearisedTable>)> = Vec::new();
        for (argument, tables) in &flats {
            for balances in sets {
                let beside: Vec<&LinearisedTable> =
                    tables.iter().filter(|table| balances.contains(&table.balance())).collect();
                if beside.len() == balances.len() {
                    screened.push((
                        linearisation.predicted_loss(self.engine, from, &beside),
                        *argument,
                        beside,
                    ));
                }
            }
        }
        screened.sort_by(|left, right| left.0.total_cmp(&right.0));
        let fitted = screened.iter().take(TRIED).filter_map(|(_, argument, beside)| {
            let balances: Vec<Balance> = beside.iter().map(|table| table.balance()).collect();
            let start = self.start(&from.model, *argument, &balances)?;
            // Beside a fitted table the linearisation of the screening suffices.
            let point = if from.model.tables.is_empty() {
                fit::fit(self.engine, start, FIRST_STEPS)
            } else {
                fit::steps(self.engine, start, &linearisation.columns_with(beside))
            };
            Some((point, *argument))
        });
        fitted.min_by(|left, right| left.0.loss.total_cmp(&right.0.loss))
    }

    /// A model with tables of some balances, at their curves or at 0.
    fn with_tables(
        &self,
        model: &Model,
        argument: Argument,
        balances: &[Balance],
        is_flat: bool,
    ) -> Option<Model> {
        let mut model = model.clone();
        for balance in balances {
            let mut fitted = self.table(argument, *balance)?;
            if is_flat {
                fitted.table.value.fill(0.0);
            }
            model.tables.push(fitted);
        }
        Some(model)
    }

    /// A model with tables of some balances, started at their curves or at 0, whichever has the smaller loss.
    fn start(&self, model: &Model, argument: Argument, balances: &[Balance]) -> Option<Iterate> {
        let from = [false, true].map(|is_flat| self.with_tables(model, argument, balances, is_flat));
        let [curved, flat] = from.map(|model| Iterate::of(self.engine, model?));
        match (curved, flat) {
            (Some(curved), Some(flat)) => Some(if curved.loss < flat.loss { curved } else { flat }),
            (one, other) => one.or(other),
        }
    }

    /// Index of a table variable among those of unknown inputs.
    fn variable_index(variable: Variable) -> Option<usize> {
        VARIABLES.iter().position(|known| known.name == variable.name())
    }

    fn value(variable: Variable, point: &UnknownPoint) -> f64 {
        let of =
            |variable: Variable| Self::variable_index(variable).map_or(0.0, |index| point.variables[index]);
        match variable {
            Variable::DirectedExtension => of(Variable::Extension) * of(Variable::Direction),
            variable => of(variable),
        }
    }

    /// The curve of an unknown input as a table.
    fn table(&self, argument: Argument, balance: Balance) -> Option<FittedTable> {
        let name = format!("{}.{}", self.axis.name(), balance.name());
        let series = self.unknowns.iter().find(|series| series.balance == name)?;
        let variable = match argument {
            Argument::Constant => Variable::Extension,
            Argument::Variable(variable) => variable,
        };
        // Only friction changes sign with the direction.
        if variable == Variable::DirectedExtension && balance != Balance::Force {
            return None;
        }
        let mut sorted_samples: Vec<f64> =
            series.points.iter().map(|point| Self::value(variable, point)).collect();
        sorted_samples.sort_unstable_by(f64::total_cmp);
        let curve = Self::variable_index(variable).map(|index| map(series, index));
        let at = match (argument, variable) {
            (Argument::Constant, _) => vec![0.0, self.engine.rig.cylinder().stroke_m],
            (_, Variable::Direction) => vec![-1.0, 1.0],
            (_, Variable::DirectedExtension) => knots(&sorted_samples, DIRECTED_KNOTS),
            _ => knots(&sorted_samples, KNOTS),
        };
        if at.len() < 2 || curve.as_ref().is_some_and(|curve| curve.at.is_empty()) {
            return None;
        }
        let most = balance.most();
        let value = match (argument, curve) {
            (_, None) => vec![0.0; at.len()],
            (Argument::Constant, Some(curve)) => {
                let mean = curve.value.iter().sum::<f64>() / curve.value.len() as f64;
                vec![mean.clamp(-most, most); 2]
            }
            (Argument::Variable(_), Some(curve)) => {
                at.iter().map(|x| interpolated(&curve.at, &curve.value, *x).clamp(-most, most)).collect()
            }
        };
        let table = Tabulated { axis: self.axis, balance, variable, at, value };
        Some(FittedTable { table, is_constant: argument == Argument::Constant, sorted_samples })
    }

    /// Refines the table while the loss, penalty included, falls.
    fn refined(&self, start: Iterate) -> Iterate {
        let mut best = fit::fit(self.engine, start, STEPS);
        for times in REFINEMENTS {
            let mut model = best.model.clone();
            for fitted in model.tables.iter_mut().filter(|fitted| fitted.table.at.len() > 2) {
                let is_directed = fitted.table.variable == Variable::DirectedExtension;
                let points = if is_directed { DIRECTED_KNOTS } else { KNOTS };
                // One more may come at the end.
                let at = knots(&fitted.sorted_samples, (times * points).min(MAX_KNOTS - 1));
                fitted.table.value =
                    at.iter().map(|x| interpolated(&fitted.table.at, &fitted.table.value, *x)).collect();
                fitted.table.at = at;
            }
            let Some(point) = Iterate::of(self.engine, model) else { break };
            let tried = fit::fit(self.engine, point, FIRST_STEPS);
            if tried.loss >= best.loss {
                break;
            }
            best = tried;
        }
        best
    }
}

/// Knots over sorted values: placed half by rank, half by distance, so that neither a cluster at rest nor a single fast stroke
/// dominates.
fn knots(sorted_samples: &[f64], count: usize) -> Vec<f64> {
    let (Some(least), Some(most)) = (sorted_samples.first(), sorted_samples.last()) else {
        return Vec::new();
    };
    let width = most - least;
    let mut at = vec![*least];
    for (rank, value) in sorted_samples.iter().enumerate() {
        let progress_along = 0.5 * rank as f64 / sorted_samples.len() as f64 + 0.5 * (value - least) / width;
        let apart = value - at[at.len() - 1] > 0.2 * width / count as f64;
        if progress_along >= at.len() as f64 / (count - 1) as f64 && apart {
            at.push(*value);
        }
    }
    if at.len() > 1 && most - at[at.len() - 1] < 0.2 * width / count as f64 {
        at.pop();
    }
    if *most > at[at.len() - 1] {
        at.push(*most);
    }
    at
}

fn term(table: &Tabulated) -> TableTerm {
    TableTerm {
        balance: format!("{}.{}", table.axis.name(), table.balance.name()),
        variable: table.variable.name().to_owned(),
        variable_unit: table.variable.unit().to_owned(),
        unit: table.balance.unit().name().to_owned(),
        at: table.at.clone(),
        value: table.value.clone(),
    }
}

/// Tables of a report as tables of a rig; invalid ones are left out.
pub(crate) fn tables(terms: &[TableTerm]) -> Vec<Tabulated> {
    let table = |term: &TableTerm| {
        let (axis, balance) = parse_balance(&term.balance)?;
        let variable = Variable::ALL.into_iter().find(|known| known.name() == term.variable)?;
        Some(Tabulated { axis, balance, variable, at: term.at.clone(), value: term.value.clone() })
    };
    terms.iter().filter_map(table).collect()
}

fn with_tables(rig: &RigParameters, tables: &[FittedTable]) -> Option<RigParameters> {
    let mut all = rig.tabulated().to_vec();
    all.extend(tables.iter().map(|fitted| fitted.table.clone()));
    rig.with_tabulated(&all).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_where_values_are_and_reach_from_the_least_to_the_most() {
        let mut sorted_samples: Vec<f64> =
            (0..1000).map(|at| if at < 700 { 0.0 } else { f64::from(at) * 1e-3 }).collect();
        sorted_samples.sort_unstable_by(f64::total_cmp);
        for count in [2, 8, 16, 32] {
            let at = knots(&sorted_samples, count);
            assert!((2..=count + 1).contains(&at.len()), "{at:?}");
            assert_eq!((at[0], at[at.len() - 1]), (0.0, 0.999));
            assert!(at.windows(2).all(|pair| pair[0] < pair[1]), "{at:?}");
        }
        assert_eq!(knots(&[3.0; 9], 8), [3.0]);
    }

    #[test]
    fn terms_of_a_report_are_tables_of_a_rig() {
        let reported = Tabulated {
            axis: Axis::Load,
            balance: Balance::FlowB,
            variable: Variable::PressureB,
            at: vec![1e5, 6e5],
            value: vec![0.0, -3.5],
        };
        assert_eq!(tables(&[term(&reported)]), [reported]);
    }
}
