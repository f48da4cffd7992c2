//! A folder of its own for each test, with everything that a run needs and everything that it leaves.

use crate::axis_table::AxisTable;
use crate::binaries::{Program, workspace};
use crate::launch::{Launch, Pace};
use crate::peer::Peer;
use crate::process::{Running, wait_until};
use crate::records::{self, Table, json};
use protocol::can::CanFrame;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// An experiment of some 1.6 s: initial positioning 0.5 s, settling, 0.05 m in 0.4 s, a rest, settling, done.
pub const SHORT: &str = include_str!("../scenes/short.toml");

/// To and fro without a rest, for `--repeat`: after the first half second the valve is hardly ever shut.
pub const RESTLESS: &str = include_str!("../scenes/restless.toml");

/// The drive's program of both, which each scene holds as program.toml.
pub const PROGRAM: &str = include_str!("../scenes/programs/stiff.toml");

/// Linked axes, the load pressing: some 4 s of preparing, a ramp, 0.05 m in 0.4 s, and a step of the force while it moves.
pub const LINKED: &str = include_str!("../scenes/linked.toml");

/// The drive's program of the linked experiment, which each scene holds as linked-program.toml: the shipped one of its time.
const LINKED_PROGRAM: &str = include_str!("../scenes/programs/damped.toml");

/// The load's program of the linked experiment, which each scene holds as load-program.toml: the same.
const LOAD_PROGRAM: &str = include_str!("../scenes/programs/presses.toml");

pub struct Scene {
    folder: TempDir,
}

impl Scene {
    /// A folder with the shipped rig file, this experiment and the programs that it names.
    pub fn new(experiment: &str) -> Self {
        // Short, since the path of a socket holds 107 bytes.
        let folder = tempfile::Builder::new().prefix("airbench-").tempdir().expect("a temporary folder");
        let scene = Self { folder };
        std::fs::copy(workspace().join("plant/rig.toml"), scene.path("rig.toml"))
            .expect("plant/rig.toml is there");
        scene.write("experiment.toml", experiment);
        scene.write("program.toml", PROGRAM);
        scene.write("linked-program.toml", LINKED_PROGRAM);
        scene.write("load-program.toml", LOAD_PROGRAM);
        scene
    }

    /// The short experiment, its bus in a process of its own, and a peer on it.
    pub fn with_bus() -> (Self, Running, Peer) {
        let scene = Self::new(SHORT);
        let host = scene.bus_host("");
        let peer = scene.peer();
        (scene, host, peer)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).expect("the temporary folder can be written");
        path
    }

    /// The shipped rig file with one text replaced, under another name.
    pub fn rig_with(&self, name: &str, from: &str, to: &str) -> PathBuf {
        let rig = std::fs::read_to_string(self.path("rig.toml")).expect("the rig file is there");
        assert!(rig.contains(from), "'{from}' is not in the rig file");
        self.write(name, &rig.replacen(from, to, 1))
    }

    pub fn socket(&self) -> PathBuf {
        self.path("bus")
    }

    pub fn url(&self) -> String {
        format!("unix://{}", self.socket().display())
    }

    /// The emulator on the scene's bus, writing to the folder `emulator`.
    pub fn emulator(&self, pace: Pace) -> Launch {
        Launch::new(Program::Emulator, self, Some(pace))
    }

    /// The controller on the scene's bus, writing to the folder `controller`.
    pub fn controller(&self, pace: Pace) -> Launch {
        Launch::new(Program::Controller, self, Some(pace))
    }

    /// The controller of one axis alone, writing to the folder `controller` too: its files have names of their own.
    pub fn axis_controller(&self, pace: Pace, axis: &str) -> Launch {
        self.controller(pace).with(&format!("--axis {axis}"))
    }

    /// A rehearsal, writing to the folder `controller`.
    pub fn rehearsal(&self) -> Launch {
        Launch::new(Program::Controller, self, None)
    }

    /// A bus of its own process; `options` follow the URL's question mark. It serves when this returns.
    pub fn bus_host(&self, options: &str) -> Running {
        let mut host = self.start_bus_host(options);
        host.wait_for("hosting");
        host
    }

    /// A bus of its own process, which may not get as far as serving.
    pub fn start_bus_host(&self, options: &str) -> Running {
        let url = if options.is_empty() { self.url() } else { format!("{}?{options}", self.url()) };
        Program::Emulator.start(&[&"bus", &"--bus", &url])
    }

    /// A peer on the scene's bus, waiting for its host if need be.
    pub fn peer(&self) -> Peer {
        Peer::connect(&self.socket())
    }

    /// Emulator and controller, each with further options.
    pub fn start(&self, pace: Pace, emulator: &str, controller: &str) -> (Running, Running) {
        (self.emulator(pace).with(emulator).start(), self.controller(pace).with(controller).start())
    }

    /// Emulator and controller, whose experiment repeats, once the emulator has recorded so many rows.
    pub fn under_way(&self, pace: Pace, rows: usize) -> (Running, Running) {
        let both = self.start(pace, "", "--repeat");
        self.wait_for_rows("emulator", rows);
        both
    }

    /// Waits until so many peers are connected to the scene's bus, as the kernel's list of sockets shows.
    pub fn wait_for_peers(&self, count: usize) {
        let socket = self.socket().display().to_string();
        let connected = || {
            let list = std::fs::read_to_string("/proc/net/unix").unwrap_or_default();
            // Number, references, protocol, flags, type, state (03: connected), inode, path.
            let peers = list.lines().filter(|line| line.ends_with(&socket));
            peers.filter(|line| line.split_whitespace().nth(5) == Some("03")).count()
        };
        wait_until(&format!("{count} peers on {socket}"), || connected() >= count);
    }

    /// Waits until measurement.csv of the emulator's folder holds so many lines: the run is under way, and recorded.
    pub fn wait_for_rows(&self, folder: &str, least: usize) {
        let path = self.path(folder).join("measurement.csv");
        wait_until(&format!("{least} rows in {}", path.display()), || rows(&path) >= least);
    }

    /// Waits until the emulator has recorded so many more rows than now: it still runs, and goes on.
    pub fn wait_for_more_rows(&self, folder: &str, more: usize) {
        self.wait_for_rows(folder, rows(&self.path(folder).join("measurement.csv")) + more);
    }

    /// summary.json of the emulator's folder; below, the other files that a run leaves where nothing else is said.
    pub fn summary(&self) -> Value {
        json(&self.path("emulator/summary.json"))
    }

    pub fn run_description(&self) -> Value {
        json(&self.path("emulator/run.json"))
    }

    /// With a row for each cycle.
    pub fn measurement(&self) -> Table {
        let table = Table::read(&self.path("emulator/measurement.csv"));
        table.expect_no_hole();
        table
    }

    pub fn truth(&self) -> Table {
        Table::read(&self.path("emulator/truth.csv"))
    }

    pub fn bus_log(&self) -> Vec<CanFrame> {
        records::bus_log(&self.path("emulator/bus.log"))
    }

    /// controller.json of the controller's folder.
    pub fn report(&self) -> Value {
        json(&self.path("controller/controller.json"))
    }

    /// The table of an axis in the controller's folder.
    pub fn axis_table(&self, axis: &str) -> AxisTable {
        AxisTable::read(&self.path("controller").join(format!("controller-{axis}.csv")))
    }
}

/// Lines of a file; none of one that cannot be read.
fn rows(path: &Path) -> usize {
    std::fs::read(path).map_or(0, |bytes| memchr::memchr_iter(b'\n', &bytes).count())
}
