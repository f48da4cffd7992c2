//! valve-offset: the spool's null lies beside the command's.
//!
//! ```text
//! target = u + u_0
//! ```
//!
//! u command, in [-1, 1]; u_0 null offset, share of full command, in [-0.1, 0.1], positive extends. Valid for a wrong
//! electrical or mechanical null; it neither drifts nor depends on pressure or temperature. The target is kept within [-1,
//! 1], since the spool has stops: at full command the offset is not seen. No regularisation: a constant.
//!
//! Properties: the same for every state and time; u_0 = 0 adds nothing.
//!
//! Source: null bias, Merritt, Hydraulic Control Systems, 1967, chapter 7; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ValveOffset {
        offset: EffectKey {
            name: "offset_percent",
            unit: Unit::Percent,
            min: -10.0,
            max: 10.0,
            drawn: [0.5, 3.0],
            signed: true,
            meaning: "u_0, of full command",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ValveOffset {
    const SHEET: Sheet = Sheet {
        name: "valve-offset",
        group: Group::Flow,
        laws: &[Law::Spool],
        law: "the spool's null lies beside the command's",
        source: "null bias, Merritt 1967 ch. 7; range: textbook prior",
        distinguished_by: &[ManualMeasurement::LockedHold],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_constant_in_shares_of_full_command_and_nothing_at_zero() {
        let rig = RigParameters::baseline();
        let percent = ValveOffset::SHEET.keys[0].unit;
        assert_eq!(ValveOffset::new(&[percent.to_si(-2.5)], &rig).offset, -0.025);
        assert_eq!(ValveOffset::new(&[percent.to_si(0.0)], &rig).offset, 0.0);
    }
}
