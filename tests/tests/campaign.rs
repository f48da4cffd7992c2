//! Campaigns: a row is what a run's folder says, whoever does the parts and however often somebody pulls the plug.

use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use system_tests::exit::{BAD_INPUT, BOUND_BROKEN, GOOD, INTERRUPTED};
use system_tests::process_table::ProcessStat;
use system_tests::small_disk::SmallDisk;
use system_tests::{
    Build, CompletedProcess, PATIENCE, Program, Running, executable, install, json, skip, workspace,
};
use tempfile::TempDir;

/// Twelve short rehearsals in six parts.
const SMALL: &str = "title = \"small\"\nexperiment = \"step\"\nseconds = 2.5\ndraws = 3\nruns_per_part = 2\n\
    [collect]\nworst = [\"position_error_dynamic_m\"]\n\
    [[vary]]\nset = \"drive.algorithm.gain_per_s\"\nlist = [15, 30]\n\
    [[vary]]\nexperiment = \"rig.added_mass_kg\"\nlist = [0, 20]\n\
    [[vary]]\nrig = \"friction.sliding_force_n\"\nrange = [20, 34]\n";

struct CampaignFolder {
    folder: TempDir,
}

impl CampaignFolder {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("c.toml"), text).expect("a campaign file");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, command: &str, arguments: &[&str]) -> Command {
        let mut program = Program::Campaign.command();
        program.args([command, "c.toml"]).args(arguments).current_dir(self.folder.path());
        program.arg("--shipped").arg(workspace().join("controller"));
        for variable in ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"] {
            program.env_remove(variable);
        }
        program
    }

    fn run(&self, command: &str, arguments: &[&str]) -> CompletedProcess {
        Running::start("campaign", &mut self.command(command, arguments)).wait()
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    fn parts(&self, out: &str) -> usize {
        fs::read_dir(self.path(out).join("parts")).map_or(0, |parts| {
            let whole = |path: &Path| path.extension().is_some_and(|ending| ending == "csv");
            parts.flatten().filter(|entry| whole(&entry.path())).count()
        })
    }
}

fn row(text: &str, run: usize) -> BTreeMap<String, String> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let head = reader.headers().expect("a head").clone();
    let row = reader.records().nth(run).expect("so many rows").expect("a row");
    head.iter().zip(&row).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
}

/// What one start did without being disturbed, for others to be compared with.
fn undisturbed(place: &CampaignFolder) -> String {
    place.run("run", &["--out", "whole", "--jobs", "2"]).expect_code(GOOD);
    place.text("whole/runs.csv")
}

#[test]
fn a_row_is_what_the_runs_folder_says_to_the_bit() {
    // Long enough for the experiment to end by itself.
    let place = CampaignFolder::new(&SMALL.replace("seconds = 2.5", "seconds = 60"));
    let table = undisturbed(&place);
    for run in [1, 10] {
        assert_eq!(row(&table, run)["ended"], "done");
        let number = run.to_string();
        place.run("repeat", &[&number, "--out", "again"]).expect_code(GOOD);
        let summary = json(&place.path("again/summary.json"));
        let row = row(&table, run);
        let mut compared = 0;
        for (name, value) in summary["figures"].as_object().expect("figures") {
            assert_eq!(row[name].parse::<f64>().ok(), value.as_f64(), "run {run}: {name}");
            compared += 1;
        }
        for name in ["position_error_dynamic_m", "position_error_static_m"] {
            assert_eq!(row[name].parse::<f64>().ok(), summary[name].as_f64(), "run {run}: {name}");
        }
        assert!(compared >= 3, "{compared} figures prove nothing");
        assert_eq!(json(&place.path("again/run.json"))["seed"].to_string(), row["seed"], "run {run}");
    }
}

