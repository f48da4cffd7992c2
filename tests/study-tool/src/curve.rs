//! Rates over the noise of the sensors, and over the amplitude from below the limit to far above it.
//!
//! ```text
//! one score for each noise factor ──► over noise:      class named, right alone, false alarms, all of the same draws
//!                                 └─► over amplitude:  class named, amplitude / (committed limit x noise factor)
//! ```
//!
//! The committed limits are those at the specified noise. A limit grows in proportion to the noise, but for the rounding of the
//! sensors: over the limit of each study the curves of all noise factors should coincide. "3 x limit and more" refers to the
//! committed limits in each study: the same draws at each noise.
//!
//! Most drawn amplitudes lie far above the limits. A study of the same noise whose amplitudes are divided by a factor (`draws
//! --weaker`) adds its draws to the curve over amplitude only.

use crate::compare::{grid, line_cell, reported};
use crate::draws::Kind;
use crate::interval::Rate;
use crate::score::tables::{Line, hidden, over_limit};
use crate::score::{Case, Score};

mod picture;

/// Edges of the bins of amplitude, in limits; there is one more bin below the first and above the last.
const ENDS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CurveError {
    #[error("nothing to draw: give LABEL@FOLDER, once for each noise factor")]
    Empty,
    #[error("'{0}' is of a run without the hidden effects: there are no names to draw")]
    LeftOut(String),
    #[error("two studies have noise times {0} and amplitudes over {1}: give one of each")]
    Duplicate(f64, f64),
    #[error("the picture cannot be drawn: {0}")]
    Picture(String),
}

pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, Rate)>,
}

/// Curves of several scores: rates over noise and over amplitude.
pub struct Curves<'a> {
    /// Scores of undivided amplitudes, by their noise.
    scores: Vec<&'a Score>,
    /// All scores, those of divided amplitudes included.
    all: Vec<&'a Score>,
}

impl<'a> Curves<'a> {
    /// The curves of scores that differ in noise or in the divisor of the amplitudes.
    ///
    /// # Errors
    /// [`CurveError`] when there is no score, one without names, or two of the same noise and divisor.
    pub fn new(scores: &'a [Score]) -> Result<Self, CurveError> {
        if let Some(left) = scores.iter().find(|score| score.leave_out.is_some()) {
            return Err(CurveError::LeftOut(left.label.clone()));
        }
        let mut all: Vec<&Score> = scores.iter().collect();
        let key = |score: &Score| (noise(score), score.shape.weaker_factor);
        all.sort_by(|left, right| {
            let (left, right) = (key(left), key(right));
            left.0.total_cmp(&right.0).then(left.1.total_cmp(&right.1))
        });
        if let Some(pair) = all.windows(2).find(|pair| key(pair[0]) == key(pair[1])) {
            let (noise, weaker) = key(pair[0]);
            return Err(CurveError::Duplicate(noise, weaker));
        }
        let scores: Vec<&Score> =
            all.iter().copied().filter(|score| score.shape.weaker_factor == 1.0).collect();
        if scores.is_empty() { Err(CurveError::Empty) } else { Ok(Curves { scores, all }) }
    }

    /// Class among the names over amplitude, for each noise factor.
    fn over_amplitude(&self) -> Vec<Curve> {
        let mut factors: Vec<f64> = self.all.iter().map(|score| noise(score)).collect();
        factors.dedup();
        let of_factor = |factor: f64| {
            let scores = self.all.iter().filter(|score| noise(score) == factor);
            let cases: Vec<&Case> = scores.flat_map(|score| &score.cases).collect();
            over_amplitude(factor, &cases)
        };
        factors.into_iter().map(of_factor).collect()
    }

    /// Both curves as tables in Markdown.
    pub fn markdown(&self) -> String {
        let row = |name: &str, cell: &dyn Fn(&Score) -> String| {
            std::iter::once(name.to_owned())
                .chain(self.scores.iter().map(|score| cell(score)))
                .collect::<Vec<_>>()
        };
        let heads = row("noise", &|score| format!("times {}", noise(score)));
        let programs = row("program, CRC-32", &|score| score.program.reported());
        let draws = row("draws, seed", &|score| format!("{}, {}", score.cases.len(), score.seed));
        let lines = self.scores[0].tables.headline.iter().map(|line| {
            row(&line.name, &|score| rate_of(score, &line.name).as_ref().map_or(String::new(), line_cell))
        });
        let over_noise = grid(&heads, [programs, draws].into_iter().chain(lines));
        let mut heads = vec!["amplitude over its limit at this noise".to_owned()];
        let curves = self.over_amplitude();
        heads.extend(curves.iter().map(|curve| curve.name.clone()));
        let rows = (0..=ENDS.len()).map(|bin| {
            let rates = curves.iter().map(|curve| reported(&curve.points[bin].1));
            std::iter::once(bin_name(bin)).chain(rates).collect()
        });
        format!("{over_noise}\nClass among the names, draws of one effect:\n\n{}", grid(&heads, rows))
    }

