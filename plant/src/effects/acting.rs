//! Effects at work: the laws of a step with everything that a rig has switched on.
//!
//! Works axis by axis and chamber by chamber, in the order of the balances in `sums.rs`: command, spool, edges, pressures behind
//! them, port, flow, line, chamber, friction, force. What is delayed or stored is remembered in `memory.rs`. Midpoints of states
//! that effects add are half a step ahead along their last rate, so that the scheme keeps its second order.
//!
//! Laws: the file of each effect. Scheme: the head of `integrator.rs`.

use super::air::HeatState;
use super::flows::PortConditions;
use super::friction::direction_of;
use super::memory::{EffectStates, Memory, axis_conditions_at};
use super::presliding::Bristle;
use super::sums::{ExhaustSide, Force, SupplySide};
use super::tabulated::AxisConditions;
use super::{AxisEffects, ChangedLaws, OpenBalance, act_in_no_step};
use crate::faults::{Faults, Outlet};
use crate::integrator::laws::{Baseline, Laws, StepContext};
use crate::integrator::{HeldInputs, Integrator, Lanes, MidpointAir};
use crate::lanes::{Axes, Choice, Mask, Pair};
use crate::motion::{MotionSpan, PistonState, side};
use crate::parameters::{LinkageParameters, RigParameters};
use crate::state::State;
use crate::truth::TrueForces;

/// What a rig has switched on, and what it remembers.
#[derive(Debug, Clone)]
pub(crate) struct Effects {
    pub(crate) on: [AxisEffects; 2],
    pub(crate) changed_laws: [ChangedLaws; 2],
    pub(crate) memory: Memory,
    /// Factors of the motion: for the two lengths of step and the directions of drive and load, to the middle and to the end.
    pub(super) motion_factors: [[[[MotionSpan; 2]; 2]; 2]; 2],
    pub(super) substep_s: f64,
    pub(super) stroke_m: f64,
    pub(super) temperature_k: f64,
    pub(super) spool_time_constant_s: f64,
    pub(super) file_linkage: LinkageParameters,
    /// What is broken: friction levels times these, and ways out of the chambers a and b.
    pub(super) friction_factors: [f64; 2],
    outlets: [[Outlet; 2]; 2],
    /// Whether friction is the baseline's on both axes; most effects leave it so, and its own laws cost three times as much.
    baseline_friction: bool,
    /// Whether the baseline's laws move the rig: no effect, table, term or fault acts in a step.
    pub(crate) baseline_laws: bool,
}

/// Below this speed an axis on bristles counts as resting: far below what moves it a sensor's step in a second. A guess.
const CREEP_M_PER_S: f64 = 1e-6;

/// Sign of +x of the rig in each axis' own extension.
pub(crate) const ALONG_X: [f64; 2] = [1.0, -1.0];

impl Effects {
    /// The effects of a rig at rest in a state; `None` if the rig has none switched on.
    pub(crate) fn of(rig: &RigParameters, of: &Integrator, state: &State) -> Option<Box<Self>> {
        rig.has_effects().then(|| Self::new(rig, of, state))
    }

    /// The same for any rig; one without any moves by the baseline's laws, through this machinery.
    pub(crate) fn new(rig: &RigParameters, of: &Integrator, state: &State) -> Box<Self> {
        let on = AxisEffects::of(rig);
        let mut effects = Box::new(Effects {
            memory: Memory::at_rest(&on, of, state),
            changed_laws: ChangedLaws::of(&on),
            on,
            motion_factors: [[[[of.spans()[0].motion_to_end; 2]; 2]; 2]; 2],
            substep_s: of.substep_s(),
            stroke_m: rig.cylinder().stroke_m,
            temperature_k: rig.gas().temperature_k,
            spool_time_constant_s: rig.valve().spool_time_constant_s,
            file_linkage: *rig.linkage(),
            friction_factors: [1.0; 2],
            outlets: Default::default(),
            baseline_friction: false,
            baseline_laws: false,
        });
        effects.baseline_friction = effects.has_baseline_friction();
        effects.baseline_laws = effects.has_baseline_laws();
        effects.move_with(of);
        let forces = TrueForces::at(of, Some(&effects), &Lanes::load(state), Pair::both(0.0), state.linked);
        for (axis, channels) in effects.memory.channels.iter_mut().enumerate() {
            channels[1].iter_mut().for_each(|history| history.fill(forces.sensor_n(of, axis)));
        }
        effects.begin_forces(of, &Lanes::load(state), state.linked);
        effects
    }

