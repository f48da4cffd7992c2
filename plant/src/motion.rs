//! Motion of one axis: exact under a held force, with stick, slip, break-away and end stops.
//!
//! ```text
//! F* = F_pn - b v - F_sli sign(v) - F_load        (sign(0) = 0)                 [Neugebauer 2011, eqs. 5-6]
//! m dv/dt = F*                              v != 0
//! m dv/dt = F* - sign(F*) F_sli             v = 0 and |F*| >  F_stat
//! v stays 0                                 v = 0 and |F*| <= F_stat
//! ```
//!
//! Under a force F held over a span h, viscous friction included, speed and way have closed forms, with z = b h / m:
//!
//! ```text
//! v' = E v + G F        E = e^-z    G = (h / m) phi_1(z)    phi_1 = (1 - e^-z) / z
//! x' = x + D v + W F    D = h phi_1(z)    W = (h^2 / m) phi_2(z)    phi_2 = (1 - phi_1) / z
//! ```
//!
//! so a large b needs no small step, and b = 0 is no special case but a limit (series below z = 0.1). Where v
//! passes zero inside the span, the instant is `t = (m / b) ln(1 - b v / F)`, and the rest of the span starts
//! from standstill. At an end of the stroke the piston stops dead, and leaves as from any standstill
//! [rig-model.md, One axis].
//!
//! Source: [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6.

use crate::lanes::{Axes, Form, Pair};
use crate::parameters::{FrictionParameters, RigParameters};

/// What moves each axis and what holds it.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    pub(crate) masses_kg: [f64; 2],
    /// What each axis' force sensor pushes along: the carriage with its weights.
    pub(crate) behind_sensor_kg: [f64; 2],
    pub(crate) stroke_m: f64,
    /// Friction of the baseline, the same for both axes and both directions.
    pub(crate) levels: Levels,
}

/// How much friction an axis has in each direction: extending, retracting.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Levels {
    /// Sliding friction, N, not below 0.
    pub(crate) sliding_n: [f64; 2],
    /// Break-away force, N, not below the sliding friction.
    pub(crate) break_away_n: [f64; 2],
    pub(crate) viscous_n_s_per_m: [f64; 2],
}

/// Place of a direction in [`Levels`]: 0 extending, 1 retracting.
#[inline(always)]
pub(crate) fn side(direction: f64) -> usize {
    usize::from(direction < 0.0)
}

/// E, G, D and W of the module's head for one span, one lane for each axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MotionSpan<P = Pair> {
    pub(crate) keep: P,
    pub(crate) gain: P,
    pub(crate) drift: P,
    pub(crate) push: P,
}

/// Extension of an axis and its velocity, m and m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PistonState {
    pub(crate) extension: f64,
    pub(crate) velocity: f64,
}

impl Motion {
    /// Of a rig with masses on top, kg: the carriage's, and what the load's rod carries.
    pub(crate) fn new(rig: &RigParameters, [on_carriage_kg, on_load_kg]: [f64; 2]) -> Self {
        Motion {
            masses_kg: [rig.mass().drive_kg + on_carriage_kg, rig.mass().load_kg + on_load_kg],
            behind_sensor_kg: [rig.mass().carriage_kg + on_carriage_kg, 0.0],
            stroke_m: rig.cylinder().stroke_m,
            levels: Levels::of(rig.friction()),
        }
    }

    #[inline(always)]
    pub(crate) fn formed<P>(&self, form: &mut impl Form<P>) -> Self {
        let mut both = |axes: [f64; 2]| [form.one(axes[0]), form.one(axes[1])];
        Motion {
            masses_kg: both(self.masses_kg),
            behind_sensor_kg: both(self.behind_sensor_kg),
            levels: Levels {
                sliding_n: both(self.levels.sliding_n),
                break_away_n: both(self.levels.break_away_n),
                viscous_n_s_per_m: both(self.levels.viscous_n_s_per_m),
            },
            stroke_m: form.one(self.stroke_m),
        }
    }

    /// The factors of a span with the baseline's viscous friction.
    pub(crate) fn span(&self, span_s: f64) -> MotionSpan {
        self.span_with([self.levels.viscous_n_s_per_m[0]; 2], span_s)
    }

    /// The factors of a span with the viscous friction of each axis, N s/m.
    pub(crate) fn span_with(&self, viscous_n_s_per_m: [f64; 2], span_s: f64) -> MotionSpan {
        let of = |axis: usize| Factors::new(self.masses_kg[axis], viscous_n_s_per_m[axis], span_s);
        let factors = [of(0), of(1)];
        let pair = |pick: fn(&Factors) -> f64| Pair::new(pick(&factors[0]), pick(&factors[1]));
        MotionSpan {
            keep: pair(|f| f.keep),
            gain: pair(|f| f.gain),
            drift: pair(|f| f.drift),
            push: pair(|f| f.push),
        }
    }

    /// Whether a resting axis under this force stays, force in N without any friction; the break-away level is that of its
    /// direction.
    #[inline(always)]
    pub(crate) fn holds(&self, extension: f64, force: f64, break_away_n: f64) -> bool {
        force.abs() <= break_away_n || self.pressed(extension, force)
    }

