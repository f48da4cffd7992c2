//! Request of an axis in each phase of the main chain: a position, a force, or a shut valve.
//!
//! ```text
//!   phase               position              force
//!   approach            sinoid to the start   linked: give way (force chain), so that the drive can move; else shut
//!   prepare             hold the start        relieve, match, in the order of the experiment
//!   ramp to the force   hold the start        sinoid from 0 to the initial force
//!   hold the start      hold the start        hold the initial force
//!   experiment          set-points            set-points, or give way to a hand; both by hand too, if that is allowed
//!   hold the end        hold the end          hold the last force, or give way
//! ```
//!
//! An axis under force control holds its valve shut while the rods are not linked, save where it gives way to a hand: with
//! nothing to press against it would run into its end. From its first step of preparing, or
//! the ramp to the force, until it is done that is a fault, also with a force of zero: nothing was pressed, and nobody shall
//! take it for an experiment.

use super::by_hand::OperatorSetPoint;
use crate::chains::force::{ForceChain, ForceInputs, ForceRequest};
use crate::chains::main::{MainConfig, MainOutput, Phase};
use crate::chains::matching::{MatchingChain, MatchingInputs};
use crate::chains::settled::ControlError;
use crate::chains::{Fault, Partner};
use crate::experiment::{OperatorLimits, Prepare};
use crate::program::{ActiveAlgorithm, Demand, Program, Task};
use crate::set_point::{ForceSetPoint, ForceSource, Motion, SetPoint, SmoothTransition};
use algorithms::algorithm::AlgorithmInput;
use protocol::frames::{ForceChainState, HandSetPoint, MainChainState, MatchingChainState, RigStatus};

/// What an axis does in the experiment.
#[derive(Clone, Debug)]
pub(crate) enum Plan {
    Shut,
    Position {
        motion: Motion,
        /// Limits of positions given by hand; `None`: none are followed.
        by_hand: Option<OperatorLimits>,
    },
    Force(ForcePlan),
}

/// Forces of an axis in the experiment, and the way to the first of them.
#[derive(Clone, Debug)]
pub(crate) struct ForcePlan {
    /// Forces of the experiment, from the initial one on.
    pub(crate) source: ForceSource,
    /// How long the ramp to the initial force takes, s.
    pub(crate) initial_ramp_s: f64,
    /// Steps before the ramp, in this order; each needs linked rods.
    pub(crate) prepare: Vec<Prepare>,
    /// It gives way to a hand during the experiment, instead of pressing.
    pub(crate) manual: bool,
    /// Limits of forces given by hand; `None`: none are followed.
    pub(crate) by_hand: Option<OperatorLimits>,
}

/// Set-points of a cycle, and the algorithm that shall follow them.
#[derive(Clone, Copy, Debug)]
pub(super) struct ControlRequest {
    pub(super) demand: Demand,
    pub(super) algorithm: ActiveAlgorithm,
}

/// Inputs of the generator in a cycle.
pub(super) struct CycleInputs<'a> {
    pub(super) cycle: u64,
    pub(super) rig: Option<&'a RigStatus>,
    pub(super) partner: &'a Partner,
    pub(super) still: bool,
    pub(super) hand_set_point: Option<HandSetPoint>,
}

/// Derives the request of each cycle from the phase of the main chain.
pub(super) enum DemandGenerator {
    Shut,
    Position { motion: Motion, start_m: f64, by_hand: Option<OperatorSetPoint> },
    Force(Box<ForceControl>),
}

/// Force control of an axis: its chains, and how far it has prepared.
pub(super) struct ForceControl {
    plan: ForcePlan,
    by_hand: Option<OperatorSetPoint>,
    force_chain: ForceChain,
    matching_chain: MatchingChain,
    /// Index in [`ForcePlan::prepare`].
    prepare_step: usize,
    fault: Option<Fault>,
}

impl DemandGenerator {
    pub(super) fn new(plan: Plan, main: &MainConfig) -> Self {
        match plan {
            Plan::Shut => Self::Shut,
            Plan::Position { motion, by_hand } => {
                let start_m = main.start_m.unwrap_or(motion.start_m());
                Self::Position { motion, start_m, by_hand: by_hand.map(OperatorSetPoint::new) }
            }
            Plan::Force(plan) => Self::Force(Box::new(ForceControl {
                by_hand: plan.by_hand.map(OperatorSetPoint::new),
                plan,
                force_chain: ForceChain::default(),
                matching_chain: MatchingChain::default(),
                prepare_step: 0,
                fault: None,
            })),
        }
    }

