//! A batch moves each of its rigs to the bit as the rig moves by itself, in whatever registers and beside whatever neighbours.

use crate::scenario::{self, Kind, Scenario};
use plant::faults::{AxisFaults, Faults, SupplyFault, ValveFault};
use plant::{Batch, Inputs, Plant, Registers, RigParameters, Sensors, Setup, State};

/// Every number of a state to the bit, signs of zero included.
fn bits(state: &State) -> Vec<u64> {
    let axis = |i: usize| {
        let axis = &state.axes[i];
        let air = [axis.stored_air_a_j, axis.stored_air_b_j, axis.flow_a_m3_per_s, axis.flow_b_m3_per_s];
        [axis.extension_m, axis.rod_velocity_m_per_s, axis.spool].into_iter().chain(air)
    };
    axis(0).chain(axis(1)).chain([state.supply_pressure_pa, state.added_mass_kg]).map(f64::to_bits).collect()
}

fn assert_alike(batch: &Batch, alone: &[Plant], when: &str) {
    for (i, (ours, theirs)) in batch.plants().iter().zip(alone).enumerate() {
        assert_eq!(bits(ours.state()), bits(theirs.state()), "rig {i}, {when}");
    }
}

fn all_registers() -> impl Iterator<Item = Registers> {
    Registers::ALL.into_iter().filter(|registers| registers.are_there())
}

/// Rigs that differ in every law of the baseline.
fn rigs() -> Vec<RigParameters> {
    let baseline = RigParameters::baseline();
    let with = |changes: &[(&str, f64)]| {
        let numbers: Vec<[f64; 1]> = changes.iter().map(|(_, number)| [*number]).collect();
        let changes = changes.iter().zip(&numbers).map(|((path, _), numbers)| (*path, numbers.as_slice()));
        baseline.with_all(changes).expect("a rig within its ranges")
    };
    vec![
        with(&[("friction.viscous_n_per_mm_per_s", 0.3), ("cylinder.dead_volume_cm3", 35.0)]),
        with(&[("supply.pressure_bar", 6.0), ("valve.spool_time_constant_ms", 2.5), ("mass.load_kg", 2.0)]),
        with(&[
            ("linkage.gap_mm", 0.4),
            ("linkage.stiffness_n_per_m", 1e6),
            ("valve.flow_lag_time_constant_ms", 5.0),
        ]),
        baseline,
    ]
}

/// Each scenario on each rig: its start, and what it is.
fn starts<'s>(rigs: &[RigParameters], scenarios: &'s [Scenario]) -> (Vec<Plant>, Vec<&'s Scenario>) {
    scenarios
        .iter()
        .flat_map(|scenario| rigs.iter().map(move |rig| (rig, scenario)))
        .map(|(rig, scenario)| {
            let start = &scenario.states[0];
            let setup = Setup {
                carriage_position_m: start.axes[0].extension_m,
                linked: start.linked,
                added_mass_kg: start.added_mass_kg,
            };
            (Plant::new(rig, &setup).expect("the scenario's start"), scenario)
        })
        .unzip()
}

#[test]
fn every_scenario_on_every_rig_has_the_bits_of_a_rig_alone() {
    let rigs = rigs();
    let scenarios = scenario::all(&RigParameters::baseline());
    for registers in all_registers() {
        let (mut alone, scenarios) = starts(&rigs, &scenarios);
        // Mixed, so that neighbours are linked and not, heavy and light, stopped and not; and not a multiple of eight.
        let order: Vec<usize> = (0..alone.len() - 1).map(|i| i * 7 % (alone.len() - 1)).collect();
        alone = order.iter().map(|i| alone[*i].clone()).collect();
        let scenarios: Vec<&Scenario> = order.iter().map(|i| scenarios[*i]).collect();
        assert_eq!(alone.len(), 19);
        let mut batch = Batch::new(alone.clone()).with_registers(registers);
        for k in 0..3000 {
            for (i, scenario) in scenarios.iter().enumerate() {
                if scenario.states[k].emergency_stop == alone[i].emergency_stop() {
                    continue;
                }
                for plant in [&mut alone[i], batch.plant_mut(i)] {
                    match k {
                        1200 => plant.trip_emergency_stop(),
                        _ => plant.release_emergency_stop(),
                    }
                }
            }
            let inputs: Vec<Inputs> = scenarios.iter().map(|scenario| scenario.inputs[k]).collect();
            alone.iter_mut().zip(&inputs).for_each(|(plant, inputs)| plant.step(inputs));
            batch.step(&inputs);
            assert_alike(&batch, &alone, &format!("{registers:?}, {k} ms"));
        }
    }
}

#[test]
fn a_batch_follows_what_was_recorded() {
    let rig = RigParameters::baseline();
    let kind = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    let scenario = scenario::record(&rig, kind, 2000);
    for count in [1, 2, 8, 13] {
        let plants = (0..count).map(|i| Plant::in_state(&rig, &scenario.states[i * 50]).expect("recorded"));
        let mut batch = Batch::new(plants.collect());
        for k in 0..1000 {
            let inputs: Vec<Inputs> = (0..count).map(|i| scenario.inputs[i * 50 + k]).collect();
            batch.step(&inputs);
        }
        for (i, plant) in batch.plants().iter().enumerate() {
            assert_eq!(bits(plant.state()), bits(&scenario.states[i * 50 + 1000]), "{i} of {count}");
        }
    }
}

