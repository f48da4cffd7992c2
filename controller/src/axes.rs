//! The two axis controllers: sensors of a cycle in, valve command of that cycle out.
//!
//! The drive is position controlled; the load axis holds its valve shut. They know each other only through the bus.

use crate::algorithm::{Algorithm, Ready};
use crate::algorithms::position_p::PositionP;
use crate::figures::PositionFigures;
use crate::linearisation::Linearisation;
use crate::main_chain::{Course, MainChain};
use crate::set_point::SetPoint;
use protocol::frames::{
    ALIVE_RANGE, ChainStatus, ChainValues, ECHO_RANGE, MainChainState, Sensors, ValveCommand,
};

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
    parameters: [f64; 2],
    linearisation: Linearisation,
    figures: PositionFigures,
    last: Option<DriveRecord>,
    alive: u8,
}

impl DriveAxis {
    /// A controller that waits for its rig.
    #[must_use]
    pub fn new(
        experiment: Course,
        parameters: [f64; 2],
        linearisation: Linearisation,
        forever: bool,
    ) -> Self {
        let chain = MainChain::new(experiment, forever);
        Self { chain, parameters, linearisation, figures: PositionFigures::default(), last: None, alive: 0 }
    }

    /// The command that answers the sensors of `cycle`.
    pub fn command(&mut self, cycle: u64, sensors: &Sensors, emergency_stop: bool) -> ValveCommand {
        let position_m = sensors.position_m;
        let set_point = self.chain.advance(cycle, position_m, emergency_stop);
        let wanted = set_point.map_or(0.0, |point| self.wanted_velocity_m_per_s(&point, position_m));
        let opening = self.linearisation.opening(wanted, &Ready::default());
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
        self.alive = next_alive(self.alive);
        ValveCommand { opening, alive: self.alive, echo: echo(cycle), enable: set_point.is_some() }
    }

    fn wanted_velocity_m_per_s(&self, set_point: &SetPoint, position_m: f64) -> f64 {
        let ready = Ready {
            position_m,
            set_position_m: set_point.position_m,
            set_velocity_m_per_s: set_point.velocity_m_per_s,
            ..Ready::default()
        };
        PositionP::default().step(&ready, &[self.parameters[0], self.parameters[1], 0.0])
    }

    /// The console ends the experiment: the valve shuts.
    pub fn abort(&mut self) {
        self.chain.abort();
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
    position_m: f64,
}

impl LoadAxis {
    /// The command that answers the sensors of `cycle`.
    pub fn command(&mut self, cycle: u64, sensors: &Sensors) -> ValveCommand {
        self.position_m = sensors.position_m;
        self.alive = next_alive(self.alive);
        ValveCommand { opening: 0.0, alive: self.alive, echo: echo(cycle), enable: false }
    }

    /// Status for the bus: it has nothing to do, so it is done when the drive is.
    #[must_use]
    pub fn status(&self, drive: MainChainState) -> ChainStatus {
        ChainStatus { main_chain: drive, ok: true, ..ChainStatus::default() }
    }

    /// Values for the bus: where the axis is, which is where it shall be.
    #[must_use]
    pub fn values(&self) -> ChainValues {
        ChainValues {
            averaged_position_m: self.position_m,
            position_set_point_m: self.position_m,
            ..ChainValues::default()
        }
    }
}

/// The alive counter of the next command.
fn next_alive(alive: u8) -> u8 {
    ((u64::from(alive) + 1) % ALIVE_RANGE) as u8
}

/// Low bits of the cycle that a command answers.
fn echo(cycle: u64) -> u16 {
    (cycle % ECHO_RANGE) as u16
}
