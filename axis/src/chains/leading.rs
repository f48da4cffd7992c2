//! The supervisory chains of an axis, connected: emergency stop chain, main chain, and the trip by a fault, in this order each
//! cycle.
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

/// Inputs of both chains in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SupervisoryInputs {
    pub(crate) cycle: u64,
    /// Status of the rig if it is fresh.
    pub(crate) rig: Option<RigStatus>,
    /// `None` before the first sensors of this axis, and while they are lost.
    pub(crate) measurement: Option<AxisMeasurement>,
    /// All steps of the preparation are done, or there are none.
    pub(crate) prepared: bool,
    pub(crate) partner: Partner,
    /// An EmergencyStop frame without release came since the last cycle, from anybody but this controller.
    pub(crate) frame: Option<EmergencyStopReason>,
    pub(crate) console: Console,
    /// A fault of this axis that was found since the last cycle.
    pub(crate) fault: Option<Fault>,
}

/// Emergency stop chain and main chain of an axis.
#[derive(Clone, Debug)]
pub(crate) struct SupervisoryChains {
    pub(crate) main: MainChain,
    pub(crate) stop: EmergencyStopChain,
    partner_needed: bool,
    pub(crate) output: Option<MainOutput>,
}

impl SupervisoryChains {
    /// A main chain that waits for the rig, and an emergency stop chain that is ready. The supply pressure is nominal, absolute.
    pub(crate) fn new(main: MainConfig, supply_pressure_pa: f64) -> Self {
        let stop = StopConfig { after_emergency_stop: main.after_emergency_stop, supply_pressure_pa };
        Self {
            partner_needed: main.partner_needed,
            main: MainChain::new(main),
            stop: EmergencyStopChain::new(stop),
            output: None,
        }
    }

    /// Moves both on by one edge at most, and trips for a fault that is new.
    pub(crate) fn advance(&mut self, inputs: &SupervisoryInputs) -> MainOutput {
        let SupervisoryInputs { cycle, rig, measurement, prepared, partner, frame, console, fault } = *inputs;
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
    pub(crate) fn restart(&mut self, cycle: u64) {
        self.main.restart(cycle);
        self.stop.restart(cycle);
        self.output = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chains::duo::{alone, short};
    use crate::chains::settled::ControlError;
    use protocol::frames::{EmergencyStopChainState as E, MainChainState as S};

    const FAR: ControlError = ControlError::Position { error_m: 0.1 };

    #[test]
    fn an_own_fault_is_released_by_a_person_and_the_run_begins_anew_to_its_end() {
        let mut pair = alone(short());
        pair.axes[0].error = FAR;
        pair.run_to(S::Fault);
        assert_eq!(pair.faults()[0], Some(Fault::SettlingTimeout));
        pair.run(1500);
        assert_eq!(pair.axes[0].stop_state(), E::WaitingForRelease);
        pair.axes[0].error = ControlError::None;
        pair.console.release = true;
        pair.step();
        pair.run(2);
        assert_eq!(pair.axes[0].stop_state(), E::Recovering, "and the withdrawal is sent");
        pair.run(210);
        assert_eq!((pair.axes[0].stop_state(), pair.axes[0].state()), (E::Ready, S::InitialPositioning));
        pair.run(3000);
        assert_eq!(pair.axes[0].state(), S::Done);
    }

    #[test]
    fn the_same_fault_trips_again_when_it_comes_again_while_the_rig_recovers() {
        let mut pair = alone(short());
        pair.axes[0].error = FAR;
        pair.run_to(S::Fault);
        pair.run(1500);
        pair.console.release = true;
        pair.run(5);
        assert_eq!(pair.axes[0].stop_state(), E::Recovering);
        pair.axes[0].fault = Some(Fault::SensorLoss);
        pair.step();
        assert_eq!(pair.axes[0].stop_state(), E::Tripped);
        assert_eq!(pair.axes[0].supervisory.stop.holds(), Some(Fault::SensorLoss));
    }
}
