//! Spring load: the further the axis goes in +x, the harder it is pressed back.
//!
//! ```text
//!   F = F_base + k (x - x_0)           dF/dt = k v
//! ```
//!
//! k: stiffness_n_per_m. x_0: rest_position_m, where only the base force acts. F_base: base_force_n, the preload. x, v: actual
//! position and velocity, rig coordinates.

use super::{Kind, Load};
use crate::set_point::Actual;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "spring",
    about: "grows with the way from a position of rest",
    read: |reader| {
        let stroke_m = reader.scale.stroke_m;
        let rest = Parameter::new(
            ("rest_position_m", "m"),
            [0.0, stroke_m],
            0.0,
            "position at which only the base force acts",
        );
        let stiffness_n_per_m = reader.number(&STIFFNESS)?;
        Ok(Arc::new(Spring { stiffness_n_per_m, rest_position_m: reader.number(&rest)? }))
    },
};

static STIFFNESS: Parameter =
    Parameter::new(("stiffness_n_per_m", "N/m"), [0.0, 50_000.0], 1000.0, "force for each way");

#[derive(Debug)]
struct Spring {
    stiffness_n_per_m: f64,
    rest_position_m: f64,
}

impl Load for Spring {
    fn at(&self, actual: &Actual) -> [f64; 2] {
        let Self { stiffness_n_per_m, rest_position_m } = *self;
        [
            stiffness_n_per_m * (actual.position_m - rest_position_m),
            stiffness_n_per_m * actual.velocity_m_per_s,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_presses_harder_the_further_the_axis_has_gone() {
        let spring = Spring { stiffness_n_per_m: 1000.0, rest_position_m: 0.25 };
        let at = |position_m| spring.at(&Actual { position_m, velocity_m_per_s: 0.5, ..Actual::default() });
        assert_eq!([at(0.5), at(0.25), at(0.0)], [[250.0, 500.0], [0.0, 500.0], [-250.0, 500.0]]);
    }
}
