//! Friction with effects: the levels of one axis in both directions, each the sum of its named terms.

use super::OpenBalance;
use super::acting::Effects;
use super::memory::AxisEffectStates;
use super::presliding::{Bristle, BristleLoad};
use super::sums::{BreakAwayLevel, Bristles, SlidingLevel, Viscous};
use crate::integrator::{Integrator, MidpointAir};
use crate::lanes::Axes;
use crate::motion::{Levels, PistonState, side};
use crate::truth::AirState;

/// Values that the friction levels depend on, besides the speed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrictionConditions {
    pub(crate) extension_m: f64,
    /// Gauge pressures of chambers a and b, Pa.
    pub(crate) gauge_pa: [f64; 2],
    pub(crate) rest_s: f64,
}

/// The friction of an axis at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Friction<'a> {
    pub(super) effects: &'a Effects,
    pub(super) of: &'a Integrator,
    pub(super) axis: usize,
    pub(super) conditions: FrictionConditions,
}

/// Place of a direction in [`Levels`] as a sign.
const DIRECTIONS: [f64; 2] = [1.0, -1.0];

/// The direction of a speed or a force, as a sign; that of 0 is extending.
pub(super) fn direction_of(value: f64) -> f64 {
    DIRECTIONS[side(value)]
}

impl Effects {
    pub(crate) fn viscous_term(&self, of: &Integrator, axis: usize, direction: f64) -> Viscous {
        let file = of.motion.levels.viscous_n_s_per_m[0];
        Viscous {
            friction_asymmetry: self.on[axis]
                .friction_asymmetry
                .map_or(0.0, |effect| effect.term(file, direction)),
        }
    }

    /// Viscous friction in a direction, N s/m.
    pub(crate) fn viscous(&self, of: &Integrator, axis: usize, direction: f64) -> f64 {
        let sound = self.viscous_term(of, axis, direction).sum(of.motion.levels.viscous_n_s_per_m[0]);
        sound.max(0.0) * self.friction_factors[axis]
    }

    /// Friction in the middle of a step.
    pub(super) fn friction<'a>(
        &'a self,
        of: &'a Integrator,
        axis: usize,
        middle: &MidpointAir,
        axis_states: &AxisEffectStates,
    ) -> Friction<'a> {
        let pressure_pa = middle.pressure.map(|pair| pair.to_array()[axis]);
        let conditions = FrictionConditions {
            extension_m: middle.extension.to_array()[axis],
            gauge_pa: pressure_pa.map(|pa| pa - of.atmospheric_pa),
            rest_s: axis_states.rest_s,
        };
        Friction { effects: self, of, axis, conditions }
    }
}

impl<'a> Friction<'a> {
    pub(crate) fn at(
        effects: &'a Effects,
        of: &'a Integrator,
        axis: usize,
        piston: PistonState,
        air: &AirState,
    ) -> Self {
        let conditions = FrictionConditions {
            extension_m: piston.extension,
            gauge_pa: air.of_axis_pa(axis).map(|pa| pa - of.atmospheric_pa),
            rest_s: effects.memory.states.axes[axis].rest_s,
        };
        Self { effects, of, axis, conditions }
    }

    /// Terms of the sliding level in a direction (1 extending, -1 retracting) at a speed.
    pub(crate) fn sliding_level(&self, speed: f64, direction: f64) -> SlidingLevel {
        let (on, at) = (&self.effects.on[self.axis], &self.conditions);
        let file = self.of.motion.levels.sliding_n[0];
        SlidingLevel {
            stribeck_friction: on.stribeck_friction.map_or(0.0, |effect| effect.term(speed)),
            friction_asymmetry: on.friction_asymmetry.map_or(0.0, |effect| effect.term(file, direction)),
            pressure_dependent_friction: on
                .pressure_dependent_friction
                .map_or(0.0, |effect| effect.term(at.gauge_pa[0], at.gauge_pa[1])),
            position_dependent_friction: on
                .position_dependent_friction
                .map_or(0.0, |effect| effect.term(at.extension_m)),
            added: on.added(OpenBalance::SlidingLevel { at, speed_m_per_s: speed, direction }),
        }
    }

