//! The program of one axis, composed in a file: which tasks run, in which multiple of the cycle, with which algorithm and
//! parameters.
//!
//! ```text
//!   sensors ──► pre-controller ──► algorithm ──► post-controller ──► opening
//!               every n cycles     every m       every k cycles      held in between
//! ```
//!
//! The algorithm is one of [`algorithms`] or a shared library; a second one, with a multiple of its own, may be there for
//! the force chain, which relieves the linked system and gives way to a hand. Every number is a [`Variable`], those of the chains
//! too: it has a name such as `algorithm.gain_per_s` and may change between two cycles.
//!
//! [`mod@file`] reads the file.

pub mod file;

use crate::chains::force::ForceOutput;
use crate::post_controller::{self, Output, PostController};
use crate::pre_controller::{self, Geometry, PreController};
use crate::set_point::{Actual, ForceSetPoint, SetPoint};
use algorithms::algorithm::{Quantity, Ready};
use algorithms::guard::{AlgorithmFault, Guarded};
use protocol::frames::Sensors;
use protocol::periods::CYCLE_S;
use settings::parameters::{Declaration, OutOfRange, Parameter, declare};
use std::ops::Range;

/// Multiple of the basic cycle of a task; the first parameter of each.
pub const EVERY_CYCLES: Declaration =
    declare("cycles", [1.0, 1000.0], 1.0, "multiple of the basic cycle of 1 ms").whole();
/// A task that is so many cycles late begins anew: a stall is no reason for a jump.
const STALLED: u64 = 100;

/// A parameter of a program under its full name.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Task and name, such as `algorithm.gain_per_s`.
    pub name: String,
    pub parameter: Parameter,
}

/// What the axis shall do in a cycle, in rig coordinates; an algorithm looks at what it controls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    pub position: SetPoint,
    pub force: ForceSetPoint,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    User,
    ForceChain,
}

struct Slot {
    algorithm: Guarded,
    controls: Quantity,
    values: Range<usize>,
    /// Cycle of its last step; `None` when it must begin anew.
    stepped: Option<u64>,
    wanted_m_per_s: f64,
}

/// A part of the program that is no algorithm and has numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    PreController,
    PostController,
    ForceChain,
    MatchingChain,
    /// What counts as settled; read once, at the start.
    Settled,
}

/// The algorithm that the force chain uses, and the two of its values in which the chain has a say each cycle.
struct GivingWay {
    slot: Slot,
    /// Places among the slot's values.
    moving: usize,
    limit_m_per_s: usize,
    /// What the chain decided last: whether the rod moves, and its limit, m/s.
    decided: (bool, Option<f64>),
    /// The slot's values with that in them; the user's own stay what they are.
    effective: Vec<f64>,
}

pub struct Program {
    pre: PreController,
    post: PostController,
    user: Slot,
    giving_way: Option<GivingWay>,
    variables: Vec<Variable>,
    values: Vec<f64>,
    tasks: [Range<usize>; 5],
    ready: Ready,
    observed: Option<u64>,
    post_stepped: Option<u64>,
    output: Output,
}

impl Program {
    /// Takes the sensors of `cycle`: the pre-controller's task.
    pub fn observe(&mut self, cycle: u64, sensors: &Sensors, supply_pressure_pa: f64) {
        let parameters = pre_controller::Parameters::of(self.task(Task::PreController));
        let passed = match due(self.observed, cycle, parameters.every_cycles) {
            Due::NotYet => return,
            Due::After(passed) => passed,
            Due::Anew => {
                self.pre.reset();
                parameters.every_cycles
            }
        };
        self.observed = Some(cycle);
        self.ready.supply_pressure_pa = supply_pressure_pa;
        self.pre.step(sensors, passed * CYCLE_S, &parameters, &mut self.ready);
    }

    /// The opening for `demand`, from the algorithm that has the axis.
    ///
    /// # Errors
    /// [`AlgorithmFault`], latched until [`Program::restart_algorithms`]: the valve is to be shut.
    pub fn control(&mut self, cycle: u64, demand: &Demand, hand: Hand) -> Result<Output, AlgorithmFault> {
        let geometry = &self.pre.geometry;
        let direction = geometry.direction();
        let ready = &mut self.ready;
        ready.set_position_m = geometry.extension_m(demand.position.position_m);
        ready.set_velocity_m_per_s = direction * demand.position.velocity_m_per_s;
        ready.set_acceleration_m_per_s2 = direction * demand.position.acceleration_m_per_s2;
        ready.set_force_n = demand.force.force_n;
        ready.set_force_rate_n_per_s = demand.force.rate_n_per_s;
        let wanted = match (hand, &mut self.giving_way) {
            (Hand::ForceChain, Some(giving_way)) => {
                self.user.stepped = None;
                giving_way.step(cycle, ready, &self.values)?
            }
            (_, other) => {
                if let Some(giving_way) = other {
                    giving_way.slot.stepped = None;
                }
                self.user.step(cycle, ready, &self.values[self.user.values.clone()])?
            }
        };
        let parameters =
            post_controller::Parameters::of(&self.values[self.tasks[Task::PostController as usize].clone()]);
        if due(self.post_stepped, cycle, parameters.every_cycles) != Due::NotYet {
            self.post_stepped = Some(cycle);
            self.output = self.post.step(wanted, ready, &parameters);
            self.ready.applied_velocity_m_per_s = self.output.applied_velocity_m_per_s;
        }
        Ok(self.output)
    }

