//! Every effect in the emulator, alone and with others, in lockstep and in real time: finite, positive pressures, and no
//! cycle missed that would not be missed without it.
//!
//! Nothing is judged of the control: a controller that knows nothing of an extreme effect may well miss its target. That the
//! sum of a balance changes by exactly an effect's term is held in `plant`.

use plant::effects::SHEETS;
use plant::effects::sheet::ActiveEffect;
use std::sync::Mutex;
use std::thread;
use system_tests::hidden::{
    Extreme, LIVELY, LoopTiming, drawn, each_alone, everything, expect_physical, live, rig_with,
};
use system_tests::{Pace, Scene, Table, run_both, turn};

/// Each slice of a comparison in real time, s.
const SECONDS: u32 = 2;
const ROUNDS: usize = 3;

/// A run in lockstep with these effects, held against what every run must be.
fn lockstep(effects: &[ActiveEffect]) {
    let scene = Scene::new(LIVELY);
    let rig = rig_with(&scene, effects);
    run_both(
        &scene.emulator(Pace::Lockstep).rig(&rig).with("--seconds 1.3"),
        &scene.controller(Pace::Lockstep).with("--repeat"),
    );
    let path = scene.path("emulator/truth.csv");
    expect_physical(&path);
    let truth = Table::read(&path);
    truth.expect_no_hole();
    for effect in effects {
        let name = effect.name.replace('-', "_");
        assert!(truth.names().iter().any(|column| column.contains(&name)), "{effect:?} has no term");
    }
}

#[test]
fn each_effect_alone_leaves_the_rig_finite_in_lockstep() {
    let waiting = Mutex::new(each_alone());
    assert_eq!(waiting.lock().map(|effects| effects.len()).ok(), Some(SHEETS.len()));
    let next = || waiting.lock().expect("a worker that fails ends the test").pop();
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(effect) = next() {
                    lockstep(&[effect]);
                }
            });
        }
    });
}

#[test]
fn ten_effects_at_random_and_all_at_their_extremes_leave_the_rig_finite_in_lockstep() {
    for seed in 1..=5 {
        lockstep(&drawn(seed, 10));
    }
    for extreme in [Extreme::Most, Extreme::Least, Extreme::Mixed, Extreme::Drawn] {
        lockstep(&everything(extreme));
    }
}

/// Slices with and without effects in turns, so that what disturbs the machine disturbs both; the sums of each.
fn in_turns(effects: &[ActiveEffect]) -> [LoopTiming; 2] {
    let mut sums = [LoopTiming::default(); 2];
    for _ in 0..ROUNDS {
        for (sum, effects) in sums.iter_mut().zip([&[][..], effects]) {
            let scene = Scene::new(LIVELY);
            let slice = live(&scene, effects, SECONDS);
            expect_physical(&scene.path("run/truth.csv"));
            eprintln!("{} effects: {slice:?}", effects.len());
            sum.cycles += slice.cycles;
            sum.missed += slice.missed;
            sum.overworked += slice.overworked;
        }
    }
    sums
}

/// Effects that cost too much for the period would do so in every cycle, or in each one of a kind that comes again and again: a
/// movement that begins, a flow that turns. What happens besides is the machine's: it stands still, for both alike but not at the
/// same moment. So of the cycles that were missed only those count in which the rig's own thread worked longer than the period
/// while no other thread had its CPU, and with effects there may be one in a hundred cycles more than without: a machine
/// that stands still so often cannot be measured, and effects that are too slow reach far more.
#[track_caller]
fn expect_no_cycle_missed_for_them([without, with]: [LoopTiming; 2]) {
    let (cycles, allowed) = (with.cycles, without.overworked + with.cycles / 100);
    let LoopTiming { overworked, missed, .. } = with;
    assert!(
        overworked <= allowed,
        "{overworked} of {cycles} cycles outlasted their period by themselves ({missed} were missed), {} ({}) without effects",
        without.overworked,
        without.missed
    );
}

#[test]
fn ten_effects_at_random_miss_no_cycle_in_real_time_that_is_not_missed_without_them() {
    let _machine = turn::take();
    expect_no_cycle_missed_for_them(in_turns(&drawn(7, 10)));
}

#[test]
fn all_effects_at_their_extremes_miss_no_cycle_in_real_time_that_is_not_missed_without_them() {
    let _machine = turn::take();
    expect_no_cycle_missed_for_them(in_turns(&everything(Extreme::Mixed)));
}
