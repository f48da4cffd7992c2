//! Friction with effects: the levels of one axis in both directions, each the sum of its named terms.

use super::acting::Effects;
use super::sums::{BreakAwayLevel, SlidingLevel, Viscous};
use crate::integrator::Integrator;
use crate::motion::Levels;

/// What the levels depend on beside the speed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rubbing {
    pub(crate) extension_m: f64,
    /// Gauge pressures of chambers a and b, Pa.
    pub(crate) gauge_pa: [f64; 2],
    /// Time at rest, s.
    pub(crate) rest_s: f64,
}

/// Place of a direction in [`Levels`] as a sign.
const DIRECTIONS: [f64; 2] = [1.0, -1.0];

impl Effects {
    /// Terms of the sliding level in a direction (1 extending, -1 retracting) at a speed.
    pub(crate) fn sliding_level(
        &self,
        of: &Integrator,
        axis: usize,
        at: &Rubbing,
        speed: f64,
        direction: f64,
    ) -> SlidingLevel {
        let on = &self.on[axis];
        let file = of.motion.levels().sliding_n[0];
        SlidingLevel {
            stribeck_friction: on.stribeck_friction.map_or(0.0, |effect| effect.term(speed)),
            friction_asymmetry: on.friction_asymmetry.map_or(0.0, |effect| effect.term(file, direction)),
            pressure_dependent_friction: on
                .pressure_dependent_friction
                .map_or(0.0, |effect| effect.term(at.gauge_pa[0], at.gauge_pa[1])),
            position_dependent_friction: on
                .position_dependent_friction
                .map_or(0.0, |effect| effect.term(at.extension_m)),
        }
    }

    /// Terms of the break-away level in a direction.
    pub(crate) fn break_away_level(
        &self,
        of: &Integrator,
        axis: usize,
        at: &Rubbing,
        direction: f64,
    ) -> BreakAwayLevel {
        let on = &self.on[axis];
        let file = of.motion.levels().break_away_n[0];
        let sliding = self.sliding_level(of, axis, at, 0.0, direction);
        BreakAwayLevel {
            friction_asymmetry: on.friction_asymmetry.map_or(0.0, |effect| effect.term(file, direction)),
            pressure_dependent_friction: sliding.pressure_dependent_friction,
            position_dependent_friction: sliding.position_dependent_friction,
            rest_time_dependent_break_away: on
                .rest_time_dependent_break_away
                .map_or(0.0, |effect| effect.term(at.rest_s)),
        }
    }

    /// Terms of the viscous friction in a direction.
    pub(crate) fn viscous_term(&self, of: &Integrator, axis: usize, direction: f64) -> Viscous {
        let file = of.motion.levels().viscous_n_s_per_m[0];
        Viscous {
            friction_asymmetry: self.on[axis]
                .friction_asymmetry
                .map_or(0.0, |effect| effect.term(file, direction)),
        }
    }

    /// Viscous friction in a direction, N s/m.
    pub(crate) fn viscous(&self, of: &Integrator, axis: usize, direction: f64) -> f64 {
        self.viscous_term(of, axis, direction).sum(of.motion.levels().viscous_n_s_per_m[0]).max(0.0)
    }

    /// All levels of an axis at a speed, both directions; none below 0, none easier to break away than to slide.
    pub(crate) fn levels(&self, of: &Integrator, axis: usize, at: &Rubbing, speed: f64) -> Levels {
        let file = *of.motion.levels();
        let sliding = |speed, direction| {
            self.sliding_level(of, axis, at, speed, direction).sum(file.sliding_n[0]).max(0.0)
        };
        Levels {
            sliding_n: DIRECTIONS.map(|direction| sliding(speed, direction)),
            break_away_n: DIRECTIONS.map(|direction| {
                let level = self.break_away_level(of, axis, at, direction).sum(file.break_away_n[0]);
                level.max(sliding(0.0, direction))
            }),
            viscous_n_s_per_m: DIRECTIONS.map(|direction| self.viscous(of, axis, direction)),
        }
    }
}
