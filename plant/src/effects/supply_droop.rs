//! supply-droop: the supply node is a volume fed through a regulator that gives way under flow.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SupplyDroop {
    /// Fall of the node when one full supply edge draws steadily.
    pub(crate) droop_pa: f64,
    /// Volume of the node.
    pub(crate) volume_m3: f64,
}

impl Effect for SupplyDroop {
    const SHEET: Sheet = Sheet {
        name: "supply-droop",
        group: Group::Flow,
        place: PlaceKind::Supply,
        law: "the supply node is a volume fed through a regulator that gives way under flow",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "droop_bar",
            unit: Unit::Bar,
            min: 0.0,
            max: 2.0,
            drawn: [0.1, 1.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "fall of the node when one full supply edge draws steadily",
        },
        EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 50.0,
            max: 10000.0,
            drawn: [200.0, 2000.0],
            signed: false,
            default: Some(500.0),
            neutral: None,
            meaning: "volume of the node",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        SupplyDroop { droop_pa: numbers[0], volume_m3: numbers[1] }
    }
}
