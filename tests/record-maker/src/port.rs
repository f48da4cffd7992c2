//! Between valve and chamber: line resistance, check valve and cushion in series, and the flow that satisfies all of them.
//!
//! ```text
//!   far side ── edges ── p_port ── line ── check valve ── cushion ── p_chamber
//!   Q = E(p_port)        p_port = p_chamber + drop(Q)
//! ```
//!
//! E falls with p_port and the drop grows with Q, so `Q - E(p_chamber + drop(Q))` has one root between 0 and the flow without
//! drops. It is found by the Illinois rule [Dowell, Jarratt 1971, BIT 11], on the squares of the flows. Flows are normal flows
//! into the chamber, m^3/s.

use super::Form;
use super::numbers::{CONDUCTANCE_PER_KV, Numbers};
use super::valve::flow;

/// Effects between valve and chamber that are on; SI.
#[derive(Debug, Clone, Default)]
pub(super) struct PortLaws {
    pub(super) form: Form,
    /// Drop of the line at the reference flow, Pa.
    pub(super) line_drop_pa: f64,
    /// Cracking pressure, Pa, and K_V of the seat, m^3/h.
    pub(super) check_valve: Option<[f64; 2]>,
    /// K_V of the cushion, m^3/h, and its length, m.
    pub(super) cushion: Option<[f64; 2]>,
}

#[derive(Debug, Clone)]
pub(super) struct Ports {
    laws: PortLaws,
    full_flow_m3_per_s: f64,
    reference_pa: f64,
}

/// The near form's check valve opens over this share of the full flow.
const OPENS_OVER: f64 = 0.03;
/// Relative excess width of the forms' cushion at its beginning over its end.
const TAPER: [f64; 3] = [0.0, 1.0, 1.0];
/// The far form's lip seal lifts only in part: a chamber that fills sees a cushion so many times as wide.
const LIP_LIFTS: f64 = 7.0;
/// Shares by which the far forms' cracking pressure of a check valve and drop of a line's filter are larger in chamber a and
/// smaller in b.
const SPRINGS_DIFFER: f64 = 0.5;
const FILTERS_DIFFER: f64 = 0.25;
/// Tolerance of a flow as a share of the full flow, and the largest number of iterations.
const CLOSE: f64 = 1e-7;
const MOST_TRIALS: usize = 60;
/// Flows below this share of the full flow are taken as zero.
const NEGLIGIBLE: f64 = 1e-9;

impl Ports {
    pub(super) fn new(numbers: &Numbers, laws: PortLaws) -> Self {
        Ports {
            laws,
            full_flow_m3_per_s: numbers.full_flow_m3_per_s(),
            reference_pa: numbers.supply_pa / 2.0,
        }
    }

    /// Port pressure, Pa, and flow, m^3/s, for a chamber whose piston face is `to_end_m` from its end.
    ///
    /// `edges` is the flow of all edges into the chamber as a function of the port pressure, m^3/s, falling.
    #[inline(always)]
    pub(super) fn pressure(
        &self,
        chamber: usize,
        [chamber_pa, to_end_m]: [f64; 2],
        edges: impl Fn(f64) -> f64,
    ) -> (f64, f64) {
        let laws = &self.laws;
        let cushioned = laws.cushion.is_some_and(|[_, length_m]| to_end_m < length_m);
        if laws.line_drop_pa == 0.0 && laws.check_valve.is_none() && !cushioned {
            return (chamber_pa, edges(chamber_pa));
        }
        self.solve(chamber, [chamber_pa, to_end_m], edges)
    }

