//! The report's page: well-formed, complete, alone, and safe against what its texts may hold.
//!
//! Each run leaves the page of a made-up report in the target folder's `tmp/report-page.html`, to be looked at.

use crate::sample;
use latency::model::{Distribution, PercentilesNs, Report};
use latency::page::page;
use roxmltree::{Document, Node, ParsingOptions};
use std::path::Path;

const SECTIONS: [&str; 13] = [
    "figures",
    "ratios",
    "histograms",
    "maxima",
    "worst",
    "findings",
    "arrivals",
    "runs",
    "comparison",
    "bounds",
    "conditions",
    "not-controlled",
    "reading",
];

/// Parses strictly; a page that a browser would mend is not good enough.
fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(html, options).unwrap_or_else(|error| panic!("not well-formed: {error}"))
}

fn text(node: Node<'_, '_>) -> String {
    node.descendants().filter(Node::is_text).filter_map(|node| node.text()).collect()
}

fn find<'a>(document: &'a Document<'a>, identifier: &str) -> Node<'a, 'a> {
    let mut nodes = document.descendants();
    nodes.find(|node| node.attribute("id") == Some(identifier)).unwrap_or_else(|| panic!("no {identifier}"))
}

/// What holds for every page.
fn check(html: &str) {
    assert!(html.starts_with("<!DOCTYPE html>\n"));
    let document = parsed(html);
    let mut sections = document.descendants().filter(|node| node.has_tag_name("section"));
    assert!(
        SECTIONS.iter().all(|wanted| sections.next().and_then(|node| node.attribute("id")) == Some(wanted))
    );
    let mut identifiers = Vec::new();
    for node in document.descendants().filter(Node::is_element) {
        let name = node.tag_name().name();
        assert!(!["script", "link", "img", "iframe", "object", "base"].contains(&name), "<{name}>");
        for attribute in node.attributes() {
            let (key, value) = (attribute.name(), attribute.value());
            assert!(!key.starts_with("on") && key != "src", "{key} of <{name}>");
            assert!(key != "href" || value.starts_with('#'), "href {value}");
            assert!(!value.contains("NaN") && !value.contains("inf"), "{key} of <{name}>: {value}");
        }
        identifiers.extend(node.attribute("id"));
    }
    let all = identifiers.len();
    identifiers.sort_unstable();
    identifiers.dedup();
    assert_eq!(all, identifiers.len(), "an identifier stands twice");
    let links = document.descendants().flat_map(|node| {
        let links = [
            node.attribute("href").map(|link| link.trim_start_matches('#')),
            node.attribute("aria-labelledby"),
        ];
        links.into_iter().flatten().flat_map(str::split_whitespace).collect::<Vec<_>>()
    });
    links.for_each(|link| assert!(identifiers.binary_search(&link).is_ok(), "{link} leads nowhere"));
    let reported = text(document.root_element());
    assert!(!reported.contains("NaN") && !reported.contains("@import"));
    assert_eq!(reported.matches("url(").count(), reported.matches("url(#").count());
}

#[test]
fn the_page_of_a_rich_report_holds_everything() {
    let report = sample::rich();
    let html = page(&report);
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report-page.html");
    std::fs::write(&place, &html).unwrap();
    check(&html);
    assert!(!html.contains("http"), "nothing from elsewhere");
    assert!(html.len() < 1_500_000, "{} bytes", html.len());
    let document = parsed(&html);
    let part = |identifier: &str| text(find(&document, identifier));
    for one in &report.distributions {
        assert!(part("figures").contains(&one.name), "{}", one.name);
        assert!(part("histograms").contains(&one.name), "{}", one.name);
    }
    assert!(part("figures").contains("cyclictest (reference)"));
    assert!(part("ratios").contains("97.9 %"));
    let cards = find(&document, "worst").children().filter(|node| node.has_tag_name("article"));
    assert_eq!(cards.count(), report.worst.len());
    for (event, place) in report.worst.iter().zip(0..) {
        assert!(text(find(&document, &format!("event-{place}-timeline-d"))).contains(&event.sentence));
        event.evidence.iter().for_each(|sentence| assert!(part("worst").contains(sentence), "{sentence}"));
    }
    assert!(part("worst").contains("5.02 ms late, 5 cycles missed"));
    assert!(part("worst").contains("-overrun, with frames 301 of 110, 299 of 120."));
    assert!(part("worst").contains("The rig noted: Cycle 17: stale drive"));
    assert!(part("arrivals").contains("DriveValveCommand"));
    for words in ["frames_malformed", "Run 4 lacks", "no probe.csv"] {
        assert!(part("runs").contains(words), "{words}");
    }
    for words in ["beyond", "within", "too few runs to tell", "+100.0 %", "−2.0 %"] {
        assert!(part("comparison").contains(words), "{words}");
    }
    for words in [
        "✓ kept",
        "✗ broken",
        "not measured",
        "? not resolved: about 12000 pairs would resolve it",
        "? not resolved: the median is on the bound",
    ] {
        assert!(part("bounds").contains(words), "{words}");
    }
    for fact in report.conditions.machine.iter().chain(&report.conditions.command_lines) {
        assert!(part("conditions").contains(&fact.value), "{}", fact.name);
    }
    assert!(part("conditions").contains("cyclictest --mlockall"));
    report.claim.not_controlled.iter().for_each(|words| assert!(part("not-controlled").contains(words)));
    report.claim.reasons.iter().for_each(|words| assert!(html.contains(words)));
    assert!(html.contains("✗ Latency claim: not supported"));
    assert!(html.contains("airbench-latency-report, version 1"));
}

