//! Tests of the record maker: reproducible bytes, all effects in all forms, sticking, convergence, no truth in a measurement.

use super::closed_loop::{replay_with, run};
use super::files::measurement_csv;
use super::rig::STEPS_PER_MS;
use super::*;
use plant::RigParameters;
use plant::effects::SHEETS;
use plant::effects::sheet::Sheet;

fn rig() -> RigParameters {
    RigParameters::baseline()
}

/// An effect at its first place with a number for each key.
fn hidden(sheet: &Sheet, number: impl Fn(&[f64; 2]) -> f64) -> Hidden {
    let numbers = sheet.keys.iter().map(|key| number(&key.drawn)).collect();
    Hidden { name: sheet.name, place: sheet.place.places()[0], numbers }
}

fn recipe(hidden: Vec<Hidden>) -> Recipe {
    let both_axes = hidden.iter().any(|hidden| hidden.name.starts_with("coupling"));
    Recipe { hidden, both_axes, ..Recipe::default() }
}

/// Valve commands that reach both ends of the stroke at full opening, reverse, move slowly and rest.
fn commands(rows: usize) -> Vec<[f64; 2]> {
    const PARTS: [(usize, f64); 9] = [
        (50, 0.0),
        (550, 1.0),
        (100, 0.0),
        (100, -0.05),
        (250, -1.0),
        (100, 0.06),
        (150, 0.3),
        (100, -0.5),
        (200, 0.07),
    ];
    let parts = PARTS.iter().flat_map(|(rows, command)| std::iter::repeat_n(*command, *rows));
    // The controllers' commands are never this still: 1 % at 25 Hz.
    let hum = |row: usize| 0.01 * libm::sin(std::f64::consts::TAU * row as f64 / 40.0);
    let both = |(row, command): (usize, f64)| [command + hum(row), -0.3 * command - hum(row)];
    parts.cycle().take(rows).enumerate().map(|row| both(row).map(plant::quantise_valve)).collect()
}

fn everything(seed: u64) -> Recipe {
    let names = ["heat-exchange", "presliding", "line-delay", "time-skew", "silencer-back-pressure"];
    let effects = names.map(|name| hidden(plant::effects::sheet(name).expect("known"), |drawn| drawn[0]));
    Recipe {
        seed,
        hidden: effects.to_vec(),
        form: Form::Near,
        wrong_parameters: PARAMETERS.map(|name| (name.to_owned(), 1.03)).to_vec(),
        coloured_noise: true,
        jitter: true,
        ..Recipe::default()
    }
}

#[test]
fn a_recipe_gives_the_same_bytes_again() {
    let bytes = |seed| measurement_csv(&run(&everything(seed), &rig(), [1500, STEPS_PER_MS]).unwrap());
    assert!(bytes(3) == bytes(3));
    assert!(bytes(3) != bytes(4), "another seed, another noise");
}

#[test]
fn every_effect_alone_at_both_ends_keeps_the_rig_a_rig_in_all_forms() {
    let valves = commands(500);
    for sheet in SHEETS {
        for end in [0, 1] {
            for form in Form::ALL {
                let recipe = Recipe { form, ..recipe(vec![hidden(sheet, |drawn| drawn[end])]) };
                // Replaying checks each row: finite, pressures positive.
                let record = replay(&recipe, &rig(), &valves);
                assert!(record.is_ok(), "{} at end {end}, {form:?}: {:?}", sheet.name, record.err());
            }
        }
    }
}

#[test]
fn all_effects_of_an_axis_together_keep_the_rig_a_rig() {
    let all: Vec<_> = SHEETS.iter().map(|sheet| hidden(sheet, |drawn| drawn[0])).collect();
    for form in Form::ALL {
        let recipe = Recipe { both_axes: true, form, ..recipe(all.clone()) };
        replay(&recipe, &rig(), &commands(300)).unwrap();
    }
}