    /// Forgets all, and stands at rest in a state; allocates nothing where no effect is on.
    pub(crate) fn begin(&mut self, of: &Integrator, state: &State) {
        self.memory = Memory::at_rest(&self.on, of, state);
    }

    /// Sets the faults of the laws; [`Effects::move_with`] follows.
    pub(crate) fn set_faults(&mut self, faults: &Faults) {
        self.changed_laws = ChangedLaws::of(&self.on);
        for (axis, faults) in faults.axes.iter().enumerate() {
            self.friction_factors[axis] = faults.friction_factor;
            self.outlets[axis] = faults.outlets();
            let leaks = self.leaks(axis);
            self.changed_laws[axis].air |= leaks;
            self.changed_laws[axis].stored_air |= leaks;
            if !self.changed_laws[axis].stored_air {
                self.memory.states.axes[axis].air_rate_w = [0.0; 2];
            }
        }
        self.baseline_friction = self.has_baseline_friction();
        self.baseline_laws = self.has_baseline_laws();
    }

    fn has_baseline_laws(&self) -> bool {
        let leaks = (0..2).any(|axis| self.leaks(axis));
        act_in_no_step(&self.on, &self.changed_laws) && self.baseline_friction && !leaks
    }

    fn has_baseline_friction(&self) -> bool {
        self.changed_laws.iter().all(|laws| !laws.friction) && self.friction_factors == [1.0; 2]
    }

    fn leaks(&self, axis: usize) -> bool {
        self.outlets[axis].iter().any(Outlet::is_open)
    }

    /// Takes over the masses of an integrator; to be called when they change.
    pub(crate) fn move_with(&mut self, of: &Integrator) {
        const DIRECTIONS: [f64; 2] = [1.0, -1.0];
        let viscous = |axis: usize, direction| self.viscous(of, axis, direction);
        let motion_factors = of.spans().map(|span| {
            DIRECTIONS.map(|drive| {
                DIRECTIONS.map(|load| {
                    let viscous = [viscous(0, drive), viscous(1, load)];
                    [span.span_s / 2.0, span.span_s].map(|span_s| of.motion.span_with(viscous, span_s))
                })
            })
        });
        self.motion_factors = motion_factors;
    }

    pub(crate) fn begin_period(&mut self, command: [f64; 2]) {
        self.memory
            .commands
            .iter_mut()
            .zip(command)
            .for_each(|(commands, command)| commands.begin_period(command));
    }

    /// Forces on one piston beside air, hand, contact and friction.
    pub(crate) fn force(&self, axis: usize, conditions: &AxisConditions) -> Force {
        let on = &self.on[axis];
        let extension_m = conditions.extension_m;
        let position_m = if axis == 0 { extension_m } else { self.stroke_m - extension_m };
        Force {
            inclination: on.inclination.map_or(0.0, |effect| ALONG_X[axis] * effect.force_n),
            position_dependent_force: on
                .position_dependent_force
                .map_or(0.0, |effect| ALONG_X[axis] * effect.term(position_m)),
            end_cushion: on.end_cushion.map_or(0.0, |effect| effect.stop_force(extension_m, self.stroke_m)),
            tabulated: on.tabulated.force(conditions),
            declared: on.declared.force(&self.declared_in_step(axis, conditions)),
            added: on.added(OpenBalance::Force(conditions)),
        }
    }
}

