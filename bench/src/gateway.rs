//! A gateway from TCP to a bus by the socketcand protocol, for programs without SocketCAN.
//!
//! ```text
//!   python-can ── TCP ──► client: session, bounded queue ──┐
//!   SavvyCAN ──── TCP ──► client: session, bounded queue ──┼── one peer ── can:// or unix://
//!   …                                                    ──┘
//! ```
//!
//! One thread, one poll over the bus's socket, the listener and all clients. No client delays another: one that does not read
//! fills its queue and loses frames, which are counted and reported; one that reads nothing for 30 s is disconnected. The
//! gateway is one peer of the bus and therefore forwards the frames of a client to the other clients itself; the sender does
//! not receive them.
//!
//! | file | holds |
//! |---|---|
//! | [`parser`] | parser of requests |
//! | [`session`] | protocol state of one client, without socket and clock |
//! | `client` | a socket, its session and its queue |
//! | [`cli`] | the command line |

pub(crate) mod cli;
mod client;
mod parser;
mod session;

use crate::say;
use cli::GatewayArguments;
use client::{Client, ClientReport, EndReason, LONGEST_FRAME};
use live::client::wait;
use live::wall_clock_ns;
use protocol::bus::{self, Bus, BusCounters, BusError, BusUrl, Received};
use protocol::can::CanFrame;
use protocol::exit::Exit;
use realtime::Interrupt;
use runlog::run_folder::{FileError, SCHEMA_VERSION, write_json};
use serde::Serialize;
use session::write_frame;
use std::collections::VecDeque;
use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener};
use std::time::{Duration, Instant};

/// Most frames of the bus, and most connections, that are taken in one turn.
const FRAMES_A_TURN: usize = 1024;
const CONNECTIONS_A_TURN: usize = 64;
/// Number of disconnected clients whose reports are kept; of the others the sums alone.
const REPORTS_KEPT: usize = 100;
/// Least time between two messages on one subject.
const REPORT_PERIOD: Duration = Duration::from_secs(1);

#[derive(Debug, thiserror::Error)]
pub(crate) enum GatewayError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("cannot listen at {address}: {reason}; choose another with --listen, port 0 for a free one")]
    Listen { address: SocketAddr, reason: String },
    #[error("{0} has no name of 1 to 64 printable characters: give one with --name")]
    Name(String),
    /// The system gave no signal handler, or no poll.
    #[error("{0}")]
    System(io::Error),
    #[error(transparent)]
    Report(#[from] FileError),
}

impl GatewayError {
    pub(crate) fn exit(&self) -> Exit {
        if matches!(self, Self::Bus(_)) { Exit::BusFailed } else { Exit::BadInput }
    }
}

#[derive(Debug, Serialize)]
struct Report {
    schema_version: u32,
    bus: String,
    name: String,
    listened_at: SocketAddr,
    connections: u64,
    connections_refused: u64,
    clients_at_a_time_max: usize,
    frames_to_clients: u64,
    frames_lost: u64,
    frames_from_clients: u64,
    frames_not_taken: u64,
    /// Remote requests and error frames, which the protocol cannot carry in a form that clients read.
    frames_not_carried: u64,
    /// The last [`REPORTS_KEPT`] disconnected clients.
    clients: VecDeque<ClientReport>,
    bus_counters: BusCounters,
}

/// Listens and serves until SIGINT or SIGTERM.
pub(crate) fn run(arguments: &GatewayArguments) -> Result<Exit, GatewayError> {
    let interrupt = Interrupt::install().map_err(GatewayError::System)?;
    let mut gateway = Gateway::open(arguments)?;
    gateway.announce(arguments.read_only);
    while !interrupt.came() {
        gateway.turn().map_err(GatewayError::System)?;
    }
    let report = gateway.close();
    // On an embedded bus only the host knows what the gateway's queue lost.
    let dropped = match arguments.bus {
        BusUrl::Can { .. } => format!(", {} lost at its own queue", report.bus_counters.dropped_on_receive),
        BusUrl::Unix { .. } => String::new(),
    };
    say(&format!(
        "gateway: {} clients, {} frames to them, {} lost, {} frames from them, {} connections refused{dropped}",
        report.connections,
        report.frames_to_clients,
        report.frames_lost,
        report.frames_from_clients,
        report.connections_refused
    ));
    if let Some(file) = &arguments.report {
        write_json(file, &report).map_err(|error| FileError::write(file, error))?;
    }
    Ok(Exit::Interrupted)
}

