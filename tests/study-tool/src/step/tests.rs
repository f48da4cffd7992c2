//! Steps with a tiny program and records of a few lines.

use super::*;
use crate::draws::{Kind, Shape};
use crate::folder::Plan;
use crate::program::ProgramEnd;
use crate::program::tests::script;
use crate::report;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tempfile::TempDir;

/// Two nulls and a pair: three draws.
const SHAPE: Shape = Shape { nulls: 2, pairs: 1, ..Shape::NO_DRAW };
const HEAD: &str = "# linked=false added_mass_kg=0\ntime_s,drive_valve,drive_position_m\n";

struct StudyFixture {
    folder: TempDir,
    study: Study,
    program: Program,
    stop: AtomicBool,
    made: AtomicUsize,
    head: &'static str,
    /// Seed of a draw whose record cannot be made.
    tripped: Option<u64>,
}

impl StudyFixture {
    fn new(script: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let study = Study::begin(&folder.path().join("study"), &Plan::new(5, SHAPE)).unwrap();
        let program = program(&folder, script);
        StudyFixture {
            folder,
            study,
            program,
            stop: AtomicBool::new(false),
            made: AtomicUsize::new(0),
            head: HEAD,
            tripped: None,
        }
    }

    fn run(&self, change: impl Fn(&Draw, &mut Step<'_>)) -> Result<Vec<Option<RunResult>>, StepError> {
        let make = |recipe: &Recipe, _: &RigParameters, measurement: &Path, truth: &Path| {
            if self.tripped == Some(recipe.seed) {
                return Err("tripped".to_owned());
            }
            self.made.fetch_add(1, Ordering::Relaxed);
            let write = |path: PathBuf, text: &str| fs::write(path, text).map_err(|error| error.to_string());
            write(measurement.join("measurement.csv"), &format!("{}0.000,0,0.1\n", self.head))?;
            write(truth.join("truth.csv"), "time_s\n")?;
            write(truth.join("truth.json"), "{}")
        };
        let one = |draw: &Draw| {
            let mut step = Step::new(&self.study, "fake", &make, &self.stop);
            change(draw, &mut step);
            step.run(draw, &self.program)
        };
        self.study.draws.iter().map(one).collect()
    }

    fn path(&self, number: usize, name: &str) -> PathBuf {
        self.study.run("fake", number).join(name)
    }
}

fn program(folder: &TempDir, text: &str) -> Program {
    script(folder.path(), text, &["--more"], Duration::from_secs(60))
}

/// Sees what a program may see, and answers.
const ANSWERS: &str = r#"
[ "$1 $2 $3 $4 $5 $6 $7 $8 $9" = "close --rig rig.toml --train train.csv --test test.csv --out out" ] || exit 9
shift 9; [ "$1" = "" ] && exit 8
[ "$(ls | tr '\n' ' ')" = "rig.toml test.csv train.csv " ] || exit 7
echo "seen: $(head -n 1 train.csv)" >&2
mkdir out && echo '{"verdict": "nothing-missing"}' >out/report.json"#;

#[test]
fn a_program_sees_copies_in_an_empty_folder_and_its_report_is_kept() {
    // $9 is the folder: after the shift only what the study adds is left.
    let fixture = StudyFixture::new(
        &ANSWERS.replace("shift 9; [ \"$1\" = \"\" ] && exit 8", "shift 9; [ \"$1\" = --more ] || exit 8"),
    );
    let results = fixture.run(|_, _| {}).unwrap();
    for draw in &fixture.study.draws {
        let result = read_result(&fixture.path(draw.number, "result.json")).unwrap();
        assert_eq!(results[draw.number].as_ref(), Some(&result));
        let reported = fs::read_to_string(fixture.path(draw.number, "stderr.txt")).unwrap();
        assert_eq!((result.number, result.taken.ended), (draw.number, ProgramEnd::Exited(0)), "{reported}");
        assert_eq!(reported, "seen: # linked=false added_mass_kg=0\n");
        assert!(report::read(&fixture.path(draw.number, "report.json")).is_ok());
        assert!(!fixture.study.truth(draw.number).join("train/truth.csv").exists());
        assert!(fixture.study.truth(draw.number).join("held-out-1/truth.json").exists());
    }
    // Three records for each draw, made once, however often it runs again.
    assert_eq!(fixture.run(|_, _| {}).unwrap(), results);
    assert_eq!(fixture.made.load(Ordering::Relaxed), 9);
}

#[test]
fn a_study_that_was_killed_goes_on_where_it_was() {
    let fixture = StudyFixture::new("sleep 1000");
    // Told to stop while the program runs: it is killed, and its draw is not done.
    let ended = std::thread::scope(|scope| {
        let running = scope.spawn(|| fixture.run(|_, _| {}));
        while !fixture.folder.path().join("study/runs/fake").exists() {
            std::thread::sleep(Duration::from_millis(5));
        }
        fixture.stop.store(true, Ordering::Relaxed);
        running.join().unwrap()
    });
    assert_eq!(ended.unwrap(), [None, None, None]);
    assert!(fixture.study.draws.iter().all(|draw| !fixture.study.run("fake", draw.number).exists()));

    // What a kill leaves behind: half a folder of a run and of records.
    for half in ["runs/fake/.0000.unfinished", "records/.0001.unfinished"] {
        fs::create_dir_all(fixture.study.root.join(half)).unwrap();
        fs::write(fixture.study.root.join(half).join("half"), "{").unwrap();
    }
    let fixture =
        StudyFixture { program: program(&fixture.folder, "exit 0"), stop: AtomicBool::new(false), ..fixture };
    assert!(fixture.run(|_, _| {}).unwrap().iter().all(Option::is_some));
    assert!(!fixture.path(0, "half").exists());
}

#[test]
fn a_program_that_crashes_hangs_or_writes_nonsense_is_a_result() {
    let nonsense = "mkdir out; echo '{\"verdict\": ' >out/report.json";
    for (script, ended) in [
        ("exit 101", ProgramEnd::Exited(101)),
        ("kill -9 $$", ProgramEnd::Signalled(9)),
        ("sleep 1000", ProgramEnd::TimedOut),
        (nonsense, ProgramEnd::Exited(0)),
        ("mkdir -p out/report.json", ProgramEnd::Exited(0)),
    ] {
        let mut fixture = StudyFixture::new(script);
        fixture.program.limit =
            Duration::from_millis(if ended == ProgramEnd::TimedOut { 100 } else { 60_000 });
        let results = fixture.run(|_, _| {}).unwrap();
        let result = results[0].as_ref().unwrap();
        assert_eq!(result.taken.ended, ended, "{script}");
        assert!(report::read(&fixture.path(0, "report.json")).is_err(), "{script}");
    }
}

#[test]
fn a_column_that_could_tell_is_refused() {
    let fixture = StudyFixture { head: "time_s,drive_valve,drive_leakage\n", ..StudyFixture::new("exit 0") };
    let error = fixture.run(|_, _| {}).unwrap_err().to_string();
    assert!(error.contains("drive_leakage"), "{error}");
}

#[test]
fn a_record_that_cannot_be_made_is_reported_and_leaves_nothing() {
    let mut fixture = StudyFixture::new("exit 0");
    fixture.tripped = Some(fixture.study.draws[0].recipe.seed);
    let error = fixture.run(|_, _| {}).unwrap_err().to_string();
    assert_eq!(error, "draw 0: its record cannot be made: tripped");
    assert!(!fixture.path(0, "result.json").exists() && !fixture.study.records(0).exists());
}

#[test]
fn a_disk_nearly_full_stops_the_study_before_it_is() {
    let fixture = StudyFixture::new("exit 0");
    let error = fixture.run(|_, step| step.least_free_mib = u64::MAX).unwrap_err().to_string();
    assert!(error.contains("nothing is lost"), "{error}");
    assert!(!fixture.study.root.join("runs").exists());
}

#[test]
fn another_program_does_not_go_on_with_the_results_of_one() {
    let fixture = StudyFixture::new("exit 0");
    fixture.run(|_, _| {}).unwrap();
    let fixture = StudyFixture { program: program(&fixture.folder, "exit 1"), ..fixture };
    assert!(fixture.run(|_, _| {}).unwrap_err().to_string().contains("another --label"));
    fixture.run(|_, step| step.label = "other").unwrap();
}

#[test]
fn what_is_left_out_is_said_on_the_command_line() {
    // The arguments of every program come first, so that both stay what they are.
    let fixture = StudyFixture::new("shift 10; echo \"$*\" >&2");
    let results = fixture.run(|_, step| step.without = Some(vec!["inclination".to_owned()])).unwrap();
    let result = results[2].as_ref().unwrap();
    assert_eq!(result.without, ["inclination"]);
    assert!(result.program.leave_out);
    let reported = fs::read_to_string(fixture.path(2, "stderr.txt")).unwrap();
    assert_eq!(reported, "--without inclination\n");
    // The same program with its whole catalogue is another one.
    assert!(fixture.run(|_, _| {}).unwrap_err().to_string().contains("another --label"));
}

#[test]
fn what_is_done_is_done_again_and_records_are_dropped_when_asked() {
    let fixture = StudyFixture::new("exit 0");
    fixture.run(|_, _| {}).unwrap();
    fs::write(fixture.path(1, "mark"), "").unwrap();
    fixture.run(|draw, step| step.again = draw.number == 0).unwrap();
    assert!(fixture.path(1, "mark").exists());
    fixture
        .run(|draw, step| {
            step.again = draw.number == 1;
            step.drop_records = true;
        })
        .unwrap();
    assert!(
        !fixture.path(1, "mark").exists()
            && !fixture.study.records(1).exists()
            && fixture.study.truth(1).exists()
    );
}

#[test]
fn the_draws_of_this_test_are_those_it_speaks_of() {
    let draws = Plan::new(5, SHAPE).draws();
    assert_eq!(draws.iter().map(|draw| draw.kind).collect::<Vec<_>>(), [Kind::Null, Kind::Null, Kind::Pair]);
}
