//! Calibration of the probabilities of explanations: of those stated at 90 %, 90 % should be right.
//!
//! An explanation is *right* when it is what was hidden: nothing, parameters only, or a set of effects of which each stands for
//! one hidden effect, itself or a twin at its place. Where no explanation of a report is right, or the effect was left out of
//! the catalogue, *none of these* is right. It is also right, beside nothing or parameters, for a record with a background and
//! nothing hidden. Two right explanations are one event with the sum of their probabilities. The weights of the probabilities
//! were fitted by the same rules (`discrepancy/study/explanations.py`), without that sum.

use crate::classes::Member;
use crate::draws::{Draw, Kind};
use crate::interval::wilson;
use crate::judge::is_of_class;
use crate::report::Report;
use discrepancy::report::{EffectPlace, Explanation, ExplanationKind};
use record_maker::Hidden;
use serde::Serialize;

/// Edges between the bins before small ones are merged.
const EDGES: [f64; 5] = [0.01, 0.1, 0.5, 0.9, 0.99];
const LEAST_IN_BIN: usize = 60;
/// Lower end of a bin that tests high probabilities.
const HIGH: f64 = 0.5;
/// Weight of the records with nothing hidden, as a share of all.
const NULL_SHARE: f64 = 1.0 / 3.0;
const CONFIDENCE: f64 = 0.95;
/// Smallest probability in a log loss: a single 0 would dominate the mean.
const LEAST_PROBABILITY: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct JudgedExplanation {
    pub(crate) probability: f64,
    /// Probability by the marginal likelihood, where the report states it.
    pub(crate) marginal: Option<f64>,
    pub(crate) right: bool,
}

/// The explanations with the probabilities of the marginal likelihood; `None` where the report has none.
pub(crate) fn by_marginal(stated: &[JudgedExplanation]) -> Option<Vec<JudgedExplanation>> {
    let with_marginal =
        |stated: &JudgedExplanation| Some(JudgedExplanation { probability: stated.marginal?, ..*stated });
    stated
        .iter()
        .map(with_marginal)
        .collect::<Option<Vec<JudgedExplanation>>>()
        .filter(|stated| !stated.is_empty())
}

pub(crate) fn judge(
    draw: &Draw,
    classes: &[Vec<Member>],
    left_out: bool,
    report: &Report,
) -> Vec<JudgedExplanation> {
    let recipe = &draw.recipe;
    let alone = recipe.hidden.is_empty();
    let is_right = |explanation: &Explanation| match explanation.kind {
        _ if left_out => explanation.kind == ExplanationKind::NoneOfThese,
        ExplanationKind::Null => alone && recipe.wrong_parameters.is_empty(),
        ExplanationKind::Parameters => alone && !recipe.wrong_parameters.is_empty(),
        ExplanationKind::Effects => {
            !alone && explanation.sets.iter().any(|set| match_hidden(set, &recipe.hidden, classes))
        }
        ExplanationKind::NoneOfThese => alone && recipe.background.is_some(),
    };
    let stated = |explanation: &Explanation| JudgedExplanation {
        probability: explanation.probability,
        marginal: explanation.marginal.map(|marginal| marginal.probability),
        right: is_right(explanation),
    };
    let mut judged: Vec<JudgedExplanation> = report.explanations.iter().map(stated).collect();
    let any = judged.iter().any(|stated| stated.right);
    let fallen =
        report.explanations.iter().position(|explanation| explanation.kind == ExplanationKind::NoneOfThese);
    if let Some(none) = fallen.filter(|_| !any) {
        judged[none].right = true;
    }
    judged
}

/// Whether the effects of a set match the hidden ones one to one.
fn match_hidden(set: &[EffectPlace], hidden: &[Hidden], classes: &[Vec<Member>]) -> bool {
    let Some(first) = set.first().filter(|_| set.len() == hidden.len()) else { return hidden.is_empty() };
    (0..hidden.len()).any(|at| {
        let (mut others, mut twins) = (hidden.to_vec(), classes.to_vec());
        twins.resize(hidden.len(), Vec::new());
        let (effect, class) = (others.remove(at), twins.remove(at));
        is_of_class(&first.effect, &first.place.to_string(), &effect, &class)
            && match_hidden(&set[1..], &others, &twins)
    })
}

