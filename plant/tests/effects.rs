//! Effects in a moving plant: each alone, many at once, at their extremes; and none of them where they are neutral.

use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Sheet};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup};

/// Periods of a run that moves both axes from end to end, turns, holds, hits the ends and is linked for a while.
const PERIODS: u32 = 2500;

/// The lowest and the highest of a key: what a file may hold.
fn extremes(key: &EffectKey) -> [f64; 2] {
    [key.min, key.max]
}

fn inputs(k: u32) -> Inputs {
    // Triangles of two periods, a square wave between, and holds.
    let triangle = |period: u32| f64::from((k % period).abs_diff(period / 2)) / f64::from(period / 4) - 1.0;
    let drive = if k < 1500 { triangle(900) } else { f64::from(1 - 2 * (k as i32 / 120 % 2)) };
    let load = if k % 700 < 400 { triangle(330) } else { 0.0 };
    Inputs {
        valve: [plant::quantise_valve(drive), plant::quantise_valve(load)],
        hand_force_carriage_n: if k % 500 < 50 { 80.0 } else { 0.0 },
        ..Inputs::default()
    }
}

/// Runs a rig and returns the first instant at which it is no rig any more.
fn survives(rig: &RigParameters, linked: bool) -> Result<Plant, String> {
    let setup = Setup { carriage_position_m: 0.3, linked, added_mass_kg: 0.0 };
    let mut plant = Plant::new(rig, &setup).expect("a good setup");
    let mut sensors = Sensors::new(rig, 5);
    for k in 0..PERIODS {
        match k {
            1900 => plant.trip_emergency_stop(),
            2100 => plant.release_emergency_stop(),
            _ => (),
        }
        let inputs = inputs(k);
        let readings = sensors.sample(&plant, &inputs);
        plant.step(&inputs);
        let truth = plant.truth(&inputs);
        let values = truth.values();
        let all_finite = plant.state().is_finite()
            && values.iter().chain(plant.terms(&inputs).values()).all(|value| value.is_finite())
            && readings.iter().all(|axis| axis.position.value.is_finite() && axis.force.value.is_finite());
        if !all_finite {
            return Err(format!("cycle {k}: not finite: {truth:?}"));
        }
        for axis in &truth.axes {
            let pressures = [axis.pressure_a_pa, axis.pressure_b_pa];
            // Compression by the other axis and at the ends goes beyond the supply; ten times it would be no air.
            if pressures.iter().any(|pa| !(1e4..7e6).contains(pa)) {
                return Err(format!("cycle {k}: pressures {pressures:?} Pa"));
            }
            if axis.rod_velocity_m_per_s.abs() > 6.0 {
                return Err(format!("cycle {k}: {} m/s", axis.rod_velocity_m_per_s));
            }
        }
    }
    Ok(plant)
}

/// The baseline with an effect at one place, its amplitude at one end of what a file may hold, the rest as drawn or default.
fn with(rig: &RigParameters, sheet: &Sheet, place: &str, end: usize, shapes: usize) -> RigParameters {
    let numbers: Vec<(&str, f64)> = sheet
        .keys
        .iter()
        .enumerate()
        .map(|(i, key)| (key.name, if i == 0 { extremes(key)[end] } else { extremes(key)[shapes] }))
        .collect();
    rig.with_effect(sheet.name, place, &numbers).expect("in range")
}

#[test]
fn each_effect_alone_at_its_extremes_leaves_a_rig() {
    let baseline = RigParameters::baseline();
    for sheet in SHEETS {
        for place in sheet.place.names() {
            // Without a second key there are no shapes to vary.
            let ends = [(0, 0), (1, 0), (0, 1), (1, 1)];
            for (end, shapes) in ends.into_iter().take(if sheet.keys.len() == 1 { 2 } else { 4 }) {
                let rig = with(&baseline, sheet, &place, end, shapes);
                for linked in [false, true] {
                    let ended = survives(&rig, linked);
                    assert!(
                        ended.is_ok(),
                        "{} {place} {end}{shapes} linked={linked}: {}",
                        sheet.name,
                        ended.unwrap_err()
                    );
                }
            }
        }
    }
}

#[test]
fn all_effects_at_once_at_their_extremes_leave_a_rig() {
    for (end, shapes) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let mut rig = RigParameters::baseline();
        for sheet in SHEETS {
            for place in sheet.place.names() {
                rig = with(&rig, sheet, &place, end, shapes);
            }
        }
        for linked in [false, true] {
            let ended = survives(&rig, linked);
            assert!(ended.is_ok(), "{end}{shapes} linked={linked}: {}", ended.unwrap_err());
        }
    }
}

