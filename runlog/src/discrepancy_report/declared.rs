//! Suspects of a file beside the rig file, as a report holds them: with all that an extended rig file needs.

use super::{NamedEffect, RigPlace};
use serde::{Deserialize, Serialize};

/// A term that a file of suspects declares beside the catalogue.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeclaredSuspect {
    /// Its name; named effects and candidates have it as their effect.
    pub effect: String,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: RigPlace,
    /// What it adds to, as `drive.force`.
    pub adds_to: String,
    /// Expression of the term that is added.
    pub add: String,
    /// Effects or suspects that are known to do the same.
    pub twins: Vec<String>,
    /// Its lines of a file of suspects.
    pub declaration: String,
}

impl DeclaredSuspect {
    /// Whether an effect of the report is this suspect.
    #[must_use]
    pub fn is(&self, effect: &NamedEffect) -> bool {
        self.effect == effect.effect && self.place == effect.place
    }
}
