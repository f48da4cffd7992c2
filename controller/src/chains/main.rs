//! Main chain of one axis: from a rig at rest anywhere through the experiment to done. Both axes run the same one.
//!
//! ```text
//!                  sensors             at start            prepared           ramp over            settled, started
//!   WaitingForRig ────────► Initial- ───────────► Preparing ───────► Initial- ─────────► Settling ────────────────┐
//!        ▲                  Positioning                              Force                                        ▼
//!        │ rig restarted        ▲ ▲          repetition + 1                               settled            Experiment
//!        │ (from any)           │ └──────────────────────────────────────────────── FinalSettling ◄───────────────┘
//!       any                     │ recovered, started                       last ───────┤              duration over
//!                               │                                                      ▼
//!   any but ended ─── emergency stop, console, partner ended ──► Aborted             Done
//!   any but fault ─── a named fault ───────────────────────────► Fault
//! ```
//!
//! The conditions are the own ones. A state on the way to done is left when the own condition holds *and* the partner, if it is
//! needed, says OK in the same state or is in a later one. OK says that the own condition holds, so what one axis detects travels
//! by that flag; a start that only one of them heard does too.
//!
//! What ends in a safe state (valve shut), and how fast:
//!
//! | what | where | after |
//! |---|---|---|
//! | emergency stop, console's abort, a fault of the own axis | any | in the cycle that tells |
//! | partner aborted or in fault | between waiting for the rig and done | in the cycle that tells; 100 cycles after a (re)start |
//! | partner silent | initial positioning to final settling | 100 cycles after its last status |
//! | partner began anew | initial positioning to final settling | in the cycle that tells |
//! | own condition not met | preparing, settling, final settling | `settling_timeout_s` beyond the state's own length |
//! | partner not OK though the own condition is met | initial positioning to final settling | the same beyond the longer of both lengths, and 100 cycles |
//! | partner never heard at the start | waiting for the rig | `partner_timeout_s` after the own sensors |
//!
//! From aborted and fault the chain goes on when the emergency stop chain has been through and is ready again, or, when there was
//! no emergency stop, on `RunControl` start; both not with [`AfterStop::End`]. It begins with the initial positioning
//! from where the carriage is, so the set-point does not jump, and repeats the repetition that was cut off, or
//! the partner's if that is a later one.
//!
//! Stillness has its own file: [`settled`](super::settled).

mod config;
#[cfg(test)]
mod tests;

pub use config::{Lengths, MainConfig, PARTNER_TIMEOUT_S, Start, approach_s};

use super::settled::{ControlError, Settled};
use super::sync::{Relation, relation, repetitions_ahead};
use super::{AfterStop, Console, Entered, Fault, PARTNER_LOST_CYCLES, Partner, cycles, elapsed_s};
use protocol::frames::{ChainStatus, EmergencyStopChainState, MainChainState};
use std::fmt;

/// Speed of the initial positioning on average, m/s.
const APPROACH_M_PER_S: f64 = 0.1;
/// Shortest initial positioning, s.
const APPROACH_SHORTEST_S: f64 = 0.5;
/// For so long after a (re)start a partner that is still aborted or in fault is waited for: ten periods of its status.
const GRACE_CYCLES: u64 = PARTNER_LOST_CYCLES;

/// Own sensors in this cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnAxis {
    /// Filtered position, rig coordinates, m.
    pub position_m: f64,
    /// What keeps the axis from its set-point.
    pub error: ControlError,
}

/// What the chain is told each cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct MainInputs {
    /// The rig's cycle.
    pub cycle: u64,
    /// Own sensors; `None` before the first.
    pub own: Option<OwnAxis>,
    /// The steps of preparing are done.
    pub prepared: bool,
    /// The partner.
    pub partner: Partner,
    /// State of the own emergency stop chain in this cycle.
    pub emergency_stop: EmergencyStopChainState,
    /// What the console said since the last cycle.
    pub console: Console,
    /// A fault of the own axis: sensors, limits, algorithm, force or matching chain.
    pub fault: Option<Fault>,
}

