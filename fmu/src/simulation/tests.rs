//! The FMU's modes, time and values, without its C interface.

use super::*;

fn baseline() -> Simulation {
    Simulation::new(RigParameters::baseline()).unwrap()
}

fn reference(simulation: &Simulation, name: &str) -> u32 {
    let place = simulation.variables.iter().position(|instance| instance.name == name);
    place.unwrap_or_else(|| panic!("no variable {name}")) as u32
}

fn real(simulation: &mut Simulation, name: &str) -> f64 {
    let (reference, mut value) = (reference(simulation, name), [0.0]);
    simulation.reals(&[reference], &mut value).unwrap();
    value[0]
}

fn set(simulation: &mut Simulation, name: &str, value: f64) -> Result<(), Refusal> {
    let reference = reference(simulation, name);
    simulation.set_reals(&[reference], &[value])
}

fn started() -> Simulation {
    let mut simulation = baseline();
    simulation.enter_initialisation().unwrap();
    simulation.exit_initialisation().unwrap();
    simulation
}

#[test]
fn a_command_acts_one_millisecond_after_the_step_in_which_it_was_set() {
    let mut simulation = started();
    let mut plant = Plant::new(&RigParameters::baseline(), &Setup::default()).unwrap();
    set(&mut simulation, "drive_valve", 0.4).unwrap();
    for (cycle, valve) in [0.0, 0.4, 0.4, 0.4].into_iter().enumerate() {
        simulation.step(cycle as f64 * 1e-3, 1e-3).unwrap();
        plant.step(&Inputs { valve: [plant::quantise_valve(valve), 0.0], ..Inputs::default() });
        let expected = plant.truth(&Inputs::default()).axes[0].spool;
        assert_eq!(real(&mut simulation, "drive_spool"), expected, "cycle {cycle}");
    }
    assert!(real(&mut simulation, "drive_spool") > 0.2);
    assert_eq!(real(&mut simulation, "drive_valve_acting"), plant::quantise_valve(0.4));
}

#[test]
fn one_long_step_is_many_short_ones() {
    let (mut long, mut short) = (started(), started());
    for simulation in [&mut long, &mut short] {
        set(simulation, "load_valve", -0.7).unwrap();
    }
    long.step(0.0, 0.25).unwrap();
    for cycle in 0..250 {
        short.step(f64::from(cycle) * 1e-3, 1e-3).unwrap();
    }
    for name in ["load_position_m", "load_pressure_a_Pa", "load_position_measured_m"] {
        assert_eq!(real(&mut long, name), real(&mut short, name), "{name}");
    }
}

#[test]
fn a_state_that_was_kept_can_be_gone_back_to() {
    let mut simulation = started();
    set(&mut simulation, "drive_valve", 0.5).unwrap();
    simulation.step(0.0, 0.1).unwrap();
    let kept = simulation.clone();
    let run_on = |mut simulation: Simulation| {
        simulation.step(0.1, 0.1).unwrap();
        ["drive_position_m", "drive_force_measured_N"].map(|name| real(&mut simulation, name))
    };
    assert_eq!(run_on(simulation), run_on(kept));
}

#[test]
fn time_that_does_not_follow_and_steps_that_are_no_milliseconds_are_refused() {
    let mut simulation = started();
    for (at_s, step_s) in [
        (0.0, 0.0005),
        (0.0, 0.0),
        (0.0, -0.001),
        (0.0, f64::NAN),
        (0.0, f64::INFINITY),
        (0.001, 0.001),
        (f64::NAN, 0.001),
    ] {
        let refused = simulation.step(at_s, step_s);
        assert!(matches!(refused, Err(Refusal::Time(_))), "{at_s} {step_s}: {refused:?}");
    }
    simulation.step(0.0, 0.001).unwrap();
    assert_eq!(simulation.time_s(), 0.001);
}

#[test]
fn parameters_are_set_together_and_only_before_the_start() {
    let mut simulation = baseline();
    // Rising from one to the next, as long as they are looked at together alone: at first the second is above the third.
    set(&mut simulation, "valve.opening[2]", 0.3).unwrap();
    set(&mut simulation, "valve.opening[3]", 0.4).unwrap();
    set(&mut simulation, "supply.pressure_bar", 6.0).unwrap();
    simulation.enter_initialisation().unwrap();
    assert_eq!(real(&mut simulation, "supply_pressure_Pa"), 6e5);
    set(&mut simulation, "supply.pressure_bar", 5.5).unwrap();
    assert_eq!(real(&mut simulation, "supply_pressure_Pa"), 5.5e5, "the start follows what is set");
    simulation.exit_initialisation().unwrap();
    let refused = set(&mut simulation, "supply.pressure_bar", 7.0).unwrap_err();
    assert!(refused.to_string().contains("after the initialisation"), "{refused}");
    simulation.reset().unwrap();
    assert_eq!(real(&mut simulation, "supply.pressure_bar"), 7.0);
}

