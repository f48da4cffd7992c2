//! A row of segments, one after the other.

use super::law::Law;
use std::sync::Arc;

/// Sums of decimal fractions carry roundings: a segment begins a nanosecond early, so that it never misses its cycle of 1 ms.
pub(super) const ROUNDING_S: f64 = 1e-9;

pub(super) trait RowSegment {
    /// Its duration, s, and the value from its end on.
    fn duration_and_end(&self) -> (f64, f64);
}

impl RowSegment for Arc<dyn Law> {
    fn duration_and_end(&self) -> (f64, f64) {
        let extent = self.extent();
        (extent.duration_s, extent.end)
    }
}

/// Segments in a row from a start value; the unit is the row's, m or N.
#[derive(Clone, Debug)]
pub(super) struct Row<S> {
    pub(super) start: f64,
    pub(super) segments: Vec<S>,
    /// When each segment ends, s after the row's start.
    until_s: Vec<f64>,
    /// The value from the last one's end on.
    pub(super) end: f64,
}

impl<S: RowSegment> Row<S> {
    pub(super) fn new(start: f64, segments: Vec<S>) -> Self {
        let (mut end_s, mut end) = (0.0, start);
        let mut ends = |segment: &S| {
            let duration_s;
            (duration_s, end) = segment.duration_and_end();
            end_s += duration_s;
            end_s
        };
        let until_s = segments.iter().map(&mut ends).collect();
        Self { start, segments, until_s, end }
    }

    pub(super) fn locate(&self, time_s: f64) -> RowPosition<'_, S> {
        if time_s < -ROUNDING_S {
            return RowPosition::Before;
        }
        let mut begun_s = 0.0;
        for (index, (segment, until_s)) in self.segments.iter().zip(&self.until_s).enumerate() {
            if time_s < until_s - ROUNDING_S {
                return RowPosition::In { index, segment, since_s: (time_s - begun_s).max(0.0) };
            }
            begun_s = *until_s;
        }
        RowPosition::After
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.until_s.last().copied().unwrap_or(0.0)
    }
}

/// Where a time lies in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum RowPosition<'a, S> {
    Before,
    In { index: usize, segment: &'a S, since_s: f64 },
    After,
}
