//! rest-time-dependent-break-away: the break-away force grows with the logarithm of the time at rest.
//!
//! ```text
//! term = F_stat g ln(1 + t / t_0) / ln(1 + 10 s / t_0)
//! ```
//!
//! t time since the rod came to rest, s, >= 0; g growth after 10 s at rest, share, 0 to 1; t_0 onset, s, > 0; F_stat
//! break-away force of the rig file, N. The term is a level, N, >= 0, of the break-away force alone: sliding friction does
//! not know it.
//!
//! Valid from fractions of a second to hours; a logarithm has no end, but between 10 s and an hour it only doubles or so. No
//! regularisation but t_0 itself, which makes the law linear, and 0, just after the stop.
//!
//! Properties: nothing at the stop; g F_stat after 10 s whatever t_0; never falls while at rest; each decade beyond t_0 adds
//! the same.
//!
//! Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, on rising static friction; logarithmic growth:
//! Dieterich, "Time-dependent friction in rocks", J. Geophysical Research 77(20), 1972; range: effects.md, textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        growth: EffectKey {
            name: "growth_percent",
            unit: Unit::Percent,
            max: 100.0,
            drawn: [10.0, 50.0],
            meaning: "g, growth of the break-away force after 10 s at rest",
            ..EffectKey::USUAL
        },
        onset_s: EffectKey {
            name: "onset_s",
            unit: Unit::Second,
            min: 0.001,
            max: 5.0,
            drawn: [0.05, 0.5],
            signed: false,
            default: Some(0.1),
            neutral: None,
            meaning: "t_0 of ln(1 + t / t_0), after which the growth is logarithmic",
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RestTimeDependentBreakAway {
    numbers: Numbers,
    /// F_stat g / ln(1 + 10 s / t_0).
    pub(crate) per_fold_n: f64,
}

impl Effect for RestTimeDependentBreakAway {
    const SHEET: Sheet = Sheet {
        name: "rest-time-dependent-break-away",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "the break-away force grows with the logarithm of the time at rest",
        source: "Armstrong-Helouvry et al. 1994, Automatica 30(7); Dieterich 1972; range: effects.md, textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::Pulling],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        let numbers @ Numbers { growth, onset_s } = Numbers::of(numbers);
        let folds = libm::log1p(REFERENCE_S / onset_s);
        let per_fold_n = rig.friction().break_away_force_n * growth / folds;
        RestTimeDependentBreakAway { numbers, per_fold_n }
    }
}

/// Time at rest that the growth is given for, s.
const REFERENCE_S: f64 = 10.0;

impl RestTimeDependentBreakAway {
    /// What the break-away force has above its baseline after this time at rest, s, not negative; N.
    pub(crate) fn term(&self, rest_s: f64) -> f64 {
        self.per_fold_n * libm::log1p(rest_s / self.numbers.onset_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(growth: f64, onset_s: f64) -> RestTimeDependentBreakAway {
        RestTimeDependentBreakAway::new(&[growth, onset_s], &RigParameters::baseline())
    }

    #[test]
    fn it_is_nothing_at_the_stop_and_the_growth_after_ten_seconds() {
        for onset_s in [0.001, 0.1, 5.0] {
            assert_eq!(of(0.4, onset_s).term(0.0), 0.0);
            // Roundings of 14 N.
            assert!((of(0.4, onset_s).term(10.0) - 0.4 * 35.0).abs() < 1e-14);
        }
        assert_eq!(of(0.0, 0.1).term(100.0), 0.0);
    }

    #[test]
    fn each_decade_adds_the_same_beyond_the_onset() {
        let decade = |from_s: f64| of(0.4, 0.01).term(10.0 * from_s) - of(0.4, 0.01).term(from_s);
        // ln(1 + t / t_0) is ln(t / t_0) but for t_0 / t = 1e-3 of 2 N per fold.
        assert!((decade(100.0) - decade(10.0)).abs() < 0.002 * 2.1);
    }

    proptest! {
        #[test]
        fn it_never_falls_at_rest(growth in 0.0..1.0_f64, onset in 0.001..5.0_f64, rest in 0.0..1e4_f64, more in 0.0..10.0_f64) {
            // One rounding of 100 N.
            prop_assert!(of(growth, onset).term(rest + more) >= of(growth, onset).term(rest) - 2e-14);
        }
    }
}
