//! Every fault of the bus does what its row of the table says, in lockstep: seen by a member of the barrier, by the rig, and in
//! the host's report.
//!
//! Faults last from 0.2 to 0.3 s of runs of 0.4 s. What the rig says in a cycle the member hears in that cycle; what the
//! member says the rig has in the next.

use protocol::can::CanFrame;
use protocol::frames::{
    DRIVE_SENSORS, DRIVE_VALVE_COMMAND, Frame, LOAD_SENSORS, LOAD_VALVE_COMMAND, RIG_STATUS, TICK,
};
use serde_json::Value;
use system_tests::broken::{BEGINS, ENDS, FaultRun, FaultRunPlan, fault};
use system_tests::{count, count_of_id, events};

fn run_over(bus: &str, faults: &str) -> FaultRun {
    FaultRunPlan { faults, bus, act: |_| Some([0.3, 0.2]), ..FaultRunPlan::default() }.run_with_marks()
}

fn run(name: &str, at: &str, numbers: &str) -> FaultRun {
    run_over("", &fault(name, at, numbers))
}

/// Frames that met the fault, by the host's report.
fn met(outcome: &FaultRun, name: &str, id: u16) -> u64 {
    let table = &outcome.summary["bus_host"]["faults"][name];
    if table.is_null() { 0 } else { count_of_id(table, &format!("{id:03X}")) }
}

