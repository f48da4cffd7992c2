//! A fault script: faults with place and time, checked before the run.
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
//! A script has the same effect in real time and in lockstep: its times are cycles of the rig.

use super::{Fault, FaultError};
use plant::Truth;
use settings::parameters::Parameter;
use settings::{Section, SettingsError, Source};
use std::path::Path;

/// Longest time of a script, s: more than a day.
const LONGEST_S: f64 = 1e5;
static FROM: Parameter =
    Parameter::new(("from_s", "s"), [0.0, LONGEST_S], 0.0, "first time at which it may be");
static TO: Parameter = Parameter::new(("to_s", "s"), [0.0, LONGEST_S], 0.0, "when it ends");
static FOR: Parameter = Parameter::new(("for_s", "s"), [0.001, LONGEST_S], 0.0, "how long it lasts");
static SEED: Parameter = Parameter::new(("seed", ""), [0.0, 9e15], 1.0, "of all that is random").whole();
/// Most faults of a script: numbers have 16 bits on the bus, and faults by hand come after the script's.
const MOST_FAULTS: usize = 1000;

/// A checked script.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultScript {
    /// Seed of all random numbers of its faults.
    pub(crate) seed: u64,
    /// Its faults, in the order of the file.
    pub faults: Vec<ScheduledFault>,
}

/// A fault with its schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledFault {
    /// The fault itself.
    pub fault: Fault,
    /// Line of its head, from 1.
    pub(crate) line: u32,
    /// First cycle in which it may begin.
    pub(crate) from: u64,
    /// Condition that must hold too for it to begin.
    pub(crate) when: Option<Condition>,
    /// Its end; `None`: never.
    pub(crate) until: Option<FaultEnd>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FaultEnd {
    Cycle(u64),
    /// Number of cycles after its begin.
    After(u64),
}

/// A threshold on a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Condition {
    signal: usize,
    above: bool,
    threshold: f64,
}

/// A signal of conditions: its name with unit, and its value.
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

/// Names of the signals of conditions.
pub(crate) fn signals() -> impl Iterator<Item = &'static str> {
    SIGNALS.iter().map(|(name, _)| *name)
}

impl Condition {
    /// Whether it holds, for the true state and the openings in effect.
    pub(crate) fn holds(&self, truth: &Truth, valve: [f64; 2]) -> bool {
        let value = SIGNALS[self.signal].1(truth, valve);
        if self.above { value > self.threshold } else { value < self.threshold }
    }
}

/// Keys of a fault besides its numbers.
const SCRIPT_KEYS: [&str; 8] = ["name", "at", "from_s", "to_s", "for_s", "when", "above", "below"];

impl FaultScript {
    /// Parses a script; `file` names it in messages.
    ///
    /// # Errors
    /// The text is no script: file and line, and what is allowed.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, SettingsError> {
        let source = Source::parse(text, Path::new(file))?;
        let mut root = source.root();
        root.allow(&["seed", "fault"])?;
        let seed = root.number_or_default(&SEED)? as u64;
        let sections = root.sections("fault")?;
        if sections.len() > MOST_FAULTS {
            return Err(root.refused("fault", &format!("allowed are at most {MOST_FAULTS}")));
        }
        let faults = sections.into_iter().map(|mut section| planned(&source, &mut section));
        Ok(Self { seed, faults: faults.collect::<Result<_, _>>()? })
    }
}

fn planned(source: &Source<'_>, section: &mut Section<'_>) -> Result<ScheduledFault, SettingsError> {
    let name = section.needed_text("name", "'emulator faults' lists them")?.text;
    let at = section.text("at")?.map(|at| at.text);
    let numbers: Vec<_> = section
        .keys()
        .into_iter()
        .filter(|key| !SCRIPT_KEYS.contains(&key.as_str()))
        .map(|key| (key.clone(), section.peek_number(&key), section.written(&key)))
        .collect();
    let fault = Fault::new(&name, at.as_deref(), &numbers).map_err(|error| {
        let blamed = match &error {
            FaultError::Unknown(_) => "name",
            FaultError::Place { .. } => "at",
            FaultError::Key { key, .. } | FaultError::Value { key, .. } => key,
            FaultError::Missing { key, .. } => key, // at the head of the fault, since it is not there
        };
        source.wrong_from(section.at(blamed), &error.to_string())
    })?;
    let mut cycle = |parameter| {
        let time_s = section.number(parameter)?;
        Ok(time_s.map(|time_s| (time_s * 1000.0).round() as u64))
    };
    let (from, to, after) = (cycle(&FROM)?.unwrap_or(0), cycle(&TO)?, cycle(&FOR)?);
    let until = match (to, after) {
        (Some(_), Some(_)) => return Err(section.refused("for_s", "to_s and for_s exclude each other")),
        (Some(to), None) if to <= from => {
            return Err(section.refused("to_s", "to_s must be at least 0.001 s after from_s"));
        }
        (Some(to), None) => Some(FaultEnd::Cycle(to)),
        (None, after) => after.map(FaultEnd::After),
    };
    let when = condition(section)?;
    Ok(ScheduledFault { fault, line: section.line() as u32, from, when, until })
}

