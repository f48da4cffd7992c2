//! DAQ lists: their order, what is refused, what leaves when.

use super::*;
use crate::image::SIGNAL;
use crate::image::tests::image;
use crate::signals::COUNT;

const FORCE: u32 = SIGNAL + 4 * 8;

fn entry(address: u32, size: u8) -> Entry {
    Entry { address, size }
}

/// A list for each of these numbers of ODTs, each ODT with one entry of 4 bytes.
fn lists(per_cycle: u32, odts: &[u8]) -> (Daq, Image) {
    let (mut daq, image) = (Daq::new(per_cycle), image());
    daq.free();
    daq.alloc_lists(odts.len() as u16).unwrap();
    (0..).zip(odts).for_each(|(list, odts)| daq.alloc_odts(list, *odts).unwrap());
    for (list, odts) in (0..).zip(odts) {
        (0..*odts).for_each(|odt| daq.alloc_entries(list, odt, 1).unwrap());
    }
    for (list, odts) in (0..).zip(odts) {
        for odt in 0..*odts {
            daq.point(list, odt, 0).unwrap();
            daq.write(&image, entry(FORCE, 4)).unwrap();
        }
    }
    (daq, image)
}

fn mode(mode: u8, prescaler: u8) -> ListMode {
    ListMode { mode, prescaler, priority: 0 }
}

/// What leaves in each of so many cycles, by number of the ODT.
fn leaving(daq: &mut Daq, image: &mut Image, cycles: u64) -> Vec<Vec<u8>> {
    let cycle = |cycle: u64| {
        image.refresh(cycle, &[cycle as f64; COUNT], &[25.0, 1.0, 15.0]);
        daq.cycle(cycle, image);
        (0..daq.per_cycle).filter_map(|_| daq.next_packet()).map(|packet| packet[0]).collect()
    };
    (0..cycles).map(cycle).collect()
}

#[test]
fn lists_are_made_in_their_order_only() {
    let mut daq = Daq::new(1);
    assert_eq!(daq.alloc_lists(1), Err(Refusal::Sequence), "FREE_DAQ comes first");
    daq.free();
    assert_eq!(daq.alloc_odts(0, 1), Err(Refusal::OutOfRange), "no such list yet");
    daq.alloc_lists(2).unwrap();
    assert_eq!(daq.alloc_lists(2), Err(Refusal::Sequence));
    assert_eq!(daq.alloc_entries(0, 0, 1), Err(Refusal::OutOfRange));
    daq.alloc_odts(0, 1).unwrap();
    assert_eq!(daq.alloc_odts(0, 1), Err(Refusal::Sequence), "once for each list");
    daq.alloc_odts(1, 1).unwrap();
    daq.alloc_entries(0, 0, 1).unwrap();
    assert_eq!(daq.write(&image(), entry(FORCE, 4)), Err(Refusal::Sequence), "nothing is pointed at");
    assert_eq!(daq.start_stop(2, 9), Err(Refusal::OutOfRange));
}

#[test]
fn there_is_room_for_so_much_and_no_more() {
    let mut daq = Daq::new(1);
    daq.free();
    assert_eq!(daq.alloc_lists(LISTS as u16 + 1), Err(Refusal::MemoryOverflow));
    daq.free();
    daq.alloc_lists(2).unwrap();
    daq.alloc_odts(0, ODTS as u8).unwrap();
    assert_eq!(daq.alloc_odts(1, 1), Err(Refusal::MemoryOverflow));
    assert_eq!(daq.alloc_entries(0, 0, ENTRIES as u8 + 1), Err(Refusal::MemoryOverflow));
}

#[test]
fn an_entry_must_fit_its_packet_and_lie_in_memory() {
    let (mut daq, image) = lists(1, &[1]);
    for (bad, refusal) in [
        (entry(FORCE, 8), Refusal::OutOfRange),
        (entry(FORCE, 0), Refusal::OutOfRange),
        (entry(0x9000_0000, 4), Refusal::AccessDenied),
        (entry(SIGNAL + 4 * COUNT as u32 - 2, 4), Refusal::AccessDenied),
    ] {
        daq.point(0, 0, 0).unwrap();
        assert_eq!(daq.write(&image, bad), Err(refusal), "{:#x}", bad.address);
    }
    daq.point(0, 0, 0).unwrap();
    assert_eq!(daq.read().map(|entry| (entry.address, entry.size)), Ok((FORCE, 4)), "what was there stays");
    // Seven bytes fill a packet; with a time stamp they are too many.
    daq.point(0, 0, 0).unwrap();
    daq.write(&image, entry(FORCE, 7)).unwrap();
    daq.set_mode(0, 0, mode(MODE_STAMP, 1)).unwrap();
    assert_eq!(daq.start_stop(1, 0), Err(Refusal::DaqConfig));
    daq.set_mode(0, 0, mode(0, 1)).unwrap();
    assert_eq!(daq.start_stop(1, 0), Ok(0));
}

