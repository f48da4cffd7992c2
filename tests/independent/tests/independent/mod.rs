//! The plant's smooth effects against an independent solver: motions, who is on in them, and the differences.
//!
//! [`equations`] is the rig with its effects as one system of ordinary differential equations, [`solution`] lets ode_solvers
//! solve it, and here both follow the same commands from the same state. Smooth is what such a system can have: all effects but
//! `spool-rate-limit` (a corner of its own), `line-delay` (an equation with a delay) and
//! `rest-time-dependent-break-away` (acts on what rests).

#![allow(dead_code)] // each user needs a part of it

mod equations;
mod numbers;
mod solution;

use numbers::Numbers;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Excitation, Sheet};
use plant::{Inputs, Plant, RigParameters, Setup, State};
use solution::{AxisSample, solve};

/// Noise of the sensors, rms: position, force, pressures [rig-model.md, Sensors].
pub(crate) const NOISE: [f64; 4] = [20e-6, 0.5, 400.0, 400.0];

/// Milliseconds in which channels that show the past still show the start, of which the plant keeps no force.
const OLD_MS: usize = 10;

/// A motion without rest, contact made or lost, or turning round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    pub(crate) name: &'static str,
    linked: bool,
    /// Carriage at the start, m, and commands until it is at the second number.
    from_m: f64,
    begins_m: f64,
    ms: usize,
    /// Commands in the middle, and how far they swing.
    command: [f64; 2],
    swing: [f64; 2],
}

/// Both rods go out between two points of the valve's table: no corner at all.
pub(crate) const EXTENDING: Motion = Motion {
    name: "extending",
    linked: false,
    from_m: 0.05,
    begins_m: 0.12,
    ms: 200,
    command: [0.33, 0.36],
    swing: [0.09, -0.08],
};

/// The drive goes in, the load out.
pub(crate) const RETRACTING: Motion = Motion {
    name: "retracting",
    from_m: 0.46,
    begins_m: 0.38,
    command: [-0.35, 0.35],
    swing: [-0.08, 0.08],
    ..EXTENDING
};

/// Through the points of the table and nearly to full opening.
pub(crate) const SWEEP: Motion =
    Motion { name: "sweep", begins_m: 0.08, ms: 150, command: [0.5, 0.5], swing: [0.4, -0.4], ..EXTENDING };

/// Creeping, where friction falls with the speed.
pub(crate) const CREEPING: Motion =
    Motion { name: "creeping", begins_m: 0.055, command: [0.042, 0.042], swing: [0.002, 0.002], ..EXTENDING };

/// Into the cushion, short of the elastic stop.
pub(crate) const INTO_THE_END: Motion = Motion {
    name: "into the end",
    from_m: 0.46,
    begins_m: 0.486,
    ms: 100,
    command: [0.08, 0.08],
    swing: [0.01, 0.01],
    ..EXTENDING
};

/// The drive pushes the load before it.
pub(crate) const PUSHING: Motion = Motion {
    name: "pushing",
    linked: true,
    from_m: 0.1,
    begins_m: 0.18,
    command: [0.38, -0.26],
    swing: [0.06, 0.05],
    ..EXTENDING
};

pub(crate) const MOTIONS: [Motion; 6] = [EXTENDING, RETRACTING, SWEEP, CREEPING, INTO_THE_END, PUSHING];

impl Motion {
    fn inputs(&self, k: usize, swings: bool) -> Inputs {
        let phase = (std::f64::consts::TAU * k as f64 / 200.0).sin();
        let valve = [0, 1].map(|axis: usize| {
            let swing = if swings { self.swing[axis] * phase } else { 0.0 };
            plant::quantise_valve(self.command[axis] + swing)
        });
        Inputs { valve, ..Inputs::default() }
    }

    /// The state at which the window begins: of the baseline, whatever is on in the window.
    fn start(&self) -> State {
        let setup = Setup { carriage_position_m: self.from_m, linked: self.linked, ..Setup::default() };
        let mut plant = Plant::new(&RigParameters::baseline(), &setup).expect("a good setup");
        for _ in 0..5000 {
            let way = (self.begins_m - self.from_m).signum();
            if (plant.state().axes[0].extension_m - self.begins_m) * way >= 0.0 {
                return *plant.state();
            }
            plant.step(&self.inputs(0, false));
        }
        panic!("{}: the carriage never comes to {} m", self.name, self.begins_m);
    }
}

/// Root mean squares of the differences over a window, of the worse axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Difference {
    /// Position, force, and the worse of both pressures, in units of the noise.
    pub(crate) truth: [f64; 3],
    /// The same of what the sensors show.
    pub(crate) shown: [f64; 3],
    /// mm/s.
    pub(crate) velocity: f64,
    /// Of full opening.
    pub(crate) spool: f64,
    /// Pressures behind the edges, in units of the pressure's noise.
    pub(crate) behind: f64,
    /// In units of the force's noise.
    pub(crate) bristles: f64,
}

impl Difference {
    pub(crate) fn worst_shown(&self) -> f64 {
        self.shown.iter().copied().fold(0.0, f64::max)
    }

    /// The worst of all that is measured in units of noise.
    pub(crate) fn worst(&self) -> f64 {
        let all = self.truth.iter().chain(&self.shown).chain([&self.behind, &self.bristles]);
        all.copied().fold(0.0, f64::max)
    }
}

/// The middle of what is drawn: geometric, positive.
pub(crate) fn middle(key: &EffectKey) -> f64 {
    (key.drawn[0] * key.drawn[1]).sqrt()
}

