//! Force control by a PID whose output, a rate of force, goes through a map of the air's stiffness.
//!
//! ```text
//!   w_r' = sat(w' + (w - w_r) / T_r)              reference: what the axis can follow of a step      |w_r'| <= v_r c
//!   w_e' = (w_r - w_e) / T_v                      expected: the reference later by the valve
//!   e    = dz(w_e - F)                            dz(e) = e - sat(e, (1 - s) d)
//!   I'   = s e / T_i  -  (1 - s) I / T_f
//!   f    = k_r w_r' + k_p (e + I + T_d (w_e' - F')) + s k_b b x''
//!   v    = f / c(x, p_a, p_b) + s k_f x'          c = p_a A_a^2 / V_a + p_b A_b^2 / V_b
//! ```
//!
//! w, w': set-point and its rate, N and N/s; F, F': force sensor and its filtered rate; x', x'': filtered rates of the axis's
//! extension, m/s and m/s^2; c: stiffness of the air, N/m, from nominal geometry and measured position and pressures: the
//! characteristic map, which has its counterpart for the valve in the pressure-compensated linearisation
//! ([`crate::linearisation`]); b: nominal viscous friction, N s/m; k_p: gain, 1/s; T_i, T_d: integral and derivative time,
//! s; T_r, T_v: time constants, s; v_r: m/s; k_r, k_f, k_b: shares fed forward; s: how much the rod moves, 0 to 1; d: dead
//! zone, N; T_f: 50 ms.
//!
//! Why: a step is more than the valve can do, so the error is taken against what can be expected by now, and the gain need
//! not be low for the step's sake. The sensor sees what is left of the air's force behind the rod's friction: when the
//! other axis slows down under the step, b x'' of it comes or goes, and is fed forward. At rest friction freezes the force:
//! the integral fades and small errors are let be, lest they pump the rod loose.
//!
//! The integral part stops at its limit, and while the valve cannot follow unless the error takes it back.
//!
//! Source: PID in the ideal form and integrator clamping [Åström, Hägglund 1995]; the map is the outlook of
//! [Neugebauer 2011, section 5]; c from its eqs. 1 to 4.

use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, LARGEST_M_PER_S, Quantity};
use crate::linearisation::Air;
use nominal::RigParameters;
use settings::parameters::declare;
use std::f64::consts::TAU;

pub(crate) const KIND: Kind = Kind {
    name: "force-pid-map",
    about: "force: PID through a map of the air's stiffness, with friction and velocity fed forward",
    controls: Quantity::Force,
    parameters: Parameters::TABLE,
    make: |rig| Box::new(ForcePidMap::new(rig)),
};

settings::parameters! {
    /// Parameters of `force-pid-map`.
    struct Parameters {
        gain_per_s: declare("1/s", [0.0, 400.0], 150.0, "rate of force for each error"),
        integral_time_s: declare("s", [0.0, 100.0], 0.2, "time in which the integral part doubles a standing error; 0 for none"),
        integral_limit_n: declare("N", [0.0, 500.0], 100.0, "largest integral part, as the error that it stands for"),
        derivative_time_s: declare("s", [0.0, 0.05], 0.0, "time over which the error is extrapolated by its rate"),
        derivative_filter_hz: declare("Hz", [1.0, 400.0], 100.0, "cut-off of the measured force's rate"),
        reference_time_s: declare("s", [0.001, 1.0], 0.032, "time constant with which a step is followed"),
        reference_speed_m_per_s: declare("m/s", [0.01, 10.0], 2.0,
            "fastest rate of the reference, as the velocity that it stands for"),
        valve_time_s: declare("s", [0.0, 0.1], 0.012, "how much later the force comes than asked for"),
        rate_feed_forward: declare("", [0.0, 2.0], 1.0, "share of the reference's rate that is fed forward"),
        velocity_feed_forward: declare("", [0.0, 2.0], 1.0, "share of the rod's velocity that is fed forward while it moves"),
        friction_feed_forward: declare("", [0.0, 1.0], 0.8,
            "share of the nominal viscous friction's rate that is fed forward while it moves"),
        dead_zone_n: declare("N", [0.0, 100.0], 5.0, "error that is let be while the rod stands"),
        standstill_m_per_s: declare("m/s", [0.001, 0.2], 0.04,
            "velocity from which on the rod moves; up to half of it, it stands"),
    }
}
/// Time in which the integral part fades while the rod stands, s.
const FADING_S: f64 = 0.05;

