//! The critical instant of a frame, simulated on the modelled wire and compared with the bound of the analysis.
//!
//! The longest frame of lower priority has just begun when the frame and all of higher priority are queued at once, and then
//! as early as their jitter allows. All frames of an identifier have one content, so that each has one stuffed length: with
//! differing contents, a bound made of the longest of each can extend over a period before whose end the simulated frames
//! are sent.

use super::rig::{RigAnalysis, RigFrame};
use crate::bus::host::FramesById;
use crate::can::CanFrame;
use crate::wire_time::{IdentifierReport, WireModel, WireTimeReport, WireTiming};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Response times of the model, and the bounds of the analysis for the frames that it sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CriticalInstant {
    /// Longest response on the model's clock, ns.
    pub measured_ns: u64,
    /// The bound with the stuffing of the frames that were sent, ns.
    pub bound_ns: u64,
}

/// Entry of a report for a frame.
#[must_use]
pub fn identifier_report<'a>(frame: &RigFrame, report: &'a WireTimeReport) -> Option<&'a IdentifierReport> {
    report.identifiers.get(&FramesById::name_of(u32::from(frame.message.id)))
}

/// Simulates the critical instant of the frame at `place` of the analysis, with contents drawn from `seed`. `None` without a
/// bound.
#[must_use]
pub fn simulate(analysis: &RigAnalysis, place: usize, seed: u64) -> Option<CriticalInstant> {
    let busy_ns = analysis.responses()[place]?.busy_period_ns;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut any_content = |frame: &RigFrame| {
        let bytes = random.next_u64().to_le_bytes();
        CanFrame::new(frame.message.id, &bytes[..usize::from(frame.message.length)])
    };
    let mut model = WireModel::new(WireTiming::at(analysis.bits_per_s), seed);
    let (level, below) = analysis.frames.split_at(place + 1);
    if let Some(longest) = below.iter().max_by_key(|frame| frame.bits) {
        let node = model.join();
        model.enter(node, any_content(longest), 0);
    }
    for frame in level {
        let (node, content) = (model.join(), any_content(frame));
        let times = (0..).map(|number| frame.arrivals.earliest_ns(number));
        times.take_while(|at_ns| *at_ns < busy_ns).for_each(|at_ns| model.enter(node, content, 1 + at_ns));
    }
    model.advance(10 * busy_ns, &mut Vec::new());
    let report = model.report();
    let sent = analysis.clone().with(|frame| {
        let seen = identifier_report(frame, &report);
        frame.bits = seen.map_or(0, |seen| seen.bits[1]);
        seen.is_some()
    });
    let frame = &analysis.frames[place];
    Some(CriticalInstant {
        measured_ns: identifier_report(frame, &report)?.response_ns.max,
        bound_ns: sent.response_of(frame.message.id)?.response_ns,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_model_comes_within_a_tenth_of_the_bound_with_the_stuffing_sent() {
        let analysis = RigAnalysis::worst_case(1_000_000);
        for (place, frame) in analysis.frames.iter().enumerate() {
            for seed in 0..50 {
                let CriticalInstant { measured_ns, bound_ns } = simulate(&analysis, place, seed).unwrap();
                let share = measured_ns as f64 / bound_ns as f64;
                let name = frame.message.name;
                assert!((0.9..=1.0).contains(&share), "{name}, seed {seed}: {measured_ns} of {bound_ns} ns");
            }
        }
    }
}
