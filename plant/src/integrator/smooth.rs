//! The substep without a corner, over one rig at a time or over many: see [`Axes`].
//!
//! All that it does to an axis is arithmetic and choosing, so that a loop over rigs can be made wide ([`crate::Batch`]).

use super::laws::{Laws, StepContext};
use super::{Forces, HeldInputs, Integrator, Lanes, Node, Span};
use crate::chamber::Air;
use crate::lanes::{Axes, Choice};
use crate::linkage::ContactKinematics;
use crate::motion::{MotionSpan, PistonState};

/// A resting axis linked to a moving one is looked at closely from this far below its break-away force on, N: more than
/// the contact force changes within half a substep while the other axis creeps.
const BREAK_AWAY_MARGIN_N: f64 = 0.5;

impl<P: Axes> Integrator<P> {
    /// d of the linkage, m, from both extensions.
    #[inline(always)]
    pub(crate) fn distance(&self, extension: P) -> f64 {
        self.motion.stroke_m - extension.sum()
    }

    #[inline(always)]
    pub(super) fn node(&self, span: &Span<P>, supply_pa: f64, stopped: bool) -> Node {
        let middle_pa = self.supply.after(supply_pa, stopped, span.supply_to_middle);
        let end_pa = self.supply.after(supply_pa, stopped, span.supply_to_end);
        Node { middle_pa, end_pa, shut: self.supply.check_valves_shut(middle_pa) }
    }

    /// A whole substep from these lanes and this supply pressure; the flag says that there may be a corner in it, and then it
    /// counts for nothing and is to be made [`Integrator::in_parts`].
    #[inline(always)]
    pub(crate) fn substep<L: Laws<P>>(
        &self,
        laws: &L,
        (from, supply_pa): (&Lanes<P>, f64),
        held: HeldInputs<P>,
        substep: u32,
        extra_state: &mut L::ExtraState,
    ) -> ((Lanes<P>, f64), bool) {
        let span = &self.coarse;
        let node = self.node(span, supply_pa, held.stopped);
        let step = StepContext { of: self, span, from, node, held, substep, part: 0 };
        let (next, corner) = self.smooth(laws, step, extra_state);
        let valves_move =
            self.supply.check_valves_shut(supply_pa) != self.supply.check_valves_shut(node.end_pa);
        ((next, node.end_pa), corner | valves_move)
    }

    /// A step that assumes no corner; the flag says that there may be one, and then the step counts for nothing.
    #[inline(always)]
    fn smooth<L: Laws<P>>(
        &self,
        laws: &L,
        step: StepContext<'_, P>,
        extra_state: &mut L::ExtraState,
    ) -> (Lanes<P>, bool) {
        let (span, node, held) = (step.span, step.node, step.held);
        let from = step.from.with_check_valves(node.shut);
        let step = StepContext { from: &from, ..step };
        let zero = P::both(0.0);
        let middle = laws.middle(step, extra_state);

        let moving = laws.moving(step);
        let external = laws.external_force(step, &middle);
        let mut forces = Forces {
            pneumatic: middle.pneumatic,
            external,
            sliding_friction: laws.sliding(step, &middle, extra_state, middle.pneumatic + external, moving),
            contact: zero,
        };
        let [to_middle, to_end] = laws.motion_factors(step);
        if held.linked {
            let kinematics = self.kinematics(span, to_middle, &from, moving, &forces);
            forces.contact = P::both(self.linkage.midpoint_force(kinematics));
        }
        let force = forces.sum();
        let mut velocity = (to_end.keep * from.velocity + to_end.gain * force).where_true(moving);
        let mut extension =
            from.extension + (to_end.drift * from.velocity + to_end.push * force).where_true(moving);
        let mut sticks = None;
        if laws.on_bristles() != [false; 2] {
            let unresisted = forces.pneumatic + forces.external + forces.contact;
            let piston = |axis: usize, extra_state: &mut L::ExtraState| {
                if !laws.on_bristles()[axis] {
                    return PistonState {
                        extension: extension.to_array()[axis],
                        velocity: velocity.to_array()[axis],
                    };
                }
                laws.advance(step, &middle, extra_state, axis, unresisted.to_array()[axis])
            };
            let (drive, load) = (piston(0, extra_state), piston(1, extra_state));
            extension = P::new(drive.extension, load.extension);
            velocity = P::new(drive.velocity, load.velocity);
            sticks = Some(P::Mask::new(laws.on_bristles().map(|on| !on)));
        }

        let growth =
            self.chambers.force_growth(&span.lag, middle.per_volume, [from.air_a.flow, from.air_b.flow]);
        let margin_n = if held.linked && moving.any() { BREAK_AWAY_MARGIN_N } else { 0.0 };
        let margin = growth.abs() + P::both(margin_n);
        let break_away = laws.break_away(step, &middle, force);
        let leaves = !moving & self.motion.might_leave(from.extension, force, margin, break_away);
        let turns = moving & (velocity * from.velocity).at_most(zero);
        let turns = sticks.map_or(turns, |sticks| turns & sticks);
        let overruns = extension.less(zero) | P::both(self.motion.stroke_m).less(extension);
        let touches =
            held.linked && self.linkage.made_contact(self.distance(from.extension), self.distance(extension));
        let limits = self.chambers.limits(node.end_pa);
        let stop =
            |air: Air<P>, edge_flow: P, volume: P| limits.stop(air, span.lag.advance(air, edge_flow), volume);
        let (air_a, fills_a) = stop(from.air_a, middle.edge_flow[0], self.chambers.volume_a(extension));
        let (air_b, fills_b) = stop(from.air_b, middle.edge_flow[1], self.chambers.volume_b(extension));
        let mut next = Lanes { extension, velocity, spool: laws.spool(step, extra_state), air_a, air_b };
        laws.air(step, &mut next, &middle, extra_state);
        (next, (leaves | turns | overruns | fills_a | fills_b).any() | touches)
    }

    /// The extensions at a step's midpoint, kept within the stroke: a step that overruns the end is discarded, but must not
    /// meet a negative volume.
    #[inline(always)]
    pub(crate) fn ahead(&self, span: &Span<P>, from: &Lanes<P>) -> P {
        let ahead = from.extension + from.velocity * P::both(span.span_s / 2.0);
        ahead.max(P::both(0.0)).min(P::both(self.motion.stroke_m))
    }

    #[inline(always)]
    pub(super) fn kinematics(
        &self,
        span: &Span<P>,
        to_middle: &MotionSpan<P>,
        from: &Lanes<P>,
        moving: P::Mask,
        forces: &Forces<P>,
    ) -> ContactKinematics {
        let free = (to_middle.keep * from.velocity + to_middle.gain * forces.sum()).where_true(moving);
        ContactKinematics {
            distance_m: self.distance(from.extension),
            free_speed_m_per_s: -free.sum(),
            mobility: to_middle.gain.where_true(moving).sum(),
            half_span_s: span.span_s / 2.0,
        }
    }
}
