//! The rules of the periodic loop, each on a virtual clock, so that every number is exact and no test waits.

use std::time::Duration;

use realtime::{
    Clock, Cycle, Instant, LoopStatistics, Overrun, OverrunPolicy, PeriodicConfig, PeriodicLoop, Recorder,
    VirtualClock,
};

const MS: Duration = Duration::from_millis(1);
const US: Duration = Duration::from_micros(1);
const START: Instant = Instant::from_nanos(1_000_000_000);
const CATCH_UP: PeriodicConfig = PeriodicConfig { period: MS, policy: OverrunPolicy::CatchUp, spin: None };
const STOP: PeriodicConfig = PeriodicConfig { policy: OverrunPolicy::Stop, ..CATCH_UP };

fn catching_up(clock: VirtualClock) -> PeriodicLoop<VirtualClock> {
    PeriodicLoop::new(clock, CATCH_UP, START)
}

fn next<C: Clock>(periodic: &mut PeriodicLoop<C>) -> Cycle {
    periodic.next_cycle().expect("the policy is to catch up")
}

/// What was recorded, as (value, count), to be compared with whole microseconds.
fn recorded(recorder: &Recorder) -> Vec<(u64, u64)> {
    recorder.histogram().iter_recorded().map(|bin| (bin.value_iterated_to(), bin.count_at_value())).collect()
}

/// The same of values that are known, through a recorder, so that both are rounded to the same bins.
fn bins(values: impl IntoIterator<Item = Duration>) -> Vec<(u64, u64)> {
    let mut recorder = Recorder::new();
    values.into_iter().for_each(|value| recorder.record(value.as_nanos() as u64));
    recorded(&recorder)
}

fn sums_agree(statistics: &LoopStatistics, last: Cycle) {
    assert_eq!(statistics.cycles + statistics.skipped, last.index + 1);
    assert_eq!(statistics.wakeup_ns.percentiles().count, statistics.cycles + statistics.skipped);
}

#[test]
fn the_first_cycle_is_due_at_the_start() {
    let cycle = next(&mut catching_up(VirtualClock::new()));
    assert_eq!(cycle, Cycle { index: 0, scheduled: START, woke: START, skipped: 0 });
}

#[test]
fn re_armed_after_the_deadline_late_wake_ups_do_not_add_up() {
    // The numbers in the head of periodic.rs: 70 us late each time, and a clock 100 ppm fast under it.
    let clock = VirtualClock::new().with_drift_ppb(100_000).with_late_wakeups(vec![70 * US; 100_000]);
    let mut periodic = catching_up(clock);
    for index in 0..100_000_u32 {
        let cycle = next(&mut periodic);
        assert_eq!(cycle.scheduled, START + index * MS);
        // A clock that runs fast has readings that it skips: 1 ns.
        assert!(cycle.wakeup_latency() - 70 * US <= Duration::from_nanos(1));
    }
    let statistics = periodic.statistics;
    assert_eq!((statistics.cycles, statistics.skipped, statistics.overruns), (100_000, 0, 0));
}

#[test]
fn re_armed_after_the_wake_up_the_same_wake_ups_would_lose_70_ms_in_1000_cycles() {
    // The other rule, to show what the first one is for.
    let clock = VirtualClock::new().with_late_wakeups(vec![70 * US; 1000]);
    let mut deadline = START;
    for _ in 0..1000 {
        clock.wait_until(deadline);
        deadline = clock.now() + MS;
    }
    assert_eq!(deadline - (START + 1000 * MS), 70 * MS);
}

#[test]
fn a_stall_of_50_ms_shows_all_50_late_cycles() {
    let mut periodic = catching_up(VirtualClock::new());
    for _ in 0..100 {
        next(&mut periodic);
    }
    // Cycle 99 stalls from its wake-up to 50 ms after the deadline of cycle 100.
    periodic.clock.advance(51 * MS);
    let cycle = next(&mut periodic);
    assert_eq!((cycle.index, cycle.skipped), (150, 50));
    assert_eq!(cycle.scheduled, START + 150 * MS);
    assert_eq!(cycle.woke, cycle.scheduled);

    let statistics = &periodic.statistics;
    assert_eq!((statistics.cycles, statistics.skipped, statistics.overruns), (101, 50, 1));
    let on_time = std::iter::repeat_n(Duration::ZERO, 101);
    assert_eq!(recorded(&statistics.wakeup_ns), bins((1..=50_u32).map(|n| n * MS).chain(on_time)));
    sums_agree(statistics, cycle);
}

