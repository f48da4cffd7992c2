//! Whether a suspect passes, on the training records alone.
//!
//! All of these must hold:
//!
//! | gate | asks | against |
//! |---|---|---|
//! | likelihood | gain over `k ln(n) + 2 ln(suspects tried)` | chance; n: effective sample size of the best fit's residual |
//! | folds in time | at least a tenth of the residual power of the model alone | size |
//! | folds in time | 5 standard errors over folds, or half of the power | an error of the model that no suspect describes |
//! | folds in time | a gain without the block that gains most, too | an event that is none of the plant's |
//! | folds in bands of `[rows.folds]` | half of that share, at 2 standard errors over folds | what does not hold elsewhere |
//!
//! A mean over its standard error asked of all terms would ask that each acts in every block: a tank overflows in two of ten. A
//! small one must, since a suspect that resembles an error of the model explains some of it in some blocks.
//! Bands are not asked of a suspect that is `local`.
//!
//! Sources: Chen, Chen 2008, Biometrika 95(3) (penalty: extended BIC); Kass, Raftery 1995, JASA 90(430) (weights of models).

use super::fit::UnknownId;
use super::folds::{Folds, fold_t, gained, in_units};
use super::select::Fitted;
use crate::estimator::Convergence;
use model::Model;

/// Least share of the residual power of the model alone that a term must explain on held-out folds in time; on bands half of it.
pub(super) const SHARE_FLOOR: f64 = 0.1;
/// Share from which a term may act in some blocks of time alone, more than all else in the residual, and standard errors over
/// folds that a smaller one needs. Of 58 null records of seeds 1, 3 and 5 of the study of any plant, whose background adds up to
/// as much power as the noise, ten had a suspect with a share of 0.12 to 0.35, at 1.5 to 3.6 standard errors; hidden terms have
/// 0.9.
const SHARE_LARGE: f64 = 0.5;
const T_SMALL: f64 = 5.0;
/// Standard errors over folds that bands ask. Folds are taken as independent, although their training rows overlap [Bengio,
/// Grandvalet 2004, JMLR 5]; for the five bands 2 is 5.8 % one-sided (Student t with 4 degrees of freedom).
const T_BANDS: f64 = 2.0;
/// Standard errors over folds of a difference between two suspects that tells them apart.
const T_APART: f64 = 3.0;
/// Difference of [`Evaluation::bic_gain`] (twice the log likelihood, less the penalty) that does the same. "Very strong" is 10
/// for twice the log Bayes factor [Kass, Raftery 1995, JASA 90(430)].
pub(super) const GAIN_APART: f64 = 10.0;

/// How a suspect did in a round.
#[derive(Clone, Debug)]
pub(crate) struct Evaluation {
    pub(crate) suspect: usize,
    pub(crate) gain: f64,
    pub(crate) penalty: f64,
    /// Share of the residual power that it explains, on folds in time.
    pub(crate) share: f64,
    /// Of the folds' differences.
    pub(crate) t: f64,
    pub(crate) passes: bool,
    /// The gate that decided, in words.
    pub(crate) gate: String,
    /// Posterior probability among the suspects of its round and none of them, which is as likely before as all of them together.
    pub(crate) probability: f64,
    /// Numbers of the suspect, by parameter.
    pub(crate) values_si: Vec<(usize, f64)>,
    pub(crate) convergence: Convergence,
    /// What each fold gains.
    differences: Vec<f64>,
}

/// Fits that a suspect is judged against: the model alone, whose power is the unit of shares, and the fit without the suspect.
#[derive(Clone, Copy)]
pub(super) struct ReferenceFits<'f, 'a> {
    pub(super) baseline: &'f Fitted<'a>,
    pub(super) before: &'f Fitted<'a>,
}

/// Residual power on folds before, over that of the model alone: no suspect explains more.
pub(super) fn most_share(ReferenceFits { baseline, before }: ReferenceFits<'_, '_>) -> f64 {
    let [of_baseline, of_before] =
        [baseline, before].map(|one| in_units(&one.folds, before).iter().sum::<f64>().max(f64::MIN_POSITIVE));
    of_before / of_baseline
}

/// Judges a suspect; where its likelihood gains and its folds by linear steps lose, by folds that are fitted.
pub(super) fn judge(
    reference_fits: ReferenceFits<'_, '_>,
    after: &Fitted<'_>,
    suspect: usize,
    of_round: (usize, &[f64]),
) -> Evaluation {
    let linear = judge_by_folds(reference_fits, after, suspect, of_round);
    if linear.passes || linear.share >= 0.0 || linear.gain <= linear.penalty {
        return linear;
    }
    let [baseline, before, after] =
        [reference_fits.baseline, reference_fits.before, after].map(Fitted::by_fits);
    match (baseline, before, after) {
        (Some(baseline), Some(before), Some(after)) => {
            judge_by_folds(ReferenceFits { baseline: &baseline, before: &before }, &after, suspect, of_round)
        }
        _ => linear,
    }
}

