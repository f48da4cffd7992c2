//! The program of one axis, composed in a file: which tasks run, in which multiple of the cycle, with which algorithm and
//! parameters.
//!
//! ```text
//!   sensors ──► pre-controller ──► algorithm ──► post-controller ──► opening
//!               every n cycles     every m       every k cycles      held in between
//! ```
//!
//! The algorithm is one of [`algorithms`] or a shared library; a second one, with a multiple of its own, may be there for
//! the force chain, which relieves the linked system and yields to a hand. Every number is a [`Variable`], those of the chains
//! too: it has a name such as `algorithm.gain_per_s` and may change between two cycles.
//!
//! [`mod@file`] reads the file.

pub mod file;

use crate::chains::force::ForceOutput;
use crate::post_controller::{self, Output, PostController};
use crate::pre_controller::{self, Geometry, PreController};
use crate::set_point::{Actual, ForceSetPoint, SetPoint};
use algorithms::algorithm::{AlgorithmInput, Quantity};
use algorithms::guard::{AlgorithmFault, Guarded};
use protocol::frames::Sensors;
use protocol::periods::CYCLE_S;
use settings::parameters::{Declaration, OutOfRange, Parameter, declare};
use std::ops::Range;

/// Multiple of the basic cycle of a task; the first parameter of each.
pub(crate) const EVERY_CYCLES: Declaration =
    declare("cycles", [1.0, 1000.0], 1.0, "multiple of the basic cycle of 1 ms").whole();
/// A task that is so many cycles late begins anew: a stall is no reason for a jump.
const STALLED: u64 = 100;

/// A parameter of a program under its full name.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Task and name, such as `algorithm.gain_per_s`.
    pub name: String,
    /// Its entry in the table of its task: name without the task, unit, range, default and meaning.
    pub parameter: Parameter,
}

/// Set-points of a cycle, in rig coordinates; an algorithm uses that of the quantity which it controls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Position set-point; under force control the measured position, at rest.
    pub position: SetPoint,
    /// Force set-point; 0 under position control.
    pub force: ForceSetPoint,
}

/// Which algorithm of the program controls the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActiveAlgorithm {
    /// That of `[algorithm]`.
    User,
    /// That of `[giving-way]`, with the limit of the force chain; in a program without it that of `[algorithm]`.
    ForceChain,
}

/// An algorithm of the program, with its values and its last step.
struct AlgorithmSlot {
    algorithm: Guarded,
    controls: Quantity,
    values: Range<usize>,
    /// Cycle of its last step; `None` when it must begin anew.
    stepped_cycle: Option<u64>,
    wanted_m_per_s: f64,
}

/// A part of the program that is no algorithm and has numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    PreController,
    PostController,
    ForceChain,
    MatchingChain,
    /// Bounds of a settled axis; read once, at the start.
    Settled,
}

/// The algorithm that the force chain uses, and the two of its values that the chain sets each cycle.
struct ForceChainSlot {
    slot: AlgorithmSlot,
    /// Indices among the slot's values.
    moving_index: usize,
    limit_index: usize,
    /// The chain's last output: whether the rod moves, and its limit, m/s.
    chain_output: (bool, Option<f64>),
    /// The slot's values with the chain's output in place; the user's values do not change.
    effective: Vec<f64>,
}

/// The tasks of one axis with their values, and what they keep from cycle to cycle.
pub struct Program {
    pre: PreController,
    post: PostController,
    user_slot: AlgorithmSlot,
    force_chain_slot: Option<ForceChainSlot>,
    variables: Vec<Variable>,
    values: Vec<f64>,
    tasks: [Range<usize>; 5],
    input: AlgorithmInput,
    observed_cycle: Option<u64>,
    post_stepped_cycle: Option<u64>,
    output: Output,
}