    /// The request of this cycle; `None` shuts the valve.
    pub(super) fn request(
        &mut self,
        output: &MainOutput,
        inputs: &CycleInputs<'_>,
        program: &mut Program,
    ) -> Option<ControlRequest> {
        match self {
            Self::Shut => None,
            Self::Position { motion, start_m, by_hand } => {
                if let Some(by_hand) = by_hand {
                    by_hand.set_target(output.phase, inputs.hand_set_point.map(|hand| hand.position_m));
                }
                let position = match output.phase {
                    Phase::Shut => return None,
                    Phase::Approach { elapsed_s, from_m, duration_s } => {
                        SmoothTransition::new(from_m, *start_m, duration_s).at(elapsed_s).into()
                    }
                    Phase::Prepare | Phase::RampForce { .. } | Phase::HoldStart => {
                        SetPoint::at_rest(*start_m)
                    }
                    Phase::Experiment { elapsed_s } => {
                        let planned = motion.at(elapsed_s);
                        by_hand.as_mut().map_or(planned, |hand| hand.at(elapsed_s, planned.into()).into())
                    }
                    Phase::HoldEnd => {
                        let operator_m = by_hand.as_ref().and_then(OperatorSetPoint::end);
                        SetPoint::at_rest(operator_m.unwrap_or(motion.end_m()))
                    }
                };
                let demand = Demand { position, force: ForceSetPoint::at_rest(0.0) };
                Some(ControlRequest { demand, algorithm: ActiveAlgorithm::User })
            }
            Self::Force(control) => control.request(output, inputs, program),
        }
    }

    pub(super) fn error(&self, demand: &Demand, input: &AlgorithmInput) -> ControlError {
        match self {
            Self::Shut => ControlError::None,
            // Both in the axis's extension, where only the difference counts.
            Self::Position { .. } => {
                ControlError::Position { error_m: input.set_position_m - input.position_m }
            }
            Self::Force(_) => ControlError::Force {
                error_n: demand.force.force_n - input.force_n,
                set_force_n: demand.force.force_n,
            },
        }
    }

    pub(super) fn is_position(&self) -> bool {
        matches!(self, Self::Position { .. })
    }

    pub(super) fn prepared(&self) -> bool {
        match self {
            Self::Force(control) => control.prepare_step >= control.plan.prepare.len(),
            _ => true,
        }
    }

    pub(super) fn fault(&mut self) -> Option<Fault> {
        match self {
            Self::Force(control) => control.fault.take(),
            _ => None,
        }
    }

    pub(super) fn force_chain(&self, main: MainChainState) -> ForceChainState {
        match self {
            Self::Force(control) => control.force_chain.entered.state,
            _ if main == MainChainState::Done => ForceChainState::Done,
            _ => ForceChainState::Idle,
        }
    }

    pub(super) fn matching_chain(&self) -> MatchingChainState {
        match self {
            Self::Force(control) => control.matching_chain.entered.state,
            _ => MatchingChainState::Idle,
        }
    }

    pub(super) fn restart(&mut self) {
        if let Self::Force(control) = self {
            control.force_chain.restart(0);
            control.matching_chain.restart(0);
            control.plan.source.reset();
            (control.prepare_step, control.fault) = (0, None);
        }
    }
}

