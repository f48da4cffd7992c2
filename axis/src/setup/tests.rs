//! What does not go together is refused before the start.

use super::*;
use tempfile::TempDir;

const DRIVE: &str = "title = \"d\"\n[algorithm]\nname = \"position-p\"\n";
const LOAD: &str = "title = \"l\"\n[algorithm]\nname = \"force-p\"\n[giving-way]\nname = \"force-manual\"\n";
const EXPERIMENT: &str = r#"title = "both"
[drive]
program = "drive.toml"
start_m = 0.2
set-point = [{ law = "rest", duration_s = 1.0 }]
[load]
program = "load.toml"
set-point = [{ law = "constant", force_n = 50.0, duration_s = 1.0 }]
"#;
const MODE: Mode = Mode { partner_needed: true, real_time: false, forever: false };

fn controllers(experiment: &str, load: &str, set: &[&str]) -> Result<Vec<AxisController>, String> {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (_, _) = (write("drive.toml", DRIVE), write("load.toml", load));
    let inputs = Inputs::read(&FileArguments {
        rig: concat!(env!("CARGO_MANIFEST_DIR"), "/../plant/rig.toml").into(),
        experiment: write("experiment.toml", experiment),
        set: set.iter().map(|set| (*set).to_owned()).collect(),
        ..FileArguments::default()
    });
    let inputs = inputs.map_err(|error| error.to_string())?;
    let controllers = Axis::ALL.map(|axis| inputs.controller(axis, MODE).map_err(|error| error.to_string()));
    controllers.into_iter().collect()
}

#[track_caller]
fn expect_refused(controllers: Result<Vec<AxisController>, String>, words: &[&str]) {
    let Err(problem) = controllers else { panic!("was taken") };
    for word in words {
        assert!(problem.contains(word), "'{word}' is missing in: {problem}");
    }
}

#[test]
fn an_axis_that_presses_needs_an_algorithm_to_give_way() {
    assert!(controllers(EXPERIMENT, LOAD, &[]).is_ok());
    let without = LOAD.replace("[giving-way]\nname = \"force-manual\"\n", "");
    let words = ["load.toml", "experiment.toml:7", "[giving-way]", "name = \"force-manual\""];
    let prepare = "program = \"load.toml\"\nprepare = [\"relieve\"]";
    let during = "program = \"load.toml\"\nduring = \"manual\"";
    for more in ["program = \"load.toml\"", prepare, during] {
        let experiment = EXPERIMENT.replace("program = \"load.toml\"", more);
        expect_refused(controllers(&experiment, &without, &[]), &words);
    }
}

#[test]
fn every_shipped_program_of_forces_gives_way() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../controller/programs"));
    let mut seen = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let source = Source::read(&file.unwrap().path()).unwrap();
        let program = source.program(Axis::Load, &RigParameters::baseline(), false).unwrap();
        if program.controls() == Quantity::Force {
            assert!(program.has_force_chain_slot(), "{}", source.path.display());
            seen += 1;
        }
    }
    assert!(seen > 1);
}

#[test]
fn what_is_read_at_the_start_only_may_be_set_but_no_change_of_it_planned() {
    let change = |parameter: &str, value: f64| {
        format!("{EXPERIMENT}[[load.change]]\nat_s = 0.5\nparameter = \"{parameter}\"\nvalue = {value}\n")
    };
    for (name, value) in [
        ("settled.still_m", 0.002),
        ("settled.position_error_m", 0.002),
        ("settled.force_error_n", 30.0),
        ("settled.force_error_n_per_n", 0.2),
        ("force-chain.relieve_timeout_s", 20.0),
        ("matching-chain.match_timeout_s", 20.0),
    ] {
        let words = ["experiment.toml:11", name.split('.').next_back().unwrap(), "at the start only"];
        expect_refused(controllers(&change(name, value), LOAD, &[]), &words);
        let set = format!("load.{name}={value}");
        let controllers = controllers(EXPERIMENT, LOAD, &[&set]).unwrap();
        let program = &controllers[1].program;
        assert_eq!(program.values()[program.place(name).unwrap()], value);
    }
    assert!(controllers(&change("force-chain.high_force_n", 90.0), LOAD, &[]).is_ok());
}

#[test]
fn a_multiple_that_is_no_whole_number_is_refused_on_the_command_line_and_in_a_plan() {
    let whole = ["every_cycles = 2.5", "a whole number"];
    expect_refused(controllers(EXPERIMENT, LOAD, &["drive.algorithm.every_cycles=2.5"]), &whole);
    let change = "[[load.change]]\nat_s = 0.5\nparameter = \"algorithm.every_cycles\"\nvalue = 2.5\n";
    expect_refused(controllers(&format!("{EXPERIMENT}{change}"), LOAD, &[]), &whole);
}

#[test]
fn a_variable_of_an_axis_that_the_experiment_leaves_out_is_refused() {
    let alone = &EXPERIMENT[..EXPERIMENT.find("[load]").unwrap()];
    assert!(controllers(alone, LOAD, &["drive.algorithm.gain_per_s=10"]).is_ok());
    let set = ["load.algorithm.gain_m_per_n_s=0.01"];
    expect_refused(controllers(alone, LOAD, &set), &["--set load.algorithm", "experiment.toml", "no [load]"]);
}
