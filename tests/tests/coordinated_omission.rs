//! What a rig leaves of a stall: every late cycle in its histograms, and the cycles and frames around it in its flight recorder.
//!
//! A loop that measures itself sees one late wake-up where fifty cycles were late; a report made of that would be fifty times too
//! good. Here the rig's process is stopped from outside for 50 ms, as a debugger does it.

use crate::hlog;
use hdrhistogram::Histogram;
use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Duration;
use system_tests::{
    Pace, RESTLESS, Running, Scene, both_good, bus_log, count, json, timing_rows, turn, wait_until,
};

const MS: u64 = 1_000_000;

fn under_way(scene: &Scene, options: &str) -> (Running, Running) {
    let both = scene.start(Pace::Real, options, "--repeat");
    scene.wait_for_rows("emulator", 1500);
    both
}

/// All lines of a tag added up, which is the whole run.
fn sum(path: &Path, tag: &str) -> Histogram<u64> {
    let lines = hlog::intervals(path).into_iter().filter(|(other, ..)| other == tag);
    let sum = lines.map(|(.., histogram)| histogram).reduce(|mut sum, next| {
        sum.add(&next).expect("equal bounds");
        sum
    });
    sum.unwrap_or_else(|| panic!("no {tag} in {}", path.display()))
}

fn dumps(scene: &Scene, trigger: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(scene.path("emulator/flight")) else { return Vec::new() };
    let all = entries.map(|entry| entry.expect("an entry").path());
    all.filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("emulator-") && name.ends_with(&format!("-{trigger}"))
    })
    .collect()
}

#[test]
fn a_stall_of_fifty_milliseconds_leaves_all_its_late_cycles_and_a_dump_that_shows_it() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = under_way(&scene, "--seconds 4 --full-timing");
    emulator.stop();
    std::thread::sleep(Duration::from_millis(50));
    emulator.signal(Signal::CONT);
    both_good(emulator, controller);

    let summary = scene.summary();
    let (cycles, skipped) = (count(&summary, "/cycles"), count(&summary, "/skipped"));
    assert_eq!((cycles, count(&summary, "/records_dropped")), (4000, 0));
    let table = timing_rows(&scene.path("emulator/emulator-timing.csv"));
    assert_eq!(table.len() as u64 + skipped, cycles, "rows and skipped cycles");
    // A busy machine may stall the rig for longer at another time; this stall ends with the continuation, whose handler may run
    // on another thread, a moment later.
    let reported =
        table.iter().find(|row| row.vitals.continued > 0).expect("no row tells of the continuation");
    let before = table
        .iter()
        .filter(|row| (reported.cycle.saturating_sub(1000)..=reported.cycle).contains(&row.cycle));
    let stall = before.max_by_key(|row| row.skipped).expect("a row");
    // The system may take its time to go on, but not less than was slept.
    assert!(stall.skipped >= 49, "{stall:?}");

    let wakeup = sum(&scene.path("emulator/emulator.hlog"), "emulator-wakeup");
    assert_eq!(wakeup.len(), cycles, "each cycle that was due stands in the histogram once");
    assert_eq!(wakeup.len(), count(&summary, "/wakeup_ns/count"));
    assert_eq!(wakeup.max(), count(&summary, "/wakeup_ns/max"));
    let completion = sum(&scene.path("emulator/emulator.hlog"), "emulator-completion");
    assert_eq!(completion.len(), cycles, "a missed cycle is completed late too");
    assert!(completion.max() >= wakeup.max(), "{} and {}", completion.max(), wakeup.max());
    // One for each missed cycle, a millisecond apart. Three digits: a bin is at most a thousandth wide.
    let late_ns = stall.woke_ns - stall.due_ns + stall.skipped * MS;
    for missed in 0..stall.skipped {
        let expected_ns = late_ns - missed * MS;
        let (from_ns, to_ns) = (expected_ns - expected_ns / 1000, expected_ns + expected_ns / 1000);
        assert!(wakeup.count_between(from_ns, to_ns) >= 1, "no sample at {expected_ns} ns");
    }
    let done_ns = stall.done_ns - stall.due_ns;
    for missed in 0..=stall.skipped {
        let expected_ns = done_ns + missed * MS;
        let (from_ns, to_ns) = (expected_ns - expected_ns / 1000, expected_ns + expected_ns / 1000);
        assert!(completion.count_between(from_ns, to_ns) >= 1, "no completion at {expected_ns} ns");
    }
    let at_least_a_cycle = wakeup.count_between(MS, wakeup.high());
    assert!(at_least_a_cycle >= skipped, "{at_least_a_cycle} late samples for {skipped} skipped cycles");
    for (tag, expected) in [("emulator-execution", cycles - skipped), ("emulator-send", cycles - skipped)] {
        assert_eq!(sum(&scene.path("emulator/emulator.hlog"), tag).len(), expected, "{tag}");
    }

    let dumps = dumps(&scene, "overrun");
    // Named after its cycle: on a busy machine there are others, whose windows may hold the stall too.
    let named_so = |dump: &&PathBuf| dump.to_string_lossy().contains(&format!("-{:010}-", stall.cycle));
    let dump = dumps.iter().find(named_so).unwrap_or_else(|| panic!("no dump of {stall:?} in {dumps:?}"));
    let event = json(&dump.join("event.json"));
    assert_eq!((&event["trigger"], &event["process"]), (&"overrun".into(), &"emulator".into()));
    assert_eq!((count(&event, "/cycle"), count(&event, "/late_ns")), (stall.cycle, late_ns));
    let around = timing_rows(&dump.join("timing.csv"));
    assert!(around.iter().any(|row| row.vitals.continued > 0), "{reported:?} is not in the dump");
    assert!(count(&summary, "/vitals/continued") > 0);
    assert!(around.len() > 1000, "a second before, and something after: {} rows", around.len());
    assert!(bus_log(&dump.join("bus.log")).len() > 4000, "four frames in a cycle at least");
    let kept = std::fs::read_dir(scene.path("emulator/flight")).expect("the folder").count();
    assert_eq!(count(&summary, "/flight/dumps"), kept as u64);
}

