//! What an axis does in each phase of the main chain: positioning, pressing, or nothing.
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

use super::by_hand::ByHand;
use crate::chains::force::{ForceAsked, ForceChain, ForceInputs};
use crate::chains::main::{MainConfig, MainOutput, Phase};
use crate::chains::matching::{MatchingChain, MatchingInputs};
use crate::chains::settled::ControlError;
use crate::chains::{Fault, Partner};
use crate::experiment::{ByHandLimits, Prepare};
use crate::program::{Demand, Hand, Program, Task};
use crate::set_point::{ForceSetPoint, ForceSource, Motion, SetPoint, SmoothWay};
use algorithms::algorithm::Ready;
use protocol::frames::{ForceChainState, HandSetPoint, MainChainState, MatchingChainState, RigStatus};

#[derive(Clone, Debug)]
pub enum Plan {
    Shut,
    Position {
        motion: Motion,
        /// What positions given by hand keep to; `None`: none are followed.
        by_hand: Option<ByHandLimits>,
    },
    Force(ForcePlan),
}

#[derive(Clone, Debug)]
pub struct ForcePlan {
    /// Forces of the experiment, from the initial one on.
    pub source: ForceSource,
    /// How long the ramp to the initial force takes, s.
    pub initial_ramp_s: f64,
    pub prepare: Vec<Prepare>,
    /// It gives way to a hand during the experiment, instead of pressing.
    pub manual: bool,
    /// What forces given by hand keep to; `None`: none are followed.
    pub by_hand: Option<ByHandLimits>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) demand: Demand,
    pub(super) hand: Hand,
}

pub(super) struct Seen<'a> {
    pub(super) cycle: u64,
    pub(super) rig: Option<&'a RigStatus>,
    pub(super) partner: &'a Partner,
    pub(super) still: bool,
    pub(super) hand: Option<HandSetPoint>,
}

pub(super) enum Work {
    Shut,
    Position { motion: Motion, start_m: f64, by_hand: Option<ByHand> },
    Force(Box<Pressing>),
}

pub(super) struct Pressing {
    plan: ForcePlan,
    by_hand: Option<ByHand>,
    force: ForceChain,
    matching: MatchingChain,
    step: usize,
    fault: Option<Fault>,
}

impl Work {
    pub(super) fn new(plan: Plan, main: &MainConfig) -> Self {
        match plan {
            Plan::Shut => Self::Shut,
            Plan::Position { motion, by_hand } => {
                let start_m = main.start_m.unwrap_or(motion.start_m());
                Self::Position { motion, start_m, by_hand: by_hand.map(ByHand::new) }
            }
            Plan::Force(plan) => Self::Force(Box::new(Pressing {
                by_hand: plan.by_hand.map(ByHand::new),
                plan,
                force: ForceChain::default(),
                matching: MatchingChain::default(),
                step: 0,
                fault: None,
            })),
        }
    }

    /// What is asked in this cycle; `None` shuts the valve.
    pub(super) fn ask(
        &mut self,
        output: &MainOutput,
        seen: &Seen<'_>,
        program: &mut Program,
    ) -> Option<Asked> {
        match self {
            Self::Shut => None,
            Self::Position { motion, start_m, by_hand } => {
                if let Some(by_hand) = by_hand {
                    by_hand.hear(output.phase, seen.hand.map(|hand| hand.position_m));
                }
                let position = match output.phase {
                    Phase::Shut => return None,
                    Phase::Approach { elapsed_s, from_m, duration_s } => {
                        SmoothWay::new(from_m, *start_m, duration_s).at(elapsed_s).into()
                    }
                    Phase::Prepare | Phase::RampForce { .. } | Phase::HoldStart => {
                        SetPoint::at_rest(*start_m)
                    }
                    Phase::Experiment { elapsed_s } => {
                        let planned = motion.at(elapsed_s);
                        by_hand.as_mut().map_or(planned, |hand| hand.at(elapsed_s, planned.into()).into())
                    }
                    Phase::HoldEnd => {
                        let led_to_m = by_hand.as_ref().and_then(ByHand::end);
                        SetPoint::at_rest(led_to_m.unwrap_or(motion.end_m()))
                    }
                };
                let demand = Demand { position, force: ForceSetPoint::at_rest(0.0) };
                Some(Asked { demand, hand: Hand::User })
            }
            Self::Force(pressing) => pressing.ask(output, seen, program),
        }
    }

    pub(super) fn error(&self, demand: &Demand, ready: &Ready) -> ControlError {
        match self {
            Self::Shut => ControlError::None,
            // Both in the axis's extension, where only the difference counts.
            Self::Position { .. } => {
                ControlError::Position { error_m: ready.set_position_m - ready.position_m }
            }
            Self::Force(_) => ControlError::Force {
                error_n: demand.force.force_n - ready.force_n,
                set_force_n: demand.force.force_n,
            },
        }
    }

    pub(super) fn is_position(&self) -> bool {
        matches!(self, Self::Position { .. })
    }

    pub(super) fn prepared(&self) -> bool {
        match self {
            Self::Force(pressing) => pressing.step >= pressing.plan.prepare.len(),
            _ => true,
        }
    }

    pub(super) fn fault(&mut self) -> Option<Fault> {
        match self {
            Self::Force(pressing) => pressing.fault.take(),
            _ => None,
        }
    }

    pub(super) fn force_chain(&self, main: MainChainState) -> ForceChainState {
        match self {
            Self::Force(pressing) => pressing.force.entered.state,
            _ if main == MainChainState::Done => ForceChainState::Done,
            _ => ForceChainState::Idle,
        }
    }

