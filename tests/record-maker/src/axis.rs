//! One axis of the record maker: its state and the rates of change.
//!
//! ```text
//!   spool ─► edges ─► flow at the valve ─► (line) ─► lagged flow q ─► air M = p V ─► pressures ─► force ─► motion
//! ```
//!
//! The air of a chamber has two states: M = p V, and N, its normal volume times p_N, which is M at the temperature of the rig.
//! Both change alike while the gas is isothermal; otherwise their ratio is T / T_0.

use super::Form;
use super::motion::{FrictionState, Motion};
use super::numbers::Numbers;
use super::port::{Node, Ports};
use super::valve::Valve;

/// Indices into [`Y`].
pub(super) const X: usize = 0;
pub(super) const V: usize = 1;
pub(super) const SPOOL: usize = 2;
/// M of chamber a; chamber b follows. The same holds for the next three.
pub(super) const AIR: usize = 5;
pub(super) const NORMAL: usize = 7;
pub(super) const FLOW: usize = 9;
pub(super) const LINE: usize = 11;
pub(super) const EXHAUST: usize = 13;

/// The smooth state: extension m, velocity m/s, spool (three), M J (two), N J (two), q m^3/s (two), flow out of the line m^3/s
/// (two), pressure behind the exhausts Pa.
pub(super) type Y = [f64; 14];

/// Heat, leakage and volumes; SI.
#[derive(Debug, Clone, Default)]
pub(super) struct AirLaws {
    pub(super) form: Form,
    /// Heat transfer coefficient, W/(m^2 K).
    pub(super) heat_w_per_m2_k: Option<f64>,
    /// Normal flow past the piston from 6 to 1 bar, m^3/s.
    pub(super) piston_leakage: f64,
    pub(super) rod_leakage: [f64; 2],
    /// Replaces the baseline's dead volume, m^3.
    pub(super) dead_volume_m3: Option<f64>,
    /// Travel time of the line, s.
    pub(super) line_delay_s: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) numbers: Numbers,
    pub(super) valve: Valve,
    pub(super) ports: Ports,
    pub(super) silencer: Option<Node>,
    pub(super) laws: AirLaws,
    pub(super) motion: Motion,
    dead_m3: [f64; 2],
}

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Air {
    pub(super) pressure_pa: [f64; 2],
    pub(super) volume_m3: [f64; 2],
    /// Flow through the valve into each chamber, m^3/s.
    pub(super) edge_flow: [f64; 2],
    /// Drawn from the supply and given to the exhaust, m^3/s.
    pub(super) drawn: f64,
    pub(super) vented: f64,
    pub(super) exhaust_pa: f64,
    pub(super) force_n: f64,
}

/// R / c_v and c_p / c_v of air.
const GAS_PER_HEAT: f64 = 287.0 / 718.0;
const GAMMA: f64 = 1005.0 / 718.0;
const GAS_CONSTANT: f64 = 287.0;
const HEAT_CAPACITY: f64 = 718.0;
/// Polytropic exponent of the near and far forms: measured exponents lie between isothermal and adiabatic.
const POLYTROPE: f64 = 1.28;
/// Leakages are stated for flow from 6 bar to 1 bar absolute, Pa.
const LEAKS_FROM_PA: f64 = 6e5;
const LEAKS_TO_PA: f64 = 1e5;
/// Share of the near form's line delay that is a first-order lag.
pub(super) const LINE_LAG_SHARE: f64 = 0.25;
/// Share by which the far form's line to chamber a is longer, and that to b shorter.
pub(super) const LINES_DIFFER: f64 = 0.5;
/// Share by which the forms make the change of dead volume larger in chamber a, and smaller in b.
const DEAD_SHIFT: [f64; 3] = [0.0, 0.2, 0.75];
/// The far forms' leaks of piston and rod are larger by this share at mid-stroke, and smaller at the ends.
const PISTON_WORN: f64 = 0.45;
const ROD_WORN: f64 = 0.52;

impl Axis {
    pub(super) fn new(
        numbers: &Numbers,
        valve: Valve,
        ports: Ports,
        silencer: Option<Node>,
        laws: AirLaws,
        motion: Motion,
    ) -> Self {
        let file_m3 = numbers.dead_volume_m3;
        let more_m3 = laws.dead_volume_m3.map_or(0.0, |changed_m3| changed_m3 - file_m3);
        let shift = laws.form.of(DEAD_SHIFT);
        // Where the dead volume is close to zero, a shift must not make a chamber's volume negative.
        let dead_m3 = [1.0 + shift, 1.0 - shift].map(|share| (file_m3 + share * more_m3).max(2e-6));
        Axis { numbers: numbers.clone(), valve, ports, silencer, laws, motion, dead_m3 }
    }

