//! What counts as resolved, which draws are grouped, and one ambiguous draw from its first report to its last.

use super::*;
use crate::draws::Shape;
use crate::folder::{Plan, Study};
use crate::judge::tests::{TAKEN, draw, reported};
use crate::program::tests::script;
use crate::step::make_record;
use discrepancy::next::menu::MENU;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tempfile::TempDir;

fn outcome(verdict: &str, names: &[&str]) -> Outcome {
    judge(&draw(Kind::Single, &["inclination"]).recipe.hidden[0], &TAKEN, &reported(verdict, names))
}

#[test]
fn one_right_name_at_its_place_resolves() {
    assert_eq!(outcome("named", &["inclination@drive"]), Outcome::Resolved);
    assert_eq!(outcome("ambiguous", &["inclination@drive[inclination@drive]"]), Outcome::Resolved);
}

#[test]
fn a_right_name_among_others_is_still_ambiguous() {
    for (verdict, names) in [
        ("ambiguous", &["inclination@drive[friction-asymmetry@drive]"][..]),
        ("ambiguous", &["friction-asymmetry@drive[inclination@drive]"]),
        ("ambiguous", &["inclination@drive[inclination@load]"]),
        ("named", &["inclination@drive", "valve-offset@drive"]),
        ("outside-catalogue", &["inclination@drive"]),
    ] {
        assert_eq!(outcome(verdict, names), Outcome::StillAmbiguous, "{verdict} {names:?}");
    }
}

#[test]
fn a_right_name_that_is_gone_is_wrong_and_no_report_an_error() {
    for (verdict, names) in [
        ("named", &["friction-asymmetry@drive"][..]),
        ("named", &["inclination@load"]),
        ("ambiguous", &["friction-asymmetry@drive[valve-offset@drive]"]),
        ("nothing-missing", &[]),
        ("outside-catalogue", &[]),
    ] {
        assert_eq!(outcome(verdict, names), Outcome::Wrong, "{verdict} {names:?}");
    }
    assert_eq!(outcome("bad-data", &[]), Outcome::Error);
    assert_eq!(outcome("named", &[]), Outcome::Error);
    let hidden = &draw(Kind::Single, &["inclination"]).recipe.hidden[0];
    let late = Execution { ended: ProgramEnd::TimedOut, ..TAKEN };
    assert_eq!(judge(hidden, &late, &reported("named", &["inclination@drive"])), Outcome::Error);
}

#[test]
fn what_is_left_open_counts_only_with_the_truth_among_it() {
    let single = draw(Kind::Single, &["inclination"]);
    let entry_of = |names: &[&str]| {
        let report = reported("ambiguous", names).unwrap();
        assert!(leaves_open(&report));
        ambiguous(&single, &report).map(|entry| entry.sheet.name)
    };
    assert_eq!(entry_of(&["valve-offset@drive[inclination@drive]"]), Some("valve-offset"));
    assert_eq!(entry_of(&["inclination@drive", "valve-offset@drive[rod-leakage@drive.a]"]), None);
    assert_eq!(entry_of(&["valve-offset@drive[inclination@load]"]), None);
    assert!(!leaves_open(&reported("named", &["inclination@drive"]).unwrap()));
}

