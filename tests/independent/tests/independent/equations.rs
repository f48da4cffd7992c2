//! The rig with its smooth effects as one system of ordinary differential equations, written from rig-model.md and the laws at
//! the heads of the effects' files, in pressures, masses of gas and each axis' own extension.
//!
//! It shares no formula with the plant, and where there is a choice it takes another: pressure and mass of gas where the plant
//! has p V, the ellipse of ISO 6358 with b where the plant adds a term to eq. (4), bisection for the flow through a port.
//! Valid while no piston rests or turns, none meets an end, and no chamber meets the bounds of the flow lag.

use super::numbers::*;

/// States of one axis.
pub(crate) const X: usize = 0;
pub(crate) const V: usize = 1;
pub(crate) const SPOOL: usize = 2;
pub(crate) const SPOOL_RATE: usize = 3;
pub(crate) const P: [usize; 2] = [4, 5];
pub(crate) const GAS_MASS: [usize; 2] = [6, 7];
pub(crate) const Q: [usize; 2] = [8, 9];
pub(crate) const P_SILENCER: usize = 10;
pub(crate) const BRISTLE: usize = 11;
/// What the lagging sensors of position and of both pressures show.
pub(crate) const SHOWN: [usize; 3] = [12, 13, 14];
pub(crate) const AXIS: usize = 15;
/// The supply node, after both axes.
pub(crate) const P_NODE: usize = 2 * AXIS;
pub(crate) const STATES: usize = P_NODE + 1;

/// The system over a span of time in which the spools' targets are held.
#[derive(Debug, Clone)]
pub(crate) struct System<'n> {
    pub(crate) numbers: &'n Numbers,
    pub(crate) target: [f64; 2],
    pub(crate) linked: bool,
    pub(crate) added_mass: f64,
}

/// Straight lines through the table.
fn kv(table: &[f64; 6], opening: f64) -> f64 {
    let i = (1..5).find(|&i| opening <= OPENING[i]).unwrap_or(5);
    let share = (opening - OPENING[i - 1]) / (OPENING[i] - OPENING[i - 1]);
    table[i - 1] + share * (table[i] - table[i - 1])
}

/// Normal flow through an orifice with critical ratio b, m^3/s, by effects.md's first line.
fn orifice(kv: f64, b: f64, from: f64, to: f64) -> f64 {
    let (up, down) = (from.max(to) / 1e5, from.min(to) / 1e5);
    let beyond = ((down / up - b) / (1.0 - b)).max(0.0);
    let per_hour = 12.95 * kv * up * (1.0 - beyond * beyond).max(0.0).sqrt();
    per_hour / 3600.0 * (from - to).signum()
}

