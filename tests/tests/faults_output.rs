//! Faults of the output: a file that may not grow, a disk that is full, a process that is killed while it writes.

use std::path::Path;
use system_tests::exit::BAD_INPUT;
use system_tests::small_disk::SmallDisk;
use system_tests::{
    CompletedProcess, Pace, RESTLESS, Scene, Table, bus_log_to_last_whole_line, count, expect_whole_lines,
    json, skip, turn,
};

/// No file grows beyond some hundred KiB; the signal that comes with it is ignored, so that writing fails instead.
const SMALL_FILES: &str = "trap '' XFSZ && ulimit -f 300";

fn expect_write_error(ended: CompletedProcess, folder: &Path) {
    let folder = folder.display().to_string();
    ended.expect_code(BAD_INPUT).expect_stderr(&["cannot write", &folder, "free space", "--out"]);
}

/// A batch of lines that the disk took in part was left as it was, so that measurement.csv ended in half a row and the
/// programs that read it stopped there.
#[test]
fn an_emulator_whose_file_cannot_grow_ends_the_run_and_keeps_whole_lines() {
    let _machine = turn::take();
    for pace in [Pace::Real, Pace::Lockstep] {
        let scene = Scene::new(RESTLESS);
        let emulator = scene.emulator(pace).after_shell(SMALL_FILES).start();
        let controller = scene.controller(pace).with("--repeat --bus-grace 2").start();
        expect_write_error(emulator.wait(), &scene.path("emulator"));
        controller.wait().expect_code(0);
        let rows = expect_whole_lines(&scene.path("emulator/measurement.csv"));
        assert!(rows > 100, "what fitted was written: {rows} rows, {pace:?}");
        let _ = expect_whole_lines(&scene.path("emulator/truth.csv"));
        let _ = expect_whole_lines(&scene.path("emulator/bus.log"));
        assert_eq!(scene.summary()["passed"], false);
    }
}

#[test]
fn a_controller_whose_file_cannot_grow_ends_and_the_rig_shuts_its_valve() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let mut emulator = scene.emulator(Pace::Real).with("--seconds 20").start();
    let controller = scene.controller(Pace::Real).with("--repeat").after_shell(SMALL_FILES).start();
    expect_write_error(controller.wait(), &scene.path("controller"));
    emulator.wait_for("no fresh drive command for 20 cycles, valve shut");
    assert!(expect_whole_lines(&scene.path("controller/controller-drive.csv")) > 100);
    assert_eq!(scene.report()["ended_because"], "the output could not be written");
}

#[test]
fn a_full_disk_ends_the_run_and_keeps_whole_lines() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let Some(disk) = SmallDisk::mount(scene.path("disk"), 512) else {
        skip::report("a_full_disk_ends_the_run_and_keeps_whole_lines", "mounting a tmpfs needs root");
        return;
    };
    let folder = disk.path.join("run");
    let emulator = scene.emulator(Pace::Real).out(&folder).start();
    let controller = scene.controller(Pace::Real).with("--repeat").start();
    expect_write_error(emulator.wait(), &folder);
    controller.wait().expect_code(0);
    assert!(expect_whole_lines(&folder.join("measurement.csv")) > 100);
    let _ = expect_whole_lines(&folder.join("truth.csv"));
    let _ = expect_whole_lines(&folder.join("bus.log"));
    let summary = folder.join("summary.json");
    assert!(!summary.exists() || json(&summary).is_object(), "there is no half summary");
}

/// Lines wait in memory for 0.2 s at most; what a kill may cost is that, and what the machine was busy with otherwise.
#[test]
fn an_emulator_that_is_killed_leaves_files_that_read_to_their_last_whole_line() {
    const MOST_CYCLES_MISSING: u64 = 1000;
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let emulator = scene.emulator(Pace::Real).start();
    let listener = scene.peer();
    let received = std::thread::spawn(move || listener.frames_to_the_end());
    let controller = scene.controller(Pace::Real).with("--repeat --bus-grace 0.5").start();
    scene.wait_for_rows("emulator", 1500);
    emulator.kill();
    let received = received.join().expect("the listener listens");
    controller.wait().expect_code(3);
    let last = received.iter().rev().find_map(|frame| match protocol::frames::Frame::decode(frame) {
        Ok(protocol::frames::Frame::Tick(tick)) => Some(u64::from(tick.cycle)),
        _ => None,
    });
    let last = last.expect("a tick was heard");
    for file in ["measurement.csv", "truth.csv"] {
        let table = Table::read_to_last_whole_line(&scene.path("emulator").join(file));
        table.expect_no_hole();
        let missing = (last + 1).saturating_sub(table.len() as u64);
        eprintln!("{file}: {missing} cycles before the kill are missing");
        assert!(missing < MOST_CYCLES_MISSING, "{file}: {missing} cycles are missing");
    }
    let frames = bus_log_to_last_whole_line(&scene.path("emulator/bus.log")).len() as u64;
    assert!(frames > 4 * (last - MOST_CYCLES_MISSING), "bus.log holds {frames} frames of {last} cycles");
    assert!(!scene.path("emulator/summary.json").exists(), "no summary of a run that did not end");
    assert!(count(&scene.run_description(), "/schema_version") >= 1);
}
