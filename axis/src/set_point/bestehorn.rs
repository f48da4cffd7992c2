//! Bestehorn sinoid: s(z) = z - sin(2 pi z) / (2 pi), with s'(z) = 1 - cos(2 pi z) and s''(z) = 2 pi sin(2 pi z).
//!
//! z: time over duration, 0 to 1. s: way over whole way, 0 to 1. Acceleration is a full sine, without a step at either end;
//! the largest speed is twice the mean.
//!
//! Source: VDI 2143 part 1 (inclined sine line); [Neugebauer 2011] calls it Bestehorn sinoid.

use super::law::{BOTH, Kind, Law, ProfilePoint, ShapedTransition};
use std::f64::consts::TAU;

pub(super) const KIND: Kind = Kind {
    name: "bestehorn",
    about: "Bestehorn sinoid to a place",
    serves: BOTH,
    read: |reader| ShapedTransition::read(reader, 0.01, at),
};

/// s(z), s'(z) and s''(z) for z in 0 to 1.
pub(super) fn at(z: f64) -> [f64; 3] {
    let (sine, cosine) = (libm::sin(TAU * z), libm::cos(TAU * z));
    [z - sine / TAU, 1.0 - cosine, TAU * sine]
}

/// A transition along the sinoid that a state of a chain can hold: it is `Copy` and has no memory. In m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothTransition {
    from: f64,
    to: f64,
    duration_s: f64,
}

impl SmoothTransition {
    /// From one value to another in `duration_s`; 0 is a jump.
    pub const fn new(from: f64, to: f64, duration_s: f64) -> Self {
        Self { from, to, duration_s }
    }

    /// The set-point `time_s` after its start, in the unit of its values.
    pub fn at(&self, time_s: f64) -> ProfilePoint {
        let Self { from, to, duration_s } = *self;
        if time_s < 0.0 {
            return ProfilePoint::at_rest(from);
        }
        if time_s >= duration_s {
            return ProfilePoint::at_rest(to);
        }
        ShapedTransition { from, to, duration_s, shape: at }.at(time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_starts_and_ends_at_rest_and_is_fastest_in_the_middle() {
        assert_eq!(at(0.0), [0.0, 0.0, 0.0]);
        let [half, fastest, _] = at(0.5);
        // One rounding of the sine near pi.
        assert!((half - 0.5).abs() < 1e-15 && (fastest - 2.0).abs() < 1e-15);
        let [end, rest, force] = at(1.0);
        // The sine of the rounded 2 pi is 2.4e-16, times 2 pi.
        assert!((end - 1.0).abs() < 1e-15 && rest.abs() < 1e-15 && force.abs() < 2e-15);
    }

    #[test]
    fn a_smooth_way_rests_before_and_behind() {
        let way = SmoothTransition::new(0.1, 0.4, 3.0);
        assert_eq!(way.at(-1.0), ProfilePoint::at_rest(0.1));
        assert_eq!(way.at(3.0), ProfilePoint::at_rest(0.4));
        assert_eq!(SmoothTransition::new(0.0, 100.0, 0.0).at(0.0), ProfilePoint::at_rest(100.0));
        assert!(way.at(1.0).moving && way.at(1.0).rate > 0.0);
    }
}
