//! Two suspects that pay together where neither does alone: a pump that is off and a tank that spills.
//!
//! ```text
//!   d_si = what suspect s with its numbers at point i of their ranges changes in the outputs, less what the model's own numbers
//!          can do (projection off their sensitivities)
//!   r    = residual of the model, projected likewise
//!   fall of the squares by a pair = b^T G^-1 b,   G = Gram matrix of d_si and d_tj,   b = (d_si r, d_tj r), both shares positive
//! ```
//! The pairs with the largest fall are fitted in the simulator, from these points and from the fits of each suspect alone. A pair
//! is taken if it passes the gates of a suspect beside the model, and each of the two those beside the fit of the other alone;
//! the penalty counts all pairs.
//!
//! Source: Miller 2002, Subset Selection in Regression, 2nd edition, 3.9 (replacing two at a time).

use super::fit::{Fitting, UnknownId};
use super::judge::{Evaluation, GAIN_APART, ReferenceFits, judge};
use super::progress::ProgressCounter;
use super::select::{Fitted, SearchResult, fitted_from};
use super::starts;
use super::structure::{self, LinearisedFit};
use crate::parallel;
use nalgebra::DVector;

/// Pairs that are fitted in the simulator, and starting points of each.
pub(super) const FITTED: usize = 4;
const POINTS: usize = 3;
/// Most steps of its fit: two suspects that hardly differ make a valley without an end, and such a pair does not pass.
const STEPS: usize = 20;

/// Two suspects that were taken together.
pub(super) struct Pair<'a> {
    pub(super) fit: Fitted<'a>,
    /// Each beside the other alone, with others that do as well in its place.
    pub(super) members: [(Evaluation, Vec<usize>); 2],
}

/// A suspect at a point: its numbers by parameter, and what it does.
struct Response {
    suspect: usize,
    values_si: Vec<(UnknownId, f64)>,
    change: DVector<f64>,
    /// Its product with the model's residual, and with itself.
    gain: f64,
    size: f64,
}

/// The best of the pairs that pass; where none does, what the nearest fails, in words, if there are pairs.
pub(super) fn best<'a>(
    found: &SearchResult<'a>,
    alone: &[(usize, Fitted<'a>)],
    done: &ProgressCounter,
) -> Result<Pair<'a>, Option<String>> {
    chosen(fitted_pairs(found, alone, done), |suspect| &found.baseline.fitting.model.suspects[suspect].name)
}

/// A pair as it was fitted, and how it is judged.
struct JudgedPair<'a> {
    fit: Fitted<'a>,
    bic_gain: f64,
    members: [Evaluation; 2],
    /// The gate that it fails.
    fails: Option<String>,
}