struct Gateway {
    bus: Box<dyn Bus>,
    bus_is_up: bool,
    listener: TcpListener,
    clients: Vec<Client>,
    most_clients: usize,
    queue_frames: u32,
    read_only: bool,
    began: Instant,
    last_report: Instant,
    refused_reported: u64,
    /// Frames lost to the gateway's queue at the bus.
    dropped_reported: u64,
    /// Whether frames may be left from the last turn.
    more: bool,
    text: String,
    report: Report,
}

impl Gateway {
    fn open(arguments: &GatewayArguments) -> Result<Self, GatewayError> {
        let name = arguments.name.clone().or_else(|| arguments.bus.name());
        let name = name.ok_or_else(|| GatewayError::Name(arguments.bus.to_string()))?;
        let listen = |reason: io::Error| GatewayError::Listen {
            address: arguments.listen,
            reason: reason.to_string(),
        };
        let bus = bus::open(&arguments.bus, Box::new(wall_clock_ns))?;
        let listener = TcpListener::bind(arguments.listen).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let now = Instant::now();
        let report = Report {
            schema_version: SCHEMA_VERSION,
            bus: arguments.bus.to_string(),
            name,
            listened_at: listener.local_addr().map_err(listen)?,
            connections: 0,
            connections_refused: 0,
            clients_at_a_time_max: 0,
            frames_to_clients: 0,
            frames_lost: 0,
            frames_from_clients: 0,
            frames_not_taken: 0,
            frames_not_carried: 0,
            clients: VecDeque::new(),
            bus_counters: BusCounters::default(),
        };
        Ok(Self {
            bus_is_up: bus.is_up(),
            bus,
            listener,
            clients: Vec::new(),
            most_clients: usize::from(arguments.clients),
            queue_frames: arguments.queue_frames,
            read_only: arguments.read_only,
            began: now,
            last_report: now,
            refused_reported: 0,
            dropped_reported: 0,
            more: false,
            text: String::with_capacity(LONGEST_FRAME),
            report,
        })
    }

    fn announce(&self, read_only: bool) {
        let Report { bus, name, listened_at, .. } = &self.report;
        let sends = if read_only { ", which may not send" } else { "" };
        eprintln!(
            "gateway: {bus} as '{name}' at {listened_at} for socketcand clients{sends}; Ctrl-C ends it"
        );
        if !listened_at.ip().is_loopback() {
            let what = if read_only { "read the bus" } else { "move the rig" };
            eprintln!("gateway: warning: {listened_at} is not loopback: whoever reaches it can {what}");
        }
        if !self.bus_is_up {
            eprintln!("gateway: {bus} has no host yet; waiting for it");
        }
    }

    /// Waits for input and processes it.
    fn turn(&mut self) -> io::Result<()> {
        let (readable, someone_waits) = self.wait()?;
        let now_ms = self.now_ms();
        if someone_waits {
            self.accept_connections(now_ms);
        }
        self.carry_from_the_bus(now_ms);
        for place in readable {
            self.read(place, now_ms);
            self.clients[place].announce();
        }
        let now_ms = self.now_ms();
        self.clients.iter_mut().for_each(|client| client.write(now_ms));
        self.remove_ended();
        self.report_losses();
        Ok(())
    }

    /// Indices of the readable clients, and whether a connection waits.
    fn wait(&self) -> io::Result<(Vec<usize>, bool)> {
        let now_ms = self.now_ms();
        let pausing = self.clients.iter().any(|client| client.is_pausing(now_ms));
        let milliseconds = match (self.more, self.bus.is_up()) {
            (true, _) => 0,
            (false, true) if !pausing => 200,
            // Reconnection attempts every 100 ms; a pause of a client is 30 ms.
            _ => 10,
        };
        let clients =
            self.clients.iter().map(|client| (&client.stream, client.has_something_to_write(now_ms)));
        wait(&self.listener, clients, self.bus.socket(), milliseconds)
    }

