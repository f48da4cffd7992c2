//! True numbers of the rig of a record: those of the rig file, some of them wrong by a few per cent.
//!
//! The controllers and the reader of the record use the numbers of the file; `parameter:` names are those of effects.md.

use super::{Background, MakeError};
use plant::RigParameters;
use plant::parameters::VALVE_POINTS;

/// From K_V in m^3/h to a conductance c in m^3/s per Pa, of Q = c sqrt((p_P - p_S) p_S) [Neugebauer 2011, eq. 4].
pub(super) const CONDUCTANCE_PER_KV: f64 = 25.9 / 1e5 / 3600.0;

/// The parameters that may be wrong, by the names of effects.md.
pub const PARAMETERS: [&str; 9] = [
    "parameter:mass",
    "parameter:viscous-friction",
    "parameter:sliding-friction",
    "parameter:break-away-force",
    "parameter:supply-pressure",
    "parameter:spool-time-constant",
    "parameter:flow-lag",
    "parameter:kv-scale",
    "parameter:piston-area",
];

/// Numbers of the true rig, SI, pressures absolute.
#[derive(Debug, Clone)]
pub(super) struct Numbers {
    pub(super) supply_pa: f64,
    pub(super) exhaust_pa: f64,
    pub(super) atmospheric_pa: f64,
    pub(super) normal_pa: f64,
    pub(super) temperature_k: f64,
    pub(super) spool_time_s: f64,
    pub(super) flow_lag_s: f64,
    pub(super) opening: [f64; VALVE_POINTS],
    /// c of the supply edge at these openings, m^3/s per Pa.
    pub(super) supply_edge_m3_per_s_pa: [f64; VALVE_POINTS],
    /// c of the exhaust edge at these openings, m^3/s per Pa.
    pub(super) exhaust_edge_m3_per_s_pa: [f64; VALVE_POINTS],
    pub(super) stroke_m: f64,
    pub(super) piston_m2: f64,
    pub(super) annulus_m2: f64,
    pub(super) dead_volume_m3: f64,
    pub(super) break_away_n: f64,
    pub(super) sliding_n: f64,
    pub(super) viscous_n_s_per_m: f64,
    /// Moving mass of drive (with weights) and load, kg.
    pub(super) mass_kg: [f64; 2],
    /// Part of it behind each force sensor, kg.
    pub(super) behind_kg: [f64; 2],
    pub(super) gap_m: f64,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_n_s_per_m: f64,
    pub(super) start_b_pa: f64,
    /// Share by which the sliding friction is reduced near rest, and the speed over which it returns, m/s.
    pub(super) fading_friction: Option<[f64; 2]>,
}

