//! Bestehorn sinoid: s(z) = z - sin(2 pi z) / (2 pi), with s'(z) = 1 - cos(2 pi z).
//!
//! z: time over duration, 0 to 1. s: way over whole way, 0 to 1. Acceleration is a full sine, without a step at either end;
//! the largest speed is twice the mean.
//!
//! Source: VDI 2143 part 1 (inclined sine line); [Neugebauer 2011] calls it Bestehorn sinoid.

use std::f64::consts::TAU;

/// s(z) and s'(z) for z in 0 to 1.
pub(super) fn at(z: f64) -> (f64, f64) {
    (z - libm::sin(TAU * z) / TAU, 1.0 - libm::cos(TAU * z))
}

#[cfg(test)]
mod tests {
    use super::at;

    #[test]
    fn it_starts_and_ends_at_rest_and_is_fastest_in_the_middle() {
        assert_eq!(at(0.0), (0.0, 0.0));
        let (half, fastest) = at(0.5);
        // One rounding of the sine near pi.
        assert!((half - 0.5).abs() < 1e-15 && (fastest - 2.0).abs() < 1e-15);
        let (end, rest) = at(1.0);
        assert!((end - 1.0).abs() < 1e-15 && rest.abs() < 1e-15);
    }
}
