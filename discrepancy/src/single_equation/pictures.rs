//! Series for the page: the measured balance and both models.

use super::model::Kind;
use super::runs::Run;
use super::{Fitted, Study};
use crate::page::{Pictures, Trace};
use std::collections::BTreeSet;
use std::ops::Range;

/// Litres a minute in a cubic metre a second: what is missing of a flow is small.
const L_PER_MIN: f64 = 6e4;

impl Study {
    /// The first record of some runs, with both models.
    pub(super) fn pictures(&self, runs: &[Run], fitted: &Fitted, held_out: bool) -> Pictures {
        let Some((run, range)) = runs.first().zip(fitted.rows.records.first()) else {
            return Pictures::default();
        };
        let (signal, unit, factor) = match self.model.kind {
            Kind::Chamber => ("air of chamber a, missing".to_owned(), "Nl/min", L_PER_MIN),
            _ => (self.model.channels["force"].column(), "N", 1.0),
        };
        let breaks = breaks(run, range);
        let drawn = |value: &dyn Fn(usize) -> f64, at_break: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let points = range.clone().flat_map(|row| {
                let gap = breaks.contains(&(row - range.start)).then(|| at_break(row));
                gap.into_iter().chain([value(row)])
            });
            points.collect()
        };
        let shown = |value: &dyn Fn(usize) -> f64| drawn(&|row| factor * value(row), &|_| f64::NAN);
        let time_s = |row: usize| run.time_s[run.kept[row - range.start]];
        // Filters settle at the ends: differences there are no model error.
        let in_score = |value: &dyn Fn(usize) -> f64| {
            shown(&|row| if fitted.rows.in_score[row] { value(row) } else { f64::NAN })
        };
        let target = &fitted.rows.target;
        let [before, after] = &fitted.residuals;
        let trace = Trace {
            signal,
            unit: unit.to_owned(),
            time_s: drawn(&time_s, &time_s),
            measured: shown(&|row| target[row]),
            before: shown(&|row| target[row] - before[row]),
            after: shown(&|row| target[row] - after[row]),
            before_residual: in_score(&|row| before[row]),
            after_residual: in_score(&|row| after[row]),
            // Nobody knows the sensors of a foreign record.
            noise: 0.0,
        };
        Pictures { record: run.name.clone(), held_out, traces: vec![trace] }
    }
}

/// Rows before which samples were left out, as where a rod was too slow to count: nothing is drawn across.
fn breaks(run: &Run, range: &Range<usize>) -> BTreeSet<usize> {
    let step = |row: usize| run.kept[row] - run.kept[row - 1];
    let usual = (1..range.len()).map(step).min().unwrap_or(1);
    (1..range.len()).filter(|row| step(*row) > usual).collect()
}
