//! The bus as the live page sees it: the rig's cycles, what the controllers say, who holds a stop, how full the wire is.

use super::columns::{AXES, MEASURED, MEASURED_COUNT};
use protocol::bus_load::worst_case_bits;
use protocol::can::CanFrame;
use protocol::frames::{
    ALIVE_RANGE, BIT_RATE_PER_S, ChainStatus, ChainValues, DecodeError, EmergencyStop, Frame, MESSAGES,
    RigStatus, Sensors, Tick,
};
use serde_json::{Map, Value, json};

/// Who stopped or failed to is known by a frame every 100 ms; one that is silent for so long holds nothing any more.
const STOP_HOLDS_MS: u64 = 500;
/// A controller's chains are told every 10 ms; after so long they are none.
const STATUS_HOLDS_MS: u64 = 1000;
/// Values of the tick's count of skipped cycles.
const SKIPPED_RANGE: u64 = 1 << 16;
/// Values of the echo in a command.
const ECHO_RANGE: u64 = 1 << 12;
/// Senders of emergency stops.
pub const STOPPERS: [&str; 4] = ["console", "rig", "drive", "load"];
/// Place of the console among them, whose frames are sent from here too.
pub const CONSOLE: usize = 0;

/// What a frame tells the rest of the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// The rig is at this cycle, and started anew if it is told so.
    Cycle(u64, bool),
    /// The controller of an axis says what it does, in its answer to the sensors of this cycle.
    Said(usize, u64, ChainValues),
}

/// Frames of the bus, taken in.
#[derive(Debug, Default)]
pub struct Wire {
    /// Of the newest sensors, once a tick has told it.
    cycle: Option<u64>,
    alive: Option<u8>,
    /// Low bits of the cycle that each controller answered last, as its command to the valve tells.
    echo: [Option<u16>; 2],
    /// Cycles without sensors here, and how many of them the rig skipped, since the first tick.
    missing: u64,
    skipped_at_first: Option<u16>,
    skipped: u64,
    status: Option<RigStatus>,
    chains: [Option<(u64, ChainStatus)>; 2],
    stops: [Option<u64>; 4],
    measured: [Option<f64>; MEASURED_COUNT],
    lost: u64,
    malformed: u64,
    frames: Counts,
}

/// Frames by message, this second and the last.
#[derive(Debug, Default)]
struct Counts {
    since_ms: u64,
    now: Vec<u64>,
    last: Vec<u64>,
    last_ms: u64,
    total: Vec<u64>,
}

impl Wire {
    /// Takes a frame that came at `now_ms`.
    pub fn take(&mut self, frame: &CanFrame, now_ms: u64) -> Option<News> {
        self.frames.count(frame);
        match Frame::decode(frame) {
            Ok(frame) => self.obey(frame, now_ms),
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => None,
            Err(_) => {
                self.malformed += 1;
                None
            }
        }
    }

    fn obey(&mut self, frame: Frame, now_ms: u64) -> Option<News> {
        match frame {
            Frame::DriveSensors(sensors) => {
                self.follow(sensors.alive);
                self.measure(0, &sensors);
            }
            Frame::LoadSensors(sensors) => self.measure(1, &sensors),
            Frame::DriveValveCommand(command) => {
                self.echo[0] = Some(command.echo);
                self.measured[0] = Some(if command.enable { command.opening } else { 0.0 });
            }
            Frame::LoadValveCommand(command) => {
                self.echo[1] = Some(command.echo);
                self.measured[MEASURED.len()] = Some(if command.enable { command.opening } else { 0.0 });
            }
            Frame::Tick(tick) => return self.tick(&tick),
            Frame::RigStatus(status) => self.status = Some(status),
            Frame::DriveChainStatus(status) => self.chains[0] = Some((now_ms, status)),
            Frame::LoadChainStatus(status) => self.chains[1] = Some((now_ms, status)),
            Frame::DriveChainValues(values) => return Some(News::Said(0, self.answered(0)?, values)),
            Frame::LoadChainValues(values) => return Some(News::Said(1, self.answered(1)?, values)),
            Frame::ConsoleEmergencyStop(stop) => self.note_stop(CONSOLE, stop, now_ms),
            Frame::RigEmergencyStop(stop) => self.note_stop(1, stop, now_ms),
            Frame::DriveEmergencyStop(stop) => self.note_stop(2, stop, now_ms),
            Frame::LoadEmergencyStop(stop) => self.note_stop(3, stop, now_ms),
            _ => {}
        }
        None
    }

    /// The cycle that a controller answered last. Newer sensors may have passed since: a late answer is of its own cycle.
    fn answered(&self, axis: usize) -> Option<u64> {
        let (cycle, echo) = (self.cycle?, self.echo[axis]?);
        let age = cycle.wrapping_sub(u64::from(echo)) % ECHO_RANGE;
        cycle.checked_sub(age)
    }

