//! What only a simulation knows: true states and every named force and flow, at one instant.
//!
//! This is also where the terms of the model can be read one by one, in the order in which they are summed:
//!
//! ```text
//! m dv/dt = pneumatic + hand + contact + viscous friction + sliding friction + holding force
//! ```
//!
//! each along the axis' own extension, N. The holding force is what keeps a resting piston at rest: static
//! friction, and the end of the stroke where the piston is pressed against it. All forces are those at the instant: what
//! the force sensors are sampled from.
//!
//! Source: rig-model.md, One axis, Masses and linkage.

use crate::integrator::{Integrator, Lanes};
use crate::lanes::Pair;
use crate::parameters::RigParameters;
use crate::state::{Inputs, State};
use crate::valve::edge_flow;

/// Columns of one axis.
const AXIS_COLUMNS: usize = 19;
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
        "drive_sliding_friction_N", "drive_holding_force_N", "drive_sensor_force_N",
        "load_position_m", "load_rod_velocity_m_per_s", "load_rod_acceleration_m_per_s2", "load_spool",
        "load_pressure_a_Pa", "load_pressure_b_Pa", "load_stored_air_a_J", "load_stored_air_b_J",
        "load_flow_a_m3_per_s", "load_flow_b_m3_per_s", "load_edge_flow_a_m3_per_s", "load_edge_flow_b_m3_per_s",
        "load_pneumatic_force_N", "load_hand_force_N", "load_contact_force_N", "load_viscous_friction_N",
        "load_sliding_friction_N", "load_holding_force_N", "load_sensor_force_N",
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
    pub(crate) fn at(integrator: &Integrator, rig: &RigParameters, state: &State, inputs: &Inputs) -> Self {
        let (chambers, motion) = (&integrator.chambers, &integrator.motion);
        let lanes = Lanes::load(state);
        let check_valves_shut = integrator.supply.check_valves_shut(state.supply_pressure_pa);

        // The air.
        let pressure_a = lanes.air_a.stored * chambers.volume_a(lanes.extension).reciprocal();
        let pressure_b = lanes.air_b.stored * chambers.volume_b(lanes.extension).reciprocal();
        let edges = integrator.valve.edges(lanes.spool, state.supply_pressure_pa, chambers.exhaust_pa());
        let open = Pair::both(if check_valves_shut { 0.0 } else { 1.0 });
        let edge_flow_a = edge_flow(edges.conductance_a * open, edges.far_pressure_a, pressure_a);
        let edge_flow_b = edge_flow(edges.conductance_b * open, edges.far_pressure_b, pressure_b);

        // The forces, each by its own law.
        let linkage_distance_m = integrator.distance(lanes.extension);
        let approach_m_per_s = -lanes.velocity.sum();
        let contact_force_n =
            if state.linked { integrator.linkage.force(linkage_distance_m, approach_m_per_s) } else { 0.0 };
        let zero = Pair::both(0.0);
        let moving = lanes.velocity.differs(zero);
        let pneumatic = chambers.pneumatic_force(pressure_a, pressure_b).to_array();
        let hand = hand_forces(inputs).to_array();
        let viscous = motion.viscous_friction(lanes.velocity).to_array();
        let sliding = motion.sliding_friction(lanes.velocity, moving).to_array();

        let axis = |i: usize| {
            let own = &state.axes[i];
            let mut sliding_friction_n = sliding[i];
            let mut holding_force_n = 0.0;
            if own.rod_velocity_m_per_s == 0.0 {
                let force = pneumatic[i] + hand[i] + contact_force_n;
                if motion.holds(own.extension_m, force) {
                    holding_force_n = -force;
                } else {
                    sliding_friction_n = -rig.friction().sliding_force_n * force.signum();
                }
            }
            let sum =
                pneumatic[i] + hand[i] + contact_force_n + viscous[i] + sliding_friction_n + holding_force_n;
            let rod_acceleration_m_per_s2 = sum / motion.mass_kg(i);
            // What pushes the rod back in; behind the drive's sensor there is the carriage to be moved, too.
            let behind_kg = [rig.mass().carriage_kg + state.added_mass_kg, 0.0][i];
            let rest_m = [0.0, motion.stroke_m()][i];
            let sign = [1.0, -1.0][i];
            AxisTruth {
                position_m: rest_m + sign * own.extension_m,
                rod_velocity_m_per_s: own.rod_velocity_m_per_s,
                rod_acceleration_m_per_s2,
                spool: own.spool,
                pressure_a_pa: pressure_a.to_array()[i],
                pressure_b_pa: pressure_b.to_array()[i],
                stored_air_a_j: own.stored_air_a_j,
                stored_air_b_j: own.stored_air_b_j,
                flow_a_m3_per_s: own.flow_a_m3_per_s,
                flow_b_m3_per_s: own.flow_b_m3_per_s,
                edge_flow_a_m3_per_s: edge_flow_a.to_array()[i],
                edge_flow_b_m3_per_s: edge_flow_b.to_array()[i],
                pneumatic_force_n: pneumatic[i],
                hand_force_n: hand[i],
                contact_force_n,
                viscous_friction_n: viscous[i],
                sliding_friction_n,
                holding_force_n,
                sensor_force_n: behind_kg * rod_acceleration_m_per_s2 - contact_force_n - hand[i],
            }
        };
        Truth {
            axes: [axis(0), axis(1)],
            supply_pressure_pa: state.supply_pressure_pa,
            linkage_distance_m,
            contact_force_n,
            check_valves_shut,
        }
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
            self.sensor_force_n,
        ]
    }
}

/// The hand's pushes, given in +x, along each axis' own extension, N.
pub(crate) fn hand_forces(inputs: &Inputs) -> Pair {
    Pair::new(inputs.hand_force_carriage_n, -inputs.hand_force_load_n)
}
