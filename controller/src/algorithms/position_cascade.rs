//! Cascaded position control: position, velocity and pneumatic force, each loop inside the last, with integral part.
//!
//! ```text
//!   w, w', w'' ─► position ─ v_c ─► velocity ─ F_c ─► force ─► v
//!                    x                  v               p_a, p_b, F_s
//!
//!   e   = w - x
//!   v_c = k_x e + k_f w'
//!   F_c = k_f (m w'' + b w') + b k_x e + k_v (v_c - v) + k_s F_sli sat(v_c / v_s) + k_l F_s + I
//!   I'  = k_i e
//!   v   = v_c + (k_F (F_c - F) + k_a b w'') / c
//!   F   = p_a A_a - p_b A_b - p_atm (A_a - A_b)          c = p_a A_a^2 / V_a + p_b A_b^2 / V_b
//! ```
//!
//! w, x: set-point and extension, m; k_x: position gain, 1/s; k_f, k_a: shares of the set-point's rates fed forward; F_c, F: wanted and
//! measured pneumatic force, N; F_s: force sensor, N; m: moved mass, kg; b, F_sli: nominal viscous and sliding friction; v_s: speed at which
//! sliding friction is compensated in full, m/s; k_v: N/(m/s); k_i: N/(m s); k_F: 1/s; c: stiffness of the air, N/m, which turns a
//! force rate into the velocity that the valve is asked for (see [`crate::linearisation`]).
//!
//! The integral part stops at its limit, and while the valve cannot follow unless the error takes it back. At rest, with the error
//! within the rest zone and the rod standing, 0 comes out: friction holds the rod better than any controller. The zone is left at twice its width.
//!
//! Source: cascade as in [Schulte, Hahn 2004] for servo-pneumatics; [Neugebauer 2011, section 5] supposes that it does better than P.

use crate::algorithm::{Algorithm, Kind, Quantity, Ready};
use crate::linearisation::Air;
use crate::parameters::Parameter;
use crate::rest_zone::RestZone;
use plant::RigParameters;

/// In the list of algorithms.
pub const KIND: Kind = Kind {
    name: "position-cascade",
    about: "position: cascaded loops for position, velocity and pneumatic force, with integral part",
    controls: Quantity::Position,
    parameters: &PARAMETERS,
    make: |rig| Box::new(PositionCascade::new(rig)),
};

const GAIN: usize = 0;
const FEED_FORWARD: usize = 1;
const VELOCITY_GAIN: usize = 2;
const INTEGRAL_GAIN: usize = 3;
const INTEGRAL_LIMIT: usize = 4;
const INTEGRAL_ZONE: usize = 5;
const FORCE_GAIN: usize = 6;
const ACCELERATION_FEED_FORWARD: usize = 7;
const MASS: usize = 8;
const FRICTION: usize = 9;
const FRICTION_SPEED: usize = 10;
const LOAD: usize = 11;
const REST_ZONE: usize = 12;
static PARAMETERS: [Parameter; 13] = [
    Parameter::new(("gain_per_s", "1/s"), [0.0, 200.0], 20.0, "velocity for each error"),
    Parameter::new(
        ("velocity_feed_forward", ""),
        [0.0, 2.0],
        1.0,
        "share of the set-point's rate that is fed forward",
    ),
    Parameter::new(
        ("velocity_gain_n_s_per_m", "N/(m/s)"),
        [0.0, 20_000.0],
        500.0,
        "force for each error of the velocity",
    ),
    Parameter::new(
        ("integral_gain_n_per_m_s", "N/(m s)"),
        [0.0, 1e6],
        20_000.0,
        "rate of the force for each error of the position",
    ),
    Parameter::new(("integral_limit_n", "N"), [0.0, 1000.0], 100.0, "largest force of the integral part"),
    Parameter::new(
        ("integral_zone_m", "m"),
        [0.0, 0.5],
        0.005,
        "larger errors leave the integral part as it is",
    ),
    Parameter::new(("force_gain_per_s", "1/s"), [0.0, 200.0], 30.0, "force rate for each error of the force"),
    Parameter::new(
        ("acceleration_feed_forward", ""),
        [0.0, 2.0],
        1.0,
        "share of the set-point's acceleration that is fed forward as a force rate",
    ),
    Parameter::new(("moved_mass_kg", "kg"), [0.0, 100.0], 5.0, "mass that the set-point's acceleration is told of"),
    Parameter::new(
        ("friction_compensation", ""),
        [0.0, 1.0],
        1.0,
        "share of the nominal sliding friction that is compensated",
    ),
    Parameter::new(
        ("friction_speed_m_per_s", "m/s"),
        [1e-4, 1.0],
        0.005,
        "wanted speed from which on it is compensated in full",
    ),
    Parameter::new(
        ("load_compensation", ""),
        [0.0, 1.0],
        1.0,
        "share of the measured force between rod and carriage that is compensated",
    ),
    Parameter::new(
        ("rest_zone_m", "m"),
        [0.0, 0.01],
        1e-4,
        "error within which a standing rod is left alone",
    ),
];

