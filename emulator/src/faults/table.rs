//! The table: every fault that can be put into a run, and everything that is known of one before it happens.
//!
//! The reader of scripts, the console, the listing, the page and the tests all read it; a new fault is a row here, and an arm in
//! [`super::overlay`] that says what it does.

use plant::faults::SensorFault;
use protocol::bus::WireNode;
use protocol::frames::{DRIVE_SENSORS, DRIVE_VALVE_COMMAND, LOAD_SENSORS, LOAD_VALVE_COMMAND, MESSAGES};

/// Most numbers that a fault has.
pub const MOST_KEYS: usize = 3;

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultSpec {
    /// Name, as in scripts and at the console.
    pub name: &'static str,
    /// What it concerns.
    pub group: Group,
    /// Where it can be.
    pub places: Places,
    /// Its numbers.
    pub keys: &'static [FaultKey],
    /// What happens, in a sentence.
    pub about: &'static str,
    /// What it is to the code.
    pub kind: Kind,
}

/// A number of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultKey {
    /// Name, ending in its unit.
    pub name: &'static str,
    /// Unit; `1` for a plain number.
    pub unit: &'static str,
    /// Least allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Value when nothing is said; without one it has to be.
    pub default: Option<f64>,
    /// Whether it is a whole number.
    pub whole: bool,
    /// What it is.
    pub meaning: &'static str,
}

/// What a fault concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// A sensor.
    Sensor,
    /// A valve.
    Valve,
    /// The supply of air.
    Supply,
    /// A chamber or its hose.
    Air,
    /// What moves.
    Mechanics,
    /// Frames and nodes.
    Bus,
}

/// Where faults of a kind can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// `drive` or `load`.
    Axis,
    /// A chamber, or its sensor.
    Chamber,
    /// The supply of both axes.
    Supply,
    /// What joins the rods.
    Linkage,
    /// All frames, or those of one identifier by its name in `rig.dbc`.
    Frames,
    /// Frames that have a counter.
    Counted,
    /// The bus itself.
    Bus,
    /// A node on it.
    Node,
}

/// What a fault is to the code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Of a sensor: which channel of the axis, or that of the chamber.
    Sensor(Channel, SensorKind),
    /// The spool stays.
    ValveStuck,
    /// A lag before the spool.
    ValveSlow,
    /// Added to the command.
    ValveOffset,
    /// The most opening.
    ValveLimited,
    /// No command arrives.
    ValveDead,
    /// Less pressure at the node.
    SupplySag,
    /// No pressure at the node.
    SupplyLoss,
    /// A gap to the atmosphere.
    Leak,
    /// A hole to the atmosphere.
    Burst,
    /// Friction times a factor.
    FrictionRise,
    /// The rods part.
    Unlink,
    /// Mass on top.
    AddedMass,
    /// A push to an end of the stroke.
    EndStopHit,
    /// Frames or nodes.
    Bus(BusKind),
}

/// Channels of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Position.
    Position,
    /// Force.
    Force,
    /// Pressure of the chamber that the place names.
    Pressure,
}

/// What is broken in a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// Shows one value.
    Stuck,
    /// An error that grows.
    Drift,
    /// A constant error.
    Offset,
    /// A factor.
    Gain,
    /// Random errors.
    Noise,
    /// The low end of the range.
    Dropout,
    /// Errors of single samples.
    Spike,
    /// Coarse steps.
    Quantisation,
}

/// What is broken on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusKind {
    /// Frames are lost.
    Loss,
    /// They come later.
    Delay,
    /// They come more than once.
    Duplication,
    /// They overtake each other.
    Reordering,
    /// Bits are inverted.
    Corruption,
    /// Too short or too long.
    WrongLength,
    /// A counter is off.
    WrongCounter,
    /// A node babbles.
    Babbling,
    /// A node is off the bus.
    BusOff,
}

/// Nodes in the order of their places.
pub const NODES: [(&str, WireNode); 3] = [
    ("rig", WireNode::Rig),
    ("drive-controller", WireNode::DriveController),
    ("load-controller", WireNode::LoadController),
];

