//! `soak-junit.xml`: the checks of all segments as test cases, for whatever shows tests.
//!
//! The format is the one that CI systems agree on: `testsuites`, `testsuite`, `testcase` with `failure` or `skipped`. The crates
//! that write it bring a date library and a UUID generator for forty lines of text.

use super::model::{CheckResult, Segment, Soak};
use std::fmt::Write;

/// The file's text.
#[must_use]
pub fn text(soak: &Soak) -> String {
    let cases: Vec<_> = soak.segments.iter().flat_map(cases).collect();
    let count = |result| cases.iter().filter(|case| case.result == result).count();
    let (tests, failures, skipped) =
        (cases.len() + 1, count(CheckResult::Failed), count(CheckResult::Skipped));
    let failures = failures + usize::from(!soak.trusted);
    let counts = format!(r#"tests="{tests}" failures="{failures}" errors="0""#);
    let time = format!(r#"time="{:.1}""#, soak.elapsed_s);
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"airbench soak\" {counts} {time}>\n\
         <testsuite name=\"soak\" {counts} skipped=\"{skipped}\" {time}>\n"
    );
    for case in cases.iter().chain([&Case {
        class: "soak".into(),
        name: "verdict".into(),
        time_s: 0.0,
        result: if soak.trusted { CheckResult::Passed } else { CheckResult::Failed },
        detail: soak.verdict.clone(),
    }]) {
        case.write(&mut text);
    }
    text.push_str("</testsuite>\n</testsuites>\n");
    text
}

struct Case {
    class: String,
    name: String,
    time_s: f64,
    result: CheckResult,
    detail: String,
}

fn cases(segment: &Segment) -> Vec<Case> {
    let class = format!("soak.{}", segment.folder);
    if !segment.finished {
        let detail = segment.ended.clone();
        return vec![Case {
            class,
            name: "finished".into(),
            time_s: 0.0,
            result: CheckResult::Skipped,
            detail,
        }];
    }
    // The segment's time stands at its first check, so that the cases add up to the soak.
    let time_s = |place| if place == 0 { segment.length_s } else { 0.0 };
    let checks = segment.checks.iter().enumerate();
    let case = |(place, check): (usize, &super::model::Check)| Case {
        class: class.clone(),
        name: check.name.clone(),
        time_s: time_s(place),
        result: check.result,
        detail: check.detail.clone(),
    };
    checks.map(case).collect()
}

impl Case {
    fn write(&self, text: &mut String) {
        let [class, name, detail] = [&self.class, &self.name, &self.detail].map(|text| escaped(text));
        let _ = write!(text, r#"<testcase classname="{class}" name="{name}" time="{:.1}">"#, self.time_s);
        let _ = match self.result {
            CheckResult::Passed => write!(text, "<system-out>{detail}</system-out>"),
            CheckResult::Failed => write!(text, r#"<failure message="{detail}">{detail}</failure>"#),
            CheckResult::Skipped => write!(text, r#"<skipped message="{detail}"/>"#),
        };
        text.push_str("</testcase>\n");
    }
}

/// A text as it may stand in an attribute or between tags; characters that XML 1.0 does not know are replaced.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' | '\r' => out.push(' '),
            c if c < ' ' || ('\u{FFFE}'..='\u{FFFF}').contains(&c) => out.push('\u{FFFD}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::segment;
    use super::*;
    use roxmltree::Document;

    #[test]
    fn each_check_of_each_segment_is_a_case() {
        let mut unfinished = segment(3, &[]);
        (unfinished.finished, unfinished.ended) = (false, "killed".into());
        let segments = vec![
            segment(1, &[("account", CheckResult::Passed), ("memory", CheckResult::Skipped)]),
            segment(2, &[("account", CheckResult::Failed)]),
            unfinished,
        ];
        let soak = Soak { segments, verdict: "may not: 2".into(), ..Soak::default() };
        let text = text(&soak);
        let document = Document::parse(&text).unwrap();
        let suite = document.descendants().find(|node| node.has_tag_name("testsuite")).unwrap();
        let number = |name: &str| suite.attribute(name).unwrap().parse::<usize>().unwrap();
        assert_eq!((number("tests"), number("failures"), number("skipped")), (5, 2, 2));
        let cases: Vec<_> = document.descendants().filter(|node| node.has_tag_name("testcase")).collect();
        assert_eq!(cases.len(), 5);
        let failed =
            |node: &roxmltree::Node<'_, '_>| node.children().any(|child| child.has_tag_name("failure"));
        assert!(failed(&cases[2]) && failed(&cases[4]));
        assert_eq!(cases[2].attribute("classname"), Some("soak.0002-e"));
    }

    #[test]
    fn whatever_a_detail_holds_the_file_stays_well_formed() {
        let mut broken = segment(1, &[("account", CheckResult::Failed)]);
        broken.checks[0].detail = "a < b & \"c\" > 'd'\u{1}\nmore ]]> ±".into();
        let soak = Soak { segments: vec![broken], ..Soak::default() };
        let text = text(&soak);
        let document = Document::parse(&text).unwrap();
        let failure = document.descendants().find(|node| node.has_tag_name("failure")).unwrap();
        assert_eq!(failure.text(), Some("a < b & \"c\" > 'd'\u{FFFD} more ]]> ±"));
    }
}
