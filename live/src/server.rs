//! The loop over bus, telemetry and clients, the paths, and the requests to act.

use super::LiveError;
use super::assets;
use super::cli::WatchArguments;
use super::client::{Client, refusal, wait};
use super::control::{self, Order};
use super::feed::TelemetryClient;
use super::http::{self, HEARTBEAT, Request, Status, is_ours, json_response, message_response, response};
use super::metrics;
use super::view::{ServerStatus, View};
use super::wire::CONSOLE;
use crate::wall_clock_ns;
use crossbeam_channel::{Receiver, Sender, bounded};
use protocol::bus::{self, Bus, BusUrl, Received};
use protocol::frames::{EmergencyStop, Frame};
use protocol::periods::EMERGENCY_STOP_CYCLES;
use runlog::candump::FrameRecord;
use runlog::telemetry::{Answer, Packet};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Period of the polls of bus and telemetry, ms.
const TURN_MS: u64 = 10;
/// Most frames of the bus that are taken in one turn: more than a full bus carries in ten turns.
const FRAMES_A_TURN: usize = 4096;
/// Times between events of each kind, ms.
const ROWS_MS: u64 = 50;
const STATE_MS: u64 = 200;
const SECOND_MS: u64 = 1000;
const HEARTBEAT_MS: u64 = 5000;
/// Longest history of a response, s.
const LONGEST_HISTORY_S: f64 = 60.0;
/// Bytes of a token: enough against guessing.
const TOKEN_BYTES: usize = 16;
/// Interface name in saved logs of an unnamed bus.
const NAMELESS: &str = "bus0";

/// Number of the client that asked for a record, and the result.
type SaveResult = (u64, io::Result<String>);

/// The server with all its inputs and clients.
pub(super) struct Server {
    bus: Box<dyn Bus>,
    url: BusUrl,
    bus_was_up: bool,
    telemetry_client: Option<TelemetryClient>,
    view: View,
    listener: TcpListener,
    address: SocketAddr,
    clients: Vec<Client>,
    most_clients: usize,
    next_client: u64,
    /// Token of clients that may act; `None` without --control.
    token: Option<String>,
    save_to: Option<PathBuf>,
    saved: (Sender<SaveResult>, Receiver<SaveResult>),
    saving: bool,
    /// Numbers of the clients whose commands the emulator has not answered, in order.
    asked: VecDeque<u64>,
    /// When the console's stop is sent again, while it is held.
    stop_due_ms: Option<u64>,
    missed_by_gone: u64,
    began: Instant,
    due: DueTimes,
}

/// When the next events are due, ms.
#[derive(Default)]
struct DueTimes {
    turn: u64,
    rows: u64,
    state: u64,
    second: u64,
    heartbeat: u64,
}

impl Server {
    pub(super) fn open(arguments: &WatchArguments) -> Result<Self, LiveError> {
        let address = arguments.http;
        let refused = |reason: io::Error| LiveError::Listen { address, reason: reason.to_string() };
        let bus = bus::open(&arguments.bus, Box::new(wall_clock_ns))?;
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let token = arguments.control.then(draw_token).transpose().map_err(LiveError::System)?;
        Ok(Self {
            bus_was_up: bus.is_up(),
            bus,
            url: arguments.bus.clone(),
            telemetry_client: arguments.telemetry.clone().map(TelemetryClient::new),
            view: View::new(arguments.run.as_deref()),
            address: listener.local_addr().map_err(refused)?,
            listener,
            clients: Vec::new(),
            most_clients: usize::from(arguments.clients),
            next_client: 0,
            token,
            save_to: arguments.save.clone(),
            saved: bounded(1),
            saving: false,
            asked: VecDeque::new(),
            stop_due_ms: None,
            missed_by_gone: 0,
            began: Instant::now(),
            due: DueTimes::default(),
        })
    }

    pub(super) fn announce(&self) {
        let secret = self.token.as_ref().map_or_else(String::new, |token| format!("#token={token}"));
        eprintln!("bench watch: {} at http://{}/{secret} ; Ctrl-C ends it", self.url, self.address);
        if !self.address.ip().is_loopback() {
            let what = if self.token.is_some() { "and, with the token, move the rig" } else { "there" };
            eprintln!(
                "bench watch: warning: {} is not loopback: whoever reaches it sees the run {what}",
                self.address
            );
        }
        if !self.bus_was_up {
            eprintln!("bench watch: {} has no host yet; waiting for it", self.url);
        }
    }

