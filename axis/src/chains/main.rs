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
//! | partner not OK, own condition met | initial positioning to final settling | the same beyond the longer length, and 0.1 s |
//! | partner never heard at the start | waiting for the rig | `partner_timeout_s` after the own sensors |
//!
//! From aborted and fault the chain goes on when the emergency stop chain has been through and is ready again, or, when there was
//! no emergency stop, on `RunControl` start; both not with [`AfterStop::End`](super::AfterStop::End). It begins with the
//! initial positioning from where the carriage is, so the set-point does not jump, and repeats the repetition that was cut
//! off, or the partner's if that is a later one.
//!
//! Stillness has its own file: [`settled`](super::settled).

mod config;
mod decide;
#[cfg(test)]
mod tests;
mod told;

pub use config::{Lengths, MainConfig, PARTNER_TIMEOUT_S, Start, approach_s};
pub use told::{MainCause, MainInputs, MainOutput, OwnAxis, Phase};

use super::settled::Settled;
use super::sync::repetitions_ahead;
use super::{Entered, Fault, PARTNER_LOST_CYCLES, elapsed_s};
use protocol::frames::{EmergencyStopChainState, MainChainState};

/// Speed of the initial positioning on average, m/s.
const APPROACH_M_PER_S: f64 = 0.1;
/// Shortest initial positioning, s.
const APPROACH_SHORTEST_S: f64 = 0.5;
/// For so long after a (re)start a partner that is still aborted or in fault is waited for: ten periods of its status.
const GRACE_CYCLES: u64 = PARTNER_LOST_CYCLES;

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
        self.settled.clear();
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
