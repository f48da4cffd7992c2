//! The page of each verdict is well-formed, says what the report says, and asks for nothing.

use super::samples::{VERDICTS, at, pictures, sample};
use super::*;
use crate::report::{HeldOutFinding, NamedEffect, SignalMisfit, Verdict};
use plant::effects::SHEETS;

fn parsed(page: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(page, options).unwrap_or_else(|error| panic!("{error}"))
}

fn text(page: &str) -> String {
    let document = parsed(page);
    let body = document.descendants().find(|node| node.has_tag_name("body")).expect("there is a body");
    let words: Vec<_> =
        body.descendants().filter(|node| node.is_text()).filter_map(|node| node.text()).collect();
    words.concat().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn rendered(verdict: Verdict) -> String {
    let (report, pictures) = sample(verdict);
    page(&report, &pictures)
}

#[test]
fn the_page_of_each_verdict_is_well_formed_self_contained_and_small() {
    for verdict in VERDICTS {
        let rendered = rendered(verdict);
        // For who wants to look at them: PAGES=folder cargo test -p discrepancy page::
        if let Some(folder) = std::env::var_os("PAGES") {
            std::fs::write(std::path::Path::new(&folder).join(format!("{verdict:?}.html")), &rendered)
                .unwrap();
        }
        let document = parsed(&rendered);
        let mut identifiers: Vec<_> =
            document.descendants().filter_map(|node| node.attribute("id")).collect();
        let count = identifiers.len();
        identifiers.sort_unstable();
        identifiers.dedup();
        assert_eq!(identifiers.len(), count, "{verdict:?}: an identifier is there twice");
        for node in document.descendants() {
            assert!(!node.has_tag_name("script") && node.attribute("src").is_none(), "{verdict:?}");
            if let Some(link) = node.attribute("href") {
                let target = link.strip_prefix('#').expect("links stay on the page");
                assert!(identifiers.binary_search(&target).is_ok(), "{verdict:?}: {link}");
            }
            assert!(!node.text().is_some_and(|text| text.contains("NaN")), "{verdict:?}");
            for part in ["x", "y", "width", "d", "x1"] {
                let value = node.attribute(part).unwrap_or_default();
                assert!(!value.contains("NaN") && !value.contains("inf"), "{verdict:?}: {part}={value}");
            }
        }
        assert!(rendered.len() < 600_000, "{verdict:?}: {} bytes", rendered.len());
        assert_eq!(rendered, self::rendered(verdict), "the same bytes each time");
    }
}

#[test]
fn the_test_of_a_name_stands_beside_the_explanations() {
    let seen = text(&rendered(Verdict::Named));
    let said = "piston-leakage (drive) gains 1612, and 1480 without its 3 best windows, where a name needs more than 0. Of \
                5 simulated records with parameters alone 0 reach 1480, and the best gains -3 (p below 0.001). Of 5 \
                simulated records with inclination (drive) instead 0 put it as far ahead (p 0.002).";
    assert!(seen.contains(said), "{seen}");
    assert!(!text(&rendered(Verdict::NothingMissing)).contains("simulated records"));
}

#[test]
fn the_verdict_stands_first_with_names_numbers_and_errors() {
    let page = rendered(Verdict::Named);
    let seen = text(&page);
    let all_candidates = format!("All {} candidates", SHEETS.len());
    let order = [
        "\u{2713} Air leaks past",
        "piston-leakage at the drive axis: leakage 2.513 \u{b1} 0.041 Nl/min; it explains 97 % of the log misfit there",
        "On test.csv, a held-out record, 92 % to 99.6 % of the gap to the noise is closed",
        "where they differ most",
        "What is missing",
        "After: with",
        "The gap, before and after",
        "Which balance",
        &all_candidates,
        "Not excited",
        "Detection limits",
        "The records",
    ];
    let mut from = seen.find("What the simulation lacks").expect("the heading");
    for part in order {
        let found = seen[from..]
            .find(part)
            .unwrap_or_else(|| panic!("{part:?} is not behind the one before: {seen}"));
        from += found;
    }
}

#[test]
fn a_held_out_record_that_gets_worse_and_a_model_that_leaves_more_stand_in_the_headline() {
    let headline = |report: &Report| text(&page(report, &Pictures::default()));
    let (mut report, _) = sample(Verdict::Named);
    report.adequate = Some(false);
    assert!(headline(&report).starts_with("Part of what the simulation lacks"));
    let verification = report.verification.as_mut().unwrap();
    verification.confirmed = false;
    assert!(headline(&report).starts_with("The held-out record does not confirm what was found"));
    report.verification.as_mut().unwrap().worse = true;
    let signal = report.misfit.values_mut().next().unwrap();
    signal.after = 1.17 * signal.before;
    let seen = headline(&report);
    assert!(seen.starts_with("What was found makes the held-out record worse"), "{seen}");
    assert!(seen.contains("gets worse with it: ") && seen.contains(" by 17 %"), "{seen}");
    assert!(!seen.contains("of the gap to the noise is closed"), "{seen}");
}

#[test]
fn a_held_out_record_that_shows_more_than_the_model_stands_in_the_headline() {
    for (verdict, headline) in [
        (Verdict::Named, "The held-out record shows that more is missing"),
        (Verdict::NothingMissing, "The held-out record shows that something is missing"),
    ] {
        let (mut report, pictures) = sample(verdict);
        let verification = report.verification.as_mut().unwrap();
        (verification.chi2_after, verification.more_missing) = (61.8, true);
        let seen = text(&page(&report, &pictures));
        assert!(seen.starts_with(headline), "{seen}");
        assert!(seen.contains("per degree of freedom 61.8, of noise at most 1.09"), "{seen}");
    }
}

#[test]
fn of_something_outside_the_catalogue_the_rig_file_is_judged_until_a_law_was_added() {
    let (mut report, _) = sample(Verdict::OutsideCatalogue);
    report.outside.as_mut().unwrap().added = false;
    let verification = report.verification.as_mut().unwrap();
    verification.confirmed = false;
    assert_eq!(report.held_out_finding(), None, "the rig file leaves 57 times the noise");
    let headline = |report: &Report| text(&page(report, &Pictures::default()));
    assert!(headline(&report).starts_with("Something is missing that the catalogue does not have"));
    report.outside.as_mut().unwrap().added = true;
    assert_eq!(
        report.held_out_finding(),
        Some(HeldOutFinding::NotConfirmed),
        "a law is judged by what it improves"
    );
    report.outside.as_mut().unwrap().added = false;
    report.verification.as_mut().unwrap().chi2_before = 1.05;
    assert_eq!(report.held_out_finding(), Some(HeldOutFinding::NotConfirmed), "noise alone");
    assert!(headline(&report).starts_with("The held-out record does not confirm what was found outside"));
    report.verification.as_mut().unwrap().worse = true;
    let seen = headline(&report);
    let said = "Something is missing that the catalogue does not have, and what was fitted";
    assert!(seen.starts_with(said), "{seen}");
}

#[test]
fn a_name_that_is_not_the_most_probable_explanation_says_so() {
    let (mut report, pictures) = sample(Verdict::Named);
    assert!(text(&page(&report, &pictures)).contains("Probability of this explanation: 97 %"));
    assert!(report.more_probable().is_none());
    report.explanations[1].probability = 0.6;
    report.explanations[2].probability = 0.37;
    let rendered = page(&report, &pictures);
    let seen = text(&rendered);
    assert!(
        seen.contains("Named is piston-leakage at the drive axis") && seen.contains("(37 %), the best model"),
        "{seen}"
    );
    assert!(seen.contains("although parameters alone (60 %) is more probable"), "{seen}");
    assert!(seen.starts_with("What the simulation lacks") && rendered.contains("<p>? "), "an open question");
}

#[test]
fn what_was_compared_stands_with_what_speaks_against_it() {
    let seen = text(&rendered(Verdict::Named));
    // exp(3.1), exp(-0.01).
    for part in [
        "What else it could be",
        "Add to the model: piston-leakage at the drive axis, or valve-null-leakage at the drive axis (97 %).",
        "none of these 3.0 % – – – – 3.0 %",
        "the rig file as it is 0.0 % 22.2 4200 0.400 – 0.0 %",
        "piston-leakage at the drive axis, or valve-null-leakage at the drive axis 97 % 0.990 0 0.400 2.0 % 97 %",
    ] {
        assert!(seen.replace(" ", "").contains(&part.replace(" ", "")), "{part}: {seen}");
    }
}

#[test]
fn small_effects_stand_apart_from_what_is_missing() {
    let seen = text(&rendered(Verdict::Named));
    let named = seen.find("piston-leakage at the drive axis: leakage").expect("what is missing");
    let small = seen.find("smaller: valve-offset at the load axis: offset 0.21").expect("what is small");
    assert!(named < small, "{seen}");
    assert!(seen.contains("the extended rig file has them"), "{seen}");
}

#[test]
fn where_only_small_effects_were_found_the_rig_file_is_not_called_right() {
    let (mut report, pictures) = sample(Verdict::NothingMissing);
    report.small = sample(Verdict::Named).0.small;
    let seen = text(&page(&report, &pictures));
    assert!(seen.contains("Nothing is missing that is large enough to be named"), "{seen}");
    assert!(seen.contains("smaller: valve-offset at the load axis"), "{seen}");
    for wrong in ["The rig file explains the records", "it stays within it"] {
        assert!(!seen.contains(wrong), "{wrong}");
    }
}

#[test]
fn what_is_ambiguous_stands_together_with_the_experiment_that_tells() {
    let seen = text(&rendered(Verdict::Ambiguous));
    for part in [
        "inclination",
        "or friction-asymmetry at the drive axis: asymmetry 47.1 \u{b1} 1.2 %; it explains 94 % of the log misfit there",
        "To run next: next.toml",
        "63",
        "Tilting the rig",
    ] {
        assert!(seen.contains(part), "{part}");
    }
}

#[test]
fn nothing_missing_is_said_with_its_limits_and_has_no_picture_after() {
    let page = rendered(Verdict::NothingMissing);
    let seen = text(&page);
    assert!(seen.contains("\u{2713} Nothing is missing above the detection limits"));
    assert!(seen.contains("would have shown from"));
    assert!(!page.contains("id=\"after\"") && !page.contains("id=\"limits-title\">Detection"));
    assert!(!seen.contains("of the gap to the noise is closed"));
}

#[test]
fn what_is_outside_the_catalogue_has_its_curve_formula_and_significance() {
    let page = rendered(Verdict::OutsideCatalogue);
    let seen = text(&page);
    for part in [
        "drive: force on the piston",
        "14 sin(9 x) + 20 x^2",
        "none of 200",
        "91 %",
        "is added to the model as a table",
        "resembles piston-leakage at the drive axis",
        "it explains 60 % of the log misfit there",
        "it depends on p_b",
    ] {
        assert!(seen.contains(part), "{part}");
    }
    assert!(page.contains("id=\"outside-curve-t\""));
    assert!(page.contains("id=\"outside-surface-t\"") && seen.contains("sign(v) \u{2212}1.00"));
}

#[test]
fn bad_data_shows_its_findings_first_and_no_pictures() {
    let page = rendered(Verdict::BadData);
    let seen = text(&page);
    assert!(seen.contains("\u{2717} train.csv: pressure b does not change"));
    let stuck = seen.find("record again").expect("the fatal finding");
    assert!(stuck < seen.find("windows there are left out").expect("the other one"), "fatal ones first");
    assert!(!page.contains("id=\"disagreement\"") && !page.contains("id=\"after\""));
}

#[test]
fn parameters_are_reported_with_what_the_rig_file_says() {
    let seen = text(&rendered(Verdict::ParametersOnly));
    assert!(seen.contains("parameter:mass: 5.263 \u{b1} 0.041 kg, the rig file says 5.00 kg"), "{seen}");
}

#[test]
fn text_of_the_report_cannot_become_markup_and_strange_numbers_draw_nothing_strange() {
    let (mut report, mut pictures) = sample(Verdict::Named);
    report.summary = "<script>&\u{1}".to_owned();
    report.named.push(NamedEffect {
        effect: "<b>".to_owned(),
        place: at("\"", Some("<")),
        parameters: Vec::new(),
        share_explained: f64::NAN,
        amplitude_variation: Some(f64::NAN),
        alternatives: Vec::new(),
    });
    let misfit = SignalMisfit { before: f64::NAN, after: f64::INFINITY, floor: 0.0, closed: Some(f64::NAN) };
    report.misfit.insert("a'<_x".to_owned(), misfit);
    report.candidates[0].score = f64::NAN;
    report.candidates[1].score = f64::INFINITY;
    report.candidates[2].score = 0.0;
    let location = report.location.as_mut().expect("a sample has one");
    location.maps[0].value[3] = f64::NAN;
    location.maps[0].band.truncate(5);
    location.series[0].value.clear();
    pictures.traces[0].measured[100] = f64::NAN;
    pictures.traces[1].before.truncate(10);
    pictures.traces[2].noise = 0.0;
    pictures.traces[3].time_s.truncate(1);
    let page = page(&report, &pictures);
    let document = parsed(&page);
    for node in document.descendants().filter(|node| node.is_element()) {
        for attribute in node.attributes().filter(|attribute| attribute.name() != "class") {
            let value = attribute.value();
            assert!(!value.contains("NaN") && !value.contains("inf"), "{} {value}", attribute.name());
        }
    }
    assert!(!text(&page).contains("NaN"));
}

#[test]
fn a_report_without_anything_else_still_has_a_page() {
    let (mut report, _) = sample(Verdict::Named);
    report.misfit.clear();
    report.verification = None;
    report.candidates.clear();
    report.location = None;
    report.checks.clear();
    report.not_excited.clear();
    report.detection_limits.clear();
    let page = page(&report, &Pictures::default());
    assert!(text(&page).contains("piston-leakage"));
    assert!(!page.contains("id=\"location\"") && !page.contains("id=\"disagreement\""));
}

#[test]
fn a_long_record_makes_no_larger_page() {
    let (report, _) = sample(Verdict::Named);
    let mut long = pictures(1.0);
    for trace in &mut long.traces {
        let count = trace.time_s.len();
        trace.time_s.extend((0..28_000).map(|ms| 20.0 + f64::from(ms) * 1e-3));
        for values in [
            &mut trace.measured,
            &mut trace.before,
            &mut trace.after,
            &mut trace.before_residual,
            &mut trace.after_residual,
        ] {
            values.extend_from_within(0..20_000);
            values.extend_from_within(0..28_000 - 20_000);
            assert_eq!(values.len(), count + 28_000);
        }
    }
    assert!(page(&report, &long).len() < 600_000);
}

/// Names of fields of a JSON value; keys of maps, which follow the records, are left out.
fn fields(value: &serde_json::Value, found: &mut std::collections::BTreeSet<String>) {
    const MAPS: [&str; 4] = ["gap", "free_run_nrmse_percent", "whiteness", "channels"];
    match value {
        serde_json::Value::Object(object) => {
            for (name, inner) in object {
                found.insert(name.clone());
                match inner {
                    serde_json::Value::Object(map) if MAPS.contains(&name.as_str()) => {
                        map.values().for_each(|entry| fields(entry, found));
                    }
                    inner => fields(inner, found),
                }
            }
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| fields(item, found)),
        _ => {}
    }
}

#[test]
fn the_document_names_every_field_and_its_example_has_every_field_of_the_whole() {
    let document = include_str!("../../docs/report.md");
    let mut all = std::collections::BTreeSet::new();
    for verdict in VERDICTS {
        let (report, _) = sample(verdict);
        let value = serde_json::to_value(&report).unwrap();
        fields(&value, &mut all);
        let name = value["verdict"].as_str().unwrap();
        assert!(document.contains(&format!("| `{name}` |")), "{name}");
    }
    assert!(all.len() > 60, "{}", all.len());
    let words: Vec<&str> =
        document.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').collect();
    for name in &all {
        assert!(words.contains(&name.as_str()), "{name} is not in docs/report.md");
    }
    let example = document.split("```json").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let example: serde_json::Value = serde_json::from_str(example).unwrap();
    let whole = serde_json::to_value(sample(Verdict::Named).0).unwrap();
    let keys = |value: &serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&example), keys(&whole));
}
