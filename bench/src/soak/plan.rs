//! Properties of each segment: experiment, processes, load and loss depend on its number alone, so that a resumed soak
//! continues as if it had not stopped.
//!
//! ```text
//!   way   processes   load   loss        the experiments go round at their own pace; when both rounds end together, the ways
//!    0       one       off     -         shift by one against them, so that every experiment is run every way
//!    1       two       on      -
//!    2       two       off    yes        a wire that loses frames needs the embedded bus
//!    3       one       on      -
//! ```

use serde::{Deserialize, Serialize};

/// Shortest segment, s: a shorter one has nothing between start and end.
pub(super) const SHORTEST_SEGMENT_S: f64 = 8.0;
/// Default length of a segment, s.
const USUAL_SEGMENT_S: f64 = 300.0;
/// Least number of segments of a soak: one of each condition.
const CONDITIONS: u32 = 4;
/// Time of a segment without a run of the rig, s: starting, ending, reading its files.
const SEGMENT_OVERHEAD_S: f64 = 2.5;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SegmentSpec {
    /// Its number, from 1.
    pub number: u32,
    pub experiment: String,
    /// Whether each axis has its own controller process.
    pub two_processes: bool,
    /// Whether the load generator runs.
    pub load: bool,
    /// Probability of an injected loss of a frame; null without injection.
    pub loss: Option<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub experiments: Vec<String>,
    /// Whether there is a load generator.
    pub load: bool,
    /// Probability of loss in the segments with loss; null without any.
    pub loss: Option<f64>,
}

impl Plan {
    pub(super) fn segment(&self, number: u32) -> SegmentSpec {
        let place = number - 1;
        let count = self.experiments.len() as u32;
        let way = (place + place / least_common_multiple(count, CONDITIONS)) % CONDITIONS;
        SegmentSpec {
            number,
            experiment: self.experiments[(place % count) as usize].clone(),
            two_processes: matches!(way, 1 | 2),
            load: self.load && matches!(way, 1 | 3),
            loss: self.loss.filter(|_| way == 2),
        }
    }
}

impl SegmentSpec {
    pub(crate) fn folder(&self) -> String {
        format!("{:04}-{}", self.number, self.experiment)
    }

    /// Its properties for messages.
    pub(crate) fn description(&self) -> String {
        let mut words =
            vec![if self.two_processes { "two controllers" } else { "one controller" }.to_owned()];
        words.extend(self.load.then(|| "under load".to_owned()));
        words.extend(self.loss.map(|loss| format!("{} % loss", loss * 100.0)));
        words.join(", ")
    }
}

/// Length of a segment including start and end, for a soak of `planned_s`.
pub(super) fn segment_s(asked_s: Option<f64>, planned_s: f64) -> f64 {
    asked_s.unwrap_or_else(|| (planned_s / f64::from(CONDITIONS)).clamp(SHORTEST_SEGMENT_S, USUAL_SEGMENT_S))
}

/// Run time of the rig in the next segment, of length `segment_s`; `None` when too little of the soak is left.
pub(super) fn rig_s(segment_s: f64, left_s: f64) -> Option<f64> {
    // The last segment is longer or shorter than the others instead of a remainder of its own.
    let with_rest = if left_s < segment_s + SHORTEST_SEGMENT_S { left_s } else { segment_s };
    (with_rest >= SHORTEST_SEGMENT_S).then(|| ((with_rest - SEGMENT_OVERHEAD_S) * 10.0).round() / 10.0)
}

fn least_common_multiple(a: u32, b: u32) -> u32 {
    let (mut greatest, mut rest) = (a, b);
    while rest > 0 {
        (greatest, rest) = (rest, greatest % rest);
    }
    a / greatest * b
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn plan(count: usize) -> Plan {
        let experiments = (0..count).map(|place| format!("e{place}")).collect();
        Plan { experiments, load: true, loss: Some(0.01) }
    }

    #[test]
    fn every_experiment_is_run_every_way() {
        for count in 1..=13 {
            let plan = plan(count);
            let specs: BTreeSet<_> = (1..=count as u32 * 16)
                .map(|number| plan.segment(number))
                .map(|spec| (spec.experiment, spec.two_processes, spec.load, spec.loss.is_some()))
                .collect();
            assert_eq!(specs.len(), count * 4, "{count} experiments");
        }
    }

    #[test]
    fn the_first_four_segments_are_the_four_ways() {
        let specs: Vec<_> = (1..=4).map(|number| plan(5).segment(number)).collect();
        let ways: Vec<_> =
            specs.iter().map(|spec| (spec.two_processes, spec.load, spec.loss.is_some())).collect();
        assert_eq!(
            ways,
            [(false, false, false), (true, true, false), (true, false, true), (false, true, false)]
        );
        assert_eq!(specs[2].folder(), "0003-e2");
        assert_eq!(specs[2].description(), "two controllers, 1 % loss");
    }

    #[test]
    fn without_load_and_loss_there_is_none() {
        let plan = Plan { load: false, loss: None, ..plan(3) };
        assert!((1..20).map(|number| plan.segment(number)).all(|spec| !spec.load && spec.loss.is_none()));
    }

    #[test]
    fn three_minutes_are_four_segments_of_some_forty_seconds() {
        let length_s = segment_s(None, 180.0);
        let (mut left_s, mut segments) = (180.0, Vec::new());
        while let Some(rig_s) = rig_s(length_s, left_s) {
            segments.push(rig_s);
            left_s -= rig_s + SEGMENT_OVERHEAD_S;
        }
        assert_eq!(segments, [42.5; 4]);
        assert_eq!(segment_s(None, 36_000.0), 300.0);
        assert_eq!(segment_s(Some(60.0), 36_000.0), 60.0);
        assert_eq!(rig_s(300.0, 7.0), None);
        assert_eq!(rig_s(300.0, 306.0), Some(303.5));
    }
}
