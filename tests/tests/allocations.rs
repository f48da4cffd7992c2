//! The 1 ms path of both shipped programs allocates nothing: ten seconds and more on a real bus after the first of warm-up, of a
//! drive alone with declared terms in its rig, and of linked axes with force control and every chain at work.
//!
//! The programs are built once more, with the allocator that counts inside the 1 ms path; nothing else differs. That this
//! counter does count is proven where it lives: `realtime/tests/allocations.rs`,
//! `a_push_is_counted_inside_the_scope_and_not_outside`.

use protocol::can::CanFrame;
use rustix::process::Signal;
use system_tests::onlooker::Viewer;
use system_tests::xcp::{self, XcpClient};
use system_tests::{Build, LINKED, Pace, Peer, RESTLESS, Scene, both_good, count, run_both, turn};

/// Faults that begin and end after the warm-up, mild enough for the run to go on as it does.
const FAULTS: &str = include_str!("../scenes/faults/allocations.toml");

/// A declared term of each kind, too small to disturb.
const TERMS: &str = include_str!("../scenes/terms/three-with-memory.toml");

#[test]
fn ten_seconds_of_both_programs_on_a_real_bus_allocate_nothing() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let faults = scene.write("faults.toml", FAULTS);
    let shipped = std::fs::read_to_string(scene.path("rig.toml")).expect("the scene has one");
    let rig = scene.write("declared.toml", &(shipped + TERMS));
    let emulator = scene
        .emulator(Pace::Real)
        .rig(&rig)
        .build(Build::CountingAllocations)
        .with(&format!("--full-timing --faults {}", faults.display()))
        .with(&format!("--telemetry {}", scene.path("telemetry").display()))
        .start();
    // One that looks on and one that stands still: both are served outside of the 1 ms path.
    let viewer = Viewer::connect(&scene.path("telemetry"));
    let _still = Viewer::connect(&scene.path("telemetry"));
    let reading = std::thread::spawn(move || viewer.to_the_end());
    let stranger = scene.peer();
    let options = format!("--repeat --full-timing --xcp {}", xcp::config(&scene).display());
    let controller = scene.controller(Pace::Real).build(Build::CountingAllocations).with(&options).start();
    // Frames to be refused come along: the paths that refuse are part of the 1 ms path too. So is XCP, in all that it does.
    for row in (1000..11_000).step_by(500) {
        scene.wait_for_rows("emulator", row);
        tune(&scene.peer(), row);
        for bad in [&[1, 2, 3, 4, 5][..], &[0; 3]] {
            stranger.send(&CanFrame::new(0x110, bad).to_bytes());
        }
    }
    // The run ends when all of it was done, however long this process was kept from it: with an end by the rig's time, a
    // machine that was busy sent the last bad frames to a rig that had gone.
    scene.wait_for_rows("emulator", 11_000);
    scene.wait_for_more_rows("emulator", 100);
    emulator.signal(Signal::TERM);
    emulator.wait().expect_code(130);
    controller.wait().expect_code(0);
    let seen = reading.join().expect("the viewer does not panic");
    assert_eq!(scene.run_description()["counts_allocations"], true);
    let summary = scene.summary();
    let controller = scene.report();
    assert!(count(&summary, "/cycles") > 11_000);
    assert!(
        seen.cycles.len() as u64 + seen.lost > 10_000,
        "{} cycles seen, {} lost",
        seen.cycles.len(),
        seen.lost
    );
    assert!(!seen.cycles.is_empty(), "the viewer was served");
    assert_eq!(count(&summary, "/frames_malformed"), 40, "each bad frame, and nothing else");
    // What the machine let the rig skip, no controller can answer.
    let skipped = count(&summary, "/skipped");
    assert!(count(&controller, "/cycles_answered") + skipped > 10_000, "the controller took part throughout");
    assert_eq!(system_tests::events::times(&system_tests::events::all(&summary), "fault"), 10);
    assert_eq!(count(&summary, "/allocations_in_cycle"), 0);
    assert_eq!(count(&controller, "/allocations_in_cycle"), 0);
    let xcp = &controller["axes"]["drive"]["xcp"];
    assert!(
        count(xcp, "/changed") >= 18 && count(xcp, "/daq_packets") + skipped > 5000,
        "XCP was at work: {xcp}"
    );
    assert!(scene.path("controller/controller-drive-parameters.toml").exists(), "and stored a set");
}

