//! Which suspects are taken, by forward selection on the training records alone.
//!
//! A suspect is fitted together with everything that the model leaves open, in the simulator, from several starts ([`starts`]).
//! All of these must hold:
//!
//! | gate | asks | against |
//! |---|---|---|
//! | likelihood | gain over `k ln(n) + 2 ln(suspects tried)` | chance; n is what the residual of the best fit is worth |
//! | folds in time | at least a tenth of the power that the model leaves | size |
//! | folds in time | a gain without the block that gains most, too | an event that is none of the plant's |
//! | folds in bands of `[rows.folds]` | half of that share, at 2 clustered standard errors | what does not hold elsewhere |
//!
//! A mean over its standard error asked of folds in time would ask that a term acts in every block: a tank overflows in two of
//! ten.
//! Bands are not asked of a suspect that is `local`.
//!
//! A fold is judged by the fit without it, which follows from the normal equations of the others by one linear step. The best of
//! what passes is taken; another that passes and is not better or worse beyond doubt explains the records as well.
//!
//! Sources: Chen, Chen 2008, Biometrika 95(3) (penalty: extended BIC); Kass, Raftery 1995, JASA 90(430) (weights of models).

use super::covariance;
use super::fit::{Fitting, OfRecord, Point, What};
use super::normal::{Normal, solved};
use super::record::Measured;
use super::starts;
use crate::estimator::Convergence;
use crate::stats::mean;
use model::{Failure, Model, Program};
use nalgebra::DVector;
use rayon::prelude::*;

/// Most terms that are taken.
pub(super) const MOST_TERMS: usize = 3;
/// Least share of the power left out that a term must explain on folds in time; on bands half of it.
const SHARE_FLOOR: f64 = 0.1;
/// Clustered standard errors that bands ask. Folds are taken as independent, although their training rows overlap [Bengio,
/// Grandvalet 2004, JMLR 5]; for ten folds 2 is about 4 % one-sided.
const T_BANDS: f64 = 2.0;
/// Clustered standard errors of a difference between two suspects that tells them apart.
const T_APART: f64 = 3.0;
/// Twice the difference of log likelihoods that does the same. "Very strong" is 10 for twice the log Bayes factor [Kass, Raftery
/// 1995, JASA 90(430)], which this difference approximates for equal numbers of parameters only.
pub(super) const GAIN_APART: f64 = 10.0;
/// Below this it says nothing at all.
pub(super) const SAME: f64 = 2.0;

/// Squares of folds, output by output.
type Folds = Vec<Vec<f64>>;

/// A fitted model.
#[derive(Clone)]
pub(crate) struct Fitted<'a> {
    pub(crate) suspects: Vec<usize>,
    pub(crate) fitting: Fitting<'a>,
    pub(crate) point: Point,
    pub(crate) convergence: Convergence,
    /// Squares that each fold in time has under the fit without it, output by output.
    folds: Folds,
    /// What the fit moves by without each of them.
    pub(crate) steps: Vec<DVector<f64>>,
    /// The same in bands of each of what the model's folds go over.
    bands: Vec<Folds>,
    /// Squares of the rows that judge, of each output.
    judged: Vec<f64>,
    /// Normal equations at the point.
    pub(crate) normal: Normal,
    /// Independent samples that each output's residual is worth.
    pub(crate) effective: Vec<f64>,
}

/// How a suspect did in a round.
#[derive(Clone, Debug)]
pub(crate) struct Evaluation {
    pub(crate) suspect: usize,
    pub(crate) gain: f64,
    pub(crate) penalty: f64,
    /// Share of the power left out, on folds in time.
    pub(crate) share: f64,
    /// Of the folds' differences.
    pub(crate) t: f64,
    pub(crate) passes: bool,
    /// The gate that decided, in words.
    pub(crate) gate: String,
    /// Posterior probability among the suspects of its round and none of them, all as likely before.
    pub(crate) probability: f64,
    /// Numbers of the suspect, by parameter.
    pub(crate) values_si: Vec<(usize, f64)>,
    pub(crate) convergence: Convergence,
    /// What each fold gains.
    differences: Vec<f64>,
}

/// A suspect that was taken.
pub(crate) struct Taken {
    pub(crate) evaluation: Evaluation,
    /// Others that explain the records as well.
    pub(crate) alternatives: Vec<usize>,
}

