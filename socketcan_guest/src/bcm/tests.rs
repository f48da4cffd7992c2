//! The manager against commands, frames and a clock that the test holds.

use super::message::{HEAD_BYTES, Head, flag, opcode};
use super::*;
use crate::abi::frame;
use std::time::Duration;

const INTERFACE: u32 = 7;
const MS: Duration = Duration::from_millis(1);

struct Command(Head, Vec<FrameBytes>);

impl Command {
    fn new(opcode: u32, flags: u32, id: u32, frames: &[FrameBytes]) -> Self {
        let zero = Duration::ZERO;
        let head = Head { opcode, flags, count: 0, interval_1: zero, interval_2: zero, id, frame_count: 0 };
        Self(head, frames.to_vec())
    }

    fn times(mut self, count: u32, interval_1: Duration, interval_2: Duration) -> Self {
        (self.0.count, self.0.interval_1, self.0.interval_2) = (count, interval_1, interval_2);
        self
    }

    fn bytes(&self) -> Vec<u8> {
        self.0.with(self.0.opcode, &self.1)
    }
}

/// A manager, and the time that the test lets pass.
struct Bench {
    manager: BroadcastManager,
    began: Instant,
    now: Instant,
}

impl Bench {
    fn new() -> Self {
        let now = Instant::now();
        Self { manager: BroadcastManager::default(), began: now, now }
    }

    fn command(&mut self, command: &Command) -> Result<Vec<Action>, Errno> {
        let mut actions = Vec::new();
        let bytes = command.bytes();
        self.manager.command(&bytes, INTERFACE, self.now, &mut actions)?;
        Ok(actions)
    }

    fn frame(&mut self, frame: FrameBytes) -> Vec<Action> {
        let mut actions = Vec::new();
        self.manager.take_frame(INTERFACE, &frame, self.now, &mut actions);
        actions
    }

    /// Actions up to then, each with its time in ms from the beginning.
    fn until(&mut self, ms: u32) -> Vec<(u128, Action)> {
        let end = self.began + MS * ms;
        let mut all = Vec::new();
        while let Some(due) = self.manager.due().filter(|due| *due <= end) {
            self.now = due;
            let mut actions = Vec::new();
            self.manager.advance(due, &mut actions);
            all.extend(actions.into_iter().map(|action| ((due - self.began).as_millis(), action)));
        }
        self.now = end;
        all
    }
}

fn sent(at: u128, data: &[u8]) -> (u128, Action) {
    (at, Action::Send(INTERFACE, frame(0x123, data)))
}

fn notifications(actions: &[Action]) -> Vec<(u32, Vec<FrameBytes>)> {
    let read = |action: &Action| match action {
        Action::Notify(_, bytes) => Head::read(bytes).map(|(head, frames)| (head.opcode, frames)).ok(),
        Action::Send(..) | Action::SendOnce(..) => None,
    };
    actions.iter().filter_map(read).collect()
}

const START: u32 = flag::SETTIMER | flag::STARTTIMER;

#[test]
fn a_cyclic_frame_is_sent_at_once_and_then_by_its_period_until_it_is_deleted() {
    let mut bench = Bench::new();
    let set_up =
        Command::new(opcode::TX_SETUP, START, 0x123, &[frame(0x123, &[1])]).times(0, Duration::ZERO, 10 * MS);
    assert_eq!(bench.command(&set_up), Ok(vec![Action::Send(INTERFACE, frame(0x123, &[1]))]));
    assert_eq!(bench.until(35), [sent(10, &[1]), sent(20, &[1]), sent(30, &[1])]);
    // A new content without a start is sent in the next cycle.
    let change = Command::new(opcode::TX_SETUP, 0, 0x123, &[frame(0x123, &[2])]);
    assert_eq!(bench.command(&change), Ok(vec![]));
    assert_eq!(bench.until(45), [sent(40, &[2])]);
    let delete = Command::new(opcode::TX_DELETE, 0, 0x123, &[]);
    assert_eq!(bench.command(&delete), Ok(vec![]));
    assert_eq!(bench.until(100), []);
    assert_eq!(bench.command(&delete), Err(Errno::INVAL));
}

#[test]
fn a_count_at_the_first_interval_ends_with_an_event_and_the_second_goes_on() {
    let mut bench = Bench::new();
    let set_up = Command::new(opcode::TX_SETUP, START | flag::TX_COUNTEVT, 0x123, &[frame(0x123, &[1])])
        .times(3, 10 * MS, 50 * MS);
    assert_eq!(bench.command(&set_up).map(|actions| actions.len()), Ok(1));
    let all = bench.until(130);
    let times: Vec<_> =
        all.iter().filter(|(_, action)| matches!(action, Action::Send(..))).map(|(at, _)| *at).collect();
    assert_eq!(times, [10, 20, 70, 120]);
    let expired: Vec<_> =
        all.iter().filter(|(_, action)| matches!(action, Action::Notify(..))).cloned().collect();
    assert_eq!(expired.len(), 1);
    assert_eq!(
        (expired[0].0, notifications(&[expired[0].1.clone()])),
        (20, vec![(opcode::TX_EXPIRED, vec![])])
    );
}

