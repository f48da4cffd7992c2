//! The one table of the rig's parameters: field in SI, key, unit, allowed range, source and meaning of each.
//!
//! The groups of [`RigParameters`] are made of it, the reader checks a file against it, the error messages quote it, and a test
//! compares the comments of the shipped `rig.toml` with it, so there is no second place where a key or a range is written.
//!
//! A range is where the model and its integration are meant to hold (property tests run over all of it); it
//! is wider than any rig of this kind and narrower than what a number can be.

use std::fmt;

use serde::Serialize;

use super::RigParameters;

/// Declares each unit with its name, as the file and the messages print it.
macro_rules! units {
    ($($(#[$doc:meta])* $unit:ident $name:literal;)*) => {
        /// A unit of the rig file; the model computes in SI.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Unit {
            $($(#[$doc])* $unit,)*
            /// As a declared term writes it; the term computes in it.
            Written(&'static str),
        }

        impl Unit {
            /// The unit's name as the file and the messages print it.
            pub fn name(self) -> &'static str {
                match self {
                    Unit::Written(name) => name,
                    $(Unit::$unit => $name,)*
                }
            }
        }
    };
}

units! {
    /// Without a dimension, printed as nothing.
    One "";
    /// A whole number of bits.
    Bits "bits";
    /// 1e5 Pa, absolute unless the key says otherwise.
    Bar "bar";
    /// Pascal.
    Pascal "Pa";
    /// Kelvin.
    Kelvin "K";
    /// 1e-3 m.
    Millimetre "mm";
    /// 1e-6 m.
    Micrometre "um";
    /// 1e-6 m^2.
    SquareMillimetre "mm^2";
    /// 1e-6 m^3.
    CubicCentimetre "cm^3";
    /// Second.
    Second "s";
    /// 1e-3 s.
    Millisecond "ms";
    /// m^3/h, the unit of K_V.
    CubicMetrePerHour "m^3/h";
    /// Kilogram.
    Kilogram "kg";
    /// Newton.
    Newton "N";
    /// N/(mm/s), 1e3 N s/m.
    NewtonSecondPerMillimetre "N/(mm/s)";
    /// N/m.
    NewtonPerMetre "N/m";
    /// N s/m.
    NewtonSecondPerMetre "N s/m";
    /// Hundredth.
    Percent "%";
    /// 100 Pa.
    Millibar "mbar";
    /// Metre.
    Metre "m";
    /// 1e-3 m/s.
    MillimetrePerSecond "mm/s";
    /// Hertz.
    Hertz "Hz";
    /// 1/s.
    PerSecond "1/s";
    /// Normal litre per minute, 1e-3/60 m^3/s.
    NormalLitrePerMinute "Nl/min";
    /// 1e-5 N/Pa.
    NewtonPerBar "N/bar";
    /// W/(m^2 K).
    WattPerSquareMetreKelvin "W/(m^2 K)";
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

/// Type of a parameter: a number, a whole number, or the points of a valve table.
trait ParameterValue {
    /// Numbers of the file.
    const COUNT: usize;

    /// From the numbers in SI, as many as these.
    fn from_si(si: &[f64]) -> Self;
}

impl ParameterValue for f64 {
    const COUNT: usize = 1;

    fn from_si(si: &[f64]) -> Self {
        si[0]
    }
}

impl ParameterValue for u32 {
    const COUNT: usize = 1;

    fn from_si(si: &[f64]) -> Self {
        si[0] as u32
    }
}

impl<const N: usize> ParameterValue for [f64; N] {
    const COUNT: usize = N;

    fn from_si(si: &[f64]) -> Self {
        std::array::from_fn(|i| si[i])
    }
}

/// Declares each key once, as `field: type = key [unit, min, max], source, meaning;`: its row of [`KEYS`], its field in SI, and how
/// the field gets its number.
macro_rules! rig_file {
    ($($(#[$doc:meta])* $table:ident: $group:ident, $about:literal {
        $($field:ident: $number:ty = $key:ident [$unit:ident, $min:expr, $max:expr], $source:expr, $meaning:literal;)*
    })*) => {
        /// Every key of the rig file, in the order of the shipped one.
        pub const KEYS: &[Key] = &[$($(Key {
            table: stringify!($table),
            name: stringify!($key),
            unit: Unit::$unit,
            min: $min,
            max: $max,
            count: <$number as ParameterValue>::COUNT,
            meaning: $meaning,
            source: $source,
        },)*)*];

        $($(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
        pub struct $group { $(#[doc = $meaning] pub $field: $number,)* }
        )*

        /// The numbers of one rig in SI, table by table.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        pub(super) struct Groups { $($table: $group,)* }

        impl Groups {
            /// `si` gives the numbers of a key, in SI.
            pub(super) fn of(si: impl Fn(&str, &str) -> Vec<f64>) -> Self {
                Groups { $($table: $group {
                    $($field: ParameterValue::from_si(&si(stringify!($table), stringify!($key))),)*
                },)* }
            }
        }

        impl RigParameters {
            $(#[doc = $about]
            pub fn $table(&self) -> &$group {
                &self.groups.$table
            })*
        }
    };
}

const AXIS: &str = "rig-model.md, One axis";
const MASSES: &str = "rig-model.md, Masses and linkage";
const STOP: &str = "rig-model.md, Emergency stop";
const START: &str = "rig-model.md, Start";
const SENSORS: &str = "rig-model.md, Sensors";

rig_file! {
    /// Table `[supply]`: pressures are absolute.
    supply: SupplyParameters, "Supply, exhaust and emergency stop." {
        pressure_pa: f64 = pressure_bar [Bar, 3.0, 12.0], AXIS, "absolute supply pressure in normal running";
        exhaust_pressure_pa: f64 = exhaust_pressure_bar [Bar, 0.9, 1.5], AXIS, "absolute pressure behind the valve's exhaust";
        atmospheric_pressure_pa: f64 = atmospheric_pressure_bar [Bar, 0.9, 1.1], AXIS, "absolute pressure around the rods; an emergency stop discharges the supply to it";
        discharge_time_constant_s: f64 = discharge_time_constant_s [Second, 0.005, 5.0], STOP, "decay of the supply node after an emergency stop";
        recovery_time_constant_s: f64 = recovery_time_constant_s [Second, 0.005, 5.0], STOP, "recovery of the supply node after the release";
        check_valve_pressure_pa: f64 = check_valve_pressure_bar [Bar, 1.2, 6.0], STOP, "pilot pressure below which the non-return valves at the chambers are shut";
    }
    /// Table `[gas]`.
    gas: GasParameters, "Normal conditions." {
        normal_pressure_pa: f64 = normal_pressure_pa [Pascal, 95000.0, 110000.0], "paper eq. (1); rig-model.md, One axis", "pressure of the normal volume, p_N";
        temperature_k: f64 = temperature_k [Kelvin, 253.15, 333.15], AXIS, "gas temperature, constant in the isothermal baseline";
    }
    /// Table `[valve]`: openings |s| and the K_V of both edges at them.
    valve: ValveParameters, "Valve characteristic and lags." {
        spool_time_constant_s: f64 = spool_time_constant_ms [Millisecond, 0.2, 20.0], "paper section 3; rig-model.md, One axis", "first-order lag of the spool, tau_v";
        flow_lag_time_constant_s: f64 = flow_lag_time_constant_ms [Millisecond, 0.001, 50.0], AXIS, "first-order lag of a chamber's net flow, tau_q";
        opening: [f64; VALVE_POINTS] = opening [One, 0.0, 1.0], AXIS, "spool openings |s| of both K_V tables, from 0 to 1, growing by at least 0.001";
        kv_supply_m3_per_h: [f64; VALVE_POINTS] = kv_supply_m3_per_h [CubicMetrePerHour, 0.0, 3.0], AXIS, "K_V of the supply edge at these openings, 0 at 0, never falling";
        kv_exhaust_m3_per_h: [f64; VALVE_POINTS] = kv_exhaust_m3_per_h [CubicMetrePerHour, 0.0, 3.0], AXIS, "K_V of the exhaust edge at these openings, 0 at 0, never falling";
    }
    /// Table `[cylinder]`, the same for both axes.
    cylinder: CylinderParameters, "Areas, stroke, dead volume." {
        stroke_m: f64 = stroke_mm [Millimetre, 50.0, 2000.0], AXIS, "stroke L of both cylinders";
        piston_area_m2: f64 = piston_area_mm2 [SquareMillimetre, 300.0, 8000.0], AXIS, "piston area on the cap side, A_a (50 mm bore)";
        annulus_area_m2: f64 = annulus_area_mm2 [SquareMillimetre, 200.0, 7900.0], AXIS, "piston area on the rod side, A_b (20 mm rod), smaller than the cap side";
        dead_volume_m3: f64 = dead_volume_cm3 [CubicCentimetre, 5.0, 200.0], AXIS, "dead volume and hose of each chamber, V_0";
    }
    /// Table `[friction]`, the same for both axes.
    friction: FrictionParameters, "Friction of each axis." {
        break_away_force_n: f64 = break_away_force_n [Newton, 0.0, 300.0], AXIS, "largest force that a piston at rest withstands, F_stat, not below the sliding force";
        sliding_force_n: f64 = sliding_force_n [Newton, 0.0, 300.0], AXIS, "sliding friction, F_sli";
        viscous_n_s_per_m: f64 = viscous_n_per_mm_per_s [NewtonSecondPerMillimetre, 0.0, 10.0], AXIS, "viscous friction, b";
    }
    /// Table `[mass]`.
    mass: MassParameters, "Moving masses." {
        drive_kg: f64 = drive_kg [Kilogram, 1.0, 50.0], MASSES, "all that moves with the drive's piston, without added weights";
        carriage_kg: f64 = carriage_kg [Kilogram, 0.1, 49.0], MASSES, "the part of it that lies behind the force sensor, less than all of it";
        load_kg: f64 = load_kg [Kilogram, 0.5, 50.0], MASSES, "piston, rod and eye of the load axis";
        added_limit_kg: f64 = added_limit_kg [Kilogram, 0.0, 100.0], MASSES, "weights that can be added to the carriage";
    }
    /// Table `[linkage]`.
    linkage: LinkageParameters, "Gap and contact of the linkage." {
        gap_m: f64 = gap_mm [Millimetre, 0.0, 5.0], MASSES, "play of the load eye in the carriage, both sides together";
        stiffness_n_per_m: f64 = stiffness_n_per_m [NewtonPerMetre, 1e4, 1e7], MASSES, "contact stiffness, k";
        damping_n_s_per_m: f64 = damping_n_s_per_m [NewtonSecondPerMetre, 0.0, 1e4], MASSES, "contact damping, c";
    }
    /// Table `[start]`.
    start: StartParameters, "Start pressures." {
        rod_side_pressure_pa: f64 = rod_side_pressure_bar [Bar, 0.9, 12.0], START, "absolute start pressure of the rod-side chambers, between exhaust and supply";
    }
    /// Table `[sensors]`; see [`SensorParameters::position_step_m`] and its siblings for the step of one count.
    sensors: SensorParameters, "Ranges, resolutions and noise of the sensors." {
        position_range_m: f64 = position_range_mm [Millimetre, 50.0, 2000.0], SENSORS, "position that the largest count stands for; 0 counts are 0";
        position_bits: u32 = position_bits [Bits, 8.0, 16.0], SENSORS, "unsigned resolution of the position";
        position_noise_m: f64 = position_noise_um [Micrometre, 0.0, 1000.0], SENSORS, "noise of the position, rms";
        load_position_offset_m: f64 = load_position_offset_mm [Millimetre, -5.0, 5.0], SENSORS, "what the load's position sensor reads too much";
        force_range_n: f64 = force_range_n [Newton, 100.0, 20000.0], SENSORS, "force that the largest count stands for, both signs";
        force_bits: u32 = force_bits [Bits, 8.0, 16.0], SENSORS, "signed resolution of the force";
        force_noise_n: f64 = force_noise_n [Newton, 0.0, 50.0], SENSORS, "noise of the force, rms";
        pressure_range_pa: f64 = pressure_range_bar [Bar, 2.0, 20.0], SENSORS, "pressure that the largest count stands for; 0 counts are vacuum";
        pressure_bits: u32 = pressure_bits [Bits, 8.0, 14.0], SENSORS, "unsigned resolution of the pressure";
        pressure_noise_pa: f64 = pressure_noise_pa [Pascal, 0.0, 20000.0], SENSORS, "noise of the pressure, rms";
    }
}