impl Places {
    /// All places, by name.
    #[must_use]
    pub fn names(self) -> Vec<String> {
        let own = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let frame = |name: &str| format!("bus.{name}");
        match self {
            Self::Axis => own(&["drive", "load"]),
            Self::Chamber => own(&["drive.a", "drive.b", "load.a", "load.b"]),
            Self::Supply => own(&["supply"]),
            Self::Linkage => own(&["linkage"]),
            Self::Bus => own(&["bus"]),
            Self::Node => NODES.iter().map(|(name, _)| (*name).to_owned()).collect(),
            Self::Counted => COUNTED.iter().map(|(name, _)| frame(name)).collect(),
            Self::Frames => std::iter::once("bus".to_owned())
                .chain(MESSAGES.iter().map(|spec| frame(spec.name)))
                .collect(),
        }
    }

    /// Whether the first place is meant when none is named.
    #[must_use]
    pub fn has_usual_place(self) -> bool {
        matches!(self, Self::Supply | Self::Linkage | Self::Bus | Self::Frames)
    }

    /// The identifier that a place of frames names; `None` for all frames.
    #[must_use]
    pub fn frame_id(self, place: usize) -> Option<u16> {
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

impl FaultKey {
    /// Whether the value is one; a NaN lies in no range.
    #[must_use]
    pub fn allows(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value) && (!self.whole || value == value.trunc())
    }

    /// The allowed values in words.
    #[must_use]
    pub fn range(&self) -> String {
        let whole = if self.whole { "whole numbers from " } else { "" };
        let unit = if self.unit == "1" { "" } else { self.unit };
        format!("{whole}{} to {} {unit}", self.min, self.max).trim_end().to_owned()
    }
}

impl Group {
    /// In words, as a heading.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sensor => "sensor",
            Self::Valve => "valve",
            Self::Supply => "supply",
            Self::Air => "air",
            Self::Mechanics => "mechanics",
            Self::Bus => "bus",
        }
    }
}

const fn key(
    name: &'static str,
    unit: &'static str,
    [min, max]: [f64; 2],
    default: Option<f64>,
    meaning: &'static str,
) -> FaultKey {
    FaultKey { name, unit, min, max, default, whole: false, meaning }
}

const fn whole(
    name: &'static str,
    unit: &'static str,
    range: [f64; 2],
    default: f64,
    meaning: &'static str,
) -> FaultKey {
    FaultKey { whole: true, ..key(name, unit, range, Some(default), meaning) }
}

const PROBABILITY: FaultKey = key("probability", "1", [0.0, 1.0], Some(1.0), "for each frame");
const SELDOM: FaultKey = FaultKey { default: Some(0.1), ..PROBABILITY };

/// The eight faults of a kind of sensor: its name, channel, places, unit, the unit in keys, the end of its range, a small error.
macro_rules! sensor {
    ($quantity:literal, $channel:ident, $places:ident, $unit:literal, $suffix:literal, $most:literal, $small:literal) => {
        &[
            FaultSpec {
                name: concat!($quantity, "-sensor-stuck"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[],
                about: "shows the value of the sample in which it stuck",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Stuck),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-drift"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key(
                    concat!("drift_", $suffix, "_per_s"),
                    concat!($unit, "/s"),
                    [-$most, $most],
                    None,
                    "how fast the error grows, from 0 at the beginning",
                )],
                about: "an error that grows with time",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Drift),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-offset"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key(concat!("offset_", $suffix), $unit, [-$most, $most], None, "added to the value")],
                about: "a constant error",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Offset),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-gain"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key("gain", "1", [-10.0, 10.0], None, "shown over true; 1 is sound")],
                about: "an error in proportion to the value",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Gain),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-noise"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key(
                    concat!("noise_", $suffix),
                    $unit,
                    [0.0, $most],
                    Some($small),
                    "standard deviation, on top of the sensor's own",
                )],
                about: "Gaussian noise",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Noise),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-dropout"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key("probability", "1", [0.0, 1.0], Some(1.0), "for each sample")],
                about: "the wire breaks: the low end of the range, with the flag of saturation",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Dropout),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-spike"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[
                    key(concat!("spike_", $suffix), $unit, [-$most, $most], None, "added to single samples"),
                    whole("every_ms", "ms", [1.0, 60_000.0], 100.0, "from one to the next"),
                ],
                about: "single samples are off",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Spike),
            },
            FaultSpec {
                name: concat!($quantity, "-sensor-quantisation"),
                group: Group::Sensor,
                places: Places::$places,
                keys: &[key(
                    concat!("step_", $suffix),
                    $unit,
                    [0.0, $most],
                    Some($small),
                    "step of the values",
                )],
                about: "shows multiples of a coarse step",
                kind: Kind::Sensor(Channel::$channel, SensorKind::Quantisation),
            },
        ]
    };
}