fn fitted_pairs<'a>(
    found: &SearchResult<'a>,
    alone: &[(usize, Fitted<'a>)],
    done: &ProgressCounter,
) -> Option<Vec<JudgedPair<'a>>> {
    let base = &found.baseline;
    let suspects = &base.fitting.model.suspects;
    let alone: Vec<&(usize, Fitted<'a>)> =
        alone.iter().filter(|(suspect, _)| !suspects[*suspect].is_decoy).collect();
    let tried = alone.len() * alone.len().saturating_sub(1) / 2;
    let responses = responses(base, &alone)?;
    let fits = parallel::map(&promising(&responses), |(pair, points)| {
        let fit = fit(found, &alone, &responses, *pair, points);
        done.increment();
        fit
    });
    let fits: Vec<([usize; 2], Fitted<'a>)> = fits.into_iter().flatten().collect();
    let least = fits.iter().min_by(|(_, one), (_, other)| one.point.loss.total_cmp(&other.point.loss))?;
    let effective = least.1.effective.clone();
    let of_alone = |suspect: usize| alone.iter().find(|(one, _)| *one == suspect).map(|(_, fit)| fit);
    let judged = fits.into_iter().filter_map(|(pair, fit)| {
        let beside = |before: &Fitted<'a>, suspect: usize| {
            judge(ReferenceFits { baseline: base, before }, &fit, suspect, (tried, &effective))
        };
        let whole = beside(base, pair[0]);
        let members = [beside(of_alone(pair[1])?, pair[0]), beside(of_alone(pair[0])?, pair[1])];
        let gates = [(&whole, "the two"), (&members[0], "the first"), (&members[1], "the second")];
        let failed = gates.into_iter().find(|(one, _)| !one.passes);
        let fails = failed.map(|(one, which)| format!("{which}: {}", one.gate));
        Some(JudgedPair { fit, bic_gain: whole.bic_gain(), members, fails })
    });
    Some(judged.collect())
}

fn chosen<'a, 'n>(
    judged: Option<Vec<JudgedPair<'a>>>,
    name: impl Fn(usize) -> &'n String,
) -> Result<Pair<'a>, Option<String>> {
    let mut judged = judged.unwrap_or_default();
    judged.sort_by(|one, other| other.bic_gain.total_cmp(&one.bic_gain));
    let pair_of = |one: &JudgedPair<'_>| [0, 1].map(|place| one.members[place].suspect);
    let Some(best) = judged.iter().position(|one| one.fails.is_none()) else {
        let nearest = judged.first().map(|nearest| {
            let [one, other] = pair_of(nearest).map(&name);
            let fails = nearest.fails.as_deref().unwrap_or_default();
            format!("of pairs of suspects {one} and {other} come nearest, and are rejected: {fails}")
        });
        return Err(nearest);
    };
    let best = judged.swap_remove(best);
    let is_as_good =
        |other: &&JudgedPair<'_>| other.fails.is_none() && best.bic_gain - other.bic_gain <= GAIN_APART;
    let others: Vec<[usize; 2]> = judged.iter().filter(is_as_good).map(pair_of).collect();
    let pair = pair_of(&best);
    let alternatives = |mine: usize| {
        let others = others.iter().map(|other| in_place_of(pair, *other)[mine]);
        let mut others: Vec<usize> = others.filter(|other| !pair.contains(other)).collect();
        others.sort_unstable();
        others.dedup();
        others
    };
    let [one, other] = best.members;
    Ok(Pair { fit: best.fit, members: [(one, alternatives(0)), (other, alternatives(1))] })
}

/// Another pair in the order of this one: what they share stands at its place.
fn in_place_of([one, two]: [usize; 2], [first, second]: [usize; 2]) -> [usize; 2] {
    if first == two || second == one { [second, first] } else { [first, second] }
}

/// What each suspect does at several points of its ranges, beside the model alone.
fn responses(base: &Fitted<'_>, alone: &[&(usize, Fitted<'_>)]) -> Option<Vec<Response>> {
    let (fitting, point) = (&base.fitting, &base.point);
    let beside = LinearisedFit::new(fitting, point)?;
    let (accepted, values_si, scale) = (&base.suspects[..], &point.values_si[..], &beside.scale[..]);
    let base = structure::ReferenceModel { fitting, accepted, values_si, scale };
    let of_suspect = |(suspect, fit): &&(usize, Fitted<'_>)| -> Vec<Response> {
        let of_this = |values_si: &[f64]| -> Vec<(UnknownId, f64)> {
            let all = fit.fitting.unknowns.iter().zip(values_si);
            let chosen = all.filter(|(unknown, _)| fit.fitting.suspect_of(unknown) == Some(*suspect));
            chosen.map(|(unknown, value)| (unknown.id, *value)).collect()
        };
        let points = starts::of_newest(&fit.fitting, &fit.suspects, (fitting, point));
        let points = points.iter().map(Vec::as_slice).chain([fit.point.values_si.as_slice()]);
        let response = |values_si: &[f64]| {
            let values_si = of_this(values_si);
            let change =
                beside.project_off(base.outputs_with(*suspect, &values_si).ok()? - &beside.predictions);
            let size = change.norm_squared();
            let gain = change.dot(&beside.residual);
            (size > 0.0 && size.is_finite()).then_some(Response {
                suspect: *suspect,
                values_si,
                change,
                gain,
                size,
            })
        };
        points.filter_map(response).collect()
    };
    Some(parallel::map(alone, of_suspect).into_iter().flatten().collect())
}

/// Pairs of suspects with the largest fall of the squares, each with the responses of its best points.
fn promising(responses: &[Response]) -> Vec<([usize; 2], Vec<[usize; 2]>)> {
    let mut falls: Vec<(f64, [usize; 2])> = Vec::new();
    for (place, one) in responses.iter().enumerate() {
        for (further, other) in responses[place + 1..].iter().enumerate() {
            if one.suspect != other.suspect
                && let Some(fall) = fall(one, other)
            {
                falls.push((fall, [place, place + 1 + further]));
            }
        }
    }
    falls.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let mut pairs: Vec<([usize; 2], Vec<[usize; 2]>)> = Vec::new();
    for (_, points) in falls {
        let pair = points.map(|place| responses[place].suspect);
        match pairs.iter().position(|(known, _)| *known == pair) {
            Some(place) if pairs[place].1.len() < POINTS => pairs[place].1.push(points),
            None if pairs.len() < FITTED => pairs.push((pair, vec![points])),
            _ => {}
        }
    }
    pairs
}

