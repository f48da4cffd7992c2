//! Runs in lockstep with a script of faults, and their files: the rig with one member that commands given openings and records
//! the frames that it receives.

use crate::launch::Pace;
use crate::records::{Table, text};
use crate::scene::Scene;
use protocol::can::CanFrame;
use protocol::frames::{Frame, RigStatus, ValveCommand};
use serde_json::Value;
use std::path::Path;

#[derive(Clone, Copy)]
pub struct FaultRunPlan<'a> {
    /// `[rig]` of the experiment, with what follows it.
    pub rig: &'a str,
    pub faults: &'a str,
    /// Options of the bus's URL.
    pub bus: &'a str,
    pub cycles: usize,
    /// Openings of drive and load that are commanded in answer to a cycle; `None` says nothing.
    pub act: fn(u32) -> Option<[f64; 2]>,
}

impl Default for FaultRunPlan<'_> {
    fn default() -> Self {
        let act = |_| Some([0.0, 0.0]);
        Self { rig: "carriage_position_m = 0.25\n", faults: "", bus: "", cycles: 400, act }
    }
}

/// Files of a run, and the frames that its member received.
pub struct FaultRun {
    pub scene: Scene,
    pub measurement: Table,
    pub truth: Table,
    pub summary: Value,
    /// `bus.log`, as the rig had it.
    pub log: Vec<CanFrame>,
    /// What the member heard in each cycle.
    pub received: Vec<Vec<CanFrame>>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Row {
    pub cycle: usize,
    pub number: u16,
    /// `begins`, `ends`, …
    pub what: String,
    pub fault: String,
    pub at: String,
    /// Its numbers, as `key=value;key=value`.
    pub numbers: String,
    /// Who asked for it.
    pub cause: String,
}

pub fn rows(path: &Path) -> Vec<Row> {
    let text = text(path);
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,number,what,fault,at,numbers,cause"), "head of {}", path.display());
    let row = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [time_s, number, what, fault, at, numbers, cause] => Row {
            cycle: (time_s.parse::<f64>().expect("a time") * 1000.0).round() as usize,
            number: number.parse().expect("a number"),
            what: what.into(),
            fault: fault.into(),
            at: at.into(),
            numbers: numbers.into(),
            cause: cause.into(),
        },
        _ => panic!("no row: {line}"),
    };
    lines.map(row).collect()
}

/// Cycles in which a [`fault`] begins and ends.
pub const BEGINS: usize = 200;
pub const ENDS: usize = 300;

/// A fault from 0.2 to 0.3 s, as a script has it.
pub fn fault(name: &str, at: &str, numbers: &str) -> String {
    let [from_s, to_s] = [BEGINS, ENDS].map(|cycle| cycle as f64 / 1000.0);
    format!("[[fault]]\nname = \"{name}\"\nat = \"{at}\"\nfrom_s = {from_s}\nto_s = {to_s}\n{numbers}\n")
}

impl FaultRunPlan<'_> {
    /// Makes the run and holds that it left its marks in every log.
    pub fn run_with_marks(&self) -> FaultRun {
        let outcome = self.run();
        outcome.expect_marks_in_every_log();
        outcome
    }

    pub fn run(&self) -> FaultRun {
        let scene = Scene::new(&format!("title = \"broken\"\n[rig]\n{}", self.rig));
        let mut emulator = scene.emulator(Pace::Lockstep).with("--seconds");
        emulator = emulator.with(&format!("{}", self.cycles as f64 * 1e-3));
        if !self.bus.is_empty() {
            emulator = emulator.bus(format!("{}?{}", scene.url(), self.bus));
        }
        if !self.faults.is_empty() {
            let script = scene.write("faults.toml", self.faults);
            emulator = emulator.with("--faults").with(&script.display().to_string());
        }
        let emulator = emulator.start();
        let mut received = Vec::new();
        let mut alive = 0;
        scene.peer().take_part("member", |peer, cycle, frames| {
            received.push(frames.to_vec());
            let Some(openings) = (self.act)(cycle) else { return };
            alive = (alive + 1) % 16;
            let echo = (cycle % 4096) as u16;
            let [drive, load] = openings.map(|opening| ValveCommand { opening, alive, echo, enable: true });
            for frame in [Frame::DriveValveCommand(drive), Frame::LoadValveCommand(load)] {
                peer.send_frame(&frame);
            }
        });
        emulator.wait().expect_code(0);
        let measurement = scene.measurement();
        assert_eq!(measurement.len(), self.cycles);
        FaultRun {
            measurement,
            truth: scene.truth(),
            summary: scene.summary(),
            log: scene.bus_log(),
            received,
            scene,
        }
    }
}

impl FaultRun {
    pub fn rows(&self) -> Vec<Row> {
        rows(&self.scene.path("emulator/faults.csv"))
    }

    /// Holds that every log reports the same faults: table, summary, frames of the bench, and the count beside the truth.
    pub fn expect_marks_in_every_log(&self) {
        let rows = self.rows();
        assert!(!rows.is_empty(), "a script without a mark");
        let events = self.summary["events"].as_array().expect("events").iter();
        let events: Vec<_> = events
            .filter_map(|event| Some((event["cycle"].as_u64()? as usize, event["kind"].get("fault")?)))
            .map(|(cycle, mark)| {
                let text = |key: &str| mark[key].as_str().unwrap_or_default().to_owned();
                (cycle, mark["number"].as_u64().unwrap_or(0) as u16, text("what"), text("fault"), text("at"))
            })
            .collect();
        let reported: Vec<_> = rows
            .iter()
            .map(|row| (row.cycle, row.number, row.what.clone(), row.fault.clone(), row.at.clone()))
            .collect();
        assert_eq!(events, reported, "summary.json and faults.csv");
        // Frames of one cycle keep their order; those that were lost on the way stand in the rig's own log all the same.
        let mut sent: Vec<_> = self
            .log
            .iter()
            .filter_map(|frame| match Frame::decode(frame) {
                Ok(Frame::FaultMark(mark)) => Some((mark.fault, mark.active)),
                _ => None,
            })
            .collect();
        let mut expected: Vec<_> = rows
            .iter()
            .filter(|row| row.what == "begins" || row.what == "ends")
            .map(|row| (row.number, row.what == "begins"))
            .collect();
        sent.sort_unstable();
        expected.sort_unstable();
        assert_eq!(sent, expected, "frames of the bench in bus.log");
        let active = self.truth.column("faults_active");
        let once = ["mechanical-unlink"];
        for (cycle, count) in active.iter().enumerate() {
            let before = |what: &str| {
                rows.iter()
                    .filter(|row| {
                        row.what == what && row.cycle <= cycle && !once.contains(&row.fault.as_str())
                    })
                    .count()
            };
            assert_eq!(*count as usize, before("begins") - before("ends"), "faults_active in cycle {cycle}");
        }
    }

    /// What the rig said of itself.
    pub fn statuses(&self) -> impl Iterator<Item = RigStatus> {
        self.log.iter().filter_map(|frame| match Frame::decode(frame) {
            Ok(Frame::RigStatus(status)) => Some(status),
            _ => None,
        })
    }

    /// Frames of an identifier that the member heard, by the cycle.
    pub fn received_of(&self, id: u16) -> Vec<Vec<CanFrame>> {
        let of_id = |frames: &Vec<CanFrame>| {
            frames.iter().filter(|frame| frame.standard_id() == Some(id)).copied().collect()
        };
        self.received.iter().map(of_id).collect()
    }
}
