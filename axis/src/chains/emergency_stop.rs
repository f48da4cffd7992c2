//! Emergency stop chain of one axis controller: from the trip to ready again, and the stop that this controller itself holds.
//!
//! ```text
//!            rig tripped, a frame                       at standstill,               not tripped any more,
//!            (local fault: from any)                    100 cycles at least          nothing held here
//!   Ready ─────────────────────────────────► Tripped ───────────────────► Waiting- ──────────────────────► Recovering
//!     ▲                                         ▲      or 1 s             ForRelease                           │
//!     │                                         └─── rig tripped, a frame ◄─── Recovering, WaitingForStart     │
//!     │      RunControl start                                                                                  │
//!     ├────────────────────────── WaitingForStart ◄───────────────────── on-start ─────────────────────────────┤
//!     │                                                      check valves open, supply up, for 0.2 s           │
//!     └────────────────────────────────────────────────────────── by itself, or the run ends ──────────────────┘
//! ```
//!
//! The valve is shut in every state but ready, in the cycle that reports the trip. A controller with a fault holds a stop of
//! its own: it sends its EmergencyStop frame in that cycle and every 100 ms after, until a person has acknowledged it, and
//! withdraws it with one frame.
//!
//! # The way back
//! 1. Look at the rig: is anybody in it, does anything still move? Nothing moves by itself as long as the supply is discharged.
//! 2. Read why: the controller's message, or `candump can0,108:7FC`. The first byte is the reason (1 operator,
//!    2 controller-fault, 3 sensor-loss, 4 partner-lost, 5 rig-fault, 6 limit-exceeded, 7 shutdown), bit 0 of the second
//!    the release.
//! 3. Remove the cause. A controller does not take a release while its cause lasts (a partner that is silent, sensors that are).
//! 4. Release at the console: `cansend can0 108#0001`. This withdraws the console's own stop too, and acknowledges those of both
//!    controllers, which answer with `10A#…01` and `10B#…01`. Nothing came back? Go to 3, and send it again.
//! 5. The supply recovers: the check valves open some 0.1 s later, and nine tenths of the nominal pressure are there after
//!    0.65 s. The rods may creep with what air is trapped.
//! 6. With `after_emergency_stop = "restart"` the aborted repetition begins anew by itself 0.2 s after the supply is up, from
//!    where the carriage is. With `"on-start"` it waits for `cansend can0 160#0109` (start, experiment 9; 0 names any). With
//!    `"end"` the controllers have ended.
//!
//! To trip it from the console: `cansend can0 108#0100`. To end the run without an emergency stop: `cansend can0 160#0200`.

use super::{AfterStop, Console, Fault, StateEntry, cycles, elapsed_s};
use protocol::frames::{EmergencyStop, EmergencyStopChainState, EmergencyStopReason, RigStatus};

/// Cycles between two frames of a stop that is held.
const REPEAT_CYCLES: u64 = protocol::periods::EMERGENCY_STOP_CYCLES;
/// Shortest stay in tripped: the rig has reported ten times by then whether it is tripped.
const TRIPPED_SHORTEST_S: f64 = 0.1;
/// Longest stay in tripped, whatever the axis still does.
const TRIPPED_LONGEST_S: f64 = 1.0;
/// Share of the nominal supply pressure that counts as recovered.
const RECOVERED_SHARE: f64 = 0.9;
/// How long the rig must have been recovered.
const RECOVERED_S: f64 = 0.2;

/// What the way back from an emergency stop needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StopConfig {
    pub(crate) after_emergency_stop: AfterStop,
    /// Nominal supply pressure, absolute, Pa.
    pub(crate) supply_pressure_pa: f64,
}

