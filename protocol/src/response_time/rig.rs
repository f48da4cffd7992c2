//! The frames of `rig.dbc` in the analysis: how often each comes at most, and whether a bit rate carries them all in time.
//!
//! A period stands in `rig.dbc`. What has none, or comes on a change too, has a least distance in the table here, each with its
//! reason: what is honest for the programs of this project, and an assumption for those of others, who may send as they like.
//! The bound holds for senders that keep to it.

use super::{Arrivals, ErrorBound, Line, Response, Stream, response};
use crate::bus_load::{LOAD_LIMIT_PPM, RESERVE_BITS, load_ppm_at, share_ppm_at, worst_case_bits};
use crate::frames::{MESSAGES, MessageSpec};
use crate::wire_time::duration_ns;
use std::fmt;

const MS: u64 = 1_000_000;

/// Release jitter of a cyclic frame: largest delay of its queuing against its period. A guess: what a loop of FIFO priority
/// keeps on a shared machine, except in its worst moments.
pub const RELEASE_JITTER_NS: u64 = 50_000;

/// Release jitter of the controllers' answers. An answer is queued after the frame that it answers was sent, so its jitter
/// includes the delay of that frame: a [`Tick`](crate::frames::TICK) and an emergency stop ahead of it are 200 bits. In lockstep
/// a test checks it; 185 us were seen. The analysis treats answers as independent of what they answer; with 220 us it would
/// find no bound for the load's sensors within 1 ms.
pub const ANSWER_JITTER_NS: u64 = 200_000;

/// Names of the answers end so.
const ANSWERS: [&str; 3] = ["ValveCommand", "ChainStatus", "ChainValues"];

const fn chain() -> Arrivals {
    let burst = Arrivals::bursts(6, MS - ANSWER_JITTER_NS, 5 * MS);
    Arrivals { jitter_ns: burst.jitter_ns + ANSWER_JITTER_NS, ..burst }
}

/// Names beginning so, how they come, and why.
const ARRIVALS: &[(&str, Arrivals, &str)] = &[
    (
        "EmergencyStop",
        Arrivals::bursts(2, MS, 100 * MS),
        "a stop and its release in two cycles; then repeated each 100 ms",
    ),
    ("Tick", Arrivals::bursts(2, MS, 10 * MS), "each 10 ms, and once more in a cycle of catch-up"),
    (
        "ChainStatus",
        chain(),
        "a chain moves by one edge a cycle: six in a row, as at the start; twice the period's in the long run",
    ),
    ("ChainValues", chain(), "with the status"),
    (
        "RunControl",
        Arrivals::bursts(2, MS, 100 * MS),
        "a person: an abort right after a start, then ten a second",
    ),
    ("HandForce", Arrivals::periodic(10 * MS), "a slider that is pulled: a hundred a second"),
    ("HandSetPoint", Arrivals::periodic(10 * MS), "a slider that is pulled: a hundred a second"),
    ("Link", Arrivals::periodic(100 * MS), "a person"),
    ("Weights", Arrivals::periodic(100 * MS), "a person"),
    ("FaultMark", Arrivals::bursts(2, MS, 100 * MS), "two faults that begin together"),
    ("XcpCommand", Arrivals::periodic(10 * MS), "a master waits for the response, and its program for that"),
    (
        "XcpResponse",
        Arrivals::bursts(2, MS, 2 * MS),
        "the reserve of one DAQ frame a ms, shared by two controllers",
    ),
];

/// A frame of `rig.dbc` as the analysis sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigFrame {
    /// Its specification in `rig.dbc`.
    pub message: &'static MessageSpec,
    /// Bits of one frame, intermission included.
    pub bits: u32,
    /// How it comes at most.
    pub arrivals: Arrivals,
    /// Why so; empty for a frame that comes with its period and never else.
    pub reason: &'static str,
}

impl RigFrame {
    fn worst(message: &'static MessageSpec) -> Self {
        let special = ARRIVALS.iter().find(|(name, ..)| message.name.ends_with(name));
        let (arrivals, reason) = match special {
            Some((_, arrivals, reason)) => (*arrivals, *reason),
            None => {
                let period_ns = u64::from(message.cycle_time_ms) * MS;
                (Arrivals { jitter_ns: late_ns(message), ..Arrivals::periodic(period_ns) }, "")
            }
        };
        Self { message, bits: worst_case_bits(message.length), arrivals, reason }
    }

