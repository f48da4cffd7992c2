//! Dry friction that sticks and slips, against the closed form of a mass that is pulled by a spring.

use crate::{counting, differences, first_values, outputs, read, refused, refuses_each, simulated};
use model::{Direction, Failure, Inputs, Program, Simulator};

/// A mass on a spring whose other end moves slowly and evenly.
const PULLED: &str = r#"
[parameters]
mass = { unit = "kg", value = 2 }
stiffness = { unit = "N/m", value = 800 }
pull = { unit = "m/s", value = 0.01 }
sliding = { unit = "N", value = 3 }
breakaway = { unit = "N", value = 4 }
[friction.rub]
unit = "N"
velocity = "v"
sliding = "sliding"
breakaway = "breakaway"
[states.x]
unit = "m"
start = 0
derivative = "v"
[states.v]
unit = "m/s"
start = 0
derivative = "(spring - rub)/mass"
[define]
spring = "stiffness*(pull*t - x)"
[outputs.x_m]
unit = "m"
value = "x"
[outputs.rub_N]
unit = "N"
value = "rub"
"#;
const FIXED: &str = "[solver]\nmethod = \"fixed\"\nstep_s = 0.002\n";

/// Of the numbers of the file: time of the first slip, its length, the period.
fn closed_form([mass, stiffness, pull, sliding, breakaway]: [f64; 5]) -> [f64; 3] {
    let frequency = (stiffness / mass).sqrt();
    let excess = breakaway - sliding;
    // Spring less sliding force: excess cos + (stiffness pull / frequency) sin, until the speed is 0 again at -excess.
    let slip_s = 2.0 * (std::f64::consts::PI - (excess * frequency / (stiffness * pull)).atan()) / frequency;
    [breakaway / (stiffness * pull), slip_s, slip_s + 2.0 * excess / (stiffness * pull)]
}

fn times() -> Vec<f64> {
    (0..=400_u32).map(|index| f64::from(index) * 0.01).collect()
}

/// Each period takes the mass on by what the other end moves in it. Steps are good to 1e-6, and so are the instants of slips.
#[test]
fn a_pulled_mass_sticks_and_slips_with_the_period_of_the_closed_form() {
    let [first_s, slip_s, period_s] = closed_form([2.0, 800.0, 0.01, 3.0, 4.0]);
    assert!(slip_s > 0.15 && period_s > 2.0 * slip_s, "{slip_s} {period_s}");
    for solver in ["", FIXED] {
        let model = read(&format!("{PULLED}{solver}"));
        let time_s = times();
        let inputs = Inputs { time_s: &time_s, samples_si: &[] };
        let computed = outputs(&model, &[], &inputs).unwrap();
        let (mut holds, mut slides) = (0, 0);
        for (row, time_s) in time_s.iter().enumerate() {
            let [x, rub] = [computed[2 * row], computed[2 * row + 1]];
            let slips = ((time_s - first_s) / period_s).floor() + 1.0;
            let since_s = (time_s - first_s).rem_euclid(period_s);
            if *time_s < first_s || since_s > slip_s + 1e-4 {
                let slips = if *time_s < first_s { 0.0 } else { slips };
                assert!((x - slips * 0.01 * period_s).abs() < 1e-7, "{solver:?} {time_s} s: {x}");
                assert!(
                    (rub - 800.0 * (0.01 * time_s - x)).abs() < 1e-9,
                    "{time_s} s: what holds is the spring"
                );
                holds += 1;
            } else if since_s > 1e-4 && since_s < slip_s - 1e-4 {
                assert!((rub - 3.0).abs() < 1e-12, "{solver:?} {time_s} s: {rub}");
                slides += 1;
            }
        }
        assert!(holds > 200 && slides > 100, "{holds} {slides}");
    }
}

/// Central differences with relative steps of 1e-6. An instant that is good to 1e-9 of a step moves them by less than 1e-3 of the
/// largest derivative, and the samples beside a slip, at which a difference reads two phases, are left out.
#[test]
fn derivatives_go_through_stops_and_break_aways() {
    for solver in ["[solver]\nrelative_tolerance = 1e-11\n", FIXED] {
        let model = read(&format!("{PULLED}{solver}"));
        let program = Program::new(&model, &[]).unwrap();
        let time_s = times();
        let inputs = Inputs { time_s: &time_s, samples_si: &[] };
        let directions: Vec<Direction> = (0..5).map(Direction::Parameter).collect();
        let values = first_values(&model);
        let computed = simulated(&program, &directions, &inputs, &values).unwrap();
        for (place, direction) in directions.iter().enumerate() {
            let differences = differences(&program, *direction, &inputs, (&values, 1e-6));
            let of_x = |row: usize| computed[2 * row].1[place];
            let largest = (0..time_s.len()).map(|row| of_x(row).abs()).fold(0.0, f64::max);
            assert!(largest > 0.0);
            let is_wrong = |row: &usize| (of_x(*row) - differences[2 * row]).abs() > 1e-3 * largest;
            let wrong: Vec<usize> = (0..time_s.len()).filter(is_wrong).collect();
            assert!(wrong.is_empty(), "{solver:?} parameter {place}: rows {wrong:?} of {largest}");
        }
    }
}

