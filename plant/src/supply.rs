//! The supply node, and what an emergency stop does to it.
//!
//! ```text
//! stopped:   dp/dt = (p_atm     - p) / 0.05 s
//! released:  dp/dt = (p_nominal - p) / 0.3 s
//! check valves at the chambers are shut while p < 2.5 bar
//! ```
//!
//! The node feeds all supply edges and pilots the non-return valves. It knows nothing of the flow it delivers,
//! so its pressure is an exact exponential of time. In normal running it stands at the nominal pressure to the
//! bit, since the exponential then multiplies zero.
//!
//! Source: rig-model.md, Emergency stop.

use crate::faults::SupplyFault;
use crate::lanes::Form;
use crate::parameters::SupplyParameters;

/// The node's constants.
#[derive(Debug, Clone)]
pub(crate) struct Supply {
    parameters: SupplyParameters,
}

/// The two decay factors of one time span: stopped and released.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SupplyDecay {
    discharge: f64,
    recovery: f64,
}

impl Supply {
    /// The node; a fault puts its target and time constant in place of those of normal running and of a release.
    pub(crate) fn new(parameters: &SupplyParameters, fault: Option<SupplyFault>) -> Self {
        let mut parameters = *parameters;
        if let Some(SupplyFault { pressure_pa, time_constant_s }) = fault {
            (parameters.pressure_pa, parameters.recovery_time_constant_s) = (pressure_pa, time_constant_s);
        }
        Supply { parameters }
    }

    pub(crate) fn decay(&self, span_s: f64) -> SupplyDecay {
        SupplyDecay {
            discharge: libm::exp(-span_s / self.parameters.discharge_time_constant_s),
            recovery: libm::exp(-span_s / self.parameters.recovery_time_constant_s),
        }
    }

    #[inline(always)]
    pub(crate) fn formed<P>(&self, form: &mut impl Form<P>) -> Self {
        let mut one = |number| form.one(number);
        let parameters = &self.parameters;
        let parameters = SupplyParameters {
            pressure_pa: one(parameters.pressure_pa),
            exhaust_pressure_pa: one(parameters.exhaust_pressure_pa),
            atmospheric_pressure_pa: one(parameters.atmospheric_pressure_pa),
            discharge_time_constant_s: one(parameters.discharge_time_constant_s),
            recovery_time_constant_s: one(parameters.recovery_time_constant_s),
            check_valve_pressure_pa: one(parameters.check_valve_pressure_pa),
        };
        Supply { parameters }
    }

    /// Node pressure, Pa absolute, a span after it was `pressure_pa`.
    #[inline(always)]
    pub(crate) fn after(&self, pressure_pa: f64, stopped: bool, decay: SupplyDecay) -> f64 {
        let (target, factor) = if stopped {
            (self.parameters.atmospheric_pressure_pa, decay.discharge)
        } else {
            (self.parameters.pressure_pa, decay.recovery)
        };
        target + (pressure_pa - target) * factor
    }

    /// Whether the non-return valves at the chambers are shut at this node pressure, Pa absolute.
    #[inline(always)]
    pub(crate) fn check_valves_shut(&self, pressure_pa: f64) -> bool {
        pressure_pa < self.parameters.check_valve_pressure_pa
    }
}

impl SupplyDecay {
    #[inline(always)]
    pub(crate) fn formed<P>(&self, form: &mut impl Form<P>) -> Self {
        SupplyDecay { discharge: form.one(self.discharge), recovery: form.one(self.recovery) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::RigParameters;

    #[test]
    fn the_node_decays_and_recovers_exponentially() {
        let supply = Supply::new(RigParameters::baseline().supply(), None);
        // Oracle at t = 0, then one time constant: 1/e of the way is left.
        assert_eq!(supply.after(7e5, true, supply.decay(0.0)), 7e5);
        let left = (-1.0_f64).exp();
        let stopped = supply.after(7e5, true, supply.decay(0.05));
        assert!((stopped - (101_325.0 + (7e5 - 101_325.0) * left)).abs() < 1e-6);
        let released = supply.after(101_325.0, false, supply.decay(0.3));
        assert!((released - (7e5 - (7e5 - 101_325.0) * left)).abs() < 1e-6);
    }

    #[test]
    fn normal_running_stands_still_to_the_bit() {
        let supply = Supply::new(RigParameters::baseline().supply(), None);
        assert_eq!(supply.after(7e5, false, supply.decay(1e-4)), 7e5);
    }

    #[test]
    fn the_check_valves_shut_below_their_pilot_pressure() {
        let supply = Supply::new(RigParameters::baseline().supply(), None);
        assert!(!supply.check_valves_shut(2.5e5) && supply.check_valves_shut(2.499e5));
    }
}
