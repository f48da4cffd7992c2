//! The pressure-compensated linearisation against the plant.

use algorithms::algorithm::AlgorithmInput;
use algorithms::linearisation::{Air, Law, Linearisation};
use plant::{Inputs, Plant, RigParameters, Setup};

#[test]
fn the_compensated_opening_gives_the_wanted_force_rate_of_a_held_rod() {
    let rig = RigParameters::baseline().with("friction.break_away_force_n", &[300.0]).unwrap();
    let mut plant = Plant::new(&rig, &Setup { carriage_position_m: 0.2, ..Setup::default() }).unwrap();
    let inputs = Inputs::default();
    let before = plant.truth(&inputs).axes[0];
    let input = AlgorithmInput {
        position_m: before.position_m,
        pressure_a_pa: before.pressure_a_pa,
        pressure_b_pa: before.pressure_b_pa,
        supply_pressure_pa: 7e5,
        ..AlgorithmInput::default()
    };
    // Held by friction, so v = 0 and the force's rate is c times the velocity asked for: 0.5 N in a millisecond.
    let rate_n_per_s = 500.0;
    let velocity = rate_n_per_s / Air::new(&rig).at(&input).stiffness_n_per_m();
    let opening = Linearisation::new(&rig, Law::PressureCompensated).opening(velocity, &input);
    let opened = Inputs { valve: [plant::quantise_valve(opening), 0.0], ..inputs };
    for _ in 0..100 {
        plant.step(&opened);
    }
    // Spool and flow lag take 9.6 ms off the 100 ms; the pressures move by some percent on the way, and the rounding of
    // the opening is half a step of 0.65 mm/s.
    let risen = plant.truth(&inputs).axes[0].pneumatic_force_n - before.pneumatic_force_n;
    let expected = rate_n_per_s * (0.1 - 0.0096);
    assert!((risen / expected - 1.0).abs() < 0.03, "{risen} N, not {expected} N");
}
