//! The integrator: one period of 1 ms in ten substeps of 100 us, both axes in one pass.
//!
//! Each law has an exact solution when its neighbours are held, so a substep evaluates the neighbours once, at its
//! midpoint, and then moves everything by exact exponentials (an explicit midpoint rule, second order):
//!
//! ```text
//! 1  spool      exact to the midpoint and to the end (it depends on the command alone)
//! 2  midpoint   x + v h/2,  M + p_N q h/2          ->  pressures, edge flows Q, pneumatic force
//! 3  motion     exact under the midpoint's force; contact by the implicit midpoint rule in closed form
//! 4  air        q and M exact under the midpoint's Q; bounds applied where they are crossed
//! ```
//!
//! The equations have corners: sticking, breaking away, turning round, making contact, meeting an end of the stroke,
//! check valves moving. A substep first assumes that none lies in it ([`Integrator::smooth`], which branches only on
//! being linked and in contact), then checks; if one does, it is discarded and made again in eight parts that locate it
//! ([`Integrator::careful`]). So corners cost time only where they are.
//!
//! Why this scheme and this step: `docs/integration.md` has the measured table of error and cost for this and
//! other schemes; `cargo run --release -p plant --example accuracy` makes it.

use crate::chamber::{Air, Chambers, FlowLag};
use crate::lanes::{Mask, Pair};
use crate::linkage::{Approach, Linkage};
use crate::motion::{Motion, MotionSpan, Place};
use crate::parameters::RigParameters;
use crate::state::{AxisState, State};
use crate::supply::{Supply, SupplyDecay};
use crate::valve::{Valve, edge_flow};

/// One step of [`crate::Plant`], s.
pub(crate) const PERIOD_S: f64 = 1e-3;

/// Substeps in a period; see the table of the module's head.
pub(crate) const SUBSTEPS: u32 = 10;

/// Parts of a substep that has a corner in it.
const PARTS: u32 = 8;

/// A resting axis linked to a moving one is looked at closely from this far below its break-away force on, N: more than
/// the contact force changes within half a substep while the other axis creeps.
const BREAK_AWAY_MARGIN_N: f64 = 0.5;

/// The laws, and their constants for both lengths of step.
#[derive(Debug, Clone)]
pub(crate) struct Integrator {
    pub(crate) valve: Valve,
    pub(crate) chambers: Chambers,
    pub(crate) motion: Motion,
    pub(crate) linkage: Linkage,
    pub(crate) supply: Supply,
    substeps: u32,
    coarse: Span,
    fine: Span,
}

/// Everything that depends on the length of a step and on the parameters.
#[derive(Debug, Clone)]
struct Span {
    span_s: f64,
    spool_to_middle: Pair,
    spool_to_end: Pair,
    lag: FlowLag,
    motion_to_middle: MotionSpan,
    motion_to_end: MotionSpan,
    supply_to_middle: SupplyDecay,
    supply_to_end: SupplyDecay,
}

/// The state of both axes, lane by lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lanes {
    pub(crate) extension: Pair,
    pub(crate) velocity: Pair,
    pub(crate) spool: Pair,
    pub(crate) air_a: Air,
    pub(crate) air_b: Air,
}

/// What is held over a period.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Held {
    /// Valve commands as they act.
    pub(crate) command: Pair,
    /// Hand forces in each axis' own extension, N.
    pub(crate) hand: Pair,
    pub(crate) stopped: bool,
    pub(crate) linked: bool,
}

/// The supply node over one step.
#[derive(Debug, Clone, Copy)]
struct Node {
    middle_pa: f64,
    end_pa: f64,
    shut: bool,
}

/// What the air does at the midpoint of a step.
struct Middle {
    pneumatic: Pair,
    edge_flow_a: Pair,
    edge_flow_b: Pair,
    per_volume: [Pair; 2],
}

/// The forces on each piston, N, along its own extension; viscous friction is in the motion's exponentials.
struct Forces {
    pneumatic: Pair,
    hand: Pair,
    sliding_friction: Pair,
    contact: Pair,
}

