//! Dry friction load: a force of one size against the motion, whichever its speed.
//!
//! ```text
//!   F = F_base + F_c tanh(v / v_s)     dF/dt = F_c (1 - tanh^2(v / v_s)) a / v_s
//! ```
//!
//! F_c: force_n. v_s: velocity_scale_m_per_s, around which the sign is smoothed: 76 % of the force at v_s, 96 % at 2 v_s,
//! nothing at standstill, where the axis therefore creeps instead of sticking. F_base: base_force_n. v, a: actual values, rig
//! coordinates.

use super::{Kind, Load};
use crate::set_point::Actual;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "dry-friction",
    about: "a force of one size against the motion",
    read: |reader| {
        let force_n = reader.value("force", "size of the friction")?;
        let velocity_scale_m_per_s = reader.section.number_or_default(&VELOCITY_SCALE)?;
        Ok(Arc::new(DryFriction { force_n, velocity_scale_m_per_s }))
    },
};

static VELOCITY_SCALE: Parameter = Parameter::new(
    ("velocity_scale_m_per_s", "m/s"),
    [0.0001, 1.0],
    0.01,
    "speed around which the sign is smoothed",
);

#[derive(Debug)]
struct DryFriction {
    force_n: f64,
    velocity_scale_m_per_s: f64,
}

impl Load for DryFriction {
    fn at(&self, actual: &Actual) -> [f64; 2] {
        let Self { force_n, velocity_scale_m_per_s } = *self;
        let share = libm::tanh(actual.velocity_m_per_s / velocity_scale_m_per_s);
        let slope = (1.0 - share * share) / velocity_scale_m_per_s;
        [force_n * share, force_n * slope * actual.acceleration_m_per_s2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(velocity_m_per_s: f64) -> f64 {
        let friction = DryFriction { force_n: 50.0, velocity_scale_m_per_s: 0.01 };
        friction.at(&Actual { velocity_m_per_s, ..Actual::default() })[0]
    }

    #[test]
    fn it_opposes_the_motion_with_one_size() {
        // tanh(10) and beyond is 1 to 5e-9.
        assert!((at(0.1) - 50.0).abs() < 1e-6 && (at(1.0) - 50.0).abs() < 1e-6);
        assert_eq!((at(-0.1), at(0.0)), (-at(0.1), 0.0));
    }

    #[test]
    fn the_rate_is_the_slope_over_the_velocity() {
        let friction = DryFriction { force_n: 50.0, velocity_scale_m_per_s: 0.01 };
        let actual = Actual { velocity_m_per_s: 0.004, acceleration_m_per_s2: 2.0, ..Actual::default() };
        let slope = (at(0.004 + 1e-8) - at(0.004 - 1e-8)) / 2e-8;
        // Central difference: third derivative 1e8 times 1e-16, and roundings of 1e-14 over 2e-8.
        assert!((friction.at(&actual)[1] - 2.0 * slope).abs() < 1e-4);
    }
}
