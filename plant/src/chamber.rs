//! Chambers: stored air, volume, pressure, the lag of the net flow and its bounds, and the force on the piston.
//!
//! ```text
//! d(p V)/dt = p_N q       V_a = V_0 + A_a xi    V_b = V_0 + A_b (L - xi)       [Neugebauer 2011, eqs. 1-3]
//! dq/dt = (Q - q) / tau_q                                                       [rig-model.md, One axis]
//! while p <= p_exhaust a negative q is set to 0, while p >= p_supply a positive one
//! F_pn = p_a A_a - p_b A_b - p_atm (A_a - A_b)
//! ```
//!
//! xi is the cylinder's own extension, q the lagged net normal flow, Q the flow through the valve's edge.
//!
//! The state is the stored air `M = p V` in joule and not the pressure: in an isothermal chamber it is
//! proportional to the mass, so a closed chamber keeps its mass to the bit however the piston moves.
//!
//! The lag is integrated exactly for a Q held over the step. The bounds act at the instant at which p crosses
//! them: from then on nothing flows that way, so the stored air stays at the bound's `p V`.
//!
//! Source: [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6.

use crate::effects;
use crate::lanes::{Axes, Form, Pair};
use crate::parameters::RigParameters;

/// How much of its air a chamber may carry beyond a bound before the instant of crossing matters: below 1 Pa.
///
/// A full chamber with an open valve touches its bound again and again by some millionths of a pascal, since the
/// flow law is vertical at equal pressures. Locating each of these would cost a careful step each time.
const NEGLIGIBLE_SHARE: f64 = 1e-6;

/// Geometry and pressures that do not change.
#[derive(Debug, Clone)]
pub(crate) struct Chambers<P = Pair> {
    dead_volume: P,
    full_volume_b: P,
    area_a: P,
    area_b: P,
    atmospheric_force: P,
    exhaust_pa: P,
    /// p_N, Pa.
    pub(crate) normal_pa: f64,
}

/// How the lagged flow goes through one span with the edge flow held.
#[derive(Debug, Clone)]
pub(crate) struct FlowLag<P = Pair> {
    keep: P,
    carried_air: P,
    fed_air: P,
    half_span_air: P,
}

/// Stored air in joule and lagged flow in m^3/s of one chamber of both axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Air<P = Pair> {
    pub(crate) stored: P,
    pub(crate) flow: P,
}

impl Chambers {
    /// The chambers of a rig, with the dead volumes that its effects put in place of the file's.
    pub(crate) fn of(rig: &RigParameters) -> Self {
        let dead_volume_m3 = effects::dead_volumes_m3(rig);
        let (cylinder, supply, gas) = (rig.cylinder(), rig.supply(), rig.gas());
        let rod_area = cylinder.piston_area_m2 - cylinder.annulus_area_m2;
        let dead_volume = Pair::new(dead_volume_m3[0], dead_volume_m3[1]);
        Chambers {
            dead_volume,
            full_volume_b: dead_volume + Pair::both(cylinder.annulus_area_m2 * cylinder.stroke_m),
            area_a: Pair::both(cylinder.piston_area_m2),
            area_b: Pair::both(cylinder.annulus_area_m2),
            atmospheric_force: Pair::both(supply.atmospheric_pressure_pa * rod_area),
            exhaust_pa: Pair::both(supply.exhaust_pressure_pa),
            normal_pa: gas.normal_pressure_pa,
        }
    }

    pub(crate) fn flow_lag(&self, time_constant_s: f64, span_s: f64) -> FlowLag {
        let carried_s = -time_constant_s * libm::expm1(-span_s / time_constant_s);
        FlowLag {
            keep: Pair::both(libm::exp(-span_s / time_constant_s)),
            carried_air: Pair::both(self.normal_pa * carried_s),
            fed_air: Pair::both(self.normal_pa * (span_s - carried_s)),
            half_span_air: Pair::both(self.normal_pa * span_s / 2.0),
        }
    }

    /// Piston areas of chambers a and b, m^2.
    pub(crate) fn areas_m2(&self) -> [f64; 2] {
        [self.area_a.drive(), self.area_b.drive()]
    }

    #[inline(always)]
    pub(crate) fn formed<P, F: Form<P>>(&self, form: &mut F) -> Chambers<P> {
        Chambers {
            dead_volume: form.pair(self.dead_volume),
            full_volume_b: form.pair(self.full_volume_b),
            area_a: form.pair(self.area_a),
            area_b: form.pair(self.area_b),
            atmospheric_force: form.pair(self.atmospheric_force),
            exhaust_pa: form.pair(self.exhaust_pa),
            normal_pa: form.one(self.normal_pa),
        }
    }