    fn measure(&mut self, axis: usize, sensors: &Sensors) {
        let Sensors { position_m, force_n, pressure_a_pa, pressure_b_pa, .. } = *sensors;
        let first = axis * MEASURED.len();
        for (place, value) in [position_m, force_n, pressure_a_pa, pressure_b_pa].into_iter().enumerate() {
            self.measured[first + 1 + place] = Some(value);
        }
    }

    /// Goes on to the sensors with this counter, the low bits of their cycle.
    fn follow(&mut self, alive: u8) {
        if let (Some(cycle), Some(before)) = (&mut self.cycle, self.alive) {
            let ahead = (ALIVE_RANGE + u64::from(alive) - u64::from(before)) % ALIVE_RANGE;
            *cycle += ahead;
            self.missing += ahead.saturating_sub(1);
        }
        self.alive = Some(alive);
    }

    fn tick(&mut self, tick: &Tick) -> Option<News> {
        let told = u64::from(tick.cycle);
        let anew = self.cycle.is_some_and(|cycle| told + ALIVE_RANGE < cycle);
        if anew {
            let frames = std::mem::take(&mut self.frames);
            *self = Self { frames, malformed: self.malformed, ..Self::default() };
        }
        let first = *self.skipped_at_first.get_or_insert(tick.skipped);
        self.skipped = (SKIPPED_RANGE + u64::from(tick.skipped) - u64::from(first)) % SKIPPED_RANGE;
        // A tick ahead of its sensors, after a miss, is of a cycle that is still to come.
        let behind = self.alive.map_or(0, |alive| (told + ALIVE_RANGE - u64::from(alive)) % ALIVE_RANGE);
        let cycle = *self.cycle.get_or_insert(told.saturating_sub(behind));
        if told >= cycle + ALIVE_RANGE {
            self.missing += (told - cycle) / ALIVE_RANGE * ALIVE_RANGE;
            self.cycle = Some(cycle + (told - cycle) / ALIVE_RANGE * ALIVE_RANGE);
        }
        self.lost = self.lost.max(self.missing.saturating_sub(self.skipped));
        Some(News::Cycle(told, anew))
    }

    /// Notes a stop or its release.
    pub fn note_stop(&mut self, stopper: usize, stop: EmergencyStop, now_ms: u64) {
        self.stops[stopper] = (!stop.release).then_some(now_ms);
    }

    /// The rig's status as it was told last.
    #[must_use]
    pub fn status(&self) -> Option<&RigStatus> {
        self.status.as_ref()
    }

    /// What sensors and valves show.
    #[must_use]
    pub fn measured(&self) -> &[Option<f64>; MEASURED_COUNT] {
        &self.measured
    }

    /// The emergency stop: whether it is tripped, and who holds it.
    #[must_use]
    pub fn emergency_stop(&self, now_ms: u64) -> Value {
        let holds = |at: &Option<u64>| at.is_some_and(|at_ms| now_ms.saturating_sub(at_ms) < STOP_HOLDS_MS);
        let senders = STOPPERS.iter().zip(&self.stops).filter(|(_, at)| holds(at));
        let senders: Vec<_> = senders.map(|(name, _)| name).collect();
        json!({ "active": self.status.map(|status| status.emergency_stop), "senders": senders })
    }

    /// The states of the chains of both axes; null of a controller that is silent.
    #[must_use]
    pub fn chains(&self, now_ms: u64) -> Value {
        let fresh = self.chains.map(|heard| {
            heard
                .filter(|(at_ms, _)| now_ms.saturating_sub(*at_ms) < STATUS_HOLDS_MS)
                .map(|(_, status)| status)
        });
        let states = AXES.iter().zip(fresh);
        states
            .map(|(axis, status)| ((*axis).to_owned(), json!(status.map(super::chains::active))))
            .collect::<Map<_, _>>()
            .into()
    }

    /// A second is over, perhaps.
    pub fn turn(&mut self, now_ms: u64) {
        self.frames.turn(now_ms);
    }

    /// How full the bus is, by frame, and what was lost here.
    #[must_use]
    pub fn load(&self) -> Value {
        let counts = &self.frames;
        let seconds = counts.last_ms as f64 / 1000.0;
        let told = |(place, count): (usize, &u64)| {
            (*count > 0)
                .then(|| (name(place).to_owned(), json!((*count as f64 / seconds * 10.0).round() / 10.0)))
        };
        let bits: u64 =
            counts.last.iter().enumerate().map(|(place, count)| count * u64::from(bits(place))).sum();
        let load_percent = (seconds > 0.0).then(|| 100.0 * bits as f64 / seconds / f64::from(BIT_RATE_PER_S));
        json!({
            "load_percent": load_percent,
            "frames_per_s": counts.last.iter().enumerate().filter_map(told).collect::<Map<_, _>>(),
            "lost": self.lost,
            "malformed": self.malformed,
        })
    }

