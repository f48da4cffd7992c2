//! What holds for every rig that the parameter table admits, under any inputs.

use plant::parameters::table::{KEYS, Key, Unit, VALVE_POINTS};
use plant::{Inputs, Plant, RigParameters, Setup};
use proptest::prelude::*;

/// A number in the key's range from a share in [0, 1]: ends often, small values as likely as large ones.
fn in_range(key: &Key, share: f64) -> f64 {
    let stretched = ((share - 0.05) / 0.9).clamp(0.0, 1.0);
    let value = if key.min > 0.0 && key.max / key.min > 20.0 {
        (key.min * (key.max / key.min).powf(stretched)).clamp(key.min, key.max)
    } else {
        key.min + stretched * (key.max - key.min)
    };
    if key.unit == Unit::Bits { value.round() } else { value }
}

/// A rig file from shares, with the pairs that must fit together put in order.
fn rig_from(shares: &[f64]) -> RigParameters {
    let mut share = shares.iter().copied().cycle();
    let mut values: Vec<(&Key, Vec<f64>)> = KEYS
        .iter()
        .map(|key| (key, share.by_ref().take(key.count).map(|s| in_range(key, s)).collect()))
        .collect();
    let get = |values: &[(&Key, Vec<f64>)], name: &str| -> f64 {
        values.iter().find(|(key, _)| key.name == name).expect("a key").1[0]
    };
    let pressure = get(&values, "pressure_bar");
    let exhaust = get(&values, "exhaust_pressure_bar");
    let piston = get(&values, "piston_area_mm2");
    let break_away = get(&values, "break_away_force_n");
    let drive = get(&values, "drive_kg");
    for (key, numbers) in &mut values {
        let first = numbers[0];
        match key.name {
            "atmospheric_pressure_bar" => numbers[0] = first.min(exhaust),
            "check_valve_pressure_bar" => {
                numbers[0] = first.clamp(exhaust + 0.01, (pressure - 0.01).min(key.max))
            }
            "rod_side_pressure_bar" => numbers[0] = first.clamp(exhaust, pressure),
            "annulus_area_mm2" => numbers[0] = first.min(piston * 0.99),
            "sliding_force_n" => numbers[0] = first.min(break_away),
            "carriage_kg" => numbers[0] = first.min(drive * 0.9),
            "opening" => {
                // Parts of at least 0.003 from 0 to 1.
                let total: f64 = numbers[1..].iter().map(|part| part + 0.02).sum();
                let mut sum = 0.0;
                for number in &mut numbers[1..] {
                    sum += (*number + 0.02) / total;
                    *number = sum.min(1.0);
                }
                numbers[0] = 0.0;
                numbers[VALVE_POINTS - 1] = 1.0;
            }
            "kv_supply_m3_per_h" | "kv_exhaust_m3_per_h" => {
                numbers.sort_by(f64::total_cmp);
                numbers[0] = 0.0;
            }
            _ => (),
        }
    }
    let mut text = String::new();
    let mut table = "";
    for (key, numbers) in &values {
        if key.table != table {
            table = key.table;
            text += &format!("[{table}]\n");
        }
        let number = |value: &f64| format!("{value:?}");
        let list = numbers.iter().map(number).collect::<Vec<_>>().join(", ");
        text += &if key.count == 1 {
            format!("{} = {list}\n", key.name)
        } else {
            format!("{} = [{list}]\n", key.name)
        };
    }
    RigParameters::from_toml(&text, "generated.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[derive(Debug, Clone)]
struct Event {
    valve: [f64; 2],
    hand: [f64; 2],
    what: u8,
    ms: usize,
}

fn event() -> impl Strategy<Value = Event> {
    let valve = prop_oneof![Just(-1.0), Just(0.0), Just(1.0), -1.0..1.0_f64];
    let hand = prop_oneof![3 => Just(0.0), 1 => -3000.0..3000.0_f64];
    ([valve.clone(), valve], [hand.clone(), hand], 0..12_u8, 1..25_usize)
        .prop_map(|(valve, hand, what, ms)| Event { valve, hand, what, ms })
}

/// What must hold at every instant.
fn check(plant: &Plant, inputs: &Inputs) -> Result<(), TestCaseError> {
    let truth = plant.truth(inputs);
    for value in truth.values() {
        prop_assert!(value.is_finite(), "{truth:?}");
    }
    prop_assert!(plant.state().is_finite());
    let stroke_m = plant.rig().cylinder().stroke_m;
    for (axis, state) in truth.axes.iter().zip(&plant.state().axes) {
        prop_assert!(axis.pressure_a_pa > 0.0 && axis.pressure_b_pa > 0.0, "{axis:?}");
        prop_assert!((0.0..=stroke_m).contains(&state.extension_m), "{state:?}");
        prop_assert!(axis.spool.abs() <= 1.0);
        let friction_power_w =
            (axis.viscous_friction_n + axis.sliding_friction_n) * axis.rod_velocity_m_per_s;
        prop_assert!(friction_power_w <= 0.0, "friction adds energy: {axis:?}");
        prop_assert!(
            axis.holding_force_n == 0.0 || axis.rod_velocity_m_per_s == 0.0,
            "held while moving: {axis:?}"
        );
        prop_assert!(state.extension_m > 0.0 || axis.rod_velocity_m_per_s >= 0.0, "moves out of the stroke");
        prop_assert!(
            state.extension_m < stroke_m || axis.rod_velocity_m_per_s <= 0.0,
            "moves out of the stroke"
        );
    }
    prop_assert!(truth.contact_force_n * truth.linkage_distance_m >= 0.0, "the contact pulls: {truth:?}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_admitted_rig_stays_finite_with_positive_pressures(
        shares in prop::collection::vec(0.0..1.0_f64, 64),
        position in 0.0..1.0_f64,
        linked in any::<bool>(),
        added in 0.0..1.0_f64,
        events in prop::collection::vec(event(), 1..12),
    ) {
        let rig = rig_from(&shares);
        let setup = Setup {
            carriage_position_m: position * rig.cylinder().stroke_m,
            linked,
            added_mass_kg: added * rig.mass().added_limit_kg,
        };
        let mut plant = Plant::new(&rig, &setup).expect("a setup within the rig's limits");
        for event in events {
            match event.what {
                0 => plant.trip_emergency_stop(),
                1 => plant.release_emergency_stop(),
                2 => plant.unlink(),
                3 => { let _refused_is_fine = plant.link(); }
                _ => (),
            }
            let inputs = Inputs {
                valve: event.valve.map(plant::quantise_valve),
                hand_force_carriage_n: event.hand[0],
                hand_force_load_n: event.hand[1],
            };
            for _ in 0..event.ms {
                plant.step(&inputs);
                check(&plant, &inputs)?;
            }
        }
    }

    #[test]
    fn the_same_inputs_give_the_same_bits(
        events in prop::collection::vec(event(), 1..6),
        linked in any::<bool>(),
    ) {
        let rig = RigParameters::baseline();
        let run = || {
            let mut plant = Plant::new(&rig, &Setup { linked, ..Setup::default() }).expect("good");
            for event in &events {
                let hand = event.hand;
                let inputs = Inputs { valve: event.valve, hand_force_carriage_n: hand[0], hand_force_load_n: hand[1] };
                (0..event.ms).for_each(|_| plant.step(&inputs));
            }
            plant.truth(&Inputs::default()).values().map(f64::to_bits)
        };
        prop_assert_eq!(run(), run());
    }
}
