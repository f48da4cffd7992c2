//! A file of faults: which, where, when, checked before the run.
//!
//! ```toml
//! seed = 7                         # of everything in it that is random; default 1
//!
//! [[fault]]                        # by time
//! name = "valve-stuck"             # as 'emulator faults' lists them
//! at = "drive"                     # may be left out where there is one place only
//! from_s = 1.0                     # the rig's time; default 0
//! to_s = 2.5                       # or for_s = 1.5; without either it stays
//!
//! [[fault]]                        # by condition: once it holds, from from_s on and before to_s
//! name = "hose-burst"
//! at = "drive.a"
//! when = "drive.position_m"        # one of the signals below, as it truly is
//! above = 0.25                     # or below = …
//! for_s = 0.5                      # counts from when it began
//! kv_m3_per_h = 1.5                # the fault's own numbers, by their keys
//! ```
//!
//! The same file means the same in real time and in lockstep: times are the rig's cycles.

use super::{Fault, FaultError};
use plant::Truth;
use settings::number;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest time of a script, s: more than a day.
const LONGEST_S: f64 = 1e5;
/// Most faults of a script: their numbers are 16 bits on the bus, and the console's come after them.
const MOST_FAULTS: usize = 1000;

/// A script, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultScript {
    /// Seed of everything that is random.
    pub seed: u64,
    pub faults: Vec<Planned>,
}

/// A fault with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    pub fault: Fault,
    /// Line of its head, from 1.
    pub line: u32,
    /// First cycle in which it may be.
    pub from: u64,
    /// What has to hold as well.
    pub when: Option<Condition>,
    /// `None`: never.
    pub until: Option<Until>,
}

/// When a fault ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Until {
    Cycle(u64),
    /// So many cycles after it began.
    After(u64),
}

/// Something that has to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    signal: usize,
    above: bool,
    threshold: f64,
}

/// Signals of conditions, each with its unit in its name.
type Signal = (&'static str, fn(&Truth, [f64; 2]) -> f64);

const SIGNALS: &[Signal] = &[
    ("drive.position_m", |truth, _| truth.axes[0].position_m),
    ("drive.rod_velocity_m_per_s", |truth, _| truth.axes[0].rod_velocity_m_per_s),
    ("drive.force_n", |truth, _| truth.axes[0].sensor_force_n),
    ("drive.pressure_a_pa", |truth, _| truth.axes[0].pressure_a_pa),
    ("drive.pressure_b_pa", |truth, _| truth.axes[0].pressure_b_pa),
    ("drive.valve", |_, valve| valve[0]),
    ("load.position_m", |truth, _| truth.axes[1].position_m),
    ("load.rod_velocity_m_per_s", |truth, _| truth.axes[1].rod_velocity_m_per_s),
    ("load.force_n", |truth, _| truth.axes[1].sensor_force_n),
    ("load.pressure_a_pa", |truth, _| truth.axes[1].pressure_a_pa),
    ("load.pressure_b_pa", |truth, _| truth.axes[1].pressure_b_pa),
    ("load.valve", |_, valve| valve[1]),
    ("supply.pressure_pa", |truth, _| truth.supply_pressure_pa),
];

/// Names of the signals that a condition can be on.
pub fn signals() -> impl Iterator<Item = &'static str> {
    SIGNALS.iter().map(|(name, _)| *name)
}

impl Condition {
    /// Whether it holds, given the truth and the commands that act.
    pub fn holds(&self, truth: &Truth, valve: [f64; 2]) -> bool {
        let value = SIGNALS[self.signal].1(truth, valve);
        if self.above { value > self.threshold } else { value < self.threshold }
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}:{line}: {problem}")]
pub struct ScriptError {
    pub file: String,
    pub line: usize,
    /// What is wrong, with key, value and what is allowed.
    pub problem: Problem,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    #[error("not TOML: {0}")]
    Syntax(String),
    /// Not as the table of faults says.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A key that no script has, or a value of the wrong type or out of range.
    #[error("{key} = {value}: allowed: {allowed}")]
    Value { key: String, value: String, allowed: String },
    /// Something is missing, or does not go with something else.
    #[error("{0}")]
    Rule(String),
}

/// Keys of a fault that are not its numbers.
const OWN_KEYS: [&str; 8] = ["name", "at", "from_s", "to_s", "for_s", "when", "above", "below"];

impl FaultScript {
    /// The script in `text`; `file` is for messages.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, ScriptError> {
        Reader { text, file }.read()
    }
}

