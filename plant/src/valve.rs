//! The valve: from command to spool, from spool to K_V, from K_V and two pressures to a normal volume flow.
//!
//! ```text
//! ds/dt = (u - s) / tau_v                                                      [rig-model.md, One axis]
//! Q_N = 25.9  K_V sqrt((p_P - p_S) p_S)    p_P >= p_S >= p_P / 2               [Neugebauer 2011, eq. 4]
//! Q_N = 12.95 K_V p_P                      p_P / 2 >= p_S
//! ```
//!
//! p in bar, K_V in m^3/h, Q_N in m^3/h, upstream p_P, downstream p_S. Both lines are one formula,
//! `25.9 K_V sqrt((p_P - m) m)` with `m = max(p_S, p_P / 2)`: where m is half of p_P the root is p_P / 2. It has no
//! branch, is continuous with its slope at the sonic point, and is vertical at equal pressures, as the paper's is.
//!
//! K_V is piecewise linear in |s|, written as a sum of hinges: `K_V = sum c_i max(0, |s| - o_i)`, where c_i is
//! the change of slope at point o_i. Both edges' tables share the hinges.
//!
//! Source: [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6.

use crate::lanes::{Axes, Choice, Form, Pair};
use crate::parameters::table::VALVE_POINTS;
use crate::parameters::{RigParameters, ValveParameters};

/// Segments of a K_V table, and so hinges.
const HINGES: usize = VALVE_POINTS - 1;

/// From bar and m^3/h to Pa and m^3/s: Q_N in m^3/s per K_V in m^3/h and Pa [Neugebauer 2011, eq. 4].
pub(crate) const FLOW_PER_KV: f64 = 25.9 / 1e5 / 3600.0;

/// Largest count of the signed 12-bit valve command.
const COMMAND_COUNTS: f64 = 2047.0;

/// Rounds a valve command to the nearest 1/2047 and clamps it to [-1, 1], as the wire does.
///
/// `u` is an opening, 1 fully open; the caller has already refused NaN [rig-model.md, Sensors].
pub fn quantise_valve(u: f64) -> f64 {
    (u.clamp(-1.0, 1.0) * COMMAND_COUNTS).round() / COMMAND_COUNTS
}

/// The valve's characteristic, ready for the step.
#[derive(Debug, Clone)]
pub(crate) struct Valve<P = Pair> {
    point: [P; HINGES],
    supply_hinge: [P; HINGES],
    exhaust_hinge: [P; HINGES],
}

/// What an edge lets through per unit of the pressure root, m^3/s per Pa, for both chambers of both axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edges<P> {
    /// Conductance of the edge that chamber a is connected to.
    pub(crate) conductance_a: P,
    /// Conductance of the edge that chamber b is connected to.
    pub(crate) conductance_b: P,
    /// Pressure on the far side of chamber a's edge: supply or exhaust.
    pub(crate) far_pressure_a: P,
    /// Pressure on the far side of chamber b's edge.
    pub(crate) far_pressure_b: P,
}

impl Valve {
    pub(crate) fn new(parameters: &ValveParameters) -> Self {
        let opening = &parameters.opening;
        let hinges = |kv: &[f64; VALVE_POINTS]| {
            let slope = |i: usize| (kv[i + 1] - kv[i]) / (opening[i + 1] - opening[i]) * FLOW_PER_KV;
            std::array::from_fn(|i| Pair::both(if i == 0 { slope(0) } else { slope(i) - slope(i - 1) }))
        };
        Valve {
            point: std::array::from_fn(|i| Pair::both(opening[i])),
            supply_hinge: hinges(&parameters.kv_supply_m3_per_h),
            exhaust_hinge: hinges(&parameters.kv_exhaust_m3_per_h),
        }
    }

    /// Conductance of supply and exhaust edge at an opening |s| of 0 to 1, m^3/s per Pa.
    pub(crate) fn conductances(&self, opening: f64) -> [f64; 2] {
        let sum = |hinges: &[Pair; HINGES]| {
            let beyond = |i: usize| (opening - self.point[i].drive()).max(0.0);
            (0..HINGES).map(|i| hinges[i].drive() * beyond(i)).sum()
        };
        [sum(&self.supply_hinge), sum(&self.exhaust_hinge)]
    }

