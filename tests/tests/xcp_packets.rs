//! XCP packet by packet: what it does to a run, and what it leaves alone. In lockstep a session of our own is the same every
//! time.

use protocol::can::CanFrame;
use system_tests::xcp::{SECRET, command, config, xcp_packet};
use system_tests::{PROGRAM, Pace, SHORT, Scene, both_good, count, json, run_both};

/// Cycle of the first command: the experiment moves.
const START: u32 = 852;
/// Address of `algorithm.gain_per_s` in the scene's program: after five numbers of the pre-controller and one of its own task.
const GAIN: u32 = 0x1000_0000 + 8 * 6;

/// What is to be said in all, after what was answered so far.
type Script = dyn Fn(&[[u8; 8]]) -> Vec<Vec<u8>>;

/// Runs the short experiment in lockstep with a client that says `script`, a command each so many cycles; gives what was
/// answered.
fn run(scene: &Scene, options: &str, axes: &[&str], script: &Script) -> Vec<[u8; 8]> {
    let members = axes.len() + 1;
    let emulator = scene.emulator(Pace::Lockstep).with(&format!("--members {members}")).start();
    let launch = |axis: &&str| scene.axis_controller(Pace::Lockstep, axis).with(options).start();
    let controllers: Vec<_> = axes.iter().map(launch).collect();
    let client = scene.peer();
    let mut answers = Vec::new();
    let mut spoken = 0;
    client.take_part("client", |peer, cycle, frames| {
        answers.extend(frames.iter().filter_map(xcp_packet));
        let xcp_packet = script(&answers);
        if cycle >= START && cycle.is_multiple_of(4) && spoken < xcp_packet.len() {
            peer.send(&command(&xcp_packet[spoken]).to_bytes());
            spoken += 1;
        }
    });
    emulator.wait().expect_code(0);
    for controller in controllers {
        controller.wait().expect_code(0);
    }
    answers
}

fn set_address(address: u32) -> Vec<u8> {
    [&[0xF6, 0, 0, 0][..], &address.to_le_bytes()].concat()
}

/// Connects and unlocks; the key is made of the seed that was answered.
fn unlock(answers: &[[u8; 8]]) -> Vec<Vec<u8>> {
    let mut xcp_packet = vec![vec![0xFF, 0], vec![0xF8, 0, 1], vec![0xF8, 1, 0]];
    if let [_, first, second, ..] = answers {
        let seed = [&first[2..8], &second[2..4]].concat().try_into().expect("8 bytes");
        let key = xcp::lock::key(&SECRET, seed);
        xcp_packet.push([&[0xF7, 8], &key[..6]].concat());
        xcp_packet.push([&[0xF7, 2], &key[6..]].concat());
    }
    xcp_packet
}

fn write_gain(answers: &[[u8; 8]]) -> Vec<Vec<u8>> {
    let mut xcp_packet = unlock(answers);
    if xcp_packet.len() == 5 {
        let value = 20.0_f64.to_le_bytes();
        xcp_packet.push(set_address(GAIN));
        xcp_packet.push([&[0xF0, 6], &value[..6]].concat());
        xcp_packet.push([&[0xF0, 2], &value[6..]].concat());
    }
    xcp_packet
}

/// Measures the position with time stamps, and reads a parameter.
fn measure(_: &[[u8; 8]]) -> Vec<Vec<u8>> {
    vec![
        vec![0xFF, 0],
        vec![0xD6],
        vec![0xD5, 0, 1, 0],
        vec![0xD4, 0, 0, 0, 1],
        vec![0xD3, 0, 0, 0, 0, 1],
        vec![0xE2, 0, 0, 0, 0, 0],
        vec![0xE1, 0xFF, 4, 0, 4 * 5, 0, 0, 0x30],
        vec![0xE0, 0x10, 0, 0, 0, 0, 1, 0],
        vec![0xDE, 1, 0, 0],
        set_address(GAIN),
        vec![0xF5, 7],
    ]
}

