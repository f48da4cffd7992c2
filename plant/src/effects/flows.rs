//! Flows with effects: from a spool and the pressures on both sides to what passes each port of a valve.
//!
//! ```text
//!   supply ──[edge]──┐                       p_port = p_chamber + drops(q)
//!                    ├── port ──(drops)── chamber
//!  exhaust ──[edge]──┘                       q = sum of the edges' flows at p_port
//! ```
//!
//! The drops grow with the flow and the edges' flow falls with the pressure at the port, so there is one q between 0 and the
//! flow without drops; it is found by the Illinois variant of false position. Where a non-return valve does not crack, q = 0.
//!
//! Source: [Dowell, Jarratt 1971], BIT 11, 168-174.

use super::OpenBalance;
use super::acting::Effects;
use super::sums::{Characteristic, Edge, Opening, Port, PortFlow};
use crate::integrator::Integrator;
use crate::valve::{FLOW_PER_KV, single_edge_flow};

/// Steps of the search for a port's flow; a dozen reach the last digits.
const SEARCH_STEPS: usize = 40;

/// Where the search ends, as a share of the flow without drops: far below what a sensor's step could show.
const SEARCH_SHARE: f64 = 1e-12;

/// Values that the flows of an axis depend on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PortConditions {
    pub(crate) spool: f64,
    pub(crate) supply_pa: f64,
    pub(crate) exhaust_pa: f64,
    pub(crate) pressure_pa: [f64; 2],
    pub(crate) extension_m: f64,
    /// Whether the check valves of the emergency stop are shut.
    pub(crate) shut: bool,
}

/// Flows through the ports of an axis, and their terms; two values are those of chambers a and b.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ports {
    /// Into each chamber's line, m^3/s.
    pub(crate) flow_m3_per_s: [f64; 2],
    /// Out of the supply, m^3/s.
    pub(crate) drawn_m3_per_s: f64,
    /// Into the exhaust, m^3/s.
    pub(crate) exhausted_m3_per_s: f64,
    pub(crate) opening: Opening,
    /// Supply edges, exhaust edges.
    pub(crate) characteristic: [Characteristic; 2],
    /// For each chamber its supply edge and its exhaust edge.
    pub(crate) edges: [[Edge; 2]; 2],
    pub(crate) port: [Port; 2],
    pub(crate) port_flow: [PortFlow; 2],
}

/// One chamber's two edges: conductances and the pressures behind them, supply and exhaust.
#[derive(Clone, Copy)]
struct ChamberEdges {
    conductance: [f64; 2],
    far_pa: [f64; 2],
}

impl Effects {
    /// Flows of an axis at its two ports.
    pub(crate) fn ports(&self, of: &Integrator, axis: usize, at: &PortConditions) -> Ports {
        let on = &self.on[axis];
        let opening = Opening {
            valve_dead_zone: on.valve_dead_zone.map_or(0.0, |effect| effect.term(at.spool)),
            added: on.added(OpenBalance::Opening { spool: at.spool }),
        };
        let spool = opening.sum(at.spool);
        let open = spool.abs().min(1.0);
        let table = |open: f64| of.valve.conductances(open).map(|conductance| conductance / FLOW_PER_KV);
        let bent = on.valve_characteristic.map_or([0.0; 2], |effect| effect.terms(table, open));
        let characteristic = bent.map(|valve_characteristic| Characteristic { valve_characteristic });
        let file_kv = table(open);
        let kv = [0, 1].map(|edge| characteristic[edge].sum(file_kv[edge]));
        let kv_max = on.valve_null_leakage.map_or([0.0; 2], |_| table(1.0));
        let mut ports = Ports {
            flow_m3_per_s: [0.0; 2],
            drawn_m3_per_s: 0.0,
            exhausted_m3_per_s: 0.0,
            opening,
            characteristic,
            edges: [[Edge::default(); 2]; 2],
            port: [Port::default(); 2],
            port_flow: [PortFlow::default(); 2],
        };
        for chamber in 0..2 {
            // s > 0: supply to a, b to exhaust.
            let connected = usize::from((spool > 0.0) != (chamber == 0));
            let mut pipes = ChamberEdges { conductance: [0.0; 2], far_pa: [at.supply_pa, at.exhaust_pa] };
            for edge in 0..2 {
                let kv_open = if edge == connected { kv[edge] } else { 0.0 };
                let floor = on.valve_null_leakage.map_or(0.0, |effect| effect.term(kv_open, kv_max[edge]));
                ports.edges[chamber][edge] = Edge { valve_null_leakage: floor };
                let shut = if at.shut { 0.0 } else { 1.0 };
                pipes.conductance[edge] = ports.edges[chamber][edge].sum(kv_open) * FLOW_PER_KV * shut;
            }
            let to_end_m = if chamber == 0 { at.extension_m } else { of.motion.stroke_m - at.extension_m };
            let unresisted = [0, 1].map(|edge| self.edge(axis, &pipes, edge, at.pressure_pa[chamber]));
            let (flow, port) = self.through(axis, &pipes, unresisted, at.pressure_pa[chamber], to_end_m);
            let [supplied, vented] = if flow == 0.0 {
                let port_pa = self.shut_port_pa(axis, &pipes, at.pressure_pa[chamber]);
                [0, 1].map(|edge| self.edge(axis, &pipes, edge, port_pa))
            } else if self.resists(axis) {
                let port_pa = port.sum(at.pressure_pa[chamber]);
                [0, 1].map(|edge| self.edge(axis, &pipes, edge, port_pa))
            } else {
                unresisted
            };
            ports.flow_m3_per_s[chamber] = flow;
            ports.port[chamber] = port;
            ports.drawn_m3_per_s += supplied.0.sum(supplied.1);
            ports.exhausted_m3_per_s -= vented.0.sum(vented.1);
            ports.port_flow[chamber] = PortFlow {
                critical_pressure_ratio: supplied.0.critical_pressure_ratio
                    + vented.0.critical_pressure_ratio,
            };
        }
        ports
    }