/// What is asked of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// Hold the valve shut.
    Shut,
    /// Move from `from_m`, where the carriage was, to the start along a Bestehorn sinoid. An axis that is not
    /// positioned holds still; its `duration_s` is 0.
    Approach {
        /// Time since the way began, s; may go on beyond its duration.
        elapsed_s: f64,
        /// Beginning of the way, m.
        from_m: f64,
        /// Duration of the way, s.
        duration_s: f64,
    },
    /// Take the steps before the initial force.
    Prepare {
        /// Time since the first of them, s.
        elapsed_s: f64,
    },
    /// Ramp to the initial force; the position stays at the start.
    RampForce {
        /// Time since the ramp began, s; may go on beyond its duration.
        elapsed_s: f64,
    },
    /// Stay at the start with the initial force.
    HoldStart,
    /// Run the experiment.
    Experiment {
        /// Time since it began, s; may go on beyond its duration.
        elapsed_s: f64,
    },
    /// Stay at the end.
    HoldEnd,
}

/// What the chain says each cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainOutput {
    /// The state.
    pub state: MainChainState,
    /// Repetitions before this one; the bus has its low 8 bits.
    pub repetition: u32,
    /// The condition for leaving the state is fulfilled on this side.
    pub ok: bool,
    /// Time in the state, s.
    pub elapsed_s: f64,
    /// What is asked of the axis.
    pub phase: Phase,
    /// The fault, while in fault.
    pub fault: Option<Fault>,
}

/// Why a state was entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MainCause {
    /// The controller began.
    Began,
    /// The rig's time began anew.
    RigRestarted,
    /// Own condition and partner.
    Ready,
    /// The same, with another repetition to go.
    NextRepetition,
    /// The emergency stop was tripped.
    EmergencyStop,
    /// The console ended the run.
    Console,
    /// The partner ended the run.
    PartnerAborted,
    /// The partner has a fault.
    PartnerFault,
    /// A fault of this controller.
    Fault(Fault),
    /// The rig recovered from an emergency stop.
    Recovered,
    /// The console started an aborted run anew.
    Started,
}

impl fmt::Display for MainCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Began => "the controller began",
            Self::RigRestarted => "the rig began anew",
            Self::Ready => "both axes are ready",
            Self::NextRepetition => "another repetition follows",
            Self::EmergencyStop => "the emergency stop is tripped",
            Self::Console => "the console ended the run",
            Self::PartnerAborted => "the other axis's controller ended the run",
            Self::PartnerFault => "the other axis's controller has a fault",
            Self::Fault(fault) => return write!(f, "{fault}"),
            Self::Recovered => "the rig has recovered from the emergency stop",
            Self::Started => "the console started the run anew",
        })
    }
}

/// How long a state has been waited in.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wait {
    since: u64,
    /// Last cycle in which nothing but the console's start was missing.
    for_console: Option<u64>,
    /// First cycle of an OK that has lasted.
    ok_since: Option<u64>,
}

/// What must be known to go on after an end.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ended {
    since: u64,
    /// The emergency stop chain was seen at work.
    stopped: bool,
    /// A person ended the run, so only a person starts it anew.
    by_person: bool,
}

/// State of the chain; each holds what it needs and nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// `since`: the first own sensors.
    WaitingForRig {
        since: Option<u64>,
    },
    InitialPositioning {
        wait: Wait,
        from_m: f64,
        duration_s: f64,
    },
    Preparing {
        wait: Wait,
    },
    InitialForce {
        wait: Wait,
    },
    Settling {
        wait: Wait,
    },
    Experiment {
        wait: Wait,
    },
    FinalSettling {
        wait: Wait,
    },
    Done {
        since: u64,
    },
    Aborted {
        ended: Ended,
    },
    Fault {
        ended: Ended,
        fault: Fault,
    },
}

/// An edge: where to, and why.
type Edge = (MainChainState, MainCause);

/// The chain.
#[derive(Clone, Debug)]
pub struct MainChain {
    config: MainConfig,
    settled: Settled,
    state: State,
    repetition: u32,
    /// The console's start was heard, here or by the partner.
    started: bool,
    entered: Entered<MainChainState, MainCause>,
}

impl MainChain {
    /// A chain that waits for the rig.
    #[must_use]
    pub fn new(config: MainConfig) -> Self {
        let entered = Entered { cycle: 0, state: MainChainState::WaitingForRig, cause: MainCause::Began };
        let settled = Settled::new(config.settled);
        let state = State::WaitingForRig { since: None };
        Self { config, settled, state, repetition: 0, started: false, entered }
    }

