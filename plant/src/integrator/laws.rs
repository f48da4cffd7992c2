//! What a step moves by: the laws of the baseline, or the same with effects beside them.
//!
//! The integrator is written once, over [`Laws`]. With [`Baseline`] the compiler finds every question answered by a constant or
//! by the baseline's own formula, so a rig without effects pays nothing for their being possible; a hash of bits and a count
//! of instructions hold that down. `effects/acting.rs` is the other answer.

use super::{HeldInputs, Integrator, Lanes, MidpointAir, Node, Span};
use crate::chamber::Air;
use crate::lanes::{Axes, Pair};
use crate::motion::{MotionSpan, PistonState, against};
use crate::valve::edge_flow;

/// All that a step depends on: integrator, length, start state, supply and held inputs.
#[derive(Clone, Copy)]
pub(crate) struct StepContext<'s, P = Pair> {
    pub(crate) of: &'s Integrator<P>,
    pub(crate) span: &'s Span<P>,
    pub(crate) from: &'s Lanes<P>,
    pub(crate) node: Node,
    pub(crate) held: HeldInputs<P>,
    /// Index of the substep in the period, and of the part in the substep; 0 for a substep that is made in one.
    pub(crate) substep: u32,
    pub(crate) part: u32,
}

impl StepContext<'_> {
    /// Time from the substep's beginning to the step's, s.
    pub(crate) fn since_substep_s(&self) -> f64 {
        let [_, fine] = self.of.spans();
        f64::from(self.part) * fine.span_s
    }

    /// Time from the period's beginning to the step's, s.
    pub(crate) fn since_period_s(&self) -> f64 {
        f64::from(self.substep) * self.of.substep_s() + self.since_substep_s()
    }
}

impl<P: Axes> StepContext<'_, P> {
    /// The spools when this share of what they lack is left.
    #[inline(always)]
    pub(crate) fn spool_after(&self, share: P) -> P {
        self.held.command + (self.from.spool - self.held.command) * share
    }

    /// The baseline's air and flows at the midpoint, with the spools there.
    #[inline(always)]
    pub(crate) fn middle(&self, spool: P) -> MidpointAir<P> {
        let StepContext { of, span, from, node, .. } = *self;
        let mut edges = of.valve.edges(spool, node.middle_pa, of.chambers.exhaust_pa());
        if node.shut {
            (edges.conductance_a, edges.conductance_b) = (P::both(0.0), P::both(0.0));
        }
        let extension = of.ahead(span, from);
        let per_volume_a = of.chambers.volume_a(extension).reciprocal();
        let per_volume_b = of.chambers.volume_b(extension).reciprocal();
        let pressure_a = span.lag.midpoint_air(from.air_a) * per_volume_a;
        let pressure_b = span.lag.midpoint_air(from.air_b) * per_volume_b;
        MidpointAir {
            extension,
            pneumatic: of.chambers.pneumatic_force(pressure_a, pressure_b),
            edge_flow: [
                edge_flow(edges.conductance_a, edges.far_pressure_a, pressure_a),
                edge_flow(edges.conductance_b, edges.far_pressure_b, pressure_b),
            ],
            pressure: [pressure_a, pressure_b],
            per_volume: [per_volume_a, per_volume_b],
        }
    }
}

/// The laws of a rig; pairs hold a value for each axis, forces are along its own extension.
pub(crate) trait Laws<P: Axes = Pair> {
    /// State that effects add to the lanes; a step that is discarded leaves none.
    type ExtraState: Copy;

    /// That state at the end of the last step.
    fn extra_state(&self) -> Self::ExtraState;