    fn solve(
        &self,
        chamber: usize,
        [chamber_pa, to_end_m]: [f64; 2],
        edges: impl Fn(f64) -> f64,
    ) -> (f64, f64) {
        let free = edges(chamber_pa);
        let least = NEGLIGIBLE * self.full_flow_m3_per_s;
        if free.abs() <= least {
            return (chamber_pa, free);
        }
        let direction = free.signum();
        // Flows of orifices are square roots of pressures: in squared flows the residual is nearly linear.
        let miss = |square: f64| {
            let flow = square.sqrt();
            let port_pa = self.beyond(chamber, direction * flow, [chamber_pa, to_end_m]);
            let passes = (direction * edges(port_pa)).max(0.0);
            (square - passes * passes, flow - passes, port_pa)
        };
        let (mut low, mut high) = (0.0, free * free);
        // The limit of a small flow: the cracking pressure of the check valve.
        let (mut miss_low, _, port_pa) = miss(least * least * 1e-6);
        if miss_low >= 0.0 {
            return (port_pa, 0.0);
        }
        let (mut miss_high, mut off, mut port_pa) = miss(high);
        let mut found = high;
        for _ in 0..MOST_TRIALS {
            if off.abs() <= CLOSE * self.full_flow_m3_per_s || high - low <= CLOSE * CLOSE * high {
                break;
            }
            found = (low * miss_high - high * miss_low) / (miss_high - miss_low);
            let missed;
            (missed, off, port_pa) = miss(found);
            if missed > 0.0 {
                (high, miss_high) = (found, missed);
                miss_low /= 2.0;
            } else {
                (low, miss_low) = (found, missed);
                miss_high /= 2.0;
            }
        }
        (port_pa, direction * found.sqrt())
    }

    /// Pressure on the valve's side of the port at a flow, Pa.
    fn beyond(&self, chamber: usize, flow: f64, [chamber_pa, to_end_m]: [f64; 2]) -> f64 {
        let (laws, direction) = (&self.laws, flow.signum());
        let split = |share| laws.form.side(chamber == 0, share);
        let mut pa = chamber_pa;
        if let Some([kv, length_m]) = laws.cushion
            && to_end_m < length_m
            && (flow < 0.0 || laws.form.is_far())
        {
            let wider = 1.0 + laws.form.of(TAPER) * (to_end_m / length_m).max(0.0);
            let lifted = if flow < 0.0 { 1.0 } else { LIP_LIFTS };
            pa = behind_orifice(lifted * CONDUCTANCE_PER_KV * kv * wider, flow, pa);
        }
        if let Some([cracking_pa, kv]) = laws.check_valve {
            let opened = flow.abs() / (OPENS_OVER * self.full_flow_m3_per_s);
            // Near: the spring of the seat is compressed as it opens.
            let share = if laws.form == Form::Near {
                0.7 + 0.3 * opened / (1.0 + opened * opened).sqrt()
            } else {
                split(SPRINGS_DIFFER)
            };
            pa = behind_orifice(CONDUCTANCE_PER_KV * kv, flow, pa) + direction * cracking_pa * share;
        }
        if laws.line_drop_pa > 0.0 && pa > 0.0 {
            let share = flow.abs() / self.full_flow_m3_per_s;
            let grown = match laws.form {
                Form::Catalogue => share * share,
                // Blasius' law for smooth turbulent pipes, q^1.75.
                Form::Near => share * share.sqrt() * share.sqrt().sqrt(),
                // A filter of sintered bronze in the line, laminar.
                Form::Far => split(FILTERS_DIFFER) * share,
            };
            pa += direction * laws.line_drop_pa * grown * self.reference_pa / pa;
        }
        pa.max(0.0)
    }
}

/// Pressure on the other side of an orifice with `pa` on the chamber side; 0 for a flow above the choked one.
fn behind_orifice(c: f64, flow: f64, pa: f64) -> f64 {
    let throat = flow / c;
    if flow > 0.0 {
        // Upstream of the chamber: subsonic, or choked.
        let subsonic = pa + throat * throat / pa;
        return if subsonic <= 2.0 * pa { subsonic } else { 2.0 * throat };
    }
    let root = pa * pa / 4.0 - throat * throat;
    if root < 0.0 { 0.0 } else { pa / 2.0 + root.sqrt() }
}

