//! `controller.json`, or `controller-drive.json` and `controller-load.json`: what a process's controllers were run with and what
//! they counted.

use axis_control::axis::AxisController;
use axis_control::node::{CalibrationPort, ControllerNode, IgnoredFrames, News};
use axis_control::setup::Inputs;
use plant::Axis;
use protocol::bus::BusCounters;
use protocol::frames::MainChainState;
use runlog::timing_recorder::TimingFigures;
use serde::Serialize;
use std::collections::BTreeMap;
use xcp::port::PortCounters;

/// The report of a process.
#[derive(Debug, Serialize)]
pub struct Report {
    /// See [`runlog::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// How it was called.
    pub command_line: Vec<String>,
    /// Its version.
    pub version: &'static str,
    /// Title of the experiment.
    pub title: String,
    /// Start of its clock, s since 1970; null where time is simulated.
    pub started_unix_s: Option<f64>,
    /// Whether it ended as it should.
    pub ended_well: bool,
    /// Why it ended.
    pub ended_because: String,
    /// Cycles that an axis of the process answered, each once: rows of the timing table.
    pub cycles_answered: u64,
    /// Cycles that the rig says it skipped.
    pub rig_cycles_skipped: u64,
    /// Frames counted and ignored.
    pub frames_ignored: IgnoredFrames,
    /// What the bus counted.
    pub bus: BusCounters,
    /// Sensor frames of the process's axes that came after newer ones.
    pub frames_late: u64,
    /// Sensor frames of the process's axes that came again.
    pub frames_duplicate: u64,
    /// Percentiles of the stages, arrivals, what the kernel counted, flight recorder. Wake-up: from the arrival of sensors; one
    /// sample for each row, and one for each frame of the axis that wakes us that was overtaken.
    #[serde(flatten)]
    pub timing: TimingFigures,
    /// Allocations in the 1 ms path; null when the build does not count them.
    pub allocations_in_cycle: Option<u64>,
    /// Rows lost to a full queue.
    pub records_dropped: u64,
    /// Sensor frames of the axis that wakes us that had arrived before the loop began and were overtaken; they are no wake-ups.
    pub sensors_before_start: u64,
    /// Stamps and frames lost to a full queue: histograms, timing table and flight recorder lack them.
    pub timing_dropped: u64,
    /// What the system granted for real time.
    pub realtime_granted: Vec<String>,
    /// What it refused, with the remedy.
    pub realtime_refused: Vec<String>,
    /// Each axis of the process.
    pub axes: BTreeMap<&'static str, AxisReport>,
    /// What a person was told.
    pub news: Vec<News>,
}

/// What an axis was run with and what it counted.
#[derive(Clone, Debug, Serialize)]
pub struct AxisReport {
    /// State of its main chain at the end.
    pub chain_state: &'static str,
    /// Why it came to that.
    pub chain_cause: String,
    /// State of its emergency stop chain at the end.
    pub emergency_stop_state: &'static str,
    /// How often the experiment was driven through.
    pub repetitions_done: u32,
    /// Why its algorithm is no longer asked; null while it is.
    pub algorithm_fault: Option<String>,
    /// Largest |set-point - position sensor| while the set-point moved; null without a position.
    pub position_error_dynamic_m: Option<f64>,
    /// Largest mean |error| over the last 0.2 s of each rest; null without a position.
    pub position_error_static_m: Option<f64>,
    /// Cycles that the axis answered: its commands on the bus.
    pub cycles_answered: u64,
    /// Sensor frames of the axis that came.
    pub sensors_received: u64,
    /// Sensor frames of the axis that never came.
    pub sensors_lost: u64,
    /// Sensor frames of the axis that came after newer ones.
    pub sensors_late: u64,
    /// Sensor frames of the axis that came again; they are among those received.
    pub sensors_duplicate: u64,
    /// Those among the sensor frames before the rig's first tick that came; with the lost ones, all that is missing.
    pub sensors_missed_before_first_tick: u64,
    /// Offset of its position sensor as it was matched, m.
    pub matched_offset_m: f64,
    /// The program file as it stands; null for an axis that held its valve shut.
    pub program_toml: Option<String>,
    /// Its path.
    pub program_file: Option<String>,
    /// Values of all variables at the end.
    pub variables: BTreeMap<String, f64>,
    /// What XCP did; absent where it was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub xcp: Option<PortCounters>,
}

impl AxisReport {
    fn new<P: CalibrationPort>(
        controller: &AxisController,
        node: &ControllerNode<P>,
        inputs: &Inputs,
    ) -> Self {
        let view = node.view();
        let program = controller.program();
        let source = inputs.programs[controller.axis().index()].as_ref();
        let values = program.values().iter();
        Self {
            chain_state: controller.state().name(),
            chain_cause: controller.cause().to_string(),
            emergency_stop_state: controller.emergency_stop().name(),
            repetitions_done: controller.repetitions_done(),
            algorithm_fault: controller.algorithm_fault().map(|fault| fault.to_string()),
            position_error_dynamic_m: controller.figures().dynamic_m(),
            position_error_static_m: controller.figures().static_m(),
            cycles_answered: node.answered_by(controller.axis()),
            sensors_received: view.received().get(controller.axis()),
            sensors_lost: view.lost().get(controller.axis()),
            sensors_late: view.late().get(controller.axis()),
            sensors_duplicate: view.duplicate().get(controller.axis()),
            sensors_missed_before_first_tick: view.missed_before_first_tick().get(controller.axis()),
            matched_offset_m: program.geometry().offset_m,
            program_toml: source.map(|source| source.text.clone()),
            program_file: source.map(|source| source.path.display().to_string()),
            variables: program
                .variables()
                .iter()
                .map(|variable| variable.name.clone())
                .zip(values.copied())
                .collect(),
            xcp: None,
        }
    }

    /// Of every controller of a node, without what XCP did.
    #[must_use]
    pub fn of_node<P: CalibrationPort>(
        node: &ControllerNode<P>,
        inputs: &Inputs,
    ) -> BTreeMap<&'static str, Self> {
        let of =
            |controller: &AxisController| (controller.axis().name(), Self::new(controller, node, inputs));
        node.controllers().map(of).collect()
    }

    /// Whether the axis ended what it was asked for.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.chain_state == MainChainState::Done.name()
    }

    /// Whether it was stopped before.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        [MainChainState::Aborted.name(), MainChainState::Fault.name()].contains(&self.chain_state)
    }
}

/// The axis that was stopped, the one with the fault before one that only followed it.
#[must_use]
pub fn stopped<'a>(axes: &'a BTreeMap<&'static str, AxisReport>) -> Option<(&'static str, &'a AxisReport)> {
    let stopped = || axes.iter().filter(|(_, axis)| axis.is_stopped()).map(|(name, axis)| (*name, axis));
    stopped().find(|(_, axis)| axis.chain_state == MainChainState::Fault.name()).or_else(|| stopped().next())
}

/// Name of the report of a process with these axes, without its ending.
#[must_use]
pub fn name(axes: &[Axis]) -> String {
    match axes {
        [axis] => format!("controller-{}", axis.name()),
        _ => "controller".into(),
    }
}