#[test]
fn shards_in_any_order_and_number_give_the_same_bytes() {
    let place = CampaignFolder::new(SMALL);
    let whole = undisturbed(&place);
    assert_eq!(whole.lines().count(), 13);
    for shard in ["2/3", "0/3", "1/3"] {
        let out = format!("shard-{}", &shard[..1]);
        place.run("run", &["--out", &out, "--shard", shard, "--jobs", "1"]).expect_code(GOOD);
    }
    let folders = ["shard-0", "shard-1", "shard-2"];
    let merge = |folders: &[&str]| place.run("merge", &[folders, &["--to", "merged"]].concat());
    merge(&folders).expect_code(GOOD);
    assert!(place.text("merged/runs.csv") == whole, "three shards give other bytes than one start");
    merge(&folders[..2]).expect_code(BAD_INPUT).expect_stderr(&["2 of 6 parts are missing", "part 2"]);
    let doubled = [&folders[..], &["whole"]].concat();
    merge(&doubled).expect_code(BAD_INPUT).expect_stderr(&["twice", "shard-0", "whole"]);
    // An array of Slurm and an indexed job give the index; both counts fill one folder.
    for (variable, index, count) in [("SLURM_ARRAY_TASK_ID", "0", "2"), ("JOB_COMPLETION_INDEX", "1", "2")] {
        let mut start = place.command("run", &["--out", "array", "--shard", count]);
        Running::start("campaign", start.env(variable, index)).wait().expect_code(GOOD);
    }
    place.run("merge", &["array"]).expect_code(GOOD);
    assert!(place.text("array/runs.csv") == whole);
}

#[test]
fn a_start_that_is_killed_again_and_again_ends_with_the_same_bytes() {
    let place = CampaignFolder::new(SMALL);
    let whole = undisturbed(&place);
    let began = Instant::now();
    let mut kills = 0;
    for wanted in 1..6 {
        let start = Running::start("campaign", &mut place.command("run", &["--out", "out", "--jobs", "1"]));
        while place.parts("out") < wanted {
            assert!(began.elapsed() < PATIENCE, "no part {wanted}");
            std::thread::sleep(Duration::from_millis(1));
        }
        kills += u32::from(start.kill().signal == Some(Signal::KILL.as_raw()));
    }
    assert!(kills > 0, "nothing was killed in its midst");
    let last = place.run("run", &["--out", "out"]).expect_code(GOOD);
    assert!(!last.stderr.contains("; 12 to do"), "what was done is done again:\n{}", last.stderr);
    assert!(place.text("out/runs.csv") == whole, "after {kills} kills the bytes are others");
}

#[test]
fn an_interrupted_start_says_so_and_goes_on() {
    let place = CampaignFolder::new(&SMALL.replace("draws = 3", "draws = 400"));
    let mut start = Running::start("campaign", &mut place.command("run", &["--out", "out"]));
    start.wait_for("runs, ");
    start.signal(Signal::INT);
    start.wait().expect_code(INTERRUPTED).expect_stderr(&["stopped", "the same command goes on"]);
    assert!(!place.path("out/runs.csv").exists(), "there is no half table");
}

#[test]
fn truncated_and_foreign_parts_are_refused_and_never_merged() {
    let place = CampaignFolder::new(SMALL);
    let whole = undisturbed(&place);
    let path = place.path("whole/parts/000002.csv");
    let good = fs::read_to_string(&path).expect("a part");
    let merge = || place.run("merge", &["whole"]).expect_code(BAD_INPUT);
    for (bad, words) in [
        (good[..good.len() / 2].to_owned(), "makes this part and the missing ones"),
        (good.replace("made by ", "made by 0123"), "another version"),
        (good.replace("campaign ", "campaign 0123"), "another campaign"),
        (good.replacen("\n4,", "\n5,", 1), "not as it was written"),
    ] {
        fs::write(&path, bad).expect("it can be spoiled");
        merge().expect_stderr(&["000002.csv", words]);
    }
    // One that cannot be read is made again; strangers are left alone.
    place.run("run", &["--out", "whole"]).expect_code(GOOD).expect_stderr(&["it is made again", "; 2 to do"]);
    assert!(place.text("whole/runs.csv") == whole);
    fs::write(&path, good.replace("made by ", "made by 0123")).expect("it can be spoiled");
    place.run("run", &["--out", "whole"]).expect_code(BAD_INPUT).expect_stderr(&["another version"]);
}

