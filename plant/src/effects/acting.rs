//! Effects at work: the laws of a step with everything that a rig has switched on.
//!
//! Works axis by axis and chamber by chamber, in the order of the balances in `sums.rs`: command, spool, edges, pressures behind
//! them, port, flow, line, chamber, friction, force. What is delayed or stored is remembered in `memory.rs`. Midpoints of states
//! that effects add are half a step ahead along their last rate, so that the scheme keeps its second order.
//!
//! Laws: the file of each effect. Scheme: the head of `integrator.rs`.

use super::AxisEffects;
use super::flows::{Ports, PortsAt};
use super::friction::Rubbing;
use super::heat_exchange::{ChamberHeat, wetted_m2};
use super::memory::{AxisMoving, Commands, History, Moving};
use super::presliding::{Bristle, Under};
use super::sums::{
    AirRate, Arriving, Bristles, Damping, DeadSpace, ExhaustSide, Force, ForceReading, Gap, Leakage,
    LimitedRate, LineFlow, PositionReading, PressureReading, SpoolRate, Stiffness, SupplySide, Target,
};
use crate::integrator::laws::{At, Laws};
use crate::integrator::{Integrator, Lanes, Middle, PERIOD_S};
use crate::lanes::{Mask, Pair};
use crate::motion::{MotionSpan, Place, side};
use crate::parameters::{LinkageParameters, RigParameters};
use crate::state::State;
use crate::truth::{AirAt, Forces};

/// What a rig has switched on, and what it remembers.
#[derive(Debug, Clone)]
pub(crate) struct Effects {
    pub(crate) on: [AxisEffects; 2],
    pub(crate) memory: Memory,
    /// Factors of the motion: for the two lengths of step and both directions, to the middle and to the end.
    ways: [[[MotionSpan; 2]; 2]; 2],
    substep_s: f64,
    stroke_m: f64,
    temperature_k: f64,
    spool_time_constant_s: f64,
    file_linkage: LinkageParameters,
}

/// All that effects remember.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    pub(crate) moving: Moving,
    pub(crate) commands: [Commands; 2],
    /// What left the valve for each chamber, at the midpoints of substeps.
    lines: [[Option<History>; 2]; 2],
    /// What the channels position, force, a, b would have shown, at the ends of substeps.
    channels: [[Option<History>; 4]; 2],
}

/// Sign of +x of the rig in each axis' own extension.
pub(crate) const ALONG_X: [f64; 2] = [1.0, -1.0];

/// Dead volume of each axis' chambers, m^3: the file's, or what an effect puts in its place.
pub(crate) fn dead_volumes_m3(rig: &RigParameters) -> [f64; 2] {
    let file = rig.cylinder().dead_volume_m3;
    AxisEffects::of(rig).map(|axis| {
        DeadSpace { dead_volume: axis.dead_volume.map_or(0.0, |effect| effect.term(file)) }.sum(file)
    })
}

/// Numbers of the linkage: the file's, or what effects put in their place.
pub(crate) fn linkage(rig: &RigParameters) -> LinkageParameters {
    let file = *rig.linkage();
    let (gap, stiffness, damping) = linkage_terms(&AxisEffects::of(rig)[0], &file);
    LinkageParameters {
        gap_m: gap.sum(file.gap_m),
        stiffness_n_per_m: stiffness.sum(file.stiffness_n_per_m),
        damping_n_s_per_m: damping.sum(file.damping_n_s_per_m),
    }
}

fn linkage_terms(on: &AxisEffects, file: &LinkageParameters) -> (Gap, Stiffness, Damping) {
    let compliance = on.coupling_compliance;
    (
        Gap { coupling_backlash: on.coupling_backlash.map_or(0.0, |effect| effect.term(file.gap_m)) },
        Stiffness {
            coupling_compliance: compliance
                .map_or(0.0, |effect| effect.stiffness_term(file.stiffness_n_per_m)),
        },
        Damping {
            coupling_compliance: compliance.map_or(0.0, |effect| effect.damping_term(file.damping_n_s_per_m)),
        },
    )
}

