//! What only a simulation knows: true states and every named force and flow, at one instant.
//!
//! This is also where the terms of the model can be read one by one, in the order in which they are summed:
//!
//! ```text
//! m dv/dt = pneumatic + hand + contact + viscous friction + sliding friction + holding force + effect force
//! ```
//!
//! each along the axis' own extension, N. The holding force is what keeps a resting piston at rest: static
//! friction, and the end of the stroke where the piston is pressed against it. The effect force is the sum of what switched-on
//! effects add beside friction; what each of them adds to which balance is in [`crate::effects::Terms`]. All forces are those at
//! the instant: what the force sensors are sampled from.
//!
//! Source: rig-model.md, One axis, Masses and linkage.

use crate::effects::tabulated::AxisConditions;
use crate::effects::{Effects, Friction};
use crate::integrator::{Integrator, Lanes};
use crate::lanes::{Axes, Pair};
use crate::motion::side;
use crate::state::{Inputs, State};
use crate::valve::edge_flow;

const AXIS_COLUMNS: usize = 20;
/// Columns of both axes and of the rig.
const COLUMNS: usize = 2 * AXIS_COLUMNS + 4;

/// True states and terms of the plant at one instant; a row of `truth.csv`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Drive and load.
    pub axes: [AxisTruth; 2],
    /// Absolute pressure of the supply node, Pa.
    pub supply_pressure_pa: f64,
    /// x_load - x_drive, m.
    pub linkage_distance_m: f64,
    /// F_c, N, positive in +x on the carriage.
    pub contact_force_n: f64,
    /// Whether the check valves at the chambers are shut.
    pub check_valves_shut: bool,
}

/// True states and terms of one axis; forces along its own extension, flows into its chambers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisTruth {
    /// Position in rig coordinates, m.
    pub position_m: f64,
    /// Rod velocity in its own extension, m/s.
    pub rod_velocity_m_per_s: f64,
    /// Rod acceleration in its own extension, m/s^2; 0 while the axis rests.
    pub rod_acceleration_m_per_s2: f64,
    /// Spool opening, -1 to 1.
    pub spool: f64,
    /// Absolute pressure of chamber a, Pa.
    pub pressure_a_pa: f64,
    /// Absolute pressure of chamber b, Pa.
    pub pressure_b_pa: f64,
    /// Stored air p V of chamber a, J.
    pub stored_air_a_j: f64,
    /// Stored air p V of chamber b, J.
    pub stored_air_b_j: f64,
    /// Lagged net normal flow into chamber a, m^3/s.
    pub flow_a_m3_per_s: f64,
    /// Lagged net normal flow into chamber b, m^3/s.
    pub flow_b_m3_per_s: f64,
    /// Normal flow through the valve's edge into chamber a, m^3/s.
    pub edge_flow_a_m3_per_s: f64,
    /// Normal flow through the valve's edge into chamber b, m^3/s.
    pub edge_flow_b_m3_per_s: f64,
    /// F_pn, N.
    pub pneumatic_force_n: f64,
    /// A hand's push, N.
    pub hand_force_n: f64,
    /// The contact's push, N.
    pub contact_force_n: f64,
    /// -b v, N.
    pub viscous_friction_n: f64,
    /// Sliding friction, N; at the instant of breaking away it has the direction of the motion to come.
    pub sliding_friction_n: f64,
    /// Static friction and end stop of a resting axis, N.
    pub holding_force_n: f64,
    /// What effects add to the forces beside friction, N; 0 without effects.
    pub effect_force_n: f64,
    /// What the force sensor between rod and carriage would show without noise, N, compression positive.
    pub sensor_force_n: f64,
}

