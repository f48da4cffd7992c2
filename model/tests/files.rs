//! Model files that are accepted, and those that are refused with line and column.

use crate::{read, refused, refuses_each};
use model::{Change, Hold, Inputs, Solver, Start, Target};

const TANK: &str = r#"# A tank with a leak.
name = "Tank"

[record]
time = "t_ms"
unit = "ms"

[inputs.pump]
column = "pump_V"
unit = "V"

[parameters]
gain = { unit = "mm/(V s)", value = 5.0, range = [0, 100] }
outflow = { unit = "m^0.5/s", value = 0.01, tolerance = 0.002 }

[states.level]
unit = "mm"
start = "level_mm"
derivative = "gain*pump - outflow*sqrt(max(level, 0))"

[outputs.level_mm]
unit = "mm"
value = "level"
noise = 0.5

[[suspects]]
name = "leak"
place = "level"
add = "-rate*level"
parameters.rate = { unit = "1/h", value = [1, 10] }
"#;

#[test]
fn a_file_is_read_in_si() {
    let model = read(TANK);
    assert_eq!((model.name.as_str(), model.record.time_unit_s), ("Tank", 1e-3));
    assert_eq!((model.inputs[0].hold, model.inputs[0].column.as_str()), (Hold::Zero, "pump_V"));
    let names: Vec<_> = model.parameters.iter().map(|one| (one.name.as_str(), one.suspect)).collect();
    assert_eq!(names, [("gain", None), ("outflow", None), ("rate", Some(0))]);
    assert_eq!(model.parameters[0].values_si, [5e-3]);
    assert_eq!(model.parameters[0].range_si, [0.0, 0.1]);
    assert_eq!(model.parameters[1].tolerance_si, Some(0.002));
    assert_eq!(model.parameters[2].values_si, [1.0 / 3600.0, 10.0 / 3600.0]);
    assert_eq!(model.states[0].start, Start::Record { output: 0 });
    assert_eq!(model.outputs[0].noise_si, Some(0.5e-3));
    assert_eq!((model.suspects[0].target, model.suspects[0].change), (Target::State(0), Change::Add));
    assert_eq!(model.solver, Solver::Adaptive { relative_tolerance: 1e-6 });
    assert_eq!(model.parameters_of(&[]).collect::<Vec<_>>(), [0, 1]);
}

#[test]
fn an_error_has_line_and_column_and_says_what_is_allowed() {
    refuses_each(
        TANK,
        &[
            (
                "gain*pump",
                "gian*pump",
                "model.toml:19:15: 'gian' is unknown here; known are t, pi, pump, level, gain, outflow",
            ),
            (
                "sqrt(max(level, 0))",
                "level",
                "model.toml:19:25: sum of 'gain*…' in mm/s and 'outflow*…' in mm^1.5/s; the rate of level is in mm/s",
            ),
            (
                "gain*pump - outflow*sqrt(max(level, 0))",
                "gain",
                "model.toml:19:15: the rate of level is in mm/s, and this is in mm/(V s)",
            ),
            ("derivative = ", "derivatif = ", "states.level.derivative is missing"),
            ("max(level, 0)", "max(level)", "model.toml:19:40: max has 1 arguments; it takes 2 or more"),
            ("max(level, 0)", "maxi(level, 0)", "model.toml:19:40: 'maxi' is no function"),
            ("max(level, 0)", "max(level, 0", "model.toml:19:53: a comma or ) is missing"),
            ("mm/(V s)", "mm/(V sx)", "model.toml:13:24: 'sx' is no unit"),
            (
                "value = 5.0, range = [0, 100]",
                "value = 500.0, range = [0, 100]",
                "model.toml:13:37: parameters.gain.value: 500 is not within its range, 0 to 100",
            ),
            ("start = \"level_mm\"", "start = \"height\"", "model.toml:18:10: 'height' is no output"),
            ("start = \"level_mm\"", "", "model.toml:16:1: states.level.start is missing"),
            (
                "place = \"level\"",
                "place = \"levle\"",
                "model.toml:28:10: 'levle' is no input, state, definition or output of this model; it has pump, level",
            ),
            (
                "range = [0, 100]",
                "range = [100, 0]",
                "range: [100.0, 0.0] is none; allowed is [least, largest], the least first",
            ),
            ("mm/(V s)", "degC", "'degC' has an offset: write K"),
            ("add = ", "addd = ", "suspects[1].one of add, multiply, replace is missing"),
            ("-rate*level", "-rate", "leak is in mm/s, and this is in 1/h"),
            (
                "value = 5.0, range = [0, 100]",
                "values = { \"a.csv\" = 5 }, range = [0, 100]",
                "model.toml:13:63: parameters.gain.range: the number is known of each record under values, and has none",
            ),
            (
                "value = 5.0, range = [0, 100]",
                "values = { \"a.csv\" = [5, 6] }",
                "parameters.gain.values.a.csv: allowed is one number",
            ),
            (
                "value = 5.0, range = [0, 100]",
                "values = {}",
                "values is empty: the file name of each record, and its value",
            ),
            ("noise = 0.5", "noise = -1", "model.toml:24:9: outputs.level_mm.noise: allowed is one number"),
            ("noise = 0.5", "nose = 0.5", "model.toml:24:1: unknown key outputs.level_mm.nose; allowed is"),
            ("[inputs.pump]", "[inputs.level]", "states.level.the name is taken"),
            ("[inputs.pump]", "[inputs.sqrt]", "the name has a meaning in expressions"),
            ("unit = \"ms\"", "unit = \"m\"", "no unit of time; allowed is s, ms, us, min, h, or iso8601"),
            (
                "[outputs.level_mm]",
                "[output.level_mm]",
                "unknown key output; allowed is name, record, solver, held_out, ",
            ),
            ("[outputs.level_mm]", "[output.level_mm]", ", suspects: did you mean outputs?"),
            ("[parameters]", "[paramters]", "did you mean parameters?"),
        ],
    );
}

