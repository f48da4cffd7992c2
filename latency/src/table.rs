//! The table of ratios that `scripts/latency` ends with, and puts into `bench/docs/latency.md`.
//!
//! | row | ours | held against |
//! |---|---|---|
//! | ratios of the report | wake-up of the rig | cyclictest, same priority, interval and CPU |
//! | | `drive-round-trip` of the rig | ping-pongs beside the run |
//! | spinning | wake-up p99 of runs that wake early and spin | what is claimed of it |
//!
//! Medians and intervals are those of [`ratios`], over the pairs; what is claimed stands in `latency/bounds*.toml`, and
//! [`resolution`] says whether it is kept.

use crate::bounds;
use crate::kinds::WAKE_UP;
use crate::model::{Ratio, Report, RunPart};
use crate::ratios;
use crate::resolution::{self, Verdict};
use clap::Args;
use figures::median::median;
use pagekit::grid::Grid;
use runlog::run_folder::{FileError, read_json};
use std::fmt::Write as _;
use std::path::PathBuf;

/// From what, and what for.
#[derive(Args, Debug)]
pub struct LatencyTableArguments {
    /// report.json of the plain runs.
    pub report: PathBuf,
    /// report.json of the runs that wake early and spin.
    #[arg(long, value_name = "FILE")]
    pub spin: Option<PathBuf>,
    /// The command that measured, to be reported above the table.
    #[arg(long)]
    pub made_by: Option<String>,
}

/// What is claimed of plain runs and of those that spin: the files that `scripts/latency --claims` judges by.
const CLAIMS: [&str; 2] = [include_str!("../bounds.toml"), include_str!("../bounds-spin.toml")];
/// The figure of the runs that spin that is claimed, and the name of its row.
const SPIN_CLAIM: &str = "emulator-wakeup.p99_ns";
const SPIN_ROW: &str = "emulator-wakeup p99, spinning / claimed";
/// Facts of the machine that are reported above the table, by the beginning of their names.
const FACTS: [&str; 6] =
    ["processor", "kernel", "preemption: model", "hypervisor", "frequency", "clock source"];

/// The table in Markdown, under the facts of the machine.
///
/// # Errors
/// [`FileError::Read`]: a report that cannot be read.
pub fn table(arguments: &LatencyTableArguments) -> Result<String, FileError> {
    let plain: Report = read_json(&arguments.report)?;
    let spin: Option<Report> = arguments.spin.as_deref().map(read_json).transpose()?;
    let mut rows = plain.ratios.clone();
    rows.extend(spin.and_then(|spin| spinning(&spin.runs)));
    let mut out = head(&plain, arguments.made_by.as_deref());
    let _ = write!(out, "{}", grid(&rows).markdown()); // writing to a string cannot fail
    Ok(out)
}

fn claimed(figure: &str) -> Option<f64> {
    CLAIMS.iter().find_map(|text| bounds::most(text, figure))
}

fn spinning(runs: &[RunPart]) -> Option<Ratio> {
    let most_ns = claimed(SPIN_CLAIM)? as u64;
    let p99 = |run: &RunPart| Some((run.percentiles_ns.get(WAKE_UP)?.p99?, most_ns));
    ratios::ratio(SPIN_ROW.to_owned(), runs.iter().filter_map(p99).collect())
}

fn grid(rows: &[Ratio]) -> Grid {
    let us = |ns: f64| format!("{:.2}", ns / 1e3);
    let row = |ratio: &Ratio| {
        let of = |side: fn(&(u64, u64)) -> u64| {
            us(median(ratio.pairs_ns.iter().map(|pair| side(pair) as f64).collect())
                .map_or(0.0, |middle| middle.value))
        };
        let interval = match (ratio.interval, ratio.confidence) {
            (Some((from, to)), Some(confidence)) => {
                format!("{from:.2} to {to:.2} ({:.1} %)", 100.0 * confidence)
            }
            _ => "too few pairs".to_owned(),
        };
        let most = if ratio.name == SPIN_ROW {
            Some(1.0)
        } else {
            claimed(&format!("ratio.{}", ratios::short_name(&ratio.name)))
        };
        let claimed = most.map_or_else(
            || "-".to_owned(),
            |most| match resolution::verdict(ratio, None, Some(most)) {
                Verdict::Kept => format!("{most} kept"),
                Verdict::Broken => format!("{most} **broken**"),
                Verdict::NotResolved { pairs } => {
                    format!("{most} **not resolved**: {}", resolution::in_words(pairs))
                }
            },
        );
        vec![
            ratio.name.clone(),
            of(|pair| pair.0),
            of(|pair| pair.1),
            format!("{:.2}", ratio.median),
            interval,
            ratio.pairs_ns.len().to_string(),
            claimed,
        ]
    };
    let head = ["figure", "ours, us", "against, us", "ratio", "interval", "pairs", "at most"];
    Grid::new(head, rows.iter().map(row))
}