    /// Whether a force presses an axis against an end of its stroke.
    #[inline(always)]
    pub(crate) fn pressed(&self, extension: f64, force: f64) -> bool {
        extension <= 0.0 && force < 0.0 || extension >= self.stroke_m && force > 0.0
    }

    /// Whether resting axes might leave within the span, so that a step must look closer; `break_away` is that of the force's
    /// direction, N.
    #[inline(always)]
    pub(crate) fn might_leave<P: Axes>(&self, extension: P, force: P, margin: P, break_away: P) -> P::Mask {
        let zero = P::both(0.0);
        let pressed = extension.at_most(zero) & force.less(zero)
            | P::both(self.stroke_m).at_most(extension) & zero.less(force);
        break_away.less(force.abs() + margin) & !pressed
    }

    /// Moves one axis through a span under a held force (N, without any friction), locating what happens inside.
    ///
    /// Never gives the force's work to friction: between two events the sliding friction opposes the motion.
    pub(crate) fn advance(
        &self,
        axis: usize,
        from: PistonState,
        force: f64,
        levels: &Levels,
        span_s: f64,
    ) -> PistonState {
        let mass = self.masses_kg[axis];
        let mut piston = from;
        let mut left_s = span_s;
        // A held force turns the motion around at most once, so two legs do; the third is for rounding.
        for _ in 0..3 {
            let direction = if piston.velocity != 0.0 {
                piston.velocity.signum()
            } else if self.holds(piston.extension, force, levels.break_away_n[side(force)]) {
                return piston;
            } else {
                force.signum()
            };
            let viscous = levels.viscous_n_s_per_m[side(direction)];
            let driving = force - direction * levels.sliding_n[side(direction)];
            let next = Factors::new(mass, viscous, left_s).advance(piston, driving);
            if next.velocity * direction > 0.0 {
                return self.stop_at_ends(next);
            }
            if piston.velocity == 0.0 {
                // Less than a rounding of way: the force exceeds the friction by nothing that moves a number.
                return piston;
            }
            let stop_s = zero_crossing(mass, viscous, piston.velocity, driving).min(left_s);
            let stop = Factors::new(mass, viscous, stop_s).advance(piston, driving);
            piston = self.stop_at_ends(PistonState { extension: stop.extension, velocity: 0.0 });
            left_s -= stop_s;
        }
        piston
    }

    /// At an end of the stroke the piston stops dead.
    pub(crate) fn stop_at_ends(&self, piston: PistonState) -> PistonState {
        if piston.extension < 0.0 {
            PistonState { extension: 0.0, velocity: 0.0 }
        } else if piston.extension > self.stroke_m {
            PistonState { extension: self.stroke_m, velocity: 0.0 }
        } else {
            piston
        }
    }
}

impl MotionSpan {
    #[inline(always)]
    pub(crate) fn formed<P, F: Form<P>>(&self, form: &mut F) -> MotionSpan<P> {
        MotionSpan {
            keep: form.pair(self.keep),
            gain: form.pair(self.gain),
            drift: form.pair(self.drift),
            push: form.pair(self.push),
        }
    }
}

impl Levels {
    pub(crate) fn of(friction: &FrictionParameters) -> Self {
        Levels {
            sliding_n: [friction.sliding_force_n; 2],
            break_away_n: [friction.break_away_force_n; 2],
            viscous_n_s_per_m: [friction.viscous_n_s_per_m; 2],
        }
    }
}

/// Sliding friction on moving axes, N, against the motion, of its level; 0 at rest.
#[inline(always)]
pub(crate) fn against<P: Axes>(velocity: P, level: P, moving: P::Mask) -> P {
    -level.with_sign_of(velocity).where_true(moving)
}

/// E, G, D and W of one axis and one span.
struct Factors {
    keep: f64,
    gain: f64,
    drift: f64,
    push: f64,
}

impl Factors {
    fn new(mass_kg: f64, viscous_n_s_per_m: f64, span_s: f64) -> Self {
        let z = viscous_n_s_per_m * span_s / mass_kg;
        let phi_1 = if z == 0.0 { 1.0 } else { -libm::expm1(-z) / z };
        Factors {
            keep: libm::exp(-z),
            gain: span_s / mass_kg * phi_1,
            drift: span_s * phi_1,
            push: span_s * span_s / mass_kg * phi_2(z, phi_1),
        }
    }

    fn advance(&self, from: PistonState, force: f64) -> PistonState {
        PistonState {
            extension: from.extension + self.drift * from.velocity + self.push * force,
            velocity: self.keep * from.velocity + self.gain * force,
        }
    }
}

/// (1 - phi_1) / z, by its series where the difference would lose digits.
fn phi_2(z: f64, phi_1: f64) -> f64 {
    if z > 0.1 {
        return (1.0 - phi_1) / z;
    }
    // sum (-z)^n / (n + 2)!; the first term left out is below 1e-10 / 12! = 2e-19.
    let mut sum = 0.0;
    for n in (0..10).rev() {
        sum = (1.0 - z * sum) / f64::from(n + 2);
    }
    sum
}

