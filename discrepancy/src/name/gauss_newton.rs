//! The last steps of a fit, all numbers of the model in the simulator, and their standard errors there.
//!
//! ```text
//!   effects and needed parameters ──► Gauss-Newton on all of them ──► accepted only when the simulator leaves less
//! ```
//!
//! Naming moves the parameters by straight lines: good enough to compare models that have them in common, but what a straight
//! line promised is not what the simulator leaves.

use super::NUMBER_COSTS;
use super::null_distribution::FAR_OFF;
use crate::engine::Engine;
use crate::fit::{Fit, Products, loss};
use crate::parameters::COUNT;
use crate::refit::{
    MOST_OFF, Placed, Refit, coordinate_columns, coordinate_ridge, costs, parameter_ridges, rig_of,
};
use crate::windows::dot;
use rayon::prelude::*;
use std::borrow::Cow;

/// Steps at most, how often one is made shorter, and to what share of it.
const STEPS: usize = 6;
const SHORTENINGS: i32 = 4;
const SHORTER: f64 = 0.4;
/// How often windows are left out of a step at most, and from where on they are: standard deviations of a window's squares.
const DOUBTS: usize = 4;
const BROKEN: f64 = 6.0;
/// Fall of the loss below which a fit has settled.
const CONVERGED: f64 = 0.3;

/// Shares of the parameters' way that are tried where straight lines may have led too far.
const WAYS: [f64; 4] = [1.0, 0.6, 0.3, 0.0];

/// The parameters of a model, as far as the simulator goes along with what straight lines promised of them: beside an effect that
/// is still missing they may be led where nothing is right any more.
pub(super) fn backtrack(engine: &Engine<'_>, model: &Refit) -> [f64; COUNT] {
    let tried = WAYS.map(|way| model.factors.map(|factor| 1.0 + way * (factor - 1.0)));
    let loss = |factors: &[f64; COUNT]| {
        point(engine, model.placed.clone(), *factors).map_or(f64::INFINITY, |point| point.loss)
    };
    let losses: Vec<f64> = tried.par_iter().map(loss).collect();
    let best = (0..WAYS.len()).min_by(|one, other| losses[*one].total_cmp(&losses[*other]));
    tried[best.expect("one at least")]
}

/// A model fitted in the simulator to the end, all parameters beside, with what its numbers cost; itself where that is no better.
pub(super) fn fit_all(engine: &Engine<'_>, model: &Refit) -> Refit {
    let Some(mut fit) = fit_selected(engine, model, &[true; COUNT]) else { return model.clone() };
    fit.loss += costs(numbers(&fit.placed).len(), &fit.factors, NUMBER_COSTS);
    if fit.loss < model.loss { fit } else { model.clone() }
}

/// A model where the simulator was asked.
struct Point {
    placed: Vec<Placed>,
    factors: [f64; COUNT],
    simulated: Vec<f64>,
    residual: Vec<f64>,
    /// Squares of each window.
    squares: Vec<f64>,
    /// What they and what is believed cost.
    loss: f64,
}

/// Fits a model in the simulator, parameters that are not `needed` held at what the file says; `None` where the rig cannot
/// have it.
pub(super) fn fit_selected(engine: &Engine<'_>, model: &Refit, needed: &[bool; COUNT]) -> Option<Refit> {
    let mut factors = model.factors;
    for (factor, _) in factors.iter_mut().zip(needed).filter(|(_, needed)| !**needed) {
        *factor = 1.0;
    }
    let mut point = point(engine, model.placed.clone(), factors)?;
    let chosen: Vec<usize> =
        (0..COUNT + numbers(&point.placed).len()).filter(|at| *at >= COUNT || needed[*at]).collect();
    let mut last = None;
    for step in 0..=STEPS {
        let lines = around(engine, &point)?;
        let tried = (step < STEPS).then(|| stepped(engine, &point, &lines, &chosen)).flatten();
        last = Some(lines);
        let Some(tried) = tried else { break };
        let fell = point.loss - tried.loss;
        point = tried;
        if fell < CONVERGED {
            last = None;
            break;
        }
    }
    let lines = match last {
        Some(lines) => lines,
        None => around(engine, &point)?,
    };
    let errors = errors(engine, &lines, &point);
    let Point { placed, factors, squares, loss, .. } = point;
    Some(Refit { placed, factors, loss, squares, errors, inflation: model.inflation })
}

fn point(engine: &Engine<'_>, placed: Vec<Placed>, factors: [f64; COUNT]) -> Option<Point> {
    let simulated = engine.simulate(&rig_of(engine.rig(), &placed, &factors)?);
    let residual = engine.residual(&simulated);
    let squares: Vec<f64> = residual.chunks_exact(engine.rows()).map(|window| dot(window, window)).collect();
    let believed = |ridge: f64, off: f64| ridge * off * off;
    let loss = loss(&squares, engine.freedom())
        + parameter_ridges()
            .iter()
            .zip(&factors)
            .map(|(ridge, factor)| believed(*ridge, factor - 1.0))
            .sum::<f64>()
        + numbers(&placed).iter().map(|(ridge, z)| believed(*ridge, *z)).sum::<f64>();
    Some(Point { placed, factors, simulated, residual, squares, loss })
}