fn condition(section: &mut Section<'_>) -> Result<Option<Condition>, SettingsError> {
    let (above, below) = (section.finite("above")?, section.finite("below")?);
    if !section.has("when") {
        let alone = ["above", "below"].into_iter().find(|key| section.has(key));
        let rule = "above and below belong to a condition: say when = \"SIGNAL\"";
        return alone.map_or(Ok(None), |key| Err(section.refused(key, rule)));
    }
    let names: Vec<_> = signals().enumerate().map(|(place, name)| (name, place)).collect();
    let signal = section.choice("when", &names)?;
    match (above, below) {
        (Some(threshold), None) => Ok(Some(Condition { signal, above: true, threshold })),
        (None, Some(threshold)) => Ok(Some(Condition { signal, above: false, threshold })),
        _ => Err(section.refused("when", "a condition has either above or below")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<FaultScript, SettingsError> {
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
        assert_eq!((stuck.when, stuck.until), (None, Some(FaultEnd::Cycle(2000))));
        assert_eq!(burst.fault.numbers().collect::<Vec<_>>(), [("kv_m3_per_h", 1.0)]);
        assert_eq!(burst.until, Some(FaultEnd::After(500)));
        assert_eq!(burst.when, Some(Condition { signal: 0, above: true, threshold: 0.25 }));
        assert_eq!((loss.fault.place(), loss.until), ("bus".into(), None));
    }

    #[test]
    fn a_bad_script_is_refused_with_line_key_value_and_what_is_allowed() {
        let (none, fault) = ("", "[[fault]]\n");
        let stuck = "[[fault]]\nname = \"valve-stuck\"\nat = \"drive\"\n";
        let offset = "[[fault]]\nname = \"valve-offset\"\nat = \"drive\"\n";
        for (head, rest, expected) in [
            (none, "x = 1\n", "1: unknown key x; allowed is seed, fault"),
            (none, "[[fault]\n", "1: not TOML:"),
            (none, "seed = -1\n", "1: seed = -1; allowed is a whole number, 0 to 9000000000000000"),
            (none, "fault = 3\n", "1: fault = 3; allowed is a list of tables: [[fault]]"),
            (fault, "at = \"drive\"\n", "1: fault[1].name is missing: 'emulator faults' lists them"),
            (fault, "name = 3\n", "2: fault[1].name = 3; allowed is a text"),
            (
                fault,
                "name = \"valve\"\n",
                "2: fault 'valve' is unknown; 'emulator faults' lists the known ones, such as valve-",
            ),
            (
                fault,
                "name = \"volve-stuck\"\n",
                "2: fault 'volve-stuck' is unknown; 'emulator faults' lists the known ones",
            ),
            (
                fault,
                "name = \"valve-stuck\"\nat = \"both\"\n",
                "3: at = 'both': valve-stuck acts at one of drive, load",
            ),
            (fault, "name = \"valve-stuck\"\n", "1: at = '': valve-stuck acts at one of drive, load"),
            (offset, "", "1: valve-offset needs offset; allowed: -1 to 1"),
            (offset, "offset = 1.5\n", "4: offset = 1.5: allowed: -1 to 1"),
            (offset, "offset = nan\n", "4: offset = nan: allowed: -1 to 1"),
            (offset, "offset = \"x\"\n", "4: offset = \"x\": allowed: -1 to 1"),
            (offset, "offset = 0.1\ngain = 2\n", "5: unknown key gain = 2; valve-offset has offset"),
            (stuck, "gain = 2\n", "4: unknown key gain = 2; valve-stuck has no numbers"),
            (stuck, "from_s = -1\n", "4: fault[1].from_s = -1 s; allowed is 0 to 100000 s"),
            (stuck, "from_s = inf\n", "4: fault[1].from_s = inf s; allowed is 0 to 100000 s"),
            (
                stuck,
                "from_s = 1\nto_s = 1\n",
                "5: fault[1].to_s = 1; to_s must be at least 0.001 s after from_s",
            ),
            (stuck, "to_s = 1\nfor_s = 1\n", "5: fault[1].for_s = 1; to_s and for_s exclude each other"),
            (stuck, "above = 1\n", "4: fault[1].above = 1; above and below belong to a condition"),
            (stuck, "when = \"x\"\n", "4: fault[1].when = \"x\"; allowed is drive.position_m, "),
            (stuck, "when = \"drive.valve\"\n", "4: fault[1].when = \"drive.valve\"; a condition has either"),
            (
                stuck,
                "when = \"drive.valve\"\nabove = nan\n",
                "5: fault[1].above = nan; allowed is a finite number",
            ),
            (
                fault,
                "name = \"bus-delay\"\ndelay_ms = 1.5\n",
                "3: delay_ms = 1.5: allowed: whole numbers from 1 to 10000 ms",
            ),
        ] {
            let (text, expected) = (format!("{head}{rest}"), format!("f.toml:{expected}"));
            let message = read(&text).unwrap_err().to_string();
            assert!(message.starts_with(&expected), "{text}\nsays {message}\nnot  {expected}");
        }
    }
}