    /// Allows for frames that came closer than they may: a late machine makes them. The arguments are those of the wire model's
    /// report.
    pub fn allow_for(&mut self, least_distance_ns: Option<u64>, release_jitter_ns: Option<u64>) {
        let Arrivals { jitter_ns, distance_ns, .. } = &mut self.arrivals;
        if let Some(seen_ns) = least_distance_ns {
            *distance_ns = (*distance_ns).min(seen_ns);
        }
        // Where a frame comes on a change too, early ones are no jitter.
        if let Some(seen_ns) = release_jitter_ns.filter(|_| self.reason.is_empty()) {
            *jitter_ns = (*jitter_ns).max(seen_ns);
        }
    }

    /// Whether frames that came so kept to what is declared here; the arguments are those of the wire model's report. Its jitter
    /// counts against the period of `rig.dbc`, and says nothing of frames that come on a change too.
    #[must_use]
    pub fn kept_to(&self, least_distance_ns: Option<u64>, release_jitter_ns: Option<u64>) -> bool {
        let close = least_distance_ns.is_some_and(|seen_ns| seen_ns < self.arrivals.earliest_ns(1));
        let early = release_jitter_ns.is_some_and(|seen_ns| seen_ns > self.arrivals.jitter_ns);
        !(close || early && self.reason.is_empty())
    }

    /// Time by which it must be through, counted from its queue: its period less what it may be queued late. `None` for events.
    #[must_use]
    pub fn deadline_ns(&self) -> Option<u64> {
        let period_ns = u64::from(self.message.cycle_time_ms) * MS;
        (period_ns > 0).then(|| period_ns - late_ns(self.message))
    }

    fn is_late(&self, response: Option<Response>) -> bool {
        let is_beyond = |deadline_ns| response.is_none_or(|found| found.response_ns > deadline_ns);
        self.deadline_ns().is_some_and(is_beyond)
    }
}

/// How much later than its period a frame may be queued.
fn late_ns(message: &MessageSpec) -> u64 {
    let answers = ANSWERS.iter().any(|ending| message.name.ends_with(ending));
    if answers { ANSWER_JITTER_NS } else { RELEASE_JITTER_NS }
}

/// The analysis of `rig.dbc` at a bit rate.
#[derive(Clone, Debug, PartialEq)]
pub struct RigAnalysis {
    /// Bit rate of the wire.
    pub bits_per_s: u32,
    errors: Option<ErrorBound>,
    /// In the order of arbitration, the highest priority first.
    pub frames: Vec<RigFrame>,
}

impl RigAnalysis {
    /// All frames of `rig.dbc` with worst-case stuffing, on a wire without errors.
    #[must_use]
    pub fn worst_case(bits_per_s: u32) -> Self {
        // Identifiers stand in their order, which is that of arbitration: a test of bus_load holds it.
        let frames = MESSAGES.iter().map(|message| RigFrame::worst(message)).collect();
        Self { bits_per_s, errors: None, frames }
    }

    /// The same on a wire with at most so many errors.
    #[must_use]
    pub fn with_errors(mut self, errors: ErrorBound) -> Self {
        self.errors = Some(errors);
        self
    }

    /// With other bits or arrivals: of the frames that were really sent. What `change` refuses is left out.
    #[must_use]
    pub fn with(mut self, mut change: impl FnMut(&mut RigFrame) -> bool) -> Self {
        self.frames.retain_mut(|frame| change(frame));
        self
    }

    /// The worst case of each frame, in their order.
    #[must_use]
    pub fn responses(&self) -> Vec<Option<Response>> {
        let stream = |frame: &RigFrame| Stream {
            transmission_ns: duration_ns(frame.bits, self.bits_per_s),
            arrivals: frame.arrivals,
        };
        let streams: Vec<_> = self.frames.iter().map(stream).collect();
        let line = Line { bit_ns: duration_ns(1, self.bits_per_s), errors: self.errors };
        (0..streams.len()).map(|place| response(&streams, place, &line)).collect()
    }

