//! Judges a finished segment: reads its files, computes the account, makes every check.

use super::EMULATOR;
use super::account::{self, FrameAccount};
use super::memory::{GROWTH_LIMIT_PERCENT, Memory, SLOPE_LIMIT_KIB_PER_H};
use super::model::{Check, CheckResult, Figures};
use super::plan::SegmentSpec;
use super::segment::{Outcome, SegmentEnd};
use super::segment_files::{SegmentFiles, counts};
use figures::experiment::Experiment;
use figures::thresholds::{self, ByRepetition, FigureValue};
use figures::top::POSITIONS;
use runlog::summary::{JudgedBound, ProcessReport};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// Standard deviations that the number of injected losses may differ from its expectation.
const LOSS_DEVIATIONS: f64 = 5.0;

/// Checks of a finished segment, with the underlying figures.
pub(super) struct SegmentVerdict {
    pub checks: Vec<Check>,
    pub figures: Figures,
    pub account: FrameAccount,
    pub memory: BTreeMap<String, Memory>,
    /// `machine` of `run.json`.
    pub machine: Value,
}

pub(super) fn judge(
    spec: &SegmentSpec,
    folder: &Path,
    outcome: &Outcome,
    judge_positions: bool,
) -> SegmentVerdict {
    let files = SegmentFiles::read(spec, folder);
    let account = files.account(outcome);
    let memory: BTreeMap<_, _> =
        outcome.memory.iter().map(|(name, record)| (name.clone(), Memory::of(record))).collect();
    let mut checks = vec![processes(outcome)];
    match &account {
        Ok(account) => checks.extend([
            result("account", &account.broken, || account_summary(account)),
            result("gaps", &account.gaps_broken, || {
                "missing frames are the same by counts and by gaps".into()
            }),
            loss(spec, &files, account),
        ]),
        Err(why) => {
            checks.extend(["account", "gaps", "loss"].map(|name| Check::new(name, CheckResult::Failed, why)))
        }
    }
    checks.extend([records(&files, outcome), memory_check(&memory), positions(&files, judge_positions)]);
    let account = account.unwrap_or_default();
    SegmentVerdict { checks, figures: files.figures(), account, memory, machine: files.machine.clone() }
}

/// Passed when nothing is broken.
fn result(name: &str, broken: &[String], good: impl Fn() -> String) -> Check {
    if broken.is_empty() {
        Check::new(name, CheckResult::Passed, &good())
    } else {
        Check::new(name, CheckResult::Failed, &broken.join("; "))
    }
}

fn processes(outcome: &Outcome) -> Check {
    // Stopped by a signal, the rig exits with 130 after saving everything.
    let asked = matches!(outcome.end, SegmentEnd::Interrupted | SegmentEnd::DiskFull(_));
    let as_expected =
        |name: &str, code: Option<i32>| code == Some(0) || (asked && name == EMULATOR && code == Some(130));
    let mut broken: Vec<_> = outcome
        .exits
        .iter()
        .filter(|(name, (_, code, _))| !as_expected(name, *code))
        .map(|(name, (_, _, words))| format!("{name}: {words}, see {name}.txt"))
        .collect();
    if let SegmentEnd::ProgramFailure(why) = &outcome.end {
        broken.insert(0, why.clone());
    }
    result("processes", &broken, || "all programs ended as they should".into())
}

fn account_summary(account: &FrameAccount) -> String {
    let sum = |part: fn(&account::Row) -> u64| account.rows.iter().map(part).sum::<u64>();
    format!(
        "{} frames for {} pairs of identifier and receiver: {} received, {} lost on the wire on purpose, {} lost at queues, \
         {} passed before their receiver came or after it left",
        sum(|row| row.sent),
        account.rows.len(),
        sum(|row| row.received),
        sum(|row| row.lost_on_wire),
        sum(|row| row.lost_at_queue),
        sum(|row| row.before_it_came + row.after_it_left),
    )
}