    /// State at rest at an extension, m, with the initial pressures.
    pub(super) fn start(&self, extension_m: f64) -> Y {
        let mut y = [0.0; 14];
        y[X] = extension_m;
        let volume = self.volumes(extension_m);
        let pressure = [self.numbers.start_a_pa(), self.numbers.start_b_pa];
        for chamber in 0..2 {
            y[AIR + chamber] = pressure[chamber] * volume[chamber];
            y[NORMAL + chamber] = y[AIR + chamber];
        }
        y[EXHAUST] = self.numbers.exhaust_pa;
        y
    }

    pub(super) fn areas(&self) -> [f64; 2] {
        [self.numbers.piston_m2, self.numbers.annulus_m2]
    }

    /// Both volumes, m^3; a trial step beyond the ends of the stroke is clamped to it.
    #[inline(always)]
    pub(super) fn volumes(&self, extension_m: f64) -> [f64; 2] {
        let x = extension_m.clamp(0.0, self.numbers.stroke_m);
        let [a, b] = self.areas();
        [self.dead_m3[0] + a * x, self.dead_m3[1] + b * (self.numbers.stroke_m - x)]
    }

    #[inline(always)]
    pub(super) fn air(&self, y: &Y, supply_pa: f64) -> Air {
        let volume_m3 = self.volumes(y[X]);
        let pressure_pa = [y[AIR] / volume_m3[0], y[AIR + 1] / volume_m3[1]];
        let exhaust_pa = if self.silencer.is_some() { y[EXHAUST] } else { self.numbers.exhaust_pa };
        let edges = self.valve.edges(y[SPOOL]);
        let to_end = [y[X], self.numbers.stroke_m - y[X]];
        let mut air = Air {
            pressure_pa,
            volume_m3,
            edge_flow: [0.0; 2],
            drawn: 0.0,
            vented: 0.0,
            exhaust_pa,
            force_n: 0.0,
        };
        for chamber in 0..2 {
            let (from_supply, from_exhaust) = (edges.supply[chamber], edges.exhaust[chamber]);
            let through = |port_pa: f64| {
                self.valve.flow(chamber, from_supply, supply_pa, port_pa)
                    + self.valve.flow(chamber, from_exhaust, exhaust_pa, port_pa)
            };
            let (port_pa, total) =
                self.ports.pressure(chamber, [pressure_pa[chamber], to_end[chamber]], through);
            air.edge_flow[chamber] = total;
            let drawn = match (from_supply > 0.0, from_exhaust > 0.0) {
                (true, false) => total,
                (false, _) => 0.0,
                (true, true) => self.valve.flow(chamber, from_supply, supply_pa, port_pa),
            };
            air.drawn += drawn;
            air.vented -= total - drawn;
        }
        let [area_a, area_b] = self.areas();
        let rod_n = self.numbers.atmospheric_pa * (area_a - area_b);
        air.force_n = pressure_pa[0] * area_a - pressure_pa[1] * area_b - rod_n;
        air
    }

    /// What friction depends on at a state.
    #[inline(always)]
    pub(super) fn at(&self, y: &Y, air: &Air, rest_s: f64, last_break_away: [f64; 2]) -> FrictionState {
        let gauge_pa = air.pressure_pa[0] + air.pressure_pa[1] - 2.0 * self.numbers.atmospheric_pa;
        let across_pa = air.pressure_pa[0] - air.pressure_pa[1];
        FrictionState { extension_m: y[X], gauge_pa, across_pa, rest_s, last_break_away }
    }

