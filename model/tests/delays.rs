//! Delays of what is integrated.

use crate::{counting, differences, first_values, outputs, read, refused, simulated};
use model::{Direction, Inputs, Program, Simulator};

const METHODS: [&str; 2] =
    ["[solver]\nrelative_tolerance = 1e-8\n", "[solver]\nmethod = \"fixed\"\nstep_s = 0.01\n"];

/// x' = -rate x(t - late) with x = start before 0.
fn delayed(late: f64, solver: &str) -> String {
    format!(
        "{solver}[parameters.rate]\nunit = \"1/s\"\nvalue = 1.3\n\
         [parameters.late]\nunit = \"s\"\nvalue = {late}\nrange = [0, 10]\n\
         [states.x]\nstart = \"fitted\"\nguess = 2\nderivative = \"-rate*delay(x, late)\"\n[outputs.y]\nvalue = \"x\"\n"
    )
}

/// Value, and derivatives by rate, delay and start, by the method of steps.
fn by_steps(t: f64, [rate, late, start]: [f64; 3]) -> [f64; 4] {
    let mut sums = [1.0, 0.0, 0.0];
    let mut factor = 1.0;
    for term in 1..60_i32 {
        let k = f64::from(term);
        let gone = t - (k - 1.0) * late;
        if gone <= 0.0 {
            break;
        }
        factor *= -rate / k;
        let value = factor * gone.powi(term);
        sums[0] += value;
        sums[1] += k / rate * value;
        sums[2] -= factor * k * (k - 1.0) * gone.powi(term - 1);
    }
    [start * sums[0], start * sums[1], start * sums[2], sums[0]]
}

fn times(count: u32, period_s: f64) -> Vec<f64> {
    (0..count).map(|row| f64::from(row) * period_s).collect()
}

/// Delays over many samples, within a step, and none, where x falls as exp(-rate t). Tolerance 1e-8 for each step, or
/// Runge-Kutta with steps of 1/100 s; of a step that reads itself the polynomial between its ends is good to 1e-7 of its
/// derivatives.
#[test]
fn a_delay_equation_has_the_solution_of_the_method_of_steps() {
    let time_s = times(60, 0.1);
    let inputs = Inputs { time_s: &time_s, samples_si: &[] };
    let directions = [Direction::Parameter(0), Direction::Parameter(1), Direction::Start(0)];
    for solver in METHODS {
        for late in [1.0, 0.777, 0.1, 0.0037, 0.0] {
            let model = read(&delayed(late, solver));
            let program = Program::new(&model, &[]).unwrap();
            let computed = simulated(&program, &directions, &inputs, &first_values(&model)).unwrap();
            for (time_s, (value, slope)) in time_s.iter().zip(&computed) {
                let exact = by_steps(*time_s, [1.3, late, 2.0]);
                let found = [*value, slope[0], slope[1], slope[2]];
                for (which, (found, exact)) in found.into_iter().zip(exact).enumerate() {
                    let away = (found - exact).abs();
                    assert!(away < 2e-6, "{solver}{late} at {time_s}, {which}: {found} for {exact}");
                }
            }
        }
    }
}

/// A mass on a spring under dry friction, a play and a force by hand, pushed by where it was and how fast.
const LATE: &str = "[inputs.u]\nunit = \"N\"\nhold = \"HOLD\"\n\
    [parameters.late]\nunit = \"s\"\nvalue = 0.13\n[parameters.gain]\nunit = \"N/m\"\nvalue = 3\n\
    [parameters.coulomb]\nunit = \"N\"\nvalue = 0.3\n[parameters.width]\nunit = \"m\"\nvalue = 0.05\n\
    [states.x]\nunit = \"m\"\nstart = \"fitted\"\nguess = 0.2\nderivative = \"v\"\n\
    [states.v]\nunit = \"m/s\"\nstart = 0\nderivative = \"(force - 20[N/m]*x - rub)/1[kg]\"\n\
    [define]\npushed = \"u + gain*x*(1 + t/10[s]) + 2[N s/m]*v\"\nforce = \"u - delay(pushed, late) - 4[N/m]*delay(w, late)\"\n\
    [memory.w]\nunit = \"m\"\nstart = 0.2\nupdate = \"min(max(w, x - width/2), x + width/2)\"\n\
    [friction.rub]\nunit = \"N\"\nvelocity = \"v\"\nsliding = \"coulomb\"\n\
    [outputs.y]\nunit = \"m\"\nvalue = \"x\"\n[outputs.now]\nunit = \"N\"\nvalue = \"pushed + rub\"\n\
    [outputs.then]\nunit = \"N\"\nvalue = \"delay(pushed + rub, 0.4[s])\"\n\
    [outputs.play]\nunit = \"m\"\nvalue = \"w\"\n[outputs.was]\nunit = \"m\"\nvalue = \"delay(w, 0.4[s])\"\n";