impl Effects {
    /// The effects of a rig at rest in a state; `None` if the rig has none switched on.
    pub(crate) fn of(rig: &RigParameters, of: &Integrator, state: &State) -> Option<Box<Self>> {
        if rig.effects().is_empty() {
            return None;
        }
        let on = AxisEffects::of(rig);
        let mut effects = Box::new(Effects {
            memory: Memory::at_rest(&on, of, state),
            on,
            ways: [[[of.spans()[0].motion_to_end; 2]; 2]; 2],
            substep_s: of.substep_s(),
            stroke_m: rig.cylinder().stroke_m,
            temperature_k: rig.gas().temperature_k,
            spool_time_constant_s: rig.valve().spool_time_constant_s,
            file_linkage: *rig.linkage(),
        });
        effects.move_with(of);
        Some(effects)
    }

    /// Terms of the linkage's numbers.
    pub(crate) fn linkage_terms(&self) -> (Gap, Stiffness, Damping) {
        linkage_terms(&self.on[0], &self.file_linkage)
    }

    /// Takes over the masses of an integrator; to be called when they change.
    pub(crate) fn move_with(&mut self, of: &Integrator) {
        let viscous = |axis: usize, direction| self.viscous(of, axis, direction);
        let ways = of.spans().map(|span| {
            [1.0, -1.0].map(|direction| {
                let viscous = [viscous(0, direction), viscous(1, direction)];
                [span.span_s / 2.0, span.span_s].map(|span_s| of.motion.span_with(viscous, span_s))
            })
        });
        self.ways = ways;
    }

    /// Remembers the commands of a period that begins.
    pub(crate) fn begin_period(&mut self, command: [f64; 2]) {
        self.memory
            .commands
            .iter_mut()
            .zip(command)
            .for_each(|(commands, command)| commands.begin_period(command));
    }

    /// What skew adds to a channel (position, force, a, b) that would show this now.
    fn skew(&self, axis: usize, channel: usize, now: f64) -> f64 {
        let history = self.on[axis].time_skew[channel].zip(self.memory.channels[axis][channel].as_ref());
        history.map_or(0.0, |(effect, history)| {
            effect.term(history.before(effect.delay_s / self.substep_s), now)
        })
    }

    /// Terms of the position reading of an axis, by its true position, m.
    pub(crate) fn position_reading(&self, axis: usize, truth: f64) -> PositionReading {
        let on = &self.on[axis];
        PositionReading {
            time_skew: self.skew(axis, 0, truth),
            position_sensor_lag: on
                .position_sensor_lag
                .map_or(0.0, |_| self.memory.moving.axes[axis].shown[0] - truth),
            position_sensor_gain: on.position_sensor_gain.map_or(0.0, |effect| effect.term(truth)),
            position_sensor_offset: on.position_sensor_offset.map_or(0.0, |effect| effect.term()),
        }
    }

    /// Terms of the force reading of an axis, by what its sensor should show, N.
    pub(crate) fn force_reading(&self, axis: usize, truth: f64) -> ForceReading {
        let on = &self.on[axis];
        ForceReading {
            time_skew: self.skew(axis, 1, truth),
            force_sensor_gain: on.force_sensor_gain.map_or(0.0, |effect| effect.term(truth)),
            force_sensor_offset: on.force_sensor_offset.map_or(0.0, |effect| effect.term()),
        }
    }

    /// Terms of the pressure reading of a chamber, by its true pressure, Pa.
    pub(crate) fn pressure_reading(&self, axis: usize, chamber: usize, truth: f64) -> PressureReading {
        let on = &self.on[axis];
        PressureReading {
            time_skew: self.skew(axis, 2 + chamber, truth),
            pressure_sensor_lag: on.pressure_sensor_lag[chamber]
                .map_or(0.0, |_| self.memory.moving.axes[axis].shown[1 + chamber] - truth),
            pressure_sensor_gain: on.pressure_sensor_gain[chamber].map_or(0.0, |effect| effect.term(truth)),
            pressure_sensor_offset: on.pressure_sensor_offset[chamber].map_or(0.0, |effect| effect.term()),
        }
    }

    /// Terms of the command that arrives at the valve at a time of the period.
    pub(crate) fn arriving(&self, axis: usize, now: f64, local_s: f64) -> Arriving {
        let on = &self.on[axis];
        Arriving {
            command_dead_time: on.command_dead_time.map_or(0.0, |effect| {
                effect.term(self.memory.commands[axis].before(effect.delay_s - local_s), now)
            }),
            valve_offset: on.valve_offset.map_or(0.0, |effect| effect.term()),
        }
    }