    /// Waits for input until the next turn is due, and processes it.
    pub(super) fn turn(&mut self) -> io::Result<()> {
        let (readable, someone_waits) = self.wait()?;
        let now_ms = self.now_ms();
        if someone_waits {
            self.accept(now_ms);
        }
        for place in readable {
            if let Some(request) = self.clients[place].read(now_ms) {
                self.serve(place, &request, now_ms);
            }
        }
        if now_ms >= self.due.turn {
            self.due.turn = now_ms + TURN_MS;
            self.receive_input(now_ms);
            if self.stop_due_ms.is_some_and(|due_ms| now_ms >= due_ms) {
                // As `rig.dbc` requires while the stop is held; this reaches a rig that starts later too.
                let _ = self.send_stop(false, now_ms);
            }
            self.send_due_events(now_ms);
        }
        self.clients.iter_mut().for_each(|client| client.write(now_ms));
        let gone = self.clients.extract_if(.., |client| client.gone);
        self.missed_by_gone += gone.map(|client| client.missed).sum::<u64>();
        Ok(())
    }

    /// Indices of the readable clients, and whether a connection waits.
    fn wait(&self) -> io::Result<(Vec<usize>, bool)> {
        let left_ms = self.due.turn.saturating_sub(self.now_ms());
        let clients = self.clients.iter().map(|client| (&client.stream, client.has_something_to_write()));
        wait(&self.listener, clients, None, left_ms as i64)
    }

