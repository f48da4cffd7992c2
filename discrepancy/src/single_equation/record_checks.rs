//! Whether the records of a balance can be used: findings of its channels, and fitted numbers below zero.

use super::Study;
use super::terms;
use crate::report::{Finding, RecordCheck};
use plant::RigParameters;
use records::Record;

/// What the check finds that holds for a balance alone: it has neither the rig's period nor its sensors.
const KINDS: [&str; 5] = ["reader", "stuck", "clipped", "absent-values", "repeated-time"];
/// Numbers of a baseline that are never below zero.
const POSITIVE: [&str; 3] = ["mass", "area", "sliding"];

impl Study {
    pub(super) fn checks(&self) -> Vec<RecordCheck> {
        let mut checks: Vec<RecordCheck> = self.records.iter().map(|record| self.check(record)).collect();
        if let Some(first) = checks.first_mut() {
            let wrong = self.wrong_sign(&first.file);
            first.usable &= wrong.is_none();
            first.findings.extend(wrong);
        }
        checks
    }

    /// What the check says of the channels of this balance. Holes are bridged here, whatever their length.
    pub(super) fn check(&self, record: &Record) -> RecordCheck {
        let columns: Vec<String> = self.model.channels.values().map(|channel| channel.column()).collect();
        let rig = self.rig.clone().unwrap_or_else(RigParameters::baseline);
        let mut check = crate::check::check(record, &rig).report;
        let is_of_study =
            |finding: &Finding| finding.column.as_ref().is_none_or(|column| columns.contains(column));
        check.findings.retain(|finding| is_of_study(finding) && KINDS.contains(&finding.kind.as_str()));
        check.channels.retain(|column, _| columns.contains(column));
        let times = record.time_s();
        let hole = times.windows(2).enumerate().map(|(row, pair)| (row, pair[1] - pair[0]));
        let hole = hole.max_by(|a, b| a.1.total_cmp(&b.1));
        let hole = hole.filter(|(_, length_s)| *length_s > 5.0 * self.model.processing.period_s);
        check.findings.extend(hole.map(|(row, length_s)| {
            let (file, line) = (record.file().display(), record.line(row + 1));
            let text =
                format!("{file}:{line}: the longest hole has {length_s:.3} s; bridged by a straight line");
            Finding { kind: "gap".into(), line: Some(line), text, ..Finding::default() }
        }));
        check.usable = !check.findings.iter().any(|finding| finding.fatal);
        check
    }

    /// A mass, an area or a friction below zero: some channel counts the other way.
    fn wrong_sign(&self, file: &str) -> Option<Finding> {
        let columns = terms::baseline(&self.model);
        let (column, number) = columns
            .iter()
            .zip(&self.base_fit.numbers)
            .find(|(column, number)| POSITIVE.contains(&column.name) && **number < 0.0)?;
        let text = format!(
            "{file}: the records ask for a {} of {number:.4} {}, which is below zero: a channel counts the other way; give it a \
             negative factor in the mapping",
            column.name, column.unit
        );
        Some(Finding { kind: "sign".into(), fatal: true, text, ..Finding::default() })
    }
}
