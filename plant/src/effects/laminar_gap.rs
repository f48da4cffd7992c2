//! A gap through which air leaks in layers: what leakage past the piston, past a rod's or cap's seal and a
//! leaking chamber have in common.
//!
//! ```text
//! q = k (p1^2 - p2^2)        k = q_ref / ((6 bar)^2 - (1 bar)^2)
//! ```
//!
//! q normal flow from p1 to p2, m^3/s; pressures absolute, Pa, positive; q_ref flow from 6 to 1 bar absolute, m^3/s.
//!
//! Source: laminar gap flow of a gas, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7.

use super::sheet::EffectKey;
use crate::parameters::table::Unit;

/// k, m^3/s per Pa^2.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LaminarGap(f64);

impl LaminarGap {
    /// q_ref in a rig file.
    pub(super) const KEY: EffectKey = EffectKey {
        name: "leakage_nl_per_min",
        unit: Unit::NormalLitrePerMinute,
        max: 50.0,
        drawn: [0.2, 10.0],
        meaning: "q_ref, flow from 6 bar to 1 bar absolute",
        ..EffectKey::USUAL
    };

    /// The gap that passes this normal flow, m^3/s, from 6 to 1 bar absolute.
    pub(crate) fn of(leakage_m3_per_s: f64) -> Self {
        const REFERENCE_PA2: f64 = 6e5 * 6e5 - 1e5 * 1e5;
        LaminarGap(leakage_m3_per_s / REFERENCE_PA2)
    }

    /// q, normal flow from one pressure to the other, m^3/s.
    pub(crate) fn flow(self, from_pa: f64, to_pa: f64) -> f64 {
        self.0 * ((from_pa - to_pa) * (from_pa + to_pa))
    }
}
