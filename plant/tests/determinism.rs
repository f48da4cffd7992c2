//! The same bits on every x86-64 machine: a run against the hash that was committed.
//!
//! If this fails after a change of the model or of the integration, that change is what it found: look at the
//! accuracy table, then commit the new hash. If it fails on another machine or compiler alone, floating point is not
//! what the crate assumes there.

use plant::{Inputs, Plant, RigParameters, Sensors, Setup};

/// FNV-1a over bytes: a hash that is written down in three lines.
fn fnv1a(hash: u64, number: f64) -> u64 {
    number
        .to_bits()
        .to_le_bytes()
        .iter()
        .fold(hash, |h, byte| (h ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Two seconds with everything in it: both valves, contact, a hand, weights, emergency stop, unlinking, noise.
fn run() -> u64 {
    let rig = RigParameters::baseline();
    let setup = Setup { carriage_position_m: 0.2, linked: true, added_mass_kg: 2.0 };
    let mut plant = Plant::new(&rig, &setup).expect("good");
    let mut sensors = Sensors::new(&rig, 2011);
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for k in 0..2000_u32 {
        match k {
            900 => plant.trip_emergency_stop(),
            1100 => plant.release_emergency_stop(),
            1500 => plant.unlink(),
            1600 => plant.set_added_mass_kg(5.0).expect("within the limit"),
            _ => (),
        }
        // A triangle, so that the pattern itself needs no library function.
        let triangle =
            |period: u32| f64::from((k % period).abs_diff(period / 2)) / f64::from(period / 4) - 1.0;
        let inputs = Inputs {
            valve: [plant::quantise_valve(0.9 * triangle(700)), plant::quantise_valve(0.4 * triangle(330))],
            hand_force_carriage_n: if k % 500 < 50 { 80.0 } else { 0.0 },
            hand_force_load_n: if k % 800 < 30 { -60.0 } else { 0.0 },
        };
        for axis in sensors.sample(&plant, &inputs) {
            for reading in [axis.position, axis.force, axis.pressure_a, axis.pressure_b] {
                hash = fnv1a(hash, reading.value);
            }
        }
        plant.step(&inputs);
    }
    plant.truth(&Inputs::default()).values().iter().fold(hash, |hash, value| fnv1a(hash, *value))
}

#[test]
fn two_runs_are_equal_to_the_bit() {
    assert_eq!(run(), run());
}

#[test]
fn this_machine_computes_what_the_first_one_did() {
    // Taken on x86-64 (AMD EPYC), rustc 1.95, 20 November 2026; before the column of effect forces it was b706d25d5b477aff.
    assert_eq!(format!("{:016x}", run()), "c8b5d470bd0c613f");
}
