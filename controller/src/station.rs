//! The controllers on the bus: frames in, commands out, whatever paces them.
//!
//! ```text
//!   take(frame)* ──► answer: for each axis with fresh sensors, one command that echoes their cycle
//!                            every ten cycles, and on change, status and values of the chains
//! ```
//!
//! Only the newest sensors of an axis are answered: after a stall, the backlog is read and not replayed. Nothing here
//! allocates, locks, prints or blocks.

use crate::axes::{DriveAxis, DriveRecord, LoadAxis};
use crate::rig_view::{RigView, TickNews};
use crossbeam_channel::Sender;
use plant::Axis;
use protocol::bus::Bus;
use protocol::can::CanFrame;
use protocol::frames::{DecodeError, Frame, MainChainState, RunControl, RunControlCommand};

/// Period of status and values, in cycles.
const SLOW_PERIOD: u64 = 10;
/// Cycles within the period in which each slow frame is sent: none falls on the rig's tick (0) or status (5), nor on another.
const DRIVE_STATUS_PHASE: u64 = 2;
const DRIVE_VALUES_PHASE: u64 = 3;
const LOAD_STATUS_PHASE: u64 = 7;
const LOAD_VALUES_PHASE: u64 = 8;

/// What a station tells a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum News {
    /// The main chain went to this state in this cycle.
    State(#[serde(serialize_with = "state_name")] MainChainState, u64),
    /// The rig's time began again.
    RigRestarted,
    /// The bus went away.
    BusLost,
    /// It is back.
    BusBack,
    /// No sensors for a while.
    SensorsSilent,
}

fn state_name<S: serde::Serializer>(state: &MainChainState, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(state.name())
}

/// Frames that were counted and ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct IgnoredFrames {
    /// Not as `rig.dbc` says.
    pub malformed: u64,
    /// Identifiers that `rig.dbc` does not know, extended and remote frames.
    pub unknown: u64,
}

/// The sending ends of the recorder's queues.
pub struct Outlets {
    /// A row of `controller.csv` each cycle.
    pub records: Sender<DriveRecord>,
    /// What a person is told.
    pub news: Sender<News>,
    /// Lockstep waits for the recorder rather than lose a row.
    pub waits: bool,
}

/// The controllers on the bus.
pub struct Station {
    view: RigView,
    drive: DriveAxis,
    load: LoadAxis,
    outlets: Outlets,
    ignored: IgnoredFrames,
    /// State last told to the bus with each axis's status.
    told_state: [MainChainState; 2],
    answered: u64,
    aborted_for: u64,
    records_dropped: u64,
    ending: bool,
}

impl Station {
    /// Puts the controllers on the bus.
    #[must_use]
    pub fn new(drive: DriveAxis, outlets: Outlets) -> Self {
        Self {
            view: RigView::default(),
            drive,
            load: LoadAxis::default(),
            outlets,
            ignored: IgnoredFrames::default(),
            told_state: [MainChainState::WaitingForRig; 2],
            answered: 0,
            aborted_for: 0,
            records_dropped: 0,
            ending: false,
        }
    }

