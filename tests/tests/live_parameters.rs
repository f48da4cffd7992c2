//! Parameters that change while running: planned by the experiment, to the cycle; and by a person who edits a program file.

use system_tests::{AxisTable, Pace, RESTLESS, Running, SHORT, Scene, turn};

/// Without feed-forward, so that the wanted velocity is gain times error.
const PROGRAM: &str = "title = \"gain alone\"\n[algorithm]\nname = \"position-p\"\ngain_per_s = 20.0\n\
                       velocity_feed_forward = 0.0\nrest_zone_m = 0.0\n";
/// When the gain changes, ms into the experiment: in the middle of the move.
const AT_MS: usize = 200;

/// Runs the short experiment twice over, with this after its `[drive]`.
fn run(change: &str) -> (Scene, AxisTable) {
    let scene = Scene::new(&format!("{}{change}", SHORT.replacen("[run]\n", "[run]\nrepetitions = 2\n", 1)));
    scene.write("program.toml", PROGRAM);
    let emulator = scene.emulator(Pace::Lockstep).start();
    scene.controller(Pace::Lockstep).start().wait().expect_code(0);
    emulator.wait().expect_code(0);
    let table = scene.axis_table("drive");
    (scene, table)
}

/// Wanted velocity over control error, where the error is large enough to measure it.
fn gains(table: &AxisTable, rows: std::ops::Range<usize>) -> Vec<f64> {
    let [wanted, set, is] =
        ["wanted_velocity_m_per_s", "set_position_m", "position_m"].map(|name| table.numbers(name));
    let error = |row: usize| set[row] - is[row];
    rows.filter(|row| error(*row).abs() > 1e-3).map(|row| wanted[row] / error(row)).collect()
}

#[track_caller]
fn expect_gain(table: &AxisTable, rows: std::ops::Range<usize>, gain: f64) {
    let seen = gains(table, rows.clone());
    assert!(seen.len() > 20, "{} rows of {rows:?} tell the gain", seen.len());
    let wrong = seen.iter().find(|seen| (*seen - gain).abs() > 1e-6 * gain);
    assert_eq!(wrong, None, "rows {rows:?} with a gain of {gain} /s");
}

#[test]
fn a_planned_change_acts_in_its_cycle_and_is_taken_back_for_the_next_repetition() {
    let change = format!(
        "[[drive.change]]\nat_s = {}\nparameter = \"algorithm.gain_per_s\"\nvalue = 30.0\n",
        AT_MS as f64 * 1e-3
    );
    let ((scene, with), (_, without)) = (run(&change), run(""));
    let first = with.first("main_chain", "experiment", 0);
    let acts = first + AT_MS;
    for column in ["position_m", "wanted_velocity_m_per_s", "opening"] {
        let (with, without) = (with.texts(column), without.texts(column));
        assert_eq!(with[..acts], without[..acts], "{column}: nothing differs before");
    }
    let wanted = |table: &AxisTable| table.numbers("wanted_velocity_m_per_s")[acts];
    // The same error in both runs, in this row for the last time.
    let ratio = wanted(&with) / wanted(&without);
    assert!((ratio - 1.5).abs() < 1e-9, "30 /s over 20 /s: {ratio}");
    let end = with.first("main_chain", "final-settling", first);
    let second = with.first("main_chain", "experiment", end);
    for start in [first, second] {
        expect_gain(&with, start..start + AT_MS, 20.0);
        expect_gain(&with, start + AT_MS..start + 400, 30.0);
    }
    expect_gain(&without, first..first + 400, 20.0);
    assert_eq!(scene.report()["axes"]["drive"]["variables"]["algorithm.gain_per_s"], 30.0, "at the end");
}

