//! Position control as in the paper: proportional, with velocity feed-forward.
//!
//! ```text
//!   w, w' ──► v = k_v (w - x) + k_f w' ──► linearisation ──► u
//! ```
//!
//! w: set-point, m; w': its rate, m/s; x: measured position, m; k_v: gain, 1/s; k_f: share of the set-point's rate.
//! The result is a wanted velocity, which the inverse valve characteristic turns into an opening.
//!
//! Source: [Neugebauer 2011, section 4].

use crate::set_point::SetPoint;
use serde::Serialize;

/// Parameters of the algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PositionP {
    /// Velocity for each error, 1/s; 0 to 200.
    pub gain_per_s: f64,
    /// Share of the set-point's rate that is fed forward; 0 to 2.
    pub velocity_feed_forward: f64,
}

impl PositionP {
    /// The wanted velocity in m/s.
    #[must_use]
    pub fn velocity_m_per_s(&self, set_point: &SetPoint, position_m: f64) -> f64 {
        self.gain_per_s * (set_point.position_m - position_m)
            + self.velocity_feed_forward * set_point.velocity_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_and_the_rate_add_up() {
        let algorithm = PositionP { gain_per_s: 40.0, velocity_feed_forward: 0.5 };
        let set_point = SetPoint { position_m: 0.2, velocity_m_per_s: 0.1, moving: true };
        assert_eq!(algorithm.velocity_m_per_s(&set_point, 0.19), 40.0 * (0.2 - 0.19) + 0.05);
    }
}
