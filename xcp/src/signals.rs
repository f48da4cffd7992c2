//! The measurable signals of a controller: one table behind A2L file, DAQ lists and trigger buffer.
//!
//! A signal is a number of the cycle that was just answered, in SI. XCP carries it as a float of four bytes or a count, so that
//! it fits a DAQ packet whole; the trigger buffer keeps all eight bytes.

use algorithms::algorithm::AlgorithmInput;
use axis_control::axis::AxisRecord;
use protocol::frames::{DRIVE_CHAIN_STATUS, Sensors, SignalSpec};
use settings::parameters::Parameter;

/// How a value lies in memory; Intel byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Byte,
    Long,
    Float,
    Double,
}

impl Format {
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Long | Self::Float => 4,
            Self::Double => 8,
        }
    }

    /// `value` as it lies in memory, in the first bytes; counts wrap, as the rig's cycle does after 49.7 days.
    pub(crate) fn encode(self, value: f64) -> [u8; 8] {
        let mut bytes = [0; 8];
        match self {
            Self::Byte => bytes[0] = value as u8,
            Self::Long => bytes[..4].copy_from_slice(&(value as u64 as u32).to_le_bytes()),
            Self::Float => bytes[..4].copy_from_slice(&(value as f32).to_le_bytes()),
            Self::Double => bytes = value.to_le_bytes(),
        }
        bytes
    }

    /// The value that lies in the first bytes.
    pub(crate) fn decode(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::Byte => f64::from(a),
            Self::Long => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::Float => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::Double => f64::from_le_bytes(bytes),
        }
    }
}

/// The data of a cycle that signals are taken from.
pub(crate) struct CycleData<'a> {
    pub(crate) input: &'a AlgorithmInput,
    pub(crate) sensors: &'a Sensors,
    pub(crate) record: AxisRecord,
}

/// A number that can be measured.
pub(crate) struct Signal {
    /// Name, unit, range and meaning; its default is that before the first cycle.
    pub(crate) about: Parameter,
    pub(crate) format: Format,
    /// Names of its values, for one that is a state.
    pub(crate) values: &'static [&'static str],
    of: fn(&CycleData<'_>) -> f64,
}

