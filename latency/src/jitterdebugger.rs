//! Wake-up latencies as jitterdebugger writes them, for jitterplot and what else reads that.
//!
//! One entry under `cpu` for each process, from 0 on without a hole, because readers count upwards until one is missing; the
//! key `distribution` says whose it is. Values are whole us with the fraction left out, as there.
//!
//! # Source
//! jitterdebugger, <https://github.com/igaw/jitterdebugger>, `dump_stats` of format version 2: keys `version`, `sysinfo`, `cpu`,
//! and in each CPU `histogram` (us to samples), `count`, `min`, `max`, `avg`.

use super::files::RunFiles;
use super::samples::Samples;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

const VERSION: u32 = 2;

/// The file's contents: wake-up latencies of all processes over all runs.
pub(crate) fn value(sums: &BTreeMap<String, Samples>, runs: &[RunFiles]) -> Value {
    // The rig first.
    let mut wakeups: Vec<_> = sums.iter().filter(|(tag, _)| tag.ends_with("-wakeup")).collect();
    wakeups.sort_by_key(|(tag, _)| super::kinds::place(tag));
    let cpu: Map<_, _> = wakeups
        .iter()
        .enumerate()
        .map(|(place, (tag, samples))| (place.to_string(), one(tag, samples)))
        .collect();
    json!({ "version": VERSION, "sysinfo": sysinfo(runs), "cpu": cpu })
}

fn one(tag: &str, samples: &Samples) -> Value {
    let mut bins: BTreeMap<u64, u64> = BTreeMap::new();
    let mut sum_us = 0.0;
    for bin in samples.histogram().iter_recorded() {
        let ns = samples.histogram().median_equivalent(bin.value_iterated_to());
        *bins.entry(ns / 1000).or_default() += bin.count_at_value();
        sum_us += (ns / 1000) as f64 * bin.count_at_value() as f64;
    }
    let histogram: Map<_, _> = bins.iter().map(|(us, count)| (us.to_string(), json!(count))).collect();
    let average_us = sum_us / samples.count().max(1) as f64;
    json!({
        "distribution": tag,
        "histogram": histogram,
        "count": samples.count(),
        "min": bins.keys().next(),
        "max": bins.keys().next_back(),
        "avg": (average_us * 100.0).round() / 100.0,
    })
}

/// What `uname` would have said on the machine of the first run, as far as run.json tells.
fn sysinfo(runs: &[RunFiles]) -> Value {
    let machine = runs.first().map(RunFiles::machine).unwrap_or_default();
    // "Linux version 6.1.0 (builder) (compiler) #1 SMP date".
    let kernel = machine.kernel.as_str();
    let release =
        kernel.strip_prefix("Linux version ").unwrap_or(kernel).split(' ').next().unwrap_or_default();
    let version = kernel.find('#').map_or("", |start| &kernel[start..]);
    json!({
        "sysname": "Linux",
        "nodename": "",
        "release": release,
        "version": version,
        "machine": std::env::consts::ARCH,
        "cpus_online": machine.processors,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;

    #[test]
    fn the_shape_is_that_of_jitterdebugger() {
        let samples = |values: &[u64]| values.iter().copied().collect::<Samples>();
        let sums = BTreeMap::from([
            ("controller-wakeup".to_owned(), samples(&[900, 5_000])),
            ("emulator-wakeup".to_owned(), samples(&[13_999, 13_000, 2_000_500])),
            ("emulator-send".to_owned(), samples(&[1])),
        ]);
        let reported = value(&sums, &[made_up::run(10)]);
        assert_eq!(reported["version"], 2);
        assert_eq!(reported["sysinfo"]["release"], "6.1.0-rt");
        assert_eq!(reported["sysinfo"]["version"], "#1 SMP PREEMPT_RT");
        let rig = &reported["cpu"]["0"];
        assert_eq!(rig["histogram"]["13"], 2, "{reported:#}");
        assert_eq!([&rig["count"], &rig["min"]], [3, 13]);
        assert!(rig["max"].as_u64().unwrap().abs_diff(2000) <= 2);
        assert_eq!(reported["cpu"]["1"]["histogram"]["0"], 1);
        assert!(reported["cpu"]["2"].is_null());
    }
}
