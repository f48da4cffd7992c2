//! Cascaded position control: position, velocity and pneumatic force, each loop inside the last, with integral part.
//!
//! ```text
//!   w, w', w'' ──► position ──v_c──► velocity ──F_c──► force ──► v
//!                      ▲                 ▲               ▲
//!                      x                 x'         p_a, p_b, x
//!
//!   e   = w - x
//!   v_c = k_x e + k_f w'
//!   F_c = k_f m w'' + b v_c + k_v (v_c - x') + k_r F_sli sat(v_c / v_r) + k_l F_s + I        I' = k_i e
//!   v   = v_c + (k_F (F_c - F) + k_a b w'') / c
//!   F   = p_a A_a - p_b A_b - p_atm (A_a - A_b)            c = p_a A_a^2 / V_a + p_b A_b^2 / V_b
//! ```
//!
//! w, x, e: set-point, extension, error, m; k_x: position gain, 1/s; v_c: wanted speed, m/s; k_f, k_a: shares of the
//! set-point's rates that are fed forward; F_c, F: wanted and measured pneumatic force, N; F_s: force sensor, N; m: moved
//! mass, kg; b: viscous friction, N s/m; F_sli: sliding friction, N, compensated in full from the speed v_r on; k_v:
//! velocity gain, N s/m; k_r, k_l: shares; I: integral part, N; k_i: N/(m s); k_F: force gain, 1/s; A, V, p: areas, volumes
//! and pressures of the chambers; c: stiffness of the air, N/m.
//!
//! The force's rate is F' = c (v - x'), v being what the valve does (see [`crate::linearisation`], whose
//! pressure-compensated law it wants): v is therefore the wanted speed and, over c, the wanted rate of the force. The force
//! sensor measures the load; it also reads the mass behind it, which its low-pass (force_filter_hz of the pre-controller, 5
//! Hz) keeps out of the loop.
//!
//! The integral part stands still at its limit, while the error is larger than its zone, and while the valve cannot follow,
//! unless the error takes it back. At rest, within the rest zone, 0 comes out: see [`crate::rest_zone`].
//!
//! Source: [Neugebauer 2011, section 5] supposes that such a cascade does better than P; air and friction from
//! rig-model.md.

use super::position_p::{VELOCITY_FEED_FORWARD, gain};
use crate::algorithm::{AlgorithmInput, ControlLaw, Kind, LARGEST_M_PER_S, Quantity};
use crate::linearisation::Air;
use crate::rest_zone::{self, RestZone};
use nominal::RigParameters;
use settings::parameters::declare;

pub(crate) const KIND: Kind = Kind {
    name: "position-cascade",
    about: "position: cascaded loops for position, velocity and pneumatic force, with integral part",
    controls: Quantity::Position,
    parameters: Parameters::TABLE,
    make: |rig| Box::new(PositionCascade::new(rig)),
};

settings::parameters! {
    /// Parameters of `position-cascade`.
    struct Parameters {
        gain_per_s: gain(15.0),
        velocity_feed_forward: VELOCITY_FEED_FORWARD,
        velocity_gain_n_s_per_m: declare("N/(m/s)", [0.0, 20_000.0], 700.0, "force for each error of the velocity"),
        integral_gain_n_per_m_s: declare("N/(m s)", [0.0, 1e6], 100_000.0, "rate of the force for each error of the position"),
        integral_limit_n: declare("N", [0.0, 1000.0], 60.0, "largest force of the integral part"),
        integral_zone_m: declare("m", [0.0, 0.5], 0.005, "larger errors leave the integral part as it is"),
        force_gain_per_s: declare("1/s", [0.0, 200.0], 25.0, "force rate for each error of the force"),
        acceleration_feed_forward: declare("", [0.0, 2.0], 1.0,
            "share of the set-point's acceleration that is fed forward as a force rate"),
        moved_mass_kg: declare("kg", [0.0, 100.0], 5.0, "mass by which the set-point's acceleration is multiplied"),
        friction_compensation: declare("", [0.0, 1.0], 1.0, "share of the nominal sliding friction that is compensated"),
        friction_speed_m_per_s: declare("m/s", [1e-4, 1.0], 0.004, "wanted speed from which on it is compensated in full"),
        load_compensation: declare("", [0.0, 1.0], 1.0,
            "share of the measured force between rod and carriage that is compensated"),
        rest_zone_m: rest_zone::declaration(2e-4),
    }
}

#[derive(Debug)]
struct PositionCascade {
    air: Air,
    viscous_n_s_per_m: f64,
    sliding_force_n: f64,
    integral_n: f64,
    last_result_m_per_s: f64,
    rest: RestZone,
}

