//! One axis controller: what came over the bus in, a valve command and a word for the partner out, once a cycle.
//!
//! ```text
//!   hear(frame)*      partner's status and values, emergency stops, the console
//!   answer(sensors) ─► emergency stop chain ─► main chain ─► work: what is asked ─► program: opening ─► Answer
//! ```
//!
//! Drive and load are the same code; what differs is their work (a position, a force, or nothing) and their program. They
//! know each other through what was heard alone. Nothing here allocates, locks, prints or blocks.

mod average;
mod record;
mod work;

pub use record::{Answer, AxisRecord};
pub use work::{ForcePlan, Plan, PrepareStep};

use crate::chains::emergency_stop::{EmergencyStopChain, StopConfig, StopInputs};
use crate::chains::main::{MainCause, MainChain, MainConfig, MainInputs, MainOutput, OwnAxis, Phase};
use crate::chains::settled::ControlError;
use crate::chains::{AfterStop, Console, Fault, Partner};
use crate::figures::PositionFigures;
use crate::guard::AlgorithmFault;
use crate::program::{Hand, Program};
use crate::station::News;
use average::Average;
use plant::Axis;
use protocol::frames::{
    ALIVE_RANGE, ChainStatus, ChainValues, DRIVE_CHAIN_VALUES, ECHO_RANGE, EmergencyStop,
    EmergencyStopChainState, EmergencyStopReason, Frame, MainChainState, RigStatus, Sensors, ValveCommand,
};
use work::{Asked, Seen, Work};

/// Period of status and values, in cycles.
const SLOW_PERIOD: u64 = protocol::periods::CHAIN_CYCLES;
/// Cycles within the period in which status and values of drive and load are sent: none falls on the rig's tick (0) or status
/// (5), nor on another.
const SLOW_PHASES: [[u64; 2]; 2] = [[2, 3], [7, 8]];

/// Positions and forces that the values can carry; those of both axes are alike.
const LEAST_M: f64 = DRIVE_CHAIN_VALUES.signals[0].min;
const MOST_M: f64 = DRIVE_CHAIN_VALUES.signals[0].max;
const MOST_N: f64 = DRIVE_CHAIN_VALUES.signals[2].max;

/// A parameter that changes at a time of the experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedChange {
    /// When, s from the experiment's start.
    pub at_s: f64,
    /// Place in the list of variables.
    pub place: usize,
    /// Its value, checked.
    pub value: f64,
}

/// What an axis controller is made of.
pub struct AxisParts {
    /// Which axis.
    pub axis: Axis,
    /// Its program.
    pub program: Program,
    /// What it does in the experiment.
    pub plan: Plan,
    /// Its main chain.
    pub main: MainConfig,
    /// Nominal supply pressure, absolute, Pa.
    pub supply_pressure_pa: f64,
    /// Parameters that change, by time.
    pub changes: Vec<PlannedChange>,
    /// A row of the record every so many cycles.
    pub record_every: u64,
}

/// What was heard since the last answer.
#[derive(Default)]
struct Heard {
    partner: Partner,
    partner_spoke: bool,
    console: Console,
    stop: Option<EmergencyStopReason>,
}

/// Parameters changed by plan, and what they were before.
struct Changes {
    planned: Vec<PlannedChange>,
    before: Vec<(usize, f64)>,
    done: usize,
}

/// The controller of one axis.
pub struct AxisController {
    axis: Axis,
    program: Program,
    work: Work,
    main: MainChain,
    main_config: MainConfig,
    stop: EmergencyStopChain,
    heard: Heard,
    changes: Changes,
    supply_pressure_pa: f64,
    record_every: u64,
    figures: PositionFigures,
    average: Average,
    fault: Option<Fault>,
    algorithm_fault: Option<AlgorithmFault>,
    asked: Option<Asked>,
    output: Option<MainOutput>,
    told: ChainStatus,
    /// Cycle answered last.
    answered: Option<u64>,
    /// Periods of status and values in which they were sent last.
    periods: [u64; 2],
    alive: u8,
}

