//! The plant's moving state, its inputs, and which axis is which.
//!
//! Parameters do not change and the state is small, copyable and serialisable, so that a window of a record can be
//! run again from any instant. Everything else is derived from the two.

use serde::{Deserialize, Serialize};

/// One of the two cylinders; its number is its place in every array of two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Moves the carriage under position control.
    Drive,
    /// Presses on the carriage under force control.
    Load,
}

impl Axis {
    /// Both axes, in the order of every array of two.
    pub const ALL: [Axis; 2] = [Axis::Drive, Axis::Load];

    /// Place in every array of two.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `drive` or `load`, as in the columns of a measurement.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::Drive => "drive",
            Axis::Load => "load",
        }
    }
}

/// What acts on the plant over one period.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Inputs {
    /// Valve commands of drive and load in [-1, 1]; positive extends the rod of its own cylinder.
    pub valve: [f64; 2],
    /// A hand's push on the carriage in +x, N.
    pub hand_force_carriage_n: f64,
    /// A hand's push on the load's eye in +x, N.
    pub hand_force_load_n: f64,
}

/// State of one axis, in its own extension.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisState {
    /// How far the rod is out, m, 0 to the stroke; the carriage's x for the drive, stroke - x for the load.
    pub extension_m: f64,
    /// Its rate, m/s; exactly 0 at rest.
    pub rod_velocity_m_per_s: f64,
    /// Spool opening, -1 to 1; positive supplies chamber a.
    pub spool: f64,
    /// p V of the cap-side chamber a, J, with the absolute pressure.
    pub stored_air_a_j: f64,
    /// p V of the rod-side chamber b, J.
    pub stored_air_b_j: f64,
    /// Lagged net normal flow into chamber a, m^3/s.
    pub flow_a_m3_per_s: f64,
    /// Lagged net normal flow into chamber b, m^3/s.
    pub flow_b_m3_per_s: f64,
}

/// All that changes in the plant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Drive and load.
    pub axes: [AxisState; 2],
    /// Absolute pressure of the supply node, Pa.
    pub supply_pressure_pa: f64,
    /// Whether the emergency stop holds the supply discharged and the commands at 0.
    pub emergency_stop: bool,
    /// Whether the load's eye sits in the carriage.
    pub linked: bool,
    /// Weights on the carriage, kg.
    pub added_mass_kg: f64,
}

impl State {
    /// The state of one axis.
    pub fn axis(&self, axis: Axis) -> &AxisState {
        &self.axes[axis.index()]
    }

    /// Whether every number is finite; a rig that is not is a latched fault of its emulator.
    pub fn is_finite(&self) -> bool {
        self.axes.iter().all(AxisState::is_finite)
            && self.supply_pressure_pa.is_finite()
            && self.added_mass_kg.is_finite()
    }
}

impl AxisState {
    fn is_finite(&self) -> bool {
        let all = [
            self.extension_m,
            self.rod_velocity_m_per_s,
            self.spool,
            self.stored_air_a_j,
            self.stored_air_b_j,
            self.flow_a_m3_per_s,
            self.flow_b_m3_per_s,
        ];
        all.iter().all(|number| number.is_finite())
    }
}
