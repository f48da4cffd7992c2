//! An independent reference of the rig: explicit Runge-Kutta of order four with tiny steps, written straight from
//! rig-model.md in pressures and rig coordinates, sharing no code and no parameter file with the crate.
//!
//! It is slow and plain on purpose: what it shares with the plant is the model's page. Corners are met by a regime
//! that is chosen before each step and corrected after it, so it is of first order there; at 0.5 us that is below
//! the sensors' noise by three decades. The same code with long steps, or with Euler's rule, is what the table of
//! schemes compares with.

#![allow(dead_code)] // each user needs a part of it

use plant::{Inputs, State};

const STROKE: f64 = 0.5;
const AREA_A: f64 = 1963.5e-6;
const AREA_B: f64 = 1649.3e-6;
const DEAD_VOLUME: f64 = 20e-6;
const P_NORMAL: f64 = 101_325.0;
const P_ATMOSPHERE: f64 = 101_325.0;
const P_EXHAUST: f64 = 101_325.0;
const P_SUPPLY: f64 = 7.0e5;
const P_CHECK_VALVE: f64 = 2.5e5;
const TAU_VALVE: f64 = 1.6e-3;
const TAU_FLOW: f64 = 8e-3;
const F_STATIC: f64 = 35.0;
const F_SLIDING: f64 = 26.0;
const VISCOUS: f64 = 1100.0;
const MASS: [f64; 2] = [5.0, 1.5];
const CARRIAGE: f64 = 3.5;
const GAP: f64 = 0.2e-3;
const STIFFNESS: f64 = 2e6;
const DAMPING: f64 = 2e3;
const OPENING: [f64; 6] = [0.0, 0.03, 0.2, 0.5, 0.8, 1.0];
const KV_SUPPLY: [f64; 6] = [0.0, 0.0, 0.115, 0.36, 0.60, 0.66];
const KV_EXHAUST: [f64; 6] = [0.0, 0.0, 0.095, 0.30, 0.52, 0.58];

/// How a step is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Method {
    Euler,
    /// The classical Runge-Kutta rule of order four.
    RungeKutta4,
}

/// One axis in rig coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ReferenceAxis {
    pub(crate) x: f64,
    pub(crate) v: f64,
    pub(crate) s: f64,
    pub(crate) p_a: f64,
    pub(crate) p_b: f64,
    pub(crate) q_a: f64,
    pub(crate) q_b: f64,
}

/// What the sensors would show, without noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensorReadings {
    pub(crate) x: [f64; 2],
    pub(crate) force: [f64; 2],
    pub(crate) p_a: [f64; 2],
    pub(crate) p_b: [f64; 2],
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reference {
    pub(crate) axes: [ReferenceAxis; 2],
    pub(crate) supply: f64,
    pub(crate) stopped: bool,
    pub(crate) linked: bool,
    pub(crate) added: f64,
    /// Counts sticking, breaking away, reversing, stops at an end and contacts made.
    pub(crate) corners: u32,
}

#[derive(Clone, Copy)]
struct Regime {
    stuck: [bool; 2],
    /// In rig coordinates.
    direction: [f64; 2],
}

fn sign(value: f64) -> f64 {
    if value > 0.0 {
        1.0
    } else if value < 0.0 {
        -1.0
    } else {
        0.0
    }
}

fn kv(table: &[f64; 6], opening: f64) -> f64 {
    for i in 1..6 {
        if opening <= OPENING[i] {
            let share = (opening - OPENING[i - 1]) / (OPENING[i] - OPENING[i - 1]);
            return table[i - 1] + share * (table[i] - table[i - 1]);
        }
    }
    table[5]
}

/// Normal flow from `far` into the chamber, m^3/s; pressures in Pa.
pub(crate) fn flow(kv: f64, far: f64, chamber: f64) -> f64 {
    let (up, down) = if far >= chamber { (far / 1e5, chamber / 1e5) } else { (chamber / 1e5, far / 1e5) };
    let per_hour = if down >= up / 2.0 { 25.9 * kv * ((up - down) * down).sqrt() } else { 12.95 * kv * up };
    sign(far - chamber) * per_hour / 3600.0
}