impl Forces {
    #[inline(always)]
    fn sum(&self) -> Pair {
        self.pneumatic + self.hand + self.sliding_friction + self.contact
    }
}

impl Integrator {
    pub(crate) fn new(rig: &RigParameters, added_mass_kg: f64, substeps: u32) -> Self {
        let chambers = Chambers::new(rig.cylinder(), rig.supply(), rig.gas());
        let motion = Motion::new(rig, added_mass_kg);
        let supply = Supply::new(rig.supply());
        let span = |span_s: f64| Span {
            span_s,
            spool_to_middle: Pair::both(libm::exp(-span_s / 2.0 / rig.valve().spool_time_constant_s)),
            spool_to_end: Pair::both(libm::exp(-span_s / rig.valve().spool_time_constant_s)),
            lag: chambers.flow_lag(rig.valve().flow_lag_time_constant_s, span_s),
            motion_to_middle: motion.span(span_s / 2.0),
            motion_to_end: motion.span(span_s),
            supply_to_middle: supply.decay(span_s / 2.0),
            supply_to_end: supply.decay(span_s),
        };
        let coarse_s = PERIOD_S / f64::from(substeps);
        Integrator {
            coarse: span(coarse_s),
            fine: span(coarse_s / f64::from(PARTS)),
            valve: Valve::new(rig.valve()),
            linkage: Linkage::new(rig.linkage()),
            chambers,
            motion,
            supply,
            substeps,
        }
    }

    /// Advances the state by one period.
    pub(crate) fn advance(&self, state: &mut State, held: Held) {
        let mut lanes = Lanes::load(state);
        let mut supply_pa = state.supply_pressure_pa;
        for _ in 0..self.substeps {
            let node = self.node(&self.coarse, supply_pa, held.stopped);
            let (next, corner) = self.smooth(&lanes, node, held);
            let valves_move =
                self.supply.check_valves_shut(supply_pa) != self.supply.check_valves_shut(node.end_pa);
            if corner || valves_move {
                for _ in 0..PARTS {
                    let node = self.node(&self.fine, supply_pa, held.stopped);
                    lanes = self.careful(&lanes, node, held);
                    supply_pa = node.end_pa;
                }
            } else {
                lanes = next;
                supply_pa = node.end_pa;
            }
        }
        lanes.store(state);
        state.supply_pressure_pa = supply_pa;
    }

    /// d of the linkage, m, from both extensions.
    pub(crate) fn distance(&self, extension: Pair) -> f64 {
        self.motion.stroke_m() - extension.sum()
    }

    #[inline(always)]
    fn node(&self, span: &Span, supply_pa: f64, stopped: bool) -> Node {
        let middle_pa = self.supply.after(supply_pa, stopped, span.supply_to_middle);
        let end_pa = self.supply.after(supply_pa, stopped, span.supply_to_end);
        Node { middle_pa, end_pa, shut: self.supply.check_valves_shut(middle_pa) }
    }

