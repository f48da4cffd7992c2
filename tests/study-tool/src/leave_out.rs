//! Leave one out: what a program reports of an effect that its catalogue lacks.
//!
//! ```text
//! hidden effect + its class in this record ──► PROGRAM close ... --without A --without B ──► report.json
//! outside-expected.json: balances, variables ──────────────────────────────────────────────► right, or not
//! ```
//!
//! An effect is left out at all its places, and with it every effect that is its twin in this record ([`super::classes`]).
//! Where the classes of a draw are not known, only the effect itself is left out. The rules:
//!
//! - *No wrong name*: the report is good and names nothing of the catalogue. A parameter of the baseline is no name.
//! - The *balance* is right when `outside-expected.json` lists it for the effect, on the axis of the effect; an effect on both
//!   axes may show on either.
//! - The *variable* is right when one of the first two is expected. Both come from what the program reports as outside the
//!   catalogue; with another verdict, from what it locates with the values of the rig file.
//! - The gap *still closes* for effects without memory, since a term over measured variables can replace them. Effects have
//!   memory when the plant keeps a state for them from step to step (`plant/src/effects/memory.rs`).
//!
//! Source: `discrepancy/docs/outside-expected.md`.

use crate::classes::DrawClasses;
use crate::draws::{Draw, axis_of};
use crate::report::Report;
use plant::effects::sheet;
use plant::effects::sheet::Place;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

pub mod tables;

pub use tables::Tables;

/// Variables of a report that count, from the first.
const COUNTED_VARIABLES: usize = 2;

/// Balances and variables in which an effect is expected to show.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// Balances without their axis, such as `flow-a`.
    pub(crate) balances: Vec<String>,
    /// Variables, such as `p_a-p_b`.
    pub(crate) variables: Vec<String>,
}

/// Expectations by the name of the effect: `tests/study/outside-expected.json`.
pub type Expectations = BTreeMap<String, Expected>;

/// Judgement of a report without the hidden effect in the catalogue.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LeaveOutJudgement {
    pub(crate) without: Vec<String>,
    /// The verdict of the report, or `error`.
    pub(crate) verdict: &'static str,
    /// Whether the report is good and names nothing.
    pub(crate) no_wrong_name: bool,
    pub(crate) balance: Option<String>,
    /// All reported variables, the strongest first.
    pub(crate) variables: Vec<String>,
    pub(crate) formula: Option<String>,
    pub(crate) balance_right: bool,
    /// Whether one of the first two variables is right.
    pub(crate) variable_right: bool,
    pub(crate) with_memory: bool,
}

/// Names of the effects to leave out for a draw: the hidden ones, and all of their classes.
pub fn left_out(draw: &Draw, classes: Option<&DrawClasses>) -> Vec<String> {
    let hidden = draw.recipe.hidden.iter().map(|hidden| hidden.name.to_owned());
    let members = classes.into_iter().flat_map(|classes| &classes.hidden).flat_map(|class| &class.members);
    let twins = members.filter(|member| member.is_twin()).map(|member| member.effect.clone());
    hidden.chain(twins).collect::<BTreeSet<_>>().into_iter().collect()
}

/// Command-line arguments of a program without these effects.
pub(crate) fn arguments(without: &[String]) -> Vec<String> {
    without.iter().flat_map(|name| ["--without".to_owned(), name.clone()]).collect()
}

/// Judges the report of a program on a draw of one effect; `None` without a good report.
pub(crate) fn judge(
    draw: &Draw,
    without: &[String],
    expectations: &Expectations,
    report: Option<&Report>,
) -> LeaveOutJudgement {
    let hidden = draw.recipe.hidden.first();
    let expected = hidden.and_then(|hidden| expectations.get(hidden.name));
    let outside = report.and_then(|report| report.outside.as_ref());
    let located = report.and_then(|report| report.dependence.as_ref()).filter(|_| outside.is_none());
    let balance =
        outside.map(|outside| &outside.balance).or(located.map(|located| &located.balance)).cloned();
    let of_outside =
        outside.iter().flat_map(|outside| &outside.variables).map(|reported| reported.variable.clone());
    let of_located =
        located.iter().flat_map(|located| &located.variables).map(|reported| reported.variable.clone());
    let variables: Vec<String> = of_outside.chain(of_located).collect();
    let balance_right = |place: Place| Some(is_expected(balance.as_ref()?, place, &expected?.balances));
    let variable_right = expected.is_some_and(|expectation| {
        variables.iter().take(COUNTED_VARIABLES).any(|reported| expectation.variables.contains(reported))
    });
    LeaveOutJudgement {
        without: without.to_vec(),
        verdict: report.map_or("error", |report| report.verdict.name()),
        no_wrong_name: report.is_some_and(|report| report.named.is_empty()),
        formula: outside.and_then(|outside| outside.formula.clone()),
        balance_right: hidden.and_then(|hidden| balance_right(hidden.place)).unwrap_or(false),
        balance,
        variable_right,
        variables,
        with_memory: hidden.and_then(|hidden| sheet(hidden.name)).is_some_and(|sheet| sheet.has_memory),
    }
}