    fn accept(&mut self, now_ms: u64) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.clients.len() >= self.most_clients {
                // The response fits the socket's buffer; whether the client reads it does not matter.
                let _ = stream.set_nonblocking(true).and_then(|()| (&stream).write(&refusal()));
                continue;
            }
            self.next_client += 1;
            // Fails for a client that has disconnected.
            self.clients.extend(Client::new(stream, self.next_client, now_ms));
        }
    }

    /// Processes the input from bus and telemetry.
    fn receive_input(&mut self, now_ms: u64) {
        for _ in 0..FRAMES_A_TURN {
            match self.bus.receive() {
                Received::Frame(frame, stamp_ns) => self.view.frame(FrameRecord { stamp_ns, frame }, now_ms),
                Received::Barrier(_) => {}
                Received::Nothing => break,
            }
        }
        let bus_is_up = self.bus.is_up();
        if std::mem::replace(&mut self.bus_was_up, bus_is_up) != bus_is_up {
            self.announce_status(now_ms);
        }
        let Some(telemetry_client) = &mut self.telemetry_client else { return };
        let (had_telemetry, mut described) = (self.view.telemetry, false);
        let (view, mut answers) = (&mut self.view, Vec::new());
        let gone = telemetry_client.poll(|packet| match packet {
            Packet::Answer(text) => answers.push(text),
            packet => {
                described |= matches!(packet, Packet::Description(_));
                view.packet(packet);
            }
        });
        answers.iter().for_each(|text| self.pass_on_answer(text, now_ms));
        if gone {
            self.view.telemetry = false;
            for number in std::mem::take(&mut self.asked) {
                self.answer(number, message_response(Status::Busy, "the emulator is gone"), now_ms);
            }
        }
        // "connected" is announced with the description, since clients request the description at once.
        if described || had_telemetry && gone {
            self.announce_status(now_ms);
        }
    }

    /// Passes the emulator's answer on to the client that sent the command.
    fn pass_on_answer(&mut self, text: &str, now_ms: u64) {
        let Some(number) = self.asked.pop_front() else { return };
        let (status, text) = match serde_json::from_str(text) {
            Ok(Answer { ok: true, text }) if text.is_empty() => {
                (Status::Good, "accepted by the emulator".to_owned())
            }
            Ok(Answer { ok: true, text }) => (Status::Good, text),
            Ok(Answer { ok: false, text }) => (Status::BadRequest, text),
            Err(error) => (Status::BadRequest, format!("the emulator's answer cannot be read: {error}")),
        };
        self.answer(number, message_response(status, &text), now_ms);
    }

    fn answer(&mut self, number: u64, response: Vec<u8>, now_ms: u64) {
        // The client may have disconnected.
        if let Some(client) = self.clients.iter_mut().find(|client| client.number == number) {
            client.answer(response, now_ms);
        }
    }

    fn send_due_events(&mut self, now_ms: u64) {
        for message in self.view.take_messages() {
            self.broadcast("message", &json!(message), now_ms);
        }
        if is_due(&mut self.due.rows, now_ms, ROWS_MS)
            && let Some(rows) = self.view.rows.take_fresh()
        {
            self.broadcast("rows", &rows, now_ms);
        }
        if is_due(&mut self.due.second, now_ms, SECOND_MS) {
            self.view.wire.turn(now_ms);
            self.view.update_each_second();
            self.broadcast("histograms", &self.view.latencies.histograms(), now_ms);
        }
        if is_due(&mut self.due.state, now_ms, STATE_MS) {
            self.broadcast("state", &json!(self.view.state(self.server_status(now_ms))), now_ms);
        }
        if is_due(&mut self.due.heartbeat, now_ms, HEARTBEAT_MS) {
            self.offer(&HEARTBEAT.into(), now_ms);
        }
        if let Ok((number, saved)) = self.saved.1.try_recv() {
            self.saving = false;
            let reported = match saved {
                Ok(reported) => message_response(Status::Good, &reported),
                Err(error) => message_response(Status::BadRequest, &error.to_string()),
            };
            self.answer(number, reported, now_ms);
        }
    }

    fn announce_status(&mut self, now_ms: u64) {
        let status = self.status();
        let of = |what: &str| status[what].as_str().unwrap_or_default();
        eprintln!("bench watch: bus {}, telemetry {}", of("bus"), of("telemetry"));
        self.broadcast("status", &status, now_ms);
    }

    fn status(&self) -> Value {
        let word = |is_there: bool| if is_there { "connected" } else { "gone" };
        json!({ "bus": word(self.bus.is_up()), "telemetry": word(self.view.telemetry) })
    }

    fn broadcast(&mut self, name: &str, data: &Value, now_ms: u64) {
        if self.clients.iter().any(Client::is_streaming) {
            self.offer(&http::event(name, data).into(), now_ms);
        }
    }

    fn offer(&mut self, event: &Arc<[u8]>, now_ms: u64) {
        let listeners = self.clients.iter_mut().filter(|client| client.is_streaming());
        listeners.for_each(|client| client.offer(event, now_ms));
    }

    fn server_status(&self, now_ms: u64) -> ServerStatus {
        let missed: u64 = self.clients.iter().map(|client| client.missed).sum();
        let viewers = self.clients.iter().filter(|client| client.is_streaming()).count();
        ServerStatus { viewers, missed: self.missed_by_gone + missed, now_ms }
    }

    /// Answers a request, or leaves the answer for later.
    fn serve(&mut self, place: usize, request: &Request, now_ms: u64) {
        let is_for_us = request.host.as_deref().is_some_and(|host| is_ours(host, self.address.port()));
        if !is_for_us {
            let why = "unknown Host header: use the address that was printed";
            return self.clients[place].answer(message_response(Status::Forbidden, why), now_ms);
        }
        if request.path == "/api/control" {
            let number = self.clients[place].number;
            if let Some(answer) = self.control(number, request, now_ms) {
                self.clients[place].answer(answer, now_ms);
            }
            return;
        }
        if request.method != "GET" {
            let why = "only GET here; POST goes to /api/control";
            return self.clients[place].answer(message_response(Status::MethodNotAllowed, why), now_ms);
        }
        let answer = match request.path.as_str() {
            "/api/events" => {
                self.clients[place].stream_events(now_ms);
                let first = http::event("status", &self.status());
                return self.clients[place].offer(&first.into(), now_ms);
            }
            "/api/description" => json_response(Status::Good, &self.view.description(self.token.is_some())),
            "/api/state" => {
                json_response(Status::Good, &json!(self.view.state_with_messages(self.server_status(now_ms))))
            }
            "/api/history" => self.history(&request.query),
            "/metrics" => {
                let text = metrics::text(&self.view, self.server_status(now_ms), self.bus.is_up());
                response(Status::Good, "text/plain; version=0.0.4; charset=utf-8", text.as_bytes())
            }
            path => match assets::find(path) {
                Some(asset) => response(Status::Good, asset.content_type, asset.body),
                None => message_response(Status::NotFound, "there is nothing by this name"),
            },
        };
        self.clients[place].answer(answer, now_ms);
    }

    fn history(&self, query: &str) -> Vec<u8> {
        let asked = query.split('&').find_map(|pair| pair.strip_prefix("seconds="));
        let seconds = asked.map_or(Ok(LONGEST_HISTORY_S), str::parse);
        match seconds {
            Ok(seconds) if (0.0..=LONGEST_HISTORY_S).contains(&seconds) => {
                json_response(Status::Good, &self.view.rows.last(seconds))
            }
            _ => message_response(Status::BadRequest, &format!("seconds: 0 to {LONGEST_HISTORY_S}")),
        }
    }

    /// Checks the authority of a request and carries it out; `None` when the answer comes later.
    fn control(&mut self, number: u64, request: &Request, now_ms: u64) -> Option<Vec<u8>> {
        if request.method != "POST" {
            return Some(message_response(Status::MethodNotAllowed, "orders come by POST"));
        }
        let Some(token) = &self.token else {
            let why = "this page is read-only: it was started without --control";
            return Some(message_response(Status::Forbidden, why));
        };
        // Browsers send the origin of a request; programs send none and need the token too.
        let host = request.host.as_deref().unwrap_or_default();
        if request.origin.as_deref().is_some_and(|origin| origin != format!("http://{host}")) {
            return Some(message_response(Status::Forbidden, "this request comes from another page"));
        }
        let shown = request.token.as_deref().unwrap_or_default();
        if !is_same(token.as_bytes(), shown.as_bytes()) {
            let why = "the token is missing or wrong: open the address that was printed";
            return Some(message_response(Status::Unauthorized, why));
        }
        match control::read(&request.body) {
            Ok(order) => self.execute(number, order, now_ms),
            Err(why) => Some(message_response(Status::BadRequest, &why)),
        }
    }

    fn execute(&mut self, number: u64, order: Order, now_ms: u64) -> Option<Vec<u8>> {
        match order {
            Order::Stop => Some(self.send_stop(false, now_ms)),
            Order::Release => Some(self.send_stop(true, now_ms)),
            Order::Frame(frame) => Some(self.send(&frame, now_ms)),
            Order::SetPoint { axis, position_m, force_n } => {
                let asked = self.view.wire.hand_set_point(axis, position_m, force_n);
                Some(match asked {
                    Some(asked) => self.send(&Frame::HandSetPoint(asked), now_ms),
                    None => message_response(Status::Busy, "no frames of this axis's controller arrive"),
                })
            }
            Order::Line(line) => {
                if self
                    .telemetry_client
                    .as_mut()
                    .is_some_and(|telemetry_client| telemetry_client.command(&line))
                {
                    self.asked.push_back(number);
                    return None;
                }
                let why = "no emulator is connected: start it with --telemetry and --console";
                Some(message_response(Status::Busy, why))
            }
            Order::Save(seconds) => self.save(number, seconds),
        }
    }

    /// Sends a frame on the bus; returns the response for the client.
    fn send(&mut self, frame: &Frame, now_ms: u64) -> Vec<u8> {
        let encoded = match frame.encode() {
            Ok(encoded) => encoded,
            Err(error) => return message_response(Status::BadRequest, &error.to_string()),
        };
        match self.bus.send(&encoded) {
            Ok(_) => {
                // A peer does not receive its frames.
                self.view.recent_record.frame(FrameRecord { stamp_ns: wall_clock_ns(0), frame: encoded });
                if let Frame::ConsoleEmergencyStop(stop) = frame {
                    self.view.wire.note_stop(CONSOLE, *stop, now_ms);
                }
                message_response(Status::Good, "on the bus")
            }
            Err(error) => message_response(Status::Busy, &error.to_string()),
        }
    }

    fn send_stop(&mut self, release: bool, now_ms: u64) -> Vec<u8> {
        self.stop_due_ms = (!release).then_some(now_ms + EMERGENCY_STOP_CYCLES);
        self.send(&Frame::ConsoleEmergencyStop(EmergencyStop::of_operator(release)), now_ms)
    }

    fn save(&mut self, number: u64, seconds: f64) -> Option<Vec<u8>> {
        let Some(folder) = self.save_to.clone().or_else(|| self.view.run_folder()) else {
            return Some(message_response(Status::BadRequest, "no folder is known: start with --save DIR"));
        };
        if std::mem::replace(&mut self.saving, true) {
            return Some(message_response(Status::Busy, "a record is being saved already"));
        }
        let interface = self.url.name().unwrap_or_else(|| NAMELESS.into());
        let record = self.view.recent_record.last(seconds, &folder, &interface, self.view.set_up);
        let done = self.saved.0.clone();
        // In a thread, since the disk may be slow.
        std::thread::spawn(move || done.send((number, record.write())));
        None
    }

    fn now_ms(&self) -> u64 {
        self.began.elapsed().as_millis() as u64
    }
}

/// Whether an event is due; if so, sets the time of the next.
fn is_due(due_ms: &mut u64, now_ms: u64, every_ms: u64) -> bool {
    let is_time = now_ms >= *due_ms;
    if is_time {
        *due_ms = now_ms + every_ms;
    }
    is_time
}

fn draw_token() -> io::Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Compares two texts in constant time.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    let differ = one.iter().zip(other).fold(0, |differ, (a, b)| differ | (a ^ b));
    one.len() == other.len() && differ == 0
}
