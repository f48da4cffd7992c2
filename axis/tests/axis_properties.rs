//! Axis controllers under random inputs: sensors that jump, a rig that trips, a partner with any status, console commands,
//! parameters at the ends of their ranges. On the virtual clock: time is the number of the cycle.
//!
//! Whatever comes, the opening is a number within the valve, and the valve is shut in every state that has no control.

use algorithms::algorithm::Quantity;
use axis_control::axis::{Answer, AxisController};
use axis_control::program::file::Source;
use plant::{Axis, RigParameters};
use proptest::prelude::*;
use protocol::frames::{
    ChainStatus, ChainValues, EmergencyStop, EmergencyStopChainState, EmergencyStopReason, Frame,
    MainChainState, RigStatus, RunControl, RunControlCommand, Sensors,
};
use std::path::Path;

/// The shipped programs whose algorithm controls `quantity`, by name, sorted.
fn programs(quantity: Quantity) -> Vec<String> {
    let rig = RigParameters::baseline();
    let controls = |path: &Path| {
        let program = Source::read(path).and_then(|source| source.program(Axis::Drive, &rig, false));
        program.unwrap_or_else(|error| panic!("{error}")).controls()
    };
    let folder = std::fs::read_dir(crate::shipped("controller/programs")).expect("the shipped programs");
    let paths = folder.map(|entry| entry.expect("an entry").path());
    let files = paths.filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
    let chosen = files.filter(|path| controls(path) == quantity);
    let mut names: Vec<_> =
        chosen.map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The controller of `axis` for the shipped experiment load-step, with another program.
fn controller(axis: Axis, program: &str) -> AxisController {
    let program = crate::shipped(&format!("controller/programs/{program}.toml"));
    let further = [format!("--{}-program", axis.name()), program.display().to_string()];
    crate::controller(axis, &crate::shipped("controller/experiments/load-step.toml"), true, &further)
}

#[derive(Clone, Debug)]
enum Stimulus {
    Nothing,
    Rig(RigStatus),
    Partner(ChainStatus, ChainValues),
    Stop(Frame),
    Console(Frame),
    Parameter(usize, f64),
    Skipped(u64),
    Restart,
}

fn sensors() -> impl Strategy<Value = Sensors> {
    (0.0..=0.5_f64, -2000.0..=2000.0_f64, 0.0..=1e6_f64, 0.0..=1e6_f64).prop_map(
        |(position_m, force_n, pressure_a_pa, pressure_b_pa)| Sensors {
            position_m,
            force_n,
            pressure_a_pa,
            pressure_b_pa,
            alive: 0,
        },
    )
}

fn main_state() -> impl Strategy<Value = MainChainState> {
    (0..10_u8).prop_map(|raw| MainChainState::from_raw(raw).expect("there are ten"))
}

fn stimulus() -> impl Strategy<Value = Stimulus> {
    let rig = (0.0..=1e6_f64, any::<[bool; 3]>()).prop_map(|(supply_pressure_pa, [linked, stop, shut])| {
        Stimulus::Rig(RigStatus {
            supply_pressure_pa,
            linked,
            emergency_stop: stop,
            check_valves_shut: shut,
            ..RigStatus::default()
        })
    });
    let partner = (main_state(), any::<bool>(), 0..4_u8, 0.0..=0.5_f64).prop_map(
        |(main_chain, ok, repetition, averaged_position_m)| {
            let status = ChainStatus { main_chain, ok, repetition, experiment: 9, ..ChainStatus::default() };
            Stimulus::Partner(status, ChainValues { averaged_position_m, ..ChainValues::default() })
        },
    );
    let stop =
        any::<bool>().prop_map(|release| EmergencyStop { reason: EmergencyStopReason::Operator, release });
    let stops = prop_oneof![
        stop.clone().prop_map(Frame::ConsoleEmergencyStop),
        stop.clone().prop_map(Frame::DriveEmergencyStop),
        stop.clone().prop_map(Frame::LoadEmergencyStop),
        stop.prop_map(Frame::RigEmergencyStop),
    ];
    let console = any::<bool>().prop_map(|start| {
        let command = if start { RunControlCommand::Start } else { RunControlCommand::Abort };
        Frame::RunControl(RunControl { command, experiment: 0 })
    });
    prop_oneof![
        20 => Just(Stimulus::Nothing),
        4 => rig,
        8 => partner,
        1 => stops.prop_map(Stimulus::Stop),
        1 => console.prop_map(Stimulus::Console),
        4 => (0..100_usize, 0.0..=1.0_f64).prop_map(|(place, share)| Stimulus::Parameter(place, share)),
        1 => (1..2000_u64).prop_map(Stimulus::Skipped),
        1 => Just(Stimulus::Restart),
    ]
}

/// A partner that goes along, so that the axis gets somewhere.
fn echo_partner(controller: &mut AxisController, answer: &Answer) {
    let Some(status) = answer.status else { return };
    let status = ChainStatus { ok: true, ..status };
    controller.receive(&match controller.axis {
        Axis::Drive => Frame::LoadChainStatus(status),
        Axis::Load => Frame::DriveChainStatus(status),
    });
}

fn check(answer: &Answer, controller: &AxisController) -> Result<(), TestCaseError> {
    use MainChainState::{Aborted, Fault, WaitingForRig};
    let command = answer.command;
    prop_assert!(command.opening.is_finite() && command.opening.abs() <= 1.0, "{command:?}");
    let without_control = matches!(controller.state(), WaitingForRig | Aborted | Fault)
        || controller.emergency_stop() != EmergencyStopChainState::Ready
        || controller.algorithm_fault().is_some();
    prop_assert!(!without_control || !command.enable, "{:?} and {command:?}", controller.state());
    prop_assert!(command.enable || command.opening == 0.0, "{command:?}");
    // What goes out fits the wire.
    for frame in [
        Frame::DriveValveCommand(command),
        Frame::DriveChainStatus(answer.status.unwrap_or_default()),
        Frame::DriveChainValues(answer.values.unwrap_or_default()),
    ] {
        prop_assert!(frame.encode().is_ok(), "{frame:?}");
    }
    Ok(())
}

fn drive_through(
    mut controller: AxisController,
    stimuli: &[(Sensors, Stimulus)],
    goes_along: bool,
) -> Result<(), TestCaseError> {
    let mut cycle = 0;
    let mut rig = Some(RigStatus { supply_pressure_pa: 7e5, linked: true, ..RigStatus::default() });
    for (sensors, stimulus) in stimuli {
        match stimulus {
            Stimulus::Nothing => {}
            Stimulus::Rig(status) => rig = Some(*status),
            Stimulus::Partner(status, values) => {
                for axis_frame in [
                    Frame::DriveChainStatus(*status),
                    Frame::LoadChainStatus(*status),
                    Frame::DriveChainValues(*values),
                    Frame::LoadChainValues(*values),
                ] {
                    controller.receive(&axis_frame);
                }
            }
            Stimulus::Stop(frame) | Stimulus::Console(frame) => controller.receive(frame),
            Stimulus::Parameter(place, share) => {
                let program = &mut controller.program;
                let place = place % program.variables().len();
                let parameter = &program.variables()[place].parameter;
                let value = parameter.least + share * (parameter.most - parameter.least);
                let value = if parameter.whole { value.round() } else { value };
                prop_assert!(program.set(place, value).is_ok());
            }
            Stimulus::Skipped(cycles) => cycle += cycles,
            Stimulus::Restart => {
                controller.restart();
                (cycle, rig) = (0, None);
            }
        }
        // A rest of ten cycles each, so that time-outs and filters see more than noise.
        for _ in 0..10 {
            let answer = controller.answer(cycle, sensors, rig.as_ref());
            check(&answer, &controller)?;
            if goes_along {
                echo_partner(&mut controller, &answer);
            }
            cycle += 1;
        }
        rig = rig.or(Some(RigStatus { supply_pressure_pa: 7e5, linked: true, ..RigStatus::default() }));
    }
    Ok(())
}

// About sixteen sequences of inputs for each of five programs.
proptest! {
    #![proptest_config(ProptestConfig { cases: 80, ..ProptestConfig::default() })]

    #[test]
    fn a_position_axis_keeps_its_valve_in_range_and_shut_without_control(
        program in prop::sample::select(programs(Quantity::Position)),
        goes_along in any::<bool>(),
        stimuli in prop::collection::vec((sensors(), stimulus()), 1..120),
    ) {
        drive_through(controller(Axis::Drive, &program), &stimuli, goes_along)?;
    }

    #[test]
    fn a_force_axis_keeps_its_valve_in_range_and_shut_without_control(
        program in prop::sample::select(programs(Quantity::Force)),
        goes_along in any::<bool>(),
        stimuli in prop::collection::vec((sensors(), stimulus()), 1..120),
    ) {
        drive_through(controller(Axis::Load, &program), &stimuli, goes_along)?;
    }
}

/// The drive under a partner that goes along, with its carriage held at `position_m`; openings from cycle `from` on.
fn held_at(position_m: f64, from: u64, until: u64) -> Vec<f64> {
    let mut controller = controller(Axis::Drive, "position-cascade");
    let rig = RigStatus { supply_pressure_pa: 7e5, linked: true, ..RigStatus::default() };
    let mut openings = Vec::new();
    for cycle in 0..until {
        let sensors = Sensors {
            position_m: if cycle < from { 0.1 } else { position_m },
            pressure_a_pa: 4e5,
            pressure_b_pa: 4e5,
            ..Sensors::default()
        };
        let answer = controller.answer(cycle, &sensors, Some(&rig));
        echo_partner(&mut controller, &answer);
        openings.push(answer.command.opening);
    }
    openings
}

#[test]
fn the_random_inputs_reach_control_and_not_only_faults() {
    // The experiment begins with a rest at 0.1 m: with the carriage held there all goes its way, and held away the valve opens.
    let openings = held_at(0.09, 2300, 2600);
    assert!(openings[2310..].iter().all(|opening| *opening > 0.0), "{:?}", &openings[2300..2330]);
}