impl Reference {
    pub(crate) fn from_state(state: &State) -> Self {
        let of_axis = |i: usize| {
            let axis = &state.axes[i];
            ReferenceAxis {
                x: if i == 0 { axis.extension_m } else { STROKE - axis.extension_m },
                v: if i == 0 { axis.rod_velocity_m_per_s } else { -axis.rod_velocity_m_per_s },
                s: axis.spool,
                p_a: axis.stored_air_a_j / (DEAD_VOLUME + AREA_A * axis.extension_m),
                p_b: axis.stored_air_b_j / (DEAD_VOLUME + AREA_B * (STROKE - axis.extension_m)),
                q_a: axis.flow_a_m3_per_s,
                q_b: axis.flow_b_m3_per_s,
            }
        };
        Reference {
            axes: [of_axis(0), of_axis(1)],
            supply: state.supply_pressure_pa,
            stopped: state.emergency_stop,
            linked: state.linked,
            added: state.added_mass_kg,
            corners: 0,
        }
    }

    /// Advances by 1 ms in the given number of steps.
    pub(crate) fn advance(&mut self, inputs: &Inputs, steps: u32, method: Method) {
        let h = 1e-3 / f64::from(steps);
        for _ in 0..steps {
            self.one_step(inputs, h, method);
        }
    }

    pub(crate) fn readings(&self, inputs: &Inputs) -> SensorReadings {
        let contact = self.contact();
        let regime = self.regime(inputs);
        let acceleration = self.acceleration(inputs, 0, &regime);
        let drive = (CARRIAGE + self.added) * acceleration - contact - inputs.hand_force_carriage_n;
        SensorReadings {
            x: self.axes.map(|axis| axis.x),
            force: [drive, -contact + inputs.hand_force_load_n],
            p_a: self.axes.map(|axis| axis.p_a),
            p_b: self.axes.map(|axis| axis.p_b),
        }
    }

    fn contact(&self) -> f64 {
        if !self.linked {
            return 0.0;
        }
        let d = self.axes[1].x - self.axes[0].x;
        let rate = self.axes[1].v - self.axes[0].v;
        if d > GAP / 2.0 {
            (STIFFNESS * (d - GAP / 2.0) + DAMPING * rate).max(0.0)
        } else if d < -GAP / 2.0 {
            (STIFFNESS * (d + GAP / 2.0) + DAMPING * rate).min(0.0)
        } else {
            0.0
        }
    }

    fn mass(&self, i: usize) -> f64 {
        MASS[i] + if i == 0 { self.added } else { 0.0 }
    }

    /// Force in +x without sliding friction.
    fn force(&self, inputs: &Inputs, i: usize) -> f64 {
        let axis = &self.axes[i];
        let pneumatic = axis.p_a * AREA_A - axis.p_b * AREA_B - P_ATMOSPHERE * (AREA_A - AREA_B);
        let contact = self.contact();
        if i == 0 {
            pneumatic - VISCOUS * axis.v + contact + inputs.hand_force_carriage_n
        } else {
            -pneumatic - VISCOUS * axis.v - contact + inputs.hand_force_load_n
        }
    }

    fn regime(&self, inputs: &Inputs) -> Regime {
        let mut regime = Regime { stuck: [false; 2], direction: [0.0; 2] };
        for i in 0..2 {
            let axis = &self.axes[i];
            let force = self.force(inputs, i);
            if axis.v != 0.0 {
                regime.direction[i] = sign(axis.v);
            } else {
                let pressed = axis.x <= 0.0 && force < 0.0 || axis.x >= STROKE && force > 0.0;
                regime.stuck[i] = force.abs() <= F_STATIC || pressed;
                regime.direction[i] = sign(force);
            }
        }
        regime
    }

    fn acceleration(&self, inputs: &Inputs, i: usize, regime: &Regime) -> f64 {
        if regime.stuck[i] {
            return 0.0;
        }
        (self.force(inputs, i) - regime.direction[i] * F_SLIDING) / self.mass(i)
    }

    fn shut(&self) -> bool {
        self.supply < P_CHECK_VALVE
    }

