//! Hand-made reports: each rule of the judge, both ways.

use super::*;
use crate::draws::{Shape, draws};
use crate::report::parse;

pub(crate) const TAKEN: Execution = Execution { ended: ProgramEnd::Exited(0), wall_s: 1.0, memory_kib: 1024 };

/// The first draw of a kind that hides these effects.
pub(crate) fn draw(kind: Kind, effects: &[&str]) -> Draw {
    let mut draw = draws(1, &Shape::SMALL).into_iter().find(|draw| draw.kind == kind).unwrap();
    draw.recipe.hidden = effects
        .iter()
        .map(|name| {
            let sheet = plant::effects::sheet(name).unwrap();
            let numbers = sheet.keys.iter().map(|key| key.default.unwrap_or(key.drawn[1])).collect();
            Hidden { name: sheet.name, place: sheet.place.places()[0], numbers }
        })
        .collect();
    draw
}

fn twin(effect: &str, place: &str, cosine: f64) -> Member {
    Member { effect: effect.to_owned(), place: place.to_owned(), cosine }
}

/// `effect@axis.element[alternative,…]` as an entry of a report.
fn entry(text: &str) -> String {
    let (name, alternatives) = text.split_once('[').unwrap_or((text, ""));
    let (effect, place) = name.split_once('@').unwrap_or((name, "drive"));
    let (axis, element) = place
        .split_once('.')
        .map_or((place, "null".to_owned()), |(axis, element)| (axis, format!("\"{element}\"")));
    let alternatives: Vec<_> =
        alternatives.trim_end_matches(']').split(',').filter(|name| !name.is_empty()).map(entry).collect();
    format!(
        r#"{{"effect": "{effect}", "where": {{"axis": "{axis}", "element": {element}}}, "alternatives": [{}]}}"#,
        alternatives.join(",")
    )
}