impl Numbers {
    /// The numbers of a rig file with weights on the carriage, the factors `wrong` and the background applied.
    pub(super) fn new(
        rig: &RigParameters,
        added_mass_kg: f64,
        wrong: &[(String, f64)],
        background: Option<&Background>,
    ) -> Result<Self, MakeError> {
        let (valve, mass, friction) = (rig.valve(), rig.mass(), rig.friction());
        let conductance = |kv: &[f64; VALVE_POINTS]| kv.map(|kv| kv * CONDUCTANCE_PER_KV);
        let mut numbers = Numbers {
            supply_pa: rig.supply().pressure_pa,
            exhaust_pa: rig.supply().exhaust_pressure_pa,
            atmospheric_pa: rig.supply().atmospheric_pressure_pa,
            normal_pa: rig.gas().normal_pressure_pa,
            temperature_k: rig.gas().temperature_k,
            spool_time_s: valve.spool_time_constant_s,
            flow_lag_s: valve.flow_lag_time_constant_s,
            opening: valve.opening,
            supply_edge_m3_per_s_pa: conductance(&valve.kv_supply_m3_per_h),
            exhaust_edge_m3_per_s_pa: conductance(&valve.kv_exhaust_m3_per_h),
            stroke_m: rig.cylinder().stroke_m,
            piston_m2: rig.cylinder().piston_area_m2,
            annulus_m2: rig.cylinder().annulus_area_m2,
            dead_volume_m3: rig.cylinder().dead_volume_m3,
            break_away_n: friction.break_away_force_n,
            sliding_n: friction.sliding_force_n,
            viscous_n_s_per_m: friction.viscous_n_s_per_m,
            mass_kg: [mass.drive_kg, mass.load_kg],
            behind_kg: [mass.carriage_kg, 0.0],
            gap_m: rig.linkage().gap_m,
            stiffness_n_per_m: rig.linkage().stiffness_n_per_m,
            damping_n_s_per_m: rig.linkage().damping_n_s_per_m,
            start_b_pa: rig.start().rod_side_pressure_pa,
            fading_friction: background
                .map(|background| [background.fading_ratio, background.fading_below_m_per_s]),
        };
        if let Some(background) = background {
            numbers.change(background);
        }
        for (name, factor) in wrong {
            numbers.scale(name, *factor)?;
        }
        numbers.mass_kg[0] += added_mass_kg;
        numbers.behind_kg[0] += added_mass_kg;
        // The break-away force is never below the sliding friction.
        numbers.break_away_n = numbers.break_away_n.max(numbers.sliding_n);
        Ok(numbers)
    }

    fn change(&mut self, background: &Background) {
        let edges = [&mut self.supply_edge_m3_per_s_pa, &mut self.exhaust_edge_m3_per_s_pa];
        for (edge, factors) in edges.into_iter().zip(&background.valve_point_factors) {
            edge.iter_mut().zip(factors).for_each(|(conductance, factor)| *conductance *= factor);
        }
        self.dead_volume_m3 *= background.dead_volume_ratio;
        // A normal flow brings the energy p_N T / T_0 per volume.
        self.normal_pa *= background.temperature_ratio;
    }

    fn scale(&mut self, name: &str, factor: f64) -> Result<(), MakeError> {
        if !(0.5..=2.0).contains(&factor) {
            return Err(MakeError::WrongParameter { name: name.to_owned(), factor });
        }
        let scaled: Vec<&mut f64> = match name {
            "parameter:mass" => self.mass_kg.iter_mut().chain(&mut self.behind_kg).collect(),
            "parameter:viscous-friction" => vec![&mut self.viscous_n_s_per_m],
            "parameter:sliding-friction" => vec![&mut self.sliding_n],
            "parameter:break-away-force" => vec![&mut self.break_away_n],
            "parameter:supply-pressure" => vec![&mut self.supply_pa],
            "parameter:spool-time-constant" => vec![&mut self.spool_time_s],
            "parameter:flow-lag" => vec![&mut self.flow_lag_s],
            "parameter:kv-scale" => {
                let edges = self.supply_edge_m3_per_s_pa.iter_mut();
                edges.chain(&mut self.exhaust_edge_m3_per_s_pa).collect()
            }
            "parameter:piston-area" => vec![&mut self.piston_m2, &mut self.annulus_m2],
            _ => return Err(MakeError::WrongParameter { name: name.to_owned(), factor }),
        };
        scaled.into_iter().for_each(|number| *number *= factor);
        Ok(())
    }

    /// Normal flow through one full supply edge into an empty chamber, m^3/s.
    pub(super) fn full_flow_m3_per_s(&self) -> f64 {
        self.supply_edge_m3_per_s_pa[VALVE_POINTS - 1] * self.supply_pa / 2.0
    }

    /// p_a that balances the initial p_b on a resting piston, Pa.
    pub(super) fn start_a_pa(&self) -> f64 {
        let rod_m2 = self.piston_m2 - self.annulus_m2;
        (self.start_b_pa * self.annulus_m2 + self.atmospheric_pa * rod_m2) / self.piston_m2
    }
}
