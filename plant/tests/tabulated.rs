//! Tabulated terms in the rig file and in the plant: read as written, refused with reasons, the same as an effect of that law.

use plant::effects::SHEETS;
use plant::effects::tabulated::{Balance, Tabulated, Variable};
use plant::{Axis, Inputs, Plant, RigParameters, Setup, Truth};

fn table(axis: Axis, balance: Balance, variable: Variable, at: &[f64], value: &[f64]) -> Tabulated {
    Tabulated { axis, balance, variable, at: at.to_vec(), value: value.to_vec() }
}

fn with(lines: &str) -> String {
    format!("{}{lines}\n", RigParameters::BASELINE_TOML)
}

pub(crate) fn inputs(period: i32) -> Inputs {
    let phase = f64::from(period) * 4e-3;
    Inputs { valve: [0.5 * phase.sin(), 0.4 * phase.cos()], ..Inputs::default() }
}

/// Two seconds of strokes of both axes.
pub(crate) fn run(rig: &RigParameters) -> Plant {
    let mut plant = Plant::new(rig, &Setup::default()).expect("good");
    (0..2000).for_each(|period| plant.step(&inputs(period)));
    plant
}

/// Both come to the same state but for rounding.
pub(crate) fn alike(one: &RigParameters, two: &RigParameters) {
    let [one, two] = [one, two].map(|rig| run(rig).truth(&inputs(0)));
    same_but_for_rounding(&one, &two);
}

pub(crate) fn same_but_for_rounding(one: &Truth, two: &Truth) {
    for (one, two) in one.values().into_iter().zip(two.values()) {
        assert!((one - two).abs() <= 1e-9 * one.abs().max(1.0), "{one} {two}");
    }
}

#[test]
fn a_file_with_tables_is_read_as_it_was_written_numbers_to_the_bit() {
    let tables: Vec<Tabulated> = Axis::ALL
        .into_iter()
        .flat_map(|axis| Balance::ALL.map(|balance| (axis, balance)))
        .zip(Variable::ALL)
        .map(|((axis, balance), variable)| {
            table(axis, balance, variable, &[-0.1, 1.0 / 3.0, 2e5], &[1e-7, -12.0, 2000.0])
        })
        .collect();
    let text: String = tables.iter().map(Tabulated::toml).collect();
    let read = RigParameters::from_toml(&with(&text), "rig.toml").expect("good");
    assert_eq!(read.tabulated(), tables);
    let set = RigParameters::baseline().with_tabulated(&tables).expect("good");
    assert_eq!(set.tabulated(), tables);
    assert_eq!(read.without_effects(), RigParameters::baseline());
    assert_eq!(read.effects(), [], "a table is no effect of the catalogue");
    assert!(SHEETS.iter().all(|sheet| sheet.name != "tabulated"));
}

#[test]
fn whatever_is_wrong_is_named_with_line_key_value_and_what_is_allowed() {
    const HEAD: &str = "[[tabulated]]\nbalance = \"drive.force\"\nvariable = \"x\"\n";
    let first = RigParameters::BASELINE_TOML.lines().count() + 1;
    let many: Vec<String> = (0..65).map(|at| at.to_string()).collect();
    let many = format!("{HEAD}at = [{}]\nvalue_n = [1, 2]", many.join(", "));
    let whole = [
        ("tabulated = 3".to_owned(), 0, "tabulated = 3; allowed is a list of tables: [[tabulated]]"),
        ("[tabulated]\nat = [0, 1]".to_owned(), 0, "allowed is a list of tables: [[tabulated]]"),
        (
            "[[tabulated]]\nvariable = \"x\"".to_owned(),
            0,
            "tabulated[1].balance is missing: one of drive.force, drive.flow-a, ",
        ),
        (
            HEAD.replace("drive.force", "linkage"),
            1,
            "tabulated[1].balance = \"linkage\"; allowed is drive.force, drive.flow-a, ",
        ),
        (HEAD.replace("\"x\"", "\"dp/dt\""), 2, "tabulated[1].variable = \"dp/dt\"; allowed is x, v, "),
        (HEAD.replace("\"x\"", "1"), 2, "tabulated[1].variable = 1; allowed is a text"),
        (many, 3, "; allowed are 2 to 64 numbers"),
    ];
    let below_head = [
        ("value_n = [0, 1]", 0, "tabulated[1].at is missing; allowed are 2 to 64 numbers"),
        ("at = [0, 1]", 0, "tabulated[1].value_n is missing; allowed are 2 to 64 numbers"),
        ("at = [0, 1]\nvalue = [0, 1]", 4, "unknown key tabulated[1].value; allowed is balance, "),
        ("at = [0, 1]\nvalue_nl_per_min = [0, 1]", 4, "unknown key tabulated[1].value_nl_per_min"),
        ("at = [0]\nvalue_n = [1]", 3, "tabulated[1].at = [0]; allowed are 2 to 64 numbers"),
        ("at = [0, nan]\nvalue_n = [1, 2]", 3, "tabulated[1].at = [0, nan]; allowed are 2 to 64 numbers"),
        (
            "at = [0, 1]\nvalue_n = [1, nan]",
            4,
            "tabulated[1].value_n = [1, nan]; allowed are 2 to 64 numbers",
        ),
        ("at = [0, 1]\nvalue_n = [1, 1e9]", 4, "2 to 64 numbers, each -2000 to 2000"),
        ("at = [0, \"1\"]\nvalue_n = [1, 2]", 3, "tabulated[1].at = [0, \"1\"]; allowed are 2 to 64 numbers"),
        ("at = [1, 1]\nvalue_n = [1, 2]", 3, "tabulated[1].at = [1, 1]; each number must"),
        ("at = [0, 1]\nvalue_n = [1, 2, 3]", 4, "it must hold as many numbers as at, 2, not 3"),
    ];
    let below_head = below_head.map(|(lines, line, message)| (format!("{HEAD}{lines}"), line, message));
    for (lines, line, message) in whole.into_iter().chain(below_head) {
        // A key before any table has to stand before the first table of the file.
        let text = if lines.starts_with("tabulated") {
            format!("{lines}\n{}", RigParameters::BASELINE_TOML)
        } else {
            with(&lines)
        };
        let at = if lines.starts_with("tabulated") { 1 } else { first + line };
        let error = RigParameters::from_toml(&text, "my-rig.toml").expect_err(&lines).to_string();
        assert!(error.starts_with(&format!("my-rig.toml:{at}: ")), "{lines}\n{error}");
        assert!(error.contains(message), "{lines}\n{error}");
    }
}

