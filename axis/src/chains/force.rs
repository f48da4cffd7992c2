//! Force chain of the load axis: relieving stress and manual mode under force control with set-point zero, and what the load is
//! doing otherwise.
//!
//! ```text
//!             asked                    |force| low for 50 ms              |v| high for 20 ms
//!   Idle ─────────────────► Limited ──────────────────────► Standstill ────────────────────► Moving
//!    ▲  relieve or manual      │                             │      ▲    |v| low for 100 ms    │
//!    │                         │ too long (relieve)          │      └──────────────────────────┤ too long (relieve)
//!    │ idle asked              ▼                             │ relieved                        │
//!    └──────────────────── Fault ◄── too long (relieve) ─────┤                                 │
//!                              ▲                             ▼                                 │
//!                              │                            Done                               │
//!                              └───────────────────────────────────────────────────────────────┘
//!   any but fault ── asked: idle, initial ramp, load profile, done ──► Idle, InitialRamp, LoadProfile, Done
//!   any but fault ── asked anew: relieve, manual ────────────────────► Limited
//! ```
//!
//! | state | velocity limited | feed-forward | dead zone |
//! |---|---|---|---|
//! | limited | yes | no | no |
//! | standstill, relieved | no | no | yes |
//! | moving | no | yes | no |
//!
//! At first the velocity is limited, since a high force between linked axes would throw the rod. The case distinction on
//! significant movement is the paper's: at standstill the noise of the velocity must not be fed forward, and a control error
//! within the friction must not be worked on; when moving, both would be felt in the hand. Movement begins with the velocity and
//! ends with its mean: a rod that bounces within the gap of the linkage is fast at times and goes nowhere.

use super::{CYCLE_S, Fault, StateEntry, cycles, elapsed_s};
use protocol::frames::ForceChainState;
use settings::parameters::declare;

/// Section of a program file that holds the numbers of the chain; also the task in their names as variables.
pub const TABLE: &str = "force-chain";

settings::parameters! {
    /// Bounds on force and velocity between the states of the chain, and how long they must hold.
    pub struct Parameters {
        high_force_n: declare("N", [1.0, 2000.0], 80.0, "above it, at first, the velocity is limited"),
        limited_m_per_s: declare("m/s", [1e-3, 1.0], 0.02, "largest rod velocity while it is limited"),
        low_force_for_s: declare("s", [0.0, 10.0], 0.05, "how long the force must be low to end that"),
        moving_m_per_s: declare("m/s", [1e-4, 1.0], 0.01, "significant movement; half of it ends it"),
        moving_for_s: declare("s", [0.0, 1.0], 0.02, "how long the axis must move significantly"),
        still_for_s: declare("s", [0.0, 1.0], 0.1, "how long it must not, to be at standstill again"),
        relieved_n: declare("N", [0.1, 2000.0], 20.0, "mean force of a relieved system"),
        relieved_for_s: declare("s", [0.0, 60.0], 0.3, "how long it must be lower, at standstill"),
        relieve_timeout_s: declare("s", [0.1, 600.0], 15.0, "how long relieving may take").at_start_only(),
    }
}

/// Time constant of the mean force, s.
const MEAN_S: f64 = 0.05;
/// Time constant of the mean velocity, s: long beside a rod that bounces within the gap of the linkage, which goes nowhere.
const MEAN_VELOCITY_S: f64 = 0.15;
/// Share of the significant velocity below which, in the mean, movement ends.
const STILL_SHARE: f64 = 0.5;

/// What the main chain and the experiment ask of the load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ForceRequest {
    /// Nothing: valve shut, or held still.
    #[default]
    Idle,
    /// To give way until the linked system is without stress.
    Relieve,
    /// To give way to a hand.
    Manual,
    /// To ramp to the initial force, or to hold it.
    InitialRamp,
    /// To follow the forces of the experiment.
    LoadProfile,
    /// To hold the last force.
    Done,
}

/// Inputs of the chain in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ForceInputs {
    pub(crate) cycle: u64,
    pub(crate) request: ForceRequest,
    /// Force sensor, filtered, N, compression positive.
    pub(crate) force_n: f64,
    /// Velocity of this axis's rod, filtered, m/s.
    pub(crate) velocity_m_per_s: f64,
}