pub(crate) fn reported(verdict: &str, names: &[&str]) -> Result<Report, String> {
    let names: Vec<_> = names.iter().map(|name| entry(name)).collect();
    parse(format!(r#"{{"verdict": "{verdict}", "named": [{}]}}"#, names.join(",")).as_bytes())
}

fn single(class: &[Member], verdict: &str, names: &[&str]) -> Judgement {
    judge(&draw(Kind::Single, &["inclination"]), &[class.to_vec()], &TAKEN, &reported(verdict, names))
}

#[test]
fn the_effect_itself_at_its_place_is_right_alone() {
    let judged = single(&[], "named", &["inclination@drive"]);
    assert!(judged.hidden[0].right && judged.hidden[0].where_right && judged.top && judged.alone);
    assert_eq!((judged.called.as_str(), judged.too_many), ("inclination", 0));
    let elsewhere = single(&[], "named", &["inclination@load"]);
    assert!(elsewhere.hidden[0].right && !elsewhere.hidden[0].where_right);
}

#[test]
fn what_is_outside_the_catalogue_resembles_the_hidden_effect_or_another() {
    let class = [twin("friction-asymmetry", "drive", 0.97)];
    let of = |verdict: &str, nearest: &str| {
        let text = format!(r#"{{"verdict": "{verdict}", "nearest": {}}}"#, entry(nearest));
        judge(&draw(Kind::Single, &["inclination"]), &[class.to_vec()], &TAKEN, &parse(text.as_bytes()))
    };
    assert!(
        of("outside-catalogue", "inclination").resembled
            && of("outside-catalogue", "friction-asymmetry").resembled
    );
    assert!(
        !of("outside-catalogue", "valve-offset").resembled && !of("nothing-missing", "inclination").resembled
    );
    assert!(!of("outside-catalogue", "inclination").hidden[0].right, "no name");
}

#[test]
fn a_twin_is_right_and_a_stranger_is_not() {
    let class = [twin("friction-asymmetry", "drive", 0.97), twin("valve-offset", "drive", 0.94)];
    let twin = single(&class, "named", &["friction-asymmetry"]);
    assert!(twin.hidden[0].right && twin.hidden[0].where_right && !twin.top && !twin.alone);
    assert_eq!(twin.hidden[0].class_size, 2);
    let stranger = single(&class, "named", &["valve-offset"]);
    assert!(!stranger.hidden[0].right && !stranger.top);
    assert_eq!(stranger.too_many, 1);
}

#[test]
fn the_same_effect_at_a_place_that_looks_alike_is_at_the_right_place() {
    let judged = judge(
        &draw(Kind::Single, &["pressure-sensor-offset"]),
        &[vec![twin("pressure-sensor-offset", "drive.b", 0.99)]],
        &TAKEN,
        &reported("named", &["pressure-sensor-offset@drive.b"]),
    );
    assert!(judged.hidden[0].right && judged.hidden[0].where_right);
    assert_eq!(judged.hidden[0].class_size, 1);
}

#[test]
fn a_parameter_that_looks_alike_is_not_in_the_class() {
    let judged = single(&[twin("parameter:mass", "", 0.99)], "named", &["inclination"]);
    assert_eq!(judged.hidden[0].class_size, 1);
}

#[test]
fn an_ambiguous_verdict_is_right_only_where_the_class_has_twins_and_at_most_two_names_lie_beyond() {
    let class = [twin("friction-asymmetry", "drive", 0.97)];
    for (names, right) in [
        ("inclination[friction-asymmetry]", true),
        ("friction-asymmetry[valve-offset]", true),
        ("valve-offset[dead-volume,inclination]", true),
        ("inclination[valve-offset,dead-volume]", true),
        ("inclination[valve-offset,dead-volume,heat-exchange]", false),
        ("valve-offset[dead-volume]", false),
    ] {
        let judged = single(&class, "ambiguous", &[names]);
        assert_eq!(judged.hidden[0].right, right, "{names}");
        assert_eq!(judged.called, "ambiguous");
        assert!(!judged.alone);
        // Alone in its class there was nothing to be unsure of.
        assert!(!single(&[], "ambiguous", &[names]).hidden[0].right, "{names}");
    }
    assert!(!single(&[], "ambiguous", &["inclination"]).hidden[0].right);
}

#[test]
fn whoever_names_everything_has_named_nothing() {
    let four = ["inclination", "valve-offset", "dead-volume", "heat-exchange"];
    assert!(single(&[], "named", &four[..3]).hidden[0].right);
    let judged = single(&[], "named", &four);
    assert!(!judged.hidden[0].right);
    assert_eq!(judged.too_many, 4);
}

#[test]
fn of_two_effects_each_name_stands_for_one() {
    let pair = draw(Kind::Pair, &["inclination", "friction-asymmetry"]);
    let both_alike =
        [vec![twin("friction-asymmetry", "drive", 0.97)], vec![twin("inclination", "drive", 0.97)]];
    let judged = |names: &[&str]| judge(&pair, &both_alike, &TAKEN, &reported("named", names));
    let right = |judged: &Judgement| judged.hidden.iter().filter(|hidden| hidden.right).count();
    assert_eq!(right(&judged(&["inclination", "friction-asymmetry"])), 2);
    // One name cannot stand for both, whichever it is.
    assert_eq!(right(&judged(&["inclination"])), 1);
    let third = judged(&["valve-offset", "inclination", "friction-asymmetry"]);
    assert_eq!((right(&third), third.too_many), (2, 1));
    // The first name fits both; the second only one of them: an assignment for both exists.
    let one_way = [vec![twin("valve-offset", "drive", 0.99)], vec![]];
    let judged = judge(&pair, &one_way, &TAKEN, &reported("named", &["friction-asymmetry", "valve-offset"]));
    assert_eq!(right(&judged), 2);
}

#[test]
fn nothing_hidden_and_something_named_is_a_false_alarm() {
    let null = draw(Kind::Null, &[]);
    let alarm = |report: Result<Report, String>| judge(&null, &[], &TAKEN, &report).false_alarm;
    assert!(alarm(reported("named", &["inclination"])));
    assert!(alarm(reported("ambiguous", &["inclination[valve-offset]"])));
    assert!(alarm(reported("outside-catalogue", &[])));
    assert!(!alarm(reported("nothing-missing", &[])));
    assert!(!alarm(parse(
        br#"{"verdict": "parameters-only", "parameters": [{"name": "parameter:mass",
        "value": 5.1, "unit": "kg", "standard_error": 0.1}]}"#
    )));
}

