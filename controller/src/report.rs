//! `controller.json`, or `controller-drive.json` and `controller-load.json`, filled from the controllers of a process.

use axis_control::axis::AxisController;
use axis_control::node::{CalibrationPort, ControllerNode, NodeEvent};
use axis_control::setup::Inputs;
use nominal::Axis;
use protocol::frames::MainChainState;
use runlog::controller_report::{self, ControllerReport};
use runlog::process::Process;
use std::collections::BTreeMap;
use xcp::port::PortCounters;

pub(crate) type Report = ControllerReport<NodeEvent, PortCounters>;
pub(crate) type AxisReport = controller_report::AxisReport<PortCounters>;

fn of_axis<P: CalibrationPort>(
    controller: &AxisController,
    node: &ControllerNode<P>,
    inputs: &Inputs,
) -> AxisReport {
    let view = &node.view;
    let program = &controller.program;
    let source = inputs.programs[controller.axis.index()].as_ref();
    let values = program.values().iter();
    AxisReport {
        chain_state: controller.state().name().into(),
        chain_cause: controller.cause().to_string(),
        emergency_stop_state: controller.emergency_stop().name().into(),
        repetitions_done: Some(controller.repetitions_done()),
        algorithm_fault: controller.algorithm_fault().map(|fault| fault.to_string()),
        position_error_dynamic_m: controller.figures.dynamic_m(),
        position_error_static_m: controller.figures.static_m(),
        cycles_answered: node.answered_by(controller.axis),
        sensors_received: view.received.get(controller.axis),
        sensors_lost: Some(view.lost.get(controller.axis)),
        sensors_late: view.late.get(controller.axis),
        sensors_duplicate: view.duplicate.get(controller.axis),
        sensors_missed_before_first_tick: Some(view.missed_before_first_tick.get(controller.axis)),
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

/// Reports of all controllers of a node, without their XCP counters.
pub(crate) fn of_node<P: CalibrationPort>(
    node: &ControllerNode<P>,
    inputs: &Inputs,
) -> BTreeMap<String, AxisReport> {
    let of = |controller: &AxisController| (controller.axis.name().into(), of_axis(controller, node, inputs));
    node.controllers().map(of).collect()
}

pub(crate) fn is_done(axis: &AxisReport) -> bool {
    axis.chain_state == MainChainState::Done.name()
}

/// The axis that was stopped; one with a fault before one that followed it.
pub(crate) fn stopped(axes: &BTreeMap<String, AxisReport>) -> Option<(&str, &AxisReport)> {
    [MainChainState::Fault, MainChainState::Aborted].iter().find_map(|state| {
        let (name, axis) = axes.iter().find(|(_, axis)| axis.chain_state == state.name())?;
        Some((name.as_str(), axis))
    })
}

/// The process that runs these axes, for the names of its files.
pub(crate) fn process(axes: &[Axis]) -> Process {
    match axes {
        [axis] => Process::ControllerOf(axis_of(*axis)),
        _ => Process::Controller,
    }
}

/// The axis of the file names.
pub(crate) fn axis_of(axis: Axis) -> runlog::Axis {
    match axis {
        Axis::Drive => runlog::Axis::Drive,
        Axis::Load => runlog::Axis::Load,
    }
}
