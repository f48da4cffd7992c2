//! Which suspects are taken, by forward selection on the training records alone.
//!
//! A suspect is fitted together with everything that the model leaves open, in the simulator, from several starting points
//! ([`starts`]). The gates stand in [`super::judge`].
//!
//! A fold is judged by the fit without it, which follows from the normal equations of the others by one linear step. The best of
//! what passes is taken; another that passes and is not better or worse beyond doubt explains the records as well.
//!
//! Sources: Chen, Chen 2008, Biometrika 95(3) (penalty: extended BIC); Kass, Raftery 1995, JASA 90(430) (weights of models).

use super::fit::{Fitting, OPTIONS, OutputSeries, Point};
use super::folds::{Folds, folds, refitted, steps};
use super::judge::{Evaluation, ReferenceFits, SHARE_FLOOR, apart, is_one_effect, judge, most_share, weigh};
use super::normal::Normal;
use super::pairs::{self, Pair};
use super::progress::{ProgressCounter, with_progress};
use super::record::MeasuredRecord;
use super::{covariance, starts};
use crate::estimator::Convergence;
use crate::parallel;
use model::{Failure, Model, Program};
use nalgebra::DVector;
use std::sync::OnceLock;

/// Most terms that are taken.
pub(super) const MOST_TERMS: usize = 3;
/// Difference of [`Evaluation::bic_gain`] below which forms of one effect count as equally good.
pub(super) const SAME: f64 = 2.0;

/// A fitted model with its folds, its normal equations, and the effective size of its samples.
#[derive(Clone)]
pub(crate) struct Fitted<'a> {
    pub(crate) suspects: Vec<usize>,
    pub(crate) fitting: Fitting<'a>,
    pub(crate) point: Point,
    pub(crate) convergence: Convergence,
    /// Squares that each fold in time has under the fit without it, output by output.
    pub(super) folds: Folds,
    /// The same by fits in place of linear steps, where they were asked for.
    refitted: OnceLock<Option<Folds>>,
    /// What the fit moves by without each of them.
    pub(crate) steps: Vec<DVector<f64>>,
    /// The same in bands of each of what the model's folds go over.
    pub(super) bands: Vec<Folds>,
    /// Squares of the rows that judge, of each output.
    pub(super) judged: Vec<f64>,
    /// Normal equations at the point.
    pub(crate) normal: Normal,
    /// Effective sample size of each output's residual.
    pub(crate) effective: Vec<f64>,
}

/// An accepted suspect with its alternatives.
pub(crate) struct AcceptedSuspect {
    pub(crate) evaluation: Evaluation,
    /// Others that explain the records as well.
    pub(crate) alternatives: Vec<usize>,
    /// Others whose likelihood does too, and that fail another gate.
    pub(crate) near: Vec<usize>,
}

/// A suspect that cannot be distinguished from an accepted one, fitted in its place.
pub(crate) struct Rival<'a> {
    pub(crate) suspect: usize,
    pub(crate) instead_of: usize,
    /// It fails another gate than the likelihood.
    pub(crate) is_near: bool,
    pub(crate) fit: Result<Fitted<'a>, Failure>,
}

/// Result of the forward selection.
pub(crate) struct SearchResult<'a> {
    pub(crate) baseline: Fitted<'a>,
    pub(crate) extended: Fitted<'a>,
    pub(crate) accepted: Vec<AcceptedSuspect>,
    /// Evaluations of all suspects in the first round and in the last one.
    pub(crate) first: Vec<Evaluation>,
    pub(crate) last: Vec<Evaluation>,
    /// Suspects that cannot be simulated, with the reason.
    pub(crate) failed: Vec<(usize, String)>,
    /// The decoy that did better than every suspect, where that ended the search.
    pub(crate) decoy: Option<usize>,
    /// What a reader should know of the search.
    pub(crate) notes: Vec<String>,
}

