//! Telemetry: viewers connected to the socket of `--telemetry` get the run as a stream, without slowing it down.
//!
//! ```text
//!   1 ms path ──► queues ──► writer thread ──► packet, made once ──┬── buffer of viewer 1 ──► its socket
//!                                                                  └── buffer of viewer 2 ──► its socket
//! ```
//!
//! The thread that writes the run's files serves it: the 1 ms path does no extra work. Nothing here blocks. Records that do not
//! fit the buffer of a viewer are lost to that viewer, and counted; lockstep does not wait for viewers either. The packets are
//! described in [`runlog::telemetry`].

mod description;
mod viewer;

use crate::console::Console;
use crate::event::Event;
use plant::CycleRecord;
use protocol::socket_file::{SocketFile, SocketFileError, SocketType};
use runlog::telemetry::{
    Description, DroppedEvents, EventMessage, Kind, write_cycle, write_description, write_packet,
};
use std::path::Path;
use viewer::Viewer;

pub(crate) use description::{RunFacts, description};

/// Most viewers at a time; a further one is disconnected at once.
const MOST_VIEWERS: usize = 8;

pub(crate) struct Telemetry {
    socket: SocketFile,
    /// The first packet of each viewer, without the state at the time of its connection.
    description: Description,
    /// Whether cycles include values of the truth.
    with_truth: bool,
    /// Executes the commands of viewers; `None` without a console.
    console: Option<Console>,
    viewers: Vec<Viewer>,
    /// Buffer for a packet, reused.
    packet: Vec<u8>,
}

impl Telemetry {
    /// Opens the socket at `path`, readable and writable by this user alone.
    pub(crate) fn open(
        path: &Path,
        run: &RunFacts<'_>,
        console: Option<Console>,
    ) -> Result<Self, SocketFileError> {
        let socket = SocketFile::bind(path, SocketType::STREAM, false)?;
        let (description, with_truth) = (description(run), run.with_truth());
        Ok(Self { socket, description, with_truth, console, viewers: Vec::new(), packet: Vec::new() })
    }

    pub(crate) fn cycle(&mut self, record: &CycleRecord) {
        if self.viewers.is_empty() {
            return;
        }
        self.packet.clear();
        if self.with_truth {
            let known = record.truth.values();
            let values = record.measured().chain(known).chain(record.terms.values().iter().copied());
            write_cycle(&mut self.packet, record.cycle, values);
        } else {
            write_cycle(&mut self.packet, record.cycle, record.measured());
        }
        self.viewers.iter_mut().for_each(|viewer| viewer.offer(&self.packet));
    }

    pub(crate) fn event(&mut self, event: &Event) {
        if !self.viewers.is_empty() {
            self.packet.clear();
            write_event(&mut self.packet, event);
            self.viewers.iter_mut().for_each(|viewer| viewer.offer(&self.packet));
        }
    }

    /// Sends lines of an interval log.
    pub(crate) fn histograms(&mut self, lines: &[u8]) {
        for line in lines.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            self.packet.clear();
            write_packet(&mut self.packet, Kind::Histogram, line);
            self.viewers.iter_mut().for_each(|viewer| viewer.offer(&self.packet));
        }
    }

    /// Accepts viewers, sends them the description and the events so far (`happened`; of the `dropped` ones only counts),
    /// executes their commands, and writes what their sockets accept.
    pub(crate) fn serve(&mut self, happened: &[Event], dropped: DroppedEvents) {
        while let Some(socket) = self.socket.accept() {
            if self.viewers.len() >= MOST_VIEWERS {
                continue;
            }
            let mut viewer = Viewer::new(socket.into());
            self.description.dropped_events = dropped;
            self.packet.clear();
            write_description(&mut self.packet, &self.description);
            viewer.offer(&self.packet);
            for event in happened {
                self.packet.clear();
                write_event(&mut self.packet, event);
                viewer.offer(&self.packet);
            }
            self.viewers.push(viewer);
        }
        let console = self.console.as_ref();
        self.viewers.retain_mut(|viewer| viewer.turn(console));
    }
}

fn write_event(out: &mut Vec<u8>, event: &Event) {
    let message = EventMessage::new(*event, event.kind.to_string());
    runlog::telemetry::write_event(out, &message);
}
