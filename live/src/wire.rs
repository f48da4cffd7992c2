//! The bus as the live page sees it: cycle of the rig, values of the controllers, holders of a stop, bus load.

use super::columns::AXES;
use super::state::{BusLoad, ChainStates, EmergencyStopState};
use protocol::bus_load::worst_case_bits;
use protocol::can::CanFrame;
use protocol::frames::{
    ALIVE_RANGE, BIT_RATE_PER_S, ChainStatus, ChainValues, DecodeError, ECHO_RANGE, EmergencyStop, Frame,
    HandSetPoint, HandSetPointAxis, MESSAGES, RigStatus, Sensors, Tick,
};
use runlog::Axis;
use runlog::cycle_tables::{AXIS_COLUMNS, MEASURED};
use std::collections::BTreeMap;

/// A node that holds a stop repeats it every 100 ms; after this silence it no longer holds it.
const STOP_HOLDS_MS: u64 = 500;
/// Controllers send their chain states every 10 ms; after this silence they are unknown.
const STATUS_HOLDS_MS: u64 = 1000;
/// Nodes that can hold an emergency stop.
pub(crate) const STOPPERS: [&str; 4] = ["console", "rig", Axis::Drive.name(), Axis::Load.name()];
/// Index of the console among them; this program sends its frames too.
pub(crate) const CONSOLE: usize = 0;

/// Effect of a frame on the rest of the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WireEvent {
    /// Newest cycle of the rig, and whether the rig restarted.
    Cycle(u64, bool),
    /// Axis, cycle answered and values of a controller.
    ChainValues(usize, u64, ChainValues),
}

/// State from the frames of the bus.
#[derive(Debug, Default)]
pub(crate) struct Wire {
    /// The newest cycle; `None` before the first tick.
    cycle: Option<u64>,
    /// Low bits of the cycle that each controller answered last, from its valve command.
    echo: [Option<u16>; 2],
    chain_values: [Option<ChainValues>; 2],
    /// Sensors of each axis since the first tick.
    sensors: [Reception; 2],
    /// Cycles that the rig skipped since the first tick, and its counter in the last tick.
    skipped: u64,
    skipped_reported: Option<u16>,
    pub(crate) status: Option<RigStatus>,
    chains: [Option<(u64, ChainStatus)>; 2],
    stops: [Option<u64>; 4],
    /// Newest values of sensors and valves.
    pub(crate) measured: [Option<f64>; MEASURED.len()],
    lost: u64,
    malformed: u64,
    frames: Counts,
}

/// Reception of the sensors of an axis.
#[derive(Clone, Copy, Debug, Default)]
struct Reception {
    /// The newest cycle expected.
    newest: u64,
    /// Bit i: whether the sensors of cycle `newest - i` were received.
    bits: u64,
    /// Expected cycles up to `newest` without sensors.
    missing: u64,
}

/// Frames by message, in the current second and in the last.
#[derive(Debug, Default)]
struct Counts {
    since_ms: u64,
    now: Vec<u64>,
    last: Vec<u64>,
    last_ms: u64,
    total: Vec<u64>,
}

impl Wire {
    pub(crate) fn take(&mut self, frame: &CanFrame, now_ms: u64) -> Option<WireEvent> {
        self.frames.count(frame);
        match Frame::decode(frame) {
            Ok(frame) => self.process(frame, now_ms),
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => None,
            Err(_) => {
                self.malformed += 1;
                None
            }
        }
    }

