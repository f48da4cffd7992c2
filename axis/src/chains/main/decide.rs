//! Which edge of the main chain is to be gone: pure functions of state and inputs.

use super::config::PARTNER_TIMEOUT_S;
use super::{
    Edge, GRACE_CYCLES, MainCause, MainChain, MainConfig, MainInputs, RestartConditions, Start, State, Wait,
};
use crate::chains::sync::{Relation, relation};
use crate::chains::{AfterStop, Fault, cycles};
use protocol::frames::{ChainStatus, EmergencyStopChainState, MainChainState};

impl MainChain {
    pub(super) fn decide(&self, inputs: &MainInputs) -> Option<Edge> {
        match &self.state {
            State::Fault { restart, .. } => self.decide_restart(restart, inputs),
            _ if inputs.fault.is_some() => inputs.fault.map(fault),
            State::Aborted { restart } => self.decide_restart(restart, inputs),
            _ if inputs.emergency_stop != EmergencyStopChainState::Ready => {
                Some((MainChainState::Aborted, MainCause::EmergencyStop))
            }
            _ if inputs.console.abort => Some((MainChainState::Aborted, MainCause::Console)),
            State::WaitingForRig { since } => self.decide_waiting_for_rig((*since)?, inputs),
            State::Done => self.decide_partner_ended(inputs),
            State::Running { wait } => self
                .decide_partner_gone(inputs)
                .or_else(|| self.decide_ready(inputs))
                .or_else(|| self.decide_late(wait, inputs)),
        }
    }

    fn decide_waiting_for_rig(&self, since: u64, inputs: &MainInputs) -> Option<Edge> {
        let go = Some((MainChainState::InitialPositioning, MainCause::Ready));
        inputs.measurement?;
        if !self.config.partner_needed {
            return go;
        }
        let status = inputs.partner.fresh(inputs.cycle);
        let same = |status: &&ChainStatus| [0, self.config.experiment].contains(&status.experiment);
        match status.filter(same).map(|status| (status.main_chain, status.ok, status.repetition)) {
            Some((MainChainState::WaitingForRig, true, _) | (MainChainState::InitialPositioning, _, 0)) => {
                return go;
            }
            Some((ended, ..)) if passed(since, GRACE_CYCLES, inputs.cycle) => {
                if let Some(edge) = partner_ended(ended) {
                    return Some(edge);
                }
            }
            _ => {}
        }
        let late = passed(since, cycles(PARTNER_TIMEOUT_S), inputs.cycle);
        late.then(|| match status {
            Some(other) if !same(&other) => fault(Fault::PartnerOtherExperiment),
            Some(status) if status.main_chain == MainChainState::WaitingForRig => fault(Fault::PartnerNotOk),
            _ => fault(Fault::PartnerMissing),
        })
    }

    fn decide_partner_gone(&self, inputs: &MainInputs) -> Option<Edge> {
        if !self.config.partner_needed {
            return None;
        }
        let restarted = self.entered.state == MainChainState::InitialPositioning;
        let in_grace = restarted && !passed(self.entered.cycle, GRACE_CYCLES, inputs.cycle);
        match self.relation(inputs) {
            Relation::Silent => Some(fault(Fault::PartnerLost)),
            Relation::Restarted => Some(fault(Fault::PartnerRestarted)),
            Relation::Aborted | Relation::Fault if !in_grace => self.decide_partner_ended(inputs),
            _ => None,
        }
    }

    fn decide_partner_ended(&self, inputs: &MainInputs) -> Option<Edge> {
        let status = inputs.partner.fresh(inputs.cycle).filter(|_| self.config.partner_needed)?;
        partner_ended(status.main_chain)
    }

    fn decide_ready(&self, inputs: &MainInputs) -> Option<Edge> {
        use MainChainState as S;
        let partner_ok = !self.config.partner_needed || self.relation(inputs).ok();
        if !(self.ok(inputs) && partner_ok) {
            return None;
        }
        let again = self.config.repetitions.is_none_or(|most| self.repetition.saturating_add(1) < most);
        let next = match self.entered.state {
            S::InitialPositioning => S::Preparing,
            S::Preparing => S::InitialForce,
            S::InitialForce => S::Settling,
            S::Settling => S::Experiment,
            S::Experiment => S::FinalSettling,
            S::FinalSettling if again => return Some((S::InitialPositioning, MainCause::NextRepetition)),
            S::FinalSettling => S::Done,
            S::WaitingForRig | S::Done | S::Aborted | S::Fault => return None,
        };
        Some((next, MainCause::Ready))
    }

