//! The valve of the record maker: command to spool, spool to four edges, an edge and two pressures to a flow.
//!
//! ```text
//!   command (late, shifted, with play) ─► target ─► spool, rate ─► opening (overlap) ─► c of both supply and both exhaust edges
//! ```
//!
//! Each law has the form of the catalogue and two others for the same phenomenon ([`Form`]); their tables are in
//! `tests/docs/record-maker.md`.

use super::Form;
use super::numbers::Numbers;
use plant::parameters::VALVE_POINTS;

/// Effects of the valve that are on; SI.
#[derive(Debug, Clone, Default)]
pub(super) struct ValveLaws {
    pub(super) form: Form,
    pub(super) offset: f64,
    pub(super) play: f64,
    pub(super) dead_zone: f64,
    pub(super) bend: f64,
    pub(super) edge_ratio: f64,
    pub(super) null_leakage: f64,
    /// Natural frequency in Hz and damping.
    pub(super) second_order: Option<[f64; 2]>,
    pub(super) rate_per_s: Option<f64>,
    pub(super) critical_ratio: Option<f64>,
}

/// Conductances of the four edges, m^3/s per Pa.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edges {
    pub(super) supply: [f64; 2],
    pub(super) exhaust: [f64; 2],
}

#[derive(Debug, Clone)]
pub(super) struct Valve {
    laws: ValveLaws,
    time_s: f64,
    opening: [f64; VALVE_POINTS],
    edges: [[f64; VALVE_POINTS]; 2],
}

/// State of the play between command and spool.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PlayState {
    command: f64,
    /// Lag of its output behind the command.
    lag: f64,
}

/// Spool position, its rate, and the third state that only the near form has.
pub(super) type Spool = [f64; 3];

impl Valve {
    pub(super) fn new(numbers: &Numbers, laws: ValveLaws) -> Self {
        let edges = [numbers.supply_edge_m3_per_s_pa, numbers.exhaust_edge_m3_per_s_pa];
        Valve { laws, time_s: numbers.spool_time_s, opening: numbers.opening, edges }
    }

    /// Target position of the spool for the acting command. To be called once a step, since it updates the play.
    pub(super) fn target(&self, command: f64, play: &mut PlayState, drift: f64) -> f64 {
        let moved = command - play.command;
        let half = self.laws.form.side(command > 0.0, SOLENOIDS_DIFFER) * self.laws.play;
        play.command = command;
        if half > 0.0 && self.laws.form == Form::Near && moved != 0.0 {
            // Coleman, Hodgdon 1986: the lag approaches the limit exponentially after a reversal.
            let side = half.copysign(moved);
            play.lag = side + (play.lag - side) * libm::exp(-moved.abs() / (PLAY_BEND * half));
        } else {
            play.lag = (play.lag + moved).clamp(-half, half);
        }
        (command - play.lag + self.laws.offset * drift).clamp(-1.0, 1.0)
    }

    /// Rates of the spool's states, 1/s.
    #[inline(always)]
    pub(super) fn spool_rates(&self, spool: Spool, target: f64) -> Spool {
        let [place, rate, third] = spool;
        let laws = &self.laws;
        let opens = (target - place) * place >= 0.0;
        let limit = |wanted: f64| match (laws.rate_per_s, laws.form) {
            (None, _) => wanted,
            (Some(most), Form::Near) => most * libm::tanh(wanted / most),
            (Some(most), form) => {
                let most = form.side(!opens, SPRING_HELPS) * most;
                wanted.clamp(-most, most)
            }
        };
        let Some([frequency_hz, damping]) = laws.second_order else {
            return [limit((target - place) / self.time_s), 0.0, 0.0];
        };
        let w = std::f64::consts::TAU * frequency_hz * laws.form.side(!opens, SPRING_SPEEDS);
        if laws.form == Form::Near {
            // The pilot stage ahead of it is a first-order lag; a stiffer slide compensates for its time.
            let (w, lag_s) = (FOREIGN_STIFFER * w, FOREIGN_PILOT / w);
            let pull = w * w * (third - place) - 2.0 * damping * w * rate;
            return [limit(rate), pull, (target - third) / lag_s];
        }
        [limit(rate), w * w * (target - place) - 2.0 * damping * w * rate, 0.0]
    }

