//! The rows of the table, group by group.

use super::{BusKind, Channel, FaultKey, FaultSpec, Group, Kind, Places, SensorKind};

/// The table, group by group.
pub const TABLE: &[&[FaultSpec]] = &[POSITION, FORCE, PRESSURE, VALVE, SUPPLY, AIR, MECHANICS, BUS];

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
