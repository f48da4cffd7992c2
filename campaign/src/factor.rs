//! Factors of a campaign: one for each `[[vary]]` of its file.
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
//! In a campaign of a program (`command = […]`) a `[[vary]]` has a `name` alone, the key of its value in the program's request.
//!
//! Lists (`list = […]`) form a full factorial design; from `range = [least, most]` a value is drawn for each run, uniformly, or
//! log-uniformly with `log = true`.

use plant::effects::draw::AxisSelection;
use plant::effects::{SHEETS, sheet};
use settings::{Section, SettingsError};
use std::fmt;
use toml::de::DeValue;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Factor {
    /// Name of its column.
    pub name: String,
    pub changes: Changes,
    pub values: Values,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Changes {
    /// A number of the rig file, by its path.
    Rig(String),
    /// A number of the experiment file, by its path.
    Experiment(String),
    Variable(String),
    Fault(FaultNumber),
    /// A file as a whole.
    File(FileChoice),
    /// An effect of the rig that the controllers do not know, at one of these places.
    Hidden(AxisSelection),
    /// A value of a command, which receives it in its request.
    CommandValue,
}

/// A number of a fault, and when it acts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FaultNumber {
    pub fault: String,
    /// Place of the fault; `None` for a fault with one place.
    pub at: Option<String>,
    /// Key of the number that is varied.
    pub key: String,
    /// Start, s of the rig's time.
    pub from_s: f64,
    /// End, s of the rig's time; `None`: the end of the run.
    pub to_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FileChoice {
    Experiment,
    Rig,
    DriveProgram,
    LoadProgram,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    /// Values that are combined with all those of the other lists.
    List(Vec<Value>),
    /// A range from which each draw of the campaign takes a value.
    Range(Range),
}

/// Distribution that values are drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) ends: [f64; 2],
    /// Log-uniform instead of uniform; both ends are above 0 then.
    pub log: bool,
}

impl Range {
    /// Quantile of the distribution at `share`, 0 to 1.
    pub(crate) fn at(&self, share: f64) -> f64 {
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

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
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
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Value::Number(number) => Some(*number),
            Value::Text(_) => None,
        }
    }
}

impl Values {
    /// Number of levels of a list; 1 for a range.
    pub(crate) fn listed(&self) -> usize {
        match self {
            Values::List(list) => list.len(),
            Values::Range(_) => 1,
        }
    }
}

/// Keys that name the target of a factor.
const SUBJECTS: [&str; 5] = ["rig", "experiment", "set", "fault", "choose"];
/// Keys of faults alone.
const OF_A_FAULT: [&str; 4] = ["at", "key", "from_s", "to_s"];

/// Values of `choose`; `None`: a hidden effect.
const CHOICES: [(&str, Option<FileChoice>); 5] = [
    ("experiment", Some(FileChoice::Experiment)),
    ("rig", Some(FileChoice::Rig)),
    ("drive-program", Some(FileChoice::DriveProgram)),
    ("load-program", Some(FileChoice::LoadProgram)),
    ("hidden", None),
];
const AMONG: [(&str, AxisSelection); 3] =
    [("drive", AxisSelection::Drive), ("load", AxisSelection::Load), ("both", AxisSelection::Both)];

/// The factor of a `[[vary]]`.
pub(crate) fn read(section: &mut Section<'_>) -> Result<Factor, SettingsError> {
    section.allow(&[&SUBJECTS[..], &OF_A_FAULT, &["name", "among", "list", "range", "log"]].concat())?;
    let name = section.text("name")?.map(|name| name.text);
    let values = values(section)?;
    let (usual, changes) = changes(section, name.as_ref())?;
    check_kind(section, &changes, &values)?;
    Ok(Factor { name: name.unwrap_or(usual), changes, values })
}

fn values(section: &mut Section<'_>) -> Result<Values, SettingsError> {
    let (list, ends, log) = (section.list("list")?, section.numbers("range")?, section.flag("log")?);
    match list {
        Some([]) => Err(section.refused("list", "needs at least one value")),
        Some(_) if log => Err(section.refused("log", "goes with a range, not with a list")),
        Some(list) if !section.has("range") => {
            let value = |item: &DeValue<'_>| match item.as_str() {
                Some(text) => Some(Value::Text(text.to_owned())),
                None => settings::number(item).filter(|number| number.is_finite()).map(Value::Number),
            };
            let values: Option<Vec<_>> = list.iter().map(|item| value(item.get_ref())).collect();
            let values =
                values.ok_or_else(|| section.refused("list", "allowed are finite numbers and names"))?;
            let doubled = values.iter().enumerate().find(|(place, value)| values[..*place].contains(value));
            if let Some((_, value)) = doubled {
                return Err(section.refused("list", &format!("{value} is listed twice")));
            }
            Ok(Values::List(values))
        }
        None if section.has("range") => match ends[..] {
            [least, most] if least < most && log && least <= 0.0 => {
                Err(section.refused("range", "with log = true both are above 0"))
            }
            [least, most] if least < most => Ok(Values::Range(Range { ends: [least, most], log })),
            _ => Err(section.refused("range", "allowed are two finite numbers, the smaller first")),
        },
        _ => Err(section.wrong("list: needs either list = [value, …] or range = [least, most]")),
    }
}

