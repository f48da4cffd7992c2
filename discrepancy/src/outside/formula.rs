//! A short formula for an unknown input, if one fits.
//!
//! ```text
//! d = a f(variables) + b       a, b by weighted least squares       at most five nodes
//! ```
//!
//! The shortest formula within a share of the best gain is taken, if it explains most of what bins of any variable explain.
//!
//! Source: discrepancy-notes.md, Pipeline 8. Short laws before good ones: Udrescu, Tegmark 2020, Science Advances 6(16).

use super::dependence::{Bins, Sample};
use crate::locate::{
    DIRECTION, HISTORY_COMPLEXITY, POSITION, SPEED, TIME, VARIABLES, VELOCITY, WindowVariable,
};
use std::f64::consts::TAU;

/// Share of the best gain that a shorter formula must reach.
const NEARLY: f64 = 0.95;
/// Share of what bins explain that a formula must explain.
const ENOUGH: f64 = 0.8;
/// Grid of ripple periods over x, m: 4 mm to 400 mm in steps of 2 %.
const SHORTEST_M: f64 = 0.004;
const PERIODS: usize = 232;

type Law = Box<dyn Fn(&[f64; VARIABLES.len()]) -> f64>;

/// A formula with a factor, and perhaps a constant.
struct CandidateFormula {
    nodes: usize,
    text: String,
    unit: String,
    law: Law,
    constant: bool,
}

/// The shortest formula that explains an unknown input, its numbers in the units of the report.
pub(crate) fn formula(sample: &Sample, unit: &str) -> Option<String> {
    let fits: Vec<(CandidateFormula, [f64; 2], f64)> = forms()
        .into_iter()
        .map(|form| {
            let (numbers, gain) = fit(sample, &form);
            (form, numbers, gain)
        })
        .collect();
    let most = fits.iter().map(|fit| fit.2).fold(0.0, f64::max);
    let best = fits
        .iter()
        .filter(|fit| fit.2 >= NEARLY * most)
        .min_by(|left, right| left.0.nodes.cmp(&right.0.nodes).then(right.2.total_cmp(&left.2)))?;
    let (form, [factor, constant], gain) = best;
    if *gain <= 0.0 || *gain < ENOUGH * binned(sample) {
        return None;
    }
    let per = if form.unit.is_empty() { unit.to_owned() } else { format!("{unit}/({})", form.unit) };
    Some(match (form.text.as_str(), form.constant) {
        ("", _) => format!("{constant:.4} {unit}"),
        (text, true) => format!("{constant:.4} {unit} + {factor:.4e} {per} * {text}"),
        (text, false) => format!("{factor:.4e} {per} * {text}"),
    })
}

/// Weighted squares explained by bins of the best variable, the mean included.
fn binned(sample: &Sample) -> f64 {
    let mean = sample.constant_share() * sample.squares();
    let variable = |at: &usize| *at != TIME;
    let singles = (0..VARIABLES.len())
        .filter(variable)
        .flat_map(|at| [Bins::of(sample, at), Bins::even(sample, at)].map(|bins| sample.explained(&bins, 0)));
    mean + singles.fold(0.0, f64::max) * (sample.squares() - mean)
}

fn forms() -> Vec<CandidateFormula> {
    let mut forms = vec![form(1, "", "", true, |_| 0.0)];
    let is_present = |at: &usize| *at != TIME && VARIABLES[*at].complexity < HISTORY_COMPLEXITY;
    for at in (0..VARIABLES.len()).filter(is_present) {
        let WindowVariable { name, unit, nodes, .. } = VARIABLES[at];
        let text = if name == "p_a-p_b" { "(p_a-p_b)" } else { name };
        forms.push(form(2 + nodes, text, unit, false, move |variables| variables[at]));
        if nodes <= 2 {
            forms.push(form(4 + nodes, text, unit, true, move |variables| variables[at]));
        }
        if nodes == 1 && at != VELOCITY {
            let product = format!("sign(v)*{text}");
            forms.push(form(5, &product, unit, false, move |variables| variables[DIRECTION] * variables[at]));
        }
    }
    forms.push(form(5, "|v|*v", "m2/s2", false, |variables| variables[VELOCITY] * variables[SPEED]));
    for step in 0..PERIODS {
        let period_m = SHORTEST_M * 1.02_f64.powi(step as i32);
        let text = format!("sin(2 pi x/{period_m:.4} m)");
        forms.push(form(5, &text, "", false, move |variables| (TAU * variables[POSITION] / period_m).sin()));
    }
    forms
}

fn form(
    nodes: usize,
    text: &str,
    unit: &str,
    constant: bool,
    law: impl Fn(&[f64; VARIABLES.len()]) -> f64 + 'static,
) -> CandidateFormula {
    CandidateFormula { nodes, text: text.to_owned(), unit: unit.to_owned(), law: Box::new(law), constant }
}

/// Factor, constant, and the weighted squares removed.
fn fit(sample: &Sample, form: &CandidateFormula) -> ([f64; 2], f64) {
    let (mut ff, mut f, mut one, mut fd, mut d) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (value, weight, variables) in sample.rows() {
        let law = (form.law)(variables);
        ff += weight * law * law;
        f += weight * law;
        one += weight;
        fd += weight * law * value;
        d += weight * value;
    }
    if form.text.is_empty() {
        return ([0.0, d / one], d * d / one);
    }
    if !form.constant {
        let factor = if ff > 0.0 { fd / ff } else { 0.0 };
        return ([factor, 0.0], factor * fd);
    }
    let determinant = ff * one - f * f;
    if determinant <= 1e-12 * ff * one {
        return ([0.0, d / one], d * d / one);
    }
    let factor = (fd * one - f * d) / determinant;
    let constant = (d - factor * f) / one;
    ([factor, constant], factor * fd + constant * d)
}
