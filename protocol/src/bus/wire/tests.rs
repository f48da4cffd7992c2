//! What each wire fault does to a row of frames.

use super::*;
use crate::frames::{Frame, Sensors, ValveCommand};

const FROM: PeerId = 4;

fn plain() -> Wire {
    Wire::new(&WireOptions { loss: 0.0, seed: 0, timing: None })
}

fn with(fault: WireFault, frames: Frames) -> Wire {
    let mut wire = plain();
    assert!(wire.orders().give(WireOrder::Begin { number: 9, fault, frames, seed: 5 }));
    wire.take_orders(0, &mut Vec::new());
    assert!(!wire.is_plain());
    wire
}

fn sensors(alive: u8) -> CanFrame {
    Frame::DriveSensors(Sensors { alive, ..Sensors::default() }).encode().unwrap()
}

/// Counters of the sensors that come out when so many go in, one each millisecond.
fn out(wire: &mut Wire, count: u8) -> Vec<FrameOutcome> {
    let mut outcomes = Vec::new();
    for alive in 0..count {
        let now_ns = u64::from(alive) * MS_NS;
        wire.release_due(now_ns, &mut outcomes);
        wire.pass(&sensors(alive % 16), FROM, &[], now_ns, &mut outcomes);
    }
    outcomes
}

fn counters(outcomes: &[FrameOutcome]) -> Vec<u8> {
    let alive = |outcome: &FrameOutcome| match outcome {
        FrameOutcome::Carried { frame, .. } => match Frame::decode(frame) {
            Ok(Frame::DriveSensors(sensors)) => Some(sensors.alive),
            _ => None,
        },
        _ => None,
    };
    outcomes.iter().filter_map(alive).collect()
}

fn lost_of_ten_thousand(loss: f64, seed: u64) -> Vec<bool> {
    let mut wire = Wire::new(&WireOptions { loss, seed, timing: None });
    let mut outcomes = Vec::new();
    (0..10_000).for_each(|_| wire.pass(&sensors(0), FROM, &[], 0, &mut outcomes));
    outcomes.iter().map(|outcome| matches!(outcome, FrameOutcome::Lost(_))).collect()
}

#[test]
fn loss_follows_probability_and_seed() {
    assert!(lost_of_ten_thousand(0.0, 1).iter().all(|lost| !lost));
    assert!(lost_of_ten_thousand(1.0, 1).iter().all(|lost| *lost));
    let lost = lost_of_ten_thousand(0.01, 1);
    // Binomial: 100 expected, standard deviation 10; five of them.
    assert!((50..150).contains(&lost.iter().filter(|lost| **lost).count()));
    assert_eq!(lost, lost_of_ten_thousand(0.01, 1));
    assert_ne!(lost, lost_of_ten_thousand(0.01, 2));
}

#[test]
fn a_fault_concerns_its_own_frames_and_ends_on_order() {
    let mut wire = with(WireFault::Loss { probability: 1.0 }, Frames::Id(0x121));
    assert_eq!(counters(&out(&mut wire, 3)), [0, 1, 2]);
    let mut wire = with(WireFault::Loss { probability: 1.0 }, Frames::Id(0x120));
    assert_eq!(out(&mut wire, 2), [FrameOutcome::Lost(sensors(0)), FrameOutcome::Lost(sensors(1))]);
    assert_eq!(wire.frames_by_fault["bus-loss"].by_name()["120"], 2);
    assert!(wire.orders().give(WireOrder::End { number: 9 }));
    wire.take_orders(0, &mut Vec::new());
    assert!(wire.is_plain());
}

#[test]
fn what_is_delayed_comes_in_its_order_and_what_is_held_at_the_end_goes_on() {
    let mut wire = with(WireFault::Delay { delay_ms: 3 }, Frames::All);
    let mut outcomes = out(&mut wire, 5);
    assert_eq!(counters(&outcomes), [0, 1], "those of 0 and 1 ms are due by 4 ms");
    assert_eq!(wire.longest_sleep_ns(4 * MS_NS), Some(MS_NS));
    assert!(wire.orders().give(WireOrder::End { number: 9 }));
    wire.take_orders(0, &mut outcomes);
    assert_eq!(counters(&outcomes), [0, 1, 2, 3, 4]);
    assert!(wire.is_plain());
}

