//! Both chains that lead an axis, wired: emergency stop chain, main chain, and the trip by a fault, in this order each cycle.
//!
//! ```text
//!   rig status, frames ──► emergency stop ──► main ──► what is asked
//!                                 ▲             │ enters fault, or a fault is reported while it is in fault
//!                                 └─── trip ────┘
//! ```
//!
//! A fault trips once, when it comes: what was released since stays released, unless its cause comes again.

use super::emergency_stop::{EmergencyStopChain, StopConfig, StopInputs};
use super::main::{AxisMeasurement, MainChain, MainConfig, MainInputs, MainOutput};
use super::{Console, Fault, Partner};
use protocol::frames::{EmergencyStopReason, RigStatus};

#[derive(Clone, Copy, Debug, Default)]
pub struct LeadingInputs {
    pub cycle: u64,
    pub rig: Option<RigStatus>,
    /// `None` before the first sensors of this axis, and while they are lost.
    pub measurement: Option<AxisMeasurement>,
    pub prepared: bool,
    pub partner: Partner,
    /// An EmergencyStop frame without release came since the last cycle, from anybody but this controller.
    pub frame: Option<EmergencyStopReason>,
    pub console: Console,
    /// A fault of this axis that was found since the last cycle.
    pub fault: Option<Fault>,
}

#[derive(Clone, Debug)]
pub struct Leading {
    pub(crate) main: MainChain,
    pub(crate) stop: EmergencyStopChain,
    partner_needed: bool,
    pub(crate) output: Option<MainOutput>,
}

impl Leading {
    /// A main chain that waits for the rig, and an emergency stop chain that is ready.
    pub fn new(main: MainConfig, supply_pressure_pa: f64) -> Self {
        let stop = StopConfig { after_emergency_stop: main.after_emergency_stop, supply_pressure_pa };
        Self {
            partner_needed: main.partner_needed,
            main: MainChain::new(main),
            stop: EmergencyStopChain::new(stop),
            output: None,
        }
    }

    /// Moves both on by one edge at most, and trips for a fault that is new.
    pub fn advance(&mut self, inputs: &LeadingInputs) -> MainOutput {
        let LeadingInputs { cycle, rig, measurement, prepared, partner, frame, console, fault } = *inputs;
        let emergency_stop = self.stop.advance(&StopInputs {
            cycle,
            rig,
            frame,
            console,
            at_standstill: self.main.still(),
            partner_fresh: !self.partner_needed || partner.fresh(cycle).is_some(),
            sensors_fresh: measurement.is_some(),
        });
        let main = MainInputs { cycle, measurement, prepared, partner, emergency_stop, console, fault };
        let output = self.main.advance(&main);
        let was_in_fault = self.output.is_some_and(|before| before.fault.is_some());
        // While in fault the chain keeps the first one; another, or the same again, trips all the same.
        let new = if was_in_fault { fault } else { output.fault };
        if let Some(fault) = new {
            self.stop.trip(fault, cycle);
        }
        self.output = Some(output);
        output
    }

    /// The rig's time begins anew at `cycle`: so do both.
    pub fn restart(&mut self, cycle: u64) {
        self.main.restart(cycle);
        self.stop.restart(cycle);
        self.output = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chains::duo::{Duo, short};
    use crate::chains::settled::ControlError;
    use protocol::frames::{EmergencyStopChainState as E, MainChainState as S};

    const FAR: ControlError = ControlError::Position { error_m: 0.1 };

    fn alone() -> Duo {
        let mut duo = Duo::new(&MainConfig { partner_needed: false, ..short() });
        duo.axes[1].alive = false;
        duo
    }

    #[test]
    fn an_own_fault_is_released_by_a_person_and_the_run_begins_anew_to_its_end() {
        let mut duo = alone();
        duo.axes[0].error = FAR;
        duo.run_to(S::Fault);
        assert_eq!(duo.faults()[0], Some(Fault::SettlingTimeout));
        duo.run(1500);
        assert_eq!(duo.axes[0].stop_state(), E::WaitingForRelease);
        duo.axes[0].error = ControlError::None;
        duo.console.release = true;
        duo.step();
        duo.run(2);
        assert_eq!(duo.axes[0].stop_state(), E::Recovering, "and the withdrawal is sent");
        duo.run(210);
        assert_eq!((duo.axes[0].stop_state(), duo.axes[0].state()), (E::Ready, S::InitialPositioning));
        duo.run(3000);
        assert_eq!(duo.axes[0].state(), S::Done);
    }

    #[test]
    fn the_same_fault_trips_again_when_it_comes_again_while_the_rig_recovers() {
        let mut duo = alone();
        duo.axes[0].error = FAR;
        duo.run_to(S::Fault);
        duo.run(1500);
        duo.console.release = true;
        duo.run(5);
        assert_eq!(duo.axes[0].stop_state(), E::Recovering);
        duo.axes[0].fault = Some(Fault::SensorLoss);
        duo.step();
        assert_eq!(duo.axes[0].stop_state(), E::Tripped);
        assert_eq!(duo.axes[0].leading.stop.holds(), Some(Fault::SensorLoss));
    }
}