/// A rig with an effect at a place, all its numbers at the middle of what is drawn.
pub(crate) fn with(rig: &RigParameters, sheet: &Sheet, place: &str) -> RigParameters {
    let numbers: Vec<(&str, f64)> = sheet.keys.iter().map(|key| (key.name, middle(key))).collect();
    rig.with_effect(sheet.name, place, &numbers).expect("the middle is allowed")
}

pub(crate) fn alone(sheet: &Sheet) -> RigParameters {
    sheet.place.names().iter().fold(RigParameters::baseline(), |rig, place| with(&rig, sheet, place))
}

/// All smooth effects that a motion can have on, at all places.
pub(crate) fn all_smooth(motion: &Motion) -> RigParameters {
    let on = |sheet: &&Sheet| {
        is_smooth(sheet)
            && match *motion {
                // A valve that hardly opens, and an axis that hardly moves, would come to rest.
                CREEPING => !matches!(sheet.name, "valve-dead-zone" | "valve-hysteresis"),
                _ => true,
            }
    };
    SHEETS.iter().filter(on).fold(RigParameters::baseline(), |rig, sheet| {
        sheet.place.names().iter().fold(rig, |rig, place| with(&rig, sheet, place))
    })
}

/// Whether an effect can be part of a system of ordinary differential equations while the rig moves.
pub(crate) fn is_smooth(sheet: &Sheet) -> bool {
    Numbers::of(&with(&RigParameters::baseline(), sheet, &sheet.place.names()[0])).is_some()
}

pub(crate) fn motion_of(sheet: &Sheet) -> Motion {
    match sheet.excited_by {
        Excitation::Creeping => CREEPING,
        Excitation::IntoEnd => INTO_THE_END,
        Excitation::Fast => SWEEP,
        Excitation::LinkedRods => PUSHING,
        Excitation::Any | Excitation::NearEnd => EXTENDING,
    }
}

/// A window as the independent solver has it.
pub(crate) struct Window {
    rig: RigParameters,
    start: State,
    inputs: Vec<Inputs>,
    solved: Vec<[AxisSample; 2]>,
}

impl Window {
    pub(crate) fn new(rig: RigParameters, motion: &Motion) -> Self {
        let numbers = Numbers::of(&rig).expect("only smooth effects");
        let start = motion.start();
        let inputs: Vec<Inputs> = (0..motion.ms).map(|k| motion.inputs(k, true)).collect();
        let solved = solve(&numbers, &start, &inputs);
        let directions = start.axes.map(|axis| axis.rod_velocity_m_per_s.signum());
        for (k, samples) in solved.iter().enumerate() {
            for axis in 0..2 {
                let speed = samples[axis].velocity * directions[axis];
                assert!(speed > 1e-3, "{}: axis {axis} comes to rest at {k} ms: {speed}", motion.name);
            }
        }
        Window { rig, start, inputs, solved }
    }

    /// What the plant with so many substeps makes of it, against the solver.
    pub(crate) fn difference(&self, substeps: u32) -> Difference {
        self.against(&self.rig, substeps)
    }

    /// What the baseline makes of it, against the solver with effects: how much there is to be agreed on.
    pub(crate) fn change(&self) -> Difference {
        self.against(&RigParameters::baseline(), 10)
    }

    fn against(&self, rig: &RigParameters, substeps: u32) -> Difference {
        let plant = Plant::in_state(rig, &self.start).expect("a good state");
        let mut plant = plant.with_substeps(substeps);
        let names = plant.term_names();
        let mut squares = [[0.0; 13]; 2];
        for (k, (inputs, solved)) in self.inputs.iter().zip(&self.solved).enumerate() {
            plant.step(inputs);
            let truth = plant.truth(inputs);
            let shown = plant.noise_free_readings(&truth);
            let terms = plant.terms(inputs);
            for axis in 0..2 {
                let part = ["drive", "load"][axis];
                let term = |name: &str| {
                    let at = names.iter().position(|column| *column == format!("{part}_{name}"));
                    at.map_or(0.0, |i| terms.values()[i])
                };
                let (plant_axis, want) = (&truth.axes[axis], &solved[axis]);
                let got = [
                    plant_axis.position_m,
                    plant_axis.sensor_force_n,
                    plant_axis.pressure_a_pa,
                    plant_axis.pressure_b_pa,
                ];
                let mut add = |i: usize, difference: f64| squares[axis][i] += difference * difference;
                for channel in 0..4 {
                    add(channel, (got[channel] - want.truth[channel]) / NOISE[channel]);
                    let counts = channel != 1 || k >= OLD_MS;
                    let error = if counts { shown[axis][channel] - want.shown[channel] } else { 0.0 };
                    add(4 + channel, error / NOISE[channel]);
                }
                add(8, (plant_axis.rod_velocity_m_per_s - want.velocity) * 1e3);
                add(9, plant_axis.spool - want.spool);
                let silencer = numbers::P_EXHAUST + term("exhaust_side_silencer_back_pressure_Pa");
                add(10, (silencer - want.silencer) / NOISE[2]);
                add(11, (truth.supply_pressure_pa - want.node) / NOISE[2]);
                add(12, (term("bristles_presliding_N") - want.bristles) / NOISE[1]);
            }
        }
        let rms = |i: usize| {
            let mean = |axis: usize| squares[axis][i] / self.inputs.len() as f64;
            mean(0).max(mean(1)).sqrt()
        };
        Difference {
            truth: [rms(0), rms(1), rms(2).max(rms(3))],
            shown: [rms(4), rms(5), rms(6).max(rms(7))],
            velocity: rms(8),
            spool: rms(9),
            behind: rms(10).max(rms(11)),
            bristles: rms(12),
        }
    }
}