/// A client comes for a moment: the first time it unlocks and starts to measure, then it changes a gain, with and without
/// success, triggers, reads, stores and loads.
fn tune(peer: &Peer, row: usize) {
    let client = XcpClient(peer);
    if row == 1000 {
        client.unlock();
        for packet in [
            &[0xD6][..],
            &[0xD5, 0, 1, 0],
            &[0xD4, 0, 0, 0, 1],
            &[0xD3, 0, 0, 0, 0, 1],
            &[0xE2, 0, 0, 0, 0, 0],
            &[0xE1, 0xFF, 4, 0, 4, 0, 0, 0x30],
            &[0xDE, 1, 0, 0],
        ] {
            let _ = client.request_ok(packet);
        }
        return;
    }
    // The gain is the seventh number of the scene's program; arming and loading are the last two controls.
    let (gain, arm) = (0x1000_0000 + 8 * 6, 0x2000_0000 + 8 * 10);
    client.write(gain, 30.0 + row as f64 * 1e-3);
    client.set_address(gain);
    let _ = client.request_ok(&[0xF0, 6, 0, 0, 0, 0, 0, 0]);
    assert_eq!(client.request(&[0xF0, 2, 0, 0x7F])[..2], [0xFE, 0x22], "too large a gain is refused");
    client.set_address(arm);
    let _ = client.request_ok(&[0xF0, 4, 1, 0, 0, 0]);
    client.set_address(0x5100_0000);
    let _ = client.request_ok(&[0xF5, 7]);
    let _ = client.request_ok(&[0xF3, 0, 0, 0, 0, 16, 0, 0]);
    if row == 2000 {
        let _ = client.request_ok(&[0xF9, 1, 0, 0]);
    }
    if row == 3000 {
        client.set_address(arm + 8);
        let _ = client.request_ok(&[0xF0, 4, 1, 0, 0, 0]);
    }
}

#[test]
fn a_linked_experiment_with_all_its_chains_allocates_nothing_over_and_over() {
    let _machine = turn::take();
    let scene = Scene::new(LINKED);
    run_both(
        &scene.emulator(Pace::Real).build(Build::CountingAllocations).with("--seconds 14 --full-timing"),
        &scene.controller(Pace::Real).build(Build::CountingAllocations).with("--repeat"),
    );
    // Past the warm-up of 1 s both axes have been through every state of the way, and into the next repetition.
    let load = scene.axis_table("load");
    let late = load.cycles().iter().position(|cycle| *cycle >= 1500).expect("rows after the warm-up");
    for (column, state) in [
        ("main_chain", "preparing"),
        ("main_chain", "initial-force"),
        ("main_chain", "experiment"),
        ("main_chain", "final-settling"),
        ("matching_chain", "averaging"),
        ("force_chain", "load-profile"),
        ("force_chain", "standstill"),
    ] {
        assert!(load.texts(column)[late..].contains(&state), "{state} after the warm-up");
    }
    assert_eq!(count(&scene.summary(), "/allocations_in_cycle"), 0);
    assert_eq!(count(&scene.report(), "/allocations_in_cycle"), 0);
}

#[test]
fn programs_that_do_not_count_say_so() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.start(Pace::Real, "--seconds 1.2", "--repeat");
    both_good(emulator, controller);
    assert_eq!(scene.run_description()["counts_allocations"], false);
    assert!(scene.summary()["allocations_in_cycle"].is_null());
    assert!(scene.report()["allocations_in_cycle"].is_null());
}