    fn process(&mut self, frame: Frame, now_ms: u64) -> Option<WireEvent> {
        match frame {
            Frame::DriveSensors(sensors) => self.measure(0, &sensors),
            Frame::LoadSensors(sensors) => self.measure(1, &sensors),
            Frame::DriveValveCommand(command) => {
                self.echo[0] = Some(command.echo);
                self.measured[0] = Some(if command.enable { command.opening } else { 0.0 });
            }
            Frame::LoadValveCommand(command) => {
                self.echo[1] = Some(command.echo);
                self.measured[AXIS_COLUMNS.len()] = Some(if command.enable { command.opening } else { 0.0 });
            }
            Frame::Tick(tick) => return self.tick(&tick),
            Frame::RigStatus(status) => self.status = Some(status),
            Frame::DriveChainStatus(status) => self.chains[0] = Some((now_ms, status)),
            Frame::LoadChainStatus(status) => self.chains[1] = Some((now_ms, status)),
            Frame::DriveChainValues(values) => return self.add_chain_values(0, values),
            Frame::LoadChainValues(values) => return self.add_chain_values(1, values),
            Frame::ConsoleEmergencyStop(stop) => self.note_stop(CONSOLE, stop, now_ms),
            Frame::RigEmergencyStop(stop) => self.note_stop(1, stop, now_ms),
            Frame::DriveEmergencyStop(stop) => self.note_stop(2, stop, now_ms),
            Frame::LoadEmergencyStop(stop) => self.note_stop(3, stop, now_ms),
            _ => {}
        }
        None
    }

    fn add_chain_values(&mut self, axis: usize, values: ChainValues) -> Option<WireEvent> {
        self.chain_values[axis] = Some(values);
        Some(WireEvent::ChainValues(axis, self.answered_cycle(axis)?, values))
    }

    /// The cycle that a controller answered last; it may be older than the newest one.
    fn answered_cycle(&self, axis: usize) -> Option<u64> {
        let (cycle, echo) = (self.cycle?, self.echo[axis]?);
        let age = cycle.wrapping_sub(u64::from(echo)) % ECHO_RANGE;
        cycle.checked_sub(age)
    }

    /// Takes sensor values; late ones do not replace newer ones.
    fn measure(&mut self, axis: usize, sensors: &Sensors) {
        if !self.record_sensors(axis, sensors.alive) {
            return;
        }
        let Sensors { position_m, force_n, pressure_a_pa, pressure_b_pa, .. } = *sensors;
        let first = axis * AXIS_COLUMNS.len();
        for (place, value) in [position_m, force_n, pressure_a_pa, pressure_b_pa].into_iter().enumerate() {
            self.measured[first + 1 + place] = Some(value);
        }
    }

    /// Records the reception of sensors and returns whether they are the newest. Their counter has the low bits of the cycle;
    /// the cycle is the one nearest to the newest known cycle, at most half of the counter's range away.
    fn record_sensors(&mut self, axis: usize, alive: u8) -> bool {
        let Some(known) = self.cycle else { return true };
        let ahead = (ALIVE_RANGE + u64::from(alive) - known % ALIVE_RANGE) % ALIVE_RANGE;
        let behind = ALIVE_RANGE - ahead;
        let cycle = if ahead <= behind { known + ahead } else { known.saturating_sub(behind) };
        self.cycle = Some(known.max(cycle));
        self.sensors[axis].take(cycle)
    }

    fn tick(&mut self, tick: &Tick) -> Option<WireEvent> {
        let reported = u64::from(tick.cycle);
        let anew = self.cycle.is_some_and(|cycle| reported + ALIVE_RANGE < cycle);
        if anew {
            self.reset();
        }
        let before = self.skipped_reported.replace(tick.skipped).unwrap_or(tick.skipped);
        self.skipped += u64::from(tick.skipped.wrapping_sub(before));
        match self.cycle {
            None => self.sensors = [Reception::since(reported); 2],
            // A tick after a miss precedes the sensors of its cycle, but no earlier ones.
            Some(_) => self.sensors.iter_mut().for_each(|came| came.expect(reported.saturating_sub(1))),
        }
        self.cycle = self.cycle.max(Some(reported));
        let lost = self.sensors.iter().map(|came| came.missing.saturating_sub(self.skipped)).sum();
        self.lost = self.lost.max(lost);
        Some(WireEvent::Cycle(reported, anew))
    }

    /// Resets everything for a new run, except the counters of frames.
    pub(crate) fn reset(&mut self) {
        let frames = std::mem::take(&mut self.frames);
        *self = Self { frames, malformed: self.malformed, ..Self::default() };
    }