/// Fits the model alone and searches beside it.
pub(crate) fn search<'a>(
    model: &'a Model,
    records: &'a [MeasuredRecord],
    progress: &mut dyn FnMut(&str),
) -> Result<SearchResult<'a>, Failure> {
    let baseline = with_progress(progress, ("the model alone: fits", 2), |done| {
        let first = fitted(model, records, &[], None)?;
        done.increment();
        // Once more from there: suspects are fitted from its values, and must gain nothing by that alone.
        fitted(model, records, &[], Some(&first))
    })?;
    progress(&format!("the model alone: {}", rms_in_words(&baseline)));
    let mut found = SearchResult {
        extended: baseline.clone(),
        baseline,
        accepted: Vec::new(),
        first: Vec::new(),
        last: Vec::new(),
        failed: Vec::new(),
        decoy: None,
        notes: Vec::new(),
    };
    while !found.is_over() {
        let accepted = found.extended.suspects.clone();
        let is_open = |suspect: &usize| !accepted.contains(suspect) && !model.suspects[*suspect].is_term;
        let open: Vec<usize> = (0..model.suspects.len()).filter(is_open).collect();
        let round = with_progress(progress, ("fits of suspects", open.len()), |done| {
            let with = |suspect: &usize| {
                let suspects: Vec<usize> = accepted.iter().copied().chain([*suspect]).collect();
                let fit = fitted(model, records, &suspects, Some(&found.extended));
                done.increment();
                (*suspect, fit)
            };
            parallel::map(&open, with)
        });
        let (mut tried, mut fits) = (Vec::new(), Vec::new());
        for (suspect, fit) in round {
            match fit {
                Ok(fit) => {
                    tried.push(suspect);
                    fits.push(fit);
                }
                Err(failure) if found.accepted.is_empty() => {
                    found.failed.push((suspect, failure.to_string()))
                }
                Err(_) => {}
            }
        }
        // Rivals share the effective sample size of the best fit: each one's own would favour a larger, more correlated residual.
        let least = fits.iter().min_by(|one, other| one.point.loss.total_cmp(&other.point.loss));
        let effective = least.map_or(Vec::new(), |least| least.effective.clone());
        let pairs = tried.iter().zip(&fits);
        let mut round: Vec<Evaluation> = pairs
            .map(|(suspect, fit)| judge(found.reference_fits(), fit, *suspect, (open.len(), &effective)))
            .collect();
        weigh(&mut round);
        if found.accepted.is_empty() {
            found.first.clone_from(&round);
        }
        found.last.clone_from(&round);
        let passing = (0..round.len()).filter(|place| round[*place].passes);
        let value = |place: usize| round[place].bic_gain();
        let best = passing.clone().max_by(|a, b| value(*a).total_cmp(&value(*b)));
        if best.is_none() && found.accepted.is_empty() {
            let alone: Vec<(usize, Fitted<'a>)> = tried.into_iter().zip(fits).collect();
            let pair = with_progress(progress, ("fits of pairs", pairs::FITTED), |done| {
                pairs::best(&found, &alone, done)
            });
            match pair {
                Ok(pair) => found.accept_pair(pair, progress),
                Err(why) => {
                    found.notes.extend(why);
                    return Ok(found);
                }
            }
            continue;
        }
        let Some(best) = best else { return Ok(found) };
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
        let is_near = |other: &&Evaluation| {
            other.suspect != evaluation.suspect
                && !model.suspects[other.suspect].is_decoy
                && (other.passes || other.bic_gain() > 0.0)
                && !apart(model, &evaluation, other)
        };
        let (alternatives, near): (Vec<&Evaluation>, Vec<&Evaluation>) =
            round.iter().filter(is_near).partition(|other| other.passes);
        let [alternatives, near] =
            [alternatives, near].map(|all| all.iter().map(|one| one.suspect).collect());
        found.extended = fits.swap_remove(best);
        let name = &model.suspects[evaluation.suspect].name;
        progress(&format!("with {name}: {}", rms_in_words(&found.extended)));
        found.accepted.push(AcceptedSuspect { evaluation, alternatives, near });
    }
    Ok(found)
}

impl<'a> SearchResult<'a> {
    pub(super) fn reference_fits(&self) -> ReferenceFits<'_, 'a> {
        ReferenceFits { baseline: &self.baseline, before: &self.extended }
    }

    /// Whether nothing more can be taken: the residual power is less than a term must explain.
    fn is_over(&self) -> bool {
        let is_little = || most_share(self.reference_fits()) <= SHARE_FLOOR;
        self.accepted.len() >= MOST_TERMS || !self.accepted.is_empty() && is_little()
    }

    /// Fits each suspect that could not be told from what was taken in its place, beside what else was taken.
    pub(crate) fn rivals(&self, progress: &mut dyn FnMut(&str)) -> Vec<Rival<'a>> {
        let in_place = |(suspect, instead_of, is_near): (usize, usize, bool), done: &ProgressCounter| {
            let others = self.extended.suspects.iter().copied();
            let others = others.filter(|other| *other != instead_of && *other != suspect);
            let suspects: Vec<usize> = others.chain([suspect]).collect();
            let (model, records) = (self.extended.fitting.model, self.extended.fitting.records);
            let fit = fitted(model, records, &suspects, Some(&self.extended));
            done.increment();
            Rival { suspect, instead_of, is_near, fit }
        };
        let of = |accepted: &AcceptedSuspect| {
            let instead_of = accepted.evaluation.suspect;
            let as_good = accepted.alternatives.iter().map(move |suspect| (*suspect, instead_of, false));
            let near = accepted.near.iter().map(move |suspect| (*suspect, instead_of, true));
            as_good.chain(near).collect::<Vec<_>>()
        };
        let all: Vec<_> = self.accepted.iter().flat_map(of).collect();
        with_progress(progress, ("fits in place of what was named", all.len()), |done| {
            parallel::map(&all, |one| in_place(*one, done))
        })
    }

    fn accept_pair(&mut self, pair: Pair<'a>, progress: &mut dyn FnMut(&str)) {
        let model = self.baseline.fitting.model;
        let [one, other] = [0, 1].map(|place| &model.suspects[pair.members[place].0.suspect].name);
        self.notes.push(format!("{one} and {other} were found together: neither passes alone"));
        self.extended = pair.fit;
        progress(&format!("with {one} and {other}: {}", rms_in_words(&self.extended)));
        let accepted = pair.members.map(|(evaluation, alternatives)| AcceptedSuspect {
            evaluation,
            alternatives,
            near: Vec::new(),
        });
        self.accepted.extend(accepted);
    }
}

