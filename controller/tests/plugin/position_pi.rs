//! Position: proportional-integral with velocity feed-forward.

use crate::algorithm::{Algorithm, Kind, Quantity, Ready};
use crate::parameters::Parameter;

/// In the list of algorithms.
pub const KIND: Kind = Kind {
    name: "position-pi",
    about: "position: proportional-integral with velocity feed-forward and anti-wind-up",
    controls: Quantity::Position,
    parameters: &PARAMETERS,
    make: |_rig| Box::new(PositionPi::default()),
};

static PARAMETERS: [Parameter; 5] = [
    Parameter::new(("gain_per_s", "1/s"), [0.0, 100.0], 20.0, "velocity for each error"),
    Parameter::new(
        ("integral_time_s", "s"),
        [0.05, 1000.0],
        2.0,
        "time in which the integral does what the gain does at once",
    ),
    Parameter::new(
        ("tracking_time_s", "s"),
        [0.005, 10.0],
        0.05,
        "time in which the integral follows a limited valve",
    ),
    Parameter::new(
        ("velocity_feed_forward", ""),
        [0.0, 2.0],
        1.0,
        "share of the set-point's rate that is fed forward",
    ),
    Parameter::new(("dead_zone_m", "m"), [0.0, 0.01], 0.001, "error that the integral leaves alone"),
];

#[derive(Default)]
struct PositionPi {
    integral_m_per_s: f64,
    last_result_m_per_s: f64,
}

impl Algorithm for PositionPi {
    fn reset(&mut self, ready: &Ready, _parameters: &[f64]) {
        *self = Self { integral_m_per_s: 0.0, last_result_m_per_s: ready.applied_velocity_m_per_s };
    }

    fn step(&mut self, ready: &Ready, parameters: &[f64]) -> f64 {
        let &[gain, integral_time, tracking_time, feed_forward, dead_zone] = parameters else {
            unreachable!("the slice is as long as the table")
        };
        let error = ready.set_position_m - ready.position_m;
        let entering = if error.abs() > dead_zone { error } else { 0.0 };
        let limited = ready.applied_velocity_m_per_s - self.last_result_m_per_s;
        self.integral_m_per_s += ready.period_s * (gain / integral_time * entering + limited / tracking_time);
        self.last_result_m_per_s =
            gain * error + self.integral_m_per_s + feed_forward * ready.set_velocity_m_per_s;
        self.last_result_m_per_s
    }
}