    /// Both curves as a picture: the text of an SVG file.
    ///
    /// # Errors
    /// [`CurveError::Picture`] with the message of the drawing library.
    pub fn svg(&self) -> Result<String, CurveError> {
        let names = [
            ("class among the names, 3 x limit and more", "one effect, 3 x limit and more: its class"),
            ("right alone, where alone in its class", "the same, alone in its class"),
            ("nothing hidden: called missing", "nothing hidden: called missing"),
        ];
        let over_noise: Vec<Curve> = names
            .into_iter()
            .map(|(name, line)| Curve {
                name: name.to_owned(),
                points: self
                    .scores
                    .iter()
                    .filter_map(|score| Some((noise(score), rate_of(score, line)?.rate)))
                    .collect(),
            })
            .collect();
        let over_amplitude = self.over_amplitude();
        let noises = self.scores.iter().map(|score| (noise(score), format!("{}", noise(score)))).collect();
        let bins = (0..=ENDS.len()).map(|bin| (place(bin), bin_name(bin))).collect();
        picture::svg([
            picture::Panel {
                title: "over the noise, times the specified",
                ticks: noises,
                curves: &over_noise,
            },
            picture::Panel {
                title: "class among the names over amplitude / limit",
                ticks: bins,
                curves: &over_amplitude,
            },
        ])
        .map_err(CurveError::Picture)
    }
}

fn noise(score: &Score) -> f64 {
    score.shape.noise_factor
}

/// The line of a score whose name begins so.
fn rate_of(score: &Score, name: &str) -> Option<Line> {
    score.tables.headline.iter().find(|line| line.name.starts_with(name)).cloned()
}

/// Class among the names, bin by bin of the amplitude over the limit at this noise.
fn over_amplitude(factor: f64, cases: &[&Case]) -> Curve {
    let singles = || cases.iter().copied().filter(|case| case.kind == Kind::Single);
    let is_of = |case: &Case, bin| over_limit(case).is_some_and(|ratio| bin_of(ratio / factor) == bin);
    let of_bin = |bin| Rate::of(singles().filter(|case| is_of(case, bin)), |case| hidden(case).right);
    let points = (0..=ENDS.len()).map(|bin| (place(bin), of_bin(bin))).collect();
    Curve { name: format!("noise times {factor}"), points }
}

fn bin_of(ratio: f64) -> usize {
    ENDS.iter().filter(|end| ratio >= **end).count()
}

fn bin_name(bin: usize) -> String {
    let end = |at: usize| ENDS[at];
    match bin {
        0 => format!("below {}", end(0)),
        bin if bin == ENDS.len() => format!("{} and more", end(bin - 1)),
        bin => format!("{} to {}", end(bin - 1), end(bin)),
    }
}

/// Position of a bin on the axis: the geometric middle; the outermost bins are as wide as their neighbours.
fn place(bin: usize) -> f64 {
    let step = 10_f64.sqrt();
    let low = if bin == 0 { ENDS[0] / step } else { ENDS[bin - 1] };
    let high = ENDS.get(bin).copied().unwrap_or(low * step);
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::{scored, scored_without};
    use plant::effects::SHEETS;

    fn at_noise(noise_factor: f64, over: f64) -> Score {
        let mut score = scored("ours");
        score.shape.noise_factor = noise_factor;
        for case in score.cases.iter_mut().filter(|case| case.kind == Kind::Single) {
            case.over_limit = vec![Some(over)];
        }
        score
    }

    #[test]
    fn a_draw_stands_in_the_bin_of_its_own_limit() {
        assert_eq!([0.0, 0.99, 1.0, 29.0, 300.0].map(bin_of), [0, 0, 1, 3, 6]);
        assert_eq!([0, 1, 6].map(bin_name), ["below 1", "1 to 3", "300 and more"]);
        let mut scores = [at_noise(4.0, 8.0), at_noise(0.5, 8.0)];
        scores[0].program.crc32 ^= 1;
        let curves = Curves::new(&scores).unwrap();
        let text = curves.markdown();
        let row = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
        // What is weaker adds to the curve over amplitude alone.
        let mut weak = at_noise(4.0, 0.4);
        weak.shape.weaker_factor = 20.0;
        let with_weak = [weak, at_noise(4.0, 8.0), at_noise(0.5, 8.0)];
        let with_weak = Curves::new(&with_weak).unwrap().markdown();
        let all = format!("{0}/{0}", SHEETS.len());
        assert!(with_weak.contains(&format!("| below 1 | none | {all}")), "{with_weak}");
        assert_eq!(with_weak.lines().next(), text.lines().next());
        // In the order of the noise, however they were given.
        assert_eq!(text.lines().next().unwrap(), "| noise | times 0.5 | times 4 |");
        // Two programs on one curve are seen.
        let [noisy, quiet] = scores.each_ref().map(|score| score.program.reported());
        assert_eq!(row("| program"), format!("| program, CRC-32 | {quiet} | {noisy} |"));
        assert_eq!(row("| 1 to 3"), format!("| 1 to 3 | none | {all} (91 to 100 %) |"));
        assert_eq!(row("| 10 to 30"), format!("| 10 to 30 | {all} (91 to 100 %) | none |"));
        assert!(row("| nothing hidden: called").ends_with("| 0/2 (at most 77.6 %) | 0/2 (at most 77.6 %) |"));
    }

    #[test]
    fn the_picture_has_both_curves_and_is_the_same_each_time() {
        let scores = [at_noise(0.5, 8.0), at_noise(1.0, 8.0), at_noise(2.0, 8.0)];
        let svg = || Curves::new(&scores).unwrap().svg().unwrap();
        let text = svg();
        for part in ["<svg", "called missing", "noise times 2", "300 and more", "over the noise"] {
            assert!(text.contains(part), "{part}");
        }
        assert_eq!(text, svg());
    }

    #[test]
    fn scores_that_cannot_stand_on_one_curve_are_refused() {
        let refused = |scores: &[Score]| Curves::new(scores).err();
        assert_eq!(refused(&[]), Some(CurveError::Empty));
        assert_eq!(refused(&[scored("a"), scored("b")]), Some(CurveError::Duplicate(1.0, 1.0)));
        assert_eq!(refused(&[scored_without("w")]), Some(CurveError::LeftOut("w".to_owned())));
    }
}
