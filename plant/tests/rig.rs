//! The rig's behaviour as rig-model.md specifies it: start, ends of the stroke, linkage, emergency stop.

use plant::{Axis, Inputs, LinkRefused, Plant, RigParameters, Setup, SetupError, State};

pub(crate) fn plant(setup: Setup) -> Plant {
    Plant::new(&RigParameters::baseline(), &setup).expect("a good setup")
}

fn run(plant: &mut Plant, inputs: Inputs, ms: usize) {
    (0..ms).for_each(|_| plant.step(&inputs));
}

fn valve(drive: f64, load: f64) -> Inputs {
    Inputs { valve: [drive, load], ..Inputs::default() }
}

fn hand(carriage: f64, load: f64) -> Inputs {
    Inputs { hand_force_carriage_n: carriage, hand_force_load_n: load, ..Inputs::default() }
}

// Start.

#[test]
fn the_start_is_at_rest_in_force_balance() {
    for linked in [false, true] {
        let plant = plant(Setup { carriage_position_m: 0.2, linked, added_mass_kg: 0.0 });
        let truth = plant.truth(&Inputs::default());
        for axis in truth.axes {
            assert_eq!((axis.rod_velocity_m_per_s, axis.spool), (0.0, 0.0));
            assert_eq!((axis.flow_a_m3_per_s, axis.flow_b_m3_per_s), (0.0, 0.0));
            // p V and back: two roundings of 3.5e5 Pa; forces of 600 N.
            assert!((axis.pressure_b_pa - 3.5e5).abs() < 1e-9);
            assert!(axis.pneumatic_force_n.abs() < 1e-9, "{}", axis.pneumatic_force_n);
        }
        assert_eq!(truth.axes[0].position_m, 0.2);
        assert_eq!(truth.supply_pressure_pa, 7e5);
    }
}

#[test]
fn the_load_is_parked_when_unlinked_and_mid_gap_when_linked() {
    let unlinked = plant(Setup { linked: false, ..Setup::default() });
    assert_eq!(unlinked.truth(&Inputs::default()).axes[1].position_m, 0.5);
    let linked = plant(Setup { linked: true, ..Setup::default() });
    // One rounding of half a metre.
    assert!(linked.truth(&Inputs::default()).linkage_distance_m.abs() < 1e-15);
}

#[test]
fn the_start_stays_at_rest() {
    for linked in [false, true] {
        let mut plant = plant(Setup { linked, ..Setup::default() });
        let start = *plant.state();
        run(&mut plant, Inputs::default(), 1000);
        assert_eq!(*plant.state(), start);
    }
}

#[test]
fn a_setup_outside_the_rig_is_refused_with_its_range() {
    let rig = RigParameters::baseline();
    for carriage_position_m in [-1e-9, 0.500001, f64::NAN, f64::INFINITY] {
        let error =
            Plant::new(&rig, &Setup { carriage_position_m, ..Setup::default() }).expect_err("refused");
        assert!(matches!(error, SetupError::CarriagePosition { .. }));
        assert!(error.to_string().contains("allowed are 0 to 0.5 m"), "{error}");
    }
    for added_mass_kg in [-0.1, 20.1, f64::NAN] {
        let error = Plant::new(&rig, &Setup { added_mass_kg, ..Setup::default() }).expect_err("refused");
        assert!(error.to_string().contains("allowed are 0 to 20 kg"), "{error}");
        assert!(plant(Setup::default()).set_added_mass_kg(added_mass_kg).is_err());
    }
}

