//! Twins: two effects that a record does not distinguish, and an experiment of the menu does.
//!
//! ```text
//!   effect A, weakened ──► train record ──► nearest law of each other effect B, parameters of the baseline fitted too
//!        A, B hardly distinct in the record: Phi(d/2) at most 0.7      d = |M (y_A - y_B)|, windows of 100 ms, over the noise
//!        A, B distinct in an experiment:     Phi(d/2) at least 0.9     closed loop, simulated with either as the truth
//! ```
//!
//! Phi(d/2) is the share of right decisions of the likelihood ratio if both models are known exactly: no program can do better
//! with these readings and free initial states of the windows. The noise of the recipe is chosen so that the two models have
//! the drawn distance in the train record; which of the two is hidden is drawn. No report of a program enters.
//!
//! | file | holds |
//! |---|---|
//! | `certificate` | share of records for which an oracle distinguishes two rigs |
//! | `rival` | the law of another effect nearest to a rig |
//! | [`search`] | tries starts in turn until there are enough twins |
//! | [`tables`] | the results of a program |
//!
//! Source: Neyman, Pearson 1933, Phil. Trans. R. Soc. A 231: the likelihood ratio; Green, Swets 1966, Signal Detection Theory and
//! Psychophysics: d' and the share of right decisions between two.

mod certificate;
mod rival;
pub mod search;
pub mod tables;

use crate::compute::trajectory;
use crate::draws::{Draw, Kind, Shape, twins};
use crate::folder::{FolderError, Plan, Study, read_versioned, write_whole};
use crate::trajectory::{TrueTrajectory, WINDOW};
use plant::effects::sheet;
use plant::{Axis, RigParameters};
use record_maker::{Experiment, Hidden, Recipe, Record, simulate, write};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

/// Windows before a part of a record in which memories build up.
const SETTLING: usize = 10;

/// Rows of a train record that a program gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Part {
    /// The first row: a multiple of a window.
    pub(crate) from: usize,
    pub(crate) rows: usize,
}

impl Part {
    /// The true trajectory of the part, and of up to a second before it, which is excluded.
    pub(crate) fn of(self, record: &Record, rig: &RigParameters) -> TrueTrajectory {
        let before = (self.from / WINDOW).min(SETTLING);
        let rows = record.rows[self.from - before * WINDOW..self.from + self.rows].to_vec();
        TrueTrajectory { settling: before.max(1), ..trajectory(&Record { rows, ..record.clone() }, rig) }
    }
}

/// One of the two models of a twin: the baseline with an effect, and with wrong parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Model {
    pub(crate) effect: String,
    #[serde(rename = "where")]
    pub(crate) place: String,
    /// One for each key of its sheet, in the units of the rig file.
    pub(crate) numbers: Vec<f64>,
    /// Factors on parameters of the baseline.
    pub(crate) wrong_parameters: Vec<(String, f64)>,
}

/// Two models that a part of a record does not distinguish.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Twin {
    pub(crate) number: usize,
    pub(crate) start: usize,
    pub(crate) recipe_seed: u64,
    pub(crate) axis: String,
    /// Of the train record.
    pub(crate) part: Part,
    /// Noise of all records over the specified noise.
    pub(crate) noise: f64,
    pub(crate) hidden: Model,
    pub(crate) rival: Model,
    /// Distance of the start's effect from the baseline in the train record, standard deviations, parameters fitted.
    pub(crate) seen_distance: f64,
    /// Distance of the two models in the train record, standard deviations.
    pub(crate) train_distance: f64,
    /// The same in the experiments of the menu that both rigs can run: the smaller one of both truths.
    pub(crate) menu_distances: BTreeMap<String, f64>,
}

/// The twins of a seed, as `twins.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Twins {
    pub(crate) schema_version: u32,
    pub seed: u64,
    /// Number of starts that were tried.
    pub(crate) starts: usize,
    /// Reasons why other starts gave no twins, and how many.
    pub refused: BTreeMap<String, usize>,
    /// The twins, in the order of their numbers.
    pub twins: Vec<Twin>,
}