/// Whether `name` begins with `start` and a word ends there.
fn starts(name: &str, start: &str) -> bool {
    name.strip_prefix(start).is_some_and(|rest| rest.starts_with(' '))
}

fn head(report: &Report, made_by: Option<&str>) -> String {
    let mut out = String::new();
    let reported = |name: &&str| {
        let is =
            |fact: &str| fact == *name || starts(&fact.replace(['_', ':'], " "), &name.replace(':', " "));
        let fact = report.conditions.machine.iter().find(|fact| is(&fact.name))?;
        Some(format!("{}: {}", fact.name, fact.value))
    };
    let length_s: f64 = report.runs.iter().map(|run| run.duration_s).sum();
    if let Some(command) = made_by {
        let _ = writeln!(out, "`{command}`, {} runs of {length_s:.0} s together.\n", report.runs.len());
    }
    for fact in FACTS.iter().filter_map(reported) {
        let _ = writeln!(out, "- {fact}");
    }
    let load = report.conditions.load_generator.as_deref().unwrap_or("not reported");
    let _ = writeln!(out, "- load generator: {load}\n\n{}\n", report.claim.sentence);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_tells_medians_interval_and_whether_the_claim_is_kept() {
        let row = |name: &str, pairs_ns| ratios::ratio(name.into(), pairs_ns).unwrap();
        let wake_up = (0..10).map(|n| (13_000 + n * 100, 13_000)).collect();
        let crossing = [20, 27, 60, 80, 105, 105, 200, 300, 495, 600].map(|n| (n * 100, 10_000)).into();
        let rows = [
            row("emulator-wakeup p50 / cyclictest p50", wake_up),
            row("drive-round-trip p50 / ping-pong-bus p50", vec![(60_000, 30_000); 6]),
            row("drive-round-trip p50 / ping-pong-socketpair p50", vec![(60_000, 30_000)]),
            row("drive-round-trip p50 / ping-pong-bus p50", vec![(60_000, 30_000)]),
            row("emulator-wakeup p99 / cyclictest p99", crossing),
        ];
        let text = grid(&rows).markdown();
        let lines: Vec<&str> = text.lines().filter(|line| line.contains(" / ")).collect();
        assert!(
            lines[0].contains("13.45") && lines[0].contains("1.03") && lines[0].contains("97.9 %"),
            "{text}"
        );
        assert!(lines[0].contains("1.1 kept"), "{text}");
        assert!(lines[1].contains("1.5 **broken**") && lines[1].contains("2.00 to 2.00 (96.9 %)"), "{text}");
        assert!(
            lines[2].contains("2.00") && !lines[2].contains("broken"),
            "claimed of the bus alone: {text}"
        );
        let few = "1.5 **not resolved**: an interval needs 6 pairs";
        assert!(lines[3].contains(few) && lines[3].contains("too few pairs"), "{text}");
        let crosses = "1.1 **not resolved**: about 12000 pairs would resolve it";
        assert!(lines[4].contains(crosses) && lines[4].contains("0.27 to 4.95"), "{text}");
    }

    #[test]
    fn every_claim_is_a_figure_that_a_report_can_have() {
        let names: Vec<_> =
            ratios::names().map(|name| format!("ratio.{}", ratios::short_name(&name))).collect();
        let plain = settings::Source::parse(CLAIMS[0], "bounds.toml".as_ref()).unwrap();
        let reported = plain.root().section("bounds").unwrap().unwrap().keys();
        assert_eq!(reported.len(), 3);
        assert!(reported.iter().all(|figure| names.contains(figure)), "{reported:?}");
        assert_eq!(claimed(SPIN_CLAIM), Some(1000.0));
    }
}