#[test]
fn a_dump_can_be_asked_for_and_changes_nothing() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = under_way(&scene, "--seconds 60");
    emulator.signal(Signal::USR1);
    wait_until("a dump that was asked for", || !dumps(&scene, "signal").is_empty());
    scene.wait_for_more_rows("emulator", 500);
    let dump = &dumps(&scene, "signal")[0];
    assert!(timing_rows(&dump.join("timing.csv")).len() > 1000);
    let event: Value = json(&dump.join("event.json"));
    let (from, at) = (count(&event, "/window_from_ns"), count(&event, "/at_monotonic_ns"));
    assert!(at - from >= 1000 * MS, "a second before: {event}");
    emulator.interrupt();
    controller.wait();
    assert!(count(&scene.summary(), "/flight/dumps") >= 1);
}

#[test]
fn without_a_recorder_nobody_is_dumped_and_what_an_earlier_run_left_is_gone() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let earlier = scene.path("emulator/flight/emulator-0000000001-overrun");
    let of_another = scene.path("emulator/flight/controller-0000000001-overrun");
    for folder in [&earlier, &of_another] {
        std::fs::create_dir_all(folder).expect("made");
    }
    std::fs::write(scene.path("emulator/emulator-timing.csv"), "of an earlier run").expect("written");
    let (emulator, controller) = under_way(&scene, "--seconds 3 --no-flight --flight-late-us 1");
    emulator.signal(Signal::USR1);
    emulator.wait().expect_code(0);
    controller.wait();
    assert!(!earlier.exists() && !scene.path("emulator/emulator-timing.csv").exists());
    assert!(of_another.exists(), "a controller may have started before the rig");
    assert_eq!(count(&scene.summary(), "/flight/dumps"), 0);
}

#[test]
fn a_rig_that_is_killed_leaves_its_histograms_but_for_the_last_second() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = under_way(&scene, "--seconds 60");
    scene.wait_for_rows("emulator", 4000);
    emulator.kill();
    drop(controller);
    let path = scene.path("emulator/emulator.hlog");
    assert!(std::fs::read(&path).expect("the log").ends_with(b"\n"));
    for tag in ["emulator-wakeup", "emulator-step", "drive-round-trip", "drive-command-age"] {
        let samples = sum(&path, tag).len();
        // The rows of 4 s were written: 3 s of them at least are in the log, less what came before the controller.
        let least = if tag.starts_with("drive") { 1000 } else { 2900 };
        assert!(samples >= least, "{tag}: {samples}");
    }
}
