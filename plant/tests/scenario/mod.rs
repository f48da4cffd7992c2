//! Motions of the rig for the tests of accuracy: set-points, two small controllers, and windows of the motion.
//!
//! The controllers close their loops on the plant's true values, only to make commands that are like a real run's;
//! the recorded commands are then given to every scheme alike.

#![allow(dead_code)] // each user needs a part of it

use plant::{Axis, Inputs, Plant, RigParameters, Setup, State};

/// Length of a window, ms.
pub(crate) const WINDOW_MS: usize = 100;

/// A recorded motion.
pub(crate) struct Scenario {
    pub(crate) name: &'static str,
    /// Inputs of each millisecond.
    pub(crate) inputs: Vec<Inputs>,
    /// State at each millisecond.
    pub(crate) states: Vec<State>,
}

/// Point-to-point motions with rests, a load that changes in steps, fast and slow phases; and what is hardest to
/// follow: full speed against the ends, and an emergency stop in mid-motion.
pub(crate) fn all(rig: &RigParameters) -> Vec<Scenario> {
    let linked = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    vec![
        record(rig, Kind::FREE, 6000),
        record(rig, linked, 6000),
        record(rig, Kind { name: "linked with 20 kg", added_mass_kg: 20.0, ..linked }, 6000),
        record(rig, Kind { name: "linked, emergency stop", emergency_stop: true, ..linked }, 3000),
        record(rig, Kind { name: "full speed against the ends", full_speed: true, ..Kind::FREE }, 4000),
    ]
}

/// What distinguishes the motions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) linked: bool,
    pub(crate) added_mass_kg: f64,
    /// Tripped at 1.2 s, released at 1.8 s: at the start of a window.
    pub(crate) emergency_stop: bool,
    /// Valve fully open, changing sign.
    pub(crate) full_speed: bool,
}

impl Kind {
    pub(crate) const FREE: Kind = Kind {
        name: "free, point to point",
        linked: false,
        added_mass_kg: 0.0,
        emergency_stop: false,
        full_speed: false,
    };
}

/// One motion of so many milliseconds.
pub(crate) fn record(rig: &RigParameters, kind: Kind, ms: usize) -> Scenario {
    let Kind { name, linked, added_mass_kg, .. } = kind;
    let setup = Setup { carriage_position_m: 0.1, linked, added_mass_kg };
    let mut plant = Plant::new(rig, &setup).expect("the scenario's setup is good");
    let mut scenario = Scenario { name, inputs: Vec::new(), states: Vec::new() };
    for k in 0..ms {
        match k {
            1200 if kind.emergency_stop => plant.trip_emergency_stop(),
            1800 if kind.emergency_stop => plant.release_emergency_stop(),
            _ => (),
        }
        let truth = plant.truth(&Inputs::default());
        let [drive, load] = truth.axes;
        let wanted = set_point(k as f64 * 1e-3);
        let quantised = |u: f64| plant::quantise_valve(u);
        let position_error = wanted - drive.position_m;
        let u_drive = 12.0 * position_error - 0.35 * drive.rod_velocity_m_per_s
            + 0.05 * f64::from(position_error > 1e-3)
            - 0.05 * f64::from(position_error < -1e-3);
        let wanted_force = [0.0, 150.0, 350.0, 60.0][k / 700 % 4];
        let force_error = wanted_force - load.sensor_force_n;
        let u_load = if linked { 2e-3 * force_error } else { 0.2 * (k as f64 * 4e-3).sin() };
        let (u_drive, u_load) = if kind.full_speed {
            (if k / 900 % 2 == 0 { 1.0 } else { -1.0 }, if k / 700 % 2 == 0 { 1.0 } else { -0.7 })
        } else {
            (u_drive, u_load)
        };
        let inputs = Inputs { valve: [quantised(u_drive), quantised(u_load)], ..Inputs::default() };
        scenario.inputs.push(inputs);
        scenario.states.push(*plant.state());
        plant.step(&inputs);
    }
    scenario
}

/// Rests and fifth-order ways between them, m over s.
fn set_point(t_s: f64) -> f64 {
    let points = [0.1, 0.35, 0.15, 0.4, 0.38, 0.12];
    let leg = (t_s / 1.0) as usize;
    let (from, to) = (points[leg % 6], points[(leg + 1) % 6]);
    let z = ((t_s - leg as f64) / [0.6, 0.8, 0.45][leg % 3]).min(1.0);
    from + (to - from) * z * z * z * (10.0 - 15.0 * z + 6.0 * z * z)
}

/// Position of an axis in rig coordinates, m.
pub(crate) fn position_m(rig: &RigParameters, state: &State, axis: Axis) -> f64 {
    match axis {
        Axis::Drive => state.axes[0].extension_m,
        Axis::Load => rig.cylinder().stroke_m - state.axes[1].extension_m,
    }
}
