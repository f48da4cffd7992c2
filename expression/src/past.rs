//! Earlier values of leaves: the steps of a record so far, each a polynomial, in a ring.
//!
//! ```text
//!   v(s) = a + s (b + (1 - s) (c + s (d + (1 - s) e)))        s: share of the step, 0 to 1
//! ```
//! Level at the start before the first step. The step that is being tried may be read before it is accepted. Derivatives by what
//! is fitted are kept as the values are.
//!
//! Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd edition, II.6 (dense output), II.17 (delays).

use crate::tape::Register;

/// Coefficients of a step's polynomial.
pub const TERMS: usize = 5;

/// History without leaves.
pub static NONE: History = History::none();

/// Earlier values of some leaves, and their derivatives.
#[derive(Clone, Debug, Default)]
pub struct History {
    leaves: Vec<Register>,
    /// A value and its derivatives.
    width: usize,
    start: Vec<f64>,
    /// Ring: from and to, s, and of each leaf [`TERMS`] rows.
    times_s: Vec<[f64; 2]>,
    terms: Vec<f64>,
    first: usize,
    count: usize,
    /// The step behind the last one is being tried.
    is_open: bool,
    /// Added to a time to decide which of two steps it belongs to at their boundary, s.
    boundary_offset_s: f64,
}

impl History {
    const fn none() -> Self {
        Self {
            leaves: Vec::new(),
            width: 1,
            start: Vec::new(),
            times_s: Vec::new(),
            terms: Vec::new(),
            first: 0,
            count: 0,
            is_open: false,
            boundary_offset_s: 0.0,
        }
    }

    /// Keeps these leaves, with so many derivatives.
    #[must_use]
    pub fn of(leaves: Vec<Register>, directions: usize) -> Self {
        let width = 1 + directions;
        Self { start: vec![0.0; leaves.len() * width], leaves, width, ..Self::none() }
    }

    /// Whether it has no leaves.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    /// Steps that fit into the ring.
    #[must_use]
    pub(crate) fn room(&self) -> usize {
        self.times_s.len()
    }

    /// Forgets all steps; the ring has room for so many, or for as many as it had.
    pub fn begin(&mut self, room: usize) {
        (self.first, self.count, self.is_open) = (0, 0, false);
        if room > self.room() {
            self.times_s.resize(room, [0.0; 2]);
            self.terms.resize(room * self.step(), 0.0);
        }
    }

    /// What was before the first step, of a leaf by its place.
    pub fn start_mut(&mut self, place: usize) -> &mut [f64] {
        &mut self.start[place * self.width..(place + 1) * self.width]
    }

    fn step(&self) -> usize {
        self.leaves.len() * TERMS * self.width
    }

    fn slot(&self, index: usize) -> usize {
        (self.first + index) % self.times_s.len()
    }

    fn rows_mut(&mut self, index: usize, place: usize) -> &mut [f64] {
        let of_leaf = TERMS * self.width;
        let start = self.slot(index) * self.step() + place * of_leaf;
        &mut self.terms[start..start + of_leaf]
    }

    /// Opens a step that is tried, or that is being tried already. Steps that end before `needed_s` may be forgotten; where none
    /// may, the ring is doubled.
    pub fn open(&mut self, times_s: [f64; 2], needed_s: f64) {
        while self.count > 0 && self.times_s[self.first][1] < needed_s {
            self.first = self.slot(1);
            self.count -= 1;
        }
        if self.count == self.room() {
            let (room, step) = (self.room(), self.step());
            self.times_s.rotate_left(self.first);
            self.terms.rotate_left(self.first * step);
            self.first = 0;
            self.times_s.resize(2 * room + 1, [0.0; 2]);
            self.terms.resize((2 * room + 1) * step, 0.0);
        }
        let slot = self.slot(self.count);
        self.times_s[slot] = times_s;
        self.is_open = true;
    }

    /// The rows of a leaf, by its place, in the step that is open.
    pub fn open_rows_mut(&mut self, place: usize) -> &mut [f64] {
        self.rows_mut(self.count, place)
    }

    /// At the boundary of two steps the rate is that of the later step (a small offset above 0) or of the earlier one (below 0).
    pub fn set_boundary_offset(&mut self, boundary_offset_s: f64) {
        self.boundary_offset_s = boundary_offset_s;
    }

    /// The open step is no longer tried.
    pub fn close(&mut self) {
        self.is_open = false;
    }

    /// The open step is the last one.
    pub fn accept(&mut self) {
        if self.is_open {
            self.count += 1;
            self.is_open = false;
        }
    }

    /// The rows of a leaf, by its place, in the last step.
    pub fn last_rows_mut(&mut self, place: usize) -> Option<&mut [f64]> {
        self.count.checked_sub(1).map(|last| self.rows_mut(last, place))
    }

    /// Its place among what is kept.
    fn place(&self, leaf: Register) -> usize {
        self.leaves.iter().position(|kept| *kept == leaf).unwrap_or(0)
    }

    /// The step in which a time lies, by its slot, the share of it and its length; `None` before the first one.
    fn at(&self, time_s: f64) -> Option<(usize, f64, f64)> {
        let known = self.count + usize::from(self.is_open);
        let mut range = 0..known;
        // The first step that ends at the time or later; the last one where there is none.
        while range.start < range.end {
            let middle = range.start.midpoint(range.end);
            if self.times_s[self.slot(middle)][1] < time_s + self.boundary_offset_s {
                range.start = middle + 1;
            } else {
                range.end = middle;
            }
        }
        let slot = self.slot(range.start.min(known.checked_sub(1)?));
        let [from_s, to_s] = self.times_s[slot];
        let length_s = to_s - from_s;
        let share = (time_s - from_s) / length_s;
        let is_before = range.start == 0 && time_s + self.boundary_offset_s <= from_s;
        (!is_before).then_some((slot, share.clamp(0.0, 1.0), length_s))
    }

