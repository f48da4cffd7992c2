//! Cycles, losses, late frames and duplicates, as a rig would send them.

use super::*;

fn tick(cycle: u32, skipped: u16) -> Tick {
    Tick { cycle, skipped, ..Tick::default() }
}

fn sensors(cycle: u64) -> Sensors {
    // Their noise tells the frames of two cycles apart.
    Sensors { alive: (cycle % 16) as u8, position_m: cycle as f64, ..Sensors::default() }
}

fn take_both(view: &mut RigView, cycle: u64) {
    Axis::ALL.iter().for_each(|axis| view.take_sensors(*axis, sensors(cycle)));
}

/// The view of a rig whose frames of `cycles` came, without those that `lost` names.
fn played(cycles: std::ops::Range<u64>, lost: &[u64]) -> RigView {
    let mut view = RigView::default();
    play(&mut view, cycles, lost);
    view
}

/// Plays the rig's frames of `cycles`, without those that `lost` names.
fn play(view: &mut RigView, cycles: std::ops::Range<u64>, lost: &[u64]) {
    play_after(0, view, cycles, lost);
}

/// The same after so many skipped cycles.
fn play_after(skipped: u16, view: &mut RigView, cycles: std::ops::Range<u64>, lost: &[u64]) {
    for cycle in cycles {
        if !lost.contains(&cycle) {
            take_both(view, cycle);
        }
        if cycle % 10 == 0 {
            view.take_tick(&tick(cycle as u32, skipped));
        }
    }
}

#[test]
fn sensors_without_a_tick_have_no_cycle() {
    let mut view = RigView::default();
    view.take_sensors(Axis::Drive, sensors(7));
    assert!(view.fresh_sensors(Axis::Drive).is_none());
}

#[test]
fn each_frame_has_its_cycle_and_is_fresh_once() {
    let mut view = played(5000..5011, &[]);
    assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 5010);
    assert!(view.fresh_sensors(Axis::Drive).is_none());
    view.take_sensors(Axis::Drive, sensors(5013));
    assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 5013);
    assert_eq!(view.fresh_sensors(Axis::Load).unwrap().0, 5010, "the load's frame is an older one");
}

#[test]
fn lost_frames_are_counted_exactly() {
    let view = played(0..1001, &[3, 15, 16, 17, 500]);
    assert_eq!(view.lost, PerAxis { drive: 5, load: 5 });
}

#[test]
fn a_late_frame_is_counted_and_answered_by_nobody() {
    let mut view = played(0..98, &[95]);
    let _ = view.fresh_sensors(Axis::Drive);
    view.take_sensors(Axis::Drive, sensors(95));
    assert!(view.fresh_sensors(Axis::Drive).is_none());
    assert_eq!((view.cycle, view.late), (Some(97), PerAxis { drive: 1, load: 0 }));
    play(&mut view, 98..201, &[]);
    assert_eq!(view.lost, PerAxis { drive: 0, load: 1 }, "what came late did come");
}

#[test]
fn a_frame_later_than_the_tick_that_missed_it_is_not_lost_in_the_end() {
    let mut view = played(0..101, &[99]);
    assert_eq!(view.lost.drive, 1);
    view.take_sensors(Axis::Drive, sensors(99));
    play(&mut view, 101..151, &[]);
    assert_eq!((view.lost, view.late.drive), (PerAxis { drive: 0, load: 1 }, 1));
}

#[test]
fn a_duplicate_is_counted_and_hides_no_loss() {
    let mut view = played(0..98, &[93]);
    let _ = view.fresh_sensors(Axis::Load);
    for again in [97, 96, 97] {
        view.take_sensors(Axis::Load, sensors(again));
    }
    assert!(view.fresh_sensors(Axis::Load).is_none());
    play(&mut view, 98..201, &[]);
    assert_eq!((view.duplicate, view.late), (PerAxis { drive: 0, load: 3 }, PerAxis::default()));
    assert_eq!(view.lost, PerAxis { drive: 1, load: 1 });
}

#[test]
fn a_gap_after_which_the_counter_is_behind_is_no_late_frame() {
    for gap in 13..=17 {
        let mut view = played(0..100, &[]);
        view.take_sensors(Axis::Drive, sensors(99 + gap));
        assert_eq!((view.late, view.duplicate), (PerAxis::default(), PerAxis::default()), "{gap}");
        assert!(view.fresh_sensors(Axis::Drive).is_some());
    }
}

#[test]
fn more_lost_frames_than_the_counter_can_tell_are_found_by_the_tick() {
    let mut view = RigView::default();
    let lost: Vec<u64> = (101..148).collect();
    play(&mut view, 0..201, &lost);
    assert_eq!(view.lost.drive, 47);
}

