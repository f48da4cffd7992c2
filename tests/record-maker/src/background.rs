//! Errors of the whole model, each small: what every real rig has beside the one effect that is looked for.
//!
//! ```text
//!   effects of the catalogue below its smallest amplitudes       friction that fades near rest
//!   points of both K_V tables, dead volume, temperature          slow noise beside the sensors' own
//!   steps of first order in place of the midpoint's
//! ```
//!
//! Source: discrepancy-notes.md, Second reading, 8.

use super::Hidden;
use plant::parameters::VALVE_POINTS;
use serde_json::{Value, json};

/// Nobody is asked to name any of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Background {
    /// Below the smallest amplitudes of their sheets.
    pub effects: Vec<Hidden>,
    /// Factors on K_V of supply and exhaust edge at each opening of the table.
    pub valve_point_factors: [[f64; VALVE_POINTS]; 2],
    /// Factor on the dead volume of each chamber.
    pub dead_volume_ratio: f64,
    /// T / T_0 of all air.
    pub temperature_ratio: f64,
    /// Share of the sliding friction that is missing near rest.
    pub fading_ratio: f64,
    /// Speed over which it comes.
    pub fading_below_m_per_s: f64,
    /// Share of the noise's variance with a correlation of [`SLOW_NOISE_SAMPLES`].
    pub slow_noise_ratio: f64,
}

impl Background {
    /// As `truth.json` and `draws.json` hold it; each writes effects its own way.
    #[must_use]
    pub fn as_json(&self, effects: Vec<Value>) -> Value {
        json!({
            "effects": effects,
            "valve_point_factors": self.valve_point_factors,
            "dead_volume_ratio": self.dead_volume_ratio,
            "temperature_ratio": self.temperature_ratio,
            "fading_ratio": self.fading_ratio,
            "fading_below_m_per_s": self.fading_below_m_per_s,
            "slow_noise_ratio": self.slow_noise_ratio,
        })
    }
}

/// Correlation time of the slow noise, in samples of 1 ms.
pub(super) const SLOW_NOISE_SAMPLES: f64 = 50.0;