/// Checks the rate of the injected loss; whether every lost frame was found is checked by the account and the gaps.
fn loss(spec: &SegmentSpec, files: &SegmentFiles, account: &FrameAccount) -> Check {
    let host = files.summary.bus_host.as_ref();
    let injected = host.map_or(0, |host| host.injected_loss.total());
    let Some(loss) = spec.loss else {
        let detail = format!("no loss asked for, {injected} frames lost on purpose");
        let result = if injected == 0 { CheckResult::Skipped } else { CheckResult::Failed };
        return Check::new("loss", result, &detail);
    };
    let frames = host.map_or(0, |host| host.on_wire.total()) + injected;
    let expected = loss * frames as f64;
    let allowed = LOSS_DEVIATIONS * (expected * (1.0 - loss)).sqrt();
    let found = account.rows.iter().any(|row| row.missing_by_gaps.is_some_and(|missing| missing > 0));
    let detail =
        format!("{injected} of {frames} frames lost on purpose, {expected:.0} ± {allowed:.0} expected");
    let kept = (injected as f64 - expected).abs() <= allowed && found;
    Check::new("loss", if kept { CheckResult::Passed } else { CheckResult::Failed }, &detail)
}

fn memory_check(memory: &BTreeMap<String, Memory>) -> Check {
    let reported = |name: &String, memory: &Memory| {
        let slope = memory.slope_kib_per_h.map_or(String::new(), |slope| format!(", {slope:+.0} KiB/h"));
        let growth = memory.growth_percent.map_or(String::new(), |growth| format!(", {growth:+.2} %"));
        format!("{name} {} KiB{slope}{growth}", memory.rss_last_kib)
    };
    let all: Vec<_> = memory.iter().map(|(name, memory)| reported(name, memory)).collect();
    let bounds = format!(
        "(bounds: {SLOPE_LIMIT_KIB_PER_H:.0} KiB/h, {GROWTH_LIMIT_PERCENT} % from the second quarter to the last)"
    );
    let detail = format!("{} {bounds}", all.join("; "));
    let flat: Vec<_> = memory.values().map(Memory::is_flat).collect();
    let result = match () {
        () if flat.contains(&Some(false)) => CheckResult::Failed,
        () if flat.is_empty() || flat.contains(&None) => CheckResult::Skipped,
        () => CheckResult::Passed,
    };
    Check::new("memory", result, &detail)
}

/// Checks that every record reached the files, and that the log holds every frame that the rig counted.
fn records(files: &SegmentFiles, outcome: &Outcome) -> Check {
    let mut broken = Vec::new();
    for (name, report) in &files.reports {
        match report.records_dropped {
            Some(0) => {}
            Some(dropped) => broken.push(format!("{name}: {dropped} records did not reach the files")),
            None => broken.push(format!("{name} left no report")),
        }
    }
    let mut counted = counts(files.summary.bus.sent_by_id.by_name());
    counted.add_all(&counts(files.summary.bus.received_by_id.by_name()));
    match &files.log {
        Err(error) => broken.push(error.clone()),
        Ok(log) if broken.is_empty() => {
            let ids = log.frames.ids().chain(counted.ids()).filter(|id| log.frames.of(id) != counted.of(id));
            broken.extend(ids.map(|id| {
                format!("{id}: {} in bus.log, the rig counted {}", log.frames.of(id), counted.of(id))
            }));
            broken.dedup();
        }
        Ok(_) => {}
    }
    let samples = outcome.memory.values().map(Vec::len).max().unwrap_or(0);
    result("records", &broken, || {
        format!(
            "bus.log holds all {} frames of the rig, {samples} memory samples of a process",
            counted.total()
        )
    })
}

/// Shortest stall that excuses position errors: five cycles with an old valve opening.
const STALL_NS: u64 = 5_000_000;

/// Why broken bounds on position errors do not count, if so.
fn position_exemption(files: &SegmentFiles, judge: bool) -> Option<String> {
    let late = |report: &ProcessReport| report.timing.stages.wakeup_ns.max;
    let stall_ns = files.reports.values().filter_map(late).max().unwrap_or_default();
    if !judge {
        Some("reported, not judged: --judge-positions no".into())
    } else if stall_ns >= STALL_NS {
        Some(format!("not judged: a process stood still for {:.1} ms", stall_ns as f64 * 1e-6))
    } else {
        None
    }
}

