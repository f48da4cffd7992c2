//! `[drive]` and `[load]` of an experiment file: what one axis does.
//!
//! ```toml
//! program = "position-p"        # programs/NAME.toml beside the experiments' folder, or a path ending in .toml
//! start_m = 0.1                 # where initial positioning goes; a row of forces may leave it out
//! prepare = ["relieve", "match"]
//! during = "set-point"          # or "manual"
//! force_limit_n = 1000.0        # the four of a row of forces
//! initial_force_n = 100.0
//! initial_ramp_s = 1.0
//! by_hand_speed_m_per_s = 0.2   # of a row of forces by_hand_rate_n_per_s: set-points given by hand are followed, see below
//! [[drive.set-point]]           # a row of positions or of forces
//! [[drive.change]]
//! at_s = 3.0
//! parameter = "algorithm.gain_per_s"
//! value = 30.0
//! ```
//!
//! Whether the row is of positions or of forces follows from its laws and their keys (`to_m`, `to_n`); a row that says neither is
//! of positions for the drive and of forces for the load axis.
//!
//! With a largest speed (or rate) by hand, the first frame `HandSetPoint` that finds the row at rest takes over: from then on the
//! axis follows these frames while the experiment lasts, and the row no more.

use crate::set_point::{ForceProfile, Motion, reading};
use algorithms::algorithm::Quantity;
use settings::parameters::{Parameter, declare};
use settings::{Section, SettingsError};
use std::path::{Path, PathBuf};

/// `[drive]` or `[load]` of an experiment: program, set-points, and what precedes them.
#[derive(Clone, Debug)]
pub struct AxisExperiment {
    /// Program that controls the axis, unless the command line names another.
    pub program: ProgramReference,
    /// Where initial positioning goes and the row begins, m, rig coordinates; not used with a row of
    /// forces, where alone it may be `None`.
    pub start_m: Option<f64>,
    /// Steps of the preparation after initial positioning, in this order.
    pub(crate) prepare: Vec<Prepare>,
    /// Limit and initial ramp; the defaults with a row of positions.
    pub(crate) force: ForceNumbers,
    /// A hand leads the axis during the experiment, under force control with set-point zero, instead of its set-points.
    /// Not used with a row of positions.
    pub(crate) manual: bool,
    pub(crate) set_points: SetPoints,
    /// Limits of set-points given by hand; `None`: none are followed.
    pub(crate) by_hand: Option<OperatorLimits>,
    /// Parameters changed while running, in the order of their times.
    pub(crate) changes: Vec<Change>,
}

/// The key `program` of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramReference {
    /// A name without its folder and `.toml`, or a path ending in `.toml`, from the experiment's folder.
    pub written: String,
    /// Line in the experiment file, from 1.
    pub(crate) line: usize,
}

/// A step between initial positioning and the ramp to the initial force, of an axis under force control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Prepare {
    /// Relieve the linked system of stress.
    Relieve,
    /// Match the position of both axes.
    Match,
}

/// Limits of set-points given by hand, in m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OperatorLimits {
    /// Largest rate on the way to one, per s.
    pub(crate) rate_per_s: f64,
    /// Least and largest one; others are taken to these.
    pub(crate) range: [f64; 2],
}

/// Row of set-points of an axis.
#[derive(Clone, Debug)]
pub(crate) enum SetPoints {
    /// Position over time.
    Positions(Motion),
    /// Force over time and over what the axis does.
    Forces(ForceProfile),
}

impl SetPoints {
    pub(crate) fn quantity(&self) -> Quantity {
        match self {
            Self::Positions(_) => Quantity::Position,
            Self::Forces(_) => Quantity::Force,
        }
    }

    /// From the first set-point to the end of the row, s.
    pub(crate) fn duration_s(&self) -> f64 {
        match self {
            Self::Positions(motion) => motion.duration_s(),
            Self::Forces(profile) => profile.duration_s(),
        }
    }
}

/// A parameter of the program that changes at a time of the experiment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Change {
    /// When, s after the experiment began.
    pub(crate) at_s: f64,
    /// Which one, such as `algorithm.gain_per_s`.
    pub(crate) parameter: String,
    /// Its new value, in the parameter's unit.
    pub(crate) value: f64,
    /// Line in the experiment file, from 1.
    pub(crate) line: usize,
}

settings::parameters! {
    /// Limit and initial ramp of a row of forces.
    pub(crate) struct ForceNumbers {
        force_limit_n: declare("N", [1.0, 2000.0], 1000.0, "largest force that is asked for"),
        initial_ramp_s: declare("s", [0.01, 60.0], 1.0, "how long the initial force is ramped to"),
    }
}

static BY_HAND_SPEED: Parameter = Parameter::new(
    ("by_hand_speed_m_per_s", "m/s"),
    [0.001, 1.0],
    0.2,
    "largest speed to a position given by hand",
);
static BY_HAND_RATE: Parameter = Parameter::new(
    ("by_hand_rate_n_per_s", "N/s"),
    [1.0, 10_000.0],
    200.0,
    "largest rate to a force given by hand",
);
static AT: Parameter =
    Parameter::new(("at_s", "s"), [0.0, 86_400.0], 0.0, "when, after the experiment began");