/// What came of the search.
pub(crate) struct Found<'a> {
    pub(crate) baseline: Fitted<'a>,
    pub(crate) extended: Fitted<'a>,
    pub(crate) taken: Vec<Taken>,
    /// All suspects beside the baseline alone, and beside what was taken.
    pub(crate) first: Vec<Evaluation>,
    pub(crate) last: Vec<Evaluation>,
    /// Suspects that cannot be simulated, with the reason.
    pub(crate) failed: Vec<(usize, String)>,
    /// The decoy that did better than every suspect, where that ended the search.
    pub(crate) decoy: Option<usize>,
}

/// Fits the model alone and searches beside it.
pub(crate) fn search<'a>(
    model: &'a Model,
    records: &'a [Measured],
    progress: &mut dyn FnMut(&str),
) -> Result<Found<'a>, Failure> {
    let baseline = fitted(model, records, &[], None)?;
    // Once more from there: suspects are fitted from its values, and must gain nothing by that alone.
    let baseline = fitted(model, records, &[], Some(&baseline))?;
    progress(&format!("the model alone: {}", left(&baseline)));
    let mut found = Found {
        extended: baseline.clone(),
        baseline,
        taken: Vec::new(),
        first: Vec::new(),
        last: Vec::new(),
        failed: Vec::new(),
        decoy: None,
    };
    loop {
        let taken = found.extended.suspects.clone();
        let is_open = |suspect: &usize| !taken.contains(suspect) && !model.suspects[*suspect].is_term;
        let open: Vec<usize> = (0..model.suspects.len()).filter(is_open).collect();
        let with = |suspect: &usize| {
            let suspects: Vec<usize> = taken.iter().copied().chain([*suspect]).collect();
            (*suspect, fitted(model, records, &suspects, Some(&found.extended)))
        };
        let (mut tried, mut fits) = (Vec::new(), Vec::new());
        for (suspect, fit) in open.par_iter().map(with).collect::<Vec<_>>() {
            match fit {
                Ok(fit) => {
                    tried.push(suspect);
                    fits.push(fit);
                }
                Err(failure) if found.taken.is_empty() => found.failed.push((suspect, failure.to_string())),
                Err(_) => {}
            }
        }
        // Rivals are compared in samples of the one that leaves least: each one's own count would favour what leaves more.
        let least = fits.iter().min_by(|one, other| one.point.loss.total_cmp(&other.point.loss));
        let effective = least.map_or(Vec::new(), |least| least.effective.clone());
        let pairs = tried.iter().zip(&fits);
        let mut round: Vec<Evaluation> =
            pairs.map(|(suspect, fit)| judge(&found, fit, *suspect, (open.len(), &effective))).collect();
        weigh(&mut round);
        if found.taken.is_empty() {
            found.first.clone_from(&round);
        }
        found.last.clone_from(&round);
        let passing = (0..round.len()).filter(|place| round[*place].passes);
        let value = |place: usize| round[place].worth();
        let best = passing.clone().max_by(|a, b| value(*a).total_cmp(&value(*b)));
        let Some(best) = best.filter(|_| found.taken.len() < MOST_TERMS) else { return Ok(found) };
        // Of forms of one effect that are as good the first of the file: its order says which is the likelier law.
        let is_as_good = |place: &usize| {
            value(*place) > value(best) - SAME
                && is_one_effect(model, round[*place].suspect, round[best].suspect)
        };
        let best = passing.clone().find(is_as_good).unwrap_or(best);
        let evaluation = round[best].clone();
        if model.suspects[evaluation.suspect].is_decoy {
            found.decoy = Some(evaluation.suspect);
            return Ok(found);
        }
        let alternatives = round
            .iter()
            .filter(|other| other.suspect != evaluation.suspect && other.passes)
            .filter(|other| !model.suspects[other.suspect].is_decoy && !apart(model, &evaluation, other))
            .map(|other| other.suspect)
            .collect();
        found.extended = fits.swap_remove(best);
        let name = &model.suspects[evaluation.suspect].name;
        progress(&format!("with {name}: {}", left(&found.extended)));
        found.taken.push(Taken { evaluation, alternatives });
    }
}