/// State of the chain after a cycle, and what it asks of the algorithm of `[giving-way]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForceOutput {
    pub(crate) state: ForceChainState,
    /// Largest rod velocity, m/s; `None`: the chain sets no limit.
    pub(crate) limit_m_per_s: Option<f64>,
    /// The velocity is fed forward: the rod moves.
    pub(crate) feed_forward: bool,
    /// Control errors within the friction are let be: the rod stands.
    pub(crate) dead_zone: bool,
    /// Set-point, N; `None` where it is the axis's own.
    pub(crate) set_force_n: Option<f64>,
    pub(crate) relieved: bool,
    pub(crate) fault: Option<Fault>,
}

/// Why the chain entered its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ForceCause {
    /// The controller or the rig began.
    Began,
    Requested(ForceRequest),
    LowForce,
    Moves,
    Still,
    Relieved,
    TooLong,
}

/// Means of what the axis shows, up to a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mean {
    cycle: u64,
    force_n: f64,
    velocity_m_per_s: f64,
}

impl Mean {
    fn to(self, now: &Self) -> Self {
        let passed_s = now.cycle.saturating_sub(self.cycle) as f64 * CYCLE_S;
        let towards =
            |mean: f64, value: f64, constant_s: f64| mean + (passed_s / constant_s).min(1.0) * (value - mean);
        Self {
            cycle: now.cycle,
            force_n: towards(self.force_n, now.force_n, MEAN_S),
            velocity_m_per_s: towards(self.velocity_m_per_s, now.velocity_m_per_s, MEAN_VELOCITY_S),
        }
    }
}

/// State of the chain; each holds what it needs and nothing else. `began` is when the relief or the manual mode began.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Idle,
    Limited { began: u64, low_since: Option<u64> },
    Standstill { began: u64, moves_since: Option<u64>, low_since: Option<u64> },
    Moving { began: u64, still_since: Option<u64> },
    InitialRamp,
    LoadProfile,
    Done,
    Fault,
}

/// The force chain of an axis; the default is idle.
#[derive(Clone, Debug)]
pub(crate) struct ForceChain {
    state: State,
    request: ForceRequest,
    /// Mean of the force, with the cycle of its last sample.
    mean: Option<Mean>,
    pub(crate) entered: StateEntry<ForceChainState, ForceCause>,
}

impl Default for ForceChain {
    fn default() -> Self {
        let entered = StateEntry { cycle: 0, state: ForceChainState::Idle, cause: ForceCause::Began };
        Self { state: State::Idle, request: ForceRequest::Idle, mean: None, entered }
    }
}

impl ForceChain {
    /// Moves on by one edge at most, with `values` in the order of [`Parameters`].
    ///
    /// # Panics
    /// When `values` is not as long as the table.
    pub(crate) fn advance(&mut self, inputs: &ForceInputs, values: &[f64]) -> ForceOutput {
        let numbers = Parameters::of(values);
        self.note(inputs, &numbers);
        if let Some((state, cause)) = self.decide(inputs, &numbers) {
            self.enter(state, cause, inputs.cycle);
        }
        self.request = inputs.request;
        self.output(&numbers)
    }

    /// The rig's time begins anew at `cycle`: so does the chain.
    pub(crate) fn restart(&mut self, cycle: u64) {
        *self = Self::default();
        self.entered.cycle = cycle;
    }

    fn note(&mut self, inputs: &ForceInputs, numbers: &Parameters) {
        let ForceInputs { cycle, force_n, velocity_m_per_s, .. } = *inputs;
        let now = Mean { cycle, force_n, velocity_m_per_s };
        let mut mean = self.mean.map_or(now, |last| last.to(&now));
        if !matches!(self.state, State::Moving { .. }) {
            // The mean is of one movement: what was before it does not count.
            mean.velocity_m_per_s = velocity_m_per_s;
        }
        // A NaN would persist in the running mean: start anew.
        self.mean = (mean.force_n.is_finite() && mean.velocity_m_per_s.is_finite()).then_some(mean);
        let mean_n = mean.force_n;
        let lasting = |since: &mut Option<u64>, holds: bool| {
            *since = if holds { since.or(Some(cycle)) } else { None };
        };
        match &mut self.state {
            State::Limited { low_since, .. } => lasting(low_since, force_n.abs() < numbers.high_force_n),
            State::Standstill { moves_since, low_since, .. } => {
                lasting(moves_since, velocity_m_per_s.abs() > numbers.moving_m_per_s);
                lasting(low_since, mean_n.abs() < numbers.relieved_n);
            }
            State::Moving { still_since, .. } => {
                let speed_m_per_s = mean.velocity_m_per_s.abs();
                lasting(still_since, speed_m_per_s < STILL_SHARE * numbers.moving_m_per_s);
            }
            _ => {}
        }
    }

