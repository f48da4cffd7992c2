//! View of the rig from its frames alone: sensors, cycle number, lost frames.
//!
//! The sensors carry the low 4 bits of their cycle, the tick all of them every ten cycles and whenever cycles were
//! skipped. Together they give the cycle of each frame, which a command echoes and which is the experiment's time.
//!
//! Lost frames are the difference between what the rig says it sent and what came:
//!
//! ```text
//!   sent of each axis up to tick n = n + 1 - skipped      (n - skipped when the tick comes before its cycle's sensors)
//!   lost between two ticks         = difference of that - sensors received
//! ```
//!
//! A frame of a cycle that its axis has passed already is *late*: it was missing, and comes after the next ones. One with counter
//! and content of a frame that came is a *duplicate*. Both are counted, and neither is fresh: what is answered is the newest.

mod recent;

use nominal::Axis;
use protocol::frames::{ALIVE_RANGE, RigStatus, Sensors, Tick};
use recent::{RecentSensors, SensorArrival};

/// Cycles for which a status of the rig holds: ten of its periods.
const STATUS_HOLDS_CYCLES: u64 = 100;
/// The tick counts skipped cycles modulo this.
const SKIPPED_RANGE: u64 = 1 << 16;

/// Counts of frames, one for each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PerAxis {
    drive: u64,
    load: u64,
}

impl PerAxis {
    /// Frames of `axis`.
    pub fn get(&self, axis: Axis) -> u64 {
        match axis {
            Axis::Drive => self.drive,
            Axis::Load => self.load,
        }
    }

    fn of(&mut self, axis: Axis) -> &mut u64 {
        match axis {
            Axis::Drive => &mut self.drive,
            Axis::Load => &mut self.load,
        }
    }
}

/// What a tick says of the rig beyond its cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TickEvent {
    Usual,
    /// The rig is another one, or the same started anew: its cycles begin again.
    Restarted,
    /// The rig announces its end.
    Ending,
}

/// Cycles by which the sensors of one axis may be behind those of the other: frames of a node wait side by side at a bus with
/// arbitration.
const MOST_PASSED: u64 = 3;

/// Frames sent and received by a tick, with counters unwrapped.
#[derive(Clone, Copy)]
struct Account {
    sent: u64,
    /// Without duplicates.
    received: PerAxis,
    late: PerAxis,
}

/// Newest sensors, cycle and status of the rig, and an account of its sensor frames.
#[derive(Default)]
pub struct RigView {
    /// The newest cycle that is known; `None` before the first tick.
    pub cycle: Option<u64>,
    /// Cycles that the rig computed after a late wake-up without sending their sensors, by its own count: they are not lost.
    pub skipped: u64,
    sensors: [Option<Sensors>; 2],
    recent: [RecentSensors; 2],
    /// Cycle of the newest sensors of each axis.
    newest: [Option<u64>; 2],
    fresh: [bool; 2],
    /// Sensor frames that came, late ones and duplicates included.
    pub received: PerAxis,
    /// Sensor frames that came after newer ones of their axis.
    pub late: PerAxis,
    /// Sensor frames that came again.
    pub duplicate: PerAxis,
    account: Option<Account>,
    /// Sensor frames that the rig sent between its first tick and its newest one, and that did not come.
    pub lost: PerAxis,
    /// Sensor frames that the rig had sent by its first tick that came, and that did not come: lost ones, and those from before
    /// the bus was joined.
    pub missed_before_first_tick: PerAxis,
    /// With the cycle in which it came.
    status: Option<(u64, RigStatus)>,
}

impl RigView {
    pub(crate) fn take_sensors(&mut self, axis: Axis, sensors: Sensors) {
        *self.received.of(axis) += 1;
        match self.recent[axis.index()].take(&sensors) {
            SensorArrival::Newer => {}
            SensorArrival::Late => {
                *self.late.of(axis) += 1;
                return;
            }
            SensorArrival::Duplicate => {
                *self.duplicate.of(axis) += 1;
                return;
            }
        }
        if let Some(known) = self.cycle {
            let ahead = (ALIVE_RANGE + u64::from(sensors.alive) - known % ALIVE_RANGE) % ALIVE_RANGE;
            // Behind the other axis's newest, and yet new to its own: arbitration let that one pass, and no round is over.
            let behind = ALIVE_RANGE - ahead;
            let newest = self.newest[axis.index()];
            let passed =
                behind <= MOST_PASSED && newest.is_some_and(|newest| known.saturating_sub(behind) > newest);
            let cycle = if passed { known - behind } else { known + ahead };
            self.newest[axis.index()] = Some(cycle);
            self.cycle = Some(known.max(cycle));
        }
        self.sensors[axis.index()] = Some(sensors);
        self.fresh[axis.index()] = true;
    }

