//! Linearisation of the manipulated variable: from a wanted velocity to a valve opening, by the inverse characteristic.
//!
//! Two laws. *Choked exhaust* is the paper's way and needs no pressure:
//!
//! ```text
//!   v A_out p_out = p_N Q,  Q = 12.95 K_V p_out (choked exhaust)   =>   K_V = v A_out / (12.95 p_N)
//!   opening = K_V,exhaust^-1(K_V)                                  p cancels
//! ```
//!
//! The outgoing chamber decides: its exhaust is choked while its pressure is above twice the atmosphere's, and
//! then its flow grows with its pressure just as the air in its volume does. Below choking the valve
//! passes less than assumed, which the position loop makes up for.
//!
//! *Pressure compensated* takes both chambers as they are, and asks at which opening the pneumatic force stays what it is
//! while the rod moves at v:
//!
//! ```text
//!   F'(s, v) = G(s) - c v      G(s) = p_N (A_a Q_a(s) / V_a - A_b Q_b(s) / V_b)      c = p_a A_a^2 / V_a + p_b A_b^2 / V_b
//!   v(s) = G(s) / c            opening = v^-1(v)
//! ```
//!
//! c: stiffness of the air, N/m; Q_a, Q_b: normal flows into the chambers by [Neugebauer 2011, eq. 4] with the K_V tables and
//! measured pressures, m^3/s; V: volumes at the extension, m^3. Any force rate F' wanted besides is the velocity
//! v + F'/c. v(s) grows with s and is piecewise linear in the table's points. A full chamber and an empty one pass nothing: the
//! opening is then at its limit.
//!
//! v in m/s, areas A in m^2, p_N in bar above and in Pa below, K_V in m^3/h. Around 0 the table's dead band is jumped over.
//!
//! Source: [Neugebauer 2011, eqs. 1 to 4] and its linearisation of the manipulated variable; tables of the rig file.

use crate::algorithm::AlgorithmInput;
use nominal::RigParameters;

/// Normal volume flow of a choked edge in m^3/h for each K_V (m^3/h) and upstream pressure (bar): [Neugebauer 2011, eq. 4].
const CHOKED_FLOW: f64 = 12.95;
const PASCAL_PER_BAR: f64 = 1e5;
const SECONDS_PER_HOUR: f64 = 3600.0;
const POINTS: usize = nominal::VALVE_POINTS;

/// How an opening follows from a velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// From the outgoing chamber's area alone.
    ChokedExhaust,
    /// From the pressures and volumes of both chambers.
    PressureCompensated,
}

impl Law {
    /// Both.
    pub const ALL: [Self; 2] = [Self::ChokedExhaust, Self::PressureCompensated];

    /// Name in a program file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ChokedExhaust => "choked-exhaust",
            Self::PressureCompensated => "pressure-compensated",
        }
    }
}

/// The inverse valve characteristic of one axis, from nominal numbers.
#[derive(Clone, Debug)]
pub struct Linearisation {
    law: Law,
    air: Air,
    /// K_V for each m/s, when extending (rod side empties) and when retracting (cap side empties).
    kv_per_velocity: [f64; 2],
    opening: [f64; POINTS],
    kv_supply: [f64; POINTS],
    kv_exhaust: [f64; POINTS],
    normal_pressure_pa: f64,
    exhaust_pressure_pa: f64,
}

impl Linearisation {
    /// From the rig file's areas, volumes and tables.
    #[must_use]
    pub fn new(rig: &RigParameters, law: Law) -> Self {
        let normal_pressure_pa = rig.gas().normal_pressure_pa;
        let normal_bar = normal_pressure_pa / PASCAL_PER_BAR;
        let of_area = |area_m2: f64| area_m2 * SECONDS_PER_HOUR / (CHOKED_FLOW * normal_bar);
        let cylinder = rig.cylinder();
        Self {
            law,
            air: Air::new(rig),
            kv_per_velocity: [of_area(cylinder.annulus_area_m2), of_area(cylinder.piston_area_m2)],
            opening: rig.valve().opening,
            kv_supply: rig.valve().kv_supply_m3_per_h,
            kv_exhaust: rig.valve().kv_exhaust_m3_per_h,
            normal_pressure_pa,
            exhaust_pressure_pa: rig.supply().exhaust_pressure_pa,
        }
    }

