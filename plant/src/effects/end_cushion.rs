//! end-cushion: near both ends the chamber that is emptied vents through a cushion orifice; an elastic stop ends the stroke.
//!
//! ```text
//! q = -k sqrt((p - p_i) p_i), p >= p_i >= p/2      as eq. (4), k = 25.9 / (1e5 * 3600) K_V,cushion    [Neugebauer 2011, eq. 4]
//! term = p_i - p = -(p - sqrt(p^2 - 4 (q/k)^2)) / 2                  q < 0 and within the cushion, else 0
//! F_stop = k_stop (1 mm - xi)     xi < 1 mm             F_stop = -k_stop (1 mm - (L - xi))     L - xi < 1 mm
//! ```
//!
//! | symbol | what | unit | domain, sign |
//! |---|---|---|---|
//! | q | normal flow into the chamber | m^3/s | only q < 0, outflow; a check valve lets it fill freely |
//! | p, p_i | chamber pressure, absolute, and pressure between cushion and port | Pa | > 0 |
//! | K_V,cushion | of the orifice, eq. (4) in bar and m^3/h | m^3/h | > 0 |
//! | to_end | way left to the end at which this chamber is empty | m | cushion for to_end < length |
//! | xi, L | the rod's own extension, stroke | m | 0 to L |
//! | k_stop | stiffness of the buffer over the last millimetre | N/m | > 0 |
//!
//! The pressure term is negative or 0, Pa. Beyond the choked flow k p / 2 no pressure at the port draws more: the drop goes
//! on in a steep line to all of p within 0.1 % more flow, so that a solver finds the choked flow as where the line is
//! crossed. The cushion closes at once (a spear with a sharp edge). The force is along the axis's extension, N, inwards; the
//! buffer is elastic and gives back what it took; at the very end the baseline's dead stop remains.
//!
//! Properties: fills freely; nothing outside the cushion; the drop of eq. (4) up to p/2; never less drop for more flow; the
//! stop pushes inwards, starts from 0 and gives back its energy; an infinite K_V changes nothing.
//!
//! Source: [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6; adjusting screw and check valve as makers of cylinders draw
//! them; range: effects.md, textbook prior.

