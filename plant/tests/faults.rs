//! Faults of the plant against closed forms, and the baseline untouched by their being possible.

use plant::faults::{AxisFaults, Faults, SupplyFault, ValveFault};
use plant::{Inputs, Plant, RigParameters, Setup, State};

const ATMOSPHERE_PA: f64 = 101_325.0;

fn plant() -> Plant {
    let setup = Setup { carriage_position_m: 0.25, ..Setup::default() };
    Plant::new(&RigParameters::baseline(), &setup).expect("a good setup")
}

fn of_drive(axis: AxisFaults) -> Faults {
    Faults { axes: [axis, AxisFaults::default()], supply: None }
}

fn inputs(k: u32) -> Inputs {
    let u = if (k / 150).is_multiple_of(2) { 0.5 } else { -0.4 };
    Inputs { valve: [u, -0.3 * u], ..Inputs::default() }
}

/// States of a motion; `each` does something to the plant before each step.
fn motion(mut plant: Plant, mut each: impl FnMut(u32, &mut Plant)) -> Vec<State> {
    let step = |k| {
        each(k, &mut plant);
        plant.step(&inputs(k));
        *plant.state()
    };
    (0..600).map(step).collect()
}

#[test]
fn a_plant_without_a_fault_is_the_baseline_to_the_bit_before_during_and_after() {
    let baseline = motion(plant(), |_, _| ());
    let expected = motion(plant(), |k, plant| {
        if k.is_multiple_of(100) {
            plant.expect_faults();
            plant.set_faults(&Faults::default());
        }
    });
    assert_eq!(baseline, expected);
    // A fault of the other kind: one that came and went before anything moved.
    let mut mended = plant();
    mended.set_faults(&of_drive(AxisFaults { friction_factor: 3.0, ..AxisFaults::default() }));
    mended.set_faults(&Faults::default());
    assert_eq!(baseline, motion(mended, |_, _| ()));
}

#[test]
fn laws_of_faults_that_are_nothing_yet_leave_the_baseline_within_roundings() {
    let baseline = motion(plant(), |_, _| ());
    let tiny = of_drive(AxisFaults { leakage_m3_per_s: [1e-15, 0.0], ..AxisFaults::default() });
    let through = motion(plant(), |k, plant| {
        if k == 50 {
            plant.set_faults(&tiny);
        }
    });
    for (k, (one, other)) in baseline.iter().zip(&through).enumerate() {
        for axis in 0..2 {
            let apart = one.axes[axis].extension_m - other.axes[axis].extension_m;
            // Motion amplifies roundings and 1e-15 m^3/s over 0.6 s by far less than to a nanometre.
            assert!(apart.abs() < 1e-9, "cycle {k}: {apart} m");
        }
    }
}

#[test]
fn a_burst_hose_empties_a_shut_chamber_with_the_computed_time_constant() {
    let (kv_m3_per_h, chamber) = (1.5, 0);
    let mut plant = plant();
    let volume_m3 = 20e-6 + 1963.5e-6 * 0.25;
    let tau_s = volume_m3 / (ATMOSPHERE_PA * 12.95 * kv_m3_per_h / 1e5 / 3600.0);
    let mut axis = AxisFaults { friction_factor: 1000.0, ..AxisFaults::default() };
    axis.burst_kv_m3_per_h[chamber] = kv_m3_per_h;
    // Friction holds the piston, so that the volume stays.
    plant.set_faults(&of_drive(axis));
    let pressure_pa = |plant: &Plant| plant.truth(&Inputs::default()).axes[0].pressure_a_pa;
    let begin_pa = pressure_pa(&plant);
    for k in 0..40 {
        let computed_pa = begin_pa * (-f64::from(k) * 1e-3 / tau_s).exp();
        assert!(computed_pa > 2.0 * ATMOSPHERE_PA, "choked throughout, or the closed form ends");
        // An explicit midpoint rule of 100 us on 0.1 s: (h / tau)^2 / 6 of the change, 2e-7.
        assert!((pressure_pa(&plant) / computed_pa - 1.0).abs() < 1e-5, "{k} ms: {}", pressure_pa(&plant));
        plant.step(&Inputs::default());
    }
    assert_eq!(plant.state().axes[0].extension_m, 0.25, "held");
    (0..2000).for_each(|_| plant.step(&Inputs::default()));
    assert!((pressure_pa(&plant) / ATMOSPHERE_PA - 1.0).abs() < 1e-3, "{}", pressure_pa(&plant));
}

#[test]
fn a_stuck_valve_holds_its_spool_and_a_dead_one_is_centred() {
    for (fault, expected) in [
        (ValveFault { stuck: true, ..ValveFault::default() }, None),
        (ValveFault { dead: true, ..ValveFault::default() }, Some(0.0)),
        (ValveFault { limit: 0.1, ..ValveFault::default() }, Some(-0.1)),
        (ValveFault { offset: 0.2, ..ValveFault::default() }, Some(-0.2)),
    ] {
        let mut spool = f64::NAN;
        let states = motion(plant(), |k, plant| {
            if k == 100 {
                spool = plant.state().axes[0].spool;
                plant.set_faults(&of_drive(AxisFaults { valve: fault, ..AxisFaults::default() }));
            }
        });
        // 140 periods after the command of -0.4 came, a spool of 1.6 ms is there to the last digits.
        let end = states[290].axes[0].spool;
        assert!((end - expected.unwrap_or(spool)).abs() < 1e-12, "{fault:?}: {end}");
        if fault.stuck {
            assert!(states[100..].iter().all(|state| state.axes[0].spool.to_bits() == spool.to_bits()));
        }
    }
}

#[test]
fn a_supply_goes_where_its_fault_sends_it_and_comes_back() {
    let mut plant = plant();
    let fault = SupplyFault { pressure_pa: 4e5, time_constant_s: 0.1 };
    plant.set_faults(&Faults { supply: Some(fault), ..Faults::default() });
    (0..100).for_each(|_| plant.step(&Inputs::default()));
    let form_pa = 4e5 + 3e5 * (-1.0_f64).exp();
    assert!((plant.supply_pressure_pa() - form_pa).abs() < 1e-6, "{}", plant.supply_pressure_pa());
    plant.set_faults(&Faults::default());
    (0..300).for_each(|_| plant.step(&Inputs::default()));
    let form_pa = 7e5 + (form_pa - 7e5) * (-1.0_f64).exp();
    assert!((plant.supply_pressure_pa() - form_pa).abs() < 1e-6, "{}", plant.supply_pressure_pa());
}

#[test]
fn friction_that_rises_and_mass_on_top_slow_an_axis_down() {
    let way_m = |faults: &Faults| {
        let mut plant = plant();
        plant.set_faults(faults);
        (0..200).for_each(|_| plant.step(&Inputs { valve: [0.5, 0.0], ..Inputs::default() }));
        plant.state().axes[0].extension_m - 0.25
    };
    let sound_m = way_m(&Faults::default());
    let rubbed_m = way_m(&of_drive(AxisFaults { friction_factor: 4.0, ..AxisFaults::default() }));
    let loaded_m = way_m(&of_drive(AxisFaults { added_mass_kg: 30.0, ..AxisFaults::default() }));
    assert!(sound_m > 0.02 && rubbed_m < 0.9 * sound_m, "{rubbed_m} of {sound_m} m");
    assert!(loaded_m < sound_m, "{loaded_m} of {sound_m} m");
}
