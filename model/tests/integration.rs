//! What is integrated, against closed forms, against an integrator by others, derivatives against differences.

use crate::{counting, differences, first_values, outputs, read, refused, simulated};
use model::{Direction, Failure, Inputs, Model, Program, Simulator};
use nalgebra::DVector;
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dopri5, System};

/// An oscillator with dry friction that is smooth, driven by an input.
const OSCILLATOR: &str = r#"
[inputs.force]
unit = "N"
hold = "HOLD"
[parameters]
mass = { unit = "kg", value = 2.0 }
stiffness = { unit = "N/m", value = 50.0 }
friction = { unit = "N", value = 1.5 }
scale = { unit = "m/s", value = 0.05, fixed = true }
[states.x]
unit = "m"
start = "fitted"
guess = 0.1
derivative = "v"
[states.v]
unit = "m/s"
start = 0.0
derivative = "(force - stiffness*x - friction*tanh(v/scale))/mass"
[outputs.x_m]
unit = "m"
value = "x"
"#;

fn oscillator(hold: &str, solver: &str) -> Model {
    read(&format!("{}\n{solver}", OSCILLATOR.replace("HOLD", hold)))
}

/// 4 s of samples with irregular distances and a hole.
fn samples() -> (Vec<f64>, Vec<Vec<f64>>) {
    let time_s: Vec<f64> = (0..200_u32)
        .map(|index| 0.02 * f64::from(index) + if index % 3 == 1 { 0.004 } else { 0.0 })
        .filter(|time_s| !(1.0..1.4).contains(time_s))
        .collect();
    let force = time_s.iter().map(|time_s| if (time_s * 2.0).fract() < 0.5 { 4.0 } else { -3.0 }).collect();
    (time_s, vec![force])
}

/// The same equations, solved by others between two samples.
struct Reference {
    force: [f64; 2],
    time_s: [f64; 2],
}

impl System<f64, DVector<f64>> for Reference {
    fn system(&self, time_s: f64, x: &DVector<f64>, rate: &mut DVector<f64>) {
        let share = (time_s - self.time_s[0]) / (self.time_s[1] - self.time_s[0]);
        let force = self.force[0] + (self.force[1] - self.force[0]) * share;
        rate[0] = x[1];
        rate[1] = (force - 50.0 * x[0] - 1.5 * (x[1] / 0.05).tanh()) / 2.0;
    }
}

fn reference(hold: &str) -> Vec<f64> {
    let (time_s, inputs) = samples();
    let mut x = DVector::from_vec(vec![0.1, 0.0]);
    let mut all = vec![x[0]];
    for row in 1..time_s.len() {
        let from = inputs[0][row - 1];
        let to = if hold == "linear" { inputs[0][row] } else { from };
        let system = Reference { force: [from, to], time_s: [time_s[row - 1], time_s[row]] };
        let length_s = time_s[row] - time_s[row - 1];
        // Sparse: the dense output of ode_solvers leaves the end out where it is off by a rounding error.
        let mut solver = Dopri5::from_param(
            system,
            time_s[row - 1],
            time_s[row],
            length_s,
            x.clone(),
            1e-11,
            1e-13,
            0.9,
            0.04,
            0.2,
            10.0,
            length_s,
            0.0,
            100_000,
            1000,
            OutputType::Sparse,
        );
        solver.integrate().expect("it is smooth");
        x = solver.y_out().last().expect("it ends at the sample").clone();
        all.push(x[0]);
    }
    all
}

/// Relative tolerance 1e-6 of each of some 700 steps, not all in one direction: within 1e-4 of the largest value, 0.2 m.
/// Runge-Kutta with steps of 1 ms through a kink of 50 mm/s: within the same.
#[test]
fn both_methods_agree_with_an_integrator_by_others() {
    for hold in ["zero", "linear"] {
        let expected = reference(hold);
        for solver in ["", "[solver]\nmethod = \"fixed\"\nstep_s = 0.001"] {
            let model = oscillator(hold, solver);
            let (time_s, inputs) = samples();
            let inputs = Inputs { time_s: &time_s, samples_si: &inputs };
            let computed = outputs(&model, &[], &inputs).unwrap();
            for ((row, expected), computed) in expected.iter().enumerate().zip(&computed) {
                assert!(
                    (computed - expected).abs() < 2e-5,
                    "{hold} {solver:?} row {row}: {computed} for {expected}"
                );
            }
        }
    }
}

