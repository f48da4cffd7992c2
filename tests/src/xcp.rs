//! Clients of the controllers' XCP: one of our own, packet by packet over a [`Peer`], and the foreign one in Python.

use crate::binaries::{Program, workspace};
use crate::foreign_python::{light_path, python};
use crate::peer::{Packet, Peer};
use crate::process::{CompletedProcess, PATIENCE, Running};
use crate::records::json;
use crate::scene::Scene;
use protocol::can::CanFrame;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use xcp::lock;

/// Secret of the write protection, as it stands in [`config`]'s file and in the Python client.
pub const SECRET: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Writes the configuration of XCP with the secret, and room for two DAQ packets a cycle.
pub fn config(scene: &Scene) -> PathBuf {
    let hex: String = SECRET.iter().map(|byte| format!("{byte:02x}")).collect();
    scene.write("xcp.toml", &format!("key = \"{hex}\"\ndaq_packets_per_cycle = 2\n"))
}

/// A command to the drive's controller, padded as `rig.dbc` has it.
pub fn command(packet: &[u8]) -> CanFrame {
    let mut bytes = [0; 8];
    bytes[..packet.len()].copy_from_slice(packet);
    CanFrame::new(0x1E0, &bytes)
}

/// XCP packet of the drive's controller in a frame, if it is one.
pub fn xcp_packet(frame: &CanFrame) -> Option<[u8; 8]> {
    (frame.standard_id() == Some(0x1E1)).then(|| frame.data().try_into().expect("padded to 8 bytes"))
}

/// A client of the drive's controller in real time.
pub struct XcpClient<'a>(pub &'a Peer);

impl XcpClient<'_> {
    /// Sends a command and waits for its answer, whatever else arrives meanwhile.
    pub fn request(&self, packet: &[u8]) -> [u8; 8] {
        self.0.send(&command(packet).to_bytes());
        loop {
            match self.0.receive(PATIENCE) {
                Some(Packet::Frame(frame)) => match xcp_packet(&frame) {
                    Some(answer) if answer[0] >= 0xFE => return answer,
                    _ => {}
                },
                other => panic!("no answer to {packet:02X?} but {other:?}"),
            }
        }
    }

    /// Sends a command that must be answered positively.
    #[track_caller]
    pub fn request_ok(&self, packet: &[u8]) -> [u8; 7] {
        let [first, rest @ ..] = self.request(packet);
        assert_eq!(first, 0xFF, "{packet:02X?} is refused: {rest:02X?}");
        rest
    }

    pub fn unlock(&self) {
        self.request_ok(&[0xFF, 0]);
        let first = self.request_ok(&[0xF8, 0, 1]);
        let second = self.request_ok(&[0xF8, 1, 0]);
        let seed = [&first[1..7], &second[1..3]].concat().try_into().expect("8 bytes");
        let [a, b, c, d, e, f, g, h] = lock::key(&SECRET, seed);
        self.request_ok(&[0xF7, 8, a, b, c, d, e, f]);
        self.request_ok(&[0xF7, 2, g, h]);
    }

    pub fn set_address(&self, address: u32) {
        let [a, b, c, d] = address.to_le_bytes();
        self.request_ok(&[0xF6, 0, 0, 0, a, b, c, d]);
    }

    pub fn write(&self, address: u32, value: f64) {
        let [a, b, c, d, e, f, g, h] = value.to_le_bytes();
        self.set_address(address);
        self.request_ok(&[0xF0, 6, a, b, c, d, e, f]);
        self.request_ok(&[0xF0, 2, g, h]);
    }
}

pub struct PyXcpClient {
    running: Running,
    results: PathBuf,
}

impl PyXcpClient {
    /// Starts a scenario of `tests/python/xcp_client.py` at the controller of `axis`, whose files are in `folder`. A `member`
    /// takes part in the lockstep barrier.
    pub fn start(scene: &Scene, scenario: &str, folder: &str, axis: &str, member: bool) -> Self {
        let scripts = workspace().join("tests/python");
        let results = scene.path(&format!("results-{axis}.json"));
        let mut command = Command::new(python());
        command.env("PYTHONPATH", light_path()).arg(scripts.join("xcp_client.py"));
        command.arg(scenario).arg(scene.socket()).arg(scene.path(folder)).arg(axis).arg(&results);
        if member {
            command.arg(format!("client-{axis}"));
        }
        Self { running: Running::start("pyXCP", &mut command), results }
    }

    /// The results that it wrote, once it has ended.
    pub fn wait(self) -> Value {
        let CompletedProcess { code, stderr, stdout, .. } = self.running.wait_within(PATIENCE);
        assert_eq!(code, Some(0), "pyXCP failed:\n{stdout}\n{stderr}");
        json(&self.results)
    }
}

/// Waits until the controller has written the A2L file of an axis: then its bus is about to open.
pub fn wait_for_a2l(scene: &Scene, folder: &str, axis: &str) {
    let path: &Path = &scene.path(folder).join(format!("controller-{axis}.a2l"));
    crate::process::wait_until("the A2L file", || path.exists());
}

/// What the controller prints for the scene's files under a command such as `parameters`.
pub fn print_with(scene: &Scene, command: &str, options: &[&str]) -> String {
    let mut program = Program::Controller.command();
    program.arg(command).arg("--rig").arg(scene.path("rig.toml"));
    program.arg("--experiment").arg(scene.path("experiment.toml")).args(options);
    Running::start("controller", &mut program).wait().expect_code(0).stdout
}