    /// Moves on by one edge at most, and says what is asked.
    pub fn advance(&mut self, inputs: &MainInputs) -> MainOutput {
        self.note(inputs);
        if let Some((state, cause)) = self.decide(inputs) {
            self.enter(state, cause, inputs);
        }
        self.output(inputs)
    }

    /// The rig's time begins anew at `cycle`: so does the chain.
    pub fn restart(&mut self, cycle: u64) {
        self.enter_waiting_for_rig(MainCause::RigRestarted, cycle);
    }

    /// The state entered last, when and why.
    #[must_use]
    pub fn entered(&self) -> Entered<MainChainState, MainCause> {
        self.entered
    }

    /// Whether the own axis keeps still.
    #[must_use]
    pub fn still(&self) -> bool {
        self.settled.still()
    }

    /// Keeps what the inputs tell, without a change of state.
    fn note(&mut self, inputs: &MainInputs) {
        let cycle = inputs.cycle;
        if let Some(own) = inputs.own {
            self.settled.take(cycle, own.position_m, own.error);
        }
        let partner_started = self.config.partner_needed && self.relation(inputs).ok();
        let in_settling = matches!(self.state, State::Settling { .. });
        self.started |= in_settling && (inputs.console.start || partner_started);
        let (held, ok) = (self.held(inputs), self.ok(inputs));
        match &mut self.state {
            State::WaitingForRig { since } if inputs.own.is_some() => *since = since.or(Some(cycle)),
            State::Aborted { ended } | State::Fault { ended, .. } => {
                ended.stopped |= inputs.emergency_stop != EmergencyStopChainState::Ready;
                ended.by_person |= inputs.console.abort;
            }
            _ => {}
        }
        if let Some(wait) = self.wait_mut() {
            wait.for_console = if held && !ok { Some(cycle) } else { wait.for_console };
            wait.ok_since = if ok { wait.ok_since.or(Some(cycle)) } else { None };
        }
    }

    /// The edge to go, if any.
    fn decide(&self, inputs: &MainInputs) -> Option<Edge> {
        match &self.state {
            State::Fault { ended, .. } => self.decide_ended(ended, inputs),
            _ if inputs.fault.is_some() => inputs.fault.map(fault),
            State::Aborted { ended } => self.decide_ended(ended, inputs),
            _ if inputs.emergency_stop != EmergencyStopChainState::Ready => {
                Some((MainChainState::Aborted, MainCause::EmergencyStop))
            }
            _ if inputs.console.abort => Some((MainChainState::Aborted, MainCause::Console)),
            State::WaitingForRig { since } => self.decide_waiting_for_rig((*since)?, inputs),
            State::Done { .. } => self.decide_partner_ended(inputs),
            State::InitialPositioning { wait, .. }
            | State::Preparing { wait }
            | State::InitialForce { wait }
            | State::Settling { wait }
            | State::Experiment { wait }
            | State::FinalSettling { wait } => self
                .decide_partner_gone(wait, inputs)
                .or_else(|| self.decide_ready(inputs))
                .or_else(|| self.decide_late(wait, inputs)),
        }
    }

    fn decide_waiting_for_rig(&self, since: u64, inputs: &MainInputs) -> Option<Edge> {
        let go = Some((MainChainState::InitialPositioning, MainCause::Ready));
        inputs.own?;
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
        let late = passed(since, cycles(self.config.partner_timeout_s), inputs.cycle);
        late.then(|| match status {
            Some(other) if !same(&other) => fault(Fault::PartnerOtherExperiment),
            Some(status) if status.main_chain == MainChainState::WaitingForRig => fault(Fault::PartnerNotOk),
            _ => fault(Fault::PartnerMissing),
        })
    }