    fn decide(&self, inputs: &ForceInputs, numbers: &Parameters) -> Option<(ForceChainState, ForceCause)> {
        use ForceChainState as S;
        let request = inputs.request;
        if self.state == State::Fault {
            return (request == ForceRequest::Idle).then_some((S::Idle, ForceCause::Requested(request)));
        }
        if request != self.request {
            let state = match request {
                ForceRequest::Idle => S::Idle,
                ForceRequest::Relieve | ForceRequest::Manual => S::Limited,
                ForceRequest::InitialRamp => S::InitialRamp,
                ForceRequest::LoadProfile => S::LoadProfile,
                ForceRequest::Done => S::Done,
            };
            return Some((state, ForceCause::Requested(request)));
        }
        let lasted = |since: Option<u64>, least_s: f64| {
            since.is_some_and(|since| inputs.cycle.saturating_sub(since) >= cycles(least_s))
        };
        let relieving = request == ForceRequest::Relieve;
        let too_long = |began: u64| {
            let late = relieving && elapsed_s(began, inputs.cycle) > numbers.relieve_timeout_s;
            late.then_some((S::Fault, ForceCause::TooLong))
        };
        match self.state {
            State::Limited { began, low_since } => lasted(low_since, numbers.low_force_for_s)
                .then_some((S::Standstill, ForceCause::LowForce))
                .or_else(|| too_long(began)),
            State::Standstill { moves_since, .. } if lasted(moves_since, numbers.moving_for_s) => {
                Some((S::Moving, ForceCause::Moves))
            }
            State::Standstill { began, low_since, .. } => (relieving
                && lasted(low_since, numbers.relieved_for_s))
            .then_some((S::Done, ForceCause::Relieved))
            .or_else(|| too_long(began)),
            State::Moving { began, still_since } => lasted(still_since, numbers.still_for_s)
                .then_some((S::Standstill, ForceCause::Still))
                .or_else(|| too_long(began)),
            State::Idle | State::InitialRamp | State::LoadProfile | State::Done | State::Fault => None,
        }
    }

    fn output(&self, numbers: &Parameters) -> ForceOutput {
        let relieved = self.state == State::Done && self.request == ForceRequest::Relieve;
        let yields = relieved
            || matches!(self.request, ForceRequest::Relieve | ForceRequest::Manual)
                && self.state != State::Fault;
        let limited = matches!(self.state, State::Limited { .. });
        let still = matches!(self.state, State::Standstill { .. }) || relieved;
        ForceOutput {
            state: self.entered.state,
            limit_m_per_s: limited.then_some(numbers.limited_m_per_s),
            feed_forward: !(limited || still),
            dead_zone: still,
            set_force_n: yields.then_some(0.0),
            relieved,
            fault: (self.state == State::Fault).then_some(Fault::RelieveTimeout),
        }
    }

    /// When the relief or the manual mode began; `now` outside of both.
    fn began(&self, now: u64) -> u64 {
        match self.state {
            State::Limited { began, .. } | State::Standstill { began, .. } | State::Moving { began, .. } => {
                began
            }
            _ => now,
        }
    }

    fn enter(&mut self, state: ForceChainState, cause: ForceCause, now: u64) {
        use ForceChainState as S;
        self.state = match state {
            S::Idle => State::Idle,
            S::Limited => State::Limited { began: now, low_since: None },
            S::Standstill => State::Standstill { began: self.began(now), moves_since: None, low_since: None },
            S::Moving => State::Moving { began: self.began(now), still_since: None },
            S::InitialRamp => State::InitialRamp,
            S::LoadProfile => State::LoadProfile,
            S::Done => State::Done,
            S::Fault => State::Fault,
        };
        self.entered = StateEntry { cycle: now, state, cause };
    }
}

#[cfg(test)]
mod tests;