impl AxisController {
    /// A controller that waits for its rig.
    #[must_use]
    pub fn new(parts: AxisParts) -> Self {
        let AxisParts { axis, program, plan, main, supply_pressure_pa, mut changes, record_every } = parts;
        changes.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        let before = changes.iter().map(|change| (change.place, program.values()[change.place])).collect();
        let stop = StopConfig { after_emergency_stop: main.after_emergency_stop, supply_pressure_pa };
        Self {
            axis,
            work: Work::new(plan, &main),
            program,
            main: MainChain::new(main.clone()),
            main_config: main,
            stop: EmergencyStopChain::new(stop),
            heard: Heard::default(),
            changes: Changes { planned: changes, before, done: 0 },
            supply_pressure_pa,
            record_every,
            figures: PositionFigures::default(),
            average: Average::default(),
            fault: None,
            algorithm_fault: None,
            asked: None,
            output: None,
            told: ChainStatus::default(),
            answered: None,
            periods: [0; 2],
            alive: 0,
        }
    }

    /// Takes a frame that is none of the own sensors and nothing of the rig's.
    pub fn hear(&mut self, frame: &Frame) {
        let (own, heard) = (self.axis, &mut self.heard);
        match (own, frame) {
            (Axis::Load, Frame::DriveChainStatus(status)) | (Axis::Drive, Frame::LoadChainStatus(status)) => {
                heard.partner.status = Some(*status);
                heard.partner_spoke = true;
            }
            (Axis::Load, Frame::DriveChainValues(values)) | (Axis::Drive, Frame::LoadChainValues(values)) => {
                heard.partner.values = Some(*values);
            }
            (Axis::Load, Frame::DriveEmergencyStop(stop))
            | (Axis::Drive, Frame::LoadEmergencyStop(stop))
            | (_, Frame::RigEmergencyStop(stop)) => heard.stop_frame(stop),
            (_, Frame::ConsoleEmergencyStop(stop)) => {
                heard.console.release |= stop.release;
                heard.stop_frame(stop);
            }
            (_, Frame::RunControl(control)) => {
                heard.console.take_run_control(control, self.main_config.experiment);
            }
            _ => {}
        }
    }

    /// The answer to the sensors of `cycle`.
    pub fn answer(&mut self, cycle: u64, sensors: &Sensors, rig: Option<&RigStatus>) -> Answer {
        // Until the rig has told its supply pressure, the nominal one is the best guess.
        let supply_pa = rig.map_or(self.supply_pressure_pa, |rig| rig.supply_pressure_pa);
        self.program.observe(cycle, sensors, supply_pa);
        self.average.take(sensors.position_m);
        self.listen(cycle);
        let output = self.advance(cycle, rig, rig.map(|_| self.own_axis(sensors)));
        let seen = Seen { cycle, rig, partner: &self.heard.partner, still: self.main.still() };
        self.asked = self.work.ask(&output, &seen, &mut self.program);
        self.fault = self.work.fault();
        if self.fault.is_some() {
            self.asked = None;
        }
        self.change_parameters(&output);
        let command = self.command(cycle);
        if let Some(fault) = self.fault {
            self.stop.trip(fault, cycle);
        }
        self.take_figures(&output, sensors);
        let record = cycle.is_multiple_of(self.record_every).then(|| self.record(cycle, sensors, &command));
        self.answer_with(cycle, command, record)
    }

    /// Notes when the partner was heard. Cycles that the rig skipped, or that this process missed, are no silence of its: it
    /// had nothing to answer, or nobody listened.
    fn listen(&mut self, cycle: u64) {
        let missed = self.answered.map_or(0, |last| cycle.saturating_sub(last + 1));
        self.answered = Some(cycle);
        let heard = &mut self.heard.partner.heard;
        *heard = heard.map(|heard| heard + missed);
        if std::mem::take(&mut self.heard.partner_spoke) {
            *heard = Some(cycle);
        }
    }

    /// What is to be said in `cycle` though no own sensors came, which is a fault once it lasted.
    pub fn without_sensors(&mut self, cycle: u64) -> Option<EmergencyStop> {
        self.fault = Some(Fault::SensorLoss);
        self.advance(cycle, None, None);
        self.program.shut();
        self.stop.frame_due(cycle)
    }