impl Truth {
    /// Names of [`Truth::values`], each with its unit.
    #[rustfmt::skip] // one axis, one block
    pub const COLUMNS: [&'static str; COLUMNS] = [
        "drive_position_m", "drive_rod_velocity_m_per_s", "drive_rod_acceleration_m_per_s2", "drive_spool",
        "drive_pressure_a_Pa", "drive_pressure_b_Pa", "drive_stored_air_a_J", "drive_stored_air_b_J",
        "drive_flow_a_m3_per_s", "drive_flow_b_m3_per_s", "drive_edge_flow_a_m3_per_s", "drive_edge_flow_b_m3_per_s",
        "drive_pneumatic_force_N", "drive_hand_force_N", "drive_contact_force_N", "drive_viscous_friction_N",
        "drive_sliding_friction_N", "drive_holding_force_N", "drive_effect_force_N", "drive_sensor_force_N",
        "load_position_m", "load_rod_velocity_m_per_s", "load_rod_acceleration_m_per_s2", "load_spool",
        "load_pressure_a_Pa", "load_pressure_b_Pa", "load_stored_air_a_J", "load_stored_air_b_J",
        "load_flow_a_m3_per_s", "load_flow_b_m3_per_s", "load_edge_flow_a_m3_per_s", "load_edge_flow_b_m3_per_s",
        "load_pneumatic_force_N", "load_hand_force_N", "load_contact_force_N", "load_viscous_friction_N",
        "load_sliding_friction_N", "load_holding_force_N", "load_effect_force_N", "load_sensor_force_N",
        "supply_pressure_Pa", "linkage_distance_m", "linkage_contact_force_N", "check_valves_shut",
    ];

    /// The numbers in the order of [`Truth::COLUMNS`]; a flag is 0 or 1.
    pub fn values(&self) -> [f64; COLUMNS] {
        let mut values = [0.0; COLUMNS];
        values[..AXIS_COLUMNS].copy_from_slice(&self.axes[0].values());
        values[AXIS_COLUMNS..2 * AXIS_COLUMNS].copy_from_slice(&self.axes[1].values());
        values[2 * AXIS_COLUMNS..].copy_from_slice(&[
            self.supply_pressure_pa,
            self.linkage_distance_m,
            self.contact_force_n,
            f64::from(u8::from(self.check_valves_shut)),
        ]);
        values
    }

    /// Evaluates every law once at the state.
    pub(crate) fn at(
        integrator: &Integrator,
        effects: Option<&Effects>,
        state: &State,
        inputs: &Inputs,
    ) -> Self {
        let lanes = Lanes::load(state);
        let check_valves_shut = integrator.supply.check_valves_shut(state.supply_pressure_pa);
        let supply_pressure_pa = supply_pressure_pa(effects, state);
        let air = AirState::of(integrator, &lanes);
        let edge_flow = edge_flows(integrator, effects, state, &lanes, &air);
        let forces = TrueForces::at(integrator, effects, &lanes, hand_forces(inputs), state.linked);

        let axis = |i: usize| {
            let (axis_state, axis) = (&state.axes[i], &forces.axes[i]);
            let rest_m = [0.0, integrator.motion.stroke_m][i];
            AxisTruth {
                position_m: rest_m + [1.0, -1.0][i] * axis_state.extension_m,
                rod_velocity_m_per_s: axis_state.rod_velocity_m_per_s,
                rod_acceleration_m_per_s2: axis.sum() / integrator.motion.masses_kg[i],
                spool: axis_state.spool,
                pressure_a_pa: air.pressure[0].to_array()[i],
                pressure_b_pa: air.pressure[1].to_array()[i],
                stored_air_a_j: axis_state.stored_air_a_j,
                stored_air_b_j: axis_state.stored_air_b_j,
                flow_a_m3_per_s: axis_state.flow_a_m3_per_s,
                flow_b_m3_per_s: axis_state.flow_b_m3_per_s,
                edge_flow_a_m3_per_s: edge_flow[0].to_array()[i],
                edge_flow_b_m3_per_s: edge_flow[1].to_array()[i],
                pneumatic_force_n: axis.pneumatic_n,
                hand_force_n: axis.hand_n,
                contact_force_n: forces.contact_n,
                viscous_friction_n: axis.viscous_n,
                sliding_friction_n: axis.sliding_n,
                holding_force_n: axis.holding_n,
                effect_force_n: axis.effect_n,
                sensor_force_n: forces.sensor_n(integrator, i),
            }
        };
        Truth {
            axes: [axis(0), axis(1)],
            supply_pressure_pa,
            linkage_distance_m: forces.distance_m,
            contact_force_n: forces.contact_n,
            check_valves_shut,
        }
    }
}

