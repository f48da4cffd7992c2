//! Declared terms in the rig file and in the plant: read as written, refused with reasons, the same as an effect of that law.

use crate::tabulated::{alike, inputs, run, same_but_for_rounding};
use plant::effects::declared::{Declared, Target};
use plant::effects::tabulated::{Balance, Tabulated, Variable};
use plant::parameters::suspects;
use plant::{Axis, Inputs, Plant, RigParameters, Setup};

/// A rig with terms: place, expression and numbers of each.
fn with(terms: &[(&str, &str, &str)]) -> RigParameters {
    read(&text(terms))
}

fn text(terms: &[(&str, &str, &str)]) -> String {
    let one = |(index, (place, add, numbers)): (usize, &(&str, &str, &str))| {
        format!("[[terms]]\nname = \"term-{index}\"\nplace = \"{place}\"\nadd = \"{add}\"\n{numbers}\n")
    };
    let terms: String = terms.iter().enumerate().map(one).collect();
    format!("{}{terms}", RigParameters::BASELINE_TOML)
}

fn read(text: &str) -> RigParameters {
    RigParameters::from_toml(text, "rig.toml").unwrap_or_else(|error| panic!("{error}"))
}

fn refused(text: &str) -> String {
    RigParameters::from_toml(text, "rig.toml").expect_err(text).to_string()
}

/// The baseline with terms as they write themselves.
fn written_again(terms: &[Declared]) -> RigParameters {
    let terms: String = terms.iter().map(|term| term.toml("terms")).collect();
    read(&format!("{}{terms}", RigParameters::BASELINE_TOML))
}

const EDDY: (&str, &str, &str) = (
    "drive.force",
    "-(c0 + c1*x)*v",
    "parameters.c0 = { unit = \"N s/m\", value = 40, range = [0, 200] }\n\
     parameters.c1 = { unit = \"N/(mm/s)/m\", value = 0.12 }",
);

#[test]
fn a_file_with_terms_is_read_as_it_was_written_numbers_to_the_bit() {
    let rig = with(&[
        EDDY,
        ("load.pressure-b-reading", "c*sin(t/1[s])", "parameters.c = { unit = \"mbar\", value = 3 }"),
    ]);
    let [eddy, drift] = rig.terms() else { panic!("two terms") };
    assert_eq!((eddy.name.as_str(), eddy.axis, eddy.target), ("term-0", Axis::Drive, Target::Force));
    assert_eq!((drift.axis, drift.target), (Axis::Load, Target::PressureB));
    let ranges: Vec<_> = eddy.numbers().iter().map(|number| number.range).collect();
    assert_eq!(ranges, [[0.0, 200.0], [0.12; 2]]);
    let changed = eddy.with(&[100.0 / 3.0, 0.12]).expect("in range");
    let again = written_again(&[changed.clone(), drift.clone()]);
    assert_eq!(again, rig.with_term(&changed));
    assert_ne!(again, rig);
    assert_eq!(rig.without_effects(), RigParameters::baseline());
    assert!(rig.has_effects() && rig.effects().is_empty() && !RigParameters::baseline().has_effects());
    assert!(eddy.with(&[200.5, 0.12]).unwrap_err().to_string().contains("c0 = 200.5: allowed are 0 to 200"));
}

#[test]
fn a_linear_brake_is_viscous_friction() {
    // b is in N/(mm/s), a factor of 1000.
    let viscous = RigParameters::baseline().numbers("friction.viscous_n_per_mm_per_s")[0];
    let thicker =
        RigParameters::baseline().with("friction.viscous_n_per_mm_per_s", &[viscous + 0.01]).unwrap();
    let brake = |axis| (axis, "-c*v", "parameters.c = { unit = \"N s/m\", value = 10 }");
    let [one, two] = [&with(&[brake("drive.force"), brake("load.force")]), &thicker].map(run);
    for axis in [0, 1] {
        let [one, two] = [&one, &two].map(|plant| plant.truth(&inputs(0)).axes[axis].position_m);
        // A friction of the step's own law and a force of its beginning: first order in the substep, 1e-4 of a damped velocity.
        assert!((one - two).abs() < 2e-5, "{one} {two}");
        let baseline = run(&RigParameters::baseline()).truth(&inputs(0)).axes[axis].position_m;
        assert!((one - baseline).abs() > 1e-4, "{one} {baseline}");
    }
}

