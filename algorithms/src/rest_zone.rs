//! Rest zone: when friction shall hold a rod that has arrived, and the position algorithms leave it alone.
//!
//! ```text
//!               set-point rests, |e| < zone, stands
//!      moving ──────────────────────────────────────► resting
//!             ◄──────────────────────────────────────
//!               set-point moves, or |e| > 2 zone
//! ```
//!
//! Below the break-away force a rod stays where it is while a valve, barely open, builds up pressure; then it breaks away,
//! slides past the set-point, and the same begins on the other side. A shut valve ends that: the air is trapped and
//! friction holds. The rod must stand first: shut in at a speed v, its air lets it slide on by v b / c, 0.2 mm for each
//! mm/s in the middle of the stroke. e: error, m; b, c: viscous friction and stiffness of the air.

use crate::algorithm::AlgorithmInput;
use settings::parameters::{Declaration, declare};

/// A rod that leaves no band of this half-width, m, over [`STANDING_S`] stands: slower than 2 mm/s. Five times the
/// sensor's noise.
const STANDING_M: f64 = 1e-4;
const STANDING_S: f64 = 0.05;
/// How much wider than the zone an error must be to leave it.
const LEAVING: f64 = 2.0;

/// The zone as a parameter of an algorithm, with its default, m.
#[must_use]
pub const fn declaration(default_m: f64) -> Declaration {
    declare("m", [0.0, 0.01], default_m, "error within which a standing rod is left alone")
}

/// Whether the rod rests.
#[derive(Clone, Copy, Debug, Default)]
pub struct RestZone {
    resting: bool,
    band_m: f64,
    stood_s: f64,
}

impl RestZone {
    /// Whether the rod is to be left alone now; a zone of 0 never does.
    pub fn rests(&mut self, input: &AlgorithmInput, zone_m: f64) -> bool {
        if (input.position_m - self.band_m).abs() > STANDING_M {
            (self.band_m, self.stood_s) = (input.position_m, 0.0);
        }
        self.stood_s += input.period_s;
        let set_point_rests = input.set_velocity_m_per_s == 0.0 && input.set_acceleration_m_per_s2 == 0.0;
        let error_m = (input.set_position_m - input.position_m).abs();
        self.resting = set_point_rests
            && zone_m > 0.0
            && if self.resting {
                error_m <= LEAVING * zone_m
            } else {
                error_m < zone_m && self.stood_s >= STANDING_S
            };
        self.resting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the rod rests after 60 ms at `position_m`, each millisecond moved on by `drift_m`.
    fn stays(zone: &mut RestZone, position_m: f64, drift_m: f64) -> bool {
        let at = |ms: i32| AlgorithmInput {
            period_s: 1e-3,
            position_m: position_m + drift_m * f64::from(ms),
            ..AlgorithmInput::default()
        };
        (0..60).fold(false, |_, ms| zone.rests(&at(ms), 2e-4))
    }

    #[test]
    fn it_is_entered_standing_within_the_zone_and_left_at_twice_of_it() {
        let mut zone = RestZone::default();
        // 5 mm/s through the zone: it never stays within a band of 0.2 mm for 50 ms.
        assert!(!stays(&mut zone, -1.5e-4, 5e-6));
        assert!(!stays(&mut zone, 3e-4, 0.0));
        assert!(stays(&mut zone, 1e-4, 0.0));
        assert!(stays(&mut zone, 3e-4, 0.0));
        assert!(!stays(&mut zone, 5e-4, 0.0));
        assert!(!stays(&mut zone, 3e-4, 0.0));
    }

    #[test]
    fn a_moving_set_point_ends_it_at_once() {
        let rested = || {
            let mut zone = RestZone::default();
            assert!(stays(&mut zone, 0.0, 0.0));
            zone
        };
        assert!(
            !rested().rests(
                &AlgorithmInput { set_acceleration_m_per_s2: 1e-3, ..AlgorithmInput::default() },
                2e-4
            )
        );
        assert!(
            !rested()
                .rests(&AlgorithmInput { set_velocity_m_per_s: 1e-6, ..AlgorithmInput::default() }, 2e-4)
        );
    }

    #[test]
    fn a_zone_of_nothing_never_rests() {
        let mut zone = RestZone::default();
        assert!(stays(&mut zone, 0.0, 0.0) && !zone.rests(&AlgorithmInput::default(), 0.0));
    }
}
