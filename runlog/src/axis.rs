//! The axes of the rig, as the files of a run name them.

use serde::{Deserialize, Serialize};

/// An axis of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Axis {
    /// The axis whose rod moves the carriage.
    Drive,
    /// The axis whose rod ends in the load eye.
    Load,
}

impl Axis {
    /// Both axes, in the order of every array of two.
    pub const ALL: [Self; 2] = [Self::Drive, Self::Load];
    /// [`Axis::name`] of each.
    pub const NAMES: [&'static str; 2] = [Self::Drive.name(), Self::Load.name()];

    /// `drive` or `load`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::Load => "load",
        }
    }
}
