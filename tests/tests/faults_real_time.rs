//! A handful of faults in real time: by the script that means the same in lockstep, and by hand while the run goes on.

use system_tests::broken::{Row, rows};
use system_tests::{Pace, RESTLESS, Scene, both_good, count, count_of_id, events, run_both, turn};

/// By time, so that real time and lockstep can be held against each other; one by a condition that is soon met.
const SCRIPT: &str = include_str!("../scenes/faults/real-time.toml");

fn run(pace: Pace) -> Scene {
    let scene = Scene::new(RESTLESS);
    let script = scene.write("faults.toml", SCRIPT);
    let options = format!("--seconds 1.8 --faults {}", script.display());
    run_both(&scene.emulator(pace).with(&options), &scene.controller(pace).with("--repeat"));
    scene
}

fn marks(scene: &Scene) -> Vec<Row> {
    rows(&scene.path("emulator/faults.csv"))
}

#[test]
fn the_same_script_breaks_the_same_in_real_time_and_in_lockstep() {
    let _machine = turn::take();
    let (real, lockstep) = (run(Pace::Real), run(Pace::Lockstep));
    let by_time = |scene: &Scene| {
        let mut rows = marks(scene);
        rows.retain(|row| row.fault != "friction-rise");
        rows
    };
    assert_eq!(by_time(&real), by_time(&lockstep), "cycle by cycle, missed ones too");
    assert_eq!(by_time(&real).len(), 10);
    for scene in [&real, &lockstep] {
        let summary = scene.summary();
        assert_eq!(events::times(&events::all(&summary), "fault"), 11);
        let measurement = scene.measurement();
        let stuck = &measurement.column("load_pressure_a_Pa")[700..1200];
        assert!(stuck.iter().all(|pressure| pressure == &stuck[0]), "the sensor shows one value");
        let truth = scene.truth();
        let spool = &truth.column("load_spool")[600..=1400];
        assert!(spool.iter().all(|sample| sample.to_bits() == spool[0].to_bits()), "the spool does not move");
        let faults = &summary["bus_host"]["faults"];
        // In real time the host takes orders when its turn comes; how many frames that concerns is the machine's affair.
        for (name, id) in [("bus-loss", "153"), ("bus-delay", "140"), ("babbling-node", "010")] {
            assert!(count_of_id(&faults[name], id) > 0, "{name}: {faults}");
        }
        let babble = count_of_id(&faults["babbling-node"], "010");
        let received = scene.bus_log();
        let received = received.iter().filter(|frame| frame.standard_id() == Some(16)).count() as u64;
        assert_eq!(received, babble, "what it says is heard");
        let drive = |row: &Row| row.fault == "friction-rise";
        assert!(marks(scene).iter().any(|row| drive(row) && row.what == "begins"), "the condition was met");
        assert!(scene.run_description()["faults_toml"].as_str() == Some(SCRIPT));
    }
}

#[test]
fn people_break_and_mend_things_while_the_run_goes_on() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (mut emulator, controller) = scene.start(Pace::Real, "--console --bus-grace 20", "--repeat");
    scene.wait_for_rows("emulator", 700);
    for (line, answer) in [
        ("fault valve-stuck load", "fault 1 begins: valve-stuck at load (console)"),
        ("fault supply-sag drop_pa=5e4", "fault 2 begins: supply-sag at supply, drop_pa=50000"),
        (
            "fault bus-loss bus.LoadChainValues",
            "fault 3 begins: bus-loss at bus.LoadChainValues, probability=1",
        ),
        ("fault valve-offset load offset=2", "offset = 2: allowed: -1 to 1"),
        ("fault nonsense", "fault 'nonsense' is unknown"),
        ("mend valve-stuck load", "fault 1 ends: valve-stuck at load (console)"),
    ] {
        emulator.type_line(line);
        emulator.wait_for(answer);
    }
    scene.wait_for_more_rows("emulator", 200);
    emulator.type_line("mend all");
    emulator.wait_for("fault 2 ends");
    emulator.wait_for("fault 3 ends");
    emulator.type_line("quit");
    both_good(emulator, controller);
    let what: Vec<_> = marks(&scene).into_iter().map(|row| (row.number, row.what, row.cause)).collect();
    let expected = [(1, "begins"), (2, "begins"), (3, "begins"), (1, "ends"), (2, "ends"), (3, "ends")];
    assert_eq!(what, expected.map(|(number, what)| (number, what.to_owned(), "console".to_owned())));
    let summary = scene.summary();
    assert!(count_of_id(&summary["bus_host"]["faults"]["bus-loss"], "153") > 0);
    assert!(count(&summary, "/event_count") >= 6);
    let supply = scene.truth().column("supply_pressure_Pa");
    assert!(supply.iter().any(|pressure| *pressure < 6.8e5), "the supply sags");
}