impl Program {
    /// Takes the sensors of `cycle`: the pre-controller's task. `supply_pressure_pa` is absolute, as the rig reports it.
    pub fn observe(&mut self, cycle: u64, sensors: &Sensors, supply_pressure_pa: f64) {
        let parameters = pre_controller::Parameters::of(self.task(Task::PreController));
        let passed = match due(self.observed_cycle, cycle, parameters.every_cycles) {
            Due::NotYet => return,
            Due::After(passed) => passed,
            Due::Anew => {
                self.pre.reset();
                parameters.every_cycles
            }
        };
        self.observed_cycle = Some(cycle);
        self.input.supply_pressure_pa = supply_pressure_pa;
        self.pre.step(sensors, passed * CYCLE_S, &parameters, &mut self.input);
    }

    /// The opening for `demand`, from the active algorithm.
    ///
    /// # Errors
    /// [`AlgorithmFault`], latched until [`Program::restart_algorithms`]: the valve is to be shut.
    pub fn control(
        &mut self,
        cycle: u64,
        demand: &Demand,
        algorithm: ActiveAlgorithm,
    ) -> Result<Output, AlgorithmFault> {
        let geometry = &self.pre.geometry;
        let direction = geometry.direction();
        let input = &mut self.input;
        input.set_position_m = geometry.extension_m(demand.position.position_m);
        input.set_velocity_m_per_s = direction * demand.position.velocity_m_per_s;
        input.set_acceleration_m_per_s2 = direction * demand.position.acceleration_m_per_s2;
        input.set_force_n = demand.force.force_n;
        input.set_force_rate_n_per_s = demand.force.rate_n_per_s;
        let wanted = match (algorithm, &mut self.force_chain_slot) {
            (ActiveAlgorithm::ForceChain, Some(force_chain)) => {
                self.user_slot.stepped_cycle = None;
                force_chain.step(cycle, input, &self.values)?
            }
            (_, other) => {
                if let Some(force_chain) = other {
                    force_chain.slot.stepped_cycle = None;
                }
                self.user_slot.step(cycle, input, &self.values[self.user_slot.values.clone()])?
            }
        };
        let parameters =
            post_controller::Parameters::of(&self.values[self.tasks[Task::PostController as usize].clone()]);
        if due(self.post_stepped_cycle, cycle, parameters.every_cycles) != Due::NotYet {
            self.post_stepped_cycle = Some(cycle);
            self.output = self.post.step(wanted, input, &parameters);
            self.input.applied_velocity_m_per_s = self.output.applied_velocity_m_per_s;
        }
        Ok(self.output)
    }

    /// The valve is shut: the next active algorithm is reset first.
    pub(crate) fn shut(&mut self) {
        self.slots().for_each(|slot| slot.stepped_cycle = None);
        self.post_stepped_cycle = None;
        self.output = Output::default();
        self.input.applied_velocity_m_per_s = 0.0;
    }

    /// The rig's time began again, or it is another rig: nothing that was seen holds, the matched offset no more than the rest.
    pub(crate) fn restart(&mut self) {
        self.restart_algorithms();
        self.shut();
        self.slots().for_each(|slot| slot.wanted_m_per_s = 0.0);
        self.pre.restart();
        self.post.restart();
        self.input = AlgorithmInput::default();
        self.observed_cycle = None;
    }

    /// Clears latched faults: the chain begins anew.
    pub(crate) fn restart_algorithms(&mut self) {
        self.slots().for_each(|slot| slot.algorithm.restart());
    }

    fn slots(&mut self) -> impl Iterator<Item = &mut AlgorithmSlot> {
        std::iter::once(&mut self.user_slot)
            .chain(self.force_chain_slot.iter_mut().map(|force_chain| &mut force_chain.slot))
    }

    /// Passes the output of the force chain to its algorithm.
    pub(crate) fn set_chain_output(&mut self, chain: &ForceOutput) {
        if let Some(force_chain) = &mut self.force_chain_slot {
            force_chain.chain_output = (chain.feed_forward, chain.limit_m_per_s);
        }
    }

    /// Whether the program has a `[giving-way]`.
    pub(crate) fn has_force_chain_slot(&self) -> bool {
        self.force_chain_slot.is_some()
    }

    /// Values of a task, in the order of its table.
    pub(crate) fn task(&self, task: Task) -> &[f64] {
        &self.values[self.tasks[task as usize].clone()]
    }