    /// Pressure at a port through which nothing passes, Pa: where leakage from the supply leaves for the exhaust.
    fn shut_port_pa(&self, axis: usize, pipes: &ChamberEdges, chamber_pa: f64) -> f64 {
        if pipes.conductance.contains(&0.0) {
            // One edge at most: the port takes the pressure behind it, and then that edge passes nothing either.
            return (0..2)
                .find(|edge| pipes.conductance[*edge] > 0.0)
                .map_or(chamber_pa, |edge| pipes.far_pa[edge]);
        }
        let [mut high, mut low] = pipes.far_pa;
        for _ in 0..SEARCH_STEPS {
            let middle = 0.5 * (low + high);
            let [supplied, vented] = [0, 1].map(|edge| self.edge(axis, pipes, edge, middle));
            if supplied.0.sum(supplied.1) + vented.0.sum(vented.1) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Flow of an edge by eq. (4), and what effects add to it.
    fn edge(&self, axis: usize, pipes: &ChamberEdges, edge: usize, port_pa: f64) -> (PortFlow, f64) {
        let (conductance, far_pa) = (pipes.conductance[edge], pipes.far_pa[edge]);
        if conductance == 0.0 {
            return (PortFlow::default(), 0.0);
        }
        let critical_pressure_ratio = self.on[axis]
            .critical_pressure_ratio
            .map_or(0.0, |effect| effect.term(conductance, far_pa, port_pa));
        (PortFlow { critical_pressure_ratio }, single_edge_flow(conductance, far_pa, port_pa))
    }

    /// What lies between a chamber and its valve, at a flow.
    pub(crate) fn drops(&self, axis: usize, flow: f64, chamber_pa: f64, to_end_m: f64) -> Port {
        let on = &self.on[axis];
        Port {
            line_resistance: on.line_resistance.map_or(0.0, |effect| effect.term(flow, chamber_pa)),
            check_valve_restriction: on
                .check_valve_restriction
                .map_or(0.0, |effect| effect.term(flow, chamber_pa)),
            end_cushion: on.end_cushion.map_or(0.0, |effect| effect.term(flow, chamber_pa, to_end_m)),
        }
    }

    /// Whether anything lies between the chambers of an axis and their valve.
    fn resists(&self, axis: usize) -> bool {
        let on = &self.on[axis];
        on.line_resistance.is_some() || on.check_valve_restriction.is_some() || on.end_cushion.is_some()
    }

    /// Flow into a chamber through its port, m^3/s, and the drops at that flow; `unresisted` are the edges' flows without drops.
    fn through(
        &self,
        axis: usize,
        pipes: &ChamberEdges,
        unresisted: [(PortFlow, f64); 2],
        chamber_pa: f64,
        to_end_m: f64,
    ) -> (f64, Port) {
        let sum = |edges: [(PortFlow, f64); 2]| -> f64 {
            edges.into_iter().map(|(terms, flow)| terms.sum(flow)).sum()
        };
        let free = sum(unresisted);
        if !self.resists(axis) || free == 0.0 {
            return (free, Port::default());
        }
        let arrives = |port_pa: f64| sum([0, 1].map(|edge| self.edge(axis, pipes, edge, port_pa)));
        let drops = |flow: f64| self.drops(axis, flow, chamber_pa, to_end_m);
        // More arrives than passes: positive below the flow that is sought, negative above.
        let excess = |size: f64| arrives(drops(size.copysign(free)).sum(chamber_pa)) * free.signum() - size;
        let tolerance = free.abs() * SEARCH_SHARE;
        let (mut low, mut high) = (tolerance, free.abs());
        let (mut at_low, mut at_high) = (excess(low), excess(high));
        if at_low <= 0.0 {
            return (0.0, Port::default());
        }
        let mut kept = 0.0; // the sign of the end that moved last
        for _ in 0..SEARCH_STEPS {
            if high - low <= tolerance || at_high == 0.0 {
                break;
            }
            let middle = (low * at_high - high * at_low) / (at_high - at_low);
            let middle = if middle > low && middle < high { middle } else { 0.5 * (low + high) };
            let found = excess(middle);
            if found > 0.0 {
                (low, at_low) = (middle, found);
                at_high *= if kept > 0.0 { 0.5 } else { 1.0 };
                kept = 1.0;
            } else {
                (high, at_high) = (middle, found);
                at_low *= if kept < 0.0 { 0.5 } else { 1.0 };
                kept = -1.0;
            }
        }
        let flow = if at_high == 0.0 { high } else { 0.5 * (low + high) }.copysign(free);
        (flow, drops(flow))
    }
}
