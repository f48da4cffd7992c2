//! The one table of the rig's parameters: key, unit, allowed range, meaning and source of each.
//!
//! The reader checks a file against it, the error messages quote it, and a test compares the comments of the
//! shipped `rig.toml` with it, so there is no second place where a range is written.
//!
//! A range is where the model and its integration are meant to hold (property tests run over all of it); it
//! is wider than any rig of this kind and narrower than what a number can be.

use std::fmt;

/// A unit of the rig file; the model computes in SI.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// A plain number.
    One,
    /// A whole number of bits.
    Bits,
    /// 1e5 Pa, absolute unless the key says otherwise.
    Bar,
    /// Pascal.
    Pascal,
    /// Kelvin.
    Kelvin,
    /// 1e-3 m.
    Millimetre,
    /// 1e-6 m.
    Micrometre,
    /// 1e-6 m^2.
    SquareMillimetre,
    /// 1e-6 m^3.
    CubicCentimetre,
    /// Second.
    Second,
    /// 1e-3 s.
    Millisecond,
    /// m^3/h, the unit of K_V.
    CubicMetrePerHour,
    /// Kilogram.
    Kilogram,
    /// Newton.
    Newton,
    /// N/(mm/s), 1e3 N s/m.
    NewtonSecondPerMillimetre,
    /// N/m.
    NewtonPerMetre,
    /// N s/m.
    NewtonSecondPerMetre,
    /// Hundredth.
    Percent,
    /// 100 Pa.
    Millibar,
    /// Metre.
    Metre,
    /// 1e-3 m/s.
    MillimetrePerSecond,
    /// Hertz.
    Hertz,
    /// 1/s.
    PerSecond,
    /// Normal litre per minute, 1e-3/60 m^3/s.
    NormalLitrePerMinute,
    /// 1e-5 N/Pa.
    NewtonPerBar,
    /// W/(m^2 K).
    WattPerSquareMetreKelvin,
}

impl Unit {
    /// Turns a value of the file into SI; K_V stays in m^3/h, as the valve law is written for it.
    pub fn to_si(self, value: f64) -> f64 {
        // Divisions by powers of ten round once; a factor of 1e-3 would round twice.
        match self {
            Unit::Bar => value * 1e5,
            Unit::Millimetre | Unit::Millisecond | Unit::MillimetrePerSecond => value / 1e3,
            Unit::Percent => value / 1e2,
            Unit::Millibar => value * 1e2,
            Unit::NewtonPerBar => value / 1e5,
            Unit::NormalLitrePerMinute => value / 6e4,
            Unit::Micrometre | Unit::SquareMillimetre | Unit::CubicCentimetre => value / 1e6,
            Unit::NewtonSecondPerMillimetre => value * 1e3,
            _ => value,
        }
    }

    /// The unit's name as the file and the messages print it.
    pub fn name(self) -> &'static str {
        match self {
            Unit::One => "",
            Unit::Bits => "bits",
            Unit::Bar => "bar",
            Unit::Pascal => "Pa",
            Unit::Kelvin => "K",
            Unit::Millimetre => "mm",
            Unit::Micrometre => "um",
            Unit::SquareMillimetre => "mm^2",
            Unit::CubicCentimetre => "cm^3",
            Unit::Second => "s",
            Unit::Millisecond => "ms",
            Unit::CubicMetrePerHour => "m^3/h",
            Unit::Kilogram => "kg",
            Unit::Newton => "N",
            Unit::NewtonSecondPerMillimetre => "N/(mm/s)",
            Unit::NewtonPerMetre => "N/m",
            Unit::NewtonSecondPerMetre => "N s/m",
            Unit::Percent => "%",
            Unit::Millibar => "mbar",
            Unit::Metre => "m",
            Unit::MillimetrePerSecond => "mm/s",
            Unit::Hertz => "Hz",
            Unit::PerSecond => "1/s",
            Unit::NormalLitrePerMinute => "Nl/min",
            Unit::NewtonPerBar => "N/bar",
            Unit::WattPerSquareMetreKelvin => "W/(m^2 K)",
        }
    }
}

