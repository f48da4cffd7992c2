//! Channels of a record, their names and units.

use plant::Axis;
use std::fmt;

/// A sensor of an axis, or the valve command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Signal {
    /// Valve command that acts over the row's period, -1 to 1.
    Valve,
    /// Position in coordinates of the rig, m.
    Position,
    /// Force between rod and carriage, N, compression positive.
    Force,
    /// Absolute pressure of chamber a, the cap side, Pa.
    PressureA,
    /// Absolute pressure of chamber b, the rod side, Pa.
    PressureB,
    /// Force of a known drive that is no cylinder, N, in the direction of growing position; foreign records only.
    AppliedForce,
}

/// A column of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Channel {
    /// A signal of an axis.
    Of(Axis, Signal),
    /// Absolute pressure of the supply node, Pa.
    SupplyPressure,
}

impl Signal {
    /// All signals, in the order of a measurement's columns.
    pub const ALL: [Signal; 6] = [
        Signal::Valve,
        Signal::Position,
        Signal::Force,
        Signal::PressureA,
        Signal::PressureB,
        Signal::AppliedForce,
    ];

    const fn column(self) -> &'static str {
        match self {
            Signal::Valve => "valve",
            Signal::Position => "position_m",
            Signal::Force => "force_N",
            Signal::PressureA => "pressure_a_Pa",
            Signal::PressureB => "pressure_b_Pa",
            Signal::AppliedForce => "applied_force_N",
        }
    }
}

/// Quantity of a channel, which determines its units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A share, without a unit.
    Opening,
    /// In m.
    Length,
    /// In N.
    Force,
    /// In Pa, absolute.
    Pressure,
}

impl Channel {
    /// Number of channels.
    pub const COUNT: usize = 2 * Signal::ALL.len() + 1;

    /// All channels: the drive's, the load's, the supply.
    pub const ALL: [Channel; Self::COUNT] = {
        let mut all = [Channel::SupplyPressure; Self::COUNT];
        let mut at = 0;
        while at < Signal::ALL.len() {
            all[at] = Channel::Of(Axis::Drive, Signal::ALL[at]);
            all[Signal::ALL.len() + at] = Channel::Of(Axis::Load, Signal::ALL[at]);
            at += 1;
        }
        all
    };

    /// Its place in [`Channel::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Channel::Of(axis, signal) => axis.index() * Signal::ALL.len() + signal as usize,
            Channel::SupplyPressure => Self::COUNT - 1,
        }
    }

    /// Its column in `measurement.csv`.
    #[must_use]
    pub fn column(self) -> String {
        self.to_string()
    }

    /// The channel that a mapping calls so.
    pub(crate) fn of_mapping(name: &str) -> Option<Channel> {
        Self::ALL.into_iter().find(|channel| channel.to_string() == name)
    }

    /// Whether no `measurement.csv` holds it.
    #[must_use]
    pub fn foreign_only(self) -> bool {
        matches!(self, Channel::Of(_, Signal::AppliedForce))
    }

    /// The quantity that it is in.
    #[must_use]
    pub fn quantity(self) -> Quantity {
        match self {
            Channel::Of(_, Signal::Valve) => Quantity::Opening,
            Channel::Of(_, Signal::Position) => Quantity::Length,
            Channel::Of(_, Signal::Force | Signal::AppliedForce) => Quantity::Force,
            Channel::Of(_, Signal::PressureA | Signal::PressureB) | Channel::SupplyPressure => {
                Quantity::Pressure
            }
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Channel::Of(axis, signal) => write!(f, "{}_{}", axis.name(), signal.column()),
            Channel::SupplyPressure => f.write_str("supply_pressure_Pa"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_channel_has_its_place_and_its_name() {
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            assert_eq!(channel.index(), place);
            assert_eq!(Channel::of_mapping(&channel.column()), Some(channel));
        }
    }

    #[test]
    fn the_columns_are_those_that_the_rig_writes() {
        let written = runlog::cycle_tables::MEASURED;
        let known: Vec<_> = Channel::ALL.into_iter().filter(|channel| !channel.foreign_only()).collect();
        let known: Vec<_> = known.iter().map(|channel| channel.column()).collect();
        assert_eq!(known[..written.len()], written);
        assert_eq!(known[written.len()..], ["supply_pressure_Pa"]);
    }
}