    /// The opening, -1 to 1, that moves the rod at `velocity_m_per_s`; at its limit beyond what the valve can.
    #[must_use]
    pub fn opening(&self, velocity_m_per_s: f64, input: &AlgorithmInput) -> f64 {
        if velocity_m_per_s == 0.0 {
            return 0.0;
        }
        let speeds = self.speeds(velocity_m_per_s < 0.0, input);
        interpolate(&speeds, &self.opening, velocity_m_per_s.abs()).copysign(velocity_m_per_s)
    }

    /// The velocity, m/s, that an opening stands for: the inverse of [`Self::opening`], 0 within the dead band.
    #[must_use]
    pub fn velocity(&self, opening: f64, input: &AlgorithmInput) -> f64 {
        let speeds = self.speeds(opening < 0.0, input);
        interpolate(&self.opening, &speeds, opening.abs()).copysign(opening)
    }

    /// Speed at each point of the table, m/s, never falling.
    fn speeds(&self, retracting: bool, input: &AlgorithmInput) -> [f64; POINTS] {
        match self.law {
            Law::ChokedExhaust => {
                self.kv_exhaust.map(|kv| kv / self.kv_per_velocity[usize::from(retracting)])
            }
            Law::PressureCompensated => {
                let now = self.air.at(input);
                let [filling, emptying] = if retracting { [now.b, now.a] } else { [now.a, now.b] };
                // Flow for each K_V, by how much force it makes in a chamber of this volume.
                let force = |chamber: Chamber, upstream, downstream| {
                    self.normal_pressure_pa * chamber.area_m2 / chamber.volume_m3
                        * root_flow(upstream, downstream)
                };
                let fill = force(filling, input.supply_pressure_pa, filling.pressure_pa);
                let empty = force(emptying, emptying.pressure_pa, self.exhaust_pressure_pa);
                let stiffness = now.stiffness_n_per_m();
                std::array::from_fn(|i| (fill * self.kv_supply[i] + empty * self.kv_exhaust[i]) / stiffness)
            }
        }
    }
}

/// Normal flow for each K_V of 1 m^3/h, m^3/s; 0 against the pressure. Pressures absolute, Pa [Neugebauer 2011, eq. 4].
fn root_flow(upstream_pa: f64, downstream_pa: f64) -> f64 {
    let throat_pa = downstream_pa.max(upstream_pa / 2.0);
    2.0 * CHOKED_FLOW / PASCAL_PER_BAR / SECONDS_PER_HOUR
        * ((upstream_pa - throat_pa).max(0.0) * throat_pa).sqrt()
}

/// `to` at the place that `value` has in `from`; both never fall. In a level part of `from`: its upper end.
fn interpolate(from: &[f64; POINTS], to: &[f64; POINTS], value: f64) -> f64 {
    for point in 1..POINTS {
        let (low, high) = (from[point - 1], from[point]);
        if value < high {
            let share = ((value - low) / (high - low)).max(0.0);
            return to[point - 1] + share * (to[point] - to[point - 1]);
        }
    }
    to[POINTS - 1]
}

/// The cylinder's chambers, from nominal numbers.
#[derive(Clone, Debug)]
pub struct Air {
    area_m2: [f64; 2],
    dead_volume_m3: f64,
    stroke_m: f64,
    atmospheric_pressure_pa: f64,
}

/// One chamber at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Chamber {
    /// Piston area, m^2.
    pub area_m2: f64,
    /// Volume with its dead part, m^3.
    pub volume_m3: f64,
    /// Absolute pressure, Pa.
    pub pressure_pa: f64,
}

/// Both chambers at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Chambers {
    /// Cap side.
    pub a: Chamber,
    /// Rod side.
    pub b: Chamber,
    rod_force_n: f64,
}

impl Air {
    /// Of the rig file's cylinder.
    #[must_use]
    pub fn new(rig: &RigParameters) -> Self {
        let cylinder = rig.cylinder();
        Self {
            area_m2: [cylinder.piston_area_m2, cylinder.annulus_area_m2],
            dead_volume_m3: cylinder.dead_volume_m3,
            stroke_m: cylinder.stroke_m,
            atmospheric_pressure_pa: rig.supply().atmospheric_pressure_pa,
        }
    }

