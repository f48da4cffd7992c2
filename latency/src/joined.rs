//! Rows of rig and controllers on one clock: how long a frame was on its way, each way, each axis.
//!
//! ```text
//!   rig, cycle k                 sensors handed over ──────────────► sensors arrived      controller, cycle k
//!   rig, a later cycle           command arrived     ◄────────────── answer handed over   controller, cycle k
//! ```
//!
//! The later cycle of the rig says which cycle's sensors its command answers. Handing over is stamped before the call that sends,
//! so the call itself is part of the way. What still comes out below zero counts as 0 and is counted.

use super::files::{EMULATOR, RunFiles};
use super::samples::Samples;
use protocol::periods::CYCLE_NS;
use runlog::Axis;
use runlog::timing::{CycleTiming, Exchange};
use std::collections::{BTreeMap, HashMap};

/// Samples, and the largest of each second.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    pub samples: Samples,
    /// Largest of each second of the run, ns.
    pub maxima_ns: BTreeMap<u64, u64>,
}

impl Series {
    /// Counts one sample of a cycle of the rig.
    pub(crate) fn record(&mut self, cycle: u64, ns: u64) {
        self.samples.record(ns, 1);
        let largest = self.maxima_ns.entry(cycle * CYCLE_NS / 1_000_000_000).or_default();
        *largest = ns.max(*largest);
    }
}

/// What joining gave.
#[derive(Clone, Debug, Default)]
pub(crate) struct OneWay {
    pub series: BTreeMap<String, Series>,
    /// Latencies below what the stamps can tell.
    pub below_zero: u64,
}

type ExchangeOfAxis = fn(&CycleTiming) -> Exchange;

/// One-way latencies of a run with rows of both sides.
pub(crate) fn one_way(run: &RunFiles) -> OneWay {
    let mut found = OneWay::default();
    let Some(rig) = run.rows.get(EMULATOR) else { return found };
    let axes: [(&str, ExchangeOfAxis); 2] =
        [(Axis::Drive.name(), |row| row.drive), (Axis::Load.name(), |row| row.load)];
    for (axis, exchange) in axes {
        let controllers = run.rows.iter().filter(|(process, _)| *process != EMULATOR);
        let rows = controllers.flat_map(|(_, rows)| rows);
        // Whoever drives this axis has stamps of it.
        let answered: HashMap<u64, Exchange> = rows
            .map(|row| (row.cycle, exchange(row)))
            .filter(|(_, reported)| reported.sensors_ns > 0)
            .collect();
        for row in rig {
            let reported = exchange(row);
            if let Some(other) = answered.get(&row.cycle).filter(|_| reported.sensors_ns > 0) {
                let tag = format!("{axis}-rig-to-controller");
                found.record(tag, row.cycle, reported.sensors_ns, other.sensors_ns);
            }
            let answer = answered
                .get(&reported.answers)
                .filter(|other| reported.command_ns > 0 && other.command_ns > 0);
            if let Some(other) = answer {
                let tag = format!("{axis}-controller-to-rig");
                found.record(tag, row.cycle, other.command_ns, reported.command_ns);
            }
        }
    }
    found
}

impl OneWay {
    fn record(&mut self, tag: String, cycle: u64, sent_ns: u64, arrived_ns: u64) {
        self.below_zero += u64::from(arrived_ns < sent_ns);
        self.series.entry(tag).or_default().record(cycle, arrived_ns.saturating_sub(sent_ns));
    }
}

/// What the rows of one process say by themselves, by tag: for runs whose log is missing.
pub(crate) fn of_rows(process: &str, rows: &[CycleTiming]) -> BTreeMap<String, Series> {
    let mut found: BTreeMap<String, Series> = BTreeMap::new();
    let mut record = |what: &str, cycle: u64, ns: u64| {
        found.entry(format!("{process}-{what}")).or_default().record(cycle, ns);
    };
    for row in rows {
        let late_ns = row.woke_ns.saturating_sub(row.due_ns);
        let completion_ns = row.done_ns.saturating_sub(row.due_ns);
        if process == EMULATOR {
            // Each missed cycle was late too, against its own scheduled time, and done when this one was.
            for n in 1..=row.skipped.min(row.cycle) {
                record("wakeup", row.cycle, late_ns + n * CYCLE_NS);
                record("completion", row.cycle, completion_ns + n * CYCLE_NS);
            }
        }
        record("wakeup", row.cycle, late_ns);
        record("receive", row.cycle, row.receive_ns);
        record("step", row.cycle, row.step_ns);
        record("send", row.cycle, row.send_ns);
        record("execution", row.cycle, row.done_ns.saturating_sub(row.woke_ns));
        record("completion", row.cycle, completion_ns);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;

    #[test]
    fn latencies_are_reported_each_way_and_for_each_axis() {
        let run = made_up::run(1000);
        let reported = one_way(&run);
        let tags: Vec<_> = reported.series.keys().map(String::as_str).collect();
        let ways = [
            "drive-controller-to-rig",
            "drive-rig-to-controller",
            "load-controller-to-rig",
            "load-rig-to-controller",
        ];
        assert_eq!(tags, ways);
        for (tag, ns) in [
            ("drive-rig-to-controller", made_up::TO_CONTROLLER_NS),
            ("load-controller-to-rig", made_up::TO_RIG_NS),
        ] {
            let reported = reported.series[tag].samples.percentiles_ns();
            let p50 = reported.p50.unwrap();
            assert!((ns..=ns + ns / 500).contains(&p50), "{tag}: {p50}");
            assert!(reported.count > 990, "{tag}: {}", reported.count);
        }
        assert_eq!(reported.below_zero, 0);
    }

    #[test]
    fn a_cycle_that_the_rig_missed_is_late_against_its_own_time() {
        let run = made_up::stalled(100, "emulator", 50, 5_300_000);
        let reported = of_rows("emulator", &run.rows["emulator"]);
        let wakeup = &reported["emulator-wakeup"].samples;
        assert_eq!(wakeup.count(), 100);
        let late = wakeup.histogram().count_between(1_000_000, 10_000_000);
        assert_eq!(late, 5, "5.3, 4.3, 3.3, 2.3 and 1.3 ms late");
        let completion = &reported["emulator-completion"].samples;
        assert_eq!(completion.count(), 100);
        assert!(completion.histogram().max() >= wakeup.histogram().max());
    }
}
