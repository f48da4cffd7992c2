//! A quantity over time, and the arithmetic that figures are made of.
//!
//! Samples stand at growing times; where there was no value there is no sample. Smoothing and slopes are centred, so that
//! they shift nothing in time; at the ends their window is cut. Stretches of time are half open: a sample at `to_s` is no
//! longer inside.

/// Times that differ by less are the same: far below a cycle, far above a rounding.
const SAME_S: f64 = 1e-7;
/// Longest gap that does not end a stretch, s: cycles that a late rig skipped are in no table of a controller, and time went on.
const LONGEST_GAP_S: f64 = 0.1;

/// Samples of a quantity at growing times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    time_s: Vec<f64>,
    values: Vec<f64>,
}

/// A stretch of time, half open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The first instant of it, s.
    pub from_s: f64,
    /// The first instant after it, s.
    pub to_s: f64,
}

impl Span {
    /// Its length, s.
    pub fn length_s(&self) -> f64 {
        self.to_s - self.from_s
    }

    /// Whether `time_s` lies inside.
    pub fn holds(&self, time_s: f64) -> bool {
        time_s >= self.from_s - SAME_S && time_s < self.to_s - SAME_S
    }

    /// What it has in common with another stretch; `None` when that has no length.
    #[must_use]
    pub fn common(&self, other: &Self) -> Option<Self> {
        let both = Self { from_s: self.from_s.max(other.from_s), to_s: self.to_s.min(other.to_s) };
        (both.length_s() > SAME_S).then_some(both)
    }

    /// Its last `length_s`, or all of it when it is shorter.
    #[must_use]
    pub fn last(&self, length_s: f64) -> Self {
        Self { from_s: self.from_s.max(self.to_s - length_s), to_s: self.to_s }
    }
}

impl FromIterator<(f64, f64)> for Series {
    fn from_iter<I: IntoIterator<Item = (f64, f64)>>(samples: I) -> Self {
        let (time_s, values) = samples.into_iter().unzip();
        Self { time_s, values }
    }
}

impl Series {
    /// A series without samples.
    pub const NONE: &'static Self = &Self { time_s: Vec::new(), values: Vec::new() };

    /// Adds a sample; `time_s` is later than those before.
    pub fn push(&mut self, time_s: f64, value: f64) {
        self.time_s.push(time_s);
        self.values.push(value);
    }

