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
//! The conditions are those of this axis. A state on the way to done is left when its condition holds *and* the partner, if it is
//! needed, says OK in the same state or is in a later one. OK says that the sender's condition holds, so what one axis detects
//! travels by that flag; a start that only one of them heard does too.
//!
//! What ends in a safe state (valve shut), and how fast:
//!
//! | what | where | after |
//! |---|---|---|
//! | emergency stop, console's abort, a fault of this axis | any | in the reporting cycle |
//! | partner aborted or in fault | between waiting for the rig and done | in the reporting cycle; 100 cycles after a (re)start |
//! | partner silent | initial positioning to final settling | 100 cycles after its last status |
//! | partner began anew | initial positioning to final settling | in the reporting cycle |
//! | condition not met | preparing, settling, final settling | `settling_timeout_s` beyond the state's own length |
//! | partner not OK, condition met | initial positioning to final settling | the same beyond the longer length, and 0.1 s |
//! | partner never heard at the start | waiting for the rig | 10 s after this axis's sensors |
//!
//! From aborted and fault the chain goes on when the emergency stop chain has been through and is ready again, or, when there was
//! no emergency stop, on `RunControl` start; both not with [`AfterStop::End`](super::AfterStop::End). It begins with the
//! initial positioning from where the carriage is, so the set-point does not jump, and repeats the repetition that was cut
//! off, or the partner's if that is a later one.
//!
//! Stillness has its own file: [`settled`](super::settled).

mod config;
mod decide;
mod interface;
#[cfg(test)]
mod tests;

pub(crate) use config::{Lengths, MainConfig, Start, approach_s};
pub use interface::MainCause;
pub(crate) use interface::{AxisMeasurement, MainInputs, MainOutput, Phase};

use super::settled::SettlingDetector;
use super::sync::repetitions_ahead;
use super::{Fault, PARTNER_LOST_CYCLES, StateEntry, elapsed_s};
use protocol::frames::{EmergencyStopChainState, MainChainState};

/// Speed of the initial positioning on average, m/s.
const APPROACH_M_PER_S: f64 = 0.1;
/// Shortest initial positioning, s.
const APPROACH_SHORTEST_S: f64 = 0.5;
/// For so long after a (re)start a partner that is still aborted or in fault is waited for: ten periods of its status.
const GRACE_CYCLES: u64 = PARTNER_LOST_CYCLES;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wait {
    /// Last cycle in which nothing but the console's start was missing.
    for_console: Option<u64>,
    /// First cycle of an OK that has lasted.
    ok_since: Option<u64>,
}

/// Facts about an abort or a fault that decide how the chain may restart.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RestartConditions {
    /// The emergency stop chain has left its state ready since.
    stopped: bool,
    /// A person ended the run, so only a person starts it anew.
    by_person: bool,
}

/// Data of a state beyond its entry time. Initial positioning to final settling are `Running`; `since` is when the first sensors
/// of this axis came.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    WaitingForRig { since: Option<u64> },
    Running { wait: Wait },
    Done,
    Aborted { restart: RestartConditions },
    Fault { restart: RestartConditions, fault: Fault },
}

type Edge = (MainChainState, MainCause);

/// The main chain of an axis, with its detector of standstill.
#[derive(Clone, Debug)]
pub(crate) struct MainChain {
    config: MainConfig,
    settling: SettlingDetector,
    state: State,
    /// Where the initial positioning began, m, and how long it takes, s.
    from_m: f64,
    approach_s: f64,
    repetition: u32,
    /// The console's start was heard, here or by the partner.
    started: bool,
    pub(crate) entered: StateEntry<MainChainState, MainCause>,
}

impl MainChain {
    /// A chain that waits for the rig.
    pub(crate) fn new(config: MainConfig) -> Self {
        let entered = StateEntry { cycle: 0, state: MainChainState::WaitingForRig, cause: MainCause::Began };
        let settling = SettlingDetector::new(config.settled);
        let state = State::WaitingForRig { since: None };
        Self { config, settling, state, from_m: 0.0, approach_s: 0.0, repetition: 0, started: false, entered }
    }

    /// Moves on by one edge at most, and says what is asked.
    pub(crate) fn advance(&mut self, inputs: &MainInputs) -> MainOutput {
        self.note(inputs);
        if let Some((state, cause)) = self.decide(inputs) {
            self.enter(state, cause, inputs);
        }
        self.output(inputs)
    }