    /// Terms of the spool's target, given what arrives.
    pub(crate) fn target(&self, axis: usize, own: &AxisMoving, arriving: f64) -> Target {
        let hysteresis = self.on[axis].valve_hysteresis;
        Target { valve_hysteresis: hysteresis.map_or(0.0, |effect| effect.term(own.play, arriving)) }
    }

    /// Terms of the spool's rate at an instant, without and with its limit.
    pub(crate) fn spool_rate(
        &self,
        axis: usize,
        own: &AxisMoving,
        spool: f64,
        target: f64,
    ) -> (SpoolRate, LimitedRate) {
        let lag = (target - spool) / self.spool_time_constant_s;
        let on = &self.on[axis];
        let rate = SpoolRate {
            spool_second_order: on.spool_second_order.map_or(0.0, |_| own.spool_rate_per_s - lag),
        };
        let free = rate.sum(lag);
        let limit = on.spool_rate_limit.map_or(0.0, |effect| effect.limit(0.0, free, 1.0) - free);
        (rate, LimitedRate { spool_rate_limit: limit })
    }

    /// The spool after a span that begins `local_s` after the period does.
    fn spool_over(&self, axis: usize, own: &mut AxisMoving, at: At<'_>, spool: f64, local_s: f64) -> f64 {
        let span_s = at.span.span_s / 2.0;
        let edge_s = self.on[axis].command_dead_time.map_or(0.0, |effect| effect.delay_s % PERIOD_S);
        if local_s < edge_s && edge_s < local_s + span_s {
            let at_edge = self.spool_leg(axis, own, at, spool, [local_s, edge_s]);
            return self.spool_leg(axis, own, at, at_edge, [edge_s, local_s + span_s]);
        }
        self.spool_leg(axis, own, at, spool, [local_s, local_s + span_s])
    }

    /// The spool after a leg of time over which its target is held.
    fn spool_leg(&self, axis: usize, own: &mut AxisMoving, at: At<'_>, from: f64, leg_s: [f64; 2]) -> f64 {
        let on = &self.on[axis];
        let span_s = leg_s[1] - leg_s[0];
        let command = at.held.command.to_array()[axis];
        let arriving = self.arriving(axis, command, (leg_s[0] + leg_s[1]) / 2.0).sum(command);
        let sent = self.target(axis, own, arriving).sum(arriving);
        own.play = sent;
        let target = sent.clamp(-1.0, 1.0);
        let mut to = if let Some(effect) = on.spool_second_order {
            let (spool, rate) = effect.advance(from, own.spool_rate_per_s, target, span_s);
            own.spool_rate_per_s = rate;
            spool
        } else {
            let half_step = at.span.span_s / 2.0;
            let keep = if on.command_dead_time.is_none() && span_s <= half_step {
                at.span.spool_to_middle.drive()
            } else {
                libm::exp(-span_s / self.spool_time_constant_s)
            };
            target + (from - target) * keep
        };
        if let Some(effect) = on.spool_rate_limit {
            let limited = effect.limit(from, to, span_s);
            if limited != to {
                own.spool_rate_per_s = own.spool_rate_per_s.clamp(-effect.rate_per_s, effect.rate_per_s);
            }
            to = limited;
        }
        if to.abs() > 1.0 {
            // The spool meets the end of its way.
            own.spool_rate_per_s = 0.0;
            to = to.clamp(-1.0, 1.0);
        }
        to
    }

    /// Pressure that effects add behind the supply edges.
    pub(crate) fn supply_side(&self, moving: &Moving) -> SupplySide {
        SupplySide { supply_droop: moving.droop_pa }
    }

    /// Ports of an axis at an instant.
    pub(crate) fn ports_at(&self, of: &Integrator, axis: usize, state: &State, air: &AirAt) -> Ports {
        let moving = &self.memory.moving;
        let exhaust = ExhaustSide { silencer_back_pressure: moving.axes[axis].silencer_pa };
        self.ports(
            of,
            axis,
            &PortsAt {
                spool: state.axes[axis].spool,
                supply_pa: self.supply_side(moving).sum(state.supply_pressure_pa),
                exhaust_pa: exhaust.sum(of.chambers.exhaust_pa()),
                pressure_pa: air.of_axis_pa(axis),
                extension_m: state.axes[axis].extension_m,
                shut: of.supply.check_valves_shut(state.supply_pressure_pa),
            },
        )
    }

