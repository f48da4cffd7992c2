//! Checks of a descriptor's texts and numbers, and the trial of an instance; nothing here is foreign any more.

use crate::interface::{FORCE, POSITION};
use crate::refusal::RefusalReason;
use algorithms::algorithm::{AlgorithmInput, Quantity};
use settings::parameters::Parameter;
use std::f64::consts::TAU;
use std::hint::black_box;

/// Keys of a program file's table `[algorithm]` that are not parameters.
const TAKEN: [&str; 3] = ["name", "library", "every_cycles"];

const TRIAL_STEPS: u32 = 100;

/// Controlled quantity, by its number in the header.
pub(super) fn quantity(controls: u32) -> Result<Quantity, RefusalReason> {
    match controls {
        POSITION => Ok(Quantity::Position),
        FORCE => Ok(Quantity::Force),
        other => Err(RefusalReason::Controls(other)),
    }
}

/// Checks that names are valid, unique keys of program files, ranges are valid, and defaults lie in them.
pub(super) fn table(parameters: &[Parameter]) -> Result<(), RefusalReason> {
    for (place, parameter) in parameters.iter().enumerate() {
        let Parameter { name, least, most, default, .. } = parameter;
        let what = || format!("parameter {}'s name '{name}'", place + 1);
        if name.is_empty() {
            return Err(RefusalReason::text(what(), "is empty; give it one"));
        }
        if !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
            return Err(RefusalReason::text(
                what(),
                "is no key of a program file: use letters, digits, '_' and '-'",
            ));
        }
        if TAKEN.contains(&name.as_ref()) {
            return Err(RefusalReason::text(what(), "has another meaning in a program file; choose another"));
        }
        if parameters[..place].iter().any(|other| other.name == *name) {
            return Err(RefusalReason::DuplicateParameter(name.clone().into_owned()));
        }
        // Not `least >= most`: NaN must be refused too.
        if !(least.is_finite() && most.is_finite() && least < most) {
            return Err(RefusalReason::Range { name: name.clone().into_owned(), least: *least, most: *most });
        }
        parameter.check(*default)?;
    }
    Ok(())
}

/// Whether this thread rounds as IEEE 754 does by default: to the nearest, with numbers below the smallest normal one.
///
/// gcc links start-up code into every -ffast-math library that flushes those to 0, for the whole thread.
pub(super) fn arithmetic() -> Result<(), RefusalReason> {
    let (one, little) = (black_box(1.0), black_box(f64::EPSILON));
    let nearest = one + little / 4.0 == 1.0 && -one - little / 4.0 == -1.0 && one - little / 8.0 == 1.0;
    let subnormal = black_box(f64::MIN_POSITIVE) / black_box(2.0) > 0.0;
    if nearest && subnormal { Ok(()) } else { Err(RefusalReason::Arithmetic) }
}

/// Runs `step` with inputs of a plausible motion (0.25 m +- 0.1 m, 2 mm behind its set-point, 50 N with ripple): every result
/// must be finite.
pub(super) fn trial(mut step: impl FnMut(u32, &AlgorithmInput) -> f64) -> Result<(), RefusalReason> {
    for number in 1..=TRIAL_STEPS {
        let result = step(number, &plausible(f64::from(number) / f64::from(TRIAL_STEPS)));
        if !result.is_finite() {
            return Err(RefusalReason::NotFinite { step: number, result });
        }
    }
    Ok(())
}

/// The input at a `share` of the trial's motion, 0 to 1.
pub(super) fn plausible(share: f64) -> AlgorithmInput {
    let (sine, cosine) = (libm::sin(TAU * share), libm::cos(TAU * share));
    AlgorithmInput {
        period_s: 0.001,
        position_m: 0.248 + 0.1 * sine,
        velocity_m_per_s: 0.2 * cosine,
        acceleration_m_per_s2: -0.4 * sine,
        force_n: 50.0 + 10.0 * cosine,
        pressure_a_pa: 4.0e5 + 0.5e5 * cosine,
        pressure_b_pa: 4.2e5 - 0.5e5 * cosine,
        supply_pressure_pa: 7.0e5,
        set_position_m: 0.25 + 0.1 * sine,
        set_velocity_m_per_s: 0.2 * cosine,
        set_acceleration_m_per_s2: -0.4 * sine,
        set_force_n: 60.0,
        set_force_rate_n_per_s: 0.0,
        applied_velocity_m_per_s: 0.2 * cosine,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(name: &'static str, range: [f64; 2], default: f64) -> Parameter {
        Parameter::new((name, ""), range, default, "")
    }

    #[test]
    fn a_table_with_names_ranges_and_defaults_in_order_is_taken() {
        table(&[parameter("gain_per_s", [0.0, 1.0], 1.0), parameter("dead-zone", [-1.0, 1.0], 0.0)]).unwrap();
        table(&[]).unwrap();
    }

    #[test]
    fn each_fault_of_a_table_is_refused_in_its_own_words() {
        let cases = [
            (parameter("", [0.0, 1.0], 0.0), "is empty"),
            (parameter("gain per s", [0.0, 1.0], 0.0), "no key of a program file"),
            (parameter("gain", [0.0, 1.0], 0.0), "two parameters 'gain'"),
            (parameter("library", [0.0, 1.0], 0.0), "another meaning"),
            (parameter("a", [1.0, 1.0], 1.0), "range 1 to 1"),
            (parameter("a", [0.0, f64::NAN], 0.0), "must be finite"),
            (parameter("a", [f64::NEG_INFINITY, 0.0], 0.0), "must be finite"),
            (parameter("a", [0.0, 1.0], 2.0), "a = 2;"),
            (parameter("a", [0.0, 1.0], f64::NAN), "a = NaN"),
        ];
        for (bad, words) in cases {
            let refusal = table(&[parameter("gain", [0.0, 1.0], 0.5), bad]).unwrap_err().to_string();
            assert!(refusal.contains(words), "{refusal}");
        }
    }

    #[test]
    fn this_process_rounds_as_usual() {
        arithmetic().unwrap();
    }

    #[test]
    fn a_trial_names_the_step_that_gave_no_number() {
        let refusal =
            trial(|number, input| if number == 7 { f64::NAN } else { input.position_m }).unwrap_err();
        assert!(matches!(refusal, RefusalReason::NotFinite { step: 7, .. }), "{refusal}");
    }
}
