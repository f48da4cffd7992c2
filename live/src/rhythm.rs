//! Latency histograms from the telemetry: wake-ups and round trips, of the whole run and of the last 10 s.

use super::state::StagePercentiles;
use crate::push_newest;
use latency::hlog;
use latency::kinds::{ROUND_TRIPS, WAKE_UP};
use latency::samples::Samples;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};

/// Length of the recent window, s.
const RECENT_S: usize = 10;
/// The stages shown, and their tags in the interval log.
const SHOWN: [(&str, &[&str]); 2] = [("wake_up", &[WAKE_UP]), ("round_trip", &ROUND_TRIPS)];

#[derive(Debug, Default)]
struct Distribution {
    whole: Samples,
    /// By the second in which their interval began.
    recent: VecDeque<(u64, Samples)>,
}

/// Latency distributions of a run.
#[derive(Debug, Default)]
pub(crate) struct LatencyHistograms {
    distributions: [Distribution; SHOWN.len()],
}

impl LatencyHistograms {
    /// Adds a line of an interval log.
    pub(crate) fn take(&mut self, line: &str) -> Result<(), hlog::LogError> {
        hlog::each(&format!("{line}\n"), |interval| {
            let known = SHOWN.iter().position(|(_, tags)| tags.contains(&interval.tag));
            let Some(distribution) = known.map(|place| &mut self.distributions[place]) else { return };
            distribution.whole.add_histogram(interval.histogram);
            let second = interval.start_s as u64;
            let recent = &mut distribution.recent;
            if recent.back().is_none_or(|(newest, _)| *newest != second) {
                push_newest(recent, RECENT_S, (second, Samples::default()));
            }
            if let Some((_, samples)) = recent.back_mut() {
                samples.add_histogram(interval.histogram);
            }
        })
    }

    /// Percentiles of the whole run, us; null with too few samples.
    pub(crate) fn percentiles(&self) -> BTreeMap<&'static str, StagePercentiles> {
        let us = |ns: Option<u64>| ns.map(|ns| ns as f64 / 1e3);
        self.each(|distribution| {
            let reported = distribution.whole.percentiles_ns();
            StagePercentiles {
                p50_us: us(reported.p50),
                p90_us: us(reported.p90),
                p99_us: us(reported.p99),
                p999_us: us(reported.p999),
                max_us: us(reported.max),
                count: reported.count,
            }
        })
    }

    /// Bins on a logarithmic axis: upper limit in us, and samples.
    pub(crate) fn histograms(&self) -> Value {
        let bins = |samples: &Samples| -> Value {
            samples.bins().iter().map(|bin| json!([bin.to_ns as f64 / 1e3, bin.count])).collect()
        };
        let reported = self.each(|distribution| {
            let mut recent = Samples::default();
            distribution.recent.iter().for_each(|(_, samples)| recent.add(samples));
            json!({ "whole": bins(&distribution.whole), "last_10_s": bins(&recent) })
        });
        json!(reported)
    }

    /// The samples of the whole run, by name.
    pub(crate) fn samples(&self) -> impl Iterator<Item = (&'static str, &Samples)> {
        SHOWN.iter().zip(&self.distributions).map(|((name, _), distribution)| (*name, &distribution.whole))
    }

    fn each<T>(&self, of: impl Fn(&Distribution) -> T) -> BTreeMap<&'static str, T> {
        SHOWN
            .iter()
            .zip(&self.distributions)
            .map(|((name, _), distribution)| (*name, of(distribution)))
            .collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use latency::hlog::Interval;

    /// Lines of a log of a second with a hundred samples of this length.
    pub(crate) fn lines(tag: &str, start_s: f64, ns: u64) -> Vec<String> {
        let samples = std::iter::repeat_n(ns, 100).collect();
        let interval = Interval { tag: tag.into(), start_s, duration_s: 1.0, samples };
        let mut log = Vec::new();
        hlog::write(&mut log, 0.0, [&interval]).unwrap();
        String::from_utf8(log).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn what_is_old_counts_in_the_whole_alone() {
        let mut rhythm = LatencyHistograms::default();
        for second in 0..RECENT_S + 5 {
            for line in lines("emulator-wakeup", second as f64, if second < 5 { 50_000 } else { 10_000 }) {
                rhythm.take(&line).unwrap();
            }
        }
        let reported = rhythm.histograms();
        let count = |which: &str| -> u64 {
            let bins = reported["wake_up"][which].as_array().unwrap();
            bins.iter().map(|bin| bin[1].as_u64().unwrap()).sum()
        };
        assert_eq!((count("whole"), count("last_10_s")), (1500, 1000));
        assert_eq!(reported["wake_up"]["last_10_s"].as_array().unwrap().len(), 1, "all of one length");
        assert_eq!(rhythm.percentiles()["wake_up"].count, 1500);
        assert_eq!(rhythm.percentiles()["round_trip"].p50_us, None);
    }

    #[test]
    fn both_axes_count_as_round_trips_and_others_as_nothing() {
        let mut rhythm = LatencyHistograms::default();
        for tag in ["drive-round-trip", "load-round-trip", "emulator-step"] {
            lines(tag, 0.0, 20_000).iter().for_each(|line| rhythm.take(line).unwrap());
        }
        assert_eq!(rhythm.percentiles()["round_trip"].count, 200);
        assert!(rhythm.take("Tag=a,0,1,2,nothing").is_err());
    }
}