    /// The rig's time begins anew at `cycle`: so does the chain.
    pub(crate) fn restart(&mut self, cycle: u64) {
        self.settling.clear();
        let inputs = MainInputs { cycle, ..MainInputs::default() };
        self.enter(MainChainState::WaitingForRig, MainCause::RigRestarted, &inputs);
    }

    /// Whether the axis keeps still, whatever its set-point.
    pub(crate) fn still(&self) -> bool {
        self.settling.still
    }

    fn note(&mut self, inputs: &MainInputs) {
        let cycle = inputs.cycle;
        if let Some(measurement) = inputs.measurement {
            self.settling.take(cycle, measurement.position_m, measurement.error);
        }
        let partner_started = self.config.partner_needed && self.relation(inputs).ok();
        let in_settling = self.entered.state == MainChainState::Settling;
        self.started |= in_settling && (inputs.console.start || partner_started);
        let (held, ok) = (self.held(inputs), self.ok(inputs));
        match &mut self.state {
            State::WaitingForRig { since } if inputs.measurement.is_some() => *since = since.or(Some(cycle)),
            State::Aborted { restart } | State::Fault { restart, .. } => {
                restart.stopped |= inputs.emergency_stop != EmergencyStopChainState::Ready;
                restart.by_person |= inputs.console.abort;
            }
            State::Running { wait } => {
                wait.for_console = if held && !ok { Some(cycle) } else { wait.for_console };
                wait.ok_since = if ok { wait.ok_since.or(Some(cycle)) } else { None };
            }
            _ => {}
        }
    }

    fn enter(&mut self, state: MainChainState, cause: MainCause, inputs: &MainInputs) {
        use MainChainState as S;
        let stopped = inputs.emergency_stop != EmergencyStopChainState::Ready;
        let restart = RestartConditions { stopped, by_person: inputs.console.abort };
        match state {
            S::WaitingForRig => (self.repetition, self.started) = (0, false),
            S::InitialPositioning => self.begin_approach(cause, inputs),
            S::Aborted | S::Fault => self.started = false,
            _ => {}
        }
        self.state = match (state, cause) {
            (S::WaitingForRig, _) => State::WaitingForRig { since: None },
            (S::Done, _) => State::Done,
            (S::Aborted, _) => State::Aborted { restart },
            (S::Fault, MainCause::Fault(fault)) => State::Fault { restart, fault },
            (S::Fault, _) => unreachable!("only a fault leads to fault"),
            _ => State::Running { wait: Wait::default() },
        };
        self.entered = StateEntry { cycle: inputs.cycle, state, cause };
    }

    fn begin_approach(&mut self, cause: MainCause, inputs: &MainInputs) {
        self.repetition = match cause {
            MainCause::NextRepetition => self.repetition.saturating_add(1),
            MainCause::Recovered | MainCause::Started => self.later_repetition(inputs),
            _ => 0,
        };
        self.from_m = inputs.measurement.map_or(0.0, |measurement| measurement.position_m);
        self.approach_s = self.config.start_m.map_or(0.0, |start_m| approach_s(self.from_m, start_m));
    }

    /// The later of this axis's repetition and the partner's.
    fn later_repetition(&self, inputs: &MainInputs) -> u32 {
        let status = inputs.partner.fresh(inputs.cycle).filter(|_| self.config.partner_needed);
        let ahead = status.map_or(0, |status| repetitions_ahead(self.repetition, status));
        self.repetition.saturating_add_signed(i32::from(ahead.max(0)))
    }

    fn output(&self, inputs: &MainInputs) -> MainOutput {
        use MainChainState as S;
        let elapsed_s = elapsed_s(self.entered.cycle, inputs.cycle);
        let fault = match self.state {
            State::Fault { fault, .. } => Some(fault),
            _ => None,
        };
        let (state, repetition) = (self.entered.state, self.repetition);
        let phase = match state {
            S::WaitingForRig | S::Aborted | S::Fault => Phase::Shut,
            S::InitialPositioning => {
                Phase::Approach { elapsed_s, from_m: self.from_m, duration_s: self.approach_s }
            }
            S::Preparing => Phase::Prepare,
            S::InitialForce => Phase::RampForce { elapsed_s },
            S::Settling => Phase::HoldStart,
            S::Experiment => Phase::Experiment { elapsed_s },
            S::FinalSettling | S::Done => Phase::HoldEnd,
        };
        MainOutput { state, repetition, ok: self.ok(inputs), phase, fault }
    }
}
