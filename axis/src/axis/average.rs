//! Moving average over the last 0.2 s: of the position sensor for the partner, of the error at rest for the figures.

const WINDOW_CYCLES: usize = 200;

#[derive(Clone, Debug)]
pub(crate) struct Average {
    samples: [f64; WINDOW_CYCLES],
    taken: usize,
}

impl Default for Average {
    fn default() -> Self {
        Self { samples: [0.0; WINDOW_CYCLES], taken: 0 }
    }
}

impl Average {
    pub(crate) fn take(&mut self, value: f64) {
        self.samples[self.taken % WINDOW_CYCLES] = value;
        self.taken += 1;
    }

    /// The mean; 0 before the first sample. Summed anew each time, so that roundings never pile up.
    pub(crate) fn value(&self) -> f64 {
        let count = self.taken.min(WINDOW_CYCLES);
        self.samples[..count].iter().sum::<f64>() / count.max(1) as f64
    }

    pub(crate) fn is_full(&self) -> bool {
        self.taken >= WINDOW_CYCLES
    }

    pub(crate) fn clear(&mut self) {
        self.taken = 0;
    }

    /// The newest sample; 0 before the first.
    pub(crate) fn last(&self) -> f64 {
        self.taken.checked_sub(1).map_or(0.0, |newest| self.samples[newest % WINDOW_CYCLES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_mean_of_the_last_window() {
        let mut average = Average::default();
        assert_eq!((average.value(), average.last()), (0.0, 0.0));
        average.take(3.0);
        assert_eq!(average.value(), 3.0);
        (0..WINDOW_CYCLES).for_each(|sample| average.take(sample as f64));
        // 0 to 199: their mean, exact in binary.
        assert_eq!((average.value(), average.last()), (99.5, 199.0));
    }
}
