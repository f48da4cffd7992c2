//! heat-exchange: the gas of each chamber has its own temperature and exchanges heat with the wall.
//!
//! ```text
//! c_v d(m T)/dt = c_p T_f mdot - p dV/dt + h S (T0 - T)         T_f = T0 for mdot > 0 (inflow), else T
//! times R / c_v, with p V = m R T and mdot = p_N q / (R T0):
//! d(p V)/dt = p_N q + p_N q (gamma T_f / T0 - 1) + (R / c_v) h S (T0 - T) - (R / c_v) p dV/dt
//! S = 2 A + 2 sqrt(pi A) V / A                                  T = p V / (m R)
//! ```
//!
//! q net normal flow into the chamber, leakage included, m^3/s; p_N q is the baseline's; T gas, T0 gas and wall of the
//! baseline, K; h heat transfer coefficient, W/(m^2 K), in [1, 1e5]; S wetted wall, m^2: two faces and the bore's wall of a
//! chamber with cross-section A, m^2, and volume V, m^3 (the rod's own wall is left out). R = 287, c_v = 718, c_p = 1005
//! J/(kg K), gamma = c_p / c_v, perfect gas. h is one constant: a real one grows with pressure and speed. The wall keeps T0,
//! since it holds more than a hundred times the heat of the gas. h to infinity is the baseline, h = 0 the adiabatic chamber.
//!
//! For the integrator: T relaxes with the time constant m c_v / (h S), which at 1e5 W/(m^2 K) is shorter than a step: its
//! part must be taken implicitly or as an exponential. No regularisation: T_f jumps with the sign of q, where p_N q is 0.
//!
//! Properties: at T0 with shut valve nothing is added; heat flows from warm to cold; inflow heats by gamma - 1, outflow takes
//! T with it; an adiabatic shut chamber keeps p V^gamma; relaxation has the time constant above.
//!
//! Source: Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7, energy balance of a chamber; Carneiro and de
//! Almeida 2006, Reduced-order thermodynamic models for servo-pneumatic actuator chambers, Proc. IMechE I 220; range:
//! textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        coefficient_w_per_m2_k: EffectKey {
            name: "coefficient_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            min: 1.0,
            max: 100000.0,
            drawn: [10.0, 150.0],
            neutral: Some(f64::INFINITY),
            meaning: "h, heat transfer coefficient to the wetted wall",
            ..EffectKey::USUAL
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HeatExchange {
    numbers: Numbers,
    /// T0.
    wall_k: f64,
    /// p_N.
    normal_pa: f64,
}

/// What the energy balance needs to know of a chamber.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChamberHeat {
    /// q, net normal flow into the chamber with leakage.
    pub(crate) flow_m3_per_s: f64,
    /// T.
    pub(crate) temperature_k: f64,
    /// S.
    pub(crate) wetted_m2: f64,
}

impl Effect for HeatExchange {
    const SHEET: Sheet = Sheet {
        name: "heat-exchange",
        group: Group::Chamber,
        laws: &[Law::StoredAir],
        law: "the gas of each chamber has its own temperature and exchanges heat with the wall",
        source: "energy balance, Beater 2007, Carneiro and de Almeida 2006; range: textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::LockedHold, ManualMeasurement::ConstantVolume],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        HeatExchange {
            numbers: Numbers::of(numbers),
            wall_k: rig.gas().temperature_k,
            normal_pa: rig.gas().normal_pressure_pa,
        }
    }
}

/// R, J/(kg K).
const GAS_J_PER_KG_K: f64 = 287.0;
/// c_v, J/(kg K).
const HEAT_J_PER_KG_K: f64 = 718.0;
/// gamma = c_p / c_v.
const GAMMA: f64 = 1005.0 / HEAT_J_PER_KG_K;

impl HeatExchange {
    /// What is added to d(p V)/dt of a chamber besides the work, W.
    pub(crate) fn thermal_rate_w(&self, chamber: ChamberHeat) -> f64 {
        let carried_k = if chamber.flow_m3_per_s > 0.0 { self.wall_k } else { chamber.temperature_k };
        let carried = self.normal_pa * chamber.flow_m3_per_s * (GAMMA * carried_k / self.wall_k - 1.0);
        let heat_w =
            self.numbers.coefficient_w_per_m2_k * chamber.wetted_m2 * (self.wall_k - chamber.temperature_k);
        carried + self.work_share() * heat_w
    }

    /// R / c_v, the share of the work p dV that the stored air p V loses.
    pub(crate) fn work_share(&self) -> f64 {
        GAS_J_PER_KG_K / HEAT_J_PER_KG_K
    }

    /// m c_v / (h S), with which the temperature of a chamber with the stored air p V relaxes, s.
    pub(crate) fn relaxation_s(&self, stored_j: f64, chamber: ChamberHeat) -> f64 {
        let mass_kg = stored_j / (GAS_J_PER_KG_K * chamber.temperature_k);
        mass_kg * HEAT_J_PER_KG_K / (self.numbers.coefficient_w_per_m2_k * chamber.wetted_m2)
    }
}

