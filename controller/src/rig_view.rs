//! What the controller knows of the rig, from frames alone: sensors, cycle number, frames that never came.
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

use plant::Axis;
use protocol::frames::{ALIVE_RANGE, RigStatus, Sensors, Tick};

/// Cycles for which a status of the rig holds: ten of its periods.
const STATUS_HOLDS_CYCLES: u64 = 100;
/// The tick counts skipped cycles modulo this.
const SKIPPED_RANGE: u64 = 1 << 16;

/// Frames of sensors, by axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PerAxis {
    /// Of the drive.
    pub drive: u64,
    /// Of the load.
    pub load: u64,
}

impl PerAxis {
    /// Of one axis.
    #[must_use]
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

/// What happened to the rig's time with a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickNews {
    /// As expected.
    Usual,
    /// The rig is another one, or the same started anew: its cycles begin again.
    Restarted,
    /// The rig says that no more sensors come.
    Ending,
}

/// What a tick says about frames sent, with counters unwrapped.
#[derive(Clone, Copy)]
struct Account {
    sent: u64,
    received: PerAxis,
}

/// The rig as seen from the bus.
#[derive(Default)]
pub struct RigView {
    cycle: Option<u64>,
    skipped: u64,
    sensors: [Option<Sensors>; 2],
    fresh: [bool; 2],
    received: PerAxis,
    account: Option<Account>,
    lost: PerAxis,
    missed_before_first_tick: PerAxis,
    /// With the cycle in which it came.
    status: Option<(u64, RigStatus)>,
}

impl RigView {
    /// Takes the sensors of an axis.
    pub fn take_sensors(&mut self, axis: Axis, sensors: Sensors) {
        *self.received.of(axis) += 1;
        if let Some(known) = self.cycle {
            let ahead = (ALIVE_RANGE + u64::from(sensors.alive) - known % ALIVE_RANGE) % ALIVE_RANGE;
            self.cycle = Some(known + ahead);
        }
        self.sensors[axis.index()] = Some(sensors);
        self.fresh[axis.index()] = true;
    }

    /// Takes a tick.
    pub fn take_tick(&mut self, tick: &Tick) -> TickNews {
        // The tick's counter wraps after 49.7 days, ours does not: what counts is the way from the cycle that we know.
        let ahead = self.cycle.map(|known| i64::from(tick.cycle.wrapping_sub(known as u32).cast_signed()));
        // Sensors that follow a lost tick may have brought us one round of their counter ahead.
        let restarted = self.account.is_some() && ahead.is_some_and(|ahead| ahead < -(ALIVE_RANGE as i64));
        if restarted {
            // Of the old rig, nothing but the counts holds.
            *self = Self { received: self.received, lost: self.lost, ..Self::default() };
        }
        let cycle = match (self.cycle, ahead) {
            (Some(known), Some(ahead)) => known.saturating_add_signed(ahead),
            _ => u64::from(tick.cycle),
        };
        self.settle_account(tick, cycle);
        if let (None, Some((came, _))) = (self.cycle, &mut self.status) {
            // It came before anything told the time.
            *came = cycle;
        }
        self.cycle = Some(cycle);
        match (restarted, tick.ending) {
            (true, _) => TickNews::Restarted,
            (_, true) => TickNews::Ending,
            _ => TickNews::Usual,
        }
    }

    fn settle_account(&mut self, tick: &Tick, cycle: u64) {
        let more = (SKIPPED_RANGE + u64::from(tick.skipped) - self.skipped % SKIPPED_RANGE) % SKIPPED_RANGE;
        // A stall of more than a minute wraps the tick's count; the cycles that passed tell how often.
        let passed = self.cycle.map_or(0, |known| cycle.saturating_sub(known));
        self.skipped += more + passed.saturating_sub(more) / SKIPPED_RANGE * SKIPPED_RANGE;
        let comes_first = tick.catch_up || tick.ending;
        let sent = (cycle + u64::from(!comes_first)).saturating_sub(self.skipped);
        if self.account.is_none() {
            for axis in Axis::ALL {
                *self.missed_before_first_tick.of(axis) += sent.saturating_sub(*self.received.of(axis));
            }
        }
        if let Some(last) = self.account {
            for axis in Axis::ALL {
                let came = *self.received.of(axis) - *last.received.clone().of(axis);
                // A frame that came twice must not hide one that was lost elsewhere in time.
                *self.lost.of(axis) += (sent - last.sent.min(sent)).saturating_sub(came);
            }
        }
        self.account = Some(Account { sent, received: self.received });
    }