/// Compares the position errors with the experiment's bounds; errors that the segment was too short for are not judged.
fn positions(files: &SegmentFiles, judge: bool) -> Check {
    let drive = files.drive();
    let errors_m = [
        drive.and_then(|drive| drive.position_error_dynamic_m),
        drive.and_then(|drive| drive.position_error_static_m),
    ];
    let reported = POSITIONS.into_iter().zip(errors_m);
    let measured: BTreeMap<_, _> = reported.filter_map(|(key, error_m)| Some((key, error_m?))).collect();
    let experiment = files.run.experiment_toml.as_deref().unwrap_or_default().parse::<Experiment>();
    let passed = experiment.unwrap_or_default().bounds().unwrap_or_default();
    let bounds: toml::Table =
        passed.into_iter().filter(|(key, _)| measured.contains_key(key.as_str())).collect();
    if bounds.is_empty() {
        return Check::new(
            "positions",
            CheckResult::Skipped,
            &format!("no bound to judge: {}", json!(measured)),
        );
    }
    let found = |key: &str| measured.get(key).copied().map(FigureValue::Number);
    match thresholds::judge(&bounds, found, &ByRepetition::new()) {
        Err(error) => Check::new("positions", CheckResult::Failed, &error.to_string()),
        Ok(judged) => {
            let words = |key: &String, bound: &JudgedBound| {
                format!("{key} = {}, {}", json!(bound.value), thresholds::in_words(bound))
            };
            let mut reported: Vec<_> = judged.iter().map(|(key, bound)| words(key, bound)).collect();
            if judged.values().all(|bound| bound.kept) {
                return Check::new("positions", CheckResult::Passed, &reported.join("; "));
            }
            let exemption = position_exemption(files, judge);
            let result = if exemption.is_some() { CheckResult::Skipped } else { CheckResult::Failed };
            reported.extend(exemption);
            Check::new("positions", result, &reported.join("; "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use realtime::{Percentiles, StageFigures};
    use runlog::controller_report::{AxisReport, ControllerReport};
    use runlog::summary::{RunDescription, Summary};
    use runlog::timing_recorder::TimingFigures;

    fn segment(error_m: f64, rig_late_ns: u64, controller_late_ns: u64) -> SegmentFiles {
        let report = |late_ns: u64| ProcessReport {
            timing: TimingFigures {
                stages: StageFigures {
                    wakeup_ns: Percentiles { max: Some(late_ns), ..Percentiles::default() },
                    ..StageFigures::default()
                },
                ..TimingFigures::default()
            },
            ..ProcessReport::default()
        };
        let drive = AxisReport { position_error_dynamic_m: Some(error_m), ..AxisReport::default() };
        let controller =
            ControllerReport { axes: [("drive".into(), drive)].into(), ..ControllerReport::default() };
        SegmentFiles {
            summary: Summary::default(),
            run: RunDescription {
                experiment_toml: Some("[passed]\nposition_error_dynamic_m = 0.005\n".into()),
                ..RunDescription::default()
            },
            machine: Value::Null,
            controllers: [("controller".to_owned(), controller)].into(),
            reports: [
                ("controller".to_owned(), report(controller_late_ns)),
                ("emulator".to_owned(), report(rig_late_ns)),
            ]
            .into(),
            log: Err("none is needed".into()),
            damaged: Vec::new(),
        }
    }

    /// A soak failed for 5.29 mm in a segment in which compilers of a higher priority had held the machine for 20 ms.
    #[test]
    fn a_position_error_counts_unless_a_process_stood_still() {
        let result = |error_m, rig_ns, controller_ns, judge| {
            positions(&segment(error_m, rig_ns, controller_ns), judge).result
        };
        assert_eq!(result(0.004, 0, 0, true), CheckResult::Passed);
        assert_eq!(result(0.004, 30_000_000, 0, true), CheckResult::Passed);
        assert_eq!(result(0.006, 900_000, 900_000, true), CheckResult::Failed);
        assert_eq!(result(0.006, 20_000_000, 0, true), CheckResult::Skipped);
        assert_eq!(result(0.006, 0, 20_000_000, true), CheckResult::Skipped);
        assert_eq!(result(0.006, 0, 0, false), CheckResult::Skipped);
    }
}
