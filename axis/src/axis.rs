//! One axis controller: what came over the bus in, a valve command and a word for the partner out, once a cycle.
//!
//! ```text
//!   receive(frame)*   partner's status and values, emergency stops, the console
//!   answer(sensors) ─► emergency stop chain ─► main chain ─► request ─► program: opening ─► Answer
//! ```
//!
//! Drive and load are the same code; what differs is their plan (a position, a force, or nothing) and their program. They
//! know each other through received frames alone. Nothing here allocates, locks, prints or blocks.

pub(crate) mod average;
mod by_hand;
mod changes;
mod range;
mod received;
mod record;
mod slow;
mod work;

pub(crate) use changes::PlannedChange;
pub use record::{Answer, AxisRecord, NumberColumn, StateColumn};
pub(crate) use work::{ForcePlan, Plan};

use crate::chains::leading::{SupervisoryChains, SupervisoryInputs};
use crate::chains::main::{AxisMeasurement, MainCause, MainConfig, MainOutput};
use crate::chains::settled::ControlError;
use crate::chains::{AfterStop, Fault};
use crate::figures::PositionFigures;
use crate::node::NodeEvent;
use crate::program::{ActiveAlgorithm, Program};
use algorithms::guard::AlgorithmFault;
use average::Average;
use changes::Changes;
use nominal::Axis;
use protocol::frames::{
    ALIVE_RANGE, ECHO_RANGE, EmergencyStop, EmergencyStopChainState, Frame, MainChainState, RigStatus,
    Sensors, ValveCommand,
};
use range::Range;
use received::Received;
use slow::StatusSchedule;
use work::{ControlRequest, CycleInputs, DemandGenerator};

/// Program, task and configuration of an axis, as its files give them.
pub(crate) struct AxisParts {
    pub(crate) axis: Axis,
    pub(crate) program: Program,
    pub(crate) plan: Plan,
    pub(crate) main: MainConfig,
    /// Nominal supply pressure, absolute, Pa.
    pub(crate) supply_pressure_pa: f64,
    pub(crate) changes: Vec<PlannedChange>,
    /// A row of the record every so many cycles.
    pub(crate) record_every: u64,
}

/// Controller of one axis: its chains and its program, and what they keep from cycle to cycle.
pub struct AxisController {
    /// Axis whose sensors it answers and whose valve it commands.
    pub axis: Axis,
    /// Its variables may be changed between two cycles.
    pub program: Program,
    demand_generator: DemandGenerator,
    supervisory: SupervisoryChains,
    main_config: MainConfig,
    received: Received,
    changes: Changes,
    supply_pressure_pa: f64,
    record_every: u64,
    /// Errors of the position control since the rig's time began; none on an axis under force control.
    pub figures: PositionFigures,
    average: Average,
    range: Range,
    /// The newest status of the rig, however old.
    rig: Option<RigStatus>,
    fault: Option<Fault>,
    algorithm_fault: Option<AlgorithmFault>,
    request: Option<ControlRequest>,
    status_schedule: StatusSchedule,
    alive: u8,
}

impl AxisController {
    /// A controller before its first cycle, its main chain waiting for the rig.
    pub(crate) fn new(parts: AxisParts) -> Self {
        let AxisParts { axis, program, plan, main, supply_pressure_pa, changes, record_every } = parts;
        Self {
            axis,
            demand_generator: DemandGenerator::new(plan, &main),
            changes: Changes::new(changes, &program),
            program,
            supervisory: SupervisoryChains::new(main.clone(), supply_pressure_pa),
            received: Received::new(axis, main.experiment),
            main_config: main,
            supply_pressure_pa,
            record_every,
            figures: PositionFigures::default(),
            average: Average::default(),
            range: Range::default(),
            rig: None,
            fault: None,
            algorithm_fault: None,
            request: None,
            status_schedule: StatusSchedule::new(axis),
            alive: 0,
        }
    }

    /// Processes a frame other than this axis's sensors and the rig's tick and status.
    pub fn receive(&mut self, frame: &Frame) {
        self.received.take(frame);
    }

    /// The answer to the sensors of `cycle`; `rig` is the rig's status if it is fresh.
    ///
    /// A status that is no longer fresh shuts nothing: rods do not part and supplies do not change because frames are lost, and
    /// an emergency stop comes as a frame of its own. The last status holds; the way back from an emergency stop
    /// waits for a fresh one.
    pub fn answer(&mut self, cycle: u64, sensors: &Sensors, rig: Option<&RigStatus>) -> Answer {
        self.rig = rig.copied().or(self.rig);
        // Until the rig has reported its supply pressure, the nominal one is the best guess.
        let supply_pa = self.rig.map_or(self.supply_pressure_pa, |rig| rig.supply_pressure_pa);
        self.program.observe(cycle, sensors, supply_pa);
        self.average.take(sensors.position_m);
        self.received.update_partner_age(cycle);
        let output = self.advance(cycle, rig, self.rig.map(|_| self.measurement(sensors)));
        let partner = &self.received.partner;
        let hand_set_point = self.received.hand_set_point.take();
        let inputs = CycleInputs {
            cycle,
            rig: self.rig.as_ref(),
            partner,
            still: self.supervisory.main.still(),
            hand_set_point,
        };
        self.request = self.demand_generator.request(&output, &inputs, &mut self.program);
        let saturation = self.range.take(self.axis, rig, output.phase);
        self.fault = self.demand_generator.fault().or(saturation);
        if self.fault.is_some() {
            self.request = None;
        }
        self.changes.follow(output.phase, &mut self.program);
        let command = self.command(cycle);
        if let Some(fault) = self.fault {
            self.supervisory.stop.trip(fault, cycle);
        }
        self.take_figures(&output, sensors);
        let record = cycle.is_multiple_of(self.record_every).then(|| self.record(cycle, sensors, &command));
        self.answer_with(cycle, command, record)
    }

