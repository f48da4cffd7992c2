//! The table of all faults that can be injected.
//!
//! Script reader, console, listing, page and tests read it; a new fault is a row. Its effect is an arm in [`super::overlay`],
//! for a sensor in [`put_sensor`], for frames and nodes in the wire; [`super::schedule`] has the faults that act once or end by
//! an event. This file defines a row, `rows.rs` has the rows.

mod rows;

use plant::Axis;
use plant::faults::SensorFault;
use protocol::bus::WireNode;
use protocol::frames::{DRIVE_SENSORS, DRIVE_VALVE_COMMAND, LOAD_SENSORS, LOAD_VALVE_COMMAND, MESSAGES};
use runlog::telemetry::{FaultGroup, FaultKey};

/// Most numbers of a fault.
pub(crate) const MOST_KEYS: usize = 3;

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FaultSpec {
    /// Name, as in scripts and at the console.
    pub name: &'static str,
    pub group: FaultGroup,
    pub places: Places,
    pub keys: &'static [FaultKey],
    /// Its effect, in a sentence.
    pub about: &'static str,
    pub kind: Kind,
}

/// Possible places of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Places {
    /// `drive` or `load`.
    Axis,
    /// A chamber, or its sensor.
    Chamber,
    Supply,
    Linkage,
    /// All frames, or those of one identifier by its name in `rig.dbc`.
    Frames,
    /// Frames with a counter (`alive`): sensors and valve commands.
    Counted,
    Bus,
    Node,
}

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// Of a sensor: the channel of the axis, or that of the chamber.
    Sensor(Channel, SensorKind),
    ValveStuck,
    /// A first-order lag before the spool.
    ValveSlow,
    /// An opening added to the command.
    ValveOffset,
    /// A limit on the magnitude of the opening.
    ValveLimited,
    ValveDead,
    SupplySag,
    SupplyLoss,
    /// A laminar gap from a chamber to the atmosphere.
    Leak,
    /// An orifice from a chamber to the atmosphere, with the flow law of the valve.
    Burst,
    FrictionRise,
    Unlink,
    AddedMass,
    /// A force towards an end of the stroke.
    EndStopHit,
    Bus(BusKind),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    Position,
    Force,
    /// Pressure of the chamber of the place.
    Pressure,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SensorKind {
    Stuck,
    /// An error that grows with time.
    Drift,
    Offset,
    Gain,
    Noise,
    /// The low end of the range.
    Dropout,
    /// Errors of single samples.
    Spike,
    Quantisation,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BusKind {
    Loss,
    Delay,
    Duplication,
    Reordering,
    Corruption,
    WrongLength,
    WrongCounter,
    Babbling,
    BusOff,
}

/// Nodes in the order of their places.
pub(crate) const NODES: [(&str, WireNode); 3] = [
    ("rig", WireNode::Rig),
    ("drive-controller", WireNode::DriveController),
    ("load-controller", WireNode::LoadController),
];

impl Places {
    pub(crate) fn names(self) -> Vec<String> {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let frame = |name: &str| format!("bus.{name}");
        match self {
            Self::Axis => owned(&Axis::ALL.map(Axis::name)),
            Self::Chamber => owned(&["drive.a", "drive.b", "load.a", "load.b"]),
            Self::Supply => owned(&["supply"]),
            Self::Linkage => owned(&["linkage"]),
            Self::Bus => owned(&["bus"]),
            Self::Node => NODES.iter().map(|(name, _)| (*name).to_owned()).collect(),
            Self::Counted => COUNTED.iter().map(|(name, _)| frame(name)).collect(),
            Self::Frames => std::iter::once("bus".to_owned())
                .chain(MESSAGES.iter().map(|spec| frame(spec.name)))
                .collect(),
        }
    }

    /// Whether the first place is the default.
    pub(crate) fn has_default_place(self) -> bool {
        matches!(self, Self::Supply | Self::Linkage | Self::Bus | Self::Frames)
    }

    /// The identifier of a place of frames; `None` for all frames.
    pub(crate) fn frame_id(self, place: usize) -> Option<u16> {
        match self {
            Self::Frames => place.checked_sub(1).map(|message| MESSAGES[message].id),
            Self::Counted => Some(COUNTED[place].1),
            _ => None,
        }
    }
}

const COUNTED: [(&str, u16); 4] = [
    (DRIVE_SENSORS.name, DRIVE_SENSORS.id),
    (LOAD_SENSORS.name, LOAD_SENSORS.id),
    (DRIVE_VALVE_COMMAND.name, DRIVE_VALVE_COMMAND.id),
    (LOAD_VALVE_COMMAND.name, LOAD_VALVE_COMMAND.id),
];

pub(crate) use rows::TABLE;

pub(crate) fn all() -> impl Iterator<Item = &'static FaultSpec> {
    TABLE.iter().flat_map(|rows| rows.iter())
}

pub(crate) fn spec(name: &str) -> Option<&'static FaultSpec> {
    all().find(|spec| spec.name == name)
}

/// Adds a fault to a sensor's other faults.
pub(super) fn put_sensor(kind: SensorKind, values: [f64; MOST_KEYS], into: &mut SensorFault) {
    let [first, second, _] = values;
    match kind {
        SensorKind::Stuck => into.stuck = true,
        SensorKind::Drift => into.drift_per_s += first,
        SensorKind::Offset => into.offset += first,
        SensorKind::Gain => into.gain *= first,
        SensorKind::Noise => into.noise = into.noise.hypot(first),
        SensorKind::Dropout => into.dropout = into.dropout.max(first),
        SensorKind::Spike => (into.spike, into.spike_every) = (first, second as u32),
        SensorKind::Quantisation => into.step = into.step.max(first),
    }
}
