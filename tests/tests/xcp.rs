//! XCP on CAN as its users meet it: unmodified pyXCP at the controllers, in lockstep and in real time, with one process and two;
//! pya2l on the A2L file.
//!
//! What the client read is held against what the controllers and the emulator recorded by themselves.

use serde_json::Value;
use std::collections::BTreeMap;
use system_tests::xcp::{PyXcpClient, config, wait_for_a2l, xcp_packet};
use system_tests::{AxisTable, Pace, RESTLESS, Running, Scene, count, turn};

/// pyXCP takes its time to start, on a busy machine more than a controller waits for those that are missing.
const PATIENT: &str = "--bus-grace 60";

fn lockstep_of(members: usize) -> String {
    format!("--members {members} --join-timeout 60 --seconds 200")
}

fn texts(value: &Value, keys: &[&str]) -> Vec<String> {
    keys.iter().map(|key| value[*key].as_str().unwrap_or("accepted").to_owned()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("no list: {value}"));
    list.iter().map(|number| number.as_f64().expect("a number")).collect()
}

/// Rows of a DAQ list by their cycle: position, if it was asked for, and state of the main chain.
fn daq_rows(seen: &Value) -> Vec<(usize, Option<f64>, f64)> {
    let headers: Vec<_> = seen["headers"].as_array().expect("headers").iter().map(Value::as_str).collect();
    let place = |name: &str| headers.iter().position(|header| *header == Some(name));
    let [cycle, state] = ["cycle", "main_chain"].map(|name| place(name).expect("it was asked for"));
    let position = place("position_m");
    let rows = seen["rows"].as_array().expect("rows").iter().map(numbers);
    rows.map(|row| (row[cycle] as usize, position.map(|place| row[place]), row[state])).collect()
}

/// The rows of DAQ are those of the controller's own table, rounded to floats of four bytes.
#[track_caller]
fn expect_rows_of(table: &AxisTable, rows: &[(usize, Option<f64>, f64)]) {
    let (positions, states) = (table.numbers("position_m"), table.texts("main_chain"));
    let at: BTreeMap<usize, usize> = table.cycles().into_iter().zip(0..).collect();
    for (cycle, position, state) in rows {
        let row = at[cycle];
        if let Some(position) = position {
            assert_eq!(*position as f32, positions[row] as f32, "position in cycle {cycle}");
        }
        assert_eq!(*state == 5.0, states[row] == "experiment", "state in cycle {cycle}");
    }
}

fn end(emulator: Running, controllers: Vec<Running>) {
    emulator.interrupt();
    for controller in controllers {
        controller.wait().expect_code(0);
    }
}