    /// Value and rate of a leaf at a time.
    #[must_use]
    pub(crate) fn value(&self, leaf: Register, time_s: f64) -> [f64; 2] {
        let place = self.place(leaf);
        if time_s.is_nan() || self.leaves.is_empty() {
            return [f64::NAN, 0.0];
        }
        let Some((slot, share, length_s)) = self.at(time_s) else {
            return [self.start[place * self.width], 0.0];
        };
        let start = slot * self.step() + place * TERMS * self.width;
        let of = |weights: [f64; TERMS]| {
            let terms = weights.iter().enumerate();
            terms.map(|(term, weight)| weight * self.terms[start + term * self.width]).sum::<f64>()
        };
        [of(values(share)), of(rates(share)) / length_s]
    }

    pub(crate) fn add_slopes(&self, leaf: Register, time_s: f64, sums: &mut [f64]) {
        let place = self.place(leaf);
        let Some((slot, share, _)) = self.at(time_s) else {
            let start = &self.start[place * self.width..(place + 1) * self.width];
            sums.iter_mut().zip(&start[1..]).for_each(|(sum, slope)| *sum += slope);
            return;
        };
        let start = slot * self.step() + place * TERMS * self.width;
        for (term, weight) in values(share).into_iter().enumerate() {
            let row = &self.terms[start + term * self.width..][1..self.width];
            sums.iter_mut().zip(row).for_each(|(sum, slope)| *sum += weight * slope);
        }
    }
}

fn values(share: f64) -> [f64; TERMS] {
    let left = 1.0 - share;
    [1.0, share, share * left, share * share * left, share * share * left * left]
}

fn rates(share: f64) -> [f64; TERMS] {
    let bent = 1.0 - 2.0 * share;
    [0.0, 1.0, bent, share * (2.0 - 3.0 * share), 2.0 * share * (1.0 - share) * bent]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of 1 s along t^2, of which the derivative by a number is 3 t.
    fn square(history: &mut History, steps: u32, needed_s: impl Fn(f64) -> f64) {
        for step in 0..steps {
            let from_s = f64::from(step);
            history.open([from_s, from_s + 1.0], needed_s(from_s));
            let rows = history.open_rows_mut(0);
            rows.fill(0.0);
            // t^2 over the step: the chord, and twice the rate at its head less the chord.
            let chord = 2.0 * from_s + 1.0;
            rows[..6].copy_from_slice(&[
                from_s * from_s,
                3.0 * from_s,
                chord,
                3.0,
                2.0 * from_s - chord,
                0.0,
            ]);
            history.accept();
        }
    }

    #[test]
    fn values_rates_and_slopes_are_those_of_the_steps() {
        let mut history = History::of(vec![7], 1);
        history.begin(2);
        history.start_mut(0).copy_from_slice(&[-1.0, 5.0]);
        // The ring is doubled where all steps are needed.
        square(&mut history, 6, |_| 0.0);
        assert!(history.room() >= 6);
        for time_s in [0.25, 1.0, 2.5, 5.75] {
            let [value, rate] = history.value(7, time_s);
            assert!((value - time_s * time_s).abs() < 1e-12, "{time_s}: {value}");
            assert!((rate - 2.0 * time_s).abs() < 1e-12, "{time_s}: {rate}");
            let mut slope = [1.0];
            history.add_slopes(7, time_s, &mut slope);
            assert!((slope[0] - 1.0 - 3.0 * time_s).abs() < 1e-12, "{time_s}: {slope:?}");
        }
        assert_eq!(history.value(7, -3.0), [-1.0, 0.0]);
        let mut slope = [0.0];
        history.add_slopes(7, -3.0, &mut slope);
        assert_eq!(slope, [5.0]);
        assert!(history.value(7, f64::NAN)[0].is_nan());
        // At the start it is level before and rises behind.
        let mut line = History::of(vec![7], 0);
        line.begin(1);
        line.open([2.0, 4.0], 0.0);
        line.open_rows_mut(0).copy_from_slice(&[0.0, 6.0, 0.0, 0.0, 0.0]);
        line.accept();
        for (boundary_offset_s, rate) in [(1e-9, 3.0), (-1e-9, 0.0)] {
            line.set_boundary_offset(boundary_offset_s);
            assert_eq!(line.value(7, 2.0), [0.0, rate]);
        }
    }

    #[test]
    fn a_ring_forgets_what_is_no_longer_needed_and_what_is_not_accepted() {
        let mut history = History::of(vec![7], 1);
        history.begin(4);
        square(&mut history, 100, |from_s| from_s - 1.5);
        assert_eq!(history.room(), 4);
        assert!((history.value(7, 98.5)[0] - 98.5 * 98.5).abs() < 1e-9);
        history.open([100.0, 101.0], 98.0);
        history.open_rows_mut(0).copy_from_slice(&[1e4, 0.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(history.value(7, 100.5)[0], 10_005.0);
        history.close();
        // The end of the last step.
        assert_eq!(history.value(7, 100.5)[0], 1e4);
    }
}
