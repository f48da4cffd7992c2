//! line-delay: what passes the valve reaches the chambers one acoustic travel time later.
//!
//! ```text
//! Q_chamber(t) = Q(t - l / a)        term = Q(t - l / a) - Q(t)        1 / a = 2.9 ms/m
//! ```
//!
//! Q normal flow at the valve's port, m^3/s, positive into the chamber; l length of each line, m, in [0, 5]; a speed of
//! sound, 345 m/s, that of air at 293 to 296 K (343 m/s at 293.15 K would make 2.91). The line only delays: its volume stands
//! in the chamber's dead volume, its resistance is line-resistance, waves that come back from the piston are damped within a
//! few travel times and left out. Valid while l / a is short against the strokes, for tubes of 4 mm and more up to some
//! metres; a longer or narrower one smears the edge too. No regularisation: the memory holds the flows of the last 15 ms.
//!
//! Properties: a constant flow is not changed; what enters the line leaves it; l = 0 adds nothing.
//!
//! Source: Richer and Hurmuzlu 2000, part I, DOI 10.1115/1.1286336, connecting tubes (delay l / a and attenuation); range:
//! textbook prior, tubes of 0.5 to 4 m.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct LineDelay {
        length_m: EffectKey {
            name: "length_m",
            unit: Unit::Metre,
            max: 5.0,
            drawn: [0.5, 4.0],
            meaning: "l, length of each line between valve and chamber; 2.9 ms per metre",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for LineDelay {
    const SHEET: Sheet = Sheet {
        name: "line-delay",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "what passes the valve reaches the chambers one acoustic travel time later",
        source: "Richer and Hurmuzlu 2000, DOI 10.1115/1.1286336; range: textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::PortPressure, ManualMeasurement::SpoolSignal],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

/// 1 / a, travel time of sound.
const DELAY_S_PER_M: f64 = 2.9e-3;

impl LineDelay {
    /// Travel time of one line.
    pub(crate) fn delay_s(&self) -> f64 {
        self.length_m * DELAY_S_PER_M
    }

    /// What is added to the flow `now`, from the one `delay_s` before, both in the same unit.
    pub(crate) fn term(&self, delayed: f64, now: f64) -> f64 {
        delayed - now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_travel_time_is_that_of_sound_in_air() {
        let sound_m_per_s = (1.4_f64 * 287.0 * 293.15).sqrt();
        // 2.9 against 2.914 ms.
        assert!((DELAY_S_PER_M * sound_m_per_s - 1.0).abs() < 0.006);
        assert_eq!(LineDelay { length_m: 2.0 }.delay_s(), 5.8e-3);
        assert_eq!(LineDelay { length_m: 0.0 }.delay_s(), 0.0);
    }

    #[test]
    fn a_constant_flow_is_not_changed_and_a_pulse_leaves_the_line_whole() {
        let effect = LineDelay { length_m: 1.0 };
        assert_eq!(effect.term(3e-3, 3e-3), 0.0);
        // One millisecond apart, three behind: the terms take away what comes in and give it back later. Small whole numbers
        // add up without rounding.
        let flows = [0.0, 0.0, 0.0, 2.0, 5.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let terms: Vec<f64> = (3..flows.len()).map(|i| effect.term(flows[i - 3], flows[i])).collect();
        assert_eq!(terms.iter().sum::<f64>(), 0.0);
        assert_eq!(terms[..4], [-2.0, -5.0, -1.0, 2.0]);
    }
}
