//! Forces on a piston: friction with stick and slip, bristles, and forces that depend on position.
//!
//! A piston sticks when its velocity changes sign within a step (Karnopp's band, as wide as the step makes it). It is then held
//! at v = 0 exactly, until the driving force exceeds the break-away force. As the step goes to zero this becomes the stick and
//! slip of the baseline; at 10 us a piston that sticks loses less than 1e-4 m/s and 1 nm.
//!
//! Source: Karnopp 1985, ASME J. Dyn. Sys. 107(1); Canudas de Wit et al. 1995, IEEE TAC 40(3) (LuGre); Dupont et al. 2002,
//! IEEE TAC 47(5) (elasto-plastic form); Olsson 1996 (fading micro-damping).

use super::Form;
use super::numbers::Numbers;

/// Effects on the motion that are on; SI, along the extension of the axis unless said otherwise.
#[derive(Debug, Clone, Default)]
pub(super) struct MotionLaws {
    pub(super) form: Form,
    /// Velocity in m/s and exponent.
    pub(super) stribeck: Option<[f64; 2]>,
    /// Bristle stiffness, N/m.
    pub(super) presliding: Option<f64>,
    pub(super) asymmetry: f64,
    /// N per Pa of the sum of both gauge pressures.
    pub(super) pressure_slope: f64,
    /// Bump N, centre m, width m, slope N, ripple N, pitch m.
    pub(super) friction_over_way: Option<[f64; 6]>,
    /// Growth after 10 s and onset s.
    pub(super) rest_growth: Option<[f64; 2]>,
    /// Force of the rig's inclination, N in +x of the rig.
    pub(super) inclination_n: f64,
    /// Spring N, ripple N, pitch m, over x of the rig and in +x.
    pub(super) force_over_way: Option<[f64; 3]>,
    /// Stiffness of the elastic stops, N/m.
    pub(super) stop_n_per_m: Option<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub(super) laws: MotionLaws,
    sliding_n: f64,
    break_away_n: f64,
    viscous_n_s_per_m: f64,
    pub(super) mass_kg: f64,
    stroke_m: f64,
    /// +1 for the drive; -1 for the load, whose rod extends to -x.
    pub(super) to_rig: f64,
    micro_damping_n_s_per_m: f64,
    fading_friction: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct FrictionState {
    pub(super) extension_m: f64,
    /// Sum of both gauge pressures, Pa.
    pub(super) gauge_pa: f64,
    /// Pressure of a less that of b, Pa.
    pub(super) across_pa: f64,
    pub(super) rest_s: f64,
    /// Rest before the last break-away, s, and the extension at which it happened, m.
    pub(super) last_break_away: [f64; 2],
}

/// Depth of the elastic stops, m.
const BUFFER_M: f64 = 1e-3;
/// Speed over which the bristles' friction falls from break-away to sliding, and over which their damping fades, m/s.
const BRISTLE_M_PER_S: f64 = 1e-3;
/// Share of the bristles' critical damping.
const BRISTLE_DAMPING: f64 = 0.7;
/// Share of the elasto-plastic bristles' largest deflection that is elastic.
const ELASTIC_SHARE: f64 = 0.7;
/// Smallest force of the bristles, N: without a force they would have no steady deflection.
const LEAST_N: f64 = 1e-3;
/// The near form's asymmetry changes sign over this speed, m/s.
const SIDES_M_PER_S: f64 = 2e-2;
/// Sum of gauge pressures at which the near form of pressure-dependent friction agrees with the catalogue's, Pa.
const SEALS_AGREE_PA: f64 = 5e5;
/// Rest after which all forms of the growth of break-away agree, s.
const REST_S: f64 = 10.0;
/// Relative excess of the slope of the forms' rail at its end over the mean slope.
const RAIL_BENDS: [f64; 3] = [0.0, 0.15, 1.0];
/// Relative excess of the far form's asymmetry over its mean with the rod fully extended.
const ROD_BENDS: f64 = 0.9;
/// The far form's bristles are stiffer by this share as the rod extends, and softer as it retracts.
const BRISTLES_DIFFER: f64 = 0.65;
/// Distance over which the growth of the break-away force fades in the far form, m.
const FILM_M: f64 = 1e-3;
/// Relative third harmonic of the forms' cogging.
const THIRD_HARMONIC: [f64; 3] = [0.0, 0.2, 0.5];
/// Share by which a far form of friction is larger as the rod extends and smaller as it retracts: the lips of a seal are not
/// symmetric.
const STRIBECK_DIFFERS: f64 = 0.52;
const BORE_DIFFERS: f64 = 0.55;

impl Motion {
    pub(super) fn new(numbers: &Numbers, axis: usize, laws: MotionLaws) -> Self {
        let mass_kg = numbers.mass_kg[axis];
        let damping = laws.presliding.map_or(0.0, |s0| 2.0 * BRISTLE_DAMPING * (s0 * mass_kg).sqrt());
        Motion {
            laws,
            sliding_n: numbers.sliding_n,
            break_away_n: numbers.break_away_n,
            viscous_n_s_per_m: numbers.viscous_n_s_per_m,
            mass_kg,
            stroke_m: numbers.stroke_m,
            to_rig: [1.0, -1.0][axis],
            micro_damping_n_s_per_m: damping,
            fading_friction: numbers.fading_friction,
        }
    }