fn late(hold: &str) -> (String, Vec<f64>, [Vec<f64>; 1]) {
    let time_s = times(80, 0.05);
    let force = time_s.iter().map(|time_s| 2.0 * (3.0 * time_s).sin()).collect();
    (format!("[solver]\nrelative_tolerance = 1e-9\n{}", LATE.replace("HOLD", hold)), time_s, [force])
}

/// With play, sticking and a delay that is no multiple of the samples. The derivative of a play jumps where it begins to move,
/// within a step; of these, some ten in the record, the differences see the instant: 2 % of the least of the derivatives.
#[test]
fn derivatives_through_delays_play_and_friction_are_those_of_differences() {
    for hold in ["linear", "zero"] {
        let (text, time_s, samples) = late(hold);
        let model = read(&text);
        let inputs = Inputs { time_s: &time_s, samples_si: &samples };
        let program = Program::new(&model, &[]).unwrap();
        let directions = [
            Direction::Parameter(0),
            Direction::Parameter(1),
            Direction::Parameter(2),
            Direction::Parameter(3),
            Direction::Start(0),
        ];
        let values = first_values(&model);
        let computed = simulated(&program, &directions, &inputs, &values).unwrap();
        for (place, direction) in directions.iter().enumerate() {
            let differences = differences(&program, *direction, &inputs, (&values, 1e-4));
            let position = || (0..time_s.len()).map(|row| 5 * row);
            let largest = position().map(|at| computed[at].1[place].abs()).fold(0.0, f64::max);
            for at in position() {
                let away = (computed[at].1[place] - differences[at]).abs() / largest;
                assert!(away < 0.03, "{hold} {direction:?} row {}: {away}", at / 5);
            }
        }
    }
}

/// 0.4 s are 8 samples, at which steps end: what is late is what was, with its derivatives.
#[test]
fn what_is_late_is_what_was_and_before_the_start_what_starts() {
    let (text, time_s, samples) = late("linear");
    let model = read(&text);
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let program = Program::new(&model, &[]).unwrap();
    let directions = [Direction::Parameter(1), Direction::Start(0)];
    let computed = simulated(&program, &directions, &inputs, &first_values(&model)).unwrap();
    let of = |row: usize, output: usize| &computed[5 * row + output];
    for row in 0..time_s.len() {
        // A play is renewed at the first sample, before which it is what it starts from.
        for (now, then) in if row > 8 { &[(1, 2), (3, 4)][..] } else { &[] } {
            let ((now, now_slopes), (then, then_slopes)) = (of(row - 8, *now), of(row, *then));
            assert!((now - then).abs() < 1e-9, "row {row}: {then} for {now}");
            for (now, then) in now_slopes.iter().zip(then_slopes) {
                assert!((now - then).abs() < 1e-9, "row {row}: {then_slopes:?} for {now_slopes:?}");
            }
        }
    }
    // 20 N/m pull it, and friction holds 0.3 N: u + gain x (1 + t/10 s) at t = -0.4 s, and the friction of the start.
    assert!((of(0, 2).0 - (3.0 * 0.2 * 0.96 - 0.3)).abs() < 1e-12, "{:?}", of(0, 2));
    assert_eq!(of(0, 4).0, 0.2);
}

/// A rate of an input that a state changes; it was refused, and now is x' = u(t - 1) - x(t - 1) - x.
#[test]
fn an_input_that_a_state_changes_is_late_with_it() {
    let rate = |derivative: &str, more: &str| {
        let model = read(&format!(
            "[inputs.u]\nhold = \"linear\"\n[states.x]\nstart = 0.3\nderivative = \"({derivative} - x)/1[s]\"\n\
             [outputs.y]\nvalue = \"x\"\n{more}"
        ));
        let (time_s, samples) = (times(40, 0.1), [times(40, 0.2)]);
        let inputs = Inputs { time_s: &time_s, samples_si: &samples };
        outputs(&model, &[], &inputs).unwrap()
    };
    let changed = rate("delay(u, 1[s])", "[[terms]]\nname = \"back\"\nplace = \"u\"\nadd = \"-x\"\n");
    assert_eq!(changed, rate("(delay(u, 1[s]) - delay(x, 1[s]))", ""));
    assert_ne!(changed, rate("delay(u, 1[s])", ""));
}

