//! Rest zone: when friction shall hold a rod that has arrived, and the position algorithms leave it alone.
//!
//! ```text
//!              set-point rests, |e| < zone, |v| < v_0
//!      moving ───────────────────────────────────────► resting
//!             ◄───────────────────────────────────────
//!              set-point moves, or |e| > 2 zone
//! ```
//!
//! Below the break-away force a rod stays where it is while a valve, barely open, builds up pressure; then it breaks away, slides past
//! the set-point, and the same begins on the other side. A shut valve ends that: the air is trapped and friction holds.
//! The rod must stand first: shut in at a speed v, its air lets it slide on by v b / c, 0.2 mm for each mm/s in the middle of the stroke.
//! e: error, m; v: filtered velocity, m/s; b, c: viscous friction and stiffness of the air.

use crate::algorithm::Ready;

/// A rod that leaves no band of this half-width, m, over [`STANDING_S`] stands: slower than 2 mm/s. Five times the sensor's noise.
const STANDING_M: f64 = 1e-4;
const STANDING_S: f64 = 0.05;
/// How much wider than the zone an error must be to leave it.
const LEAVING: f64 = 2.0;

/// Whether the rod rests.
#[derive(Clone, Copy, Debug, Default)]
pub struct RestZone {
    resting: bool,
    band_m: f64,
    stood_s: f64,
}

impl RestZone {
    /// Whether the rod is to be left alone now; a zone of 0 never does.
    pub fn rests(&mut self, ready: &Ready, zone_m: f64) -> bool {
        if (ready.position_m - self.band_m).abs() > STANDING_M {
            (self.band_m, self.stood_s) = (ready.position_m, 0.0);
        }
        self.stood_s += ready.period_s;
        let set_point_rests = ready.set_velocity_m_per_s == 0.0 && ready.set_acceleration_m_per_s2 == 0.0;
        let error_m = (ready.set_position_m - ready.position_m).abs();
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

    fn at(position_m: f64, velocity_m_per_s: f64) -> Ready {
        Ready { position_m, velocity_m_per_s, ..Ready::default() }
    }

    #[test]
    fn it_is_entered_standing_within_the_zone_and_left_at_twice_of_it() {
        let mut zone = RestZone::default();
        for (ready, rests) in [
            (at(1.5e-4, 0.0), false),
            (at(0.5e-4, 0.01), false),
            (at(0.5e-4, 0.001), true),
            (at(1.5e-4, 0.01), true),
            (at(2.5e-4, 0.0), false),
            (at(1.5e-4, 0.0), false),
        ] {
            assert_eq!(zone.rests(&ready, 1e-4), rests, "{ready:?}");
        }
    }

    #[test]
    fn a_moving_set_point_ends_it_at_once() {
        let mut zone = RestZone::default();
        assert!(zone.rests(&at(0.0, 0.0), 1e-4));
        assert!(!zone.rests(&Ready { set_acceleration_m_per_s2: 1e-3, ..at(0.0, 0.0) }, 1e-4));
        assert!(!zone.rests(&Ready { set_velocity_m_per_s: 1e-6, ..at(0.0, 0.0) }, 1e-4));
    }

    #[test]
    fn a_zone_of_nothing_never_rests() {
        assert!(!RestZone::default().rests(&at(0.0, 0.0), 0.0));
    }
}