/// 5 N hold against 4 N; 6 N for 0.2 s slide with (6 - 3) N on 2 kg; then 1 N brakes it, and it stays.
#[test]
fn an_input_that_jumps_breaks_away_at_its_sample() {
    let text = PULLED.replace("stiffness*(pull*t - x)", "force").replace("value = 4", "value = 5");
    let text = format!("[inputs.force]\nunit = \"N\"\n{text}");
    for solver in ["", FIXED] {
        let model = read(&format!("{text}{solver}"));
        let time_s: Vec<f64> = (0..20_u32).map(|index| f64::from(index) * 0.1).collect();
        let force: Vec<f64> = (0..20)
            .map(|row| match row {
                0..5 => 4.0,
                5..7 => 6.0,
                7..15 => 1.0,
                _ => -6.0,
            })
            .collect();
        let inputs = Inputs { time_s: &time_s, samples_si: &[force] };
        let computed = outputs(&model, &[], &inputs).unwrap();
        let x = |row: usize| computed[2 * row];
        assert_eq!([x(0), x(5)], [0.0, 0.0], "{solver:?}");
        // 1.5 m/s^2 for 0.2 s, then -1 m/s^2 for 0.3 s.
        assert!((x(7) - 0.03).abs() < 1e-6, "{}", x(7));
        assert!((x(12) - 0.075).abs() < 1e-6 && (x(15) - x(12)).abs() < 1e-12, "{} {}", x(12), x(15));
        // -1.5 m/s^2 from 1.5 s on.
        assert!((x(19) - 0.075 + 0.5 * 1.5 * 0.16).abs() < 1e-6, "{}", x(19));
    }
}

#[test]
fn friction_that_drives_is_reported_with_its_place() {
    let model = read(&PULLED.replace("spring - rub", "spring + rub"));
    let inputs = Inputs { time_s: &[0.0, 1.0], samples_si: &[] };
    let failure = outputs(&model, &[], &inputs).unwrap_err();
    assert!(
        matches!(&failure, Failure::Drives { place, name } if place == "model.toml:11:12" && name == "rub")
    );
    assert!(failure.to_string().contains("rub does not brake"), "{failure}");
}

#[test]
fn a_run_with_friction_allocates_nothing() {
    let model = read(PULLED);
    let program = Program::new(&model, &[]).unwrap();
    let time_s = times();
    let inputs = Inputs { time_s: &time_s, samples_si: &[] };
    let mut simulator = Simulator::new(&program, &[Direction::Parameter(3), Direction::Parameter(4)]);
    let [parameters, starts, memories] = first_values(&model);
    let run = || simulator.run(&inputs, [&parameters, &starts, &memories], |_, _, _, _| ());
    assert_eq!(counting(run), (Ok(()), 0));
}

#[test]
fn friction_that_cannot_hold_is_refused_with_line_and_column() {
    let second = "[friction.more]\nunit = \"N\"\nvelocity = \"v\"\nsliding = \"sliding\"\n[states.x]";
    refuses_each(
        PULLED,
        &[
            (
                "velocity = \"v\"",
                "velocity = \"w\"",
                "model.toml:10:13: velocity: 'w' is no state; friction holds one of x, v",
            ),
            ("velocity = \"v\"\n", "", "velocity is missing: the state that it holds at rest"),
            ("sliding = \"sliding\"\n", "", "sliding is missing: its force while it slides"),
            (
                "sliding = \"sliding\"\n",
                "sliding = \"mass\"\n",
                "model.toml:11:12: sliding of rub is in N, and this is in kg",
            ),
            (
                "(spring - rub)/mass",
                "spring/mass",
                "the equation of v does not read rub, which is to hold it",
            ),
            (
                "(spring - rub)/mass",
                "(spring - rub*abs(rub)/1[N])/mass",
                "the equation of v is not linear in rub",
            ),
            ("sliding = \"sliding\"\n", "sliding = \"sliding + rub\"\n", "rub depends on itself"),
            ("[states.x]", second, "model.toml:15:13: velocity: rub holds v already"),
            (
                "breakaway = \"b",
                "break_away = \"b",
                "unknown key friction.rub.break_away; allowed is unit, velocity, sliding, breakaway",
            ),
        ],
    );
    let one = |index: usize| {
        format!(
            "[states.w{index}]\nstart = 0\nderivative = \"-f{index}/1[s]\"\n\
             [friction.f{index}]\nvelocity = \"w{index}\"\nsliding = \"1\"\n"
        )
    };
    let many: String = (0..21).map(one).collect();
    let found = refused(&format!("{many}[outputs.y]\nvalue = \"w0\"\n"));
    assert!(
        found.starts_with("model.toml:") && found.ends_with("more than 20 frictions in one file"),
        "{found}"
    );
}