#[test]
fn a_force_is_a_table_of_the_same_law_and_a_flow_one_of_the_same_mass() {
    let table = |balance, variable, at: [f64; 2], value: [f64; 2]| Tabulated {
        axis: Axis::Load,
        balance,
        variable,
        at: at.to_vec(),
        value: value.to_vec(),
    };
    let tabulated = |table| RigParameters::baseline().with_tabulated(&[table]).expect("good");
    alike(
        &with(&[("load.force", "40[N/m]*x - 3[N]", "")]),
        &tabulated(table(Balance::Force, Variable::Extension, [0.0, 0.5], [-3.0, 17.0])),
    );
    // 6 Nl/min are 1e-4 m^3/s of 101325/(287*293.15) kg/m^3.
    let flow = 1e-4 * 101_325.0 / (287.0 * 293.15);
    alike(
        &with(&[("load.flow-b", "q*s", &format!("parameters.q = {{ unit = \"kg/s\", value = {flow:?} }}"))]),
        &tabulated(table(Balance::FlowB, Variable::Spool, [-1.0, 1.0], [-6.0, 6.0])),
    );
}

#[test]
fn a_table_of_the_term_or_of_the_file_is_the_same_curve_in_a_table_of_the_rig() {
    let term_table =
        "tables.lift = { x_unit = \"mm\", y_unit = \"N\", x = [0, 100, 500], y = [0, 20, -7.5] }";
    let rig = with(&[("load.force", "2*lift(x)", term_table)]);
    let at = vec![0.0, 0.1, 0.5];
    let (axis, balance, variable) = (Axis::Load, Balance::Force, Variable::Extension);
    let tabulated = Tabulated { axis, balance, variable, at, value: vec![0.0, 40.0, -15.0] };
    alike(&rig, &RigParameters::baseline().with_tabulated(&[tabulated]).expect("good"));

    // Under the file's tables; a term's own comes first, and one that nothing reads is not the term's.
    let of_file = "[tables.lift]\nx_unit = \"mm\"\ny_unit = \"kN\"\nx = [0, 100, 500]\ny = [0, 0.02, -0.0075]\n\
                   [tables.other]\nx = [0, 1]\ny = [0.1, 1e-7]\n";
    let both = text(&[("load.force", "lift(x)", ""), ("drive.force", "lift(x)", term_table)]);
    let both = read(&format!("{both}{of_file}"));
    alike(&both, &with(&[("load.force", "lift(x)", term_table), ("drive.force", "lift(x)", term_table)]));
    let again: String = both.terms().iter().map(|term| term.toml("terms")).collect();
    assert!(!again.contains("other") && again.contains("y_unit = \"kN\""), "{again}");
    assert_eq!(written_again(both.terms()), both);
    let suspect = "[[suspects]]\nname = \"lift\"\nplace = \"load.force\"\nadd = \"c*lift(x)\"\n\
                   parameters.c = { range = [0, 3] }\n";
    let suspect =
        suspects(&format!("{suspect}{of_file}"), "s.toml").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(suspects(&suspect[0].toml("suspects"), "s.toml").expect("written as it is read"), suspect);
}