#[test]
fn records_of_the_catalogues_and_the_near_form_keep_their_bytes() {
    // Draws of all studies before the far forms existed. FNV-1a.
    let hash = |bytes: &[u8]| {
        bytes.iter().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3)
        })
    };
    let valves = commands(700);
    let of = |form, end: usize| {
        let of_effect = |sheet: &Sheet| {
            let recipe = Recipe { form, ..recipe(vec![hidden(sheet, |drawn| drawn[end])]) };
            measurement_csv(&replay(&recipe, &rig(), &valves).unwrap())
        };
        hash(&SHEETS.iter().flat_map(of_effect).collect::<Vec<_>>())
    };
    let expected = [0x3282_9AE7_E35D_BB92, 0xC799_E597_FBBC_B3AE, 0x1EC4_B231_1527_D972];
    assert_eq!([of(Form::Catalogue, 1), of(Form::Near, 0), of(Form::Near, 1)], expected);
}

#[test]
fn a_foreign_form_differs_from_the_catalogues_and_means_the_same() {
    let valves = commands(1500);
    let null = [false, true]
        .map(|both_axes| replay(&Recipe { both_axes, ..Recipe::default() }, &rig(), &valves).unwrap());
    let mut unlike = Vec::new();
    for sheet in SHEETS {
        let recipe = recipe(vec![hidden(sheet, |drawn| (drawn[0] * drawn[1]).sqrt())]);
        let of_catalogue = replay(&recipe, &rig(), &valves).unwrap();
        let null = &null[usize::from(recipe.both_axes)];
        let name = sheet.name;
        let mut others = Vec::new();
        // Alike: the same direction within 45 degrees, far within 70; the size within a factor of three.
        for (form, least_cosine) in [(Form::Near, 0.7), (Form::Far, 0.34)] {
            let foreign = replay(&Recipe { form, ..recipe.clone() }, &rig(), &valves).unwrap();
            let [one, other, cosine] = comparison::from_null(null, &of_catalogue, &foreign, 2);
            // The growth of a rest moves a few instants of break-away: in a free run of the far form they are others.
            if form == Form::Far && name == "rest-time-dependent-break-away" {
                others.push(foreign);
                continue;
            }
            if cosine < least_cosine || !(0.33..3.0).contains(&(other / one)) {
                unlike.push(format!("{name} {form:?}: {one:.2} {other:.2} {cosine:.2}"));
            }
            others.push(foreign);
        }
        let differ = |one: &Record, other: &Record| {
            one.rows.iter().zip(&other.rows).any(|(a, b)| a.without_noise != b.without_noise)
        };
        let [near, far] = &others[..] else { panic!("two other forms") };
        // The near form of heat exchange is different enough.
        let is_one_more = differ(near, far) || name == "heat-exchange";
        assert!(differ(&of_catalogue, near) && differ(&of_catalogue, far) && is_one_more, "{name}");
    }
    assert!(unlike.is_empty(), "{unlike:#?}");
}

#[test]
fn every_effect_of_the_catalogues_form_is_the_plants_effect() {
    // One stroke at full opening, into the cushion. It ends before events decide, such as the end of the stroke, and a chamber
    // that reaches the supply pressure, where the lagged flow jumps.
    const ROWS: usize = 660;
    let valves = commands(ROWS);
    for sheet in SHEETS {
        let recipe = recipe(vec![hidden(sheet, |drawn| drawn[1])]);
        let Hidden { place, numbers, .. } = &recipe.hidden[0];
        let keys: Vec<_> = sheet.keys.iter().zip(numbers).map(|(key, number)| (key.name, *number)).collect();
        let plants = rig().with_effect(sheet.name, &place.to_string(), &keys).unwrap();
        let record = replay(&recipe, &rig(), &valves).unwrap();
        let largest = |rig: &RigParameters| {
            let rms = comparison::with_effects(&record, rig, ROWS).unwrap();
            let active = if recipe.both_axes { &rms[..] } else { &rms[..1] };
            active.iter().flatten().copied().fold(0.0, f64::max)
        };
        // A free run under given commands: half of the noise, or a fiftieth of the effect where events come at other instants.
        let (size, off) = (largest(&rig()), largest(&plants));
        assert!(off < f64::max(0.5, size / 50.0), "{}: {off} of the noise, the effect is {size}", sheet.name);
    }
}

