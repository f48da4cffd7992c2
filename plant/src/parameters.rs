//! All numbers of the rig, checked once, in SI, grouped as the tables of the rig file.
//!
//! A [`RigParameters`] that exists is good: every value lies in its range and the values fit together, so the
//! step never meets a bad one. The fields of a group can be read and not written; a changed rig is made by
//! [`RigParameters::with`], which checks again.
//!
//! Source of every number: the comments of `rig.toml`, which are those of [`table::KEYS`].

pub mod table;

mod reader;
mod switched;
mod tabulated;

use serde::Serialize;

use reader::Entries;
pub use reader::ParameterError;
pub use table::VALVE_POINTS;

use crate::effects::sheet::{Place, Switched};
use crate::effects::tabulated::Tabulated;

/// The numbers of one rig; made from a rig file, or the shipped baseline.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigParameters {
    #[serde(skip)]
    entries: Entries,
    supply: SupplyParameters,
    gas: GasParameters,
    valve: ValveParameters,
    cylinder: CylinderParameters,
    friction: FrictionParameters,
    mass: MassParameters,
    linkage: LinkageParameters,
    start: StartParameters,
    sensors: SensorParameters,
}

/// Table `[supply]`: pressures are absolute.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // the names carry quantity and unit; meaning and range stand in table::KEYS
pub struct SupplyParameters {
    pub pressure_pa: f64,
    pub exhaust_pressure_pa: f64,
    pub atmospheric_pressure_pa: f64,
    pub discharge_time_constant_s: f64,
    pub recovery_time_constant_s: f64,
    pub check_valve_pressure_pa: f64,
}

/// Table `[gas]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct GasParameters {
    pub normal_pressure_pa: f64,
    pub temperature_k: f64,
}

/// Table `[valve]`: openings |s| and the K_V of both edges at them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct ValveParameters {
    pub spool_time_constant_s: f64,
    pub flow_lag_time_constant_s: f64,
    pub opening: [f64; VALVE_POINTS],
    pub kv_supply_m3_per_h: [f64; VALVE_POINTS],
    pub kv_exhaust_m3_per_h: [f64; VALVE_POINTS],
}

/// Table `[cylinder]`, the same for both axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct CylinderParameters {
    pub stroke_m: f64,
    pub piston_area_m2: f64,
    pub annulus_area_m2: f64,
    pub dead_volume_m3: f64,
}

/// Table `[friction]`, the same for both axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct FrictionParameters {
    pub break_away_force_n: f64,
    pub sliding_force_n: f64,
    pub viscous_n_s_per_m: f64,
}

/// Table `[mass]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct MassParameters {
    pub drive_kg: f64,
    pub carriage_kg: f64,
    pub load_kg: f64,
    pub added_limit_kg: f64,
}

/// Table `[linkage]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct LinkageParameters {
    pub gap_m: f64,
    pub stiffness_n_per_m: f64,
    pub damping_n_s_per_m: f64,
}

/// Table `[start]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct StartParameters {
    pub rod_side_pressure_pa: f64,
}

/// Table `[sensors]`; see [`SensorParameters::position_step_m`] and its siblings for the step of one count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)] // as above
pub struct SensorParameters {
    pub position_range_m: f64,
    pub position_bits: u32,
    pub position_noise_m: f64,
    pub load_position_offset_m: f64,
    pub force_range_n: f64,
    pub force_bits: u32,
    pub force_noise_n: f64,
    pub pressure_range_pa: f64,
    pub pressure_bits: u32,
    pub pressure_noise_pa: f64,
}

impl SensorParameters {
    /// Largest count of the position sensor, 65535 for 16 bit; the smallest is 0.
    pub fn position_counts(&self) -> f64 {
        f64::from((1_u32 << self.position_bits) - 1)
    }

    /// Largest count of the force sensor, 32767 for 16 bit; the smallest is its negative.
    pub fn force_counts(&self) -> f64 {
        f64::from((1_u32 << (self.force_bits - 1)) - 1)
    }

