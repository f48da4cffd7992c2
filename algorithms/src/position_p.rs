//! Position control as in the paper: proportional, with velocity feed-forward.
//!
//! ```text
//!   w, w' ──► v = k_v (w - x) + k_f w'
//! ```
//!
//! w: set-point, m; w': its rate, m/s; x: extension, m; k_v: gain, 1/s; k_f: share of the set-point's rate. At rest, within
//! the rest zone, 0 comes out: see [`crate::rest_zone`]. No other state.
//!
//! Source: [Neugebauer 2011, section 4].

use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, Quantity};
use crate::rest_zone::{self, RestZone};
use settings::parameters::{Declaration, declare};

pub(crate) const KIND: Kind = Kind {
    name: "position-p",
    about: "position: proportional with velocity feed-forward, the paper's",
    controls: Quantity::Position,
    parameters: Parameters::TABLE,
    make: |_| Box::new(PositionP::default()),
};

/// The gain that every position algorithm has, with its default, 1/s.
pub(super) const fn gain(default_per_s: f64) -> Declaration {
    declare("1/s", [0.0, 200.0], default_per_s, "velocity for each error")
}

/// The feed-forward that every position algorithm has.
pub(super) const VELOCITY_FEED_FORWARD: Declaration =
    declare("", [0.0, 2.0], 1.0, "share of the set-point's rate that is fed forward");

settings::parameters! {
    /// Parameters of `position-p`.
    struct Parameters {
        gain_per_s: gain(20.0),
        velocity_feed_forward: VELOCITY_FEED_FORWARD,
        rest_zone_m: rest_zone::declaration(5e-4),
    }
}

#[derive(Debug, Default)]
struct PositionP {
    rest: RestZone,
}

impl ControlLaw for PositionP {
    type Parameters = Parameters;

    fn reset(&mut self, _input: &AlgorithmInput, _: &Parameters) {
        *self = Self::default();
    }

    fn step(&mut self, input: &AlgorithmInput, parameters: &Parameters) -> f64 {
        if self.rest.rests(input, parameters.rest_zone_m) {
            return 0.0;
        }
        parameters.gain_per_s * (input.set_position_m - input.position_m)
            + parameters.velocity_feed_forward * input.set_velocity_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_and_the_rate_add_up() {
        let input = AlgorithmInput {
            set_position_m: 0.2,
            set_velocity_m_per_s: 0.1,
            position_m: 0.19,
            ..AlgorithmInput::default()
        };
        assert_eq!(
            PositionP::default()
                .step(&input, &Parameters { gain_per_s: 40.0, velocity_feed_forward: 0.5, rest_zone_m: 0.0 }),
            40.0 * (0.2 - 0.19) + 0.05
        );
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        crate::laws::check(&KIND);
    }
}
