//! Worst-case response times on a CAN bus: how long a frame takes at most from its sender's queue to its end on the wire.
//!
//! ```text
//!   busy period    t    = B + E(t) + sum over k in hep(m) of n_k(t) C_k                          hep: m and all that outrank it
//!   instance q     w(q) = B + E(w + C_m) + q C_m + sum over k in hp(m) of n_k(w + bit) C_k       hp: all that outrank it
//!   response       R(q) = w(q) + C_m - a_m(q),   R = max over the q of the busy period
//!   releases       n(t) = min(ceil((t + J) / T), ceil(t / d)),   a(q) = max(q T - J, q d)
//!   blocking       B    = max C_k of all that m outranks: a transmission that has begun is not interrupted
//!   errors         E(t) = (31 bits + max C_k of hep(m)) F(t)
//! ```
//!
//! T is the period, or the least time between two frames in the long run; J lets frames come early against it; d is the least
//! time between two of them in a burst. With d = 0 these are the equations of the paper. All instances of the busy period are
//! looked at: the first one alone, which older analyses took for the worst, may be better than a later one, since its own
//! successor is delayed by a frame that was pushed through meanwhile. A response counts from the queue (the paper adds J,
//! which counts from the event behind it), and to the end of the intermission.
//!
//! `rig` knows the frames of `rig.dbc`, `critical` plays their worst case. What a wire does is modelled apart, in
//! [`crate::wire_time`], and tests hold both against each other.
//!
//! Source: Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised",
//! Real-Time Systems 35 (2007), section 3.2, and 3.4 for errors.

pub mod critical;
pub mod rig;

/// How frames of one identifier come at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrivals {
    /// Period, or least time between two frames in the long run, ns; above 0.
    pub period_ns: u64,
    /// How much earlier than that a frame may come, ns.
    pub jitter_ns: u64,
    /// Least time between any two frames, ns; 0 sets no limit.
    pub distance_ns: u64,
}

impl Arrivals {
    /// A frame each period, none early.
    #[must_use]
    pub const fn periodic(period_ns: u64) -> Self {
        Self { period_ns, jitter_ns: 0, distance_ns: 0 }
    }

    /// Up to `frames` in a row at `distance_ns`, and one each `period_ns` in the long run.
    #[must_use]
    pub const fn bursts(frames: u64, distance_ns: u64, period_ns: u64) -> Self {
        Self { period_ns, jitter_ns: (frames - 1) * period_ns, distance_ns }
    }

    /// Most frames in any half-open time of so many ns.
    #[must_use]
    pub const fn most_in(&self, time_ns: u64) -> u64 {
        if time_ns == 0 {
            return 0;
        }
        let by_period = (time_ns + self.jitter_ns).div_ceil(self.period_ns);
        if self.distance_ns == 0 {
            return by_period;
        }
        let by_distance = time_ns.div_ceil(self.distance_ns);
        if by_distance < by_period { by_distance } else { by_period }
    }

    /// Earliest time of frame `number`, counted from 0, after the first of a busy period, ns.
    #[must_use]
    pub const fn earliest_ns(&self, number: u64) -> u64 {
        let by_period = (number * self.period_ns).saturating_sub(self.jitter_ns);
        let by_distance = number * self.distance_ns;
        if by_distance > by_period { by_distance } else { by_period }
    }
}

/// All frames of one identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// Time of one frame on the wire, intermission included, ns.
    pub transmission_ns: u64,
    /// How they come.
    pub arrivals: Arrivals,
}

/// Errors at most: so many at once, and one more each `distance_ns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorBound {
    /// Errors that may hit in a row.
    pub burst: u64,
    /// Time between two errors in the long run, ns; above 0.
    pub distance_ns: u64,
}

impl ErrorBound {
    fn most_in(&self, time_ns: u64) -> u64 {
        self.burst + time_ns / self.distance_ns
    }
}

/// The wire that the streams share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Time of one bit, ns, rounded up.
    pub bit_ns: u64,
    /// Errors; `None` for a wire without.
    pub errors: Option<ErrorBound>,
}