/// Central differences with relative steps of 1e-5, by an integration of relative tolerance 1e-11: they are good to some 1e-6.
#[test]
fn derivatives_of_the_outputs_are_those_of_differences() {
    let model = oscillator("linear", "[solver]\nrelative_tolerance = 1e-11");
    let (time_s, inputs) = samples();
    let inputs = Inputs { time_s: &time_s, samples_si: &inputs };
    let program = Program::new(&model, &[]).unwrap();
    let directions =
        [Direction::Parameter(0), Direction::Parameter(1), Direction::Parameter(2), Direction::Start(0)];
    let values = first_values(&model);
    let computed = simulated(&program, &directions, &inputs, &values).unwrap();
    for (place, direction) in directions.iter().enumerate() {
        let differences = differences(&program, *direction, &inputs, (&values, 1e-5));
        let largest = computed.iter().map(|(_, slope)| slope[place].abs()).fold(0.0, f64::max);
        for (row, (_, slope)) in computed.iter().enumerate() {
            assert!((slope[place] - differences[row]).abs() < 1e-4 * largest, "{direction:?} row {row}");
        }
    }
}

/// Play of 0.2 behind a sine of 1: the output follows with half of it, and its derivative by the width is 1 or -1.
#[test]
fn a_memory_keeps_its_value_over_a_step() {
    let model = read(
        "[inputs.u]\n[parameters.width]\nvalue = 0.2\n\
         [memory.w]\nstart = 0\nupdate = \"min(max(w, u - width/2), u + width/2)\"\n\
         [outputs.y]\nvalue = \"w\"\n",
    );
    let time_s: Vec<f64> = (0..=400_u32).map(|index| f64::from(index) * 0.01).collect();
    let sine: Vec<f64> = time_s.iter().map(|time_s| (time_s * std::f64::consts::PI).sin()).collect();
    let inputs = [sine.clone()];
    let inputs = Inputs { time_s: &time_s, samples_si: &inputs };
    let program = Program::new(&model, &[]).unwrap();
    let computed = simulated(&program, &[Direction::Parameter(0)], &inputs, &first_values(&model)).unwrap();
    let mut expected = 0.0_f64;
    for (row, (value, slope)) in computed.iter().enumerate() {
        if row > 0 {
            // A memory is renewed at the end of a step, with the input that was held over it.
            expected = expected.max(sine[row - 1] - 0.1).min(sine[row - 1] + 0.1);
        }
        assert!((value - expected).abs() < 1e-12, "row {row}");
        assert!(slope[0] == 0.0 || slope[0].abs() == 0.5, "row {row}: {slope:?}");
    }
    assert!(
        computed.iter().any(|(_, slope)| slope[0] == 0.5)
            && computed.iter().any(|(_, slope)| slope[0] == -0.5)
    );
}

#[test]
fn a_delayed_input_is_the_input_of_then_and_differentiates_by_the_delay() {
    let model = read(
        "[inputs.u]\nhold = \"linear\"\n[parameters.late]\nunit = \"s\"\nvalue = 0.25\n[outputs.y]\nvalue = \"delay(u, late)\"\n",
    );
    let time_s = [0.0, 1.0, 2.0, 4.0];
    let inputs = [vec![0.0, 2.0, 0.0, 8.0]];
    let inputs = Inputs { time_s: &time_s, samples_si: &inputs };
    let program = Program::new(&model, &[]).unwrap();
    let computed = simulated(&program, &[Direction::Parameter(0)], &inputs, &first_values(&model)).unwrap();
    let expected = [(0.0, vec![0.0]), (1.5, vec![-2.0]), (0.5, vec![2.0]), (7.0, vec![-4.0])];
    assert_eq!(computed, expected);
}