#[test]
fn a_table_that_is_none_is_refused_at_its_key() {
    for (add, table, message) in [
        ("f(x)*1[N]", "x = [0, 1], y = [0, 1]", "f is over 1, and this is in m"),
        ("f(s)", "x = [0, 1], y = [0, 1]", "drive.force is in N, and this is in 1"),
        ("1[N]/f(s)", "x = [0, 1], y = [0, 1]", "divides by a value that may be 0 (0 to 1)"),
        ("1[N]*f(s)", "x = [0, 0], y = [0, 1]", "x: each point must be larger"),
        ("1[N]*f(s)", "x = [0, 1], y = [0, 1, 2]", "y: 3 values for 2 points of x"),
        ("1[N]*f(s)", "x = [0, 1], y = [0, 1], z = 3", "z"),
        ("1[N]*g(s)", "x = [0, 1], y = [0, 1]", "'g' is no function; known are abs, "),
    ] {
        let table = format!("tables.f = {{ {table} }}");
        let error = refused(&text(&[("drive.force", add, &table)]));
        assert!(error.starts_with("rig.toml:") && error.contains(message), "{add}\n{error}");
    }
    let taken = text(&[("drive.force", "0", "tables.sin = { x = [0, 1], y = [0, 1] }")]);
    let error = refused(&taken);
    assert!(error.contains("sin: the name has a meaning in expressions"), "{error}");
}

/// F is the carriage's inertia on the drive, and the hand on the load: both are known without a term.
#[test]
fn a_force_over_the_force_sensor_is_the_mass_or_the_hand_that_it_shows() {
    // m a = S + k m_c a: as a mass of m - k m_c, 5 kg and half of 3.5 kg.
    let heavier = RigParameters::baseline().with("mass.drive_kg", &[6.75]).expect("good");
    let [term, heavier] = [&with(&[("drive.force", "-0.5*F", "")]), &heavier].map(run);
    let [one, two, bare] = [&term, &heavier, &run(&RigParameters::baseline())]
        .map(|plant| plant.truth(&inputs(0)).axes[0].position_m);
    // F is 0.1 ms old.
    assert!((one - two).abs() < 2e-5, "{one} {two}");
    assert!((one - bare).abs() > 2e-4, "{one} {bare}");

    let pushed = |rig: &RigParameters, hand_force_load_n: f64| {
        let mut plant = Plant::new(rig, &Setup::default()).expect("good");
        let inputs = |period| Inputs { hand_force_load_n, ..inputs(period) };
        (0..1000).for_each(|period| plant.step(&inputs(period)));
        plant.truth(&inputs(1000)).axes[1]
    };
    let [one, two] =
        [pushed(&with(&[("load.force", "0.25*F", "")]), -80.0), pushed(&RigParameters::baseline(), -60.0)];
    assert_eq!((one.sensor_force_n, one.effect_force_n), (-80.0, -20.0));
    assert!((one.position_m - two.position_m).abs() < 2e-5, "{} {}", one.position_m, two.position_m);
}

#[test]
fn a_flow_and_what_is_kept_may_follow_the_force_sensor() {
    let low =
        "memory.w = { unit = \"N\", range = [-500, 500], start = \"F\", update = \"w + (F - w)*dt/50[ms]\" }";
    let rig = with(&[
        ("load.pressure-a-reading", "1[Pa/N]*w", low),
        ("load.flow-a", "1e-6[kg/(s N)]*F", ""),
        ("load.force", "-1*w", low),
    ]);
    let mut plant = Plant::new(&rig, &Setup::default()).expect("good");
    let hand = Inputs { hand_force_load_n: -30.0, ..Inputs::default() };
    (0..1000).for_each(|_| plant.step(&hand));
    let truth = plant.truth(&hand);
    // Twenty time constants: the rest is below a rounding of the sum.
    assert!((plant.noise_free_readings(&truth)[1][2] - truth.axes[1].pressure_a_pa + 30.0).abs() < 1e-4);
    assert!((truth.axes[1].effect_force_n - 30.0).abs() < 1e-6, "{}", truth.axes[1].effect_force_n);
    let flow = plant.term_names().iter().position(|name| name == "load_leakage_declared_a_m3_per_s");
    let flow = plant.terms(&hand).values()[flow.expect("a term")];
    // -3e-5 kg/s of 1.204 kg/m^3, whole as long as the chamber is at exhaust pressure.
    assert!((flow + 3e-5 / (101_325.0 / (287.0 * 293.15))).abs() < 1e-6, "{flow}");
}

