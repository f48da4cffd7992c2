//! The description: all that a viewer has to know before the first cycle. The run, the rig's numbers, the columns, the faults
//! that can be put into it.
//!
//! A description of an earlier emulator lacks newer fields: they are read as their defaults.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The description of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Description {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// `real` or `lockstep`.
    pub pace: String,
    /// The bus by its URL.
    pub bus: String,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Start of the run's clock, in s since 1970; null in lockstep, whose time is simulated.
    pub started_unix_s: Option<f64>,
    /// The run's folder, an absolute path.
    pub out: String,
    /// The experiment; null without one.
    pub experiment: Option<Experiment>,
    /// Whether commands are obeyed.
    pub console: bool,
    /// Whether effects are on that nobody shall know: then cycles have the columns of `measurement.csv` alone.
    pub sealed: bool,
    /// The columns of each cycle, in order.
    pub columns: Vec<Column>,
    /// Numbers of the rig that a drawing needs.
    pub rig: RigFigures,
    /// Linkage and weights at the start.
    pub setup: SetUp,
    /// The table of faults, as `emulator faults --json` lists it.
    pub faults: Vec<FaultEntry>,
    /// Late wake-ups that no event follows for: those that follow are the first of each kind.
    #[serde(rename = "untold")]
    pub dropped_events: DroppedEvents,
}

/// The experiment of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Experiment {
    /// Name of the file, without folder and extension.
    pub name: Option<String>,
    /// Title that stands in the file.
    pub title: Option<String>,
}

/// A column of the cycles.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// The file that it is a column of.
    pub table: Table,
    /// Name in that file.
    pub name: String,
    /// Unit; `1` for a plain number.
    pub unit: String,
}

/// A file of the run that has a row for each cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Table {
    /// `measurement.csv`.
    Measurement,
    /// `truth.csv`.
    Truth,
}

/// Numbers of the rig that a drawing needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RigFigures {
    /// Stroke of both cylinders, m.
    pub stroke_m: f64,
    /// Area of the piston on the cap side, m^2.
    pub piston_area_m2: f64,
    /// Area of the piston on the rod side, m^2.
    pub annulus_area_m2: f64,
    /// Pressure of the supply, absolute, Pa.
    pub supply_pressure_pa: f64,
    /// Pressure that the valves exhaust to, absolute, Pa.
    pub exhaust_pressure_pa: f64,
    /// Pressure of the atmosphere, absolute, Pa.
    pub atmospheric_pressure_pa: f64,
    /// Mass of all that moves with the drive's piston, without weights, kg.
    pub drive_mass_kg: f64,
    /// The part of it behind the force sensor, kg.
    pub carriage_mass_kg: f64,
    /// Mass of piston, rod and eye of the load axis, kg.
    pub load_mass_kg: f64,
    /// Largest mass of weights, kg.
    pub added_mass_limit_kg: f64,
    /// Play of the load eye in the carriage, both sides together, m.
    pub gap_m: f64,
    /// Force that the largest count of the force sensors stands for, both signs, N.
    pub force_range_n: f64,
}

/// Set-up of the rig that people can change during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SetUp {
    /// Whether the rods are linked.
    pub linked: bool,
    /// Mass of the weights on the carriage, kg.
    pub added_mass_kg: f64,
}

/// A row of the table of faults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultEntry {
    /// Name, as in scripts and at the console.
    pub fault: String,
    /// Part of the rig that it concerns.
    pub group: FaultGroup,
    /// Consequence, in a sentence.
    pub about: String,
    /// Places where it can be.
    pub places: Vec<String>,
    /// Numbers that an order may give it.
    pub keys: Vec<FaultKey>,
}

/// Part of the rig that a fault concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FaultGroup {
    /// Position, force and pressure sensors.
    Sensor,
    /// Proportional valves.
    Valve,
    /// Compressed-air supply.
    Supply,
    /// A chamber or its hose.
    Air,
    /// Masses, friction, linkage, end stops.
    Mechanics,
    /// Frames, and nodes that send them.
    Bus,
}

/// A number of a fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultKey {
    /// Name, ending in its unit.
    #[serde(rename = "key")]
    pub name: Cow<'static, str>,
    /// Unit; `1` for a plain number.
    pub unit: Cow<'static, str>,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Value when none is given; null for a number that has to be given.
    pub default: Option<f64>,
    /// Whether it has to be a whole number.
    pub whole: bool,
    /// Meaning, in a sentence.
    pub meaning: Cow<'static, str>,
}