    /// What friction depends on at an instant.
    pub(crate) fn rubbing_at(&self, of: &Integrator, axis: usize, place: Place, air: &AirAt) -> Rubbing {
        Rubbing {
            extension_m: place.extension,
            gauge_pa: air.of_axis_pa(axis).map(|pa| pa - of.atmospheric_pa()),
            rest_s: self.memory.moving.axes[axis].rest_s,
        }
    }

    /// Friction of the bristles at an instant, along the own extension; `None` for an axis without them.
    pub(crate) fn bristles(
        &self,
        of: &Integrator,
        axis: usize,
        rubbing: &Rubbing,
        place: Place,
        force_n: f64,
    ) -> Option<Bristles> {
        let effect = self.on[axis].presliding?;
        let deflection_m = self.memory.moving.axes[axis].deflection_m;
        let bristle = Bristle { velocity_m_per_s: place.velocity, deflection_m };
        let under = self.under(of, axis, rubbing, place.velocity, force_n);
        Some(Bristles { presliding: effect.force(bristle, under) })
    }

    /// Forces on one piston beside air, hand, contact and friction, by its extension.
    pub(crate) fn force(&self, axis: usize, extension_m: f64) -> Force {
        let on = &self.on[axis];
        let position_m = if axis == 0 { extension_m } else { self.stroke_m - extension_m };
        Force {
            inclination: on.inclination.map_or(0.0, |effect| ALONG_X[axis] * effect.term()),
            position_dependent_force: on
                .position_dependent_force
                .map_or(0.0, |effect| ALONG_X[axis] * effect.term(position_m)),
            end_cushion: on.end_cushion.map_or(0.0, |effect| effect.stop_force(extension_m, self.stroke_m)),
        }
    }

    /// Flows into the chambers of an axis beside the valve's, by their pressures.
    pub(crate) fn leakage(&self, of: &Integrator, axis: usize, pressure_pa: [f64; 2]) -> [Leakage; 2] {
        let on = &self.on[axis];
        let across = on.piston_leakage.map_or(0.0, |effect| effect.flow(pressure_pa[0], pressure_pa[1]));
        let out = |chamber: usize| {
            on.rod_leakage[chamber]
                .map_or(0.0, |effect| -effect.flow(pressure_pa[chamber], of.atmospheric_pa()))
        };
        [
            Leakage { piston_leakage: -across, rod_leakage: out(0) },
            Leakage { piston_leakage: across, rod_leakage: out(1) },
        ]
    }

    /// What heat adds to the rate of a chamber's stored air, but for the piston's work, by its stored air, normal volume and flow.
    pub(crate) fn air_rate(&self, of: &Integrator, axis: usize, chamber: usize, heat: HeatAt) -> AirRate {
        let heat_exchange = self.on[axis].heat_exchange.map_or(0.0, |effect| {
            effect.thermal_rate_w(ChamberHeat {
                flow_m3_per_s: heat.flow_m3_per_s,
                temperature_k: self.temperature_k * heat.stored_j
                    / (of.chambers.normal_pa() * heat.normal_volume_m3),
                wetted_m2: wetted_m2(of.chambers.areas_m2()[chamber], heat.volume_m3),
            })
        });
        AirRate { heat_exchange }
    }

    /// Share of the piston's work p dV that the stored air loses; 0 in the isothermal baseline.
    pub(crate) fn work_share(&self, axis: usize) -> f64 {
        self.on[axis].heat_exchange.map_or(0.0, |effect| effect.work_share())
    }

    fn adds_air(&self, axis: usize) -> bool {
        let on = &self.on[axis];
        on.heat_exchange.is_some()
            || on.piston_leakage.is_some()
            || on.rod_leakage.iter().any(Option::is_some)
    }

    /// Where a bristled axis stands: all that its friction depends on.
    pub(crate) fn under(
        &self,
        of: &Integrator,
        axis: usize,
        rubbing: &Rubbing,
        velocity: f64,
        force_n: f64,
    ) -> Under {
        let levels = self.levels(of, axis, rubbing, velocity.abs());
        let direction = side(if velocity == 0.0 { force_n } else { velocity });
        Under {
            force_n,
            mass_kg: of.motion.mass_kg(axis),
            viscous_n_s_per_m: levels.viscous_n_s_per_m[direction],
            sliding_n: levels.sliding_n[direction],
            break_away_n: levels.break_away_n[direction],
        }
    }

