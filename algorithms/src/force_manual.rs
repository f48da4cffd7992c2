//! Force control with set-point zero, for relieving stress and for moving the axis by hand.
//!
//! ```text
//!   moving:  v = k_p (w - F) + k_f x'
//!   else:    v = k_p dz(w - F)          dz(e) = e - sat(e, d)
//!   both:    |v| <= v_max
//! ```
//!
//! w: set-point of the force, N, zero as a rule; F: force sensor of the axis, N, compression positive; x': rate of the extension,
//! m/s; k_p: gain, m/(N s); k_f: share of the rate; d: dead zone, N; v_max: limit, m/s. No state.
//!
//! At standstill neither the zero of the sensor nor the noise of x' shall set the rod in motion, hence the dead zone and no
//! feed-forward. Once the rod moves, a dead zone would be a force for the hand, and k_f x' lets the air follow the rod. A
//! rod let go in motion slides on by v b / (c (1 - k_f)), since only its spring stops it: k_f = 1 is the ideal for the hand
//! and never stops. b: viscous friction, N s/m; c: stiffness of the air, N/m. The limit is for high forces in the
//! beginning. Which case it is, and which lower limit, the force chain decides in each cycle.
//!
//! Source: [Neugebauer 2011, section 4], manual mode.

use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, Quantity};
use settings::parameters::declare;

pub(crate) const KIND: Kind = Kind {
    name: "force-manual",
    about: "force: for moving by hand and relieving stress, with the paper's distinction of standstill and motion",
    controls: Quantity::Force,
    parameters: Parameters::TABLE,
    make: |_| Box::new(ForceManual),
};

settings::parameters! {
    /// Parameters of `force-manual`.
    struct Parameters {
        gain_m_per_n_s: declare("m/(N s)", [0.0, 0.05], 0.015, "velocity for each error"),
        velocity_feed_forward: declare("", [0.0, 1.0], 0.5, "share of the rod's velocity that is fed forward while it moves"),
        dead_zone_n: declare("N", [0.0, 100.0], 5.0, "error that is let be while the rod stands"),
        moving: declare("", [0.0, 1.0], 0.0, "from 0.5 on the rod counts as moving; in [giving-way] the force chain decides it"),
        limit_m_per_s: declare("m/s", [0.0, 5.0], 1.0,
            "largest velocity either way; in [giving-way] the force chain may lower it"),
    }
}

#[derive(Debug)]
struct ForceManual;

impl ControlLaw for ForceManual {
    type Parameters = Parameters;

    fn step(&mut self, input: &AlgorithmInput, parameters: &Parameters) -> f64 {
        let error_n = input.set_force_n - input.force_n;
        let (gain, dead_n, limit) =
            (parameters.gain_m_per_n_s, parameters.dead_zone_n, parameters.limit_m_per_s);
        let wanted = if parameters.moving >= 0.5 {
            gain * error_n + parameters.velocity_feed_forward * input.velocity_m_per_s
        } else {
            gain * (error_n - error_n.clamp(-dead_n, dead_n))
        };
        wanted.clamp(-limit, limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws;

    const STANDING: Parameters = Parameters {
        gain_m_per_n_s: 0.01,
        velocity_feed_forward: 0.5,
        dead_zone_n: 5.0,
        moving: 0.0,
        limit_m_per_s: 1.0,
    };
    const MOVES: Parameters = Parameters { moving: 1.0, ..STANDING };

    fn at(force_n: f64, velocity_m_per_s: f64) -> AlgorithmInput {
        AlgorithmInput { force_n, velocity_m_per_s, ..AlgorithmInput::default() }
    }

    #[test]
    fn a_standing_rod_lets_small_forces_and_its_velocity_be() {
        assert_eq!(ForceManual.step(&at(4.9, 0.02), &STANDING), 0.0);
        assert_eq!(ForceManual.step(&at(-4.9, -0.02), &STANDING), 0.0);
        assert_eq!(ForceManual.step(&at(25.0, 0.02), &STANDING), -0.01 * 20.0);
    }

    #[test]
    fn a_moving_rod_follows_its_velocity_and_the_smallest_force() {
        assert_eq!(ForceManual.step(&at(2.0, 0.1), &MOVES), -0.01 * 2.0 + 0.05);
    }

    #[test]
    fn the_limit_holds_in_both_cases_and_both_directions() {
        for (parameters, force_n) in [(STANDING, 300.0), (MOVES, 300.0), (STANDING, -300.0), (MOVES, -300.0)]
        {
            let limited = Parameters { limit_m_per_s: 0.05, ..parameters };
            assert_eq!(ForceManual.step(&at(force_n, 0.0), &limited), -0.05 * force_n.signum());
        }
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        laws::check(&KIND);
    }
}