    /// Time and value of each sample.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (f64, f64)> + ExactSizeIterator + Clone + '_ {
        self.time_s.iter().copied().zip(self.values.iter().copied())
    }

    /// The values of all samples, in the order of their times.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// First time and the time after the last.
    pub fn span(&self) -> Option<Span> {
        Some(Span { from_s: *self.time_s.first()?, to_s: self.time_s.last()? + self.period_s() })
    }

    /// Smallest distance of the first samples: the record's cycle.
    pub fn period_s(&self) -> f64 {
        let steps = self.time_s.windows(2).take(100).map(|pair| pair[1] - pair[0]);
        steps.fold(f64::INFINITY, f64::min).min(1.0)
    }

    /// The samples inside `span`.
    #[must_use]
    pub fn within(&self, span: &Span) -> Self {
        let place = |time_s: f64| self.time_s.partition_point(|time| *time < time_s - SAME_S);
        let (from, to) = (place(span.from_s), place(span.to_s));
        let to = to.max(from);
        Self { time_s: self.time_s[from..to].to_vec(), values: self.values[from..to].to_vec() }
    }

    /// The samples inside any of `spans`, which grow in time.
    #[must_use]
    pub fn within_all(&self, spans: &[Span]) -> Self {
        spans.iter().flat_map(|span| self.within(span).iter().collect::<Vec<_>>()).collect()
    }

    /// Each value through `change`.
    #[must_use]
    pub fn map(&self, change: impl Fn(f64) -> f64) -> Self {
        Self { time_s: self.time_s.clone(), values: self.values.iter().map(|value| change(*value)).collect() }
    }

    /// The same values at times moved by `by_s`.
    #[must_use]
    pub fn shifted(&self, by_s: f64) -> Self {
        Self { time_s: self.time_s.iter().map(|time| time + by_s).collect(), values: self.values.clone() }
    }

    /// Both values through `join` where both have a sample of the same time.
    #[must_use]
    pub fn with(&self, other: &Self, join: impl Fn(f64, f64) -> f64) -> Self {
        let mut others = other.iter().peekable();
        let mut result = Self::default();
        for (time, value) in self.iter() {
            while others.next_if(|(earlier, _)| *earlier < time - SAME_S).is_some() {}
            if let Some((_, other)) = others.next_if(|(same, _)| *same < time + SAME_S) {
                result.push(time, join(value, other));
            }
        }
        result
    }

    /// This less the other where both have a sample of the same time.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        self.with(other, |value, other| value - other)
    }

    /// The last value at or before `time_s`.
    pub fn at(&self, time_s: f64) -> Option<f64> {
        let after = self.time_s.partition_point(|time| *time < time_s + SAME_S);
        after.checked_sub(1).map(|place| self.values[place])
    }

    /// First and last sample, as places, of the window around each sample.
    fn windows(&self, length_s: f64) -> impl Iterator<Item = (usize, usize)> + '_ {
        let (mut from, mut to) = (0, 0);
        self.time_s.iter().map(move |time| {
            while self.time_s[from] < time - 0.5 * length_s - SAME_S {
                from += 1;
            }
            while to + 1 < self.time_s.len() && self.time_s[to + 1] < time + 0.5 * length_s + SAME_S {
                to += 1;
            }
            (from, to)
        })
    }

    /// Mean over a centred window.
    #[must_use]
    pub fn smoothed(&self, length_s: f64) -> Self {
        let mut sums = Vec::with_capacity(self.len() + 1);
        sums.push(0.0);
        sums.extend(self.values.iter().scan(0.0, |sum, value| {
            *sum += value;
            Some(*sum)
        }));
        let means =
            self.windows(length_s).map(|(from, to)| (sums[to + 1] - sums[from]) / (to + 1 - from) as f64);
        Self { time_s: self.time_s.clone(), values: means.collect() }
    }

    /// Slope of the straight line through a centred window, by least squares; a window of one sample has none and is left out.
    #[must_use]
    pub fn slope(&self, length_s: f64) -> Self {
        let slope = |(from, to): (usize, usize)| {
            let count = (to + 1 - from) as f64;
            let mean = |row: &[f64]| row[from..=to].iter().sum::<f64>() / count;
            let (time, value) = (mean(&self.time_s), mean(&self.values));
            let sums = (from..=to).fold((0.0, 0.0), |(cross, square), place| {
                let apart = self.time_s[place] - time;
                (cross + apart * (self.values[place] - value), square + apart * apart)
            });
            (sums.1 > 0.0).then(|| sums.0 / sums.1)
        };
        let slopes = self.time_s.iter().zip(self.windows(length_s));
        slopes.filter_map(|(time, window)| Some((*time, slope(window)?))).collect()
    }

    /// Mean of the values; `None` of no sample.
    pub fn mean(&self) -> Option<f64> {
        (!self.is_empty()).then(|| self.values.iter().sum::<f64>() / self.len() as f64)
    }

    /// Root of the mean square; `None` of no sample.
    pub fn rms(&self) -> Option<f64> {
        self.map(|value| value * value).mean().map(f64::sqrt)
    }

    /// Least value; `None` of no sample.
    pub fn least(&self) -> Option<f64> {
        self.values.iter().copied().reduce(f64::min)
    }

    /// Largest value; `None` of no sample.
    pub fn most(&self) -> Option<f64> {
        self.values.iter().copied().reduce(f64::max)
    }

    /// Largest absolute value; `None` of no sample.
    pub fn largest(&self) -> Option<f64> {
        self.map(f64::abs).most()
    }

    /// Largest less least value; `None` of no sample.
    pub fn peak_to_peak(&self) -> Option<f64> {
        Some(self.most()? - self.least()?)
    }

    pub(crate) fn first_time(&self, wanted: impl Fn(f64) -> bool) -> Option<f64> {
        self.iter().find(|(_, value)| wanted(*value)).map(|(time, _)| time)
    }

    /// Time of the first sample from which on all values are as wanted; none when the last is not.
    pub(crate) fn stays_from(&self, wanted: impl Fn(f64) -> bool) -> Option<f64> {
        let last_bad = self.values.iter().rposition(|value| !wanted(*value));
        self.time_s.get(last_bad.map_or(0, |place| place + 1)).copied()
    }

    /// The stretches of neighbouring samples whose values are as wanted; a gap in time ends one.
    pub fn stretches(&self, wanted: impl Fn(f64) -> bool) -> Vec<Span> {
        self.stretches_of(|before, value| wanted(value) && before.is_none_or(&wanted))
            .into_iter()
            .filter(|span| self.at(span.from_s).is_some_and(&wanted))
            .collect()
    }

    /// Stretches of neighbouring samples with the same value.
    pub(crate) fn constant_stretches(&self) -> Vec<Span> {
        self.stretches_of(|before, value| before.is_none_or(|before| before == value))
    }

    /// Cuts the samples wherever `goes_on` of a value and the one before says no, and at gaps longer than [`LONGEST_GAP_S`].
    fn stretches_of(&self, goes_on: impl Fn(Option<f64>, f64) -> bool) -> Vec<Span> {
        let period_s = self.period_s();
        let mut stretches: Vec<Span> = Vec::new();
        let mut before: Option<(f64, f64)> = None;
        for (time, value) in self.iter() {
            let longest_s = LONGEST_GAP_S.max(2.5 * period_s);
            let near = before.is_some_and(|(earlier, _)| time - earlier < longest_s);
            match stretches.last_mut() {
                Some(open) if near && goes_on(before.map(|(_, value)| value), value) => {
                    open.to_s = time + period_s;
                }
                open => {
                    if let Some(open) = open.filter(|_| near) {
                        open.to_s = time;
                    }
                    stretches.push(Span { from_s: time, to_s: time + period_s });
                }
            }
            before = Some((time, value));
        }
        stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Series {
        (0..1000).map(|ms| (f64::from(ms) * 1e-3, f64::from(ms) * 2e-3)).collect()
    }

    #[test]
    fn smoothing_and_slopes_shift_nothing() {
        let (smooth, slope) = (ramp().smoothed(0.02), ramp().slope(0.02));
        assert_eq!((smooth.len(), slope.len()), (1000, 1000));
        for time in [0.1, 0.5, 0.9] {
            // A centred mean and a centred slope of a straight line are the line's own; sums of 1000 values round at 1e-13.
            assert!((smooth.at(time).unwrap() - 2.0 * time).abs() < 1e-11);
            assert!((slope.at(time).unwrap() - 2.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_span_is_half_open() {
        let part = ramp().within(&Span { from_s: 0.1, to_s: 0.2 });
        assert_eq!((part.len(), part.values()[0], part.values()[99]), (100, 0.2, 0.398));
        assert_eq!(part.span().map(|span| (span.length_s() * 1e3).round()), Some(100.0));
        assert!(ramp().within(&Span { from_s: 0.2, to_s: 0.1 }).is_empty());
    }

    #[test]
    fn a_difference_is_taken_where_both_have_a_sample() {
        let series = |samples: &[(f64, f64)]| samples.iter().copied().collect::<Series>();
        let minuend = series(&[(0.002, 1.0), (0.003, 2.0), (0.005, 3.0)]);
        let subtrahend = series(&[(0.0, 9.0), (0.001, 9.0), (0.002, 0.5), (0.003, 0.5), (0.004, 0.5)]);
        assert_eq!(minuend.minus(&subtrahend), series(&[(0.002, 0.5), (0.003, 1.5)]));
    }

    #[test]
    fn settling_is_the_first_time_from_which_all_is_well() {
        let ringing: Series =
            [1.0, 0.0, 0.5, 0.0, 0.0].iter().enumerate().map(|(s, v)| (s as f64, *v)).collect();
        assert_eq!(ringing.stays_from(|value| value < 0.1), Some(3.0));
        assert_eq!(ringing.stays_from(|value| value < 2.0), Some(0.0));
        assert_eq!(ringing.stays_from(|value| value > 0.1), None);
    }

    #[test]
    fn stretches_end_with_the_value_and_with_a_gap() {
        let flags: Series =
            [(0.0, 0.0), (0.1, 1.0), (0.2, 1.0), (0.3, 0.0), (0.4, 1.0), (0.9, 1.0)].into_iter().collect();
        let spans = flags.stretches(|value| value == 1.0);
        let rounded: Vec<_> =
            spans.iter().map(|span| ((span.from_s * 10.0).round(), (span.to_s * 10.0).round())).collect();
        assert_eq!(rounded, [(1.0, 3.0), (4.0, 5.0), (9.0, 10.0)]);
        assert_eq!(flags.constant_stretches().len(), 5);
    }
}
