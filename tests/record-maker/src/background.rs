//! Model errors of the whole rig, each small: what every real rig has beside the effect in question.
//!
//! ```text
//!   effects of the catalogue below their smallest drawn sizes    friction that fades near rest
//!   points of both K_V tables, dead volume, temperature          slow noise added to the sensors' white noise
//!   first-order steps instead of the midpoint's
//! ```
//!
//! Source: discrepancy-notes.md, Second reading, 8.

use super::Hidden;
use plant::parameters::VALVE_POINTS;
use serde_json::{Value, json};

/// The model errors of one rig; no report is expected to name any of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Background {
    /// Effects below the smallest amplitudes of their sheets.
    pub effects: Vec<Hidden>,
    /// Factors on K_V of supply and exhaust edge at each opening of the table.
    pub valve_point_factors: [[f64; VALVE_POINTS]; 2],
    /// Factor on the dead volume of each chamber.
    pub dead_volume_ratio: f64,
    /// T / T_0 of all air.
    pub temperature_ratio: f64,
    /// Share by which the sliding friction is reduced near rest.
    pub fading_ratio: f64,
    /// Speed over which the full friction returns, m/s.
    pub fading_below_m_per_s: f64,
    /// Share of the noise's variance with a correlation of [`SLOW_NOISE_SAMPLES`].
    pub slow_noise_ratio: f64,
}

impl Background {
    /// JSON of `truth.json` and `draws.json`, with the effects as the caller formats them.
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