#[test]
fn a_draw_is_measured_under_the_menus_experiments_with_noise_of_its_own() {
    let free = MENU.iter().find(|entry| entry.name == "shut-and-hold").unwrap();
    let linked = MENU.iter().find(|entry| entry.name == "load-steps").unwrap();
    let single = draw(Kind::Single, &["inclination"]);
    assert_ne!(recipe(&single).seed, single.recipe.seed);
    assert!(recipe(&single).seed < 1 << 53);
    assert_eq!(Recipe { seed: single.recipe.seed, ..recipe(&single) }, single.recipe);
    for (entry, linked) in [(free, false), (linked, true)] {
        let rig = RigParameters::baseline();
        let record =
            record_maker::simulate_proposed(&recipe(&single), &rig, (entry.name, entry.toml)).unwrap();
        assert_eq!((record.linked, record.recipe.both_axes), (linked, linked), "{}", entry.name);
        let touches = record.rows.iter().any(|row| row.contact_force_n != 0.0);
        assert_eq!(touches, linked, "{}", entry.name);
        // Unlinked, the other axis moves as well but is not recorded.
        let way_m = |axis: usize| {
            let extensions = record.rows.iter().map(|row| row.axes[axis].extension_m);
            extensions.clone().fold(0.0, f64::max) - extensions.fold(1.0, f64::min)
        };
        assert!(way_m(0) > 0.01 && way_m(1) > 0.01, "{}: {} {}", entry.name, way_m(0), way_m(1));
    }
}

#[test]
fn an_experiment_that_is_none_cannot_be_run() {
    let rig = RigParameters::baseline();
    let single = recipe(&draw(Kind::Single, &["inclination"]));
    for (toml, reason) in [
        ("title = ", "next.toml"),
        (&SHORT.replace("position-pid", "nobodys"), "nobodys"),
        (
            &SHORT.replace("[run]", "[[rig.event]]\nat_s = 0.9\ndo = \"emergency-stop\"\n[run]"),
            "the record maker plays no",
        ),
    ] {
        let error = record_maker::simulate_proposed(&single, &rig, ("next.toml", toml)).unwrap_err();
        assert!(error.to_string().contains(reason), "{error}");
    }
}

/// One axis, for a short while.
const SHORT: &str = r#"title = "short"
number = 1
[rig]
carriage_position_m = 0.2
[run]
settling_s = 0.0
[drive]
program = "position-pid"
start_m = 0.2
set-point = [{ law = "rest", duration_s = 0.3 }]
"#;

/// A study whose program leaves `inclination` and its twin ambiguous, until the second record names the effect.
struct StudyFixture {
    folder: TempDir,
    study: Study,
    draw: Draw,
    stop: AtomicBool,
}

impl StudyFixture {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let shape = Shape { each: 1, ..Shape::NO_DRAW };
        let study = Study::begin(&folder.path().join("study"), &Plan::new(5, shape)).unwrap();
        let draw =
            study.draws.iter().find(|draw| draw.recipe.hidden[0].name == "inclination").unwrap().clone();
        // Records of a few lines; the proposed one is made by the record maker.
        for name in ["train", "held-out-0", "held-out-1"] {
            let record = study.records(draw.number).join(name);
            fs::create_dir_all(&record).unwrap();
            let text = "time_s,drive_valve,drive_position_m\n0.000,0,0.1\n";
            fs::write(record.join("measurement.csv"), text).unwrap();
        }
        StudyFixture { folder, study, draw, stop: AtomicBool::new(false) }
    }

    fn program(&self, resolved: &str, proposes: &str) -> Program {
        let place = |effect: &str| {
            let axis = self.draw.recipe.hidden[0].place.to_string();
            format!(r#"{{"effect": "{effect}", "where": {{"axis": "{axis}", "element": null}}"#)
        };
        let (truth, twin) = (place("inclination"), place("friction-asymmetry"));
        let text = format!(
            r#"mkdir out
if [ -e next.csv ]; then
    [ "$*" = "close --rig rig.toml --train train.csv next.csv --test test.csv --out out --more" ] || exit 9
    [ "$(ls | tr '\n' ' ')" = "next.csv out rig.toml test.csv train.csv " ] || exit 8
    echo '{{"verdict": "named", "named": [{resolved}}}]}}' >out/report.json
else
    echo '{{"verdict": "ambiguous", "named": [{twin}, "alternatives": [{truth}}}]}}], {proposes}}}' >out/report.json
    cat >out/next-short.toml <<'TOML'
{SHORT}TOML
fi"#
        )
        .replace("TRUTH", &truth)
        .replace("TWIN", &twin);
        script(self.folder.path(), &text, &["--more"], Duration::from_secs(60))
    }

    fn step<'a>(&'a self, label: &'a str, again: bool) -> Step<'a> {
        Step { again, ..Step::new(&self.study, label, &make_record, &self.stop) }
    }

    /// Runs the draw, then what was proposed for it.
    fn run(&self, label: &str, program: &Program) -> Table {
        self.step(label, true).run(&self.draw, program).unwrap();
        assert!(run(&self.step(label, false), program, &self.draw).unwrap().is_some());
        Table::of(&self.study, label).unwrap()
    }
}

