//! The scheme of `plant` in plain C (`floor.c`), the floor that the benchmarks compare the crate with.

#![allow(unsafe_code)] // C

use std::ffi::{c_int, c_ulong};

use plant::{AxisState, Inputs, RigParameters};

/// The rig's numbers as `struct rig` of floor.c has them.
#[repr(C)]
struct FloorRig {
    supply: [f64; 4],
    time_constants: [f64; 2],
    tables: [[f64; 6]; 3],
    cylinder: [f64; 4],
    friction: [f64; 3],
    masses: [f64; 2],
    linkage: [f64; 3],
}

/// `struct axis` of floor.c: extension, m; velocity of the rod, m/s; spool; stored air of both chambers, J; flows into them,
/// m^3/s.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FloorAxis(pub [f64; 7]);

impl FloorAxis {
    pub fn of(axis: &AxisState) -> Self {
        Self([
            axis.extension_m,
            axis.rod_velocity_m_per_s,
            axis.spool,
            axis.stored_air_a_j,
            axis.stored_air_b_j,
            axis.flow_a_m3_per_s,
            axis.flow_b_m3_per_s,
        ])
    }
}

unsafe extern "C" {
    fn floor_size() -> c_ulong;
    fn floor_new(plant: *mut u64, rig: *const FloorRig);
    fn floor_step(plant: *const u64, axes: *mut FloorAxis, valve: *const f64, linked: c_int);
}

/// The C plant: constants behind a buffer of its own size, and the state.
#[derive(Clone, Debug)]
pub struct Floor {
    constants: Vec<u64>,
    pub axes: [FloorAxis; 2],
}

impl Floor {
    pub fn new(rig: &RigParameters, axes: &[AxisState; 2]) -> Self {
        let (supply, gas, valve) = (rig.supply(), rig.gas(), rig.valve());
        let (cylinder, friction, mass, linkage) = (rig.cylinder(), rig.friction(), rig.mass(), rig.linkage());
        let numbers = FloorRig {
            supply: [
                supply.pressure_pa,
                supply.exhaust_pressure_pa,
                supply.atmospheric_pressure_pa,
                gas.normal_pressure_pa,
            ],
            time_constants: [valve.spool_time_constant_s, valve.flow_lag_time_constant_s],
            tables: [valve.opening, valve.kv_supply_m3_per_h, valve.kv_exhaust_m3_per_h],
            cylinder: [
                cylinder.stroke_m,
                cylinder.piston_area_m2,
                cylinder.annulus_area_m2,
                cylinder.dead_volume_m3,
            ],
            friction: [friction.break_away_force_n, friction.sliding_force_n, friction.viscous_n_s_per_m],
            masses: [mass.drive_kg, mass.load_kg],
            linkage: [linkage.gap_m, linkage.stiffness_n_per_m, linkage.damping_n_s_per_m],
        };
        // SAFETY: floor_size takes nothing and returns a constant.
        let bytes = unsafe { floor_size() };
        let mut constants = vec![0_u64; (bytes as usize).div_ceil(8)];
        // SAFETY: the buffer has the size that C asked for and is aligned for doubles; FloorRig has the layout of
        // struct rig, doubles only.
        unsafe { floor_new(constants.as_mut_ptr(), &numbers) };
        Floor { constants, axes: axes.each_ref().map(FloorAxis::of) }
    }

    /// One period of 1 ms, linked.
    pub fn step(&mut self, inputs: &Inputs) {
        // SAFETY: the constants were made by floor_new; axes and valve are two of each, as C reads and writes.
        unsafe { floor_step(self.constants.as_ptr(), self.axes.as_mut_ptr(), inputs.valve.as_ptr(), 1) };
    }
}