    #[inline(always)]
    pub(crate) fn formed<P: Copy, F: Form<P>>(&self, form: &mut F) -> Valve<P> {
        Valve {
            point: formed_hinges(&self.point, form),
            supply_hinge: formed_hinges(&self.supply_hinge, form),
            exhaust_hinge: formed_hinges(&self.exhaust_hinge, form),
        }
    }
}

impl<P: Axes> Valve<P> {
    /// Which edge each chamber sees and how far it is open, for spools in [-1, 1].
    ///
    /// s > 0: supply to a, b to exhaust; s < 0: supply to b, a to exhaust.
    #[inline(always)]
    pub(crate) fn edges(&self, spool: P, supply_pa: f64, exhaust_pa: f64) -> Edges<P> {
        let opening = spool.abs();
        let mut supply = P::both(0.0);
        let mut exhaust = P::both(0.0);
        for i in 0..HINGES {
            let beyond = (opening - self.point[i]).max(P::both(0.0));
            supply = supply + self.supply_hinge[i] * beyond;
            exhaust = exhaust + self.exhaust_hinge[i] * beyond;
        }
        let extending = P::both(0.0).less(spool);
        let (supply_pa, exhaust_pa) = (P::both(supply_pa), P::both(exhaust_pa));
        Edges {
            conductance_a: extending.choose(supply, exhaust),
            conductance_b: extending.choose(exhaust, supply),
            far_pressure_a: extending.choose(supply_pa, exhaust_pa),
            far_pressure_b: extending.choose(exhaust_pa, supply_pa),
        }
    }
}

#[inline(always)]
fn formed_hinges<P: Copy, F: Form<P>>(hinges: &[Pair; HINGES], form: &mut F) -> [P; HINGES] {
    let mut formed = [form.pair(hinges[0]); HINGES];
    for i in 1..HINGES {
        formed[i] = form.pair(hinges[i]);
    }
    formed
}

/// Normal volume flow through an edge into the chamber, m^3/s, positive inwards [Neugebauer 2011, eq. 4].
///
/// `conductance` is in m^3/s per Pa and not negative, pressures are absolute, Pa, and positive.
#[inline(always)]
pub(crate) fn edge_flow<P: Axes>(conductance: P, far_pa: P, chamber_pa: P) -> P {
    let upstream = far_pa.max(chamber_pa);
    let downstream = far_pa.min(chamber_pa);
    let throat = downstream.max(upstream * P::both(0.5));
    let root = ((upstream - throat) * throat).sqrt();
    (conductance * root).with_sign_of(far_pa - chamber_pa)
}

/// [`edge_flow`] of one edge of one axis.
#[inline(always)]
pub(crate) fn single_edge_flow(conductance: f64, far_pa: f64, chamber_pa: f64) -> f64 {
    let upstream = far_pa.max(chamber_pa);
    let throat = far_pa.min(chamber_pa).max(upstream * 0.5);
    (conductance * ((upstream - throat) * throat).sqrt()).copysign(far_pa - chamber_pa)
}

/// The valve between supply and exhaust without its lags, for one chamber: what the model says of a flow, beside measurements.
#[derive(Debug, Clone)]
pub struct StaticValve {
    valve: Valve,
    supply_pa: f64,
    exhaust_pa: f64,
}

impl StaticValve {
    /// The valve of a rig.
    #[must_use]
    pub fn new(rig: &RigParameters) -> Self {
        let (valve, supply) = (Valve::new(rig.valve()), rig.supply());
        StaticValve { valve, supply_pa: supply.pressure_pa, exhaust_pa: supply.exhaust_pressure_pa }
    }