/// Whether a balance such as `drive.flow-a` is an expected one, on the axis of a place.
fn is_expected(balance: &str, place: Place, expected: &[String]) -> bool {
    let (axis, name) = balance.split_once('.').map_or((None, balance), |(axis, name)| (Some(axis), name));
    let on_axis = match (axis, axis_of(place)) {
        (Some(reported), Some(of_place)) => reported == of_place.name(),
        _ => true,
    };
    on_axis && expected.iter().any(|expected_name| expected_name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classes::{HiddenClass, Member};
    use crate::draws::{Kind, Shape, draws};
    use crate::report::parse;
    use plant::effects::SHEETS;
    use record_maker::Hidden;

    const TABLE: &str = include_str!("../../study/outside-expected.json");

    fn expectations() -> Expectations {
        serde_json::from_str(TABLE).unwrap()
    }

    /// A draw of this effect at its first place, or at one of the load.
    fn draw(effect: &str, place: &str) -> Draw {
        let shape = Shape { each: 1, ..Shape::NO_DRAW };
        let sheet = sheet(effect).unwrap();
        let mut draw = draws(1, &shape).into_iter().find(|draw| draw.kind == Kind::Single).unwrap();
        let numbers = sheet.keys.iter().map(|key| key.drawn[1]).collect();
        draw.recipe.hidden =
            vec![Hidden { name: sheet.name, place: sheet.place_named(place).unwrap(), numbers }];
        draw
    }

    fn reported(verdict: &str, balance: &str, variables: &[&str]) -> Report {
        let variables: Vec<_> = variables
            .iter()
            .map(|name| serde_json::json!({"variable": name, "r2": 0.5, "p_value": 0.005}))
            .collect();
        let text = serde_json::json!({"verdict": verdict, "outside": {"balance": balance, "variables": variables,
            "formula": "2 x"}});
        parse(text.to_string().as_bytes()).unwrap()
    }

    #[test]
    fn every_effect_of_the_catalogue_has_an_expectation() {
        let table = expectations();
        assert!(SHEETS.iter().all(|sheet| table.contains_key(sheet.name)) && table.len() == SHEETS.len());
    }

    #[test]
    fn the_class_is_left_out_with_the_effect_and_parameters_are_not() {
        let draw = draw("position-sensor-lag", "drive");
        assert_eq!(left_out(&draw, None), ["position-sensor-lag"]);
        let member = |effect: &str, place: &str, cosine| Member {
            effect: effect.to_owned(),
            place: place.to_owned(),
            cosine,
        };
        let members = vec![
            member("time-skew", "drive.position", 0.999),
            member("time-skew", "drive.a", 0.96),
            member("parameter:mass", "", 0.96),
            member("inclination", "drive", 0.94),
        ];
        let (effect, place) = ("position-sensor-lag".to_owned(), "drive".to_owned());
        let classes = DrawClasses {
            schema_version: 1,
            number: draw.number,
            hidden: vec![HiddenClass { effect, place, strength: 9.0, members, nearest: None }],
        };
        let without = left_out(&draw, Some(&classes));
        assert_eq!(without, ["position-sensor-lag", "time-skew"]);
        assert_eq!(arguments(&without), ["--without", "position-sensor-lag", "--without", "time-skew"]);
    }

    #[test]
    fn balance_and_variable_are_right_by_the_table_alone() {
        let table = expectations();
        let judged = |effect, place, balance, variables: &[&str]| {
            let report = reported("outside-catalogue", balance, variables);
            let judged = judge(&draw(effect, place), &[], &table, Some(&report));
            assert!(judged.no_wrong_name && judged.verdict == "outside-catalogue");
            (judged.balance_right, judged.variable_right)
        };
        let inclination = |balance, variables: &[&str]| judged("inclination", "load", balance, variables);
        assert_eq!(inclination("load.force", &["constant"]), (true, true));
        assert_eq!(inclination("load.force", &["v", "constant"]), (true, true));
        assert_eq!(inclination("load.force", &["v", "x", "constant"]), (true, false));
        assert_eq!(inclination("drive.force", &["constant"]), (false, true));
        assert_eq!(inclination("load.flow-a", &[]), (false, false));
        // What acts on both axes may be seen on either.
        assert_eq!(judged("supply-droop", "supply", "load.flow-b", &["u"]), (true, true));
        assert_eq!(judged("coupling-compliance", "linkage", "linkage", &["F"]), (true, true));
        assert_eq!(judged("force-sensor-gain", "drive", "linkage", &["F"]), (true, true));
    }

    #[test]
    fn a_name_is_wrong_and_so_is_no_report() {
        let text =
            br#"{"verdict": "named", "named": [{"effect": "valve-offset", "where": {"axis": "drive"}}]}"#;
        let (draw, table) = (draw("valve-hysteresis", "drive"), expectations());
        let named = judge(&draw, &[], &table, Some(&parse(text).unwrap()));
        assert!(!named.no_wrong_name && !named.balance_right && !named.variable_right && named.with_memory);
        let error = judge(&draw, &[], &table, None);
        assert!(!error.no_wrong_name && error.verdict == "error");
        let silent = judge(&draw, &[], &table, Some(&parse(br#"{"verdict": "nothing-missing"}"#).unwrap()));
        assert!(silent.no_wrong_name && !silent.balance_right);
    }
}