#[test]
fn a_wrong_parameter_is_right_when_it_is_reported_and_no_effect_is_named() {
    let mut case = draw(Kind::Parameter, &[]);
    case.recipe.wrong_parameters = vec![("parameter:mass".to_owned(), 1.1)];
    let report = |verdict: &str, name: &str, named: &str| {
        parse(
            format!(
                r#"{{"verdict": "{verdict}", "named": [{named}],
                "parameters": [{{"name": "{name}", "value": 5.5, "unit": "kg", "standard_error": 0.1}}]}}"#
            )
            .as_bytes(),
        )
    };
    let right = |report| judge(&case, &[], &TAKEN, &report).parameter_right;
    assert!(right(report("parameters-only", "parameter:mass", "")));
    assert!(!right(report("parameters-only", "parameter:kv-scale", "")));
    assert!(!right(report("named", "parameter:mass", &entry("inclination"))));
    assert!(!right(reported("nothing-missing", &[])));
}

#[test]
fn numbers_are_compared_in_their_unit_and_with_two_standard_errors() {
    let mut case = draw(Kind::Single, &["inclination"]);
    case.recipe.hidden[0].numbers = vec![-20.0];
    let numbers = |value: f64, unit: &str, error: &str| {
        let text = entry("inclination").replace(
            "\"alternatives\"",
            &format!(
                r#""parameters": [{{"name": "force_n", "value": {value}, "unit": "{unit}",
                "standard_error": {error}}}], "alternatives""#
            ),
        );
        let report = parse(format!(r#"{{"verdict": "named", "named": [{text}]}}"#).as_bytes());
        judge(&case, &[], &TAKEN, &report).hidden[0].numbers.clone()
    };
    let reported = &numbers(-19.0, "N", "0.5")[0];
    assert!(reported.amplitude && reported.covered == Some(true));
    assert!((reported.off_ratio - 0.05).abs() < 1e-12 && reported.error_ratio == Some(0.025));
    assert_eq!(numbers(-18.9, "N", "0.5")[0].covered, Some(false));
    assert_eq!(numbers(20.0, "N", "0.5")[0].covered, Some(false));
    assert_eq!(numbers(-20.0, "N", "null")[0].covered, None);
    assert!(numbers(-20.0, "kN", "0.5").is_empty());
}

#[test]
fn what_is_no_report_is_an_error_with_its_reason() {
    let case = draw(Kind::Single, &["inclination"]);
    let good = || reported("named", &["inclination"]);
    for (ended, report, reason) in [
        (ProgramEnd::TimedOut, good(), "time limit"),
        (ProgramEnd::Signalled(11), good(), "signal 11"),
        (ProgramEnd::NotStarted, good(), "not be started"),
        (ProgramEnd::Exited(101), Err("wrote no report.json".to_owned()), "exit code 101"),
        (ProgramEnd::Exited(0), parse(b"{\"verdict\": NaN}"), "report.json"),
        (ProgramEnd::Exited(0), reported("named", &["phlogiston"]), "phlogiston"),
        (ProgramEnd::Exited(0), reported("bad-data", &[]), "bad-data"),
    ] {
        let judged = judge(&case, &[], &Execution { ended, ..TAKEN }, &report);
        assert_eq!(judged.called, "error");
        assert!(judged.error.as_ref().is_some_and(|error| error.contains(reason)), "{reason}: {judged:?}");
        assert!(!judged.hidden[0].right && !judged.top);
    }
}