fn bytes(scene: &Scene, file: &str) -> Vec<u8> {
    std::fs::read(scene.path(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

#[test]
fn a_value_that_is_written_acts_from_the_next_cycle_on_and_the_session_is_the_same_every_time() {
    let logs = [&["both"][..], &["both"], &["drive", "load"]].map(|axes| {
        let scene = Scene::new(SHORT);
        let answers = run(&scene, &format!("--xcp {}", config(&scene).display()), axes, &write_gain);
        assert_eq!(answers.len(), 8, "{answers:02X?}");
        assert!(answers.iter().all(|answer| answer[0] == 0xFF), "{answers:02X?}");
        let drive = scene.axis_table("drive");
        let [wanted, set, is, speed] =
            ["wanted_velocity_m_per_s", "set_position_m", "position_m", "set_velocity_m_per_s"]
                .map(|name| drive.numbers(name));
        // The eighth command leaves 28 cycles after the first and is heard in the next, whose answer is made before it is
        // looked at.
        let gain = |row: usize| (wanted[row] - speed[row]) / (set[row] - is[row]);
        let rows = (1..set.len()).filter(|row| (set[*row] - is[*row]).abs() > 1e-4);
        let (before, after): (Vec<_>, Vec<_>) =
            rows.partition(|row| drive.cycles()[*row] <= START as usize + 29);
        assert!(before.len() > 20 && after.len() > 20, "{} and {}", before.len(), after.len());
        for (rows, expected) in [(before, 40.0), (after, 20.0)] {
            let wrong = rows.iter().find(|row| (gain(**row) - expected).abs() > 1e-6 * expected);
            assert_eq!(wrong, None, "a gain of {expected} /s");
        }
        let report =
            if axes.len() == 1 { "controller/controller.json" } else { "controller/controller-drive.json" };
        let axis = &json(&scene.path(report))["axes"]["drive"];
        assert_eq!(axis["variables"]["algorithm.gain_per_s"], 20.0);
        assert_eq!((count(&axis["xcp"], "/changed"), count(&axis["xcp"], "/unlocked")), (1, 1));
        bytes(&scene, "emulator/bus.log")
    });
    assert!(logs[0] == logs[1], "two runs");
    assert!(logs[0] == logs[2], "one process and two");
}

#[test]
fn measuring_leaves_the_run_as_it_is() {
    let [alone, measured] = ["", "--xcp"].map(|options| {
        let scene = Scene::new(SHORT);
        let answers = run(&scene, options, &["both"], &measure);
        if options.is_empty() {
            assert!(answers.is_empty(), "off unless told: {answers:02X?}");
            assert!(scene.report()["axes"]["drive"].get("xcp").is_none());
        } else {
            let (measured, answered): (Vec<_>, Vec<_>) =
                answers.into_iter().partition(|answer| answer[0] < 0xFC);
            assert_eq!(answered.len(), 11);
            assert_eq!(answered[10][1..], 40.0_f64.to_le_bytes()[..7]);
            expect_measured(&scene, &measured);
        }
        ["emulator/measurement.csv", "emulator/truth.csv", "controller/controller-drive.csv"]
            .map(|file| bytes(&scene, file))
    });
    assert!(alone == measured, "measurement, truth and the controller's table are the same to the byte");
}

/// One packet for each cycle after the start, with the low bits of its number and the position of its row.
#[track_caller]
fn expect_measured(scene: &Scene, packets: &[[u8; 8]]) {
    let drive = scene.axis_table("drive");
    let positions = drive.numbers("position_m");
    assert!(packets.len() > 1000, "{} packets", packets.len());
    let first = usize::from(u16::from_le_bytes([packets[0][1], packets[0][2]]));
    let row = drive.cycles().iter().position(|cycle| *cycle == first).expect("it was recorded");
    for (packet, place) in packets.iter().zip(0..) {
        let [number, low, high, a, b, c, d, _] = *packet;
        assert_eq!((number, usize::from(u16::from_le_bytes([low, high]))), (0, first + place), "no gap");
        assert_eq!(
            f32::from_le_bytes([a, b, c, d]),
            positions[row + place] as f32,
            "cycle {}",
            first + place
        );
    }
}

#[test]
fn without_a_key_in_the_configuration_nothing_is_ever_unlocked() {
    let scene = Scene::new(SHORT);
    let write = |_: &[[u8; 8]]| {
        vec![
            vec![0xFF, 0],
            vec![0xF8, 0, 1],
            vec![0xF7, 6, 1, 2, 3, 4, 5, 6],
            set_address(GAIN),
            vec![0xF0, 6, 0, 0, 0, 0, 0, 0],
        ]
    };
    let answers = run(&scene, "--xcp", &["both"], &write);
    let heads: Vec<_> = answers.iter().map(|answer| [answer[0], answer[1]]).collect();
    assert_eq!(heads[1..], [[0xFE, 0x24], [0xFE, 0x29], [0xFF, 0], [0xFE, 0x25]]);
    assert_eq!(scene.report()["axes"]["drive"]["variables"]["algorithm.gain_per_s"], 40.0);
}

#[test]
fn a_flood_of_commands_is_dropped_and_counted_and_the_valve_is_served() {
    let scene = Scene::new(SHORT);
    let (emulator, controller) = scene.start(Pace::Lockstep, "--members 2", "--xcp");
    let client = scene.peer();
    let (mut sent, mut received) = (0, 0);
    client.take_part("client", |peer, cycle, frames| {
        received += frames.iter().filter(|frame| xcp_packet(frame).is_some()).count();
        if cycle < 1000 {
            (0..20).for_each(|_| peer.send(&command(&[0xFF, 0]).to_bytes()));
            // Of another length than rig.dbc has it, as a client without padding sends it.
            peer.send(&CanFrame::new(0x1E0, &[0xFD]).to_bytes());
            sent += 21;
        }
    });
    both_good(emulator, controller);
    let report = scene.report();
    let xcp = &report["axes"]["drive"]["xcp"];
    let (answered, dropped) = (count(xcp, "/answered"), count(xcp, "/commands_dropped"));
    assert_eq!(answered + dropped, sent, "each is answered or counted: {xcp}");
    assert!(answered as usize >= received && received > 7000 && dropped > 10_000, "{received} heard: {xcp}");
    // What the flood leaves of the run: everything.
    let summary = scene.summary();
    assert_eq!((count(&summary, "/stale_commands"), count(&summary, "/frames_lost")), (0, 0));
}

#[test]
fn a_parameter_set_is_printed_loaded_and_refused_with_its_line() {
    let scene = Scene::new(SHORT);
    scene.write("program.toml", &PROGRAM.replace("gain_per_s = 40.0", "gain_per_s = 33.5"));
    let printed = system_tests::xcp::print_with(&scene, "parameters", &[]);
    assert!(printed.contains("[drive.algorithm]\n") && printed.contains("gain_per_s = 33.5 "), "{printed}");
    let set = scene.write("set.toml", &printed);
    // Another program with the same variables takes the numbers of the set.
    scene.write("program.toml", PROGRAM);
    let options = format!("--parameters {}", set.display());
    scene.rehearsal().with(&options).start().wait().expect_code(0);
    let gain = |scene: &Scene| {
        scene.report()["axes"]["drive"]["variables"]["algorithm.gain_per_s"].as_f64().expect("a number")
    };
    assert_eq!(gain(&scene), 33.5);
    // What is set on the command line goes before it.
    let both = format!("{options} --set drive.algorithm.gain_per_s=31");
    scene.rehearsal().with(&both).start().wait().expect_code(0);
    assert_eq!(gain(&scene), 31.0);
    let line = 1 + printed.lines().position(|line| line.starts_with("gain_per_s")).expect("it is there");
    for (from, to, words) in [
        ("gain_per_s = 33.5", "gain_per_s = 333.5", ["drive.gain_per_s = 333.5", "0 to 200"]),
        (
            "gain_per_s = 33.5",
            "gain = 33.5",
            ["drive.algorithm.gain: no such variable", "algorithm.gain_per_s"],
        ),
        (
            "gain_per_s = 33.5",
            "gain_per_s = \"33\"",
            ["drive.algorithm.gain_per_s = \"33\"", "a finite number"],
        ),
    ] {
        assert!(printed.contains(from));
        let _ = scene.write("set.toml", &printed.replacen(from, to, 1));
        let place = format!("set.toml:{line}:");
        let ended = scene.rehearsal().with(&options).start().wait().expect_code(2);
        ended.expect_stderr(&words).expect_stderr(&[&place]);
    }
}

#[test]
fn the_a2l_file_can_be_had_without_a_run_and_is_that_of_the_run() {
    let scene = Scene::new(SHORT);
    run_both(&scene.emulator(Pace::Lockstep), &scene.controller(Pace::Lockstep).with("--xcp"));
    for axis in ["drive", "load"] {
        let printed = system_tests::xcp::print_with(&scene, "a2l", &["--axis", axis]);
        let written = bytes(&scene, &format!("controller/controller-{axis}.a2l"));
        assert_eq!(printed.trim_end(), String::from_utf8(written).expect("text").trim_end(), "{axis}");
    }
}

#[test]
fn a_configuration_that_cannot_be_used_is_refused_before_anything_moves() {
    let scene = Scene::new(SHORT);
    for (text, words) in [("key = \"c0ffee\"\n", "16 to 64 bytes"), ("daq_packets_per_cycle = 9\n", "1 to 4")]
    {
        let config = scene.write("bad.toml", text);
        let launch = scene.controller(Pace::Real).with(&format!("--xcp {}", config.display()));
        launch.start().wait().expect_code(2).expect_stderr(&["bad.toml", words]);
    }
    scene.controller(Pace::Real).with("--xcp nowhere.toml").start().wait().expect_code(2);
}