/// The worst case of one stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Response {
    /// Longest time from the sender's queue to the end of the transmission, ns.
    pub response_ns: u64,
    /// Part of it that one transmission of a lower priority may take, ns.
    pub blocking_ns: u64,
    /// Longest time in which the wire is busy with this and higher priorities, ns.
    pub busy_period_ns: u64,
    /// Which instance of the busy period is the worst, counted from 0.
    pub worst_instance: u64,
}

/// Busy periods are not followed beyond this: whatever is so close to a full wire counts as one.
const LONGEST_BUSY_PERIOD_NS: u64 = 100_000_000_000;

/// The worst case of the stream at `place` of `streams`, which are in the order of their priority. `None` when there is none:
/// what has its priority or a higher one fills the wire.
#[must_use]
pub fn response(streams: &[Stream], place: usize, line: &Line) -> Option<Response> {
    let level = Level::of(streams, place, line);
    // Share of the wire, in 2^-40.
    let share =
        |stream: &Stream| (u128::from(stream.transmission_ns) << 40) / u128::from(stream.arrivals.period_ns);
    let errors =
        line.errors.map_or(0, |errors| (u128::from(level.error_ns) << 40) / u128::from(errors.distance_ns));
    if streams[..=place].iter().map(share).sum::<u128>() + errors >= 1 << 40 {
        return None;
    }
    let busy_period_ns = level.busy_period_ns()?;
    let instances = level.stream.arrivals.most_in(busy_period_ns);
    let mut worst = (0, 0);
    let mut waited_ns = level.blocking_ns;
    for number in 0..instances {
        waited_ns = level.waiting_ns(number, waited_ns)?;
        let response_ns =
            waited_ns + level.stream.transmission_ns - level.stream.arrivals.earliest_ns(number);
        if response_ns > worst.0 {
            worst = (response_ns, number);
        }
    }
    let (response_ns, worst_instance) = worst;
    Some(Response { response_ns, blocking_ns: level.blocking_ns, busy_period_ns, worst_instance })
}

/// One priority, and what is above and below it.
struct Level<'a> {
    above: &'a [Stream],
    stream: &'a Stream,
    line: &'a Line,
    blocking_ns: u64,
    error_ns: u64,
}

impl<'a> Level<'a> {
    fn of(streams: &'a [Stream], place: usize, line: &'a Line) -> Self {
        let (above, rest) = streams.split_at(place);
        let longest =
            |streams: &[Stream]| streams.iter().map(|stream| stream.transmission_ns).max().unwrap_or(0);
        let error_ns =
            u64::from(crate::wire_time::WORST_ERROR_BITS) * line.bit_ns + longest(&streams[..=place]);
        Self { above, stream: &rest[0], line, blocking_ns: longest(&rest[1..]), error_ns }
    }

    fn errors_ns(&self, time_ns: u64) -> u64 {
        self.line.errors.map_or(0, |errors| errors.most_in(time_ns) * self.error_ns)
    }

    fn interference_ns(&self, time_ns: u64) -> u64 {
        self.above.iter().map(|stream| stream.arrivals.most_in(time_ns) * stream.transmission_ns).sum()
    }

    fn busy_period_ns(&self) -> Option<u64> {
        fixed_point(self.stream.transmission_ns, |time_ns| {
            let instances_ns = self.stream.arrivals.most_in(time_ns) * self.stream.transmission_ns;
            self.blocking_ns + self.errors_ns(time_ns) + instances_ns + self.interference_ns(time_ns)
        })
    }

    /// Longest time until instance `number` begins, looked for from `from_ns` on.
    fn waiting_ns(&self, number: u64, from_ns: u64) -> Option<u64> {
        let before = self.blocking_ns + number * self.stream.transmission_ns;
        fixed_point(from_ns.max(before), |waited_ns| {
            before
                + self.errors_ns(waited_ns + self.stream.transmission_ns)
                + self.interference_ns(waited_ns + self.line.bit_ns)
        })
    }
}

/// The least time that does not grow any more, from `time_ns` on.
fn fixed_point(mut time_ns: u64, grown: impl Fn(u64) -> u64) -> Option<u64> {
    while time_ns <= LONGEST_BUSY_PERIOD_NS {
        let next_ns = grown(time_ns);
        if next_ns <= time_ns {
            return Some(time_ns);
        }
        time_ns = next_ns;
    }
    None
}

#[cfg(test)]
mod tests;
