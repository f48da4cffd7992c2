//! Force control as in the paper: proportional, with the rod's velocity as a disturbance fed forward.
//!
//! ```text
//!   w ──► v = k_p (w - F) + k_f x'
//! ```
//!
//! w: set-point of the force, N; F: force sensor of the axis, N, compression positive; x': rate of the extension, m/s; k_p: gain,
//! m/(N s); k_f: share of the rate. No state. At a blocked rod the air integrates v to force, so P alone leaves no lasting
//! error; the motion that the other axis forces on the rod would, and x' moves the air along with the rod.
//!
//! Source: [Neugebauer 2011, section 4].

use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, LARGEST_M_PER_S, Quantity};
use settings::parameters::declare;

pub(crate) const KIND: Kind = Kind {
    name: "force-p",
    about: "force: proportional with the rod's velocity fed forward, the paper's",
    controls: Quantity::Force,
    parameters: Parameters::TABLE,
    make: |_| Box::new(ForceP),
};

settings::parameters! {
    /// Parameters of `force-p`.
    struct Parameters {
        gain_m_per_n_s: declare("m/(N s)", [0.0, 0.05], 0.012, "velocity for each error"),
        velocity_feed_forward: declare("", [0.0, 2.0], 0.8, "share of the rod's velocity that is fed forward"),
    }
}

#[derive(Debug)]
struct ForceP;

impl ControlLaw for ForceP {
    type Parameters = Parameters;

    fn step(&mut self, input: &AlgorithmInput, parameters: &Parameters) -> f64 {
        let velocity = parameters.gain_m_per_n_s * (input.set_force_n - input.force_n)
            + parameters.velocity_feed_forward * input.velocity_m_per_s;
        velocity.clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws;

    #[test]
    fn the_error_and_the_velocity_add_up() {
        let input = AlgorithmInput {
            set_force_n: 300.0,
            force_n: 280.0,
            velocity_m_per_s: -0.2,
            ..AlgorithmInput::default()
        };
        assert_eq!(
            ForceP.step(&input, &Parameters { gain_m_per_n_s: 0.01, velocity_feed_forward: 0.5 }),
            0.01 * 20.0 - 0.1
        );
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        laws::check(&KIND);
    }
}
