//! Set-points: where the axis shall be, or how hard it shall press, at a time since the experiment began.
//!
//! A [`Motion`] is a row of segments of position, a [`ForceProfile`] one of force. Each segment follows a law; each law is a
//! file of its own beside this one ([`law::KINDS`] lists them), and those that serve positions serve forces too where that makes
//! sense. Loads that answer what the axis does (spring, damper, mass, dry friction) are in [`force`].
//!
//! Positions are rig coordinates, in m; forces are in N, compression positive: a load that presses opposes the drive's extension.
//! Nothing here changes while it runs, allocates or blocks; the little that a force remembers is in [`ForceSource`].

mod bestehorn;
pub mod force;
pub mod law;
mod modified_sine;
mod oscillation;
mod pseudo_random_steps;
mod ramp;
pub(crate) mod reading;
mod row;
mod step;
mod table;
mod trapezoidal;

pub use bestehorn::SmoothTransition;
pub(crate) use force::{ForceProfile, ForceSource};

use law::{Law, ProfilePoint};
use row::{Row, RowPosition};
use std::sync::Arc;

/// A position set-point with its derivatives, in rig coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
    /// Position, m.
    pub position_m: f64,
    /// Its rate, m/s; a jump of the position does not show in it.
    pub velocity_m_per_s: f64,
    /// The rate of that, m/s^2; a jump of the velocity does not show in it.
    pub acceleration_m_per_s2: f64,
    /// Whether the set-point changes; at rest both error figures are judged otherwise.
    pub moving: bool,
}

impl SetPoint {
    /// A set-point that holds this position.
    pub const fn at_rest(position_m: f64) -> Self {
        Self { position_m, velocity_m_per_s: 0.0, acceleration_m_per_s2: 0.0, moving: false }
    }
}

impl From<ProfilePoint> for SetPoint {
    fn from(point: ProfilePoint) -> Self {
        let ProfilePoint { value, rate, acceleration, moving } = point;
        Self { position_m: value, velocity_m_per_s: rate, acceleration_m_per_s2: acceleration, moving }
    }
}

impl From<SetPoint> for ProfilePoint {
    fn from(point: SetPoint) -> Self {
        let SetPoint { position_m, velocity_m_per_s, acceleration_m_per_s2, moving } = point;
        Self { value: position_m, rate: velocity_m_per_s, acceleration: acceleration_m_per_s2, moving }
    }
}

/// A force set-point with its rate, compression positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceSetPoint {
    /// Force, N.
    pub force_n: f64,
    /// Its rate, N/s; a jump of the force does not show in it, and it is 0 where the force is limited.
    pub rate_n_per_s: f64,
    /// Whether the set-point changes; always true of a load that follows the motion of the axis.
    pub moving: bool,
}

impl ForceSetPoint {
    /// A set-point that holds this force.
    pub const fn at_rest(force_n: f64) -> Self {
        Self { force_n, rate_n_per_s: 0.0, moving: false }
    }
}

impl From<ProfilePoint> for ForceSetPoint {
    fn from(point: ProfilePoint) -> Self {
        Self { force_n: point.value, rate_n_per_s: point.rate, moving: point.moving }
    }
}

impl From<ForceSetPoint> for ProfilePoint {
    fn from(point: ForceSetPoint) -> Self {
        Self { value: point.force_n, rate: point.rate_n_per_s, acceleration: 0.0, moving: point.moving }
    }
}

/// Measured and filtered motion of the axis, in rig coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Actual {
    pub(crate) position_m: f64,
    pub(crate) velocity_m_per_s: f64,
    pub(crate) acceleration_m_per_s2: f64,
}

/// Position over time: a start and a row of segments.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    row: Row<Arc<dyn Law>>,
}

impl Motion {
    /// The set-point `time_s` after the start: the start before it, the end from the end on.
    pub(crate) fn at(&self, time_s: f64) -> SetPoint {
        let point = match self.row.locate(time_s) {
            RowPosition::Before => ProfilePoint::at_rest(self.start_m()),
            RowPosition::In { segment, since_s, .. } => segment.at(since_s),
            RowPosition::After => ProfilePoint::at_rest(self.end_m()),
        };
        point.into()
    }

    /// From the start to the end of the row, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.row.duration_s()
    }

    pub(crate) fn start_m(&self) -> f64 {
        self.row.start
    }

    pub(crate) fn end_m(&self) -> f64 {
        self.row.end
    }
}

#[cfg(test)]
mod tests;
