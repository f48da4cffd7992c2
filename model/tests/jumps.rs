//! What jumps or leaves zero within a step, against closed forms and against short steps: step control finds it.

use crate::{first_values, outputs, read, refused, simulated};
use model::{Direction, Failure, Inputs, Program, Simulator};

/// The first output at samples `period_s` apart; inputs in SI.
fn output(text: &str, period_s: f64, rows: usize, inputs: &[Vec<f64>]) -> Result<Vec<f64>, Failure> {
    let model = read(text);
    let time_s: Vec<f64> = (0..rows).map(|row| period_s * row as f64).collect();
    outputs(&model, &[], &Inputs { time_s: &time_s, samples_si: inputs })
}

/// Six lags in a row behind a step; the last state begins as t^6: 1 - exp(-t) (1 + t + ... + t^5/5!).
#[test]
fn a_chain_of_lags_leaves_rest() {
    let mut text = "[inputs.u]\nunit = \"1\"\n[parameters]\nk = { unit = \"1/s\", value = 1.0 }\n".to_owned();
    for stage in 1..=6 {
        let before = if stage == 1 { "u".to_owned() } else { format!("x{}", stage - 1) };
        text += &format!("[states.x{stage}]\nstart = 0\nderivative = \"k*({before} - x{stage})\"\n");
    }
    text += "[outputs.y]\nvalue = \"x6\"\n";
    let computed = output(&text, 0.5, 20, &[vec![1.0; 20]]).expect("it is no stiff chain");
    for (row, computed) in computed.iter().enumerate() {
        let time_s = 0.5 * row as f64;
        let mut term = 1.0;
        let mut sum = 0.0;
        for power in 0..6 {
            sum += term;
            term *= time_s / f64::from(power + 1);
        }
        let expected = 1.0 - (-time_s).exp() * sum;
        assert!((computed - expected).abs() < 1e-5, "{time_s} s: {computed} in place of {expected}");
    }
}

/// A rate that jumps between two samples, from rest: k (t - 3.02 s).
#[test]
fn a_rate_may_jump_within_a_step_from_rest() {
    let text = "[inputs.u]\nunit = \"1\"\n[parameters]\nk = { unit = \"1/s\", value = 2.0 }\n\
                [states.x]\nstart = 0\nderivative = \"if(t > 3.02[s], k, 0) + 0*u*k\"\n[outputs.y]\nvalue = \"x\"\n";
    let computed = output(text, 0.5, 20, &[vec![0.0; 20]]).expect("a jump ends no run");
    for (row, computed) in computed.iter().enumerate() {
        let expected = (2.0 * (0.5 * row as f64 - 3.02)).max(0.0);
        assert!((computed - expected).abs() < 1e-5, "row {row}: {computed} in place of {expected}");
    }
}

/// Mass 1, stiffness 3, damping 0.2, and a play of 0.1 that holds by a spring of 1.
const PLAY: &str = "[inputs.u]\nhold = \"linear\"\n[parameters]\nk = { unit = \"1/s^2\", value = 3.0 }\n\
                    [memory.w]\nstart = 0\nupdate = \"min(max(w, x - 0.1), x + 0.1)\"\n\
                    [states.x]\nstart = 0.5\nderivative = \"v\"\n[states.v]\nunit = \"1/s\"\nstart = 0\n\
                    derivative = \"k*(u - x) - 1[1/s^2]*w - 0.2[1/s]*v\"\n[outputs.y]\nvalue = \"x\"\n";

/// The default method against steps so short that a memory which stands still over each of them does not count.
#[test]
fn a_play_is_as_exact_as_the_steps() {
    let rows = 60;
    let input: Vec<f64> = (0..rows).map(|row| 0.4 * (0.7 * 0.5 * f64::from(row)).sin()).collect();
    let inputs = [input];
    let count = rows as usize;
    let computed = output(PLAY, 0.5, count, &inputs).expect("it ends");
    let short = format!("{PLAY}[solver]\nmethod = \"fixed\"\nstep_s = 1e-4\n");
    let expected = output(&short, 0.5, count, &inputs).expect("it ends");
    for (row, (computed, expected)) in computed.iter().zip(&expected).enumerate() {
        // The short steps are of first order: 1e-4 s of a rate of 1/s, twice.
        assert!((computed - expected).abs() < 2e-4, "row {row}: {computed} in place of {expected}");
    }
}

/// The derivative by the stiffness goes through the memory: against differences, whose own error is 1e-4 of it squared.
#[test]
fn derivatives_go_through_a_memory() {
    let exact = format!("{PLAY}[solver]\nrelative_tolerance = 1e-9\n");
    let time_s: Vec<f64> = (0..40_u32).map(|row| 0.5 * f64::from(row)).collect();
    let samples = [time_s.iter().map(|time_s| 0.4 * (0.7 * time_s).sin()).collect()];
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let model = read(&exact);
    let program = Program::new(&model, &[]).expect("it compiles");
    let at = |stiffness: f64| {
        let mut values = first_values(&model);
        values[0][0] = stiffness;
        simulated(&program, &[Direction::Parameter(0)], &inputs, &values).expect("it ends")
    };
    let (here, less, more) = (at(3.0), at(3.0 - 1e-3), at(3.0 + 1e-3));
    let largest = here.iter().map(|(_, slope)| slope[0].abs()).fold(0.0, f64::max);
    for (row, ((_, slope), (less, more))) in here.iter().zip(less.iter().zip(&more)).enumerate() {
        let expected = (more.0 - less.0) / 2e-3;
        assert!((slope[0] - expected).abs() < 1e-2 * largest, "row {row}: {} for {expected}", slope[0]);
    }
}