    fn rubbing(&self, of: &Integrator, axis: usize, middle: &Middle, own: &AxisMoving) -> Rubbing {
        let pressure_pa = middle.pressure.map(|pair| pair.to_array()[axis]);
        Rubbing {
            extension_m: middle.extension.to_array()[axis],
            gauge_pa: pressure_pa.map(|pa| pa - of.atmospheric_pa()),
            rest_s: own.rest_s,
        }
    }

    /// The speed of a moving axis in the middle of a step, m/s, by its force at the beginning; 0 if it would turn.
    fn middle_speed(
        &self,
        of: &Integrator,
        axis: usize,
        rubbing: &Rubbing,
        velocity: f64,
        push: f64,
        span_s: f64,
    ) -> f64 {
        if self.on[axis].stribeck_friction.is_none() {
            return velocity.abs();
        }
        let levels = self.levels(of, axis, rubbing, velocity.abs());
        let direction = if velocity == 0.0 { push.signum() } else { velocity.signum() };
        let friction =
            levels.sliding_n[side(direction)] + levels.viscous_n_s_per_m[side(direction)] * velocity.abs();
        let acceleration = (push * direction - friction) / of.motion.mass_kg(axis);
        (velocity.abs() + acceleration * span_s / 2.0).max(0.0)
    }
}

/// What heat and temperature of a chamber depend on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HeatAt {
    pub(crate) stored_j: f64,
    pub(crate) volume_m3: f64,
    pub(crate) normal_volume_m3: f64,
    pub(crate) flow_m3_per_s: f64,
}

impl Memory {
    fn at_rest(on: &[AxisEffects; 2], of: &Integrator, state: &State) -> Self {
        let lanes = Lanes::load(state);
        let volume_m3 = [of.chambers.volume_a(lanes.extension), of.chambers.volume_b(lanes.extension)];
        let stored_j = lanes.air().map(|air| air.stored);
        let axis = |i: usize| {
            let lane = |pair: Pair| pair.to_array()[i];
            let pressure_pa = [0, 1].map(|chamber| lane(stored_j[chamber]) / lane(volume_m3[chamber]));
            let position_m =
                if i == 0 { lane(lanes.extension) } else { of.motion.stroke_m() - lane(lanes.extension) };
            let truths = [position_m, pressure_pa[0], pressure_pa[1]];
            AxisMoving {
                spool: lane(lanes.spool),
                play: lane(lanes.spool),
                spool_rate_per_s: 0.0,
                silencer_pa: 0.0,
                silencer_pa_per_s: 0.0,
                normal_volume_m3: stored_j.map(|stored| lane(stored) / of.chambers.normal_pa()),
                air_rate_w: [0.0; 2],
                port_flow_m3_per_s: lanes.air().map(|air| lane(air.flow)),
                deflection_m: 0.0,
                rest_s: 0.0,
                shown: truths,
                seen: truths,
            }
        };
        let axes = [axis(0), axis(1)];
        let steps = |delay_s: f64| delay_s / of.substep_s();
        let lines = [0, 1].map(|i| {
            let axis: &AxisMoving = &axes[i];
            axis.port_flow_m3_per_s
                .map(|flow| on[i].line_delay.map(|effect| History::new(flow, steps(effect.delay_s()) + 2.0)))
        });
        let channels = [0, 1].map(|i| {
            let axis: &AxisMoving = &axes[i];
            let values = [axis.seen[0], 0.0, axis.seen[1], axis.seen[2]];
            [0, 1, 2, 3].map(|channel: usize| {
                on[i].time_skew[channel]
                    .map(|effect| History::new(values[channel], steps(effect.delay_s) + 1.0))
            })
        });
        let commands = [0, 1].map(|i: usize| Commands::new(axes[i].spool));
        Memory { moving: Moving { axes, droop_pa: 0.0, droop_pa_per_s: 0.0 }, commands, lines, channels }
    }
}

impl Laws for Effects {
    type Carried = Moving;

    fn carried(&self) -> Moving {
        self.memory.moving
    }