    /// Both chains that lead, moved on.
    fn advance(&mut self, cycle: u64, rig: Option<&RigStatus>, own: Option<OwnAxis>) -> MainOutput {
        let Heard { partner, console, stop, .. } = &mut self.heard;
        let console = std::mem::take(console);
        let partner_fresh = !self.main_config.partner_needed || partner.fresh(cycle).is_some();
        let emergency_stop = self.stop.advance(&StopInputs {
            cycle,
            rig: rig.copied(),
            frame: stop.take(),
            console,
            at_standstill: self.main.still(),
            partner_fresh,
            sensors_fresh: own.is_some(),
        });
        let output = self.main.advance(&MainInputs {
            cycle,
            own,
            prepared: self.work.prepared(),
            partner: *partner,
            emergency_stop,
            console,
            fault: self.fault.take(),
        });
        if let Some(fault) = output.fault {
            self.stop.trip(fault, cycle);
        }
        let before = self.output.map(|output| output.state);
        if output.state == MainChainState::InitialPositioning && before != Some(output.state) {
            self.algorithm_fault = None;
            self.program.restart_algorithms();
        }
        self.output = Some(output);
        output
    }

    fn own_axis(&self, sensors: &Sensors) -> OwnAxis {
        let error = match &self.asked {
            Some(Asked { demand, hand: Hand::User }) => self.work.error(demand, self.program.ready()),
            _ => ControlError::None,
        };
        OwnAxis { position_m: sensors.position_m - self.program.geometry().offset_m, error }
    }

    fn command(&mut self, cycle: u64) -> ValveCommand {
        self.alive = ((u64::from(self.alive) + 1) % ALIVE_RANGE) as u8;
        let shut = ValveCommand {
            opening: 0.0,
            alive: self.alive,
            echo: (cycle % ECHO_RANGE) as u16,
            enable: false,
        };
        let Some(Asked { demand, hand }) = &self.asked else {
            self.program.shut();
            return shut;
        };
        match self.program.control(cycle, demand, *hand) {
            Ok(output) => ValveCommand { opening: output.opening, enable: true, ..shut },
            Err(fault) => {
                self.algorithm_fault = Some(fault);
                self.fault = Some(Fault::ControllerFault);
                self.program.shut();
                shut
            }
        }
    }

    /// What is planned for the time that the experiment has reached; what was changed goes back before it begins.
    fn change_parameters(&mut self, output: &MainOutput) {
        let Changes { planned, before, done } = &mut self.changes;
        match output.phase {
            Phase::Experiment { elapsed_s } => {
                while let Some(change) = planned.get(*done).filter(|change| change.at_s <= elapsed_s) {
                    // The value was checked when the experiment was read.
                    let _ = self.program.set(change.place, change.value);
                    *done += 1;
                }
            }
            Phase::Approach { .. } if *done > 0 => {
                *done = 0;
                for (place, value) in before.iter().rev() {
                    let _ = self.program.set(*place, *value);
                }
            }
            _ => {}
        }
    }

    fn take_figures(&mut self, output: &MainOutput, sensors: &Sensors) {
        match (&self.asked, output.state) {
            (Some(Asked { demand, hand: Hand::User }), MainChainState::Experiment)
                if self.work.is_position() =>
            {
                self.figures.take(&demand.position, sensors.position_m);
            }
            _ => self.figures.end_rest(),
        }
    }

    fn record(&self, cycle: u64, sensors: &Sensors, command: &ValveCommand) -> AxisRecord {
        let geometry = self.program.geometry();
        let status = self.status();
        let asked = self.asked.as_ref();
        AxisRecord {
            axis: self.axis,
            cycle,
            main: status.main_chain,
            force_chain: status.force_chain,
            matching: status.matching_chain,
            emergency_stop: status.emergency_stop_chain,
            set_position: asked.filter(|_| self.work.is_position()).map(|asked| asked.demand.position),
            set_force: asked.filter(|_| !self.work.is_position()).map(|asked| asked.demand.force),
            position_m: sensors.position_m - geometry.offset_m,
            velocity_m_per_s: geometry.direction() * self.program.ready().velocity_m_per_s,
            force_n: sensors.force_n,
            wanted_velocity_m_per_s: asked.map_or(0.0, |asked| self.program.wanted_m_per_s(asked.hand)),
            opening: command.opening,
            enabled: command.enable,
        }
    }