#[test]
fn pyxcp_reads_writes_is_refused_measures_without_a_gap_and_triggers() {
    let scene = Scene::new(RESTLESS);
    let config = config(&scene);
    let emulator = scene.emulator(Pace::Lockstep).with(&lockstep_of(2)).start();
    let options = format!("--repeat --xcp {} {PATIENT}", config.display());
    let controller = scene.controller(Pace::Lockstep).with(&options).start();
    wait_for_a2l(&scene, "controller", "drive");
    let seen = PyXcpClient::start(&scene, "whole", "controller", "drive", true).wait();
    end(emulator, vec![controller]);
    let drive = scene.axis_table("drive");

    let identity = &seen["identity"];
    assert_eq!([&identity["slave"]["maxCto"], &identity["slave"]["maxDto"]], ["8", "8"]);
    assert!(identity["epk"].as_str().expect("a text").starts_with("airbench "), "{identity}");
    assert_eq!([&identity["epk_in_memory"], &identity["epk_in_file"]], [&identity["epk"]; 2]);
    assert_eq!(identity["a2l_bytes"][0], identity["a2l_bytes"][1]);
    assert_eq!(identity["a2l_sums_agree"], true, "the slave hands out the file that lies in the folder");

    let protection = &seen["protection"];
    assert_eq!((&protection["gain"], &protection["protected"]), (&40.0.into(), &true.into()));
    let keys =
        ["locked", "wrong_key", "too_large", "no_number", "at_start_only", "signal", "nowhere", "written"];
    let refusals = [
        "ERR_ACCESS_LOCKED",
        "ERR_ACCESS_LOCKED",
        "ERR_OUT_OF_RANGE",
        "ERR_OUT_OF_RANGE",
        "ERR_WRITE_PROTECTED",
        "ERR_WRITE_PROTECTED",
        "ERR_ACCESS_DENIED",
        "accepted",
    ];
    assert_eq!(texts(protection, &keys), refusals);
    assert_eq!(protection["unlocked"], true);
    assert_eq!(protection["gain_after_refusals"], 40.0);
    assert_eq!(protection["gain_written"], 17.125);

    let set = &seen["parameter_set"];
    let stored = set["stored"].as_str().expect("a text");
    assert!(stored.contains("[drive.algorithm]"), "{stored}");
    assert!(stored.contains("\ngain_per_s = 17.125  # 1/s, 0 to 200"), "{stored}");
    assert_eq!((&set["gain_loaded"], &set["block_restores"]), (&17.125.into(), &true.into()));

    // pyXCP 0.29 begins a block of one double and goes on with another: nothing of it may be taken, and the client must learn it.
    assert_eq!((&set["push_of_one"], &set["gain_after_push"]), (&"ERR_SEQUENCE".into(), &44.0.into()));

    expect_trace(&scene, &drive, &seen["trace"]);
    let rows = daq_rows(&seen["daq"]);
    assert!(rows.len() >= 10_000, "{} rows", rows.len());
    let gaps = rows.windows(2).filter(|pair| pair[1].0 != pair[0].0 + 1).count();
    assert_eq!(gaps, 0, "from cycle {} to {}", rows[0].0, rows[rows.len() - 1].0);
    expect_rows_of(&drive, &rows);

    let xcp = &scene.report()["axes"]["drive"]["xcp"];
    for (key, least) in
        [("sessions", 3), ("wrong_keys", 1), ("unlocked", 1), ("changed", 3), ("daq_packets", 20_000)]
    {
        assert!(count(xcp, &format!("/{key}")) >= least, "{key}: {xcp}");
    }
    for key in ["daq_dropped", "answers_dropped", "commands_dropped"] {
        assert_eq!(count(xcp, &format!("/{key}")), 0, "{key}");
    }
}

/// The trigger buffer holds, to the bit, what controller and emulator recorded around the crossing.
#[track_caller]
fn expect_trace(scene: &Scene, drive: &AxisTable, trace: &Value) {
    let cycles: Vec<usize> = numbers(&trace["cycles"]).into_iter().map(|cycle| cycle as usize).collect();
    let trigger = trace["trigger_cycle"].as_u64().expect("a cycle") as usize;
    assert_eq!((trace["running"].as_u64(), cycles.len()), (Some(1), 200));
    assert!(cycles.iter().zip(trigger - 60..).all(|(cycle, expected)| *cycle == expected), "{cycles:?}");
    // A sensor may read -0, and the wire has one zero only: 0 is added to both, which makes one of them and changes nothing else.
    let bits = |values: &[f64]| values.iter().map(|value| (value + 0.0).to_bits()).collect::<Vec<_>>();
    let rig = scene.measurement();
    // A row of the emulator's table for each cycle from 0 on.
    let of_rig = |name: &str| {
        let column = rig.column(name);
        cycles.iter().map(|cycle| column[*cycle]).collect::<Vec<_>>()
    };
    let position = numbers(&trace["channel_1"]);
    assert_eq!(bits(&position), bits(&of_rig("drive_position_m")), "the rig's position sensor");
    assert_eq!(bits(&numbers(&trace["channel_2"])), bits(&of_rig("drive_force_N")), "the rig's force sensor");
    assert!(position[59] < 0.25 && position[60] >= 0.25, "{} and {}", position[59], position[60]);
    let first = drive.cycles().iter().position(|cycle| *cycle == cycles[0]).expect("it was recorded");
    for (channel, column) in [("channel_3", "wanted_velocity_m_per_s"), ("channel_4", "opening")] {
        let recorded = &drive.numbers(column)[first..first + 200];
        assert_eq!(bits(&numbers(&trace[channel])), bits(recorded), "{column}");
        assert!(recorded.iter().any(|value| *value != recorded[0]), "{column} moves");
    }
}

