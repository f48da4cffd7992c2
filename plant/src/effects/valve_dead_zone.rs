//! valve-dead-zone: the spool overlaps its edges: nothing opens below d, and the rest of the way is stretched.
//!
//! ```text
//! s_eff = sign(s) (|s| - d) / (1 - d)     |s| > d
//! s_eff = 0                               |s| <= d            term = s_eff - s
//! ```
//!
//! s spool, in [-1, 1], positive extends; d overlap, share of full opening, in [0, 0.2], on top of the dead band that the K_V
//! tables have themselves. Valid for a lap equal on both sides; an unequal one is a dead zone and an offset. Outside [-1, 1]
//! the line goes on. No regularisation: continuous, with a corner at d as a lapped spool has.
//!
//! Properties: odd; continuous; full opening stays; inside the lap spool and term sum to 0 to the bit; never opens wider than
//! the spool; d = 0 adds nothing.
//!
//! Source: lapped spool, Merritt, Hydraulic Control Systems, 1967, chapter 5; Beater, Pneumatic Drives, 2007, DOI
//! 10.1007/978-3-540-69471-7; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ValveDeadZone {
        dead_zone: EffectKey {
            name: "dead_zone_percent",
            unit: Unit::Percent,
            max: 20.0,
            drawn: [0.5, 5.0],
            meaning: "d, of full opening, beside the tables' own dead band",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ValveDeadZone {
    const SHEET: Sheet = Sheet {
        name: "valve-dead-zone",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "the spool overlaps its edges: nothing opens below d, and the rest of the way is stretched",
        source: "lapped spool, Merritt 1967 ch. 5; range: textbook prior (Beater 2007)",
        nonlinear_in_amplitude: true,
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl ValveDeadZone {
    /// What is added to a spool in [-1, 1] for the opening that the edges see.
    pub(crate) fn term(&self, spool: f64) -> f64 {
        if self.dead_zone == 0.0 {
            return 0.0;
        }
        let beyond = (spool.abs() - self.dead_zone).max(0.0) / (1.0 - self.dead_zone);
        beyond.copysign(spool) - spool
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn opening(dead_zone: f64, spool: f64) -> f64 {
        spool + ValveDeadZone { dead_zone }.term(spool)
    }

    #[test]
    fn nothing_opens_inside_the_lap_and_all_at_full_command() {
        for spool in [0.0, 0.01, -0.049, 0.05] {
            assert_eq!(opening(0.05, spool), 0.0, "{spool}");
        }
        assert_eq!((opening(0.05, 1.0), opening(0.05, -1.0)), (1.0, -1.0));
        // (0.525 - 0.05) / 0.95 = 0.5, four roundings of numbers below 1.
        assert!((opening(0.05, 0.525) - 0.5).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn no_lap_adds_nothing(spool in -1.0..=1.0_f64) {
            prop_assert_eq!(ValveDeadZone { dead_zone: 0.0 }.term(spool), 0.0);
        }

        #[test]
        fn it_is_odd_and_never_opens_wider_than_the_spool(lap in 0.0..=0.2_f64, spool in -1.0..=1.0_f64) {
            prop_assert_eq!(opening(lap, -spool), -opening(lap, spool));
            // One rounding of the sum of spool and term.
            prop_assert!(opening(lap, spool).abs() <= spool.abs() + 1e-16);
        }

        #[test]
        fn it_is_continuous(lap in 0.0..=0.2_f64, spool in -1.0..=0.999_f64) {
            // The steepest slope is 1 / (1 - 0.2) = 1.25.
            prop_assert!((opening(lap, spool + 1e-6) - opening(lap, spool)).abs() <= 1.2501e-6);
        }
    }
}