/// Absolute pressure behind the supply edges, Pa.
pub(crate) fn supply_pressure_pa(effects: Option<&Effects>, state: &State) -> f64 {
    effects.map_or(state.supply_pressure_pa, |effects| {
        effects.supply_side(&effects.memory.states).sum(state.supply_pressure_pa)
    })
}

/// The air of both chambers at an instant.
pub(crate) struct AirState {
    pub(crate) volume: [Pair; 2],
    pub(crate) pressure: [Pair; 2],
}

impl AirState {
    pub(crate) fn of(integrator: &Integrator, lanes: &Lanes) -> Self {
        let chambers = &integrator.chambers;
        let volume = [chambers.volume_a(lanes.extension), chambers.volume_b(lanes.extension)];
        let [a, b] = lanes.air();
        AirState { volume, pressure: [a.stored * volume[0].reciprocal(), b.stored * volume[1].reciprocal()] }
    }

    /// Pressures of the chambers of one axis, Pa.
    pub(crate) fn of_axis_pa(&self, axis: usize) -> [f64; 2] {
        self.pressure.map(|pair| pair.to_array()[axis])
    }
}

fn edge_flows(
    integrator: &Integrator,
    effects: Option<&Effects>,
    state: &State,
    lanes: &Lanes,
    air: &AirState,
) -> [Pair; 2] {
    let exhaust_pa = integrator.chambers.exhaust_pa();
    let edges = integrator.valve.edges(lanes.spool, state.supply_pressure_pa, exhaust_pa);
    let shut = integrator.supply.check_valves_shut(state.supply_pressure_pa);
    let open = Pair::both(if shut { 0.0 } else { 1.0 });
    let mut flows = [
        edge_flow(edges.conductance_a * open, edges.far_pressure_a, air.pressure[0]),
        edge_flow(edges.conductance_b * open, edges.far_pressure_b, air.pressure[1]),
    ]
    .map(Pair::to_array);
    let Some(effects) = effects else { return flows.map(|lanes| Pair::new(lanes[0], lanes[1])) };
    for axis in (0..2).filter(|axis| effects.changed_laws[*axis].air) {
        let through = effects.ports_at(integrator, axis, state, air).flow_m3_per_s;
        flows.iter_mut().zip(through).for_each(|(lanes, flow)| lanes[axis] = flow);
    }
    flows.map(|lanes| Pair::new(lanes[0], lanes[1]))
}

/// Every force at an instant.
pub(crate) struct TrueForces {
    axes: [AxisForces; 2],
    contact_n: f64,
    distance_m: f64,
}

/// Forces on one piston along its own extension, N.
struct AxisForces {
    pneumatic_n: f64,
    hand_n: f64,
    contact_n: f64,
    viscous_n: f64,
    sliding_n: f64,
    holding_n: f64,
    effect_n: f64,
}

impl AxisForces {
    fn sum(&self) -> f64 {
        self.pneumatic_n
            + self.hand_n
            + self.contact_n
            + self.viscous_n
            + self.sliding_n
            + self.holding_n
            + self.effect_n
    }
}