#[test]
fn frames_are_overtaken_by_the_next_of_their_identifier_and_come_more_than_once() {
    let mut wire = with(WireFault::Reordering { probability: 1.0 }, Frames::All);
    assert_eq!(counters(&out(&mut wire, 6)), [1, 0, 3, 2, 5, 4]);
    let mut wire = with(WireFault::Duplication { probability: 1.0, copies: 2 }, Frames::All);
    assert_eq!(counters(&out(&mut wire, 2)), [0, 0, 0, 1, 1, 1]);
}

#[test]
fn a_frame_that_is_held_comes_with_its_copies() {
    let duplication = WireFault::Duplication { probability: 1.0, copies: 1 };
    let held = [
        (WireFault::Delay { delay_ms: 2 }, vec![0, 0, 1, 1]),
        (WireFault::Reordering { probability: 1.0 }, vec![1, 1, 0, 0, 3, 3, 2, 2]),
    ];
    for (fault, expected) in held {
        for [first, second] in [[fault, duplication], [duplication, fault]] {
            let mut wire = with(first, Frames::All);
            let begin = WireOrder::Begin { number: 10, fault: second, frames: Frames::All, seed: 6 };
            assert!(wire.orders().give(begin));
            wire.take_orders(0, &mut Vec::new());
            assert_eq!(counters(&out(&mut wire, 4)), expected, "{first:?}, then {second:?}");
            assert_eq!(wire.frames_by_fault["bus-duplication"].by_name()["120"], 4);
        }
    }
}

#[test]
fn a_corrupted_frame_is_one_that_the_checksum_finds_and_a_wrong_counter_is_not() {
    let command = ValveCommand { opening: 1.0, alive: 15, echo: 7, enable: true };
    let frame = Frame::DriveValveCommand(command).encode().unwrap();
    let changed = |fault: WireFault| {
        let (mut wire, mut outcomes) = (with(fault, Frames::All), Vec::new());
        wire.pass(&frame, FROM, &[], 0, &mut outcomes);
        match &outcomes[..] {
            [FrameOutcome::Carried { frame, .. }] => *frame,
            other => panic!("{other:?}"),
        }
    };
    let corrupted = changed(WireFault::Corruption { probability: 1.0, bits: 1 });
    assert!(corrupted.data().len() == 5 && Frame::decode(&corrupted).is_err());
    let short = changed(WireFault::WrongLength { probability: 1.0, bytes: 3 });
    assert_eq!(short.data(), &frame.data()[..3]);
    let counted = changed(WireFault::WrongCounter { probability: 1.0, step: 5 });
    let expected = Frame::DriveValveCommand(ValveCommand { alive: 4, ..command });
    assert_eq!(Frame::decode(&counted), Ok(expected));
}

#[test]
fn a_babbling_node_says_so_many_frames_in_a_millisecond() {
    let fault = WireFault::Babbling { id: 0x10, frames_per_ms: 2.5, bytes: 4 };
    let mut wire = with(fault, Frames::All);
    let mut babbled = Vec::new();
    (1..=10).for_each(|ms| wire.babble(ms * MS_NS, &mut babbled));
    assert_eq!(babbled, vec![CanFrame::new(0x10, &[0; 4]); 25]);
    assert_eq!(wire.longest_sleep_ns(0), Some(MS_NS));
    babbled.clear();
    wire.babble(u64::MAX / 2, &mut babbled);
    assert_eq!(babbled.len(), 200, "a pause is not caught up without bounds");
}

#[test]
fn a_node_off_the_bus_is_not_heard_and_hears_nothing() {
    let mut wire = with(WireFault::BusOff { node: WireNode::Rig }, Frames::All);
    let mut outcomes = Vec::new();
    let other = CanFrame::new(0x110, &[0; 5]);
    wire.pass(&other, 7, &[1], 0, &mut outcomes);
    wire.learn_node(&sensors(0), FROM);
    wire.pass(&other, 7, &[1], 0, &mut outcomes);
    wire.pass(&sensors(0), FROM, &[], 0, &mut outcomes);
    let carried = |deaf: &[PeerId]| FrameOutcome::Carried { frame: other, from: 7, deaf: deaf.to_vec() };
    assert_eq!(outcomes, [carried(&[1]), carried(&[1, FROM]), FrameOutcome::Lost(sensors(0))]);
}
