//! The gateway as a process, and a client of the socketcand protocol that does exactly what it is asked.

use crate::binaries::Program;
use crate::process::{PATIENCE, Running, wait_until};
use crate::records::json;
use crate::scene::Scene;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::time::Duration;

/// A gateway on the bus of a scene, at a free port of loopback.
pub struct GatewayProcess {
    running: Running,
    report: PathBuf,
    pub address: SocketAddr,
}

impl GatewayProcess {
    /// Opens it; `options` are separated by spaces.
    pub fn open(scene: &Scene, options: &str) -> Self {
        let report = scene.path("gateway.json");
        let mut command = Program::Bench.command();
        command.args(["gateway", "--listen", "127.0.0.1:0", "--bus", &scene.url(), "--report"]).arg(&report);
        let mut running = Running::start("bench gateway", command.args(options.split_whitespace()));
        running.wait_for("Ctrl-C ends it");
        let output = running.stderr();
        let address = output.split(" at ").nth(1).and_then(|rest| rest.split(' ').next());
        let address = address.and_then(|address| address.parse().ok());
        Self { running, report, address: address.unwrap_or_else(|| panic!("no address in: {output}")) }
    }

    /// Waits until it has said this so many times.
    pub fn wait_for_times(&mut self, text: &str, times: usize) {
        self.running.wait_for_times(text, times);
    }

    /// The most memory that it ever had, KiB, as the kernel reports it.
    pub fn peak_memory_kib(&self) -> u64 {
        let path = format!("/proc/{}/status", self.running.number());
        let status = std::fs::read_to_string(path).expect("the gateway runs");
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let number = peak.and_then(|rest| rest.split_whitespace().next());
        number.and_then(|number| number.parse().ok()).expect("VmHWM in kB")
    }

    pub fn close(self) -> Value {
        self.running.interrupt();
        json(&self.report)
    }

    /// Arguments with which python-can's programs reach it, after all others.
    pub fn python_can(&self) -> [String; 5] {
        let (host, port) = (format!("host={}", self.address.ip()), format!("port={}", self.address.port()));
        ["-isocketcand".into(), "-cbus".into(), "--bus-kwargs".into(), host, port]
    }
}

pub struct GatewayClient {
    pub stream: TcpStream,
    text: String,
}

impl GatewayClient {
    pub fn connect(gateway: &GatewayProcess) -> Self {
        let stream = TcpStream::connect(gateway.address).expect("the gateway listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        Self { stream, text: String::new() }
    }

    /// Connects, as soon as there is room, and goes to raw mode.
    pub fn connect_raw(gateway: &GatewayProcess) -> Self {
        let mut client = Self::connect(gateway);
        wait_until("a place at the gateway", || {
            let let_in = client.receive().as_deref() == Some("< hi >");
            if !let_in {
                client = Self::connect(gateway);
            }
            let_in
        });
        client.send("< open bus >");
        client.expect("< ok >");
        client.send("< rawmode >");
        client.expect("< ok >");
        client
    }

    pub fn send(&mut self, text: &str) {
        self.stream.write_all(text.as_bytes()).expect("the gateway takes it");
    }

    /// The next `< … >`; `None` at the end of the connection.
    pub fn receive(&mut self) -> Option<String> {
        loop {
            if let Some(end) = self.text.find('>') {
                let rest = self.text.split_off(end + 1);
                return Some(std::mem::replace(&mut self.text, rest));
            }
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes) {
                Ok(0) => return None,
                Ok(read) => self.text.push_str(std::str::from_utf8(&bytes[..read]).expect("ASCII")),
                Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => return None,
                Err(error) => panic!("nothing comes from the gateway: {error}"),
            }
        }
    }

    /// Reads the next `< … >` and holds it against what must come.
    #[track_caller]
    pub fn expect(&mut self, text: &str) {
        assert_eq!(self.receive().as_deref(), Some(text));
    }

    /// The next frame: identifier and data, without its time.
    pub fn frame(&mut self) -> (String, String) {
        let text = self.receive().expect("a frame");
        let words: Vec<_> = text.split(' ').collect();
        assert!(words[..2] == ["<", "frame"] && words[words.len() - 1] == ">", "{text}");
        (words[2].into(), words[4].into())
    }

    /// Whether the gateway ends the connection, whatever it says before.
    pub fn is_disconnected(&mut self) -> bool {
        self.stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
        let mut bytes = [0; 4096];
        loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => return true,
                Ok(_) => {}
                Err(error) => return error.kind() == std::io::ErrorKind::ConnectionReset,
            }
        }
    }
}