#[test]
fn constants_that_are_no_numbers_are_refused_at_their_operator() {
    for (value, column, message) in [
        ("1/0", 11, "this divides by 0"),
        ("t/(2[s] - 2[s])", 11, "this divides by 0"),
        ("1 + sqrt(-1)", 14, "no finite number: not a number"),
        ("log(0)", 10, "no finite number: -inf"),
        ("1e308*1e308", 15, "no finite number: inf"),
        ("(-8)^(1/3)", 14, "no finite number: not a number"),
    ] {
        let found = refused(&with_output("", value));
        let place = format!("model.toml:3:{column}: ");
        assert!(found.starts_with(&place) && found.contains(message), "{value}: {found}");
    }
}

#[test]
fn a_flat_sum_of_a_thousand_terms_is_no_nesting() {
    let sum = vec!["1"; 1000].join("+");
    assert_eq!(read(&with_output("", &sum)).outputs.len(), 1);
}

/// A fuzz target takes a seed that is refused without a word.
#[test]
fn the_fuzz_seed_of_libraries_is_a_model() {
    assert_eq!(read(include_str!("../../fuzz/seeds/model_toml/library.toml")).suspects.len(), 5);
}

#[test]
fn every_value_has_one_unit() {
    let lines = "[inputs.u]\nunit = \"V\"\n";
    let of = |value: &str| with_output(lines, value);
    for (value, message) in [
        ("0*u", "y is in 1, and this is in V"),
        ("0/u", "y is in 1, and this is in 1/V"),
        ("if(u, 1, 2)", "if takes a condition, and this is in V: compare it"),
        ("u and 1", "and takes a condition, and this is in V"),
        ("1 or u", "or takes a condition, and this is in V"),
        ("not(u)", "not takes a condition, and this is in V"),
        ("sqrt(1[m^0.08333333333])", "sqrt of a value in m^"),
    ] {
        let found = refused(&of(value));
        assert!(found.starts_with("model.toml:") && found.contains(message), "{value}: {found}");
    }
    read(&of("if(u > 0 and not(t > 1[s]), 1, 0) + 0*u/1[V]"));
    // What a suspect adds to a bare 0 has no unit, and what reads it sees that.
    let changed = "[define]\nextra = \"0\"\n[outputs.y]\nunit = \"V\"\nvalue = \"u + extra\"\n\
                   [[suspects]]\nname = \"s\"\nplace = \"extra\"\nadd = \"k\"\nparameters.k.value = 1\n";
    let found = refused(&format!("{lines}{changed}"));
    assert!(found.contains("sum of 'u' in V and 'extra' in 1"), "{found}");
    read(&format!(
        "{lines}{}",
        changed.replace("\"0\"", "\"0[V]\"").replace("k.value", "k.unit = \"V\"\nparameters.k.value")
    ));
}

