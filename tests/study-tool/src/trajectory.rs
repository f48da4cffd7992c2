//! True trajectory of a record: inputs and true states for each millisecond.

use plant::{Inputs, RigParameters, State};

/// Length of a window, rows of 1 ms.
pub(crate) const WINDOW: usize = 100;

#[derive(Debug, Clone)]
pub(crate) struct TrueTrajectory {
    pub(crate) rig: RigParameters,
    /// Which axes are measured, drive and load.
    pub(crate) measured: [bool; 2],
    /// Initial state; every state other than the points continues from it.
    pub(crate) start: State,
    pub(crate) inputs: Vec<Inputs>,
    /// Windows at the start in which memories build up: they are excluded.
    pub(crate) settling: usize,
    /// True mechanical state and pressures at the start of each millisecond.
    pub(crate) points: Vec<[Point; 2]>,
}

/// The free initial state of a window, for one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) extension_m: f64,
    /// Its rate, m/s.
    pub(crate) rod_velocity_m_per_s: f64,
    /// Absolute pressures of the chambers a and b, Pa.
    pub(crate) pressures_pa: [f64; 2],
}

pub(crate) const POINT_NUMBERS: usize = 4;

impl Point {
    /// The point with one of its numbers increased by less than the sensors' noise, so that the trajectory hardly changes.
    pub(crate) fn perturbed(mut self, number: usize) -> Self {
        match number {
            0 => self.extension_m += 2e-6,
            1 => self.rod_velocity_m_per_s += 2e-4,
            2 => self.pressures_pa[0] += 50.0,
            _ => self.pressures_pa[1] += 50.0,
        }
        self
    }
}

impl TrueTrajectory {
    /// Number of whole windows; a remainder is ignored.
    pub(crate) fn windows(&self) -> usize {
        self.inputs.len().min(self.points.len()) / WINDOW
    }
}