/// One key of the rig file.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Table of the file, as `supply`.
    pub table: &'static str,
    /// Name inside the table, ending in its unit.
    pub name: &'static str,
    /// Unit of the value in the file.
    pub unit: Unit,
    /// Smallest allowed value, in the file's unit.
    pub min: f64,
    /// Largest allowed value, in the file's unit.
    pub max: f64,
    /// How many numbers the key holds: 1, or the points of a valve table.
    pub count: usize,
    /// What the number is.
    pub meaning: &'static str,
    /// Where the baseline's number comes from.
    pub source: &'static str,
}

impl Key {
    /// `table.name`, the name that messages and callers use.
    pub fn path(&self) -> String {
        format!("{}.{}", self.table, self.name)
    }

    /// The allowed values in words, as `2 to 16 bar`.
    pub fn range(&self) -> String {
        let what = match (self.count, self.unit) {
            (1, Unit::Bits) => "a whole number, ".to_owned(),
            (1, _) => String::new(),
            (count, _) => format!("{count} numbers, each "),
        };
        format!("{what}{} to {} {}", self.min, self.max, self.unit.name()).trim_end().to_owned()
    }

    /// The comment that stands above the key in a rig file.
    pub fn comment(&self) -> String {
        format!("# {}: {} [{}]", self.range(), self.meaning, self.source)
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.table, self.name)
    }
}

/// Points of each valve table.
pub const VALVE_POINTS: usize = 6;

const fn number(
    table: &'static str,
    name: &'static str,
    (unit, min, max): (Unit, f64, f64),
    meaning: &'static str,
    source: &'static str,
) -> Key {
    Key { table, name, unit, min, max, count: 1, meaning, source }
}

const fn points(name: &'static str, (unit, min, max): (Unit, f64, f64), meaning: &'static str) -> Key {
    Key {
        table: "valve",
        name,
        unit,
        min,
        max,
        count: VALVE_POINTS,
        meaning,
        source: "rig-model.md, One axis",
    }
}

const AXIS: &str = "rig-model.md, One axis";
const MASSES: &str = "rig-model.md, Masses and linkage";
const STOP: &str = "rig-model.md, Emergency stop";
const START: &str = "rig-model.md, Start";
const SENSORS: &str = "rig-model.md, Sensors";