#[test]
fn a_delay_looks_back() {
    for (lines, by, message) in [
        ("", "-0.1[s]", "model.toml:6:19: delay: -0.1 s looks into the future"),
        (
            "[parameters.d]\nunit = \"ms\"\nvalue = 1\nrange = [-2, 5]\n",
            "d",
            "delay: 'd' may be -2 ms: a delay",
        ),
        ("[parameters.d]\nunit = \"s\"\nvalue = -1\n", "d", "delay: 'd' may be -1 s"),
    ] {
        let text = with_output(&format!("[inputs.u]\nunit = \"1\"\n\n{lines}"), &format!("delay(u, {by})"));
        let found = refused(&text);
        assert!(found.contains(message), "{found}");
    }
}

fn with_output(lines: &str, value: &str) -> String {
    format!("{lines}\n[outputs.y]\nvalue = \"{value}\"\n")
}

#[test]
fn hostile_files_are_refused_with_line_and_column() {
    let terms = vec!["t/1[s]"; 1_000_000].join("+");
    let brackets = format!("{}1{}", "(".repeat(5000), ")".repeat(5000));
    let mut chain = String::from("[define]\na0 = \"1\"\n");
    (1..400).for_each(|index| chain += &format!("a{index} = \"a{} + 1\"\n", index - 1));
    for (text, message) in [
        (with_output("", &terms), "more than 10000 numbers, names and operators in this file"),
        (with_output("", &brackets), "nested deeper than 64"),
        (
            with_output("[parameters]\nk = 3", "k"),
            "model.toml:2:5: parameters.k = 3 must be a table: write parameters.k = { unit = \"kg\", value = 2 }",
        ),
        (
            "[outputs]\ny = \"x\"".to_owned(),
            "model.toml:2:5: outputs.y = \"x\" must be a table: write outputs.y = { unit = \"m\", value = \"x\" }",
        ),
        (
            "[[outputs]]\nname = \"y\"".to_owned(),
            "outputs must be a table and no list: write outputs.NAME = { unit = \"m\", value = \"x\" }",
        ),
        (with_output("record = 3", "1"), "record = 3 must be a table: write [record] with its keys below"),
        (
            with_output("[tables.f]\nx = [1]\ny = [2]", "f(1)"),
            "model.toml:2:5: tables.f.x: a table has 2 to 10000 points",
        ),
        (with_output("[tables.f]\nx = [1, 1]\ny = [2, 3]", "f(1)"), "larger than the one before"),
        (with_output("[tables.f]\nx = [1, nan]\ny = [2, 3]", "f(1)"), "a finite number"),
        (with_output("[define]\na = \"b\"\nb = \"a\"", "a"), "depends on itself"),
        (with_output(&chain, "a399"), "more than 32 deep"),
        (with_output("", "1e400"), "no finite number"),
        (with_output("", "delay(1, 2)"), "delay takes a value in s"),
        (with_output("[parameters.p]\nvalue = [1,2,3,4,5,6,7,8,9]", "p"), "up to 8"),
    ] {
        let found = refused(&text);
        assert!(found.contains(message), "{found}\n  {message}");
        let mut place = found.split(':').skip(1);
        assert!(place.next().is_some_and(|line| line.parse::<usize>().is_ok()), "{found}");
        assert!(place.next().is_some_and(|column| column.parse::<usize>().is_ok()), "{found}");
    }
}

#[test]
fn suspects_that_depend_on_each_other_in_a_circle_are_refused() {
    let text = "[define]\na = \"1\"\nb = \"a\"\n[outputs.y]\nvalue = \"b\"\n\
                [[suspects]]\nname = \"back\"\nplace = \"a\"\nadd = \"b\"\n";
    let found = refused(text);
    assert!(found.starts_with("model.toml:9:8: b depends on itself by way of b, a"), "{found}");
}

