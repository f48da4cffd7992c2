//! What a campaign varies: one `[[vary]]` of its file each.
//!
//! ```text
//! [[vary]]                                    changes
//! rig = "friction.viscous_n_per_mm_per_s"     a number of the rig file; of a list, "valve.kv_supply_m3_per_h.3"
//! rig = "effects.valve-offset.drive.offset_percent"   one of an effect, which is switched on with it
//! experiment = "rig.added_mass_kg"            a number of the experiment file; of its second set-point, "drive.set-point.1.to_m"
//! set = "drive.algorithm.gain_per_s"          a variable of a controller
//! fault = "valve-slow"                        a number of a fault: at = "drive", key = "…", from_s, to_s as in a script
//! choose = "experiment"                       a whole file: "experiment", "rig", "drive-program", "load-program"
//! choose = "hidden"                           one effect, or "none"; its place and numbers are drawn as for sealed rigs
//! ```
//!
//! In a campaign of a program (`command = […]`) a `[[vary]]` has a `name` alone, by which the program is given its value.
//!
//! `list = […]` is gone through, each of its values beside each of every other list; from `range = [least, most]` a value is
//! drawn for each run, evenly, or evenly in its order of magnitude with `log = true`.

use plant::effects::draw::Among;
use plant::effects::{SHEETS, sheet};
use serde::Deserialize;
use std::fmt;

/// What is varied, and through which values.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    /// Name of its column.
    pub name: String,
    pub changes: Changes,
    pub values: Values,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Changes {
    /// A number of the rig file, by its path.
    Rig(String),
    /// A number of the experiment file, by its path.
    Experiment(String),
    Variable(String),
    Fault(FaultNumber),
    /// A file as a whole.
    File(FileChoice),
    /// The effect that the rig has and the controllers do not know, at a place among these.
    Hidden(Among),
    /// Nothing here: it is given to the program that is run.
    Passed,
}

/// A number of a fault, and when it acts.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultNumber {
    pub fault: String,
    /// Where; none for a fault that has one place.
    pub at: Option<String>,
    /// Which of its numbers.
    pub key: String,
    /// From when, s of the rig's time.
    pub from_s: f64,
    /// Until when; to the end without.
    pub to_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileChoice {
    Experiment,
    Rig,
    DriveProgram,
    LoadProgram,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Gone through.
    List(Vec<Value>),
    /// Drawn.
    Range(Range),
}

/// What a value is drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    pub(crate) ends: [f64; 2],
    /// Evenly in the order of magnitude, not in the value; then both ends are above 0.
    pub log: bool,
}

impl Range {
    /// The value at a share of it, 0 to 1.
    #[must_use]
    pub fn at(&self, share: f64) -> f64 {
        let Range { ends: [least, most], log } = *self;
        let value = if log {
            let (low, high) = (libm::log(least), libm::log(most));
            libm::exp(low + (high - low) * share)
        } else {
            least + (most - least) * share
        };
        value.clamp(least, most)
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// In the unit of the file that it goes into.
    Number(f64),
    /// Name of a file or of an effect.
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // The fewest digits that read back to the same bits.
            Value::Number(number) => write!(out, "{number}"),
            Value::Text(text) => write!(out, "{text}"),
        }
    }
}

impl Value {
    /// The number, where it is one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Value::Number(number) => Some(*number),
            Value::Text(_) => None,
        }
    }
}

impl Values {
    /// How many are gone through; 1 for those that are drawn.
    #[must_use]
    pub fn listed(&self) -> usize {
        match self {
            Values::List(list) => list.len(),
            Values::Range(_) => 1,
        }
    }

    /// Whether they are drawn.
    #[must_use]
    pub fn drawn(&self) -> bool {
        matches!(self, Values::Range(_))
    }
}

/// `[[vary]]` as it stands in the file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct VaryTable {
    name: Option<String>,
    rig: Option<String>,
    experiment: Option<String>,
    set: Option<String>,
    fault: Option<String>,
    choose: Option<String>,
    at: Option<String>,
    key: Option<String>,
    from_s: Option<f64>,
    to_s: Option<f64>,
    among: Option<String>,
    list: Option<Vec<Value>>,
    range: Option<[f64; 2]>,
    log: bool,
}

/// What `choose` may name.
const CHOICES: &str = "\"experiment\", \"rig\", \"drive-program\", \"load-program\" or \"hidden\"";

