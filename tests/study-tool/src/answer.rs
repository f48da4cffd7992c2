//! What a campaign collects of a draw: the keys of its answer.
//!
//! ```text
//! run, leave-out   kind, axis, hidden, where, over_limit, called, wall_s, memory_mib
//!   run            right, where_right, alone, closed, white
//!   leave-out      verdict, no_wrong_name, balance_right, variable_right, closed
//! resolve          outcome, experiment
//! ```
//! Truth values are 0 or 1; keys that do not apply to a draw are missing. The rates with their intervals, and what counts as
//! right, are in [`super::score`]: a campaign only shows its progress and where the program fails.

use crate::draws::Kind;
use crate::resolve::{self, ProposalState};
use crate::score::Case;
use serde_json::{Map, Value, json};

/// The answer for a draw that the program has run on: a JSON object with the keys of `run` or `leave-out`.
pub fn of_case(case: &Case) -> Value {
    let judgement = &case.judgement;
    let hidden = &judgement.hidden;
    let names =
        |reported: Vec<String>| if reported.is_empty() { "nothing".to_owned() } else { reported.join("+") };
    let mut answer = Map::new();
    let mut tell = |name: &str, value: Value| {
        answer.insert(name.to_owned(), value);
    };
    tell("kind", json!(case.kind));
    tell("axis", case.recipe["axis"].clone());
    tell("hidden", json!(names(hidden.iter().map(|judged| judged.effect.to_owned()).collect())));
    tell("where", json!(names(hidden.iter().map(|judged| judged.place.to_string()).collect())));
    tell("over_limit", json!(case.over_limit.iter().flatten().copied().reduce(f64::min)));
    tell("called", json!(judgement.called));
    tell("closed", json!(judgement.claimed_joint_ratio));
    tell("wall_s", json!(case.wall_s));
    tell("memory_mib", json!(case.memory_kib as f64 / 1024.0));
    if let Some(left) = &case.left_out {
        tell("verdict", json!(left.verdict));
        tell("no_wrong_name", json!(left.no_wrong_name));
        tell("balance_right", json!(left.balance_right));
        tell("variable_right", json!(left.variable_right));
        return Value::Object(answer);
    }
    let right = match case.kind {
        Kind::Null => !judgement.false_alarm && judgement.error.is_none(),
        Kind::Parameter => judgement.parameter_right,
        Kind::Single | Kind::Pair | Kind::Triple => hidden.iter().all(|judged| judged.right),
    };
    tell("right", json!(right));
    tell("white", json!(judgement.claimed_white));
    if !hidden.is_empty() {
        tell("where_right", json!(hidden.iter().all(|judged| judged.where_right)));
    }
    if case.kind == Kind::Single {
        tell("alone", json!(judgement.alone));
    }
    Value::Object(answer)
}

/// The answer for a draw of `resolve`: a JSON object. `outcome` is that of a measured experiment.
pub fn of_proposal(found: &ProposalState, outcome: Option<resolve::Outcome>) -> Value {
    match found {
        ProposalState::NotOpen => json!({"outcome": "not-open"}),
        ProposalState::NothingProposed => json!({"outcome": "nothing-proposed"}),
        ProposalState::Measured(resolution) => {
            json!({"outcome": outcome, "experiment": resolution.experiment})
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::{scored, scored_without};

    #[test]
    fn a_program_that_tells_the_truth_is_right_everywhere() {
        let cases = scored("oracle").cases;
        let answers: Vec<_> = cases.iter().map(of_case).collect();
        assert!(answers.iter().all(|answer| answer["right"] == true), "{answers:?}");
        let single = &answers[0];
        assert_eq!((&single["kind"], &single["called"]), (&json!("single"), &single["hidden"]));
        assert_eq!((&single["where_right"], &single["alone"]), (&json!(true), &json!(true)));
        let null = answers.iter().find(|answer| answer["kind"] == "null").unwrap();
        assert_eq!((&null["hidden"], &null["called"]), (&json!("nothing"), &json!("nothing")));
        assert!(null.get("where_right").is_none());
        let pair = answers.iter().find(|answer| answer["kind"] == "pair").unwrap();
        assert_eq!(pair["hidden"].as_str().unwrap().split('+').count(), 2);
    }

    #[test]
    fn without_its_effect_a_case_is_judged_by_name_and_balance() {
        let answer = of_case(&scored_without("humble").cases[0]);
        assert_eq!((&answer["no_wrong_name"], &answer["balance_right"]), (&json!(true), &json!(true)));
        assert!(answer.get("right").is_none());
    }
}