#[test]
fn frames_of_a_list_follow_each_other() {
    let mut bench = Bench::new();
    let list = [frame(0x123, &[1]), frame(0x123, &[2]), frame(0x123, &[3])];
    let set_up = Command::new(opcode::TX_SETUP, START, 0x123, &list).times(0, Duration::ZERO, 10 * MS);
    bench.command(&set_up).unwrap();
    assert_eq!(bench.until(30), [sent(10, &[2]), sent(20, &[3]), sent(30, &[1])]);
    let longer = Command::new(opcode::TX_SETUP, START, 0x123, &[list.as_slice(), &list].concat());
    assert_eq!(bench.command(&longer), Err(Errno::TOOBIG));
}

#[test]
fn a_watch_tells_of_changes_under_its_mask_alone() {
    let mut bench = Bench::new();
    let watch = Command::new(opcode::RX_SETUP, 0, 0x123, &[frame(0x123, &[0xFF, 0])]);
    assert_eq!(bench.command(&watch), Ok(vec![]));
    let changed = |data: &[u8]| vec![(opcode::RX_CHANGED, vec![frame(0x123, data)])];
    assert_eq!(notifications(&bench.frame(frame(0x123, &[1, 1]))), changed(&[1, 1]));
    assert_eq!(bench.frame(frame(0x123, &[1, 2])), []);
    assert_eq!(notifications(&bench.frame(frame(0x123, &[2, 2]))), changed(&[2, 2]));
    assert_eq!(bench.frame(frame(0x124, &[3, 3])), []);
    assert_eq!(bench.frame(frame(0x8000_0123, &[3, 3])), []);
}

#[test]
fn silence_is_reported_once_and_the_clock_starts_again_with_the_next_frame() {
    let mut bench = Bench::new();
    let watch = Command::new(opcode::RX_SETUP, START, 0x123, &[]).times(0, 10 * MS, Duration::ZERO);
    bench.command(&watch).unwrap();
    let all = bench.until(50);
    assert_eq!(all.len(), 1);
    assert_eq!((all[0].0, notifications(&[all[0].1.clone()])), (10, vec![(opcode::RX_TIMEOUT, vec![])]));
    assert_eq!(
        notifications(&bench.frame(frame(0x123, &[1]))),
        [(opcode::RX_CHANGED, vec![frame(0x123, &[1])])]
    );
    assert_eq!(bench.until(59).len(), 0);
    assert_eq!(bench.until(100).len(), 1);
}

#[test]
fn changes_are_reported_no_faster_than_the_second_interval_and_the_last_one_is_not_lost() {
    let mut bench = Bench::new();
    let watch = Command::new(opcode::RX_SETUP, START, 0x123, &[frame(0x123, &[0xFF])]).times(
        0,
        Duration::ZERO,
        10 * MS,
    );
    bench.command(&watch).unwrap();
    assert_eq!(notifications(&bench.frame(frame(0x123, &[1]))).len(), 1);
    assert_eq!(bench.until(3), []);
    assert_eq!(bench.frame(frame(0x123, &[2])), []);
    assert_eq!(bench.frame(frame(0x123, &[3])), []);
    let all = bench.until(40);
    assert_eq!(all.len(), 1);
    assert_eq!(
        (all[0].0, notifications(&[all[0].1.clone()])),
        (10, vec![(opcode::RX_CHANGED, vec![frame(0x123, &[3])])])
    );
}

#[test]
fn a_remote_request_is_answered_with_the_frame_of_the_job() {
    let mut bench = Bench::new();
    let id = REMOTE | 0x123;
    let watch = Command::new(opcode::RX_SETUP, flag::RX_RTR_FRAME, id, &[frame(id, &[9])]);
    bench.command(&watch).unwrap();
    assert_eq!(bench.frame(frame(id, &[])), [Action::Send(INTERFACE, frame(0x123, &[9]))]);
}

const REMOTE: u32 = protocol::can::REMOTE_FLAG;

#[test]
fn malformed_commands_are_refused_as_the_kernel_does() {
    let mut manager = BroadcastManager::default();
    let mut command =
        |bytes: &[u8], interface| manager.command(bytes, interface, Instant::now(), &mut Vec::new());
    assert_eq!(command(&[0; HEAD_BYTES - 1], INTERFACE), Err(Errno::INVAL));
    assert_eq!(command(&[0; HEAD_BYTES + 5], INTERFACE), Err(Errno::INVAL));
    assert_eq!(command(&Command::new(99, 0, 1, &[]).bytes(), INTERFACE), Err(Errno::INVAL));
    let send = Command::new(opcode::TX_SEND, 0, 1, &[frame(1, &[])]).bytes();
    assert_eq!(command(&send, INTERFACE), Ok(HEAD_BYTES + 16));
    assert_eq!(command(&send, 0), Err(Errno::NODEV));
    let none = Command::new(opcode::TX_SETUP, START, 1, &[]).bytes();
    assert_eq!(command(&none, INTERFACE), Err(Errno::INVAL));
    // One frame announced, none there.
    let mut short = none;
    short[52..56].copy_from_slice(&1_u32.to_ne_bytes());
    assert_eq!(command(&short, INTERFACE), Err(Errno::FAULT));
}
