//! On CAN cards, emulated ones, and on both kernels: the full experiment over two SJA1000 with the emulator on `can0` and the
//! controller on `can1`, every frame accounted for; a transmit queue that is full; each interface down and up again; error
//! frames; cyclictest beside our own figures; PREEMPT_RT and what it grants.
//!
//! One machine for each kernel does it all (`scripts/vm/job-*`). QEMU's cards take no wire time and go neither passive nor
//! bus-off; their receive FIFO of 64 bytes runs over in earnest where the guest is late, which it hardly is here (`--even`).
//! What is lost and accounted for goes with the interfaces that go down. Accounts are asserted, never times.

use protocol::frames::{self, Frame};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use system_tests::foreign_python::python;
use system_tests::guest::{Guest, InterfaceCounters, compare_candump, data_frames};
use system_tests::{Table, account, count, find, json, workspace};

const LOG_OF_CAN1: &str = "candump-can1.log";
/// What `job-cards` lets cangen send.
const FOREIGN: u16 = 0x5A5;
/// Error frames that `job-errors` sends.
const ERROR_FRAMES: u64 = 5;

/// How often a kernel's machine runs the experiment on each bus, each time after cyclictest.
struct Pairs {
    vcan0: usize,
    cards: usize,
}

fn run_all(kernel: &str, pairs: &Pairs) -> Guest {
    python(); // tells at once what is missing
    let job = format!(
        "PAIRS={} sh /airbench/job-latency vcan0 && PAIRS={} sh /airbench/job-latency cards && sh /airbench/job-cards && \
         sh /airbench/job-errors",
        pairs.vcan0, pairs.cards
    );
    let guest = Guest::run(&["--kernel", kernel, "--cards", "--", &job]);
    let out = guest.out();
    let runs = |bus: &str, count: usize| -> Vec<PathBuf> {
        (1..=count).map(|pair| out.join(format!("latency/{bus}/pair-{pair}"))).collect()
    };
    let (vcan_runs, card_runs) = (runs("vcan0", pairs.vcan0), runs("cards", pairs.cards));
    let disturbed = out.join("cards");

    for (name, code) in guest.codes() {
        // These two jobs end the rig, as Ctrl-C does, when they have done what they are for.
        let expected = if ["cards-emulator", "errors-emulator"].contains(&name.as_str()) { 130 } else { 0 };
        assert_eq!(code, expected, "{name}");
    }
    the_cards_are_set_up_as_asked(&json(&guest.file("guest.json")));
    the_system_granted_real_time(&out.join("cards"));
    for run in &vcan_runs {
        assert_eq!(json(&run.join("controller.json"))["axes"]["drive"]["chain_state"], "done");
        candump_agrees(&guest, run);
    }
    for run in &card_runs {
        assert_eq!(json(&run.join("controller.json"))["axes"]["drive"]["chain_state"], "done");
        every_frame_on_the_cards_is_accounted_for(&guest, run);
    }
    for run in vcan_runs.iter().chain(&card_runs) {
        cyclictest_stands_beside_our_figures(run, kernel);
    }
    both_interfaces_went_down_and_came_back(&disturbed);
    frames_around_the_disturbances_are_accounted_for(&guest, &disturbed);
    error_frames_are_counted_and_change_nothing(&out.join("errors"));
    reports_are_kept(kernel);
    guest
}

#[test]
fn vm_stock_kernel_with_cards_accounts_for_every_frame_and_survives_what_cards_do() {
    let guest = run_all("stock", &Pairs { vcan0: 1, cards: 1 });
    assert_eq!(json(&guest.file("guest.json"))["sys_kernel_realtime"], false);
}

#[test]
fn vm_preempt_rt_kernel_with_cards_accounts_for_every_frame_and_survives_what_cards_do() {
    let guest = run_all("rt", &Pairs { vcan0: 2, cards: 1 });
    let facts = json(&guest.file("guest.json"));
    assert_eq!(facts["sys_kernel_realtime"], true);
    assert!(facts["kernel_version"].as_str().unwrap().contains("PREEMPT_RT"), "{facts:#}");
    let run = json(&guest.out().join("cards/run.json"));
    assert!(run["machine"].to_string().contains("PREEMPT_RT"), "{:#}", run["machine"]);
}

fn the_cards_are_set_up_as_asked(facts: &Value) {
    for card in ["can0", "can1"] {
        let link = find(&facts["links"], "ifname", card);
        assert_eq!(link["txqlen"], 10, "{card}");
        let data = &link["linkinfo"]["info_data"];
        assert_eq!(
            (&data["bittiming"]["bitrate"], &data["restart_ms"]),
            (&1_000_000.into(), &100.into()),
            "{card}"
        );
        assert!(data["ctrlmode"].to_string().contains("BERR-REPORTING"), "{data:#}");
        assert_eq!(data["bittiming_const"]["name"], "sja1000");
    }
}