    /// A set-point by hand. The frame holds a position and a force, and the axis follows the one that it controls; the one not
    /// given repeats the controller's last set-point. `None` before the first values of the controller.
    pub(crate) fn hand_set_point(
        &self,
        axis: HandSetPointAxis,
        position_m: Option<f64>,
        force_n: Option<f64>,
    ) -> Option<HandSetPoint> {
        let chain_values = match axis {
            HandSetPointAxis::Drive => self.chain_values[0]?,
            HandSetPointAxis::Load => self.chain_values[1]?,
        };
        let position_m = position_m.unwrap_or(chain_values.position_set_point_m);
        Some(HandSetPoint { axis, position_m, force_n: force_n.unwrap_or(chain_values.force_set_point_n) })
    }

    pub(crate) fn note_stop(&mut self, stopper: usize, stop: EmergencyStop, now_ms: u64) {
        self.stops[stopper] = (!stop.release).then_some(now_ms);
    }

    /// The emergency stop: whether it is tripped, and which nodes hold it.
    pub(crate) fn emergency_stop(&self, now_ms: u64) -> EmergencyStopState {
        let holds = |at: &Option<u64>| at.is_some_and(|at_ms| now_ms.saturating_sub(at_ms) < STOP_HOLDS_MS);
        let senders = STOPPERS.iter().zip(&self.stops).filter(|(_, at)| holds(at));
        EmergencyStopState {
            active: self.status.map(|status| status.emergency_stop),
            senders: senders.map(|(name, _)| *name).collect(),
        }
    }

    /// Chain states of both axes; null for a silent controller.
    pub(crate) fn chains(&self, now_ms: u64) -> BTreeMap<&'static str, Option<ChainStates>> {
        let fresh = self.chains.map(|received| {
            received
                .filter(|(at_ms, _)| now_ms.saturating_sub(*at_ms) < STATUS_HOLDS_MS)
                .map(|(_, status)| status)
        });
        AXES.into_iter().zip(fresh.map(|status| status.map(super::chains::active))).collect()
    }

    /// Closes the current second of the counters, if it is over.
    pub(crate) fn turn(&mut self, now_ms: u64) {
        let frames = &mut self.frames;
        let passed_ms = now_ms.saturating_sub(frames.since_ms);
        if passed_ms >= 1000 {
            (frames.since_ms, frames.last_ms) = (now_ms, passed_ms);
            frames.last = std::mem::take(&mut frames.now);
        }
    }

    /// Bus load by frame, and lost frames.
    pub(crate) fn load(&self) -> BusLoad {
        let counts = &self.frames;
        let seconds = counts.last_ms as f64 / 1000.0;
        let reported = |(place, count): (usize, &u64)| {
            (*count > 0).then(|| (name(place), (*count as f64 / seconds * 10.0).round() / 10.0))
        };
        let bits: u64 =
            counts.last.iter().enumerate().map(|(place, count)| count * u64::from(bits(place))).sum();
        let load_percent = (seconds > 0.0).then(|| 100.0 * bits as f64 / seconds / f64::from(BIT_RATE_PER_S));
        BusLoad {
            load_percent,
            frames_per_s: counts.last.iter().enumerate().filter_map(reported).collect(),
            lost: self.lost,
            malformed: self.malformed,
        }
    }

    /// Frames since the start, by name.
    pub(crate) fn totals(&self) -> impl Iterator<Item = (&'static str, u64)> {
        self.frames.total.iter().enumerate().map(|(place, count)| (name(place), *count))
    }
}

/// Name of a message by its index; the last index stands for all others.
fn name(place: usize) -> &'static str {
    MESSAGES.get(place).map_or("others", |message| message.name)
}

/// Worst-case bits of a message on the wire; for other messages those of the longest.
fn bits(place: usize) -> u32 {
    worst_case_bits(MESSAGES.get(place).map_or(8, |message| message.length))
}

impl Reception {
    /// Expects sensors after `cycle`; earlier ones are unknown.
    fn since(cycle: u64) -> Self {
        Self { newest: cycle, bits: u64::MAX, missing: 0 }
    }

    /// Expects the sensors of all cycles up to `cycle`; each is missing until it is received.
    fn expect(&mut self, cycle: u64) {
        let more = cycle.saturating_sub(self.newest);
        self.bits = self.bits.checked_shl(more.min(u64::from(u64::BITS)) as u32).unwrap_or(0);
        self.newest += more;
        self.missing += more;
    }