const PROPOSES: &str = r#""next": {"reason": "alike", "experiment": "next-short.toml", "otherwise": null}"#;

#[test]
fn what_was_ambiguous_is_measured_again_and_judged_with_both_records() {
    let fixture = StudyFixture::new();
    let program = fixture.program("TRUTH", PROPOSES);
    let table = fixture.run("right", &program);
    assert_eq!((table.singles, table.open, table.truth_not_among, table.cases.len()), (1, 1, 0, 1));
    assert_eq!(table.cases[0].outcome, Some(Outcome::Resolved), "{:?}", table.cases[0].problem);
    let class = &table.classes[0];
    assert_eq!(class.name, "friction-asymmetry, inclination");
    assert_eq!((class.ambiguous, class.resolved.count, class.resolved.of), (1, 1, 1));
    assert!(
        table.markdown().contains("| friction-asymmetry, inclination | 1 | 0 |  | next-short.toml (1) | 1/1")
    );
    let folder = fixture.study.run("right-resolve", fixture.draw.number);
    assert_eq!(fs::read_to_string(folder.join("next.toml")).unwrap(), SHORT);

    // Done is done; a run that did not keep the experiment is repeated for it.
    fs::write(folder.join("mark"), "").unwrap();
    run(&fixture.step("right", false), &program, &fixture.draw).unwrap();
    assert!(folder.join("mark").exists());
    fs::remove_file(fixture.study.run("right", fixture.draw.number).join("next-short.toml")).unwrap();
    run(&fixture.step("right", true), &program, &fixture.draw).unwrap();
    assert!(!folder.join("mark").exists());
    assert_eq!(Table::of(&fixture.study, "right").unwrap().classes[0].resolved.count, 1);

    // Another program does not go on with the results of this one.
    let other = fixture.program("TWIN", PROPOSES);
    let error = run(&fixture.step("right", false), &other, &fixture.draw).unwrap_err().to_string();
    assert!(error.contains("another program"), "{error}");
    let table = fixture.run("wrong", &other);
    assert_eq!((table.all.wrong, table.all.resolved.count, table.all.resolved.of), (1, 0, 1));
}

#[test]
fn where_no_experiment_can_tell_nothing_is_run_and_what_would_is_counted() {
    let fixture = StudyFixture::new();
    let program = fixture.program("TRUTH", r#""next": {"experiment": null, "otherwise": "tilting"}"#);
    let class = fixture.run("none", &program).classes.remove(0);
    assert_eq!((class.no_experiment, class.resolved.of, class.not_run), (1, 0, 0));
    assert_eq!(class.otherwise.into_iter().collect::<Vec<_>>(), [("tilting".to_owned(), 1)]);
    assert!(!fixture.study.run("none-resolve", fixture.draw.number).exists());
}

#[test]
fn an_experiment_that_is_not_proposed_again_is_an_error_that_says_so() {
    let fixture = StudyFixture::new();
    let lost = PROPOSES.replace("next-short", "next-other");
    let table = fixture.run("lost", &fixture.program("TRUTH", &lost));
    assert_eq!(table.cases[0].outcome, Some(Outcome::Error));
    assert!(table.cases[0].problem.as_ref().unwrap().contains("did not write next-other.toml"));
    assert_eq!(table.all.errors, 1);
}