fn alive(frame: &CanFrame) -> u64 {
    match Frame::decode(frame) {
        Ok(Frame::DriveSensors(sensors) | Frame::LoadSensors(sensors)) => u64::from(sensors.alive),
        Ok(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => u64::from(command.alive),
        other => panic!("no counter in {other:?}"),
    }
}

/// Counters of the drive's sensors that the member heard, cycle by cycle.
fn counters(outcome: &FaultRun, id: u16) -> Vec<Vec<u64>> {
    outcome.received_of(id).iter().map(|frames| frames.iter().map(alive).collect()).collect()
}

/// What a sound bus brings: one frame in each cycle, with the cycle's counter.
fn sound(cycle: usize) -> Vec<u64> {
    vec![cycle as u64 % 16]
}

fn expect_sound_outside(received: &[Vec<u64>], ends: usize) {
    for (cycle, received) in received.iter().enumerate().filter(|(cycle, _)| !(BEGINS..ends).contains(cycle))
    {
        assert_eq!(*received, sound(cycle), "cycle {cycle}");
    }
}

#[test]
fn lost_frames_are_lost_for_all_and_counted() {
    let outcome = run("bus-loss", "bus.DriveSensors", "");
    let received = counters(&outcome, DRIVE_SENSORS.id);
    expect_sound_outside(&received, ENDS);
    assert!(received[BEGINS..ENDS].iter().all(Vec::is_empty), "not one is heard");
    expect_sound_outside(&counters(&outcome, LOAD_SENSORS.id), 0);
    assert_eq!(met(&outcome, "bus-loss", DRIVE_SENSORS.id), 100);
    assert_eq!(count_of_id(&outcome.summary["bus_host"]["injected_loss"], "120"), 100);
    // A half of all frames, commands among them: the rig finds the gaps in their counters.
    let outcome = run("bus-loss", "bus", "probability = 0.5");
    let lost = count(&outcome.summary, "/drive_commands/lost");
    let met_commands = met(&outcome, "bus-loss", DRIVE_VALVE_COMMAND.id);
    assert_eq!(lost, met_commands, "gaps are what was lost");
    // Binomial of 100 by a half: 50 with a deviation of 5; five of them.
    assert!((25..=75).contains(&met_commands), "{met_commands}");
}

#[test]
fn the_bus_url_loses_by_the_same_fault_from_start_to_end() {
    let outcome =
        FaultRunPlan { bus: "loss=0.5&seed=3", act: |_| Some([0.0; 2]), ..FaultRunPlan::default() }.run();
    let lost = count_of_id(&outcome.summary["bus_host"]["injected_loss"], "120");
    assert_eq!(met(&outcome, "bus-loss", DRIVE_SENSORS.id), lost);
    let received = counters(&outcome, DRIVE_SENSORS.id).iter().map(Vec::len).sum::<usize>();
    assert_eq!(received as u64 + lost, 400);
}

#[test]
fn delayed_frames_come_so_much_later_in_their_order() {
    let outcome = run("bus-delay", "bus.LoadSensors", "delay_ms = 7");
    let received = counters(&outcome, LOAD_SENSORS.id);
    assert!(received[BEGINS..BEGINS + 7].iter().all(Vec::is_empty), "{:?}", &received[BEGINS..BEGINS + 7]);
    for (cycle, received) in received.iter().enumerate().take(ENDS).skip(BEGINS + 7) {
        assert_eq!(*received, sound(cycle - 7), "cycle {cycle}");
    }
    // What is under way at the end comes at once, before the first that is not delayed.
    let last: Vec<u64> = (ENDS - 7..=ENDS).map(|cycle| cycle as u64 % 16).collect();
    assert_eq!(received[ENDS], last);
    assert_eq!(met(&outcome, "bus-delay", LOAD_SENSORS.id), 100);
}

#[test]
fn commands_that_are_delayed_beyond_their_age_shut_the_valve() {
    let outcome = run("bus-delay", "bus.DriveValveCommand", "delay_ms = 30");
    let valve = outcome.measurement.column("drive_valve");
    assert!(valve[BEGINS - 1] > 0.29 && valve[BEGINS + 25..ENDS].iter().all(|opening| *opening == 0.0));
    assert!(outcome.measurement.column("load_valve")[BEGINS..ENDS].iter().all(|opening| *opening > 0.19));
    assert!(count(&outcome.summary, "/drive_commands/refused_stale") > 50);
    let reported = events::all(&outcome.summary);
    assert_eq!(events::times(&reported, "command-stale"), 1, "{reported:?}");
}

#[test]
fn frames_come_more_than_once_and_overtake_each_other() {
    let outcome = run("bus-duplication", "bus.DriveSensors", "probability = 1.0\ncopies = 2");
    let received = counters(&outcome, DRIVE_SENSORS.id);
    expect_sound_outside(&received, ENDS);
    for (cycle, received) in received.iter().enumerate().take(ENDS).skip(BEGINS) {
        assert_eq!(*received, vec![cycle as u64 % 16; 3], "cycle {cycle}");
    }
    let outcome = run("bus-duplication", "bus.DriveValveCommand", "probability = 1.0");
    assert!(count(&outcome.summary, "/frames_duplicate") >= 100, "the rig finds them");

    let outcome = run("bus-reordering", "bus.DriveSensors", "probability = 1.0");
    let received = counters(&outcome, DRIVE_SENSORS.id);
    expect_sound_outside(&received, ENDS);
    for cycle in (BEGINS..ENDS).step_by(2) {
        let (first, second) = (cycle as u64 % 16, (cycle as u64 + 1) % 16);
        assert_eq!(
            [&received[cycle][..], &received[cycle + 1][..]],
            [&[][..], &[second, first][..]],
            "cycle {cycle}"
        );
    }
    assert_eq!(met(&outcome, "bus-reordering", DRIVE_SENSORS.id), 50);
}

#[test]
fn corrupted_and_cut_commands_are_refused_and_the_valve_shuts() {
    for (name, numbers) in
        [("bus-corruption", "probability = 1.0"), ("wrong-length", "probability = 1.0\nbytes = 4")]
    {
        let outcome = run(name, "bus.DriveValveCommand", numbers);
        assert_eq!(count(&outcome.summary, "/frames_malformed"), 100, "{name}");
        assert_eq!(met(&outcome, name, DRIVE_VALVE_COMMAND.id), 100);
        let valve = outcome.measurement.column("drive_valve");
        assert!(
            valve[BEGINS + 25..ENDS].iter().all(|opening| *opening == 0.0),
            "{name}: no wrong command acts"
        );
        let others =
            valve.iter().filter(|opening| **opening != 0.0 && (**opening - 0.3).abs() > 1e-3).count();
        assert_eq!(others, 0, "{name}: an opening that nobody commanded");
        assert!(valve[ENDS + 5] > 0.29, "{name}: it follows again");
        let lengths: Vec<_> = outcome
            .log
            .iter()
            .filter(|frame| frame.standard_id() == Some(DRIVE_VALVE_COMMAND.id))
            .map(|frame| frame.data().len())
            .collect();
        let short = lengths.iter().filter(|length| **length == 4).count();
        assert_eq!(short, if name == "wrong-length" { 100 } else { 0 }, "{name}: in the log as it came");
    }
}

#[test]
fn a_counter_that_is_off_is_found_and_never_malformed() {
    let outcome = run("wrong-counter", "bus.DriveValveCommand", "probability = 0.2");
    let off = met(&outcome, "wrong-counter", DRIVE_VALVE_COMMAND.id);
    assert!((1..=45).contains(&off), "binomial of 100 by 0.2: 20 with a deviation of 4; {off}");
    let of_drive = |key: &str| count(&outcome.summary, &format!("/drive_commands/{key}"));
    assert!(of_drive("lost") + of_drive("breaks") + of_drive("two_sources") > 0);
    assert_eq!(count(&outcome.summary, "/frames_malformed"), 0, "length and checksum are right");
    assert_eq!(count(&outcome.summary, "/load_commands/lost"), 0);
    let outcome = run("wrong-counter", "bus.DriveSensors", "probability = 1.0\nstep = 3");
    let received = counters(&outcome, DRIVE_SENSORS.id);
    expect_sound_outside(&received, ENDS);
    assert!((BEGINS..ENDS).all(|cycle| received[cycle] == [(cycle as u64 + 3) % 16]));
}

/// Bits of the frames of a wire that keeps time, by identifier and in all, ppm of the time observed.
fn load_ppm(summary: &Value) -> u64 {
    count(summary, "/bus_host/wire_time/load_ppm")
}

#[test]
fn a_babbling_node_raises_the_load_of_the_bus_and_takes_the_others_time() {
    let wire = "bitrate=1000000";
    let quiet = run_over(wire, "[[fault]]\nname = \"bus-loss\"\nat = \"bus.Tick\"\nprobability = 0.0\n");
    let babble = fault("babbling-node", "bus", "id = 16\nframes_per_ms = 3.0");
    let loud = run_over(wire, &babble);
    assert_eq!(met(&loud, "babbling-node", 16), 300);
    // 300 frames of 8 bytes in 0.4 s: 111 to 135 us each, so 8.3 to 10.1 % more.
    let more = load_ppm(&loud.summary) - load_ppm(&quiet.summary);
    assert!((83_000..=102_000).contains(&more), "{more} ppm more");
    let longest =
        |outcome: &FaultRun| count(&outcome.summary, "/bus_host/wire_time/identifiers/120/response_ns/max");
    assert!(longest(&loud) > longest(&quiet), "a lower identifier goes first");
    let nodes = loud.summary["bus_host"]["wire_time"]["nodes"].as_array().expect("nodes").clone();
    assert!(nodes.iter().any(|node| node["name"] == "babbling node" && node["sent"] == 300), "{nodes:?}");
    // Over a wire that takes no time everybody hears it all the same.
    assert_eq!(run_over("", &babble).received_of(16).iter().map(Vec::len).sum::<usize>(), 300);
    assert_eq!(count(&loud.summary, "/frames_ignored/unknown"), 300, "the rig hears it, and minds it not");
}

#[test]
fn a_node_that_is_off_the_bus_is_not_heard_and_hears_nothing() {
    let outcome = run("bus-off", "rig", "");
    for id in [DRIVE_SENSORS.id, LOAD_SENSORS.id, TICK.id, RIG_STATUS.id] {
        let received = outcome.received_of(id);
        assert!(received[BEGINS..ENDS].iter().all(Vec::is_empty), "{id:#x} is heard");
        assert!(received[ENDS..].iter().any(|frames| !frames.is_empty()), "{id:#x} does not come back");
    }
    let valve = outcome.measurement.column("drive_valve");
    assert!(valve[BEGINS + 25..ENDS].iter().all(|opening| *opening == 0.0), "no command comes through");

    // The member is both controllers: it hears nothing, and no command of it comes through.
    let outcome = run("bus-off", "load-controller", "");
    assert!(outcome.received[BEGINS + 1..ENDS].iter().all(Vec::is_empty));
    for axis in ["drive", "load"] {
        let valve = outcome.measurement.column(&format!("{axis}_valve"));
        assert!(valve[BEGINS + 25..ENDS].iter().all(|opening| *opening == 0.0), "{axis}");
        assert!(valve[ENDS + 5] > 0.19, "{axis} is back");
    }
    assert_eq!(met(&outcome, "bus-off", LOAD_VALVE_COMMAND.id), 100);
    let missed: u64 = outcome.summary["bus_host"]["peers"]
        .as_array()
        .expect("peers")
        .iter()
        .map(|peer| count_of_id(&peer["missed_in_bus_off"], "120"))
        .sum();
    assert_eq!(missed, 100, "what it missed is counted");

    // It does not hear a node that babbles either, whatever the wire.
    let babble = fault("babbling-node", "bus", "id = 16\nframes_per_ms = 3.0");
    let faults = fault("bus-off", "rig", "") + &babble.replace("to_s = 0.3", "to_s = 0.25");
    for wire in ["", "bitrate=1000000"] {
        let outcome = run_over(wire, &faults);
        assert_eq!(
            outcome.received_of(16).iter().map(Vec::len).sum::<usize>(),
            150,
            "others hear it: {wire}"
        );
        assert_eq!(count(&outcome.summary, "/frames_ignored/unknown"), 0, "{wire}");
    }
}