/// Selecting looks at what a list is then. A controller once panicked in its cycle over what came between that and the start.
#[test]
fn what_changes_between_selection_and_start_is_looked_at_again() {
    let fills = entry(FORCE, 7);
    let stamp_behind = |daq: &mut Daq, image: &Image| {
        daq.point(1, 0, 0).unwrap();
        daq.write(image, fills).unwrap();
        daq.start_stop(2, 1).unwrap();
        daq.set_mode(1, 0, mode(MODE_STAMP, 2)).unwrap();
    };
    let bytes_behind = |daq: &mut Daq, image: &Image| {
        daq.set_mode(1, 0, mode(MODE_STAMP, 2)).unwrap();
        daq.start_stop(2, 1).unwrap();
        daq.point(1, 0, 0).unwrap();
        daq.write(image, fills).unwrap();
    };
    for change in [&stamp_behind as &dyn Fn(&mut Daq, &Image), &bytes_behind] {
        let (mut daq, mut image) = lists(1, &[1, 1]);
        daq.set_mode(0, 0, mode(0, 2)).unwrap();
        daq.start_stop(2, 0).unwrap();
        change(&mut daq, &image);
        assert_eq!(daq.start_stop_selected(1), Err(Refusal::DaqConfig));
        assert!(!daq.runs(), "none is started, not even the one that is good");
        daq.set_mode(1, 0, mode(0, 2)).unwrap();
        assert_eq!(daq.start_stop_selected(1), Ok(()), "both are still selected");
        assert_eq!(leaving(&mut daq, &mut image, 4), [[0], [1], [0], [1]]);
    }
}

#[test]
fn a_packet_holds_number_stamp_and_values_of_one_cycle() {
    let (mut daq, mut image) = lists(1, &[1]);
    daq.set_mode(0, 0, mode(MODE_STAMP, 1)).unwrap();
    daq.start_stop(1, 0).unwrap();
    image.refresh(0x12345, &[2.5; COUNT], &[25.0, 1.0, 15.0]);
    daq.cycle(0x12345, &image);
    let [a, b, c, d] = 2.5_f32.to_le_bytes();
    assert_eq!(daq.next_packet(), Some([0, 0x45, 0x23, a, b, c, d, 0]));
    assert_eq!(daq.next_packet(), None);
}

#[test]
fn packets_of_a_cycle_follow_in_the_next_ones_and_none_is_lost() {
    let (mut daq, mut image) = lists(1, &[3, 1]);
    daq.set_mode(0, 0, mode(0, 4)).unwrap();
    daq.set_mode(1, 0, mode(0, 4)).unwrap();
    daq.start_stop(2, 0).unwrap();
    daq.start_stop(2, 1).unwrap();
    daq.start_stop_selected(1).unwrap();
    let sent = leaving(&mut daq, &mut image, 1000);
    assert!(sent.iter().zip(0..).all(|(sent, cycle)| *sent == [(cycle % 4) as u8]), "{:?}", &sent[..8]);
    assert_eq!(daq.dropped, 0);
}

#[test]
fn more_than_may_leave_is_refused_at_the_start_and_starts_nothing() {
    for (per_cycle, odts, prescalers, fits) in [
        (1, &[1, 1][..], &[1, 1][..], false),
        (2, &[1, 1], &[1, 1], true),
        (1, &[1, 1], &[2, 2], true),
        (1, &[3, 1], &[4, 4], true),
        (1, &[3, 1], &[3, 255], false),
        (1, &[1, 1, 1], &[3, 3, 3], true),
        (4, &[4], &[1], true),
        (4, &[5], &[1], false),
    ] {
        let (mut daq, mut image) = lists(per_cycle, odts);
        for (list, prescaler) in (0..).zip(prescalers) {
            daq.set_mode(list, 0, mode(0, *prescaler)).unwrap();
            daq.start_stop(2, list).unwrap();
        }
        let expected = if fits { Ok(()) } else { Err(Refusal::DaqConfig) };
        assert_eq!(daq.start_stop_selected(1), expected, "{odts:?} by {prescalers:?}, {per_cycle} a cycle");
        assert_eq!(daq.runs(), fits);
        let sent: usize = leaving(&mut daq, &mut image, 3000).iter().map(Vec::len).sum();
        assert_eq!(daq.dropped, 0);
        assert_eq!(sent > 0, fits);
    }
}

#[test]
fn what_runs_is_not_changed() {
    let (mut daq, image) = lists(1, &[1]);
    daq.point(0, 0, 0).unwrap();
    daq.start_stop(1, 0).unwrap();
    assert_eq!(daq.write(&image, entry(FORCE, 4)), Err(Refusal::DaqActive));
    assert_eq!(daq.point(0, 0, 0), Err(Refusal::DaqActive));
    assert_eq!(daq.set_mode(0, 0, mode(0, 2)), Err(Refusal::DaqActive));
    assert_eq!(daq.alloc_entries(0, 0, 1), Err(Refusal::DaqActive));
    assert_eq!(daq.mode(0).unwrap().mode & RUNNING, RUNNING);
    daq.free();
    assert!(!daq.runs());
}

#[test]
fn modes_that_are_not_offered_are_refused() {
    let (mut daq, _) = lists(1, &[1]);
    for (event, asked) in [(1, mode(0, 1)), (0, mode(0, 0)), (0, mode(0x02, 1)), (0, mode(0x20, 1))] {
        assert_eq!(daq.set_mode(0, event, asked), Err(Refusal::OutOfRange), "{event} {asked:?}");
    }
    assert_eq!(daq.start_stop(3, 0), Err(Refusal::OutOfRange));
    assert_eq!(daq.start_stop_selected(9), Err(Refusal::OutOfRange));
}
