//! Telemetry: whoever connects to the socket of `--telemetry` gets the run as it goes, and never slows it down.
//!
//! ```text
//!   1 ms path ──► queues ──► writer thread ──► packet, made once ──┬── buffer of viewer 1 ──► its socket
//!                                                                  └── buffer of viewer 2 ──► its socket
//! ```
//!
//! The thread that writes the run's files serves it: the 1 ms path does nothing for it that it does not do without. Nothing here
//! waits. What the buffer of a viewer has no room for is lost to that viewer, by whole records, and counted; lockstep does not
//! wait for viewers either. The packets are described in [`runlog::telemetry`].

mod description;
mod viewer;

use crate::console::Console;
use crate::event::Event;
use plant::tables::CycleRecord;
use protocol::socket_file::{SocketFile, SocketFileError, SocketType};
use runlog::telemetry::{
    Description, DroppedEvents, EventMessage, Kind, write_cycle, write_description, write_packet,
};
use std::path::Path;
use viewer::Viewer;

pub(crate) use description::{Described, description};

/// Viewers at a time; one more is parted with at once.
const MOST_VIEWERS: usize = 8;

pub(crate) struct Telemetry {
    socket: SocketFile,
    /// The first packet of each viewer, save what it is given at its coming.
    description: Description,
    /// Whether cycles show what only a simulation knows.
    with_truth: bool,
    /// Takes the commands of viewers; `None` in a run without a console.
    console: Option<Console>,
    viewers: Vec<Viewer>,
    /// The packet that is made; kept so that it need not be allocated anew.
    packet: Vec<u8>,
}

impl Telemetry {
    /// Opens the socket at `path`, readable and writable by this user alone.
    pub(crate) fn open(
        path: &Path,
        run: &Described<'_>,
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

    /// Tells lines of an interval log.
    pub(crate) fn histograms(&mut self, lines: &[u8]) {
        for line in lines.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            self.packet.clear();
            write_packet(&mut self.packet, Kind::Histogram, line);
            self.viewers.iter_mut().for_each(|viewer| viewer.offer(&self.packet));
        }
    }

    /// Lets viewers in, sends them the description and what `happened` so far, of which the `dropped` events are only counted,
    /// obeys their commands, and writes what their sockets take.
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
