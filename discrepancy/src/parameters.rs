//! Numbers of the baseline that may merely be wrong: carried along by every fit, and reported when one is off.
//!
//! Each is a factor on one or several keys of the rig file. Tolerances are what a builder knows of such a rig before it is
//! measured; data soon outweighs them. Source: effects.md, Parameters that may merely be wrong.

use plant::RigParameters;
use plant::parameters::{ParameterError, table};

/// A number of the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in reports.
    pub name: &'static str,
    /// Keys of the rig file that it scales, the one that is reported first.
    pub keys: &'static [&'static str],
    /// Standard deviation of its factor, before anything is measured.
    pub tolerance: f64,
}

/// All of them, in the order of effects.md.
pub const PARAMETERS: [Parameter; 9] = [
    Parameter {
        name: "parameter:mass",
        keys: &["mass.drive_kg", "mass.carriage_kg", "mass.load_kg"],
        tolerance: 0.05,
    },
    Parameter {
        name: "parameter:viscous-friction",
        keys: &["friction.viscous_n_per_mm_per_s"],
        tolerance: 0.1,
    },
    Parameter { name: "parameter:sliding-friction", keys: &["friction.sliding_force_n"], tolerance: 0.1 },
    Parameter { name: "parameter:break-away-force", keys: &["friction.break_away_force_n"], tolerance: 0.1 },
    Parameter { name: "parameter:supply-pressure", keys: &["supply.pressure_bar"], tolerance: 0.05 },
    Parameter {
        name: "parameter:spool-time-constant",
        keys: &["valve.spool_time_constant_ms"],
        tolerance: 0.1,
    },
    Parameter { name: "parameter:flow-lag", keys: &["valve.flow_lag_time_constant_ms"], tolerance: 0.1 },
    Parameter {
        name: "parameter:kv-scale",
        keys: &["valve.kv_supply_m3_per_h", "valve.kv_exhaust_m3_per_h"],
        tolerance: 0.05,
    },
    Parameter {
        name: "parameter:piston-area",
        keys: &["cylinder.piston_area_mm2", "cylinder.annulus_area_mm2"],
        tolerance: 0.02,
    },
];

/// How many there are.
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
    #[must_use]
    pub fn value(&self, rig: &RigParameters, measured: [bool; 2]) -> (f64, &'static str) {
        // Of both axes together, only a factor says what both have in common.
        if self.name == "parameter:mass" && measured == [true; 2] {
            return (1.0, "");
        }
        let own = if self.name == "parameter:mass" && !measured[0] { self.keys.len() - 1 } else { 0 };
        let key = table::KEYS.iter().find(|key| key.path() == self.keys[own]).expect("the table has it");
        match rig.numbers(self.keys[own]) {
            [one] => (*one, key.unit.name()),
            _ => (1.0, ""),
        }
    }
}

/// The rig with all factors applied; a factor that would leave a range, or the break-away force below the sliding one, is
/// held there.
#[must_use]
pub fn with_factors(rig: &RigParameters, factors: &[f64; COUNT]) -> RigParameters {
    let mut rig = rig.clone();
    // Break-away before sliding, growing ones first: the file's order between them holds at every step.
    let order: [usize; COUNT] =
        if factors[3] >= factors[2] { [0, 1, 3, 2, 4, 5, 6, 7, 8] } else { [0, 1, 2, 3, 4, 5, 6, 7, 8] };
    for at in order {
        if factors[at] != 1.0
            && let Ok(scaled) = PARAMETERS[at].scaled(&rig, factors[at])
        {
            rig = scaled;
        }
    }
    rig
}