#[test]
fn a_delay_that_cannot_be_kept_is_refused_with_its_place() {
    let state = "[inputs.u]\n[states.x]\nstart = 0\nderivative = \"-delay(x, LATE)/1[s]\"\n[outputs.y]\nvalue = \"x\"\n";
    for (late, message) in [
        ("x*1[s]", "model.toml:4:26: delay: the time by which x is late reads parameters and numbers alone"),
        ("u*1[s]", "model.toml:4:26: delay: the time by which x is late reads parameters and numbers alone"),
        ("t", "model.toml:4:25: delay: the time by which x is late reads"),
        ("-1[s]", "model.toml:4:25: delay: -1 s looks into the future"),
        ("1", "delay takes a value in s"),
    ] {
        let found = refused(&state.replace("LATE", late));
        assert!(found.contains(message), "{found}");
    }
    let found = refused("[define]\na = \"1 + delay(b, 1[s])\"\nb = \"a/2\"\n[outputs.y]\nvalue = \"a\"\n");
    assert!(found.contains("depends on itself"), "{found}");
    let held = "[states.v]\nunit = \"m/s\"\nstart = 0\nderivative = \"-(rub + delay(rub, 1[s]))/1[kg]\"\n\
                [friction.rub]\nunit = \"N\"\nvelocity = \"v\"\nsliding = \"1[N]\"\n\
                [outputs.y]\nunit = \"m/s\"\nvalue = \"v\"\n";
    let found = refused(held);
    assert!(
        found.starts_with("model.toml:4:") && found.contains("the equation of v reads an earlier rub"),
        "{found}"
    );
}

/// Room for the steps of a delay is made before the first sample, and is there in the next run.
#[test]
fn a_run_with_delays_allocates_nothing_once_there_is_room() {
    let (text, time_s, samples) = late("zero");
    for solver in ["relative_tolerance = 1e-6\n", "method = \"fixed\"\nstep_s = 0.01\n"] {
        let model = read(&text.replace("relative_tolerance = 1e-9\n", solver));
        let inputs = Inputs { time_s: &time_s, samples_si: &samples };
        let program = Program::new(&model, &[]).unwrap();
        let mut simulator = Simulator::new(&program, &[Direction::Parameter(0), Direction::Start(0)]);
        let [parameters, starts, memories] = first_values(&model);
        let mut run = || simulator.run(&inputs, [&parameters, &starts, &memories], |_, _, _, _| ());
        let (first, calls) = counting(&mut run);
        assert_eq!(first, Ok(()));
        // Times, and steps.
        assert_eq!(calls, 2, "{solver}");
        assert_eq!(counting(&mut run), (Ok(()), 0), "{solver}");
    }
}

/// A reading that is late, of a state and behind a lag, whichever stands first in the file. 0.4 s are 8 samples; all is 0
/// before.
#[test]
fn a_sensor_reads_a_state_late() {
    let dead = "[[terms]]\nname = \"dead\"\nuse = \"sensor/dead-time\"\nplace = \"y\"\nparameters.late = { value = 400 }\n";
    let lag =
        "[[terms]]\nname = \"lag\"\nuse = \"sensor/lag\"\nplace = \"y\"\nparameters.lag = { value = 0.3 }\n";
    let (time_s, samples) = (times(60, 0.05), [times(60, 1.0)]);
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let read_as = |terms: &[&str]| {
        let model = read(&format!(
            "[inputs.u]\nunit = \"V\"\nhold = \"linear\"\n[states.x]\nunit = \"V\"\nstart = 0\nderivative = \"(u - x)/0.5[s]\"\n\
             [outputs.y]\nunit = \"V\"\nvalue = \"x\"\n{}",
            terms.concat()
        ));
        outputs(&model, &[], &inputs).unwrap()
    };
    for (prompt, late) in [(&[][..], &[&[dead][..]][..]), (&[lag], &[&[dead, lag], &[lag, dead]])] {
        let prompt = read_as(prompt);
        for late in late.iter().map(|terms| read_as(terms)) {
            for row in 0..time_s.len() {
                let (was, is) = (if row < 8 { 0.0 } else { prompt[row - 8] }, late[row]);
                assert!((was - is).abs() < 1e-4, "row {row}: {is} for {was}");
            }
        }
    }
    assert!(read_as(&[])[59] > 40.0);
}