/// FIFO, locked memory and the one processor there is, and nothing refused.
fn the_system_granted_real_time(run: &Path) {
    for file in ["run.json", "controller.json"] {
        let report = json(&run.join(file));
        let granted = report["realtime_granted"].to_string();
        for wanted in ["SCHED_FIFO priority 80", "memory locked", "pinned to CPU 0"] {
            assert!(granted.contains(wanted), "{file}: no {wanted} in {granted}");
        }
        assert_eq!(report["realtime_refused"], Value::Array(Vec::new()), "{file}");
    }
}

/// On vcan0 nothing is lost, and an independent decoder agrees with the run's files.
fn candump_agrees(guest: &Guest, run: &Path) {
    let log = tempfile::NamedTempFile::new().unwrap();
    fs::write(log.path(), guest.lines_of_run("candump.log", run)).unwrap();
    let reported =
        compare_candump(log.path(), run).unwrap_or_else(|complaint| panic!("{}: {complaint}", run.display()));
    eprintln!("{}: {reported}", run.display());
}

/// Both programs' files of a run on the cards, what the interfaces counted, and what candump saw on `can1`.
struct CardRun {
    summary: Value,
    controller: Value,
    can0: InterfaceCounters,
    can1: InterfaceCounters,
    heard: Vec<protocol::can::CanFrame>,
    /// Frames in candump's log that are no error frames, garbled ones too: an emulated card whose FIFO ran over on a busy machine
    /// has handed out frames with the bits of an extended or remote one.
    logged: u64,
}

impl CardRun {
    fn read(guest: &Guest, run: &Path) -> Self {
        let log = guest.lines_of_run(LOG_OF_CAN1, run);
        // candump writes an error frame with the flag's eight digits, 2 or 3 first.
        let error_frame = |line: &&str| {
            let id =
                line.rsplit_once(' ').and_then(|(_, frame)| frame.split_once('#')).map_or("", |(id, _)| id);
            id.len() == 8 && id.starts_with(['2', '3'])
        };
        Self {
            summary: json(&run.join("summary.json")),
            controller: json(&run.join("controller.json")),
            can0: InterfaceCounters::during(run, "can0"),
            can1: InterfaceCounters::during(run, "can1"),
            logged: log.lines().filter(|line| !error_frame(line)).count() as u64,
            heard: data_frames(&log),
        }
    }

    /// Frames on `can1` from the far end of the wire, of the rig and foreign ones, and those of the controllers.
    fn heard_by_sender(&self) -> (u64, u64) {
        let by_the_controllers = |id: u16| matches!(id, 0x10A | 0x10B | 0x110 | 0x111 | 0x150..=0x157);
        let from_controllers =
            self.heard.iter().filter(|frame| frame.standard_id().is_some_and(by_the_controllers)).count()
                as u64;
        (self.logged - from_controllers, from_controllers)
    }

    /// A card loses what its receive FIFO does not take, and then says so: once for one frame or more. Both directions.
    fn losses_on_the_wire_are_counted_by_the_cards(&self) {
        for (sender, receiver) in [(&self.can0, &self.can1), (&self.can1, &self.can0)] {
            let lost = sender.sent.checked_sub(receiver.received).expect("a frame that nobody sent");
            assert!(
                receiver.overruns <= lost && (lost == 0) == (receiver.overruns == 0),
                "{sender:?}, {receiver:?}"
            );
        }
    }

    /// Every overrun is an error frame to the program, while it listens.
    fn overruns_reach_the_programs(&self) {
        assert_eq!(count(&self.summary, "/bus/error_frames"), self.can0.overruns);
        assert!(count(&self.controller, "/bus/error_frames") <= self.can1.overruns);
    }
}