    /// Nearest extension at which no stop pushes, m: where an axis can be at rest initially.
    pub(super) fn beside_the_stops(&self, extension_m: f64) -> f64 {
        let reach_m = if self.laws.stop_n_per_m.is_some() { BUFFER_M } else { 0.0 };
        extension_m.clamp(reach_m, self.stroke_m - reach_m)
    }

    /// Forces other than air, contact and friction, N, along the extension.
    #[inline(always)]
    pub(super) fn pushes(&self, extension_m: f64) -> f64 {
        let laws = &self.laws;
        let mut rig_n = laws.inclination_n;
        let mid = self.stroke_m / 2.0;
        let x = if self.to_rig > 0.0 { extension_m } else { self.stroke_m - extension_m };
        if laws.form.is_foreign() && rig_n != 0.0 {
            // A bent rail: steeper towards one end.
            rig_n *= 1.0 + laws.form.of(RAIL_BENDS) * (x - mid) / mid;
        }
        if let Some([spring, ripple, pitch]) = laws.force_over_way {
            let along = (x - mid) / mid;
            let hose = match laws.form {
                Form::Catalogue => along,
                Form::Near => 0.75 * along + 0.25 * along * along * along,
                // A cable hangs loose at mid-stroke and is taut at the ends.
                Form::Far => along * along * along,
            };
            let phase = std::f64::consts::TAU * x / pitch;
            let mut wave = libm::sin(phase);
            if laws.form.is_foreign() {
                wave += laws.form.of(THIRD_HARMONIC) * libm::sin(3.0 * phase);
            }
            rig_n += ripple * wave - spring * hose;
        }
        let mut rod_n = self.to_rig * rig_n;
        if let Some(stiffness) = laws.stop_n_per_m {
            let push = |depth_m: f64| {
                let depth_m = depth_m.max(0.0);
                // Rubber stiffens; equal to the spring at half of its depth.
                stiffness * depth_m * if laws.form.is_foreign() { depth_m / (BUFFER_M / 2.0) } else { 1.0 }
            };
            rod_n += push(BUFFER_M - extension_m) - push(extension_m - (self.stroke_m - BUFFER_M));
        }
        rod_n
    }

    /// Friction of a piston sliding in `direction` at a velocity, N along the extension, viscous friction included.
    #[inline(always)]
    pub(super) fn sliding(&self, at: FrictionState, velocity: f64, direction: f64) -> f64 {
        let side = self.side(at.extension_m, velocity, direction);
        let viscous = self.viscous_n_s_per_m * (1.0 + side * self.laws.asymmetry) * velocity;
        let level =
            self.sliding_level(at, velocity.abs(), side, direction > 0.0) + self.remaining_growth_n(at);
        -direction * level - viscous
    }

