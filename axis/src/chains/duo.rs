//! Two chains that talk to each other, for tests: what one says in a cycle the other sees in the next.
//!
//! Each is wired as in an axis controller, by the same [`Leading`].

use super::leading::{Leading, LeadingInputs};
use super::main::{AxisMeasurement, Lengths, MainConfig, MainOutput, Phase};
use super::settled::ControlError;
use super::{AfterStop, Console, Fault, Partner};
use protocol::frames::{
    ChainStatus, EmergencyStopChainState, EmergencyStopReason, MainChainState, RigStatus,
};

pub(super) const SUPPLY_PA: f64 = 7e5;

pub(super) struct One {
    pub(super) leading: Leading,
    pub(super) position_m: f64,
    pub(super) error: ControlError,
    pub(super) prepared: bool,
    pub(super) sensors: bool,
    /// Its status frames reach the other.
    pub(super) received: bool,
    pub(super) alive: bool,
    pub(super) fault: Option<Fault>,
    partner: Partner,
    pub(super) output: Option<MainOutput>,
    experiment: u8,
    pub(super) seen: Vec<(u64, MainChainState)>,
    /// It holds the emergency stop, as the rig knows it.
    holds: bool,
}

impl One {
    pub(super) fn new(config: MainConfig) -> Self {
        Self {
            experiment: config.experiment,
            leading: Leading::new(config, SUPPLY_PA),
            position_m: 0.1,
            error: ControlError::None,
            prepared: true,
            sensors: true,
            received: true,
            alive: true,
            fault: None,
            partner: Partner::default(),
            output: None,
            seen: Vec::new(),
            holds: false,
        }
    }

    pub(super) fn state(&self) -> MainChainState {
        self.leading.main.entered.state
    }

    pub(super) fn fault(&self) -> Option<Fault> {
        self.output.and_then(|output| output.fault)
    }

    pub(super) fn stop_state(&self) -> EmergencyStopChainState {
        self.leading.stop.state()
    }

    fn status(&self) -> Option<ChainStatus> {
        let output = self.output?;
        Some(ChainStatus {
            main_chain: output.state,
            emergency_stop_chain: self.leading.stop.state(),
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
        let output = self.leading.advance(&LeadingInputs {
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
        if self.seen.last().is_none_or(|(_, state)| *state != output.state) {
            self.seen.push((cycle, output.state));
        }
        self.output = Some(output);
        let sent = self.leading.stop.frame_due(cycle)?;
        self.holds = !sent.release;
        (!sent.release).then_some(sent.reason)
    }
}

/// Two axes, the rig's emergency stop, and the console.
pub(super) struct Duo {
    pub(super) axes: [One; 2],
    pub(super) cycle: u64,
    /// Said in the next cycle only.
    pub(super) console: Console,
    pub(super) console_holds: bool,
    /// What each sent in the cycle before.
    sent: [Option<EmergencyStopReason>; 2],
}

impl Duo {
    pub(super) fn new(config: &MainConfig) -> Self {
        Self {
            axes: [0, 1].map(|_| One::new(config.clone())),
            cycle: 0,
            console: Console::default(),
            console_holds: false,
            sent: [None; 2],
        }
    }

    fn rig_is_stopped(&self) -> bool {
        self.console_holds || self.axes.iter().any(|axis| axis.holds)
    }

    /// One cycle of both; each sees what the other said in the cycle before.
    pub(super) fn step(&mut self) {
        if self.console.release {
            self.console_holds = false;
        }
        let emergency_stop = self.rig_is_stopped();
        let supply_pressure_pa = if emergency_stop { 1e5 } else { SUPPLY_PA };
        let rig = RigStatus {
            emergency_stop,
            supply_pressure_pa,
            check_valves_shut: emergency_stop,
            ..RigStatus::default()
        };
        let console = std::mem::take(&mut self.console);
        let said = [0, 1].map(|index| {
            let one = &self.axes[index];
            one.status().filter(|_| one.alive && one.received)
        });
        let sent = self.sent;
        for index in [0, 1] {
            let one = &mut self.axes[index];
            if let Some(status) = said[1 - index] {
                one.partner = Partner { status: Some(status), values: None, received: Some(self.cycle) };
            }
            self.sent[index] = one.advance(self.cycle, rig, sent[1 - index], console);
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
        panic!("{state} was not reached: {:?} {:?}", self.axes[0].seen, self.axes[1].seen);
    }

    pub(super) fn states(&self) -> [MainChainState; 2] {
        [0, 1].map(|index| self.axes[index].state())
    }

    pub(super) fn faults(&self) -> [Option<Fault>; 2] {
        [0, 1].map(|index| self.axes[index].fault())
    }

    /// The console trips the emergency stop for half a second.
    pub(super) fn stop_and_release(&mut self) {
        self.console_holds = true;
        self.run(500);
        self.console.release = true;
        self.step();
    }
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