    /// Normal volume flow into a chamber, m^3/s, at an opening in [-1, 1], towards the supply where it is positive, and an
    /// absolute pressure of at least 0, Pa.
    #[must_use]
    pub fn flow_m3_per_s(&self, opening: f64, chamber_pa: f64) -> f64 {
        let [supply, exhaust] = self.valve.conductances(opening.abs());
        if opening > 0.0 {
            single_edge_flow(supply, self.supply_pa, chamber_pa)
        } else {
            single_edge_flow(exhaust, self.exhaust_pa, chamber_pa)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eq. (4) as printed, in bar and m^3/h.
    fn paper_flow(kv: f64, upstream_bar: f64, downstream_bar: f64) -> f64 {
        if downstream_bar >= upstream_bar / 2.0 {
            25.9 * kv * ((upstream_bar - downstream_bar) * downstream_bar).sqrt()
        } else {
            12.95 * kv * upstream_bar
        }
    }

    #[test]
    fn the_edge_flow_is_the_papers_in_both_regimes_and_both_directions() {
        let conductance = Pair::both(0.6 * FLOW_PER_KV);
        for (far_bar, chamber_bar) in
            [(7.0, 1.0), (7.0, 3.5), (7.0, 5.0), (7.0, 6.999), (1.01325, 1.5), (1.0, 7.0)]
        {
            let flow = edge_flow(conductance, Pair::both(far_bar * 1e5), Pair::both(chamber_bar * 1e5));
            let (up, down) = (f64::max(far_bar, chamber_bar), f64::min(far_bar, chamber_bar));
            let paper = paper_flow(0.6, up, down) / 3600.0 * f64::signum(far_bar - chamber_bar);
            // Ten roundings, and the difference of nearly equal pressures loses three digits at 6.999 bar.
            assert!((flow.drive() - paper).abs() <= 1e-12 * paper.abs(), "{far_bar} -> {chamber_bar}");
        }
    }

    #[test]
    fn without_lags_a_chamber_gets_what_the_paper_says() {
        let rig = RigParameters::baseline();
        let valve = StaticValve::new(&rig);
        let [supply_kv, exhaust_kv] =
            [rig.valve().kv_supply_m3_per_h, rig.valve().kv_exhaust_m3_per_h].map(|kv| kv[3]);
        let opening = rig.valve().opening[3];
        let (supply_bar, exhaust_bar) =
            (rig.supply().pressure_pa / 1e5, rig.supply().exhaust_pressure_pa / 1e5);
        for chamber_bar in [1.5, 4.0, 6.5] {
            let filled = paper_flow(supply_kv, supply_bar, chamber_bar) / 3600.0;
            let emptied = paper_flow(exhaust_kv, chamber_bar, exhaust_bar) / 3600.0;
            let reported = [opening, -opening].map(|opening| valve.flow_m3_per_s(opening, chamber_bar * 1e5));
            assert!((reported[0] - filled).abs() <= 1e-9 * filled, "{reported:?}, {filled}");
            assert!((reported[1] + emptied).abs() <= 1e-9 * emptied, "{reported:?}, {emptied}");
        }
    }

    #[test]
    fn no_flow_at_equal_pressures() {
        let flow = edge_flow(Pair::both(1e-8), Pair::both(3e5), Pair::both(3e5));
        assert_eq!(flow.to_array().map(f64::abs), [0.0, 0.0]);
    }

    #[test]
    fn the_hinges_reproduce_the_table_between_and_at_its_points() {
        let rig = RigParameters::baseline();
        let valve = Valve::new(rig.valve());
        for (spool, supply_kv, exhaust_kv) in [
            (0.0, 0.0, 0.0),
            (0.02, 0.0, 0.0),
            (0.2, 0.115, 0.095),
            (0.35, 0.2375, 0.1975),
            (0.9, 0.63, 0.55),
            (1.0, 0.66, 0.58),
        ] {
            let edges = valve.edges(Pair::new(spool, -spool), 7e5, 1e5);
            // Five products and sums of numbers below 1: a few units in the last place of 1.
            let close = |conductance: f64, kv: f64| (conductance / FLOW_PER_KV - kv).abs() < 1e-14;
            assert!(close(edges.conductance_a.drive(), supply_kv), "a extends at {spool}");
            assert!(close(edges.conductance_b.drive(), exhaust_kv), "b exhausts at {spool}");
            if spool > 0.0 {
                assert!(close(edges.conductance_a.load(), exhaust_kv), "a exhausts at -{spool}");
                assert!(close(edges.conductance_b.load(), supply_kv), "b is supplied at -{spool}");
                assert_eq!(edges.far_pressure_a.to_array(), [7e5, 1e5]);
                assert_eq!(edges.far_pressure_b.to_array(), [1e5, 7e5]);
            }
        }
    }

    #[test]
    fn a_command_is_rounded_to_the_nearest_count_and_clamped() {
        assert_eq!(quantise_valve(0.0), 0.0);
        assert_eq!(quantise_valve(1.0), 1.0);
        assert_eq!(quantise_valve(-7.0), -1.0);
        assert_eq!(quantise_valve(0.4 / 2047.0), 0.0);
        assert_eq!(quantise_valve(0.6 / 2047.0), 1.0 / 2047.0);
        assert_eq!(quantise_valve(-0.6 / 2047.0), -1.0 / 2047.0);
    }
}