impl VaryTable {
    /// The factor.
    ///
    /// # Errors
    /// What is wrong and what would be right, in words; the caller knows the line.
    pub(crate) fn factor(self) -> Result<Factor, String> {
        let values = self.values()?;
        let (usual, changes) = self.changes()?;
        check_kind(&changes, &values)?;
        Ok(Factor { name: self.name.clone().unwrap_or(usual), changes, values })
    }

    fn values(&self) -> Result<Values, String> {
        match (&self.list, self.range) {
            (Some(list), None) if list.is_empty() => Err("list: needs at least one value".into()),
            (Some(_), None) if self.log => Err("log: goes with a range, not with a list".into()),
            (Some(list), None) => check_list(list).map(|()| Values::List(list.clone())),
            (None, Some(ends)) => check_range(ends, self.log),
            _ => Err("needs either list = [value, …] or range = [least, most]".into()),
        }
    }

    fn changes(&self) -> Result<(String, Changes), String> {
        let subjects = [&self.rig, &self.experiment, &self.set, &self.fault, &self.choose];
        let one = "needs exactly one of rig, experiment, set, fault, choose";
        match (subjects.iter().filter(|subject| subject.is_some()).count(), &self.name) {
            (0, Some(name)) => return Ok((name.clone(), Changes::Passed)),
            (1, _) => {}
            _ => return Err(one.into()),
        }
        let of_fault = [self.at.is_some(), self.key.is_some(), self.from_s.is_some(), self.to_s.is_some()];
        if self.fault.is_none() && of_fault.contains(&true) {
            return Err("at, key, from_s and to_s go with fault".into());
        }
        if self.choose.as_deref() != Some("hidden") && self.among.is_some() {
            return Err("among goes with choose = \"hidden\"".into());
        }
        let named = |text: &String, make: fn(String) -> Changes| (text.clone(), make(text.clone()));
        if let Some(path) = &self.rig {
            return Ok(named(path, Changes::Rig));
        }
        if let Some(path) = &self.experiment {
            return Ok(named(path, Changes::Experiment));
        }
        if let Some(name) = &self.set {
            return Ok(named(name, Changes::Variable));
        }
        if let Some(fault) = &self.fault {
            return self.fault_number(fault);
        }
        let choose = self.choose.as_deref().ok_or(one)?;
        let changes = match choose {
            "experiment" => Changes::File(FileChoice::Experiment),
            "rig" => Changes::File(FileChoice::Rig),
            "drive-program" => Changes::File(FileChoice::DriveProgram),
            "load-program" => Changes::File(FileChoice::LoadProgram),
            "hidden" => Changes::Hidden(self.places()?),
            other => return Err(format!("choose = \"{other}\": allowed are {CHOICES}")),
        };
        Ok((choose.to_owned(), changes))
    }

    fn fault_number(&self, fault: &str) -> Result<(String, Changes), String> {
        let key = self.key.clone().ok_or("fault: needs the key of its number that is varied")?;
        let from_s = self.from_s.unwrap_or(0.0);
        let sound = from_s >= 0.0 && self.to_s.is_none_or(|to_s| to_s > from_s);
        if !sound {
            return Err("from_s: from 0, and before to_s".into());
        }
        let at = self.at.clone();
        let usual =
            [Some(fault), at.as_deref(), Some(&key)].into_iter().flatten().collect::<Vec<_>>().join(".");
        Ok((usual, Changes::Fault(FaultNumber { fault: fault.to_owned(), at, key, from_s, to_s: self.to_s })))
    }

    fn places(&self) -> Result<Among, String> {
        match self.among.as_deref() {
            None | Some("drive") => Ok(Among::Drive),
            Some("load") => Ok(Among::Load),
            Some("both") => Ok(Among::Both),
            Some(other) => Err(format!("among = \"{other}\": allowed are \"drive\", \"load\", \"both\"")),
        }
    }
}

fn check_list(list: &[Value]) -> Result<(), String> {
    let finite = |value: &Value| !matches!(value, Value::Number(number) if !number.is_finite());
    if !list.iter().all(finite) {
        return Err("list: numbers must be finite".into());
    }
    let doubled = list.iter().enumerate().find(|(place, value)| list[..*place].contains(value));
    doubled.map_or(Ok(()), |(_, value)| Err(format!("list: {value} stands there twice")))
}

