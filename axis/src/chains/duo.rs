//! Two axes that exchange their statuses, for tests: a status sent in a cycle is received in the next.
//!
//! Each is wired as in an axis controller, by the same [`SupervisoryChains`].

use super::leading::{SupervisoryChains, SupervisoryInputs};
use super::main::{AxisMeasurement, Lengths, MainConfig, MainOutput, Phase};
use super::settled::ControlError;
use super::{AfterStop, Console, Fault, Partner};
use protocol::frames::{
    ChainStatus, EmergencyStopChainState, EmergencyStopReason, MainChainState, RigStatus,
};

pub(super) const SUPPLY_PA: f64 = 7e5;

/// The supervisory chains of an axis, with inputs that a test sets.
pub(super) struct SimulatedAxis {
    pub(super) supervisory: SupervisoryChains,
    pub(super) position_m: f64,
    pub(super) error: ControlError,
    pub(super) prepared: bool,
    pub(super) sensors: bool,
    /// The partner receives its status frames.
    pub(super) received: bool,
    pub(super) alive: bool,
    pub(super) fault: Option<Fault>,
    partner: Partner,
    pub(super) output: Option<MainOutput>,
    experiment: u8,
    /// Each state with the cycle in which it was entered.
    pub(super) state_log: Vec<(u64, MainChainState)>,
    /// It holds the emergency stop, as the rig knows it.
    holds: bool,
}

impl SimulatedAxis {
    pub(super) fn new(config: MainConfig) -> Self {
        Self {
            experiment: config.experiment,
            supervisory: SupervisoryChains::new(config, SUPPLY_PA),
            position_m: 0.1,
            error: ControlError::None,
            prepared: true,
            sensors: true,
            received: true,
            alive: true,
            fault: None,
            partner: Partner::default(),
            output: None,
            state_log: Vec::new(),
            holds: false,
        }
    }

    pub(super) fn state(&self) -> MainChainState {
        self.supervisory.main.entered.state
    }

    pub(super) fn stop_state(&self) -> EmergencyStopChainState {
        self.supervisory.stop.state()
    }

    fn status(&self) -> Option<ChainStatus> {
        let output = self.output?;
        Some(ChainStatus {
            main_chain: output.state,
            emergency_stop_chain: self.supervisory.stop.state(),
            ok: output.ok,
            experiment: self.experiment,
            repetition: output.repetition as u8,
            ..ChainStatus::default()
        })
    }

    /// One cycle; the reason of the frame it sends.
    fn advance(
        &mut self,
        cycle: u64,
        rig: RigStatus,
        frame: Option<EmergencyStopReason>,
        console: Console,
    ) -> Option<EmergencyStopReason> {
        if !self.alive {
            return None;
        }
        let measurement =
            self.sensors.then_some(AxisMeasurement { position_m: self.position_m, error: self.error });
        let output = self.supervisory.advance(&SupervisoryInputs {
            cycle,
            rig: Some(rig),
            measurement,
            prepared: self.prepared,
            partner: self.partner,
            frame,
            console,
            fault: self.fault,
        });
        assert!(
            !output.ok || !matches!(output.state, MainChainState::Aborted | MainChainState::Fault),
            "an ended chain is never OK"
        );
        if self.stop_state() != EmergencyStopChainState::Ready {
            assert_eq!(output.phase, Phase::Shut, "an emergency stop shuts in its cycle");
        }
        if self.state_log.last().is_none_or(|(_, state)| *state != output.state) {
            self.state_log.push((cycle, output.state));
        }
        self.output = Some(output);
        let sent = self.supervisory.stop.frame_due(cycle)?;
        self.holds = !sent.release;
        (!sent.release).then_some(sent.reason)
    }
}

/// Two axes, the rig's emergency stop, and the console.
pub(super) struct AxisPair {
    pub(super) axes: [SimulatedAxis; 2],
    pub(super) cycle: u64,
    /// Input of the next cycle only.
    pub(super) console: Console,
    pub(super) console_holds: bool,
    /// Emergency stop that each sent in the cycle before.
    sent: [Option<EmergencyStopReason>; 2],
}

impl AxisPair {
    pub(super) fn new(config: &MainConfig) -> Self {
        Self {
            axes: [0, 1].map(|_| SimulatedAxis::new(config.clone())),
            cycle: 0,
            console: Console::default(),
            console_holds: false,
            sent: [None; 2],
        }
    }

    /// One cycle of both; each sees what the other sent in the cycle before.
    pub(super) fn step(&mut self) {
        if self.console.release {
            self.console_holds = false;
        }
        let emergency_stop = self.console_holds || self.axes.iter().any(|axis| axis.holds);
        let supply_pressure_pa = if emergency_stop { 1e5 } else { SUPPLY_PA };
        let rig = RigStatus {
            emergency_stop,
            supply_pressure_pa,
            check_valves_shut: emergency_stop,
            ..RigStatus::default()
        };
        let console = std::mem::take(&mut self.console);
        let statuses = [0, 1].map(|index| {
            let axis = &self.axes[index];
            axis.status().filter(|_| axis.alive && axis.received)
        });
        let sent = self.sent;
        for index in [0, 1] {
            let axis = &mut self.axes[index];
            if let Some(status) = statuses[1 - index] {
                axis.partner = Partner { status: Some(status), values: None, received: Some(self.cycle) };
            }
            self.sent[index] = axis.advance(self.cycle, rig, sent[1 - index], console);
        }
        self.cycle += 1;
    }

    pub(super) fn run(&mut self, cycles: u64) {
        (0..cycles).for_each(|_| self.step());
    }

    /// Runs until the first axis is in `state`; panics after 60 s.
    pub(super) fn run_to(&mut self, state: MainChainState) {
        for _ in 0..60_000 {
            if self.axes[0].state() == state {
                return;
            }
            self.step();
        }
        panic!("{state} was not reached: {:?} {:?}", self.axes[0].state_log, self.axes[1].state_log);
    }

    pub(super) fn states(&self) -> [MainChainState; 2] {
        [0, 1].map(|index| self.axes[index].state())
    }

    pub(super) fn faults(&self) -> [Option<Fault>; 2] {
        [0, 1].map(|index| self.axes[index].output.and_then(|output| output.fault))
    }

    /// The console trips the emergency stop for half a second.
    pub(super) fn stop_and_release(&mut self) {
        self.console_holds = true;
        self.run(500);
        self.console.release = true;
        self.step();
    }
}

/// A pair whose second axis has no controller, and whose first needs none.
pub(super) fn alone(config: MainConfig) -> AxisPair {
    let mut pair = AxisPair::new(&MainConfig { partner_needed: false, ..config });
    pair.axes[1].alive = false;
    pair
}

/// Half a second of positioning, 0.2 s of force, 0.3 s of settling, 1 s of experiment.
pub(super) fn short() -> MainConfig {
    let lengths = Lengths { prepare_s: 0.0, initial_force_s: 0.2, experiment_s: 1.0 };
    MainConfig {
        experiment: 9,
        start_m: Some(0.1),
        prepares: true,
        lengths,
        longest_lengths: lengths,
        settling_s: 0.3,
        settling_timeout_s: 2.0,
        after_emergency_stop: AfterStop::Restart,
        ..MainConfig::default()
    }
}