    /// Largest count of a pressure sensor, 16383 for 14 bit; the smallest is 0.
    pub fn pressure_counts(&self) -> f64 {
        f64::from((1_u32 << self.pressure_bits) - 1)
    }

    /// Position of one count, m.
    pub fn position_step_m(&self) -> f64 {
        self.position_range_m / self.position_counts()
    }

    /// Force of one count, N.
    pub fn force_step_n(&self) -> f64 {
        self.force_range_n / self.force_counts()
    }

    /// Pressure of one count, Pa.
    pub fn pressure_step_pa(&self) -> f64 {
        self.pressure_range_pa / self.pressure_counts()
    }
}

impl RigParameters {
    /// Reads a rig file; `file` is only its name for messages.
    ///
    /// # Errors
    /// [`ParameterError`] with file, line, key, value and what is allowed, for anything but a complete rig:
    /// unknown, missing, mistyped, out-of-range or contradicting keys, NaN and infinity.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, ParameterError> {
        Self::from_entries(Entries::read(text, file)?)
    }

    /// The shipped rig, `plant/rig.toml`, with the numbers of rig-model.md.
    ///
    /// # Panics
    /// Never: a test reads the same file.
    pub fn baseline() -> Self {
        Self::from_toml(Self::BASELINE_TOML, "rig.toml").expect("the shipped rig.toml is good")
    }

    /// The text of the shipped rig file, for a run's folder or as a start for one's own.
    pub const BASELINE_TOML: &'static str = include_str!("../rig.toml");

    /// The same rig with one key changed: `path` is `table.key`, `numbers` are in the file's unit.
    ///
    /// # Errors
    /// [`ParameterError`] as from a file that says so.
    pub fn with(&self, path: &str, numbers: &[f64]) -> Result<Self, ParameterError> {
        Self::from_entries(self.entries.with(path, numbers)?)
    }

    /// The same rig with several keys changed at once, so that only the outcome must fit together.
    ///
    /// # Errors
    /// [`ParameterError`] as from a file that says so.
    pub fn with_all<'a>(
        &self,
        changes: impl IntoIterator<Item = (&'a str, &'a [f64])>,
    ) -> Result<Self, ParameterError> {
        let mut changes = changes.into_iter();
        Self::from_entries(
            changes.try_fold(self.entries.clone(), |entries, (path, numbers)| entries.with(path, numbers))?,
        )
    }

    /// The numbers of a key, `table.key`, in the file's unit.
    ///
    /// # Panics
    /// If the table of parameters holds no such key: a typing error.
    #[must_use]
    pub fn numbers(&self, path: &str) -> &[f64] {
        let (table, name) = path.split_once('.').unwrap_or((path, ""));
        &self.entries.entry(table, name).numbers
    }

    /// The same rig with one effect switched on, or with other numbers where it is on already.
    ///
    /// `place` is `drive`, `drive.a` and so on; `numbers` are keys of the effect's sheet in the file's units; keys that are
    /// not named get their defaults.
    ///
    /// # Errors
    /// [`ParameterError`] as from a file that says so.
    pub fn with_effect(
        &self,
        name: &str,
        place: &str,
        numbers: &[(&str, f64)],
    ) -> Result<Self, ParameterError> {
        Self::from_entries(self.entries.with_effect(name, place, numbers)?)
    }

    /// The same rig with the effects of a file besides its own; where both switch on one effect at one place, the file's counts.
    /// `file` is only its name for messages.
    ///
    /// # Errors
    /// [`ParameterError`] as from a rig file, also for any key besides `[effects.…]`.
    pub fn with_effects_of(&self, text: &str, file: &str) -> Result<Self, ParameterError> {
        Self::from_entries(self.entries.with_effects_of(text, file)?)
    }

    /// The same rig with these tables and no others; values in the units of a rig file.
    ///
    /// # Errors
    /// [`ParameterError`] as from a file that says so.
    pub fn with_tabulated(&self, tables: &[Tabulated]) -> Result<Self, ParameterError> {
        Self::from_entries(self.entries.with_tabulated(tables)?)
    }

    /// The tables of terms that no effect of the catalogue has, in the order of the file.
    #[must_use]
    pub fn tabulated(&self) -> &[Tabulated] {
        &self.entries.tabulated
    }

    /// The same rig with all effects off, tables too.
    #[must_use]
    pub fn without_effects(&self) -> Self {
        let mut entries = self.entries.clone();
        entries.effects.clear();
        entries.tabulated.clear();
        RigParameters { entries, ..self.clone() }
    }

    /// The same rig with one effect off at one place.
    #[must_use]
    pub fn without_effect(&self, name: &str, place: Place) -> Self {
        let mut entries = self.entries.clone();
        entries.effects.retain(|effect| effect.name != name || effect.place != place);
        RigParameters { entries, ..self.clone() }
    }

    /// The effects that are switched on, in the order of the catalogue.
    #[must_use]
    pub fn effects(&self) -> &[Switched] {
        &self.entries.effects
    }

    /// Supply, exhaust and emergency stop.
    pub fn supply(&self) -> &SupplyParameters {
        &self.supply
    }

    /// Normal conditions.
    pub fn gas(&self) -> &GasParameters {
        &self.gas
    }

    /// Valve characteristic and lags.
    pub fn valve(&self) -> &ValveParameters {
        &self.valve
    }

    /// Areas, stroke, dead volume.
    pub fn cylinder(&self) -> &CylinderParameters {
        &self.cylinder
    }

    /// Friction of each axis.
    pub fn friction(&self) -> &FrictionParameters {
        &self.friction
    }

    /// Moving masses.
    pub fn mass(&self) -> &MassParameters {
        &self.mass
    }

    /// Gap and contact of the linkage.
    pub fn linkage(&self) -> &LinkageParameters {
        &self.linkage
    }

    /// Start pressures.
    pub fn start(&self) -> &StartParameters {
        &self.start
    }

    /// Ranges, resolutions and noise of the sensors.
    pub fn sensors(&self) -> &SensorParameters {
        &self.sensors
    }

    fn from_entries(entries: Entries) -> Result<Self, ParameterError> {
        check_together(&entries)?;
        let si = |table: &str, name: &str| entries.si(table, name);
        Ok(RigParameters {
            supply: SupplyParameters {
                pressure_pa: si("supply", "pressure_bar"),
                exhaust_pressure_pa: si("supply", "exhaust_pressure_bar"),
                atmospheric_pressure_pa: si("supply", "atmospheric_pressure_bar"),
                discharge_time_constant_s: si("supply", "discharge_time_constant_s"),
                recovery_time_constant_s: si("supply", "recovery_time_constant_s"),
                check_valve_pressure_pa: si("supply", "check_valve_pressure_bar"),
            },
            gas: GasParameters {
                normal_pressure_pa: si("gas", "normal_pressure_pa"),
                temperature_k: si("gas", "temperature_k"),
            },
            valve: ValveParameters {
                spool_time_constant_s: si("valve", "spool_time_constant_ms"),
                flow_lag_time_constant_s: si("valve", "flow_lag_time_constant_ms"),
                opening: entries.si_points("valve", "opening"),
                kv_supply_m3_per_h: entries.si_points("valve", "kv_supply_m3_per_h"),
                kv_exhaust_m3_per_h: entries.si_points("valve", "kv_exhaust_m3_per_h"),
            },
            cylinder: CylinderParameters {
                stroke_m: si("cylinder", "stroke_mm"),
                piston_area_m2: si("cylinder", "piston_area_mm2"),
                annulus_area_m2: si("cylinder", "annulus_area_mm2"),
                dead_volume_m3: si("cylinder", "dead_volume_cm3"),
            },
            friction: FrictionParameters {
                break_away_force_n: si("friction", "break_away_force_n"),
                sliding_force_n: si("friction", "sliding_force_n"),
                viscous_n_s_per_m: si("friction", "viscous_n_per_mm_per_s"),
            },
            mass: MassParameters {
                drive_kg: si("mass", "drive_kg"),
                carriage_kg: si("mass", "carriage_kg"),
                load_kg: si("mass", "load_kg"),
                added_limit_kg: si("mass", "added_limit_kg"),
            },
            linkage: LinkageParameters {
                gap_m: si("linkage", "gap_mm"),
                stiffness_n_per_m: si("linkage", "stiffness_n_per_m"),
                damping_n_s_per_m: si("linkage", "damping_n_s_per_m"),
            },
            start: StartParameters { rod_side_pressure_pa: si("start", "rod_side_pressure_bar") },
            sensors: SensorParameters {
                position_range_m: si("sensors", "position_range_mm"),
                position_bits: si("sensors", "position_bits") as u32,
                position_noise_m: si("sensors", "position_noise_um"),
                load_position_offset_m: si("sensors", "load_position_offset_mm"),
                force_range_n: si("sensors", "force_range_n"),
                force_bits: si("sensors", "force_bits") as u32,
                force_noise_n: si("sensors", "force_noise_n"),
                pressure_range_pa: si("sensors", "pressure_range_bar"),
                pressure_bits: si("sensors", "pressure_bits") as u32,
                pressure_noise_pa: si("sensors", "pressure_noise_pa"),
            },
            entries,
        })
    }
}

