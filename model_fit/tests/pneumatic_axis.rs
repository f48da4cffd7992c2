//! The model file of a pneumatic axis beside the crate `plant`: the same laws, another text, another integrator.

use crate::real::crate_folder;
use model::{Inputs, Model, Program, Simulator, Start};
use plant::{Plant, RigParameters, Setup, quantise_valve};

/// Length of the record, ms.
const ROWS: usize = 2000;
/// What follows here is that of outputs of the file, in its order: position, both pressures, force.
const OUTPUTS: [&str; 4] = ["position", "pressure_a", "pressure_b", "force"];

/// Commands of the drive, and what the plant makes of them without noise.
fn record() -> (Vec<f64>, Vec<[f64; 4]>) {
    let setup = Setup { carriage_position_m: 0.2, linked: false, added_mass_kg: 0.0 };
    let mut plant = Plant::new(&RigParameters::baseline(), &setup).unwrap();
    let openings = [0.0, 0.25, -0.3, 0.4, -0.5, 0.15, -0.1, 0.0]; // at rest first: the file starts with the spool at the command
    let rows = (0..ROWS).map(|k| {
        let valve = quantise_valve(openings[k / 250]);
        let inputs = plant::Inputs { valve: [valve, 0.0], ..plant::Inputs::default() };
        let [drive, _] = plant.truth(&inputs).axes;
        plant.step(&inputs);
        (valve, [drive.position_m, drive.pressure_a_pa, drive.pressure_b_pa, drive.sensor_force_n])
    });
    rows.unzip()
}

fn simulated(model: &Model, valve: &[f64], first: [f64; 4]) -> Vec<[f64; 4]> {
    let program = Program::new(model, &[]).unwrap();
    let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64 * 1e-3).collect();
    let starts = model.states.iter().map(|state| match (state.name.as_str(), state.start) {
        ("x", Start::Fitted { .. }) => first[0],
        ("p_a", Start::Fitted { .. }) => first[1],
        ("p_b", Start::Fitted { .. }) => first[2],
        (_, Start::Known { value_si }) => value_si,
        (_, Start::Input { .. }) => valve[0],
        (name, start) => panic!("{name} starts at {start:?}"),
    });
    let (starts, parameters): (Vec<f64>, Vec<f64>) =
        (starts.collect(), model.parameters.iter().map(|one| one.values_si[0]).collect());
    let mut rows = vec![[0.0; 4]; ROWS];
    let samples_si = [valve.to_vec()];
    Simulator::new(&program, &[])
        .run(
            &Inputs { time_s: &time_s, samples_si: &samples_si },
            [&parameters, &starts, &[]],
            |row, output, value, _| rows[row][output] = value,
        )
        .unwrap();
    rows
}

/// Both integrate the same equations, so that their errors add up over the 20 windows of 100 ms of the record. Those of the
/// plant have at most 0.34 um, 28 Pa and 0.0095 N rms (plant/docs/integration.md, exact midpoint, 100 us, worst window): 6.8 um,
/// 560 Pa, 0.19 N in all. The file has 1e-8 of the largest value in each of some 4000 steps: 12 um of 0.3 m, 28 Pa of 7 bar. The
/// force, an acceleration, follows what the pressures differ by, some 2000 mm^2 times 0.7: 0.8 N. Where a stop or a break-away
/// comes within 5 ms, one of them may hold already and the other not.
#[test]
fn the_file_of_an_axis_agrees_with_the_plant_within_their_integration_errors() {
    let file = crate_folder().join("../discrepancy/models/pneumatic-axis.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.lines().count() < 120);
    let model = Model::parse(&text, &file).unwrap_or_else(|error| panic!("{error}"));
    assert!(model.outputs.iter().map(|output| output.name.as_str()).eq(OUTPUTS));
    let (valve, plant) = record();
    let rows = simulated(&model, &valve, plant[0]);
    let held = |row: &[f64; 4]| row[3] == 0.0;
    let turns: Vec<usize> = (1..ROWS).filter(|k| held(&plant[*k]) != held(&plant[*k - 1])).collect();
    assert!(turns.len() > 4, "it stops and breaks away: {turns:?}");
    let ends =
        plant.iter().map(|row| row[0]).fold([1.0, 0.0], |[low, high]: [f64; 2], x| [low.min(x), high.max(x)]);
    assert!(ends[0] > 0.02 && ends[1] < 0.48 && ends[1] - ends[0] > 0.05, "it moves, off the ends: {ends:?}");
    let mut worst = [0.0_f64; 4];
    for k in 0..ROWS {
        let is_near_a_turn = turns.iter().any(|turn| turn.abs_diff(k) <= 5);
        for (output, worst) in
            worst.iter_mut().enumerate().filter(|(output, _)| *output < 3 || !is_near_a_turn)
        {
            *worst = worst.max((rows[k][output] - plant[k][output]).abs());
        }
    }
    let allowed = [20e-6, 600.0, 600.0, 1.0];
    assert!(worst.iter().zip(allowed).all(|(worst, allowed)| *worst <= allowed), "{worst:?} of {allowed:?}");
}
