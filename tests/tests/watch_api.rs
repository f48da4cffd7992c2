//! `bench watch` as programs see it: what it shows of a run, whom it obeys, and that nobody who looks on costs the run anything.

use rustix::process::Signal;
use serde_json::{Value, json as value};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use system_tests::foreign_python::python;
use system_tests::onlooker::LivePage;
use system_tests::{
    Build, LINKED, Pace, Program, RESTLESS, Running, Scene, Table, count, executable, json, shipped_programs,
    turn, wait_until, workspace,
};

/// Emulator and controller of a scene, watched with controls.
struct WatchedRun {
    scene: Scene,
    emulator: Running,
    controller: Running,
    page: LivePage,
}

fn emulator(scene: &Scene) -> Running {
    let telemetry = scene.path("telemetry");
    let options = format!("--seconds 60 --console --telemetry {}", telemetry.display());
    scene.emulator(Pace::Real).with(&options).start()
}

impl WatchedRun {
    /// Under way: rows of the charts come.
    fn start(experiment: &str, options: &str) -> Self {
        let scene = Scene::new(experiment);
        // The page first: it waits for bus and telemetry.
        let page = LivePage::open(&scene, options);
        let emulator = emulator(&scene);
        let controller = scene.controller(Pace::Real).with("--repeat").start();
        page.events().wait_for("state", |state| {
            state["cycle"].as_u64() > Some(1000) && state["chains"]["drive"]["main"] == "experiment"
        });
        Self { scene, emulator, controller, page }
    }

    fn end(self) -> Scene {
        let Self { scene, emulator, controller, page } = self;
        page.close();
        emulator.interrupt();
        controller.wait();
        scene
    }
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_array().expect("a list").iter().map(|value| value.as_f64().expect("a number")).collect()
}

#[test]
fn a_run_is_served_as_description_state_history_events_and_metrics() {
    let _machine = turn::take();
    let watched = WatchedRun::start(RESTLESS, "");
    let page = &watched.page;
    assert_eq!(page.token, "", "there is nothing to be allowed to do");

    let description = page.get("/api/description").json();
    assert_eq!(description["experiment"]["title"], "restless");
    assert_eq!(
        (&description["control"], &description["telemetry"]["connected"]),
        (&value!(false), &value!(true))
    );
    assert_eq!(description["run_folder"], watched.scene.path("emulator").to_str().expect("a plain path"));
    let fault =
        description["faults"].as_array().and_then(|faults| faults.iter().find(|f| f["name"] == "hose-burst"));
    assert!(fault.is_some_and(|fault| fault["parameters"][0]["name"] == "kv_m3_per_h"), "{fault:?}");
    let chains = description["chains"].as_array().expect("chains");
    assert_eq!(
        chains.iter().map(|chain| &chain["name"]).collect::<Vec<_>>(),
        ["main", "force", "matching", "emergency_stop"]
    );

    let mut events = page.events();
    assert_eq!(events.wait_for("status", |_| true), value!({ "bus": "connected", "telemetry": "connected" }));
    let rows = events.wait_for("rows", |_| true);
    let names: Vec<_> =
        description["columns"].as_array().expect("columns").iter().map(|c| c["name"].as_str()).collect();
    assert!(names.iter().flatten().all(|name| rows["columns"][name].is_array()), "{names:?}");
    let histograms = events.wait_for("histograms", |reported| reported["wake_up"]["whole"][0].is_array());
    assert!(histograms["round_trip"]["last_10_s"][0][1].as_u64() > Some(0), "{histograms}");

    wait_until("a second of history", || {
        page.get("/api/history?seconds=1").json()["t_s"].as_array().map(Vec::len) == Some(100)
    });
    let history = page.get("/api/history?seconds=1").json();
    let (time_s, position_m) = (numbers(&history["t_s"]), numbers(&history["columns"]["drive_position_m"]));
    assert_eq!((time_s.len(), position_m.len()), (100, 100));
    assert!(position_m.iter().all(|m| (0.15..0.35).contains(m)), "{position_m:?}");
    // Where a stall of the machine left nothing of a controller on both sides of a row, there is a gap.
    let of = |name: &str| history["columns"][name].as_array().expect("a list").iter().map(Value::as_f64);
    let rows = of("drive_set_point_m").zip(of("drive_control_error_m")).zip(&position_m);
    let mut compared = 0;
    for ((set_point_m, error_m), m) in rows {
        let (Some(set_point_m), Some(error_m)) = (set_point_m, error_m) else { continue };
        // All three are of one cycle, but for what a straight line over twenty cycles makes of 4 m/s^2, and 20 um of noise.
        assert!((set_point_m - m - error_m).abs() < 5e-4, "{set_point_m} - {m} is not {error_m}");
        compared += 1;
    }
    assert!(compared >= 50, "{compared} of 100 rows have what the controller said");

    // Histograms come by whole seconds, and begin when the page was there.
    let wake_ups = |state: &Value| state["timing"]["wake_up"]["count"].as_u64();
    wait_until("more than a second of wake-ups", || wake_ups(&page.state()) > Some(1000));
    let state = page.state();
    assert_eq!((&state["linked"], &state["weights_kg"]), (&value!(false), &value!(0.0)));
    assert_eq!(state["emergency_stop"], value!({ "active": false, "senders": [] }));
    assert!(state["bus"]["load_percent"].as_f64() > Some(20.0), "{}", state["bus"]);
    assert_eq!(state["bus"]["lost"], 0);
    assert_eq!(state["timing"]["overruns_by_second"].as_array().map(Vec::len), Some(60));
    assert!(["yes", "doubtful", "no"].iter().any(|word| state["claim"]["supported"] == *word));

    let metrics = page.get("/metrics");
    assert!(metrics.head.contains("Content-Type: text/plain; version=0.0.4"), "{}", metrics.head);
    let families = parse_with_prometheus_client(&metrics.body);
    for name in
        ["airbench_cycles", "airbench_drive_position_m", "airbench_frames", "airbench_wake_up_seconds"]
    {
        assert!(families.iter().any(|family| family == name), "{name}: {families:?}");
    }
    expect_dashboard_of(page);
    watched.end();
}