/// Explanations of similar probabilities.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Bin {
    /// Smallest and largest probability.
    pub(crate) between: [f64; 2],
    pub(crate) explanations: usize,
    /// Weighted means.
    #[serde(rename = "said")]
    pub(crate) stated: f64,
    pub(crate) right: f64,
    /// Simultaneous over the bins at 95 %: Wilson's interval at the Bonferroni level, for the effective number. It assumes that
    /// the explanations of one report are independent, which they are not: it is too narrow.
    pub(crate) band: [f64; 2],
}

/// The explanations of a report as mutually exclusive events: right ones are one event.
fn events(stated: &[JudgedExplanation]) -> impl Iterator<Item = JudgedExplanation> {
    let wrong = stated.iter().copied().filter(|stated| !stated.right);
    let right = stated.iter().filter(|stated| stated.right).map(|stated| stated.probability);
    let both = right.reduce(|one, other| one + other);
    wrong.chain(both.map(|probability| JudgedExplanation { probability, marginal: None, right: true }))
}

/// Reliability of the probabilities of all reports, and the expected calibration error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Reliability {
    pub(crate) bins: Vec<Bin>,
    /// Weighted mean of |stated - right| of the bins.
    pub(crate) calibration_error: f64,
    /// Reports whose most probable explanation is right, and all reports.
    pub(crate) first_right: [usize; 2],
    /// Mean over the reports of -ln of the probability of the right event; `None` without reports.
    pub(crate) log_loss: Option<f64>,
}

impl Reliability {
    /// The calibration error if a bin lies wholly above one half; otherwise it does not test high probabilities. One event of
    /// each report is right, so that the means of a single bin agree by construction.
    pub(crate) fn shown_error(&self) -> Option<f64> {
        let is_high = self.bins.len() > 1 && self.bins.iter().any(|bin| bin.between[0] >= HIGH);
        is_high.then_some(self.calibration_error)
    }

    /// Reliability of reports with the kinds of their draws, weighted so that nothing hidden has a third of the weight.
    pub(crate) fn of(reports: &[(Kind, &[JudgedExplanation])]) -> Self {
        let given: Vec<_> = reports.iter().filter(|(_, stated)| !stated.is_empty()).collect();
        let is_null = |kind: Kind| matches!(kind, Kind::Null | Kind::Parameter);
        let nulls = given.iter().filter(|(kind, _)| is_null(*kind)).count();
        let others = given.len() - nulls;
        let weight = |kind| match (nulls, others) {
            (0, _) | (_, 0) => 1.0,
            _ if is_null(kind) => NULL_SHARE / nulls as f64,
            _ => (1.0 - NULL_SHARE) / others as f64,
        };
        let mut all: Vec<(f64, JudgedExplanation)> = given
            .iter()
            .flat_map(|(kind, stated)| events(stated).map(|event| (weight(*kind), event)))
            .collect();
        all.sort_by(|left, right| left.1.probability.total_cmp(&right.1.probability));
        let parts = parts(&all);
        let bins: Vec<Bin> = parts.iter().map(|part| bin(part, parts.len())).collect();
        let weight_of =
            |part: &[(f64, JudgedExplanation)]| part.iter().map(|(weight, _)| weight).sum::<f64>();
        let errors =
            bins.iter().zip(&parts).map(|(bin, part)| (bin.stated - bin.right).abs() * weight_of(part));
        let first = |stated: &[JudgedExplanation]| {
            stated.iter().copied().max_by(|a, b| a.probability.total_cmp(&b.probability))
        };
        let right =
            given.iter().filter(|(_, stated)| first(stated).is_some_and(|stated| stated.right)).count();
        let loss = |stated: &[JudgedExplanation]| {
            let of_right = events(stated).filter(|event| event.right).map(|event| event.probability);
            -of_right.sum::<f64>().max(LEAST_PROBABILITY).ln()
        };
        let losses: f64 = given.iter().map(|(_, stated)| loss(stated)).sum();
        Reliability {
            calibration_error: errors.sum::<f64>() / weight_of(&all),
            bins,
            first_right: [right, given.len()],
            log_loss: (!given.is_empty()).then(|| losses / given.len() as f64),
        }
    }
}