#[test]
fn a_state_survives_json_and_a_bad_one_is_refused() {
    let rig = RigParameters::baseline();
    let mut plant = plant(Setup { linked: true, ..Setup::default() });
    run(&mut plant, valve(0.4, 0.3), 150);
    let json = serde_json::to_string(plant.state()).expect("a state is plain numbers");
    let state: State = serde_json::from_str(&json).expect("its own text");
    assert_eq!(state, *plant.state());
    let mut again = Plant::in_state(&rig, &state).expect("a state of its own");
    run(&mut again, valve(0.4, 0.3), 50);
    run(&mut plant, valve(0.4, 0.3), 50);
    assert_eq!(again.state(), plant.state());

    let mut bad = state;
    bad.axes[1].spool = f64::NAN;
    let error = Plant::in_state(&rig, &bad).expect_err("refused");
    assert_eq!(error.to_string(), "state: load spool = NaN: allowed are -1 to 1");
}

// Ends of the stroke.

#[test]
fn at_an_end_the_piston_stops_dead_and_stays_while_pressed() {
    let mut plant = plant(Setup::default());
    run(&mut plant, valve(1.0, 0.0), 1500);
    let drive = *plant.state().axis(Axis::Drive);
    assert_eq!((drive.extension_m, drive.rod_velocity_m_per_s), (0.5, 0.0));
    let truth = plant.truth(&valve(1.0, 0.0)).axes[0];
    assert!(truth.pneumatic_force_n > 500.0, "it is pressed: {} N", truth.pneumatic_force_n);
    assert_eq!(truth.holding_force_n, -truth.pneumatic_force_n);
}

#[test]
fn a_piston_leaves_its_end_as_from_any_standstill() {
    let mut plant = plant(Setup { carriage_position_m: 0.5, ..Setup::default() });
    run(&mut plant, hand(1e4, 0.0), 10);
    assert_eq!(plant.state().axes[0].extension_m, 0.5);
    run(&mut plant, hand(-34.9, 0.0), 10);
    assert_eq!(plant.state().axes[0].extension_m, 0.5, "held by static friction");
    run(&mut plant, hand(-35.1, 0.0), 1);
    assert!(plant.state().axes[0].extension_m < 0.5, "breaks away");
}

#[test]
fn no_impulse_of_an_end_reaches_the_force_sensor() {
    let mut plant = plant(Setup::default());
    let inputs = valve(1.0, 0.0);
    let (mut hit, mut speed) = (false, 0.0_f64);
    for _ in 0..1500 {
        let truth = plant.truth(&inputs).axes[0];
        // 3.5 kg times what the air and friction can do to 5 kg: below 7 bar on the full area.
        assert!(truth.sensor_force_n.abs() < 3.5 / 5.0 * 1500.0, "{}", truth.sensor_force_n);
        if truth.position_m == 0.5 && !hit {
            hit = true;
            assert!(speed > 0.2, "it came at speed: {speed} m/s");
            assert_eq!(truth.sensor_force_n, 0.0);
        }
        speed = truth.rod_velocity_m_per_s;
        plant.step(&inputs);
    }
    assert!(hit);
}

// Linkage.

#[test]
fn linking_is_refused_outside_the_gap() {
    let mut plant = plant(Setup::default());
    let refused = plant.link().expect_err("the load is parked 0.4 m away");
    // Positions of half a metre: one rounding.
    assert!((refused.distance_m - 0.4).abs() < 1e-15);
    assert!(!plant.linked());
    let LinkRefused { half_gap_m, .. } = refused;
    assert_eq!(half_gap_m, 1e-4);
    assert!(refused.to_string().contains("0.0001 m to either side"), "{refused}");
}

#[test]
fn linking_is_possible_within_the_gap_and_unlinking_always() {
    let rig = RigParameters::baseline();
    for (offset_m, possible) in [(0.99e-4, true), (-0.99e-4, true), (1.01e-4, false), (-1.01e-4, false)] {
        let mut state = *plant(Setup { linked: true, ..Setup::default() }).state();
        state.linked = false;
        state.axes[1].extension_m += offset_m;
        let mut plant = Plant::in_state(&rig, &state).expect("good");
        assert_eq!(plant.link().is_ok(), possible, "{offset_m}");
        assert_eq!(plant.linked(), possible);
        plant.unlink();
        assert!(!plant.linked());
    }
}