/// What a fit leaves, in words.
fn left(fitted: &Fitted<'_>) -> String {
    let model = fitted.fitting.model;
    let each = model.outputs.iter().zip(fitted.rms_si()).map(|(output, rms_si)| {
        format!("{} {:.4} {} rms", output.name, rms_si / output.unit.factor, output.unit.text)
    });
    each.collect::<Vec<_>>().join(", ")
}

impl Fitted<'_> {
    /// Root mean square of what is left of each output.
    pub(crate) fn rms_si(&self) -> Vec<f64> {
        let squares = self.point.squares.iter().enumerate();
        squares.map(|(output, squares)| (squares / self.fitting.count(output).max(1.0)).sqrt()).collect()
    }
}

/// Fits a model with suspects, from what a smaller one gave and each start of the suspects that are new.
pub(crate) fn fitted<'a>(
    model: &'a Model,
    records: &'a [Measured],
    suspects: &[usize],
    from: Option<&Fitted<'a>>,
) -> Result<Fitted<'a>, Failure> {
    let starts = |fitting: &Fitting<'a>| {
        starts::starts(fitting, suspects, from.map(|from| (&from.fitting, &from.point)))
    };
    fitted_from(model, records, suspects, starts)
}

/// The same from given starts.
pub(crate) fn fitted_from<'a>(
    model: &'a Model,
    records: &'a [Measured],
    suspects: &[usize],
    starts: impl Fn(&Fitting<'a>) -> Vec<Vec<f64>>,
) -> Result<Fitted<'a>, Failure> {
    let program =
        Program::new(model, suspects).expect("all suspects together were compiled when the file was read");
    let fitting = Fitting::new(model, program, records, suspects);
    let starts = starts(&fitting);
    let (point, convergence) = fitting.fit_from(starts)?;
    let normals = fitting.normals(&point.values_si, &fitting.in_time())?;
    let normal = fitting.sum(&normals, &point);
    let bands = (0..model.rows.folds.len()).map(|fold| {
        let normals = fitting.normals(&point.values_si, &fitting.in_bands(fold))?;
        Ok(folds(&normals, &steps(&normals, &normal, &fitting, &point)))
    });
    let bands = bands.collect::<Result<Vec<_>, Failure>>()?;
    let judged =
        normals[..normals.len() - 1].iter().fold(vec![0.0; model.outputs.len()], |mut sum, block| {
            sum.iter_mut().zip(block).for_each(|(sum, normal)| *sum += normal.squares);
            sum
        });
    let residuals = series(&fitting, &point)?;
    let effective = (0..model.outputs.len())
        .map(|output| independent(&residuals[output], fitting.count(output)))
        .collect();
    let steps = steps(&normals, &normal, &fitting, &point);
    Ok(Fitted {
        suspects: suspects.to_vec(),
        folds: folds(&normals, &steps),
        steps,
        bands,
        judged,
        fitting,
        point,
        convergence,
        normal,
        effective,
    })
}

/// What the fit moves by without each block, by one linear step; the last block is no fold.
fn steps(normals: &[Vec<Normal>], all: &Normal, fitting: &Fitting<'_>, point: &Point) -> Vec<DVector<f64>> {
    let is_free: Vec<bool> = fitting
        .unknowns
        .iter()
        .zip(&point.values_si)
        .map(|(unknown, value)| unknown.range_si[0] < *value && *value < unknown.range_si[1])
        .collect();
    let without = |block: &Vec<Normal>| {
        let mut rest = all.clone();
        for (output, normal) in block.iter().enumerate() {
            let weight = 1.0 / fitting.variance(output, point.squares[output]);
            rest.matrix -= &normal.matrix * weight;
            rest.slope -= &normal.slope * weight;
        }
        solved(&rest, &is_free, 0.0)
    };
    normals[..normals.len() - 1].iter().map(without).collect()
}

/// Squares of each fold under the fit without it.
fn folds(normals: &[Vec<Normal>], steps: &[DVector<f64>]) -> Folds {
    let of_block = |(block, step): (&Vec<Normal>, &DVector<f64>)| {
        let squares = |normal: &Normal| {
            let quadratic = step.dot(&(&normal.matrix * step));
            (normal.squares - 2.0 * step.dot(&normal.slope) + quadratic).max(0.0)
        };
        block.iter().map(squares).collect()
    };
    normals.iter().zip(steps).map(of_block).collect()
}