#[test]
fn a_planned_change_that_cannot_be_is_refused_with_file_line_and_range() {
    for (parameter, value, words) in [
        ("algorithm.gain_per_s", "1000.0", &["1000", "0 to 200"][..]),
        ("algorithm.gain", "10.0", &["algorithm.gain", "algorithm.gain_per_s"]),
    ] {
        let change = format!("[[drive.change]]\nat_s = 0.1\nparameter = \"{parameter}\"\nvalue = {value}\n");
        let scene = Scene::new(&format!("{SHORT}{change}"));
        let line = SHORT.lines().count() + 1;
        let ended = scene.controller(Pace::Real).start().wait().expect_code(2).expect_stderr(words);
        let lines: Vec<_> = (line..line + 4).map(|line| format!("experiment.toml:{line}:")).collect();
        assert!(lines.iter().any(|place| ended.stderr.contains(place)), "{}", ended.stderr);
    }
}

fn edit(scene: &Scene, from: &str, to: &str) {
    assert!(PROGRAM.contains(from), "'{from}' is not in the program");
    // As an editor does: written beside it and moved over it, so that nobody reads half of it.
    let new = scene.write("program.new", &PROGRAM.replacen(from, to, 1));
    std::fs::rename(new, scene.path("program.toml")).expect("the folder is ours");
}

fn gain_of(scene: &Scene) -> f64 {
    scene.report()["axes"]["drive"]["variables"]["algorithm.gain_per_s"].as_f64().expect("a number")
}

fn under_way(options: &str) -> (Scene, Running, Running) {
    let scene = Scene::new(RESTLESS);
    scene.write("program.toml", PROGRAM);
    let (emulator, mut controller) = scene.start(Pace::Real, "", &format!("--repeat {options}"));
    controller.wait_for("drive experiment");
    scene.wait_for_rows("emulator", 900);
    (scene, emulator, controller)
}

fn end(scene: &Scene, emulator: Running, controller: Running) -> String {
    scene.wait_for_more_rows("emulator", 600);
    emulator.interrupt();
    controller.wait().expect_code(0).stderr
}

#[test]
fn a_number_edited_while_running_is_taken_over_and_a_bad_edit_changes_nothing() {
    let _machine = turn::take();
    let (scene, emulator, mut controller) = under_way("--watch");
    edit(&scene, "gain_per_s = 20.0", "gain_per_s = 15.0");
    controller.wait_for("drive.algorithm.gain_per_s is 15 now");
    for (from, to, words) in [
        ("gain_per_s = 20.0", "gain_per_s = 900.0", "gain_per_s = 900"),
        ("gain_per_s = 20.0", "gain_per_s = nan", "gain_per_s = NaN"),
        ("gain_per_s = 20.0", "gain_per_s = = 5", "program.toml"),
        ("\"position-p\"", "\"position-pid\"", "a change of the algorithm needs a restart"),
    ] {
        let before = controller.stderr().matches("the numbers in use stay").count();
        edit(&scene, from, to);
        controller.wait_for_times("the numbers in use stay", before + 1);
        assert!(controller.stderr().contains(words), "'{words}' is missing in: {}", controller.stderr());
    }
    let said = end(&scene, emulator, controller);
    assert_eq!(said.matches("gain_per_s is ").count(), 1, "{said}");
    assert_eq!(gain_of(&scene), 15.0, "the last good number stays");
    let table = scene.axis_table("drive");
    let seen = gains(&table, 10..table.len());
    let is = |gain: f64| move |seen: &&f64| (*seen - gain).abs() < 1e-6 * gain;
    let (old, new) = (seen.iter().filter(is(20.0)).count(), seen.iter().filter(is(15.0)).count());
    assert!(old > 50 && new > 50, "{old} rows with 20 /s, {new} with 15 /s");
    let changed = seen.iter().position(|seen| is(15.0)(&seen)).expect("counted");
    assert!(seen[changed..].iter().all(|seen| is(15.0)(&seen)), "and never the old one again");
    assert!(seen[..changed].iter().all(|seen| is(20.0)(&seen)), "nor anything between");
}

#[test]
fn without_the_option_an_edit_changes_nothing() {
    let _machine = turn::take();
    let (scene, emulator, controller) = under_way("");
    edit(&scene, "gain_per_s = 20.0", "gain_per_s = 15.0");
    let said = end(&scene, emulator, controller);
    assert!(!said.contains("gain_per_s is "), "{said}");
    assert_eq!(gain_of(&scene), 20.0);
}