/// As files did before F was known in forces.
#[test]
fn a_number_of_a_force_may_be_called_as_the_force_sensor() {
    let with_number = |name: &str| {
        let number = format!("parameters.{name} = {{ unit = \"N\", value = 7 }}");
        with(&[("drive.force", &format!("-{name}*tanh(v/1[mm/s])"), &number)])
    };
    alike(&with_number("F"), &with_number("G"));
}

#[test]
fn a_reading_is_the_truth_and_its_term_and_leaves_the_motion_alone() {
    let rig = with(&[
        ("drive.position-reading", "1[mm] + 1e-3*x", ""),
        ("drive.force-reading", "0.02*F", ""),
        ("load.pressure-a-reading", "100[Pa]*u + 10[Pa/s]*t", ""),
    ]);
    let mut plant = Plant::new(&rig, &Setup::default()).expect("good");
    let mut bare = Plant::new(&RigParameters::baseline(), &Setup::default()).expect("good");
    (0..2000).for_each(|period| {
        plant.step(&inputs(period));
        bare.step(&inputs(period));
    });
    let (truth, expected) = (plant.truth(&inputs(2000)), bare.truth(&inputs(2000)));
    same_but_for_rounding(&truth, &expected);
    let (shown, [drive, load]) = (plant.noise_free_readings(&truth), truth.axes);
    assert!((shown[0][0] - (1.001 * drive.position_m + 1e-3)).abs() < 1e-12);
    assert!((shown[0][1] - 1.02 * drive.sensor_force_n).abs() < 1e-9);
    let acts = inputs(1999).valve[1];
    assert!((shown[1][2] - (load.pressure_a_pa + 100.0 * acts + 20.0)).abs() < 1e-6, "{}", shown[1][2]);
    assert_eq!(shown[1][3], load.pressure_b_pa);
    assert_eq!(
        plant.term_names(),
        [
            "drive_position_reading_declared_reading_position_m",
            "drive_force_reading_declared_reading_force_N",
            "load_pressure_reading_declared_reading_a_Pa"
        ]
    );
}

const LOW_PASS: &str =
    "{ unit = \"m\", range = [0, 1], start = \"x\", update = \"w + (x - w)*(1 - exp(-dt/5[ms]))\" }";

#[test]
fn a_reading_that_remembers_is_a_lagging_sensor() {
    let term = with(&[("drive.position-reading", "w - x", &format!("memory.w = {LOW_PASS}"))]);
    let effect = [("time_constant_ms", 5.0)];
    let lagging =
        RigParameters::baseline().with_effect("position-sensor-lag", "drive", &effect).expect("good");
    let [mut term, mut lagging] =
        [&term, &lagging].map(|rig| Plant::new(rig, &Setup::default()).expect("good"));
    let mut most_m = 0.0_f64;
    for period in 0..2000 {
        let [one, two] =
            [&term, &lagging].map(|plant| plant.noise_free_readings(&plant.truth(&inputs(period)))[0][0]);
        // It sees the end of a substep held, and the sensor a straight line: half a substep of a fast stroke.
        assert!((one - two).abs() < 5e-5, "{period}: {one} {two}");
        most_m = most_m.max((one - term.truth(&inputs(period)).axes[0].position_m).abs());
        term.step(&inputs(period));
        lagging.step(&inputs(period));
    }
    assert!(most_m > 1e-3, "it lags by {most_m} m");
}