    /// The chambers at measured extension and pressures; a pressure below a tenth of the atmosphere's is none that air has.
    #[must_use]
    pub fn at(&self, input: &AlgorithmInput) -> Chambers {
        let extension_m = input.position_m.clamp(0.0, self.stroke_m);
        let chamber = |i: usize, way_m: f64, pressure_pa: f64| Chamber {
            area_m2: self.area_m2[i],
            volume_m3: self.dead_volume_m3 + self.area_m2[i] * way_m,
            pressure_pa: pressure_pa.max(self.atmospheric_pressure_pa / 10.0),
        };
        Chambers {
            a: chamber(0, extension_m, input.pressure_a_pa),
            b: chamber(1, self.stroke_m - extension_m, input.pressure_b_pa),
            rod_force_n: self.atmospheric_pressure_pa * (self.area_m2[0] - self.area_m2[1]),
        }
    }
}

impl Chambers {
    /// Pneumatic force, N, positive outwards: p_a A_a - p_b A_b - p_atm (A_a - A_b).
    #[must_use]
    pub fn force_n(&self) -> f64 {
        self.a.pressure_pa * self.a.area_m2 - self.b.pressure_pa * self.b.area_m2 - self.rod_force_n
    }

    /// Stiffness of the shut-in air, N/m: p_a A_a^2 / V_a + p_b A_b^2 / V_b.
    #[must_use]
    pub fn stiffness_n_per_m(&self) -> f64 {
        let of = |chamber: &Chamber| chamber.pressure_pa * chamber.area_m2.powi(2) / chamber.volume_m3;
        of(&self.a) + of(&self.b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::at_rest;
    use proptest::prelude::*;

    #[test]
    fn full_opening_is_the_choked_exhausts_velocity() {
        let linearisation = Linearisation::new(&RigParameters::baseline(), Law::ChokedExhaust);
        let opening = |velocity| linearisation.opening(velocity, &AlgorithmInput::default());
        // 12.95 * 0.58 m^3/h per bar * 1.01325 bar / 3600 / 1649.3 mm^2, computed apart.
        let largest = 12.95 * 0.58 * 1.013_25 / 3600.0 / 1.6493e-3;
        // The last step of the table rises by 0.2 of opening over 0.06 m^3/h: 1e-6 of speed is 5e-6 of opening.
        assert!((opening((1.0 - 1e-6) * largest) - 1.0).abs() < 1e-5);
        assert_eq!(opening(2.0 * largest), 1.0);
        assert_eq!(opening(-2.0 * largest), -1.0);
        assert_eq!(opening(0.0), 0.0);
    }

    #[test]
    fn the_smallest_velocity_jumps_over_the_dead_band() {
        for law in Law::ALL {
            let linearisation = Linearisation::new(&RigParameters::baseline(), law);
            assert!((linearisation.opening(1e-9, &at_rest()) - 0.03).abs() < 1e-6, "{law:?}");
            assert!((linearisation.opening(-1e-9, &at_rest()) + 0.03).abs() < 1e-6, "{law:?}");
        }
    }

    proptest! {
        #[test]
        fn the_opening_grows_with_the_velocity_and_stays_within_the_valve(
            slow in -3.0..3.0_f64, more in 0.0..1.0_f64, position_m in -0.01..0.51_f64,
            pressure_a_pa in 0.0..1e6_f64, pressure_b_pa in 0.0..1e6_f64, supply_pressure_pa in 0.0..1e6_f64,
        ) {
            let rest = AlgorithmInput::default();
            let input = AlgorithmInput { position_m, pressure_a_pa, pressure_b_pa, supply_pressure_pa, ..rest };
            for law in Law::ALL {
                let linearisation = Linearisation::new(&RigParameters::baseline(), law);
                let (low, high) = (linearisation.opening(slow, &input), linearisation.opening(slow + more, &input));
                prop_assert!(low <= high && low >= -1.0 && high <= 1.0, "{low} {high}");
            }
        }

        #[test]
        fn the_velocity_of_an_opening_is_its_inverse(velocity in -0.5..0.5_f64) {
            for law in Law::ALL {
                let linearisation = Linearisation::new(&RigParameters::baseline(), law);
                let back = linearisation.velocity(linearisation.opening(velocity, &at_rest()), &at_rest());
                // Beyond the largest velocity the opening is at its limit, and so is what comes back.
                let largest = linearisation.velocity(1.0_f64.copysign(velocity), &at_rest()).abs();
                prop_assert!((back - velocity.clamp(-largest, largest)).abs() < 1e-12, "{law:?} {back}");
            }
        }
    }
}
