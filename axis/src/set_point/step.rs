//! Step: at once to a place, which is then held. A rest is a step to where the row stands, a constant force one to a value of its
//! own.
//!
//! The set-point counts as moving in the basic cycle in which it jumps, so that the rest behind is one of its own; its rate is 0,
//! since a jump has none.

use super::law::{BOTH, Extent, Kind, Law, ProfilePoint, SegmentReader};
use algorithms::algorithm::Quantity;
use settings::SettingsError;
use std::sync::Arc;

/// How long a jump counts as moving: a basic cycle.
pub(super) const JUMP_S: f64 = 0.000_999;

pub(super) const KIND: Kind = Kind {
    name: "step",
    about: "at once to a place, which is then held",
    serves: BOTH,
    read: |reader| {
        let to = reader.value("to", "where it jumps to")?;
        Step::read(reader, to, 0.001)
    },
};

pub(super) const REST: Kind = Kind {
    name: "rest",
    about: "stays where it is",
    serves: BOTH,
    read: |reader| Step::read(reader, reader.from, 0.0),
};

pub(super) const CONSTANT: Kind = Kind {
    name: "constant",
    about: "a constant force",
    serves: &[Quantity::Force],
    read: |reader| {
        let to = reader.value("force", "the force that is held")?;
        Step::read(reader, to, 0.001)
    },
};

#[derive(Debug)]
struct Step {
    from: f64,
    to: f64,
    duration_s: f64,
}

impl Step {
    fn read(
        reader: &mut SegmentReader<'_, '_>,
        to: f64,
        least_s: f64,
    ) -> Result<Arc<dyn Law>, SettingsError> {
        Ok(Arc::new(Self { from: reader.from, to, duration_s: reader.duration_s(least_s)? }))
    }
}

impl Law for Step {
    fn at(&self, time_s: f64) -> ProfilePoint {
        ProfilePoint { moving: time_s < JUMP_S && self.to != self.from, ..ProfilePoint::at_rest(self.to) }
    }

    fn extent(&self) -> Extent {
        Extent::between(self.from, self.to, self.duration_s)
    }
}
