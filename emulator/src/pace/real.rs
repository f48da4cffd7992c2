//! The rig on the machine's clock: one cycle each millisecond.

use super::{RunContext, RunEnd, RunOutcome};
use protocol::bus::{Bus, Received};
use protocol::can::CanFrame;
use protocol::commands::STALE_AFTER_CYCLES;
use protocol::periods::CYCLE;
use realtime::{Clock, PeriodicConfig, PeriodicLoop, VitalsReader};
use runlog::timing::CycleTiming;
use runlog::timing_recorder::WARM_UP_CYCLES;
use std::time::{Duration, Instant};

/// Time after the loop in which the rig announces its end and still takes answers to the last cycles.
const LAST_TICKS_WITHIN: Duration = Duration::from_millis(30);
/// Number of announcements in that time: a frame may be lost.
const LAST_TICKS: u32 = 3;
/// Most frames between a cycle's start and the reading of a late loop; they belong to the next cycle.
const EARLY_FRAMES: usize = 256;
/// Cycles within which a rig that meets another one knows that it is the later one.
const NEWCOMER_CYCLES: u64 = 10 * STALE_AFTER_CYCLES;

pub(crate) fn run<C: Clock>(mut context: RunContext<'_>, clock: C, config: PeriodicConfig) -> RunOutcome {
    let start = clock.now() + CYCLE;
    let mut periodic = PeriodicLoop::new(&clock, config, start);
    let mut vitals = VitalsReader::new(context.shared.continued.clone());
    let mut inbox = Inbox::new();
    let mut bus_lost_at: Option<u64> = None;
    let mut cycles = 0;
    let mut count_scope = None;
    let grace_cycles = context.limits.bus_grace.as_millis() as u64;
    let end = loop {
        let cycle = match periodic.next_cycle() {
            Ok(cycle) => cycle,
            Err(overrun) => {
                context.node.record_overrun(&overrun, clock.now().as_nanos());
                break RunEnd::Overrun(overrun);
            }
        };
        let index = cycle.index;
        if count_scope.is_none() && index >= WARM_UP_CYCLES {
            count_scope = Some(realtime::allocations::count_scope());
        }
        let RunContext { node, bus, .. } = &mut context;
        node.miss(index - cycle.skipped, cycle.skipped);
        let caught_up = clock.now();
        node.publish(index, cycle.skipped > 0, *bus);
        let sent = clock.now();
        inbox.take_before(cycle.scheduled.as_nanos(), *bus, |frame, stamp_ns| {
            node.take(frame, stamp_ns, index);
        });
        let taken = clock.now();
        node.act(index);
        let stepped = clock.now();
        cycles = index + 1;
        bus_lost_at = if bus.is_up() { None } else { bus_lost_at.or(Some(index)) };
        let end = if bus_lost_at.is_some_and(|lost| index - lost > grace_cycles) {
            Some(RunEnd::BusGone)
        } else if index < NEWCOMER_CYCLES && node.frames.second_rig > 0 {
            Some(RunEnd::SecondRig)
        } else {
            context.after_cycle(cycles)
        };
        // Measuring is part of the cycle's work, except for queueing the sample.
        let vitals = vitals.read();
        let done = periodic.end_of_work().unwrap_or(stepped);
        context.node.record_timing(CycleTiming {
            cycle: index,
            skipped: cycle.skipped,
            due_ns: cycle.scheduled.as_nanos(),
            woke_ns: cycle.woke.as_nanos(),
            receive_ns: length_ns(sent, taken),
            step_ns: length_ns(cycle.woke, caught_up) + length_ns(taken, stepped),
            send_ns: length_ns(caught_up, sent),
            done_ns: done.as_nanos(),
            vitals,
            ..CycleTiming::default()
        });
        if let Some(end) = end {
            break end;
        }
    };
    let allocations = count_scope.map(|scope| {
        drop(scope);
        realtime::allocations::counted()
    });
    // A faulty rig is silent; the second rig on a bus does not end the first one's controllers.
    if !matches!(end, RunEnd::NotFinite | RunEnd::SecondRig) {
        send_last_ticks(&mut context, &mut inbox, cycles);
    }
    let cycle_zero_ns = start.as_nanos();
    RunOutcome { end, cycles, cycle_zero_ns, statistics: Some(periodic.statistics), allocations }
}

fn length_ns(from: realtime::Instant, to: realtime::Instant) -> u64 {
    to.saturating_duration_since(from).as_nanos() as u64
}

fn send_last_ticks(context: &mut RunContext<'_>, inbox: &mut Inbox, cycles: u64) {
    let RunContext { node, bus, .. } = context;
    for _ in 0..LAST_TICKS {
        node.publish_end(cycles, *bus);
        let until = Instant::now() + LAST_TICKS_WITHIN / LAST_TICKS;
        while let Some(left) = until.checked_duration_since(Instant::now()) {
            inbox.take_before(u64::MAX, *bus, |frame, stamp_ns| node.take(frame, stamp_ns, cycles));
            bus.wait_readable(left);
        }
    }
    bus.leave();
    inbox.take_before(u64::MAX, *bus, |frame, stamp_ns| node.take(frame, stamp_ns, cycles));
}

/// Sorts frames by cycle: frames that arrived after a cycle's start wait for the next one, however late the loop reads.
struct Inbox {
    early: [Option<(CanFrame, u64)>; EARLY_FRAMES],
    count: usize,
}

impl Inbox {
    fn new() -> Self {
        Self { early: [None; EARLY_FRAMES], count: 0 }
    }

    fn take_before(&mut self, before_ns: u64, bus: &mut dyn Bus, mut take: impl FnMut(&CanFrame, u64)) {
        let waiting = std::mem::take(&mut self.count);
        for slot in 0..waiting {
            if let Some((frame, stamp_ns)) = self.early[slot].take() {
                self.sort(frame, stamp_ns, before_ns, &mut take);
            }
        }
        // When the buffer is full the rest stays in the kernel's queue, which has the stamps.
        while self.count < EARLY_FRAMES {
            match bus.receive() {
                Received::Frame(frame, stamp_ns) => self.sort(frame, stamp_ns, before_ns, &mut take),
                Received::Barrier(_) => {}
                Received::Nothing => break,
            }
        }
    }

    fn sort(
        &mut self,
        frame: CanFrame,
        stamp_ns: u64,
        before_ns: u64,
        take: &mut impl FnMut(&CanFrame, u64),
    ) {
        // Stamps of one peer never decrease, so frames after a waiting one wait too.
        if stamp_ns < before_ns {
            take(&frame, stamp_ns);
        } else {
            self.early[self.count] = Some((frame, stamp_ns));
            self.count += 1;
        }
    }
}
