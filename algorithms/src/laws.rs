//! Properties that every algorithm must have, whatever its law: for their tests.

use crate::algorithm::{AlgorithmInput, Kind};
use nominal::RigParameters;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// A result beyond this is out of proportion to any rig, m/s; P may reach 200 1/s * 0.5 m + 2 * 1 m/s.
const BOUND_M_PER_S: f64 = 102.0;

/// At rest where it should be, 0.2 m out.
pub(super) fn at_rest() -> AlgorithmInput {
    let (position_m, set_position_m) = (0.2, 0.2);
    let (pressure_a_pa, pressure_b_pa, supply_pressure_pa) = (3.1e5, 3.5e5, 7e5);
    let air =
        AlgorithmInput { pressure_a_pa, pressure_b_pa, supply_pressure_pa, ..AlgorithmInput::default() };
    AlgorithmInput { period_s: 1e-3, position_m, set_position_m, ..air }
}

/// Anything that a rig of half a metre can be in.
fn any_input() -> impl Strategy<Value = AlgorithmInput> {
    let position = (0.0..0.5_f64, -1.0..1.0_f64, -50.0..50.0_f64);
    let air = (-2000.0..2000.0_f64, 0.0..1e6_f64, 0.0..1e6_f64, 1e5..8e5_f64);
    let set = (0.0..0.5_f64, -1.0..1.0_f64, -50.0..50.0_f64);
    let set_force = (-2000.0..2000.0_f64, -1e5..1e5_f64);
    let rest = (-1.0..1.0_f64, 1e-3..0.1_f64);
    (position, air, set, set_force, rest).prop_map(|(position, air, set, set_force, (applied, period_s))| {
        AlgorithmInput {
            period_s,
            position_m: position.0,
            velocity_m_per_s: position.1,
            acceleration_m_per_s2: position.2,
            force_n: air.0,
            pressure_a_pa: air.1,
            pressure_b_pa: air.2,
            supply_pressure_pa: air.3,
            set_position_m: set.0,
            set_velocity_m_per_s: set.1,
            set_acceleration_m_per_s2: set.2,
            set_force_n: set_force.0,
            set_force_rate_n_per_s: set_force.1,
            applied_velocity_m_per_s: applied,
        }
    })
}

/// Any values that the tables allow.
fn any_parameters(kind: &Kind) -> impl Strategy<Value = Vec<f64>> {
    kind.parameters.iter().map(|parameter| parameter.least..=parameter.most).collect::<Vec<_>>()
}

/// Results are bounded numbers, for all inputs and parameters, and a reset forgets all that was before.
pub(super) fn check(kind: &Kind) {
    let inputs = (proptest::collection::vec(any_input(), 1..40), any_parameters(kind));
    let claim = |(row, parameters): (Vec<AlgorithmInput>, Vec<f64>)| {
        let rig = RigParameters::baseline();
        let (mut used, mut fresh) = ((kind.make)(&rig), (kind.make)(&rig));
        used.reset(&row[0], &parameters);
        for input in &row {
            let result = used.step(input, &parameters);
            prop_assert!(result.abs() <= BOUND_M_PER_S, "{result}");
        }
        used.reset(&row[0], &parameters);
        fresh.reset(&row[0], &parameters);
        for input in &row {
            let (again, first) = (used.step(input, &parameters), fresh.step(input, &parameters));
            prop_assert_eq!(again.to_bits(), first.to_bits());
        }
        Ok(())
    };
    TestRunner::default().run(&inputs, claim).unwrap_or_else(|error| panic!("{}: {error}", kind.name));
}

pub(super) type ParameterOverride = (&'static str, f64);

/// A control error that the valve cannot remove, and the reversed error that follows.
pub(super) struct WindupCase<'a> {
    /// Parameters that differ from their defaults: an integral part so slow, with limit and zone so wide, that neither of these
    /// stops it in 10 s.
    pub overrides: &'a [ParameterOverride],
    /// The large error, 1 s or 10 s long.
    pub held_error: AlgorithmInput,
    /// The error that follows, for 0.5 s: some per cent of the first, with the other sign.
    pub reversed_error: AlgorithmInput,
}

/// Anti-windup: an integral part does not grow while the valve cannot follow. After 10 s of the error the algorithm continues as
/// after 1 s, with the valve at its limit or shut. With a valve that follows it does grow, so that the test has power.
pub(super) fn does_not_wind_up(kind: &Kind, case: &WindupCase<'_>) {
    let mut parameters: Vec<_> = kind.parameters.iter().map(|parameter| parameter.default).collect();
    for (name, value) in case.overrides {
        let place = kind.parameters.iter().position(|parameter| parameter.name == *name);
        parameters[place.unwrap_or_else(|| panic!("{}: no {name}", kind.name))] = *value;
    }
    let after = |held_s: f64, valve: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let mut algorithm = (kind.make)(&RigParameters::baseline());
        let mut input = case.held_error;
        algorithm.reset(&input, &parameters);
        for _ in 0..(held_s / input.period_s).round() as usize {
            input.applied_velocity_m_per_s = valve(algorithm.step(&input, &parameters));
        }
        input = AlgorithmInput {
            applied_velocity_m_per_s: input.applied_velocity_m_per_s,
            ..case.reversed_error
        };
        let mut step = |_| {
            let result = algorithm.step(&input, &parameters);
            input.applied_velocity_m_per_s = valve(result);
            result
        };
        (0..500).map(&mut step).collect()
    };
    // Filters within an algorithm have settled after 1 s, to this, m/s.
    let differ = |valve: &dyn Fn(f64) -> f64| {
        let (long, short) = (after(10.0, valve), after(1.0, valve));
        long.iter().zip(&short).map(|(long, short)| (long - short).abs()).fold(0.0, f64::max) > 1e-6
    };
    assert!(!differ(&|result: f64| result.clamp(-0.6, 0.6)), "{}: wound up at the valve's limit", kind.name);
    assert!(!differ(&|_| 0.0), "{}: wound up with the valve shut", kind.name);
    assert!(differ(&|result| result), "{}: its integral part does nothing here", kind.name);
}

/// After 10 s of an error at the edge of what an integral part may take in, its limit lets the result turn its sign within
/// `within_s` when the error does; with the parameters' defaults.
pub(super) fn keeps_its_limit(kind: &Kind, at_rest: &AlgorithmInput, within_s: f64) {
    let parameters: Vec<_> = kind.parameters.iter().map(|parameter| parameter.default).collect();
    for error_m in [0.3, 0.0029] {
        for valve_shut in [false, true] {
            let mut algorithm = (kind.make)(&RigParameters::baseline());
            let mut input = AlgorithmInput { set_position_m: at_rest.position_m + error_m, ..*at_rest };
            algorithm.reset(&input, &parameters);
            for _ in 0..10_000 {
                let result = algorithm.step(&input, &parameters);
                input.applied_velocity_m_per_s = if valve_shut { 0.0 } else { result.clamp(-0.6, 0.6) };
                assert!(result > 0.0, "{}: {result}", kind.name);
            }
            input.set_position_m = at_rest.position_m - error_m;
            let turned = (0..10_000).position(|_| {
                let result = algorithm.step(&input, &parameters);
                input.applied_velocity_m_per_s = if valve_shut { 0.0 } else { result.clamp(-0.6, 0.6) };
                result < 0.0
            });
            let turned_s = turned.map(|cycles| cycles as f64 * at_rest.period_s);
            assert!(turned_s.is_some_and(|s| s <= within_s), "{}: {turned_s:?} s", kind.name);
        }
    }
}
