//! Forces over time and over what the axis does.
//!
//! ```text
//!   ForceProfile (constant)              ForceSource (moving state: a copy of a few numbers)
//!     laws of time ─────────┐
//!     step at a position ───┼──► limit 0 ... force_limit_n ──► ForceSetPoint
//!     loads F(x, v, a) ─────┘
//! ```
//!
//! Signs: compression is positive. The load axis presses against the drive's extension, to -x, so that a force above 0 acts on
//! the carriage in -x. A load that opposes a motion in +x is therefore above its base force, one in -x below it; and since an
//! axis can only press, the sum is limited to 0 and the limit. With a base force of half the span a load acts to both sides.
//!
//! A new load is a file in the folder beside this one and a line in [`KINDS`].

pub(super) mod at_position;
mod damper;
mod dry_friction;
mod mass;
mod spring;

use super::law::{Law, ProfilePoint, SegmentReader};
use super::row::{Row, RowPosition, RowSegment};
use super::{Actual, ForceSetPoint};
use at_position::AtPosition;
use settings::SettingsError;
use settings::parameters::Parameter;
use std::fmt;
use std::sync::Arc;

/// Loads that depend on what the axis does.
pub const KINDS: &[Kind] = &[spring::KIND, damper::KIND, mass::KIND, dry_friction::KIND];

/// A load that an experiment file can name.
pub struct Kind {
    /// Name in an experiment file, the value of `law`.
    pub name: &'static str,
    /// What it does, in a clause for lists.
    pub about: &'static str,
    pub(crate) read: fn(&mut SegmentReader<'_, '_>) -> Result<Arc<dyn Load>, SettingsError>,
}

/// A force that follows the motion of the axis.
pub(crate) trait Load: fmt::Debug + Send + Sync {
    /// Force added to the base force, N, and its rate, N/s.
    fn at(&self, actual: &Actual) -> [f64; 2];
}

#[derive(Clone, Debug)]
pub(super) enum Segment {
    Timed(Arc<dyn Law>),
    AtPosition(AtPosition),
    Load { load: Arc<dyn Load>, base_n: f64, duration_s: f64 },
}

impl RowSegment for Segment {
    fn duration_and_end(&self) -> (f64, f64) {
        match self {
            Self::Timed(law) => law.duration_and_end(),
            Self::AtPosition(step) => (step.duration_s, step.to_n),
            Self::Load { base_n, duration_s, .. } => (*duration_s, *base_n),
        }
    }
}

impl Segment {
    pub(super) fn read_load(kind: &Kind, reader: &mut SegmentReader<'_, '_>) -> Result<Self, SettingsError> {
        let load = (kind.read)(reader)?;
        let base = Parameter::new(
            ("base_force_n", "N"),
            [0.0, reader.scale.force_limit_n],
            reader.from,
            "force without the load; by default where the row stands",
        );
        let base_n = reader.section.number_or_default(&base)?;
        Ok(Self::Load { load, base_n, duration_s: reader.duration_s(0.001)? })
    }
}

/// Force over time: a start and a row of segments. It does not change while it runs; see [`ForceSource`].
#[derive(Clone, Debug)]
pub(crate) struct ForceProfile {
    pub(super) row: Row<Segment>,
    pub(super) limit_n: f64,
}

impl ForceProfile {
    /// From the start to the end of the row, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.row.duration_s()
    }

    pub(crate) fn initial_force_n(&self) -> f64 {
        self.row.start
    }

    fn limited(&self, unlimited: ProfilePoint) -> ForceSetPoint {
        let mut point = ForceSetPoint::from(unlimited);
        if !point.rate_n_per_s.is_finite() {
            point.rate_n_per_s = 0.0;
        }
        if (0.0..=self.limit_n).contains(&point.force_n) {
            return point;
        }
        // Not clamp, which hands a NaN on.
        let force_n = point.force_n.max(0.0).min(self.limit_n);
        ForceSetPoint { force_n, rate_n_per_s: 0.0, ..point }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Memory {
    /// Segment that is being driven, and what has happened in it.
    segment: Option<usize>,
    crossing: at_position::Crossing,
    last_n: Option<f64>,
}

/// A profile being driven; asked once a cycle, with time that does not go back.
#[derive(Clone, Debug)]
pub(crate) struct ForceSource {
    pub(crate) profile: Arc<ForceProfile>,
    memory: Memory,
}

impl ForceSource {
    pub(crate) fn new(profile: ForceProfile) -> Self {
        Self { profile: Arc::new(profile), memory: Memory::default() }
    }

    /// Begins the profile anew.
    pub(crate) fn reset(&mut self) {
        self.memory = Memory::default();
    }

    /// The set-point `time_s` after the start: the initial force before it, [`Self::end`] from the end on.
    pub(crate) fn at(&mut self, time_s: f64, actual: &Actual) -> ForceSetPoint {
        let unlimited = match self.profile.row.locate(time_s) {
            RowPosition::Before => ProfilePoint::at_rest(self.profile.initial_force_n()),
            RowPosition::After => return self.end(),
            RowPosition::In { index, segment, since_s } => {
                if self.memory.segment != Some(index) {
                    self.memory.segment = Some(index);
                    self.memory.crossing = at_position::Crossing::default();
                }
                match segment {
                    Segment::Timed(law) => law.at(since_s),
                    Segment::AtPosition(step) => step.at(since_s, &mut self.memory.crossing, actual),
                    Segment::Load { load, base_n, .. } => {
                        let [force, rate] = load.at(actual);
                        ProfilePoint { value: base_n + force, rate, acceleration: 0.0, moving: true }
                    }
                }
            }
        };
        let point = self.profile.limited(unlimited);
        let last = self.memory.segment.and_then(|index| self.profile.row.segments.get(index));
        self.memory.last_n = matches!(last, Some(Segment::Load { .. })).then_some(point.force_n);
        point
    }

    /// The set-point that is held from the end on. After a load that depends on the axis it is the force that it had last, so
    /// that nothing jumps.
    pub(crate) fn end(&self) -> ForceSetPoint {
        ForceSetPoint::at_rest(self.memory.last_n.unwrap_or(self.profile.row.end))
    }
}

#[cfg(test)]
mod tests;