#[test]
fn a_play_moves_only_when_the_axis_has_taken_it_up() {
    let play =
        "memory.w = { unit = \"m\", range = [-1, 1], start = \"x\", update = \"min(max(w, x - g), x + g)\" }";
    let gap = "parameters.g = { unit = \"mm\", value = 2, range = [0, 10] }";
    // Two that remember on one axis, and one on the other that does not.
    let rig = with(&[
        ("load.pressure-b-reading", "1[Pa]", ""),
        ("drive.pressure-a-reading", "1e5[Pa/m]*(x - w)", &format!("{play}\n{gap}")),
        ("drive.pressure-b-reading", "1e5[Pa/m]*w", &format!("memory.w = {LOW_PASS}")),
    ]);
    let mut plant = Plant::new(&rig, &Setup::default()).expect("good");
    let mut off = [0.0_f64; 2];
    for period in 0..3000 {
        let truth = plant.truth(&inputs(period));
        let by = plant.noise_free_readings(&truth)[0][2] - truth.axes[0].pressure_a_pa;
        off = [off[0].min(by), off[1].max(by)];
        plant.step(&inputs(period));
    }
    // Taken up to both sides, and never beyond, but for what the axis goes within a substep.
    assert!(off[0] < -199.0 && off[0] > -206.0 && off[1] > 199.0 && off[1] < 206.0, "{off:?}");
    let [_, with_play, _] = rig.terms() else { panic!("three terms") };
    assert_eq!((with_play.memory[0].name.as_str(), with_play.memory[0].range), ("w", [-1.0, 1.0]));
    assert_eq!(written_again(rig.terms()), rig);
}

#[test]
fn what_a_term_keeps_is_refused_where_it_cannot_run() {
    let memory = |range: &str, start: &str, update: &str| {
        format!("memory.w = {{ unit = \"m\", range = {range}, start = \"{start}\", update = \"{update}\" }}")
    };
    let c = "parameters.dt = { unit = \"N/m\", value = 4 }";
    for (add, numbers, message) in [
        ("1[N/m]*w", memory("[0, 1]", "x", "w + v"), "sum of 'w' in m and 'v' in m/s"),
        ("1[N/m]*w", memory("[0, 1]", "w", "x"), "'w' is unknown here"),
        ("1[N/m]*w", memory("[0, 1]", "x", "x/v*1[m/s]"), "divides by a value that may be 0"),
        ("1[N/m]*w", memory("[1, 1]", "x", "x"), "range: needed are two numbers"),
        ("1[N/m]/w*1[m^2]", memory("[0, 1]", "x", "x"), "divides by a value that may be 0 (0 to 1)"),
        (
            "1[N/m]*w",
            "memory.w = { unit = \"m\", range = [0, 1], update = \"x\" }".to_owned(),
            "start is missing",
        ),
        ("1[N/m]*w", memory("[0, 1]", "x", "x").replace(".w", ".x"), "memory.x: a variable has this name"),
        ("dt*w", format!("{}\n{c}", memory("[0, 1]", "x", "x")), "parameters.dt: a variable has this name"),
        (
            "1[N/m]*w",
            ["a", "b", "w"]
                .map(|name| memory("[0, 1]", "x", "x").replace(".w", &format!(".{name}")))
                .join("\n"),
            "more than 2 names under memory",
        ),
    ] {
        let error = refused(&text(&[("drive.force", add, &numbers)]));
        assert!(error.starts_with("rig.toml:") && error.contains(message), "{numbers}\n{error}");
    }
}

#[test]
fn two_terms_act_as_their_sum_and_a_force_is_held_at_2000_newton() {
    let half = ("drive.force", "-20[N s/m]*v", "");
    alike(&with(&[half, half]), &with(&[("drive.force", "-40[N s/m]*v", "")]));
    let plant = run(&with(&[("drive.force", "1e6[N]", "")]));
    assert_eq!(plant.truth(&inputs(0)).axes[0].effect_force_n, 2000.0);
    assert_eq!(plant.term_names(), ["drive_force_declared_N"]);
    assert!(plant.state().is_finite());
}

