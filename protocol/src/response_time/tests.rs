//! The analysis against the paper's example, and against a wire that was searched for its worst case.

use super::*;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

fn stream(transmission_ns: u64, period_ns: u64) -> Stream {
    Stream { transmission_ns, arrivals: Arrivals::periodic(period_ns) }
}

fn responses(streams: &[Stream], line: &Line) -> Vec<Option<u64>> {
    (0..streams.len()).map(|place| Some(response(streams, place, line)?.response_ns)).collect()
}

/// Table 3 of the paper: 125 bits each at 125 kbit/s. The first instance of C is through after 3 ms, which is what was taken for
/// its worst case before; the second takes 3.5 ms.
#[test]
fn the_papers_example_is_met() {
    let streams = [stream(MS, 2_500_000), stream(MS, 3_500_000), stream(MS, 3_500_000)];
    let line = Line { bit_ns: 8_000, errors: None };
    assert_eq!(responses(&streams, &line), [Some(2 * MS), Some(3 * MS), Some(3_500_000)]);
    let worst = response(&streams, 2, &line).unwrap();
    assert_eq!((worst.busy_period_ns, worst.worst_instance, worst.blocking_ns), (7 * MS, 1, 0));
}

#[test]
fn a_full_wire_has_no_worst_case() {
    let streams = [stream(MS, 2 * MS), stream(MS, 2 * MS), stream(MS, 100 * MS)];
    let line = Line { bit_ns: 1_000, errors: None };
    let found = responses(&streams, &line);
    assert!(found[0].is_some() && found[1].is_none() && found[2].is_none(), "{found:?}");
}

/// By hand: one error in the busy period costs 31 bits and the longest frame of the level again.
#[test]
fn an_error_costs_its_flag_and_a_frame() {
    let streams = [stream(100_000, 10 * MS), stream(130_000, 10 * MS)];
    let errors = Some(ErrorBound { burst: 1, distance_ns: 1_000 * MS });
    let line = Line { bit_ns: 1_000, errors };
    let expected = [130_000 + 100_000 + 31_000 + 100_000, 100_000 + 130_000 + 31_000 + 130_000];
    assert_eq!(responses(&streams, &line), expected.map(Some));
}

#[test]
fn bursts_and_jitter_are_counted_as_they_come() {
    let burst = Arrivals::bursts(3, MS, 10 * MS);
    assert_eq!(
        [0, 1, MS, MS + 1, 2 * MS + 1, 9 * MS, 10 * MS + 1].map(|t| burst.most_in(t)),
        [0, 1, 1, 2, 3, 3, 4]
    );
    assert_eq!([0, 1, 2, 3, 4].map(|n| burst.earliest_ns(n)), [0, MS, 2 * MS, 10 * MS, 20 * MS]);
    let late = Arrivals { jitter_ns: 50_000, ..Arrivals::periodic(MS) };
    assert_eq!([950_000, 950_001].map(|t| late.most_in(t)), [1, 2]);
}

/// A wire without preemption, ticks of one bit: the longest response of each stream, with these first releases.
fn simulated(streams: &[(u64, u64)], offsets: &[u64], horizon: u64) -> Vec<u64> {
    let mut queue: Vec<Vec<u64>> = vec![Vec::new(); streams.len()];
    let mut worst = vec![0; streams.len()];
    let mut sending: Option<(usize, u64, u64)> = None;
    for now in 0..horizon {
        if let Some((who, released, end)) = sending
            && end == now
        {
            worst[who] = worst[who].max(now - released);
            sending = None;
        }
        for (who, (_, period)) in streams.iter().enumerate() {
            if now >= offsets[who] && (now - offsets[who]).is_multiple_of(*period) {
                queue[who].push(now);
            }
        }
        if sending.is_none()
            && let Some(who) = queue.iter().position(|waiting| !waiting.is_empty())
        {
            sending = Some((who, queue[who].remove(0), now + streams[who].0));
        }
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Small wires, all phasings that matter: the bound is never exceeded, and the worst phasing is that of a blocking frame of
    /// which the one bit is gone by which it must have begun before. (That bit may cost more than its own time: another frame
    /// of higher priority gets in.)
    #[test]
    fn the_bound_is_the_worst_of_all_phasings(
        streams in proptest::collection::vec((2..6_u64, 12..30_u64), 2..5),
    ) {
        let load: f64 = streams.iter().map(|(c, t)| *c as f64 / *t as f64).sum();
        prop_assume!(load < 0.85);
        let line = Line { bit_ns: 1, errors: None };
        let analysed: Vec<_> = streams.iter().map(|(c, t)| stream(*c, *t)).collect();
        for place in 0..streams.len() {
            let bound = response(&analysed, place, &line).unwrap();
            // The critical instant: everything of this and higher priority at 1, the longest lower one at 0.
            let below = (place + 1..streams.len()).max_by_key(|who| streams[*who].0);
            let offset = |who: usize| match () {
                () if who <= place => 1,
                () if Some(who) == below => 0,
                () => 10_000,
            };
            let offsets: Vec<_> = (0..streams.len()).map(offset).collect();
            let horizon = bound.busy_period_ns + 200;
            let seen = simulated(&streams, &offsets, horizon)[place];
            let begun = below.map(|who| stream(streams[who].0 - 1, streams[who].1));
            let left: Vec<_> = analysed[..=place].iter().cloned().chain(begun).collect();
            prop_assert_eq!(seen, response(&left, place, &line).unwrap().response_ns);
            prop_assert!(seen <= bound.response_ns, "{} of {:?}", seen, bound);
        }
    }

    #[test]
    fn no_phasing_exceeds_the_bound(
        streams in proptest::collection::vec((2..6_u64, 12..30_u64, 0..30_u64), 2..6),
    ) {
        let analysed: Vec<_> = streams.iter().map(|(c, t, _)| stream(*c, *t)).collect();
        let (plain, offsets): (Vec<_>, Vec<_>) = streams.iter().map(|(c, t, o)| ((*c, *t), *o)).unzip();
        let seen = simulated(&plain, &offsets, 3_000);
        for (place, seen) in seen.into_iter().enumerate() {
            if let Some(bound) = response(&analysed, place, &Line { bit_ns: 1, errors: None }) {
                prop_assert!(seen <= bound.response_ns, "{place}: {seen} of {bound:?}");
            }
        }
    }
}
