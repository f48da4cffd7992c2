//! Whether the gain of a named set of effects could be chance, or that of a few windows.

use super::EffectPlace;
use serde::Serialize;

/// The tests that a set of effects has to pass for a name. Gains are falls of the loss over the windows of the searched part.
#[derive(Clone, Debug, Serialize)]
pub struct Significance {
    /// The set that was tested, named where it passed; effects too small to be named are among them.
    pub effects: Vec<EffectPlace>,
    /// Its gain over parameters alone, less what the screening charges for each number.
    pub gain: f64,
    /// Number of windows that are left out of `gain_without_best`; 0 of a record with fewer than five.
    pub best_windows: usize,
    /// The gain without the windows that contribute most.
    pub gain_without_best: f64,
    /// What `gain_without_best` has to exceed.
    pub least_gain: f64,
    /// Records drawn with parameters alone; null where the rods are linked.
    pub chance: Option<DrawnRecords>,
    /// Records drawn with the other one of the two most probable explanations, where it has effects: how often the tested set
    /// leads it by as much as in the records. Not a condition for naming.
    pub other: Option<DrawnRecords>,
}

/// A sequential test on records that were drawn with an explanation.
#[derive(Clone, Debug, Serialize)]
pub struct DrawnRecords {
    /// Effects with which they were drawn; empty for parameters alone.
    pub effects: Vec<EffectPlace>,
    /// What the tested set gains on the records, over the explanation.
    pub observed: f64,
    /// Number of records.
    pub draws: usize,
    /// Draws that reach `observed`.
    pub reached: usize,
    /// The largest gain of a draw: over parameters alone that of at most as many effects, by forward selection.
    pub largest: f64,
    /// Bound of the p-value; far above the draws an extrapolation by an exponential tail.
    pub p_value: f64,
    /// Why no more were drawn.
    pub ended: StoppingReason,
    /// Whether `observed` is larger than chance gives, at the level of a twentieth.
    pub significant: bool,
}

/// Why a sequential test stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StoppingReason {
    /// Two draws reached what was observed.
    Reached,
    /// What was observed lies far above all draws.
    FarAbove,
    /// All draws were spent.
    AllDrawn,
}

impl Significance {
    /// Why the set has no name, in words after its effects; `None` where it passes.
    #[must_use]
    pub fn rejection_reason(&self) -> Option<&'static str> {
        if self.gain_without_best <= self.least_gain {
            Some("gains too little outside its best windows")
        } else if self.chance.as_ref().is_some_and(|chance| !chance.significant) {
            Some("gains no more than chance may")
        } else {
            None
        }
    }

    /// The effects that were tested, in words.
    #[must_use]
    pub fn tested(&self) -> String {
        names(&self.effects)
    }

    /// What the tests show, in a sentence or two.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Significance { gain, gain_without_best, best_windows, least_gain, .. } = self;
        let without_best = match best_windows {
            0 => ", in too few windows to leave the best ones out".to_owned(),
            1 => format!(", and {gain_without_best:.0} without its best window"),
            more => format!(", and {gain_without_best:.0} without its {more} best windows"),
        };
        let mut text = format!(
            "{} gains {gain:.0}{without_best}, where a name needs more than {least_gain:.0}.",
            self.tested()
        );
        if let Some(DrawnRecords { draws, reached, largest, p_value, .. }) = &self.chance {
            text += &format!(
                " Of {draws} simulated records with parameters alone {reached} reach {gain_without_best:.0}, and the best gains \
                 {largest:.0} (p {}).",
                p_words(*p_value)
            );
        }
        if let Some(DrawnRecords { effects, draws, reached, p_value, .. }) = &self.other {
            text += &format!(
                " Of {draws} simulated records with {} instead {reached} put it as far ahead (p {}).",
                names(effects),
                p_words(*p_value)
            );
        }
        text
    }
}

fn names(effects: &[EffectPlace]) -> String {
    let names: Vec<String> = effects.iter().map(|one| format!("{} ({})", one.effect, one.place)).collect();
    names.join(" and ")
}

/// A p-value to a thousandth.
fn p_words(p_value: f64) -> String {
    if p_value < 1e-3 { "below 0.001".to_owned() } else { format!("{p_value:.3}") }
}