    /// A step that assumes no corner; the flag says that there may be one, and then the step counts for nothing.
    #[inline(always)]
    fn smooth(&self, from: &Lanes, node: Node, held: Held) -> (Lanes, bool) {
        let span = &self.coarse;
        let zero = Pair::both(0.0);
        let from = from.with_check_valves(node.shut);
        let middle = self.middle(span, &from, node, held);

        let moving = from.velocity.differs(zero);
        let mut forces = Forces {
            pneumatic: middle.pneumatic,
            hand: held.hand,
            sliding_friction: self.motion.sliding_friction(from.velocity, moving),
            contact: zero,
        };
        if held.linked {
            forces.contact =
                Pair::both(self.linkage.midpoint_force(self.approach(span, &from, moving, &forces)));
        }
        let force = forces.sum();
        let way = &span.motion_to_end;
        let velocity = (way.keep * from.velocity + way.gain * force).where_true(moving);
        let extension = from.extension + (way.drift * from.velocity + way.push * force).where_true(moving);

        let growth =
            self.chambers.force_growth(&span.lag, middle.per_volume, [from.air_a.flow, from.air_b.flow]);
        let nudged_n = if held.linked && moving.any() { BREAK_AWAY_MARGIN_N } else { 0.0 };
        let margin = growth.abs() + Pair::both(nudged_n);
        let leaves = !moving & self.motion.might_leave(from.extension, force, margin);
        let turns = moving & (velocity * from.velocity).at_most(zero);
        let overruns = extension.less(zero) | Pair::both(self.motion.stroke_m()).less(extension);
        let touches =
            held.linked && self.linkage.made_contact(self.distance(from.extension), self.distance(extension));
        let limits = self.chambers.limits(node.end_pa);
        let stop = |air: Air, edge_flow: Pair, volume: Pair| {
            limits.stop(air, span.lag.advance(air, edge_flow), volume)
        };
        let (air_a, fills_a) = stop(from.air_a, middle.edge_flow_a, self.chambers.volume_a(extension));
        let (air_b, fills_b) = stop(from.air_b, middle.edge_flow_b, self.chambers.volume_b(extension));
        let spool = held.command + (from.spool - held.command) * span.spool_to_end;
        let next = Lanes { extension, velocity, spool, air_a, air_b };
        (next, (leaves | turns | overruns | fills_a | fills_b).any() | touches)
    }

    /// A short step that may meet any corner.
    #[cold]
    fn careful(&self, from: &Lanes, node: Node, held: Held) -> Lanes {
        let span = &self.fine;
        let from = from.with_check_valves(node.shut);
        let middle = self.middle(span, &from, node, held);
        let zero = Pair::both(0.0);
        let moving = from.velocity.differs(zero);
        let mut forces = Forces {
            pneumatic: middle.pneumatic,
            hand: held.hand,
            sliding_friction: self.motion.sliding_friction(from.velocity, moving),
            contact: zero,
        };
        if held.linked {
            // First as if what rests stays; then again with what the contact sets in motion.
            forces.contact = Pair::both(self.contact(self.approach(span, &from, moving, &forces)));
            let resting_force = forces.pneumatic + forces.hand + forces.contact;
            let starts = self.starting(&from, resting_force, moving);
            if starts.any() {
                forces.sliding_friction =
                    forces.sliding_friction + self.motion.sliding_friction(resting_force, starts);
                forces.contact = zero;
                forces.contact =
                    Pair::both(self.contact(self.approach(span, &from, moving | starts, &forces)));
            }
        }
        let force = forces.pneumatic + forces.hand + forces.contact;
        let place = |axis: usize| {
            let start = Place {
                extension: from.extension.to_array()[axis],
                velocity: from.velocity.to_array()[axis],
            };
            self.motion.advance(axis, start, force.to_array()[axis], span.span_s)
        };
        let (drive, load) = (place(0), place(1));
        let extension = Pair::new(drive.extension, load.extension);
        let velocity = Pair::new(drive.velocity, load.velocity);
        let limits = self.chambers.limits(node.end_pa);
        let bounded = |air: Air, edge_flow: Pair, volume: fn(&Chambers, Pair) -> Pair| {
            let free = span.lag.advance(air, edge_flow);
            let [before, after] = [from.extension, extension].map(|x| volume(&self.chambers, x));
            limits.hold(air, free, before, after)
        };
        Lanes {
            extension,
            velocity,
            spool: held.command + (from.spool - held.command) * span.spool_to_end,
            air_a: bounded(from.air_a, middle.edge_flow_a, Chambers::volume_a),
            air_b: bounded(from.air_b, middle.edge_flow_b, Chambers::volume_b),
        }
    }

    fn contact(&self, approach: Approach) -> f64 {
        if self.linkage.overlap(approach.distance_m) == 0.0 {
            self.linkage.closing_force(approach)
        } else {
            self.linkage.midpoint_force(approach)
        }
    }