    /// The pressure at which a chamber of this cross-section's force balance stands still, Pa absolute:
    /// p_a for a given p_b.
    pub(crate) fn balancing_pressure_a(&self, pressure_b: Pair) -> Pair {
        (pressure_b * self.area_b + self.atmospheric_force) * self.area_a.reciprocal()
    }
}

impl<P: Axes> Chambers<P> {
    /// Volume of chamber a, m^3, at extensions in [0, L], m.
    #[inline(always)]
    pub(crate) fn volume_a(&self, extension: P) -> P {
        self.dead_volume + self.area_a * extension
    }

    /// Volume of chamber b, m^3, at extensions in [0, L], m.
    #[inline(always)]
    pub(crate) fn volume_b(&self, extension: P) -> P {
        self.full_volume_b - self.area_b * extension
    }

    /// Force of the air on the piston, N, positive extends the rod; pressures absolute, Pa.
    #[inline(always)]
    pub(crate) fn pneumatic_force(&self, pressure_a: P, pressure_b: P) -> P {
        pressure_a * self.area_a - pressure_b * self.area_b - self.atmospheric_force
    }

    /// By how much the pneumatic force grows in half a span by the lagged flows alone, N.
    #[inline(always)]
    pub(crate) fn force_growth(&self, lag: &FlowLag<P>, per_volume: [P; 2], flow: [P; 2]) -> P {
        let a = self.area_a * per_volume[0] * flow[0];
        let b = self.area_b * per_volume[1] * flow[1];
        (a - b) * lag.half_span_air
    }
}

impl FlowLag {
    #[inline(always)]
    pub(crate) fn formed<P, F: Form<P>>(&self, form: &mut F) -> FlowLag<P> {
        FlowLag {
            keep: form.pair(self.keep),
            carried_air: form.pair(self.carried_air),
            fed_air: form.pair(self.fed_air),
            half_span_air: form.pair(self.half_span_air),
        }
    }
}

impl<P: Axes> FlowLag<P> {
    /// The stored air half a span on, J, to the order the midpoint rule needs.
    #[inline(always)]
    pub(crate) fn midpoint_air(&self, air: Air<P>) -> P {
        air.stored + air.flow * self.half_span_air
    }

    /// Stored air and flow a span on, with the edge flow held and no bounds.
    #[inline(always)]
    pub(crate) fn advance(&self, air: Air<P>, edge_flow: P) -> Air<P> {
        Air {
            stored: air.stored + air.flow * self.carried_air + edge_flow * self.fed_air,
            flow: edge_flow + (air.flow - edge_flow) * self.keep,
        }
    }
}

/// The pressures beyond which the lag may carry no air, Pa absolute.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    supply_pa: f64,
    exhaust_pa: f64,
}

impl<P: Axes> Chambers<P> {
    #[inline(always)]
    pub(crate) fn limits(&self, supply_pa: f64) -> Limits {
        Limits { supply_pa, exhaust_pa: self.exhaust_pa.drive() }
    }

    pub(crate) fn exhaust_pa(&self) -> f64 {
        self.exhaust_pa.drive()
    }
}

impl Limits {
    /// The air after a step, stopped at the bounds at the step's end, and where the instant of crossing would matter.
    #[inline(always)]
    pub(crate) fn stop<P: Axes>(&self, from: Air<P>, to: Air<P>, volume: P) -> (Air<P>, P::Mask) {
        let most = (volume * P::both(self.supply_pa)).max(from.stored);
        let least = (volume * P::both(self.exhaust_pa)).min(from.stored);
        let stored = to.stored.min(most).max(least);
        let beyond = (to.stored - stored).abs();
        let within = beyond.at_most(P::both(0.0));
        let air = Air { stored, flow: to.flow.where_true(within) };
        (air, (stored * P::both(NEGLIGIBLE_SHARE)).less(beyond))
    }

