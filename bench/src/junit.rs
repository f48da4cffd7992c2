//! Checks as test cases in JUnit XML.
//!
//! The elements are those that all CI systems read: `testsuites`, `testsuite`, `testcase` with `failure` or `skipped`. The
//! crates that write them bring a date library and a UUID generator for forty lines of text.

use crate::soak::model::{Check, CheckResult};
use std::fmt::Write;

pub(crate) struct Case {
    pub(crate) class: String,
    pub(crate) time_s: f64,
    pub(crate) check: Check,
}

/// The text of a file with one suite; `name` is that of the suite, `time_s` its duration.
pub(crate) fn text(name: &str, cases: &[Case], time_s: f64) -> String {
    let count = |result| cases.iter().filter(|case| case.check.result == result).count();
    let (tests, failures, skipped) = (cases.len(), count(CheckResult::Failed), count(CheckResult::Skipped));
    let counts = format!(r#"tests="{tests}" failures="{failures}" errors="0""#);
    let time = format!(r#"time="{time_s:.1}""#);
    let name = escaped(name);
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"airbench {name}\" {counts} {time}>\n\
         <testsuite name=\"{name}\" {counts} skipped=\"{skipped}\" {time}>\n"
    );
    cases.iter().for_each(|case| case.write(&mut text));
    text.push_str("</testsuite>\n</testsuites>\n");
    text
}

impl Case {
    fn write(&self, text: &mut String) {
        let Check { name, result, detail } = &self.check;
        let [class, name, detail] = [&self.class, name, detail].map(|text| escaped(text));
        let _ = write!(text, r#"<testcase classname="{class}" name="{name}" time="{:.1}">"#, self.time_s);
        let _ = match result {
            CheckResult::Passed => write!(text, "<system-out>{detail}</system-out>"),
            CheckResult::Failed => write!(text, r#"<failure message="{detail}">{detail}</failure>"#),
            CheckResult::Skipped => write!(text, r#"<skipped message="{detail}"/>"#),
        };
        text.push_str("</testcase>\n");
    }
}

/// A text on one line, escaped for attributes and content.
fn escaped(text: &str) -> String {
    pagekit::page::escaped(&text.replace(['\n', '\t', '\r'], " "))
}
