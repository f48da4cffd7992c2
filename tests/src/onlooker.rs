//! Observers of a run: a viewer of the telemetry, and the live page as a program reads it.

use crate::binaries::Program;
use crate::process::{PATIENCE, Running, wait_until};
use crate::scene::Scene;
use runlog::telemetry::{Decoder, Packet};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::Path;

pub struct Viewer {
    stream: UnixStream,
    decoder: Decoder,
}

/// A cycle of the telemetry: its number, and a value for each column.
pub type TelemetryCycle = (u64, Vec<f64>);

#[derive(Debug, Default)]
pub struct ReceivedTelemetry {
    pub description: Value,
    pub cycles: Vec<TelemetryCycle>,
    pub events: Vec<Value>,
    /// Lines of the interval log.
    pub histograms: Vec<String>,
    pub lost: u64,
}

impl Viewer {
    /// Connects as soon as an emulator listens.
    pub fn connect(path: &Path) -> Self {
        let mut stream = None;
        wait_until(&format!("telemetry at {}", path.display()), || {
            stream = UnixStream::connect(path).ok();
            stream.is_some()
        });
        let stream = stream.expect("it was waited for");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        Self { stream, decoder: Decoder::default() }
    }

    /// The next packet; `None` at the end of the run.
    pub fn packet(&mut self) -> Option<Packet> {
        let mut bytes = [0; 65536];
        loop {
            if let Some(packet) = self.decoder.packet().expect("telemetry") {
                return Some(packet);
            }
            match self.stream.read(&mut bytes) {
                Ok(0) => return None,
                Ok(read) => self.decoder.take(&bytes[..read]),
                // An emulator that ends while lines of ours are unread resets the connection.
                Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => return None,
                Err(error) => panic!("nothing comes from the emulator: {error}"),
            }
        }
    }

    /// Sends a line, and gives the answer to it.
    pub fn request(&mut self, line: &str) -> Value {
        writeln!(self.stream, "{line}").expect("the emulator listens");
        loop {
            if let Packet::Answer(text) = self.packet().expect("the run goes on") {
                return serde_json::from_str(&text).expect("JSON");
            }
        }
    }

    pub fn to_the_end(mut self) -> ReceivedTelemetry {
        let mut reported = ReceivedTelemetry::default();
        let json = |text: &str| serde_json::from_str(text).expect("JSON");
        while let Some(packet) = self.packet() {
            match packet {
                Packet::Description(text) => reported.description = json(&text),
                Packet::Cycle(cycle, values) => reported.cycles.push((cycle, values)),
                Packet::Event(text) => reported.events.push(json(&text)),
                Packet::Histogram(line) => reported.histograms.push(line),
                Packet::Loss(lost) => reported.lost = lost,
                Packet::Answer(text) => panic!("nobody asked for {text}"),
            }
        }
        reported
    }
}

/// `bench watch` at a free port of loopback.
pub struct LivePage {
    pub running: Running,
    pub address: SocketAddr,
    /// What it printed for those who may act; empty without `--control`.
    pub token: String,
}

#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    /// Header fields, as they came.
    pub head: String,
    pub body: String,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.body))
    }
}

impl LivePage {
    /// Starts it beside a scene; `options` are separated by spaces.
    pub fn open(scene: &Scene, options: &str) -> Self {
        let mut command = Program::Bench.command();
        command.args(["watch", "--http", "127.0.0.1:0", "--bus", &scene.url(), "--telemetry"]);
        command.arg(scene.path("telemetry"));
        Self::announced_by(Running::start("bench watch", command.args(options.split_whitespace())))
    }

    /// The page of a program that is it, or starts it and ends with it.
    pub fn announced_by(mut running: Running) -> Self {
        running.wait_for("Ctrl-C ends it");
        let output = running.stderr();
        let address =
            output.split_whitespace().find_map(|word| word.strip_prefix("http://")).expect("an address");
        let (address, token) = address.split_once('/').expect("a path");
        let token = token.strip_prefix("#token=").unwrap_or_default().to_owned();
        Self { running, address: address.parse().expect("an address"), token }
    }

    pub fn send(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream.write_all(request.as_bytes()).expect("it listens");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("an answer");
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no answer: {text}"));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
        Answer { status, head: head.to_owned(), body: body.to_owned() }
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        stream
    }

    pub fn get(&self, path: &str) -> Answer {
        self.send(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address))
    }

    pub fn state(&self) -> Value {
        self.get("/api/state").json()
    }

    /// Gives an order with further header fields, each with its line end.
    pub fn order_with(&self, fields: &str, order: &Value) -> Answer {
        let body = order.to_string();
        self.send(&format!(
            "POST /api/control HTTP/1.1\r\nHost: {}\r\nContent-Length: {}\r\n{fields}\r\n{body}",
            self.address,
            body.len()
        ))
    }

    /// Gives an order as one who may.
    pub fn order(&self, order: &Value) -> Answer {
        self.order_with(&format!("X-Airbench-Token: {}\r\n", self.token), order)
    }

    /// A connection on which events come.
    pub fn listen(&self) -> TcpStream {
        let mut stream = self.connect();
        let request = format!("GET /api/events HTTP/1.1\r\nHost: {}\r\n\r\n", self.address);
        stream.write_all(request.as_bytes()).expect("it listens");
        stream
    }

    pub fn events(&self) -> Events {
        Events { lines: BufReader::new(self.listen()) }
    }

    pub fn close(self) {
        self.running.interrupt();
    }
}

pub struct Events {
    lines: BufReader<TcpStream>,
}

impl Events {
    /// The next event of this name that is so.
    pub fn wait_for(&mut self, name: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let mut current = String::new();
        loop {
            let mut line = String::new();
            assert!(self.lines.read_line(&mut line).expect("events") > 0, "the stream ended");
            if let Some(event) = line.trim_end().strip_prefix("event: ") {
                current = event.to_owned();
            } else if let Some(data) = line.trim_end().strip_prefix("data: ")
                && current == name
            {
                let data = serde_json::from_str(data).expect("JSON");
                if is_so(&data) {
                    return data;
                }
            }
        }
    }
}