fn check_range(ends: [f64; 2], log: bool) -> Result<Values, String> {
    let [least, most] = ends;
    if !(least.is_finite() && most.is_finite() && least < most) {
        return Err(format!("range = [{least}, {most}]: two finite numbers, the smaller first"));
    }
    if log && least <= 0.0 {
        return Err(format!("range = [{least}, {most}]: with log = true both are above 0"));
    }
    Ok(Values::Range(Range { ends, log }))
}

/// Files and effects have names, everything else has numbers.
fn check_kind(changes: &Changes, values: &Values) -> Result<(), String> {
    if *changes == Changes::Passed {
        return Ok(());
    }
    let names = matches!(changes, Changes::File(_) | Changes::Hidden(_));
    let fits = match values {
        Values::List(list) => list.iter().all(|value| matches!(value, Value::Text(_)) == names),
        Values::Range(_) => !names,
    };
    if !fits {
        return Err(if names { "needs a list of names" } else { "needs numbers" }.into());
    }
    if let (Changes::Hidden(among), Values::List(list)) = (changes, values) {
        for name in list.iter().map(Value::to_string).filter(|name| name != NONE_HIDDEN) {
            let known = sheet(&name).filter(|sheet| sheet.place.places().iter().any(|at| among.allows(*at)));
            if known.is_none() {
                let names: Vec<_> = SHEETS.iter().map(|sheet| sheet.name).collect();
                return Err(format!(
                    "list: no effect \"{name}\" on these axes; there are \"{NONE_HIDDEN}\", {}",
                    names.join(", ")
                ));
            }
        }
    }
    Ok(())
}

/// Name of no hidden effect.
pub const NONE_HIDDEN: &str = "none";

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(text: &str) -> Result<Factor, String> {
        toml::from_str::<VaryTable>(text).map_err(|error| error.to_string())?.factor()
    }

    #[test]
    fn each_subject_becomes_a_factor_with_a_name() {
        for (text, name) in [
            ("rig = \"friction.sliding_force_n\"\nrange = [20, 30]", "friction.sliding_force_n"),
            ("set = \"drive.algorithm.gain_per_s\"\nlist = [20, 25.5]", "drive.algorithm.gain_per_s"),
            ("experiment = \"rig.added_mass_kg\"\nlist = [0, 10]\nname = \"weights\"", "weights"),
            ("choose = \"experiment\"\nlist = [\"step\", \"soak\"]", "experiment"),
            ("choose = \"hidden\"\nlist = [\"none\", \"valve-offset\"]", "hidden"),
            (
                "fault = \"valve-slow\"\nat = \"drive\"\nkey = \"time_constant_s\"\nrange = [0.01, 1]\nlog = true",
                "valve-slow.drive.time_constant_s",
            ),
        ] {
            assert_eq!(factor(text).unwrap().name, name, "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_what_would_be_right() {
        for (text, words) in [
            ("rig = \"a.b\"", "either list"),
            ("rig = \"a.b\"\nlist = []", "at least one"),
            ("rig = \"a.b\"\nlist = [1, 1]", "twice"),
            ("rig = \"a.b\"\nlist = [nan]", "finite"),
            ("rig = \"a.b\"\nlist = [\"x\"]", "numbers"),
            ("rig = \"a.b\"\nrange = [2, 1]", "smaller first"),
            ("rig = \"a.b\"\nrange = [0, 1]\nlog = true", "above 0"),
            ("rig = \"a.b\"\nset = \"c\"\nlist = [1]", "exactly one"),
            ("rig = \"a.b\"\nat = \"drive\"\nlist = [1]", "go with fault"),
            ("choose = \"weather\"\nlist = [\"rain\"]", "drive-program"),
            ("choose = \"experiment\"\nrange = [1, 2]", "list of names"),
            ("choose = \"hidden\"\nlist = [\"rust\"]", "no effect \"rust\""),
            ("choose = \"hidden\"\nlist = [\"coupling-backlash\"]", "on these axes"),
            ("fault = \"valve-slow\"\nlist = [1]", "key"),
            ("unknown = 1\nlist = [1]", "unknown"),
        ] {
            let error = factor(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn a_range_is_gone_through_evenly_or_by_magnitude() {
        let even = Range { ends: [2.0, 4.0], log: false };
        assert_eq!([even.at(0.0), even.at(0.5), even.at(1.0)], [2.0, 3.0, 4.0]);
        let magnitude = Range { ends: [0.01, 1.0], log: true };
        assert!((magnitude.at(0.5) - 0.1).abs() < 1e-15);
        assert_eq!([magnitude.at(0.0), magnitude.at(1.0)], [0.01, 1.0]);
    }
}