use super::sheet::{Effect, EffectKey, Excitation, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::valve::FLOW_PER_KV;

effect_numbers! {
    pub(crate) struct EndCushion {
        cushion_kv_m3_per_h: EffectKey {
            name: "cushion_kv_m3_per_h",
            unit: Unit::CubicMetrePerHour,
            min: 0.005,
            max: 100.0,
            drawn: [0.02, 0.3],
            neutral: Some(f64::INFINITY),
            meaning: "K_V of the cushion's orifice; a chamber that fills goes past it",
            ..EffectKey::USUAL
        },
        length_m: EffectKey {
            name: "length_mm",
            unit: Unit::Millimetre,
            min: 1.0,
            max: 50.0,
            drawn: [10.0, 25.0],
            signed: false,
            default: Some(20.0),
            neutral: None,
            meaning: "length of the cushion before each end",
        },
        stop_stiffness_n_per_m: EffectKey {
            name: "stop_stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 10000.0,
            max: 5000000.0,
            drawn: [100000.0, 2000000.0],
            signed: false,
            default: Some(1e6),
            neutral: None,
            meaning: "k_stop of the elastic stop over the last millimetre",
        },
    }
}

impl Effect for EndCushion {
    const SHEET: Sheet = Sheet {
        name: "end-cushion",
        group: Group::Motion,
        laws: &[Law::Air, Law::Force],
        law: "near both ends the chamber that is emptied vents through a cushion orifice; an elastic stop ends the stroke",
        source: "eq. (4) for the orifice; range: effects.md, textbook prior",
        nonlinear_in_amplitude: true,
        excited_by: Excitation::IntoEnd,
        distinguished_by: &[ManualMeasurement::PressedEnds],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

/// Way over which the elastic stop acts before each end, m: a guess, as thick as buffer rings are.
pub(crate) const BUFFER_M: f64 = 1e-3;

/// Drop per q/k beyond the choked flow, both Pa: the rest of the pressure within 0.1 % more flow.
const CHOKED: f64 = 1e3;

impl EndCushion {
    /// Pressure at the cushion's port above the chamber's, Pa, not positive, at a normal flow into the chamber, m^3/s.
    ///
    /// `chamber_pa` is absolute and positive; `to_end_m` is the way left to the end at which this chamber is empty.
    pub(crate) fn term(&self, flow: f64, chamber_pa: f64, to_end_m: f64) -> f64 {
        if flow >= 0.0 || to_end_m >= self.length_m {
            return 0.0;
        }
        let passed_pa = -flow / (self.cushion_kv_m3_per_h * FLOW_PER_KV);
        // At the choked flow the root is exactly 0; each step after it is taken by the line.
        let choked_pa = chamber_pa / 2.0;
        let open_pa = passed_pa.min(choked_pa);
        let root_pa = 2.0 * ((choked_pa - open_pa) * (choked_pa + open_pa)).sqrt();
        // p - sqrt(p^2 - 4 a^2) = 4 a^2 / (p + sqrt(...)): no digits lost at small flow.
        let drop_pa = 2.0 * open_pa * open_pa / (chamber_pa + root_pa);
        -(drop_pa + CHOKED * (passed_pa - open_pa))
    }

    /// Force of the elastic stops along the axis's extension, N: inwards, 0 outside the last millimetre.
    pub(crate) fn stop_force(&self, extension_m: f64, stroke_m: f64) -> f64 {
        let pressed = |to_end_m: f64| (BUFFER_M - to_end_m).max(0.0);
        self.stop_stiffness_n_per_m * (pressed(extension_m) - pressed(stroke_m - extension_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cushion(cushion_kv_m3_per_h: f64) -> EndCushion {
        EndCushion { cushion_kv_m3_per_h, length_m: 0.02, stop_stiffness_n_per_m: 1e6 }
    }

    /// Normal flow out of a chamber, m^3/s, by eq. (4) in bar and m^3/h.
    fn paper(kv: f64, chamber_pa: f64, port_pa: f64) -> f64 {
        let (up, down) = (chamber_pa / 1e5, port_pa / 1e5);
        25.9 * kv * ((up - down) * down).sqrt() / 3600.0
    }

    #[test]
    fn the_drop_is_that_of_the_papers_orifice() {
        for share in [0.5, 0.51, 0.7, 0.9, 0.99, 0.9999] {
            let port_pa = share * 5e5;
            let drop_pa = cushion(0.1).term(-paper(0.1, 5e5, port_pa), 5e5, 0.01);
            // Roundings of 5 bar, which the root at the choked flow halves in digits: 1e-16^(1/2) of 5 bar, 5 mPa.
            let tolerance_pa = if share == 0.5 { 0.02 } else { 1e-6 };
            assert!((5e5 + drop_pa - port_pa).abs() < tolerance_pa, "{share}: {drop_pa} Pa");
        }
    }

    #[test]
    fn it_fills_freely_and_does_nothing_outside_its_length() {
        assert_eq!(cushion(0.1).term(1e-3, 5e5, 0.0), 0.0);
        assert_eq!(cushion(0.1).term(0.0, 5e5, 0.0), 0.0);
        assert_eq!(cushion(0.1).term(-1e-3, 5e5, 0.02), 0.0);
        assert!(cushion(0.1).term(-1e-3, 5e5, 0.0199) < 0.0);
        assert_eq!(cushion(f64::INFINITY).term(-1e-3, 5e5, 0.0), 0.0);
    }

    #[test]
    fn hardly_more_than_the_choked_flow_takes_all_of_the_pressure() {
        let choked = 12.95 * 0.1 * 5.0 / 3600.0;
        assert!(cushion(0.1).term(-choked * 1.002, 5e5, 0.0) < -5e5);
    }

    #[test]
    fn the_stops_push_inwards_from_nothing_and_give_back_their_energy() {
        let stop = |x: f64| cushion(0.1).stop_force(x, 0.5);
        assert_eq!([1e-3, 0.25].map(stop), [0.0, 0.0]);
        // 1e-16 of 0.5 m times 1e6 N/m.
        assert!(stop(0.499).abs() < 1e-10);
        assert_eq!(stop(0.0), 1000.0);
        assert!((stop(0.5) + 1000.0).abs() < 1e-10);
        assert!((stop(0.4995) + 500.0).abs() < 1e-9);
        // k s^2 / 2 over the last millimetre, 0.5 J, whichever way it is gone: a function of the place alone.
        let work: f64 = (0..1000).map(|i| stop((f64::from(i) + 0.5) * 1e-6) * 1e-6).sum();
        assert!((work - 0.5).abs() < 1e-12, "{work} J");
    }

    proptest! {
        #[test]
        fn more_flow_never_drops_less(
            kv in 0.005..100.0_f64,
            chamber in 0.5e5..12e5_f64,
            flow in 0.0..0.03_f64,
            more in 0.0..0.03_f64,
        ) {
            let [less, more] = [flow, flow + more].map(|flow| cushion(kv).term(-flow, chamber, 0.0));
            // One rounding of the drop.
            prop_assert!(more <= less + 1e-15 * less.abs() && less <= 0.0);
        }
    }
}
