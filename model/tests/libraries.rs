//! Suspects of libraries: bound to names of a model, with its units, and refused with line and column.

use crate::{first_values, outputs, read, refused, refuses_each, simulated};
use model::{Change, Inputs, Model, Program, Start, Target};

/// A balance whose names are those of a library's numbers, too.
const BALANCE: &str = r#"[inputs.speed]
unit = "mm/s"
[inputs.load]
unit = "bar"
[parameters]
viscous = { unit = "N s/m", value = 2 }
excess = { unit = "N", value = 7 }
[define]
friction = "viscous*speed"
[outputs.force]
unit = "N"
value = "friction + excess"
[[suspects]]
use = "friction/stribeck"
place = "friction"
with.v = "speed - 1[mm/s]"
[[suspects]]
name = "more-viscous"
use = "friction/viscous"
place = "force"
times = "-viscous/4[N s/m]"
with.v = "speed"
parameters.viscous = { unit = "N s/mm", value = 3, range = [0, 9], tolerance = 1 }
"#;

#[test]
fn a_suspect_of_a_library_is_bound_to_names_of_the_model() {
    let model = read(BALANCE);
    let [stribeck, viscous] = &model.suspects[..] else { panic!("{:?}", model.suspects) };
    assert_eq!(
        (stribeck.name.as_str(), stribeck.library.as_deref()),
        ("stribeck", Some("friction/stribeck"))
    );
    assert_eq!(
        (stribeck.target, stribeck.change, stribeck.is_local),
        (Target::Definition(0), Change::Add, true)
    );
    assert_eq!(stribeck.expression.text, "excess*sign(speed - 1[mm/s])*exp(-abs(speed - 1[mm/s])/velocity)");
    assert_eq!(viscous.expression.text, "-viscous/4[N s/m]*(viscous*speed)");
    let of = |suspect: usize| {
        let parameters = model.parameters.iter().filter(move |one| one.suspect == Some(suspect));
        parameters
            .map(|one| (one.name.as_str(), one.unit.text.as_str(), one.values_si[0]))
            .collect::<Vec<_>>()
    };
    assert_eq!(of(0), [("excess", "N", 5.0), ("velocity", "mm/s", 0.002)]);
    assert_eq!(of(1), [("viscous", "N s/mm", 3000.0)]);
    // 5 N of its own excess, not the 7 N of the model; its own viscous, times the model's over 4.
    let inputs = Inputs { time_s: &[0.0], samples_si: &[vec![0.003], vec![0.0]] };
    let value = |suspects: &[usize]| outputs(&model, suspects, &inputs).unwrap()[0];
    let alone = 2.0 * 0.003 + 7.0;
    assert!((value(&[]) - alone).abs() < 1e-12);
    assert!((value(&[0]) - (alone + 5.0 * (-1.0_f64).exp())).abs() < 1e-12);
    assert!((value(&[1]) - (alone - 0.5 * 3000.0 * 0.003)).abs() < 1e-12);
}

#[test]
fn a_number_has_the_unit_that_follows_from_what_is_bound() {
    let rotary = BALANCE.replace("unit = \"N\"", "unit = \"N m\"").replace("N s/m\"", "N m s\"");
    let rotary = rotary.replace("\"mm/s\"", "\"rad/s\"").replace("1[mm/s]", "1[rad/s]");
    let rotary = rotary.split("[[suspects]]").next().unwrap().to_owned();
    let linear = "[[suspects]]\nuse = \"damping/quadratic\"\nplace = \"friction\"\nwith.v = \"speed\"\n";
    let model = read(&(rotary.clone() + linear));
    // N m over (rad/s)^2.
    assert_eq!(model.parameters[2].unit.text, "kg m^2");
    let stribeck = linear.replace("damping/quadratic", "friction/stribeck");
    let message = refused(&(rotary.clone() + &stribeck));
    let expected = "parameters.excess.value is missing: the library has none for this place, in kg m^2 s^-2";
    assert!(message.contains(expected), "{message}");
    let given = "parameters.excess = { unit = \"N m\", value = 1 }\n\
                 parameters.velocity = { unit = \"deg/s\", value = 5 }\n";
    let model = read(&(rotary + &stribeck + given));
    assert!((model.parameters[3].values_si[0] - 5.0_f64.to_radians()).abs() < 1e-15);
}

/// A lag at an input, and one at an output: each reads what its place is without it, in the equation of its state too.
#[test]
fn a_lag_follows_what_its_place_is_without_it() {
    let model = read(
        "[inputs.u]\nunit = \"V\"\n[outputs.y]\nunit = \"V\"\nvalue = \"2*u\"\n\
         [[suspects]]\nname = \"actuator-lag\"\nuse = \"actuator/lag\"\nplace = \"u\"\nparameters.lag = { value = 0.5 }\n\
         [[suspects]]\nname = \"sensor-lag\"\nuse = \"sensor/lag\"\nplace = \"y\"\nparameters.lag = { value = 0.5 }\n\
         states.late = { start = 2 }\n",
    );
    assert_eq!(model.states[0].start, Start::Input { input: 0 });
    assert_eq!(model.states[1].start, Start::Known { value_si: 2.0 });
    let inputs = Inputs { time_s: &[0.0, 1.0], samples_si: &[vec![3.0, 3.0]] };
    let mut values = first_values(&model);
    values[1] = vec![1.0, 2.0];
    for (suspect, start) in [(0, 2.0), (1, 2.0)] {
        let program = Program::new(&model, &[suspect]).unwrap();
        let ends = simulated(&program, &[], &inputs, &values).unwrap()[1].0;
        // From its start to 6 V with 0.5 s; the relative tolerance of the integration is 1e-6.
        assert!((ends - (6.0 + (start - 6.0) * (-2.0_f64).exp())).abs() < 1e-4, "{suspect}: {ends}");
    }
}