    pub(super) fn matching_chain(&self) -> MatchingChainState {
        match self {
            Self::Force(pressing) => pressing.matching.entered.state,
            _ => MatchingChainState::Idle,
        }
    }

    pub(super) fn restart(&mut self) {
        if let Self::Force(pressing) = self {
            pressing.force.restart(0);
            pressing.matching.restart(0);
            pressing.plan.source.reset();
            (pressing.step, pressing.fault) = (0, None);
        }
    }
}

impl Pressing {
    fn ask(&mut self, output: &MainOutput, seen: &Seen<'_>, program: &mut Program) -> Option<Asked> {
        let linked = seen.rig.is_some_and(|rig| rig.linked);
        if let Some(by_hand) = &mut self.by_hand {
            by_hand.hear(output.phase, seen.hand.map(|hand| hand.force_n));
        }
        if matches!(output.phase, Phase::Approach { .. } | Phase::Shut) {
            self.step = 0;
            self.plan.source.reset();
        }
        let asked = self.force_asked(output.phase, linked);
        self.fault = self.fault.or(self.not_linked(output.state, linked));
        let matching = asked != ForceAsked::Idle && self.preparing(output.phase) == Some(Prepare::Match);
        self.advance_matching(matching, linked, seen, program);
        let ready = *program.ready();
        let chain = self.force.advance(
            &ForceInputs {
                cycle: seen.cycle,
                asked,
                force_n: ready.force_n,
                velocity_m_per_s: ready.velocity_m_per_s,
            },
            program.task(Task::ForceChain),
        );
        self.fault = self.fault.or(chain.fault);
        let relieving = self.preparing(output.phase) == Some(Prepare::Relieve);
        if relieving && chain.relieved {
            self.step += 1;
        }
        match asked {
            ForceAsked::Idle => None,
            ForceAsked::Relieve | ForceAsked::Manual => {
                program.give_way(&chain);
                let force = ForceSetPoint::at_rest(chain.set_force_n.unwrap_or(0.0));
                Some(Asked { demand: self.demand(force, program), hand: Hand::ForceChain })
            }
            ForceAsked::InitialRamp | ForceAsked::LoadProfile | ForceAsked::Done => {
                let force = self.set_point(output.phase, program);
                Some(Asked { demand: self.demand(force, program), hand: Hand::User })
            }
        }
    }

    fn force_asked(&self, phase: Phase, linked: bool) -> ForceAsked {
        let by_hand = self.plan.manual && matches!(phase, Phase::Experiment { .. } | Phase::HoldEnd);
        match phase {
            Phase::Shut => ForceAsked::Idle,
            _ if by_hand => ForceAsked::Manual,
            _ if !linked => ForceAsked::Idle,
            Phase::Approach { .. } => ForceAsked::Manual,
            Phase::Prepare => ForceAsked::Relieve,
            // With no force to hold, before and after a manual mode, it gives way too.
            _ if self.plan.manual => ForceAsked::Manual,
            Phase::RampForce { .. } | Phase::HoldStart => ForceAsked::InitialRamp,
            Phase::Experiment { .. } => ForceAsked::LoadProfile,
            Phase::HoldEnd => ForceAsked::Done,
        }
    }

    fn not_linked(&self, state: MainChainState, linked: bool) -> Option<Fault> {
        use MainChainState::{Experiment, FinalSettling, InitialForce, Preparing, Settling};
        let needed = match state {
            Preparing => self.step < self.plan.prepare.len(),
            InitialForce | Settling | Experiment | FinalSettling => true,
            _ => false,
        };
        (needed && !self.plan.manual && !linked).then_some(Fault::NotLinked)
    }

    fn preparing(&self, phase: Phase) -> Option<Prepare> {
        self.plan.prepare.get(self.step).copied().filter(|_| phase == Phase::Prepare)
    }

    fn advance_matching(&mut self, asked: bool, linked: bool, seen: &Seen<'_>, program: &mut Program) {
        let offset_m = program.geometry().offset_m;
        let inputs = MatchingInputs {
            cycle: seen.cycle,
            asked,
            linked,
            still: seen.still,
            position_m: program.position_m() + offset_m,
            partner: *seen.partner,
        };
        let output = self.matching.advance(&inputs, program.task(Task::MatchingChain));
        self.fault = self.fault.or(output.fault);
        if asked && output.matched {
            program.set_offset(output.offset_m);
            self.step += 1;
        }
    }

    fn set_point(&mut self, phase: Phase, program: &Program) -> ForceSetPoint {
        let initial_n = self.plan.source.profile.initial_force_n();
        match phase {
            Phase::RampForce { elapsed_s } => {
                SmoothWay::new(0.0, initial_n, self.plan.initial_ramp_s).at(elapsed_s).into()
            }
            Phase::Experiment { elapsed_s } => {
                let planned = self.plan.source.at(elapsed_s, &program.actual());
                self.by_hand.as_mut().map_or(planned, |hand| hand.at(elapsed_s, planned.into()).into())
            }
            Phase::HoldEnd => {
                let led_to_n = self.by_hand.as_ref().and_then(ByHand::end);
                led_to_n.map_or_else(|| self.plan.source.end(), ForceSetPoint::at_rest)
            }
            _ => ForceSetPoint::at_rest(initial_n),
        }
    }

    fn demand(&self, force: ForceSetPoint, program: &Program) -> Demand {
        Demand { position: SetPoint::at_rest(program.position_m()), force }
    }
}
