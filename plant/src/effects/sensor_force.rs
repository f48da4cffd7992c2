//! What declared terms are over, and the force sensors that they follow: in a step those of the end of the substep before.
//!
//! Why not those of the same instant: `declared.rs`.

use super::acting::Effects;
use super::declared::TermInputs;
use super::memory::axis_conditions_at;
use super::tabulated::AxisConditions;
use crate::integrator::{Integrator, Lanes};
use crate::lanes::{Axes, Pair};
use crate::truth::TrueForces;

impl Effects {
    /// Where the plant begins: what the force sensors show there, and what terms keep of it.
    pub(super) fn begin_forces(&mut self, of: &Integrator, lanes: &Lanes, linked: bool) {
        self.see_forces(of, lanes, Pair::both(0.0), linked);
        for axis in (0..2).filter(|axis| self.on[*axis].declared.follows_sensor) {
            let values = self.declared_in_step(axis, &axis_conditions_at(of, lanes, axis)).values();
            self.memory.declared[axis] = self.on[axis].declared.begin(&values);
        }
    }

    /// Inputs of declared terms of a force or a flow, and of their memory variables.
    pub(crate) fn declared_in_step<'a>(
        &'a self,
        axis: usize,
        conditions: &'a AxisConditions,
    ) -> TermInputs<'a> {
        self.declared_at(axis, conditions, self.memory.sensor_force_n[axis])
    }

    /// Keeps what the force sensors should show, where a declared term is over it in a step.
    pub(super) fn see_forces(&mut self, of: &Integrator, lanes: &Lanes, hand: Pair, linked: bool) {
        if self.on.iter().any(|on| on.declared.follows_sensor) {
            let forces = TrueForces::at(of, Some(self), lanes, hand, linked);
            self.memory.sensor_force_n = [0, 1].map(|axis| forces.sensor_n(of, axis));
        }
    }

    /// Inputs of declared terms.
    pub(crate) fn declared_at<'a>(
        &'a self,
        axis: usize,
        conditions: &'a AxisConditions,
        sensor_force_n: f64,
    ) -> TermInputs<'a> {
        let command = self.memory.commands[axis].newest();
        let time_s = self.memory.substeps as f64 * self.substep_s;
        TermInputs { conditions, command, time_s, sensor_force_n, kept: &self.memory.declared[axis] }
    }
}