#[test]
fn every_drawing_has_its_text() {
    let html = page(&sample::rich());
    let document = parsed(&html);
    let drawings = document.descendants().filter(|node| node.attribute("role") == Some("img"));
    let mut number = 0;
    for drawing in drawings {
        for part in ["title", "desc"] {
            let reported = drawing.children().find(|node| node.has_tag_name(part)).map(text);
            assert!(reported.is_some_and(|reported| !reported.trim().is_empty()), "a drawing without {part}");
        }
        number += 1;
    }
    assert!(number > 15, "{number} drawings");
}

#[test]
fn the_page_of_an_empty_report_says_that_nothing_was_measured() {
    let html = page(&sample::empty());
    check(&html);
    for words in
        ["No length of time was measured.", "No reference was", "None was measured.", "No run was given."]
    {
        assert!(html.to_lowercase().contains(&words.to_lowercase()), "{words}");
    }
    assert!(!html.contains("<table>\n<thead><tr></tr>"));
    assert!(html.contains("0 runs of 0 s together. Made at an unknown time."));
}

/// Text that would run, or break the page, if it became markup.
const HOSTILE: &str = "</title></style><script>alert(1)</script>\"' onload='x' ]]> <!-- &amp; \u{1b}[0m";

#[test]
fn no_text_becomes_markup() {
    let json = serde_json::to_value(sample::rich()).unwrap();
    let report: Report = serde_json::from_value(with_hostile_texts(json)).unwrap();
    let html = page(&report);
    check(&html);
    assert!(!html.contains("<script") && html.contains("&lt;script&gt;"));
    assert!(!html.contains('\u{1b}'));
}

/// Every text that is no word of the schema replaced; keys of maps too, where they are free.
fn with_hostile_texts(value: serde_json::Value) -> serde_json::Value {
    use serde_json::Value;
    match value {
        Value::Array(list) => list.into_iter().map(with_hostile_texts).collect(),
        Value::Object(map) => {
            let each = map.into_iter().map(|(key, value)| match key.as_str() {
                "source" | "cause" => (key, value),
                // Numbers that JSON cannot say come back as null.
                "median" if value.is_null() => (key, 1.0.into()),
                "emulator" | "controller" | "frames_malformed" | "emulator-wakeup" => {
                    (format!("{HOSTILE}{key}"), with_hostile_texts(value))
                }
                _ => (key, with_hostile_texts(value)),
            });
            Value::Object(each.collect())
        }
        Value::String(_) => Value::String(HOSTILE.into()),
        other => other,
    }
}

#[test]
fn odd_numbers_break_no_chart() {
    let mut report = sample::rich();
    let odd = |name: &str, bins| Distribution {
        name: name.into(),
        percentiles_ns: PercentilesNs { max: Some(u64::MAX), count: u64::MAX, ..PercentilesNs::default() },
        bins,
        ..Distribution::default()
    };
    let bin = |from_ns, to_ns| latency::model::Bin { from_ns, to_ns, count: 1 };
    report.distributions = vec![
        odd("emulator-wakeup", vec![bin(0, 1), bin(1, 1), bin(u64::MAX - 1, u64::MAX)]),
        odd("drive-round-trip", vec![]),
        odd("drive-command-age", vec![bin(0, 0)]),
    ];
    for event in &mut report.worst {
        event.at_s = f64::NAN;
        event.late_ns = u64::MAX;
        for row in event.nearby_cycles.values_mut().flatten() {
            (row.late_us, row.run_delay_us) = (f64::INFINITY, f64::NAN);
        }
        event.probe.iter_mut().for_each(|gap| gap.length_us = f64::NAN);
    }
    report.runs.iter_mut().for_each(|run| run.duration_s = f64::NAN);
    check(&page(&report));
}
