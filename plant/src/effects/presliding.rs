//! presliding: the contact is a brush of bristles, so before it breaks away the piston moves elastically (LuGre).
//!
//! ```text
//! dz/dt  = v - |v| s_0 z / g(v)                                                        [Canudas de Wit 1995]
//! F      = s_0 z + s_1(v) dz/dt           against the motion, in place of stick and slip
//! g(v)   = F_sli + (F_brk - F_sli) exp(-(v / v_s)^2)                                   (theirs is g / s_0)
//! s_1(v) = s_1 g / (g + s_1 |v|)          s_1 = 2 * 0.7 sqrt(s_0 m)
//! ```
//!
//! | symbol | what | unit | domain, sign |
//! |---|---|---|---|
//! | z | mean deflection of the bristles | m | in the direction of the extension, \|z\| <= F_brk / s_0 |
//! | v | velocity of the rod | m/s | positive extending |
//! | s_0 | stiffness of the bristles | N/m | 3e4 to 3e7 |
//! | s_1 | damping of the bristles at rest: 0.7 of critical | N s/m | follows from s_0 and the mass |
//! | F_sli, F_brk | levels of sliding friction and break-away at this instant | N | 0 <= F_sli <= F_brk |
//! | v_s | speed over which the one gives way to the other | m/s | 1 mm/s |
//!
//! Viscous friction stands beside it (b v of the baseline). With levels that depend on the direction, those of the motion count,
//! at rest those of the force. Valid for dry and boundary friction of seals and guides. A force that
//! comes faster than the bristles settle breaks away below F_brk, and a force that swings below F_brk lets the piston creep
//! [Dupont 2002]: known limits of LuGre; the elasto-plastic form mends the second.
//!
//! Regularisation: none of its own; it is the regularisation of stick and slip, and the baseline is its limit for s_0 to
//! infinity. Levels below 0.01 N count as 0.01 N, so that a frictionless rig has no 0 / 0. The damping fades with the speed
//! because with a constant s_1 LuGre may produce energy [Barabanov 2000]: the balance below is dissipative for every deflection
//! as long as `s_1(v) |v| <= 4 g(v)`, and this form keeps `s_1(v) |v| < g(v)`.
//!
//! **A step of any length.** The bristles are moved through the span h by their exact solution for the speed v of its midpoint,
//! and push with their exact mean force; the mass sees the implicit midpoint rule. With d = sign(v), s = |v|, f = d s_0 z:
//!
//! ```text
//! k = s h s_0 / g      w = s s_1 / g      psi = phi_1(k) / (1 + w)      phi_1(k) = (1 - e^-k) / k
//! mean F d = g - (g - f) psi              z' = z + d phi_1(k) s h (1 - f / g)
//! (2 m / h + b) s + (g - f) (1 - psi(s)) = |c|         c = F_applied + 2 m v_0 / h - s_0 z = d |c|
//! v' = 2 d s - v_0                        x' = x + d s h
//! ```
//!
//! The sign of the motion is that of c, whatever g is. psi is convex and falls from 1 to 0, so the left side is concave for
//! f <= g and convex above; Newton's method from the bound that belongs to each side approaches the root without ever passing
//! it, and a fixed number of steps does. An s below the root only brakes more, so the scheme dissipates however far Newton came:
//!
//! ```text
//! m (v'^2 - v_0^2) / 2 + s_0 (z'^2 - z^2) / 2 <= F_applied (x' - x) - b v^2 h
//! ```
//!
//! because on the exact path `v F - s_0 z dz/dt = |v| g (q (1 - y) + y^2)`, y = d s_0 z / g, q = s_1(v) |v| / g = w / (1 + w),
//! and that is never negative for q <= 4. g is taken at a predicted midpoint speed, which keeps the second order.
//!
//! Properties: friction never adds energy; the deflection stays below F_brk / s_0; sliding steadily it is g(v); below
//! break-away it settles at z = F / s_0; above it slides; slowly loaded it moves by -(F_brk / s_0) ln(1 - F / F_brk); it tends to
//! stick and slip as s_0 grows; the step is of second order and stable for every span up to 100 us.
//!
//! Source: [Canudas de Wit 1995] Canudas de Wit, Olsson, Astrom, Lischinsky, "A new model for control of systems with friction",
//! IEEE Trans. Automatic Control 40(3); [Barabanov 2000] Barabanov, Ortega, "Necessary and sufficient conditions for passivity of
//! the LuGre friction model", IEEE Trans. Automatic Control 45(4); [Dupont 2002] Dupont, Hayward, Armstrong, Altpeter, "Single
//! state elastoplastic friction models", IEEE Trans. Automatic Control 47(5). Fading form of s_1: ours, the simplest that is
//! passive and gives psi in closed form. v_s and the range of s_0: textbook prior.