#[test]
fn a_held_piston_rests_to_the_bit_under_load() {
    let record = run(&Recipe::default(), &rig(), [4000, STEPS_PER_MS]).unwrap();
    let held: Vec<_> = record
        .rows
        .windows(2)
        .map(|rows| [rows[0].axes[0], rows[1].axes[0]])
        .filter(|[one, other]| one.rod_velocity_m_per_s == 0.0 && other.rod_velocity_m_per_s == 0.0)
        .collect();
    // It slips and sticks again within a millisecond at most a few times.
    let moved = held.iter().filter(|[one, other]| one.extension_m != other.extension_m).count();
    assert!(moved * 100 < held.len(), "{moved} of {}", held.len());
    assert!(held.iter().any(|[one, _]| one.pneumatic_force_n.abs() > 20.0), "under load");
    assert!(held.iter().all(|[one, _]| one.friction_n.abs() <= 35.0), "never beyond the break-away force");
}

#[test]
fn halving_the_step_changes_next_to_nothing() {
    for both_axes in [false, true] {
        let recipe = Recipe { both_axes, ..Recipe::default() };
        let changed = comparison::of_halved_step(&recipe, &rig(), [5000, STEPS_PER_MS]).unwrap();
        // A twentieth of the noise: it would show in the mean of no fewer than 400 records.
        assert!(changed.iter().flatten().all(|rms| *rms < 0.05), "{changed:?}");
    }
}

#[test]
fn halving_the_step_changes_next_to_nothing_with_the_stiffest_effects() {
    let valves = commands(800); // as far as the end of the stroke, and back from it
    let stiff = [
        ("presliding", 1),
        ("coupling-compliance", 1),
        ("silencer-back-pressure", 0),
        ("supply-droop", 0),
        ("check-valve-restriction", 1),
        ("end-cushion", 0),
        ("stribeck-friction", 0),
    ];
    for (name, end) in stiff {
        let recipe = recipe(vec![hidden(plant::effects::sheet(name).expect("known"), |drawn| drawn[end])]);
        let full_step = replay_with(&recipe, &rig(), &valves, STEPS_PER_MS).unwrap();
        let halved = replay_with(&recipe, &rig(), &valves, 2 * STEPS_PER_MS).unwrap();
        let null = Record { rows: full_step.rows.clone(), ..full_step.clone() };
        let [_, rms, _] = comparison::from_null(&null, &full_step, &halved, 2);
        // A free run under given commands, in which errors persist: a fifth of the noise.
        assert!(rms < 0.2, "{name}: {rms}");
    }
}