/// What is left of each output, record by record, where something was measured.
fn series(fitting: &Fitting<'_>, point: &Point) -> Result<Vec<Vec<Vec<f64>>>, Failure> {
    let residuals = fitting.residuals(&point.values_si)?;
    let of_output = |output: usize| {
        let measured =
            |record: &OfRecord| record[output][0].iter().copied().filter(|value| value.is_finite()).collect();
        residuals.iter().map(measured).collect()
    };
    Ok((0..fitting.model.outputs.len()).map(of_output).collect())
}

/// Samples over the sum of their autocorrelations until one is not positive.
fn independent(series: &[Vec<f64>], count: f64) -> f64 {
    let sum: f64 = covariance::autocorrelation(series).iter().sum();
    (count / (1.0 + 2.0 * sum)).max(2.0)
}

/// Folds in units of what `reference` leaves of each output.
fn in_units(folds: &Folds, reference: &Fitted<'_>) -> Vec<f64> {
    let weight = |output: usize| 1.0 / reference.fitting.variance(output, reference.point.squares[output]);
    let fold = |squares: &Vec<f64>| {
        squares.iter().enumerate().map(|(output, squares)| squares * weight(output)).sum()
    };
    folds.iter().map(fold).collect()
}

/// What each fold gains, in units of what is left before.
fn gained(before: &Folds, after: &Folds, reference: &Fitted<'_>) -> Vec<f64> {
    let [before, after] = [before, after].map(|folds| in_units(folds, reference));
    before.iter().zip(after).map(|(before, after)| before - after).collect()
}

/// Mean over its standard error, of differences that are one for each fold and taken as independent.
fn clustered_t(differences: &[f64]) -> f64 {
    let count = differences.len() as f64;
    let mean = mean(differences);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean / (variance / count).sqrt().max(f64::MIN_POSITIVE)
}

pub(super) fn judge(
    found: &Found<'_>,
    after: &Fitted<'_>,
    suspect: usize,
    (tried, samples): (usize, &[f64]),
) -> Evaluation {
    let (baseline, before) = (&found.baseline, &found.extended);
    let gain: f64 = (0..after.judged.len())
        .map(|output| {
            let [old, new] = [before, after].map(|of| of.judged[output]);
            let share = samples[output] / after.fitting.count(output).max(1.0);
            match after.fitting.model.outputs[output].noise_si {
                Some(_) => share * (old - new) / after.fitting.variance(output, new),
                None => {
                    let variances =
                        before.fitting.variance(output, old) / after.fitting.variance(output, new);
                    samples[output] * variances.ln()
                }
            }
        })
        .sum();
    let effective: f64 = samples.iter().sum();
    let more = after.fitting.unknowns.len() as f64 - before.fitting.unknowns.len() as f64;
    let penalty = more * effective.ln() + 2.0 * (tried.max(1) as f64).ln();
    let differences = gained(&before.folds, &after.folds, before);
    let share_of = |differences: &[f64], plain: &Folds| {
        let plain: f64 = in_units(plain, before).iter().sum();
        differences.iter().sum::<f64>() / plain.max(f64::MIN_POSITIVE)
    };
    let share = share_of(&differences, &baseline.folds);
    let t = clustered_t(&differences);
    let best_fold = differences.iter().copied().fold(0.0, f64::max);
    let without_best = differences.iter().sum::<f64>() - best_fold;
    let mut gates = vec![
        (gain / penalty.max(f64::MIN_POSITIVE), format!("likelihood gain {gain:.1}, penalty {penalty:.1}")),
        (
            share / SHARE_FLOOR,
            format!("folds in time: {}, {:.0} % asked", share_in_words(share), SHARE_FLOOR * 100.0),
        ),
        (
            if without_best > 0.0 { f64::INFINITY } else { 0.0 },
            "folds in time: it gains in one block of time alone".to_owned(),
        ),
    ];
    let model = after.fitting.model;
    let all_bands = before.bands.iter().zip(&after.bands).zip(&baseline.bands).zip(&model.rows.folds);
    for (((before_bands, after_bands), plain), over) in
        all_bands.filter(|_| !model.suspects[suspect].is_local)
    {
        let differences = gained(before_bands, after_bands, before);
        let (share, t) = (share_of(&differences, plain), clustered_t(&differences));
        let (floor, over) = (SHARE_FLOOR / 2.0, &over.text);
        let words = share_in_words(share);
        gates.push((share / floor, format!("folds over {over}: {words}, {:.0} % asked", floor * 100.0)));
        gates.push((
            t / T_BANDS,
            format!("folds over {over}: {t:.1} clustered standard errors, {T_BANDS:.0} asked"),
        ));
    }
    let (score, gate) =
        gates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there are three at least");
    let unknowns = after.fitting.unknowns.iter().zip(&after.point.values_si);
    let values_si = unknowns.filter_map(|(unknown, value)| match unknown.what {
        What::Shared(index) | What::OfRecord(index, 0)
            if after.fitting.model.parameters[index].suspect == Some(suspect) =>
        {
            Some((index, *value))
        }
        _ => None,
    });
    Evaluation {
        suspect,
        gain,
        penalty,
        share,
        t,
        passes: score > 1.0,
        gate,
        probability: 0.0,
        values_si: values_si.collect(),
        convergence: after.convergence,
        differences,
    }
}