/// Holds Grafana's dashboard against the metrics of a run under way.
fn expect_dashboard_of(page: &LivePage) {
    // These have no line before enough was measured or heard.
    let late = ["wake_up_seconds{quantile=\"0.999\"}", "round_trip_seconds{quantile=\"0.999\"}"];
    let late = late.iter().chain(&["load_force_set_point_n ", "drive_control_error_m "]);
    let is_there = |text: &str| late.clone().all(|name| text.contains(&format!("\nairbench_{name}")));
    let mut metrics = String::new();
    wait_until("all metrics", || {
        metrics = page.get("/metrics").body;
        is_there(&metrics)
    });
    let judge = |metrics: &str| -> Value {
        let script = workspace().join("tests/python/dashboard_metrics.py");
        let dashboard = workspace().join("docs/examples/grafana/airbench.json");
        let printed = python_reads(&[script.as_os_str(), dashboard.as_os_str()], metrics);
        serde_json::from_str(&printed).expect("JSON")
    };
    let judged = judge(&metrics);
    assert!(judged["expressions"].as_u64() > Some(30), "{judged}");
    assert_eq!((&judged["unknown"], &judged["units"]), (&value!([]), &value!([])));

    // A name or a label that is not served is found.
    let without = metrics
        .replace("airbench_overruns_total ", "airbench_overran_total ")
        .replace("=\"0.999\"", "=\"0.998\"");
    let missed = judge(&without)["unknown"].to_string();
    let expected = ["airbench_overruns_total", "airbench_wake_up_seconds{quantile=0.999}"];
    assert!(expected.iter().all(|name| missed.contains(name)), "{missed}");
}

/// Names of the metric families, as the parser of Prometheus' own Python client reads them.
fn parse_with_prometheus_client(text: &str) -> Vec<String> {
    let script = "import sys; from prometheus_client.parser import text_string_to_metric_families as families\n\
                  print('\\n'.join(family.name for family in families(sys.stdin.read())))";
    python_reads(&["-c".as_ref(), script.as_ref()], text).lines().map(str::to_owned).collect()
}

