//! The part of an experiment file that concerns the rig: its initial state, linkage and weights.
//!
//! The controllers read the rest; the emulator does not look at it, so that it cannot know what is asked of it.

use plant::Setup;
use serde::{Deserialize, Serialize};

/// `[rig]` of an experiment file.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RigSection {
    /// Where the carriage stands at the start, in m.
    pub carriage_position_m: f64,
    /// Whether the rods are linked at the start.
    pub linked: bool,
    /// Weights on the carriage, in kg.
    pub added_mass_kg: f64,
}

impl Default for RigSection {
    fn default() -> Self {
        let Setup { carriage_position_m, linked, added_mass_kg } = Setup::default();
        Self { carriage_position_m, linked, added_mass_kg }
    }
}

impl RigSection {
    /// The `[rig]` of the experiment file in `text`; all defaults when it has none.
    ///
    /// # Errors
    /// What is wrong, with line, column and caret, after the name of the `file`.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct RigPart {
            #[serde(default)]
            rig: RigSection,
        }
        toml::from_str::<RigPart>(text).map(|part| part.rig).map_err(|error| format!("{file}: {error}"))
    }

    /// The plant's initial state.
    #[must_use]
    pub fn setup(&self) -> Setup {
        Setup {
            carriage_position_m: self.carriage_position_m,
            linked: self.linked,
            added_mass_kg: self.added_mass_kg,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_rigs_part_is_read() {
        let text = "[drive]\nanything = 1\n[rig]\ncarriage_position_m = 0.25\nlinked = true\n";
        let section = RigSection::from_toml(text, "e.toml").unwrap();
        assert_eq!((section.carriage_position_m, section.linked, section.added_mass_kg), (0.25, true, 0.0));
    }

    #[test]
    fn an_unknown_key_is_named_with_its_place() {
        let message = RigSection::from_toml("[rig]\nlinkd = true\n", "e.toml").unwrap_err();
        assert!(
            message.contains("e.toml") && message.contains("line 2") && message.contains("linkd"),
            "{message}"
        );
    }
}