#[test]
fn less_than_a_period_late_is_late_and_skips_nothing() {
    let almost = MS - Duration::from_nanos(1);
    let clock = VirtualClock::new().with_late_wakeups([almost]);
    let mut periodic = PeriodicLoop::new(&clock, STOP, START);
    let cycle = periodic.next_cycle().expect("not a whole period late");
    assert_eq!((cycle.index, cycle.skipped, cycle.wakeup_latency()), (0, 0, almost));
}

#[test]
fn exactly_a_period_late_skips_one() {
    let mut periodic = catching_up(VirtualClock::new().with_late_wakeups([MS]));
    let cycle = next(&mut periodic);
    assert_eq!((cycle.index, cycle.skipped, cycle.wakeup_latency()), (1, 1, Duration::ZERO));
}

#[test]
fn catching_up_hands_out_the_newest_cycle_and_goes_on_at_the_next() {
    let mut periodic = catching_up(VirtualClock::new().with_late_wakeups([Duration::ZERO, 2600 * US]));
    let indices = [0; 4].map(|_| {
        let cycle = next(&mut periodic);
        (cycle.index, cycle.skipped, cycle.wakeup_latency())
    });
    assert_eq!(
        indices,
        [(0, 0, Duration::ZERO), (3, 2, 600 * US), (4, 0, Duration::ZERO), (5, 0, Duration::ZERO)]
    );
}

#[test]
fn stopping_names_the_first_missed_cycle_and_stays_stopped() {
    let clock = VirtualClock::new().with_late_wakeups([Duration::ZERO, 2600 * US]);
    let mut periodic = PeriodicLoop::new(&clock, STOP, START);
    periodic.next_cycle().expect("on time");
    let overrun = periodic.next_cycle().expect_err("2.6 ms late");
    assert_eq!(overrun, Overrun { index: 1, late_by: 2600 * US, skipped: 2 });
    assert_eq!(
        overrun.to_string(),
        "overrun: cycle 1 woke 2.6ms late, 2 cycles were missed, and the policy is to stop"
    );
    let stopped_at = clock.now();
    assert_eq!(periodic.next_cycle(), Err(overrun));
    periodic.end_of_work();
    assert_eq!(clock.now(), stopped_at);

    let statistics = periodic.statistics;
    assert_eq!((statistics.cycles, statistics.skipped, statistics.overruns), (1, 2, 1));
    assert_eq!(recorded(&statistics.wakeup_ns), bins([Duration::ZERO, 2600 * US, 1600 * US]));
    assert_eq!(statistics.execution_ns.percentiles().count, 0);
}

#[test]
fn each_cycle_that_was_due_is_recorded_once_for_any_wobble() {
    for seed in 0..100 {
        let mut periodic = catching_up(VirtualClock::new().with_seeded_jitter(seed, 3 * MS));
        let mut expected_index = 0;
        let mut last = None;
        for _ in 0..500 {
            let cycle = next(&mut periodic);
            assert_eq!(cycle.index, expected_index + cycle.skipped);
            assert_eq!(cycle.scheduled, START + cycle.index as u32 * MS);
            assert!(cycle.wakeup_latency() < MS);
            expected_index = cycle.index + 1;
            last = Some(cycle);
        }
        assert!(periodic.statistics.overruns > 0);
        sums_agree(&periodic.statistics, last.expect("500 cycles"));
    }
}

#[test]
fn with_spin_a_wake_up_that_is_less_late_than_the_spin_is_on_time() {
    let clock = VirtualClock::new().with_late_wakeups([70 * US, 70 * US, 130 * US]);
    let config = PeriodicConfig { spin: Some(100 * US), ..CATCH_UP };
    let mut periodic = PeriodicLoop::new(&clock, config, START);
    let latencies = [0; 4].map(|_| next(&mut periodic).wakeup_latency());
    // Woken 100 us early and 130 us late of that: 30 us after the deadline.
    assert_eq!(latencies, [Duration::ZERO, Duration::ZERO, 30 * US, Duration::ZERO]);
}