/// What python prints, given a text on its standard input.
fn python_reads(arguments: &[&OsStr], text: &str) -> String {
    let mut child = Command::new(python())
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("python starts");
    child.stdin.take().expect("a pipe").write_all(text.as_bytes()).expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "python refuses it:\n{text}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn only_who_may_gives_orders() {
    let scene = Scene::new(RESTLESS);
    let _bus = scene.bus_host("");
    let looks_on = LivePage::open(&scene, "");
    let stop = value!({ "command": "emergency-stop" });
    assert_eq!(looks_on.order(&stop).status, 403, "without --control");
    looks_on.close();

    let page = LivePage::open(&scene, "--control");
    assert_eq!(page.token.len(), 32);
    let token = format!("X-Airbench-Token: {}\r\n", page.token);
    for (what, fields, status) in [
        ("no token", String::new(), 401),
        ("a wrong token", token.replace(": ", ": 0"), 401),
        ("half a token", format!("X-Airbench-Token: {}\r\n", &page.token[..16]), 401),
        ("another page", format!("{token}Origin: http://evil.example\r\n"), 403),
        ("a page without a name", format!("{token}Origin: null\r\n"), 403),
        ("a page at another port", format!("{token}Origin: http://{}:1\r\n", page.address.ip()), 403),
        ("its own page", format!("{token}Origin: http://{}\r\n", page.address), 200),
        ("a program", token.clone(), 200),
    ] {
        let answer = page.order_with(&fields, &stop);
        assert_eq!((answer.status, answer.json()["ok"] == true), (status, status == 200), "{what}");
    }
    let get = |host: &str| page.send(&format!("GET /api/state HTTP/1.1\r\nHost: {host}\r\n\r\n")).status;
    assert_eq!(get(&format!("localhost:{}", page.address.port())), 200);
    // A foreign name that leads here is how foreign pages would come in.
    assert_eq!(get(&format!("evil.example:{}", page.address.port())), 403);
    assert_eq!(get("127.0.0.1"), 403);

    for (request, status) in [
        ("GET /nothing HTTP/1.1\r\nHost: HERE\r\n\r\n", 404),
        ("GET /assets/../../etc/passwd HTTP/1.1\r\nHost: HERE\r\n\r\n", 404),
        ("POST / HTTP/1.1\r\nHost: HERE\r\n\r\n", 405),
        ("GET /api/control HTTP/1.1\r\nHost: HERE\r\n\r\n", 405),
        ("GET /api/history?seconds=61 HTTP/1.1\r\nHost: HERE\r\n\r\n", 400),
        ("POST /api/control HTTP/1.1\r\nHost: HERE\r\nContent-Length: 99999999\r\n\r\n", 413),
        ("nonsense\r\n\r\n", 400),
    ] {
        let answer = page.send(&request.replace("HERE", &page.address.to_string()));
        assert_eq!(answer.status, status, "{request}");
        assert!(answer.head.contains("X-Content-Type-Options: nosniff"), "{}", answer.head);
    }
    let index = page.get("/");
    assert!(index.head.contains("Content-Security-Policy: default-src 'self'"), "{}", index.head);
    assert!(index.head.contains("Content-Type: text/html"), "{}", index.head);
    let no_emulator = page.order(&value!({ "command": "link" }));
    assert_eq!((no_emulator.status, no_emulator.json()["ok"] == true), (503, false));
    page.close();
}