/// Inputs of the chain in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StopInputs {
    pub(crate) cycle: u64,
    /// The rig's last status; `None` before the first, and best when it is older than 100 cycles too.
    pub(crate) rig: Option<RigStatus>,
    /// An EmergencyStop frame without release came since the last cycle, from anybody but this controller.
    pub(crate) frame: Option<EmergencyStopReason>,
    pub(crate) console: Console,
    /// The axis keeps still: see [`settled`](super::settled).
    pub(crate) at_standstill: bool,
    /// A status of the partner came lately, or none is needed.
    pub(crate) partner_fresh: bool,
    /// Sensors of this axis came lately and are good.
    pub(crate) sensors_fresh: bool,
}

/// Why the chain entered its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopCause {
    Began,
    RigRestarted,
    /// The rig reports that it is tripped.
    Rig,
    /// Somebody tripped it over the bus.
    Frame(EmergencyStopReason),
    /// This controller tripped it.
    LocalFault(Fault),
    Standstill,
    /// The axis still moved a second after the trip.
    NoStandstill,
    Released,
    Recovered,
    Started,
}

/// The fault for which this controller tripped the emergency stop.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LocalFault {
    fault: Fault,
    acknowledged: bool,
}

/// State of the chain; each holds what it needs and nothing else. `up_since`: since when supply and check valves are back.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Ready,
    Tripped { local_fault: Option<LocalFault> },
    WaitingForRelease { local_fault: Option<LocalFault> },
    Recovering { up_since: Option<u64> },
    WaitingForStart,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Frames {
    None,
    /// A stop, from this cycle on each 100.
    Hold {
        next: u64,
        reason: EmergencyStopReason,
    },
    Release,
}

#[derive(Clone, Debug)]
pub(crate) struct EmergencyStopChain {
    config: StopConfig,
    state: State,
    frames: Frames,
    pub(crate) entered: StateEntry<EmergencyStopChainState, StopCause>,
}

impl EmergencyStopChain {
    pub(crate) fn new(config: StopConfig) -> Self {
        let entered = StateEntry { cycle: 0, state: EmergencyStopChainState::Ready, cause: StopCause::Began };
        Self { config, state: State::Ready, frames: Frames::None, entered }
    }

    /// Moves on by one edge at most. The valve is shut unless the result is ready.
    pub(crate) fn advance(&mut self, inputs: &StopInputs) -> EmergencyStopChainState {
        self.note(inputs);
        if let Some((state, cause)) = self.decide(inputs) {
            self.enter(state, cause, inputs.cycle);
        }
        self.state()
    }

    /// Trips the emergency stop for a fault of this controller; the first one is kept until it is released.
    pub(crate) fn trip(&mut self, fault: Fault, cycle: u64) {
        if self.holds().is_none() {
            self.enter(EmergencyStopChainState::Tripped, StopCause::LocalFault(fault), cycle);
        }
    }

    /// The rig's time begins anew at `cycle`: so does the chain, and what it held is the old rig's.
    pub(crate) fn restart(&mut self, cycle: u64) {
        self.enter(EmergencyStopChainState::Ready, StopCause::RigRestarted, cycle);
        self.frames = Frames::None;
    }

    /// The frame to send in this cycle, if any; to be asked after [`trip`](Self::trip).
    pub(crate) fn frame_due(&mut self, cycle: u64) -> Option<EmergencyStop> {
        match self.frames {
            Frames::Hold { next, reason } if cycle >= next => {
                self.frames = Frames::Hold { next: cycle + REPEAT_CYCLES, reason };
                Some(EmergencyStop { reason, release: false })
            }
            // A release that came early waits until the axis stands still.
            Frames::Release if !matches!(self.state, State::Tripped { .. }) => {
                self.frames = Frames::None;
                Some(EmergencyStop { reason: EmergencyStopReason::None, release: true })
            }
            _ => None,
        }
    }

    pub(crate) fn state(&self) -> EmergencyStopChainState {
        self.entered.state
    }

    /// The fault for which this controller holds the emergency stop.
    pub(crate) fn holds(&self) -> Option<Fault> {
        self.local_fault().filter(|local| !local.acknowledged).map(|local| local.fault)
    }