    fn middle(&self, at: At<'_>, carried: &mut Moving) -> Middle {
        let At { of, span, from, node, .. } = at;
        let half_s = span.span_s / 2.0;
        let extension = of.ahead(span, from);
        let volume = [of.chambers.volume_a(extension), of.chambers.volume_b(extension)];
        let volume_from = [of.chambers.volume_a(from.extension), of.chambers.volume_b(from.extension)];
        let supply = SupplySide { supply_droop: carried.droop_pa + carried.droop_pa_per_s * half_s };
        let (mut pressure_pa, mut flow, mut drawn) = ([[0.0; 2]; 2], [[0.0; 2]; 2], 0.0);
        for axis in 0..2 {
            let lane = |pair: Pair| pair.to_array()[axis];
            let own = &mut carried.axes[axis];
            let spool = self.spool_over(axis, own, at, lane(from.spool), at.local_s);
            own.spool = self.spool_over(axis, own, at, spool, at.local_s + half_s);
            let exhaust =
                ExhaustSide { silencer_back_pressure: own.silencer_pa + own.silencer_pa_per_s * half_s };
            for chamber in 0..2 {
                let air = from.air()[chamber];
                let worked = lane(volume[chamber]) / lane(volume_from[chamber]) - 1.0;
                let stored = lane(span.lag.midpoint_air(air)) + own.air_rate_w[chamber] * half_s
                    - self.work_share(axis) * lane(air.stored) * worked;
                pressure_pa[chamber][axis] = stored / lane(volume[chamber]);
            }
            let ports = self.ports(
                of,
                axis,
                &PortsAt {
                    spool,
                    supply_pa: supply.sum(node.middle_pa),
                    exhaust_pa: exhaust.sum(of.chambers.exhaust_pa()),
                    pressure_pa: [pressure_pa[0][axis], pressure_pa[1][axis]],
                    extension_m: lane(extension),
                    shut: node.shut,
                },
            );
            drawn += ports.drawn_m3_per_s;
            own.port_flow_m3_per_s = ports.flow_m3_per_s;
            for chamber in 0..2 {
                let port = ports.flow_m3_per_s[chamber];
                flow[chamber][axis] =
                    self.line(axis, chamber, port, at.local_s % self.substep_s + half_s).sum(port);
            }
            if let Some(effect) = self.on[axis].silencer_back_pressure {
                let outside_pa = of.chambers.exhaust_pa();
                let before_pa = own.silencer_pa;
                let after_pa =
                    effect.advance(outside_pa + before_pa, outside_pa, ports.exhausted_m3_per_s, span.span_s);
                own.silencer_pa = after_pa - outside_pa;
                own.silencer_pa_per_s = (own.silencer_pa - before_pa) / span.span_s;
            }
        }
        if let Some(effect) = self.on[0].supply_droop {
            let before_pa = carried.droop_pa;
            let after_pa = effect.advance(node.middle_pa + before_pa, node.middle_pa, drawn, span.span_s);
            carried.droop_pa = after_pa - node.middle_pa;
            carried.droop_pa_per_s = (carried.droop_pa - before_pa) / span.span_s;
        }
        let pressure = pressure_pa.map(|lanes| Pair::new(lanes[0], lanes[1]));
        Middle {
            extension,
            pneumatic: of.chambers.pneumatic_force(pressure[0], pressure[1]),
            edge_flow: flow.map(|lanes| Pair::new(lanes[0], lanes[1])),
            pressure,
            per_volume: volume.map(Pair::reciprocal),
        }
    }

    fn outside(&self, at: At<'_>, middle: &Middle) -> Pair {
        let [drive, load] = [0, 1].map(|axis| self.force(axis, middle.extension.to_array()[axis]).sum(0.0));
        at.held.hand + Pair::new(drive, load)
    }

    fn moving(&self, at: At<'_>) -> Mask {
        at.from.velocity.differs(Pair::both(0.0)) | Mask::new(self.on_bristles())
    }

    fn on_bristles(&self) -> [bool; 2] {
        [self.on[0].presliding.is_some(), self.on[1].presliding.is_some()]
    }

    fn sliding(&self, at: At<'_>, middle: &Middle, carried: &Moving, push: Pair, moving: Mask) -> Pair {
        let of = at.of;
        let [drive, load] = [0, 1].map(|axis| {
            let own = &carried.axes[axis];
            let velocity = at.from.velocity.to_array()[axis];
            let push = push.to_array()[axis];
            let rubbing = self.rubbing(of, axis, middle, own);
            if let Some(effect) = self.on[axis].presliding {
                let bristle = Bristle { velocity_m_per_s: velocity, deflection_m: own.deflection_m };
                return effect.force(bristle, self.under(of, axis, &rubbing, velocity, push));
            }
            if velocity == 0.0 {
                return 0.0;
            }
            let speed = self.middle_speed(of, axis, &rubbing, velocity, push, at.span.span_s);
            -velocity.signum() * self.levels(of, axis, &rubbing, speed).sliding_n[side(velocity)]
        });
        Pair::new(drive, load).where_true(moving)
    }