impl PositionCascade {
    fn new(rig: &RigParameters) -> Self {
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

impl ControlLaw for PositionCascade {
    type Parameters = Parameters;

    fn reset(&mut self, _input: &AlgorithmInput, _: &Parameters) {
        self.integral_n = 0.0;
        self.last_result_m_per_s = 0.0;
        self.rest = RestZone::default();
    }

    fn step(&mut self, input: &AlgorithmInput, p: &Parameters) -> f64 {
        let error_m = input.set_position_m - input.position_m;
        if self.rest.rests(input, p.rest_zone_m) {
            self.last_result_m_per_s = 0.0;
            return 0.0;
        }
        let set_acceleration = input.set_acceleration_m_per_s2;
        let velocity = p.gain_per_s * error_m + p.velocity_feed_forward * input.set_velocity_m_per_s;

        // The valve gives less than was asked for: only an error that takes the integral back counts.
        let held_back = self.last_result_m_per_s - input.applied_velocity_m_per_s;
        if error_m.abs() <= p.integral_zone_m && held_back * error_m <= 0.0 {
            self.integral_n += p.integral_gain_n_per_m_s * error_m * input.period_s;
        }
        self.integral_n = self.integral_n.clamp(-p.integral_limit_n, p.integral_limit_n);

        let sliding_n = (velocity / p.friction_speed_m_per_s).clamp(-1.0, 1.0) * self.sliding_force_n;
        let force_n = p.velocity_feed_forward * p.moved_mass_kg * set_acceleration
            + self.viscous_n_s_per_m * velocity
            + p.velocity_gain_n_s_per_m * (velocity - input.velocity_m_per_s)
            + p.friction_compensation * sliding_n
            + p.load_compensation * input.force_n
            + self.integral_n;
        let air = self.air.at(input);
        let rate_n_per_s = p.force_gain_per_s * (force_n - air.force_n())
            + p.acceleration_feed_forward * self.viscous_n_s_per_m * set_acceleration;
        self.last_result_m_per_s =
            (velocity + rate_n_per_s / air.stiffness_n_per_m()).clamp(-LARGEST_M_PER_S, LARGEST_M_PER_S);
        self.last_result_m_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{self, WindupCase};

    fn cascade() -> PositionCascade {
        PositionCascade::new(&RigParameters::baseline())
    }

    /// Air in balance at rest, as the rig starts.
    fn balanced() -> AlgorithmInput {
        let air = RigParameters::baseline();
        let (cylinder, atmosphere) = (air.cylinder(), air.supply().atmospheric_pressure_pa);
        let [a, b] = [cylinder.piston_area_m2, cylinder.annulus_area_m2];
        AlgorithmInput {
            period_s: 1e-3,
            position_m: 0.2,
            set_position_m: 0.2,
            pressure_a_pa: (3.5e5 * b + atmosphere * (a - b)) / a,
            pressure_b_pa: 3.5e5,
            supply_pressure_pa: 7e5,
            ..AlgorithmInput::default()
        }
    }

    #[test]
    fn each_loop_adds_its_part() {
        let parameters = Parameters {
            integral_gain_n_per_m_s: 0.0,
            friction_compensation: 0.0,
            load_compensation: 0.0,
            ..Parameters::default()
        };
        let input = AlgorithmInput { set_position_m: 0.21, set_velocity_m_per_s: 0.1, ..balanced() };
        let velocity = 15.0 * 0.01 + 0.1;
        let stiffness = Air::new(&RigParameters::baseline()).at(&input).stiffness_n_per_m();
        let force = (1100.0 + 700.0) * velocity;
        let expected = velocity + 25.0 * force / stiffness;
        let result = cascade().step(&input, &parameters);
        // The balance above is computed, not measured: rounding of newtons out of some hundred.
        assert!((result - expected).abs() < 1e-9, "{result}, not {expected}");
    }

    #[test]
    fn the_measured_load_is_compensated() {
        let input = AlgorithmInput { set_velocity_m_per_s: 0.1, ..balanced() };
        let loaded = AlgorithmInput { force_n: 100.0, ..input };
        let stiffness = Air::new(&RigParameters::baseline()).at(&input).stiffness_n_per_m();
        let more =
            cascade().step(&loaded, &Parameters::default()) - cascade().step(&input, &Parameters::default());
        assert!((more - 25.0 * 100.0 / stiffness).abs() < 1e-9, "{more}");
    }

    #[test]
    fn what_every_algorithm_must_keep() {
        laws::check(&KIND);
    }

    #[test]
    fn it_does_not_wind_up() {
        // 0.2 m at 300 N/(m s): 600 N in 10 s, of a limit of 1000 N.
        let overrides = &[
            ("integral_gain_n_per_m_s", 300.0),
            ("integral_limit_n", 1000.0),
            ("integral_zone_m", 0.5),
            ("rest_zone_m", 0.0),
        ];
        let held_error = AlgorithmInput { set_position_m: 0.4, ..balanced() };
        let reversed_error = AlgorithmInput { set_position_m: 0.19, ..balanced() };
        laws::does_not_wind_up(&KIND, &WindupCase { overrides, held_error, reversed_error });
    }

    #[test]
    fn its_integral_keeps_its_limit() {
        // The integral's limit is 60 N; 4 mm take it back at 100 kN/(m s) within 2 * 60 / (4e-3 * 1e5) = 0.3 s.
        laws::keeps_its_limit(&KIND, &balanced(), 0.3);
    }
}