fn judge_by_folds(
    ReferenceFits { baseline, before }: ReferenceFits<'_, '_>,
    after: &Fitted<'_>,
    suspect: usize,
    (tried, samples): (usize, &[f64]),
) -> Evaluation {
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
    let t = fold_t(&differences);
    let best_fold = differences.iter().copied().fold(0.0, f64::max);
    let without_best = differences.iter().sum::<f64>() - best_fold;
    let mut gates = vec![
        (gain / penalty.max(f64::MIN_POSITIVE), format!("likelihood gain {gain:.1}, penalty {penalty:.1}")),
        (
            share / SHARE_FLOOR,
            format!("folds in time: {}, {:.0} % asked", share_in_words(share), SHARE_FLOOR * 100.0),
        ),
        (
            (share / SHARE_LARGE).max(t / T_SMALL),
            format!(
                "folds in time: {} at {t:.1} standard errors over folds, half or {T_SMALL:.0} of these asked",
                share_in_words(share)
            ),
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
        let (share, t) = (share_of(&differences, plain), fold_t(&differences));
        let (floor, over) = (SHARE_FLOOR / 2.0, &over.text);
        let words = share_in_words(share);
        gates.push((share / floor, format!("folds over {over}: {words}, {:.0} % asked", floor * 100.0)));
        gates.push((
            t / T_BANDS,
            format!("folds over {over}: {t:.1} standard errors over folds, {T_BANDS:.0} asked"),
        ));
    }
    let (score, gate) =
        gates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there are four at least");
    let unknowns = after.fitting.unknowns.iter().zip(&after.point.values_si);
    let values_si = unknowns.filter_map(|(unknown, value)| match unknown.id {
        UnknownId::Shared(index) | UnknownId::PerRecord(index, 0)
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
    /// Twice a log likelihood ratio, less the penalty of the extended BIC.
    pub(super) fn bic_gain(&self) -> f64 {
        self.gain - self.penalty
    }
}

/// Probabilities of a round: each suspect, all as likely before, and none of them, as likely before as all together, since a
/// penalty has 2 ln(suspects tried); gains in units of the best one's samples.
pub(super) fn weigh(round: &mut [Evaluation]) {
    let best = round.iter().map(Evaluation::bic_gain).fold(0.0, f64::max);
    let weight = |gain: f64| (0.5 * (gain - best)).exp();
    let sum: f64 = weight(0.0) + round.iter().map(|one| weight(one.bic_gain())).sum::<f64>();
    for one in round {
        one.probability = weight(one.bic_gain()) / sum;
    }
}

/// A share of the residual power of the model alone on folds; one with a much larger residual says how many times as much.
pub(crate) fn share_in_words(share: f64) -> String {
    match share {
        share if share >= -1.0 => format!("{:.1} % of the power", share * 100.0),
        share if share > -1e4 => format!("worse, {:.0} times the power", 1.0 - share),
        _ => "worse, more than 10000 times the power".into(),
    }
}

/// Effects of these suspects, each once, with its forms where there are several.
pub(super) fn by_effect(model: &Model, suspects: &[usize]) -> String {
    let effect = |one: usize| model.suspects[one].effect.as_ref().unwrap_or(&model.suspects[one].name);
    let mut effects: Vec<&String> = suspects.iter().map(|one| effect(*one)).collect();
    effects.sort_by_key(|name| suspects.iter().position(|one| effect(*one) == *name));
    effects.dedup();
    let in_words = |name: &&String| {
        let forms = suspects.iter().filter(|one| effect(**one) == *name);
        let forms: Vec<&str> = forms.map(|one| model.suspects[*one].name.as_str()).collect();
        if forms.len() < 2 { (*name).clone() } else { format!("{name} ({})", forms.join(" or ")) }
    };
    effects.iter().map(in_words).collect::<Vec<_>>().join(" or ")
}

/// Whether two suspects are forms of one effect.
pub(super) fn is_one_effect(model: &Model, one: usize, other: usize) -> bool {
    let [effect, of_other] = [one, other].map(|suspect| model.suspects[suspect].effect.as_ref());
    one == other || effect.is_some() && effect == of_other
}

/// Whether one is better than the other beyond doubt: by its likelihood, or on the same folds. Forms of one effect differ by so
/// little that the spread over folds is nothing to compare it with: of them the likelihood decides alone.
pub(super) fn apart(model: &Model, best: &Evaluation, other: &Evaluation) -> bool {
    if best.bic_gain() - other.bic_gain() > GAIN_APART {
        return true;
    }
    if is_one_effect(model, best.suspect, other.suspect) {
        return false;
    }
    let differences: Vec<f64> =
        best.differences.iter().zip(&other.differences).map(|(best, other)| best - other).collect();
    fold_t(&differences) > T_APART
}

#[cfg(test)]
mod tests {
    use super::{by_effect, share_in_words};
    use model::Model;
    use std::path::Path;

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

    #[test]
    fn forms_of_one_effect_are_one_alternative_with_their_names() {
        let suspect = |name: &str, effect: &str| {
            format!("[[suspects]]\nname = \"{name}\"\n{effect}place = \"y\"\nadd = \"1\"\n")
        };
        let seal = "effect = \"pressed-seal\"\n";
        let all = [
            suspect("lip", seal),
            suspect("offset", ""),
            suspect("root", seal),
            suspect("single", "effect = \"e\"\n"),
        ];
        let text = format!("[outputs.y]\nvalue = \"1\"\n{}", all.concat());
        let model = Model::parse(&text, Path::new("m.toml")).unwrap();
        assert_eq!(by_effect(&model, &[0, 1, 2, 3]), "pressed-seal (lip or root) or offset or e");
    }
}