/// Explanations split at the edges; a bin with too few is merged with the next higher one, the last with the one below.
fn parts(all: &[(f64, JudgedExplanation)]) -> Vec<&[(f64, JudgedExplanation)]> {
    let mut cuts = vec![0];
    for edge in EDGES {
        let at = all.partition_point(|(_, stated)| stated.probability < edge);
        if at >= cuts[cuts.len() - 1] + LEAST_IN_BIN {
            cuts.push(at);
        }
    }
    while cuts.len() > 1 && all.len() < cuts[cuts.len() - 1] + LEAST_IN_BIN {
        cuts.pop();
    }
    cuts.push(all.len());
    cuts.windows(2).map(|ends| &all[ends[0]..ends[1]]).filter(|part| !part.is_empty()).collect()
}

fn bin(part: &[(f64, JudgedExplanation)], of: usize) -> Bin {
    let sum = |value: &dyn Fn(&(f64, JudgedExplanation)) -> f64| part.iter().map(value).sum::<f64>();
    let total = sum(&|(weight, _)| *weight);
    let right = sum(&|(weight, stated)| weight * f64::from(stated.right)) / total;
    let effective = total * total / sum(&|(weight, _)| weight * weight);
    Bin {
        between: [part[0].1.probability, part[part.len() - 1].1.probability],
        explanations: part.len(),
        stated: sum(&|(weight, stated)| weight * stated.probability) / total,
        right,
        band: wilson(right * effective, effective, 1.0 - (1.0 - CONFIDENCE) / of as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::{Shape, draws};
    use crate::report::parse;
    use serde_json::json;

    fn report(explanations: &serde_json::Value) -> Report {
        parse(json!({"verdict": "nothing-missing", "explanations": explanations}).to_string().as_bytes())
            .unwrap()
    }

    fn stated(probability: f64, right: bool) -> JudgedExplanation {
        JudgedExplanation { probability, marginal: Some(0.5), right }
    }

    #[test]
    fn a_log_loss_is_of_what_is_right_by_each_rule() {
        let report = [stated(0.1, true), stated(0.7, false), stated(0.2, true)];
        let loss =
            |stated: &[JudgedExplanation]| Reliability::of(&[(Kind::Single, stated)]).log_loss.unwrap();
        assert!((loss(&report) + 0.3_f64.ln()).abs() < 1e-12);
        assert!(loss(&by_marginal(&report[..2]).unwrap()) - 2.0_f64.ln() < 1e-12);
        assert!(loss(&[stated(0.0, true), stated(1.0, false)]) < 14.0);
        let without = JudgedExplanation { marginal: None, ..report[0] };
        assert!(by_marginal(&[report[1], without]).is_none() && by_marginal(&[]).is_none());
    }

    #[test]
    fn an_explanation_is_right_when_each_effect_stands_for_a_hidden_one() {
        let all = draws(1, &Shape::SMALL);
        let pair = all.iter().find(|draw| draw.kind == Kind::Pair).unwrap();
        let effect = |hidden: &Hidden| {
            let place = hidden.place.to_string();
            let (axis, element) =
                place.split_once('.').map_or((&*place, None), |(axis, element)| (axis, Some(element)));
            json!({"effect": hidden.name, "where": {"axis": axis, "element": element}})
        };
        let [one, other] = [&pair.recipe.hidden[0], &pair.recipe.hidden[1]].map(effect);
        let stated = |draw: &Draw, left_out| {
            let explanations = json!([
                {"kind": "nothing", "sets": [], "probability": 0.1},
                {"kind": "effects", "sets": [[one.clone()]], "probability": 0.2},
                {"kind": "effects", "sets": [[one.clone(), one.clone()], [other.clone(), one.clone()]], "probability": 0.3},
                {"kind": "none-of-these", "sets": [], "probability": 0.4}
            ]);
            judge(draw, &[], left_out, &report(&explanations))
                .iter()
                .map(|stated| stated.right)
                .collect::<Vec<_>>()
        };
        assert_eq!(stated(pair, false), [false, false, true, false]);
        assert_eq!(stated(pair, true), [false, false, false, true]);
        let null = all.iter().find(|draw| draw.kind == Kind::Null && draw.recipe.wrong_parameters.is_empty());
        assert_eq!(stated(null.unwrap(), false), [true, false, false, false]);
        // Nothing of what was said is so.
        let parameter = all.iter().find(|draw| draw.kind == Kind::Parameter).unwrap();
        assert_eq!(stated(parameter, false), [false, false, false, true]);
    }

    #[test]
    fn probabilities_that_keep_their_promise_have_no_error_and_others_have() {
        // 80 reports: of what is said at 75 %, three quarters are right.
        let of = |right: usize| -> Vec<Vec<JudgedExplanation>> {
            (0..80)
                .map(|at| {
                    let first = at % 4 < right;
                    vec![stated(0.75, first), stated(0.25, !first)]
                })
                .collect()
        };
        let reliability = |reports: &[Vec<JudgedExplanation>]| {
            Reliability::of(&reports.iter().map(|stated| (Kind::Single, &stated[..])).collect::<Vec<_>>())
        };
        let good = reliability(&of(3));
        assert!(good.calibration_error < 1e-12 && good.bins.len() == 2, "{good:?}");
        assert!(
            good.bins
                .iter()
                .all(|bin| bin.explanations == 80 && bin.band[0] < bin.right && bin.right < bin.band[1])
        );
        assert_eq!(good.first_right, [60, 80]);
        assert_eq!(good.shown_error(), Some(good.calibration_error));
        let overconfident = reliability(&of(1));
        assert!((overconfident.calibration_error - 0.5).abs() < 1e-12, "{overconfident:?}");
        // A bin that would hold too few joins its neighbour.
        let few = reliability(&of(3)[..20]);
        assert_eq!((few.bins.len(), few.shown_error()), (1, None));
    }

    #[test]
    fn no_calibration_error_is_shown_where_no_bin_is_high() {
        // 64 and 64 events below one half, in two bins: their means say nothing of what is said at 90 %.
        let report = [stated(0.45, true), stated(0.45, false), stated(0.05, false), stated(0.05, false)];
        let low = Reliability::of(&[(Kind::Single, &report[..]); 32]);
        assert_eq!((low.bins.len(), low.shown_error()), (2, None));
    }

    #[test]
    fn explanations_that_are_right_together_are_one_event() {
        let background = [stated(0.3, true), stated(0.1, false), stated(0.6, true)];
        let events: Vec<JudgedExplanation> = events(&background).collect();
        assert_eq!(events.len(), 2);
        assert!(!events[0].right && events[1].right && (events[1].probability - 0.9).abs() < 1e-12);
    }

    #[test]
    fn a_third_of_the_weight_is_of_records_with_nothing_hidden() {
        let [right, wrong] = [true, false].map(|right| vec![stated(0.5, right)]);
        let mut reports: Vec<(Kind, &[JudgedExplanation])> = vec![(Kind::Null, &right); 90];
        reports.extend(vec![(Kind::Single, &wrong[..]); 10]);
        let bins = Reliability::of(&reports).bins;
        assert!(bins.len() == 1 && (bins[0].right - 1.0 / 3.0).abs() < 1e-12, "{bins:?}");
    }
}
