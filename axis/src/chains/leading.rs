//! Both chains that lead an axis, wired: emergency stop chain, main chain, and the trip by a fault, in this order each cycle.
//!
//! ```text
//!   rig status, frames ──► emergency stop ──► main ──► what is asked
//!                                 ▲             │ enters fault, or a fault is told while it is in fault
//!                                 └─── trip ────┘
//! ```
//!
//! A fault trips once, when it comes: what was released since stays released, unless its cause comes again.

use super::emergency_stop::{EmergencyStopChain, StopConfig, StopInputs};
use super::main::{MainCause, MainChain, MainConfig, MainInputs, MainOutput, OwnAxis};
use super::{Console, Entered, Fault, Partner};
use protocol::frames::{
    EmergencyStop, EmergencyStopChainState, EmergencyStopReason, MainChainState, RigStatus,
};

/// What both are told each cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeadingInputs {
    /// The rig's cycle.
    pub cycle: u64,
    /// The rig's status if it is fresh.
    pub rig: Option<RigStatus>,
    /// Own sensors; `None` before the first, and while they are lost.
    pub own: Option<OwnAxis>,
    /// The steps of preparing are done.
    pub prepared: bool,
    pub partner: Partner,
    /// An EmergencyStop frame without release came since the last cycle, from anybody but this controller.
    pub frame: Option<EmergencyStopReason>,
    /// What the console said since the last cycle.
    pub console: Console,
    /// A fault of the own axis that was found since the last cycle.
    pub fault: Option<Fault>,
}

/// Both chains.
#[derive(Clone, Debug)]
pub struct Leading {
    pub(super) main: MainChain,
    pub(super) stop: EmergencyStopChain,
    partner_needed: bool,
    output: Option<MainOutput>,
}

impl Leading {
    /// A main chain that waits for the rig, and an emergency stop chain that is ready.
    #[must_use]
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
        let LeadingInputs { cycle, rig, own, prepared, partner, frame, console, fault } = *inputs;
        let emergency_stop = self.stop.advance(&StopInputs {
            cycle,
            rig,
            frame,
            console,
            at_standstill: self.main.still(),
            partner_fresh: !self.partner_needed || partner.fresh(cycle).is_some(),
            sensors_fresh: own.is_some(),
        });
        let main = MainInputs { cycle, own, prepared, partner, emergency_stop, console, fault };
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

    /// Trips for a fault that was found after [`advance`](Self::advance), which is to be told of it in the next cycle.
    pub fn trip(&mut self, fault: Fault, cycle: u64) {
        self.stop.trip(fault, cycle);
    }

    /// The frame to send in this cycle, if any; to be asked last.
    pub fn frame_due(&mut self, cycle: u64) -> Option<EmergencyStop> {
        self.stop.frame_due(cycle)
    }

    /// The rig's time begins anew at `cycle`: so do both.
    pub fn restart(&mut self, cycle: u64) {
        self.main.restart(cycle);
        self.stop.restart(cycle);
        self.output = None;
    }

    /// What the main chain said last.
    #[must_use]
    pub fn output(&self) -> Option<&MainOutput> {
        self.output.as_ref()
    }

    /// The state that the main chain entered last, when and why.
    #[must_use]
    pub fn entered(&self) -> Entered<MainChainState, MainCause> {
        self.main.entered()
    }

    /// State of the emergency stop chain.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStopChainState {
        self.stop.state()
    }

    /// The fault for which this controller holds the emergency stop.
    #[must_use]
    pub fn holds(&self) -> Option<Fault> {
        self.stop.holds()
    }

    /// Whether the own axis keeps still.
    #[must_use]
    pub fn still(&self) -> bool {
        self.main.still()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chains::duo::{Duo, short};
    use crate::chains::settled::ControlError;
    use EmergencyStopChainState as E;
    use MainChainState as S;

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
        assert_eq!(duo.axes[0].leading.holds(), Some(Fault::SensorLoss));
    }
}
