//! What the workflow concludes, of a rig and of any plant.

use serde::{Deserialize, Serialize};

/// What the training records say of the rig file, or of a model file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No effect was found. An effect at its detection limit would be found in about half of the records or fewer, so that one
    /// just above it may be missed.
    #[default]
    NothingMissing,
    /// Only baseline parameters are off.
    ParametersOnly,
    /// Effects are missing and named.
    Named,
    /// Effects are missing, and several explain the records equally well.
    Ambiguous,
    /// A term outside the catalogue is missing.
    OutsideCatalogue,
    /// A record cannot be used.
    BadData,
}

impl Verdict {
    /// Its spelling in reports, which is that of serde.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Verdict::NothingMissing => "nothing-missing",
            Verdict::ParametersOnly => "parameters-only",
            Verdict::Named => "named",
            Verdict::Ambiguous => "ambiguous",
            Verdict::OutsideCatalogue => "outside-catalogue",
            Verdict::BadData => "bad-data",
        }
    }
}