#[test]
fn two_processes_are_measured_at_once_each_under_identifiers_of_its_own() {
    let scene = Scene::new(RESTLESS);
    let config = config(&scene);
    let emulator = scene.emulator(Pace::Lockstep).with(&lockstep_of(4)).start();
    let options = format!("--repeat --xcp {} {PATIENT}", config.display());
    let axes = ["drive", "load"];
    let controllers: Vec<_> =
        axes.iter().map(|axis| scene.axis_controller(Pace::Lockstep, axis).with(&options).start()).collect();
    axes.iter().for_each(|axis| wait_for_a2l(&scene, "controller", axis));
    let clients = axes.map(|axis| PyXcpClient::start(&scene, "measure", "controller", axis, true));
    for (client, axis) in clients.into_iter().zip(axes) {
        let seen = client.wait();
        let epk = seen["identity"]["epk"].as_str().expect("a text");
        assert!(
            epk.contains(axis) && seen["identity"]["a2l_sums_agree"] == true,
            "{axis}: {}",
            seen["identity"]
        );
        let rows = daq_rows(&seen["daq"]);
        assert!(rows.len() >= 1000 && rows.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1), "{axis}");
        let positions: Vec<_> = rows.iter().filter_map(|(_, position, _)| *position).collect();
        // The drive moves; the load is parked at the end of its stroke, offset of its sensor included.
        assert!(
            positions.len() == rows.len()
                && positions.iter().all(|position| (*position > 0.45) == (axis == "load")),
            "{axis}: {:?}",
            &positions[..3]
        );
    }
    end(emulator, controllers);
}

#[test]
fn in_real_time_every_cycle_that_was_answered_in_10_s_was_measured() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let config = config(&scene);
    let emulator = scene.emulator(Pace::Real).start();
    let options = format!("--repeat --xcp {}", config.display());
    let controller = scene.controller(Pace::Real).with(&options).start();
    wait_for_a2l(&scene, "controller", "drive");
    scene.wait_for_rows("emulator", 100);
    let seen = PyXcpClient::start(&scene, "watch", "controller", "drive", false).wait();
    end(emulator, vec![controller]);
    let drive = scene.axis_table("drive");
    let rows = daq_rows(&seen["daq"]);
    expect_rows_of(&drive, &rows);
    assert!(rows.len() >= 10_000, "{} rows", rows.len());
    let seen = rows[0].0..=rows[rows.len() - 1].0;
    let answered: Vec<_> = drive.cycles().into_iter().filter(|cycle| seen.contains(cycle)).collect();
    let mut sent = measured_cycles(&scene);
    sent.retain(|cycle| seen.contains(cycle));
    assert!(sent == answered, "{} packets in {seen:?} for {} cycles", sent.len(), answered.len());
    // A client that is not served for a while loses what its queue does not hold: that is its own.
    eprintln!("of {} packets pyXCP had {}", sent.len(), rows.len());
}

/// Cycles of the drive's DAQ packets on the bus, by their time stamps: the low 16 bits of ever later cycles.
fn measured_cycles(scene: &Scene) -> Vec<usize> {
    let frames = scene.bus_log().into_iter();
    let mut cycle = 0;
    frames
        .filter_map(|frame| xcp_packet(&frame).filter(|packet| packet[0] == 0))
        .map(|[_, low, high, ..]| {
            cycle += usize::from(u16::from_le_bytes([low, high]).wrapping_sub(cycle as u16));
            cycle
        })
        .collect()
}