    /// Direction for the asymmetry, -1 to 1.
    #[inline(always)]
    fn side(&self, extension_m: f64, velocity: f64, direction: f64) -> f64 {
        if self.laws.asymmetry == 0.0 {
            return direction;
        }
        match self.laws.form {
            Form::Catalogue => direction,
            Form::Near => libm::tanh(velocity / SIDES_M_PER_S),
            // A bent rod presses on its seal in proportion to its extension.
            Form::Far => {
                let mid = self.stroke_m / 2.0;
                direction * (1.0 + ROD_BENDS * (extension_m - mid) / mid)
            }
        }
    }

    #[inline(always)]
    fn sliding_level(&self, at: FrictionState, speed: f64, side: f64, extends: bool) -> f64 {
        let laws = &self.laws;
        let mut level = self.sliding_n * (1.0 + side * laws.asymmetry) + self.on_both(at, extends);
        if let Some([velocity, exponent]) = laws.stribeck {
            let share = speed / velocity;
            let power = libm::pow(share, exponent);
            let falls = if laws.form == Form::Near { 1.0 / (1.0 + power) } else { libm::exp(-power) };
            let falls = laws.form.side(extends, STRIBECK_DIFFERS) * falls;
            level += (self.break_away_n - self.sliding_n) * falls;
        }
        if let Some([share, velocity]) = self.fading_friction {
            let along = speed / velocity;
            level *= 1.0 - share / (1.0 + along * along);
        }
        level.max(0.0)
    }

    /// Largest force that holds a resting piston in a direction, N.
    pub(super) fn break_away(&self, at: FrictionState, direction: f64) -> f64 {
        let laws = &self.laws;
        let side = if laws.form.is_far() { self.side(at.extension_m, 0.0, direction) } else { direction };
        let mut level = self.break_away_n * (1.0 + side * laws.asymmetry) + self.on_both(at, direction > 0.0);
        if laws.rest_growth.is_some() {
            level += self.rest_growth_n(at.rest_s);
        }
        level.max(self.sliding_level(at, 0.0, side, direction > 0.0))
    }

    /// Growth of the break-away force after a rest, N.
    fn rest_growth_n(&self, rest_s: f64) -> f64 {
        let Some([growth, onset_s]) = self.laws.rest_growth else { return 0.0 };
        let (now, then) = (1.0 + rest_s / onset_s, 1.0 + REST_S / onset_s);
        let share = if self.laws.form == Form::Near {
            (libm::pow(now, 0.15) - 1.0) / (libm::pow(then, 0.15) - 1.0)
        } else {
            libm::log(now) / libm::log(then)
        };
        self.break_away_n * growth * share
    }

    /// Remainder of the growth while the piston slides, N: in the far form the oil film rebuilds over a distance.
    fn remaining_growth_n(&self, at: FrictionState) -> f64 {
        if !self.laws.form.is_far() || self.laws.rest_growth.is_none() {
            return 0.0;
        }
        let [rest_s, from_m] = at.last_break_away;
        self.rest_growth_n(rest_s) * libm::exp(-(at.extension_m - from_m).abs() / FILM_M)
    }

    /// What pressure and position add to both sliding and break-away level, N.
    #[inline(always)]
    fn on_both(&self, at: FrictionState, extends: bool) -> f64 {
        let laws = &self.laws;
        let mut sum = 0.0;
        if laws.pressure_slope != 0.0 {
            let share = at.gauge_pa / SEALS_AGREE_PA;
            let grown = match laws.form {
                Form::Catalogue => share,
                Form::Near => libm::pow(share.max(0.0), 0.8),
                // The sealed pressure presses on the lip.
                Form::Far => 0.2 * share + 1.8 * (at.across_pa / SEALS_AGREE_PA).abs(),
            };
            sum += laws.pressure_slope * SEALS_AGREE_PA * grown;
        }
        if let Some(numbers) = laws.friction_over_way {
            sum += laws.form.side(extends, BORE_DIFFERS) * self.position_friction_n(numbers, at.extension_m);
        }
        sum
    }