#[test]
fn inconsistent_parameters_are_refused_when_the_plant_is_set_up() {
    let mut simulation = baseline();
    set(&mut simulation, "supply.check_valve_pressure_bar", 6.0).unwrap();
    set(&mut simulation, "supply.pressure_bar", 5.0).unwrap();
    simulation.enter_initialisation().unwrap();
    let refused = simulation.exit_initialisation().unwrap_err();
    assert!(matches!(refused, Refusal::Parameters(_)), "{refused}");
    assert!(refused.to_string().contains("check_valve_pressure_bar"), "{refused}");
}

#[test]
fn values_out_of_range_outputs_and_strangers_cannot_be_set() {
    let mut simulation = started();
    for value in [1.5, f64::NAN, f64::NEG_INFINITY] {
        let refused = set(&mut simulation, "drive_valve", value).unwrap_err();
        assert!(refused.to_string().contains("allowed are -1 to 1"), "{refused}");
    }
    assert!(matches!(set(&mut simulation, "drive_spool", 0.0), Err(Refusal::NotSettable(..))));
    assert!(matches!(simulation.set_reals(&[u32::MAX], &[0.0]), Err(Refusal::Reference(..))));
    let stop = reference(&simulation, "emergency_stop");
    assert!(matches!(simulation.set_reals(&[stop], &[0.0]), Err(Refusal::Reference(..))));
    // All or none.
    let valves = ["drive_valve", "load_valve"].map(|name| reference(&simulation, name));
    assert!(simulation.set_reals(&valves, &[0.5, 2.0]).is_err());
    assert_eq!(real(&mut simulation, "drive_valve"), 0.0);
}

#[test]
fn rods_that_are_apart_are_not_linked_and_that_is_reported_once() {
    let mut simulation = started();
    let link = reference(&simulation, "link");
    simulation.set_booleans(&[link], &[true]).unwrap();
    assert!(simulation.step(0.0, 1e-3).unwrap().is_some_and(|text| text.contains("0.4")));
    assert_eq!(simulation.step(1e-3, 1e-3).unwrap(), None);
    let (linked, mut value) = (reference(&simulation, "linked"), [true]);
    simulation.booleans(&[linked], &mut value).unwrap();
    assert_eq!(value, [false]);
    simulation.reset().unwrap();
    simulation.set_booleans(&[link], &[true]).unwrap();
    simulation.enter_initialisation().unwrap();
    simulation.booleans(&[linked], &mut value).unwrap();
    assert_eq!(value, [true], "at the start the eye is put there");
}

#[test]
fn calls_in_the_wrong_mode_say_what_comes_before() {
    let mut simulation = baseline();
    assert!(matches!(simulation.step(0.0, 1e-3), Err(Refusal::Mode { .. })));
    assert!(matches!(simulation.exit_initialisation(), Err(Refusal::Mode { .. })));
    let position = reference(&simulation, "drive_position_m");
    assert!(matches!(simulation.reals(&[position], &mut [0.0]), Err(Refusal::Mode { .. })));
    simulation.enter_initialisation().unwrap();
    assert!(matches!(simulation.set_start(1.0), Err(Refusal::Mode { .. })));
    simulation.exit_initialisation().unwrap();
    simulation.terminate().unwrap();
    assert!(matches!(simulation.step(0.0, 1e-3), Err(Refusal::Mode { .. })));
    assert!(real(&mut simulation, "drive_position_m") > 0.0, "values can still be read");
}

#[test]
fn an_emergency_stop_empties_the_supply_and_counts_from_the_start() {
    let mut simulation = started();
    let stop = reference(&simulation, "emergency_stop");
    simulation.set_booleans(&[stop], &[true]).unwrap();
    simulation.step(0.0, 0.07).unwrap();
    // Discharge with 0.05 s: 6 bar e^-1.4 above 1 bar.
    let supply = real(&mut simulation, "supply_pressure_Pa");
    assert!((240_000.0..260_000.0).contains(&supply), "{supply} Pa");
    simulation.set_booleans(&[stop], &[false]).unwrap();
    simulation.step(0.07, 2.0).unwrap();
    assert!(real(&mut simulation, "supply_pressure_Pa") > 650_000.0);
}
