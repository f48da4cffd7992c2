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
//! ([`Integrator::in_parts`]). So corners cost time only where they are.
//!
//! Why this scheme and this step: `plant/docs/integration.md` has the measured table of error and cost for this and
//! other schemes; `cargo run --release -p plant --example accuracy` makes it.

mod form;
pub(crate) mod laws;
mod smooth;

use crate::chamber::{Air, Chambers, FlowLag};
use crate::faults::Faults;
use crate::lanes::{Axes, Choice, Mask, Pair};
use crate::linkage::{ContactKinematics, Linkage};
use crate::motion::{Motion, MotionSpan, PistonState};
use crate::parameters::RigParameters;
use crate::state::{AxisState, State};
use crate::supply::{Supply, SupplyDecay};
use crate::valve::Valve;
use laws::{Laws, StepContext};

/// One step of [`crate::Plant`], s.
pub const PERIOD_S: f64 = 1e-3;

/// Substeps in a period; see the table of the module's head.
pub(crate) const SUBSTEPS: u32 = 10;

/// Parts of a substep that has a corner in it.
const PARTS: u32 = 8;

/// The laws, and their constants for both lengths of step.
#[derive(Debug, Clone)]
pub(crate) struct Integrator<P = Pair> {
    pub(crate) valve: Valve<P>,
    pub(crate) chambers: Chambers<P>,
    pub(crate) motion: Motion,
    pub(crate) linkage: Linkage,
    pub(crate) supply: Supply,
    /// Pressure around the rods, Pa.
    pub(crate) atmospheric_pa: f64,
    /// Dead volume of the rig file, which an effect may have replaced in the chambers, m^3.
    pub(crate) file_dead_volume_m3: f64,
    pub(crate) substeps: u32,
    coarse: Span<P>,
    fine: Span<P>,
}

/// Everything that depends on the length of a step and on the parameters.
#[derive(Debug, Clone)]
pub(crate) struct Span<P = Pair> {
    pub(crate) span_s: f64,
    pub(crate) spool_to_middle: P,
    pub(crate) spool_to_end: P,
    pub(crate) lag: FlowLag<P>,
    pub(crate) motion_to_middle: MotionSpan<P>,
    pub(crate) motion_to_end: MotionSpan<P>,
    supply_to_middle: SupplyDecay,
    supply_to_end: SupplyDecay,
}

/// The state of both axes, lane by lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lanes<P = Pair> {
    pub(crate) extension: P,
    pub(crate) velocity: P,
    pub(crate) spool: P,
    pub(crate) air_a: Air<P>,
    pub(crate) air_b: Air<P>,
}

/// Inputs and flags that are held over a period.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HeldInputs<P = Pair> {
    /// Valve commands as they act.
    pub(crate) command: P,
    /// Hand forces in each axis' own extension, N.
    pub(crate) hand: P,
    pub(crate) stopped: bool,
    pub(crate) linked: bool,
    /// Spools that do not move.
    pub(crate) stuck: [bool; 2],
}

/// The supply node over one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) middle_pa: f64,
    end_pa: f64,
    pub(crate) shut: bool,
}

/// Air of both axes at the midpoint of a step; two values are those of chambers a and b.
pub(crate) struct MidpointAir<P = Pair> {
    pub(crate) extension: P,
    pub(crate) pneumatic: P,
    pub(crate) edge_flow: [P; 2],
    pub(crate) pressure: [P; 2],
    pub(crate) per_volume: [P; 2],
}

/// The forces on each piston, N, along its own extension; viscous friction is in the motion's exponentials.
struct Forces<P> {
    pneumatic: P,
    /// Hands and effects, without friction.
    external: P,
    sliding_friction: P,
    contact: P,
}

impl<P: Axes> Forces<P> {
    #[inline(always)]
    fn sum(&self) -> P {
        self.pneumatic + self.external + self.sliding_friction + self.contact
    }
}