#[test]
fn a_rig_does_not_feel_its_neighbours() {
    let rig = RigParameters::baseline();
    let scenario = scenario::record(&rig, Kind { full_speed: true, ..Kind::FREE }, 1500);
    let watched = Plant::in_state(&rig, &scenario.states[0]).expect("recorded");
    // Beside a rig that rests and others that nothing but numbers can be.
    let mut broken = *watched.state();
    broken.axes[0].rod_velocity_m_per_s = 900.0;
    broken.axes[1].stored_air_a_j = 1e4;
    let broken = Plant::in_state(&rig, &broken).expect("odd, but allowed");
    let resting = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("good");
    for place in 0..8 {
        let mut plants = vec![broken.clone(); 8];
        plants[(place + 3) % 8] = resting.clone();
        plants[place] = watched.clone();
        let mut batch = Batch::new(plants);
        scenario.inputs[..1000].iter().for_each(|inputs| batch.step_alike(inputs));
        assert_eq!(bits(batch.plants()[place].state()), bits(&scenario.states[1000]), "in lane {place}");
    }
}

/// Rigs of which some cannot run in lanes, or not always.
fn odd_rigs() -> Vec<Plant> {
    let rig = RigParameters::baseline();
    let setup = Setup { linked: true, carriage_position_m: 0.2, added_mass_kg: 3.0 };
    let plant = Plant::new(&rig, &setup).expect("good");
    let inclined = rig.with_effect("inclination", "drive", &[("force_n", 20.0)]).expect("allowed");
    let mut plants = vec![plant.clone(); 11];
    plants[2] = Plant::new(&inclined, &setup).expect("good");
    plants[5] = plant.clone().with_substeps(5);
    plants[9] = plant.with_substeps(20);
    plants
}

/// What somebody does to the rigs, some at a time.
fn interfere(k: usize, plant: &mut Plant, at: usize) {
    let axis = AxisFaults { leakage_m3_per_s: [1e-4, 0.0], friction_factor: 1.5, ..AxisFaults::default() };
    let slow = AxisFaults {
        valve: ValveFault { lag_s: 0.02, offset: 0.05, limit: 0.8, ..ValveFault::default() },
        added_mass_kg: 1.5,
        ..AxisFaults::default()
    };
    let supply = Some(SupplyFault { pressure_pa: 5.5e5, time_constant_s: 0.1 });
    let state = *plant.state();
    match (k, at) {
        (100, 3) => plant.set_faults(&Faults { axes: [axis, AxisFaults::default()], supply }),
        (150, 4) => plant.set_faults(&Faults { axes: [AxisFaults::default(), slow], supply: None }),
        (300, 3 | 4) => plant.set_faults(&Faults::default()),
        (200, 6) => plant.set_added_mass_kg(12.0).expect("allowed"),
        (250, 7) => plant.unlink(),
        (350, 1) => plant.trip_emergency_stop(),
        (450, 1) => plant.release_emergency_stop(),
        (400, 8) => {
            let mut state = state;
            state.axes[0].rod_velocity_m_per_s = -0.2;
            state.axes[1].stored_air_b_j *= 1.2;
            plant.go_on_in(&state).expect("a state of the rig");
        }
        _ => (),
    }
}

#[test]
fn effects_faults_and_changes_in_the_middle_are_those_of_a_rig_alone() {
    for registers in all_registers() {
        let mut alone = odd_rigs();
        let mut batch = Batch::new(alone.clone()).with_registers(registers);
        for k in 0..800 {
            let inputs: Vec<Inputs> = (0..alone.len())
                .map(|i| Inputs {
                    valve: [((k + 40 * i) as f64 * 0.013).sin(), 0.5 * ((k + 9 * i) as f64 * 0.031).cos()],
                    hand_force_carriage_n: if k / 100 % 3 == 1 { 60.0 } else { 0.0 },
                    hand_force_load_n: if i == 0 { -30.0 } else { 0.0 },
                })
                .collect();
            for (i, alone) in alone.iter_mut().enumerate() {
                interfere(k, alone, i);
                if k % 50 == 0 {
                    interfere(k, batch.plant_mut(i), i);
                }
                alone.step(&inputs[i]);
            }
            batch.step(&inputs);
            assert_alike(&batch, &alone, &format!("{registers:?}, {k} ms"));
        }
        let [at_rest, last] = [Inputs::default(), Inputs { valve: [0.1, 0.2], ..Inputs::default() }];
        for (ours, theirs) in batch.plants().iter().zip(&alone) {
            assert_eq!(ours.truth(&at_rest).values(), theirs.truth(&at_rest).values());
            assert_eq!(ours.terms(&last).values(), theirs.terms(&last).values());
        }
        for (ours, theirs) in batch.into_plants().iter_mut().zip(&mut alone) {
            ours.step(&last);
            theirs.step(&last);
            assert_eq!(bits(ours.state()), bits(theirs.state()), "a plant goes on by itself");
        }
    }
}

#[test]
fn sensors_read_a_batch_as_they_read_a_plant() {
    let rig = RigParameters::baseline();
    let plant = Plant::new(&rig, &Setup::default()).expect("good");
    let (mut alone, mut batch) = (plant.clone(), Batch::new(vec![plant; 4]));
    let [mut ours, mut theirs] = [Sensors::new(&rig, 5), Sensors::new(&rig, 5)];
    let inputs = Inputs { valve: [0.4, -0.3], ..Inputs::default() };
    for _ in 0..300 {
        let [ours, theirs] = [ours.sample(&batch.plants()[3], &inputs), theirs.sample(&alone, &inputs)];
        assert_eq!(ours.map(|axis| axis.force.value), theirs.map(|axis| axis.force.value));
        batch.step_alike(&inputs);
        alone.step(&inputs);
    }
}

#[test]
#[should_panic(expected = "inputs for each plant")]
fn inputs_are_wanted_for_each_plant() {
    let plant = Plant::new(&RigParameters::baseline(), &Setup::default()).expect("good");
    Batch::new(vec![plant; 3]).step(&[Inputs::default(); 2]);
}
