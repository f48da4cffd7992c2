//! Baseline parameters as nuisance parameters: fitted in every model, and reported when significantly off.
//!
//! Each is a factor on one or several keys of the rig file, with a prior whose width is what a builder knows of such a rig.
//! Source: effects.md, Parameters that may merely be wrong.

use plant::RigParameters;
use plant::parameters::{ParameterError, table};

/// A number of the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in reports.
    pub name: &'static str,
    /// Keys of the rig file that it scales, the reported one first.
    pub(crate) keys: &'static [&'static str],
    /// Prior standard deviation of its factor.
    pub prior_std: f64,
}

/// All of them, in the order of effects.md.
pub const PARAMETERS: [Parameter; 9] = [
    Parameter {
        name: "parameter:mass",
        keys: &["mass.drive_kg", "mass.carriage_kg", "mass.load_kg"],
        prior_std: 0.05,
    },
    Parameter {
        name: "parameter:viscous-friction",
        keys: &["friction.viscous_n_per_mm_per_s"],
        prior_std: 0.1,
    },
    Parameter { name: "parameter:sliding-friction", keys: &[SLIDING], prior_std: 0.1 },
    Parameter { name: "parameter:break-away-force", keys: &[BREAK_AWAY], prior_std: 0.1 },
    Parameter { name: "parameter:supply-pressure", keys: &["supply.pressure_bar"], prior_std: 0.05 },
    Parameter {
        name: "parameter:spool-time-constant",
        keys: &["valve.spool_time_constant_ms"],
        prior_std: 0.1,
    },
    Parameter { name: "parameter:flow-lag", keys: &["valve.flow_lag_time_constant_ms"], prior_std: 0.1 },
    Parameter {
        name: "parameter:kv-scale",
        keys: &["valve.kv_supply_m3_per_h", "valve.kv_exhaust_m3_per_h"],
        prior_std: 0.05,
    },
    Parameter {
        name: "parameter:piston-area",
        keys: &["cylinder.piston_area_mm2", "cylinder.annulus_area_mm2"],
        prior_std: 0.02,
    },
];

const SLIDING: &str = "friction.sliding_force_n";
const BREAK_AWAY: &str = "friction.break_away_force_n";

/// Number of baseline parameters.
pub const COUNT: usize = PARAMETERS.len();

impl Parameter {
    /// The rig with this number scaled.
    ///
    /// # Errors
    /// [`ParameterError`] when a key leaves its range.
    pub fn scaled(&self, rig: &RigParameters, factor: f64) -> Result<RigParameters, ParameterError> {
        self.keys.iter().try_fold(rig.clone(), |rig, key| {
            let numbers: Vec<f64> = rig.numbers(key).iter().map(|number| number * factor).collect();
            rig.with(key, &numbers)
        })
    }

    /// Value and unit in a rig file, of the first axis that is measured; of tables 1, without a unit: their common factor.
    pub fn value(&self, rig: &RigParameters, measured: [bool; 2]) -> (f64, &'static str) {
        // For both axes together the mass is a common factor.
        if self.name == "parameter:mass" && measured == [true; 2] {
            return (1.0, "");
        }
        let place = if self.name == "parameter:mass" && !measured[0] { self.keys.len() - 1 } else { 0 };
        let key = table::KEYS.iter().find(|key| key.path() == self.keys[place]).expect("the table has it");
        match rig.numbers(self.keys[place]) {
            [one] => (*one, key.unit.name()),
            _ => (1.0, ""),
        }
    }
}

/// The rig with all factors applied. Numbers are clamped to their ranges and the break-away force to the sliding force; numbers
/// inconsistent with the rest of the file stay unchanged.
pub fn with_factors(rig: &RigParameters, factors: &[f64; COUNT]) -> RigParameters {
    let mut changes: Vec<(&str, Vec<f64>)> = Vec::new();
    for (parameter, factor) in PARAMETERS.iter().zip(factors).filter(|(_, factor)| **factor != 1.0) {
        for path in parameter.keys {
            let key = table::KEYS.iter().find(|key| key.path() == *path).expect("the table has it");
            let held = rig.numbers(path).iter().map(|number| (number * factor).clamp(key.min, key.max));
            changes.push((path, held.collect()));
        }
    }
    let new = |path: &str| {
        changes.iter().find(|(change, _)| *change == path).map_or(rig.numbers(path)[0], |change| change.1[0])
    };
    let (sliding_n, rest_n) = (new(SLIDING), new(BREAK_AWAY));
    if rest_n < sliding_n {
        changes.retain(|(path, _)| *path != BREAK_AWAY);
        changes.push((BREAK_AWAY, vec![sliding_n]));
    }
    let all = changes.iter().map(|(path, numbers)| (*path, numbers.as_slice()));
    rig.with_all(all.clone()).unwrap_or_else(|_| {
        all.fold(rig.clone(), |rig, (path, numbers)| rig.with(path, numbers).unwrap_or(rig))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(changed: &[(&str, f64)]) -> [f64; COUNT] {
        let of = |name: &str| changed.iter().find(|(entry, _)| *entry == name).map_or(1.0, |entry| entry.1);
        PARAMETERS.map(|parameter| of(parameter.name.trim_start_matches("parameter:")))
    }

    #[test]
    fn factors_that_go_together_are_applied_together() {
        let rig = RigParameters::baseline();
        // Either of them alone would be refused on the way.
        let scaled = with_factors(&rig, &factors(&[("break-away-force", 0.72), ("sliding-friction", 0.7)]));
        assert_eq!(scaled.numbers(BREAK_AWAY)[0], 0.72 * rig.numbers(BREAK_AWAY)[0]);
        assert_eq!(scaled.numbers(SLIDING)[0], 0.7 * rig.numbers(SLIDING)[0]);
        let scaled = with_factors(&rig, &factors(&[("piston-area", 0.8)]));
        for path in ["cylinder.piston_area_mm2", "cylinder.annulus_area_mm2"] {
            assert_eq!(scaled.numbers(path)[0], 0.8 * rig.numbers(path)[0]);
        }
    }

    #[test]
    fn a_piston_at_rest_holds_at_least_what_slides() {
        let rig = RigParameters::baseline();
        let scaled = with_factors(&rig, &factors(&[("break-away-force", 0.7)]));
        assert_eq!(scaled.numbers(BREAK_AWAY), scaled.numbers(SLIDING));
    }
}
