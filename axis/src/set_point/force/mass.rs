//! Mass load: opposes the acceleration, as if so much more hung at the carriage.
//!
//! ```text
//!   F = F_base + m a                   dF/dt taken as 0: the rate of the acceleration is not measured
//! ```
//!
//! m: mass_kg. F_base: base_force_n. a: actual acceleration, rig coordinates. The acceleration is the second difference of a
//! position and filtered: masses far above the moved ones make the loop swing.

use super::{Kind, Load};
use crate::set_point::Actual;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "mass",
    about: "opposes the acceleration in proportion",
    read: |reader| Ok(Arc::new(Mass { mass_kg: reader.number(&MASS)? })),
};

static MASS: Parameter = Parameter::new(("mass_kg", "kg"), [0.0, 200.0], 10.0, "force for each acceleration");

#[derive(Debug)]
struct Mass {
    mass_kg: f64,
}

impl Load for Mass {
    fn at(&self, actual: &Actual) -> [f64; 2] {
        [self.mass_kg * actual.acceleration_m_per_s2, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_opposes_the_acceleration_and_not_the_velocity() {
        let mass = Mass { mass_kg: 10.0 };
        let fast = Actual { velocity_m_per_s: 1.0, ..Actual::default() };
        assert_eq!(mass.at(&fast), [0.0, 0.0]);
        assert_eq!(mass.at(&Actual { acceleration_m_per_s2: 3.0, ..fast }), [30.0, 0.0]);
        assert_eq!(mass.at(&Actual { acceleration_m_per_s2: -3.0, ..fast }), [-30.0, 0.0]);
    }
}
