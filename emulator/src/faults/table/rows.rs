//! The rows of the table, group by group.

use super::{BusKind, Channel, FaultSpec, Kind, Places, SensorKind};
use runlog::telemetry::{FaultGroup, FaultKey};
use std::borrow::Cow;

/// The table, group by group.
pub(crate) const TABLE: &[&[FaultSpec]] = &[POSITION, FORCE, PRESSURE, VALVE, SUPPLY, AIR, MECHANICS, BUS];

const fn key(
    name: &'static str,
    unit: &'static str,
    [min, max]: [f64; 2],
    default: Option<f64>,
    meaning: &'static str,
) -> FaultKey {
    let (name, unit, meaning) = (Cow::Borrowed(name), Cow::Borrowed(unit), Cow::Borrowed(meaning));
    FaultKey { name, unit, min, max, default, whole: false, meaning }
}

const fn whole(
    name: &'static str,
    unit: &'static str,
    range: [f64; 2],
    default: f64,
    meaning: &'static str,
) -> FaultKey {
    let mut key = key(name, unit, range, Some(default), meaning);
    key.whole = true;
    key
}

const PROBABILITY: FaultKey = key("probability", "1", [0.0, 1.0], Some(1.0), "for each frame");
const PROBABILITY_TENTH: FaultKey = key("probability", "1", [0.0, 1.0], Some(0.1), "for each frame");

/// The rows of a group: name, places, kind, effect, numbers.
macro_rules! rows {
    ($group:ident { $($name:expr, $places:ident, $kind:expr, $about:literal, [$($key:expr),*];)* }) => {
        &[$(FaultSpec {
            name: $name,
            group: FaultGroup::$group,
            places: Places::$places,
            keys: &[$($key),*],
            about: $about,
            kind: $kind,
        }),*]
    };
}

/// The faults of a kind of sensor: its name, channel, places, unit, the unit in keys, the end of its range, a small
/// error.
macro_rules! sensor {
    ($quantity:literal, $channel:ident, $places:ident, $unit:literal, $suffix:literal, $most:literal, $small:literal) => {
        rows! { Sensor {
            concat!($quantity, "-sensor-stuck"), $places, Kind::Sensor(Channel::$channel, SensorKind::Stuck),
                "shows the value of the sample in which it stuck", [];
            concat!($quantity, "-sensor-drift"), $places, Kind::Sensor(Channel::$channel, SensorKind::Drift),
                "an error that grows with time",
                [key(concat!("drift_", $suffix, "_per_s"), concat!($unit, "/s"), [-$most, $most], None,
                    "how fast the error grows, from 0 at the beginning")];
            concat!($quantity, "-sensor-offset"), $places, Kind::Sensor(Channel::$channel, SensorKind::Offset),
                "a constant error",
                [key(concat!("offset_", $suffix), $unit, [-$most, $most], None, "added to the value")];
            concat!($quantity, "-sensor-gain"), $places, Kind::Sensor(Channel::$channel, SensorKind::Gain),
                "an error in proportion to the value",
                [key("gain", "1", [-10.0, 10.0], None, "shown over true value; 1 is without fault")];
            concat!($quantity, "-sensor-noise"), $places, Kind::Sensor(Channel::$channel, SensorKind::Noise),
                "Gaussian noise",
                [key(concat!("noise_", $suffix), $unit, [0.0, $most], Some($small),
                    "standard deviation, on top of the sensor's own")];
            concat!($quantity, "-sensor-dropout"), $places, Kind::Sensor(Channel::$channel, SensorKind::Dropout),
                "the wire breaks: the low end of the range, with the flag of saturation",
                [key("probability", "1", [0.0, 1.0], Some(1.0), "for each sample")];
            concat!($quantity, "-sensor-spike"), $places, Kind::Sensor(Channel::$channel, SensorKind::Spike),
                "single samples are off",
                [key(concat!("spike_", $suffix), $unit, [-$most, $most], None, "added to single samples"),
                    whole("every_ms", "ms", [1.0, 60_000.0], 100.0, "from one to the next")];
            concat!($quantity, "-sensor-quantisation"), $places, Kind::Sensor(Channel::$channel, SensorKind::Quantisation),
                "shows multiples of a coarse step",
                [key(concat!("step_", $suffix), $unit, [0.0, $most], Some($small), "step of the values")];
        } }
    };
}

const POSITION: &[FaultSpec] = sensor!("position", Position, Axis, "m", "m", 0.5, 0.001);
const FORCE: &[FaultSpec] = sensor!("force", Force, Axis, "N", "n", 2000.0, 20.0);
const PRESSURE: &[FaultSpec] = sensor!("pressure", Pressure, Chamber, "Pa", "pa", 1e6, 20_000.0);