impl Effects {
    /// The spools at the midpoint; those at the end are kept where effects move them.
    fn spool_to_middle(&self, step: StepContext<'_>, states: &mut EffectStates) -> Pair {
        let mut spools = step.spool_after(step.span.spool_to_middle).to_array();
        let (since_period_s, half_s) = (step.since_period_s(), step.span.span_s / 2.0);
        for (axis, spool) in spools.iter_mut().enumerate().filter(|(axis, _)| self.changed_laws[*axis].spool)
        {
            let axis_states = &mut states.axes[axis];
            if step.held.stuck[axis] {
                (*spool, axis_states.spool_rate_per_s) = (step.from.spool.to_array()[axis], 0.0);
                axis_states.spool = *spool;
                continue;
            }
            *spool =
                self.spool_over(axis, axis_states, step, step.from.spool.to_array()[axis], since_period_s);
            axis_states.spool = self.spool_over(axis, axis_states, step, *spool, since_period_s + half_s);
        }
        Pair::new(spools[0], spools[1])
    }

    /// Pressures and flows at the midpoint of the axes that have effects in them.
    fn pass_air(
        &self,
        step: StepContext<'_>,
        spool: Pair,
        states: &mut EffectStates,
        middle: &mut MidpointAir,
    ) {
        let StepContext { of, span, from, node, .. } = step;
        let half_s = span.span_s / 2.0;
        let ahead_s = step.since_substep_s() + half_s;
        let extension = middle.extension;
        let volume = [of.chambers.volume_a(extension), of.chambers.volume_b(extension)];
        let volume_from = [of.chambers.volume_a(from.extension), of.chambers.volume_b(from.extension)];
        let supply = SupplySide { supply_droop: states.droop_pa + states.droop_pa_per_s * half_s };
        let mut pressure_pa = middle.pressure.map(Pair::to_array);
        let mut flow = middle.edge_flow.map(Pair::to_array);
        let mut drawn = 0.0;
        for axis in (0..2).filter(|axis| self.changed_laws[*axis].air) {
            let lane = |pair: Pair| pair.to_array()[axis];
            let axis_states = &mut states.axes[axis];
            let exhaust = ExhaustSide {
                silencer_back_pressure: axis_states.silencer_pa + axis_states.silencer_pa_per_s * half_s,
            };
            for chamber in 0..2 {
                let air = from.air()[chamber];
                let worked = lane(volume[chamber]) / lane(volume_from[chamber]) - 1.0;
                let stored = lane(span.lag.midpoint_air(air)) + axis_states.air_rate_w[chamber] * half_s
                    - self.work_share(axis) * lane(air.stored) * worked;
                pressure_pa[chamber][axis] = stored / lane(volume[chamber]);
            }
            let ports = self.ports(
                of,
                axis,
                &PortConditions {
                    spool: lane(spool),
                    supply_pa: supply.sum(node.middle_pa),
                    exhaust_pa: exhaust.sum(of.chambers.exhaust_pa()),
                    pressure_pa: [pressure_pa[0][axis], pressure_pa[1][axis]],
                    extension_m: lane(extension),
                    shut: node.shut,
                },
            );
            drawn += ports.drawn_m3_per_s;
            axis_states.port_flow_m3_per_s = ports.flow_m3_per_s;
            for (chamber, flow) in flow.iter_mut().enumerate() {
                let port = ports.flow_m3_per_s[chamber];
                flow[axis] = self.line(axis, chamber, port, ahead_s).sum(port);
            }
            if let Some(effect) = self.on[axis].silencer_back_pressure {
                let outside_pa = of.chambers.exhaust_pa();
                let before_pa = axis_states.silencer_pa;
                let after_pa =
                    effect.advance(outside_pa + before_pa, outside_pa, ports.exhausted_m3_per_s, span.span_s);
                axis_states.silencer_pa = after_pa - outside_pa;
                axis_states.silencer_pa_per_s = (axis_states.silencer_pa - before_pa) / span.span_s;
            }
        }
        if let Some(effect) = self.on[0].supply_droop {
            let before_pa = states.droop_pa;
            let after_pa = effect.advance(node.middle_pa + before_pa, node.middle_pa, drawn, span.span_s);
            states.droop_pa = after_pa - node.middle_pa;
            states.droop_pa_per_s = (states.droop_pa - before_pa) / span.span_s;
        }
        middle.pressure = pressure_pa.map(|lanes| Pair::new(lanes[0], lanes[1]));
        middle.pneumatic = of.chambers.pneumatic_force(middle.pressure[0], middle.pressure[1]);
        middle.edge_flow = flow.map(|lanes| Pair::new(lanes[0], lanes[1]));
    }
}

