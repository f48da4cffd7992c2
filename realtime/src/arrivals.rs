//! How regularly a cyclic frame comes: its intervals, gaps and bursts.
//!
//! ```text
//! period T        ├────T────┼────T────┼────T────┼────T────┤
//! arrivals        ▲         ▲  ▲                ▲
//!                           burst   gap
//! ```
//! - *Gap*: an interval longer than 1.5 periods. A cycle that the sender skipped is one, and so is a frame that was lost.
//! - *Burst*: an interval shorter than half a period, as after a delay that held frames back. A frame that is sent on change too
//!   comes early whenever something changes: its bursts are not counted.
//!
//! Fed by a thread of normal priority from frames and their arrival stamps, in the order in which they arrived.

use std::borrow::Cow;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::clock::Instant;
use crate::histogram::{Percentiles, Recorder};

/// The account of one cyclic frame at one receiver.
#[derive(Debug)]
pub struct Arrivals {
    frame: &'static str,
    period: Duration,
    last: Option<Instant>,
    count: u64,
    gaps: u64,
    /// `None` for a frame that is sent on change too.
    bursts: Option<u64>,
    interval_ns: Recorder,
}

/// What `summary.json` and its like say of it.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ArrivalFigures {
    /// The frame's name.
    pub frame: Cow<'static, str>,
    /// Its period, ms.
    pub period_ms: u64,
    /// Frames that came.
    pub count: u64,
    /// Intervals longer than 1.5 periods.
    pub gaps: u64,
    /// Intervals shorter than half a period; `None` for a frame that is sent on change too.
    pub bursts: Option<u64>,
    /// Intervals between one frame and the next, ns.
    pub interval_ns: Percentiles,
}

impl Arrivals {
    /// An account of `frame`, which should come every `period`.
    #[must_use]
    pub fn new(frame: &'static str, period: Duration) -> Self {
        Self { frame, period, last: None, count: 0, gaps: 0, bursts: Some(0), interval_ns: Recorder::new() }
    }

    /// The same of a frame that is sent on change too.
    #[must_use]
    pub fn on_change_too(self) -> Self {
        Self { bursts: None, ..self }
    }

    /// A frame arrived.
    pub fn note(&mut self, at: Instant) {
        self.count += 1;
        let Some(last) = self.last.replace(at) else { return };
        let interval = at.saturating_duration_since(last);
        self.interval_ns.record(interval.as_nanos() as u64);
        self.gaps += u64::from(interval > self.period * 3 / 2);
        if let Some(bursts) = &mut self.bursts {
            *bursts += u64::from(interval < self.period / 2);
        }
    }

    /// The figures so far.
    #[must_use]
    pub fn figures(&self) -> ArrivalFigures {
        let Self { frame, count, gaps, bursts, .. } = *self;
        let period_ms = self.period.as_millis() as u64;
        ArrivalFigures {
            frame: frame.into(),
            period_ms,
            count,
            gaps,
            bursts,
            interval_ns: self.interval_ns.percentiles(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(stamps_us: &[u64]) -> ArrivalFigures {
        let mut arrivals = Arrivals::new("DriveValveCommand", Duration::from_millis(1));
        stamps_us.iter().for_each(|us| arrivals.note(Instant::from_nanos(us * 1000)));
        arrivals.figures()
    }

    #[test]
    fn a_regular_frame_has_neither_gap_nor_burst() {
        let got = figures(&[1000, 2400, 3000, 3900]);
        assert_eq!((got.count, got.gaps, got.bursts, got.interval_ns.count), (4, 0, Some(0), 3));
        assert_eq!(got.period_ms, 1);
    }

    #[test]
    fn a_lost_frame_is_a_gap_and_a_queue_let_go_is_a_burst() {
        let got = figures(&[1000, 3000, 4000, 8000, 8010, 8020, 9000]);
        assert_eq!((got.gaps, got.bursts), (2, Some(2)));
        // Exactly one and a half and exactly half a period are neither.
        let got = figures(&[1000, 2500, 3000]);
        assert_eq!((got.gaps, got.bursts), (0, Some(0)));
    }

    #[test]
    fn a_frame_that_is_sent_on_change_too_has_gaps_and_no_account_of_bursts() {
        let mut arrivals = Arrivals::new("Tick", Duration::from_millis(10)).on_change_too();
        [10, 11, 20, 50].iter().for_each(|ms| arrivals.note(Instant::from_nanos(ms * 1_000_000)));
        let got = arrivals.figures();
        assert_eq!((got.count, got.gaps, got.bursts), (4, 1, None));
        assert!(serde_json::to_string(&got).unwrap().contains(r#""bursts":null"#));
    }

    #[test]
    fn a_frame_that_never_came_has_no_interval() {
        let got = figures(&[]);
        assert_eq!((got.count, got.interval_ns.max), (0, None));
    }
}