#[test]
fn a_neutral_effect_is_the_baseline() {
    // Neutral terms are 0; what differs is the order of some additions, a few units in the last place of each state, which
    // breaking away may spread to one part of 1e9 within a second.
    let baseline = RigParameters::baseline();
    for sheet in SHEETS {
        let Some(neutral) = sheet.keys[0].neutral.filter(|value| value.is_finite()) else { continue };
        let place = &sheet.place.names()[0];
        let Ok(rig) = baseline.with_effect(sheet.name, place, &[(sheet.keys[0].name, neutral)]) else {
            continue;
        };
        let setup = Setup { carriage_position_m: 0.3, linked: true, added_mass_kg: 0.0 };
        let mut plants = [&baseline, &rig].map(|rig| Plant::new(rig, &setup).expect("good"));
        for k in 0..1000 {
            let truths = plants.each_ref().map(|plant| plant.truth(&inputs(k)));
            for (axis, other) in truths[0].axes.iter().zip(&truths[1].axes) {
                let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-9 * scale;
                assert!(
                    close(axis.position_m, other.position_m, 0.5),
                    "{} cycle {k}: {axis:?} {other:?}",
                    sheet.name
                );
                assert!(close(axis.pressure_a_pa, other.pressure_a_pa, 7e5), "{} cycle {k}", sheet.name);
            }
            plants.iter_mut().for_each(|plant| plant.step(&inputs(k)));
        }
    }
}

#[test]
fn going_on_in_the_state_that_it_is_in_changes_nothing() {
    for sheet in SHEETS {
        let place = sheet.place.places()[0].to_string();
        let key = &sheet.keys[0];
        let rig =
            RigParameters::baseline().with_effect(sheet.name, &place, &[(key.name, key.drawn[1])]).unwrap();
        let mut straight = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).unwrap();
        let mut again = straight.clone();
        for k in 0..700 {
            if k % 100 == 0 {
                let state = *again.state();
                again.go_on_in(&state).unwrap();
            }
            straight.step(&inputs(k));
            again.step(&inputs(k));
            assert_eq!(straight.state(), again.state(), "{} at {k} ms", sheet.name);
        }
        let shown = |plant: &Plant| plant.noise_free_readings(&plant.truth(&inputs(700)));
        assert_eq!(shown(&straight), shown(&again), "{}", sheet.name);
    }
}

#[test]
fn sensors_that_are_late_see_no_jump_when_a_plant_goes_on_in_another_state() {
    let late = [("time-skew", "delay_ms", 4.0), ("pressure-sensor-lag", "time_constant_ms", 8.0)];
    for (effect, key, value) in late {
        let rig = RigParameters::baseline().with_effect(effect, "drive.a", &[(key, value)]).unwrap();
        let mut plant = Plant::new(&rig, &Setup::default()).unwrap();
        let mut state = *plant.state();
        state.axes[0].stored_air_a_j *= 1.5;
        plant.go_on_in(&state).unwrap();
        for _ in 0..10 {
            let truth = plant.truth(&Inputs::default());
            let off_pa = plant.noise_free_readings(&truth)[0][2] - truth.axes[0].pressure_a_pa;
            // The chamber itself moves on, but by little; the jump was a bar and a half.
            assert!(off_pa.abs() < 2e4, "{effect}: {off_pa} Pa");
            plant.step(&Inputs::default());
        }
    }
}

#[test]
fn a_chamber_that_goes_on_at_another_pressure_keeps_its_temperature() {
    let rig = RigParameters::baseline();
    let rig = rig.with_effect("heat-exchange", "drive", &[("coefficient_w_per_m2_k", 10.0)]).unwrap();
    let mut plant = Plant::new(&rig, &Setup::default()).unwrap();
    let mut state = *plant.state();
    state.axes[0].stored_air_a_j *= 1.5;
    state.axes[0].stored_air_b_j *= 1.5;
    plant.go_on_in(&state).unwrap();
    // Air at the walls' temperature in a shut chamber has no heat to exchange.
    plant.step(&Inputs::default());
    let terms = plant.terms(&Inputs::default());
    assert!(terms.values().iter().all(|watt| watt.abs() < 1e-6), "{terms:?}");
}