#[test]
fn whatever_is_wrong_is_named_with_line_column_and_what_is_allowed() {
    let first = RigParameters::BASELINE_TOML.lines().count() + 1;
    let number = "parameters.c = { unit = \"N s/m\", value = 4, range = [0, 200] }";
    for (place, add, numbers, line, column, message) in [
        ("drive.torque", "0", "", 2, 10, "place = \"drive.torque\"; allowed is drive.force, drive.flow-a, "),
        (
            "drive.force",
            "-c*v*w",
            number,
            3,
            13,
            "'w' is unknown here; known are pi, x, v, p_a, p_b, u, s, t, F, c",
        ),
        ("drive.force", "-c*x", number, 3, 8, "drive.force is in N, and this is in N s"),
        ("drive.force", "c*v/v*1[m/s]", number, 3, 11, "divides by a value that may be 0 (-1000 to 1000)"),
        (
            "drive.force",
            "exp(abs(v)/1[mm/s])*1[N]",
            "",
            3,
            8,
            "counts as not finite: bound it by min and max",
        ),
        (
            "drive.force",
            "-c*v",
            "parameters.c = { unit = \"N s/m\", value = 400, range = [0, 200] }",
            4,
            55,
            "range: 0 to 200 must hold",
        ),
        ("drive.force", "-c*v", "parameters.c = { unit = \"N sx/m\", value = 4 }", 4, 28, "'sx' is no unit"),
        ("drive.force", "-c*v", "parameters.c = { unit = \"N s/m\" }", 4, 16, "value: needed is one number"),
        ("drive.force", "0", "parameters.v = { value = 4 }", 0, 1, "parameters.v: a variable has this name"),
        ("drive.force", "0", "gain = 3", 4, 1, "gain; allowed is"),
    ] {
        let text = text(&[(place, add, numbers)]);
        let error = RigParameters::from_toml(&text, "my-rig.toml").expect_err(add).to_string();
        assert!(error.starts_with(&format!("my-rig.toml:{}:{column}: ", first + line)), "{add}\n{error}");
        assert!(error.contains(message), "{add}\n{error}");
    }
    let twice = text(&[EDDY, EDDY]).replace("term-1", "term-0");
    let error = refused(&twice);
    assert!(error.contains("name: term-0 is at drive.force already"), "{error}");
    let catalogue = text(&[EDDY]).replace("term-0", "inclination");
    let error = refused(&catalogue);
    assert!(error.contains("an effect of the catalogue has it"), "{error}");
}

#[test]
fn a_suspect_adds_nothing_while_it_is_off() {
    let file = |add: &str, numbers: &str| {
        format!("[[suspects]]\nname = \"eddy\"\nplace = \"drive.force\"\nadd = \"{add}\"\n{numbers}\n")
    };
    let c = "parameters.c = { unit = \"N s/m\", range = [0, 200], prior = 50 }";
    let good =
        suspects(&file("-c*v", &format!("{c}\ntwins = [\"friction-asymmetry\"]")), "s.toml").expect("good");
    assert_eq!((good[0].numbers()[0].prior, good[0].numbers()[0].value), (Some(50.0), 0.0));
    assert_eq!(good[0].twins, ["friction-asymmetry"]);
    assert_eq!(suspects(&good[0].toml("suspects"), "s.toml").expect("written as it is read"), good);
    for (text, message) in [
        (file("3[N] - c*v", c), "s.toml:4:8: where c is 0 a suspect adds nothing, and this adds 3 N"),
        (
            file("-c*v", "parameters.c = { unit = \"N s/m\", value = 1, range = [0, 9] }"),
            "is its amplitude, and has no value",
        ),
        (
            file(
                "-c*v + 1[N/m]*w",
                &format!(
                    "{c}\nmemory.w = {{ unit = \"m\", range = [0, 1], start = \"0[m]\", update = \"x\" }}"
                ),
            ),
            "where c is 0 a suspect adds nothing, and this adds 1 N",
        ),
        (file("-c*v", "parameters.c = { unit = \"N s/m\" }"), "range: needed are two numbers"),
        (format!("gain = 1\n{}", file("-c*v", c)), "unknown key gain"),
        ("[[terms]]\n".to_owned(), "unknown key terms"),
        (String::new(), "no [[suspects]] in this file"),
    ] {
        let error = suspects(&text, "s.toml").expect_err(&text).to_string();
        assert!(error.starts_with("s.toml:") && error.contains(message), "{text}\n{error}");
    }
}

/// A fuzz target takes a seed that is refused without a word.
#[test]
fn the_fuzz_seed_of_suspects_is_a_file_of_them() {
    let text = include_str!("../../fuzz/seeds/rig_toml/suspects");
    assert_eq!(suspects(text, "suspects").unwrap_or_else(|error| panic!("{error}")).len(), 2);
}
