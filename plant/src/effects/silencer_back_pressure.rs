//! silencer-back-pressure: both exhausts of a cylinder end in one volume that vents through a silencer.
//!
//! ```text
//! V dp_e/dt = p_N (q_fed - Q(p_e -> p_out))        Q: eq. (4) with K_V = n K_V,exhaust,max
//! ```
//!
//! p_e pressure behind the exhaust edges of one axis, p_out that behind the silencer, absolute, Pa; q_fed normal flow that
//! both exhaust edges bring, m^3/s, negative where they draw; V volume, m^3, in [5, 1000] cm^3; n in [0.1, 100], K_V of the
//! silencer in units of the exhaust edge's largest. Valid for a sintered silencer taken as one orifice; its slow blocking by
//! dirt is a smaller n. Isothermal as the chambers. At equal pressures the law is vertical as the baseline's is; the step of
//! `node.rs` solves it there without regularisation, for any span.
//!
//! Properties: without flow the outside pressure stays to the bit; back pressure of a steady flow is that of eq. (4), and the
//! less the larger n; positive; never past the equilibrium.
//!
//! Source: eq. (4) of Neugebauer 2011, DOI 10.2478/v10180-011-0014-6; resistances of silencers, Beater, Pneumatic Drives,
//! 2007, DOI 10.1007/978-3-540-69471-7; range: textbook prior.

use super::node::Node;
use super::sheet::{Effect, EffectKey, Excitation, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::valve::FLOW_PER_KV;

effect_numbers! {
    struct Numbers {
        kv_ratio: EffectKey {
            name: "silencer_kv_ratio",
            unit: Unit::One,
            min: 0.1,
            max: 100.0,
            drawn: [0.3, 3.0],
            neutral: Some(f64::INFINITY),
            meaning: "n, K_V of the silencer in units of the exhaust edge's largest",
            ..EffectKey::USUAL
        },
        volume_m3: EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 5.0,
            max: 1000.0,
            drawn: [30.0, 100.0],
            signed: false,
            default: Some(60.0),
            neutral: None,
            meaning: "volume between the exhaust edges and the silencer",
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SilencerBackPressure {
    node: Node,
}

impl Effect for SilencerBackPressure {
    const SHEET: Sheet = Sheet {
        name: "silencer-back-pressure",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "both exhausts of a cylinder end in one volume that vents through a silencer",
        source: "eq. (4) for the silencer, Beater 2007; range: textbook prior",
        nonlinear_in_amplitude: true,
        has_memory: true,
        excited_by: Excitation::Fast,
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        let kv_max = rig.valve().kv_exhaust_m3_per_h.into_iter().fold(0.0, f64::max);
        let Numbers { kv_ratio, volume_m3 } = Numbers::of(numbers);
        let conductance = kv_ratio * kv_max * FLOW_PER_KV;
        let node = Node { conductance, volume_m3, normal_pa: rig.gas().normal_pressure_pa };
        SilencerBackPressure { node }
    }
}

impl SilencerBackPressure {
    /// Pressure of the volume a span later; pressures absolute, Pa, flow in m^3/s and held over the span.
    pub(crate) fn advance(&self, pressure_pa: f64, outside_pa: f64, fed_m3_per_s: f64, span_s: f64) -> f64 {
        self.node.advance(pressure_pa, outside_pa, fed_m3_per_s, span_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valve::single_edge_flow;
    use proptest::prelude::*;

    const OUTSIDE_PA: f64 = 101_325.0;

    fn effect(ratio: f64, volume_cm3: f64) -> SilencerBackPressure {
        SilencerBackPressure::new(&[ratio, volume_cm3 / 1e6], &RigParameters::baseline())
    }

    fn steady(effect: &SilencerBackPressure, fed: f64) -> f64 {
        (0..50_000).fold(OUTSIDE_PA, |pressure, _| effect.advance(pressure, OUTSIDE_PA, fed, 1e-4))
    }

    #[test]
    fn without_flow_the_outside_pressure_stays_to_the_bit() {
        for span in [1.25e-5, 1e-4, 1e-3] {
            assert_eq!(effect(0.3, 60.0).advance(OUTSIDE_PA, OUTSIDE_PA, 0.0, span), OUTSIDE_PA);
        }
    }

    #[test]
    fn a_steady_flow_has_the_back_pressure_of_the_edge_law() {
        let fed = 3e-3;
        for ratio in [0.3, 1.0, 3.0] {
            let back = steady(&effect(ratio, 60.0), fed);
            let passed = -single_edge_flow(ratio * 0.58 * FLOW_PER_KV, OUTSIDE_PA, back);
            // The approach stalls where the roundings of a step, 3e-11 Pa, outweigh its share of the way, some 1e-3: 3e-8 Pa
            // of 6e3 Pa and more above the outside.
            assert!((passed - fed).abs() < 1e-11 * fed, "{ratio}: {passed}");
        }
        assert!(steady(&effect(0.3, 60.0), fed) > steady(&effect(1.0, 60.0), fed));
    }

    #[test]
    fn a_wide_silencer_has_nearly_no_back_pressure() {
        // r = q / c: 3e-3 m^3/s through 100 x 0.58 m^3/h make (720 Pa)^2 / p.
        assert!(steady(&effect(100.0, 60.0), 3e-3) - OUTSIDE_PA < 6.0);
    }

    proptest! {
        #[test]
        fn it_rises_no_further_than_its_equilibrium_and_stays_positive(
            ratio in -1.0..2.0_f64, volume in 5.0..1000.0_f64, pressure in 9e4..1.2e6_f64, fed in -0.02..0.1_f64,
            span in prop::sample::select(vec![1.25e-5, 1e-4, 1e-3]),
        ) {
            let effect = effect(10_f64.powf(ratio), volume);
            let after = effect.advance(pressure, OUTSIDE_PA, fed, span);
            let goal = effect.node.equilibrium(OUTSIDE_PA, fed).unwrap_or(0.0);
            prop_assert!(after > 0.0 && (pressure.min(goal)..=pressure.max(goal)).contains(&after));
        }
    }
}
