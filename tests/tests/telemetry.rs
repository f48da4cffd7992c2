//! The telemetry: viewers receive what stands in the run's files, and nothing that they do reaches the run.

use runlog::telemetry::Packet;
use serde_json::{Value, json as value};
use std::os::unix::fs::PermissionsExt;
use system_tests::events::{all, times};
use system_tests::onlooker::{ReceivedTelemetry, Viewer};
use system_tests::{Launch, Pace, RESTLESS, SHORT, Scene, Table, both_good, expect_same, json, turn};

fn with_telemetry(scene: &Scene, pace: Pace) -> Launch {
    scene.emulator(pace).with(&format!("--telemetry {}", scene.path("telemetry").display()))
}

fn viewer(scene: &Scene) -> Viewer {
    Viewer::connect(&scene.path("telemetry"))
}

/// Compares what a viewer received with the tables, cell by cell and to the bit.
fn expect_rows_of_the_files(scene: &Scene, reported: &ReceivedTelemetry) {
    let tables =
        ["measurement", "truth"].map(|name| Table::read(&scene.path(&format!("emulator/{name}.csv"))));
    let columns: Vec<Vec<f64>> = reported.description["columns"]
        .as_array()
        .expect("columns")
        .iter()
        .map(|column| {
            let table = if column["table"] == "measurement" { &tables[0] } else { &tables[1] };
            table.column(column["name"].as_str().expect("a name"))
        })
        .collect();
    for (cycle, values) in &reported.cycles {
        assert_eq!(values.len(), columns.len(), "cycle {cycle}");
        for (place, (value, column)) in values.iter().zip(&columns).enumerate() {
            let written = column[*cycle as usize];
            assert!(
                value.to_bits() == written.to_bits() || *value == written,
                "cycle {cycle}, column {place}"
            );
        }
    }
}

#[test]
fn a_viewer_receives_what_the_files_hold() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let emulator = with_telemetry(&scene, Pace::Real).with("--seconds 3.5 --seed 7").start();
    let viewer = viewer(&scene);
    let socket = std::fs::metadata(scene.path("telemetry")).expect("a socket");
    assert_eq!(socket.permissions().mode() & 0o777, 0o600, "for this user alone");
    let reading = std::thread::spawn(|| viewer.to_the_end());
    both_good(emulator, scene.controller(Pace::Real).with("--repeat").start());
    let reported = reading.join().expect("the viewer does not panic");

    assert_eq!(reported.description["experiment"], value!({ "name": "experiment", "title": "restless" }));
    assert_eq!(
        (&reported.description["seed"], &reported.description["console"]),
        (&value!(7), &value!(false))
    );
    assert_eq!(reported.description["rig"]["stroke_m"], 0.5);
    assert!(reported.description["faults"].as_array().is_some_and(|faults| faults.len() > 10));
    let out = scene.path("emulator");
    assert_eq!(reported.description["out"], out.to_str().expect("a plain path"));
    expect_rows_of_the_files(&scene, &reported);
    assert!(reported.cycles.len() > 3000, "{} cycles", reported.cycles.len());
    assert_eq!(reported.lost, 0);
    let consecutive = reported.cycles.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1);
    assert!(consecutive, "cycles are sent in order and without a hole");

    let summary = json(&out.join("summary.json"));
    let without_text =
        reported.events.iter().map(|event| value!({ "cycle": event["cycle"], "kind": event["kind"] }));
    let events = summary["events"].as_array().expect("events");
    // Those of the last milliseconds may still be on their way when the emulator ends.
    assert!(events.starts_with(&without_text.collect::<Vec<_>>()), "{:?}\n{events:?}", reported.events);
    let log = std::fs::read_to_string(out.join("emulator.hlog")).expect("a log");
    assert!(reported.histograms.len() > 10, "{} histograms", reported.histograms.len());
    for line in &reported.histograms {
        assert!(log.lines().any(|written| written == line), "{line}");
    }
}

#[test]
fn lockstep_leaves_the_same_bytes_whoever_looks_on() {
    let run = |telemetry: bool| {
        let scene = Scene::new(SHORT);
        let emulator =
            if telemetry { with_telemetry(&scene, Pace::Lockstep) } else { scene.emulator(Pace::Lockstep) };
        let emulator = emulator.start();
        // One that reads, and one that stands still.
        let viewers = telemetry.then(|| (viewer(&scene), viewer(&scene)));
        let controller = scene.controller(Pace::Lockstep).start();
        let reported = viewers.map(|(reads, still)| (reads.to_the_end(), still));
        both_good(emulator, controller);
        (scene, reported.map(|(reported, _)| reported))
    };
    let (alone, watched) = (run(false), run(true));
    let [one, other] = [&alone, &watched].map(|(scene, _)| scene.path("emulator"));
    expect_same(&one, &other, &["measurement.csv", "truth.csv", "bus.log"], "differs");
    let reported = watched.1.expect("a viewer");
    expect_rows_of_the_files(&watched.0, &reported);
    assert!(reported.histograms.is_empty(), "simulated time is never late");
}