impl TrueForces {
    /// Each force by its own law.
    pub(crate) fn at(
        integrator: &Integrator,
        effects: Option<&Effects>,
        lanes: &Lanes,
        hand: Pair,
        linked: bool,
    ) -> Self {
        let motion = &integrator.motion;
        let distance_m = integrator.distance(lanes.extension);
        let approach_m_per_s = -lanes.velocity.sum();
        let contact_n = if linked { integrator.linkage.force(distance_m, approach_m_per_s) } else { 0.0 };
        let air = AirState::of(integrator, lanes);
        let pneumatic = integrator.chambers.pneumatic_force(air.pressure[0], air.pressure[1]).to_array();

        let axis = |i: usize| {
            let piston = lanes.piston(i);
            let hand_n = hand.to_array()[i];
            let effect_n =
                effects.map_or(0.0, |effects| effects.force(i, &AxisConditions::at(lanes, &air, i)).sum(0.0));
            let force = pneumatic[i] + hand_n + contact_n + effect_n;
            let friction = effects.map(|effects| Friction::at(effects, integrator, i, piston, &air));
            let levels = friction.map_or(motion.levels, |friction| friction.levels(piston.velocity.abs()));
            let viscous_n = -(levels.viscous_n_s_per_m[side(piston.velocity)] * piston.velocity);
            let mut sliding_n = 0.0;
            let mut holding_n = 0.0;
            let bristles = friction.and_then(|friction| friction.bristles(piston, force));
            if let Some(bristles) = bristles {
                sliding_n = bristles.sum(0.0);
                // What the bristles leave of a force that presses against an end, the end takes.
                let rest = force + sliding_n;
                if piston.velocity == 0.0 && motion.pressed(piston.extension, rest) {
                    holding_n = -rest;
                }
            } else if piston.velocity != 0.0 {
                sliding_n = -levels.sliding_n[side(piston.velocity)] * piston.velocity.signum();
            } else if motion.holds(piston.extension, force, levels.break_away_n[side(force)]) {
                holding_n = -force;
            } else {
                sliding_n = -levels.sliding_n[side(force)] * force.signum();
            }
            AxisForces {
                pneumatic_n: pneumatic[i],
                hand_n,
                contact_n,
                viscous_n,
                sliding_n,
                holding_n,
                effect_n,
            }
        };
        TrueForces { axes: [axis(0), axis(1)], contact_n, distance_m }
    }

    /// Force on a piston without any friction, N.
    pub(crate) fn unresisted_n(&self, axis: usize) -> f64 {
        let axis_forces = &self.axes[axis];
        axis_forces.pneumatic_n + axis_forces.hand_n + axis_forces.contact_n + axis_forces.effect_n
    }

    /// What the force sensor of an axis would show, N: what pushes its rod back in; behind the drive's there is the carriage
    /// to be moved, too.
    pub(crate) fn sensor_n(&self, integrator: &Integrator, axis: usize) -> f64 {
        let axis_forces = &self.axes[axis];
        let acceleration = axis_forces.sum() / integrator.motion.masses_kg[axis];
        integrator.motion.behind_sensor_kg[axis] * acceleration - self.contact_n - axis_forces.hand_n
    }
}

impl AxisTruth {
    fn values(&self) -> [f64; AXIS_COLUMNS] {
        [
            self.position_m,
            self.rod_velocity_m_per_s,
            self.rod_acceleration_m_per_s2,
            self.spool,
            self.pressure_a_pa,
            self.pressure_b_pa,
            self.stored_air_a_j,
            self.stored_air_b_j,
            self.flow_a_m3_per_s,
            self.flow_b_m3_per_s,
            self.edge_flow_a_m3_per_s,
            self.edge_flow_b_m3_per_s,
            self.pneumatic_force_n,
            self.hand_force_n,
            self.contact_force_n,
            self.viscous_friction_n,
            self.sliding_friction_n,
            self.holding_force_n,
            self.effect_force_n,
            self.sensor_force_n,
        ]
    }
}

/// The hand's pushes, given in +x, along each axis' own extension, N.
pub(crate) fn hand_forces(inputs: &Inputs) -> Pair {
    Pair::new(inputs.hand_force_carriage_n, -inputs.hand_force_load_n)
}