    /// Takes the rig's status.
    pub fn take_status(&mut self, status: RigStatus) {
        self.status = Some((self.cycle.unwrap_or(0), status));
    }

    /// The newest sensors of an axis with their cycle, once for each frame; `None` before the first tick.
    pub fn fresh_sensors(&mut self, axis: Axis) -> Option<(u64, Sensors)> {
        let cycle = self.cycle?;
        let fresh = std::mem::take(&mut self.fresh[axis.index()]);
        let sensors = self.sensors[axis.index()].filter(|_| fresh)?;
        // The other axis's sensors, or a tick, may already be of the next cycle.
        let behind = (ALIVE_RANGE + cycle % ALIVE_RANGE - u64::from(sensors.alive)) % ALIVE_RANGE;
        Some((cycle.saturating_sub(behind), sensors))
    }

    /// The newest cycle that is known; `None` before the first tick.
    #[must_use]
    pub fn cycle(&self) -> Option<u64> {
        self.cycle
    }

    /// What the rig says of itself; `None` until it said something, and when that is older than 100 cycles.
    ///
    /// Cycles that the rig skipped make it older too: after those it is the next status that counts. What an axis does while
    /// there is none stands in [`AxisController::answer`](crate::axis::AxisController::answer).
    #[must_use]
    pub fn status(&self) -> Option<&RigStatus> {
        let (came, status) = self.status.as_ref()?;
        let age = self.cycle.map_or(0, |cycle| cycle.saturating_sub(*came));
        (age <= STATUS_HOLDS_CYCLES).then_some(status)
    }

    /// Sensor frames received.
    #[must_use]
    pub fn received(&self) -> PerAxis {
        self.received
    }

    /// Sensor frames that never came.
    #[must_use]
    pub fn lost(&self) -> PerAxis {
        self.lost
    }

    /// Sensor frames that the rig had sent by its first tick that came, and that did not come: lost ones, and those from before
    /// the bus was joined.
    #[must_use]
    pub fn missed_before_first_tick(&self) -> PerAxis {
        self.missed_before_first_tick
    }