#[test]
fn a_forward_step_of_the_clock_is_an_overrun_like_any_other() {
    let mut periodic = catching_up(VirtualClock::new());
    next(&mut periodic);
    periodic.clock.step_forward(5500 * US);
    let cycle = next(&mut periodic);
    assert_eq!((cycle.index, cycle.skipped, cycle.wakeup_latency()), (5, 4, 500 * US));
}

#[test]
fn a_backward_step_of_the_clock_repeats_no_cycle() {
    let mut periodic = catching_up(VirtualClock::new());
    next(&mut periodic);
    let before = periodic.clock.true_elapsed();
    periodic.clock.step_back(3 * MS);
    periodic.end_of_work();
    let cycle = next(&mut periodic);
    assert_eq!((cycle.index, cycle.skipped, cycle.wakeup_latency()), (1, 0, Duration::ZERO));
    // It waits out what the clock shows twice.
    assert_eq!(periodic.clock.true_elapsed() - before, 4 * MS);
    assert_eq!(periodic.statistics.execution_ns.percentiles().max, Some(0));
}

#[test]
fn a_step_of_a_year_is_counted_in_full_and_ends() {
    let mut periodic = catching_up(VirtualClock::new());
    next(&mut periodic);
    let year = Duration::from_secs(365 * 86_400);
    periodic.clock.step_forward(year);
    let cycle = next(&mut periodic);
    assert_eq!(u128::from(cycle.index), year.as_millis());
    let statistics = &periodic.statistics;
    sums_agree(statistics, cycle);
    // Cycles 1 ms to 60 s late are distinguished, those before them stand at the bound: latency of cycle n is year − n ms.
    let within_bound = 60_000;
    assert_eq!(statistics.wakeup_ns.beyond_bound, statistics.skipped - within_bound);
}

#[test]
fn the_period_error_is_the_change_of_lateness() {
    let late = [0, 70, 20, 20, 2600].map(|us| us * US);
    let mut periodic = catching_up(VirtualClock::new().with_late_wakeups(late));
    for _ in late {
        next(&mut periodic);
    }
    // 70 − 0, 20 − 70, 20 − 20; the last one is 600 us late for the cycle it is handed out as.
    assert_eq!(recorded(&periodic.statistics.period_error_ns), bins([70, 50, 0, 580].map(|us| us * US)));
}

#[test]
fn execution_time_runs_from_the_wake_up_to_the_end_of_work() {
    let mut periodic = catching_up(VirtualClock::new().with_late_wakeups([300 * US]));
    periodic.end_of_work();
    next(&mut periodic);
    periodic.clock.advance(200 * US);
    periodic.end_of_work();
    periodic.clock.advance(200 * US);
    periodic.end_of_work();
    assert_eq!(recorded(&periodic.statistics.execution_ns), bins([200 * US]));
}

#[test]
fn work_that_ends_after_the_next_deadline_is_a_late_completion() {
    let mut periodic = catching_up(VirtualClock::new().with_late_wakeups([900 * US]));
    for (work, late_completions) in [(100 * US, 0), (MS, 0), (MS + Duration::from_nanos(1), 1), (US, 1)] {
        next(&mut periodic);
        periodic.clock.advance(work);
        periodic.end_of_work();
        assert_eq!(periodic.statistics.late_completions, late_completions, "after {work:?} of work");
    }
}

#[test]
fn a_start_in_the_past_begins_with_an_overrun() {
    let mut periodic = catching_up(VirtualClock::starting_at(START + 10 * MS));
    let cycle = next(&mut periodic);
    assert_eq!((cycle.index, cycle.skipped), (10, 10));
}

#[test]
#[should_panic(expected = "allowed is less than the period")]
fn a_loop_with_a_spin_of_a_whole_period_is_a_bug_that_panics() {
    let _ = PeriodicLoop::new(VirtualClock::new(), PeriodicConfig { spin: Some(MS), ..STOP }, START);
}

#[test]
fn statistics_serialise_with_percentiles() {
    let mut periodic = catching_up(VirtualClock::new());
    next(&mut periodic);
    let json = serde_json::to_value(&periodic.statistics).expect("serialises");
    assert_eq!(json["cycles"], 1);
    assert_eq!(json["wakeup_ns"]["p99"], 0);
    assert_eq!(json["period_error_ns"]["p99"], serde_json::Value::Null);
}