    /// The partner ended, fell silent or began anew.
    fn decide_partner_gone(&self, wait: &Wait, inputs: &MainInputs) -> Option<Edge> {
        if !self.config.partner_needed {
            return None;
        }
        let restarted = matches!(self.state, State::InitialPositioning { .. });
        let in_grace = restarted && !passed(wait.since, GRACE_CYCLES, inputs.cycle);
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

    /// Both are ready.
    fn decide_ready(&self, inputs: &MainInputs) -> Option<Edge> {
        use MainChainState as S;
        let partner_ok = !self.config.partner_needed || self.relation(inputs).ok();
        if !(self.ok(inputs) && partner_ok) {
            return None;
        }
        let again = self.config.repetitions.is_none_or(|most| self.repetition.saturating_add(1) < most);
        let next = match self.state {
            State::InitialPositioning { .. } => S::Preparing,
            State::Preparing { .. } => S::InitialForce,
            State::InitialForce { .. } => S::Settling,
            State::Settling { .. } => S::Experiment,
            State::Experiment { .. } => S::FinalSettling,
            State::FinalSettling { .. } if again => {
                return Some((S::InitialPositioning, MainCause::NextRepetition));
            }
            State::FinalSettling { .. } => S::Done,
            State::WaitingForRig { .. }
            | State::Done { .. }
            | State::Aborted { .. }
            | State::Fault { .. } => {
                return None;
            }
        };
        Some((next, MainCause::Ready))
    }

    /// A state has been waited in for too long.
    fn decide_late(&self, wait: &Wait, inputs: &MainInputs) -> Option<Edge> {
        let timeout = cycles(self.config.settling_timeout_s);
        let [own, either] = self.expected_cycles();
        if let Some(ok_since) = wait.ok_since {
            let from = ok_since.max(wait.since + either);
            // The partner's own time-out, which names the cause, comes first.
            return passed(from, timeout + GRACE_CYCLES, inputs.cycle).then_some(fault(Fault::PartnerNotOk));
        }
        let from = wait.for_console.unwrap_or(0).max(wait.since + own);
        // Settled and waiting for the console is not late.
        let late = passed(from, timeout, inputs.cycle) && !self.held(inputs);
        let cause = match self.state {
            State::Settling { .. } | State::FinalSettling { .. } => Fault::SettlingTimeout,
            _ => Fault::PreparationTimeout,
        };
        late.then_some(fault(cause))
    }

    /// The way back from aborted and fault.
    fn decide_ended(&self, ended: &Ended, inputs: &MainInputs) -> Option<Edge> {
        let ready = |state| state == EmergencyStopChainState::Ready;
        if self.config.after_emergency_stop == AfterStop::End || !ready(inputs.emergency_stop) {
            return None;
        }
        inputs.own.filter(|_| inputs.fault.is_none())?;
        if self.config.partner_needed {
            inputs.partner.fresh(inputs.cycle).filter(|status| {
                use MainChainState::{Aborted, Fault, InitialPositioning};
                let goes_along = matches!(status.main_chain, Aborted | Fault | InitialPositioning);
                goes_along && ready(status.emergency_stop_chain)
            })?;
        }
        let recovered = ended.stopped && !ended.by_person;
        let cause = match inputs.console.start {
            true if !recovered => MainCause::Started,
            _ if recovered => MainCause::Recovered,
            _ => return None,
        };
        Some((MainChainState::InitialPositioning, cause))
    }

    fn relation(&self, inputs: &MainInputs) -> Relation {
        relation(self.name(), self.repetition, &inputs.partner, inputs.cycle)
    }

    /// Whether the own axis is done with the state, whoever must start what follows.
    fn held(&self, inputs: &MainInputs) -> bool {
        let over = |wait: &Wait, length_s| passed(wait.since, cycles(length_s), inputs.cycle + 1);
        let settled =
            |wait: &Wait| self.settled.settled_for(self.config.settling_s, wait.since, inputs.cycle);
        match &self.state {
            State::WaitingForRig { .. } => inputs.own.is_some(),
            State::InitialPositioning { wait, duration_s, .. } => over(wait, *duration_s),
            State::Preparing { .. } => inputs.prepared || !self.config.prepares,
            State::InitialForce { wait } => over(wait, self.config.own.initial_force_s),
            State::Settling { wait } | State::FinalSettling { wait } => settled(wait),
            State::Experiment { wait } => over(wait, self.config.own.experiment_s),
            State::Done { .. } => true,
            State::Aborted { .. } | State::Fault { .. } => false,
        }
    }

    /// The OK flag.
    fn ok(&self, inputs: &MainInputs) -> bool {
        let waits = matches!(self.state, State::Settling { .. }) && self.config.start == Start::OnStart;
        self.held(inputs) && (self.started || !waits)
    }

    /// How long the state is meant to last, for this axis and for the slower of both.
    fn expected_cycles(&self) -> [u64; 2] {
        let MainConfig { own, either, settling_s, approach_longest_s, .. } = &self.config;
        let seconds = match &self.state {
            State::InitialPositioning { duration_s, .. } => [*duration_s, *approach_longest_s],
            State::Preparing { .. } => [own.prepare_s, either.prepare_s],
            State::InitialForce { .. } => [own.initial_force_s, either.initial_force_s],
            State::Settling { .. } | State::FinalSettling { .. } => [*settling_s; 2],
            State::Experiment { .. } => [own.experiment_s, either.experiment_s],
            _ => [0.0; 2],
        };
        [cycles(seconds[0]), cycles(seconds[0].max(seconds[1]))]
    }

    fn wait_mut(&mut self) -> Option<&mut Wait> {
        match &mut self.state {
            State::InitialPositioning { wait, .. }
            | State::Preparing { wait }
            | State::InitialForce { wait }
            | State::Settling { wait }
            | State::Experiment { wait }
            | State::FinalSettling { wait } => Some(wait),
            _ => None,
        }
    }

    fn enter(&mut self, state: MainChainState, cause: MainCause, inputs: &MainInputs) {
        use MainChainState as S;
        let now = inputs.cycle;
        match state {
            S::WaitingForRig => self.enter_waiting_for_rig(cause, now),
            S::InitialPositioning => self.enter_initial_positioning(cause, inputs),
            S::Preparing => self.enter_preparing(cause, now),
            S::InitialForce => self.enter_initial_force(cause, now),
            S::Settling => self.enter_settling(cause, now),
            S::Experiment => self.enter_experiment(cause, now),
            S::FinalSettling => self.enter_final_settling(cause, now),
            S::Done => self.enter_done(cause, now),
            S::Aborted => self.enter_aborted(cause, inputs),
            S::Fault => self.enter_fault(cause, inputs),
        }
    }

    fn enter_waiting_for_rig(&mut self, cause: MainCause, now: u64) {
        self.settled.clear();
        self.repetition = 0;
        self.started = false;
        self.set(State::WaitingForRig { since: None }, cause, now);
    }

    fn enter_initial_positioning(&mut self, cause: MainCause, inputs: &MainInputs) {
        match cause {
            MainCause::NextRepetition => self.repetition = self.repetition.saturating_add(1),
            MainCause::Recovered | MainCause::Started => self.repetition = self.later_repetition(inputs),
            _ => self.repetition = 0,
        }
        let from_m = inputs.own.map_or(0.0, |own| own.position_m);
        let duration_s = self.config.start_m.map_or(0.0, |start_m| approach_s(from_m, start_m));
        let state = State::InitialPositioning { wait: Wait::since(inputs.cycle), from_m, duration_s };
        self.set(state, cause, inputs.cycle);
    }

    fn enter_preparing(&mut self, cause: MainCause, now: u64) {
        self.set(State::Preparing { wait: Wait::since(now) }, cause, now);
    }

    fn enter_initial_force(&mut self, cause: MainCause, now: u64) {
        self.set(State::InitialForce { wait: Wait::since(now) }, cause, now);
    }

    fn enter_settling(&mut self, cause: MainCause, now: u64) {
        self.set(State::Settling { wait: Wait::since(now) }, cause, now);
    }

    fn enter_experiment(&mut self, cause: MainCause, now: u64) {
        self.set(State::Experiment { wait: Wait::since(now) }, cause, now);
    }

    fn enter_final_settling(&mut self, cause: MainCause, now: u64) {
        self.set(State::FinalSettling { wait: Wait::since(now) }, cause, now);
    }

    fn enter_done(&mut self, cause: MainCause, now: u64) {
        self.set(State::Done { since: now }, cause, now);
    }

    fn enter_aborted(&mut self, cause: MainCause, inputs: &MainInputs) {
        self.started = false;
        self.set(State::Aborted { ended: Ended::now(inputs) }, cause, inputs.cycle);
    }

    fn enter_fault(&mut self, cause: MainCause, inputs: &MainInputs) {
        self.started = false;
        let MainCause::Fault(fault) = cause else { unreachable!("only a fault leads to fault") };
        self.set(State::Fault { ended: Ended::now(inputs), fault }, cause, inputs.cycle);
    }

    fn set(&mut self, state: State, cause: MainCause, now: u64) {
        self.state = state;
        self.entered = Entered { cycle: now, state: self.name(), cause };
    }

    /// The later of the own repetition and the partner's.
    fn later_repetition(&self, inputs: &MainInputs) -> u32 {
        let status = inputs.partner.fresh(inputs.cycle).filter(|_| self.config.partner_needed);
        let ahead = status.map_or(0, |status| repetitions_ahead(self.repetition, status));
        self.repetition.saturating_add_signed(i32::from(ahead.max(0)))
    }

    fn output(&self, inputs: &MainInputs) -> MainOutput {
        let elapsed_s = elapsed_s(self.since().unwrap_or(inputs.cycle), inputs.cycle);
        let fault = match self.state {
            State::Fault { fault, .. } => Some(fault),
            _ => None,
        };
        let phase = match self.state {
            State::WaitingForRig { .. } | State::Aborted { .. } | State::Fault { .. } => Phase::Shut,
            State::InitialPositioning { from_m, duration_s, .. } => {
                Phase::Approach { elapsed_s, from_m, duration_s }
            }
            State::Preparing { .. } => Phase::Prepare { elapsed_s },
            State::InitialForce { .. } => Phase::RampForce { elapsed_s },
            State::Settling { .. } => Phase::HoldStart,
            State::Experiment { .. } => Phase::Experiment { elapsed_s },
            State::FinalSettling { .. } | State::Done { .. } => Phase::HoldEnd,
        };
        let (state, repetition) = (self.name(), self.repetition);
        MainOutput { state, repetition, ok: self.ok(inputs), elapsed_s, phase, fault }
    }

    fn since(&self) -> Option<u64> {
        match self.state {
            State::WaitingForRig { since } => since,
            State::InitialPositioning { wait, .. }
            | State::Preparing { wait }
            | State::InitialForce { wait }
            | State::Settling { wait }
            | State::Experiment { wait }
            | State::FinalSettling { wait } => Some(wait.since),
            State::Done { since } => Some(since),
            State::Aborted { ended } | State::Fault { ended, .. } => Some(ended.since),
        }
    }

    /// The state as the bus names it.
    fn name(&self) -> MainChainState {
        match self.state {
            State::WaitingForRig { .. } => MainChainState::WaitingForRig,
            State::InitialPositioning { .. } => MainChainState::InitialPositioning,
            State::Preparing { .. } => MainChainState::Preparing,
            State::InitialForce { .. } => MainChainState::InitialForce,
            State::Settling { .. } => MainChainState::Settling,
            State::Experiment { .. } => MainChainState::Experiment,
            State::FinalSettling { .. } => MainChainState::FinalSettling,
            State::Done { .. } => MainChainState::Done,
            State::Aborted { .. } => MainChainState::Aborted,
            State::Fault { .. } => MainChainState::Fault,
        }
    }
}

impl Wait {
    fn since(since: u64) -> Self {
        Self { since, for_console: None, ok_since: None }
    }
}

impl Ended {
    fn now(inputs: &MainInputs) -> Self {
        let stopped = inputs.emergency_stop != EmergencyStopChainState::Ready;
        Self { since: inputs.cycle, stopped, by_person: inputs.console.abort }
    }
}

/// More than `length` cycles have passed.
fn passed(since: u64, length: u64, cycle: u64) -> bool {
    cycle.saturating_sub(since) > length
}

fn fault(fault: Fault) -> Edge {
    (MainChainState::Fault, MainCause::Fault(fault))
}

/// What follows from a partner in `state`, when it has ended its run.
fn partner_ended(state: MainChainState) -> Option<Edge> {
    let cause = match state {
        MainChainState::Aborted => MainCause::PartnerAborted,
        MainChainState::Fault => MainCause::PartnerFault,
        _ => return None,
    };
    Some((MainChainState::Aborted, cause))
}
