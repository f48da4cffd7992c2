//! The table of ratios that `scripts/latency` ends with, and puts into `bench/docs/latency.md`.
//!
//! | row | ours | held against |
//! |---|---|---|
//! | ratios of the report | wake-up of the rig | cyclictest, same priority, interval and CPU |
//! | round trips | `drive-round-trip` of the rig | ping-pongs beside the run: `ping-pong.json` in its folder |
//! | spinning | wake-up p99 of runs that wake early and spin | 1 us |
//!
//! Medians and intervals are those of [`ratios`], over the pairs.

use crate::SummaryError;
use crate::grid::Grid;
use crate::join::read_object;
use crate::report::model::{Ratio, Report, RunPart};
use crate::report::ratios;
use clap::Args;
use serde_json::{Map, Value};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// From what, and what for.
#[derive(Args, Debug)]
pub struct LatencyTableArguments {
    /// report.json of the plain runs.
    pub report: PathBuf,
    /// report.json of the runs that wake early and spin.
    #[arg(long, value_name = "FILE")]
    pub spin: Option<PathBuf>,
    /// The command that measured, to be told above the table.
    #[arg(long)]
    pub made_by: Option<String>,
}

/// Ping-pongs that stand beside a run, where their p50 stands, and what a row calls them.
const PING_PONGS: [(&str, &str); 4] = [
    ("/bus/p50", "ping-pong p50 on the same bus"),
    ("/bus/to_arrival_ns/p50", "ping-pong p50 to arrival on the same bus"),
    ("/embedded/p50", "ping-pong p50 on the embedded bus"),
    ("/socketpair/p50", "ping-pong p50 on a bare socketpair"),
];
/// The figure that they are held against.
const ROUND_TRIP: &str = "drive-round-trip";
/// The rig's wake-up.
const WAKE_UP: &str = "emulator-wakeup";
/// What wake-ups that spin are held against, ns.
const SPIN_BOUND_NS: u64 = 1000;
/// Largest ratios that are claimed on an idle machine, by the beginning of a row's name.
const CLAIMED: [(&str, f64); 4] = [
    ("emulator-wakeup p50 / cyclictest", 1.1),
    ("emulator-wakeup p99 / cyclictest", 1.1),
    ("emulator-wakeup p99, spinning", 1.0),
    ("drive-round-trip p50 / ping-pong p50 on the same bus", 1.5),
];
/// Facts of the machine that are told above the table, by the beginning of their names.
const FACTS: [&str; 6] =
    ["processor", "kernel", "preemption: model", "hypervisor", "frequency", "clock source"];

/// The table in Markdown.
///
/// # Errors
/// [`SummaryError::Read`] when a report cannot be read.
pub fn table(arguments: &LatencyTableArguments) -> Result<String, SummaryError> {
    let plain = read(&arguments.report)?;
    let spin = arguments.spin.as_deref().map(read).transpose()?;
    let mut rows = plain.ratios.clone();
    let round_trip =
        |run: &'_ RunPart| run.percentiles_ns.get(ROUND_TRIP).and_then(|round_trip| round_trip.p50);
    let runs = plain.runs.iter().filter_map(|run| Some((round_trip(run)?, Path::new(&run.folder))));
    rows.extend(round_trips(runs));
    rows.extend(spin.and_then(|spin| spinning(&spin.runs)));
    let mut out = head(&plain, arguments.made_by.as_deref());
    let _ = write!(out, "{}", grid(&rows).markdown()); // writing to a string cannot fail
    Ok(out)
}

fn read(path: &Path) -> Result<Report, SummaryError> {
    let text = std::fs::read_to_string(path).map_err(|error| SummaryError::read(path, error))?;
    serde_json::from_str(&text).map_err(|error| SummaryError::read(path, error))
}

/// From the p50 of each run's round trip and the run's folder.
fn round_trips<'a>(runs: impl Iterator<Item = (u64, &'a Path)>) -> Vec<Ratio> {
    let beside =
        |(ours_ns, folder): (u64, &Path)| Some((ours_ns, read_object(&folder.join("ping-pong.json")).ok()?));
    let beside: Vec<(u64, Map<String, Value>)> = runs.filter_map(beside).collect();
    let row = |(place, name): &(&str, &str)| {
        let pair = |(ours_ns, told): &(u64, Map<String, Value>)| {
            let theirs_ns = Value::Object(told.clone()).pointer(place)?.as_u64()?;
            (theirs_ns > 0).then_some((*ours_ns, theirs_ns))
        };
        let pairs_ns = beside.iter().filter_map(pair).collect();
        ratios::ratio(format!("{ROUND_TRIP} p50 / {name}"), pairs_ns)
    };
    PING_PONGS.iter().filter_map(row).collect()
}

