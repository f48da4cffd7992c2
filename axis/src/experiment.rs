//! An experiment file: what both axes shall do, in which order, with which programs, and what is recorded.
//!
//! ```toml
//! title = "load-step"
//! about = "Positioning under a load step: Fig. 9 of the paper"
//! number = 9                       # 1 to 255: its name on the bus
//!
//! [run]                            # both axes; the values here are the defaults
//! repetitions = 1
//! settling_s = 0.5
//! settling_timeout_s = 10.0
//! start = "by-itself"              # or "on-start"
//! after_emergency_stop = "end"     # or "restart", "on-start"
//!
//! [drive]                          # see the module axis, and for the laws the module set_point::law
//! program = "position-p"
//! start_m = 0.1
//! [[drive.set-point]]
//! law = "bestehorn"
//! to_m = 0.4
//! duration_s = 3.0
//!
//! [load]                           # absent: its valve is held shut
//! program = "force-p"
//! initial_force_n = 100.0
//! [[load.set-point]]
//! law = "step"
//! to_n = 300.0
//! duration_s = 3.0
//!
//! [recording]
//! every_cycles = 1
//! ```
//!
//! `[rig]` is read and checked by `plant/src/scene/file.rs`, `[passed]` by `figures/src/thresholds.rs`; here they pass through.

mod axis;

pub use axis::{AxisExperiment, ProgramReference};
pub(crate) use axis::{OperatorLimits, Prepare, SetPoints};

use crate::chains::AfterStop;
use crate::chains::main::Start;
use settings::parameters::{Parameter, declare};
use settings::{Section, SettingsError, Source};
use std::path::Path;

/// An experiment file, read and checked.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Name for people, in reports.
    pub title: String,
    /// A sentence about it; may be empty.
    pub about: String,
    /// Its name on the bus, 1 to 255.
    pub number: u8,
    /// `[run]`, for both axes.
    pub run: RunSection,
    /// Experiment of the drive; `None`: its valve is held shut.
    pub drive: Option<AxisExperiment>,
    /// Experiment of the load axis; `None`: its valve is held shut.
    pub load: Option<AxisExperiment>,
    /// Cycles between two rows of an axis's file.
    pub(crate) record_every_cycles: u32,
    /// `[rig]`, unchecked: emulator and rehearsal read it, the controllers do not.
    pub rig: toml::Table,
    /// `[passed]`, unchecked: bounds on figures of the run, each under the name of its figure.
    pub passed: toml::Table,
}

/// Repetitions, settling, start and restart of an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSection {
    /// Repetitions, and times of settling, s.
    pub(crate) numbers: RunNumbers,
    /// Start condition once both axes have settled.
    pub(crate) start: Start,
    /// What follows once the rig has recovered; the command line may override it.
    pub(crate) after_emergency_stop: AfterStop,
}

settings::parameters! {
    /// Repetitions and settling of an experiment.
    pub(crate) struct RunNumbers {
        repetitions: declare("times", [1.0, 1e6], 1.0,
            "how often it is driven through, each time from initial positioning on").whole(),
        settling_s: declare("s", [0.0, 60.0], 0.5, "how long an axis stands still before and after"),
        settling_timeout_s: declare("s", [0.1, 3600.0], 10.0,
            "how long a state of the main chain may take beyond its own length before it is given up"),
    }
}

static NUMBER: Parameter = Parameter::new(("number", ""), [1.0, 255.0], 1.0, "name on the bus");
static EVERY: Parameter =
    Parameter::new(("every_cycles", "cycles"), [1.0, 1000.0], 1.0, "cycles between two rows");

impl Experiment {
    /// The experiment in `text`, for a stroke of `stroke_m`. `file` is for messages, and tables are read beside it.
    ///
    /// # Errors
    /// [`SettingsError`] for TOML that does not parse, unknown or missing keys, values out of range, and bad tables.
    pub fn from_toml(text: &str, file: &Path, stroke_m: f64) -> Result<Self, SettingsError> {
        let source = Source::parse(text, file)?;
        let mut root = source.root();
        let title = root.needed_text("title", "what the experiment is called")?.text;
        let about = root.text("about")?.map_or_else(String::new, |about| about.text);
        // Within 1 to 255 by its range.
        let number = root.whole_or_default(&NUMBER)? as u8;
        let run = RunSection::read(root.section_or_empty("run")?)?;
        let mut axis = |key, usual| {
            let section = root.section(key)?;
            section.map(|section| AxisExperiment::read(section, usual, stroke_m)).transpose()
        };
        let drive = axis("drive", algorithms::algorithm::Quantity::Position)?;
        let load = axis("load", algorithms::algorithm::Quantity::Force)?;
        let mut recording = root.section_or_empty("recording")?;
        let record_every_cycles = recording.whole_or_default(&EVERY)?;
        recording.finish()?;
        let [rig, passed] = [root.opaque("rig")?, root.opaque("passed")?];
        root.finish()?;
        if drive.is_none() && load.is_none() {
            return Err(root.wrong("[drive] or [load] is needed: nothing moves without"));
        }
        Ok(Self { title, about, number, run, drive, load, record_every_cycles, rig, passed })
    }

    /// How long one repetition takes, s: the longer of both axes.
    pub fn duration_s(&self) -> f64 {
        let axes = [&self.drive, &self.load].into_iter().flatten();
        axes.map(|axis| axis.set_points.duration_s()).fold(0.0, f64::max)
    }
}

impl RunSection {
    /// How often the experiment is driven through.
    pub fn repetitions(&self) -> u32 {
        self.numbers.repetitions as u32 // a whole number in its range
    }

    fn read(mut section: Section<'_>) -> Result<Self, SettingsError> {
        let run = Self {
            numbers: section.parameters()?,
            start: section
                .choice("start", &[("by-itself", Start::ByItself), ("on-start", Start::OnStart)])?,
            after_emergency_stop: section.choice(
                "after_emergency_stop",
                &[("end", AfterStop::End), ("restart", AfterStop::Restart), ("on-start", AfterStop::OnStart)],
            )?,
        };
        let RunNumbers { settling_s, settling_timeout_s, .. } = run.numbers;
        if settling_timeout_s <= settling_s {
            let message = format!(
                "settling_timeout_s = {settling_timeout_s} s; allowed is above settling_s, which is {settling_s} s"
            );
            return Err(section.wrong_at("settling_timeout_s", &message));
        }
        section.finish()?;
        Ok(run)
    }
}

#[cfg(test)]
mod tests;