/// Ridge and value of each coordinate of the effects.
fn numbers(placed: &[Placed]) -> Vec<(f64, f64)> {
    placed
        .iter()
        .flat_map(|effect| {
            effect
                .coordinates
                .iter()
                .enumerate()
                .map(|(key, z)| (coordinate_ridge(&effect.candidate, key), *z))
        })
        .collect()
}

/// Straight lines around a point.
struct Lines {
    /// What each number changes, parameters first.
    columns: Vec<Vec<f64>>,
    /// What is believed of each.
    ridges: Vec<f64>,
    /// How far each is from what is believed.
    from: Vec<f64>,
}

impl Lines {
    /// Products without what some windows say of the lines.
    fn products(&self, engine: &Engine<'_>, point: &Point, out: &[usize]) -> Products {
        let mut columns = Cow::from(&self.columns);
        if !out.is_empty() {
            for column in columns.to_mut() {
                out.iter().for_each(|at| column[at * engine.rows()..][..engine.rows()].fill(0.0));
            }
        }
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        Products::new(&point.residual, &columns, engine.freedom(), engine.rows())
    }
}

fn around(engine: &Engine<'_>, point: &Point) -> Option<Lines> {
    let rig = rig_of(engine.rig(), &point.placed, &[1.0; COUNT])?;
    let mut columns = engine.parameter_columns(&rig, &point.factors);
    columns.extend(coordinate_columns(engine, &point.factors, &point.placed, &point.simulated)?);
    let (coordinate_ridges, places): (Vec<f64>, Vec<f64>) = numbers(&point.placed).into_iter().unzip();
    let ridges = [parameter_ridges(), coordinate_ridges].concat();
    let from = point.factors.iter().map(|factor| factor - 1.0).chain(places).collect();
    Some(Lines { columns, ridges, from })
}

/// The best point along the lines that is better than this one: with all windows, and without those that are far off, whose
/// lines may lead anywhere.
fn stepped(engine: &Engine<'_>, point: &Point, lines: &Lines, chosen: &[usize]) -> Option<Point> {
    let far: Vec<usize> = (0..engine.freedom().len())
        .filter(|window| point.squares[*window] > FAR_OFF * engine.freedom()[*window])
        .collect();
    let with_all = along(engine, point, lines, chosen, &[]);
    let without = if far.is_empty() { None } else { along(engine, point, lines, chosen, &far) };
    [with_all, without].into_iter().flatten().min_by(|left, right| left.loss.total_cmp(&right.loss))
}

/// A better point along the lines, those of some windows left out. Where the simulator does not do what a window's lines
/// promise, they are left out as well: around a break-away, what a small change does says nothing of a smaller one.
fn along(
    engine: &Engine<'_>,
    point: &Point,
    lines: &Lines,
    chosen: &[usize],
    out: &[usize],
) -> Option<Point> {
    let part = |of: &[f64]| chosen.iter().map(|at| of[*at]).collect::<Vec<_>>();
    let (ridges, from) = (part(&lines.ridges), part(&lines.from));
    let mut out = out.to_vec();
    for _ in 0..DOUBTS {
        let fit = lines.products(engine, point, &out).fit_from(chosen, &ridges, &from);
        let tried = moved(engine, point, chosen, &fit, 1.0)?;
        if tried.loss < point.loss {
            return Some(tried);
        }
        let broken = |window: &usize| {
            tried.squares[*window] - fit.squares[*window] > BROKEN * engine.freedom()[*window].sqrt()
        };
        let before = out.len();
        out.extend((0..engine.freedom().len()).filter(broken));
        out.sort_unstable();
        out.dedup();
        if out.len() == before {
            return (1..=SHORTENINGS).find_map(|times| {
                moved(engine, point, chosen, &fit, SHORTER.powi(times))
                    .filter(|tried| tried.loss < point.loss)
            });
        }
    }
    None
}

/// The point a share of a step away.
fn moved(engine: &Engine<'_>, from: &Point, chosen: &[usize], step: &Fit, share: f64) -> Option<Point> {
    let (mut placed, mut factors) = (from.placed.clone(), from.factors);
    let mut changes = vec![0.0; COUNT + numbers(&placed).len()];
    chosen.iter().zip(&step.coefficients).for_each(|(at, coefficient)| changes[*at] = share * coefficient);
    for (factor, change) in factors.iter_mut().zip(&changes) {
        *factor = (*factor + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
    }
    let mut changes = changes[COUNT..].iter();
    for effect in &mut placed {
        for key in 0..effect.coordinates.len() {
            let [least, most] = effect.candidate.reach(key);
            effect.coordinates[key] =
                (effect.coordinates[key] + changes.next().expect("one each")).clamp(least, most);
        }
    }
    point(engine, placed, factors)
}

/// Standard errors beside all parameters, in the order of [`Refit::errors`]: which parameters are needed was told by the same
/// records.
fn errors(engine: &Engine<'_>, lines: &Lines, point: &Point) -> Vec<f64> {
    let products = lines.products(engine, point, &[]);
    let all: Vec<usize> = (0..products.columns()).collect();
    let weights = products.weights(&point.squares);
    let stays =
        Fit { coefficients: vec![0.0; all.len()], loss: point.loss, squares: point.squares.clone(), weights };
    let errors =
        products.jackknife(&all, &stays, &lines.ridges).unwrap_or_else(|| vec![f64::INFINITY; all.len()]);
    [&errors[COUNT..], &errors[..COUNT]].concat()
}