const POSITION: &[FaultSpec] = sensor!("position", Position, Axis, "m", "m", 0.5, 0.001);
const FORCE: &[FaultSpec] = sensor!("force", Force, Axis, "N", "n", 2000.0, 20.0);
const PRESSURE: &[FaultSpec] = sensor!("pressure", Pressure, Chamber, "Pa", "pa", 1e6, 20_000.0);

const fn at_axis(
    name: &'static str,
    group: Group,
    kind: Kind,
    keys: &'static [FaultKey],
    about: &'static str,
) -> FaultSpec {
    FaultSpec { name, group, places: Places::Axis, keys, about, kind }
}

const VALVE: &[FaultSpec] = &[
    at_axis(
        "valve-stuck",
        Group::Valve,
        Kind::ValveStuck,
        &[],
        "the spool stays where it is, also in an emergency stop",
    ),
    at_axis(
        "valve-slow",
        Group::Valve,
        Kind::ValveSlow,
        &[key("time_constant_s", "s", [0.0001, 100.0], Some(0.05), "of a lag before the spool's own")],
        "the spool follows late",
    ),
    at_axis(
        "valve-offset",
        Group::Valve,
        Kind::ValveOffset,
        &[key("offset", "1", [-1.0, 1.0], None, "added to the command; 1 is fully open")],
        "the valve's zero is off, also in an emergency stop",
    ),
    at_axis(
        "valve-limited",
        Group::Valve,
        Kind::ValveLimited,
        &[key("limit", "1", [0.0, 1.0], None, "most opening to either side")],
        "the valve opens no further than this",
    ),
    at_axis(
        "valve-dead",
        Group::Valve,
        Kind::ValveDead,
        &[],
        "no command arrives, springs centre the spool: shut",
    ),
];

const SUPPLY: &[FaultSpec] = &[
    FaultSpec {
        name: "supply-sag",
        group: Group::Supply,
        places: Places::Supply,
        keys: &[
            key(
                "drop_pa",
                "Pa",
                [0.0, 1e6],
                None,
                "how far below the set pressure; no further than the atmosphere",
            ),
            key("time_constant_s", "s", [0.001, 1000.0], Some(0.3), "with which it falls"),
        ],
        about: "the supply falls; below the pilot pressure the check valves close",
        kind: Kind::SupplySag,
    },
    FaultSpec {
        name: "supply-loss",
        group: Group::Supply,
        places: Places::Supply,
        keys: &[key("time_constant_s", "s", [0.001, 1000.0], Some(0.05), "with which it falls")],
        about: "the supply falls to the atmosphere; the check valves close, and no stop is told on the bus",
        kind: Kind::SupplyLoss,
    },
];

const AIR: &[FaultSpec] = &[
    FaultSpec {
        name: "chamber-leak",
        group: Group::Air,
        places: Places::Chamber,
        keys: &[key(
            "leakage_nl_per_min",
            "Nl/min",
            [0.0, 2000.0],
            None,
            "from 6 to 1 bar absolute; laminar",
        )],
        about: "air leaves the chamber through a gap",
        kind: Kind::Leak,
    },
    FaultSpec {
        name: "hose-burst",
        group: Group::Air,
        places: Places::Chamber,
        keys: &[key(
            "kv_m3_per_h",
            "m3/h",
            [0.001, 5.0],
            Some(1.0),
            "K_V of the hole, by the valve's own law",
        )],
        about: "the hose is open to the atmosphere; a shut chamber empties with tau = V / (p_N 12.95 K_V)",
        kind: Kind::Burst,
    },
];

