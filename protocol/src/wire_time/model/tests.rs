//! The wire by itself: order, times, errors, bus-off.

use super::*;
use crate::wire_time::bits;

const BIT_NS: u64 = 1000;
const AT_1M: WireTiming = WireTiming::at(1_000_000);

fn frame(id: u16) -> CanFrame {
    CanFrame::new(id, &[id as u8; 2])
}

fn length_ns(id: u16) -> u64 {
    u64::from(bits::on_the_wire(&frame(id))) * BIT_NS
}

fn wire<const N: usize>(timing: WireTiming) -> (WireModel, [NodeId; N]) {
    let mut model = WireModel::new(timing, 1);
    let nodes = std::array::from_fn(|_| model.join());
    (model, nodes)
}

fn run(model: &mut WireModel, to_ns: u64) -> Vec<WireEvent> {
    let mut events = Vec::new();
    model.advance(to_ns, &mut events);
    events
}

/// Identifier, sender and end of each frame that was delivered.
fn delivered(events: &[WireEvent]) -> Vec<(u32, NodeId, u64)> {
    let of = |event: &WireEvent| match event {
        WireEvent::Delivered { frame, from, ended_ns, .. } => Some((frame.raw_id(), *from, *ended_ns)),
        WireEvent::ErrorFrame { .. } => None,
    };
    events.iter().filter_map(of).collect()
}

fn reported(events: &[WireEvent], whom: NodeId) -> Vec<(u32, u64)> {
    let of = |event: &WireEvent| match event {
        WireEvent::ErrorFrame { node, frame, at_ns } if *node == whom => {
            Some((frame.raw_id() & 0x1FF, *at_ns))
        }
        _ => None,
    };
    events.iter().filter_map(of).collect()
}

#[test]
fn a_frame_takes_its_bits() {
    let (mut model, [node]) = wire(AT_1M);
    model.enter(node, frame(0x110), 5_000);
    assert_eq!(model.next_ns(), Some(5_000));
    assert!(run(&mut model, 5_000 + length_ns(0x110) - 1).is_empty());
    let events = run(&mut model, 10_000_000);
    assert_eq!(delivered(&events), [(0x110, node, 5_000 + length_ns(0x110))]);
    let report = model.report();
    let identifier = &report.identifiers["110"];
    assert_eq!(identifier.response_ns.max, length_ns(0x110));
    assert_eq!((report.busy_ns, report.load_ppm), (length_ns(0x110), 1_000_000));
}

#[test]
fn a_bit_rate_that_divides_no_ns_is_rounded_up() {
    assert_eq!(WireTiming::at(125_000).duration_ns(125), 1_000_000);
    assert_eq!(WireTiming::at(300_000).duration_ns(1), 3334);
}

#[test]
fn the_lowest_identifier_of_all_nodes_is_sent_first_and_none_is_cut_off() {
    let (mut model, [one, two]) = wire(AT_1M);
    for (node, id, at_ns) in [(one, 0x300, 0), (one, 0x200, 10), (two, 0x250, 10), (two, 0x100, 20)] {
        model.enter(node, frame(id), at_ns);
    }
    let order: Vec<_> = delivered(&run(&mut model, 1_000_000)).iter().map(|(id, ..)| *id).collect();
    assert_eq!(order, [0x300, 0x100, 0x200, 0x250]);
}

#[test]
fn a_frame_that_enters_as_the_wire_gets_free_takes_part() {
    let (mut model, [one, two]) = wire(AT_1M);
    model.enter(one, frame(0x300), 0);
    model.enter(one, frame(0x200), 1);
    model.enter(two, frame(0x100), length_ns(0x300));
    let order: Vec<_> = delivered(&run(&mut model, 1_000_000)).iter().map(|(id, ..)| *id).collect();
    assert_eq!(order, [0x300, 0x100, 0x200]);
}

#[test]
fn frames_of_one_identifier_keep_their_order() {
    let (mut model, [node]) = wire(AT_1M);
    (0..5).for_each(|n| model.enter(node, CanFrame::new(0x110, &[n]), 0));
    let data: Vec<_> = run(&mut model, 1_000_000)
        .iter()
        .filter_map(|event| match event {
            WireEvent::Delivered { frame, .. } => Some(frame.data()[0]),
            WireEvent::ErrorFrame { .. } => None,
        })
        .collect();
    assert_eq!(data, [0, 1, 2, 3, 4]);
}

#[test]
fn times_do_not_depend_on_when_the_model_is_asked() {
    let events = |step_ns: u64| {
        let (mut model, [one, two]) = wire(WireTiming { error_rate: 0.3, ..AT_1M });
        for k in 0..50_u64 {
            model.enter(one, frame(0x110), k * 150_000);
            model.enter(two, frame(0x120), k * 150_000 + 30_000);
        }
        let (mut events, mut now_ns) = (Vec::new(), 0);
        while now_ns < 20_000_000 {
            now_ns += step_ns;
            model.advance(now_ns, &mut events);
        }
        events
    };
    assert_eq!(events(1_000), events(7_654_321));
}

#[test]
fn what_the_model_has_passed_enters_now_and_is_counted() {
    let (mut model, [node]) = wire(AT_1M);
    run(&mut model, 1_000_000);
    model.enter(node, frame(0x110), 400_000);
    let events = run(&mut model, 2_000_000);
    assert_eq!(delivered(&events)[0].2, 1_000_000 + length_ns(0x110));
    assert_eq!((model.report().entered_late.count, model.report().entered_late.max_ns), (1, 600_000));
}