fn spinning(runs: &[RunPart]) -> Option<Ratio> {
    let p99 = |run: &RunPart| Some((run.percentiles_ns.get(WAKE_UP)?.p99?, SPIN_BOUND_NS));
    ratios::ratio(format!("{WAKE_UP} p99, spinning / 1 us"), runs.iter().filter_map(p99).collect())
}

fn grid(rows: &[Ratio]) -> Grid {
    let us = |ns: f64| format!("{:.2}", ns / 1e3);
    let row = |ratio: &Ratio| {
        let of = |side: fn(&(u64, u64)) -> u64| us(median(ratio.pairs_ns.iter().map(side).collect()));
        let interval = match (ratio.interval, ratio.confidence) {
            (Some((from, to)), Some(confidence)) => {
                format!("{from:.2} to {to:.2} ({:.1} %)", 100.0 * confidence)
            }
            _ => "too few pairs".to_owned(),
        };
        let bound = CLAIMED.iter().find(|(name, _)| ratio.name == *name || starts(&ratio.name, name));
        let claimed = bound.map_or_else(
            || "-".to_owned(),
            |(_, most)| format!("{most} {}", if ratio.median <= *most { "kept" } else { "**broken**" }),
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
    Grid { head: head.map(str::to_owned).into(), rows: rows.iter().map(row).collect() }
}

/// Whether `name` begins with `start` and a word ends there.
fn starts(name: &str, start: &str) -> bool {
    name.strip_prefix(start).is_some_and(|rest| rest.starts_with(' '))
}

fn median(mut values_ns: Vec<u64>) -> f64 {
    values_ns.sort_unstable();
    let count = values_ns.len();
    match count {
        0 => 0.0,
        count if count % 2 == 1 => values_ns[count / 2] as f64,
        count => f64::midpoint(values_ns[count / 2 - 1] as f64, values_ns[count / 2] as f64),
    }
}

fn head(report: &Report, made_by: Option<&str>) -> String {
    let mut out = String::new();
    let told = |name: &&str| {
        let is =
            |fact: &str| fact == *name || starts(&fact.replace(['_', ':'], " "), &name.replace(':', " "));
        let fact = report.conditions.machine.iter().find(|fact| is(&fact.name))?;
        Some(format!("{}: {}", fact.name, fact.value))
    };
    let length_s: f64 = report.runs.iter().map(|run| run.duration_s).sum();
    if let Some(command) = made_by {
        let _ = writeln!(out, "`{command}`, {} runs of {length_s:.0} s together.\n", report.runs.len());
    }
    for fact in FACTS.iter().filter_map(told) {
        let _ = writeln!(out, "- {fact}");
    }
    let load = report.conditions.load_generator.as_deref().unwrap_or("not told");
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
        let rows = [
            row("emulator-wakeup p50 / cyclictest p50", wake_up),
            row("drive-round-trip p50 / ping-pong p50 on the same bus", vec![(60_000, 30_000)]),
            row("drive-round-trip p50 / ping-pong p50 on a bare socketpair", vec![(60_000, 30_000)]),
        ];
        let text = grid(&rows).markdown();
        let lines: Vec<&str> = text.lines().filter(|line| line.contains(" / ")).collect();
        assert!(
            lines[0].contains("13.45") && lines[0].contains("1.03") && lines[0].contains("97.9 %"),
            "{text}"
        );
        assert!(lines[0].contains("1.1 kept"), "{text}");
        assert!(lines[1].contains("1.5 **broken**") && lines[1].contains("too few pairs"), "{text}");
        assert!(
            lines[2].contains("2.00") && !lines[2].contains("broken"),
            "claimed of the bus alone: {text}"
        );
    }

    #[test]
    fn round_trips_are_held_against_the_ping_pongs_of_their_own_run() {
        let folder = tempfile::tempdir().unwrap();
        let run = |name: &str, theirs_ns: u64| {
            let path = folder.path().join(name);
            std::fs::create_dir(&path).unwrap();
            let told =
                serde_json::json!({ "bus": { "p50": theirs_ns, "to_arrival_ns": { "p50": theirs_ns - 1 } } });
            std::fs::write(path.join("ping-pong.json"), told.to_string()).unwrap();
            path
        };
        let runs = [(60, run("a", 40)), (90, run("b", 30)), (70, folder.path().join("none beside it"))];
        let rows = round_trips(runs.iter().map(|(ours_ns, folder)| (*ours_ns, folder.as_path())));
        let names: Vec<_> = rows.iter().map(|row| row.name.rsplit(" / ").next().unwrap()).collect();
        assert_eq!(names, ["ping-pong p50 on the same bus", "ping-pong p50 to arrival on the same bus"]);
        assert_eq!(rows[0].pairs_ns, [(60, 40), (90, 30)]);
        assert!((rows[0].median - 2.25).abs() < 1e-12);
    }
}