/// Every key of the rig file, in the order of the shipped one.
#[rustfmt::skip] // one key, one line
pub const KEYS: &[Key] = {
    use Unit::*;
    &[
    number("supply", "pressure_bar", (Bar, 3.0, 12.0), "absolute supply pressure in normal running", AXIS),
    number("supply", "exhaust_pressure_bar", (Bar, 0.9, 1.5), "absolute pressure behind the valve's exhaust", AXIS),
    number("supply", "atmospheric_pressure_bar", (Bar, 0.9, 1.1), "absolute pressure around the rods; an emergency stop discharges the supply to it", AXIS),
    number("supply", "discharge_time_constant_s", (Second, 0.005, 5.0), "decay of the supply node after an emergency stop", STOP),
    number("supply", "recovery_time_constant_s", (Second, 0.005, 5.0), "recovery of the supply node after the release", STOP),
    number("supply", "check_valve_pressure_bar", (Bar, 1.2, 6.0), "pilot pressure below which the non-return valves at the chambers are shut", STOP),
    number("gas", "normal_pressure_pa", (Pascal, 95000.0, 110000.0), "pressure of the normal volume, p_N", "paper eq. (1); rig-model.md, One axis"),
    number("gas", "temperature_k", (Kelvin, 253.15, 333.15), "gas temperature, constant in the isothermal baseline", AXIS),
    number("valve", "spool_time_constant_ms", (Millisecond, 0.2, 20.0), "first-order lag of the spool, tau_v", "paper section 3; rig-model.md, One axis"),
    number("valve", "flow_lag_time_constant_ms", (Millisecond, 0.001, 50.0), "first-order lag of a chamber's net flow, tau_q", AXIS),
    points("opening", (One, 0.0, 1.0), "spool openings |s| of both K_V tables, from 0 to 1, growing by at least 0.001"),
    points("kv_supply_m3_per_h", (CubicMetrePerHour, 0.0, 3.0), "K_V of the supply edge at these openings, 0 at 0, never falling"),
    points("kv_exhaust_m3_per_h", (CubicMetrePerHour, 0.0, 3.0), "K_V of the exhaust edge at these openings, 0 at 0, never falling"),
    number("cylinder", "stroke_mm", (Millimetre, 50.0, 2000.0), "stroke L of both cylinders", AXIS),
    number("cylinder", "piston_area_mm2", (SquareMillimetre, 300.0, 8000.0), "piston area on the cap side, A_a (50 mm bore)", AXIS),
    number("cylinder", "annulus_area_mm2", (SquareMillimetre, 200.0, 7900.0), "piston area on the rod side, A_b (20 mm rod), smaller than the cap side", AXIS),
    number("cylinder", "dead_volume_cm3", (CubicCentimetre, 5.0, 200.0), "dead volume and hose of each chamber, V_0", AXIS),
    number("friction", "break_away_force_n", (Newton, 0.0, 300.0), "largest force that a piston at rest withstands, F_stat, not below the sliding force", AXIS),
    number("friction", "sliding_force_n", (Newton, 0.0, 300.0), "sliding friction, F_sli", AXIS),
    number("friction", "viscous_n_per_mm_per_s", (NewtonSecondPerMillimetre, 0.0, 10.0), "viscous friction, b", AXIS),
    number("mass", "drive_kg", (Kilogram, 1.0, 50.0), "all that moves with the drive's piston, without added weights", MASSES),
    number("mass", "carriage_kg", (Kilogram, 0.1, 49.0), "the part of it that lies behind the force sensor, less than all of it", MASSES),
    number("mass", "load_kg", (Kilogram, 0.5, 50.0), "piston, rod and eye of the load axis", MASSES),
    number("mass", "added_limit_kg", (Kilogram, 0.0, 100.0), "weights that can be added to the carriage", MASSES),
    number("linkage", "gap_mm", (Millimetre, 0.0, 5.0), "play of the load eye in the carriage, both sides together", MASSES),
    number("linkage", "stiffness_n_per_m", (NewtonPerMetre, 1e4, 1e7), "contact stiffness, k", MASSES),
    number("linkage", "damping_n_s_per_m", (NewtonSecondPerMetre, 0.0, 1e4), "contact damping, c", MASSES),
    number("start", "rod_side_pressure_bar", (Bar, 0.9, 12.0), "absolute start pressure of the rod-side chambers, between exhaust and supply", START),
    number("sensors", "position_range_mm", (Millimetre, 50.0, 2000.0), "position that the largest count stands for; 0 counts are 0", SENSORS),
    number("sensors", "position_bits", (Bits, 8.0, 16.0), "unsigned resolution of the position", SENSORS),
    number("sensors", "position_noise_um", (Micrometre, 0.0, 1000.0), "noise of the position, rms", SENSORS),
    number("sensors", "load_position_offset_mm", (Millimetre, -5.0, 5.0), "what the load's position sensor reads too much", SENSORS),
    number("sensors", "force_range_n", (Newton, 100.0, 20000.0), "force that the largest count stands for, both signs", SENSORS),
    number("sensors", "force_bits", (Bits, 8.0, 16.0), "signed resolution of the force", SENSORS),
    number("sensors", "force_noise_n", (Newton, 0.0, 50.0), "noise of the force, rms", SENSORS),
    number("sensors", "pressure_range_bar", (Bar, 2.0, 20.0), "pressure that the largest count stands for; 0 counts are vacuum", SENSORS),
    number("sensors", "pressure_bits", (Bits, 8.0, 14.0), "unsigned resolution of the pressure", SENSORS),
    number("sensors", "pressure_noise_pa", (Pascal, 0.0, 20000.0), "noise of the pressure, rms", SENSORS),
]};