#[test]
fn a_measurement_holds_no_column_of_the_truth() {
    let recipe = recipe(vec![hidden(plant::effects::sheet("piston-leakage").expect("known"), |_| 7.125)]);
    let [measured, truth] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    write(&run(&recipe, &rig(), [50, STEPS_PER_MS]).unwrap(), measured.path(), truth.path()).unwrap();
    let names = |folder: &tempfile::TempDir| {
        let files = std::fs::read_dir(folder.path()).unwrap();
        let mut names: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&measured), ["measurement.csv"]);
    assert_eq!(names(&truth), ["truth.csv", "truth.json"]);
    let text = std::fs::read_to_string(measured.path().join("measurement.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("# linked=false added_mass_kg=0"));
    let columns = "time_s,drive_valve,drive_position_m,drive_force_N,drive_pressure_a_Pa,drive_pressure_b_Pa";
    assert_eq!(lines.next(), Some(columns));
    assert_eq!(lines.count(), 50);
    assert!(!text.contains("leakage") && !text.contains("7.125"));
    let truth = std::fs::read_to_string(truth.path().join("truth.json")).unwrap();
    assert!(truth.contains("piston-leakage") && truth.contains("7.125"));
}

#[test]
fn noise_is_as_specified_and_jitter_shows_in_motion_alone() {
    let rms = |recipe: &Recipe, rows: std::ops::Range<usize>| {
        let record = replay(recipe, &rig(), &commands(2000)).unwrap();
        let squares = record.rows[rows.clone()]
            .iter()
            .map(|row| (row.readings[0].position.value - row.without_noise[0][0]).powi(2));
        (squares.sum::<f64>() / rows.len() as f64).sqrt() / 20e-6
    };
    let plain = Recipe::default();
    // 2000 samples: standard error 1.6 %, and rounding to 7.6 um adds 0.6 %; five standard errors.
    assert!((rms(&plain, 0..2000) - 1.0).abs() < 0.09);
    assert!((rms(&Recipe { noise: 0.5, ..plain.clone() }, 0..2000) - 0.5).abs() < 0.06);
    // Within the first stroke, near 1 m/s: 0.1 ms are 100 um, five times the noise.
    let jitter = Recipe { jitter: true, ..plain };
    assert!(rms(&jitter, 300..400) > 2.0, "{}", rms(&jitter, 300..400));
    assert!(rms(&jitter, 0..50) < 1.7);
}

#[test]
fn every_parameter_that_may_be_wrong_changes_the_record() {
    let valves = commands(600);
    let null = replay(&Recipe::default(), &rig(), &valves).unwrap();
    for name in PARAMETERS {
        let wrong_parameters = vec![(name.to_owned(), 1.03)];
        let other = replay(&Recipe { wrong_parameters, ..Recipe::default() }, &rig(), &valves).unwrap();
        assert!(null.rows.iter().zip(&other.rows).any(|(a, b)| a.axes[0] != b.axes[0]), "{name}");
    }
    let wrong_parameters = vec![("parameter:colour".to_owned(), 1.03)];
    let refused = replay(&Recipe { wrong_parameters, ..Recipe::default() }, &rig(), &valves);
    assert!(matches!(refused, Err(MakeError::WrongParameter { .. })));
}

#[test]
fn an_effect_where_nobody_would_see_it_is_refused() {
    let refused = |name: &str, place: &str| {
        let sheet = plant::effects::sheet(name).expect("known");
        let place = sheet.place_named(place).expect("a place of the effect");
        let effect = Hidden { place, ..hidden(sheet, |drawn| drawn[0]) };
        let made = replay(&Recipe { hidden: vec![effect], ..Recipe::default() }, &rig(), &commands(1));
        matches!(made, Err(MakeError::Place { .. }))
    };
    assert!(refused("inclination", "load") && refused("coupling-backlash", "linkage"));
    assert!(!refused("inclination", "drive") && !refused("supply-droop", "supply"));
}

#[test]
fn null_records_lie_within_a_fifth_of_the_noise_of_the_plant() {
    for (axis, both_axes) in [(Axis::Drive, false), (Axis::Load, false), (Axis::Drive, true)] {
        for experiment in [Experiment::Train, Experiment::HeldOut(0), Experiment::HeldOut(1)] {
            let recipe = Recipe { axis, both_axes, experiment, ..Recipe::default() };
            let record = simulate(&recipe, &rig()).unwrap();
            let differences = comparison::against_plant(&record, &rig(), comparison::WINDOW).unwrap();
            for (signals, axis) in differences.iter().zip(Axis::ALL) {
                for (difference, name) in signals.iter().zip(comparison::SIGNALS) {
                    // The deviation that rig-model.md (Accuracy) allows any simulation, so neither may be wrong by more.
                    let rms = difference.rms();
                    assert!(rms < 0.2, "{recipe:?}: {} {name}: {rms} of the noise", axis.name());
                    let left_out = difference.left_out;
                    assert!(left_out[0] * 50 <= left_out[1], "{recipe:?}: {left_out:?} samples left out");
                }
            }
        }
    }
}

fn background() -> Background {
    let small = hidden(plant::effects::sheet("line-delay").expect("known"), |drawn| 0.5 * drawn[0]);
    Background {
        effects: vec![small],
        valve_point_factors: [[1.01; 6], [0.99; 6]],
        dead_volume_ratio: 1.02,
        temperature_ratio: 0.995,
        fading_ratio: 0.05,
        fading_below_m_per_s: 2e-3,
        slow_noise_ratio: 0.2,
    }
}

#[test]
fn a_background_moves_all_readings_a_little_and_hides_nothing() {
    let valves = commands(1500);
    let null = replay(&Recipe::default(), &rig(), &valves).unwrap();
    let with = Recipe { background: Some(background()), ..Recipe::default() };
    let record = replay(&with, &rig(), &valves).unwrap();
    for signal in 0..4 {
        let differs = null.rows.iter().zip(&record.rows);
        let squares: f64 = differs
            .map(|(one, other)| (one.without_noise[0][signal] - other.without_noise[0][signal]).powi(2))
            .sum();
        // Of position, force and pressures, over their ranges.
        let rms = (squares / null.rows.len() as f64).sqrt() / [0.5, 500.0, 6e5, 6e5][signal];
        assert!((1e-6..0.05).contains(&rms), "{signal}: {rms}");
    }
    assert_eq!(measurement_csv(&record), measurement_csv(&replay(&with, &rig(), &valves).unwrap()));
}

#[test]
fn each_part_of_a_background_changes_the_record() {
    let valves = commands(600);
    let none = Background {
        effects: Vec::new(),
        valve_point_factors: [[1.0; 6]; 2],
        dead_volume_ratio: 1.0,
        temperature_ratio: 1.0,
        fading_ratio: 0.0,
        fading_below_m_per_s: 2e-3,
        slow_noise_ratio: 0.0,
    };
    let bytes = |background: &Background| {
        let recipe = Recipe { background: Some(background.clone()), ..Recipe::default() };
        measurement_csv(&replay(&recipe, &rig(), &valves).unwrap())
    };
    let all = background();
    let parts = [
        Background { effects: all.effects.clone(), ..none.clone() },
        Background { valve_point_factors: all.valve_point_factors, ..none.clone() },
        Background { dead_volume_ratio: all.dead_volume_ratio, ..none.clone() },
        Background { temperature_ratio: all.temperature_ratio, ..none.clone() },
        Background { fading_ratio: all.fading_ratio, ..none.clone() },
        Background { slow_noise_ratio: all.slow_noise_ratio, ..none.clone() },
    ];
    for part in parts {
        assert!(bytes(&part) != bytes(&none), "{part:?}");
    }
}

#[test]
fn rods_that_are_apart_do_not_touch_and_both_axes_move() {
    let recipe = Recipe { both_axes: true, unlinked: true, ..Recipe::default() };
    let record = run(&recipe, &rig(), [3000, STEPS_PER_MS]).unwrap();
    assert!(!record.linked && record.rows.iter().all(|row| row.contact_force_n == 0.0));
    for axis in 0..2 {
        let extensions = record.rows.iter().map(|row| row.axes[axis].extension_m);
        let [least, most] =
            extensions.fold([f64::MAX, f64::MIN], |[least, most], x| [least.min(x), most.max(x)]);
        assert!(most - least > 0.05, "axis {axis}: {least} to {most}");
    }
    let refused = Recipe {
        hidden: vec![hidden(plant::effects::sheet("coupling-backlash").unwrap(), |drawn| drawn[0])],
        ..recipe
    };
    assert!(matches!(run(&refused, &rig(), [10, STEPS_PER_MS]), Err(MakeError::Place { .. })));
}