// What the program's own table allows is checked there.
static VALUE: Parameter = Parameter::new(("value", ""), [-1e15, 1e15], 0.0, "the parameter's new value");

const PREPARE: [(&str, Prepare); 2] = [("relieve", Prepare::Relieve), ("match", Prepare::Match)];
const DURING: [(&str, bool); 2] = [("set-point", false), ("manual", true)];

impl AxisExperiment {
    /// Reads it; `usual` is what a row is of that does not say.
    pub(super) fn read(
        mut section: Section<'_>,
        usual: Quantity,
        stroke_m: f64,
    ) -> Result<Self, SettingsError> {
        let program = program(&mut section)?;
        let start = Parameter::new(("start_m", "m"), [0.0, stroke_m], 0.0, "where initial positioning goes");
        let start_m = section.number(&start)?;
        let prepare = section.choices("prepare", &PREPARE)?;
        let manual = section.choice("during", &DURING)?;
        let segments = section.sections("set-point")?;
        let quantity = reading::quantity(&segments)?.unwrap_or(usual);
        let mut force = ForceNumbers::default();
        let by_hand;
        let set_points = match quantity {
            Quantity::Position => {
                if let Some(key) = force_keys().find(|key| section.has(key)) {
                    let message = format!("{key} is for set-points of force; these are of position");
                    return Err(section.wrong_at(key, &message));
                }
                let start_m = section.needed_number(&start)?;
                let speed = section.number(&BY_HAND_SPEED)?;
                by_hand = speed.map(|rate_per_s| OperatorLimits { rate_per_s, range: [0.0, stroke_m] });
                SetPoints::Positions(reading::motion(start_m, segments, stroke_m)?)
            }
            Quantity::Force => {
                force = section.parameters()?;
                let limit_n = force.force_limit_n;
                let initial = Parameter::new(
                    ("initial_force_n", "N"),
                    [0.0, limit_n],
                    0.0,
                    "force that it begins with",
                );
                let initial_n = section.number_or_default(&initial)?;
                let rate = section.number(&BY_HAND_RATE)?;
                by_hand = rate.map(|rate_per_s| OperatorLimits { rate_per_s, range: [0.0, limit_n] });
                SetPoints::Forces(reading::forces([initial_n, limit_n], segments, stroke_m)?)
            }
        };
        if by_hand.is_some() && manual {
            let message =
                "during = \"manual\" leaves no set-points to be given by hand: leave one of both out";
            return Err(section.wrong_at("during", message));
        }
        let changes = section.sections("change")?.into_iter().map(change).collect::<Result<Vec<_>, _>>();
        let mut changes = changes?;
        changes.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        section.finish()?;
        Ok(Self { program, start_m, prepare, force, manual, set_points, by_hand, changes })
    }

    /// The force that the axis begins with, N; 0 when it is position controlled.
    pub(crate) fn initial_force_n(&self) -> f64 {
        match &self.set_points {
            SetPoints::Positions(_) => 0.0,
            SetPoints::Forces(profile) => profile.initial_force_n(),
        }
    }

    /// The program's file: `../programs/NAME.toml` from the experiment's folder, or the path from there that ends in .toml.
    pub(crate) fn program_path(&self, experiment_file: &Path) -> PathBuf {
        let (folder, written) = (experiment_file.parent().unwrap_or(Path::new("")), &self.program.written);
        if written.ends_with(".toml") {
            return folder.join(written);
        }
        folder.join("..").join("programs").join(format!("{written}.toml"))
    }
}

/// Keys that only a row of forces has.
fn force_keys() -> impl Iterator<Item = &'static str> {
    let numbers = ForceNumbers::TABLE.iter().map(|number| &*number.name);
    numbers.chain(["initial_force_n", "by_hand_rate_n_per_s"])
}

fn program(section: &mut Section<'_>) -> Result<ProgramReference, SettingsError> {
    let program = section.needed_text("program", "a name in programs, or a path ending in .toml")?;
    let is_name = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if program.text.ends_with(".toml") || (!program.text.is_empty() && program.text.chars().all(is_name)) {
        return Ok(ProgramReference { written: program.text, line: program.line });
    }
    let message = format!(
        "program = \"{}\"; allowed is a name of letters, digits, - and _, or a path ending in .toml",
        program.text
    );
    Err(section.wrong_at("program", &message))
}

fn change(mut section: Section<'_>) -> Result<Change, SettingsError> {
    let at_s = section.needed_number(&AT)?;
    let parameter = section.needed_text("parameter", "which one, such as algorithm.gain_per_s")?;
    let value = section.needed_number(&VALUE)?;
    section.finish()?;
    Ok(Change { at_s, parameter: parameter.text, value, line: parameter.line })
}
