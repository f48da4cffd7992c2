//! The distributions of each run by their tags, and those of all runs added up.

use super::files::RunFiles;
use super::joined::{self, Series};
use super::model::{Distribution, Maximum, PercentilesNs};
use super::samples::{Samples, supported};
use super::{kinds, reference};
use std::collections::BTreeMap;

/// Share of one-way latencies that may be below zero before the report says so.
const BELOW_ZERO_SHARE: f64 = 0.01;

/// The distributions of a run, by tag, the reference's among them; notes in the run which cannot be had.
pub(crate) fn of_run(run: &mut RunFiles) -> BTreeMap<String, Series> {
    let mut found = run.logged.clone();
    if run.whole {
        for (process, rows) in &run.rows {
            for (tag, series) in joined::of_rows(process, rows) {
                found.entry(tag).or_insert(series);
            }
        }
        let one_way = joined::one_way(run);
        let all: u64 = one_way.series.values().map(|series| series.samples.count()).sum();
        if one_way.below_zero as f64 > BELOW_ZERO_SHARE * all as f64 {
            run.lacks.push(format!(
                "{} of {all} one-way latencies were below what the stamps can tell and stand as 0",
                one_way.below_zero
            ));
        }
        found.extend(one_way.series);
    }
    if let Some(reference) = &run.reference {
        let series = Series { samples: reference.samples.clone(), maxima_ns: BTreeMap::new() };
        found.insert(reference::TAG.into(), series);
        if reference.beyond_histogram > 0 {
            run.lacks.push(format!(
                "cyclictest: {} sample(s) were beyond its histogram and stand at its maximum",
                reference.beyond_histogram
            ));
        }
    }
    for (tag, samples) in &run.ping_pongs {
        found.insert(tag.clone(), Series { samples: samples.clone(), maxima_ns: BTreeMap::new() });
    }
    found.retain(|_, series| series.samples.count() > 0);
    found
}

/// Percentiles of a run by tag; those of the summaries where nothing better is there.
pub(crate) fn percentiles_of_run(
    run: &RunFiles,
    series: &BTreeMap<String, Series>,
) -> BTreeMap<String, PercentilesNs> {
    let mut reported: BTreeMap<_, _> =
        series.iter().map(|(tag, series)| (tag.clone(), series.samples.percentiles_ns())).collect();
    for (process, report) in run.process_reports() {
        let stages = &report.timing.stages;
        for (tag, figures) in [
            (format!("{process}-wakeup"), &stages.wakeup_ns),
            (format!("{process}-execution"), &stages.execution_ns),
            (format!("{process}-period-error"), &stages.period_error_ns),
            (kinds::ROUND_TRIPS[0].to_owned(), &report.round_trip_ns),
        ] {
            if let Some(percentiles) = percentiles(figures) {
                reported.entry(tag).or_insert(percentiles);
            }
        }
    }
    for (name, _) in kinds::PING_PONGS {
        let Some(figures) = run.ping_pong.figures.get(name) else { continue };
        let to_arrival = figures.to_arrival_ns.as_ref().map(|figures| (kinds::TO_ARRIVAL, figures));
        for (end, figures) in std::iter::once(("", &figures.round_trip_ns)).chain(to_arrival) {
            if let Some(percentiles) = percentiles(figures) {
                reported.entry(format!("{}{name}{end}", kinds::PING_PONG)).or_insert(percentiles);
            }
        }
    }
    reported
}

/// Percentiles of the summaries; nothing without samples.
pub(crate) fn percentiles(reported: &PercentilesNs) -> Option<PercentilesNs> {
    (reported.count > 0).then(|| supported(*reported))
}

pub(crate) fn add_up(runs: &[BTreeMap<String, Series>]) -> BTreeMap<String, Samples> {
    let mut sums: BTreeMap<String, Samples> = BTreeMap::new();
    for (tag, series) in runs.iter().flatten() {
        sums.entry(tag.clone()).or_default().add(&series.samples);
    }
    sums
}

/// The distributions as a report shows them.
pub(crate) fn shown(
    runs: &[BTreeMap<String, Series>],
    sums: &BTreeMap<String, Samples>,
) -> Vec<Distribution> {
    let mut shown: Vec<_> = sums.iter().map(|(tag, samples)| distribution(tag, samples, runs)).collect();
    shown.sort_by_key(|distribution| kinds::place(&distribution.name));
    shown
}

fn distribution(tag: &str, samples: &Samples, runs: &[BTreeMap<String, Series>]) -> Distribution {
    let kind = kinds::of(tag);
    let mut maxima = Vec::new();
    for (run, series) in runs.iter().enumerate().filter_map(|(run, all)| Some((run, all.get(tag)?))) {
        maxima.extend(series.maxima_ns.iter().map(|(second, max_ns)| Maximum {
            run,
            second: *second,
            max_ns: *max_ns,
        }));
    }
    Distribution {
        name: kind.tag,
        source: kind.source,
        about: kind.about,
        percentiles_ns: samples.percentiles_ns(),
        bins: samples.bins(),
        maxima,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hlog::BorrowedInterval;
    use crate::made_up;
    use serde_json::json;

    #[test]
    fn intervals_add_up_and_each_has_its_maximum() {
        let mut run = RunFiles::default();
        let mut take = |tag: &str, start_s: f64, duration_s: f64, values_ns: &[u64]| {
            let samples: Samples = values_ns.iter().copied().collect();
            run.take_interval(BorrowedInterval { tag, start_s, duration_s, histogram: samples.histogram() });
        };
        take("emulator-wakeup", 0.0, 1.0, &[5, 100]);
        take("emulator-wakeup", 1.0, 1.0, &[7]);
        take("emulator-send", 0.0, 60.0, &[9]);
        let series = of_run(&mut run);
        let runs = [series.clone(), series];
        let shown = shown(&runs, &add_up(&runs));
        assert_eq!(shown.len(), 2);
        assert_eq!(shown[0].percentiles_ns.count, 6);
        let maxima: Vec<_> = shown[0].maxima.iter().map(|one| (one.run, one.second, one.max_ns)).collect();
        assert_eq!(maxima, [(0, 0, 100), (0, 1, 7), (1, 0, 100), (1, 1, 7)]);
        assert!(shown[1].maxima.is_empty(), "an interval of a minute has no maximum of a second");
    }

    #[test]
    fn without_a_log_the_rows_speak_and_without_rows_the_summary() {
        let mut run = made_up::run(1000);
        made_up::edit_summary(&mut run, |summary| {
            summary["wakeup_ns"] = json!({ "p50": 3, "p90": 4, "p99": 5, "p999": 6, "max": 7, "count": 500 });
        });
        let series = of_run(&mut run);
        assert_eq!(percentiles_of_run(&run, &series)["emulator-wakeup"].count, 1000);
        run.rows.clear();
        let series = of_run(&mut run);
        assert!(series.is_empty());
        let reported = percentiles_of_run(&run, &series)["emulator-wakeup"];
        assert_eq!((reported.p50, reported.p999, reported.p9999, reported.count), (Some(3), None, None, 500));
    }
}