fn every_frame_on_the_cards_is_accounted_for(guest: &Guest, run: &Path) {
    let on = CardRun::read(guest, run);
    eprintln!("{}: {:?} {:?}", run.display(), on.can0, on.can1);
    assert!(count(&on.summary, "/cycles") > 5000);
    let (from_rig, from_controllers) = on.heard_by_sender();

    // Handed to the bus = sent by the card = heard at the far end + lost in the far card's FIFO.
    assert_eq!(count(&on.summary, "/bus/sent"), count(&on.summary, "/frames_sent"));
    assert_eq!(count(&on.summary, "/bus/sent"), on.can0.sent);
    assert_eq!((count(&on.controller, "/bus/sent"), on.can1.sent), (from_controllers, from_controllers));
    assert_eq!((on.can1.received, on.can1.dropped), (from_rig, 0));
    on.losses_on_the_wire_are_counted_by_the_cards();
    on.overruns_reach_the_programs();

    // Heard by the programs: all that came; what came before the controllers listened, or after they left, is excused.
    let heard_by_rig = count(&on.summary, "/bus/received") + count(&on.summary, "/bus/dropped_on_receive");
    let heard_by_controllers =
        count(&on.controller, "/bus/received") + count(&on.controller, "/bus/dropped_on_receive");
    assert!(heard_by_rig <= on.can0.received && heard_by_controllers <= from_rig);
    assert!(
        heard_by_controllers + rig_frames_outside_the_commands(&on.heard) >= from_rig,
        "{heard_by_controllers} of {from_rig} heard"
    );

    // By the other account, the gaps: what the controllers miss is what is missing on can1's side of the wire.
    for (axis, id) in [("drive", frames::DRIVE_SENSORS.id), ("load", frames::LOAD_SENSORS.id)] {
        let sent = count(&on.summary, "/cycles") - count(&on.summary, "/skipped");
        let came = on.heard.iter().filter(|frame| frame.standard_id() == Some(id)).count() as u64;
        let missing = account::of_sensors(&on.heard, id);
        let received = count(&on.controller, &format!("/axes/{axis}/sensors_received"));
        let lost = count(&on.controller, &format!("/axes/{axis}/sensors_lost"));
        eprintln!("{axis}: {sent} sent, {came} came, {received} received, {lost} lost by gaps, {missing:?}");
        assert!(came <= sent && received <= came && received + lost <= sent, "{axis}");
        assert!(lost <= missing.missing_before_first_tick + missing.missing_between_ticks, "{axis}");
        let before = sensors_sent_before_the_first_command(&on.heard);
        assert!(received + lost + before >= sent, "{axis}: {sent} sent, {before} before the first command");
    }
}

/// Frames of the rig on the bus before the first command, and after the rig's first farewell.
fn rig_frames_outside_the_commands(heard: &[protocol::can::CanFrame]) -> u64 {
    let known: Vec<_> = heard.iter().filter_map(|frame| Frame::decode(frame).ok()).collect();
    let first = known
        .iter()
        .position(|frame| matches!(frame, Frame::DriveValveCommand(_) | Frame::LoadValveCommand(_)));
    let farewell = known.iter().position(|frame| matches!(frame, Frame::Tick(tick) if tick.ending));
    let after = farewell.map_or(0, |farewell| known.len() - farewell - 1);
    (first.expect("a command") + after) as u64
}

/// Sensor frames of an axis that the rig had sent by the first tick after the controllers' first command.
fn sensors_sent_before_the_first_command(heard: &[protocol::can::CanFrame]) -> u64 {
    let mut known = heard.iter().filter_map(|frame| Frame::decode(frame).ok());
    known.find(|frame| matches!(frame, Frame::DriveValveCommand(_))).expect("a command");
    let tick = known
        .find_map(|frame| if let Frame::Tick(tick) = frame { Some(tick) } else { None })
        .expect("a tick");
    u64::from(tick.cycle) + 1 - u64::from(tick.skipped)
}

/// Ten frames are soon full when foreign programs send without a pause: frames that find no room are dropped by their sender,
/// and counted.
#[test]
fn vm_a_full_queue_is_counted() {
    let guest =
        Guest::run_on_two_processors(&["--kernel", "stock", "--cards", "--", "sh /airbench/job-queue"]);
    assert_eq!(
        guest.codes(),
        [("queue-cangen", 0), ("queue-emulator", 130)].map(|(name, code)| (name.to_owned(), code)).into()
    );
    let run = guest.out().join("queue");
    let (sent, refused) = sent_and_refused_by_cangen(&run);
    assert!(sent > 0 && refused > 0, "cangen never filled the queue: {sent} sent");
    let summary = json(&run.join("summary.json"));
    assert!(count(&summary, "/bus/dropped_on_send") > 0, "the rig never found the queue full");
    assert_eq!(count(&summary, "/bus/sent"), count(&summary, "/frames_sent"));
}

/// What the senders of cangen put on the bus, and how often the queue was full, as each says itself.
fn sent_and_refused_by_cangen(run: &Path) -> (u64, u64) {
    const TRIED_BY_EACH: u64 = 3000;
    let said = (0..).map_while(|sender| fs::read_to_string(run.join(format!("cangen-{sender}.txt"))).ok());
    let refused: Vec<u64> =
        said.map(|said| said.split_whitespace().find_map(|word| word.parse().ok()).unwrap_or(0)).collect();
    let sum = refused.iter().sum();
    (TRIED_BY_EACH * refused.len() as u64 - sum, sum)
}

