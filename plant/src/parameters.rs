//! All numbers of the rig, checked once, in SI, grouped as the tables of the rig file.
//!
//! A [`RigParameters`] that exists is good: every value lies in its range and the values fit together, so the
//! step never meets a bad one. The fields of a group can be read and not written; a changed rig is made by
//! [`RigParameters::with`], which checks again.
//!
//! Source of every number: the comments of `rig.toml`, which are those of [`table::KEYS`].

pub mod table;

mod declared;
mod laws;
mod reader;
mod switched;
mod tabulated;

use serde::Serialize;

use reader::Entries;
pub use reader::ParameterError;
use table::Groups;
pub use table::{
    CylinderParameters, FrictionParameters, GasParameters, LinkageParameters, MassParameters,
    SensorParameters, StartParameters, SupplyParameters, VALVE_POINTS, ValveParameters,
};

pub use declared::{suspects, suspects_using};
pub use laws::{Law, LawNumber, LawVariable, Laws};

use crate::effects::declared::Declared;
use crate::effects::sheet::{ActiveEffect, Place};
use crate::effects::tabulated::Tabulated;

/// The numbers of one rig; made from a rig file, or the shipped baseline.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigParameters {
    #[serde(skip)]
    entries: Entries,
    #[serde(flatten)]
    groups: Groups,
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

    /// Line of a key, `table.key`, in the rig file, from 1.
    ///
    /// # Panics
    /// If the table of parameters holds no such key: a typing error.
    #[must_use]
    pub fn line(&self, path: &str) -> usize {
        let (table, name) = path.split_once('.').unwrap_or((path, ""));
        self.entries.entry(table, name).line
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

    /// The same rig with the effects and declared terms of a file besides its own; of two of one name at one place, the file's
    /// counts.
    /// `file` is only its name for messages.
    ///
    /// # Errors
    /// [`ParameterError`] as from a rig file, also for any key besides `[effects.…]` and `[[terms]]`.
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

    /// The same rig with a declared term, in place of one of the same name and place.
    #[must_use]
    pub fn with_term(&self, term: &Declared) -> Self {
        let mut entries = self.entries.clone();
        entries.put_term(term.clone());
        RigParameters { entries, ..self.clone() }
    }

    /// The terms that the file declares, in its order.
    #[must_use]
    pub fn terms(&self) -> &[Declared] {
        &self.entries.terms
    }

    /// Whether anything is added to the baseline: an effect, a table or a declared term.
    #[must_use]
    pub fn has_effects(&self) -> bool {
        let entries = &self.entries;
        !(entries.effects.is_empty() && entries.tabulated.is_empty() && entries.terms.is_empty())
    }

    /// The same rig with all effects off, tables and declared terms too.
    #[must_use]
    pub fn without_effects(&self) -> Self {
        let mut entries = self.entries.clone();
        entries.effects.clear();
        entries.tabulated.clear();
        entries.terms.clear();
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
    pub fn effects(&self) -> &[ActiveEffect] {
        &self.entries.effects
    }

    fn from_entries(entries: Entries) -> Result<Self, ParameterError> {
        check_together(&entries)?;
        let groups = Groups::of(|table, name| entries.si_points(table, name));
        Ok(RigParameters { entries, groups })
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
    let message = format!("{table}.{name} = {} contradicts another key: {rule}", entry.text);
    ParameterError::at(&entries.file, entry.line, &message)
}