    /// The valve is shut: whatever has the axis next begins anew.
    pub fn shut(&mut self) {
        self.slots().for_each(|slot| slot.stepped = None);
        self.post_stepped = None;
        self.output = Output::default();
        self.ready.applied_velocity_m_per_s = 0.0;
    }

    /// The rig's time began again, or it is another rig: nothing that was seen holds, the matched offset no more than the rest.
    pub fn restart(&mut self) {
        self.restart_algorithms();
        self.shut();
        self.slots().for_each(|slot| slot.wanted_m_per_s = 0.0);
        self.pre.restart();
        self.post.restart();
        self.ready = Ready::default();
        self.observed = None;
    }

    /// Takes latched faults away: the chain begins anew.
    pub fn restart_algorithms(&mut self) {
        self.slots().for_each(|slot| slot.algorithm.restart());
    }

    fn slots(&mut self) -> impl Iterator<Item = &mut Slot> {
        std::iter::once(&mut self.user)
            .chain(self.giving_way.iter_mut().map(|giving_way| &mut giving_way.slot))
    }

    /// Tells the algorithm of the force chain what the chain has decided.
    pub fn give_way(&mut self, chain: &ForceOutput) {
        if let Some(giving_way) = &mut self.giving_way {
            giving_way.decided = (chain.feed_forward, chain.limit_m_per_s);
        }
    }

    pub fn gives_way(&self) -> bool {
        self.giving_way.is_some()
    }

    /// Values of a task, in the order of its table.
    pub fn task(&self, task: Task) -> &[f64] {
        &self.values[self.tasks[task as usize].clone()]
    }

    /// Position of the axis, less the sensor's offset, m, rig coordinates.
    pub fn position_m(&self) -> f64 {
        self.pre.geometry.position_m(self.ready.position_m)
    }

    /// What the axis does, in rig coordinates.
    pub fn actual(&self) -> Actual {
        let direction = self.pre.geometry.direction();
        Actual {
            position_m: self.position_m(),
            velocity_m_per_s: direction * self.ready.velocity_m_per_s,
            acceleration_m_per_s2: direction * self.ready.acceleration_m_per_s2,
        }
    }

    /// What was measured, in the axis's own extension.
    pub fn ready(&self) -> &Ready {
        &self.ready
    }

    pub fn geometry(&self) -> &Geometry {
        &self.pre.geometry
    }

    /// Takes what the position sensor reads too much, m.
    pub fn set_offset(&mut self, offset_m: f64) {
        self.pre.set_offset(offset_m);
    }

    /// The velocity that the algorithm wants, m/s, along the axis's extension.
    pub fn wanted_m_per_s(&self, hand: Hand) -> f64 {
        match (hand, &self.giving_way) {
            (Hand::ForceChain, Some(giving_way)) => giving_way.slot.wanted_m_per_s,
            _ => self.user.wanted_m_per_s,
        }
    }

    pub fn controls(&self) -> Quantity {
        self.user.controls
    }

    /// All variables, in the order of their values.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub fn place(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|variable| variable.name == name)
    }

    /// Changes the variable at `place`; acts from the next cycle on.
    ///
    /// # Errors
    /// [`OutOfRange`] when it does not allow the value; it keeps its own. What is read at the start only is set all the same:
    /// who changes it while running asks [`Parameter::check_change`] before.
    pub fn set(&mut self, place: usize, value: f64) -> Result<(), OutOfRange> {
        self.values[place] = self.variables[place].parameter.check(value)?;
        Ok(())
    }
}

impl Slot {
    /// The wanted velocity, with the `values` of this slot.
    fn step(&mut self, cycle: u64, ready: &mut Ready, values: &[f64]) -> Result<f64, AlgorithmFault> {
        let (every, parameters) = values.split_at(1);
        match due(self.stepped, cycle, every[0]) {
            Due::NotYet => return Ok(self.wanted_m_per_s),
            Due::After(passed) => ready.period_s = passed * CYCLE_S,
            Due::Anew => {
                ready.period_s = every[0] * CYCLE_S;
                self.algorithm.reset(ready, parameters)?;
            }
        }
        self.stepped = Some(cycle);
        self.wanted_m_per_s = 0.0;
        self.wanted_m_per_s = self.algorithm.step(ready, parameters)?;
        Ok(self.wanted_m_per_s)
    }
}

impl GivingWay {
    /// The wanted velocity: the chain says whether the rod moves, and the lower one of its limit and the user's holds.
    fn step(&mut self, cycle: u64, ready: &mut Ready, values: &[f64]) -> Result<f64, AlgorithmFault> {
        let (moves, limit_m_per_s) = self.decided;
        self.effective.copy_from_slice(&values[self.slot.values.clone()]);
        self.effective[self.moving] = f64::from(u8::from(moves));
        let limit = &mut self.effective[self.limit_m_per_s];
        *limit = limit.min(limit_m_per_s.unwrap_or(f64::INFINITY));
        self.slot.step(cycle, ready, &self.effective)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Due {
    NotYet,
    /// It is, so many cycles after its last step.
    After(f64),
    /// There was no last step, or it is too long ago to go on from it.
    Anew,
}

fn due(last: Option<u64>, cycle: u64, every_cycles: f64) -> Due {
    let every = every_cycles as u64;
    let Some(last) = last else { return Due::Anew };
    match cycle.saturating_sub(last) {
        passed if passed < every => Due::NotYet,
        passed if passed >= every + STALLED => Due::Anew,
        passed => Due::After(passed as f64),
    }
}

#[cfg(test)]
mod tests;