#[test]
fn unlinked_rods_pass_each_other() {
    let mut plant = plant(Setup { carriage_position_m: 0.4, ..Setup::default() });
    run(&mut plant, valve(0.0, 1.0), 1000);
    let truth = plant.truth(&Inputs::default());
    assert!(truth.linkage_distance_m < -0.1, "{}", truth.linkage_distance_m);
    assert_eq!(truth.contact_force_n, 0.0);
    assert_eq!(truth.axes[0].position_m, 0.4);
}

#[test]
fn through_the_gap_nothing_is_felt_and_then_the_contact_pushes() {
    let mut plant = plant(Setup { carriage_position_m: 0.25, linked: true, added_mass_kg: 0.0 });
    let push = hand(0.0, -60.0);
    let (mut free, mut touching) = (0, 0);
    for _ in 0..100 {
        let truth = plant.truth(&push);
        if truth.linkage_distance_m.abs() <= 1e-4 {
            assert_eq!(truth.contact_force_n, 0.0);
            free += 1;
        } else {
            assert!(truth.contact_force_n * truth.linkage_distance_m >= 0.0, "never pulls");
            touching += usize::from(truth.contact_force_n != 0.0);
        }
        plant.step(&push);
    }
    assert!(free > 3 && touching > 50, "{free} ms free, {touching} ms touching");
}

#[test]
fn at_rest_the_forces_of_hand_contact_and_friction_balance() {
    // The load's air pushes on the carriage with some 100 N; everything comes to rest.
    let mut plant = plant(Setup { carriage_position_m: 0.25, linked: true, added_mass_kg: 0.0 });
    run(&mut plant, valve(0.0, 0.1), 150);
    run(&mut plant, valve(0.0, 0.0), 3000);
    let truth = plant.truth(&Inputs::default());
    let [drive, load] = truth.axes;
    assert!(load.sensor_force_n > 20.0, "{} N", load.sensor_force_n);
    assert_eq!(load.sensor_force_n, -truth.contact_force_n);
    if drive.rod_velocity_m_per_s == 0.0 {
        assert_eq!(drive.sensor_force_n, -truth.contact_force_n, "a resting carriage passes the force on");
    }
    for axis in truth.axes {
        let sum = axis.pneumatic_force_n + axis.hand_force_n + axis.contact_force_n;
        assert!(sum.abs() < 36.0, "friction bears the rest: {sum} N");
    }
}

// Emergency stop.

#[test]
fn the_emergency_stop_discharges_the_supply_and_shuts_the_check_valves() {
    let mut plant = plant(Setup::default());
    plant.trip_emergency_stop();
    assert!(plant.emergency_stop() && !plant.check_valves_shut());
    // 0.05 s ln((7 - 1.01325) / (2.5 - 1.01325)) = 69.65 ms.
    run(&mut plant, Inputs::default(), 69);
    assert!(!plant.check_valves_shut());
    plant.step(&Inputs::default());
    assert!(plant.check_valves_shut());
    let form = 101_325.0 + (7e5 - 101_325.0) * (-0.070_f64 / 0.05).exp();
    // 700 products of a factor near 1.
    assert!((plant.supply_pressure_pa() - form).abs() < 1e-12 * 700.0 * form);
}

#[test]
fn shut_check_valves_hold_the_air_and_stop_the_motion() {
    let mut plant = plant(Setup::default());
    run(&mut plant, valve(1.0, 0.0), 250);
    let (x_trip, speed) = {
        let drive = plant.state().axes[0];
        (drive.extension_m, drive.rod_velocity_m_per_s)
    };
    assert!(speed > 0.2, "{speed} m/s");
    plant.trip_emergency_stop();
    run(&mut plant, valve(1.0, 0.0), 71);
    assert!(plant.check_valves_shut());
    let trapped = plant.state().axes;
    let way = trapped[0].extension_m - x_trip;
    assert!((0.03..0.06).contains(&way), "up to 6 cm at full speed until the valves shut: {way} m");
    for _ in 0..2000 {
        plant.step(&valve(1.0, -1.0));
        for (now, then) in plant.state().axes.iter().zip(&trapped) {
            assert_eq!((now.stored_air_a_j, now.stored_air_b_j), (then.stored_air_a_j, then.stored_air_b_j));
            assert_eq!((now.flow_a_m3_per_s, now.flow_b_m3_per_s), (0.0, 0.0));
        }
    }
    let drive = plant.state().axes[0];
    // With b = 1.1 N/(mm/s) the air spring is overdamped: the last micrometres are crept, not slipped.
    assert!(drive.rod_velocity_m_per_s.abs() < 1e-5, "{} m/s", drive.rod_velocity_m_per_s);
}