impl System<'_> {
    pub(crate) fn mass(&self, axis: usize) -> f64 {
        MASS[axis] + if axis == 0 { self.added_mass } else { 0.0 }
    }

    pub(crate) fn volume(&self, axis: usize, chamber: usize, x: f64) -> f64 {
        self.numbers.axes[axis].dead_volume + AREA[chamber] * [x, STROKE - x][chamber]
    }

    /// K_V of the supply edges and of the exhaust edges, each to chambers a and b.
    fn edges(&self, axis: usize, spool: f64) -> [[f64; 2]; 2] {
        let n = &self.numbers.axes[axis];
        let open = ((spool.abs() - n.dead_zone) / (1.0 - n.dead_zone)).clamp(0.0, 1.0);
        let bent = (open + 2.0 * n.bend * open * (1.0 - open)).clamp(0.0, 1.0);
        let supply = kv(&KV_SUPPLY, bent) * (1.0 + n.edge_ratio / 2.0);
        let exhaust = kv(&KV_EXHAUST, bent) * (1.0 - n.edge_ratio / 2.0);
        let least = [n.floor * KV_SUPPLY[5], n.floor * KV_EXHAUST[5]];
        let (supply, exhaust) =
            if spool > 0.0 { ([supply, 0.0], [0.0, exhaust]) } else { ([0.0, supply], [exhaust, 0.0]) };
        [supply.map(|kv| kv.max(least[0])), exhaust.map(|kv| kv.max(least[1]))]
    }

    /// What the port's pressure has above the chamber's at a flow.
    fn drops(&self, axis: usize, chamber: usize, x: f64, p: f64, q: f64) -> f64 {
        let n = &self.numbers.axes[axis];
        let q_full = 12.95 * KV_SUPPLY[5] * (P_SUPPLY / 1e5) / 3600.0;
        let mut drop = n.line_drop * (q * q.abs() / (q_full * q_full)) * (P_SUPPLY / 2.0 / p);
        drop += q.signum() * n.cracking;
        let root = |kv: f64| q.abs() * 3600.0 * 1e5 / (25.9 * kv);
        let series = root(n.series_kv);
        drop += if q > 0.0 {
            if series <= p { series * series / p } else { 2.0 * series - p }
        } else {
            -(p - (p * p - 4.0 * series * series).max(0.0).sqrt()) / 2.0
        };
        if let Some([kv, length, _]) = n.cushion
            && q < 0.0
            && [x, STROKE - x][chamber] < length
        {
            let cushion = root(kv);
            drop -= (p - (p * p - 4.0 * cushion * cushion).max(0.0).sqrt()) / 2.0;
            drop -= 1e3 * (cushion - p / 2.0).max(0.0);
        }
        drop
    }

    /// Flow into a chamber through its port, and what the supply edge and the exhaust edge bring of it.
    fn port(&self, axis: usize, chamber: usize, y: &[f64], p_supply: f64) -> [f64; 3] {
        let n = &self.numbers.axes[axis];
        let (x, p) = (y[X], y[P[chamber]]);
        let [supply, exhaust] = self.edges(axis, y[SPOOL]).map(|edges| edges[chamber]);
        let p_exhaust = y[P_SILENCER];
        let arriving = |p_port: f64| {
            [
                orifice(supply, n.critical_ratio, p_supply, p_port),
                orifice(exhaust, n.critical_ratio, p_exhaust, p_port),
            ]
        };
        let free: f64 = arriving(p).iter().sum();
        let at = |size: f64| p + self.drops(axis, chamber, x, p, size * free.signum());
        let (mut low, mut high) = (0.0, free.abs());
        if free != 0.0 && (at(high) - p).abs() > 0.0 {
            for _ in 0..70 {
                let middle = 0.5 * (low + high);
                let more = arriving(at(middle)).iter().sum::<f64>() * free.signum() > middle;
                if more { low = middle } else { high = middle }
            }
        } else {
            low = high;
        }
        let flow = 0.5 * (low + high);
        let [from_supply, from_exhaust] = arriving(at(flow));
        [flow * free.signum(), from_supply, from_exhaust]
    }

    /// Levels of sliding friction and of breaking away.
    fn levels(&self, axis: usize, y: &[f64]) -> [f64; 2] {
        let n = &self.numbers.axes[axis];
        let (x, v) = (y[X], y[V]);
        let [bump, centre, width, slope, ripple, pitch] = n.friction_over_x;
        let both = n.pressure_slope * (y[P[0]] + y[P[1]] - 2.0 * P_ATMOSPHERE).max(0.0)
            + bump * (-((x - centre) / width).powi(2)).exp()
            + slope * (x - STROKE / 2.0) / (STROKE / 2.0)
            + ripple * (std::f64::consts::TAU * x / pitch).sin();
        let sided = 1.0 + n.asymmetry * v.signum();
        let stribeck = |speed: f64| {
            let falls = |[v_s, exponent]: [f64; 2]| (-(speed / v_s).powf(exponent)).exp();
            (F_STATIC - F_SLIDING) * n.stribeck.map_or(0.0, falls)
        };
        let sliding = |speed: f64| (F_SLIDING * sided + both + stribeck(speed)).max(0.0);
        [sliding(v.abs()), (F_STATIC * sided + both).max(sliding(0.0))]
    }

    /// Force of the bristles against the motion, and their rate.
    pub(crate) fn bristles(&self, axis: usize, y: &[f64]) -> [f64; 2] {
        let Some(stiffness) = self.numbers.axes[axis].bristle_stiffness else { return [0.0; 2] };
        let (v, z) = (y[V], y[BRISTLE]);
        let [sliding, break_away] = self.levels(axis, y);
        let g = sliding + (break_away - sliding) * (-(v / 1e-3).powi(2)).exp();
        let rate = v - v.abs() * stiffness * z / g;
        let at_rest = 1.4 * (stiffness * self.mass(axis)).sqrt();
        [stiffness * z + at_rest * g / (g + at_rest * v.abs()) * rate, rate]
    }

    pub(crate) fn contact(&self, y: &[f64]) -> f64 {
        let (drive, load) = (&y[..AXIS], &y[AXIS..2 * AXIS]);
        let distance = STROKE - load[X] - drive[X];
        let beyond = (distance.abs() - self.numbers.gap / 2.0).max(0.0) * distance.signum();
        if !self.linked || beyond == 0.0 {
            return 0.0;
        }
        let force = self.numbers.stiffness * beyond + self.numbers.damping * (-load[V] - drive[V]);
        if force * beyond > 0.0 { force } else { 0.0 }
    }

    pub(crate) fn acceleration(&self, axis: usize, whole: &[f64]) -> f64 {
        let n = &self.numbers.axes[axis];
        let y = &whole[AXIS * axis..AXIS * (axis + 1)];
        let (x, v) = (y[X], y[V]);
        let along_x = [1.0, -1.0][axis];
        let position = [x, STROKE - x][axis];
        let [spring, ripple, pitch] = n.force_over_x;
        let over_x = -spring * (position - STROKE / 2.0) / (STROKE / 2.0)
            + ripple * (std::f64::consts::TAU * position / pitch).sin();
        let buffer = |to_end: f64| n.cushion.map_or(0.0, |[_, _, k]| k * (1e-3 - to_end).max(0.0));
        let friction = match n.bristle_stiffness {
            Some(_) => self.bristles(axis, y)[0],
            None => self.levels(axis, y)[0] * v.signum(),
        };
        let force = y[P[0]] * AREA[0]
            - y[P[1]] * AREA[1]
            - P_ATMOSPHERE * (AREA[0] - AREA[1])
            - VISCOUS * (1.0 + n.asymmetry * v.signum()) * v
            - friction
            + along_x * (n.inclination + over_x)
            + buffer(x)
            - buffer(STROKE - x)
            + self.contact(whole);
        force / self.mass(axis)
    }

    pub(crate) fn rates(&self, y: &[f64], rate: &mut [f64]) {
        let mut drawn = 0.0;
        for axis in 0..2 {
            let n = &self.numbers.axes[axis];
            let axis_state = &y[AXIS * axis..AXIS * (axis + 1)];
            let out = &mut rate[AXIS * axis..AXIS * (axis + 1)];
            let (x, v) = (axis_state[X], axis_state[V]);
            out[X] = v;
            out[V] = self.acceleration(axis, y);
            let error = self.target[axis] - axis_state[SPOOL];
            (out[SPOOL], out[SPOOL_RATE]) = match n.second_order {
                Some([w, z]) => {
                    (axis_state[SPOOL_RATE], w * w * error - 2.0 * z * w * axis_state[SPOOL_RATE])
                }
                None => (error / TAU_VALVE, 0.0),
            };
            let ports = [0, 1].map(|chamber| self.port(axis, chamber, axis_state, y[P_NODE]));
            drawn += ports[0][1] + ports[1][1];
            out[P_SILENCER] = n.silencer.map_or(0.0, |[ratio, volume]| {
                let leaves = orifice(ratio * KV_EXHAUST[5], 0.5, axis_state[P_SILENCER], P_EXHAUST);
                P_NORMAL / volume * (-ports[0][2] - ports[1][2] - leaves)
            });
            let across = n.leak[0] * (axis_state[P[0]].powi(2) - axis_state[P[1]].powi(2));
            for chamber in 0..2 {
                let p = axis_state[P[chamber]];
                let out_of_seal = n.leak[1 + chamber] * (p * p - P_ATMOSPHERE * P_ATMOSPHERE);
                let net = axis_state[Q[chamber]] + [-across, across][chamber] - out_of_seal;
                let volume = self.volume(axis, chamber, x);
                let swept = [1.0, -1.0][chamber] * AREA[chamber] * v;
                let mass_flow = P_NORMAL * net / (GAS * T_WALL);
                out[Q[chamber]] = (ports[chamber][0] - axis_state[Q[chamber]]) / TAU_FLOW;
                out[GAS_MASS[chamber]] = mass_flow;
                out[P[chamber]] = match n.heat {
                    None => (P_NORMAL * net - p * swept) / volume,
                    Some(h) => {
                        // Energy: c_v d(m T)/dt, with m T = p V / R.
                        let temperature = p * volume / (axis_state[GAS_MASS[chamber]] * GAS);
                        let carried = if net > 0.0 { T_WALL } else { temperature };
                        let area = AREA[chamber];
                        let wall = 2.0 * area + 2.0 * (std::f64::consts::PI / area).sqrt() * volume;
                        let power = C_P * carried * mass_flow - p * swept + h * wall * (T_WALL - temperature);
                        (power * GAS / C_V - p * swept) / volume
                    }
                };
            }
            out[BRISTLE] = self.bristles(axis, axis_state)[1];
            let truths = [[x, STROKE - x][axis], axis_state[P[0]], axis_state[P[1]]];
            for (i, lag) in [n.lag[0], n.lag[2], n.lag[3]].into_iter().enumerate() {
                out[SHOWN[i]] = if lag > 0.0 { (truths[i] - axis_state[SHOWN[i]]) / lag } else { 0.0 };
            }
        }
        rate[P_NODE] = self.numbers.droop.map_or(0.0, |[droop, volume]| {
            let full = 12.95 * KV_SUPPLY[5] * (P_SUPPLY / 1e5);
            let under = P_SUPPLY - droop;
            let kv = full / (25.9 * (droop * under).sqrt() / 1e5);
            P_NORMAL / volume * (orifice(kv, 0.5, P_SUPPLY, y[P_NODE]) - drawn)
        });
    }
}