/// A balance: nothing is integrated, speed and acceleration come from the measured position.
const BALANCE: &str = r#"[rows]
where = "abs(v) > slow and t > 1[s]"
every = 20
folds = { position = "x", speed = "abs(v)" }
[inputs.x]
unit = "mm"
low_pass_hz = 100
[inputs.v]
rate_of = "x"
unit = "m/s"
[parameters]
slow = { unit = "mm/s", value = 3, fixed = true }
mass = { unit = "kg", value = 1 }
[outputs.force]
scale = 35.2
unit = "N"
value = "mass*v/1[s]"
[[suspects]]
name = "drag"
effect = "friction"
place = "force"
add = "c*v"
local = true
parameters.c = { unit = "N s/m", value = 1 }
[[terms]]
name = "weight"
place = "force"
add = "w"
parameters.w = { unit = "N", value = 1 }
"#;

#[test]
fn a_balance_reads_rates_rows_and_terms() {
    let model = read(BALANCE);
    assert_eq!((model.inputs[1].rate_of, model.inputs[0].smoothing.low_pass_hz), (Some(0), 100.0));
    assert_eq!((model.rows.every, model.rows.folds.len(), model.outputs[0].scale), (20, 2, 35.2));
    let names: Vec<_> = model.suspects.iter().map(|one| (one.name.as_str(), one.is_term)).collect();
    assert_eq!(names, [("weight", true), ("drag", false)], "terms are a part of the model and come first");
    // A term's number is always read, a suspect's with the suspect.
    let read_with = |suspects: &[usize]| -> Vec<String> {
        model.parameters_of(suspects).map(|index| model.parameters[index].name.clone()).collect()
    };
    assert_eq!(read_with(&[]), ["slow", "mass", "w"]);
    assert_eq!(read_with(&[1]), ["slow", "mass", "w", "c"]);
    let inputs = Inputs { time_s: &[0.0, 2.0, 3.0], samples_si: &[vec![0.0; 3], vec![0.01, 0.01, -0.001]] };
    let counts = model.at_samples(model.rows.condition.as_ref().unwrap(), &inputs);
    assert_eq!(counts, [0.0, 1.0, 0.0]);
}

#[test]
fn rates_and_rows_that_cannot_be_computed_are_refused() {
    refuses_each(
        BALANCE,
        &[
            ("rate_of = \"x\"", "rate_of = \"v\"", "'v' is no input that stands before this one"),
            ("unit = \"m/s\"", "unit = \"m\"", "the unit of this input is not that of x over a time"),
            ("rate_of = \"x\"", "rate_of = \"x\"\ncolumn = \"v\"", "it is the rate of another input"),
            ("abs(v) > slow", "abs(v) > mass", "comparison of 'mass' in kg and 'abs(…)' in m/s"),
            (
                "and t > 1[s]",
                "and mass > 1[kg]",
                "'mass': rows and folds read inputs and fixed numbers alone",
            ),
            (
                "value = 3, fixed = true",
                "values = { \"a.csv\" = 3 }",
                "'slow': rows and folds read inputs and fixed numbers alone",
            ),
            ("low_pass_hz = 100", "moving_average = 4", "allowed is an odd number"),
            ("scale = 35.2", "scale = 0", "allowed is a number that is not 0"),
            ("every = 20", "every = 0", "allowed is one number, 1 to 1000"),
        ],
    );
}

#[test]
fn what_belongs_to_a_suspect_is_unknown_elsewhere() {
    let text = "[parameters.p]\nvalue = 1\n[outputs.y]\nvalue = \"p\"\n\
                [[suspects]]\nname = \"one\"\nplace = \"y\"\nadd = \"q\"\nparameters.q = { value = 1 }\n\
                [[suspects]]\nname = \"two\"\nplace = \"y\"\nadd = \"q\"\nparameters.r = { value = 1 }\n";
    assert!(refused(text).contains("'q' is unknown here; known are t, pi, p, r"), "{}", refused(text));
    let model = read(&text.replace("parameters.r", "parameters.q"));
    assert_eq!(model.parameters.len(), 3);
}