/// S, m^2, of a chamber with this cross-section, m^2, and volume, m^3.
pub(crate) fn wetted_m2(area_m2: f64, volume_m3: f64) -> f64 {
    2.0 * area_m2 + 2.0 * (std::f64::consts::PI / area_m2).sqrt() * volume_m3
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const T0: f64 = 293.15;
    const P_N: f64 = 101_325.0;

    fn effect(coefficient: f64) -> HeatExchange {
        HeatExchange::new(&[coefficient], &RigParameters::baseline())
    }

    fn chamber(flow_m3_per_s: f64, temperature_k: f64) -> ChamberHeat {
        ChamberHeat { flow_m3_per_s, temperature_k, wetted_m2: 0.01 }
    }

    #[test]
    fn the_gas_constants_fit_together() {
        assert_eq!(1005.0 - HEAT_J_PER_KG_K, GAS_J_PER_KG_K);
        assert!((effect(50.0).work_share() - (GAMMA - 1.0)).abs() < 1e-15);
    }

    #[test]
    fn at_wall_temperature_with_shut_valve_nothing_is_added() {
        assert_eq!(effect(100.0).thermal_rate_w(chamber(0.0, T0)), 0.0);
    }

    #[test]
    fn inflow_heats_by_the_ratio_of_heats_and_outflow_takes_the_gas_as_it_is() {
        let q = 2e-3;
        let added = effect(0.0).thermal_rate_w(chamber(q, 350.0));
        // A difference from 1 and two products.
        assert!((added - P_N * q * (GAMMA - 1.0)).abs() < 1e-12);
        let taken = effect(0.0).thermal_rate_w(chamber(-q, 260.0));
        assert!((taken + P_N * q * (GAMMA * 260.0 / T0 - 1.0)).abs() < 1e-12);
    }

    #[test]
    fn the_wetted_wall_is_that_of_a_cylinder() {
        let (radius, length) = (0.025_f64, 0.3);
        let area = std::f64::consts::PI * radius * radius;
        let wall = 2.0 * area + 2.0 * std::f64::consts::PI * radius * length;
        assert!((wetted_m2(area, area * length) - wall).abs() < 1e-16);
        assert_eq!(wetted_m2(area, 0.0), 2.0 * area);
    }

    /// Explicit midpoint steps of the stored air E = p V at a shut valve; the volume goes from one to the other in time T.
    fn shut(effect: HeatExchange, temperature_k: f64, volumes_m3: [f64; 2], time_s: f64) -> f64 {
        let mass_gas = 3.5e5 * volumes_m3[0] / temperature_k; // m R
        let (steps, speed) = (2000, (volumes_m3[1] - volumes_m3[0]) / time_s);
        let span = time_s / f64::from(steps);
        let rate = |stored: f64, volume: f64| {
            let chamber =
                ChamberHeat { wetted_m2: 0.01, flow_m3_per_s: 0.0, temperature_k: stored / mass_gas };
            effect.thermal_rate_w(chamber) - effect.work_share() * stored / volume * speed
        };
        let mut stored = 3.5e5 * volumes_m3[0];
        for step in 0..steps {
            let volume = volumes_m3[0] + speed * span * f64::from(step);
            let middle = stored + span / 2.0 * rate(stored, volume);
            stored += span * rate(middle, volume + speed * span / 2.0);
        }
        stored
    }

    #[test]
    fn an_adiabatic_shut_chamber_keeps_its_polytrope() {
        let volumes = [4e-4, 2e-4];
        let pressure = shut(effect(0.0), T0, volumes, 0.1) / volumes[1];
        let adiabatic = 3.5e5 * 2_f64.powf(GAMMA);
        // Midpoint rule: (ln 2 / 2000)^2 of the change.
        assert!((pressure / adiabatic - 1.0).abs() < 2e-7, "{pressure}");
        assert_eq!(shut(effect(0.0), T0, [4e-4, 4e-4], 0.1), 3.5e5 * 4e-4);
    }

    #[test]
    fn a_warm_shut_chamber_relaxes_with_its_time_constant() {
        let (effect, volume, warm) = (effect(100.0), 4e-4, 330.0);
        let time_s = effect.relaxation_s(3.5e5 * volume, chamber(0.0, warm));
        // m = 1.478e-3 kg times 718 J/(kg K) over 1 W/K.
        let mass_kg = 3.5e5 * volume / (GAS_J_PER_KG_K * warm);
        assert!((time_s - mass_kg * 718.0 / (100.0 * 0.01)).abs() < 1e-14);
        let temperature = shut(effect, warm, [volume, volume], time_s) / (3.5e5 * volume / warm);
        // Midpoint rule: (1 / 2000)^2 / 6 of the difference.
        assert!((temperature - (T0 + (warm - T0) * (-1.0_f64).exp())).abs() < 4e-6, "{temperature}");
    }

    proptest! {
        #[test]
        fn heat_flows_from_warm_to_cold(h in 1.0..1e5_f64, temperature in 150.0..500.0_f64) {
            let rate = effect(h).thermal_rate_w(chamber(0.0, temperature));
            prop_assert!(rate * (T0 - temperature) >= 0.0);
        }
    }
}