    fn position_friction_n(
        &self,
        [bump, centre, width, slope, ripple, pitch]: [f64; 6],
        extension_m: f64,
    ) -> f64 {
        let (off, mid) = ((extension_m - centre) / width, self.stroke_m / 2.0);
        let along = (extension_m - mid) / mid;
        let turn = extension_m / pitch;
        if self.laws.form != Form::Near {
            return bump * libm::exp(-off * off)
                + slope * along
                + ripple * libm::sin(std::f64::consts::TAU * turn);
        }
        // A raised cosine of the same area, a bowed slope, a triangle of the same rms.
        let reach = std::f64::consts::PI.sqrt();
        let cosine =
            if off.abs() < reach { 0.5 + 0.5 * libm::cos(std::f64::consts::PI * off / reach) } else { 0.0 };
        let phase = turn - 0.25 - (turn - 0.25).floor();
        let triangle = (3.0_f64 / 2.0).sqrt() * (4.0 * (phase - 0.5).abs() - 1.0);
        bump * cosine + slope * libm::sin(std::f64::consts::FRAC_PI_2 * along) + ripple * triangle
    }

    /// Largest deflection of the bristles at this velocity, m, with the sign of the direction.
    #[inline(always)]
    fn full_deflection(&self, at: FrictionState, velocity: f64) -> f64 {
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let side = self.side(at.extension_m, velocity, direction);
        let level = self.sliding_level(at, velocity.abs(), side, direction > 0.0);
        let more = self.break_away(at, direction) - level;
        let share = velocity / BRISTLE_M_PER_S;
        let stiffness = self.stiffness(direction > 0.0);
        direction * (level + more * libm::exp(-share * share)).max(LEAST_N) / stiffness
    }

    /// Stiffness of bristles deflected to this side, N/m.
    #[inline(always)]
    fn stiffness(&self, extends: bool) -> f64 {
        let stiffness = self.laws.presliding.expect("asked for with bristles alone");
        self.laws.form.side(extends, BRISTLES_DIFFER) * stiffness
    }

    /// Share of the bristles' motion that is slip, 0 to 1.
    #[inline(always)]
    fn slip(&self, deflection: f64, full: f64) -> f64 {
        if self.laws.form != Form::Near {
            return 1.0;
        }
        let share = deflection / full;
        if share <= ELASTIC_SHARE {
            0.0
        } else if share >= 1.0 {
            1.0
        } else {
            let along = (share - ELASTIC_SHARE) / (1.0 - ELASTIC_SHARE);
            0.5 - 0.5 * libm::cos(std::f64::consts::PI * along)
        }
    }

    /// Friction at a deflection of the bristles, N along the extension, viscous friction included.
    #[inline(always)]
    pub(super) fn bristles(&self, at: FrictionState, velocity: f64, deflection: f64) -> f64 {
        let full = self.full_deflection(at, velocity);
        let slip = self.slip(deflection, full);
        let rate = velocity * (1.0 - slip * deflection / full);
        let stiffness = self.stiffness(deflection > 0.0);
        let damping = if self.laws.form == Form::Near {
            let share = velocity / BRISTLE_M_PER_S;
            self.micro_damping_n_s_per_m * libm::exp(-share * share)
        } else {
            // Never above the friction level of any speed.
            let level = stiffness * full.abs();
            self.micro_damping_n_s_per_m * level / (level + self.micro_damping_n_s_per_m * velocity.abs())
        };
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let viscous = self.viscous_n_s_per_m
            * (1.0 + self.side(at.extension_m, velocity, direction) * self.laws.asymmetry);
        -(stiffness * deflection + damping * rate + viscous * velocity)
    }

    /// The deflection after a span at constant velocity, m: exact for constant slip.
    #[inline(always)]
    pub(super) fn deflect(&self, at: FrictionState, velocity: f64, deflection: f64, span_s: f64) -> f64 {
        if velocity == 0.0 {
            return deflection;
        }
        let full = self.full_deflection(at, velocity);
        let slip = self.slip(deflection, full);
        if slip == 0.0 {
            return deflection + velocity * span_s;
        }
        let end = full / slip;
        end + (deflection - end) * libm::exp(-velocity * span_s / end)
    }
}