struct Reader<'t> {
    text: &'t str,
    file: &'t str,
}

impl Reader<'_> {
    fn line(&self, offset: usize) -> usize {
        settings::line_of(self.text, offset)
    }

    fn refuse(&self, offset: usize, problem: impl Into<Problem>) -> ScriptError {
        ScriptError { file: self.file.to_owned(), line: self.line(offset), problem: problem.into() }
    }

    fn written(&self, value: &Spanned<DeValue<'_>>) -> String {
        settings::written(self.text, value.span())
    }

    fn bad_value(&self, key: &str, value: &Spanned<DeValue<'_>>, allowed: impl Into<String>) -> ScriptError {
        let (key, allowed) = (key.to_owned(), allowed.into());
        let problem = Problem::Value { key, value: self.written(value), allowed };
        self.refuse(value.span().start, problem)
    }

    fn read(&self) -> Result<FaultScript, ScriptError> {
        let root = DeTable::parse(self.text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            self.refuse(offset, Problem::Syntax(error.message().to_owned()))
        })?;
        let mut script = FaultScript { seed: 1, faults: Vec::new() };
        for (key, value) in root.get_ref() {
            match (key.get_ref().as_ref(), value.get_ref()) {
                ("seed", _) => {
                    let whole = |number: &f64| (0.0..=9e15).contains(number) && *number == number.trunc();
                    let seed = number(value.get_ref()).filter(whole);
                    script.seed = seed
                        .ok_or_else(|| self.bad_value("seed", value, "whole numbers from 0 to 9e15"))?
                        as u64;
                }
                ("fault", DeValue::Array(tables)) if tables.len() <= MOST_FAULTS => {
                    for table in tables {
                        let DeValue::Table(keys) = table.get_ref() else {
                            return Err(self.bad_value("fault", table, "tables, each as [[fault]]"));
                        };
                        script.faults.push(self.fault(keys, table.span().start)?);
                    }
                }
                ("fault", _) => {
                    let allowed = format!("tables, each as [[fault]], at most {MOST_FAULTS}");
                    return Err(self.bad_value("fault", value, allowed));
                }
                (other, _) => return Err(self.bad_value(other, value, "the keys seed and [[fault]]")),
            }
        }
        Ok(script)
    }

    fn fault(&self, table: &DeTable<'_>, head: usize) -> Result<Planned, ScriptError> {
        let text = |key: &str| {
            let Some(value) = table.get(key) else { return Ok(None) };
            match value.get_ref() {
                DeValue::String(text) => Ok(Some(text.as_ref())),
                _ => Err(self.bad_value(key, value, "a text in quotes")),
            }
        };
        let name = text("name")?.ok_or_else(|| {
            self.refuse(head, Problem::Rule("[[fault]] has no name; 'emulator faults' lists them".into()))
        })?;
        let at = text("at")?;
        let numbers: Vec<_> = table
            .iter()
            .filter(|(key, _)| !OWN_KEYS.contains(&key.get_ref().as_ref()))
            .map(|(key, value)| (key.get_ref().to_string(), number(value.get_ref()), self.written(value)))
            .collect();
        let fault = Fault::new(name, at, &numbers).map_err(|error| {
            let blamed = match &error {
                FaultError::Unknown(_) => table.get("name"),
                FaultError::Place { .. } => table.get("at"),
                FaultError::Key { key, .. } | FaultError::Value { key, .. } => table.get(key.as_str()),
                FaultError::Missing { .. } => None,
            };
            self.refuse(blamed.map_or(head, |value| value.span().start), error)
        })?;
        let from = self.cycle(table, "from_s", 0.0)?.unwrap_or(0);
        let until = match (self.cycle(table, "to_s", 0.0)?, self.cycle(table, "for_s", 0.001)?) {
            (Some(_), Some(_)) => {
                return Err(self.rule(table, "for_s", "to_s and for_s exclude each other"));
            }
            (Some(to), None) if to <= from => {
                return Err(self.rule(table, "to_s", "to_s must be at least 0.001 s after from_s"));
            }
            (Some(to), None) => Some(Until::Cycle(to)),
            (None, after) => after.map(Until::After),
        };
        let when = self.condition(table, text("when")?)?;
        Ok(Planned { fault, line: self.line(head) as u32, from, when, until })
    }

    fn condition(&self, table: &DeTable<'_>, signal: Option<&str>) -> Result<Option<Condition>, ScriptError> {
        let bound = |key: &str| {
            let Some(value) = table.get(key) else { return Ok(None) };
            let number = number(value.get_ref()).filter(|number| number.is_finite());
            number.map(Some).ok_or_else(|| self.bad_value(key, value, "finite numbers"))
        };
        let (above, below) = (bound("above")?, bound("below")?);
        let Some(name) = signal else {
            return match ["above", "below"].into_iter().find(|key| table.contains_key(*key)) {
                Some(key) => {
                    Err(self.rule(table, key, "above and below belong to a condition: say when = \"SIGNAL\""))
                }
                None => Ok(None),
            };
        };
        let Some(signal) = signals().position(|known| known == name) else {
            let value = table.get("when").expect("it was read");
            return Err(self.bad_value("when", value, signals().collect::<Vec<_>>().join(", ")));
        };
        match (above, below) {
            (Some(threshold), None) => Ok(Some(Condition { signal, above: true, threshold })),
            (None, Some(threshold)) => Ok(Some(Condition { signal, above: false, threshold })),
            _ => Err(self.rule(table, "when", "a condition has either above or below")),
        }
    }

    fn rule(&self, table: &DeTable<'_>, key: &str, rule: &str) -> ScriptError {
        let value = table.get(key).expect("the key at fault is there");
        self.refuse(value.span().start, Problem::Rule(format!("{key} = {}: {rule}", self.written(value))))
    }

    fn cycle(&self, table: &DeTable<'_>, key: &str, least_s: f64) -> Result<Option<u64>, ScriptError> {
        let Some(value) = table.get(key) else { return Ok(None) };
        let time_s = number(value.get_ref()).filter(|time_s| (least_s..=LONGEST_S).contains(time_s));
        let time_s =
            time_s.ok_or_else(|| self.bad_value(key, value, format!("{least_s} to {LONGEST_S} s")))?;
        Ok(Some((time_s * 1000.0).round() as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<FaultScript, ScriptError> {
        FaultScript::from_toml(text, "f.toml")
    }

    #[test]
    fn a_script_says_what_where_and_when() {
        let script = read(
            "seed = 7\n[[fault]]\nname = \"valve-stuck\"\nat = \"load\"\nfrom_s = 1.5\nto_s = 2\n\
             [[fault]]\nname = \"hose-burst\"\nat = \"drive.b\"\nwhen = \"drive.position_m\"\nabove = 0.25\nfor_s = 0.5\n\
             [[fault]]\nname = \"bus-loss\"\nprobability = 0.5\n",
        )
        .unwrap();
        assert_eq!((script.seed, script.faults.len()), (7, 3));
        let [stuck, burst, loss] = script.faults[..] else { panic!("three") };
        assert_eq!((stuck.fault.place(), stuck.line, stuck.from), ("load".into(), 2, 1500));
        assert_eq!((stuck.when, stuck.until), (None, Some(Until::Cycle(2000))));
        assert_eq!(burst.fault.numbers().collect::<Vec<_>>(), [("kv_m3_per_h", 1.0)]);
        assert_eq!(burst.until, Some(Until::After(500)));
        assert_eq!(burst.when, Some(Condition { signal: 0, above: true, threshold: 0.25 }));
        assert_eq!((loss.fault.place(), loss.until), ("bus".into(), None));
    }

    #[test]
    fn what_is_wrong_is_told_with_line_key_value_and_what_is_allowed() {
        let stuck = "[[fault]]\nname = \"valve-stuck\"\nat = \"drive\"\n";
        let offset = "[[fault]]\nname = \"valve-offset\"\nat = \"drive\"\n";
        for (text, expected) in [
            ("x = 1\n".to_owned(), "f.toml:1: x = 1: allowed: the keys seed and [[fault]]"),
            ("[[fault]\n".to_owned(), "f.toml:1: not TOML:"),
            ("seed = -1\n".to_owned(), "f.toml:1: seed = -1: allowed: whole numbers"),
            ("fault = 3\n".to_owned(), "f.toml:1: fault = 3: allowed: tables"),
            ("[[fault]]\nat = \"drive\"\n".to_owned(), "f.toml:1: [[fault]] has no name"),
            ("[[fault]]\nname = 3\n".to_owned(), "f.toml:2: name = 3: allowed: a text"),
            (
                "[[fault]]\nname = \"valve\"\n".to_owned(),
                "f.toml:2: fault 'valve' is unknown; 'emulator faults' lists those that there are, such as valve-",
            ),
            (
                "[[fault]]\nname = \"volve-stuck\"\n".to_owned(),
                "f.toml:2: fault 'volve-stuck' is unknown; 'emulator faults' lists those that there are",
            ),
            (
                "[[fault]]\nname = \"valve-stuck\"\nat = \"both\"\n".to_owned(),
                "f.toml:3: at = 'both': valve-stuck is at one of drive, load",
            ),
            (
                "[[fault]]\nname = \"valve-stuck\"\n".to_owned(),
                "f.toml:1: at = '': valve-stuck is at one of drive, load",
            ),
            (offset.to_owned(), "f.toml:1: valve-offset needs offset; allowed: -1 to 1"),
            (format!("{offset}offset = 1.5\n"), "f.toml:4: offset = 1.5: allowed: -1 to 1"),
            (format!("{offset}offset = nan\n"), "f.toml:4: offset = nan: allowed: -1 to 1"),
            (format!("{offset}offset = \"x\"\n"), "f.toml:4: offset = \"x\": allowed: -1 to 1"),
            (
                format!("{offset}offset = 0.1\ngain = 2\n"),
                "f.toml:5: unknown key gain = 2; valve-offset has offset",
            ),
            (format!("{stuck}gain = 2\n"), "f.toml:4: unknown key gain = 2; valve-stuck has no numbers"),
            (format!("{stuck}from_s = -1\n"), "f.toml:4: from_s = -1: allowed: 0 to 100000 s"),
            (format!("{stuck}from_s = inf\n"), "f.toml:4: from_s = inf: allowed: 0 to 100000 s"),
            (
                format!("{stuck}from_s = 1\nto_s = 1\n"),
                "f.toml:5: to_s = 1: to_s must be at least 0.001 s after from_s",
            ),
            (
                format!("{stuck}to_s = 1\nfor_s = 1\n"),
                "f.toml:5: for_s = 1: to_s and for_s exclude each other",
            ),
            (format!("{stuck}above = 1\n"), "f.toml:4: above = 1: above and below belong to a condition"),
            (format!("{stuck}when = \"x\"\n"), "f.toml:4: when = \"x\": allowed: drive.position_m, "),
            (
                format!("{stuck}when = \"drive.valve\"\n"),
                "f.toml:4: when = \"drive.valve\": a condition has either",
            ),
            (
                format!("{stuck}when = \"drive.valve\"\nabove = nan\n"),
                "f.toml:5: above = nan: allowed: finite",
            ),
            (
                "[[fault]]\nname = \"bus-delay\"\ndelay_ms = 1.5\n".to_owned(),
                "f.toml:3: delay_ms = 1.5: allowed: whole numbers from 1 to 10000 ms",
            ),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{text}\nsays {message}\nnot  {expected}");
        }
    }
}
