//! One axis controller: what came over the bus in, a valve command and a word for the partner out, once a cycle.
//!
//! ```text
//!   hear(frame)*      partner's status and values, emergency stops, the console
//!   answer(sensors) ─► emergency stop chain ─► main chain ─► work: what is asked ─► program: opening ─► Answer
//! ```
//!
//! Drive and load are the same code; what differs is their work (a position, a force, or nothing) and their program. They
//! know each other through what was heard alone. Nothing here allocates, locks, prints or blocks.

pub(crate) mod average;
mod by_hand;
mod changes;
mod range;
mod received;
mod record;
mod slow;
mod work;

pub use changes::PlannedChange;
pub use record::{Answer, AxisRecord, NumberColumn, StateColumn};
pub use work::{ForcePlan, Plan};

use crate::chains::leading::{Leading, LeadingInputs};
use crate::chains::main::{AxisMeasurement, MainCause, MainConfig, MainOutput};
use crate::chains::settled::ControlError;
use crate::chains::{AfterStop, Fault};
use crate::figures::PositionFigures;
use crate::node::NodeEvent;
use crate::program::{Hand, Program};
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
use slow::Slow;
use work::{Asked, Seen, Work};

pub struct AxisParts {
    pub axis: Axis,
    pub program: Program,
    pub plan: Plan,
    pub main: MainConfig,
    /// Nominal supply pressure, absolute, Pa.
    pub supply_pressure_pa: f64,
    pub changes: Vec<PlannedChange>,
    /// A row of the record every so many cycles.
    pub record_every: u64,
}

pub struct AxisController {
    pub axis: Axis,
    /// Its variables may be changed between two cycles.
    pub program: Program,
    work: Work,
    leading: Leading,
    main_config: MainConfig,
    received: Received,
    changes: Changes,
    supply_pressure_pa: f64,
    record_every: u64,
    pub figures: PositionFigures,
    average: Average,
    range: Range,
    /// What the rig said of itself last, however long ago.
    rig: Option<RigStatus>,
    fault: Option<Fault>,
    algorithm_fault: Option<AlgorithmFault>,
    asked: Option<Asked>,
    slow: Slow,
    alive: u8,
}

impl AxisController {
    pub fn new(parts: AxisParts) -> Self {
        let AxisParts { axis, program, plan, main, supply_pressure_pa, changes, record_every } = parts;
        Self {
            axis,
            work: Work::new(plan, &main),
            changes: Changes::new(changes, &program),
            program,
            leading: Leading::new(main.clone(), supply_pressure_pa),
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
            asked: None,
            slow: Slow::new(axis),
            alive: 0,
        }
    }

    /// Takes a frame that is none of this axis's sensors and nothing of the rig's.
    pub fn hear(&mut self, frame: &Frame) {
        self.received.take(frame);
    }

    /// The answer to the sensors of `cycle`; `rig` is the rig's status if it is fresh.
    ///
    /// A status that is no longer fresh shuts nothing: rods do not part and supplies do not change because frames are lost, and
    /// an emergency stop comes as a frame of its own. What was said last holds; the way back from an emergency stop
    /// waits for a fresh one.
    pub fn answer(&mut self, cycle: u64, sensors: &Sensors, rig: Option<&RigStatus>) -> Answer {
        self.rig = rig.copied().or(self.rig);
        // Until the rig has reported its supply pressure, the nominal one is the best guess.
        let supply_pa = self.rig.map_or(self.supply_pressure_pa, |rig| rig.supply_pressure_pa);
        self.program.observe(cycle, sensors, supply_pa);
        self.average.take(sensors.position_m);
        self.received.listen(cycle);
        let output = self.advance(cycle, rig, self.rig.map(|_| self.measurement(sensors)));
        let partner = &self.received.partner;
        let hand = self.received.hand.take();
        let seen = Seen { cycle, rig: self.rig.as_ref(), partner, still: self.leading.main.still(), hand };
        self.asked = self.work.ask(&output, &seen, &mut self.program);
        let beyond = self.range.take(self.axis, rig, output.phase);
        self.fault = self.work.fault().or(beyond);
        if self.fault.is_some() {
            self.asked = None;
        }
        self.changes.follow(output.phase, &mut self.program);
        let command = self.command(cycle);
        if let Some(fault) = self.fault {
            self.leading.stop.trip(fault, cycle);
        }
        self.take_figures(&output, sensors);
        let record = cycle.is_multiple_of(self.record_every).then(|| self.record(cycle, sensors, &command));
        self.answer_with(cycle, command, record)
    }

