//! What the 1 ms path hands to the recorder: cycles, frames and events, through bounded queues.
//!
//! ```text
//!   rig loop ── try_send ──► [cycles]  ──┐
//!            ── try_send ──► [frames]  ──┼── polled every few ms ── writer ──► files
//!            ── try_send ──► [events]  ──┤
//!            ── try_send ──► [timings] ──┤   in real time only
//!            ── try_send ──► [trips]   ──┘
//! ```
//!
//! The queues are allocated before the start; sending takes no lock and wakes nobody, because the writer polls
//! (facts: 0.2 us against 9 us with a blocked receiver). A full queue loses the record and counts it.

pub(crate) mod rig_timing;
pub(crate) mod writer;

use crate::event::Event;
use crate::exchange::{RoundTrip, TimingRecord};
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use plant::tables::CycleRecord;
use runlog::candump::FrameRecord;
use std::sync::{Arc, Weak};

/// Cycles that fit the queue: 16 s, longer than any stall that a run survives in practice.
const CYCLE_QUEUE: usize = 16 * 1024;
/// Frames that fit the queue, some eight for each of those cycles.
const FRAME_QUEUE: usize = 8 * CYCLE_QUEUE;
/// Round trips that fit the queue, one of each axis for each of those cycles.
const TRIP_QUEUE: usize = 2 * CYCLE_QUEUE;
const EVENT_QUEUE: usize = 4096;

/// The sending ends, held by the rig loop.
pub(crate) struct Recorder {
    cycles: Sender<CycleRecord>,
    frames: Sender<FrameRecord>,
    events: Sender<Event>,
    timings: Sender<TimingRecord>,
    round_trips: Sender<RoundTrip>,
    /// Lockstep waits for the writer rather than lose a record: simulated time has no deadline.
    waits: bool,
    dropped: u64,
    writer_alive: Weak<()>,
    _alive: Arc<()>,
}

/// The receiving ends, held by the writer.
pub(crate) struct Records {
    pub(crate) cycles: Receiver<CycleRecord>,
    frames: Receiver<FrameRecord>,
    pub(crate) events: Receiver<Event>,
    timings: Receiver<TimingRecord>,
    round_trips: Receiver<RoundTrip>,
    sender_alive: Weak<()>,
    _alive: Arc<()>,
}

/// Makes the queues. With `waits`, a full queue holds the sender up instead of losing the record.
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
    /// Whether nothing more can come.
    fn senders_gone(&self) -> bool {
        self.sender_alive.strong_count() == 0
    }

    /// Whether all that came was taken.
    fn are_taken(&self) -> bool {
        let Self { cycles, frames, events, timings, round_trips, .. } = self;
        cycles.is_empty()
            && frames.is_empty()
            && events.is_empty()
            && timings.is_empty()
            && round_trips.is_empty()
    }
}

/// What waits in a queue, a quarter of its room at most: a writer slower than the rig would never see the end of one queue,
/// and the others would run over.
fn a_turn<T>(queue: &Receiver<T>) -> impl Iterator<Item = T> {
    queue.try_iter().take(queue.len().min(queue.capacity().map_or(usize::MAX, |room| room / 4)))
}

impl Recorder {
    pub(crate) fn cycle(&mut self, record: CycleRecord) {
        self.dropped += hand_over(&self.cycles, record, self.waits);
    }

    pub(crate) fn frame(&mut self, record: FrameRecord) {
        self.dropped += hand_over(&self.frames, record, self.waits);
    }

    pub(crate) fn event(&mut self, event: Event) {
        self.dropped += hand_over(&self.events, event, self.waits);
    }

    /// Hands over when everything of a cycle happened.
    pub(crate) fn timing(&mut self, record: TimingRecord) {
        self.dropped += hand_over(&self.timings, record, self.waits);
    }

    pub(crate) fn round_trip(&mut self, record: RoundTrip) {
        self.dropped += hand_over(&self.round_trips, record, self.waits);
    }

    /// Whether there is no room for a cycle, and a writer who will make some.
    pub(crate) fn is_full(&self) -> bool {
        self.cycles.is_full() && self.writer_alive.strong_count() > 0
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}

/// Returns how many records were lost: 0 or 1.
fn hand_over<T>(queue: &Sender<T>, record: T, waits: bool) -> u64 {
    match queue.try_send(record) {
        Ok(()) => 0,
        // A writer that is gone has said why; then there is nobody to wait for.
        Err(TrySendError::Full(record)) if waits => u64::from(queue.send(record).is_err()),
        Err(_) => 1,
    }
}