#[test]
fn a_constant_force_is_an_inclination() {
    for (axis, sign) in [(Axis::Drive, 1.0), (Axis::Load, -1.0)] {
        let inclined =
            RigParameters::baseline().with_effect("inclination", axis.name(), &[("force_n", 17.0)]);
        // An inclination is along the rig's x, which the load's extension is against.
        let constant = table(axis, Balance::Force, Variable::Extension, &[0.0, 0.5], &[sign * 17.0; 2]);
        let tabulated = RigParameters::baseline().with_tabulated(&[constant]);
        alike(&inclined.expect("good"), &tabulated.expect("good"));
    }
}

#[test]
fn two_tables_act_as_their_sum() {
    let part =
        |value: f64| table(Axis::Drive, Balance::FlowB, Variable::PressureB, &[1e5, 7e5], &[0.0, value]);
    let one = run(&RigParameters::baseline().with_tabulated(&[part(-4.0), part(-2.0)]).expect("good"));
    let two = run(&RigParameters::baseline().with_tabulated(&[part(-6.0)]).expect("good"));
    let none = run(&RigParameters::baseline());
    let pressure_pa = |plant: &Plant| plant.truth(&inputs(0)).axes[0].pressure_b_pa;
    assert!((pressure_pa(&one) - pressure_pa(&two)).abs() < 1e-3);
    assert!((pressure_pa(&one) - pressure_pa(&none)).abs() > 1e3);
}

#[test]
fn each_table_has_its_column_in_the_truth_and_its_value_there() {
    let tables = [
        table(Axis::Drive, Balance::Force, Variable::Speed, &[0.0, 1.0], &[3.0, 3.0]),
        table(Axis::Load, Balance::FlowA, Variable::Spool, &[-1.0, 1.0], &[6.0, 6.0]),
    ];
    let plant = run(&RigParameters::baseline().with_tabulated(&tables).expect("good"));
    assert_eq!(plant.term_names(), ["drive_force_tabulated_N", "load_leakage_tabulated_a_m3_per_s"]);
    let terms = plant.terms(&inputs(0));
    assert_eq!(terms.values()[0], 3.0);
    assert!((terms.values()[1] - 1e-4).abs() < 1e-12);
    assert_eq!(plant.truth(&inputs(0)).axes[0].effect_force_n, 3.0);
}

#[test]
fn a_table_over_the_direction_resists_motion_and_does_not_shake_a_piston_that_rests() {
    let more = table(Axis::Drive, Balance::Force, Variable::Direction, &[-1.0, 1.0], &[10.0, -10.0]);
    let mut plant = run(&RigParameters::baseline().with_tabulated(&[more]).expect("good"));
    (0..3000).for_each(|_| plant.step(&Inputs::default()));
    // Break-away does not know of the table: between both, a piston may creep, by far less than a sensor's step in a second.
    assert!(plant.state().axes[0].rod_velocity_m_per_s.abs() < 1e-6);
}