    /// What is to be said in `cycle` though no sensors of this axis came, which is a fault once it lasted.
    pub fn without_sensors(&mut self, cycle: u64) -> Option<EmergencyStop> {
        self.fault = Some(Fault::SensorLoss);
        self.advance(cycle, None, None);
        self.program.shut();
        self.leading.stop.frame_due(cycle)
    }

    fn advance(
        &mut self,
        cycle: u64,
        rig: Option<&RigStatus>,
        measurement: Option<AxisMeasurement>,
    ) -> MainOutput {
        let before = self.leading.output.map(|output| output.state);
        let output = self.leading.advance(&LeadingInputs {
            cycle,
            rig: rig.copied(),
            measurement,
            prepared: self.work.prepared(),
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
        let error = match &self.asked {
            Some(Asked { demand, hand: Hand::User }) => self.work.error(demand, self.program.ready()),
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

    fn take_figures(&mut self, output: &MainOutput, sensors: &Sensors) {
        match (&self.asked, output.state) {
            (Some(Asked { demand, hand: Hand::User }), MainChainState::Experiment)
                if self.work.is_position() =>
            {
                self.figures.take(&demand.position, sensors.position_m);
            }
            // What an emergency stop cut off is no positioning.
            (_, MainChainState::Aborted | MainChainState::Fault) => self.figures.drop_repetition(),
            _ => self.figures.end_repetition(),
        }
    }

    fn answer_with(&mut self, cycle: u64, command: ValveCommand, record: Option<AxisRecord>) -> Answer {
        let status = self.status();
        let due = self.slow.due(cycle, &status);
        let news = due.other_state.then(|| NodeEvent::State {
            axis: self.axis,
            state: status.main_chain,
            cycle,
            cause: self.cause(),
        });
        Answer {
            command,
            emergency_stop: self.leading.stop.frame_due(cycle),
            status: due.status.then_some(status),
            values: due.values.then(|| self.values()),
            news,
            record,
        }
    }

    /// The rig's time began again, or it is another rig: nothing of the old one is kept. What a person has changed of the
    /// program stays.
    pub fn restart(&mut self) {
        self.leading.restart(0);
        self.work.restart();
        self.changes.take_back(&mut self.program);
        self.program.restart();
        self.received = Received::new(self.axis, self.main_config.experiment);
        self.figures = PositionFigures::default();
        self.average = Average::default();
        self.range = Range::default();
        self.slow = Slow::new(self.axis);
        (self.rig, self.fault, self.algorithm_fault, self.asked, self.alive) = (None, None, None, None, 0);
    }

    /// Why the algorithm is no longer asked.
    pub fn algorithm_fault(&self) -> Option<AlgorithmFault> {
        self.algorithm_fault
    }

    pub fn state(&self) -> MainChainState {
        self.status().main_chain
    }

    pub fn cause(&self) -> MainCause {
        self.leading.main.entered.cause
    }

    pub fn may_restart(&self) -> bool {
        self.main_config.after_emergency_stop != AfterStop::End
    }

    pub fn emergency_stop(&self) -> EmergencyStopChainState {
        self.leading.stop.state()
    }

    /// How often the experiment has been driven through.
    pub fn repetitions_done(&self) -> u32 {
        self.leading
            .output
            .map_or(0, |output| output.repetition + u32::from(output.state == MainChainState::Done))
    }
}