    fn decide_late(&self, wait: &Wait, inputs: &MainInputs) -> Option<Edge> {
        let timeout = cycles(self.config.settling_timeout_s);
        let [length, longest] = self.expected_cycles();
        if let Some(ok_since) = wait.ok_since {
            let from = ok_since.max(self.entered.cycle + longest);
            // The partner's own time-out, which names the cause, comes first.
            return passed(from, timeout + GRACE_CYCLES, inputs.cycle).then_some(fault(Fault::PartnerNotOk));
        }
        let from = wait.for_console.unwrap_or(0).max(self.entered.cycle + length);
        // Settled and waiting for the console is not late.
        let late = passed(from, timeout, inputs.cycle) && !self.held(inputs);
        let cause = match self.entered.state {
            MainChainState::Settling | MainChainState::FinalSettling => Fault::SettlingTimeout,
            _ => Fault::PreparationTimeout,
        };
        late.then_some(fault(cause))
    }

    fn decide_restart(&self, restart: &RestartConditions, inputs: &MainInputs) -> Option<Edge> {
        let ready = |state| state == EmergencyStopChainState::Ready;
        if self.config.after_emergency_stop == AfterStop::End || !ready(inputs.emergency_stop) {
            return None;
        }
        inputs.measurement.filter(|_| inputs.fault.is_none())?;
        if self.config.partner_needed {
            inputs.partner.fresh(inputs.cycle).filter(|status| {
                use MainChainState::{Aborted, Fault, InitialPositioning};
                let goes_along = matches!(status.main_chain, Aborted | Fault | InitialPositioning);
                goes_along && ready(status.emergency_stop_chain)
            })?;
        }
        let recovered = restart.stopped && !restart.by_person;
        let cause = match inputs.console.start {
            true if !recovered => MainCause::Started,
            _ if recovered => MainCause::Recovered,
            _ => return None,
        };
        Some((MainChainState::InitialPositioning, cause))
    }

    pub(super) fn relation(&self, inputs: &MainInputs) -> Relation {
        relation(self.entered.state, self.repetition, &inputs.partner, inputs.cycle)
    }

    /// Whether this axis is done with the state, whoever must start what follows.
    pub(super) fn held(&self, inputs: &MainInputs) -> bool {
        use MainChainState as S;
        let (config, since) = (&self.config, self.entered.cycle);
        let over = |length_s| passed(since, cycles(length_s), inputs.cycle + 1);
        match self.entered.state {
            S::WaitingForRig => inputs.measurement.is_some(),
            S::InitialPositioning => over(self.approach_s),
            S::Preparing => inputs.prepared || !config.prepares,
            S::InitialForce => over(config.lengths.initial_force_s),
            S::Settling | S::FinalSettling => {
                self.settling.settled_for(config.settling_s, since, inputs.cycle)
            }
            S::Experiment => over(config.lengths.experiment_s),
            S::Done => true,
            S::Aborted | S::Fault => false,
        }
    }

    pub(super) fn ok(&self, inputs: &MainInputs) -> bool {
        let waits = self.entered.state == MainChainState::Settling && self.config.start == Start::OnStart;
        self.held(inputs) && (self.started || !waits)
    }

    /// How long the state is meant to last, for this axis and for the slower of both.
    fn expected_cycles(&self) -> [u64; 2] {
        let MainConfig { lengths, longest_lengths: longest, settling_s, approach_longest_s, .. } =
            &self.config;
        use MainChainState as S;
        let seconds = match self.entered.state {
            S::InitialPositioning => [self.approach_s, *approach_longest_s],
            S::Preparing => [lengths.prepare_s, longest.prepare_s],
            S::InitialForce => [lengths.initial_force_s, longest.initial_force_s],
            S::Settling | S::FinalSettling => [*settling_s; 2],
            S::Experiment => [lengths.experiment_s, longest.experiment_s],
            _ => [0.0; 2],
        };
        [cycles(seconds[0]), cycles(seconds[0].max(seconds[1]))]
    }
}

fn passed(since: u64, length: u64, cycle: u64) -> bool {
    cycle.saturating_sub(since) > length
}

fn fault(fault: Fault) -> Edge {
    (MainChainState::Fault, MainCause::Fault(fault))
}

/// The edge to take when the partner, in `state`, has ended its run.
fn partner_ended(state: MainChainState) -> Option<Edge> {
    let cause = match state {
        MainChainState::Aborted => MainCause::PartnerAborted,
        MainChainState::Fault => MainCause::PartnerFault,
        _ => return None,
    };
    Some((MainChainState::Aborted, cause))
}
