//! The study as a campaign: its steps are taken by shards, stopped and gone on with, and its files are what they say.

use rustix::process::{Pid, Signal, test_kill_process};
use std::fs;
use std::process::Command;
use system_tests::exit::{BAD_INPUT, GOOD, INTERRUPTED};
use system_tests::{Build, CompletedProcess, Program, Running, executable, install, wait_until, workspace};
use tempfile::TempDir;

/// Two draws with nothing hidden, and a pair.
const SHAPE: [&str; 10] =
    ["--each", "0", "--nulls", "2", "--parameters", "0", "--pairs", "1", "--triples", "0"];

const STUDY: &str = env!("CARGO_BIN_EXE_study");

/// A folder with a campaign file and a program that is judged.
struct StudyFolder {
    folder: TempDir,
}

impl StudyFolder {
    fn new(script: &str, draws: u32) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("program");
        install(format!("#!/bin/sh\n{script}\n").as_bytes(), &program);
        let program = program.display().to_string();
        let start = [STUDY, "one", "run", "--out", "study", "--label", "fake", "--program", &program];
        let words: Vec<_> = start.into_iter().chain(SHAPE).map(|word| format!("{word:?}")).collect();
        let text = format!(
            "title = \"fake\"\ncommand = [{}]\ndraws = {draws}\nruns_per_part = 1\n\
             [collect]\nfigures = [\"kind\", \"hidden\", \"called\", \"right\"]\nconfusion = [[\"kind\", \"called\"]]\n",
            words.join(", ")
        );
        fs::write(folder.path().join("c.toml"), text).expect("a campaign file");
        Self { folder }
    }

    fn campaign(&self, out: &str, arguments: &[&str]) -> Command {
        let mut campaign = Command::new(executable(Program::Campaign, Build::Shipped));
        // From elsewhere: paths are from the campaign's file.
        campaign.arg("run").arg(self.folder.path().join("c.toml")).args(arguments).current_dir("/");
        campaign.arg("--out").arg(self.folder.path().join(out));
        campaign
    }

    fn run(&self, arguments: &[&str]) -> CompletedProcess {
        Running::start("campaign", &mut self.campaign("out", arguments)).wait()
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.folder.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }
}

#[test]
fn shards_fill_one_folder_and_the_study_is_scored() {
    let place = StudyFolder::new("mkdir out; echo '{\"verdict\": \"nothing-missing\"}' >out/report.json", 3);
    for shard in ["1/2", "0/2"] {
        let _ = place.run(&["--shard", shard]).expect_code(GOOD);
    }
    let _ = place.run(&[]).expect_code(GOOD).expect_stderr(&["0 to do"]);
    let table = place.text("out/runs.csv");
    let rows: Vec<&str> = table.lines().map(|line| line.splitn(8, ',').last().expect("columns")).collect();
    assert_eq!(rows[..3], ["kind,hidden,called,right", "null,nothing,nothing,1", "null,nothing,nothing,1"]);
    assert!(rows[3].starts_with("pair,") && rows[3].ends_with(",nothing,0"), "{table}");
    let mut score = Command::new(STUDY);
    score.args(["score", "study", "--label", "fake"]).current_dir(place.folder.path());
    let _ = Running::start("study", &mut score).wait().expect_code(GOOD);
    let score: serde_json::Value = serde_json::from_str(&place.text("study/score-fake.json")).expect("JSON");
    assert_eq!(score["cases"].as_array().map(Vec::len), Some(3));
}

#[test]
fn a_study_that_is_stopped_ends_its_programs_and_goes_on() {
    let place = StudyFolder::new("echo $$ >\"$0.number\"; exec sleep 1000", 3);
    let campaign = Running::start("campaign", &mut place.campaign("out", &["--jobs", "1"]));
    let said = place.folder.path().join("program.number");
    wait_until("the program's number", || fs::read_to_string(&said).is_ok_and(|text| text.ends_with('\n')));
    campaign.signal(Signal::INT);
    let _ = campaign.wait().expect_code(INTERRUPTED).expect_stderr(&["the same command goes on"]);
    let number = place.text("program.number").trim().parse().expect("a number");
    let number = Pid::from_raw(number).expect("a process");
    assert!(test_kill_process(number).is_err(), "the program that was judged is still there");
    assert!(!place.folder.path().join("study/runs/fake/0000").exists(), "a draw is done or absent");
}

#[test]
fn what_is_no_result_ends_the_study_and_leaves_the_draw_missing() {
    let place = StudyFolder::new("mkdir out; echo '{\"verdict\": \"nothing-missing\"}' >out/report.json", 4);
    let _ = place.run(&["--jobs", "1"]).expect_code(BAD_INPUT).expect_stderr(&["needs draws = 3", "kept"]);
    assert!(place.folder.path().join("out/parts/000002.csv").exists());
    assert!(!place.folder.path().join("out/parts/000003.csv").exists());
    // Another program under the same label is reported, whatever the campaign thinks.
    fs::write(place.folder.path().join("program"), "#!/bin/sh\nexit 1\n").expect("another program");
    let again = Running::start("campaign", &mut place.campaign("again", &[])).wait();
    let _ = again.expect_code(BAD_INPUT).expect_stderr(&["another --label"]);
}

#[test]
fn shipped_studies_are_campaigns_of_all_their_draws() {
    let mut seen = 0;
    for entry in fs::read_dir(workspace().join("tests/study")).expect("studies").flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|ending| ending != "toml") {
            continue;
        }
        let file: toml::Table = fs::read_to_string(&path).expect("a file").parse().expect("TOML");
        let words: Vec<_> =
            file["command"].as_array().expect("words").iter().filter_map(toml::Value::as_str).collect();
        // One draw beyond the last, in a folder of its own: reported before anything is done.
        let out = tempfile::tempdir().expect("a folder");
        let place = words.iter().position(|word| *word == "--out").expect("a folder of the study");
        let mut words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        words[place + 1] = out.path().display().to_string();
        let draws = file["draws"].as_integer().expect("how many");
        words.splice(3..3, ["--draw".to_owned(), "1000000".to_owned()]);
        let mut command = Command::new(STUDY);
        let reported = Running::start("study", command.args(&words[1..])).wait().expect_code(75).stderr;
        let singles = plant::effects::SHEETS.len() as i64 * 6;
        let all = reported.split("draws = ").nth(1).and_then(|all| all.trim().parse::<i64>().ok());
        let expected =
            if ["leave-out", "resolve"].contains(&words[2].as_str()) { Some(singles) } else { all };
        assert_eq!(Some(draws), expected, "{}: {reported}", path.display());
        seen += 1;
    }
    assert!(seen >= 3, "{seen} studies");
}
