//! The example in C, from the build line of its head to the set-point of the simulated drive.

use crate::build::{Libraries, trier};
use crate::laws;
use crate::position_pi::KIND;
use algorithms::algorithm::{Algorithm, AlgorithmInput, Quantity};
use algorithms::guard::Guarded;
use algorithms::linearisation::{Law, Linearisation};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup};
use plugin::{Plugin, load_tried_by};
use realtime::{MonotonicClock, allocations};

fn example() -> Plugin {
    load_tried_by(&trier(), &Libraries::new().example(), &RigParameters::baseline()).unwrap()
}

fn defaults(plugin: &Plugin) -> Vec<f64> {
    plugin.description.parameters.iter().map(|parameter| parameter.default).collect()
}

/// Positions of the unlinked drive after each ms of 5 s with its set-point at `target_m`, from 0.1 m, under the example.
fn drive_to(target_m: f64, change: impl Fn(&mut [f64])) -> Vec<f64> {
    let rig = RigParameters::baseline();
    let linearisation = Linearisation::new(&rig, Law::ChokedExhaust);
    let plugin = example();
    let mut values = defaults(&plugin);
    change(&mut values);
    let mut guarded = Guarded::new(Box::new(plugin), None);
    let mut plant = Plant::new(&rig, &Setup::default()).unwrap();
    let mut sensors = Sensors::new(&rig, 1);
    let mut inputs = Inputs::default();
    let mut input = AlgorithmInput { period_s: 0.001, set_position_m: target_m, ..AlgorithmInput::default() };
    (0..5000)
        .map(|cycle| {
            input.position_m = sensors.sample(&plant, &inputs)[0].position.value;
            if cycle == 0 {
                guarded.reset(&input, &values).unwrap();
            }
            let wanted = guarded.step(&input, &values).unwrap();
            let largest = linearisation.velocity(1.0f64.copysign(wanted), &input).abs();
            input.applied_velocity_m_per_s = wanted.clamp(-largest, largest);
            inputs.valve[0] = linearisation.opening(input.applied_velocity_m_per_s, &input);
            plant.step(&inputs);
            plant.state().axes[0].extension_m
        })
        .collect()
}

#[test]
fn the_description_is_the_table_of_the_c_file() {
    let plugin = example();
    let description = &plugin.description;
    assert_eq!((description.name.as_str(), description.controls), ("position-pi", Quantity::Position));
    let names: Vec<_> = description.parameters.iter().map(|parameter| parameter.name.as_ref()).collect();
    assert_eq!(
        names,
        ["gain_per_s", "integral_time_s", "tracking_time_s", "velocity_feed_forward", "dead_zone_m"]
    );
    assert_eq!((description.parameters[0].unit.as_ref(), description.parameters[0].most), ("1/s", 100.0));
}

#[test]
fn it_brings_the_drive_to_its_set_point_and_the_anti_wind_up_keeps_it_from_overshooting() {
    let target = 0.4;
    // A quick integral, which a step winds up.
    let quick = |values: &mut [f64]| (values[1], values[4]) = (0.5, 0.0003);
    let positions = drive_to(target, quick);
    let highest = |positions: &[f64]| positions.iter().copied().fold(0.0, f64::max);
    // The step of 0.3 m holds the valve in its limit for half a second. 10 mm is a thirtieth of the step.
    assert!(highest(&positions) < target + 0.01, "{}", highest(&positions));
    // A tracking time of 10 s is as good as no anti-wind-up: it runs into the end of its stroke.
    let wound_up = drive_to(target, |values| {
        quick(values);
        values[2] = 10.0;
    });
    assert!(highest(&wound_up) > target + 0.05, "{}", highest(&wound_up));
    // Dead zone 0.3 mm, noise 0.02 mm, and stick-slip of the like size: 1 mm.
    let worst = positions[4000..].iter().map(|position| (position - target).abs()).fold(0.0, f64::max);
    assert!(worst < 0.001, "{worst}");
}

#[test]
fn a_step_through_the_library_allocates_nothing() {
    let plugin = example();
    let values = defaults(&plugin);
    let mut guarded = Guarded::new(Box::new(plugin), Some(Box::new(MonotonicClock)));
    let input = AlgorithmInput { period_s: 0.001, set_position_m: 0.1, ..AlgorithmInput::default() };
    guarded.reset(&input, &values).unwrap();
    let (before, sum) = {
        let _scope = allocations::count_scope();
        let before = allocations::counted();
        (before, (0..1000).map(|_| guarded.step(&input, &values).unwrap_or(0.0)).sum::<f64>())
    };
    assert_eq!(allocations::counted(), before);
    assert!(sum > 0.0);
}

#[test]
fn two_instances_of_one_library_have_their_own_state() {
    let libraries = Libraries::new();
    let library = libraries.example();
    let load = || load_tried_by(&trier(), &library, &RigParameters::baseline()).unwrap();
    let (mut one, mut other) = (load(), load());
    let values = defaults(&one);
    let input = AlgorithmInput { period_s: 0.001, set_position_m: 0.1, ..AlgorithmInput::default() };
    one.reset(&input, &values);
    other.reset(&input, &values);
    let first = one.step(&input, &values);
    (0..100).for_each(|_| {
        one.step(&input, &values);
    });
    assert_eq!(other.step(&input, &values), first);
}

#[test]
#[should_panic(expected = "a value for each parameter")]
fn fewer_values_than_parameters_are_a_bug_and_never_reach_the_library() {
    let _ = example().step(&AlgorithmInput::default(), &[1.0]);
}

#[test]
fn the_example_in_rust_gives_the_same_bits_and_is_the_text_of_the_document() {
    let document = include_str!("../../docs/own-algorithm.md");
    assert!(
        document.contains(include_str!("position_pi.rs")),
        "own-algorithm.md shows tests/plugin/position_pi.rs"
    );

    laws::check(&KIND);
    let mut in_c = example();
    let values = defaults(&in_c);
    assert_eq!(in_c.description.parameters, KIND.parameters, "the tables");
    let mut in_rust = (KIND.make)(&RigParameters::baseline());
    let mut input = AlgorithmInput { period_s: 0.001, ..AlgorithmInput::default() };
    in_rust.reset(&input, &values);
    in_c.reset(&input, &values);
    for cycle in 0..2000 {
        input.set_position_m = 0.2 + 0.05 * f64::from(cycle % 300) / 300.0;
        input.position_m += 0.001 * input.applied_velocity_m_per_s;
        let results = [in_rust.step(&input, &values), in_c.step(&input, &values)];
        assert_eq!(results[0].to_bits(), results[1].to_bits(), "step {cycle}: {results:?}");
        input.applied_velocity_m_per_s = results[0].clamp(-0.8, 0.8);
    }
}