use super::sheet::{Effect, EffectKey, Excitation, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// v_s, m/s: a guess of what lies between creeping and sliding; the effect stribeck-friction has its own.
const STRIBECK_M_PER_S: f64 = 1e-3;

/// Damping ratio of the unloaded bristles at rest: settles without ringing. Under a force F it is sqrt(1 - F / F_brk) of it.
const DAMPING_RATIO: f64 = 0.7;

/// Least level of friction, N: a fiftieth of the force sensor's noise.
const LEAST_LEVEL_N: f64 = 1e-2;

/// Steps of Newton's method, after one for the prediction: the test `the_balance_is_solved` says what they leave.
const NEWTON_STEPS: u32 = 4;

effect_numbers! {
    pub(crate) struct Presliding {
        stiffness_n_per_m: EffectKey {
            name: "stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 30000.0,
            max: 30000000.0,
            drawn: [100000.0, 10000000.0],
            neutral: Some(f64::INFINITY),
            meaning: "s_0, stiffness of the bristles",
            ..EffectKey::USUAL
        },
    }
}

/// State of one piston on its bristles, along its own extension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bristle {
    /// Of the rod.
    pub(crate) velocity_m_per_s: f64,
    /// z, mean deflection of the bristles.
    pub(crate) deflection_m: f64,
}

/// Force, mass and friction levels over a span, held constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BristleLoad {
    /// All forces but friction, along the extension.
    pub(crate) force_n: f64,
    /// All that moves with the piston.
    pub(crate) mass_kg: f64,
    /// b, viscous friction.
    pub(crate) viscous_n_s_per_m: f64,
    /// Level of sliding friction.
    pub(crate) sliding_n: f64,
    /// Level of break-away, not below the sliding level.
    pub(crate) break_away_n: f64,
}