impl ForceControl {
    fn request(
        &mut self,
        output: &MainOutput,
        inputs: &CycleInputs<'_>,
        program: &mut Program,
    ) -> Option<ControlRequest> {
        let linked = inputs.rig.is_some_and(|rig| rig.linked);
        if let Some(by_hand) = &mut self.by_hand {
            by_hand.set_target(output.phase, inputs.hand_set_point.map(|hand| hand.force_n));
        }
        if matches!(output.phase, Phase::Approach { .. } | Phase::Shut) {
            self.prepare_step = 0;
            self.plan.source.reset();
        }
        let request = self.force_request(output.phase, linked);
        self.fault = self.fault.or(self.not_linked(output.state, linked));
        let matching = request != ForceRequest::Idle && self.preparing(output.phase) == Some(Prepare::Match);
        self.advance_matching(matching, linked, inputs, program);
        let measured = *program.algorithm_input();
        let chain = self.force_chain.advance(
            &ForceInputs {
                cycle: inputs.cycle,
                request,
                force_n: measured.force_n,
                velocity_m_per_s: measured.velocity_m_per_s,
            },
            program.task(Task::ForceChain),
        );
        self.fault = self.fault.or(chain.fault);
        let relieving = self.preparing(output.phase) == Some(Prepare::Relieve);
        if relieving && chain.relieved {
            self.prepare_step += 1;
        }
        match request {
            ForceRequest::Idle => None,
            ForceRequest::Relieve | ForceRequest::Manual => {
                program.set_chain_output(&chain);
                let force = ForceSetPoint::at_rest(chain.set_force_n.unwrap_or(0.0));
                Some(ControlRequest {
                    demand: self.demand(force, program),
                    algorithm: ActiveAlgorithm::ForceChain,
                })
            }
            ForceRequest::InitialRamp | ForceRequest::LoadProfile | ForceRequest::Done => {
                let force = self.set_point(output.phase, program);
                Some(ControlRequest { demand: self.demand(force, program), algorithm: ActiveAlgorithm::User })
            }
        }
    }

    fn force_request(&self, phase: Phase, linked: bool) -> ForceRequest {
        let by_hand = self.plan.manual && matches!(phase, Phase::Experiment { .. } | Phase::HoldEnd);
        match phase {
            Phase::Shut => ForceRequest::Idle,
            _ if by_hand => ForceRequest::Manual,
            _ if !linked => ForceRequest::Idle,
            Phase::Approach { .. } => ForceRequest::Manual,
            Phase::Prepare => ForceRequest::Relieve,
            // With no force to hold, before and after a manual mode, it gives way too.
            _ if self.plan.manual => ForceRequest::Manual,
            Phase::RampForce { .. } | Phase::HoldStart => ForceRequest::InitialRamp,
            Phase::Experiment { .. } => ForceRequest::LoadProfile,
            Phase::HoldEnd => ForceRequest::Done,
        }
    }

    fn not_linked(&self, state: MainChainState, linked: bool) -> Option<Fault> {
        use MainChainState::{Experiment, FinalSettling, InitialForce, Preparing, Settling};
        let needed = match state {
            Preparing => self.prepare_step < self.plan.prepare.len(),
            InitialForce | Settling | Experiment | FinalSettling => true,
            _ => false,
        };
        (needed && !self.plan.manual && !linked).then_some(Fault::NotLinked)
    }

    fn preparing(&self, phase: Phase) -> Option<Prepare> {
        self.plan.prepare.get(self.prepare_step).copied().filter(|_| phase == Phase::Prepare)
    }

    fn advance_matching(
        &mut self,
        requested: bool,
        linked: bool,
        inputs: &CycleInputs<'_>,
        program: &mut Program,
    ) {
        let offset_m = program.geometry().offset_m;
        let matching_inputs = MatchingInputs {
            cycle: inputs.cycle,
            requested,
            linked,
            still: inputs.still,
            position_m: program.position_m() + offset_m,
            partner: *inputs.partner,
        };
        let output = self.matching_chain.advance(&matching_inputs, program.task(Task::MatchingChain));
        self.fault = self.fault.or(output.fault);
        if requested && output.matched {
            program.set_offset(output.offset_m);
            self.prepare_step += 1;
        }
    }

    fn set_point(&mut self, phase: Phase, program: &Program) -> ForceSetPoint {
        let initial_n = self.plan.source.profile.initial_force_n();
        match phase {
            Phase::RampForce { elapsed_s } => {
                SmoothTransition::new(0.0, initial_n, self.plan.initial_ramp_s).at(elapsed_s).into()
            }
            Phase::Experiment { elapsed_s } => {
                let planned = self.plan.source.at(elapsed_s, &program.actual());
                self.by_hand.as_mut().map_or(planned, |hand| hand.at(elapsed_s, planned.into()).into())
            }
            Phase::HoldEnd => {
                let operator_n = self.by_hand.as_ref().and_then(OperatorSetPoint::end);
                operator_n.map_or_else(|| self.plan.source.end(), ForceSetPoint::at_rest)
            }
            _ => ForceSetPoint::at_rest(initial_n),
        }
    }

    fn demand(&self, force: ForceSetPoint, program: &Program) -> Demand {
        Demand { position: SetPoint::at_rest(program.position_m()), force }
    }
}