    fn answer_with(&mut self, cycle: u64, command: ValveCommand, record: Option<AxisRecord>) -> Answer {
        let status = self.status();
        let changed = status != self.told;
        let news = (status.main_chain != self.told.main_chain).then(|| News::State {
            axis: self.axis,
            state: status.main_chain,
            cycle,
            cause: self.main.entered().cause,
        });
        // Counted, so that a cycle that was skipped puts off what was due in it and does not drop it.
        let periods = SLOW_PHASES[self.axis.index()].map(|phase| (cycle + SLOW_PERIOD - phase) / SLOW_PERIOD);
        let [status_due, values_due] = [0, 1].map(|which| changed || periods[which] != self.periods[which]);
        self.periods = periods;
        self.told = status;
        Answer {
            command,
            emergency_stop: self.stop.frame_due(cycle),
            status: status_due.then_some(status),
            values: values_due.then(|| self.values()),
            news,
            record,
        }
    }

    /// Status for the bus.
    #[must_use]
    pub fn status(&self) -> ChainStatus {
        let (main_chain, ok, repetition) =
            self.output.map_or((MainChainState::WaitingForRig, false, 0), |output| {
                (output.state, output.ok, output.repetition)
            });
        ChainStatus {
            main_chain,
            force_chain: self.work.force_chain(main_chain),
            matching_chain: self.work.matching_chain(),
            emergency_stop_chain: self.stop.state(),
            ok,
            experiment: self.main_config.experiment,
            // The counter wraps as its field in rig.dbc does.
            repetition: repetition as u8,
        }
    }

    /// Values for the bus.
    fn values(&self) -> ChainValues {
        let average_m = self.average.value();
        let demand = self.asked.as_ref().map(|asked| asked.demand);
        let set_position_m = match demand {
            Some(demand) if self.work.is_position() => demand.position.position_m,
            _ => average_m,
        };
        let now_m = self.average.last();
        ChainValues {
            averaged_position_m: average_m.clamp(LEAST_M, MOST_M),
            position_set_point_m: set_position_m.clamp(LEAST_M, MOST_M),
            force_set_point_n: demand.map_or(0.0, |demand| demand.force.force_n.clamp(-MOST_N, MOST_N)),
            control_error_m: if self.work.is_position() { set_position_m - now_m } else { 0.0 },
        }
    }

    /// The rig's time began again.
    pub fn restart(&mut self) {
        self.main.restart(0);
        self.stop.restart(0);
        self.work.restart();
        self.program.restart();
        self.heard = Heard::default();
        self.figures.end_rest();
        (self.asked, self.output, self.fault, self.answered) = (None, None, None, None);
    }

    /// Which axis.
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// State of the main chain.
    #[must_use]
    pub fn state(&self) -> MainChainState {
        self.status().main_chain
    }

    /// Why the main chain came to its state.
    #[must_use]
    pub fn cause(&self) -> MainCause {
        self.main.entered().cause
    }

    /// Whether a stopped axis may begin anew.
    #[must_use]
    pub fn may_restart(&self) -> bool {
        self.main_config.after_emergency_stop != AfterStop::End
    }

    /// State of the emergency stop chain.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStopChainState {
        self.stop.state()
    }

    /// Its program, whose variables may be changed between two cycles.
    pub fn program_mut(&mut self) -> &mut Program {
        &mut self.program
    }

    /// Its program.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Figures of the position control so far.
    #[must_use]
    pub fn figures(&self) -> &PositionFigures {
        &self.figures
    }

    /// Why the algorithm is no longer asked.
    #[must_use]
    pub fn algorithm_fault(&self) -> Option<AlgorithmFault> {
        self.algorithm_fault
    }

    /// How often the experiment has been driven through.
    #[must_use]
    pub fn repetitions_done(&self) -> u32 {
        self.output.map_or(0, |output| output.repetition + u32::from(output.state == MainChainState::Done))
    }
}

impl Heard {
    fn stop_frame(&mut self, stop: &EmergencyStop) {
        if !stop.release {
            self.stop = Some(stop.reason);
        }
    }
}