    /// Takes a frame.
    pub fn take(&mut self, frame: &CanFrame) {
        match Frame::decode(frame) {
            Ok(Frame::DriveSensors(sensors)) => self.view.take_sensors(Axis::Drive, sensors),
            Ok(Frame::LoadSensors(sensors)) => self.view.take_sensors(Axis::Load, sensors),
            Ok(Frame::RigStatus(status)) => self.view.take_status(status),
            Ok(Frame::Tick(tick)) => match self.view.take_tick(&tick) {
                TickNews::Usual => {}
                TickNews::Ending => self.ending = true,
                TickNews::Restarted => {
                    self.ending = false;
                    self.drive.restart();
                    self.tell(News::RigRestarted);
                }
            },
            Ok(Frame::RunControl(RunControl { command: RunControlCommand::Abort, .. })) => self.drive.abort(),
            Ok(_) => {}
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                self.ignored.unknown += 1;
            }
            Err(_) => self.ignored.malformed += 1,
        }
    }

    /// Answers what is fresh; true when the drive was answered.
    pub fn answer(&mut self, bus: &mut dyn Bus) -> bool {
        if self.ending {
            return false;
        }
        let drive = self.view.fresh_sensors(Axis::Drive);
        if let Some((cycle, sensors)) = drive {
            let command = self.drive.command(cycle, &sensors, self.view.emergency_stop());
            send(bus, &Frame::DriveValveCommand(command));
            self.answered += 1;
            let aborted = self.drive.state() == MainChainState::Aborted;
            self.aborted_for = if aborted { self.aborted_for + 1 } else { 0 };
            self.record();
            self.send_drive_chain(cycle, bus);
        }
        if let Some((cycle, sensors)) = self.view.fresh_sensors(Axis::Load) {
            send(bus, &Frame::LoadValveCommand(self.load.command(cycle, &sensors)));
            self.send_load_chain(cycle, bus);
        }
        drive.is_some()
    }

    fn send_drive_chain(&mut self, cycle: u64, bus: &mut dyn Bus) {
        let state = self.drive.state();
        let changed = std::mem::replace(&mut self.told_state[Axis::Drive.index()], state) != state;
        if changed {
            self.tell(News::State(state, cycle));
        }
        if changed || cycle % SLOW_PERIOD == DRIVE_STATUS_PHASE {
            send(bus, &Frame::DriveChainStatus(self.drive.status()));
        }
        if (changed || cycle % SLOW_PERIOD == DRIVE_VALUES_PHASE)
            && let Some(values) = self.drive.values()
        {
            send(bus, &Frame::DriveChainValues(values));
        }
    }

    fn send_load_chain(&mut self, cycle: u64, bus: &mut dyn Bus) {
        let state = self.drive.state();
        let changed = std::mem::replace(&mut self.told_state[Axis::Load.index()], state) != state;
        if changed || cycle % SLOW_PERIOD == LOAD_STATUS_PHASE {
            send(bus, &Frame::LoadChainStatus(self.load.status(state)));
        }
        if changed || cycle % SLOW_PERIOD == LOAD_VALUES_PHASE {
            send(bus, &Frame::LoadChainValues(self.load.values()));
        }
    }

    fn record(&mut self) {
        let Some(record) = self.drive.last() else { return };
        let sent = if self.outlets.waits {
            self.outlets.records.send(record).is_ok()
        } else {
            self.outlets.records.try_send(record).is_ok()
        };
        self.records_dropped += u64::from(!sent);
    }

    /// Tells a person something; a full queue loses it, which a person survives.
    pub fn tell(&mut self, news: News) {
        let _ = self.outlets.news.try_send(news);
    }

    /// Whether the rig said that no more sensors come.
    #[must_use]
    pub fn ending(&self) -> bool {
        self.ending
    }

    /// The drive's controller.
    #[must_use]
    pub fn drive(&self) -> &DriveAxis {
        &self.drive
    }

    /// The rig as seen from here.
    #[must_use]
    pub fn view(&self) -> &RigView {
        &self.view
    }

    /// Frames counted and ignored.
    #[must_use]
    pub fn ignored(&self) -> IgnoredFrames {
        self.ignored
    }

    /// Cycles of the drive that were answered.
    #[must_use]
    pub fn answered(&self) -> u64 {
        self.answered
    }

    /// Cycles answered since the experiment was aborted; 0 while it is not.
    #[must_use]
    pub fn aborted_for(&self) -> u64 {
        self.aborted_for
    }

    /// Rows lost to a full queue.
    #[must_use]
    pub fn records_dropped(&self) -> u64 {
        self.records_dropped
    }
}

/// Sends a frame that a controller made itself; what the bus does not take is counted there.
fn send(bus: &mut dyn Bus, frame: &Frame) {
    let frame = frame
        .encode()
        .unwrap_or_else(|error| panic!("a controller made a frame that rig.dbc does not allow: {error}"));
    let _ = bus.send(&frame);
}