/// A two-point controller: x rises by 1/s up to 1 and falls by 2/s down to 0.4. Period 0.6 s + 0.3 s, from x = 0 on after 1 s.
#[test]
fn a_relay_with_hysteresis_switches_at_its_levels() {
    let text = "[inputs.u]\nunit = \"1\"\n[parameters]\nrise = { unit = \"1/s\", value = 1.0 }\n\
                [memory.off]\nstart = 0\nupdate = \"if(x > 1, 1, if(x < 0.4, 0, off))\"\n\
                [states.x]\nstart = 0\nderivative = \"rise*if(off > 0.5, -2, 1) + 0*u*rise\"\n[outputs.y]\nvalue = \"x\"\n";
    let computed = output(text, 0.13, 60, &[vec![0.0; 60]]).expect("it ends");
    for (row, computed) in computed.iter().enumerate() {
        let time_s = 0.13 * row as f64;
        let phase_s = (time_s - 1.0).rem_euclid(0.9);
        let expected = match time_s {
            ..=1.0 => time_s,
            _ if phase_s < 0.3 => 1.0 - 2.0 * phase_s,
            _ => 0.4 + (phase_s - 0.3),
        };
        // Each of seventeen switches comes late by a millionth of a sample at most, and so does what follows.
        assert!((computed - expected).abs() < 1e-4, "{time_s} s: {computed} in place of {expected}");
    }
}

/// A relay without hysteresis at 0 switches at each of the shortest steps; that is said at once, and a fit goes on elsewhere.
#[test]
fn a_relay_without_hysteresis_is_refused_at_once() {
    let text = "[inputs.u]\nunit = \"1\"\n[parameters]\nrate = { unit = \"1/s\", value = 10.0 }\n\
                [states.x]\nstart = 0\nderivative = \"if(x > 0, -rate, rate) + 0*u*rate\"\n[outputs.y]\nvalue = \"x\"\n";
    let model = read(text);
    let (time_s, samples) = ([0.0, 0.5, 1.0], [vec![0.0; 3]]);
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let program = Program::new(&model, &[]).expect("it compiles");
    let mut simulator = Simulator::new(&program, &[]);
    let values = first_values(&model);
    let failed = simulator.run(&inputs, values.each_ref().map(Vec::as_slice), |_, _, _, _| {});
    assert_eq!(failed, Err(Failure::Steps { time_s: 0.0 }));
    assert!(simulator.steps < 1000, "{} steps", simulator.steps);
}

/// A hold that jumps at a sample moves a memory of it there, not a step later: the command behind a play of 0.2 is integrated.
#[test]
fn a_memory_of_an_input_follows_its_jump_at_the_sample() {
    let text = "[inputs.u]\nhold = \"zero\"\n[parameters]\nk = { unit = \"1/s\", value = 1.0 }\n\
                [memory.w]\nstart = 0\nupdate = \"min(max(w, u - 0.2), u + 0.2)\"\n\
                [states.x]\nstart = 0\nderivative = \"k*w\"\n[outputs.y]\nvalue = \"x\"\n";
    let input: Vec<f64> = (0..40).map(|row| [0.0, 1.0, 0.9, 0.5, -0.4, 0.1][row % 6]).collect();
    for solver in ["", "[solver]\nmethod = \"fixed\"\nstep_s = 0.05\n"] {
        let computed =
            output(&format!("{text}{solver}"), 0.1, 40, std::slice::from_ref(&input)).expect("it ends");
        let (mut play, mut expected) = (0.0_f64, 0.0);
        for (row, computed) in computed.iter().enumerate() {
            assert!((computed - expected).abs() < 1e-9, "row {row}: {computed} in place of {expected}");
            play = play.max(input[row] - 0.2).min(input[row] + 0.2);
            expected += 0.1 * play;
        }
    }
}

/// A play of an input: w is 0.5 from the start, and 2 behind an input that was held at 3, less a half width of 1.
#[test]
fn a_memory_starts_from_parameters_and_has_their_derivatives() {
    let text = "[inputs.u]\nunit = \"m\"\n[parameters]\nat = { unit = \"mm\", value = 250 }\nhalf = { unit = \"m\", value = 1 }\n\
                [memory.w]\nunit = \"m\"\nstart = \"2*at\"\nupdate = \"min(max(w, u - half), u + half)\"\n\
                [memory.other]\nunit = \"m\"\nstart = 3\nupdate = \"other\"\n[outputs.y]\nunit = \"m\"\nvalue = \"w + other\"\n";
    let model = read(text);
    let program = Program::new(&model, &[]).unwrap();
    let inputs = [vec![0.0, 3.0, 3.0]];
    let inputs = Inputs { time_s: &[0.0, 1.0, 2.0], samples_si: &inputs };
    let directions = [0, 1].map(Direction::Parameter);
    let mut values = first_values(&model);
    let computed = simulated(&program, &directions, &inputs, &values).unwrap();
    for (row, (y, slope)) in
        [(3.5, [2.0, 0.0]), (3.5, [2.0, 0.0]), (5.0, [0.0, -1.0])].into_iter().enumerate()
    {
        assert!(
            (computed[row].0 - y).abs() < 1e-12 && computed[row].1 == slope,
            "{row}: {:?}",
            computed[row]
        );
    }
    values[0][0] = 0.1;
    assert!((simulated(&program, &[], &inputs, &values).unwrap()[0].0 - 3.2).abs() < 1e-12);
    for (from, to, message) in [
        ("2*at", "u", "'u': the start of a memory reads parameters alone"),
        ("2*at", "2", "the start of w is in m, and this is in 1"),
        ("2*at", "2*ta", "'ta' is unknown here"),
    ] {
        let found = refused(&text.replace(from, to));
        assert!(found.starts_with("model.toml:8:") && found.contains(message), "{found}");
    }
}
