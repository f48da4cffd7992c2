//! The rig as the master of the barrier: as fast as all members allow, in simulated time.

use super::{RunContext, RunEnd, RunOutcome};
use protocol::bus::control::{Kind, Role};
use protocol::bus::{BusError, Received};
use protocol::can::CanFrame;
use protocol::periods::CYCLE_NS;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longest wait of an interrupted rig for the turn of the members.
const LAST_TURN_TIMEOUT: Duration = Duration::from_millis(500);

/// Runs the rig in the barrier; `simulated_ns` is the clock that stamps its frames.
pub(crate) fn run(mut context: RunContext<'_>, simulated_ns: &AtomicU64) -> Result<RunOutcome, BusError> {
    context.bus.join_lockstep(Role::Rig, "rig")?;
    let mut posted = Vec::new();
    let mut cycles = 0;
    let mut members_seen = false;
    let end = loop {
        let cycle = cycles;
        let patience = if cycle == 0 { context.limits.join } else { context.limits.cycle * 2 };
        let members = match wait_for_go(&mut context, &mut posted, cycle, patience) {
            Ok(members) => members,
            Err(end) => break end,
        };
        members_seen |= members > 0;
        simulated_ns.store(cycle * CYCLE_NS, Ordering::Relaxed);
        let RunContext { node, bus, .. } = &mut context;
        // As in real time: sensors first, then what arrived before the cycle.
        node.publish(cycle, false, *bus);
        take(&mut posted, |frame, stamp_ns| node.take(frame, stamp_ns, cycle));
        node.act(cycle);
        cycles += 1;
        let left = (members_seen && members == 0).then_some(RunEnd::MembersLeft);
        if let Some(end) = context.after_cycle(cycles).or(left) {
            context.node.publish_end(cycles, context.bus);
            context.bus.done(cycle as u32);
            // The answers to the last cycle belong to the log; a member that has ended gives none, and a time-out has no effect
            // any more.
            let patience = context.limits.cycle * 2;
            let _ = wait_for_go(&mut context, &mut posted, cycles, patience);
            take(&mut posted, |frame, stamp_ns| context.node.take(frame, stamp_ns, cycles));
            break end;
        }
        context.bus.done(cycle as u32);
    };
    Ok(RunOutcome { end, cycles, cycle_zero_ns: 0, statistics: None, allocations: None })
}

fn take(posted: &mut Vec<(CanFrame, u64)>, mut take: impl FnMut(&CanFrame, u64)) {
    posted.drain(..).for_each(|(frame, stamp_ns)| take(&frame, stamp_ns));
}

/// Collects posted frames until the barrier says Go for `cycle`; returns its number of members.
fn wait_for_go(
    context: &mut RunContext<'_>,
    posted: &mut Vec<(CanFrame, u64)>,
    cycle: u64,
    patience: Duration,
) -> Result<u8, RunEnd> {
    let mut since: Option<Instant> = None;
    loop {
        match context.bus.receive() {
            // Stamped in the cycle in which it was posted: the clock has not advanced yet.
            Received::Frame(frame, stamp_ns) => posted.push((frame, stamp_ns)),
            Received::Barrier(control) => match control.kind {
                Kind::Go { members } if control.cycle == cycle as u32 => return Ok(members),
                Kind::TimedOut => return Err(RunEnd::LockstepTimeout(control.name())),
                _ => {}
            },
            Received::Nothing => {
                let waited = since.get_or_insert_with(Instant::now).elapsed();
                // In the middle of a cycle the members finish their turn, so that they receive the last tick after it.
                if context.shared.interrupt.came() && (cycle == 0 || waited >= LAST_TURN_TIMEOUT) {
                    return Err(RunEnd::Interrupted);
                }
                if waited >= patience {
                    return Err(if cycle == 0 { RunEnd::NobodyJoined } else { RunEnd::BusGone });
                }
                context.bus.wait_readable((patience - waited).min(Duration::from_millis(100)));
            }
        }
    }
}
