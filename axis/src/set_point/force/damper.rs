//! Damper load: opposes the velocity in proportion.
//!
//! ```text
//!   F = F_base + d v                   dF/dt = d a
//! ```
//!
//! d: damping_n_s_per_m. F_base: base_force_n. v, a: actual velocity and acceleration, rig coordinates. Going in +x it presses
//! harder, going in -x less: either way against the motion.

use super::{Kind, Load};
use crate::set_point::Actual;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "damper",
    about: "opposes the velocity in proportion",
    read: |reader| Ok(Arc::new(Damper { damping_n_s_per_m: reader.number(&DAMPING)? })),
};

static DAMPING: Parameter =
    Parameter::new(("damping_n_s_per_m", "N s/m"), [0.0, 10_000.0], 500.0, "force for each velocity");

#[derive(Debug)]
struct Damper {
    damping_n_s_per_m: f64,
}

impl Load for Damper {
    fn at(&self, actual: &Actual) -> [f64; 2] {
        let damping = self.damping_n_s_per_m;
        [damping * actual.velocity_m_per_s, damping * actual.acceleration_m_per_s2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_takes_energy_from_either_direction() {
        let damper = Damper { damping_n_s_per_m: 400.0 };
        for velocity_m_per_s in [-0.5, 0.5] {
            let [force, rate] = damper.at(&Actual { velocity_m_per_s, ..Actual::default() });
            // The force acts in -x: its power on the carriage is -F v.
            assert_eq!((force * velocity_m_per_s, rate), (100.0, 0.0));
        }
    }
}