/// What no single range can say: which values must fit together.
fn check_together(entries: &Entries) -> Result<(), ParameterError> {
    let below = |table: &str, lower: &str, upper: &str, may_be_equal: bool| {
        let (low, high) = (entries.entry(table, lower), entries.entry(table, upper));
        let good = low.numbers[0] < high.numbers[0] || may_be_equal && low.numbers[0] == high.numbers[0];
        let relation = if may_be_equal { "not be above" } else { "be below" };
        let rule = format!("it must {relation} {table}.{upper} = {}", high.text);
        if good { Ok(()) } else { Err(inconsistent(entries, table, lower, rule)) }
    };
    below("supply", "atmospheric_pressure_bar", "exhaust_pressure_bar", true)?;
    below("supply", "exhaust_pressure_bar", "check_valve_pressure_bar", false)?;
    below("supply", "check_valve_pressure_bar", "pressure_bar", false)?;
    below("cylinder", "annulus_area_mm2", "piston_area_mm2", false)?;
    below("friction", "sliding_force_n", "break_away_force_n", true)?;
    below("mass", "carriage_kg", "drive_kg", false)?;

    let start = entries.si("start", "rod_side_pressure_bar");
    if start < entries.si("supply", "exhaust_pressure_bar") || start > entries.si("supply", "pressure_bar") {
        let rule = format!(
            "it must lie between supply.exhaust_pressure_bar = {} and supply.pressure_bar = {}",
            entries.entry("supply", "exhaust_pressure_bar").text,
            entries.entry("supply", "pressure_bar").text
        );
        return Err(inconsistent(entries, "start", "rod_side_pressure_bar", rule));
    }

    let opening = &entries.entry("valve", "opening").numbers;
    // Steps that are not tiny keep the slopes of the tables finite.
    let grows = opening.windows(2).all(|pair| pair[1] - pair[0] >= 0.001);
    if !grows || opening[0] != 0.0 || opening[VALVE_POINTS - 1] != 1.0 {
        let rule = "the openings must start at 0, grow by at least 0.001, and end at 1".to_owned();
        return Err(inconsistent(entries, "valve", "opening", rule));
    }
    for name in ["kv_supply_m3_per_h", "kv_exhaust_m3_per_h"] {
        let kv = &entries.entry("valve", name).numbers;
        if kv[0] != 0.0 || kv.windows(2).any(|pair| pair[0] > pair[1]) {
            let rule = "K_V must be 0 at opening 0 and never fall with valve.opening".to_owned();
            return Err(inconsistent(entries, "valve", name, rule));
        }
    }
    Ok(())
}

fn inconsistent(entries: &Entries, table: &str, name: &str, rule: String) -> ParameterError {
    let entry = entries.entry(table, name);
    ParameterError::Inconsistent {
        file: entries.file.clone(),
        line: entry.line,
        key: format!("{table}.{name}"),
        value: entry.text.clone(),
        rule,
    }
}