const MECHANICS: &[FaultSpec] = &[
    at_axis(
        "friction-rise",
        Group::Mechanics,
        Kind::FrictionRise,
        &[key("factor", "1", [0.0, 100.0], None, "all friction times this; 1 is sound")],
        "break-away, sliding and viscous friction rise together",
    ),
    FaultSpec {
        name: "mechanical-unlink",
        group: Group::Mechanics,
        places: Places::Linkage,
        keys: &[],
        about: "the rods part, once; people may link them again",
        kind: Kind::Unlink,
    },
    at_axis(
        "added-mass",
        Group::Mechanics,
        Kind::AddedMass,
        &[key("mass_kg", "kg", [0.0, 100.0], None, "moves with the axis, beside the weights of people")],
        "something heavy is caught; its weight pulls nowhere",
    ),
    at_axis(
        "end-stop-hit",
        Group::Mechanics,
        Kind::EndStopHit,
        &[key(
            "force_n",
            "N",
            [-5000.0, 5000.0],
            Some(3000.0),
            "a push from outside; positive extends the rod",
        )],
        "the axis is pushed until its piston hits an end of the stroke, and then let go; trapped air may hold it off",
    ),
];

const fn on_bus(
    name: &'static str,
    kind: BusKind,
    places: Places,
    keys: &'static [FaultKey],
    about: &'static str,
) -> FaultSpec {
    FaultSpec { name, group: Group::Bus, places, keys, about, kind: Kind::Bus(kind) }
}

const BUS: &[FaultSpec] = &[
    on_bus(
        "bus-loss",
        BusKind::Loss,
        Places::Frames,
        &[PROBABILITY],
        "frames are lost for all; ?loss=P of the bus's URL is this one, from the start to the end",
    ),
    on_bus(
        "bus-delay",
        BusKind::Delay,
        Places::Frames,
        &[whole("delay_ms", "ms", [1.0, 10_000.0], 5.0, "by how much")],
        "frames come later, in their order",
    ),
    on_bus(
        "bus-duplication",
        BusKind::Duplication,
        Places::Frames,
        &[SELDOM, whole("copies", "1", [1.0, 10.0], 1.0, "how often more")],
        "frames come more than once",
    ),
    on_bus(
        "bus-reordering",
        BusKind::Reordering,
        Places::Frames,
        &[SELDOM],
        "a frame is overtaken by the next one of its identifier",
    ),
    on_bus(
        "bus-corruption",
        BusKind::Corruption,
        Places::Frames,
        &[SELDOM, whole("bits", "1", [1.0, 64.0], 1.0, "drawn in each frame and inverted")],
        "bits of the data are inverted by the sender: CAN's checksum is right, the frame's own is not",
    ),
    on_bus(
        "wrong-length",
        BusKind::WrongLength,
        Places::Frames,
        &[SELDOM, whole("bytes", "1", [0.0, 8.0], 3.0, "of data instead; cut, or padded with 0")],
        "frames are too short or too long",
    ),
    on_bus(
        "wrong-counter",
        BusKind::WrongCounter,
        Places::Counted,
        &[SELDOM, whole("step", "1", [1.0, 15.0], 5.0, "by how much")],
        "the counter of sensors or commands is off; the checksum is right",
    ),
    on_bus(
        "babbling-node",
        BusKind::Babbling,
        Places::Bus,
        &[
            whole("id", "1", [0.0, 2047.0], 16.0, "its identifier; the lowest wins the bus"),
            key("frames_per_ms", "1/ms", [0.001, 20.0], Some(3.0), "how often"),
            whole("bytes", "1", [0.0, 8.0], 8.0, "of data, all 0"),
        ],
        "a node more says the same over and over; on a wire with a bit rate it takes the others' time",
    ),
    on_bus(
        "bus-off",
        BusKind::BusOff,
        Places::Node,
        &[],
        "the node hears nothing and is not heard; a process for both axes is one node",
    ),
];

/// The table, group by group.
pub const TABLE: &[&[FaultSpec]] = &[POSITION, FORCE, PRESSURE, VALVE, SUPPLY, AIR, MECHANICS, BUS];

/// All rows.
pub fn all() -> impl Iterator<Item = &'static FaultSpec> {
    TABLE.iter().flat_map(|rows| rows.iter())
}

/// The row of a name.
#[must_use]
pub fn spec(name: &str) -> Option<&'static FaultSpec> {
    all().find(|spec| spec.name == name)
}

/// Puts a sensor's fault with its numbers into what else is broken in it.
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