#[derive(Debug)]
struct ForcePidMap {
    air: Air,
    viscous_n_s_per_m: f64,
    memory: Memory,
}

/// State between two steps.
#[derive(Debug, Default)]
struct Memory {
    reference_n: f64,
    expected_n: f64,
    integral_n: f64,
    force_n: f64,
    force_rate_n_per_s: f64,
    result_m_per_s: f64,
}

impl ForcePidMap {
    fn new(rig: &RigParameters) -> Self {
        Self {
            air: Air::new(rig),
            viscous_n_s_per_m: rig.friction().viscous_n_s_per_m,
            memory: Memory::default(),
        }
    }
}

impl ControlLaw for ForcePidMap {
    type Parameters = Parameters;

    fn reset(&mut self, input: &AlgorithmInput, _: &Parameters) {
        let force_n = input.force_n;
        self.memory = Memory { reference_n: force_n, expected_n: force_n, force_n, ..Memory::default() };
    }

    fn step(&mut self, input: &AlgorithmInput, p: &Parameters) -> f64 {
        let memory = &mut self.memory;
        let period_s = input.period_s;
        let stiffness_n_per_m = self.air.at(input).stiffness_n_per_m();
        let moves = (2.0 * input.velocity_m_per_s.abs() / p.standstill_m_per_s - 1.0).clamp(0.0, 1.0);

        let fastest = p.reference_speed_m_per_s * stiffness_n_per_m;
        let catching_up = (input.set_force_n - memory.reference_n) / p.reference_time_s.max(period_s);
        let reference_rate = (input.set_force_rate_n_per_s + catching_up).clamp(-fastest, fastest);
        memory.reference_n += period_s * reference_rate;
        let behind_n = memory.reference_n - memory.expected_n;
        let expected_rate = behind_n / p.valve_time_s.max(period_s);
        memory.expected_n += period_s * expected_rate;

        let slope = (input.force_n - memory.force_n) / period_s;
        memory.force_n = input.force_n;
        memory.force_rate_n_per_s +=
            (1.0 - libm::exp(-TAU * p.derivative_filter_hz * period_s)) * (slope - memory.force_rate_n_per_s);

        let error_n = memory.expected_n - input.force_n;
        let dead_n = (1.0 - moves) * p.dead_zone_n;
        let error_n = error_n - error_n.clamp(-dead_n, dead_n);
        let held_back = memory.result_m_per_s - input.applied_velocity_m_per_s;
        if p.integral_time_s == 0.0 {
            memory.integral_n = 0.0;
        } else if held_back * error_n <= 1e-9 {
            memory.integral_n += moves * error_n * period_s / p.integral_time_s;
        }
        memory.integral_n *= 1.0 - (1.0 - moves) * (period_s / FADING_S).min(1.0);
        memory.integral_n = memory.integral_n.clamp(-p.integral_limit_n, p.integral_limit_n);

        let lead_n = p.derivative_time_s * (expected_rate - memory.force_rate_n_per_s);
        let friction_rate = moves * self.viscous_n_s_per_m * input.acceleration_m_per_s2;
        let force_rate = p.rate_feed_forward * reference_rate
            + p.gain_per_s * (error_n + memory.integral_n + lead_n)
            + p.friction_feed_forward * friction_rate;
        let result =
            force_rate / stiffness_n_per_m + p.velocity_feed_forward * moves * input.velocity_m_per_s;
        memory.result_m_per_s = result.clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S);
        memory.result_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{self, WindupCase};

    const CYCLE_S: f64 = 1e-3;

    fn moving_at(velocity_m_per_s: f64) -> AlgorithmInput {
        AlgorithmInput {
            period_s: CYCLE_S,
            position_m: 0.25,
            velocity_m_per_s,
            pressure_a_pa: 4e5,
            pressure_b_pa: 4e5,
            supply_pressure_pa: 7e5,
            ..AlgorithmInput::default()
        }
    }