#[test]
fn a_full_disk_loses_nothing_that_is_done() {
    let place = CampaignFolder::new(&SMALL.replace("draws = 3", "draws = 60"));
    let Some(disk) = SmallDisk::mount(place.path("disk"), 64) else {
        skip::report("a_full_disk_loses_nothing_that_is_done", "mounting a tmpfs needs root");
        return;
    };
    let out = disk.path.join("out").display().to_string();
    let _ = place
        .run("run", &["--out", &out])
        .expect_code(BAD_INPUT)
        .expect_stderr(&["free disk space and run the same command"]);
    let done = place.parts("disk/out");
    assert!(done > 0, "nothing was written before the disk was full");
    // Elsewhere the same goes on from what the full disk holds.
    fs::create_dir_all(place.path("roomy")).expect("a folder");
    let copied =
        Command::new("cp").arg("-r").arg(disk.path.join("out/parts")).arg(place.path("roomy")).status();
    assert!(copied.expect("cp starts").success());
    let again = place.run("run", &["--out", "roomy"]).expect_code(GOOD);
    let todo = format!("; {} to do", 240 - 2 * done);
    assert!(again.stderr.contains(&todo), "'{todo}' is missing:\n{}", again.stderr);
}

#[test]
fn what_a_program_answers_becomes_a_table_and_a_confusion_matrix() {
    let place = CampaignFolder::new(
        "title = \"judge\"\ncommand = [\"./judge.sh\"]\ndraws = 2\n\
         [collect]\nfigures = [\"named\", \"score\"]\nconfusion = [[\"hidden\", \"named\"]]\nworst = [\"score\"]\n\
         [[vary]]\nname = \"hidden\"\nlist = [\"leak\", \"lag\", \"crash\"]\n",
    );
    let script = "#!/bin/sh\nread line\ncase $line in *crash*) echo broken >&2; exit 3;; *leak*) n=leak;; *) n=leak;; esac\n\
                  echo \"{\\\"named\\\": \\\"$n\\\", \\\"score\\\": 0.5}\"\n";
    install(script.as_bytes(), &place.path("judge.sh"));
    place.run("run", &["--out", "out", "--expect-passed"]).expect_code(BOUND_BROKEN);
    let table = place.text("out/runs.csv");
    let cell = |run: usize, name: &str| row(&table, run)[name].clone();
    assert_eq!((cell(0, "named"), cell(0, "ended")), ("leak".to_owned(), "done".to_owned()));
    assert_eq!((cell(4, "named"), cell(4, "ended")), (String::new(), "failed".to_owned()));
    assert!(cell(4, "because").contains("broken"), "{table}");
    let page = place.text("out/report.html");
    assert!(page.contains("hidden and named") && page.contains("The same in 2 of 6 runs"), "{page}");
}

/// An experiment with a table beside it, of which one number is varied.
#[test]
fn a_table_of_set_points_is_of_the_campaign_and_goes_with_a_run() {
    let place = CampaignFolder::new(
        "title = \"way\"\nexperiment = \"way.toml\"\nseconds = 3\n[collect]\nfigures = [\"position_error_dynamic_m\"]\n\
         [[vary]]\nexperiment = \"rig.added_mass_kg\"\nlist = [0, 10]\n",
    );
    let experiment = "title = \"way\"\n[rig]\ncarriage_position_m = 0.1\n[drive]\nprogram = \"position-p\"\nstart_m = 0.1\n\
        [[drive.set-point]]\nlaw = \"table\"\nfile = \"way.csv\"\ninterpolation = \"smooth\"\n";
    fs::write(place.path("way.toml"), experiment).expect("an experiment");
    fs::write(place.path("way.csv"), "time_s,position_m\n0,0.1\n1,0.2\n2,0.15\n").expect("a table");
    let table = undisturbed(&place);
    place.run("repeat", &["1", "--out", "again"]).expect_code(GOOD);
    let summary = json(&place.path("again/summary.json"));
    let error = row(&table, 1)["position_error_dynamic_m"].parse::<f64>().ok();
    assert!(error.is_some() && error == summary["position_error_dynamic_m"].as_f64(), "{table}");
    fs::write(place.path("way.csv"), "time_s,position_m\n0,0.1\n1,0.3\n2,0.15\n").expect("a table");
    place.run("run", &["--out", "whole"]).expect_code(BAD_INPUT).expect_stderr(&["another campaign"]);
}