    /// Frames so far by name.
    pub fn totals(&self) -> impl Iterator<Item = (&'static str, u64)> {
        self.frames.total.iter().enumerate().map(|(place, count)| (name(place), *count))
    }
}

/// Name of a message by its place; the last place is that of all others.
fn name(place: usize) -> &'static str {
    MESSAGES.get(place).map_or("others", |message| message.name)
}

/// Bits of a message on the wire at most; of others those of the longest.
fn bits(place: usize) -> u32 {
    worst_case_bits(MESSAGES.get(place).map_or(8, |message| message.length))
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

    fn turn(&mut self, now_ms: u64) {
        let passed_ms = now_ms.saturating_sub(self.since_ms);
        if passed_ms >= 1000 {
            (self.since_ms, self.last_ms) = (now_ms, passed_ms);
            self.last = std::mem::take(&mut self.now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::ValveCommand;

    fn sensors(cycle: u64) -> CanFrame {
        let (position_m, force_n, pressure_a_pa, pressure_b_pa) = (0.1, 0.0, 1e5, 1e5);
        let alive = (cycle % ALIVE_RANGE) as u8;
        Frame::DriveSensors(Sensors { position_m, force_n, pressure_a_pa, pressure_b_pa, alive })
            .encode()
            .unwrap()
    }

    fn tick(cycle: u64, skipped: u16) -> CanFrame {
        let tick = Tick { cycle: cycle as u32, skipped, catch_up: false, lockstep: false, ending: false };
        Frame::Tick(tick).encode().unwrap()
    }

    /// Cycles of which those in `without` have no sensors; ticks tell `skipped` of them as skipped.
    fn wire(cycles: u64, without: &[u64], skipped: u16) -> Wire {
        let mut wire = Wire::default();
        for cycle in 100..100 + cycles {
            if !without.contains(&cycle) {
                wire.take(&sensors(cycle), cycle);
            }
            if cycle % 10 == 0 {
                wire.take(&tick(cycle, if cycle > 120 { skipped } else { 0 }), cycle);
            }
        }
        wire
    }

    #[test]
    fn cycles_are_followed_between_ticks_and_over_gaps() {
        let wire = wire(58, &[103, 131, 132], 2);
        assert_eq!(wire.cycle, Some(157));
        assert_eq!(wire.load()["lost"], 1, "three are missing, and two of them the rig skipped");
        let gap: Vec<u64> = (125..165).collect();
        assert_eq!(self::wire(80, &gap, 0).cycle, Some(179), "a gap longer than the counter");
    }

    #[test]
    fn a_rig_that_starts_anew_is_told() {
        let mut wire = wire(58, &[], 0);
        assert_eq!(wire.take(&tick(160, 0), 0), Some(News::Cycle(160, false)));
        assert_eq!(wire.take(&tick(0, 0), 0), Some(News::Cycle(0, true)));
        wire.take(&sensors(0), 0);
        assert_eq!(wire.cycle, Some(0));
    }

    #[test]
    fn what_a_late_controller_says_is_of_the_cycle_that_it_answers() {
        let values = ChainValues {
            averaged_position_m: 0.1,
            position_set_point_m: 0.2,
            force_set_point_n: 0.0,
            control_error_m: 0.1,
        };
        let said = Frame::DriveChainValues(values).encode().unwrap();
        let mut wire = wire(58, &[], 0);
        assert_eq!(wire.take(&said, 0), None, "nobody knows of which cycle");
        let command = ValveCommand { opening: 0.0, enable: true, alive: 1, echo: 154 };
        wire.take(&Frame::DriveValveCommand(command).encode().unwrap(), 0);
        let told = wire.take(&said, 0);
        assert!(matches!(told, Some(News::Said(0, 154, _))), "the newest sensors are of 157: {told:?}");
    }

    #[test]
    fn who_holds_a_stop_is_known_until_it_is_released_or_silent() {
        let stop = |release| {
            let reason = protocol::frames::EmergencyStopReason::Operator;
            Frame::DriveEmergencyStop(EmergencyStop { reason, release }).encode().unwrap()
        };
        let mut wire = Wire::default();
        wire.take(&stop(false), 100);
        assert_eq!(wire.emergency_stop(200)["senders"], json!(["drive"]));
        assert_eq!(wire.emergency_stop(100 + STOP_HOLDS_MS)["senders"], json!([]));
        wire.take(&stop(true), 300);
        assert_eq!(wire.emergency_stop(300)["senders"], json!([]));
    }

    #[test]
    fn a_load_is_that_of_the_last_second() {
        let mut wire = Wire::default();
        for cycle in 0..1000 {
            wire.take(&sensors(cycle), cycle);
        }
        wire.turn(1000);
        let load = wire.load();
        assert_eq!(load["frames_per_s"]["DriveSensors"], 1000.0);
        assert_eq!(load["load_percent"], f64::from(worst_case_bits(8)) / 10.0);
    }
}
