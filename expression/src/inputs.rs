//! Inputs over time: samples, and what holds between them.

/// What an input does between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// It keeps the sample's value until the next one.
    Zero,
    /// It is straight between samples.
    Linear,
}

/// Samples of all inputs at the times of a record.
#[derive(Clone, Debug)]
pub struct Inputs<'a> {
    /// Times of the samples, s, growing.
    pub time_s: &'a [f64],
    /// Of each input its samples, in SI.
    pub samples_si: &'a [Vec<f64>],
}

impl Inputs<'static> {
    /// No inputs.
    #[must_use]
    pub(crate) const fn none() -> Self {
        Self { time_s: &[], samples_si: &[] }
    }
}

impl Inputs<'_> {
    /// Value and rate of an input in straight lines between its samples; level before the first and after the last.
    pub(crate) fn between(&self, input: usize, time_s: f64) -> (f64, f64) {
        let Some(samples) = self.samples_si.get(input).filter(|samples| !samples.is_empty()) else {
            return (f64::NAN, 0.0);
        };
        let right = self.time_s.partition_point(|sample_s| *sample_s <= time_s);
        if right == 0 || !time_s.is_finite() {
            return (if time_s.is_nan() { f64::NAN } else { samples[0] }, 0.0);
        }
        let left = right - 1;
        if right >= samples.len() {
            return (samples[samples.len() - 1], 0.0);
        }
        let rate = (samples[right] - samples[left]) / (self.time_s[right] - self.time_s[left]);
        (samples[left] + rate * (time_s - self.time_s[left]), rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_straight_between_samples_and_level_beyond() {
        let (time_s, samples) = ([1.0, 2.0, 4.0], [vec![10.0, 20.0, 0.0]]);
        let inputs = Inputs { time_s: &time_s, samples_si: &samples };
        for (at_s, expected) in
            [(0.0, (10.0, 0.0)), (1.5, (15.0, 10.0)), (3.0, (10.0, -10.0)), (9.0, (0.0, 0.0))]
        {
            assert_eq!(inputs.between(0, at_s), expected, "at {at_s} s");
        }
        assert!(inputs.between(0, f64::NAN).0.is_nan());
    }
}