#[test]
fn orders_reach_rig_controllers_and_folder() {
    let _machine = turn::take();
    let watched = WatchedRun::start(LINKED, "--control");
    let page = &watched.page;
    let order = |order: Value| page.order(&order);
    let mut events = page.events();

    assert_eq!(order(value!({ "command": "weights", "kg": 2.5 })).json()["ok"], true);
    let weighted = events.wait_for("state", |state| state["weights_kg"] == 2.5);
    let refused = order(value!({ "command": "weights", "kg": 250 }));
    assert_eq!(refused.status, 400);
    assert_eq!(refused.json()["message"], "weights '250': allowed are 0 to 20 kg");

    let noise = value!({ "command": "fault", "name": "position-sensor-noise", "place": "load", "values": { "noise_m": 0.002 } });
    assert_eq!(order(noise).json()["ok"], true);
    let state = events.wait_for("state", |state| state["faults_active"][0].is_object());
    assert_eq!(state["faults_active"][0]["name"], "position-sensor-noise");
    assert_eq!(state["faults_active"][0]["values"]["noise_m"], 0.002);
    assert_eq!(order(value!({ "command": "mend", "all": true })).json()["ok"], true);
    events.wait_for("state", |state| state["faults_active"] == value!([]));

    let go = |position_m: f64| {
        order(value!({ "command": "set-point", "axis": "drive", "position_m": position_m }))
    };
    assert_eq!((go(0.3).status, go(0.6).status), (200, 400));
    let nowhere = order(value!({ "command": "set-point", "axis": "drive" }));
    assert_eq!(nowhere.status, 400, "a position that is not given is not 0 m: {}", nowhere.body);

    // Of linked axes: an axis that lies at its end is no record of anything.
    // More than the second that a record needs at least: its ends lie within a frame, not on one.
    let enough_s = weighted["t_s"].as_f64().map(|t_s| t_s + 1.5);
    events.wait_for("state", |state| state["t_s"].as_f64() > enough_s);
    let saved = order(value!({ "command": "save", "seconds": 60 })).json();
    let message = saved["message"].as_str().expect("a message").to_owned();
    let (folder, of) =
        message.strip_prefix("saved in ").and_then(|said| said.split_once(" (")).expect(&message);
    assert!(of.ends_with("s, since linkage or weights changed before)"), "{message}");
    let record_s = Table::read(&Path::new(folder).join("measurement.csv")).column("time_s");
    for file in ["measurement.csv", "bus.log"] {
        let (rig, record) = (watched.scene.path("rig.toml"), format!("{folder}/{file}"));
        let checked = Program::Discrepancy.start(&[&"check", &"--rig", &rig, &"--train", &record]).wait();
        assert_eq!(checked.code, Some(0), "{file}: {}{}", checked.stdout, checked.stderr);
    }

    assert_eq!(order(value!({ "command": "emergency-stop" })).json()["ok"], true);
    let stopped = events.wait_for("state", |state| {
        state["emergency_stop"]["active"] == true && state["emergency_stop"]["senders"][0] == "console"
    });
    assert_ne!(stopped["chains"]["drive"]["emergency_stop"], Value::Null);
    events.wait_for("state", |state| state["chains"]["drive"]["emergency_stop"] == "waiting-for-release");
    assert_eq!(order(value!({ "command": "release" })).json()["ok"], true);
    events.wait_for("state", |state| state["emergency_stop"] == value!({ "active": false, "senders": [] }));

    let scene = watched.end();
    let summary = scene.summary();
    let mut events = summary["events"].as_array().expect("events").iter();
    let weights = events.find(|event| event["kind"]["weights"].is_object()).expect("they were put on");
    let cycle = (record_s[0] * 1000.0).round() as u64;
    assert_eq!(Some(cycle), weights["cycle"].as_u64().map(|cycle| cycle + 1), "the record has one set-up");
    let kinds = summary["events"].to_string();
    assert!(kinds.contains("\"emergency-stop\"") && kinds.contains("emergency-stop-released"), "{kinds}");
    // Called out again every 100 ms until it was released, once.
    let frames: Vec<String> = scene.bus_log().iter().map(ToString::to_string).collect();
    assert_eq!(
        frames.iter().filter(|frame| frame.starts_with("184#")).collect::<Vec<_>>(),
        ["184#0099990000"]
    );
    let calls: Vec<_> = frames.into_iter().filter(|frame| frame.starts_with("108#")).collect();
    assert!(calls.len() > 2 && calls[..calls.len() - 1].iter().all(|call| call == "108#0100"), "{calls:?}");
    assert_eq!(calls[calls.len() - 1], "108#0001");
}