    /// Terms of the break-away level in a direction, beside those of its sliding level.
    pub(crate) fn break_away_level(&self, direction: f64, sliding: &SlidingLevel) -> BreakAwayLevel {
        let (on, at) = (&self.effects.on[self.axis], &self.conditions);
        let file = self.of.motion.levels.break_away_n[0];
        BreakAwayLevel {
            friction_asymmetry: on.friction_asymmetry.map_or(0.0, |effect| effect.term(file, direction)),
            pressure_dependent_friction: sliding.pressure_dependent_friction,
            position_dependent_friction: sliding.position_dependent_friction,
            rest_time_dependent_break_away: on
                .rest_time_dependent_break_away
                .map_or(0.0, |effect| effect.term(at.rest_s)),
            added: on.added(OpenBalance::BreakAwayLevel { at, direction }),
        }
    }

    fn viscous(&self, direction: f64) -> f64 {
        self.effects.viscous(self.of, self.axis, direction)
    }

    /// Level of sliding friction in a direction (1 extending, -1 retracting) at a speed, N, not below 0.
    pub(super) fn sliding_n(&self, speed: f64, direction: f64) -> f64 {
        let file = self.of.motion.levels.sliding_n[0];
        let level = if self.effects.changed_laws[self.axis].friction {
            self.sliding_level(speed, direction).sum(file).max(0.0)
        } else {
            file
        };
        level * self.effects.friction_factors[self.axis]
    }

    /// Break-away level in a direction, N: not easier than to slide.
    pub(super) fn break_away_n(&self, direction: f64) -> f64 {
        let (file, factor) = (&self.of.motion.levels, self.effects.friction_factors[self.axis]);
        if !self.effects.changed_laws[self.axis].friction {
            return file.break_away_n[0] * factor;
        }
        let sliding = self.sliding_level(0.0, direction);
        let level = self.break_away_level(direction, &sliding).sum(file.break_away_n[0]);
        (level * factor).max(sliding.sum(file.sliding_n[0]).max(0.0) * factor)
    }

    /// All levels at a speed, both directions.
    pub(crate) fn levels(&self, speed: f64) -> Levels {
        Levels {
            sliding_n: DIRECTIONS.map(|direction| self.sliding_n(speed, direction)),
            break_away_n: DIRECTIONS.map(|direction| self.break_away_n(direction)),
            viscous_n_s_per_m: DIRECTIONS.map(|direction| self.viscous(direction)),
        }
    }

    /// Friction of the bristles, along the axis's extension; `None` for an axis without them.
    pub(crate) fn bristles(&self, piston: PistonState, force_n: f64) -> Option<Bristles> {
        let effect = self.effects.on[self.axis].presliding?;
        let deflection_m = self.effects.memory.states.axes[self.axis].deflection_m;
        let bristle = Bristle { velocity_m_per_s: piston.velocity, deflection_m };
        let bristle_load = self.bristle_load(piston.velocity, piston.velocity.abs(), force_n);
        Some(Bristles { presliding: effect.force(bristle, bristle_load) })
    }

    /// Load of the bristles, with the friction levels at a speed.
    pub(super) fn bristle_load(&self, velocity: f64, speed: f64, force_n: f64) -> BristleLoad {
        let direction = direction_of(if velocity == 0.0 { force_n } else { velocity });
        BristleLoad {
            force_n,
            mass_kg: self.of.motion.masses_kg[self.axis],
            viscous_n_s_per_m: self.viscous(direction),
            sliding_n: self.sliding_n(speed, direction),
            break_away_n: self.break_away_n(direction),
        }
    }

    /// The speed of a moving axis in the middle of a step, m/s, by its force at the beginning; 0 if it would turn.
    pub(super) fn middle_speed(&self, velocity: f64, push: f64, span_s: f64) -> f64 {
        if self.effects.on[self.axis].stribeck_friction.is_none() {
            return velocity.abs();
        }
        let direction = if velocity == 0.0 { push.signum() } else { velocity.signum() };
        let friction = self.sliding_n(velocity.abs(), direction_of(direction))
            + self.viscous(direction_of(direction)) * velocity.abs();
        let acceleration = (push * direction - friction) / self.of.motion.masses_kg[self.axis];
        (velocity.abs() + acceleration * span_s / 2.0).max(0.0)
    }
}
