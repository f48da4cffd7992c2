//! The sensors on the plant: steps, ranges, noise, what each one shows.

use crate::rig::plant;
use plant::{AxisReadings, Inputs, Plant, Reading, RigParameters, Sensors, Setup};

fn noiseless() -> RigParameters {
    let mut rig = RigParameters::baseline();
    for key in ["sensors.position_noise_um", "sensors.force_noise_n", "sensors.pressure_noise_pa"] {
        rig = rig.with(key, &[0.0]).expect("no noise is allowed");
    }
    rig
}

/// Each reading with its sensor's step.
fn all(readings: &[AxisReadings; 2]) -> Vec<(Reading, f64)> {
    let (x, f, p) = (0.5 / 65535.0, 2000.0 / 32767.0, 1e6 / 16383.0);
    let of = |axis: &AxisReadings| {
        [(axis.position, x), (axis.force, f), (axis.pressure_a, p), (axis.pressure_b, p)]
    };
    readings.iter().flat_map(of).collect()
}

#[test]
fn every_value_is_a_whole_number_of_steps() {
    let rig = RigParameters::baseline();
    let mut sensors = Sensors::new(&rig, 3);
    let mut plant = plant(Setup { linked: true, ..Setup::default() });
    let inputs = Inputs { valve: [0.5, 0.3], ..Inputs::default() };
    for _ in 0..300 {
        for (reading, step) in all(&sensors.sample(&plant, &inputs)) {
            let counts = (reading.value / step).round();
            assert_eq!(reading.value, counts * step);
        }
        plant.step(&inputs);
    }
}

#[test]
fn without_noise_the_sensors_show_the_truth_to_half_a_step() {
    let rig = noiseless();
    let mut plant = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("good");
    let inputs = Inputs { valve: [0.4, 0.2], hand_force_load_n: -20.0, ..Inputs::default() };
    let mut sensors = Sensors::new(&rig, 0);
    for _ in 0..200 {
        let truth = plant.truth(&inputs);
        let readings = sensors.sample(&plant, &inputs);
        let shown = |i: usize, offset: f64| {
            let axis = truth.axes[i];
            [axis.position_m + offset, axis.sensor_force_n, axis.pressure_a_pa, axis.pressure_b_pa]
        };
        let wanted = [shown(0, 0.0), shown(1, 0.8e-3)].concat();
        for ((reading, step), wanted) in all(&readings).iter().zip(wanted) {
            assert!((reading.value - wanted).abs() <= 0.5000001 * step, "{reading:?} {wanted}");
            assert!(!reading.saturated);
        }
        plant.step(&inputs);
    }
}

#[test]
fn the_load_parked_beyond_its_range_by_the_offset_is_flagged() {
    let rig = noiseless();
    let [drive, load] = Sensors::new(&rig, 0).sample(&plant(Setup::default()), &Inputs::default());
    assert!(!drive.position.saturated);
    // Parked at 0.5 m, the sensor mounted 0.8 mm off.
    assert_eq!(load.position, Reading { value: 65535.0 * (0.5 / 65535.0), saturated: true });
}

#[test]
fn a_force_beyond_the_range_is_clipped_and_flagged() {
    let rig = noiseless();
    let push = Inputs { hand_force_carriage_n: -2500.0, hand_force_load_n: 2500.0, ..Inputs::default() };
    // Both rods at an end that takes the push: the drive at 0, the load at its own 0.
    let plant = plant(Setup { carriage_position_m: 0.0, ..Setup::default() });
    let [drive, load] = Sensors::new(&rig, 0).sample(&plant, &push);
    let most = 32767.0 * (2000.0 / 32767.0);
    assert_eq!(drive.force, Reading { value: most, saturated: true });
    assert_eq!(load.force, Reading { value: most, saturated: true });
}

#[test]
fn the_noise_has_the_mean_and_the_spread_of_the_table() {
    let rig = RigParameters::baseline();
    let plant = plant(Setup { carriage_position_m: 0.25, linked: true, added_mass_kg: 0.0 });
    let truth = plant.truth(&Inputs::default());
    let mut sensors = Sensors::new(&rig, 11);
    let samples = 20_000;
    let mut sums = [[0.0; 2]; 8];
    let center = |i: usize| {
        let axis = truth.axes[i / 4];
        let offset = if i < 4 { 0.0 } else { 0.8e-3 };
        [axis.position_m + offset, axis.sensor_force_n, axis.pressure_a_pa, axis.pressure_b_pa][i % 4]
    };
    for _ in 0..samples {
        for (i, (reading, _)) in all(&sensors.sample(&plant, &Inputs::default())).iter().enumerate() {
            let deviation = reading.value - center(i);
            sums[i][0] += deviation;
            sums[i][1] += deviation * deviation;
        }
    }
    for (i, [sum, squares]) in sums.iter().enumerate() {
        let noise = [20e-6, 0.5, 400.0, 400.0][i % 4];
        let step = [0.5 / 65535.0, 2000.0 / 32767.0, 1e6 / 16383.0, 1e6 / 16383.0][i % 4];
        // Rounding adds step^2 / 12. Standard errors: noise / sqrt(n) and noise / sqrt(2 n); five of each.
        let spread = f64::sqrt(noise * noise + step * step / 12.0);
        let n = f64::from(samples);
        assert!((sum / n).abs() < 5.0 * spread / n.sqrt(), "mean of channel {i}: {}", sum / n);
        let rms = (squares / n).sqrt();
        assert!((rms - spread).abs() < 5.0 * spread / (2.0 * n).sqrt(), "spread of channel {i}: {rms}");
    }
}

#[test]
fn the_seed_gives_the_readings_and_another_seed_gives_others() {
    let rig = RigParameters::baseline();
    let plant = plant(Setup::default());
    let run = |seed| {
        let mut sensors = Sensors::new(&rig, seed);
        (0..50).map(|_| sensors.sample(&plant, &Inputs::default())).collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn sampling_leaves_the_plant_as_it_is() {
    let rig = RigParameters::baseline();
    let plant = plant(Setup::default());
    let before = *plant.state();
    Sensors::new(&rig, 1).sample(&plant, &Inputs::default());
    assert_eq!(*plant.state(), before);
}