    fn local_fault(&self) -> Option<LocalFault> {
        match self.state {
            State::Tripped { local_fault } | State::WaitingForRelease { local_fault } => local_fault,
            _ => None,
        }
    }

    fn note(&mut self, inputs: &StopInputs) {
        let up = self.is_up(inputs);
        match &mut self.state {
            State::Tripped { local_fault: Some(local) }
            | State::WaitingForRelease { local_fault: Some(local) } => {
                let over = local.fault.is_over(inputs.partner_fresh, inputs.sensors_fresh);
                if inputs.console.release && over {
                    local.acknowledged = true;
                    // Once for each of the person's frames: the bus may have lost the one before.
                    self.frames = Frames::Release;
                }
            }
            State::Recovering { up_since } => {
                *up_since = if up { up_since.or(Some(inputs.cycle)) } else { None };
            }
            _ => {}
        }
    }

    /// Check valves open and the supply near its nominal pressure.
    fn is_up(&self, inputs: &StopInputs) -> bool {
        let least_pa = RECOVERED_SHARE * self.config.supply_pressure_pa;
        inputs.rig.is_some_and(|rig| !rig.check_valves_shut && rig.supply_pressure_pa >= least_pa)
    }

    fn decide(&self, inputs: &StopInputs) -> Option<(EmergencyStopChainState, StopCause)> {
        use EmergencyStopChainState as S;
        let rig_tripped = inputs.rig.is_some_and(|rig| rig.emergency_stop);
        let tripped = || match inputs.frame {
            Some(reason) => Some((S::Tripped, StopCause::Frame(reason))),
            None => rig_tripped.then_some((S::Tripped, StopCause::Rig)),
        };
        match self.state {
            State::Ready => tripped(),
            State::Tripped { .. } => {
                let [shortest, longest] = [TRIPPED_SHORTEST_S, TRIPPED_LONGEST_S].map(cycles);
                match inputs.cycle.saturating_sub(self.entered.cycle) {
                    passed if passed >= longest => Some((S::WaitingForRelease, StopCause::NoStandstill)),
                    passed if passed >= shortest && inputs.at_standstill => {
                        Some((S::WaitingForRelease, StopCause::Standstill))
                    }
                    _ => None,
                }
            }
            State::WaitingForRelease { .. } => {
                let reported = inputs.rig.is_some() && !rig_tripped && inputs.frame.is_none();
                (reported && self.holds().is_none()).then_some((S::Recovering, StopCause::Released))
            }
            State::Recovering { up_since } => tripped().or_else(|| {
                let up_s = elapsed_s(up_since?, inputs.cycle);
                let next = match self.config.after_emergency_stop {
                    AfterStop::OnStart => S::WaitingForStart,
                    AfterStop::End | AfterStop::Restart => S::Ready,
                };
                (cycles(up_s) >= cycles(RECOVERED_S)).then_some((next, StopCause::Recovered))
            }),
            State::WaitingForStart => {
                tripped().or(inputs.console.start.then_some((S::Ready, StopCause::Started)))
            }
        }
    }

    fn enter(&mut self, state: EmergencyStopChainState, cause: StopCause, now: u64) {
        use EmergencyStopChainState as S;
        self.state = match state {
            S::Ready => State::Ready,
            S::Tripped => {
                let local_fault = match cause {
                    StopCause::LocalFault(fault) => Some(LocalFault { fault, acknowledged: false }),
                    // Nothing is held where the rig or a frame can trip from.
                    _ => None,
                };
                if let Some(LocalFault { fault, .. }) = local_fault {
                    self.frames = Frames::Hold { next: now, reason: fault.reason() };
                }
                State::Tripped { local_fault }
            }
            S::WaitingForRelease => State::WaitingForRelease { local_fault: self.local_fault() },
            S::Recovering => State::Recovering { up_since: None },
            S::WaitingForStart => State::WaitingForStart,
        };
        self.entered = StateEntry { cycle: now, state, cause };
    }
}

#[cfg(test)]
mod tests;