    /// Which resting axes this force sets in motion.
    fn starting(&self, from: &Lanes, force: Pair, moving: Mask) -> Mask {
        let leaves = |axis: usize| {
            let stays = self.motion.holds(from.extension.to_array()[axis], force.to_array()[axis]);
            if stays { 0.0 } else { 1.0 }
        };
        Pair::new(leaves(0), leaves(1)).differs(Pair::both(0.0)) & !moving
    }

    /// Air at the step's midpoint; one evaluation of the valve and of both chambers.
    #[inline(always)]
    fn middle(&self, span: &Span, from: &Lanes, node: Node, held: Held) -> Middle {
        let spool = held.command + (from.spool - held.command) * span.spool_to_middle;
        let mut edges = self.valve.edges(spool, node.middle_pa, self.chambers.exhaust_pa());
        if node.shut {
            (edges.conductance_a, edges.conductance_b) = (Pair::both(0.0), Pair::both(0.0));
        }
        // Kept within the stroke: a step that overruns the end is discarded, but must not meet a negative volume.
        let ahead = from.extension + from.velocity * Pair::both(span.span_s / 2.0);
        let extension = ahead.max(Pair::both(0.0)).min(Pair::both(self.motion.stroke_m()));
        let per_volume_a = self.chambers.volume_a(extension).reciprocal();
        let per_volume_b = self.chambers.volume_b(extension).reciprocal();
        let pressure_a = span.lag.midpoint_air(from.air_a) * per_volume_a;
        let pressure_b = span.lag.midpoint_air(from.air_b) * per_volume_b;
        Middle {
            pneumatic: self.chambers.pneumatic_force(pressure_a, pressure_b),
            edge_flow_a: edge_flow(edges.conductance_a, edges.far_pressure_a, pressure_a),
            edge_flow_b: edge_flow(edges.conductance_b, edges.far_pressure_b, pressure_b),
            per_volume: [per_volume_a, per_volume_b],
        }
    }

    #[inline(always)]
    fn approach(&self, span: &Span, from: &Lanes, moving: Mask, forces: &Forces) -> Approach {
        let way = &span.motion_to_middle;
        let free = (way.keep * from.velocity + way.gain * forces.sum()).where_true(moving);
        Approach {
            distance_m: self.distance(from.extension),
            free_speed_m_per_s: -free.sum(),
            mobility: way.gain.where_true(moving).sum(),
            half_span_s: span.span_s / 2.0,
        }
    }
}

impl Lanes {
    pub(crate) fn load(state: &State) -> Self {
        let pair = |pick: fn(&AxisState) -> f64| Pair::new(pick(&state.axes[0]), pick(&state.axes[1]));
        Lanes {
            extension: pair(|axis| axis.extension_m),
            velocity: pair(|axis| axis.rod_velocity_m_per_s),
            spool: pair(|axis| axis.spool),
            air_a: Air { stored: pair(|axis| axis.stored_air_a_j), flow: pair(|axis| axis.flow_a_m3_per_s) },
            air_b: Air { stored: pair(|axis| axis.stored_air_b_j), flow: pair(|axis| axis.flow_b_m3_per_s) },
        }
    }

    fn store(&self, state: &mut State) {
        for (i, axis) in state.axes.iter_mut().enumerate() {
            let lane = |pair: Pair| pair.to_array()[i];
            *axis = AxisState {
                extension_m: lane(self.extension),
                rod_velocity_m_per_s: lane(self.velocity),
                spool: lane(self.spool),
                stored_air_a_j: lane(self.air_a.stored),
                stored_air_b_j: lane(self.air_b.stored),
                flow_a_m3_per_s: lane(self.air_a.flow),
                flow_b_m3_per_s: lane(self.air_b.flow),
            };
        }
    }

    /// With no flow left in the chambers while the check valves are shut.
    #[inline(always)]
    fn with_check_valves(mut self, shut: bool) -> Self {
        if shut {
            self.air_a.flow = Pair::both(0.0);
            self.air_b.flow = Pair::both(0.0);
        }
        self
    }
}
