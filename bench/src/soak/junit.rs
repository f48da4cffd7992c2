//! `soak-junit.xml`: the checks of all segments as test cases.

use super::model::{Check, CheckResult, Segment, Soak};
use crate::junit::Case;

pub(super) fn text(soak: &Soak) -> String {
    let mut cases: Vec<_> = soak.segments.iter().flat_map(cases).collect();
    let result = if soak.trusted { CheckResult::Passed } else { CheckResult::Failed };
    let check = Check::new("verdict", result, &soak.verdict);
    cases.push(Case { class: "soak".into(), time_s: 0.0, check });
    crate::junit::text("soak", &cases, soak.elapsed_s)
}

fn cases(segment: &Segment) -> Vec<Case> {
    let class = format!("soak.{}", segment.folder);
    if !segment.finished {
        let check = Check::new("finished", CheckResult::Skipped, &segment.ended);
        return vec![Case { class, time_s: 0.0, check }];
    }
    // The first check has the time of the segment, so that the cases add up to the soak.
    let time_s = |place| if place == 0 { segment.length_s } else { 0.0 };
    let checks = segment.checks.iter().enumerate();
    let case = |(place, check): (usize, &Check)| Case {
        class: class.clone(),
        time_s: time_s(place),
        check: check.clone(),
    };
    checks.map(case).collect()
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
