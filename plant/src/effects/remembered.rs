//! Values that a declared term keeps from step to step, as a play or a low pass of what it is over.
//!
//! ```text
//!   w = start(x, v, p_a, p_b, u, s, t, F)                                       where the plant begins
//!   w = update(x, v, p_a, p_b, u, s, t, F, w, dt), held in its range            at the end of each substep of length dt
//! ```
//!
//! A term has the value of the last substep's end. All that a term keeps is renewed at once, from the values before. Start and
//! update are proven finite as the term itself is; the declared range is what the term's proof is over.

use super::declared::{MOST_REMEMBERED, SENSOR_FORCE, VARIABLES};
use expression::formula::Formula;
use expression::units::Unit;

/// Name of the length of a substep in an update, its unit and range.
pub(crate) const STEP: (&str, &str, [f64; 2]) = ("dt", "s", [1e-6, 1e-3]);

/// Variables of start and update before what is remembered.
const BEFORE: usize = VARIABLES.len();

/// A variable that a term keeps from step to step, as a file declares it, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryVariable {
    /// Its name in the expressions.
    pub name: String,
    pub(crate) unit: Unit,
    /// Least and largest value, in the unit of the file.
    pub range: [f64; 2],
    pub(crate) start: String,
    pub(crate) update: String,
    pub(crate) start_formula: Formula,
    pub(crate) update_formula: Formula,
}

impl MemoryVariable {
    pub(crate) fn set(&mut self, parameters_si: &[f64]) {
        self.start_formula.set(parameters_si);
        self.update_formula.set(parameters_si);
    }

    /// Whether start or update is over the force sensor.
    pub(crate) fn reads_sensor_force(&self) -> bool {
        [&self.start_formula, &self.update_formula].into_iter().any(|formula| formula.reads(SENSOR_FORCE))
    }

    pub(crate) fn law(&self) -> MemoryLaw {
        let range_si = self.range.map(|end| end * self.unit.factor);
        MemoryLaw { start: self.start_formula.clone(), update: self.update_formula.clone(), range_si }
    }
}

/// Start and update of a memory variable, in SI.
#[derive(Debug, Clone)]
pub(crate) struct MemoryLaw {
    start: Formula,
    update: Formula,
    range_si: [f64; 2],
}

impl MemoryLaw {
    /// Its value where the plant begins, at these [`VARIABLES`].
    pub(crate) fn begin(&self, values: &[f64; VARIABLES.len()]) -> f64 {
        let [least, most] = self.range_si;
        self.start.value(values).clamp(least, most)
    }
}

/// Renews what one term keeps.
pub(crate) fn renew(laws: &[MemoryLaw], values: &[f64; VARIABLES.len()], step_s: f64, kept: &mut [f64]) {
    let mut all = [0.0; BEFORE + MOST_REMEMBERED + 1];
    all[..BEFORE].copy_from_slice(values);
    all[BEFORE..][..kept.len()].copy_from_slice(kept);
    all[BEFORE + kept.len()] = step_s;
    let all = &all[..=BEFORE + kept.len()];
    for (law, kept) in laws.iter().zip(kept) {
        let [least, most] = law.range_si;
        *kept = law.update.value(all).clamp(least, most);
    }
}
