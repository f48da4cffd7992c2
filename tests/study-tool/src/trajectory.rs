//! What really happened in a record: inputs and true states, millisecond by millisecond.

use plant::{Inputs, RigParameters, State, Truth};

pub const WINDOW: usize = 100;

/// The trajectory of a record, as only its maker knows it.
#[derive(Debug, Clone)]
pub struct TrueTrajectory {
    pub rig: RigParameters,
    /// Which axes are measured, drive and load.
    pub measured: [bool; 2],
    /// State at the start, from which everything but the points is carried on.
    pub start: State,
    pub inputs: Vec<Inputs>,
    /// Windows at the start in which memories fill: they count for nothing.
    pub settling: usize,
    /// The true mechanical state and pressures at the start of each millisecond.
    pub points: Vec<[Point; 2]>,
}

/// What a window's free initial state is made of, for one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    pub extension_m: f64,
    /// Its rate, m/s.
    pub rod_velocity_m_per_s: f64,
    /// Absolute pressures of the chambers a and b, Pa.
    pub pressures_pa: [f64; 2],
}

pub const POINT_NUMBERS: usize = 4;

impl Point {
    pub fn of(truth: &Truth, stroke_m: f64) -> [Point; 2] {
        std::array::from_fn(|i| {
            let axis = &truth.axes[i];
            let extension_m = if i == 0 { axis.position_m } else { stroke_m - axis.position_m };
            Point {
                extension_m: extension_m.clamp(0.0, stroke_m),
                rod_velocity_m_per_s: axis.rod_velocity_m_per_s,
                pressures_pa: [axis.pressure_a_pa, axis.pressure_b_pa],
            }
        })
    }

    /// The same with one of its numbers a little larger: by less than the sensors' noise, so that the trajectory stays what it
    /// is.
    #[must_use]
    pub fn nudged(mut self, number: usize) -> Self {
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
    /// Whole windows of the trajectory; what is left over at the end is not looked at.
    pub fn windows(&self) -> usize {
        self.inputs.len().min(self.points.len()) / WINDOW
    }
}