    /// The four edges at a spool opening.
    #[inline(always)]
    pub(super) fn edges(&self, spool: f64) -> Edges {
        let laws = &self.laws;
        let mut opening = spool.abs().min(1.0);
        if laws.dead_zone > 0.0 {
            opening = self.beyond_overlap(opening, spool > 0.0);
        }
        let worn = laws.form.side(spool > 0.0, NOTCHES_DIFFER);
        let mut along = opening;
        if laws.bend != 0.0 {
            let o = opening;
            let bow = if laws.form == Form::Near {
                27.0 / 8.0 * o * (1.0 - o) * (1.0 - o)
            } else {
                2.0 * o * (1.0 - o)
            };
            along = (o + worn * laws.bend * bow).clamp(0.0, 1.0);
        }
        let [mut supply, mut exhaust] = self.table(along);
        if laws.edge_ratio != 0.0 {
            let fade = if laws.form == Form::Near { 1.2 * opening / (opening + 0.2) } else { worn };
            supply *= 1.0 + fade * laws.edge_ratio / 2.0;
            exhaust *= 1.0 - fade * laws.edge_ratio / 2.0;
        }
        let mut edges = if spool > 0.0 {
            Edges { supply: [supply, 0.0], exhaust: [0.0, exhaust] }
        } else {
            Edges { supply: [0.0, supply], exhaust: [exhaust, 0.0] }
        };
        if laws.null_leakage > 0.0 {
            let last = VALVE_POINTS - 1;
            let floors = [laws.null_leakage * self.edges[0][last], laws.null_leakage * self.edges[1][last]];
            for (edge, floor) in [(&mut edges.supply, floors[0]), (&mut edges.exhaust, floors[1])] {
                for (chamber, c) in edge.iter_mut().enumerate() {
                    *c = if laws.form == Form::Near {
                        (*c * *c + floor * floor).sqrt()
                    } else {
                        c.max(laws.form.side(chamber == 0, FLOORS_DIFFER) * floor)
                    };
                }
            }
        }
        edges
    }

    fn beyond_overlap(&self, opening: f64, extends: bool) -> f64 {
        let d = self.laws.dead_zone * self.laws.form.side(extends, OVERLAPS_DIFFER);
        if self.laws.form != Form::Near {
            return (opening - d).max(0.0) / (1.0 - d);
        }
        // A rounded edge: softplus of width d / 4, 0 at 0 and 1 at 1.
        let width = d / 4.0;
        let soft = |o: f64| {
            let over = (o - d) / width;
            // Beyond 40 widths the rounding of the edge is below the rounding of the number.
            if over > 40.0 { o - d } else { width * libm::log1p(libm::exp(over)) }
        };
        (soft(opening) - soft(0.0)) / (soft(1.0) - soft(0.0))
    }

    /// c of supply and exhaust edge at an opening in [0, 1].
    #[inline(always)]
    fn table(&self, opening: f64) -> [f64; 2] {
        let mut i = 0;
        while i + 2 < VALVE_POINTS && opening > self.opening[i + 1] {
            i += 1;
        }
        let share = (opening - self.opening[i]) / (self.opening[i + 1] - self.opening[i]);
        [0, 1].map(|edge| self.edges[edge][i] + share * (self.edges[edge][i + 1] - self.edges[edge][i]))
    }

    /// Normal flow through an edge of conductance `c` into the chamber, m^3/s; pressures absolute, Pa.
    #[inline(always)]
    pub(super) fn flow(&self, chamber: usize, c: f64, far_pa: f64, port_pa: f64) -> f64 {
        if c == 0.0 {
            return 0.0;
        }
        match self.laws.critical_ratio {
            None => flow(c, far_pa, port_pa),
            Some(b) => {
                let b = if self.laws.form.is_far() {
                    (0.5 - self.laws.form.side(chamber == 0, PORTS_DIFFER) * (0.5 - b)).max(0.0)
                } else {
                    b
                };
                let (up, down) = if far_pa > port_pa { (far_pa, port_pa) } else { (port_pa, far_pa) };
                let beyond = (down / up - b) / (1.0 - b);
                let under = (1.0 - beyond * beyond).max(0.0);
                let share = match (beyond > 0.0, self.laws.form == Form::Near) {
                    (false, _) => 1.0,
                    (true, false) => under.sqrt(),
                    (true, true) => libm::pow(under, 0.5 + SUBSONIC_SHIFT * (0.5 - b)),
                };
                (c * up / 2.0 * share).copysign(far_pa - port_pa)
            }
        }
    }
}

/// Length over which the near form's play closes, in half-widths.
const PLAY_BEND: f64 = 0.5;
/// Exponent of the near form's flow, the subsonic index m of ISO 6358-3: 0.5 plus this share of 0.5 - b.
const SUBSONIC_SHIFT: f64 = 0.15;
/// The near form's spool: natural frequency of its slide over that of the catalogue, and lag of its pilot in units of 1/w.
const FOREIGN_STIFFER: f64 = 1.15;
const FOREIGN_PILOT: f64 = 0.25;
/// The far forms: lands worn more in one direction, unequal ports, and a spring that helps the spool to close and opposes its
/// opening; each is the share by which one side is larger and the other smaller.
const SOLENOIDS_DIFFER: f64 = 0.5;
const NOTCHES_DIFFER: f64 = 0.42;
const OVERLAPS_DIFFER: f64 = 0.65;
const FLOORS_DIFFER: f64 = 0.6;
const PORTS_DIFFER: f64 = 0.75;
const SPRING_HELPS: f64 = 0.5;
const SPRING_SPEEDS: f64 = 0.22;

/// Eq. (4) of the paper as one formula; pressures absolute, Pa, c in m^3/s per Pa.
#[inline(always)]
pub(super) fn flow(c: f64, far_pa: f64, port_pa: f64) -> f64 {
    let (up, down) = if far_pa > port_pa { (far_pa, port_pa) } else { (port_pa, far_pa) };
    let throat = down.max(0.5 * up);
    (c * ((up - throat) * throat).sqrt()).copysign(far_pa - port_pa)
}
