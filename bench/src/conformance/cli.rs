//! The conformance check's command line.

use crate::probe::cli::seconds;
use clap::{Args, ValueEnum};
use protocol::bus::BusUrl;
use protocol::frames::{DRIVE_SENSORS, DRIVE_VALVE_COMMAND, LOAD_SENSORS, LOAD_VALVE_COMMAND, MessageSpec};
use std::ffi::OsString;
use std::path::PathBuf;

/// The axis whose controller is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CheckedAxis {
    /// The drive, which positions.
    Drive,
    /// The load, which presses.
    Load,
}

impl CheckedAxis {
    /// The frame of its valve commands.
    pub(crate) fn command(self) -> &'static MessageSpec {
        match self {
            Self::Drive => DRIVE_VALVE_COMMAND,
            Self::Load => LOAD_VALVE_COMMAND,
        }
    }

    pub(crate) fn sensors(self) -> &'static MessageSpec {
        match self {
            Self::Drive => DRIVE_SENSORS,
            Self::Load => LOAD_SENSORS,
        }
    }
}

/// How time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CheckPace {
    /// One cycle each millisecond; what a foreign controller, and one on real CAN, is checked at.
    Real,
    /// Simulated time, for a controller that joins the barrier of the embedded bus.
    Lockstep,
    /// Simulated time, for a foreign controller that answers every cycle: it takes part by its commands' echo.
    LockstepEcho,
}

/// What is checked, how, and where the result goes.
#[derive(Args, Debug)]
pub(crate) struct ConformanceArguments {
    /// Bus on which the check is the rig: unix:///PATH is hosted here, can://IFACE must be there. No emulator may be on it
    /// [default: an embedded bus of the check's own, which needs a COMMAND].
    #[arg(long, required_unless_present = "command")]
    pub bus: Option<BusUrl>,
    /// The axis whose controller is checked.
    #[arg(long, value_enum, default_value_t = CheckedAxis::Drive)]
    pub axis: CheckedAxis,
    /// The controller serves both axes and may send the other axis's frames.
    #[arg(long)]
    pub both_axes: bool,
    /// How time passes.
    #[arg(long, value_enum, default_value_t = CheckPace::Real)]
    pub pace: CheckPace,
    /// Write the result as JUnit XML.
    #[arg(long, value_name = "FILE.xml")]
    pub junit: Option<PathBuf>,
    /// How long regular operation is watched, s.
    #[arg(long, default_value = "3", value_parser = seconds)]
    pub seconds: f64,
    /// How long to wait for the first command, and for an open valve before each fault, s.
    #[arg(long, default_value = "20", value_parser = seconds)]
    pub patience: f64,
    /// Real time: largest 99th percentile of the response time from sensors to command, us.
    #[arg(long, default_value_t = 500)]
    pub response_us: u64,
    /// Real time: 99 % of the times between two commands differ from 1 ms by at most this, us.
    #[arg(long, default_value_t = 300)]
    pub spread_us: u64,
    /// Real time: share of the cycles that may go without an answer, and of those with more than one.
    #[arg(long, default_value_t = 0.001)]
    pub missing: f64,
    /// Command line of the controller, started anew for each fault; {bus} stands for the bus's URL, {path} for its path or
    /// interface. Without it the controller on the bus is reset by whoever runs the check.
    #[arg(last = true)]
    pub command: Vec<OsString>,
}
