//! The two axis controllers: sensors of a cycle in, valve command of that cycle out.
//!
//! The drive is position controlled; the load axis holds its valve shut. They know each other only through the bus.

use crate::experiment::DriveExperiment;
use crate::figures::PositionFigures;
use crate::linearisation::Linearisation;
use crate::main_chain::MainChain;
use crate::position_p::PositionP;
use crate::set_point::SetPoint;
use protocol::frames::{ChainStatus, ChainValues, MainChainState, Sensors, ValveCommand};

/// Values of the alive counter and of the echo.
const ALIVE_RANGE: u8 = 16;
const ECHO_RANGE: u64 = 4096;

/// What the drive did in a cycle, for `controller.csv`.
#[derive(Clone, Copy, Debug)]
pub struct DriveRecord {
    /// The rig's cycle.
    pub cycle: u64,
    /// State of the main chain.
    pub state: MainChainState,
    /// Set-point; `None` while there is none.
    pub set_point: Option<SetPoint>,
    /// Position as the sensor shows it, m.
    pub position_m: f64,
    /// Velocity that the algorithm wants, m/s.
    pub wanted_velocity_m_per_s: f64,
    /// Opening sent, -1 to 1.
    pub opening: f64,
}

/// Controller of the drive axis.
pub struct DriveAxis {
    chain: MainChain,
    algorithm: PositionP,
    linearisation: Linearisation,
    figures: PositionFigures,
    last: Option<DriveRecord>,
    alive: u8,
}

impl DriveAxis {
    /// A controller that waits for its rig.
    #[must_use]
    pub fn new(experiment: DriveExperiment, linearisation: Linearisation, forever: bool) -> Self {
        let algorithm = experiment.position_p;
        let chain = MainChain::new(experiment, forever);
        Self { chain, algorithm, linearisation, figures: PositionFigures::default(), last: None, alive: 0 }
    }

    /// The command that answers the sensors of `cycle`.
    pub fn command(&mut self, cycle: u64, sensors: &Sensors, emergency_stop: bool) -> ValveCommand {
        let position_m = sensors.position_m;
        let set_point = self.chain.advance(cycle, position_m, emergency_stop);
        let wanted = set_point.map_or(0.0, |point| self.algorithm.velocity_m_per_s(&point, position_m));
        let opening = self.linearisation.opening(wanted);
        match (&set_point, self.chain.state()) {
            (Some(point), MainChainState::Experiment) => self.figures.take(point, position_m),
            _ => self.figures.end_rest(),
        }
        self.last = Some(DriveRecord {
            cycle,
            state: self.chain.state(),
            set_point,
            position_m,
            wanted_velocity_m_per_s: wanted,
            opening,
        });
        self.alive = (self.alive + 1) % ALIVE_RANGE;
        ValveCommand { opening, alive: self.alive, echo: echo(cycle), enable: set_point.is_some() }
    }

    /// The rig's time began again.
    pub fn restart(&mut self) {
        self.chain.restart();
        self.figures.end_rest();
    }

    /// State of the main chain.
    #[must_use]
    pub fn state(&self) -> MainChainState {
        self.chain.state()
    }

    /// Figures of the position control so far.
    #[must_use]
    pub fn figures(&self) -> &PositionFigures {
        &self.figures
    }

    /// What the last command was made of.
    #[must_use]
    pub fn last(&self) -> Option<DriveRecord> {
        self.last
    }

    /// Status for the bus.
    #[must_use]
    pub fn status(&self) -> ChainStatus {
        let state = self.chain.state();
        ChainStatus {
            main_chain: state,
            ok: !matches!(state, MainChainState::WaitingForRig | MainChainState::Aborted),
            // The counter wraps as its field in rig.dbc does.
            repetition: self.chain.repetition() as u8,
            ..ChainStatus::default()
        }
    }

    /// Values for the bus; `None` before the first command.
    #[must_use]
    pub fn values(&self) -> Option<ChainValues> {
        let last = self.last?;
        let set_point_m = last.set_point.map_or(last.position_m, |point| point.position_m);
        Some(ChainValues {
            averaged_position_m: last.position_m,
            position_set_point_m: set_point_m,
            force_set_point_n: 0.0,
            control_error_m: set_point_m - last.position_m,
        })
    }
}

/// Controller of the load axis: holds its valve shut, and says so every cycle.
#[derive(Default)]
pub struct LoadAxis {
    alive: u8,
}

impl LoadAxis {
    /// The command that answers the sensors of `cycle`.
    pub fn command(&mut self, cycle: u64) -> ValveCommand {
        self.alive = (self.alive + 1) % ALIVE_RANGE;
        ValveCommand { opening: 0.0, alive: self.alive, echo: echo(cycle), enable: false }
    }

    /// Status for the bus: it has nothing to do, so it is done when the drive is.
    #[must_use]
    pub fn status(&self, drive: MainChainState) -> ChainStatus {
        ChainStatus { main_chain: drive, ok: true, ..ChainStatus::default() }
    }
}

/// Low bits of the cycle that a command answers.
fn echo(cycle: u64) -> u16 {
    (cycle % ECHO_RANGE) as u16
}
