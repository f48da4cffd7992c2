//! Position control by a PID with velocity feed-forward.
//!
//! ```text
//!   e = w - x         e' = w' - x'
//!   v = k_p (e + e' T_d + I) + k_f w'
//!   I' = e / T_i
//! ```
//!
//! w, w': set-point and its rate, m and m/s; x, x': extension and its filtered rate; k_p: gain, 1/s; T_d, T_i: derivative
//! and integral time, s (T_i = 0: no integral part); k_f: share of the set-point's rate; I: integral part, m.
//!
//! The integral part stands still at its limit, while the error is larger than its zone, and while the valve cannot follow,
//! unless the error takes it back. The derivative makes up for the lag of the air, 0.2 s in the middle of the stroke. At
//! rest, within the rest zone, 0 comes out: see [`crate::rest_zone`].
//!
//! Source: [Åström, Hägglund 1995], PID in the ideal form; the derivative filter is the pre-controller's.

use super::position_p::{VELOCITY_FEED_FORWARD, gain};
use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, LARGEST_M_PER_S, Quantity};
use crate::rest_zone::{self, RestZone};
use settings::parameters::declare;

pub(crate) const KIND: Kind = Kind {
    name: "position-pid",
    about: "position: PID with velocity feed-forward",
    controls: Quantity::Position,
    parameters: Parameters::TABLE,
    make: |_| Box::new(PositionPid::default()),
};

settings::parameters! {
    /// Parameters of `position-pid`.
    struct Parameters {
        gain_per_s: gain(30.0),
        velocity_feed_forward: VELOCITY_FEED_FORWARD,
        integral_time_s: declare("s", [0.0, 100.0], 1.0, "time in which the integral part doubles a standing error; 0 for none"),
        integral_limit_m: declare("m", [0.0, 0.1], 0.003, "largest integral part, as the error that it stands for"),
        integral_zone_m: declare("m", [0.0, 0.5], 0.003, "larger errors leave the integral part as it is"),
        derivative_time_s: declare("s", [0.0, 1.0], 0.12, "time over which the error is extrapolated by its rate"),
        rest_zone_m: rest_zone::declaration(3e-4),
    }
}

#[derive(Debug, Default)]
struct PositionPid {
    integral_m: f64,
    last_result_m_per_s: f64,
    rest: RestZone,
}

impl ControlLaw for PositionPid {
    type Parameters = Parameters;

    fn reset(&mut self, _input: &AlgorithmInput, _: &Parameters) {
        *self = Self::default();
    }

    fn step(&mut self, input: &AlgorithmInput, p: &Parameters) -> f64 {
        let error_m = input.set_position_m - input.position_m;
        if self.rest.rests(input, p.rest_zone_m) {
            self.last_result_m_per_s = 0.0;
            return 0.0;
        }
        let held_back = self.last_result_m_per_s - input.applied_velocity_m_per_s;
        if p.integral_time_s == 0.0 {
            self.integral_m = 0.0;
        } else if error_m.abs() <= p.integral_zone_m && held_back * error_m <= 0.0 {
            self.integral_m += error_m * input.period_s / p.integral_time_s;
        }
        self.integral_m = self.integral_m.clamp(-p.integral_limit_m, p.integral_limit_m);
        let rate_m_per_s = input.set_velocity_m_per_s - input.velocity_m_per_s;
        let result = p.gain_per_s * (error_m + p.derivative_time_s * rate_m_per_s + self.integral_m)
            + p.velocity_feed_forward * input.set_velocity_m_per_s;
        self.last_result_m_per_s = result.clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S);
        self.last_result_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{self, WindupCase, at_rest};

    #[test]
    fn its_parts_add_up() {
        let input = AlgorithmInput {
            position_m: 0.199,
            velocity_m_per_s: 0.04,
            set_velocity_m_per_s: 0.1,
            ..at_rest()
        };
        let parameters = Parameters {
            gain_per_s: 20.0,
            velocity_feed_forward: 1.0,
            integral_time_s: 0.5,
            integral_limit_m: 0.003,
            integral_zone_m: 0.003,
            derivative_time_s: 0.12,
            rest_zone_m: 0.0,
        };
        let result = PositionPid::default().step(&input, &parameters);
        let expected = 20.0 * (0.001 + 0.12 * 0.06 + 0.001 * 1e-3 / 0.5) + 0.1;
        assert!((result - expected).abs() < 1e-12, "{result}, not {expected}");
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        laws::check(&KIND);
    }

    #[test]
    fn it_does_not_wind_up() {
        // 0.3 m over 100 s: 30 mm in 10 s, of a limit of 100 mm.
        let overrides = &[
            ("integral_time_s", 100.0),
            ("integral_limit_m", 0.1),
            ("integral_zone_m", 0.5),
            ("rest_zone_m", 0.0),
        ];
        let held_error = AlgorithmInput { set_position_m: 0.5, ..at_rest() };
        let reversed_error = AlgorithmInput { set_position_m: 0.19, ..at_rest() };
        laws::does_not_wind_up(&KIND, &WindupCase { overrides, held_error, reversed_error });
    }

    #[test]
    fn its_integral_keeps_its_limit() {
        // The integral's limit is 3 mm; 2.9 mm take it back in 2 * 3 / 2.9 s of an integral time of 1 s at most, but the
        // error itself turns the sign as soon as the integral is below it.
        laws::keeps_its_limit(&KIND, &at_rest(), 2.1);
    }
}