    pub(crate) fn take_tick(&mut self, tick: &Tick) -> TickEvent {
        // The tick's counter wraps after 49.7 days, ours does not: what counts is the way from the cycle that we know.
        let ahead = self.cycle.map(|known| i64::from(tick.cycle.wrapping_sub(known as u32).cast_signed()));
        // Sensors that follow a lost tick may have brought us one round of their counter ahead.
        let restarted = self.account.is_some() && ahead.is_some_and(|ahead| ahead < -(ALIVE_RANGE as i64));
        if restarted {
            // Of the old rig, nothing but the counts holds.
            let Self { received, late, duplicate, lost, .. } = *self;
            *self = Self { received, late, duplicate, lost, ..Self::default() };
        }
        let cycle = match (self.cycle, ahead) {
            (Some(known), Some(ahead)) => known.saturating_add_signed(ahead),
            _ => u64::from(tick.cycle),
        };
        self.settle_account(tick, cycle);
        if let (None, Some((came, _))) = (self.cycle, &mut self.status) {
            // It came before the first frame with the time.
            *came = cycle;
        }
        self.cycle = Some(cycle);
        match (restarted, tick.ending) {
            (true, _) => TickEvent::Restarted,
            (_, true) => TickEvent::Ending,
            _ => TickEvent::Usual,
        }
    }

    fn settle_account(&mut self, tick: &Tick, cycle: u64) {
        let more = u64::from(tick.skipped.wrapping_sub(self.skipped as u16));
        // A stall of more than a minute wraps the tick's count; the cycles that passed tell how often.
        let passed = self.cycle.map_or(0, |known| cycle.saturating_sub(known));
        self.skipped += more + passed.saturating_sub(more) / SKIPPED_RANGE * SKIPPED_RANGE;
        let comes_first = tick.catch_up || tick.ending;
        let sent = (cycle + u64::from(!comes_first)).saturating_sub(self.skipped);
        // A frame that came twice must not hide one that was lost.
        let once = |axis| self.received.get(axis) - self.duplicate.get(axis);
        let received = PerAxis { drive: once(Axis::Drive), load: once(Axis::Load) };
        if self.account.is_none() {
            for axis in Axis::ALL {
                *self.missed_before_first_tick.of(axis) += sent.saturating_sub(received.get(axis));
            }
        }
        let mut counted = received;
        if let Some(last) = self.account {
            for axis in Axis::ALL {
                let went = sent - last.sent.min(sent);
                let came = received.get(axis) - last.received.get(axis);
                // A late frame may have counted as lost at the tick before; nothing else takes a loss back.
                let late = self.late.get(axis) - last.late.get(axis);
                let found = came.saturating_sub(went).min(late);
                let lost = self.lost.of(axis);
                *lost = (*lost + went.saturating_sub(came)).saturating_sub(found);
                // Sensors that arbitration let pass the tick that announces them belong to the next one's account.
                *counted.of(axis) -= came.saturating_sub(went + found);
            }
        }
        self.account = Some(Account { sent, received: counted, late: self.late });
    }

    pub(crate) fn take_status(&mut self, status: RigStatus) {
        self.status = Some((self.cycle.unwrap_or(0), status));
    }

    /// The newest sensors of an axis with their cycle, once for each frame; `None` before the first tick.
    pub(crate) fn fresh_sensors(&mut self, axis: Axis) -> Option<(u64, Sensors)> {
        let cycle = self.cycle?;
        let fresh = std::mem::take(&mut self.fresh[axis.index()]);
        let sensors = self.sensors[axis.index()].filter(|_| fresh)?;
        // The other axis's sensors, or a tick, may already be of the next cycle.
        let behind = (ALIVE_RANGE + cycle % ALIVE_RANGE - u64::from(sensors.alive)) % ALIVE_RANGE;
        Some((cycle.saturating_sub(behind), sensors))
    }

    /// Status of the rig; `None` before the first, and when it is older than 100 cycles.
    ///
    /// Cycles that the rig skipped make it older too: after those it is the next status that counts. What an axis does while
    /// there is none stands in [`AxisController::answer`](crate::axis::AxisController::answer).
    pub(crate) fn status(&self) -> Option<&RigStatus> {
        let (came, status) = self.status.as_ref()?;
        let age = self.cycle.map_or(0, |cycle| cycle.saturating_sub(*came));
        (age <= STATUS_HOLDS_CYCLES).then_some(status)
    }
}

#[cfg(test)]
mod tests;
