//! Laws of a library in a file of suspects: bound to the variables of the rig, or refused with file, line and column.

use plant::parameters::{Law, LawNumber, LawVariable, suspects, suspects_using};

fn number(name: &str, unit: &str, value_si: Option<f64>, range_si: [f64; 2]) -> LawNumber {
    let (name, unit) = (name.to_owned(), unit.to_owned());
    LawNumber { name, unit, value_si, range_si, is_fixed: false, is_amplitude: false }
}

/// A ripple over a load, with a number that is called as a variable of the rig, one that is fixed, and a default.
fn ripple(used: &str) -> Result<Law, String> {
    if used != "friction/ripple" {
        return Err(format!("'{used}' is not there"));
    }
    let variable = |name: &str, default: Option<&str>| LawVariable {
        name: name.to_owned(),
        about: "something".to_owned(),
        default: default.map(str::to_owned),
    };
    Ok(Law {
        name: "ripple".to_owned(),
        add: "s*direction*load/scale*sin(x/pitch)".to_owned(),
        variables: vec![
            variable("x", None),
            variable("load", None),
            variable("direction", Some("sign(v)")),
            variable("v", None),
        ],
        numbers: vec![
            LawNumber { is_amplitude: true, ..number("s", "N", Some(5.0), [0.0, 100.0]) },
            LawNumber {
                is_fixed: true,
                ..number("scale", "bar", Some(1e5), [f64::NEG_INFINITY, f64::INFINITY])
            },
            number("pitch", "mm", Some(2e-3), [1e-4, 1e-2]),
        ],
    })
}

const USED: &str = "[[suspects]]\nuse = \"friction/ripple\"\nplace = \"drive.force\"\ntimes = \"-1\"\n\
                    with.load = \"p_a - p_b\"\n";

#[test]
fn a_law_is_bound_to_the_variables_of_the_rig() {
    let read = suspects_using(USED, "s.toml", &ripple).unwrap_or_else(|error| panic!("{error}"));
    let ripple = &read[0];
    assert_eq!(ripple.name, "ripple");
    assert_eq!(ripple.add, "(-1)*(ripple_s*(sign(v))*(p_a - p_b)/(1.0[bar])*sin(x/pitch))");
    let numbers: Vec<_> =
        ripple.numbers().iter().map(|one| (one.name.as_str(), one.value, one.range, one.prior)).collect();
    assert_eq!(numbers, [("ripple_s", 0.0, [0.0, 100.0], Some(5.0)), ("pitch", 2.0, [0.1, 10.0], None)]);
    // 4 N of it, 3 bar, 1 mm on: half a radian.
    let at = [1e-3, -0.2, 4e5, 1e5, 0.0, 0.0, 0.0, 0.0];
    let value = ripple.with(&[4.0, 2.0]).unwrap().value(&at);
    assert!((value - 4.0 * 3.0 * 0.5_f64.sin()).abs() < 1e-12, "{value}");
    // What is written stands by itself.
    assert_eq!(suspects(&ripple.toml("suspects"), "s.toml").unwrap(), read);
}

#[test]
fn numbers_of_the_file_stand_in_place_of_those_of_the_library() {
    let text = format!(
        "{USED}name = \"mine\"\nparameters.s = {{ unit = \"kN\", range = [0, 0.2], prior = 0.01 }}\n\
         parameters.scale.value = 2\nparameters.pitch = {{ value = 3, range = [1, 4] }}\n"
    );
    let read = suspects_using(&text, "s.toml", &ripple).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((read[0].name.as_str(), read[0].numbers()[0].unit.text.as_str()), ("mine", "kN"));
    assert!(read[0].add.contains("mine_s*") && read[0].add.contains("(2.0[bar])"));
    let numbers: Vec<_> = read[0].numbers().iter().map(|one| (one.value, one.range, one.prior)).collect();
    assert_eq!(numbers, [(0.0, [0.0, 0.2], Some(0.01)), (3.0, [1.0, 4.0], None)]);
}

#[test]
fn a_law_that_cannot_be_used_is_refused_with_its_line() {
    let mut wrong = Vec::new();
    for (from, to, message) in [
        ("friction/ripple", "friction/riple", "s.toml:2:8: use: 'friction/riple' is not there"),
        ("with.load = \"p_a - p_b\"\n", "", "with.load is missing: something"),
        ("with.load", "with.lode", "unknown key suspects[1].with.lode; allowed is x, load, direction, v"),
        ("p_a - p_b", "p_c", "s.toml:2:8: 'p_c' is unknown"),
        ("p_a - p_b", "x", "s.toml:2:8: drive.force is in N, and this is in"),
        (
            "times = \"-1\"",
            "add = \"v\"",
            "s.toml:4:7: suspects[1].add: the law of the library stands in its place",
        ),
        ("times", "tims", "unknown key suspects[1].tims"),
        ("times", "parameters.s.value = 1\ntimes", "parameters.s.value: it is 0 where the suspect is off"),
        ("times", "parameters.pitch.range = [3, 4]\ntimes", "parameters.pitch.range: 3 to 4 does not hold 2"),
        (
            "times",
            "parameters.s.unit = \"N m\"\ntimes",
            "parameters.s.range is missing: the least and the largest value, in N m",
        ),
        (
            "times",
            "parameters.patch.value = 1\ntimes",
            "unknown key suspects[1].parameters.patch; allowed is s, scale, pitch",
        ),
    ] {
        assert!(USED.contains(from), "{from}");
        let found = suspects_using(&USED.replacen(from, to, 1), "s.toml", &ripple).expect_err(to).to_string();
        if !found.contains(message) || !found.starts_with("s.toml:") {
            wrong.push(format!("{from} -> {to}\n  {found}\n  {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let message = suspects(USED, "s.toml").unwrap_err().to_string();
    assert!(message.contains("no library is known here"), "{message}");
}