    /// Rates of everything but x and v. `line` is the flow out of the lines towards the chambers, m^3/s.
    #[inline(always)]
    pub(super) fn rates(&self, y: &Y, air: &Air, supply_pa: f64, target: f64, line: [f64; 2]) -> Y {
        let numbers = &self.numbers;
        let mut rates = [0.0; 14];
        let spool = self.valve.spool_rates([y[SPOOL], y[SPOOL + 1], y[SPOOL + 2]], target);
        rates[SPOOL..SPOOL + 3].copy_from_slice(&spool);
        let leaks = self.leaks(air, y[X]);
        let areas = self.areas();
        let swept = [areas[0] * y[V], -areas[1] * y[V]];
        for chamber in 0..2 {
            let (pressure, q) = (air.pressure_pa[chamber], y[FLOW + chamber]);
            let mut arrives = line[chamber];
            if self.laws.form == Form::Near && self.laws.line_delay_s > 0.0 {
                arrives = y[LINE + chamber];
                rates[LINE + chamber] = (line[chamber] - arrives) / (LINE_LAG_SHARE * self.laws.line_delay_s);
            }
            rates[FLOW + chamber] = (arrives - q) / numbers.flow_lag_s;
            let stopped = pressure <= air.exhaust_pa && q < 0.0 || pressure >= supply_pa && q > 0.0;
            let net = if stopped { 0.0 } else { q } + leaks[chamber];
            rates[NORMAL + chamber] = numbers.normal_pa * net;
            rates[AIR + chamber] = match self.laws.heat_w_per_m2_k {
                None => numbers.normal_pa * net,
                Some(h) => self.warm(h, y, air, (chamber, net, swept[chamber])),
            };
        }
        if let Some(silencer) = &self.silencer {
            let net = air.vented + silencer.inflow(air.exhaust_pa);
            rates[EXHAUST] = numbers.normal_pa * net / silencer.volume_m3;
        }
        rates
    }

    /// Leakage into each chamber, m^3/s.
    #[inline(always)]
    fn leaks(&self, air: &Air, extension_m: f64) -> [f64; 2] {
        let laws = &self.laws;
        let worn = |share: f64| {
            if !laws.form.is_far() {
                return 1.0;
            }
            // The bore is worn most where the piston runs most.
            let turns = extension_m / self.numbers.stroke_m;
            1.0 - share * libm::cos(std::f64::consts::TAU * turns)
        };
        let [a, b] = air.pressure_pa;
        let across = worn(PISTON_WORN) * self.leak(laws.piston_leakage, a, b);
        let out = [0, 1].map(|chamber| {
            worn(ROD_WORN)
                * self.leak(laws.rod_leakage[chamber], air.pressure_pa[chamber], self.numbers.atmospheric_pa)
        });
        [-across - out[0], across - out[1]]
    }

    /// Leakage of a seal from one pressure to another, m^3/s.
    #[inline(always)]
    fn leak(&self, given: f64, from_pa: f64, to_pa: f64) -> f64 {
        if given == 0.0 {
            0.0
        } else if self.laws.form.is_foreign() {
            // A scratch is an orifice: choked from 6 to 1 bar, where the flow is c p / 2.
            super::valve::flow(given / (LEAKS_FROM_PA / 2.0), from_pa, to_pa)
                * if from_pa == to_pa { 0.0 } else { 1.0 }
        } else {
            let squares = LEAKS_FROM_PA * LEAKS_FROM_PA - LEAKS_TO_PA * LEAKS_TO_PA;
            given / squares * (from_pa * from_pa - to_pa * to_pa)
        }
    }

    /// dM/dt of gas whose temperature varies, W.
    fn warm(&self, h: f64, y: &Y, air: &Air, (chamber, net, swept): (usize, f64, f64)) -> f64 {
        let numbers = &self.numbers;
        let (pressure, volume) = (air.pressure_pa[chamber], air.volume_m3[chamber]);
        let (gas, normal) = (y[AIR + chamber], y[NORMAL + chamber]);
        let work = GAS_PER_HEAT * pressure * swept;
        if self.laws.form.is_foreign() {
            // Polytropic changes that relax with a fixed time constant: that of half a stroke at the initial pressure.
            let area = self.areas()[chamber];
            let mid_m3 = self.dead_m3[chamber] + area * numbers.stroke_m / 2.0;
            let mass_kg = numbers.start_b_pa * mid_m3 / (GAS_CONSTANT * numbers.temperature_k);
            let relaxes_s = mass_kg * HEAT_CAPACITY / (h * wetted_m2(area, mid_m3));
            let work = (POLYTROPE - 1.0) * pressure * swept;
            return POLYTROPE * numbers.normal_pa * net - work - (gas - normal) / relaxes_s;
        }
        let ratio = gas / normal;
        let carried = if net > 0.0 { 1.0 } else { ratio };
        let wall_w = h * wetted_m2(self.areas()[chamber], volume) * numbers.temperature_k * (1.0 - ratio);
        GAMMA * carried * numbers.normal_pa * net - work + GAS_PER_HEAT * wall_w
    }
}

/// Wall that a gas volume over a piston of this area touches, m^2.
fn wetted_m2(area_m2: f64, volume_m3: f64) -> f64 {
    let bore_m = (4.0 * area_m2 / std::f64::consts::PI).sqrt();
    2.0 * area_m2 + std::f64::consts::PI * bore_m * volume_m3 / area_m2
}