    /// The worst case of the frame with identifier `id`; `None` when there is none, or no such frame.
    #[must_use]
    pub fn response_of(&self, id: u16) -> Option<Response> {
        let place = self.frames.iter().position(|frame| frame.message.id == id)?;
        self.responses()[place]
    }

    /// Number of the cyclic frames that are not through by their deadline.
    fn late(&self) -> usize {
        let of_frame = self.frames.iter().zip(self.responses());
        of_frame.filter(|(frame, response)| frame.is_late(*response)).count()
    }
}

/// A response for people, in us.
#[must_use]
pub fn in_us(response_ns: Option<u64>) -> String {
    response_ns.map_or_else(|| "unbounded".into(), |ns| format!("{:.0}", ns as f64 / 1e3))
}

/// How a frame comes, for people: `1 ms`, or `2 at 1 ms, 100 ms`.
#[must_use]
pub fn arrivals_text(arrivals: &Arrivals) -> String {
    let ms = |ns: u64| ns as f64 / MS as f64;
    match arrivals.jitter_ns / arrivals.period_ns {
        0 => format!("{} ms", ms(arrivals.period_ns)),
        more => format!("{} at {} ms, {} ms", more + 1, ms(arrivals.distance_ns), ms(arrivals.period_ns)),
    }
}

impl fmt::Display for RigAnalysis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "worst-case response times at {} bit/s, from the sender's queue on:", self.bits_per_s)?;
        write!(
            f,
            "{:<22} {:>5} {:>5} {:<20} {:>11} {:>11}",
            "frame", "id", "bits", "comes at most", "response_us", "deadline_us"
        )?;
        for (frame, found) in self.frames.iter().zip(self.responses()) {
            let RigFrame { message: MessageSpec { name, id, .. }, bits, arrivals, .. } = frame;
            let response = in_us(found.map(|found| found.response_ns));
            let deadline = frame.deadline_ns().map_or_else(String::new, |ns| in_us(Some(ns)));
            let comes = arrivals_text(arrivals);
            write!(f, "\n{name:<22} {id:#05X} {bits:>5} {comes:<20} {response:>11} {deadline:>11}")?;
        }
        Ok(())
    }
}

/// Why a bit rate is too low for `rig.dbc`, with the arithmetic.
#[derive(Clone, Debug, PartialEq)]
pub struct TooSlow(RigAnalysis);

impl fmt::Display for TooSlow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bits_per_s = self.0.bits_per_s;
        let percent = |ppm: u64| ppm as f64 / 1e4;
        writeln!(f, "at {bits_per_s} bit/s the cyclic frames of rig.dbc do not fit:")?;
        for (frame, found) in self.0.frames.iter().zip(self.0.responses()) {
            let (Some(deadline_ns), message) = (frame.deadline_ns(), frame.message) else { continue };
            let response_ns = found.map(|found| found.response_ns);
            let share = percent(share_ppm_at(frame.bits, message.cycle_time_ms, bits_per_s));
            writeln!(
                f,
                "  {:<22} {:#05X} {:>3} bits each {:>3} ms = {share:>5.2} %, response {:>9} of {:>5} us{}",
                message.name,
                message.id,
                frame.bits,
                message.cycle_time_ms,
                in_us(response_ns),
                in_us(Some(deadline_ns)),
                if frame.is_late(found) { "  too late" } else { "" },
            )?;
        }
        let reserve = percent(share_ppm_at(RESERVE_BITS, 1, bits_per_s));
        writeln!(
            f,
            "  {:<28} {RESERVE_BITS:>3} bits each   1 ms = {reserve:>5.2} %",
            "reserve: one DAQ frame"
        )?;
        let (load, limit) = (percent(load_ppm_at(bits_per_s)), percent(LOAD_LIMIT_PPM));
        write!(f, "  load {load:.2} %, limit {limit:.0} %; {} frames miss their deadline", self.0.late())
    }
}

