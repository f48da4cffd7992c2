//! Set-points that a person gives over the bus while an experiment runs: followed where it allows them, smoothly, and nowhere
//! else.

use protocol::frames::{Frame, HandSetPoint, HandSetPointAxis, MainChainState};
use system_tests::{LINKED, Pace, Scene, both_good};

/// Both axes at rest for three seconds, linked, for a hand to lead.
fn experiment(drive: &str, load: &str) -> String {
    let head = LINKED.split("[drive]").next().expect("its head");
    format!(
        "{head}[drive]\nprogram = \"linked-program.toml\"\nstart_m = 0.2\n{drive}\n\
         set-point = [{{ law = \"rest\", duration_s = 3.0 }}]\n\
         [load]\nprogram = \"load-program.toml\"\ninitial_force_n = 100.0\ninitial_ramp_s = 0.3\n{load}\n\
         set-point = [{{ law = \"rest\", duration_s = 3.0 }}]\n"
    )
}

/// Runs it in lockstep with a person who asks once, a tenth of a second into the experiment, and returns the positions
/// that the drive was asked for, m, and the forces that the load was asked for, N.
fn led(experiment: &str, asks: &[HandSetPoint]) -> [Vec<f64>; 2] {
    let scene = Scene::new(experiment);
    let (emulator, controller) = scene.start(Pace::Lockstep, "--members 2 --seconds 60", "");
    let mut began = None;
    scene.peer().take_part("bench", |peer, cycle, frames| {
        for frame in frames.iter().filter_map(|frame| Frame::decode(frame).ok()) {
            if let Frame::DriveChainStatus(status) = frame
                && status.main_chain == MainChainState::Experiment
            {
                began.get_or_insert(cycle);
            }
        }
        if began.is_some_and(|began| cycle == began + 100) {
            for ask in asks {
                peer.send_frame(&Frame::HandSetPoint(*ask));
            }
        }
    });
    both_good(emulator, controller);
    [("drive", "set_position_m"), ("load", "set_force_N")].map(|(axis, column)| {
        let table = scene.axis_table(axis);
        // Where nothing is asked for, a cell is empty.
        table.numbers(column).into_iter().filter(|value| value.is_finite()).collect()
    })
}

const ASKS: [HandSetPoint; 2] = [
    HandSetPoint { axis: HandSetPointAxis::Drive, position_m: 0.25, force_n: 0.0 },
    HandSetPoint { axis: HandSetPointAxis::Load, position_m: 0.0, force_n: 150.0 },
];

#[test]
fn both_axes_follow_a_hand_smoothly_and_hold_what_it_led_to() {
    let experiment = experiment("by_hand_speed_m_per_s = 0.1", "by_hand_rate_n_per_s = 100.0");
    let [positions, forces] = led(&experiment, &ASKS);
    let steps = positions.windows(2).map(|two| (two[1] - two[0]).abs()).fold(0.0, f64::max);
    // 0.1 m/s at most, and the step of a file's digits.
    assert!(steps < 0.101e-3, "{steps} m in a cycle");
    let (end_m, end_n) = (positions[positions.len() - 1], forces[forces.len() - 1]);
    assert!((end_m - 0.25).abs() < 1e-5, "{end_m} m");
    assert!((end_n - 150.0).abs() < 0.1, "{end_n} N");
}

#[test]
fn an_experiment_that_does_not_allow_it_is_led_by_nobody() {
    let [positions, forces] = led(&experiment("", ""), &ASKS);
    assert!(positions.iter().all(|position_m| (position_m - 0.2).abs() < 1e-3), "it stays");
    assert!(forces.iter().all(|force_n| *force_n < 100.5), "it presses as before");
}