#[test]
fn a_suspect_of_a_library_that_cannot_be_used_is_refused_with_line_and_column() {
    refuses_each(
        BALANCE,
        &[
            (
                "friction/stribeck",
                "frictions/stribeck",
                "model.toml:14:8: use: 'frictions' is no library; allowed is",
            ),
            (
                "friction/stribeck",
                "friction/stribek",
                "model.toml:14:8: use: 'stribek' is not in friction; it has coulomb,",
            ),
            ("friction/stribeck", "friction", "use: '' is not in friction"),
            ("with.v = \"speed - 1[mm/s]\"", "", "with.v is missing: sliding speed, usually in m/s"),
            ("with.v = \"speed - 1[mm/s]\"", "with.w = \"speed\"", "with.v is missing"),
            (
                "with.v = \"speed\"",
                "with = { v = \"speed\", x = \"1\" }",
                "unknown key suspects[2].with.x; allowed is v",
            ),
            ("speed - 1[mm/s]", "sped", "model.toml:16:11: 'sped' is unknown here"),
            ("speed - 1[mm/s]", "excess", "parameters.velocity.value is missing"),
            ("{ unit = \"N s/mm\"", "{ unit = \"N\"", "more-viscous is in N, and this is in W"),
            (
                "parameters.viscous",
                "parameters.vicsous",
                "unknown key suspects[2].parameters.vicsous; allowed is viscous",
            ),
            (
                "value = 3, range",
                "valeu = 3, range",
                "unknown key suspects[2].parameters.viscous.valeu; allowed is unit, value,",
            ),
            ("with.v = \"speed\"", "with.v = \"speed\"\nadd = \"1\"", "unknown key suspects[2].add"),
            (
                "use = \"friction/viscous\"",
                "use = \"actuator/gain\"",
                "times: a factor or a replacement has none",
            ),
        ],
    );
    let at_state = "[states.x]\nstart = 0\nderivative = \"0/1[s]\"\n[outputs.y]\nvalue = \"x\"\n\
                    [[suspects]]\nuse = \"actuator/lag\"\nplace = \"x\"\n";
    let found = refused(at_state);
    assert!(found.contains("place: lag changes an input, a definition or an output"), "{found}");
}

const SEALS: &str = r#"about = "seals"
unit = "N"
[variables]
v = { unit = "m/s", about = "sliding speed" }
direction = { default = "sign(v)", about = "direction of motion" }
[[suspects]]
name = "lip"
about = "a lip that is pressed on"
add = "growth*direction"
parameters.growth = { unit = "N", dimension = "place", value = 4, range = [0, 9] }
"#;

#[test]
fn a_library_that_a_user_keeps_in_a_file_is_used_by_its_path() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    let library = folder.path().join("mine/seals.toml");
    let file = folder.path().join("model.toml");
    let text = BALANCE.replacen("friction/stribeck", "mine/seals.toml/lip", 1);
    let read = |seals: &str, text: &str| {
        std::fs::write(&library, seals).unwrap();
        Model::parse(text, &file).map_err(|error| error.to_string())
    };
    let model = read(SEALS, &text).unwrap();
    assert_eq!(model.suspects[0].name, "lip");
    assert_eq!(model.suspects[0].expression.text, "growth*sign(speed - 1[mm/s])");
    assert_eq!(model.parameters[2].range_si, [0.0, 9.0]);
    let mut wrong = Vec::new();
    for (seals, text, message) in [
        (SEALS.to_owned(), text.replace("/lip", "/lap"), "use: 'lap' is not in mine/seals.toml; it has lip"),
        (SEALS.to_owned(), text.replace("mine/", "yours/"), "yours/seals.toml: No such file"),
        (
            SEALS.replace("growth*direction", "growth*speed"),
            text.clone(),
            "seals.toml:7: lip: 'speed' is no variable of the library and no number of the suspect",
        ),
        (
            SEALS.replace("sign(v)", "sign(w)"),
            text.clone(),
            "seals.toml:5: direction: 'w' is no variable above it: a default is over these",
        ),
        (
            SEALS.replace("about = \"a lip", "abuot = \"a lip"),
            text.clone(),
            "seals.toml:6:1: suspects[1].about is missing",
        ),
    ] {
        let found = read(&seals, &text).expect_err(message);
        if !found.contains(message) || !found.contains("model.toml:14:8: use: ") {
            wrong.push(format!("{found}\n  {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