impl Evaluation {
    /// Twice a log likelihood ratio, less what chance is granted.
    pub(super) fn worth(&self) -> f64 {
        self.gain - self.penalty
    }
}

/// Probabilities of a round: each suspect and none of them, as likely before; gains in units of the best one's samples.
fn weigh(round: &mut [Evaluation]) {
    let best = round.iter().map(Evaluation::worth).fold(0.0, f64::max);
    let weight = |worth: f64| (0.5 * (worth - best)).exp();
    let sum: f64 = weight(0.0) + round.iter().map(|one| weight(one.worth())).sum::<f64>();
    for one in round {
        one.probability = weight(one.worth()) / sum;
    }
}

/// A share of the power that the model alone leaves on folds; one that leaves much more says how many times as much.
pub(crate) fn share_in_words(share: f64) -> String {
    match share {
        share if share >= -1.0 => format!("{:.1} % of the power", share * 100.0),
        share if share > -1e4 => format!("worse, {:.0} times the power", 1.0 - share),
        _ => "worse, more than 10000 times the power".into(),
    }
}

/// Whether two suspects are forms of one effect.
fn is_one_effect(model: &Model, one: usize, other: usize) -> bool {
    let [effect, of_other] = [one, other].map(|suspect| model.suspects[suspect].effect.as_ref());
    one == other || effect.is_some() && effect == of_other
}

/// Whether one is better than the other beyond doubt: by its likelihood, or on the same folds. Forms of one effect differ by so
/// little that the spread over folds is nothing to compare it with: of them the likelihood decides alone.
fn apart(model: &Model, best: &Evaluation, other: &Evaluation) -> bool {
    if best.worth() - other.worth() > GAIN_APART {
        return true;
    }
    if is_one_effect(model, best.suspect, other.suspect) {
        return false;
    }
    let differences: Vec<f64> =
        best.differences.iter().zip(&other.differences).map(|(best, other)| best - other).collect();
    clustered_t(&differences) > T_APART
}

#[cfg(test)]
mod tests {
    use super::{clustered_t, independent, share_in_words};

    #[test]
    fn rows_that_repeat_their_neighbours_count_once() {
        // A hundred values, each ten times, of alternating signs.
        let residual = (0..1000).map(|at| if (at / 10) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let effective = independent(&[residual], 1000.0);
        assert!((100.0..300.0).contains(&effective), "{effective}");
    }

    #[test]
    fn blocks_that_differ_are_no_gain_beyond_their_error() {
        let alternating: Vec<f64> = (0..10).map(|at| if at % 2 == 0 { 1.1 } else { -0.9 }).collect();
        // A mean of 0.1, and a standard error of 1 / sqrt(10 - 1).
        assert!((clustered_t(&alternating) - 0.3).abs() < 1e-9);
        assert!(clustered_t(&[1.0; 10]) > 1e6);
    }

    #[test]
    fn a_share_that_is_far_below_nothing_is_said_as_a_ratio() {
        let said = [0.123, -0.5, -1.0, -3351.0, -2e4].map(share_in_words);
        let expected = [
            "12.3 % of the power",
            "-50.0 % of the power",
            "-100.0 % of the power",
            "worse, 3352 times the power",
            "worse, more than 10000 times the power",
        ];
        assert_eq!(said, expected);
    }
}
