//! People at the rig: how it is set up, whose hands push, and who presses which button when.
//!
//! `[rig]` of an experiment file is a [`Scene`]; [`People`] plays it on a [`Plant`], cycle by cycle, the same to the bit
//! wherever the plant runs. All times are the rig's own: cycle over 1000.
//!
//! ```toml
//! [rig]
//! carriage_position_m = 0.1      # where the carriage stands at the start
//! linked = false                 # whether the load's eye sits in it
//! added_mass_kg = 0.0            # weights on it
//! sealed = "my.sealed.toml"      # effects that nobody but the rig knows; beside this file, or an absolute path
//!
//! [[rig.hand]]                   # a push: constant in +x, with ramps at both ends
//! on = "carriage"                # or "load-eye"
//! from_s = 0.5
//! to_s = 2.0
//! force_n = 60.0
//! ramp_s = 0.05
//!
//! [[rig.hand]]                   # a guiding hand: an arm that pulls towards a travelling target
//! on = "load-eye"
//! from_s = 0.5
//! to_s = 4.0
//! guide_to_m = 0.3
//! travel_s = 1.0
//! stiffness_n_per_m = 2000.0
//! damping_n_s_per_m = 60.0
//! most_n = 150.0
//!
//! [[rig.event]]
//! at_s = 3.0
//! do = "link"                    # or "unlink", "emergency-stop", "release", "weights" (with added_mass_kg)
//! until_s = 5.0                  # tried in each cycle until then: the pin is wiggled in
//!
//! [[rig.event]]
//! at_s = 1.0
//! at_position_m = 0.25           # not at that time, but as soon as the carriage passes this place from then on
//! do = "emergency-stop"
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `file.rs` | the text, checked, with messages that name file, line, key, value and range |
//! | `hand.rs` | force of a push and of a guiding hand |
//! | `stop.rs` | holders of the emergency stop, and the rig's announcements of it |
//! | `people.rs` | what is due in a cycle, done to a plant |

mod file;
mod hand;
mod people;
mod stop;

use serde::Serialize;

use crate::parameters::RigParameters;
use crate::plant::Plant;
use crate::setup::Setup;

pub use hand::{Guidance, Hand, HandAction, HandForces, Part};
pub use people::{Outcome, People, Script};
/// Why the `[rig]` of an experiment is refused: file, line, key, value and what is allowed.
pub use settings::SettingsError as SceneError;
pub use stop::{REPEAT_CYCLES, RigCall, StopHolder, StopHolders};

/// `[rig]` of an experiment: the rig's setup, and what people do to it while it runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// Carriage position at the start, m, 0 to the stroke.
    pub carriage_position_m: f64,
    /// Whether the load's eye sits in the carriage at the start.
    pub linked: bool,
    /// Weights on the carriage at the start, kg, 0 to the rig's limit.
    pub added_mass_kg: f64,
    /// File with sealed effects, as the experiment names it; not read here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sealed: Option<String>,
    /// Hands; those that act at a time add up.
    pub hand: Vec<Hand>,
    /// What is done when, in the order of the file.
    pub event: Vec<Event>,
}

/// Something that a person does at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Event {
    /// When, s of the rig's time.
    pub at_s: f64,
    /// From then on, as soon as the carriage passes this place, m; `None`: at that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_position_m: Option<f64>,
    /// What.
    #[serde(flatten)]
    pub action: Action,
}

/// What a person can do at the rig besides pushing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Action {
    /// Presses the rig's own emergency stop.
    EmergencyStop,
    /// Releases it; what others hold stays.
    Release,
    /// Puts the load's eye into the carriage.
    Link {
        /// Tried in each cycle until this time, s; `None`: tried once.
        until_s: Option<f64>,
    },
    /// Takes it out.
    Unlink,
    /// Puts weights on the carriage or takes them off.
    Weights {
        /// Weights in all, kg.
        added_mass_kg: f64,
    },
}

impl Default for Scene {
    fn default() -> Self {
        let Setup { carriage_position_m, linked, added_mass_kg } = Setup::default();
        let (hand, event) = (Vec::new(), Vec::new());
        Scene { carriage_position_m, linked, added_mass_kg, sealed: None, hand, event }
    }
}

impl Scene {
    /// The `[rig]` of the experiment in `text`, checked for this rig; all defaults when it has none. `file` is for messages,
    /// other tables are not looked at.
    ///
    /// # Errors
    /// [`SceneError`] with file, line, key, value and what is allowed.
    pub fn from_toml(text: &str, file: &str, rig: &RigParameters) -> Result<Self, SceneError> {
        file::read(text, file, rig)
    }

    /// How the rig is set up before the run.
    #[must_use]
    pub fn setup(&self) -> Setup {
        let Scene { carriage_position_m, linked, added_mass_kg, .. } = *self;
        Setup { carriage_position_m, linked, added_mass_kg }
    }
}

impl Part {
    /// Position in +x, m, and its rate, m/s.
    fn motion(self, plant: &Plant) -> (f64, f64) {
        let [drive, load] = &plant.state().axes;
        match self {
            Part::Carriage => (drive.extension_m, drive.rod_velocity_m_per_s),
            Part::LoadEye => (plant.rig().cylinder().stroke_m - load.extension_m, -load.rod_velocity_m_per_s),
        }
    }
}

/// The cycle that begins nearest to a time of the rig.
fn cycle_of(time_s: f64) -> u64 {
    (time_s * 1000.0).round() as u64
}
