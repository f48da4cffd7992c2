//! Position control as in the paper: proportional, with velocity feed-forward.
//!
//! ```text
//!   w, w' ──► v = k_v (w - x) + k_f w'
//! ```
//!
//! w: set-point, m; w': its rate, m/s; x: extension, m; k_v: gain, 1/s; k_f: share of the set-point's rate. No state.
//!
//! Source: [Neugebauer 2011, section 4].

use crate::algorithm::{Algorithm, Kind, Quantity, Ready};
use crate::parameters::Parameter;

/// In the list of algorithms.
pub const KIND: Kind = Kind {
    name: "position-p",
    about: "position: proportional with velocity feed-forward, the paper's",
    controls: Quantity::Position,
    parameters: &PARAMETERS,
    make: |_| Box::new(PositionP),
};

const GAIN: usize = 0;
const FEED_FORWARD: usize = 1;
static PARAMETERS: [Parameter; 2] = [
    Parameter::new(("gain_per_s", "1/s"), [0.0, 200.0], 25.0, "velocity for each error"),
    Parameter::new(
        ("velocity_feed_forward", ""),
        [0.0, 2.0],
        1.0,
        "share of the set-point's rate that is fed forward",
    ),
];

/// The algorithm.
#[derive(Debug)]
pub struct PositionP;

impl Algorithm for PositionP {
    fn reset(&mut self, _ready: &Ready, _parameters: &[f64]) {}

    fn step(&mut self, ready: &Ready, parameters: &[f64]) -> f64 {
        parameters[GAIN] * (ready.set_position_m - ready.position_m)
            + parameters[FEED_FORWARD] * ready.set_velocity_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_and_the_rate_add_up() {
        let ready =
            Ready { set_position_m: 0.2, set_velocity_m_per_s: 0.1, position_m: 0.19, ..Ready::default() };
        assert_eq!(PositionP.step(&ready, &[40.0, 0.5]), 40.0 * (0.2 - 0.19) + 0.05);
    }
}
