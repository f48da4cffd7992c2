//! Bounded queues from the 1 ms path to the recorder: cycles, frames and events.
//!
//! ```text
//!   rig loop ── try_send ──► [cycles]  ──┐
//!            ── try_send ──► [frames]  ──┼── polled every few ms ── writer ──► files
//!            ── try_send ──► [events]  ──┤
//!            ── try_send ──► [timings] ──┤   in real time only
//!            ── try_send ──► [trips]   ──┘
//! ```
//!
//! The queues are allocated before the start; sending takes no lock and wakes no thread, because the writer polls (0.2 us
//! instead of 9 us with a blocked receiver). A full queue loses the record and counts it.

pub(crate) mod rig_timing;
pub(crate) mod writer;

use crate::event::Event;
use crate::exchange::{RoundTrip, TimingRecord};
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use plant::CycleRecord;
use runlog::candump::FrameRecord;
use std::sync::{Arc, Weak};

/// Capacity in cycles: 16 s, longer than any stall that a run survives in practice.
const CYCLE_QUEUE: usize = 16 * 1024;
/// Capacity in frames, some eight for each of those cycles.
const FRAME_QUEUE: usize = 8 * CYCLE_QUEUE;
/// Capacity in round trips, one of each axis for each of those cycles.
const TRIP_QUEUE: usize = 2 * CYCLE_QUEUE;
const EVENT_QUEUE: usize = 4096;

/// The senders, held by the rig loop.
pub(crate) struct Recorder {
    cycles: Sender<CycleRecord>,
    frames: Sender<FrameRecord>,
    events: Sender<Event>,
    timings: Sender<TimingRecord>,
    round_trips: Sender<RoundTrip>,
    /// Lockstep waits for the writer instead of losing a record: simulated time has no deadline.
    waits: bool,
    pub(crate) dropped: u64,
    writer_alive: Weak<()>,
    _alive: Arc<()>,
}

/// The receivers, held by the writer.
pub(crate) struct Records {
    pub(crate) cycles: Receiver<CycleRecord>,
    frames: Receiver<FrameRecord>,
    pub(crate) events: Receiver<Event>,
    timings: Receiver<TimingRecord>,
    round_trips: Receiver<RoundTrip>,
    sender_alive: Weak<()>,
    _alive: Arc<()>,
}

/// Creates the queues. With `waits`, a full queue blocks the sender instead of losing the record.
#[must_use]
pub(crate) fn queues(waits: bool) -> (Recorder, Records) {
    let (cycle_sender, cycles) = bounded(CYCLE_QUEUE);
    let (frame_sender, frames) = bounded(FRAME_QUEUE);
    let (event_sender, events) = bounded(EVENT_QUEUE);
    let (timing_sender, timings) = bounded(CYCLE_QUEUE);
    let (round_trip_sender, round_trips) = bounded(TRIP_QUEUE);
    let alive = Arc::new(());
    let sender_alive = Arc::downgrade(&alive);
    let writer = Arc::new(());
    let recorder = Recorder {
        cycles: cycle_sender,
        frames: frame_sender,
        events: event_sender,
        timings: timing_sender,
        round_trips: round_trip_sender,
        waits,
        dropped: 0,
        writer_alive: Arc::downgrade(&writer),
        _alive: alive,
    };
    (recorder, Records { cycles, frames, events, timings, round_trips, sender_alive, _alive: writer })
}

impl Records {
    fn senders_gone(&self) -> bool {
        self.sender_alive.strong_count() == 0
    }

    /// Whether all queues are empty.
    fn are_taken(&self) -> bool {
        let Self { cycles, frames, events, timings, round_trips, .. } = self;
        cycles.is_empty()
            && frames.is_empty()
            && events.is_empty()
            && timings.is_empty()
            && round_trips.is_empty()
    }
}

/// The waiting records of a queue, a quarter of its capacity at most: otherwise a writer slower than the rig would never leave
/// one queue, and the others would overflow.
fn batch<T>(queue: &Receiver<T>) -> impl Iterator<Item = T> {
    queue.try_iter().take(queue.len().min(queue.capacity().map_or(usize::MAX, |room| room / 4)))
}

impl Recorder {
    pub(crate) fn cycle(&mut self, record: CycleRecord) {
        self.dropped += enqueue(&self.cycles, record, self.waits);
    }

    pub(crate) fn frame(&mut self, record: FrameRecord) {
        self.dropped += enqueue(&self.frames, record, self.waits);
    }

    pub(crate) fn event(&mut self, event: Event) {
        self.dropped += enqueue(&self.events, event, self.waits);
    }

    /// Queues the time stamps of a cycle.
    pub(crate) fn timing(&mut self, record: TimingRecord) {
        self.dropped += enqueue(&self.timings, record, self.waits);
    }

    pub(crate) fn round_trip(&mut self, record: RoundTrip) {
        self.dropped += enqueue(&self.round_trips, record, self.waits);
    }

    /// Whether the queue of cycles is full while the writer runs.
    pub(crate) fn is_full(&self) -> bool {
        self.cycles.is_full() && self.writer_alive.strong_count() > 0
    }
}

/// Returns the number of lost records: 0 or 1.
fn enqueue<T>(queue: &Sender<T>, record: T, waits: bool) -> u64 {
    match queue.try_send(record) {
        Ok(()) => 0,
        // A writer that has ended has reported why.
        Err(TrySendError::Full(record)) if waits => u64::from(queue.send(record).is_err()),
        Err(_) => 1,
    }
}