    /// Air and flows at the midpoint of a step.
    fn middle(&self, step: StepContext<'_, P>, extra_state: &mut Self::ExtraState) -> MidpointAir<P>;

    /// External force on each piston, N: the hand's and that of effects.
    fn external_force(&self, step: StepContext<'_, P>, middle: &MidpointAir<P>) -> P;

    /// Which axes move, for the laws of friction.
    fn moving(&self, step: StepContext<'_, P>) -> P::Mask;

    /// Which axes rest and slide on bristles: they neither stick nor break away.
    fn on_bristles(&self) -> [bool; 2];

    /// Friction on moving axes but for the viscous one, N, signed; `push` is the force without it.
    fn sliding(
        &self,
        step: StepContext<'_, P>,
        middle: &MidpointAir<P>,
        extra_state: &Self::ExtraState,
        push: P,
        moving: P::Mask,
    ) -> P;

    /// Friction on axes that this force sets in motion, N, signed.
    fn starting(&self, step: StepContext<'_, P>, middle: &MidpointAir<P>, force: P, starts: P::Mask) -> P;

    /// Break-away force in the direction of a force, N.
    fn break_away(&self, step: StepContext<'_, P>, middle: &MidpointAir<P>, force: P) -> P;

    /// Factors of the motion to the middle and to the end of a step.
    fn motion_factors<'s>(&'s self, step: StepContext<'s, P>) -> [&'s MotionSpan<P>; 2];

    /// Whether a resting axis stays under this force, N without any friction.
    fn holds(&self, step: StepContext<'_, P>, middle: &MidpointAir<P>, axis: usize, force: f64) -> bool;

    /// Moves one axis through a step under a held force, N without any friction.
    fn advance(
        &self,
        step: StepContext<'_, P>,
        middle: &MidpointAir<P>,
        extra_state: &mut Self::ExtraState,
        axis: usize,
        force: f64,
    ) -> PistonState;

    /// The air of both chambers after a step, given what lag and bounds left of it.
    fn air(
        &self,
        step: StepContext<'_, P>,
        to: &mut Lanes<P>,
        middle: &MidpointAir<P>,
        extra_state: &mut Self::ExtraState,
    );

    /// The spools at the step's end.
    fn spool(&self, step: StepContext<'_, P>, extra_state: &Self::ExtraState) -> P;

    /// Accepts a substep: its added state is kept.
    fn keep(
        &mut self,
        of: &Integrator<P>,
        held: HeldInputs<P>,
        to: &Lanes<P>,
        extra_state: &Self::ExtraState,
    );
}

/// The laws of rig-model.md.
pub(crate) struct Baseline;

impl<P: Axes> Laws<P> for Baseline {
    type ExtraState = ();

    #[inline(always)]
    fn extra_state(&self) {}

    #[inline(always)]
    fn middle(&self, step: StepContext<'_, P>, (): &mut ()) -> MidpointAir<P> {
        step.middle(step.spool_after(step.span.spool_to_middle))
    }

    #[inline(always)]
    fn external_force(&self, step: StepContext<'_, P>, _: &MidpointAir<P>) -> P {
        step.held.hand
    }

    #[inline(always)]
    fn moving(&self, step: StepContext<'_, P>) -> P::Mask {
        step.from.velocity.differs(P::both(0.0))
    }

    #[inline(always)]
    fn on_bristles(&self) -> [bool; 2] {
        [false; 2]
    }

    #[inline(always)]
    fn sliding(&self, step: StepContext<'_, P>, _: &MidpointAir<P>, (): &(), _: P, moving: P::Mask) -> P {
        against(step.from.velocity, P::both(step.of.motion.levels.sliding_n[0]), moving)
    }

    #[inline(always)]
    fn starting(&self, step: StepContext<'_, P>, _: &MidpointAir<P>, force: P, starts: P::Mask) -> P {
        against(force, P::both(step.of.motion.levels.sliding_n[0]), starts)
    }

    #[inline(always)]
    fn break_away(&self, step: StepContext<'_, P>, _: &MidpointAir<P>, _: P) -> P {
        P::both(step.of.motion.levels.break_away_n[0])
    }

    #[inline(always)]
    fn motion_factors<'s>(&'s self, step: StepContext<'s, P>) -> [&'s MotionSpan<P>; 2] {
        [&step.span.motion_to_middle, &step.span.motion_to_end]
    }

    #[inline(always)]
    fn holds(&self, step: StepContext<'_, P>, _: &MidpointAir<P>, axis: usize, force: f64) -> bool {
        step.of.motion.holds(step.from.piston(axis).extension, force, step.of.motion.levels.break_away_n[0])
    }

    #[inline(always)]
    fn advance(
        &self,
        step: StepContext<'_, P>,
        _: &MidpointAir<P>,
        (): &mut (),
        axis: usize,
        force: f64,
    ) -> PistonState {
        let motion = &step.of.motion;
        motion.advance(axis, step.from.piston(axis), force, &motion.levels, step.span.span_s)
    }

    #[inline(always)]
    fn air(&self, _: StepContext<'_, P>, _: &mut Lanes<P>, _: &MidpointAir<P>, (): &mut ()) {}

    #[inline(always)]
    fn spool(&self, step: StepContext<'_, P>, (): &()) -> P {
        step.spool_after(step.span.spool_to_end)
    }

    #[inline(always)]
    fn keep(&mut self, _: &Integrator<P>, _: HeldInputs<P>, _: &Lanes<P>, (): &()) {}
}

/// Air of both chambers in one place, for laws that treat them alike.
impl<P: Copy> Lanes<P> {
    #[inline(always)]
    pub(crate) fn air(&self) -> [Air<P>; 2] {
        [self.air_a, self.air_b]
    }
}