#[test]
fn every_shipped_campaign_is_one_and_faults_run_as_processes() {
    for entry in fs::read_dir(workspace().join("campaign/campaigns")).expect("campaigns").flatten() {
        let place = CampaignFolder::new(&fs::read_to_string(entry.path()).expect("a campaign"));
        let ended = place.run("plan", &["--json"]).expect_code(GOOD);
        let plan: serde_json::Value = serde_json::from_str(&ended.stdout).expect("a plan");
        assert!(plan["runs"].as_u64().is_some_and(|runs| runs > 10), "{}", entry.path().display());
    }
    let faults = fs::read_to_string(workspace().join("campaign/campaigns/faults.toml")).expect("the faults");
    let place = CampaignFolder::new(&faults.replace("draws = 4", "draws = 1\nruns_per_part = 3"));
    place.run("run", &["--out", "out"]).expect_code(GOOD);
    let table = place.text("out/runs.csv");
    let errors: Vec<f64> =
        (0..3).map(|run| row(&table, run)["position_error_dynamic_m"].parse().expect("a figure")).collect();
    // A sensor that jumps in the midst of a motion shows its jump as error.
    assert!(errors[2] > 0.008 && errors[2] > errors[0], "{errors:?}");
}

#[test]
fn the_page_is_whole_and_asks_for_nothing_from_elsewhere() {
    let place = CampaignFolder::new(SMALL);
    undisturbed(&place);
    let page = place.text("whole/report.html");
    let document = roxmltree::Document::parse_with_options(
        &page,
        roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() },
    );
    let document = document.expect("well-formed");
    let repeat = format!("scripts/campaign repeat {} ", place.path("c.toml").display());
    for words in ["How the runs ended", "Medians over the varied values", "Worst cases", &repeat] {
        assert!(page.contains(words), "'{words}' is missing");
    }
    for node in document.descendants() {
        for attribute in node.attributes().filter(|attribute| ["src", "href"].contains(&attribute.name())) {
            assert_eq!(attribute.value(), "runs.csv", "{attribute:?}");
        }
    }
}

/// A Dask cluster of two workers on this machine, one of which is killed while both are at work.
#[test]
fn dask_gives_the_same_bytes_when_a_worker_is_killed() {
    let place = CampaignFolder::new(&SMALL.replace("draws = 3", "draws = 16"));
    let whole = undisturbed(&place);
    let mut command = Command::new(system_tests::foreign_python::of("dask"));
    command.arg(workspace().join("campaign/dask/hand_out.py")).current_dir(place.folder.path());
    command.args(["c.toml", "--out", "out", "--workers", "2"]);
    command.arg("--campaign").arg(executable(Program::Campaign, Build::Shipped));
    command.arg("--shipped").arg(workspace().join("controller"));
    let mut driver = Running::start("hand_out.py", &mut command);
    driver.wait_for("parts, ");
    let worker = worker_at_work(driver.number());
    rustix::process::kill_process(worker, Signal::KILL).expect("a worker can be killed");
    assert!(place.parts("out") < 32, "it was done before anybody could be killed");
    driver.wait().expect_code(GOOD);
    assert!(place.text("out/runs.csv") == whole, "with a worker killed the bytes are others");
    let pages = ["out", "whole"].map(|folder| place.text(&format!("{folder}/report.html")));
    assert!(pages[0] == pages[1], "with a worker killed the page is another");
}

/// A process below `driver` that has a `campaign run` below it.
fn worker_at_work(driver: u32) -> rustix::process::Pid {
    let began = Instant::now();
    loop {
        let processes: Vec<_> = ProcessStat::all().collect();
        let parent = |number: u32| {
            processes.iter().find(|process| process.number == number).map(|process| process.parent)
        };
        let below = |mut number: u32| loop {
            match parent(number) {
                Some(parent) if parent == driver => break true,
                Some(parent) => number = parent,
                None => break false,
            }
        };
        let worker = processes
            .iter()
            .find(|process| process.name == "campaign" && process.parent != driver && below(process.parent));
        if let Some(worker) = worker {
            return rustix::process::Pid::from_raw(worker.parent as i32).expect("a process");
        }
        assert!(began.elapsed() < PATIENCE, "no worker is at work");
        std::thread::sleep(Duration::from_millis(2));
    }
}