fn both_interfaces_went_down_and_came_back(run: &Path) {
    let (summary, controller) = (json(&run.join("summary.json")), json(&run.join("controller.json")));
    for (file, report) in [("summary.json", &summary), ("controller.json", &controller)] {
        assert_eq!((count(report, "/bus/disconnects"), count(report, "/bus/reconnects")), (1, 1), "{file}");
    }

    // can0, under the rig: the valves shut while the bus is gone, and follow again when it is back.
    let events = summary["events"].as_array().unwrap();
    let cycle_of = |from: u64, wanted: Value| {
        let found = events.iter().find(|event| event["kind"] == wanted && count(event, "/cycle") >= from);
        found.map(|event| count(event, "/cycle"))
    };
    let expected = |from: u64, wanted: Value| {
        cycle_of(from, wanted.clone())
            .unwrap_or_else(|| panic!("no {wanted} from cycle {from} on: {}", kinds_of_events(&summary)))
    };
    let measurement = Table::read(&run.join("measurement.csv"));
    let lost = expected(0, "bus-lost".into());
    let back = expected(lost, "bus-back".into());
    for axis in ["drive", "load"] {
        let reported = |what: &str, from: u64| expected(from, serde_json::json!({ what: axis }));
        // With the queue full the command may have grown stale before the bus went.
        let shut = cycle_of(lost, serde_json::json!({ "command-stale": axis }))
            .filter(|cycle| *cycle < back)
            .unwrap_or(lost);
        let again = reported("command-fresh", back);
        // can1, under the controller: the rig still has its bus, but no commands.
        let shut_again = reported("command-stale", again);
        let fresh_again = reported("command-fresh", shut_again);
        let valve = measurement.column(&format!("{axis}_valve"));
        for rows in [shut..again, shut_again..fresh_again] {
            let open = rows.clone().find(|row| valve[*row as usize] != 0.0);
            assert_eq!(open, None, "the {axis} valve is open in a row of {rows:?}");
        }
    }
    // The controller waits, tells so, and goes on with the experiment where it stood.
    let news = controller["news"].as_array().unwrap();
    let place = |wanted: &str| {
        news.iter().position(|news| news == wanted).unwrap_or_else(|| panic!("no {wanted} in {news:#?}"))
    };
    assert!(
        place("sensors-silent") < place("bus-lost") && place("bus-lost") < place("bus-back"),
        "{news:#?}"
    );
    for axis in ["drive", "load"] {
        let state = controller["axes"][axis]["chain_state"].as_str().unwrap();
        assert!(!["fault", "aborted"].contains(&state), "{axis}: {state}");
    }
}

/// How often each kind was reported, for who has to find out why one was not.
fn kinds_of_events(summary: &Value) -> String {
    let mut kinds = BTreeMap::<String, usize>::new();
    for event in summary["events"].as_array().unwrap() {
        let kind = event["kind"].as_object().and_then(|kind| kind.keys().next());
        *kinds.entry(kind.map_or_else(|| event["kind"].to_string(), Clone::clone)).or_default() += 1;
    }
    format!("{kinds:?}, {} in all, {} records dropped", summary["event_count"], summary["records_dropped"])
}

