//! From a command to a spool with effects: dead time, offset, play, and how the spool moves.

use super::acting::Effects;
use super::memory::AxisEffectStates;
use super::sums::{Arriving, LimitedRate, SpoolRate, Target};
use crate::integrator::PERIOD_S;
use crate::integrator::laws::StepContext;
use crate::lanes::Axes;

impl Effects {
    /// Terms of the command that arrives at the valve at a time of the period.
    pub(crate) fn arriving(&self, axis: usize, now: f64, local_s: f64) -> Arriving {
        let on = &self.on[axis];
        Arriving {
            command_dead_time: on.command_dead_time.map_or(0.0, |effect| {
                effect.term(self.memory.commands[axis].before(effect.delay_s - local_s), now)
            }),
            valve_offset: on.valve_offset.map_or(0.0, |effect| effect.offset),
        }
    }

    /// Terms of the spool's target, given what arrives.
    pub(crate) fn target(&self, axis: usize, axis_states: &AxisEffectStates, arriving: f64) -> Target {
        let hysteresis = self.on[axis].valve_hysteresis;
        Target { valve_hysteresis: hysteresis.map_or(0.0, |effect| effect.term(axis_states.play, arriving)) }
    }

    /// Terms of the spool's rate at an instant, without and with its limit.
    pub(crate) fn spool_rate(
        &self,
        axis: usize,
        axis_states: &AxisEffectStates,
        spool: f64,
        target: f64,
    ) -> (SpoolRate, LimitedRate) {
        let lag = (target - spool) / self.spool_time_constant_s;
        let on = &self.on[axis];
        let rate = SpoolRate {
            spool_second_order: on.spool_second_order.map_or(0.0, |_| axis_states.spool_rate_per_s - lag),
        };
        let free = rate.sum(lag);
        let limit = on.spool_rate_limit.map_or(0.0, |effect| effect.limit(0.0, free, 1.0) - free);
        (rate, LimitedRate { spool_rate_limit: limit })
    }

    /// The spool after a span that begins `local_s` after the period does.
    pub(super) fn spool_over(
        &self,
        axis: usize,
        axis_states: &mut AxisEffectStates,
        step: StepContext<'_>,
        spool: f64,
        local_s: f64,
    ) -> f64 {
        let span_s = step.span.span_s / 2.0;
        let edge_s = self.on[axis].command_dead_time.map_or(0.0, |effect| effect.delay_s % PERIOD_S);
        if local_s < edge_s && edge_s < local_s + span_s {
            let at_edge = self.spool_leg(axis, axis_states, step, spool, [local_s, edge_s]);
            return self.spool_leg(axis, axis_states, step, at_edge, [edge_s, local_s + span_s]);
        }
        self.spool_leg(axis, axis_states, step, spool, [local_s, local_s + span_s])
    }

    /// The spool after a leg of time over which its target is held.
    fn spool_leg(
        &self,
        axis: usize,
        axis_states: &mut AxisEffectStates,
        step: StepContext<'_>,
        from: f64,
        leg_s: [f64; 2],
    ) -> f64 {
        let on = &self.on[axis];
        let span_s = leg_s[1] - leg_s[0];
        let command = step.held.command.to_array()[axis];
        let arriving = self.arriving(axis, command, (leg_s[0] + leg_s[1]) / 2.0).sum(command);
        let sent = self.target(axis, axis_states, arriving).sum(arriving);
        axis_states.play = sent;
        let target = sent.clamp(-1.0, 1.0);
        let mut to = if let Some(effect) = on.spool_second_order {
            let (spool, rate) = effect.advance(from, axis_states.spool_rate_per_s, target, span_s);
            axis_states.spool_rate_per_s = rate;
            spool
        } else {
            let half_step = step.span.span_s / 2.0;
            let keep = if on.command_dead_time.is_none() && span_s <= half_step {
                step.span.spool_to_middle.drive()
            } else {
                libm::exp(-span_s / self.spool_time_constant_s)
            };
            target + (from - target) * keep
        };
        if let Some(effect) = on.spool_rate_limit {
            let limited = effect.limit(from, to, span_s);
            if limited != to {
                axis_states.spool_rate_per_s =
                    axis_states.spool_rate_per_s.clamp(-effect.rate_per_s, effect.rate_per_s);
            }
            to = limited;
        }
        if to.abs() > 1.0 {
            // The spool meets the end of its way.
            axis_states.spool_rate_per_s = 0.0;
            to = to.clamp(-1.0, 1.0);
        }
        to
    }
}
