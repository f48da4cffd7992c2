//! The list of all terms at an instant: what each switched-on effect adds to which balance, for `truth.csv` and for tests.
//!
//! The balances are reported in the order of `sums.rs`, axis by axis, then those of linkage and supply. A term of an effect that
//! is off is not reported.

use super::OpenBalance;
use super::acting::Effects;
use super::air::HeatState;
use super::friction::{Friction, direction_of};
use super::replaced::linkage_terms;
use super::sheet::{Element, Part};
use super::sums::{Balance, Damping, DeadSpace, ExhaustSide, Gap, Stiffness};
use super::tabulated::AxisConditions;
use crate::integrator::{Integrator, Lanes};
use crate::lanes::{Axes, Pair};
use crate::state::{Inputs, State};
use crate::truth::{AirState, TrueForces, hand_forces};

/// Terms that a rig with everything switched on has, and some room.
const MOST_TERMS: usize = 160;

/// Values of all terms of a rig at an instant, in the order of [`crate::Plant::term_names`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    count: usize,
    values: [f64; MOST_TERMS],
}

impl Default for Terms {
    fn default() -> Self {
        Terms { count: 0, values: [0.0; MOST_TERMS] }
    }
}

impl Terms {
    /// Terms in the order of their columns.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    /// Adds a value of the caller's own behind those of the rig.
    ///
    /// # Panics
    /// If there is no room: a rig with everything switched on leaves some.
    pub fn push(&mut self, value: f64) {
        self.values[self.count] = value;
        self.count += 1;
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    pub(crate) part: Part,
    /// Chamber, channel or edge it belongs to.
    pub(crate) element: Option<&'static str>,
    pub(crate) balance: &'static str,
    /// Name of the effect, with underscores.
    pub(crate) effect: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) value: f64,
}

impl Term {
    /// Column of `truth.csv`, as `drive_leakage_piston_leakage_a_m3_per_s`.
    pub(crate) fn column(&self) -> String {
        let element = self.element.map(|element| format!("_{element}")).unwrap_or_default();
        format!("{}_{}_{}{element}_{}", self.part.name(), self.balance, self.effect, self.unit)
    }
}

/// Chambers by name, as they are counted.
const CHAMBERS: [(&str, Element); 2] = [("a", Element::A), ("b", Element::B)];

/// The walk over all terms, which calls a function for each.
struct TermVisitor<'t> {
    effects: &'t Effects,
    part: Part,
    visit: &'t mut dyn FnMut(Term),
}

impl TermVisitor<'_> {
    /// Visits the terms of a balance whose effects are on.
    fn balance<B: Balance>(&mut self, balance: &B, name: Option<&'static str>, element: Option<Element>) {
        let on = &self.effects.on[usize::from(self.part == Part::Load)];
        balance.each(&mut |effect, value| {
            if on.is_on(effect, element) {
                let (part, element) = (self.part, name);
                (self.visit)(Term { part, element, balance: B::NAME, effect, unit: B::UNIT, value });
            }
        });
    }

    /// Lists the terms of an open balance behind those of `balance`.
    fn open<B: Balance>(&mut self, balance: &B, name: Option<&'static str>, open: &OpenBalance<'_>) {
        self.balance(balance, name, open.element());
        let (part, element) = (self.part, name);
        self.effects.on[usize::from(part == Part::Load)].each_term(open, |effect, value| {
            (self.visit)(Term { part, element, balance: B::NAME, effect, unit: B::UNIT, value });
        });
    }
}