#[test]
fn a_viewer_that_stands_still_or_dies_costs_the_run_nothing() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let emulator = with_telemetry(&scene, Pace::Real).with("--seconds 60").start();
    let mut still = viewer(&scene);
    let mut dies = viewer(&scene);
    let controller = scene.controller(Pace::Real).with("--repeat").start();
    assert!(matches!(dies.packet(), Some(Packet::Description(_))));
    drop(dies);
    // More cycles than the buffer and the socket of a viewer hold.
    scene.wait_for_rows("emulator", 13_000);
    // It wakes up: what did not fit is lost by whole records, and reported.
    let (mut cycles, mut lost) = (Vec::new(), None);
    while lost.is_none() {
        match still.packet() {
            Some(Packet::Cycle(cycle, _)) => cycles.push(cycle),
            Some(Packet::Loss(records)) => lost = Some(records),
            Some(_) => {}
            None => break,
        }
    }
    emulator.interrupt();
    controller.wait();
    assert!(lost.is_some_and(|lost| lost > 1000), "{lost:?} lost");
    assert!(cycles.windows(2).all(|pair| pair[1] == pair[0] + 1), "until it was full nothing was lost");
    assert!(cycles.len() > 2000, "more than a second of 1 kHz fits: {}", cycles.len());
    let summary = scene.summary();
    assert_eq!(summary["records_dropped"], 0);
    assert_eq!(summary["cycles"], scene.measurement().len(), "the files have every cycle");
}

#[test]
fn commands_are_obeyed_with_a_console_and_refused_without() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let emulator = with_telemetry(&scene, Pace::Real).with("--seconds 60").start();
    let mut one = viewer(&scene);
    let refused = one.request("stop");
    assert_eq!(refused["ok"], false);
    assert!(refused["text"].as_str().is_some_and(|text| text.contains("--console")), "{refused}");
    drop(one);
    emulator.interrupt();
    // A late wake-up may stand there; nothing that was asked for does.
    let events = all(&scene.summary());
    assert_eq!(times(&events, "emergency-stop"), 0, "{events:?}");

    let emulator = with_telemetry(&scene, Pace::Real).with("--seconds 60 --console").start();
    let mut one = viewer(&scene);
    assert_eq!(one.request("weights 3"), value!({ "ok": true, "text": "" }));
    assert!(one.request("help")["text"].as_str().is_some_and(|help| help.contains("unlink")));
    let refused = one.request("weights 300");
    assert!(
        refused["ok"] == false && refused["text"] == "weights '300': allowed are 0 to 20 kg",
        "{refused}"
    );
    let is_weights = |event: &Value| event["kind"]["weights"]["added_mass_kg"] == 3.0;
    // A viewer that connects later receives it too.
    let mut later = viewer(&scene);
    let received = std::iter::from_fn(|| later.packet()).find_map(|packet| match packet {
        Packet::Event(text) => serde_json::from_str::<Value>(&text).ok().filter(is_weights),
        _ => None,
    });
    assert_eq!(received.expect("the event")["text"], "weights on the carriage: 3 kg");
    assert_eq!(one.request("quit")["ok"], true);
    emulator.wait().expect_code(0);
    assert!(!scene.path("telemetry").exists(), "the socket went with the run");
}

#[test]
fn a_sealed_run_tells_viewers_nothing_that_only_a_simulation_knows() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let sealed = scene.write("sealed.toml", "[effects.piston-leakage.drive]\nleakage_nl_per_min = 4.0\n");
    let options = format!("--seconds 1 --sealed {}", sealed.display());
    let emulator = with_telemetry(&scene, Pace::Real).with(&options).start();
    let reported = viewer(&scene).to_the_end();
    emulator.wait().expect_code(0);
    let columns = reported.description["columns"].as_array().expect("columns");
    assert_eq!(columns.len(), 10);
    assert!(columns.iter().all(|column| column["table"] == "measurement"));
    assert!(
        !reported.description.to_string().contains("leakage_nl_per_min\":4"),
        "no word of what is sealed"
    );
    expect_rows_of_the_files(&scene, &reported);
}

#[test]
fn a_socket_that_cannot_be_had_is_refused_before_the_run() {
    let scene = Scene::new(SHORT);
    let path = scene.write("telemetry", "a file of somebody's own");
    with_telemetry(&scene, Pace::Real)
        .start()
        .wait()
        .expect_code(2)
        .expect_stderr(&["cannot open telemetry", "choose another path with --telemetry"]);
    assert_eq!(std::fs::read_to_string(path).expect("it is left as it was"), "a file of somebody's own");
}
