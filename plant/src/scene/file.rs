//! Reads `[rig]` of an experiment file, and says where and what is wrong.
//!
//! Each number is held against its range, and keys that do not go together are refused, so that what comes out can be
//! played without a look back.

use std::path::Path;

use settings::parameters::Parameter;
use settings::{Result, Section, Source};

use super::hand::STRONGEST_N;
use super::{Action, Event, Guidance, Hand, HandAction, Part, Scene, cycle_of};
use crate::parameters::RigParameters;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    EmergencyStop,
    Release,
    Link,
    Unlink,
    Weights,
}

const KINDS: [(&str, Kind); 5] = [
    ("emergency-stop", Kind::EmergencyStop),
    ("release", Kind::Release),
    ("link", Kind::Link),
    ("unlink", Kind::Unlink),
    ("weights", Kind::Weights),
];
const PARTS: [(&str, Part); 2] = [("carriage", Part::Carriage), ("load-eye", Part::LoadEye)];

/// Times of a script, s: up to more than a day.
const TIMES_S: [f64; 2] = [0.0, 1e5];

static FROM: Parameter = Parameter::new(("from_s", "s"), TIMES_S, 0.0, "when the hand is put on");
static TO: Parameter = Parameter::new(("to_s", "s"), TIMES_S, 0.0, "when it lets go");
static FORCE: Parameter =
    Parameter::new(("force_n", "N"), [-STRONGEST_N, STRONGEST_N], 0.0, "force of a push");
// The default is a guess.
static RAMP: Parameter =
    Parameter::new(("ramp_s", "s"), [0.0, 60.0], 0.05, "how long a push takes to its force and back");
static AT: Parameter = Parameter::new(("at_s", "s"), TIMES_S, 0.0, "when it is done");
static UNTIL: Parameter = Parameter::new(("until_s", "s"), TIMES_S, 0.0, "until when it is tried");

/// The `[rig]` of an experiment, checked.
pub(super) fn read(text: &str, file: &str, rig: &RigParameters) -> Result<Scene> {
    let source = Source::parse(text, Path::new(file))?;
    let mut table = source.root().section_or_empty("rig")?;
    let default = Scene::default();
    let position = place("carriage_position_m", rig);
    let scene = Scene {
        carriage_position_m: table.number(&position)?.unwrap_or(default.carriage_position_m),
        linked: table.flag("linked")?,
        added_mass_kg: table.number_or_default(&weights(rig))?,
        sealed: table.text("sealed")?.map(|sealed| sealed.text),
        hand: table.sections("hand")?.into_iter().map(|one| hand(one, rig)).collect::<Result<_>>()?,
        event: table.sections("event")?.into_iter().map(|one| event(one, rig)).collect::<Result<_>>()?,
    };
    table.finish()?;
    Ok(scene)
}

/// A place on the stroke.
fn place(name: &'static str, rig: &RigParameters) -> Parameter {
    Parameter::new((name, "m"), [0.0, rig.cylinder().stroke_m], 0.0, "a place on the stroke")
}

/// Weights on the carriage.
fn weights(rig: &RigParameters) -> Parameter {
    let range = [0.0, rig.mass().added_limit_kg];
    Parameter::new(("added_mass_kg", "kg"), range, 0.0, "weights on the carriage in all")
}

/// Refuses the first of `keys` that is there.
fn none_of(section: &Section<'_>, keys: &[&str], rule: &str) -> Result<()> {
    let there = keys.iter().find(|key| section.has(key));
    there.map_or(Ok(()), |key| Err(section.refused(key, rule)))
}

/// The time of `end`, which comes after the time `begin_s` of `begin`.
fn after(section: &mut Section<'_>, end: &Parameter, begin: &Parameter, begin_s: f64) -> Result<f64> {
    let end_s = section.needed_number(end)?;
    if cycle_of(end_s) > cycle_of(begin_s) {
        return Ok(end_s);
    }
    let rule = format!("it must be at least 0.001 s after {} = {begin_s}", begin.name);
    Err(section.refused(&end.name, &rule))
}

fn hand(mut table: Section<'_>, rig: &RigParameters) -> Result<Hand> {
    let on = table.needed_choice("on", &PARTS)?;
    let from_s = table.needed_number(&FROM)?;
    let to_s = after(&mut table, &TO, &FROM, from_s)?;
    let guide_to = place("guide_to_m", rig);
    let action = match (table.number(&FORCE)?, table.number(&guide_to)?) {
        (Some(force_n), None) => {
            let of_a_guide: Vec<&str> = Guidance::TABLE.iter().map(|key| &*key.name).collect();
            none_of(&table, &of_a_guide, "it belongs to a hand with guide_to_m, and this one has force_n")?;
            HandAction::Push { force_n, ramp_s: table.number_or_default(&RAMP)? }
        }
        (None, Some(guide_to_m)) => {
            none_of(&table, &["ramp_s"], "it belongs to a hand with force_n, and this one has guide_to_m")?;
            let mut guidance: Guidance = table.parameters()?;
            if !table.has("travel_s") {
                guidance.travel_s = guidance.travel_s.min(to_s - from_s);
            }
            HandAction::Guide { guide_to_m, guidance }
        }
        _ => {
            let rule = "a hand has one of force_n, guide_to_m: it pushes or it guides";
            return Err(table.refused("on", rule));
        }
    };
    table.finish()?;
    Ok(Hand { on, from_s, to_s, action })
}

fn event(mut table: Section<'_>, rig: &RigParameters) -> Result<Event> {
    let at_s = table.needed_number(&AT)?;
    let at_position_m = table.number(&place("at_position_m", rig))?;
    let kind = table.needed_choice("do", &KINDS)?;
    if kind != Kind::Link {
        none_of(&table, &["until_s"], "it belongs to do = \"link\" alone")?;
    }
    if kind != Kind::Weights {
        none_of(&table, &["added_mass_kg"], "it belongs to do = \"weights\" alone")?;
    }
    let action = match kind {
        Kind::EmergencyStop => Action::EmergencyStop,
        Kind::Release => Action::Release,
        Kind::Unlink => Action::Unlink,
        Kind::Link => {
            let until = table.has("until_s").then(|| after(&mut table, &UNTIL, &AT, at_s));
            Action::Link { until_s: until.transpose()? }
        }
        Kind::Weights => Action::Weights { added_mass_kg: table.needed_number(&weights(rig))? },
    };
    table.finish()?;
    Ok(Event { at_s, at_position_m, action })
}
