//! A leaking chamber and a burst hose: ways out of a chamber into the atmosphere, beside its valve.
//!
//! ```text
//! leak    q_out = k (p^2 - p_atm^2)                      k = q_ref / ((6 bar)^2 - (1 bar)^2)
//! burst   q_out = 25.9  K_V sqrt((p - p_atm) p_atm)      p_atm >= p / 2          [Neugebauer 2011, eq. 4]
//!         q_out = 12.95 K_V p                            p_atm <= p / 2
//! ```
//!
//! q_out normal flow out of the chamber, m^3/s; p chamber, p_atm atmosphere, absolute; q_ref leakage from 6 to 1 bar
//! absolute, m^3/s; K_V of the hole in m^3/h, p in bar and q in m^3/h in the second law, as the paper has it. The hose is part
//! of the chamber's dead volume, so what the valve lets in still passes the chamber.
//!
//! While the hole is choked a shut chamber of volume V empties as `p = p_0 e^(-t / tau)`,
//!
//! ```text
//! tau = V / (p_N 12.95 K_V / (1e5 Pa/bar 3600 s/h))
//! ```
//!
//! Regularisation: the flow law is vertical at equal pressures, so no step lets more out than what lies above the atmosphere
//! (or in, than what lacks to it).
//!
//! Properties: from high to low; 0 at equal pressures; a closed outlet adds nothing.
//!
//! Source: laminar gap flow, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7; [Neugebauer 2011] is DOI
//! 10.2478/v10180-011-0014-6.

use crate::effects::laminar_gap::LaminarGap;
use crate::valve::{FLOW_PER_KV, single_edge_flow};

/// A way out of one chamber.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Outlet {
    gap: LaminarGap,
    /// Conductance of the hole, m^3/s per Pa.
    hole: f64,
}

impl Outlet {
    /// A gap that passes a normal flow from 6 to 1 bar absolute, m^3/s, and a hole of this K_V, m^3/h.
    pub(crate) fn new(leakage_m3_per_s: f64, burst_kv_m3_per_h: f64) -> Self {
        Outlet { gap: LaminarGap::of(leakage_m3_per_s), hole: burst_kv_m3_per_h * FLOW_PER_KV }
    }

    pub(crate) fn is_open(&self) -> bool {
        *self != Outlet::default()
    }

    /// Normal flow into the chamber, m^3/s, negative above the atmosphere; pressures absolute, Pa. `most_m3_per_s` is what
    /// would bring the chamber to the atmosphere's pressure within the step.
    pub(crate) fn inflow(&self, chamber_pa: f64, atmospheric_pa: f64, most_m3_per_s: f64) -> f64 {
        let gap = self.gap.flow(atmospheric_pa, chamber_pa);
        let hole =
            if self.hole > 0.0 { single_edge_flow(self.hole, atmospheric_pa, chamber_pa) } else { 0.0 };
        (gap + hole).clamp(-most_m3_per_s, most_m3_per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ATMOSPHERE_PA: f64 = 101_325.0;

    #[test]
    fn both_laws_are_those_of_the_head() {
        // From 6 to 1 bar absolute the gap passes what it is given by; a few roundings.
        assert!((Outlet::new(1e-3, 0.0).inflow(6e5, 1e5, 1.0) + 1e-3).abs() < 1e-17);
        // Choked, 12.95 K_V p: 12.95 * 2 * 6 m^3/h.
        let choked = -12.95 * 2.0 * 6.0 / 3600.0;
        assert!((Outlet::new(0.0, 2.0).inflow(6e5, ATMOSPHERE_PA, 1.0) / choked - 1.0).abs() < 1e-12);
    }

    #[test]
    fn air_flows_from_high_to_low_and_a_closed_outlet_passes_none() {
        let open = Outlet::new(1e-3, 1.0);
        assert!(open.inflow(5e5, ATMOSPHERE_PA, 1.0) < 0.0 && open.inflow(9e4, ATMOSPHERE_PA, 1.0) > 0.0);
        assert_eq!(open.inflow(ATMOSPHERE_PA, ATMOSPHERE_PA, 1.0), 0.0);
        assert_eq!(open.inflow(5e5, ATMOSPHERE_PA, 1e-6), -1e-6, "no more than there is");
        assert_eq!(Outlet::default().inflow(5e5, ATMOSPHERE_PA, 1.0), 0.0);
        assert!(!Outlet::default().is_open() && open.is_open());
    }
}