#[test]
fn an_error_costs_its_flag_and_the_frame_is_sent_again_after_arbitration() {
    let timing = WireTiming { error_rate: 1.0, errors_to_ms: Some(1), ..AT_1M };
    let (mut model, [one, two]) = wire(timing);
    model.enter(one, frame(0x200), 999_999);
    model.enter(two, frame(0x100), 999_999 + 1);
    let events = run(&mut model, 3_000_000);
    let ends = delivered(&events);
    // The frame that came meanwhile wins when the other one is tried again.
    assert_eq!(ends.iter().map(|(id, ..)| *id).collect::<Vec<_>>(), [0x100, 0x200]);
    let error_ns = ends[0].2 - length_ns(0x100) - 999_999;
    let (least, most) = (u64::from(1 + ERROR_BITS) * BIT_NS, length_ns(0x200) + 20 * BIT_NS);
    assert!((least..=most).contains(&error_ns), "{error_ns} ns");
    let report = model.report();
    assert_eq!((report.errors, report.identifiers["200"].errors, report.frames), (1, 1, 2));
    assert_eq!(
        report.nodes.iter().map(|node| (node.tec, node.rec)).collect::<Vec<_>>(),
        [
            ([7, 8], [0, 0]),
            // The receiver's one is taken back by the frame that it received.
            ([0, 0], [0, 1])
        ]
    );
}

/// 32 failures put a node off; it drops what it has, hears nothing, and is back after its restart time and 128 x 11 bits.
#[test]
fn a_node_whose_frames_all_fail_goes_off_the_bus_and_recovers() {
    let timing = WireTiming { error_rate: 1.0, errors_id: Some(0x110), errors_to_ms: Some(50), ..AT_1M };
    let (mut model, [bad, good]) = wire(timing);
    model.enter(bad, frame(0x110), 0);
    model.enter(bad, frame(0x300), 0);
    let events = run(&mut model, 20_000_000);
    let changes = reported(&events, bad);
    assert_eq!(changes.iter().map(|(class, _)| *class).collect::<Vec<_>>(), [0x004, 0x040]);
    let off_ns = changes[1].1;
    // 16 of the attempts were those of a passive sender, in whose wait the other frame cannot begin: it is the same node's.
    assert!(delivered(&events).is_empty());

    model.enter(bad, frame(0x110), 21_000_000);
    model.enter(good, frame(0x120), 22_000_000);
    let events = run(&mut model, 60_000_000);
    let expected = [WireEvent::Delivered {
        frame: frame(0x120),
        from: good,
        entered_ns: 22_000_000,
        ended_ns: 22_000_000 + length_ns(0x120),
        deaf: vec![bad],
    }];
    assert_eq!(events, expected);

    let events = run(&mut model, 300_000_000);
    let back_ns = off_ns + 100_000_000 + 128 * 11 * BIT_NS;
    assert_eq!(reported(&events, bad), [(0x100, back_ns)]);
    model.enter(bad, frame(0x110), 300_000_000);
    assert_eq!(delivered(&run(&mut model, 400_000_000)).len(), 1);
    let node = &model.report().nodes[bad];
    assert_eq!((node.bus_offs, node.errors, node.error_passive, node.missed_in_bus_off), (1, 32, 1, 1));
    assert_eq!(
        node.dropped_in_bus_off.by_name().into_iter().collect::<Vec<_>>(),
        [("110".into(), 2), ("300".into(), 1)]
    );
}

/// Without a restart time, on a wire without a pause: each frame ends in 11 recessive bits and counts for one of the 128.
#[test]
fn recovery_counts_recessive_bits_of_a_busy_wire() {
    let timing = WireTiming { error_rate: 1.0, errors_id: Some(0x110), restart_ms: 0, ..AT_1M };
    let (mut model, [bad, good]) = wire(timing);
    model.enter(bad, frame(0x110), 0);
    (0..400).for_each(|k| model.enter(good, frame(0x300), k * length_ns(0x300)));
    let events = run(&mut model, 400_000_000);
    let changes = reported(&events, bad);
    assert_eq!(changes.iter().map(|(class, _)| *class).collect::<Vec<_>>(), [0x004, 0x040, 0x100]);
    let (off_ns, back_ns) = (changes[1].1, changes[2].1);
    let meanwhile = |end_ns: &u64| (off_ns + 1..=back_ns).contains(end_ns);
    assert_eq!(delivered(&events).iter().filter(|(_, _, end_ns)| meanwhile(end_ns)).count(), 128);
}

/// A passive sender waits 8 bits, in which others begin.
#[test]
fn a_passive_sender_lets_others_begin() {
    let timing = WireTiming { error_rate: 1.0, errors_id: Some(0x110), ..AT_1M };
    let (mut model, [bad, good]) = wire(timing);
    model.enter(bad, frame(0x110), 0);
    model.enter(good, frame(0x300), 1);
    let events = run(&mut model, 50_000_000);
    // 16 failures in a row, then the other frame although its identifier is higher.
    assert_eq!(delivered(&events).len(), 1);
    let passive_ns = reported(&events, bad)[0].1;
    assert_eq!(delivered(&events)[0].2, passive_ns + length_ns(0x300));
}

#[test]
fn what_a_node_had_queued_is_sent_when_it_is_gone() {
    let (mut model, [one, _two]) = wire(AT_1M);
    model.enter(one, frame(0x110), 0);
    model.leave(one);
    assert_eq!(delivered(&run(&mut model, 1_000_000)).len(), 1);
}
