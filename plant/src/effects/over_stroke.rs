//! Shapes over the stroke that friction and force have in common: a straight line through its middle, and a ripple.

use super::sheet::EffectKey;
use crate::parameters::table::Unit;

/// A straight line over a stroke of twice this length, m: -1 at its beginning, 0 in its middle, 1 at its end.
pub(super) fn line(half_stroke_m: f64, at_m: f64) -> f64 {
    (at_m - half_stroke_m) / half_stroke_m
}

/// A sine over the position, 0 at 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ripple {
    pub(super) amplitude_n: f64,
    /// P, its period.
    pub(super) pitch_m: f64,
}

impl Ripple {
    /// P in a rig file.
    pub(super) const PITCH: EffectKey = EffectKey {
        name: "pitch_mm",
        unit: Unit::Millimetre,
        min: 2.0,
        max: 500.0,
        drawn: [20.0, 100.0],
        signed: false,
        default: Some(50.0),
        neutral: None,
        meaning: "P, period of the ripple",
    };

    /// Force at a position, N.
    pub(super) fn at(&self, at_m: f64) -> f64 {
        self.amplitude_n * libm::sin(std::f64::consts::TAU * at_m / self.pitch_m)
    }
}
