//! The modelled wire against the response-time analysis: all frames of `rig.dbc`, on the model's own clock.
//!
//! No phasing exceeds the bound with worst-case stuffing, and errors stay below the bound that allows for them. How close the
//! model comes at the critical instant is held in `response_time/critical.rs`.

use proptest::prelude::*;
use protocol::can::CanFrame;
use protocol::frames::MessageSpec;
use protocol::response_time::ErrorBound;
use protocol::response_time::rig::{RigAnalysis, RigFrame};
use protocol::wire_time::{WireModel, WireTimeReport, WireTiming};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BITS_PER_S: u32 = 1_000_000;
const MS: u64 = 1_000_000;

fn any_frame(message: &MessageSpec, random: &mut Pcg64Mcg) -> CanFrame {
    CanFrame::new(message.id, &random.next_u64().to_le_bytes()[..usize::from(message.length)])
}

fn run(model: &mut WireModel, to_ns: u64) -> WireTimeReport {
    model.advance(to_ns, &mut Vec::new());
    model.report()
}

fn name(message: &MessageSpec) -> String {
    format!("{:03X}", message.id)
}

/// As early as it may: the first at `from_ns`, the next as soon as its arrivals allow, for `time_ns`.
fn release_as_early_as_allowed(
    model: &mut WireModel,
    frame: &RigFrame,
    [from_ns, time_ns]: [u64; 2],
    random: &mut Pcg64Mcg,
) {
    let node = model.join();
    let times = (0..).map(|number| frame.arrivals.earliest_ns(number));
    for at_ns in times.take_while(|at_ns| *at_ns < time_ns) {
        model.enter(node, any_frame(frame.message, random), from_ns + at_ns);
    }
}

/// All frames with any phase and any content, each as often as it may come.
fn any_phasing(analysis: &RigAnalysis, timing: WireTiming, seed: u64) -> WireTimeReport {
    const TIME_NS: u64 = 60 * MS;
    let mut model = WireModel::new(timing, seed);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for frame in &analysis.frames {
        let from_ns = random.next_u64() % (10 * MS);
        release_as_early_as_allowed(&mut model, frame, [from_ns, TIME_NS], &mut random);
    }
    run(&mut model, 10 * TIME_NS)
}

fn expect_below(analysis: &RigAnalysis, seen: &WireTimeReport) -> Result<(), TestCaseError> {
    for (frame, bound) in analysis.frames.iter().zip(analysis.responses()) {
        let measured_ns = seen.identifiers[&name(frame.message)].response_ns.max;
        let bound_ns = bound.unwrap().response_ns;
        prop_assert!(measured_ns <= bound_ns, "{}: {measured_ns} of {bound_ns} ns", frame.message.name);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_phasing_exceeds_the_bound_with_worst_case_stuffing(seed: u64) {
        let analysis = RigAnalysis::worst_case(BITS_PER_S);
        expect_below(&analysis, &any_phasing(&analysis, WireTiming::at(BITS_PER_S), seed))?;
    }

    /// As many errors as were drawn, all at once, is more than any that were spread.
    #[test]
    fn errors_stay_below_the_bound_that_allows_for_them(seed: u64) {
        let timing = WireTiming { error_rate: 0.005, ..WireTiming::at(BITS_PER_S) };
        let analysis = RigAnalysis::worst_case(BITS_PER_S);
        let seen = any_phasing(&analysis, timing, seed);
        let errors = ErrorBound { burst: seen.errors, distance_ns: 1_000_000 * MS };
        expect_below(&analysis.with_errors(errors), &seen)?;
    }
}