#[test]
fn viewers_that_hang_or_talk_nonsense_cost_nobody_anything() {
    let _machine = turn::take();
    let watched = WatchedRun::start(RESTLESS, "--clients 20");
    // One that asks for everything and reads nothing, one that never finishes its request, one that only connects.
    let host = watched.page.address;
    let mut hangs = watched.page.connect();
    write!(hangs, "GET /api/events HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("it listens");
    let mut unfinished = watched.page.connect();
    write!(unfinished, "GET /api/sta").expect("it listens");
    let silent = watched.page.connect();
    let mut events = watched.page.events();
    // It misses events, counted, once the socket and its queue are full; the other gets all of them.
    let state = events.wait_for("state", |state| state["dropped"].as_u64() > Some(3));
    assert_eq!(state["viewers"], 2);
    // There is room for twenty; the rest is reported so.
    let crowd: Vec<_> = (0..20).map(|_| watched.page.connect()).collect();
    let mut refused = String::new();
    let mut last = crowd.last().expect("a crowd");
    last.read_to_string(&mut refused).expect("an answer");
    assert!(refused.starts_with("HTTP/1.1 503"), "{refused}");
    drop((crowd, silent, unfinished, hangs));
    // Asked by the one that stayed: a new one might still find no room.
    events.wait_for("state", |state| state["viewers"] == 1);
    assert!(!watched.page.running.stderr().contains("panicked"));
    assert_eq!(count(&watched.end().summary(), "/records_dropped"), 0);
}

#[test]
fn the_page_comes_back_with_the_emulator_and_the_run_goes_on_without_the_page() {
    let _machine = turn::take();
    let mut watched = WatchedRun::start(RESTLESS, "--control");
    let mut events = watched.page.events();
    watched.emulator.signal(Signal::INT);
    events.wait_for("status", |status| status["telemetry"] == "gone");
    watched.scene.write("experiment.toml", &RESTLESS.replace("restless", "restless again"));
    let before = std::mem::replace(&mut watched.emulator, emulator(&watched.scene));
    // It had its folder first; both write the same one, and the first has ended by now.
    before.wait().expect_code(130);
    events.wait_for("status", |status| status["telemetry"] == "connected");
    let description = watched.page.get("/api/description").json();
    assert_eq!(
        description["experiment"]["title"], "restless again",
        "it is there when connected is reported"
    );
    let rows = events.wait_for("rows", |_| true);
    assert!(rows["t_s"][0].as_f64() < Some(5.0), "time begins anew: {rows}");

    let WatchedRun { scene, emulator, controller, page } = watched;
    page.running.signal(Signal::KILL);
    scene.wait_for_more_rows("emulator", 500);
    emulator.interrupt();
    controller.wait();
    assert_eq!(count(&scene.summary(), "/records_dropped"), 0);
}

#[test]
fn without_telemetry_the_page_shows_what_is_on_the_bus() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let page = LivePage::open(&scene, "");
    let (emulator, controller) = scene.start(Pace::Real, "--seconds 60", "--repeat");
    let rows = page.events().wait_for("rows", |rows| rows["columns"]["drive_set_point_m"][0].is_number());
    assert!(rows["columns"]["drive_position_m"][0].is_number(), "{rows}");
    assert!(rows["columns"]["drive_true_position_m"][0].is_null(), "{rows}");
    page.close();
    emulator.interrupt();
    controller.wait();
}

#[test]
fn a_run_with_its_page_is_one_command() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    // A script cannot trap what was ignored when it began, as Ctrl-C is below a shell's background.
    let mut command = Command::new("env");
    command.arg("--default-signal=INT").arg(workspace().join("scripts/run"));
    // Built already: the test is of the script, and a build would want the machine for itself.
    command.env("AIRBENCH_BIN_DIR", shipped_programs());
    command.args(["--watch", "--http", "127.0.0.1:0", "--seconds", "60", "--bus", &scene.url()]);
    command.arg("--out").arg(scene.path("run")).arg(scene.path("experiment.toml"));
    let page = LivePage::announced_by(Running::start("scripts/run --watch", &mut command));
    assert_eq!(page.token.len(), 32, "its page has controls");
    page.events().wait_for("state", |state| state["chains"]["drive"]["main"] == "experiment");
    let description = page.get("/api/description").json();
    assert_eq!((&description["control"], &description["console"]), (&value!(true), &value!(true)));
    let address = page.address;
    page.close();
    assert!(std::net::TcpStream::connect(address).is_err(), "the page ends with the run");
    assert_eq!(json(&scene.path("run/summary.json"))["records_dropped"], 0);
}

#[test]
fn the_program_with_the_page_inside_has_less_than_10_mb() {
    let bench = executable(Program::Bench, Build::Shipped);
    let bytes = std::fs::metadata(bench).expect("it is there").len();
    assert!(bytes < 10_000_000, "bench has {bytes} bytes: is it stripped of line tables?");
}
