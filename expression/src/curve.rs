//! Curves that expressions read by their name.

/// A curve through points, straight between them and level beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Curve {
    /// Through these points, x growing.
    #[must_use]
    pub fn new(x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { x, y }
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