impl Model {
    /// As the hidden effect of a recipe; `None` for an effect that the catalogue lacks.
    pub(crate) fn hidden(&self) -> Option<Hidden> {
        let sheet = sheet(&self.effect)?;
        Some(Hidden {
            name: sheet.name,
            place: sheet.place_named(&self.place)?,
            numbers: self.numbers.clone(),
        })
    }

    pub(crate) fn title(&self) -> String {
        format!("{} {}", self.effect, self.place)
    }
}

impl Twin {
    /// The experiment with the largest distance of the two models, and that distance.
    pub(crate) fn best(&self) -> Option<(&str, f64)> {
        let best = self.menu_distances.iter().max_by(|one, other| one.1.total_cmp(other.1));
        best.map(|(name, distance)| (name.as_str(), *distance))
    }

    fn recipe(&self) -> Option<Recipe> {
        Some(Recipe {
            seed: self.recipe_seed,
            axis: Axis::ALL.into_iter().find(|axis| axis.name() == self.axis)?,
            hidden: vec![self.hidden.hidden()?],
            wrong_parameters: self.hidden.wrong_parameters.clone(),
            noise: self.noise,
            ..Recipe::default()
        })
    }
}

impl Twins {
    /// Reads the twins of a folder.
    ///
    /// # Errors
    /// [`FolderError`] when there are none, or they are of another version or catalogue.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let path = root.join("twins.json");
        let twins = read_versioned(&path, "list of twins", |twins: &Twins| twins.schema_version)?;
        if twins.twins.iter().any(|twin| twin.recipe().is_none()) {
            return Err(FolderError::content(&path, "has an effect that the catalogue does not have"));
        }
        Ok(twins)
    }

    /// Writes `twins.json` into a folder.
    pub fn save(&self, root: &Path) -> Result<(), FolderError> {
        write_whole(&root.join("twins.json"), format!("{:#}\n", json!(self)).as_bytes())
    }

    /// The twins as draws of a study in a folder: first all in the exact world, then the same with a background.
    ///
    /// # Panics
    /// When a twin has an effect that the catalogue lacks, which [`Twins::open`] refuses.
    pub fn study(&self, root: &Path) -> Study {
        let exact = self.twins.iter().map(|twin| twin.recipe().expect("those that were read have effects"));
        let exact: Vec<Recipe> = exact.collect();
        let beside = exact.iter().enumerate().map(|(number, recipe)| Recipe {
            background: Some(twins::background(self.seed, number, recipe)),
            ..recipe.clone()
        });
        let recipes: Vec<Recipe> = exact.iter().cloned().chain(beside).collect();
        let draw = |(number, recipe)| Draw { number, kind: Kind::Single, recipe };
        let draws = recipes.into_iter().enumerate().map(draw).collect();
        Study { root: root.to_owned(), plan: Plan::new(self.seed, Shape::NO_DRAW), draws }
    }

    /// The twin of a draw of [`Twins::study`].
    pub(crate) fn of_draw(&self, number: usize) -> Option<&Twin> {
        self.twins.get(number % self.twins.len().max(1)).filter(|_| number < 2 * self.twins.len())
    }

    /// Makes a record of draw `number` of [`Twins::study`]; a train record is cut to the part of the twin.
    ///
    /// # Errors
    /// Why it cannot be made.
    pub fn make(
        &self,
        number: usize,
        recipe: &Recipe,
        rig: &RigParameters,
        [measurement, truth]: [&Path; 2],
    ) -> Result<(), String> {
        let mut record = simulate(recipe, rig).map_err(|error| error.to_string())?;
        if let (Experiment::Train, Some(Twin { part, .. })) = (recipe.experiment, self.of_draw(number)) {
            record.rows.truncate(part.from + part.rows);
            record.rows.drain(..part.from);
        }
        write(&record, measurement, truth).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests;