#[test]
fn commands_count_as_zero_from_the_trip_until_the_release() {
    let mut plant = plant(Setup::default());
    run(&mut plant, valve(0.8, 0.0), 20);
    plant.trip_emergency_stop();
    let spool = plant.state().axes[0].spool;
    plant.step(&valve(0.8, 0.0));
    // The spool falls with its own lag of 1.6 ms.
    assert!((plant.state().axes[0].spool - spool * (-1.0_f64 / 1.6).exp()).abs() < 1e-12);
    run(&mut plant, valve(0.8, 0.0), 100);
    assert!(plant.state().axes[0].spool < 1e-12);
    plant.release_emergency_stop();
    run(&mut plant, valve(0.8, 0.0), 20);
    assert!(plant.state().axes[0].spool > 0.79);
}

#[test]
fn after_the_release_the_supply_recovers_and_the_flow_starts_at_zero() {
    let mut plant = plant(Setup::default());
    plant.trip_emergency_stop();
    run(&mut plant, Inputs::default(), 1000);
    plant.release_emergency_stop();
    let released_at = plant.supply_pressure_pa();
    let mut opened_ms = None;
    for k in 1..=300 {
        plant.step(&valve(0.5, 0.0));
        let flow = plant.state().axes[0].flow_a_m3_per_s;
        match (plant.check_valves_shut(), opened_ms) {
            (true, _) => assert_eq!(flow, 0.0, "{k} ms"),
            (false, None) => {
                opened_ms = Some(k);
                // Less than 1 ms of a lag of 8 ms towards at most the sonic flow of 7 bar, 0.009 m^3/s.
                assert!(flow.abs() < 0.009 / 8.0, "{flow}");
            }
            _ => (),
        }
    }
    let form = 7e5 + (released_at - 7e5) * (-1.0_f64).exp();
    assert!((plant.supply_pressure_pa() - form).abs() < 1e-6);
    // 0.3 s ln((7 - 1.01325) / (7 - 2.5)) = 85.6 ms.
    assert_eq!(opened_ms, Some(86));
}

// Weights.

#[test]
fn weights_make_the_carriage_slower_and_show_in_its_force_sensor() {
    let speed = |kg: f64| {
        let mut plant = plant(Setup { carriage_position_m: 0.25, ..Setup::default() });
        plant.set_added_mass_kg(kg).expect("within the limit");
        run(&mut plant, hand(235.0, 0.0), 1);
        plant.state().axes[0].rod_velocity_m_per_s
    };
    // (235 - 26) N for 1 ms on 5 and 25 kg: 0.0418 and 0.00836 m/s less viscous friction of 10 % and 2 %.
    assert!((speed(0.0) / speed(20.0) - 5.0).abs() < 0.5, "{} {}", speed(0.0), speed(20.0));

    let mut loaded = plant(Setup { added_mass_kg: 20.0, carriage_position_m: 0.25, ..Setup::default() });
    let push = valve(0.5, 0.0);
    run(&mut loaded, push, 60);
    let truth = loaded.truth(&push).axes[0];
    let behind = 23.5 * truth.rod_acceleration_m_per_s2;
    assert!((truth.sensor_force_n - behind).abs() < 1e-9 && behind.abs() > 1.0, "{behind}");
}