/// The algorithm.
#[derive(Debug)]
pub struct PositionCascade {
    air: Air,
    viscous_n_s_per_m: f64,
    sliding_force_n: f64,
    integral_n: f64,
    last_result_m_per_s: f64,
    rest: RestZone,
}

impl PositionCascade {
    /// For a rig of these nominal numbers.
    #[must_use]
    pub fn new(rig: &RigParameters) -> Self {
        Self {
            air: Air::new(rig),
            viscous_n_s_per_m: rig.friction().viscous_n_s_per_m,
            sliding_force_n: rig.friction().sliding_force_n,
            integral_n: 0.0,
            last_result_m_per_s: 0.0,
            rest: RestZone::default(),
        }
    }
}

impl Algorithm for PositionCascade {
    fn reset(&mut self, _ready: &Ready, _parameters: &[f64]) {
        self.integral_n = 0.0;
        self.last_result_m_per_s = 0.0;
        self.rest = RestZone::default();
    }

    fn step(&mut self, ready: &Ready, parameters: &[f64]) -> f64 {
        let p = |place: usize| parameters[place];
        let error_m = ready.set_position_m - ready.position_m;
        if self.rest.rests(ready, p(REST_ZONE)) {
            self.last_result_m_per_s = 0.0;
            return 0.0;
        }
        let (set_velocity, set_acceleration) =
            (p(FEED_FORWARD) * ready.set_velocity_m_per_s, ready.set_acceleration_m_per_s2);
        let velocity = p(GAIN) * error_m + set_velocity;

        // The valve gives less than was asked for: only an error that takes the integral back counts.
        let held_back = self.last_result_m_per_s - ready.applied_velocity_m_per_s;
        if error_m.abs() <= p(INTEGRAL_ZONE) && held_back * error_m <= 1e-9 {
            self.integral_n += p(INTEGRAL_GAIN) * error_m * ready.period_s;
        }
        self.integral_n = self.integral_n.clamp(-p(INTEGRAL_LIMIT), p(INTEGRAL_LIMIT));

        let sliding = (velocity / p(FRICTION_SPEED)).clamp(-1.0, 1.0) * self.sliding_force_n;
        let force_n = p(MASS) * p(FEED_FORWARD) * set_acceleration
            + self.viscous_n_s_per_m * velocity
            + p(VELOCITY_GAIN) * (velocity - ready.velocity_m_per_s)
            + p(FRICTION) * sliding
            + p(LOAD) * ready.force_n
            + self.integral_n;
        let air = self.air.at(ready);
        let rate_n_per_s = p(FORCE_GAIN) * (force_n - air.force_n())
            + p(ACCELERATION_FEED_FORWARD) * self.viscous_n_s_per_m * set_acceleration;
        self.last_result_m_per_s = (velocity + rate_n_per_s / air.stiffness_n_per_m()).clamp(-LARGEST, LARGEST);
        self.last_result_m_per_s
    }
}

/// Largest result, m/s: several times what any valve of this rig gives.
const LARGEST: f64 = 5.0;