    fn accept_connections(&mut self, now_ms: u64) {
        for _ in 0..CONNECTIONS_A_TURN {
            let (stream, address) = match self.listener.accept() {
                Ok(accepted) => accepted,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(_) => {
                    // Most likely no file descriptors are left: the next attempt must wait.
                    std::thread::sleep(Duration::from_millis(1));
                    break;
                }
            };
            if self.clients.len() >= self.most_clients {
                self.report.connections_refused += 1;
                // The response fits the socket's buffer; whether the client reads it does not matter.
                let _ = stream
                    .set_nonblocking(true)
                    .and_then(|()| (&stream).write(b"< error too many clients >"));
                continue;
            }
            // Fails for a client that has disconnected.
            if let Ok(client) = Client::new(stream, address, now_ms, self.queue_frames, self.read_only) {
                self.clients.push(client);
                self.report.connections += 1;
            }
        }
        self.report.clients_at_a_time_max = self.report.clients_at_a_time_max.max(self.clients.len());
    }

    fn carry_from_the_bus(&mut self, now_ms: u64) {
        self.more = true;
        for _ in 0..FRAMES_A_TURN {
            match self.bus.receive() {
                Received::Frame(frame, stamp_ns) => {
                    self.text.clear();
                    if write_frame(&mut self.text, &frame, stamp_ns) {
                        let raw = self.clients.iter_mut().filter(|client| client.is_raw());
                        raw.for_each(|client| client.queue_frame(&self.text, now_ms));
                    } else {
                        self.report.frames_not_carried += 1;
                    }
                }
                Received::Barrier(_) => {}
                Received::Nothing => {
                    self.more = false;
                    break;
                }
            }
        }
        if self.bus.is_up() != self.bus_is_up {
            self.bus_is_up = self.bus.is_up();
            let how = if self.bus_is_up { "is there" } else { "is gone; waiting for it" };
            eprintln!("gateway: {} {how}", self.report.bus);
        }
    }

    fn read(&mut self, place: usize, now_ms: u64) {
        let mut sent: Vec<CanFrame> = Vec::new();
        let bus = &mut self.bus;
        self.clients[place].read(&self.report.name, now_ms, |frame| {
            let taken = bus.send(frame).is_ok();
            if taken {
                sent.push(*frame);
            }
            taken
        });
        for frame in sent {
            self.text.clear();
            write_frame(&mut self.text, &frame, wall_clock_ns(0));
            let others = self.clients.iter_mut().enumerate().filter(|(other, _)| *other != place);
            let raw = others.map(|(_, client)| client).filter(|client| client.is_raw());
            raw.for_each(|client| client.queue_frame(&self.text, now_ms));
        }
    }

    /// Removes disconnected clients and adds up their counters.
    fn remove_ended(&mut self) {
        let (gone, here) =
            std::mem::take(&mut self.clients).into_iter().partition(|client| client.report.ended.is_some());
        self.clients = here;
        for client in gone {
            report_loss(&client);
            self.account(client.report);
        }
    }

    fn account(&mut self, of_client: ClientReport) {
        let report = &mut self.report;
        report.frames_to_clients += of_client.frames_to_client;
        report.frames_lost += of_client.frames_lost;
        report.frames_from_clients += of_client.frames_from_client;
        report.frames_not_taken += of_client.frames_not_taken;
        report.clients.push_back(of_client);
        if report.clients.len() > REPORTS_KEPT {
            report.clients.pop_front();
        }
    }

    /// Reports losses and refused connections, once a second at most.
    fn report_losses(&mut self) {
        if self.last_report.elapsed() < REPORT_PERIOD {
            return;
        }
        self.last_report = Instant::now();
        for client in &mut self.clients {
            report_loss(client);
            client.lost_reported = client.report.frames_lost;
        }
        let refused = self.report.connections_refused;
        if refused > std::mem::replace(&mut self.refused_reported, refused) {
            eprintln!(
                "gateway: {refused} connections refused so far: {} clients are here, --clients N allows more",
                self.clients.len()
            );
        }
        let dropped = self.bus.counters().dropped_on_receive;
        if dropped > std::mem::replace(&mut self.dropped_reported, dropped) {
            eprintln!(
                "gateway: {dropped} frames lost to all clients so far: the gateway's own queue at the bus was full"
            );
        }
    }

    fn close(mut self) -> Report {
        self.clients.iter_mut().for_each(|client| client.end(EndReason::WithGateway));
        self.remove_ended();
        self.report.bus_counters = *self.bus.counters();
        self.report
    }

    fn now_ms(&self) -> u64 {
        self.began.elapsed().as_millis() as u64
    }
}

fn report_loss(client: &Client) {
    let report = &client.report;
    if report.frames_lost > client.lost_reported {
        eprintln!(
            "gateway: client {} reads too slowly: {} frames lost to it so far, {} delivered",
            report.address, report.frames_lost, report.frames_to_client
        );
    }
}