    /// Cycles that the rig says it skipped.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(cycle: u32, skipped: u16) -> Tick {
        Tick { cycle, skipped, ..Tick::default() }
    }

    fn sensors(cycle: u64) -> Sensors {
        Sensors { alive: (cycle % 16) as u8, ..Sensors::default() }
    }

    /// Plays the rig's frames of `cycles`, without those that `lost` names.
    fn play(view: &mut RigView, cycles: std::ops::Range<u64>, lost: &[u64]) {
        for cycle in cycles {
            for axis in Axis::ALL {
                if !lost.contains(&cycle) {
                    view.take_sensors(axis, sensors(cycle));
                }
            }
            if cycle % 10 == 0 {
                view.take_tick(&tick(cycle as u32, 0));
            }
        }
    }

    #[test]
    fn sensors_without_a_tick_have_no_cycle() {
        let mut view = RigView::default();
        view.take_sensors(Axis::Drive, sensors(7));
        assert!(view.fresh_sensors(Axis::Drive).is_none());
    }

    #[test]
    fn each_frame_has_its_cycle_and_is_fresh_once() {
        let mut view = RigView::default();
        play(&mut view, 5000..5011, &[]);
        assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 5010);
        assert!(view.fresh_sensors(Axis::Drive).is_none());
        view.take_sensors(Axis::Drive, sensors(5013));
        assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 5013);
        assert_eq!(view.fresh_sensors(Axis::Load).unwrap().0, 5010, "the load's frame is an older one");
    }

    #[test]
    fn lost_frames_are_counted_exactly() {
        let mut view = RigView::default();
        play(&mut view, 0..1001, &[3, 15, 16, 17, 500]);
        assert_eq!(view.lost(), PerAxis { drive: 5, load: 5 });
    }

    #[test]
    fn more_lost_frames_than_the_counter_can_tell_are_found_by_the_tick() {
        let mut view = RigView::default();
        let lost: Vec<u64> = (101..148).collect();
        play(&mut view, 0..201, &lost);
        assert_eq!(view.lost().drive, 47);
    }

    #[test]
    fn skipped_cycles_are_not_lost() {
        let mut view = RigView::default();
        play(&mut view, 0..101, &[]);
        view.take_tick(&Tick { catch_up: true, ..tick(151, 50) });
        play_with_skipped(&mut view, 151..201, 50);
        assert_eq!((view.lost().drive, view.skipped()), (0, 50));
        view.take_sensors(Axis::Drive, sensors(201));
        assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 201);
    }

    fn play_with_skipped(view: &mut RigView, cycles: std::ops::Range<u64>, skipped: u16) {
        for cycle in cycles {
            Axis::ALL.iter().for_each(|axis| view.take_sensors(*axis, sensors(cycle)));
            if cycle % 10 == 0 {
                view.take_tick(&tick(cycle as u32, skipped));
            }
        }
    }

    #[test]
    fn a_stall_of_more_cycles_than_the_tick_can_count_loses_nothing() {
        let mut view = RigView::default();
        play(&mut view, 0..101, &[]);
        let skipped = (100_000 % SKIPPED_RANGE) as u16;
        view.take_tick(&Tick { catch_up: true, ..tick(100_101, skipped) });
        play_with_skipped(&mut view, 100_101..100_201, skipped);
        assert_eq!((view.lost().drive, view.skipped()), (0, 100_000));
    }

    #[test]
    fn the_cycle_goes_on_when_the_ticks_counter_wraps() {
        let mut view = RigView::default();
        let last = u64::from(u32::MAX);
        view.take_tick(&tick(u32::MAX - 5, 0));
        (last - 4..=last + 5).for_each(|cycle| {
            Axis::ALL.iter().for_each(|axis| view.take_sensors(*axis, sensors(cycle)));
        });
        assert_eq!(view.take_tick(&tick(4, 0)), TickNews::Usual);
        assert_eq!((view.fresh_sensors(Axis::Drive).unwrap().0, view.lost().drive), (last + 5, 0));
    }

    #[test]
    fn an_emergency_stop_of_the_old_rig_is_not_the_new_ones() {
        let mut view = RigView::default();
        play(&mut view, 0..5001, &[]);
        view.take_status(RigStatus { emergency_stop: true, ..RigStatus::default() });
        view.take_tick(&tick(0, 0));
        assert!(view.status().is_none());
    }

    #[test]
    fn a_status_holds_for_a_hundred_cycles() {
        let mut view = RigView::default();
        view.take_status(RigStatus::default());
        // The first time that is known: what came before it is as new.
        view.take_tick(&tick(5000, 0));
        assert!(view.status().is_some());
        play(&mut view, 5001..5101, &[]);
        assert!(view.status().is_some(), "in cycle {:?}", view.cycle());
        view.take_sensors(Axis::Drive, sensors(5101));
        assert!(view.status().is_none());
        view.take_status(RigStatus::default());
        assert!(view.status().is_some());
    }

    #[test]
    fn the_ending_tick_settles_the_last_frames() {
        let mut view = RigView::default();
        play(&mut view, 0..98, &[95]);
        let news = view.take_tick(&Tick { ending: true, ..tick(98, 0) });
        assert_eq!((news, view.lost().drive), (TickNews::Ending, 1));
    }

    #[test]
    fn a_rig_that_starts_anew_is_noticed_and_loses_nothing() {
        let mut view = RigView::default();
        play(&mut view, 0..5001, &[]);
        view.take_sensors(Axis::Drive, sensors(0));
        assert_eq!(view.take_tick(&tick(0, 0)), TickNews::Restarted);
        play(&mut view, 1..101, &[]);
        assert_eq!(view.lost(), PerAxis::default());
        assert_eq!(view.fresh_sensors(Axis::Drive).unwrap().0, 100);
    }
}