    fn starting(&self, at: At<'_>, middle: &Middle, force: Pair, starts: Mask) -> Pair {
        let of = at.of;
        let [drive, load] = [0, 1].map(|axis| {
            let own = &self.memory.moving.axes[axis];
            let force = force.to_array()[axis];
            let rubbing = self.rubbing(of, axis, middle, own);
            -force.signum() * self.levels(of, axis, &rubbing, 0.0).sliding_n[side(force)]
        });
        Pair::new(drive, load).where_true(starts)
    }

    fn break_away(&self, at: At<'_>, middle: &Middle, force: Pair) -> Pair {
        let of = at.of;
        let [drive, load] = [0, 1].map(|axis| {
            let own = &self.memory.moving.axes[axis];
            let rubbing = self.rubbing(of, axis, middle, own);
            self.levels(of, axis, &rubbing, 0.0).break_away_n[side(force.to_array()[axis])]
        });
        Pair::new(drive, load)
    }

    fn ways(&self, at: At<'_>) -> [MotionSpan; 2] {
        let [extending, retracting] = &self.ways[usize::from(at.span.span_s < self.substep_s)];
        let backwards = at.from.velocity.less(Pair::both(0.0));
        [0, 1].map(|reach: usize| {
            let (there, back) = (&extending[reach], &retracting[reach]);
            MotionSpan {
                keep: backwards.choose(back.keep, there.keep),
                gain: backwards.choose(back.gain, there.gain),
                drift: backwards.choose(back.drift, there.drift),
                push: backwards.choose(back.push, there.push),
            }
        })
    }

    fn holds(&self, at: At<'_>, middle: &Middle, axis: usize, force: f64) -> bool {
        let rubbing = self.rubbing(at.of, axis, middle, &self.memory.moving.axes[axis]);
        let levels = self.levels(at.of, axis, &rubbing, 0.0);
        at.of.motion.holds(at.from.place(axis).extension, force, &levels)
    }

    fn advance(&self, at: At<'_>, middle: &Middle, carried: &mut Moving, axis: usize, force: f64) -> Place {
        let (of, start) = (at.of, at.from.place(axis));
        let own = &mut carried.axes[axis];
        let rubbing = self.rubbing(of, axis, middle, own);
        let span_s = at.span.span_s;
        let Some(effect) = self.on[axis].presliding else {
            let speed = self.middle_speed(of, axis, &rubbing, start.velocity, force, span_s);
            return of.motion.advance(axis, start, force, &self.levels(of, axis, &rubbing, speed), span_s);
        };
        let bristle = Bristle { velocity_m_per_s: start.velocity, deflection_m: own.deflection_m };
        let under = self.under(of, axis, &rubbing, start.velocity, force);
        let (way_m, bristle) = effect.advance(bristle, under, span_s);
        own.deflection_m = bristle.deflection_m;
        of.motion
            .stop_at_ends(Place { extension: start.extension + way_m, velocity: bristle.velocity_m_per_s })
    }