/// An input with a term, a suspect and what delays it, at samples 1 s apart: `u` is 0, 2, 0, 8, 4.
fn delayed(changes: &str, suspects: &[usize]) -> Vec<f64> {
    let model = read(&format!(
        "[inputs.u]\nhold = \"linear\"\n[inputs.w]\nhold = \"linear\"\n[define]\nlate = \"delay(u, 1[s])\"\n\
         [outputs.y]\nvalue = \"late\"\n[outputs.z]\nvalue = \"u\"\n{changes}"
    ));
    let time_s = [0.0, 1.0, 2.0, 3.0, 4.0];
    let samples = [vec![0.0, 2.0, 0.0, 8.0, 4.0], vec![0.0, 10.0, 20.0, 30.0, 40.0]];
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    outputs(&model, suspects, &inputs).unwrap()
}

/// `delay` read the samples of the record, and dropped every term and suspect at its input.
#[test]
fn a_delay_is_of_the_input_with_all_that_changes_it() {
    let gain = "[[terms]]\nname = \"gain\"\nplace = \"u\"\nadd = \"u + w*t/1[s]\"\n";
    // u' = 2 u + w t: 0, 14, 40, 106, 168.
    assert_eq!(delayed(gain, &[]), [0.0, 0.0, 0.0, 14.0, 14.0, 40.0, 40.0, 106.0, 106.0, 168.0]);
    // What delays an input comes before what else changes it: 2 u(t - 1) + w t, and in y all of it a second earlier.
    let dead = "[[suspects]]\nuse = \"actuator/dead-time\"\nplace = \"u\"\nwith.u = \"u\"\n\
                parameters.late = { unit = \"s\", value = 1 }\n";
    let both = format!("{gain}{dead}");
    assert_eq!(delayed(&both, &[1]), [0.0, 0.0, 0.0, 10.0, 10.0, 44.0, 44.0, 90.0, 90.0, 176.0]);
}

/// A lag and a dead time at one input: the lag follows the delayed input, so that the answer of both is that of the lag, late.
#[test]
fn a_lag_and_a_dead_time_at_one_input_are_both_there() {
    let text = "[inputs.u]\nhold = \"linear\"\n[outputs.y]\nvalue = \"u\"\n\
                [[suspects]]\nuse = \"actuator/lag\"\nplace = \"u\"\nparameters.lag = { value = 0.5 }\n\
                [[suspects]]\nuse = \"actuator/dead-time\"\nplace = \"u\"\nwith.u = \"u\"\n\
                parameters.late = { unit = \"s\", value = 2 }\n";
    let model = read(text);
    let time_s: Vec<f64> = (0..200_u32).map(|index| 0.1 * f64::from(index)).collect();
    let samples = [time_s.iter().map(|time_s| (time_s - 1.0).max(0.0)).collect()];
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let values = |suspects: &[usize]| outputs(&model, suspects, &inputs).unwrap();
    let (lag, orders) = (values(&[0]), [values(&[0, 1]), values(&[1, 0])]);
    for late in orders {
        for row in 20..200 {
            assert!((late[row] - lag[row - 20]).abs() < 1e-4, "row {row}: {} {}", late[row], lag[row - 20]);
        }
    }
}

#[test]
fn too_many_delays_of_delays_are_refused() {
    // Delays of delays multiply.
    let mut text = String::from("[outputs.y]\nvalue = \"u0\"\n");
    for index in 0..30 {
        text += &format!("[inputs.u{index}]\n");
    }
    for index in 0..29 {
        let next = index + 1;
        text += &format!(
            "[[terms]]\nname = \"s{index}\"\nplace = \"u{index}\"\nadd = \"delay(u{next}, 1[s]) + delay(u{next}, 2[s])\"\n"
        );
    }
    assert!(refused(&text).contains("more than 1000 delays"), "{}", refused(&text));
}