/// A volume shared by the exhausts of both chambers or by the supplies of both axes; SI.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) volume_m3: f64,
    pub(super) outside_pa: f64,
    pub(super) flow_law: FlowLaw,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum FlowLaw {
    /// An orifice of this conductance, m^3/s per Pa.
    Orifice(f64),
    /// A flow in proportion to the difference, m^3/s per Pa.
    Linear(f64),
    /// Sintered bronze: same choked flow as the orifice of this conductance, but choked only below [`SINTERED_RATIO`].
    Sintered(f64),
    /// A flow proportional to the square of the difference: this flow, m^3/s, at this difference, Pa.
    Quadratic(f64, f64),
    /// Darcy's law: a flow proportional to the difference of the squared pressures, equal to that of the orifice of this
    /// conductance at twice the outside pressure.
    Porous(f64),
}

impl Node {
    /// The supply node behind a regulator whose pressure falls by `droop_pa` at the flow of one full supply edge.
    pub(super) fn supply(numbers: &Numbers, [droop_pa, volume_m3]: [f64; 2], form: Form) -> Self {
        let (full, set_pa) = (numbers.full_flow_m3_per_s(), numbers.supply_pa);
        let flow_law = match form {
            Form::Catalogue => FlowLaw::Orifice(full / (droop_pa * (set_pa - droop_pa)).sqrt()),
            Form::Near => FlowLaw::Linear(full / (LINEAR_SHARE * droop_pa)),
            Form::Far => FlowLaw::Quadratic(full, LINEAR_SHARE * droop_pa),
        };
        Node { volume_m3, outside_pa: set_pa, flow_law }
    }

    /// The volume behind both exhaust edges, vented by a silencer of `kv_ratio` times the exhaust edge.
    pub(super) fn silencer(numbers: &Numbers, [kv_ratio, volume_m3]: [f64; 2], form: Form) -> Self {
        let c = kv_ratio * numbers.exhaust_edge_m3_per_s_pa[numbers.opening.len() - 1];
        let outside_pa = numbers.exhaust_pa;
        let flow_law = match form {
            Form::Catalogue => FlowLaw::Orifice(c),
            Form::Near => FlowLaw::Sintered(c),
            Form::Far => FlowLaw::Porous(c),
        };
        Node { volume_m3, outside_pa, flow_law }
    }

    /// Normal flow from outside into the node, m^3/s.
    #[inline(always)]
    pub(super) fn inflow(&self, node_pa: f64) -> f64 {
        match self.flow_law {
            FlowLaw::Orifice(c) => flow(c, self.outside_pa, node_pa),
            FlowLaw::Linear(per_pa) => per_pa * (self.outside_pa - node_pa),
            FlowLaw::Quadratic(flow, at_pa) => {
                let share = (self.outside_pa - node_pa) / at_pa;
                flow * share * share.abs()
            }
            FlowLaw::Porous(c) => {
                let outside_pa = self.outside_pa;
                c / (3.0 * outside_pa) * (outside_pa * outside_pa - node_pa * node_pa)
            }
            FlowLaw::Sintered(c) => {
                let (up, down) = (self.outside_pa.max(node_pa), self.outside_pa.min(node_pa));
                let beyond = ((down / up - SINTERED_RATIO) / (1.0 - SINTERED_RATIO)).max(0.0);
                let share = (1.0 - beyond * beyond).max(0.0).sqrt();
                (c * up / 2.0 * share).copysign(self.outside_pa - node_pa)
            }
        }
    }
}

/// Critical pressure ratio of the near form's silencer.
const SINTERED_RATIO: f64 = 0.2;
/// The near and far forms' regulator falls by this share of the droop at full flow. On average it then equals an orifice, whose
/// drop grows with the square of the flow.
const LINEAR_SHARE: f64 = 0.6;