const VALVE: &[FaultSpec] = rows! { Valve {
    "valve-stuck", Axis, Kind::ValveStuck, "the spool stays where it is, also in an emergency stop", [];
    "valve-slow", Axis, Kind::ValveSlow, "the spool follows late",
        [key("time_constant_s", "s", [0.0001, 100.0], Some(0.05), "of a lag before the spool's own")];
    "valve-offset", Axis, Kind::ValveOffset, "the valve's zero is off, also in an emergency stop",
        [key("offset", "1", [-1.0, 1.0], None, "added to the command; 1 is fully open")];
    "valve-limited", Axis, Kind::ValveLimited, "the valve opens no further than this",
        [key("limit", "1", [0.0, 1.0], None, "largest opening to either side")];
    "valve-dead", Axis, Kind::ValveDead, "no command arrives, springs centre the spool: shut", [];
} };

const SUPPLY: &[FaultSpec] = rows! { Supply {
    "supply-sag", Supply, Kind::SupplySag, "the supply falls; below the pilot pressure the check valves close",
        [key("drop_pa", "Pa", [0.0, 1e6], None, "how far below the set pressure; no further than the atmosphere"),
            key("time_constant_s", "s", [0.001, 1000.0], Some(0.3), "with which it falls")];
    "supply-loss", Supply, Kind::SupplyLoss,
        "the supply falls to the atmosphere; the check valves close, and no emergency stop is sent on the bus",
        [key("time_constant_s", "s", [0.001, 1000.0], Some(0.05), "with which it falls")];
} };

const AIR: &[FaultSpec] = rows! { Air {
    "chamber-leak", Chamber, Kind::Leak, "air leaves the chamber through a gap",
        [key("leakage_nl_per_min", "Nl/min", [0.0, 2000.0], None, "from 6 to 1 bar absolute; laminar")];
    "hose-burst", Chamber, Kind::Burst,
        "the hose is open to the atmosphere; a shut chamber empties with tau = V / (p_N 12.95 K_V)",
        [key("kv_m3_per_h", "m3/h", [0.001, 5.0], Some(1.0), "K_V of the hole, by the valve's own law")];
} };

const MECHANICS: &[FaultSpec] = rows! { Mechanics {
    "friction-rise", Axis, Kind::FrictionRise, "break-away, sliding and viscous friction rise together",
        [key("factor", "1", [0.0, 100.0], None, "all friction times this; 1 is without fault")];
    "mechanical-unlink", Linkage, Kind::Unlink, "the rods part, once; people may link them again", [];
    "added-mass", Axis, Kind::AddedMass, "a mass is coupled to the axis; gravity on it has no effect",
        [key("mass_kg", "kg", [0.0, 100.0], None, "moves with the axis, beside the weights of people")];
    "end-stop-hit", Axis, Kind::EndStopHit,
        "the axis is pushed until its piston hits an end of the stroke, and then let go; trapped air may hold it off",
        [key("force_n", "N", [-5000.0, 5000.0], Some(3000.0), "a push from outside; positive extends the rod")];
} };

const BUS: &[FaultSpec] = rows! { Bus {
    "bus-loss", Frames, Kind::Bus(BusKind::Loss),
        "frames are lost for all; ?loss=P of the bus's URL is this one, from the start to the end", [PROBABILITY];
    "bus-delay", Frames, Kind::Bus(BusKind::Delay), "frames come later, in their order",
        [whole("delay_ms", "ms", [1.0, 10_000.0], 5.0, "by how much")];
    "bus-duplication", Frames, Kind::Bus(BusKind::Duplication), "frames come more than once",
        [PROBABILITY_TENTH, whole("copies", "1", [1.0, 10.0], 1.0, "additional copies")];
    "bus-reordering", Frames, Kind::Bus(BusKind::Reordering),
        "a frame is overtaken by the next one of its identifier", [PROBABILITY_TENTH];
    "bus-corruption", Frames, Kind::Bus(BusKind::Corruption),
        "bits of the data are inverted by the sender: CAN's checksum is right, the frame's own is not",
        [PROBABILITY_TENTH, whole("bits", "1", [1.0, 64.0], 1.0, "drawn in each frame and inverted")];
    "wrong-length", Frames, Kind::Bus(BusKind::WrongLength), "frames are too short or too long",
        [PROBABILITY_TENTH, whole("bytes", "1", [0.0, 8.0], 3.0, "of data instead; cut, or padded with 0")];
    "wrong-counter", Counted, Kind::Bus(BusKind::WrongCounter),
        "the counter of sensors or commands is off; the checksum is right",
        [PROBABILITY_TENTH, whole("step", "1", [1.0, 15.0], 5.0, "by how much")];
    "babbling-node", Bus, Kind::Bus(BusKind::Babbling),
        "an additional node repeats one frame; on a wire with a bit rate it takes the others' time",
        [whole("id", "1", [0.0, 2047.0], 16.0, "its identifier; the lowest wins the bus"),
            key("frames_per_ms", "1/ms", [0.001, 20.0], Some(3.0), "how often"),
            whole("bytes", "1", [0.0, 8.0], 8.0, "of data, all 0")];
    "bus-off", Node, Kind::Bus(BusKind::BusOff),
        "the node hears nothing and is not heard; a process for both axes is one node", [];
} };