impl Effects {
    /// Visits every term of the rig at an instant.
    pub(crate) fn each_term(
        &self,
        of: &Integrator,
        state: &State,
        inputs: &Inputs,
        visit: &mut dyn FnMut(Term),
    ) {
        let lanes = Lanes::load(state);
        let air = AirState::of(of, &lanes);
        let forces = TrueForces::at(of, Some(self), &lanes, hand_forces(inputs), state.linked);
        for (axis, part) in [Part::Drive, Part::Load].into_iter().enumerate() {
            let mut visitor = TermVisitor { effects: self, part, visit };
            let axis_states = &self.memory.states.axes[axis];
            let lane = |pair: Pair| pair.to_array()[axis];
            let piston = lanes.piston(axis);

            // From the command to the flows.
            let command = if state.emergency_stop { 0.0 } else { inputs.valve[axis] };
            let arriving = self.arriving(axis, command, 0.0);
            let target = self.target(axis, axis_states, arriving.sum(command));
            let sent = target.sum(arriving.sum(command)).clamp(-1.0, 1.0);
            let (rate, limited) = self.spool_rate(axis, axis_states, state.axes[axis].spool, sent);
            visitor.balance(&arriving, None, None);
            visitor.balance(&target, None, None);
            visitor.balance(&rate, None, None);
            visitor.balance(&limited, None, None);
            let ports = self.ports_at(of, axis, state, &air);
            let open = OpenBalance::Opening { spool: state.axes[axis].spool };
            visitor.open(&ports.opening, None, &open);
            for (edge, name) in ["supply", "exhaust"].into_iter().enumerate() {
                visitor.balance(&ports.characteristic[edge], Some(name), None);
            }
            visitor.balance(&ExhaustSide { silencer_back_pressure: axis_states.silencer_pa }, None, None);

            // The chambers.
            let conditions = AxisConditions::at(&lanes, &air, axis);
            let leakage = self.leakage(of, axis, &conditions);
            let flows = lanes.air().map(|air| lane(air.flow));
            for (chamber, (name, element)) in CHAMBERS.into_iter().enumerate() {
                let (at, element) = (Some(name), Some(element));
                let edges = [["supply_a", "exhaust_a"], ["supply_b", "exhaust_b"]];
                for (edge, name) in ports.edges[chamber].iter().zip(edges[chamber]) {
                    visitor.balance(edge, Some(name), element);
                }
                visitor.balance(&ports.port[chamber], at, element);
                visitor.balance(&ports.port_flow[chamber], at, element);
                visitor.balance(&self.line(axis, chamber, ports.flow_m3_per_s[chamber], 0.0), at, element);
                visitor.open(
                    &leakage[chamber],
                    at,
                    &OpenBalance::Leakage { chamber, conditions: &conditions },
                );
                let heat = HeatState {
                    stored_j: lane(lanes.air()[chamber].stored),
                    volume_m3: lane(air.volume[chamber]),
                    normal_volume_m3: axis_states.normal_volume_m3[chamber],
                    flow_m3_per_s: flows[chamber] + leakage[chamber].sum(0.0),
                };
                // With the piston's work, which the step takes from the volume swept.
                let mut rate = self.air_rate(of, axis, chamber, heat, 0.0);
                let area_m2 = [1.0, -1.0][chamber] * of.chambers.areas_m2()[chamber];
                rate.heat_exchange -=
                    self.work_share(axis) * air.of_axis_pa(axis)[chamber] * area_m2 * piston.velocity;
                visitor.balance(&rate, at, element);
                let file = of.file_dead_volume_m3;
                let dead_volume = self.on[axis].dead_volume.map_or(0.0, |effect| effect.term(file));
                visitor.balance(&DeadSpace { dead_volume }, at, element);
            }

            // Friction in the direction of the motion, or of the force on a resting piston.
            let friction = Friction::at(self, of, axis, piston, &air);
            let force = forces.unresisted_n(axis);
            let direction = direction_of(if piston.velocity == 0.0 { force } else { piston.velocity });
            let (at, speed) = (&friction.conditions, piston.velocity.abs());
            let sliding = friction.sliding_level(speed, direction);
            let open = OpenBalance::SlidingLevel { at, speed_m_per_s: speed, direction };
            visitor.open(&sliding, None, &open);
            let open = OpenBalance::BreakAwayLevel { at, direction };
            visitor.open(&friction.break_away_level(direction, &sliding), None, &open);
            visitor.balance(&self.viscous_term(of, axis, direction), None, None);
            let bristles = friction.bristles(piston, force).unwrap_or_default();
            visitor.balance(&bristles, None, None);
            visitor.open(&self.force(axis, &conditions), None, &OpenBalance::Force(&conditions));

            // What the sensors make of it.
            let position_m = if axis == 0 { piston.extension } else { of.motion.stroke_m - piston.extension };
            let force_n = forces.sensor_n(of, axis);
            let declared = self.declared_at(axis, &conditions, force_n);
            let open = OpenBalance::PositionReading { truth_m: position_m };
            visitor.open(&self.position_reading(axis, position_m, &declared), Some("position"), &open);
            let open = OpenBalance::ForceReading { truth_n: force_n };
            visitor.open(&self.force_reading(axis, force_n, &declared), Some("force"), &open);
            for (chamber, (name, _)) in CHAMBERS.into_iter().enumerate() {
                let truth_pa = air.of_axis_pa(axis)[chamber];
                let open = OpenBalance::PressureReading { chamber, truth_pa };
                let reading = self.pressure_reading(axis, chamber, truth_pa, &declared);
                visitor.open(&reading, Some(name), &open);
            }
        }
        let (gap, stiffness, damping) = linkage_terms(&self.on[0], &self.file_linkage);
        let mut visitor = TermVisitor { effects: self, part: Part::Linkage, visit };
        visitor.balance::<Gap>(&gap, None, None);
        visitor.balance::<Stiffness>(&stiffness, None, None);
        visitor.balance::<Damping>(&damping, None, None);
        let mut visitor = TermVisitor { effects: self, part: Part::Supply, visit };
        visitor.balance(&self.supply_side(&self.memory.states), None, None);
    }
}