    /// Position of the axis, less the sensor's offset, m, rig coordinates.
    pub(crate) fn position_m(&self) -> f64 {
        self.pre.geometry.position_m(self.input.position_m)
    }

    /// Measured motion of the axis, in rig coordinates.
    pub(crate) fn actual(&self) -> Actual {
        let direction = self.pre.geometry.direction();
        Actual {
            position_m: self.position_m(),
            velocity_m_per_s: direction * self.input.velocity_m_per_s,
            acceleration_m_per_s2: direction * self.input.acceleration_m_per_s2,
        }
    }

    /// Input of the algorithms, in the axis's own extension.
    pub fn algorithm_input(&self) -> &AlgorithmInput {
        &self.input
    }

    /// From rig coordinates to the rod's extension; its offset is the matched one.
    pub fn geometry(&self) -> &Geometry {
        &self.pre.geometry
    }

    /// Sets the offset of the position sensor, m.
    pub(crate) fn set_offset(&mut self, offset_m: f64) {
        self.pre.set_offset(offset_m);
    }

    /// The velocity that the algorithm wants, m/s, along the axis's extension.
    pub(crate) fn wanted_m_per_s(&self, algorithm: ActiveAlgorithm) -> f64 {
        match (algorithm, &self.force_chain_slot) {
            (ActiveAlgorithm::ForceChain, Some(force_chain)) => force_chain.slot.wanted_m_per_s,
            _ => self.user_slot.wanted_m_per_s,
        }
    }

    /// What the algorithm of `[algorithm]` controls; that of `[giving-way]` always controls a force.
    pub fn controls(&self) -> Quantity {
        self.user_slot.controls
    }

    /// All variables, in the order of their values.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Current values of the variables, each in its unit, in the order of [`Program::variables`].
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Index of the variable of this full name; `None` where the program has none.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|variable| variable.name == name)
    }

    /// Changes the variable at `place`; acts from the next cycle on.
    ///
    /// # Errors
    /// [`OutOfRange`] when it does not allow the value; it keeps its own. What is read at the start only is set all the same:
    /// who changes it while running asks [`Parameter::check_change`] before.
    ///
    /// # Panics
    /// When `place` is none of [`Program::variables`].
    pub fn set(&mut self, place: usize, value: f64) -> Result<(), OutOfRange> {
        self.values[place] = self.variables[place].parameter.check(value)?;
        Ok(())
    }
}

impl AlgorithmSlot {
    /// The wanted velocity, with the `values` of this slot.
    fn step(
        &mut self,
        cycle: u64,
        input: &mut AlgorithmInput,
        values: &[f64],
    ) -> Result<f64, AlgorithmFault> {
        let (every, parameters) = values.split_at(1);
        match due(self.stepped_cycle, cycle, every[0]) {
            Due::NotYet => return Ok(self.wanted_m_per_s),
            Due::After(passed) => input.period_s = passed * CYCLE_S,
            Due::Anew => {
                input.period_s = every[0] * CYCLE_S;
                self.algorithm.reset(input, parameters)?;
            }
        }
        self.stepped_cycle = Some(cycle);
        self.wanted_m_per_s = 0.0;
        self.wanted_m_per_s = self.algorithm.step(input, parameters)?;
        Ok(self.wanted_m_per_s)
    }
}

impl ForceChainSlot {
    /// The wanted velocity: the chain sets whether the rod moves, and the lower of its limit and the user's applies.
    fn step(
        &mut self,
        cycle: u64,
        input: &mut AlgorithmInput,
        values: &[f64],
    ) -> Result<f64, AlgorithmFault> {
        let (moves, limit_m_per_s) = self.chain_output;
        self.effective.copy_from_slice(&values[self.slot.values.clone()]);
        self.effective[self.moving_index] = f64::from(u8::from(moves));
        let limit = &mut self.effective[self.limit_index];
        *limit = limit.min(limit_m_per_s.unwrap_or(f64::INFINITY));
        self.slot.step(cycle, input, &self.effective)
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