impl Integrator {
    pub(crate) fn new(rig: &RigParameters, added_mass_kg: f64, substeps: u32, faults: &Faults) -> Self {
        Self::assemble(Chambers::of(rig), Linkage::of(rig), rig, added_mass_kg, substeps, faults)
    }

    /// The same rig with other masses on it, or otherwise broken; allocates nothing, whatever effects replace.
    pub(crate) fn rebuilt(&self, rig: &RigParameters, added_mass_kg: f64, faults: &Faults) -> Self {
        let (chambers, linkage) = (self.chambers.clone(), self.linkage.clone());
        Self::assemble(chambers, linkage, rig, added_mass_kg, self.substeps, faults)
    }

    fn assemble(
        chambers: Chambers,
        linkage: Linkage,
        rig: &RigParameters,
        added_mass_kg: f64,
        substeps: u32,
        faults: &Faults,
    ) -> Self {
        let [on_drive_kg, on_load_kg] = faults.axes.map(|axis| axis.added_mass_kg);
        let motion = Motion::new(rig, [added_mass_kg + on_drive_kg, on_load_kg]);
        let supply = Supply::new(rig.supply(), faults.supply);
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
            linkage,
            file_dead_volume_m3: rig.cylinder().dead_volume_m3,
            atmospheric_pa: rig.supply().atmospheric_pressure_pa,
            chambers,
            motion,
            supply,
            substeps,
        }
    }

    /// Advances the state by one period under these laws.
    pub(crate) fn advance<L: Laws>(&self, laws: &mut L, state: &mut State, held: HeldInputs) {
        let mut lanes = Lanes::load(state);
        let mut supply_pa = state.supply_pressure_pa;
        for substep in 0..self.substeps {
            let mut extra_state = laws.extra_state();
            let (next, corner) = self.substep(laws, (&lanes, supply_pa), held, substep, &mut extra_state);
            (lanes, supply_pa) = if corner {
                extra_state = laws.extra_state();
                self.in_parts(laws, (lanes, supply_pa), held, substep, &mut extra_state)
            } else {
                next
            };
            laws.keep(self, held, &lanes, &extra_state);
        }
        lanes.store(state);
        state.supply_pressure_pa = supply_pa;
    }

    /// A substep from these lanes and this supply pressure made again, in parts that locate its corners.
    #[cold]
    pub(crate) fn in_parts<L: Laws>(
        &self,
        laws: &L,
        (mut lanes, mut supply_pa): (Lanes, f64),
        held: HeldInputs,
        substep: u32,
        extra_state: &mut L::ExtraState,
    ) -> (Lanes, f64) {
        for part in 0..PARTS {
            let node = self.node(&self.fine, supply_pa, held.stopped);
            let step = StepContext { of: self, span: &self.fine, from: &lanes, node, held, substep, part };
            lanes = self.careful(laws, step, extra_state);
            supply_pa = node.end_pa;
        }
        (lanes, supply_pa)
    }

    pub(crate) fn substep_s(&self) -> f64 {
        self.coarse.span_s
    }

    /// The two lengths of step: a substep, and a part of one.
    pub(crate) fn spans(&self) -> [&Span; 2] {
        [&self.coarse, &self.fine]
    }

    /// A short step that may meet any corner.
    #[cold]
    fn careful<L: Laws>(&self, laws: &L, step: StepContext<'_>, extra_state: &mut L::ExtraState) -> Lanes {
        let (span, node, held) = (step.span, step.node, step.held);
        let from = step.from.with_check_valves(node.shut);
        let step = StepContext { from: &from, ..step };
        let middle = laws.middle(step, extra_state);
        let zero = Pair::both(0.0);
        let moving = laws.moving(step);
        let external = laws.external_force(step, &middle);
        let mut forces = Forces {
            pneumatic: middle.pneumatic,
            external,
            sliding_friction: laws.sliding(step, &middle, extra_state, middle.pneumatic + external, moving),
            contact: zero,
        };
        if held.linked {
            let [to_middle, _] = laws.motion_factors(step);
            // First as if what rests stays; then again with what the contact sets in motion.
            forces.contact =
                Pair::both(self.contact(self.kinematics(span, to_middle, &from, moving, &forces)));
            let resting_force = forces.pneumatic + forces.external + forces.contact;
            let starts = self.starting(laws, step, &middle, resting_force, moving);
            if starts.any() {
                forces.sliding_friction =
                    forces.sliding_friction + laws.starting(step, &middle, resting_force, starts);
                forces.contact = zero;
                let kinematics = self.kinematics(span, to_middle, &from, moving | starts, &forces);
                forces.contact = Pair::both(self.contact(kinematics));
            }
        }
        let force = forces.pneumatic + forces.external + forces.contact;
        let mut piston = |axis: usize| laws.advance(step, &middle, extra_state, axis, force.to_array()[axis]);
        let (drive, load) = (piston(0), piston(1));
        let extension = Pair::new(drive.extension, load.extension);
        let velocity = Pair::new(drive.velocity, load.velocity);
        let limits = self.chambers.limits(node.end_pa);
        let bounded = |air: Air, edge_flow: Pair, volume: fn(&Chambers, Pair) -> Pair| {
            let free = span.lag.advance(air, edge_flow);
            let [before, after] = [from.extension, extension].map(|x| volume(&self.chambers, x));
            limits.hold(air, free, before, after)
        };
        let mut next = Lanes {
            extension,
            velocity,
            spool: laws.spool(step, extra_state),
            air_a: bounded(from.air_a, middle.edge_flow[0], Chambers::volume_a),
            air_b: bounded(from.air_b, middle.edge_flow[1], Chambers::volume_b),
        };
        laws.air(step, &mut next, &middle, extra_state);
        next
    }

    fn contact(&self, kinematics: ContactKinematics) -> f64 {
        if self.linkage.overlap(kinematics.distance_m) == 0.0 {
            self.linkage.closing_force(kinematics)
        } else {
            self.linkage.midpoint_force(kinematics)
        }
    }

    /// Which resting axes this force sets in motion.
    fn starting<L: Laws>(
        &self,
        laws: &L,
        step: StepContext<'_>,
        middle: &MidpointAir,
        force: Pair,
        moving: Mask,
    ) -> Mask {
        let leaves = |axis: usize| !laws.holds(step, middle, axis, force.to_array()[axis]);
        Mask::new([leaves(0), leaves(1)]) & !moving
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

    pub(crate) fn store(&self, state: &mut State) {
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
}

impl<P: Axes> Lanes<P> {
    /// From its numbers in the order of [`Lanes::to_pairs`].
    #[inline(always)]
    pub(crate) fn from_pairs([extension, velocity, spool, a, flow_a, b, flow_b]: [P; 7]) -> Self {
        let (air_a, air_b) = (Air { stored: a, flow: flow_a }, Air { stored: b, flow: flow_b });
        Lanes { extension, velocity, spool, air_a, air_b }
    }

    #[inline(always)]
    pub(crate) fn to_pairs(self) -> [P; 7] {
        let Lanes { extension, velocity, spool, air_a, air_b } = self;
        [extension, velocity, spool, air_a.stored, air_a.flow, air_b.stored, air_b.flow]
    }

    /// One axis.
    #[inline(always)]
    pub(crate) fn piston(&self, axis: usize) -> PistonState {
        PistonState { extension: self.extension.to_array()[axis], velocity: self.velocity.to_array()[axis] }
    }

    /// With no flow left in the chambers while the check valves are shut.
    #[inline(always)]
    fn with_check_valves(mut self, shut: bool) -> Self {
        if shut {
            self.air_a.flow = P::both(0.0);
            self.air_b.flow = P::both(0.0);
        }
        self
    }
}
