//! example: the effect that the tests add, by this file and one line of the catalogue; it acts on every open balance.
//!
//! ```text
//! term = a u        u one unit of the balance, as listed in `unit`
//! ```
//!
//! a amount, in [-1, 1]; acts always, whatever the state. It models nothing and ships with nothing.
//!
//! Properties: a constant in every open balance; 0 changes nothing; its name stands in no other file.
//!
//! Source: none, it is made for the tests.

use super::OpenBalance;
use super::sheet::{Effect, EffectKey, Group, Law, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    /// The number of this effect at one place.
    pub(crate) struct Example {
        amount: EffectKey {
            name: "amount",
            unit: Unit::One,
            min: -1.0,
            max: 1.0,
            drawn: [0.1, 1.0],
            signed: true,
            meaning: "size of the terms",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for Example {
    const SHEET: Sheet = Sheet {
        name: "example",
        group: Group::Motion,
        laws: &[Law::Air, Law::StoredAir, Law::Friction, Law::Force],
        law: "a constant in every open balance",
        source: "none, made for the tests",
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }

    fn open_term(&self, balance: &OpenBalance<'_>) -> Option<f64> {
        Some(self.amount * unit(balance))
    }
}

/// What the term is of an amount of 1: small, but seen in any motion.
fn unit(balance: &OpenBalance<'_>) -> f64 {
    match balance {
        OpenBalance::Opening { .. } => 0.01,
        OpenBalance::Leakage { .. } => 1e-5,
        OpenBalance::SlidingLevel { .. } => 5.0,
        OpenBalance::BreakAwayLevel { .. } => 7.0,
        OpenBalance::Force(_) => 20.0,
        OpenBalance::PositionReading { .. } => 1e-3,
        OpenBalance::ForceReading { .. } => 3.0,
        OpenBalance::PressureReading { .. } => 1e3,
    }
}

#[cfg(test)]
mod tests {
    use super::super::acting::Effects;
    use super::super::friction::{Friction, FrictionConditions};
    use super::super::tabulated::AxisConditions;
    use super::*;
    use crate::{Inputs, Plant, Setup};
    use std::path::Path;

    const NAME: &str = Example::SHEET.name;

    fn plant(amount: Option<f64>) -> Plant {
        let rig = RigParameters::baseline();
        let rig =
            amount.map_or(Ok(rig.clone()), |amount| rig.with_effect(NAME, "drive", &[("amount", amount)]));
        Plant::new(&rig.expect("in range"), &Setup::default()).expect("good")
    }

    fn moved(amount: Option<f64>) -> (Plant, Inputs) {
        let (mut plant, inputs) = (plant(amount), Inputs { valve: [0.6, 0.3], ..Inputs::default() });
        (0..80).for_each(|_| plant.step(&inputs));
        (plant, inputs)
    }

    #[test]
    fn it_has_a_column_with_its_term_in_every_open_balance() {
        let (plant, inputs) = moved(Some(0.5));
        let terms = plant.terms(&inputs);
        let columns: Vec<(String, f64)> =
            plant.term_names().into_iter().zip(terms.values().to_vec()).collect();
        let expected = [
            ("drive_opening_example_opening", 0.005),
            ("drive_leakage_example_a_m3_per_s", 5e-6),
            ("drive_leakage_example_b_m3_per_s", 5e-6),
            ("drive_sliding_level_example_N", 2.5),
            ("drive_break_away_level_example_N", 3.5),
            ("drive_force_example_N", 10.0),
            ("drive_position_reading_example_position_m", 5e-4),
            ("drive_force_reading_example_force_N", 1.5),
            ("drive_pressure_reading_example_a_Pa", 500.0),
            ("drive_pressure_reading_example_b_Pa", 500.0),
        ];
        assert_eq!(columns, expected.map(|(name, value)| (name.to_owned(), value)));
    }

    #[test]
    fn each_open_sum_holds_its_term() {
        let of = |amount| {
            let (plant, _) = moved(Some(0.0));
            let mut on = plant.effects().expect("on").clone();
            on.on[0].example = Some(Example { amount });
            (plant, on)
        };
        let ((plant, with), (_, without)) = (of(1.0), of(0.0));
        let integrator = &plant.integrator;
        let conditions =
            AxisConditions { extension_m: 0.2, velocity_m_per_s: 0.1, spool: 0.3, pressure_pa: [4e5, 3e5] };
        let friction_conditions = FrictionConditions { extension_m: 0.2, gauge_pa: [3e5, 2e5], rest_s: 0.0 };
        let sums = |effects: &Effects| {
            let at = effects.declared_at(0, &conditions, 0.0);
            let friction = Friction { effects, of: integrator, axis: 0, conditions: friction_conditions };
            [
                effects.force(0, &conditions).sum(0.0),
                effects.leakage(integrator, 0, &conditions)[1].sum(0.0),
                friction.levels(0.1).sliding_n[0],
                friction.levels(0.1).break_away_n[1],
                effects.position_reading(0, 0.0, &at).sum(0.0),
                effects.force_reading(0, 0.0, &at).sum(0.0),
                effects.pressure_reading(0, 1, 0.0, &at).sum(0.0),
            ]
        };
        let differences: Vec<f64> =
            sums(&with).into_iter().zip(sums(&without)).map(|(with, without)| with - without).collect();
        // A level is a sum with the file's: a rounding of its last place.
        let close = |(is, want): (&f64, f64)| (is - want).abs() <= 1e-12 * want;
        assert!(differences.iter().zip([20.0, 1e-5, 5.0, 7.0, 1e-3, 3.0, 1e3]).all(close), "{differences:?}");
    }

    #[test]
    fn it_changes_the_motion_and_at_0_it_does_not() {
        let position = |amount| moved(amount).0.truth(&Inputs::default()).axes[0].position_m;
        let baseline = position(None);
        assert!((position(Some(1.0)) - baseline).abs() > 1e-4, "20 N and more on 10 kg for 80 ms");
        assert!((position(Some(0.0)) - baseline).abs() < 1e-9, "the order of additions alone");
    }

    /// In `plant/src`, adding an effect takes one file and one line: the name of this one stands nowhere else there.
    #[test]
    fn it_stands_in_one_file_and_one_line() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let (mut folders, mut lines) = (vec![source], Vec::new());
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("the sources are there") {
                let path = entry.expect("readable").path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|end| end == "rs")
                    && !path.ends_with("effects/example.rs")
                {
                    let text = std::fs::read_to_string(&path).expect("readable");
                    let names = |line: &&str| line.contains("example:") || line.contains("Example");
                    lines.extend(text.lines().filter(names).map(|line| line.trim().to_owned()));
                }
            }
        }
        assert_eq!(lines, ["#[cfg(test)] example: Example, Axis;"]);
    }
}