/// Conditions of an axis in a step; speed and spool are those at its beginning.
fn axis_conditions(step: StepContext<'_>, middle: &MidpointAir, axis: usize) -> AxisConditions {
    let lane = |pair: Pair| pair.to_array()[axis];
    AxisConditions {
        extension_m: lane(middle.extension),
        velocity_m_per_s: lane(step.from.velocity),
        spool: lane(step.from.spool),
        pressure_pa: middle.pressure.map(lane),
    }
}

impl Laws for Effects {
    type ExtraState = EffectStates;

    fn extra_state(&self) -> EffectStates {
        self.memory.states
    }

    fn middle(&self, step: StepContext<'_>, states: &mut EffectStates) -> MidpointAir {
        let spool = self.spool_to_middle(step, states);
        let mut middle = step.middle(spool);
        if self.changed_laws.iter().any(|laws| laws.air) {
            self.pass_air(step, spool, states, &mut middle);
        }
        middle
    }

    fn external_force(&self, step: StepContext<'_>, middle: &MidpointAir) -> Pair {
        let force = |axis: usize| {
            if self.changed_laws[axis].force {
                self.force(axis, &axis_conditions(step, middle, axis)).sum(0.0)
            } else {
                0.0
            }
        };
        step.held.hand + Pair::new(force(0), force(1))
    }

    fn moving(&self, step: StepContext<'_>) -> Mask {
        step.from.velocity.differs(Pair::both(0.0)) | Mask::new(self.on_bristles())
    }

    fn on_bristles(&self) -> [bool; 2] {
        [self.on[0].presliding.is_some(), self.on[1].presliding.is_some()]
    }

    fn sliding(
        &self,
        step: StepContext<'_>,
        middle: &MidpointAir,
        states: &EffectStates,
        push: Pair,
        moving: Mask,
    ) -> Pair {
        if self.baseline_friction {
            return Baseline.sliding(step, middle, &(), push, moving);
        }
        let of = step.of;
        let [drive, load] = [0, 1].map(|axis| {
            let axis_states = &states.axes[axis];
            let velocity = step.from.velocity.to_array()[axis];
            let push = push.to_array()[axis];
            let friction = self.friction(of, axis, middle, axis_states);
            if let Some(effect) = self.on[axis].presliding {
                let bristle = Bristle { velocity_m_per_s: velocity, deflection_m: axis_states.deflection_m };
                return effect.force(bristle, friction.bristle_load(velocity, velocity.abs(), push));
            }
            if velocity == 0.0 {
                return 0.0;
            }
            let speed = friction.middle_speed(velocity, push, step.span.span_s);
            -velocity.signum() * friction.sliding_n(speed, direction_of(velocity))
        });
        Pair::new(drive, load).where_true(moving)
    }

    fn starting(&self, step: StepContext<'_>, middle: &MidpointAir, force: Pair, starts: Mask) -> Pair {
        if self.baseline_friction {
            return Baseline.starting(step, middle, force, starts);
        }
        let of = step.of;
        let [drive, load] = [0, 1].map(|axis| {
            let axis_states = &self.memory.states.axes[axis];
            let force = force.to_array()[axis];
            let friction = self.friction(of, axis, middle, axis_states);
            -force.signum() * friction.sliding_n(0.0, direction_of(force))
        });
        Pair::new(drive, load).where_true(starts)
    }