    /// A step of 200 N on a rod that moves along while the air, c v, is an integrator behind a lag of the valve's time.
    fn step_response(change: impl Fn(&mut Parameters)) -> Vec<f64> {
        let mut parameters = Parameters::default();
        change(&mut parameters);
        let mut algorithm = ForcePidMap::new(&RigParameters::baseline());
        let mut input = moving_at(-0.1);
        let stiffness = Air::new(&RigParameters::baseline()).at(&input).stiffness_n_per_m();
        algorithm.reset(&input, &parameters);
        let mut rate = 0.0;
        input.set_force_n = 200.0;
        (0..1000)
            .map(|_| {
                let result = algorithm.step(&input, &parameters);
                input.applied_velocity_m_per_s = result.clamp(-0.6, 0.6);
                let wanted = stiffness * (input.applied_velocity_m_per_s - input.velocity_m_per_s);
                rate += (wanted - rate) * CYCLE_S / parameters.valve_time_s;
                input.force_n += CYCLE_S * rate;
                input.force_n
            })
            .collect()
    }

    #[test]
    fn a_step_of_the_force_is_followed_aperiodically_within_three_time_constants() {
        let force_n = step_response(|_| ());
        let largest = force_n.iter().copied().fold(0.0, f64::max);
        assert!(largest < 1.02 * 200.0, "{largest}");
        // Three time constants leave 5 % of a step; the valve's time, and what its saturation takes, come on top.
        let settled = force_n.iter().rposition(|force| (force - 200.0).abs() > 0.05 * 200.0).unwrap();
        assert!((60..150).contains(&settled), "{settled} ms");
    }

    #[test]
    fn a_motion_that_is_fed_forward_too_little_leaves_no_lasting_error() {
        let end = *step_response(|parameters| parameters.velocity_feed_forward = 0.8).last().unwrap();
        assert!((end - 200.0).abs() < 0.1, "{end}");
        let without = *step_response(|parameters| {
            parameters.velocity_feed_forward = 0.8;
            parameters.integral_time_s = 0.0;
        })
        .last()
        .unwrap();
        // P alone: k_p e = 0.2 c 0.1 m/s.
        assert!((without - 200.0).abs() > 0.3, "{without}");
    }

    #[test]
    fn a_valve_that_cannot_follow_does_not_wind_it_up() {
        // 1500 N over 100 s: 150 N in 10 s, of a limit of 500 N.
        let overrides = &[("integral_time_s", 100.0), ("integral_limit_n", 500.0)];
        let held_error = AlgorithmInput { set_force_n: 1500.0, ..moving_at(0.1) };
        let reversed_error = AlgorithmInput { set_force_n: -15.0, ..moving_at(0.1) };
        laws::does_not_wind_up(&KIND, &WindupCase { overrides, held_error, reversed_error });
    }

    #[test]
    fn after_a_step_that_the_valve_cannot_follow_it_turns_in_time() {
        let parameters = Parameters::default();
        for shut in [false, true] {
            let mut algorithm = ForcePidMap::new(&RigParameters::baseline());
            let mut input = AlgorithmInput { set_force_n: 1500.0, ..moving_at(0.1) };
            algorithm.reset(&input, &parameters);
            for _ in 0..10_000 {
                let result = algorithm.step(&input, &parameters);
                input.applied_velocity_m_per_s = if shut { 0.0 } else { result.clamp(-0.6, 0.6) };
            }
            // The set-point comes back below the force: the reference needs 1500 N / (v_r c), some 150 ms, and turns the result.
            input.set_force_n = -1500.0;
            let turned = (0..1000).position(|_| {
                let result = algorithm.step(&input, &parameters);
                input.applied_velocity_m_per_s = if shut { 0.0 } else { result.clamp(-0.6, 0.6) };
                result < 0.0
            });
            assert!(turned.is_some_and(|cycles| cycles < 300), "{turned:?}");
        }
    }

    #[test]
    fn a_standing_rod_lets_small_errors_be_and_the_integral_fades() {
        let parameters = Parameters::default();
        let mut algorithm = ForcePidMap::new(&RigParameters::baseline());
        let mut input = AlgorithmInput { force_n: 100.0, set_force_n: 104.0, ..moving_at(0.1) };
        algorithm.reset(&input, &parameters);
        for _ in 0..100 {
            input.applied_velocity_m_per_s = algorithm.step(&input, &parameters);
        }
        assert!(algorithm.memory.integral_n > 1.0);
        input.velocity_m_per_s = 0.0;
        for _ in 0..1000 {
            input.applied_velocity_m_per_s = algorithm.step(&input, &parameters);
        }
        // 1 s is twenty times the fading time, and thirty reference times.
        assert!(input.applied_velocity_m_per_s.abs() < 1e-6, "{}", input.applied_velocity_m_per_s);
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        laws::check(&KIND);
    }
}
