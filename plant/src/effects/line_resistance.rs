//! line-resistance: the lines between valve and chambers are resistances: the drop grows with the flow squared and with 1/p.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LineResistance {
    /// Drop at the full flow of the supply edge into a chamber at half the supply pressure.
    pub(crate) drop_pa: f64,
}

impl Effect for LineResistance {
    const SHEET: Sheet = Sheet {
        name: "line-resistance",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the lines between valve and chambers are resistances: the drop grows with the flow squared and with 1/p",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "drop_bar",
            unit: Unit::Bar,
            min: 0.0,
            max: 1.0,
            drawn: [0.05, 0.5],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "drop at the full flow of the supply edge into a chamber at half the supply pressure",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        LineResistance { drop_pa: numbers[0] }
    }
}