impl FaultKey {
    /// Whether the value is in the range; a NaN lies in none.
    pub fn allows(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value) && (!self.whole || value == value.trunc())
    }

    /// The range in words, as `whole numbers from 1 to 10`.
    pub fn range(&self) -> String {
        let whole = if self.whole { "whole numbers from " } else { "" };
        let unit = if self.unit == "1" { "" } else { &self.unit };
        format!("{whole}{} to {} {unit}", self.min, self.max).trim_end().to_owned()
    }
}

/// Late wake-ups beyond those whose events are kept for viewers to come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct DroppedEvents {
    /// Late wake-ups.
    pub overruns: u64,
    /// Cycles that they skipped.
    pub skipped: u64,
}

impl Description {
    /// JSON with the keys of each object in the order of the alphabet.
    pub fn to_json(&self) -> String {
        // A value's map is sorted; numbers and texts have a JSON form.
        serde_json::to_value(self).map(|value| value.to_string()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_is_read_from_the_json_that_it_is_written_as() {
        let column = |table, name: &str, unit: &str| Column { table, name: name.into(), unit: unit.into() };
        let number = FaultKey {
            name: "offset_m".into(),
            unit: "m".into(),
            min: -0.5,
            max: 0.5,
            default: None,
            whole: false,
            meaning: "added".into(),
        };
        let description = Description {
            schema_version: 1,
            pace: "real".into(),
            bus: "can://vcan0".into(),
            seed: u64::MAX,
            started_unix_s: Some(1.5),
            out: "/tmp/run".into(),
            experiment: Some(Experiment { name: Some("steps".into()), title: None }),
            console: true,
            columns: vec![
                column(Table::Measurement, "drive_position_m", "m"),
                column(Table::Truth, "drive_spool", "1"),
            ],
            setup: SetUp { linked: true, added_mass_kg: 2.5 },
            faults: vec![FaultEntry {
                fault: "sensor-offset".into(),
                group: FaultGroup::Sensor,
                about: "shifted".into(),
                places: vec!["drive".into()],
                keys: vec![number],
            }],
            dropped_events: DroppedEvents { overruns: 10, skipped: 30 },
            ..Description::default()
        };
        let json = concat!(
            r#"{"bus":"can://vcan0","columns":[{"name":"drive_position_m","table":"measurement","unit":"m"},"#,
            r#"{"name":"drive_spool","table":"truth","unit":"1"}],"console":true,"#,
            r#""experiment":{"name":"steps","title":null},"faults":[{"about":"shifted","fault":"sensor-offset","#,
            r#""group":"sensor","keys":[{"default":null,"key":"offset_m","max":0.5,"meaning":"added","min":-0.5,"#,
            r#""unit":"m","whole":false}],"places":["drive"]}],"out":"/tmp/run","pace":"real","#,
            r#""rig":{"added_mass_limit_kg":0.0,"annulus_area_m2":0.0,"atmospheric_pressure_pa":0.0,"#,
            r#""carriage_mass_kg":0.0,"drive_mass_kg":0.0,"exhaust_pressure_pa":0.0,"force_range_n":0.0,"#,
            r#""gap_m":0.0,"load_mass_kg":0.0,"piston_area_m2":0.0,"stroke_m":0.0,"supply_pressure_pa":0.0},"#,
            r#""schema_version":1,"sealed":false,"seed":18446744073709551615,"#,
            r#""setup":{"added_mass_kg":2.5,"linked":true},"started_unix_s":1.5,"#,
            r#""untold":{"overruns":10,"skipped":30}}"#,
        );
        assert_eq!(description.to_json(), json);
        assert_eq!(serde_json::from_str::<Description>(json).unwrap(), description);
    }

    #[test]
    fn fields_that_an_earlier_emulator_lacks_have_their_defaults() {
        let read: Description = serde_json::from_str(r#"{"pace":"real","rig":{"stroke_m":0.5}}"#).unwrap();
        let rig = RigFigures { stroke_m: 0.5, ..RigFigures::default() };
        assert_eq!(read, Description { pace: "real".into(), rig, ..Description::default() });
    }
}