    /// Time derivatives in the shape of the state.
    fn derivative(&self, inputs: &Inputs, regime: &Regime) -> [f64; 15] {
        let mut rate = [0.0; 15];
        for i in 0..2 {
            let axis = &self.axes[i];
            let u = if self.stopped { 0.0 } else { inputs.valve[i] };
            let (extension, speed) = if i == 0 { (axis.x, axis.v) } else { (STROKE - axis.x, -axis.v) };
            let speed = if regime.stuck[i] { 0.0 } else { speed };
            let (v_a, v_b) = (DEAD_VOLUME + AREA_A * extension, DEAD_VOLUME + AREA_B * (STROKE - extension));
            let (supply_kv, exhaust_kv) = (kv(&KV_SUPPLY, axis.s.abs()), kv(&KV_EXHAUST, axis.s.abs()));
            let (edge_a, edge_b) = if axis.s > 0.0 {
                (flow(supply_kv, self.supply, axis.p_a), flow(exhaust_kv, P_EXHAUST, axis.p_b))
            } else {
                (flow(exhaust_kv, P_EXHAUST, axis.p_a), flow(supply_kv, self.supply, axis.p_b))
            };
            let row = &mut rate[7 * i..7 * i + 7];
            row[0] = if regime.stuck[i] { 0.0 } else { axis.v };
            row[1] = self.acceleration(inputs, i, regime);
            row[2] = (u - axis.s) / TAU_VALVE;
            row[3] = (P_NORMAL * axis.q_a - axis.p_a * AREA_A * speed) / v_a;
            row[4] = (P_NORMAL * axis.q_b + axis.p_b * AREA_B * speed) / v_b;
            if !self.shut() {
                row[5] = (edge_a - axis.q_a) / TAU_FLOW;
                row[6] = (edge_b - axis.q_b) / TAU_FLOW;
            }
        }
        rate[14] =
            if self.stopped { (P_ATMOSPHERE - self.supply) / 0.05 } else { (P_SUPPLY - self.supply) / 0.3 };
        rate
    }

    fn moved(&self, rate: &[f64; 15], h: f64) -> Self {
        let mut next = *self;
        for (i, axis) in next.axes.iter_mut().enumerate() {
            let row = &rate[7 * i..7 * i + 7];
            axis.x += h * row[0];
            axis.v += h * row[1];
            axis.s += h * row[2];
            axis.p_a += h * row[3];
            axis.p_b += h * row[4];
            axis.q_a += h * row[5];
            axis.q_b += h * row[6];
        }
        next.supply += h * rate[14];
        next
    }

    fn one_step(&mut self, inputs: &Inputs, h: f64, method: Method) {
        let regime = self.regime(inputs);
        let k1 = self.derivative(inputs, &regime);
        let mut next = match method {
            Method::Euler => self.moved(&k1, h),
            Method::RungeKutta4 => {
                let k2 = self.moved(&k1, h / 2.0).derivative(inputs, &regime);
                let k3 = self.moved(&k2, h / 2.0).derivative(inputs, &regime);
                let k4 = self.moved(&k3, h).derivative(inputs, &regime);
                let mean: [f64; 15] =
                    std::array::from_fn(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
                self.moved(&mean, h)
            }
        };
        if (self.contact() == 0.0) != (next.contact() == 0.0) {
            next.corners += 1;
        }
        let shut = next.shut();
        for i in 0..2 {
            let before = &self.axes[i];
            let axis = &mut next.axes[i];
            if !regime.stuck[i] && axis.v * regime.direction[i] <= 0.0 {
                axis.v = 0.0;
            }
            if axis.x < 0.0 || axis.x > STROKE {
                axis.x = axis.x.clamp(0.0, STROKE);
                axis.v = 0.0;
            }
            if (before.v == 0.0) != (axis.v == 0.0) {
                next.corners += 1;
            }
            for (p, q) in [(axis.p_a, &mut axis.q_a), (axis.p_b, &mut axis.q_b)] {
                if shut || p <= P_EXHAUST && *q < 0.0 || p >= next.supply && *q > 0.0 {
                    *q = 0.0;
                }
            }
        }
        *self = next;
    }
}