impl Effect for Presliding {
    const SHEET: Sheet = Sheet {
        name: "presliding",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "bristles hold the piston: before it breaks away it moves elastically (LuGre)",
        source: "Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE TAC 40(3); range: effects.md, textbook prior",
        has_memory: true,
        excited_by: Excitation::Creeping,
        distinguished_by: &[ManualMeasurement::Uncoupling, ManualMeasurement::Pulling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl Presliding {
    /// Moves piston and bristles through a span, s: the displacement along the extension, m, and what is there at the end.
    pub(crate) fn advance(&self, from: Bristle, load: BristleLoad, span_s: f64) -> (f64, Bristle) {
        let inertia = 2.0 * load.mass_kg / span_s;
        let elastic_n = self.stiffness_n_per_m * from.deflection_m;
        let push_n = load.force_n + inertia * from.velocity_m_per_s - elastic_n;
        let direction = push_n.signum();
        let balance = |level_n: f64| Balance {
            slope: inertia + load.viscous_n_s_per_m,
            push_n: push_n.abs(),
            room_n: level_n - direction * elastic_n,
            relaxation: span_s * self.stiffness_n_per_m / level_n,
            fading: self.damping(&load) / level_n,
        };
        let predicted = balance(level(&load, from.velocity_m_per_s));
        let level_n = level(&load, predicted.closer(predicted.bound()));
        let balance = balance(level_n);
        let speed = (0..NEWTON_STEPS).fold(balance.bound(), |speed, _| balance.closer(speed));
        let speed = balance.not_above(speed);

        let way = speed * span_s;
        let taken_up = phi_1(balance.relaxation * speed) * way * (balance.room_n / level_n);
        let to = Bristle {
            velocity_m_per_s: 2.0 * direction * speed - from.velocity_m_per_s,
            deflection_m: from.deflection_m + direction * taken_up,
        };
        (direction * way, to)
    }

    /// The bristles' force on the piston at an instant, N along the extension: against the motion while it slides.
    pub(crate) fn force(&self, bristle: Bristle, load: BristleLoad) -> f64 {
        let level_n = level(&load, bristle.velocity_m_per_s);
        let elastic_n = self.stiffness_n_per_m * bristle.deflection_m;
        let speed = bristle.velocity_m_per_s.abs();
        let fading = self.damping(&load) / level_n * speed;
        // s_1(v) dz/dt, with dz/dt = v (1 - y).
        let room_n = level_n * bristle.velocity_m_per_s.signum() - elastic_n;
        -(elastic_n + fading / (1.0 + fading) * room_n)
    }

    /// s_1 at rest, N s/m.
    fn damping(&self, load: &BristleLoad) -> f64 {
        2.0 * DAMPING_RATIO * (self.stiffness_n_per_m * load.mass_kg).sqrt()
    }
}

/// g(v), N: what the bristles bear at this velocity, m/s.
fn level(load: &BristleLoad, velocity_m_per_s: f64) -> f64 {
    let ratio = velocity_m_per_s / STRIBECK_M_PER_S;
    let excess_n = load.break_away_n - load.sliding_n;
    (load.sliding_n + excess_n * libm::exp(-ratio * ratio)).max(LEAST_LEVEL_N)
}

/// `H(s) = slope s + room (1 - psi(s)) = push`, of the module's head, for the speed s >= 0 at the midpoint.
struct Balance {
    /// 2 m / h + b, N s/m.
    slope: f64,
    /// |c|, N.
    push_n: f64,
    /// g - f, N.
    room_n: f64,
    /// k / s, s/m.
    relaxation: f64,
    /// w / s, s/m.
    fading: f64,
}

impl Balance {
    /// A speed on the side from which Newton's method does not pass the root: below it when concave, above it when convex.
    fn bound(&self) -> f64 {
        let slid = (self.push_n - self.room_n) / self.slope;
        // -psi'(0) = (relaxation / 2 + fading); H lies below its tangent at 0 when concave, above it when convex.
        let tangent = self.slope + self.room_n * (self.relaxation / 2.0 + self.fading);
        if self.room_n >= 0.0 {
            slid.max(self.push_n / tangent)
        } else if tangent > 0.0 {
            slid.min(self.push_n / tangent)
        } else {
            slid
        }
    }

    /// One step of Newton's method.
    fn closer(&self, speed: f64) -> f64 {
        let (k, faded) = (self.relaxation * speed, 1.0 + self.fading * speed);
        let phi = phi_1(k);
        let psi = phi / faded;
        let psi_slope = (phi_1_slope(k, phi) * self.relaxation - psi * self.fading) / faded;
        let missing = self.push_n - (self.slope * speed + self.room_n * (1.0 - psi));
        speed + missing / (self.slope - self.room_n * psi_slope)
    }

    /// The speed itself if it is not above the root; else one a little below, on the chord from 0, which lies above a convex H.
    fn not_above(&self, speed: f64) -> f64 {
        let psi = phi_1(self.relaxation * speed) / (1.0 + self.fading * speed);
        let reached = self.slope * speed + self.room_n * (1.0 - psi);
        if reached > self.push_n { speed * (self.push_n / reached) } else { speed }
    }
}

/// (1 - e^-k) / k.
fn phi_1(k: f64) -> f64 {
    if k == 0.0 { 1.0 } else { -libm::expm1(-k) / k }
}

/// Its derivative, (e^-k - phi_1) / k; good to 1e-9, which only Newton's speed depends on.
fn phi_1_slope(k: f64, phi: f64) -> f64 {
    if k < 1e-4 { k / 3.0 - 0.5 } else { (1.0 - k * phi - phi) / k }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LONGEST_S: f64 = 1e-4;

    fn presliding(stiffness_n_per_m: f64) -> Presliding {
        Presliding { stiffness_n_per_m }
    }

    fn load(force_n: f64) -> BristleLoad {
        BristleLoad { force_n, mass_kg: 5.0, viscous_n_s_per_m: 0.0, sliding_n: 26.0, break_away_n: 35.0 }
    }

    fn at(velocity_m_per_s: f64, deflection_m: f64) -> Bristle {
        Bristle { velocity_m_per_s, deflection_m }
    }

    /// Many steps: where it came, and what is there.
    fn run(of: Presliding, from: Bristle, load: BristleLoad, span_s: f64, steps: u32) -> (f64, Bristle) {
        (0..steps).fold((0.0, from), |(x, bristle), _| {
            let (way, next) = of.advance(bristle, load, span_s);
            (x + way, next)
        })
    }

    /// The equations as printed, by the classical Runge-Kutta method: x, v, z.
    fn printed(s_0: f64, load: BristleLoad, [_, v, z]: [f64; 3]) -> [f64; 3] {
        let g = load.sliding_n + (load.break_away_n - load.sliding_n) * (-(v / 1e-3).powi(2)).exp();
        let s_1 = 1.4 * (s_0 * load.mass_kg).sqrt();
        let dz = v - v.abs() * s_0 * z / g;
        let friction = s_0 * z + s_1 * g / (g + s_1 * v.abs()) * dz;
        [v, (load.force_n - load.viscous_n_s_per_m * v - friction) / load.mass_kg, dz]
    }

    fn runge_kutta(s_0: f64, load: BristleLoad, from: [f64; 3], span_s: f64, steps: u32) -> [f64; 3] {
        let plus = |y: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        let h = span_s / f64::from(steps);
        (0..steps).fold(from, |y, _| {
            let k1 = printed(s_0, load, y);
            let k2 = printed(s_0, load, plus(y, k1, h / 2.0));
            let k3 = printed(s_0, load, plus(y, k2, h / 2.0));
            let k4 = printed(s_0, load, plus(y, k3, h));
            std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
        })
    }

    #[test]
    fn the_step_is_of_second_order() {
        // A blow of 34 N on a piston that slides back: it stops, bends the bristles the other way, breaks away.
        let (s_0, start) = (1e5, at(-0.003, -2e-4));
        let truth = runge_kutta(s_0, load(34.0), [0.0, -0.003, -2e-4], 0.02, 20_000);
        let error = |steps: u32| {
            let (x, end) = run(presliding(s_0), start, load(34.0), 0.02 / f64::from(steps), steps);
            [x - truth[0], end.velocity_m_per_s - truth[1], end.deflection_m - truth[2]].map(f64::abs)
        };
        let [coarse, fine] = [error(400), error(800)];
        for (coarse, fine) in coarse.into_iter().zip(fine) {
            // Twice the steps, a quarter of the error; 3 leaves room for the third order.
            assert!(coarse / fine > 3.0, "{coarse:e} to {fine:e}");
        }
        // At the plant's step the way is off by less than a tenth of the sensor's noise of 20 um.
        assert!(error(200)[0] < 2e-6, "{:e} m", error(200)[0]);
    }

    #[test]
    fn below_break_away_it_settles_where_the_bristles_carry_the_force() {
        for s_0 in [3e4, 1e5, 1e6, 1e7, 3e7] {
            for mass_kg in [1.5, 5.0, 25.0] {
                for span_s in [12.5e-6, LONGEST_S] {
                    let pushed = BristleLoad { mass_kg, ..load(20.0) };
                    let (_, end) = run(presliding(s_0), at(0.0, 0.0), pushed, span_s, 200_000);
                    // The slowest: decay at 0.49 sqrt(s_0 / m (1 - 20 / 35)) > 11 1/s over 2.5 s is 1e-12 of F / s_0.
                    let off = (end.deflection_m * s_0 - 20.0).abs();
                    assert!(off < 1e-9, "s_0 = {s_0}, {mass_kg} kg, {span_s} s: {off:e} N");
                    assert!(end.velocity_m_per_s.abs() < 1e-12, "s_0 = {s_0}, {mass_kg} kg: still creeps");
                }
            }
        }
    }

    #[test]
    fn in_balance_it_stays_to_the_bit() {
        // 2^-15 m * 2^20 N/m = 32 N.
        let rest = at(0.0, 1.0 / 32768.0);
        assert_eq!(presliding(1_048_576.0).advance(rest, load(32.0), LONGEST_S), (0.0, rest));
        assert_eq!(presliding(1e5).advance(at(0.0, 0.0), load(0.0), LONGEST_S), (0.0, at(0.0, 0.0)));
    }

    #[test]
    fn above_break_away_it_slides_with_the_friction_of_its_speed() {
        for s_0 in [3e4, 3e7] {
            let pushed = BristleLoad { viscous_n_s_per_m: 1100.0, ..load(136.0) };
            let (way, end) = run(presliding(s_0), at(0.0, 0.0), pushed, LONGEST_S, 10_000);
            // (136 - 26) N / 1100 N s/m; 1 s is 220 time constants of the mass.
            assert!((end.velocity_m_per_s - 0.1).abs() < 1e-12, "s_0 = {s_0}: {end:?}");
            assert!(way > 0.09);
            assert!((presliding(s_0).force(end, pushed) + 26.0).abs() < 1e-9, "s_0 = {s_0}: {end:?}");
            assert!((end.deflection_m * s_0 - 26.0).abs() < 1e-9);
        }
    }

    #[test]
    fn loaded_slowly_it_moves_by_the_logarithm_of_what_is_left() {
        // dz/dx = 1 - s_0 z / F_brk as long as v is far below v_s.
        let (s_0, steps) = (1e5, 100_000);
        let form = |elastic_n: f64| -35.0 / s_0 * (1.0 - elastic_n / 35.0).ln();
        assert_eq!(form(0.0), 0.0);
        let (mut x, mut bristle) = (0.0, at(0.0, 0.0));
        for step in 0..steps {
            let loaded = load(17.5 * f64::from(step) / f64::from(steps));
            let (way, next) = presliding(s_0).advance(bristle, loaded, LONGEST_S);
            (x, bristle) = (x + way, next);
        }
        // At 36 um/s at most g is 26 % of (0.036)^2 = 4e-4 below F_brk, and x by less than that.
        let expected = form(s_0 * bristle.deflection_m);
        assert!((x / expected - 1.0).abs() < 4e-4, "{x:e} m for {expected:e} m");
        assert!(x > 1.3 * 17.5 / s_0, "moved elastically, and a little more");
    }

    #[test]
    fn it_tends_to_stick_and_slip_as_the_bristles_stiffen() {
        for s_0 in [3e5, 3e6, 3e7] {
            // Stick and slip stops after m v^2 / (2 F_sli); the bristles take up F_sli / s_0 first and give back as much at last.
            let (way, end) = run(presliding(s_0), at(0.1, 0.0), load(0.0), LONGEST_S, 10_000);
            let stick_slip = 5.0 * 0.01 / (2.0 * 26.0);
            // 0.1 um for the last millimetre per second, where 35 N brake 5 kg in place of 26.
            assert!((way - stick_slip).abs() < 2.0 * 35.0 / s_0 + 1e-7, "s_0 = {s_0}: {way:e} m");
            assert!(end.velocity_m_per_s.abs() < 1e-9);
            // Held at 32 N, which comes within 5 s, it moves by 35 / s_0 ln (35 / 3) and somewhat more as it creeps there, and
            // does not slide; at 36 N it does.
            let reached = |most_n: f64| {
                let ramp = (0..60_000).fold((0.0, at(0.0, 0.0)), |(x, bristle), step| {
                    let loaded = load(most_n * (f64::from(step) / 50_000.0).min(1.0));
                    let (way, next) = presliding(s_0).advance(bristle, loaded, LONGEST_S);
                    (x + way, next)
                });
                ramp.0
            };
            assert!(reached(32.0) < 35.0 / s_0 * 35.0_f64.ln(), "s_0 = {s_0}");
            assert!(reached(36.0) > 0.1, "s_0 = {s_0}");
        }
    }

    #[test]
    fn the_balance_is_solved() {
        for [break_away_n, sliding_n] in [[35.0, 26.0], [26.0, 26.0], [52.0, 26.0], [5.0, 1.0], [0.0, 0.0]] {
            for (s_0, mass_kg) in [(3e4, 0.5), (3e4, 25.0), (1e6, 5.0), (3e7, 0.5), (3e7, 25.0)] {
                for (push_n, share) in (0..400).map(|i| (f64::from(i % 40), f64::from(i / 40) / 5.0 - 1.0)) {
                    let pushed = BristleLoad { mass_kg, sliding_n, break_away_n, ..load(0.0) };
                    let level_n = level(&pushed, push_n / 1e3);
                    let balance = Balance {
                        slope: 2.0 * mass_kg / LONGEST_S,
                        push_n: push_n * push_n,
                        room_n: level_n - share * break_away_n.max(LEAST_LEVEL_N),
                        relaxation: LONGEST_S * s_0 / level_n,
                        fading: presliding(s_0).damping(&pushed) / level_n,
                    };
                    let newton = (0..NEWTON_STEPS).fold(balance.bound(), |speed, _| balance.closer(speed));
                    let speed = balance.not_above(newton);
                    let psi = phi_1(balance.relaxation * speed) / (1.0 + balance.fading * speed);
                    let left_n = balance.push_n - balance.slope * speed - balance.room_n * (1.0 - psi);
                    // Never above the root but for roundings of 1600 N; below it by what no sensor sees.
                    assert!(
                        (-1e-11..1e-5).contains(&left_n),
                        "{left_n:e} N at {push_n}^2 N of {share}, s_0 = {s_0}"
                    );
                }
            }
        }
    }

    /// Any span, rig and load, also those where a level falls to nothing.
    fn any_case() -> impl Strategy<Value = (f64, BristleLoad, Bristle, f64)> {
        let levels = (0.0..300.0_f64, 0.0..1.0_f64);
        let rig = (3e4_f64.ln()..3e7_f64.ln(), 0.5..25.0_f64, 0.0..1e4_f64, levels);
        let load = prop_oneof![-60.0..60.0_f64, -3000.0..3000.0_f64];
        let speed = prop_oneof![Just(0.0), -1e-3..1e-3_f64, -0.05..0.05_f64, -3.0..3.0_f64];
        (rig, load, speed, -1.0..1.0_f64, 1e-6..LONGEST_S).prop_map(|(rig, force_n, speed, share, span_s)| {
            let (log_s_0, mass_kg, viscous_n_s_per_m, (break_away_n, sliding)) = rig;
            let s_0 = log_s_0.exp();
            let sliding_n = break_away_n * sliding;
            let load = BristleLoad { force_n, mass_kg, viscous_n_s_per_m, sliding_n, break_away_n };
            (s_0, load, at(speed, share * break_away_n / s_0), span_s)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn friction_never_adds_energy((s_0, load, start, span_s) in any_case()) {
            let energy = |b: Bristle| {
                let kinetic = load.mass_kg * b.velocity_m_per_s * b.velocity_m_per_s;
                (kinetic + s_0 * b.deflection_m * b.deflection_m) / 2.0
            };
            let (way, end) = presliding(s_0).advance(start, load, span_s);
            let gained = energy(end) - energy(start);
            let viscous = load.viscous_n_s_per_m * way * way / span_s;
            let work = load.force_n * way - viscous;
            // Roundings of the energies.
            let rounding = 1e-13 * (energy(start) + energy(end) + work.abs() + viscous);
            prop_assert!(gained <= work + rounding, "{gained:e} J > {work:e} J");
        }

        #[test]
        fn the_deflection_stays_below_break_away((s_0, load, start, span_s) in any_case()) {
            let (_, end) = presliding(s_0).advance(start, load, span_s);
            let most = load.break_away_n.max(LEAST_LEVEL_N) / s_0;
            // One rounding of the sum.
            prop_assert!(end.deflection_m.abs() <= most * (1.0 + 1e-15), "{end:?} beyond {most:e}");
        }

        #[test]
        fn the_force_is_bounded_and_opposes_sliding((s_0, load, start, _) in any_case()) {
            let force = presliding(s_0).force(start, load);
            // The damping adds at most as much as the level leaves room: g - d s_0 z, whichever its sign.
            let most = load.break_away_n.max(LEAST_LEVEL_N);
            prop_assert!(force.abs() <= most * (1.0 + 1e-15));
            let velocity = start.velocity_m_per_s;
            let settled = at(velocity, velocity.signum() * level(&load, velocity) / s_0);
            prop_assert!(presliding(s_0).force(settled, load) * velocity <= 0.0);
        }
    }
}
