//! Control algorithms: from the values that the pre-controller computed to the wanted velocity of the rod.
//!
//! ```text
//!   sensors, set-points ──► pre-controller ──► AlgorithmInput ──► Algorithm ──► rod velocity ──► post-controller ──► opening
//! ```
//!
//! Everything is in the axis's own extension: positions grow as its rod comes out, and a positive result extends it,
//! which raises the axis's force sensor's reading when something is in the way. So one algorithm serves both axes.
//! An algorithm holds its state and nothing else: parameters come with each step, since they may change while running.
//! It neither allocates nor blocks; that its result is a number is checked behind it.

use nominal::RigParameters;
use settings::parameters::{Parameter, ParameterSet};

/// Input of a control algorithm, filled in by the pre-controller. The C interface (`struct airbench_ready`) has the same layout:
/// numbers of 8 bytes, in this order.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlgorithmInput {
    /// Time between two steps of the algorithm, s.
    pub period_s: f64,
    /// Extension of the axis's rod, m.
    pub position_m: f64,
    /// Its rate, filtered, m/s.
    pub velocity_m_per_s: f64,
    /// The rate of that, filtered, m/s^2.
    pub acceleration_m_per_s2: f64,
    /// Force sensor of the axis, filtered, N, compression positive.
    pub force_n: f64,
    /// Absolute pressure of the cap-side chamber, filtered, Pa.
    pub pressure_a_pa: f64,
    /// Absolute pressure of the rod-side chamber, filtered, Pa.
    pub pressure_b_pa: f64,
    /// Absolute pressure of the supply as the rig reports it, Pa.
    pub supply_pressure_pa: f64,
    /// Set-point of the extension, m.
    pub set_position_m: f64,
    /// Its rate, m/s.
    pub set_velocity_m_per_s: f64,
    /// The rate of that, m/s^2.
    pub set_acceleration_m_per_s2: f64,
    /// Set-point of the force, N.
    pub set_force_n: f64,
    /// Its rate, N/s.
    pub set_force_rate_n_per_s: f64,
    /// The last result as the valve could apply it, m/s: differs when the post-controller limited it. For the anti-windup of
    /// integral parts.
    pub applied_velocity_m_per_s: f64,
}

/// A control algorithm of one axis, with the values of its parameters in the order of its table.
pub trait Algorithm: Send {
    /// Resets integral and memory. The axis has been without control before.
    ///
    /// # Panics
    /// When `parameters` are not as many as its table has.
    fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]);

    /// The velocity that the rod shall have, m/s.
    ///
    /// # Panics
    /// When `parameters` are not as many as its table has.
    fn step(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> f64;
}

/// A control algorithm whose parameters are declared by [`settings::parameters!`] and read as fields; each is an [`Algorithm`].
pub trait ControlLaw: Send {
    /// Fields that are read from the values of the program, each by its place in the table.
    type Parameters: ParameterSet;

    /// Resets integral and memory, if it has any. The axis has been without control before.
    fn reset(&mut self, _input: &AlgorithmInput, _parameters: &Self::Parameters) {}

    /// The velocity that the rod shall have, m/s.
    fn step(&mut self, input: &AlgorithmInput, parameters: &Self::Parameters) -> f64;
}

impl<L: ControlLaw> Algorithm for L {
    fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]) {
        ControlLaw::reset(self, input, &L::Parameters::of(parameters));
    }

    fn step(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> f64 {
        ControlLaw::step(self, input, &L::Parameters::of(parameters))
    }
}

/// Controlled quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Extension of the rod, m.
    Position,
    /// The force between rod and carriage.
    Force,
}

impl Quantity {
    /// Its word in texts.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Force => "force",
        }
    }
}

/// Largest result, m/s: several times what any valve of this rig gives.
pub const LARGEST_M_PER_S: f64 = 5.0;

/// An algorithm that can be asked for by name.
pub struct Kind {
    /// Name in a program file.
    pub name: &'static str,
    /// One sentence for lists.
    pub about: &'static str,
    /// Quantity that it controls.
    pub controls: Quantity,
    /// Its parameters, in the order of the slices.
    pub parameters: &'static [Parameter],
    /// Makes one, for a rig of these nominal numbers.
    pub make: fn(&RigParameters) -> Box<dyn Algorithm>,
}
