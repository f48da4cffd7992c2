//! Accounts of made-up segments: whole ones, and each way in which one can be broken.

use super::*;

/// A rig and a controller; two of 1000 sensor frames were lost on the wire, one at the controller's queue, three passed before it
/// came; of 996 commands one was lost on the wire, and one came when the rig had left.
fn whole() -> (Vec<Participant>, Wire) {
    let rig = Participant {
        name: "emulator".into(),
        sent: Counts::from([("120", 1000), ("130", 100)]),
        received: Counts::from([("110", 994)]),
        host_counts: Some(PeerCounts {
            taken: Counts::from([("120", 1000), ("130", 100)]),
            delivered: Counts::from([("110", 994)]),
            after: Counts::from([("110", 1)]),
            ..PeerCounts::default()
        }),
        // 996 = 62 * 16 + 4: the last one sent has counter 4; the last that came 3, so one is missing behind it.
        gaps: BTreeMap::from([("110".into(), Gaps::Commands { lost: 0, first: 2, last: 3, pauses: 0 })]),
        ..Participant::default()
    };
    let controller = Participant {
        name: "controller".into(),
        sent: Counts::from([("110", 996)]),
        received: Counts::from([("120", 994), ("130", 100)]),
        host_counts: Some(PeerCounts {
            taken: Counts::from([("110", 996)]),
            before: Counts::from([("120", 3)]),
            delivered: Counts::from([("120", 994), ("130", 100)]),
            dropped: Counts::from([("120", 1)]),
            ..PeerCounts::default()
        }),
        gaps: BTreeMap::from([("120".into(), Gaps::Sensors { lost: 2, before: 4 })]),
        ..Participant::default()
    };
    let wire = Wire {
        injected: Counts::from([("120", 2), ("110", 1)]),
        passed: Counts::from([("110", 995), ("120", 998), ("130", 100)]),
        ..Wire::default()
    };
    (vec![rig, controller], wire)
}

fn broken(change: impl Fn(&mut Vec<Participant>, &mut Wire)) -> FrameAccount {
    let (mut participants, mut wire) = whole();
    change(&mut participants, &mut wire);
    close(&participants, Some(&wire))
}

#[test]
fn a_whole_account_names_every_missing_frame_both_ways() {
    let account = broken(|_, _| {});
    assert_eq!((&account.broken, &account.gaps_broken), (&vec![], &vec![]));
    let missing: Vec<_> =
        account.rows.iter().map(|row| (row.id.as_str(), row.explained(), row.missing_by_gaps)).collect();
    assert_eq!(missing, [("110", 2, Some(2)), ("120", 6, Some(6)), ("130", 0, None)]);
}

#[test]
fn one_frame_too_few_at_a_receiver_breaks_it() {
    let account =
        broken(|participants, _| participants[1].received = Counts::from([("120", 993), ("130", 100)]));
    assert_eq!(account.broken.len(), 2, "{account:?}");
    assert!(account.broken[1].contains("120: emulator sent 1000, controller received 993"), "{account:?}");
    assert_eq!(account.gaps_broken.len(), 1, "{account:?}");
}

#[test]
fn a_frame_that_never_reached_the_host_breaks_it() {
    let account = broken(|participants, _| participants[1].sent = Counts::from([("110", 997)]));
    assert!(account.broken[0].contains("110: controller sent 997, the host took 996"), "{account:?}");
}

#[test]
fn a_wire_that_lost_more_than_it_says_breaks_it() {
    let account = broken(|_, wire| wire.injected = Counts::from([("120", 1), ("110", 1)]));
    assert!(
        account.broken.iter().any(|line| line.contains("998 passed the wire, 1 lost on it")),
        "{account:?}"
    );
}

#[test]
fn gaps_that_differ_by_one_break_the_gaps_alone() {
    let gaps = Gaps::Sensors { lost: 3, before: 4 };
    let account = broken(|participants, _| {
        participants[1].gaps.insert("120".into(), gaps);
    });
    assert_eq!(account.broken, [""; 0]);
    assert_eq!(account.gaps_broken, ["120 at controller: 6 missing by the counts, 7 by the gaps"]);
}

#[test]
fn a_stranger_that_sends_is_a_sender_and_its_frames_must_arrive() {
    let stranger = PeerCounts { taken: Counts::from([("108", 5)]), ..PeerCounts::default() };
    let account = broken(|participants, wire| {
        wire.others = vec![stranger.clone()];
        wire.passed.add("108", 5);
        for participant in participants {
            participant.received.add("108", 5);
            participant.host_counts.as_mut().unwrap().delivered.add("108", 5);
        }
    });
    assert_eq!(account.broken, [""; 0]);
    assert_eq!(account.rows.iter().filter(|row| row.sender == "another").count(), 2);
}

#[test]
fn on_a_kernels_bus_the_overflow_count_must_be_what_is_missing_in_all() {
    let (mut participants, _) = whole();
    participants.iter_mut().for_each(|participant| participant.host_counts = None);
    (participants[0].overflow, participants[1].overflow) = (2, 6);
    let account = close(&participants, None);
    assert_eq!((account.broken.len(), account.gaps_broken.len()), (0, 0), "{account:?}");
    participants[1].overflow = 5;
    let account = close(&participants, None);
    assert_eq!(account.broken[0], "controller misses 6 frames in all, its queue dropped 5");
}

#[test]
fn what_nobody_sent_is_reported() {
    let account = broken(|participants, _| participants[0].received.add("7", 1));
    assert_eq!(account.broken, ["emulator received 7, which nobody has sent"]);
}

#[test]
fn a_series_of_commands_is_missing_what_lies_before_between_and_after() {
    // 1 to 20 were sent; 1, 2, 7 and 20 did not come.
    assert_eq!(Gaps::Commands { lost: 1, first: 3, last: 3, pauses: 0 }.missing(20), 4);
    assert_eq!(Gaps::Commands { lost: 0, first: 1, last: 0, pauses: 0 }.missing(16), 0);
}

#[test]
fn a_frame_lost_in_a_pause_of_its_sender_may_leave_no_gap_but_none_may_be_too_many() {
    let with = |lost, pauses| {
        let gaps = Gaps::Commands { lost, first: 1, last: 3, pauses };
        broken(|participants, _| {
            participants[0].gaps.insert("110".into(), gaps);
        })
    };
    assert_eq!(with(0, 0).gaps_broken.len(), 1);
    assert_eq!(with(0, 1).gaps_broken, Vec::<String>::new());
    assert_eq!(with(2, 1).gaps_broken.len(), 1);
}

#[test]
fn what_the_senders_own_queue_refused_is_missing_by_the_gaps_and_not_by_the_counts() {
    // The first line does not change; three frames that were never sent leave gaps like any others.
    let gaps = Gaps::Sensors { lost: 5, before: 4 };
    let account = broken(|participants, _| {
        participants[0].refused = Counts::from([("120", 3)]);
        participants[1].gaps.insert("120".into(), gaps);
    });
    assert_eq!((account.broken.len(), account.gaps_broken.len()), (0, 0), "{account:?}");
}
