//! Position: proportional-integral with velocity feed-forward.

use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, LARGEST_M_PER_S, Quantity};
use settings::parameters::declare;

/// In the list of algorithms.
pub(crate) const KIND: Kind = Kind {
    name: "position-pi",
    about: "position: proportional-integral with velocity feed-forward and anti-wind-up",
    controls: Quantity::Position,
    parameters: Parameters::TABLE,
    make: |_rig| Box::new(PositionPi::default()),
};

settings::parameters! {
    /// Parameters of `position-pi`.
    struct Parameters {
        gain_per_s: declare("1/s", [0.0, 100.0], 20.0, "velocity for each error"),
        integral_time_s: declare("s", [0.05, 1000.0], 2.0, "time in which the integral does what the gain does at once"),
        tracking_time_s: declare("s", [0.005, 10.0], 0.05, "time in which the integral follows a limited valve"),
        velocity_feed_forward: declare("", [0.0, 2.0], 1.0, "share of the set-point's rate that is fed forward"),
        dead_zone_m: declare("m", [0.0, 0.01], 0.001, "error that the integral leaves alone"),
    }
}

#[derive(Default)]
struct PositionPi {
    integral_m_per_s: f64,
    last_result_m_per_s: f64,
}

impl ControlLaw for PositionPi {
    type Parameters = Parameters;

    fn reset(&mut self, input: &AlgorithmInput, _: &Parameters) {
        *self = Self { integral_m_per_s: 0.0, last_result_m_per_s: input.applied_velocity_m_per_s };
    }

    fn step(&mut self, input: &AlgorithmInput, p: &Parameters) -> f64 {
        let error = input.set_position_m - input.position_m;
        let entering = if error.abs() > p.dead_zone_m { error } else { 0.0 };
        let limited = input.applied_velocity_m_per_s - self.last_result_m_per_s;
        let rate = p.gain_per_s / p.integral_time_s * entering + limited / p.tracking_time_s;
        let integral = self.integral_m_per_s + input.period_s * rate;
        self.integral_m_per_s = integral.clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S);
        let result = p.gain_per_s * error
            + self.integral_m_per_s
            + p.velocity_feed_forward * input.set_velocity_m_per_s;
        self.last_result_m_per_s = result.clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S);
        self.last_result_m_per_s
    }
}
