//! A suspect beside the model alone: its decision in words, gains and numbers.

use super::{ParameterEstimate, SuspectJudgement, place, significant};
use crate::bounds;
use crate::estimator::Outcome;
use crate::fit::Fitting;
use crate::judge::Evaluation;
use crate::select::SearchResult;

pub(super) fn judgement(
    fitting: &Fitting<'_>,
    evaluation: &Evaluation,
    found: &SearchResult<'_>,
) -> SuspectJudgement {
    let model = fitting.model;
    let suspect = &model.suspects[evaluation.suspect];
    let accepted =
        found.accepted.iter().position(|accepted| accepted.evaluation.suspect == evaluation.suspect);
    let last = found.last.iter().find(|last| last.suspect == evaluation.suspect);
    let mut decision = match (accepted, last) {
        (Some(round), _) => format!("taken, number {}", round + 1),
        _ if found.accepted.iter().any(|accepted| accepted.alternatives.contains(&evaluation.suspect)) => {
            "explains the records as well as what was taken".to_owned()
        }
        _ if found.accepted.first().is_some_and(|accepted| accepted.near.contains(&evaluation.suspect)) => {
            format!("cannot be told from what was taken, though it fails: {}", evaluation.gate)
        }
        (None, Some(last)) if last.passes => "passes, but another was better".to_owned(),
        (None, Some(last)) => format!("rejected: {}", last.gate),
        (None, None) => "rejected beside what was taken".to_owned(),
    };
    let numbers = evaluation.values_si.iter().map(|(index, value)| {
        let parameter = &model.parameters[*index];
        ParameterEstimate {
            name: parameter.name.clone(),
            suspect: Some(suspect.name.clone()),
            unit: parameter.unit.text.clone(),
            value: value / parameter.unit.factor,
            standard_error: None,
            baseline: None,
            is_at_bound: bounds::is_at_bound(*value, parameter.range_si),
            is_of_one_sign: false,
            expected: None,
        }
    });
    let numbers: Vec<ParameterEstimate> = numbers.collect();
    let at_end = numbers.iter().find(|number| number.is_at_bound);
    match (evaluation.convergence.outcome, at_end) {
        (Outcome::Bound, Some(number)) => {
            let (name, value, unit) = (&number.name, significant(number.value), &number.unit);
            decision += &format!("; its {name} ended at the end of the range, {value} {unit}");
        }
        (Outcome::Bound, None) => {
            decision += "; a number of the model ended at the end of its range beside it";
        }
        _ => decision += &evaluation.convergence.doubt().map_or(String::new(), |doubt| format!("; {doubt}")),
    }
    SuspectJudgement {
        suspect: suspect.name.clone(),
        place: place(model, evaluation.suspect),
        is_decoy: suspect.is_decoy,
        probability: evaluation.probability,
        gain: evaluation.gain,
        penalty: evaluation.penalty,
        share: evaluation.share,
        fold_t: evaluation.t,
        decision,
        numbers,
    }
}