const fn count(
    name: &'static str,
    most: f64,
    meaning: &'static str,
    of: fn(&CycleData<'_>) -> f64,
) -> Signal {
    let about = Parameter::new((name, ""), [0.0, most], 0.0, meaning).whole();
    Signal { about, format: Format::Long, values: &[], of }
}

const fn number(
    name: &'static str,
    (unit, range): (&'static str, [f64; 2]),
    meaning: &'static str,
    of: fn(&CycleData<'_>) -> f64,
) -> Signal {
    let about = Parameter::new((name, unit), range, 0.0, meaning);
    Signal { about, format: Format::Float, values: &[], of }
}

const fn state(
    name: &'static str,
    values: &'static [&'static str],
    meaning: &'static str,
    of: fn(&CycleData<'_>) -> f64,
) -> Signal {
    let most = values.len() as f64 - 1.0;
    let about = Parameter::new((name, ""), [0.0, most], 0.0, meaning).whole();
    Signal { about, format: Format::Byte, values, of }
}

/// Names of a chain's states, from `rig.dbc`.
const fn names(chain: usize) -> &'static [&'static str] {
    let signals: &[SignalSpec] = DRIVE_CHAIN_STATUS.signals;
    signals[chain].values
}

const NO_YES: &[&str] = &["no", "yes"];

/// Number of signals.
pub const COUNT: usize = SIGNALS.len();

/// The table of signals: kind, name, range or values, meaning, and what it is in the data of a cycle.
macro_rules! signals {
    ($data:ident: $($kind:ident($name:literal, $scale:expr, $meaning:literal) = $of:expr;)*) => {
        [$($kind($name, $scale, $meaning, |$data| $of)),*]
    };
}

/// All signals; a place in this table is what the trigger buffer calls a source or a channel.
pub(crate) static SIGNALS: [Signal; 24] = signals! { data:
    count("cycle", 4_294_967_295.0, "the rig's cycle, 1 ms each") = data.record.cycle as f64;
    number("sensor_position_m", ("m", [0.0, 0.5]), "position as the sensor told it, rig coordinates") =
        data.sensors.position_m;
    number("sensor_force_n", ("N", [-2000.0, 2000.0]), "force as the sensor told it, compression positive") =
        data.sensors.force_n;
    number("sensor_pressure_a_pa", ("Pa", [0.0, 1e6]), "absolute pressure of the cap side as the sensor told it") =
        data.sensors.pressure_a_pa;
    number("sensor_pressure_b_pa", ("Pa", [0.0, 1e6]), "absolute pressure of the rod side as the sensor told it") =
        data.sensors.pressure_b_pa;
    number("position_m", ("m", [-0.1, 0.6]), "position less the matched offset, rig coordinates") = data.record.position_m;
    number("velocity_m_per_s", ("m/s", [-10.0, 10.0]), "its rate, filtered") = data.record.velocity_m_per_s;
    number("extension_acceleration_m_per_s2", ("m/s^2", [-1000.0, 1000.0]),
        "acceleration of the rod, filtered, positive as it extends") = data.input.acceleration_m_per_s2;
    number("force_n", ("N", [-2000.0, 2000.0]), "force, filtered") = data.input.force_n;
    number("pressure_a_pa", ("Pa", [0.0, 1e6]), "absolute pressure of the cap side, filtered") = data.input.pressure_a_pa;
    number("pressure_b_pa", ("Pa", [0.0, 1e6]), "absolute pressure of the rod side, filtered") = data.input.pressure_b_pa;
    number("supply_pressure_pa", ("Pa", [0.0, 1e6]), "absolute pressure of the supply as the rig tells it") =
        data.input.supply_pressure_pa;
    number("set_position_m", ("m", [-0.1, 0.6]), "position asked for; 0 while none is, see asked") =
        data.record.set_position.map_or(0.0, |point| point.position_m);
    number("set_velocity_m_per_s", ("m/s", [-10.0, 10.0]), "its rate; 0 while none is asked for") =
        data.record.set_position.map_or(0.0, |point| point.velocity_m_per_s);
    number("set_force_n", ("N", [-2000.0, 2000.0]), "force asked for; 0 while none is, see asked") =
        data.record.set_force.map_or(0.0, |point| point.force_n);
    number("wanted_velocity_m_per_s", ("m/s", [-100.0, 100.0]),
        "velocity that the algorithm wants, positive as the rod extends") = data.record.wanted_velocity_m_per_s;
    number("applied_velocity_m_per_s", ("m/s", [-100.0, 100.0]), "what the valve can do of it") =
        data.input.applied_velocity_m_per_s;
    number("opening", ("", [-1.0, 1.0]), "valve opening sent") = data.record.opening;
    state("enabled", NO_YES, "the valve is asked to act") = f64::from(u8::from(data.record.enabled));
    state("main_chain", names(0), "state of the main chain") = f64::from(data.record.main.raw());
    state("force_chain", names(1), "state of the force chain") = f64::from(data.record.force_chain.raw());
    state("matching_chain", names(2), "state of the matching chain") = f64::from(data.record.matching.raw());
    state("emergency_stop_chain", names(3), "state of the emergency stop chain") =
        f64::from(data.record.emergency_stop.raw());
    state("asked", &["nothing", "position", "force"], "what is asked of the axis") =
        match (data.record.set_position, data.record.set_force) {
            (Some(_), _) => 1.0,
            (None, Some(_)) => 2.0,
            (None, None) => 0.0,
        };
};

/// All signals of a cycle, in the order of [`SIGNALS`].
pub(crate) fn sample(data: &CycleData<'_>) -> [f64; COUNT] {
    std::array::from_fn(|place| (SIGNALS[place].of)(data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_states_have_names_for_all_their_values() {
        for (place, signal) in SIGNALS.iter().enumerate() {
            let name = &signal.about.name;
            assert!(SIGNALS[..place].iter().all(|other| other.about.name != *name), "{name} twice");
            assert_eq!(signal.format == Format::Byte, !signal.values.is_empty(), "{name}");
        }
        let main = SIGNALS.iter().find(|signal| signal.about.name == "main_chain").unwrap();
        assert_eq!((main.values[5], main.values.len()), ("experiment", 10));
    }

    #[test]
    fn what_lies_in_memory_is_what_was_put_there() {
        for (format, value) in
            [(Format::Byte, 7.0), (Format::Long, 4e9), (Format::Float, 0.25), (Format::Double, 0.1)]
        {
            assert_eq!(format.decode(format.encode(value)), value, "{format:?}");
        }
        assert_eq!(Format::Long.decode(Format::Long.encode(4_294_967_297.0)), 1.0, "the cycle wraps");
    }
}
