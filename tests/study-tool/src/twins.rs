//! Twins: two effects that a record leaves alike, and that an experiment of the menu tells apart.
//!
//! ```text
//!   effect A, weakened ──► train record ──► nearest law of each other effect B, parameters of the baseline beside it
//!        A, B hardly apart in the record:  Phi(d/2) at most 0.7       d = |M (y_A - y_B)|, windows of 100 ms, over the noise
//!        A, B apart in an experiment:      Phi(d/2) at least 0.9      closed loop, driven as if either were true
//! ```
//!
//! Phi(d/2) is how often the likelihood ratio is right if both models are known exactly: no program can do better with these
//! readings and free initial states of the windows. The noise of the recipe is chosen so that the train record leaves the
//! two as far apart as was drawn; which of the two is hidden is drawn. What a program says of a record is not asked.
//!
//! | file | holds |
//! |---|---|
//! | [`certificate`] | how often an oracle tells two rigs apart |
//! | [`rival`] | the law of another effect that is nearest to a rig |
//! | [`search`] | starts, one after the other, until there are enough twins |
//! | [`tables`] | what a program made of them |
//!
//! Source: Neyman, Pearson 1933, Phil. Trans. R. Soc. A 231: the likelihood ratio; Green, Swets 1966, Signal Detection Theory and
//! Psychophysics: d' and the share of right decisions between two.

pub mod certificate;
pub mod rival;
pub mod search;
pub mod tables;

use crate::compute::trajectory;
use crate::draws::{Draw, Kind, Shape, twins};
use crate::folder::{FolderError, Plan, Study, read_left, write_whole};
use crate::trajectory::{TrueTrajectory, WINDOW};
use plant::effects::sheet;
use plant::{Axis, RigParameters};
use record_maker::{Experiment, Hidden, Recipe, Record, simulate, write};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

/// Windows before a part of a record in which memories fill.
const SETTLING: usize = 10;

/// Rows of a train record that a program gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The first one: a multiple of a window.
    pub from: usize,
    pub rows: usize,
}

impl Part {
    /// What really happened in it, and in the second before it, which does not count.
    pub(crate) fn of(self, record: &Record, rig: &RigParameters) -> TrueTrajectory {
        let before = (self.from / WINDOW).min(SETTLING);
        let rows = record.rows[self.from - before * WINDOW..self.from + self.rows].to_vec();
        let settling = before.max(1);
        TrueTrajectory { settling, ..trajectory(&Record { rows, ..record.clone() }, rig) }
    }

    fn cut(self, record: &mut Record) {
        record.rows.truncate(self.from + self.rows);
        record.rows.drain(..self.from);
    }
}

/// One of the two models of a twin: the baseline with an effect, and with parameters that are off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: String,
    /// One for each key of its sheet, in the file's units.
    pub numbers: Vec<f64>,
    /// Factors on parameters of the baseline.
    pub wrong_parameters: Vec<(String, f64)>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Twin {
    pub number: usize,
    /// Which start it is of.
    pub start: usize,
    pub recipe_seed: u64,
    pub axis: String,
    /// Of the train record.
    pub part: Part,
    /// Noise of all records; 1 is as specified.
    pub noise: f64,
    pub hidden: Model,
    pub rival: Model,
    /// Distance of what was started with from the baseline in the train record, standard deviations, parameters fitted.
    pub seen_distance: f64,
    /// Distance of the two models in the train record.
    pub train_distance: f64,
    /// The same in the experiments of the menu that both rigs can run, the smaller of both truths.
    pub menu_distances: BTreeMap<String, f64>,
}

/// The twins of a seed, as `twins.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Twins {
    pub schema_version: u32,
    pub seed: u64,
    /// Starts that were tried.
    pub starts: usize,
    /// Why the others are no twins, and how many.
    pub refused: BTreeMap<String, usize>,
    pub twins: Vec<Twin>,
}

impl Model {
    /// As a recipe hides it; `None` for what the catalogue does not have.
    pub fn hidden(&self) -> Option<Hidden> {
        let sheet = sheet(&self.effect)?;
        Some(Hidden {
            name: sheet.name,
            place: sheet.place_named(&self.place)?,
            numbers: self.numbers.clone(),
        })
    }

    pub fn title(&self) -> String {
        format!("{} {}", self.effect, self.place)
    }
}

impl Twin {
    /// The experiment in which the two models are farthest apart.
    pub fn best(&self) -> Option<(&str, f64)> {
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
    /// Reads those of a folder.
    ///
    /// # Errors
    /// [`FolderError`] when there are none of this version.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let path = root.join("twins.json");
        let twins = read_left(&path, "list of twins", |twins: &Twins| twins.schema_version)?;
        if twins.twins.iter().any(|twin| twin.recipe().is_none()) {
            return Err(FolderError::content(&path, "has an effect that the catalogue does not have"));
        }
        Ok(twins)
    }

    /// # Errors
    /// [`FolderError`] when the file cannot be written.
    pub fn save(&self, root: &Path) -> Result<(), FolderError> {
        write_whole(&root.join("twins.json"), format!("{:#}\n", json!(self)).as_bytes())
    }

    /// The twins as draws of a study: first all in the exact world, then the same ones beside a background.
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
        let shape = Shape { each: 0, nulls: 0, parameters: 0, pairs: 0, triples: 0, ..Shape::default() };
        Study { root: root.to_owned(), plan: Plan::new(self.seed, shape), draws }
    }

    /// The twin of a draw of [`Twins::study`].
    pub fn of_draw(&self, number: usize) -> Option<&Twin> {
        self.twins.get(number % self.twins.len().max(1)).filter(|_| number < 2 * self.twins.len())
    }

    /// Makes a record of a draw; of its train record the part of the twin.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn make(
        &self,
        number: usize,
        recipe: &Recipe,
        rig: &RigParameters,
        [measurement, truth]: [&Path; 2],
    ) -> Result<(), String> {
        let mut record = simulate(recipe, rig).map_err(|error| error.to_string())?;
        if let (Experiment::Train, Some(twin)) = (recipe.experiment, self.of_draw(number)) {
            twin.part.cut(&mut record);
        }
        write(&record, measurement, truth).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests;