    /// The emergency stop to send in `cycle` when no sensors of this axis came for too long, which is a fault.
    pub(crate) fn without_sensors(&mut self, cycle: u64) -> Option<EmergencyStop> {
        self.fault = Some(Fault::SensorLoss);
        self.advance(cycle, None, None);
        self.program.shut();
        self.supervisory.stop.frame_due(cycle)
    }

    fn advance(
        &mut self,
        cycle: u64,
        rig: Option<&RigStatus>,
        measurement: Option<AxisMeasurement>,
    ) -> MainOutput {
        let before = self.supervisory.output.map(|output| output.state);
        let output = self.supervisory.advance(&SupervisoryInputs {
            cycle,
            rig: rig.copied(),
            measurement,
            prepared: self.demand_generator.prepared(),
            partner: self.received.partner,
            frame: self.received.stop.take(),
            console: std::mem::take(&mut self.received.console),
            fault: self.fault.take(),
        });
        if output.state == MainChainState::InitialPositioning && before != Some(output.state) {
            self.algorithm_fault = None;
            self.program.restart_algorithms();
        }
        output
    }

    fn measurement(&self, sensors: &Sensors) -> AxisMeasurement {
        let error = match &self.request {
            Some(ControlRequest { demand, algorithm: ActiveAlgorithm::User }) => {
                self.demand_generator.error(demand, self.program.algorithm_input())
            }
            _ => ControlError::None,
        };
        AxisMeasurement { position_m: sensors.position_m - self.program.geometry().offset_m, error }
    }

    fn command(&mut self, cycle: u64) -> ValveCommand {
        self.alive = ((u64::from(self.alive) + 1) % ALIVE_RANGE) as u8;
        let shut = ValveCommand {
            opening: 0.0,
            alive: self.alive,
            echo: (cycle % ECHO_RANGE) as u16,
            enable: false,
        };
        let Some(ControlRequest { demand, algorithm }) = &self.request else {
            self.program.shut();
            return shut;
        };
        match self.program.control(cycle, demand, *algorithm) {
            Ok(output) => ValveCommand { opening: output.opening, enable: true, ..shut },
            Err(fault) => {
                self.algorithm_fault = Some(fault);
                self.fault = Some(Fault::ControllerFault);
                self.program.shut();
                shut
            }
        }
    }

    fn take_figures(&mut self, output: &MainOutput, sensors: &Sensors) {
        match (&self.request, output.state) {
            (
                Some(ControlRequest { demand, algorithm: ActiveAlgorithm::User }),
                MainChainState::Experiment,
            ) if self.demand_generator.is_position() => {
                self.figures.take(&demand.position, sensors.position_m);
            }
            // What an emergency stop cut off is no positioning.
            (_, MainChainState::Aborted | MainChainState::Fault) => self.figures.drop_repetition(),
            _ => self.figures.end_repetition(),
        }
    }

    fn answer_with(&mut self, cycle: u64, command: ValveCommand, record: Option<AxisRecord>) -> Answer {
        let status = self.status();
        let due = self.status_schedule.due(cycle, &status);
        let news = due.state_changed.then(|| NodeEvent::State {
            axis: self.axis,
            state: status.main_chain,
            cycle,
            cause: self.cause(),
        });
        Answer {
            command,
            emergency_stop: self.supervisory.stop.frame_due(cycle),
            status: due.status.then_some(status),
            values: due.values.then(|| self.values()),
            news,
            record,
        }
    }

    /// The rig's time began again, or it is another rig: nothing of the old one is kept. What a person has changed of the
    /// program stays.
    pub fn restart(&mut self) {
        self.supervisory.restart(0);
        self.demand_generator.restart();
        self.changes.take_back(&mut self.program);
        self.program.restart();
        self.received = Received::new(self.axis, self.main_config.experiment);
        self.figures = PositionFigures::default();
        self.average = Average::default();
        self.range = Range::default();
        self.status_schedule = StatusSchedule::new(self.axis);
        (self.rig, self.fault, self.algorithm_fault, self.request, self.alive) = (None, None, None, None, 0);
    }

    /// Why the algorithm is no longer called; `None` again from the next initial positioning on.
    pub fn algorithm_fault(&self) -> Option<AlgorithmFault> {
        self.algorithm_fault
    }

    /// State of the main chain since the last cycle; waiting for the rig before the first.
    pub fn state(&self) -> MainChainState {
        self.status().main_chain
    }

    /// Why the main chain entered its state.
    pub fn cause(&self) -> MainCause {
        self.supervisory.main.entered.cause
    }

    /// Whether the run can begin anew after an abort or a fault.
    pub(crate) fn may_restart(&self) -> bool {
        self.main_config.after_emergency_stop != AfterStop::End
    }

    /// State of the emergency stop chain; the valve is shut in all but ready.
    pub fn emergency_stop(&self) -> EmergencyStopChainState {
        self.supervisory.stop.state()
    }

    /// How often the experiment has been driven through.
    pub fn repetitions_done(&self) -> u32 {
        self.supervisory
            .output
            .map_or(0, |output| output.repetition + u32::from(output.state == MainChainState::Done))
    }
}
