//! Curves that expressions read by their name.

use crate::bounds::Range;
use crate::units::Unit;

/// Points of a table at most.
const MOST_POINTS: usize = 10_000;

/// A curve of a file, which expressions read by its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Its name in expressions.
    pub name: String,
    /// Its points, in SI.
    pub curve: Curve,
    /// Unit in which what it is read at is written.
    pub from: Unit,
    /// Unit in which its values are written.
    pub to: Unit,
    /// Its points as they are written: x, y.
    pub written: [Vec<f64>; 2],
}

impl Table {
    /// Of points as they are written, with their units.
    ///
    /// # Errors
    /// The key, `x` or `y`, and what is wrong with it.
    pub fn new(
        name: String,
        (x, from): (Vec<f64>, Unit),
        (y, to): (Vec<f64>, Unit),
    ) -> Result<Self, (&'static str, String)> {
        if !(2..=MOST_POINTS).contains(&x.len()) {
            return Err(("x", format!("x: a table has 2 to {MOST_POINTS} points")));
        }
        let si = |values: &[f64], unit: &Unit| values.iter().map(|value| value * unit.factor).collect();
        let (x_si, y_si): (Vec<f64>, Vec<f64>) = (si(&x, &from), si(&y, &to));
        if x_si.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(("x", "x: each point must be larger than the one before".to_owned()));
        }
        if y.len() != x.len() {
            return Err(("y", format!("y: {} values for {} points of x", y.len(), x.len())));
        }
        Ok(Self { name, curve: Curve { x: x_si, y: y_si }, from, to, written: [x, y] })
    }
}

/// A curve through points, straight between them and level beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Curve {
    /// Through these points, x growing.
    #[cfg(test)]
    pub(crate) fn new(x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { x, y }
    }

    /// Its smallest and largest value where it is read within a range.
    pub(crate) fn bounds(&self, [least, most]: Range) -> Range {
        let inside = self.points().filter(|[x, _]| (least..=most).contains(x)).map(|[_, y]| y);
        let ends = [least, most].map(|end| self.at(end).0);
        inside.fold([ends[0].min(ends[1]), ends[0].max(ends[1])], |[low, high], y| [low.min(y), high.max(y)])
    }

    /// Its points, x growing.
    pub fn points(&self) -> impl ExactSizeIterator<Item = [f64; 2]> + DoubleEndedIterator + '_ {
        self.x.iter().zip(&self.y).map(|(x, y)| [*x, *y])
    }

    /// Value and slope.
    pub(crate) fn at(&self, x: f64) -> (f64, f64) {
        let last = self.x.len() - 1;
        if x.is_nan() {
            return (f64::NAN, 0.0);
        }
        if x <= self.x[0] {
            return (self.y[0], 0.0);
        }
        if x >= self.x[last] {
            return (self.y[last], 0.0);
        }
        let right = self.x.partition_point(|point| *point <= x);
        let left = right - 1;
        let slope = (self.y[right] - self.y[left]) / (self.x[right] - self.x[left]);
        (self.y[left] + slope * (x - self.x[left]), slope)
    }
}