fn frames_around_the_disturbances_are_accounted_for(guest: &Guest, run: &Path) {
    let on = CardRun::read(guest, run);
    eprintln!("{}: {:?} {:?}", run.display(), on.can0, on.can1);
    let (from_can0, from_controllers) = on.heard_by_sender();
    let (foreign, _) = sent_and_refused_by_cangen(run);

    // What was in the queue went with the interface, and so did what the kernel still took while it was closing it; everything
    // else left the card.
    for (handed_over, sent) in [
        (count(&on.summary, "/bus/sent") + foreign, on.can0.sent),
        (count(&on.controller, "/bus/sent"), on.can1.sent),
    ] {
        let with_the_interface = handed_over.checked_sub(sent).expect("a frame that nobody sent");
        eprintln!("{with_the_interface} of {handed_over} frames went with the interface");
    }
    // candump saw what the driver of can1 handed up, and what it sent, but for what the kernel dropped when can1 went down.
    let carried = on.can1.received + on.can1.sent;
    assert!((carried - on.can1.dropped..=carried).contains(&(from_can0 + from_controllers)), "{:?}", on.can1);
    assert!(count(&on.controller, "/bus/received") <= from_can0);
    assert!(
        on.heard.iter().any(|frame| frame.standard_id() == Some(FOREIGN)),
        "no frame of cangen crossed the wire"
    );
    for (report, card) in [(&on.summary, &on.can0), (&on.controller, &on.can1)] {
        // Where its FIFO ran over, an emulated card hands out garbled frames; nowhere else.
        let [malformed, unknown] =
            ["malformed", "unknown"].map(|kind| count(report, &format!("/frames_ignored/{kind}")));
        assert!(
            card.overruns > 0 || (malformed == 0 && unknown <= foreign),
            "{malformed} malformed, {unknown} unknown, {foreign} foreign, {card:?}"
        );
    }
    // Wherever a sensor frame was lost, it is missing in the count of those that the rig says it sent.
    for (axis, id) in [("drive", frames::DRIVE_SENSORS.id), ("load", frames::LOAD_SENSORS.id)] {
        let tried = count(&on.summary, "/cycles") - count(&on.summary, "/skipped");
        let came = on.heard.iter().filter(|frame| frame.standard_id() == Some(id)).count() as u64;
        let account::SensorAccount { missing_before_first_tick, missing_between_ticks } =
            account::of_sensors(&on.heard, id);
        let missing = missing_before_first_tick + missing_between_ticks;
        let received = count(&on.controller, &format!("/axes/{axis}/sensors_received"));
        let lost = count(&on.controller, &format!("/axes/{axis}/sensors_lost"));
        eprintln!(
            "{axis}: {tried} tried, {came} came, {received} received, {lost} lost by gaps, {missing} missing"
        );
        assert!(came + missing <= tried && received <= came && lost <= missing, "{axis}");
        assert!(lost > 0, "{axis}: sensors were sent while can1 was down");
        let before = sensors_sent_before_the_first_command(&on.heard);
        assert!(received + lost + before >= came + missing, "{axis}: {before} before the first command");
    }
}

/// A card that goes bus-off says so with an error frame; on vcan0 cansend says it. It is counted, and nothing else happens.
fn error_frames_are_counted_and_change_nothing(run: &Path) {
    let (summary, controller) = (json(&run.join("summary.json")), json(&run.join("controller.json")));
    for (file, report) in [("summary.json", &summary), ("controller.json", &controller)] {
        assert_eq!(count(report, "/bus/error_frames"), ERROR_FRAMES, "{file}");
        let others =
            ["/bus/disconnects", "/bus/dropped_on_receive", "/bus/dropped_on_send", "/bus/malformed"];
        for counter in others.into_iter().chain(["/frames_ignored/unknown", "/frames_ignored/malformed"]) {
            assert_eq!(count(report, counter), 0, "{file}: {counter}");
        }
    }
    assert_eq!(count(&summary, "/frames_lost"), 0);
    assert_eq!(count(&controller, "/axes/drive/sensors_lost"), 0);
}

fn cyclictest_stands_beside_our_figures(run: &Path, kernel: &str) {
    let reference = json(&run.join("cyclictest.json"));
    assert_eq!(reference["return_code"], 0);
    assert_eq!(count(&reference, "/sysinfo/realtime") == 1, kernel == "rt", "{:#}", reference["sysinfo"]);
    let thread = &reference["thread"]["0"];
    let samples: u64 = thread["histogram"].as_object().unwrap().values().filter_map(Value::as_u64).sum();
    assert!(samples > 0 && samples <= count(thread, "/cycles"), "{samples} samples");
    let summary = json(&run.join("summary.json"));
    assert_eq!(
        count(&summary, "/wakeup_ns/count"),
        count(&summary, "/cycles"),
        "skipped cycles were late as well"
    );
    let conditions = json(&run.join("conditions.json"));
    assert!(conditions["reference_command"].as_str().unwrap().starts_with("cyclictest "), "{conditions:#}");
    eprintln!(
        "{}: cyclictest max {} us; wake-up p50 {} ns, {} of {} cycles skipped",
        run.display(),
        thread["max"],
        summary["wakeup_ns"]["p50"],
        summary["skipped"],
        summary["cycles"]
    );
}

/// The reports that `.github/workflows/ci.yml` keeps, in `target/vm-reports`; they say themselves that they support no claim.
fn reports_are_kept(kernel: &str) {
    for bus in ["vcan0", "cards"] {
        let folder = workspace().join(format!("target/vm-reports/{kernel}-{bus}"));
        for file in ["guest.json", "report.html", "report.md"] {
            assert!(folder.join(file).exists(), "no {file} in {}", folder.display());
        }
        let report = json(&folder.join("report.json"));
        assert_eq!(report["claim"]["supported"], false, "{:#}", report["claim"]);
    }
}