/// Time until a velocity under an opposing force is zero, s.
fn zero_crossing(mass_kg: f64, viscous_n_s_per_m: f64, velocity: f64, force: f64) -> f64 {
    let frictionless_s = -velocity * mass_kg / force;
    let y = viscous_n_s_per_m * frictionless_s / mass_kg;
    if y == 0.0 { frictionless_s } else { frictionless_s * (libm::log1p(y) / y) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn motion(viscous_n_per_mm_per_s: f64) -> Motion {
        let rig = RigParameters::baseline();
        let rig = rig.with("friction.viscous_n_per_mm_per_s", &[viscous_n_per_mm_per_s]).expect("in range");
        Motion::new(&rig, [0.0; 2])
    }

    fn advance(
        viscous_n_per_mm_per_s: f64,
        axis: usize,
        from: PistonState,
        force: f64,
        span_s: f64,
    ) -> PistonState {
        let motion = motion(viscous_n_per_mm_per_s);
        motion.advance(axis, from, force, &motion.levels, span_s)
    }

    fn at(velocity: f64) -> PistonState {
        PistonState { extension: 0.25, velocity }
    }

    #[test]
    fn the_factors_solve_the_equation_of_motion() {
        // z from far below to far above the change from series to difference.
        for viscous in [0.0, 1e-6, 0.1, 1.1, 10.0] {
            let span = 0.01;
            let whole = advance(viscous, 0, at(0.2), 500.0, span);
            let mut parts = at(0.2);
            for _ in 0..1000 {
                parts = advance(viscous, 0, parts, 500.0, span / 1000.0);
            }
            // An exact solution does not depend on how it is cut: a thousand roundings of 0.25 m and 1 m/s.
            assert!((whole.extension - parts.extension).abs() < 1e-13, "b = {viscous}");
            assert!((whole.velocity - parts.velocity).abs() < 1e-12, "b = {viscous}");
        }
        // And one of the solutions, written down: b = 0, 474 N on 5 kg.
        let end = advance(0.0, 0, at(0.2), 500.0, 0.01);
        assert!((end.velocity - (0.2 + 94.8 * 0.01)).abs() < 1e-15);
        assert!((end.extension - (0.25 + 0.002 + 47.4e-4)).abs() < 1e-15);
    }

    #[test]
    fn a_long_push_ends_at_the_terminal_velocity() {
        // (576 - 26) N / 1100 N s/m = 0.5 m/s; 20 ms are 4.4 time constants of 5 kg / 1100 N s/m.
        let form = |t: f64| 0.5 * (1.0 - (-1100.0 / 5.0 * t).exp());
        assert_eq!(form(0.0), 0.0);
        for ms in 0..20 {
            let t = f64::from(ms) * 1e-3;
            let velocity = advance(1.1, 0, at(0.0), 576.0, t).velocity;
            assert!((velocity - form(t)).abs() < 1e-14, "{ms} ms");
        }
    }

    #[test]
    fn a_decelerating_piston_stops_where_its_energy_is_spent_and_sticks() {
        // b = 0: m v^2 / 2 = F_sli s, 0.5 * 5 * 0.1^2 / 26 = 0.96 mm.
        let stop = advance(0.0, 0, at(0.1), 0.0, 0.1);
        assert_eq!(stop.velocity, 0.0);
        assert!((stop.extension - 0.25 - 0.5 * 5.0 * 0.01 / 26.0).abs() < 1e-15);
    }

    #[test]
    fn a_piston_turns_round_inside_a_span_if_the_force_exceeds_the_static_friction() {
        let held = advance(1.1, 0, at(0.01), -34.9, 0.01);
        assert_eq!(held.velocity, 0.0);
        let turned = advance(1.1, 0, at(0.01), -35.1, 0.01);
        assert!(turned.velocity < 0.0);
    }

    #[test]
    fn an_end_of_the_stroke_stops_the_piston_dead() {
        let stop = advance(1.1, 1, PistonState { extension: 0.4999, velocity: 1.0 }, 500.0, 1e-3);
        assert_eq!(stop, PistonState { extension: 0.5, velocity: 0.0 });
        assert_eq!(advance(1.1, 1, stop, 1e6, 1e-3), stop, "pressed");
        assert_eq!(advance(1.1, 1, stop, -34.0, 1e-3), stop, "held");
        assert!(advance(1.1, 1, stop, -36.0, 1e-3).extension < 0.5, "leaves");
    }

    proptest! {
        #[test]
        fn friction_never_adds_energy(
            velocity in -3.0..3.0_f64,
            force in -2000.0..2000.0_f64,
            viscous in 0.0..10.0_f64,
            span in 1e-6..0.02_f64,
        ) {
            // Over any span: kinetic energy gained is at most the force's work. Ends take energy as well.
            let start = at(velocity);
            let end = advance(viscous, 0, start, force, span);
            let gained = 2.5 * (end.velocity * end.velocity - velocity * velocity);
            let work = force * (end.extension - start.extension);
            // Roundings of energies up to some hundred joule.
            prop_assert!(gained <= work + 1e-12 * (gained.abs() + work.abs() + 1.0), "{gained} J > {work} J");
        }
    }
}