#[test]
fn skipped_cycles_are_not_lost() {
    let mut view = played(0..101, &[]);
    view.take_tick(&Tick { catch_up: true, ..tick(151, 50) });
    play_after(50, &mut view, 151..201, &[]);
    assert_eq!((view.lost.drive, view.skipped), (0, 50));
    view.take_sensors(Axis::Drive, sensors(201));
    assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 201);
}

#[test]
fn a_stall_of_more_cycles_than_the_tick_can_count_loses_nothing() {
    let mut view = played(0..101, &[]);
    let skipped = (100_000 % SKIPPED_RANGE) as u16;
    view.take_tick(&Tick { catch_up: true, ..tick(100_101, skipped) });
    play_after(skipped, &mut view, 100_101..100_201, &[]);
    assert_eq!((view.lost.drive, view.skipped), (0, 100_000));
}

#[test]
fn the_cycle_goes_on_when_the_ticks_counter_wraps() {
    let mut view = RigView::default();
    let last = u64::from(u32::MAX);
    view.take_tick(&tick(u32::MAX - 5, 0));
    (last - 4..=last + 5).for_each(|cycle| take_both(&mut view, cycle));
    assert_eq!(view.take_tick(&tick(4, 0)), TickEvent::Usual);
    assert_eq!((view.fresh_sensors(Axis::Drive).unwrap().0, view.lost.drive), (last + 5, 0));
}

#[test]
fn an_emergency_stop_of_the_old_rig_is_not_the_new_ones() {
    let mut view = played(0..5001, &[]);
    view.take_status(RigStatus { emergency_stop: true, ..RigStatus::default() });
    view.take_tick(&tick(0, 0));
    assert!(view.status().is_none());
}

#[test]
fn a_status_holds_for_a_hundred_cycles() {
    let mut view = RigView::default();
    view.take_status(RigStatus::default());
    // The first time that is known: what came before it is as new.
    view.take_tick(&tick(5000, 0));
    assert!(view.status().is_some());
    play(&mut view, 5001..5101, &[]);
    assert!(view.status().is_some(), "in cycle {:?}", view.cycle);
    view.take_sensors(Axis::Drive, sensors(5101));
    assert!(view.status().is_none());
    view.take_status(RigStatus::default());
    assert!(view.status().is_some());
}

#[test]
fn the_ending_tick_settles_the_last_frames() {
    let mut view = played(0..98, &[95]);
    let news = view.take_tick(&Tick { ending: true, ..tick(98, 0) });
    assert_eq!((news, view.lost.drive), (TickEvent::Ending, 1));
}

#[test]
fn a_rig_that_starts_anew_is_noticed_and_loses_nothing() {
    let mut view = played(0..5001, &[]);
    view.take_sensors(Axis::Drive, sensors(0));
    assert_eq!(view.take_tick(&tick(0, 0)), TickEvent::Restarted);
    play(&mut view, 1..101, &[]);
    assert_eq!(view.lost, PerAxis::default());
    assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 100);
}

/// On the modelled wire the drive's sensors once passed the load's of the cycle before: taken for a round of the counter,
/// twice, they looked like a rig that had started anew.
#[test]
fn sensors_that_pass_others_at_arbitration_are_no_round_of_the_counter() {
    let mut view = played(0..100, &[]);
    for cycle in 100..110 {
        view.take_sensors(Axis::Drive, sensors(cycle + 1));
        view.take_sensors(Axis::Load, sensors(cycle));
        assert_eq!(view.cycle, Some(cycle + 1));
        assert_eq!(view.fresh_sensors(Axis::Load).map(|(of, _)| of), Some(cycle));
        assert_eq!(view.fresh_sensors(Axis::Drive).map(|(of, _)| of), Some(cycle + 1));
    }
    assert_eq!(view.take_tick(&tick(110, 0)), TickEvent::Usual);
}

/// After a stall the tick is sent first, and arbitration puts the sensors, whose identifiers are lower, ahead of it.
#[test]
fn sensors_that_pass_their_tick_are_not_lost() {
    let mut view = played(0..100, &[]);
    let before = view.lost;
    // Cycles 100 to 104 are skipped.
    take_both(&mut view, 105);
    view.take_tick(&Tick { catch_up: true, ..tick(105, 5) });
    (106..=110).for_each(|cycle| take_both(&mut view, cycle));
    view.take_tick(&tick(110, 5));
    assert_eq!((view.lost.drive, view.lost.load), (before.drive, before.load));
}
