//! The integration against its limit of small steps, as rig-model.md, Accuracy, asks for it.

use crate::scenario;
use crate::windows::{Errors, Scheme, compare, reference_windows};
use plant::RigParameters;

#[test]
fn windows_of_100_ms_stay_within_a_fifth_of_the_sensors_noise() {
    let rig = RigParameters::baseline();
    let mut errors = Errors::default();
    for scenario in scenario::all(&rig) {
        // 1 us: the reference's own error is below 0.02 of the noise (last row of docs/integration.md).
        let windows = reference_windows(&scenario, 1000);
        compare(&rig, Scheme::Plant(10), &scenario, &windows, &mut errors);
    }
    let [position, pressure, force] = errors.worst();
    assert!(position <= 0.2, "position: {position} of the noise");
    assert!(pressure <= 0.2, "pressure: {pressure} of the noise");
    assert!(force <= 0.2, "force: {force} of the noise");
}

#[test]
fn in_normal_running_single_samples_stay_within_the_sensors_steps() {
    let rig = RigParameters::baseline();
    let mut errors = Errors::default();
    for scenario in scenario::all(&rig).iter().take(3) {
        let windows = reference_windows(scenario, 1000);
        compare(&rig, Scheme::Plant(10), scenario, &windows, &mut errors);
    }
    let [position_m, pressure_pa, _] = errors.max;
    assert!(position_m <= rig.sensors().position_step_m(), "{position_m} m");
    assert!(pressure_pa <= rig.sensors().pressure_step_pa(), "{pressure_pa} Pa");
}

#[test]
fn halving_the_step_divides_the_error_by_about_four() {
    // Second order: from 500 to 250 us, in the median window, where corners do not hide the order.
    let rig = RigParameters::baseline();
    let scenario = &scenario::all(&rig)[1];
    let windows = reference_windows(scenario, 1000);
    let median = |substeps| {
        let mut errors = Errors::default();
        compare(&rig, Scheme::Plant(substeps), scenario, &windows, &mut errors);
        errors.median()
    };
    let (coarse, fine) = (median(2), median(4));
    for (name, i) in [("position", 0), ("pressure", 1), ("force", 2)] {
        let ratio = coarse[i] / fine[i];
        assert!((2.5..8.0).contains(&ratio), "{name}: {ratio}");
    }
}
