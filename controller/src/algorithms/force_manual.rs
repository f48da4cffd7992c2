//! Force control with set-point zero, for relieving stress and for moving the axis by hand.
//!
//! ```text
//!   moving:  v = k_p (w - F) + k_f x'
//!   else:    v = k_p dz(w - F)          dz(e) = e - sat(e, d)
//!   both:    |v| <= v_max
//! ```
//!
//! w: set-point of the force, N, zero as a rule; F: own force sensor, N, compression positive; x': rate of the own extension,
//! m/s; k_p: gain, m/(N s); k_f: share of the rate; d: dead zone, N; v_max: limit, m/s. No state.
//!
//! At standstill the sensor's zero and the friction shall not set the rod in motion, hence the dead zone, and the noise of x' neither. Once it
//! moves, a dead zone would be a force for the hand, and k_f x' makes the air follow the rod. k_f stays below 1: with 1 a rod
//! let go would go on by itself, its friction overcome by what the hand had asked for. The limit is for high forces in the beginning.
//! Which case it is, and which limit, the force chain decides and sets in each cycle.
//!
//! Source: [Neugebauer 2011, section 4], manual mode.

use super::force_p::bounded;
use crate::algorithm::{Algorithm, Kind, Quantity, Ready};
use crate::parameters::Parameter;

/// In the list of algorithms.
pub const KIND: Kind = Kind {
    name: "force-manual",
    about: "force: for moving by hand and relieving stress, with the paper's distinction of standstill and motion",
    controls: Quantity::Force,
    parameters: &PARAMETERS,
    make: |_| Box::new(ForceManual),
};

const GAIN: usize = 0;
const FEED_FORWARD: usize = 1;
const DEAD_ZONE: usize = 2;
const MOVING: usize = 3;
const LIMIT: usize = 4;
static PARAMETERS: [Parameter; 5] = [
    Parameter::new(("gain_m_per_n_s", "m/(N s)"), [0.0, 0.05], 0.01, "velocity for each error"),
    Parameter::new(
        ("velocity_feed_forward", ""),
        [0.0, 1.0],
        0.8,
        "share of the own rod's velocity that is fed forward while it moves",
    ),
    Parameter::new(
        ("dead_zone_n", "N"),
        [0.0, 100.0],
        5.0,
        "error that is let be while the rod stands",
    ),
    Parameter::new(
        ("moving", ""),
        [0.0, 1.0],
        0.0,
        "from 0.5 on the rod counts as moving; set by the force chain",
    ),
    Parameter::new(
        ("limit_m_per_s", "m/s"),
        [0.0, 10.0],
        1.0,
        "largest velocity either way; set by the force chain",
    ),
];

/// The algorithm.
#[derive(Debug)]
pub struct ForceManual;

impl Algorithm for ForceManual {
    fn reset(&mut self, _ready: &Ready, _parameters: &[f64]) {}

    fn step(&mut self, ready: &Ready, parameters: &[f64]) -> f64 {
        let error_n = ready.set_force_n - ready.force_n;
        let (gain, dead_n, limit) = (parameters[GAIN], parameters[DEAD_ZONE], parameters[LIMIT]);
        let wanted = if parameters[MOVING] >= 0.5 {
            gain * error_n + parameters[FEED_FORWARD] * ready.velocity_m_per_s
        } else {
            gain * (error_n - error_n.clamp(-dead_n, dead_n))
        };
        bounded(wanted).clamp(-limit, limit)
    }
}
