//! Modified sine of VDI 2143: a quick quarter sine of acceleration at either end, a slow half sine between.
//!
//! ```text
//!   k = pi / (4 + pi)
//!   0   <= z <= 1/8:  s = k (z - sin(4 pi z) / (4 pi))                       s' = k (1 - cos(4 pi z))
//!   1/8 <= z <= 7/8:  s = k (2/pi + z - 9/(4 pi) sin((4 pi z + pi) / 3))     s' = k (1 - 3 cos((4 pi z + pi) / 3))
//!   7/8 <= z <= 1:    s = k (4/pi + z - sin(4 pi z) / (4 pi))                s' = k (1 - cos(4 pi z))
//!   s'' = 4 pi k sin((4 pi z + pi) / 3) in the middle, 4 pi k sin(4 pi z) at either end
//! ```
//!
//! z: time over duration, 0 to 1. s: way over whole way, 0 to 1. Position, speed and acceleration are continuous; the
//! largest speed is 1.76 times the mean, below the sinoid's 2.
//!
//! Source: VDI 2143 part 1 (modified sine line).

use super::law::{BOTH, Kind, ShapedTransition};
use std::f64::consts::PI;

pub(super) const KIND: Kind = Kind {
    name: "modified-sine",
    about: "modified sine to a place: slower at its fastest than the sinoid",
    serves: BOTH,
    read: |reader| ShapedTransition::read(reader, 0.01, at),
};

const K: f64 = PI / (4.0 + PI);

/// s(z), s'(z) and s''(z) for z in 0 to 1.
pub(super) fn at(z: f64) -> [f64; 3] {
    if (0.125..=0.875).contains(&z) {
        let angle = (4.0 * PI * z + PI) / 3.0;
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        let s = 2.0 / PI + z - 9.0 / (4.0 * PI) * sine;
        return [K * s, K * (1.0 - 3.0 * cosine), K * 4.0 * PI * sine];
    }
    let angle = 4.0 * PI * z;
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let passed = if z < 0.5 { 0.0 } else { 4.0 / PI };
    [K * (passed + z - sine / (4.0 * PI)), K * (1.0 - cosine), K * 4.0 * PI * sine]
}

#[cfg(test)]
mod tests {
    use super::at;

    #[test]
    fn it_starts_and_ends_at_rest() {
        assert_eq!(at(0.0), [0.0, 0.0, 0.0]);
        let [end, rest, _] = at(1.0);
        // A few roundings of numbers near 1.
        assert!((end - 1.0).abs() < 1e-15 && rest.abs() < 1e-15);
    }

    #[test]
    fn the_pieces_join_in_position_rate_and_acceleration() {
        for joint in [0.125, 0.875] {
            let (before, after) = (at(joint - 1e-12), at(joint + 1e-12));
            // Rates below 2, accelerations below 6 and jerks below 70 over 2e-12, and roundings.
            assert!((before[0] - after[0]).abs() < 1e-11 && (before[1] - after[1]).abs() < 1e-10);
            assert!((before[2] - after[2]).abs() < 1e-9);
        }
    }

    #[test]
    fn the_largest_rate_is_that_of_the_guideline() {
        assert!((at(0.5)[1] - 1.759_603_4).abs() < 1e-7);
    }
}
