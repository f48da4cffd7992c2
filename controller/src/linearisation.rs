//! Linearisation of the manipulated variable: from a wanted velocity to a valve opening, by the inverse characteristic.
//!
//! ```text
//!   v A_out p_out = p_N Q,  Q = 12.95 K_V p_out (choked exhaust)   =>   K_V = v A_out / (12.95 p_N)
//!   opening = K_V,exhaust^-1(K_V)                                  p cancels: no pressure is needed
//! ```
//!
//! The outgoing chamber decides: its exhaust is choked while its pressure is above twice the atmosphere's, and
//! then its flow grows with its pressure just as the air in its volume does. v in m/s, A_out in m^2 the area whose chamber
//! empties, p_N in bar, K_V in m^3/h, so 12.95 K_V p is in m^3/h and is divided by 3600. Below choking the valve
//! passes less than assumed, which the position loop makes up for. Around 0 the table's dead band is jumped over.
//!
//! Source: [Neugebauer 2011, eqs. 1 to 4] and its linearisation of the manipulated variable; tables of the rig file.

use plant::RigParameters;

/// Normal volume flow of a choked edge in m^3/h for each K_V (m^3/h) and upstream pressure (bar): [Neugebauer 2011, eq. 4].
const CHOKED_FLOW: f64 = 12.95;
const PASCAL_PER_BAR: f64 = 1e5;
const SECONDS_PER_HOUR: f64 = 3600.0;

/// The inverse valve characteristic of one axis, from nominal numbers.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// K_V for each m/s, when extending (rod side empties) and when retracting (cap side empties).
    kv_per_velocity: [f64; 2],
    opening: [f64; POINTS],
    kv: [f64; POINTS],
}

const POINTS: usize = plant::parameters::VALVE_POINTS;

impl Linearisation {
    /// From the rig file's areas and exhaust table.
    #[must_use]
    pub fn new(rig: &RigParameters) -> Self {
        let normal_bar = rig.gas().normal_pressure_pa / PASCAL_PER_BAR;
        let of_area = |area_m2: f64| area_m2 * SECONDS_PER_HOUR / (CHOKED_FLOW * normal_bar);
        let cylinder = rig.cylinder();
        Self {
            kv_per_velocity: [of_area(cylinder.annulus_area_m2), of_area(cylinder.piston_area_m2)],
            opening: rig.valve().opening,
            kv: rig.valve().kv_exhaust_m3_per_h,
        }
    }

    /// The opening, -1 to 1, that moves the unloaded rod at `velocity_m_per_s`; at its limit beyond what the valve can.
    #[must_use]
    pub fn opening(&self, velocity_m_per_s: f64) -> f64 {
        let retracting = usize::from(velocity_m_per_s < 0.0);
        let wanted = velocity_m_per_s.abs() * self.kv_per_velocity[retracting];
        let magnitude = self.inverse(wanted);
        if velocity_m_per_s == 0.0 { 0.0 } else { magnitude.copysign(velocity_m_per_s) }
    }

    /// The velocity, m/s, that an opening stands for: the inverse of [`Linearisation::opening`], 0 within the dead band.
    #[must_use]
    pub fn velocity(&self, opening: f64) -> f64 {
        let retracting = usize::from(opening < 0.0);
        let magnitude = opening.abs();
        let point = (1..POINTS).find(|point| magnitude <= self.opening[*point]).unwrap_or(POINTS - 1);
        let (low, high) = (self.opening[point - 1], self.opening[point]);
        let share = ((magnitude - low) / (high - low)).min(1.0);
        let kv = self.kv[point - 1] + share * (self.kv[point] - self.kv[point - 1]);
        (kv / self.kv_per_velocity[retracting]).copysign(opening)
    }

    fn inverse(&self, kv: f64) -> f64 {
        for point in 1..POINTS {
            let (low, high) = (self.kv[point - 1], self.kv[point]);
            if kv < high {
                let share = ((kv - low) / (high - low)).max(0.0);
                return self.opening[point - 1] + share * (self.opening[point] - self.opening[point - 1]);
            }
        }
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn full_opening_is_the_choked_exhausts_velocity() {
        let linearisation = Linearisation::new(&RigParameters::baseline());
        // 12.95 * 0.58 m^3/h per bar * 1.01325 bar / 3600 / 1649.3 mm^2, computed apart.
        let largest = 12.95 * 0.58 * 1.013_25 / 3600.0 / 1.6493e-3;
        // The last step of the table rises by 0.2 of opening over 0.06 m^3/h: 1e-6 of speed is 5e-6 of opening.
        assert!((linearisation.opening((1.0 - 1e-6) * largest) - 1.0).abs() < 1e-5);
        assert_eq!(linearisation.opening(2.0 * largest), 1.0);
        assert_eq!(linearisation.opening(-2.0 * largest), -1.0);
        assert_eq!(linearisation.opening(0.0), 0.0);
    }

    #[test]
    fn the_smallest_velocity_jumps_over_the_dead_band() {
        let linearisation = Linearisation::new(&RigParameters::baseline());
        assert!((linearisation.opening(1e-9) - 0.03).abs() < 1e-6);
        assert!((linearisation.opening(-1e-9) + 0.03).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn velocity_is_the_inverse_of_the_opening(velocity in -0.6..0.6_f64) {
            let linearisation = Linearisation::new(&RigParameters::baseline());
            let there_and_back = linearisation.velocity(linearisation.opening(velocity));
            prop_assert!((there_and_back - velocity).abs() < 1e-12, "{there_and_back}");
        }

        #[test]
        fn the_opening_grows_with_the_velocity_and_stays_within_the_valve(
            slow in -3.0..3.0_f64, more in 0.0..1.0_f64,
        ) {
            let linearisation = Linearisation::new(&RigParameters::baseline());
            let (low, high) = (linearisation.opening(slow), linearisation.opening(slow + more));
            prop_assert!(low <= high && low >= -1.0 && high <= 1.0);
        }
    }
}
