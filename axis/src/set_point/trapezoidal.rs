//! Trapezoidal velocity: constant acceleration, constant velocity, constant deceleration. The time follows from the way.
//!
//! ```text
//!   v ^     ________          t_a = v / a          until v is reached
//!     |    /        \         T   = t_a + d / v    when d >= v^2 / a
//!     |   /          \        a shorter way is a triangle: v = sqrt(d a), T = 2 t_a
//!     +--/------------\--> t
//! ```
//!
//! d: way, m. v: velocity_m_per_s. a: acceleration_m_per_s2. Acceleration jumps at the four corners.

use super::law::{Extent, Kind, Law, ProfilePoint};
use algorithms::algorithm::Quantity;
use settings::parameters::Parameter;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    name: "trapezoidal",
    about: "trapezoidal velocity to a place; the time follows from the way",
    serves: &[Quantity::Position],
    read: |reader| {
        let to = reader.value("to", "where it ends")?;
        let (velocity, acceleration) = (reader.number(&VELOCITY)?, reader.number(&ACCELERATION)?);
        Ok(Arc::new(Trapezoidal::new([reader.from, to], velocity, acceleration)))
    },
};

static VELOCITY: Parameter =
    Parameter::new(("velocity_m_per_s", "m/s"), [0.001, 5.0], 0.2, "largest velocity");
static ACCELERATION: Parameter =
    Parameter::new(("acceleration_m_per_s2", "m/s^2"), [0.01, 100.0], 1.0, "acceleration and deceleration");

#[derive(Debug)]
struct Trapezoidal {
    from: f64,
    to: f64,
    /// With the sign of the way.
    acceleration: f64,
    /// Time of the acceleration, and of the deceleration, s.
    ramp_s: f64,
    duration_s: f64,
}

impl Trapezoidal {
    fn new([from, to]: [f64; 2], velocity: f64, acceleration: f64) -> Self {
        let way = (to - from).abs();
        let reached = velocity.min((way * acceleration).sqrt());
        let ramp_s = reached / acceleration;
        let duration_s = if reached > 0.0 { ramp_s + way / reached } else { 0.0 };
        Self { from, to, acceleration: acceleration.copysign(to - from), ramp_s, duration_s }
    }
}

impl Law for Trapezoidal {
    fn at(&self, time_s: f64) -> ProfilePoint {
        let Self { from, to, acceleration, ramp_s, duration_s } = *self;
        let left_s = duration_s - time_s;
        let point = |value, rate, acceleration| ProfilePoint { value, rate, acceleration, moving: true };
        if time_s < ramp_s {
            let rate = acceleration * time_s;
            return point(from + 0.5 * rate * time_s, rate, acceleration);
        }
        if left_s < ramp_s {
            let rate = acceleration * left_s;
            return point(to - 0.5 * rate * left_s, rate, -acceleration);
        }
        let rate = acceleration * ramp_s;
        point(from + rate * (time_s - 0.5 * ramp_s), rate, 0.0)
    }

    fn extent(&self) -> Extent {
        Extent::between(self.from, self.to, self.duration_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_way_reaches_the_velocity_and_a_short_one_does_not() {
        let long = Trapezoidal::new([0.4, 0.1], 0.2, 1.0);
        // 0.2 s up, 0.2 s down and 0.26 m at 0.2 m/s.
        assert!((long.duration_s - 1.7).abs() < 1e-15);
        assert_eq!(long.at(0.85).rate, -0.2);
        let short = Trapezoidal::new([0.1, 0.11], 0.2, 1.0);
        assert!((short.duration_s - 0.2).abs() < 1e-15, "{}", short.duration_s);
        assert!((short.at(0.1).rate - 0.1).abs() < 1e-15);
    }

    #[test]
    fn no_way_takes_no_time() {
        assert_eq!(Trapezoidal::new([0.2, 0.2], 0.2, 1.0).duration_s, 0.0);
    }
}