    fn break_away(&self, step: StepContext<'_>, middle: &MidpointAir, force: Pair) -> Pair {
        if self.baseline_friction {
            return Baseline.break_away(step, middle, force);
        }
        let of = step.of;
        let [drive, load] = [0, 1].map(|axis| {
            if step.from.velocity.to_array()[axis] != 0.0 {
                return f64::INFINITY; // it moves
            }
            let axis_states = &self.memory.states.axes[axis];
            let friction = self.friction(of, axis, middle, axis_states);
            friction.break_away_n(direction_of(force.to_array()[axis]))
        });
        Pair::new(drive, load)
    }

    fn motion_factors<'s>(&'s self, step: StepContext<'s>) -> [&'s MotionSpan; 2] {
        if self.baseline_friction {
            return Baseline.motion_factors(step);
        }
        let [drive, load] = step.from.velocity.to_array().map(side);
        let [to_middle, to_end] =
            &self.motion_factors[usize::from(step.span.span_s < self.substep_s)][drive][load];
        [to_middle, to_end]
    }

    fn holds(&self, step: StepContext<'_>, middle: &MidpointAir, axis: usize, force: f64) -> bool {
        if self.baseline_friction {
            return Baseline.holds(step, middle, axis, force);
        }
        let friction = self.friction(step.of, axis, middle, &self.memory.states.axes[axis]);
        let break_away_n = friction.break_away_n(direction_of(force));
        step.of.motion.holds(step.from.piston(axis).extension, force, break_away_n)
    }

    fn advance(
        &self,
        step: StepContext<'_>,
        middle: &MidpointAir,
        states: &mut EffectStates,
        axis: usize,
        force: f64,
    ) -> PistonState {
        if self.baseline_friction {
            return Baseline.advance(step, middle, &mut (), axis, force);
        }
        let (of, start) = (step.of, step.from.piston(axis));
        let axis_states = &mut states.axes[axis];
        let friction = self.friction(of, axis, middle, axis_states);
        let span_s = step.span.span_s;
        let Some(effect) = self.on[axis].presliding else {
            let speed = friction.middle_speed(start.velocity, force, span_s);
            return of.motion.advance(axis, start, force, &friction.levels(speed), span_s);
        };
        let bristle = Bristle { velocity_m_per_s: start.velocity, deflection_m: axis_states.deflection_m };
        let speed = friction.middle_speed(start.velocity, force, span_s);
        let bristle_load = friction.bristle_load(start.velocity, speed, force);
        let (way_m, bristle) = effect.advance(bristle, bristle_load, span_s);
        axis_states.deflection_m = bristle.deflection_m;
        let extension = start.extension + way_m;
        of.motion.stop_at_ends(PistonState { extension, velocity: bristle.velocity_m_per_s })
    }

    fn air(&self, step: StepContext<'_>, to: &mut Lanes, middle: &MidpointAir, states: &mut EffectStates) {
        if !self.changed_laws.iter().any(|laws| laws.stored_air) {
            return;
        }
        let (of, from) = (step.of, step.from);
        let span_s = step.span.span_s;
        let normal_pa = of.chambers.normal_pa;
        let volumes = |extension| [of.chambers.volume_a(extension), of.chambers.volume_b(extension)];
        let (volume_from, volume_to) = (volumes(from.extension), volumes(to.extension));
        let mut stored = to.air().map(|air| air.stored.to_array());
        for axis in [0, 1] {
            if !self.changed_laws[axis].stored_air {
                continue;
            }
            let lane = |pair: Pair| pair.to_array()[axis];
            let pressure_pa = middle.pressure.map(lane);
            let mut leakage =
                self.leakage(of, axis, &axis_conditions(step, middle, axis)).map(|terms| terms.sum(0.0));
            for (chamber, leakage) in leakage.iter_mut().enumerate().filter(|_| self.leaks(axis)) {
                let lacks_pa = (of.atmospheric_pa - pressure_pa[chamber]).abs();
                let most = lacks_pa / lane(middle.per_volume[chamber]) / (normal_pa * span_s);
                let outlet = &self.outlets[axis][chamber];
                *leakage += outlet.inflow(pressure_pa[chamber], of.atmospheric_pa, most);
            }
            let axis_states = &mut states.axes[axis];
            for chamber in 0..2 {
                // What lag and bounds have let in, as a mean flow over the step.
                let valve = (stored[chamber][axis] - lane(from.air()[chamber].stored)) / (normal_pa * span_s);
                let flow_m3_per_s = valve + leakage[chamber];
                let volume_m3 = 1.0 / lane(middle.per_volume[chamber]);
                let rate = self.air_rate(
                    of,
                    axis,
                    chamber,
                    HeatState {
                        stored_j: pressure_pa[chamber] * volume_m3,
                        volume_m3,
                        normal_volume_m3: axis_states.normal_volume_m3[chamber]
                            + flow_m3_per_s * span_s / 2.0,
                        flow_m3_per_s,
                    },
                    span_s,
                );
                let swept_m3 = lane(volume_to[chamber]) - lane(volume_from[chamber]);
                axis_states.air_rate_w[chamber] = normal_pa * leakage[chamber] + rate.sum(0.0);
                axis_states.normal_volume_m3[chamber] += flow_m3_per_s * span_s;
                stored[chamber][axis] += axis_states.air_rate_w[chamber] * span_s
                    - self.work_share(axis) * pressure_pa[chamber] * swept_m3;
            }
        }
        let [a, b] = stored.map(|lanes| Pair::new(lanes[0], lanes[1]));
        (to.air_a.stored, to.air_b.stored) = (a, b);
    }

    fn spool(&self, step: StepContext<'_>, states: &EffectStates) -> Pair {
        let baseline = step.spool_after(step.span.spool_to_end).to_array();
        let spool = |axis: usize| {
            if self.changed_laws[axis].spool { states.axes[axis].spool } else { baseline[axis] }
        };
        Pair::new(spool(0), spool(1))
    }

    fn keep(&mut self, of: &Integrator, held: HeldInputs, lanes: &Lanes, states: &EffectStates) {
        let span_s = self.substep_s;
        self.memory.states = *states;
        self.memory.substeps += 1;
        self.see_forces(of, lanes, held.hand, held.linked);
        for axis in 0..2 {
            let lane = |pair: Pair| pair.to_array()[axis];
            // Bristles never come to rest to the bit.
            let creep = if self.on_bristles()[axis] { CREEP_M_PER_S } else { 0.0 };
            let axis_states = &mut self.memory.states.axes[axis];
            axis_states.rest_s =
                if lane(lanes.velocity).abs() <= creep { axis_states.rest_s + span_s } else { 0.0 };
            for (line, flow) in self.memory.lines[axis].iter_mut().zip(axis_states.port_flow_m3_per_s) {
                line.iter_mut().for_each(|line| line.push(flow));
            }
            if self.changed_laws[axis].past_readings {
                self.keep_readings(of, axis, lanes);
            }
            if self.on[axis].declared.remembers() {
                let values = self.declared_in_step(axis, &axis_conditions_at(of, lanes, axis)).values();
                self.on[axis].declared.renew(&values, span_s, &mut self.memory.declared[axis]);
            }
        }
        if self.memory.channels.iter().any(|axis| axis[1].is_some()) {
            let forces = TrueForces::at(of, Some(self), lanes, held.hand, held.linked);
            for (axis, channels) in self.memory.channels.iter_mut().enumerate() {
                channels[1].iter_mut().for_each(|history| history.push(forces.sensor_n(of, axis)));
            }
        }
    }
}
