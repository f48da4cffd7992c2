//! With the counting allocator registered: what it counts, and that a running loop gives it nothing to count.
//!
//! A file of its own, since the allocator and its counter belong to the whole process; for the same reason the tests
//! take turns.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use realtime::allocations::{CountingAllocator, count_scope, counted, reset};
use realtime::{Clock, MonotonicClock, OverrunPolicy, PeriodicConfig, PeriodicLoop, Recorder, VirtualClock};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn counter_for_this_test_alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    reset();
    turn
}

fn push_one() -> Vec<u64> {
    let mut vector = Vec::new();
    black_box(&mut vector).push(1);
    vector
}

#[test]
fn a_push_is_counted_inside_the_scope_and_not_outside() {
    let _turn = counter_for_this_test_alone();
    drop(push_one());
    assert_eq!(counted(), 0);

    let scope = count_scope();
    let vector = push_one();
    assert_eq!(counted(), 1);
    drop(vector);
    assert_eq!(counted(), 2, "giving back counts too");
    drop(scope);

    drop(push_one());
    assert_eq!(counted(), 2);
}

#[test]
fn growing_and_zeroed_blocks_are_counted() {
    let _turn = counter_for_this_test_alone();
    let mut vector = push_one();
    {
        let _scope = count_scope();
        vector.reserve_exact(black_box(1000));
        assert_eq!(counted(), 1);
        black_box(vec![0_u8; black_box(1000)]);
        assert_eq!(counted(), 3);
    }
}

#[test]
fn another_thread_is_not_counted() {
    let _turn = counter_for_this_test_alone();
    let (go, done) = (AtomicBool::new(false), AtomicBool::new(false));
    // Flags, not channels: waiting for them makes no call of this thread's own.
    let wait_for = |flag: &AtomicBool| {
        while !flag.load(Ordering::Acquire) {
            std::hint::spin_loop();
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            wait_for(&go);
            (0..100).for_each(|_| drop(push_one()));
            done.store(true, Ordering::Release);
        });
        let _scope = count_scope();
        go.store(true, Ordering::Release);
        wait_for(&done);
        assert_eq!(counted(), 0);
    });
}

#[test]
fn a_scope_in_a_scope_ends_with_the_outer_one() {
    let _turn = counter_for_this_test_alone();
    let outer = count_scope();
    drop(count_scope());
    let vector = push_one();
    drop(outer);
    assert_eq!(counted(), 1);
    drop(vector);
}

#[test]
fn a_loop_of_thousands_of_cycles_allocates_nothing_for_any_wobble() {
    let _turn = counter_for_this_test_alone();
    let clock = VirtualClock::new().with_seeded_jitter(1, Duration::from_micros(2500));
    let period = Duration::from_millis(1);
    let config =
        PeriodicConfig { period, policy: OverrunPolicy::CatchUp, spin: Some(Duration::from_micros(100)) };
    let mut periodic = PeriodicLoop::new(&clock, config, clock.now() + period);
    let mut recorder = Recorder::new();

    let scope = count_scope();
    for _ in 0..5000 {
        let cycle = periodic.next_cycle().expect("catches up");
        clock.advance(Duration::from_micros(300));
        recorder.record(cycle.wakeup_latency().as_nanos() as u64);
        recorder.record(u64::MAX);
        periodic.end_of_work();
    }
    clock.step_forward(Duration::from_secs(3600));
    periodic.next_cycle().expect("catches up");
    drop(scope);

    assert_eq!(counted(), 0);
    assert!(periodic.statistics.overruns > 0, "the rare paths ran too");
}

#[test]
fn the_real_clock_and_an_overrun_that_stops_allocate_nothing() {
    let _turn = counter_for_this_test_alone();
    let clock = MonotonicClock;
    let period = Duration::from_micros(100);
    let config =
        PeriodicConfig { period, policy: OverrunPolicy::Stop, spin: Some(Duration::from_micros(10)) };
    // Due long ago, so that it must stop, whatever the machine does.
    let mut periodic = PeriodicLoop::new(clock, config, clock.now().saturating_sub(Duration::from_millis(1)));

    let scope = count_scope();
    clock.wait_until(clock.now() + period);
    let outcome = periodic.next_cycle();
    drop(scope);

    assert!(outcome.is_err());
    assert_eq!(counted(), 0);
}