    /// Takes the sensors of a cycle, on time, late or duplicate; returns whether they are the newest.
    fn take(&mut self, cycle: u64) -> bool {
        self.expect(cycle);
        // At most half of the counter's range, since no later cycle is expected than is known.
        let bit = 1 << (self.newest - cycle);
        if self.bits & bit == 0 {
            self.bits |= bit;
            self.missing -= 1;
        }
        cycle == self.newest
    }
}

impl Counts {
    fn count(&mut self, frame: &CanFrame) {
        self.now.resize(MESSAGES.len() + 1, 0);
        self.total.resize(MESSAGES.len() + 1, 0);
        let id = frame.standard_id();
        let place = MESSAGES.iter().position(|message| Some(message.id) == id).unwrap_or(MESSAGES.len());
        self.now[place] += 1;
        self.total[place] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::ValveCommand;

    /// Of both axes; the position is the cycle, in mm.
    fn sensors(cycle: u64) -> [CanFrame; 2] {
        let (position_m, force_n, pressure_a_pa, pressure_b_pa) = (cycle as f64 * 1e-3, 0.0, 1e5, 1e5);
        let alive = (cycle % ALIVE_RANGE) as u8;
        let sensors = Sensors { position_m, force_n, pressure_a_pa, pressure_b_pa, alive };
        [Frame::DriveSensors(sensors), Frame::LoadSensors(sensors)].map(|frame| frame.encode().unwrap())
    }

    fn tick(cycle: u64, skipped: u16) -> CanFrame {
        let tick = Tick { cycle: cycle as u32, skipped, catch_up: false, lockstep: false, ending: false };
        Frame::Tick(tick).encode().unwrap()
    }

    /// Cycles of which those in `without` have no sensors; ticks report `skipped` of them as skipped.
    fn wire(cycles: u64, without: &[u64], skipped: u16) -> Wire {
        let mut wire = Wire::default();
        for cycle in 100..100 + cycles {
            if !without.contains(&cycle) {
                go_on(&mut wire, cycle..cycle + 1);
            }
            if cycle % 10 == 0 {
                wire.take(&tick(cycle, if cycle > 120 { skipped } else { 0 }), cycle);
            }
        }
        wire
    }

    fn go_on(wire: &mut Wire, cycles: impl IntoIterator<Item = u64>) {
        for frame in cycles.into_iter().flat_map(sensors) {
            wire.take(&frame, 0);
        }
    }

    #[test]
    fn cycles_are_followed_between_ticks_and_over_gaps() {
        let wire = wire(58, &[103, 131, 132], 2);
        assert_eq!(wire.cycle, Some(157));
        assert_eq!(wire.load().lost, 2, "three are missing of each axis, and two of them the rig skipped");
        let gap: Vec<u64> = (125..165).collect();
        let wire = self::wire(80, &gap, 0);
        assert_eq!((wire.cycle, wire.load().lost), (Some(179), 80), "a gap longer than the counter");
    }

    #[test]
    fn sensors_that_were_overtaken_are_late_and_not_lost() {
        let mut wire = wire(21, &[], 0);
        go_on(&mut wire, [122, 121, 123, 123, 125, 126, 127, 124]);
        assert_eq!(wire.cycle, Some(127));
        assert_eq!(wire.measured[1].map(|m| (m * 1e3).round()), Some(127.0), "the newest stand");
        go_on(&mut wire, 128..=130);
        assert_eq!(wire.take(&tick(130, 0), 0), Some(WireEvent::Cycle(130, false)));
        assert_eq!(wire.load().lost, 0);
        // Told as lost by the tick between, and no reason to overlook the next one.
        go_on(&mut wire, (131..140).filter(|cycle| *cycle != 138));
        wire.take(&tick(140, 0), 0);
        go_on(&mut wire, [138, 140]);
        wire.take(&tick(140, 0), 0);
        assert_eq!(wire.load().lost, 2);
        go_on(&mut wire, (141..150).filter(|cycle| *cycle != 145));
        wire.take(&tick(150, 0), 0);
        assert_eq!(wire.load().lost, 2, "of each axis one is missing still");
    }

    #[test]
    fn sensors_of_the_load_are_missed_too() {
        let mut wire = wire(21, &[], 0);
        for cycle in 121..=130 {
            let [drive, load] = sensors(cycle);
            wire.take(&drive, 0);
            if cycle != 125 {
                wire.take(&load, 0);
            }
        }
        wire.take(&tick(130, 0), 0);
        assert_eq!(wire.load().lost, 1);
    }

    #[test]
    fn a_tick_after_a_miss_comes_ahead_of_its_sensors() {
        let mut wire = wire(21, &[], 0);
        wire.take(&tick(133, 12), 0);
        go_on(&mut wire, 133..=140);
        wire.take(&tick(140, 12), 0);
        assert_eq!((wire.cycle, wire.load().lost), (Some(140), 0));
    }

    #[test]
    fn a_restart_of_the_rig_is_reported() {
        let mut wire = wire(58, &[], 0);
        assert_eq!(wire.take(&tick(160, 0), 0), Some(WireEvent::Cycle(160, false)));
        assert_eq!(wire.take(&tick(0, 0), 0), Some(WireEvent::Cycle(0, true)));
        go_on(&mut wire, 0..=0);
        assert_eq!(wire.cycle, Some(0));
        let total: u64 = wire.totals().map(|(_, count)| count).sum();
        assert_eq!(total, 2 * 58 + 6 + 2 + 2, "counts of frames go on");
    }

    const VALUES: ChainValues = ChainValues {
        averaged_position_m: 0.1,
        position_set_point_m: 0.2,
        force_set_point_n: 100.0,
        control_error_m: 0.1,
    };

    #[test]
    fn what_a_hand_does_not_give_stays_as_the_controller_reported_it() {
        let mut wire = Wire::default();
        let axis = HandSetPointAxis::Load;
        assert_eq!(wire.hand_set_point(axis, None, Some(150.0)), None, "nobody knows where it stands");
        wire.take(&Frame::LoadChainValues(VALUES).encode().unwrap(), 0);
        let stays_m =
            wire.hand_set_point(axis, None, Some(150.0)).map(|asked| (asked.position_m * 1e4).round());
        assert_eq!(stays_m, Some(2000.0), "0.2 m to the step of the wire");
        let given = wire.hand_set_point(axis, Some(0.3), None).unwrap();
        assert!(given.position_m == 0.3 && (given.force_n - 100.0).abs() < 0.1, "{given:?}");
    }

    #[test]
    fn what_a_late_controller_says_is_of_the_cycle_that_it_answers() {
        let chain_values = Frame::DriveChainValues(VALUES).encode().unwrap();
        let mut wire = wire(58, &[], 0);
        assert_eq!(wire.take(&chain_values, 0), None, "nobody knows of which cycle");
        let command = ValveCommand { opening: 0.0, enable: true, alive: 1, echo: 154 };
        wire.take(&Frame::DriveValveCommand(command).encode().unwrap(), 0);
        let reported = wire.take(&chain_values, 0);
        assert!(
            matches!(reported, Some(WireEvent::ChainValues(0, 154, _))),
            "the newest sensors are of 157: {reported:?}"
        );
    }

    #[test]
    fn who_holds_a_stop_is_known_until_it_is_released_or_silent() {
        let stop = |release| {
            let reason = protocol::frames::EmergencyStopReason::Operator;
            Frame::DriveEmergencyStop(EmergencyStop { reason, release }).encode().unwrap()
        };
        let mut wire = Wire::default();
        wire.take(&stop(false), 100);
        assert_eq!(wire.emergency_stop(200).senders, ["drive"]);
        assert_eq!(wire.emergency_stop(100 + STOP_HOLDS_MS).senders, [""; 0]);
        wire.take(&stop(true), 300);
        assert_eq!(wire.emergency_stop(300).senders, [""; 0]);
    }

    #[test]
    fn a_load_is_that_of_the_last_second() {
        let mut wire = Wire::default();
        go_on(&mut wire, (0..1000).map(|cycle| cycle % 500));
        wire.turn(1000);
        let load = wire.load();
        assert_eq!(load.frames_per_s["DriveSensors"], 1000.0);
        assert_eq!(load.load_percent, Some(f64::from(2 * worst_case_bits(8)) / 10.0));
    }
}