    fn air(&self, at: At<'_>, to: &mut Lanes, middle: &Middle, carried: &mut Moving) {
        let (of, from) = (at.of, at.from);
        let span_s = at.span.span_s;
        let normal_pa = of.chambers.normal_pa();
        let volumes = |extension| [of.chambers.volume_a(extension), of.chambers.volume_b(extension)];
        let (volume_from, volume_to) = (volumes(from.extension), volumes(to.extension));
        let mut stored = to.air().map(|air| air.stored.to_array());
        for axis in 0..2 {
            if !self.adds_air(axis) {
                continue;
            }
            let lane = |pair: Pair| pair.to_array()[axis];
            let pressure_pa = middle.pressure.map(lane);
            let leakage = self.leakage(of, axis, pressure_pa).map(|terms| terms.sum(0.0));
            let own = &mut carried.axes[axis];
            for chamber in 0..2 {
                // What lag and bounds have let in, as a mean flow over the step.
                let valve = (stored[chamber][axis] - lane(from.air()[chamber].stored)) / (normal_pa * span_s);
                let flow_m3_per_s = valve + leakage[chamber];
                let volume_m3 = 1.0 / lane(middle.per_volume[chamber]);
                let rate = self.air_rate(
                    of,
                    axis,
                    chamber,
                    HeatAt {
                        stored_j: pressure_pa[chamber] * volume_m3,
                        volume_m3,
                        normal_volume_m3: own.normal_volume_m3[chamber] + flow_m3_per_s * span_s / 2.0,
                        flow_m3_per_s,
                    },
                );
                let swept_m3 = lane(volume_to[chamber]) - lane(volume_from[chamber]);
                own.air_rate_w[chamber] = normal_pa * leakage[chamber] + rate.sum(0.0);
                own.normal_volume_m3[chamber] += flow_m3_per_s * span_s;
                stored[chamber][axis] += own.air_rate_w[chamber] * span_s
                    - self.work_share(axis) * pressure_pa[chamber] * swept_m3;
            }
        }
        let [a, b] = stored.map(|lanes| Pair::new(lanes[0], lanes[1]));
        (to.air_a.stored, to.air_b.stored) = (a, b);
    }

    fn spool(&self, _: At<'_>, carried: &Moving) -> Pair {
        Pair::new(carried.axes[0].spool, carried.axes[1].spool)
    }

    fn keep(&mut self, at: At<'_>, lanes: &Lanes, carried: Moving) {
        let of = at.of;
        self.memory.moving = carried;
        for axis in 0..2 {
            let lane = |pair: Pair| pair.to_array()[axis];
            let own = &mut self.memory.moving.axes[axis];
            own.rest_s = if lane(lanes.velocity) == 0.0 { own.rest_s + at.span.span_s } else { 0.0 };
            for (line, flow) in self.memory.lines[axis].iter_mut().zip(own.port_flow_m3_per_s) {
                line.iter_mut().for_each(|line| line.push(flow));
            }
            let volumes = [of.chambers.volume_a(lanes.extension), of.chambers.volume_b(lanes.extension)];
            let [a, b] =
                [0, 1].map(|chamber: usize| lane(lanes.air()[chamber].stored) / lane(volumes[chamber]));
            let x = if axis == 0 { lane(lanes.extension) } else { self.stroke_m - lane(lanes.extension) };
            let on = &self.on[axis];
            for (i, truth) in [x, a, b].into_iter().enumerate() {
                let (shown, seen, span_s) = (own.shown[i], own.seen[i], at.span.span_s);
                own.shown[i] = match i {
                    0 => on.position_sensor_lag.map_or(truth, |lag| lag.advance(shown, seen, truth, span_s)),
                    _ => on.pressure_sensor_lag[i - 1]
                        .map_or(truth, |lag| lag.advance(shown, seen, truth, span_s)),
                };
                own.seen[i] = truth;
            }
            for (channel, truth) in [(0, x), (2, a), (3, b)] {
                self.memory.channels[axis][channel].iter_mut().for_each(|history| history.push(truth));
            }
            if self.memory.channels[axis][1].is_some() {
                let forces = Forces::at(of, Some(self), lanes, at.held.hand, at.held.linked);
                let force = forces.sensor_n(of, axis);
                self.memory.channels[axis][1].iter_mut().for_each(|history| history.push(force));
            }
        }
    }
}

impl Effects {
    /// What enters the line of a chamber, `ahead_s` after the newest substep's beginning.
    pub(crate) fn line(&self, axis: usize, chamber: usize, port: f64, ahead_s: f64) -> LineFlow {
        let line = self.on[axis].line_delay.zip(self.memory.lines[axis][chamber].as_ref());
        let line_delay = line.map_or(0.0, |(effect, history)| {
            // The newest entry is of the last substep's midpoint; between it and now there is a straight line.
            let back_s = effect.delay_s() - ahead_s - self.substep_s / 2.0;
            let delayed = if back_s >= 0.0 {
                history.before(back_s / self.substep_s)
            } else {
                let share = effect.delay_s() / (ahead_s + self.substep_s / 2.0);
                port + (history.before(0.0) - port) * share
            };
            effect.term(delayed, port)
        });
        LineFlow { line_delay }
    }
}