/// Holds a bit rate against what `rig.dbc` sends in cycles: load, and deadlines.
///
/// # Errors
/// [`TooSlow`], which shows the arithmetic.
pub fn check(bits_per_s: u32) -> Result<(), TooSlow> {
    let analysis = RigAnalysis::worst_case(bits_per_s);
    if load_ppm_at(bits_per_s) <= LOAD_LIMIT_PPM && analysis.late() == 0 {
        Ok(())
    } else {
        Err(TooSlow(analysis))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{
        DRIVE_CHAIN_STATUS, DRIVE_SENSORS, DRIVE_VALVE_COMMAND, LOAD_SENSORS, LOAD_XCP_RESPONSE,
    };

    #[test]
    fn every_frame_comes_with_a_period_or_a_reason() {
        for frame in RigAnalysis::worst_case(1_000_000).frames {
            let MessageSpec { name, cycle_time_ms, send_type, .. } = frame.message;
            assert!(frame.arrivals.period_ns > 0, "{name}: add it to ARRIVALS");
            assert!(*cycle_time_ms > 0 || !frame.reason.is_empty(), "{name}");
            let strictly_cyclic = *send_type == "Cyclic";
            assert_eq!(strictly_cyclic, frame.reason.is_empty(), "{name} is {send_type}");
        }
    }

    /// By hand: 4 emergency stops of 75, commands of 105, sensors of 135, and 135 for whatever had begun before.
    #[test]
    fn frames_of_each_ms_have_the_response_made_by_hand() {
        let analysis = RigAnalysis::worst_case(1_000_000);
        let of = |message: &MessageSpec| analysis.response_of(message.id).unwrap().response_ns / 1000;
        let [command, sensors, last] = [DRIVE_VALVE_COMMAND, DRIVE_SENSORS, LOAD_SENSORS].map(of);
        assert_eq!(command, 135 + 300 + 105);
        assert_eq!(sensors, 135 + 300 + 210 + 135);
        assert_eq!(last, 135 + 300 + 210 + 135 + 135);
    }

    #[test]
    fn what_came_too_close_or_too_early_did_not_keep_to_it() {
        let analysis = RigAnalysis::worst_case(1_000_000);
        let of = |id: u16| *analysis.frames.iter().find(|frame| frame.message.id == id).unwrap();
        let (sensors, answer, chain) =
            (of(DRIVE_SENSORS.id), of(DRIVE_VALVE_COMMAND.id), of(DRIVE_CHAIN_STATUS.id));
        assert!(sensors.kept_to(None, None) && sensors.kept_to(Some(950_000), Some(50_000)));
        assert!(!sensors.kept_to(Some(949_999), Some(0)) && !sensors.kept_to(Some(MS), Some(50_001)));
        assert!(answer.kept_to(Some(800_000), Some(200_000)) && !answer.kept_to(Some(799_999), None));
        // Early ones are no jitter where a frame comes on a change too.
        assert!(chain.kept_to(Some(800_000), Some(100 * MS)) && !chain.kept_to(Some(799_999), None));
    }

    #[test]
    fn one_mbit_carries_all_and_half_a_mbit_does_not() {
        assert_eq!(check(1_000_000), Ok(()));
        let reported = check(500_000).unwrap_err().to_string();
        for part in [
            "at 500000 bit/s",
            "DriveSensors           0x120 135 bits each   1 ms = 27.00 %",
            "1090 of   800 us  too late",
            "unbounded of  9800 us  too late",
            "reserve: one DAQ frame",
            "load 137.60 %, limit 70 %",
        ] {
            assert!(reported.contains(part), "'{part}' is not in\n{reported}");
        }
    }

    #[test]
    fn even_the_last_frame_has_a_bound_at_one_mbit_with_and_without_errors() {
        let analysis = RigAnalysis::worst_case(1_000_000);
        let last = analysis.response_of(LOAD_XCP_RESPONSE.id).unwrap();
        let errors = ErrorBound { burst: 1, distance_ns: 10 * MS };
        let with_errors = analysis.with_errors(errors).response_of(LOAD_XCP_RESPONSE.id).unwrap();
        assert!(with_errors.response_ns > last.response_ns);
    }

    #[test]
    fn frames_that_were_really_sent_are_faster() {
        let analysis = RigAnalysis::worst_case(1_000_000);
        let sent = analysis.clone().with(|frame| {
            frame.bits -= 10;
            frame.message.id >= 0x110
        });
        let faster = sent.response_of(DRIVE_VALVE_COMMAND.id).unwrap().response_ns;
        assert_eq!(faster, (125 + 95) * 1000);
    }
}