/// Rms residual of each output, in words.
fn rms_in_words(fitted: &Fitted<'_>) -> String {
    let model = fitted.fitting.model;
    let each = model.outputs.iter().zip(fitted.rms_si()).map(|(output, rms_si)| {
        format!("{} {:.4} {} rms", output.name, rms_si / output.unit.factor, output.unit.text)
    });
    each.collect::<Vec<_>>().join(", ")
}

impl Fitted<'_> {
    /// The same with folds that were fitted.
    pub(super) fn by_fits(&self) -> Option<Self> {
        let folds = self.refitted.get_or_init(|| refitted(self)).clone()?;
        Some(Self { folds, ..self.clone() })
    }

    /// Rms residual of each output.
    pub(crate) fn rms_si(&self) -> Vec<f64> {
        let squares = self.point.squares.iter().enumerate();
        squares.map(|(output, squares)| (squares / self.fitting.count(output).max(1.0)).sqrt()).collect()
    }
}

/// Fits a model with suspects, from what a smaller one gave and each start of the suspects that are new.
pub(crate) fn fitted<'a>(
    model: &'a Model,
    records: &'a [MeasuredRecord],
    suspects: &[usize],
    from: Option<&Fitted<'a>>,
) -> Result<Fitted<'a>, Failure> {
    let starts = |fitting: &Fitting<'a>| {
        starts::starts(fitting, suspects, from.map(|from| (&from.fitting, &from.point)))
    };
    fitted_from(model, records, suspects, (starts, OPTIONS.steps))
}

/// The same from given starting points, in at most so many steps.
pub(crate) fn fitted_from<'a>(
    model: &'a Model,
    records: &'a [MeasuredRecord],
    suspects: &[usize],
    (starts, most): (impl Fn(&Fitting<'a>) -> Vec<Vec<f64>>, usize),
) -> Result<Fitted<'a>, Failure> {
    let program =
        Program::new(model, suspects).expect("all suspects together were compiled when the file was read");
    let fitting = Fitting::new(model, program, records, suspects);
    let starts = starts(&fitting);
    let (point, convergence) = fitting.fit_from(starts, most)?;
    let normals = fitting.normals(&point.values_si, &fitting.blocks_in_time())?;
    let normal = fitting.sum(&normals, &point);
    let bands = (0..model.rows.folds.len()).map(|fold| {
        let normals = fitting.normals(&point.values_si, &fitting.blocks_in_bands(fold))?;
        Ok(folds(&normals, &steps(&normals, &normal, &fitting, &point)))
    });
    let bands = bands.collect::<Result<Vec<_>, Failure>>()?;
    let judged =
        normals[..normals.len() - 1].iter().fold(vec![0.0; model.outputs.len()], |mut sum, block| {
            sum.iter_mut().zip(block).for_each(|(sum, normal)| *sum += normal.squares);
            sum
        });
    let effective = effective_sample_sizes(&fitting, &point)?;
    let steps = steps(&normals, &normal, &fitting, &point);
    Ok(Fitted {
        suspects: suspects.to_vec(),
        folds: folds(&normals, &steps),
        refitted: OnceLock::new(),
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

/// Effective sample size of the residual of each output.
pub(super) fn effective_sample_sizes(fitting: &Fitting<'_>, point: &Point) -> Result<Vec<f64>, Failure> {
    let residuals = series(fitting, point)?;
    let of_output =
        |(output, residual): (usize, &Vec<Vec<f64>>)| effective_sample_size(residual, fitting.count(output));
    Ok(residuals.iter().enumerate().map(of_output).collect())
}

/// Residual of each output, record by record, where something was measured.
fn series(fitting: &Fitting<'_>, point: &Point) -> Result<Vec<Vec<Vec<f64>>>, Failure> {
    let residuals = fitting.residuals(&point.values_si)?;
    let of_output = |output: usize| {
        let measured = |record: &OutputSeries| {
            record[output][0].iter().copied().filter(|value| value.is_finite()).collect()
        };
        residuals.iter().map(measured).collect()
    };
    Ok((0..fitting.model.outputs.len()).map(of_output).collect())
}

/// Effective sample size: n / (1 + 2 sum of the autocorrelations up to the first that is not positive), at least 2.
fn effective_sample_size(series: &[Vec<f64>], count: f64) -> f64 {
    let sum: f64 = covariance::autocorrelation(series).iter().sum();
    (count / (1.0 + 2.0 * sum)).max(2.0)
}

#[cfg(test)]
mod tests {
    use super::effective_sample_size;

    #[test]
    fn rows_that_repeat_their_neighbours_count_once() {
        // A hundred values, each ten times, of alternating signs.
        let residual = (0..1000).map(|at| if (at / 10) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let effective = effective_sample_size(&[residual], 1000.0);
        assert!((100.0..300.0).contains(&effective), "{effective}");
    }
}
