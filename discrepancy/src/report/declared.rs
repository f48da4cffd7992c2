//! Suspects of a file beside the rig file, as a report holds them: with all that an extended rig file needs.

use super::{NamedEffect, Where};
use crate::suspects::Suspect;
use serde::{Deserialize, Serialize};

/// A suspect of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeclaredSuspect {
    /// Its name; named effects and candidates have it as their effect.
    pub effect: String,
    #[serde(rename = "where")]
    pub place: Where,
    /// What it adds to, as `drive.force`.
    pub adds_to: String,
    /// The expression.
    pub add: String,
    /// Effects or suspects that are known to do the same.
    pub twins: Vec<String>,
    /// Its lines of a file of suspects.
    pub declaration: String,
}

impl DeclaredSuspect {
    pub(crate) fn of(suspect: &Suspect) -> Self {
        let declared = &suspect.declared;
        DeclaredSuspect {
            effect: declared.name().to_owned(),
            place: Where::from(suspect.place),
            adds_to: declared.place(),
            add: declared.expression().to_owned(),
            twins: declared.twins().to_vec(),
            declaration: declared.toml("suspects"),
        }
    }

    /// Whether an effect of the report is this suspect.
    pub(crate) fn is(&self, effect: &NamedEffect) -> bool {
        self.effect == effect.effect && self.place == effect.place
    }
}
