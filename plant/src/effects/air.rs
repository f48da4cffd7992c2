//! The air with effects: what enters a chamber beside the valve's flow, what heat does to it, and what a line delays.

use super::OpenBalance;
use super::acting::Effects;
use super::flows::{PortConditions, Ports};
use super::heat_exchange::{ChamberHeat, wetted_m2};
use super::memory::EffectStates;
use super::sums::{AirRate, ExhaustSide, Leakage, LineFlow, SupplySide};
use super::tabulated::AxisConditions;
use crate::integrator::Integrator;
use crate::state::State;
use crate::truth::AirState;

pub(crate) struct HeatState {
    pub(crate) stored_j: f64,
    pub(crate) volume_m3: f64,
    pub(crate) normal_volume_m3: f64,
    pub(crate) flow_m3_per_s: f64,
}

impl Effects {
    /// Pressure that effects add behind the supply edges.
    pub(crate) fn supply_side(&self, states: &EffectStates) -> SupplySide {
        SupplySide { supply_droop: states.droop_pa }
    }

    pub(crate) fn ports_at(&self, of: &Integrator, axis: usize, state: &State, air: &AirState) -> Ports {
        let states = &self.memory.states;
        let exhaust = ExhaustSide { silencer_back_pressure: states.axes[axis].silencer_pa };
        self.ports(
            of,
            axis,
            &PortConditions {
                spool: state.axes[axis].spool,
                supply_pa: self.supply_side(states).sum(state.supply_pressure_pa),
                exhaust_pa: exhaust.sum(of.chambers.exhaust_pa()),
                pressure_pa: air.of_axis_pa(axis),
                extension_m: state.axes[axis].extension_m,
                shut: of.supply.check_valves_shut(state.supply_pressure_pa),
            },
        )
    }

    /// Flows into the chambers of an axis beside the valve's, by their pressures and what tables are over.
    pub(crate) fn leakage(&self, of: &Integrator, axis: usize, conditions: &AxisConditions) -> [Leakage; 2] {
        let on = &self.on[axis];
        let pressure_pa = conditions.pressure_pa;
        let across = on.piston_leakage.map_or(0.0, |effect| effect.flow(pressure_pa[0], pressure_pa[1]));
        let out = |chamber: usize| {
            on.rod_leakage[chamber]
                .map_or(0.0, |effect| -effect.flow(pressure_pa[chamber], of.atmospheric_pa))
        };
        [0, 1].map(|chamber| Leakage {
            piston_leakage: if chamber == 0 { -across } else { across },
            rod_leakage: out(chamber),
            tabulated: on.tabulated.flow(chamber, conditions),
            declared: on.declared.flow(chamber, &self.declared_in_step(axis, conditions)),
            added: on.added(OpenBalance::Leakage { chamber, conditions }),
        })
    }

    /// What heat adds to the rate of a chamber's stored air, but for the piston's work; `span_s` is 0 for an instant.
    ///
    /// Where the gas takes the wall's temperature within a span x times as long as its relaxation, the exchange is damped by
    /// 1 / (1 + x^2/4): second order where it is slow, and never more than the whole difference where it is fast.
    pub(crate) fn air_rate(
        &self,
        of: &Integrator,
        axis: usize,
        chamber: usize,
        heat: HeatState,
        span_s: f64,
    ) -> AirRate {
        let heat_exchange = self.on[axis].heat_exchange.map_or(0.0, |effect| {
            let inside = ChamberHeat {
                flow_m3_per_s: heat.flow_m3_per_s,
                temperature_k: self.temperature_k * heat.stored_j
                    / (of.chambers.normal_pa * heat.normal_volume_m3),
                wetted_m2: wetted_m2(of.chambers.areas_m2()[chamber], heat.volume_m3),
            };
            let carried = effect.thermal_rate_w(ChamberHeat { wetted_m2: 0.0, ..inside });
            let exchanged = effect.thermal_rate_w(inside) - carried;
            let x = span_s / effect.relaxation_s(heat.stored_j, inside);
            carried + exchanged / (1.0 + x * x / 4.0)
        });
        AirRate { heat_exchange }
    }

    /// Share of the piston's work p dV that the stored air loses; 0 in the isothermal baseline.
    pub(crate) fn work_share(&self, axis: usize) -> f64 {
        self.on[axis].heat_exchange.map_or(0.0, |effect| effect.work_share())
    }

    /// What enters the line of a chamber, `ahead_s` after the newest substep's beginning.
    pub(crate) fn line(&self, axis: usize, chamber: usize, port: f64, ahead_s: f64) -> LineFlow {
        let line = self.on[axis].line_delay.zip(self.memory.lines[axis][chamber].as_ref());
        let line_delay = line.map_or(0.0, |(effect, history)| {
            // The newest entry is of the last substep's midpoint; between it and now there is a straight line.
            let back_s = effect.delay_s() - ahead_s - self.substep_s / 2.0;
            let delayed = if back_s >= 0.0 {
                history.before(back_s / self.substep_s)
            } else {
                let share = effect.delay_s() / (ahead_s + self.substep_s / 2.0);
                port + (history.before(0.0) - port) * share
            };
            effect.term(delayed, port)
        });
        LineFlow { line_delay }
    }
}