/// An exponential, whose value and derivative are known; zero at the start would divide its error by 0.
#[test]
fn a_charge_from_zero_is_its_closed_form() {
    let model = read(
        "[parameters.tau]\nunit = \"ms\"\nvalue = 20\n[states.q]\nstart = 0\nderivative = \"(1 - q)/tau\"\n\
         [outputs.q_1]\nvalue = \"q\"\n",
    );
    let time_s: Vec<f64> = (0..50_u32).map(|index| f64::from(index) * 2e-3).collect();
    let inputs = Inputs { time_s: &time_s, samples_si: &[] };
    let program = Program::new(&model, &[]).unwrap();
    let computed = simulated(&program, &[Direction::Parameter(0)], &inputs, &first_values(&model)).unwrap();
    for (time_s, (value, slope)) in time_s.iter().zip(computed) {
        let left = (-time_s / 0.02).exp();
        assert!((value - (1.0 - left)).abs() < 1e-5, "{time_s} s: {value}");
        // d/dtau of 1 - exp(-t/tau).
        assert!((slope[0] + left * time_s / 4e-4).abs() < 1e-3, "{time_s} s: {slope:?}");
    }
}

#[test]
fn a_suspect_changes_its_place_and_leaves_the_model_alone() {
    let text = "[inputs.u]\nunit = \"V\"\n[parameters.r]\nunit = \"ohm\"\nvalue = 2\n[define]\ncurrent = \"u/r\"\n\
                [outputs.i_A]\nunit = \"A\"\nvalue = \"current\"\n\
                [[suspects]]\nname = \"gain\"\nplace = \"u\"\nmultiply = \"g\"\nparameters.g = { value = 3 }\n\
                [[suspects]]\nname = \"sensor\"\nplace = \"i_A\"\nadd = \"o\"\nparameters.o = { unit = \"A\", value = 0.5 }\n\
                [[suspects]]\nname = \"square\"\nplace = \"current\"\nreplace = \"current^2/scale\"\n\
                parameters.scale = { unit = \"A\", value = 4 }\n";
    let model = read(text);
    let (time_s, samples) = ([0.0], [vec![8.0]]);
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    for (suspects, expected) in
        [(&[][..], 4.0), (&[0][..], 12.0), (&[1][..], 4.5), (&[2][..], 4.0), (&[0, 1, 2][..], 36.5)]
    {
        assert_eq!(outputs(&model, suspects, &inputs).unwrap()[0], expected, "{suspects:?}");
    }
}

#[test]
fn a_run_allocates_nothing() {
    let model = oscillator("linear", "");
    let (time_s, inputs) = samples();
    let inputs = Inputs { time_s: &time_s, samples_si: &inputs };
    let program = Program::new(&model, &[]).unwrap();
    let mut simulator = Simulator::new(&program, &[Direction::Parameter(0), Direction::Start(0)]);
    let [parameters, starts, memories] = first_values(&model);
    let mut sum = 0.0;
    let run = || simulator.run(&inputs, [&parameters, &starts, &memories], |_, _, value, _| sum += value);
    assert_eq!(counting(run), (Ok(()), 0));
    assert!(sum != 0.0);
    let (_, calls) = counting(|| drop(vec![0_u8; 100]));
    assert!(calls > 0, "the allocator counts");
}

#[test]
fn what_runs_away_or_starts_as_no_number_is_reported() {
    let run = |rate: &str, start: f64| {
        let model = read(&format!(
            "[states.x]\nstart = {start}\nderivative = \"({rate})/1[s]\"\n[outputs.y]\nvalue = \"x\"\n"
        ));
        let time_s = [0.0, 1.0, 5.0];
        let inputs = Inputs { time_s: &time_s, samples_si: &[] };
        outputs(&model, &[], &inputs).expect_err(rate)
    };
    let at_start = run("1/x", 0.0);
    assert!(matches!(&at_start, Failure::Start { place, .. } if place == "model.toml:3:15"), "{at_start:?}");
    assert!(matches!(run("sqrt(-1 - x)", 0.0), Failure::Start { .. }));
    // x' = x^2 from 1 is infinite at 1 s.
    let away = run("x^2", 1.0);
    assert!(matches!(away, Failure::NotFinite { .. } | Failure::Steps { .. }), "{away:?}");
}
