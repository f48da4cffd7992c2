//! Force step when the axis passes a position, at the latest when its segment is over.
//!
//! ```text
//!   direction    positive: x was below and is not any more;  negative: x was above and is not any more;  any: either
//! ```
//!
//! An axis that begins beyond the position has not passed it. Once stepped it stays, however often the axis comes back.

use crate::set_point::Actual;
use crate::set_point::law::{ProfilePoint, SegmentReader};
use crate::set_point::step::JUMP_S;
use settings::SettingsError;
use settings::parameters::Parameter;

/// The key that tells this step from one in time.
pub(in crate::set_point) const KEY: &str = "at_position_m";

#[derive(Clone, Copy, Debug, PartialEq)]
enum Direction {
    Positive,
    Negative,
    Any,
}

const DIRECTIONS: [(&str, Direction); 3] =
    [("any", Direction::Any), ("positive", Direction::Positive), ("negative", Direction::Negative)];

#[derive(Clone, Copy, Debug)]
pub(in crate::set_point) struct AtPosition {
    from_n: f64,
    pub(super) to_n: f64,
    pub(super) duration_s: f64,
    at_position_m: f64,
    direction: Direction,
}

/// Position of the axis and its crossing of the threshold since the segment began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Crossing {
    last_m: Option<f64>,
    /// When the axis passed, s after the segment's beginning.
    passed_s: Option<f64>,
}

impl AtPosition {
    pub(in crate::set_point) fn read(reader: &mut SegmentReader<'_, '_>) -> Result<Self, SettingsError> {
        let to_n = reader.value("to", "force after the step")?;
        let position = Parameter::new(
            (KEY, "m"),
            [0.0, reader.scale.stroke_m],
            0.0,
            "position at which the force steps",
        );
        let at_position_m = reader.number(&position)?;
        let direction = reader.section.choice("direction", &DIRECTIONS)?;
        let duration_s = reader.duration_s(0.001)?;
        Ok(Self { from_n: reader.from, to_n, duration_s, at_position_m, direction })
    }

    pub(super) fn at(&self, since_s: f64, crossing: &mut Crossing, actual: &Actual) -> ProfilePoint {
        let now_m = actual.position_m;
        let last_m = crossing.last_m.replace(now_m).unwrap_or(now_m);
        if crossing.passed_s.is_none() && self.passes(last_m, now_m) {
            crossing.passed_s = Some(since_s);
        }
        match crossing.passed_s {
            None => ProfilePoint::at_rest(self.from_n),
            Some(passed_s) => {
                let moving = since_s - passed_s < JUMP_S && self.to_n != self.from_n;
                ProfilePoint { moving, ..ProfilePoint::at_rest(self.to_n) }
            }
        }
    }

    fn passes(&self, last_m: f64, now_m: f64) -> bool {
        let upwards = last_m < self.at_position_m && now_m >= self.at_position_m;
        let downwards = last_m > self.at_position_m && now_m <= self.at_position_m;
        match self.direction {
            Direction::Positive => upwards,
            Direction::Negative => downwards,
            Direction::Any => upwards || downwards,
        }
    }
}