/// Fall of the squares by two responses, each with a positive share; `None` where one of them does as well alone.
fn fall(one: &Response, other: &Response) -> Option<f64> {
    let product = one.change.dot(&other.change);
    let determinant = one.size * other.size - product * product;
    if determinant <= 1e-6 * one.size * other.size {
        return None;
    }
    let shares = [
        (other.size * one.gain - product * other.gain) / determinant,
        (one.size * other.gain - product * one.gain) / determinant,
    ];
    let is_pair = shares.iter().all(|share| *share > 0.0);
    is_pair.then(|| shares[0] * one.gain + shares[1] * other.gain)
}

/// Fits a pair from its best points, and from each of the two alone with the other at these points.
fn fit<'a>(
    found: &SearchResult<'a>,
    alone: &[&(usize, Fitted<'a>)],
    responses: &[Response],
    pair: [usize; 2],
    points: &[[usize; 2]],
) -> Option<([usize; 2], Fitted<'a>)> {
    let base = &found.baseline;
    let (model, records) = (base.fitting.model, base.fitting.records);
    let suspects: Vec<usize> = base.suspects.iter().copied().chain(pair).collect();
    let starts = |fitting: &Fitting<'a>| -> Vec<Vec<f64>> {
        let values_of = |fit: &Fitted<'a>| -> Vec<(UnknownId, f64)> {
            let all = fit.fitting.unknowns.iter().zip(&fit.point.values_si);
            all.map(|(unknown, value)| (unknown.id, *value)).collect()
        };
        let with = |known: &[&[(UnknownId, f64)]]| -> Vec<f64> {
            let value = |id: UnknownId| {
                known
                    .iter()
                    .rev()
                    .find_map(|values| values.iter().find(|(of, _)| *of == id))
                    .map(|(_, value)| *value)
            };
            fitting.unknowns.iter().map(|unknown| value(unknown.id).unwrap_or(unknown.start_si)).collect()
        };
        let begin = values_of(base);
        let mut all = Vec::new();
        for [one, other] in points {
            let [one, other] = [&responses[*one], &responses[*other]];
            all.push(with(&[&begin, &one.values_si, &other.values_si]));
            for (suspect, fit) in alone.iter().filter(|(suspect, _)| pair.contains(suspect)) {
                let partner = if one.suspect == *suspect { other } else { one };
                all.push(with(&[&values_of(fit), &partner.values_si]));
            }
        }
        all
    };
    fitted_from(model, records, &suspects, (starts, STEPS)).ok().map(|fit| (pair, fit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(suspect: usize, change: [f64; 2], residual: [f64; 2]) -> Response {
        let (change, residual) = (DVector::from_row_slice(&change), DVector::from_row_slice(&residual));
        let (gain, size) = (change.dot(&residual), change.norm_squared());
        Response { suspect, values_si: Vec::new(), change, gain, size }
    }

    #[test]
    fn two_that_oppose_each_other_fall_further_than_each_alone() {
        // Neither direction is near to the residual, (0, 1); their sum is, and explains all of its square.
        let residual = [0.0, 1.0];
        let [one, other] = [response(0, [1.0, 0.2], residual), response(1, [-1.0, 0.2], residual)];
        assert!(one.gain * one.gain / one.size < 0.05);
        assert!((fall(&one, &other).unwrap() - 1.0).abs() < 1e-12);
        // A share that would have to be negative is no pair, and neither are two of one direction.
        assert!(fall(&one, &response(1, [1.0, -0.1], residual)).is_none());
        assert!(fall(&one, &response(1, [2.0, 0.4], residual)).is_none());
        let responses = [one, other, response(2, [1.0, 0.0], residual)];
        assert_eq!(promising(&responses)[0], ([0, 1], vec![[0, 1]]));
    }

    #[test]
    fn what_two_pairs_share_stands_at_its_place() {
        assert_eq!(in_place_of([3, 5], [5, 7]), [7, 5]);
        assert_eq!(in_place_of([3, 5], [1, 3]), [3, 1]);
        assert_eq!(in_place_of([3, 5], [3, 7]), [3, 7]);
    }
}