    /// The air after a step, with the flow stopped at the instant at which a bound was crossed.
    ///
    /// The instant is found by a straight line between the pressures at both ends.
    pub(crate) fn hold(&self, from: Air, to: Air, volume_from: Pair, volume_to: Pair) -> Air {
        let lane = |i: usize| {
            let (start_j, end_j) = (from.stored.to_array()[i], to.stored.to_array()[i]);
            let (v_start, v_end) = (volume_from.to_array()[i], volume_to.to_array()[i]);
            let (p_start, p_end) = (start_j / v_start, end_j / v_end);
            let (flow_start, flow_end) = (from.flow.to_array()[i], to.flow.to_array()[i]);
            let bound_pa = if p_end > self.supply_pa && flow_start.max(flow_end) > 0.0 {
                self.supply_pa
            } else if p_end < self.exhaust_pa && flow_start.min(flow_end) < 0.0 {
                self.exhaust_pa
            } else {
                return (end_j, flow_end);
            };
            if (p_start - bound_pa) * (p_end - bound_pa) >= 0.0 {
                // Beyond the bound from the start: nothing may flow that way at all.
                return (start_j, 0.0);
            }
            let share = (bound_pa - p_start) / (p_end - p_start);
            let at_bound_j = start_j + share * (end_j - start_j);
            // The volume at the crossing lies between the two, whatever the straight line says.
            let (least, most) = (v_start.min(v_end), v_start.max(v_end));
            (at_bound_j.clamp(bound_pa * least, bound_pa * most), 0.0)
        };
        let (drive, load) = (lane(0), lane(1));
        Air { stored: Pair::new(drive.0, load.0), flow: Pair::new(drive.1, load.1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chambers() -> Chambers {
        Chambers::of(&RigParameters::baseline())
    }

    #[test]
    fn volumes_follow_the_extension() {
        let extension = Pair::new(0.0, 0.5);
        let full_a = 20e-6 + 1963.5e-6 * 0.5;
        let full_b = 20e-6 + 1649.3e-6 * 0.5;
        // One rounding each, of volumes of 1e-3.
        let close = |got: Pair, want: [f64; 2]| (0..2).all(|i| (got.to_array()[i] - want[i]).abs() < 1e-18);
        assert!(close(chambers().volume_a(extension), [20e-6, full_a]));
        assert!(close(chambers().volume_b(extension), [full_b, 20e-6]));
    }

    #[test]
    fn the_balancing_pressure_leaves_no_force() {
        let pressure_b = Pair::new(3.5e5, 6.9e5);
        let force = chambers().pneumatic_force(chambers().balancing_pressure_a(pressure_b), pressure_b);
        // Forces of 1e3 N, a few roundings.
        assert!(force.to_array().iter().all(|force| force.abs() < 1e-12 * 1e3), "{force:?}");
    }

    #[test]
    fn the_lag_moves_as_its_differential_equation() {
        let chambers = chambers();
        let (start, edge, span, tau) = (2e-3, -1e-3, 0.003, 0.008);
        let lag = chambers.flow_lag(tau, span);
        let air = Air { stored: Pair::both(200.0), flow: Pair::both(start) };
        let next = lag.advance(air, Pair::both(edge));
        let decay = (-span / tau).exp();
        let flow = edge + (start - edge) * decay;
        let stored = 200.0 + 101_325.0 * (edge * span + (start - edge) * tau * (1.0 - decay));
        // Few roundings of 200 J and of 2e-3 m^3/s.
        assert!((next.stored.drive() - stored).abs() < 1e-12 * 200.0);
        assert!((next.flow.load() - flow).abs() < 1e-15);
    }

    #[test]
    fn the_lag_neither_overfills_nor_empties() {
        let chambers = chambers();
        let lag = chambers.flow_lag(0.008, 1e-4);
        let volume = Pair::both(2e-5);
        let bounded = |pressure_pa: f64| {
            let air = Air { stored: Pair::both(pressure_pa * 2e-5), flow: Pair::new(0.01, -0.01) };
            let free = lag.advance(air, Pair::both(0.0));
            chambers.limits(7e5).hold(air, free, volume, volume)
        };
        // In a resting chamber the air at the crossing is known: a few roundings of 14 J and 2 J.
        let full = bounded(6.999e5);
        assert!((full.stored.drive() - 7e5 * 2e-5).abs() < 1e-13);
        assert_eq!(full.flow.drive(), 0.0);
        assert!(full.flow.load() < 0.0, "outflow goes on");
        let empty = bounded(1.014e5);
        assert!((empty.stored.load() - chambers.exhaust_pa() * 2e-5).abs() < 1e-14);
        assert_eq!(empty.flow.load(), 0.0);
        assert!(empty.flow.drive() > 0.0, "inflow goes on");
    }

    #[test]
    fn a_chamber_beyond_a_bound_keeps_its_air() {
        let chambers = chambers();
        let lag = chambers.flow_lag(0.008, 1e-4);
        let volume = Pair::both(2e-5);
        // Compressed above the supply, the lag still carrying air in: it stops, but nothing is taken out.
        let squeezed = Air { stored: Pair::both(8e5 * 2e-5), flow: Pair::both(0.01) };
        let next =
            chambers.limits(7e5).hold(squeezed, lag.advance(squeezed, Pair::both(0.0)), volume, volume);
        assert_eq!((next.stored.drive(), next.flow.drive()), (8e5 * 2e-5, 0.0));
    }
}