/// The target of a factor, and the default name of its column.
fn changes(section: &mut Section<'_>, name: Option<&String>) -> Result<(String, Changes), SettingsError> {
    let subjects: Vec<_> = SUBJECTS.into_iter().filter(|key| section.has(key)).collect();
    let subject = match (&subjects[..], name) {
        ([], Some(name)) => return Ok((name.clone(), Changes::CommandValue)),
        ([subject], _) => *subject,
        _ => return Err(section.wrong(&format!("rig: needs exactly one of {}", SUBJECTS.join(", ")))),
    };
    let text = section.needed_text(subject, "what is changed")?.text;
    if let Some(key) = OF_A_FAULT.iter().find(|key| subject != "fault" && section.has(key)) {
        return Err(section.refused(key, "at, key, from_s and to_s go with fault"));
    }
    if section.has("among") && (subject, text.as_str()) != ("choose", "hidden") {
        return Err(section.refused("among", "goes with choose = \"hidden\""));
    }
    let changes = match subject {
        "rig" => Changes::Rig(text.clone()),
        "experiment" => Changes::Experiment(text.clone()),
        "set" => Changes::Variable(text.clone()),
        "fault" => return fault_number(section, text),
        _ => match section.choice("choose", &CHOICES)? {
            Some(file) => Changes::File(file),
            None => Changes::Hidden(section.choice("among", &AMONG)?),
        },
    };
    Ok((text, changes))
}

fn fault_number(section: &mut Section<'_>, fault: String) -> Result<(String, Changes), SettingsError> {
    let key = section.needed_text("key", "which number of the fault is varied")?.text;
    let at = section.text("at")?.map(|at| at.text);
    let (from_s, to_s) = (section.finite("from_s")?.unwrap_or(0.0), section.finite("to_s")?);
    if from_s < 0.0 || to_s.is_some_and(|to_s| to_s <= from_s) {
        return Err(section.wrong("from_s: from 0, and before to_s"));
    }
    let usual = [Some(&fault), at.as_ref(), Some(&key)].into_iter().flatten().cloned().collect::<Vec<_>>();
    Ok((usual.join("."), Changes::Fault(FaultNumber { fault, at, key, from_s, to_s })))
}

/// Files and effects have names, everything else has numbers.
fn check_kind(section: &Section<'_>, changes: &Changes, values: &Values) -> Result<(), SettingsError> {
    if *changes == Changes::CommandValue {
        return Ok(());
    }
    let names = matches!(changes, Changes::File(_) | Changes::Hidden(_));
    let (key, fits) = match values {
        Values::List(list) => ("list", list.iter().all(|value| matches!(value, Value::Text(_)) == names)),
        Values::Range(_) => ("range", !names),
    };
    if !fits {
        return Err(section.refused(key, if names { "needs a list of names" } else { "needs numbers" }));
    }
    if let (Changes::Hidden(among), Values::List(list)) = (changes, values) {
        for name in list.iter().map(Value::to_string).filter(|name| name != NONE_HIDDEN) {
            let known = sheet(&name).filter(|sheet| sheet.place.places().iter().any(|at| among.allows(*at)));
            if known.is_none() {
                let names: Vec<_> = SHEETS.iter().map(|sheet| sheet.name).collect();
                let problem = format!(
                    "no effect \"{name}\" on these axes; there are \"{NONE_HIDDEN}\", {}",
                    names.join(", ")
                );
                return Err(section.refused("list", &problem));
            }
        }
    }
    Ok(())
}

/// Value of a factor for a run without a hidden effect.
pub(crate) const NONE_HIDDEN: &str = "none";

#[cfg(test)]
mod tests {
    use super::*;
    use settings::Source;
    use std::path::Path;

    fn factor(text: &str) -> Result<Factor, String> {
        let source = Source::parse(text, Path::new("c.toml")).map_err(|error| error.to_string())?;
        read(&mut source.root()).map_err(|error| error.to_string())
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
    fn a_bad_factor_is_refused_with_what_would_be_right() {
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
