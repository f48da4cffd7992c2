//! Rest: the row stays where it stands; and the constant force, which is a rest at a value of its own.

use super::law::{BOTH, Kind, Law, Moment};
use super::step::Step;
use algorithms::algorithm::Quantity;
use std::sync::Arc;

/// In the list of laws.
pub const KIND: Kind = Kind {
    name: "rest",
    about: "stays where it is",
    serves: BOTH,
    read: |given| Ok(law(given.from, given.duration_s(0.0)?)),
};

/// In the list of laws.
pub const CONSTANT: Kind = Kind {
    name: "constant",
    about: "a constant force",
    serves: &[Quantity::Force],
    read: |given| {
        let to = given.place("force", "the force that is held")?;
        Ok(Arc::new(Step { from: given.from, to, duration_s: given.duration_s(0.001)? }))
    },
};

/// A rest at `value`.
pub(super) fn law(value: f64, duration_s: f64) -> Arc<dyn Law> {
    Arc::new(Rest { value, duration_s })
}

#[derive(Debug)]
struct Rest {
    value: f64,
    duration_s: f64,
}

impl Law for Rest {
    fn at(&self, _time_s: f64) -> Moment {
        Moment::at_rest(self.value)
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn end(&self) -> f64 {
        self.value
    }

    fn reach(&self) -> [f64; 2] {
        [self.value; 2]
    }
}
